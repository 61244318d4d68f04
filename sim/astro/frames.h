/* Earth orientation and the rotations between TEME, GCRF and ITRF. */
#ifndef BST_ASTRO_FRAMES_H
#define BST_ASTRO_FRAMES_H

#include "sim/astro/time.h"
#include "sim/core/vec.h"

/* Table of Earth-orientation parameters; immutable once made, shareable between threads. */
typedef struct bst_eop bst_eop;

typedef struct bst_eop_values {
    double ut1_minus_utc_s;
    double xp_rad, yp_rad; /* pole */
    double dx_rad, dy_rad; /* celestial pole offsets to IAU 2006/2000A */
} bst_eop_values;

/* Makes the table of the dates of the shipped scenarios that is part of the program. */
bst_status bst_eop_builtin(bst_ctx *ctx, bst_eop **out) BST_MUST_CHECK;
/* Reads an IERS EOP C04 file. Errors carry the line number. */
bst_status bst_eop_load(bst_ctx *ctx, const char *path, bst_eop **out) BST_MUST_CHECK;
void bst_eop_free(bst_eop *eop);
/* Values at t: linear interpolation, leap seconds handled. Outside the table: BST_ERR_RANGE naming
 * the dates covered. */
bst_status bst_eop_at(bst_ctx *ctx, const bst_eop *eop, bst_time t,
                      bst_eop_values *out) BST_MUST_CHECK;

/* Rotations at one instant. */
typedef struct bst_earth_frames {
    bst_mat3 gcrf_from_teme;
    bst_mat3 itrf_from_gcrf;
} bst_earth_frames;

/* Rotations at t (docs/conventions.md for the chain: GMST82(UT1), Earth rotation angle, CIO by
 * eraC2i06a, polar motion). About 100 us: callers that need many instants interpolate (see
 * sim/world). */
bst_status bst_earth_frames_at(bst_ctx *ctx, const bst_eop *eop, bst_time t,
                               bst_earth_frames *out) BST_MUST_CHECK;

/* GCRF velocity from an ITRF-fixed point and back need the Earth's rotation vector, rad/s in GCRF.
 */
bst_vec3 bst_earth_rate_gcrf(const bst_earth_frames *frames);

#endif
