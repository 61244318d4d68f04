/* Statistical stars: stars fainter than the catalogue's limit, drawn by position from the table of
 * star counts, and the integrated light of still fainter ones.
 *
 * The sky is a function of its seed alone: every star belongs to a cell of the sky and a bin of
 * magnitude, and is made from (seed, cell, bin, number). It does not depend on observer, time,
 * depth or order of queries: overlapping queries give the same stars, and a deeper limit only adds
 * stars. The catalogue only decides which stars are kept: see bst_faint_sky_create. */
#ifndef BST_CATALOGUE_FAINT_STARS_H
#define BST_CATALOGUE_FAINT_STARS_H

#include "sim/catalogue/star_counts.h"
#include "sim/catalogue/stars.h"

/* faintest magnitude of single statistical stars, V */
#define BST_FAINT_LIMIT_V 21

/* identity bit of statistical stars; identities of a catalogue's stars are below it */
#define BST_FAINT_ID_BIT 0x80000000u

/* default seed of the statistical stars */
#define BST_FAINT_SEED 0x5ca1ab1edeadbeefULL

/* The statistical sky; immutable, shareable between threads. */
typedef struct bst_faint_sky bst_faint_sky;

/* A user's bounded cache of cells of the statistical sky. One thread at a time. */
typedef struct bst_faint_stars bst_faint_stars;

/* Creates the statistical sky that completes `stars` (borrowed for the call).
 *
 * Notes:     Where the catalogue is complete (Tycho-2 alone: at most to V 11) there
 *            are no statistical stars. Beyond, a statistical star is kept with probability 1 -
 *            catalogue / table, at least 0, by zone of the sky (432 of 95 square degrees, and each
 *            patch of the catalogue) and quarter of a magnitude: catalogue and statistical stars
 *            together follow the table. */
bst_status bst_faint_sky_create(bst_ctx *ctx, const bst_stars *stars, uint64_t seed,
                                bst_faint_sky **out) BST_MUST_CHECK;
/* Frees the statistical sky; NULL is allowed. */
void bst_faint_sky_free(bst_faint_sky *sky);

/* Integrated light of statistical stars fainter than v_limit towards `icrs` (unit), in units of one
 * star of V = 0 per steradian. */
double bst_faint_sky_unresolved(const bst_faint_sky *sky, bst_vec3 icrs, double v_limit);

/* Integrated light of all stars that are not rendered towards `icrs`: statistical stars fainter
 * than faint_limit (-INFINITY: all) and catalogue stars fainter than v_limit, by the table of star
 * counts; stars of V = 0 per steradian. */
double bst_faint_sky_undrawn(const bst_faint_sky *sky, bst_vec3 icrs, double v_limit,
                             double faint_limit);

/* Creates a cache for `sky`, which must outlive it. It holds up to cache_stars stars (40 bytes
 * each), more only if a single query needs them. */
bst_status bst_faint_stars_create(bst_ctx *ctx, const bst_faint_sky *sky, int cache_stars,
                                  bst_faint_stars **out) BST_MUST_CHECK;
/* Frees a cache of faint stars; NULL is allowed. */
void bst_faint_stars_free(bst_faint_stars *faint);

/* Finds the statistical stars within radius_rad (0 to pi) of `centre` (unit, ICRS) not fainter than
 * v_limit (at most BST_FAINT_LIMIT_V), by cell. They have neither proper motion nor colour (NAN).
 * Writes at most `capacity` stars; *count: number of all. Allocates for cells on their first use.
 * BST_ERR_ARGUMENT; BST_ERR_MEMORY. */
bst_status bst_faint_stars_query(bst_ctx *ctx, bst_faint_stars *faint, bst_vec3 centre,
                                 double radius_rad, double v_limit, bst_star *out, int capacity,
                                 int *count) BST_MUST_CHECK;

#endif
