/* The star catalogue: a memory-mapped file with a sky index, or the embedded stars. */
#ifndef BST_CATALOGUE_STARS_H
#define BST_CATALOGUE_STARS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"

/* A star in the result of a query. */
typedef struct bst_star {
    bst_vec3 icrs;   /* unit vector, ICRS axes, from the query's observer at its epoch */
    float v_mag;     /* Johnson V, at the query's epoch */
    float b_minus_v; /* Johnson B-V; NAN: unknown */
    uint32_t id;     /* Tycho-2 identity, see bst_star_id_make; or BST_STAR_TABLE_ID and more */
} bst_star;

/* Identities of stars of a user's table: this and the star's number in the catalogue, from 0. */
#define BST_STAR_TABLE_ID 0x40000000u
#define BST_STAR_TABLE_IDS 0x40000000u

/* Tycho-2 identity TYC tyc1-tyc2-tyc3 in 30 bits, and back. Tycho-2 itself gives 254 identities to
 * both components of a double star (one in its main table, one in supplement 1). */
static inline uint32_t bst_star_id_make(unsigned tyc1, unsigned tyc2, unsigned tyc3) {
    return (uint32_t)(tyc1 << 16 | tyc2 << 2 | (tyc3 & 3u));
}
static inline void bst_star_id_split(uint32_t id, unsigned *tyc1, unsigned *tyc2, unsigned *tyc3) {
    *tyc1 = id >> 16;
    *tyc2 = id >> 2 & 0x3FFFu;
    *tyc3 = (id & 3u) ? (id & 3u) : 4u;
}

/* An open catalogue; immutable, shareable between threads. */
typedef struct bst_stars bst_stars;

typedef struct bst_stars_info {
    char source[64];          /* "Tycho-2" or "embedded default" */
    char path[512];           /* "" when embedded */
    long long count;          /* stars */
    double complete_to_v_mag; /* of the whole sky */
    int patches;              /* caps with fainter stars, see bst_stars_patch */
    long long table_count;    /* of them, stars of a user's table that Tycho-2 lacks */
    long long variable_count; /* variable stars */
    bool has_parallax;        /* stars may have parallaxes */
    bool embedded;
} bst_stars_info;

/* Opens a catalogue: "embedded"; "default" (the user's full catalogue, else the embedded one with a
 * warning); or a path. The file's checksum is verified. Close *out with bst_stars_close.
 * BST_ERR_NOT_FOUND: no such file; BST_ERR_FORMAT: no catalogue, truncated or damaged. */
bst_status bst_stars_open(bst_ctx *ctx, const char *name, bst_stars **out) BST_MUST_CHECK;

/* Creates another handle of an open catalogue, which must be closed last. */
bst_status bst_stars_share(bst_ctx *ctx, const bst_stars *stars, bst_stars **out) BST_MUST_CHECK;

/* Closes a catalogue; NULL is allowed. */
void bst_stars_close(bst_stars *stars);

/* Description of a catalogue: source, number of stars, completeness. */
void bst_stars_get_info(const bst_stars *stars, bst_stars_info *out);

/* Patch number `index` (0 to info.patches - 1): centre (unit, ICRS), radius (rad), and V to which
 * it is complete. */
void bst_stars_patch(const bst_stars *stars, int index, bst_vec3 *centre, double *radius_rad,
                     double *v_mag);

/* V to which the catalogue is complete in the cone of radius_rad around `centre` (unit, ICRS): the
 * whole sky's limit, or that of a single patch that contains the cone. */
double bst_stars_complete_to(const bst_stars *stars, bst_vec3 centre, double radius_rad);

/* Path of the user's full catalogue, existing or not: tycho2.stars in $XDG_DATA_HOME/boresight or
 * ~/.local/share/boresight. BST_ERR_NOT_FOUND: neither variable is set; BST_ERR_ARGUMENT: buffer
 * too small. */
bst_status bst_stars_default_path(bst_ctx *ctx, char *buffer, size_t bytes) BST_MUST_CHECK;

/* Time of a query, and where the observer is. */
typedef struct bst_star_epoch {
    double julian_year; /* TT or TDB, for example 2022.46 */
    bst_vec3 sun_m; /* observer to the Sun's centre (bst_light.sun_m), ICRS axes; zero: seen from
                       the solar-system barycentre */
} bst_star_epoch;

