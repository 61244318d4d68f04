/* Earth orientation, and rotations between TEME, GCRF and ITRF. */
#ifndef BST_ASTRO_FRAMES_H
#define BST_ASTRO_FRAMES_H

#include <stdbool.h>

#include "boresight/vec.h"
#include "sim/astro/time.h"

/* Table of Earth orientation parameters; immutable, shareable between threads. */
typedef struct bst_astro_eop bst_astro_eop;

typedef struct bst_astro_eop_values {
    double ut1_minus_utc_s;
    double xp_rad, yp_rad; /* coordinates of the pole */
} bst_astro_eop_values;

/* Creates the built-in table: IERS EOP 20 C04, 2020-01-01 to 2026-01-01, 0h UTC. Free it with
 * bst_astro_eop_free. */
bst_status bst_astro_eop_builtin(bst_ctx *ctx, bst_astro_eop **out) BST_MUST_CHECK;
/* Reads an IERS EOP C04 file, of the 20 C04 series (hour column) or the 14 C04 series (none). Rows
 * are one a day at 0h UTC, without gaps; at most 64 MiB. Errors carry file and line number. */
bst_status bst_astro_eop_load(bst_ctx *ctx, const char *path, bst_astro_eop **out) BST_MUST_CHECK;
/* Reads a table of Earth orientation from memory; `name`: file name for messages. */
bst_status bst_astro_eop_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                     bst_astro_eop **out) BST_MUST_CHECK;
void bst_astro_eop_free(bst_astro_eop *eop); /* NULL allowed */
/* Values at t: linear interpolation between 0h UTC values, leap seconds handled; no sub-daily
 * tides. After the table, for BST_EOP_PREDICTED_YEARS years, they are predicted from it
 * (bst_astro_eop_uncertainty_at). Before it and after those years: BST_ERR_RANGE naming the dates.
 */
bst_status bst_astro_eop_at(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                            bst_astro_eop_values *out) BST_MUST_CHECK;
enum { BST_EOP_PREDICTED_YEARS = 30 };

/* Uncertainty of predicted Earth orientation: 2.5 times the RMS error of past predictions, which
 * covers at least 95 % of them. Unannounced leap seconds are excluded: they change UT1-UTC and UTC
 * by whole seconds, but not the orientation of the Earth at an instant of TAI. */
typedef struct bst_astro_eop_uncertainty {
    double days;        /* after the table's last row */
    double ut1_s;       /* 1 s of UT1 is 15 arcsec of Earth rotation */
    double pole_arcsec; /* per axis */
} bst_astro_eop_uncertainty;
/* Uncertainty of Earth orientation at t. False (all 0) within or before the table. */
bool bst_astro_eop_uncertainty_at(const bst_astro_eop *eop, bst_time t,
                                  bst_astro_eop_uncertainty *out);
/* Logs a warning with the uncertainty at `last` if it is after the table; `where`: prefix ("file:
 * "). */
void bst_astro_eop_warn(bst_ctx *ctx, const bst_astro_eop *eop, bst_time last, const char *where);

/* Rotations at one instant, for positions and velocities alike. The frames TEME and GCRF turn
 * against each other by 8e-12 rad/s, which velocities leave out (0.3 mm/s at a geostationary
 * distance); for the turn of ITRF see bst_astro_earth_rate_gcrf. */
typedef struct bst_astro_earth_frames {
    bst_mat3 gcrf_from_teme;
    bst_mat3 itrf_from_gcrf;
} bst_astro_earth_frames;

/* Rotations at t, by the chain that astropy uses: TEME - Greenwich mean sidereal time of 1982 -
 * Earth rotation angle - IAU 2006/2000A celestial intermediate pole and origin (eraC2i06a) - GCRF;
 * GCRF - the same pole, Earth rotation angle - TIO locator and polar motion - ITRF. The IERS's
 * celestial pole offsets (below 0.5 mas, 0.1 m at a geostationary distance) are left out, as there.
 * Errors as bst_astro_eop_at. About 50 us: callers that need many instants use
 * sim/astro/sky_clock.h. Source: IERS Conventions (2010) chapter 5; Vallado et al., AIAA 2006-6753,
 * for TEME. */
bst_status bst_astro_earth_frames_at(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                                     bst_astro_earth_frames *out) BST_MUST_CHECK;

/* Earth rotation vector, rad/s, GCRF axes: a point fixed in ITRF at r has GCRF velocity rate x r.
 * Along the celestial intermediate pole, nominal rate of the Earth rotation angle. */
bst_vec3 bst_astro_earth_rate_gcrf(const bst_astro_earth_frames *frames);

#endif