/* A cone of the sky, seen at an epoch. */
typedef struct bst_star_query {
    bst_vec3 centre; /* unit, ICRS axes */
    double radius_rad, v_limit;
    bst_star_epoch epoch;
} bst_star_query;

/* Stars within radius_rad (0 to pi) of `centre` (unit, ICRS) that are not fainter than v_limit,
 * with proper motion to the epoch, and as seen from the observer's place: with annual parallax,
 * before light deflection and aberration. Variable stars have the magnitude of the epoch, with the
 * light time from the barycentre. Writes at most `capacity` stars, in the
 * catalogue's order (by sky cell, brightest first in each, ties by identity), and returns in *count
 * how many there are in all (may exceed capacity: then those written are the first ones met and the
 * caller asks again with more room). `out` may be NULL when capacity is 0. No allocation.
 *
 * Motion is uniform along the great circle's tangent, without radial velocity: over 35 years
 * that is right to 1 mas but for the nearest stars, where the neglected change of perspective
 * grows to 0.7 arcsec (Barnard's star; all others under 0.2). Tycho-2 itself has no proper motion
 * for 5 % of its stars, those without a mean position (109,445) and Tycho-1's (13,082): they stay
 * where they were observed about 1991.5, fast ones such as Polaris, 61 Cygni and GJ 887 among them.
 */
bst_status bst_stars_query_seen(bst_ctx *ctx, const bst_stars *stars, const bst_star_query *query,
                                bst_star *out, int capacity, int *count) BST_MUST_CHECK;

/* As bst_stars_query_seen, from the barycentre: without parallax and light time. */
bst_status bst_stars_query(bst_ctx *ctx, const bst_stars *stars, bst_vec3 centre, double radius_rad,
                           double v_limit, double julian_year, bst_star *out, int capacity,
                           int *count) BST_MUST_CHECK;

/* Finds a star by identity (the brighter one if two share it); BST_ERR_NOT_FOUND. */
bst_status bst_stars_find_seen(bst_ctx *ctx, const bst_stars *stars, uint32_t id,
                               const bst_star_epoch *epoch, bst_star *out) BST_MUST_CHECK;

/* As bst_stars_find_seen, from the barycentre. */
bst_status bst_stars_find(bst_ctx *ctx, const bst_stars *stars, uint32_t id, double julian_year,
                          bst_star *out) BST_MUST_CHECK;

/* Julian year of queries `seconds` after an epoch: year itself in a catalogue without parallaxes
 * and variable stars, where proper motion within a run does not count. */
double bst_stars_year_after(const bst_stars *stars, double julian_year, double seconds);

/* What of a star changes with the observer's place and time. */
typedef struct bst_star_change {
    double parallax_mas; /* 0: not known */
    bool varies;         /* the rest holds only if true */
    double brightest_v_mag, faintest_v_mag;
    double period_d; /* 0: a light curve without a period */
    double epoch_jd; /* of phase 0: brightest, or of the light curve's zero; barycentric (TDB) */
    int points;      /* of the light curve; 0: a cosine */
} bst_star_change;

/* Parallax and variability of a star; all zero without, or for an identity that is not there. */
void bst_stars_change(const bst_stars *stars, uint32_t id, bst_star_change *out);

/* The table's own identity of a star (Gaia's source_id, for example); 0: the star is not of a
 * table, or the table has none. */
int64_t bst_stars_source(const bst_stars *stars, uint32_t id);

/* Errors of the onboard star catalogue; the error of a star follows from its identity and the
 * seed. */
typedef struct bst_star_errors_config {
    double missing_fraction, position_error_fraction, position_error_sigma_arcsec;
    uint64_t seed;
} bst_star_errors_config;

/* Creates a catalogue with errors: stars are missing or displaced. It shares the memory of `stars`,
 * which must outlive *out. */
bst_status bst_stars_with_errors(bst_ctx *ctx, const bst_stars *stars,
                                 const bst_star_errors_config *errors,
                                 bst_stars **out) BST_MUST_CHECK;

#endif
