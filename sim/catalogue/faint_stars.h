/* The statistical sky: stars below the catalogue's limit, drawn by place from the table of star
 * counts, and the light of those fainter still.
 *
 * The sky is a function of its seed alone: every star belongs to a cell of the sky and a bin of
 * magnitude, and is made from (seed, cell, bin, number). It does not depend on who looks, when, how
 * deep or in which order: overlapping queries give the same stars, a deeper limit adds stars and
 * changes none. The catalogue only decides which of them are kept: see bst_faint_sky_create. */
#ifndef BST_CATALOGUE_FAINT_STARS_H
#define BST_CATALOGUE_FAINT_STARS_H

#include "sim/catalogue/star_counts.h"
#include "sim/catalogue/stars.h"

/* Faintest limit that single stars can be drawn to, V. */
#define BST_FAINT_LIMIT_V 21

/* Statistical stars have this bit set in their identity, which no star of Tycho-2 has (its
 * identities are below 2^30). */
#define BST_FAINT_ID_BIT 0x80000000u

/* Seed of the sky when the scenario gives none. */
#define BST_FAINT_SEED 0x5ca1ab1edeadbeefULL

/* The sky itself; immutable, shareable between threads. */
typedef struct bst_faint_sky bst_faint_sky;

/* One user's window on it: a bounded cache of the cells lately looked at. Not shareable between
 * threads. */
typedef struct bst_faint_stars bst_faint_stars;

/* Makes the sky that completes `stars` (borrowed for the call). Where the catalogue is complete (at
 * most to V 11, Tycho-2's limit) there are no statistical stars. Beyond, a statistical star is kept
 * with the probability 1 - catalogue / table, at least 0, by zone of the sky (432 of 95 square
 * degrees, and each patch of the catalogue by itself) and quarter of a magnitude: catalogue and
 * statistical stars together follow the table. */
bst_status bst_faint_sky_create(bst_ctx *ctx, const bst_stars *stars, uint64_t seed,
                                bst_faint_sky **out) BST_MUST_CHECK;
/* Frees the model of the faint sky; NULL is allowed. */
void bst_faint_sky_free(bst_faint_sky *sky);

/* Light of the statistical stars fainter than v_limit towards `icrs` (unit), in units of one star
 * of V = 0 per steradian. */
double bst_faint_sky_unresolved(const bst_faint_sky *sky, bst_vec3 icrs, double v_limit);

/* Light of all stars that are not drawn towards `icrs`: the statistical ones fainter than
 * faint_limit (-INFINITY: all) and those of the catalogue fainter than v_limit, by the table of
 * star counts; units as above. */
double bst_faint_sky_undrawn(const bst_faint_sky *sky, bst_vec3 icrs, double v_limit,
                             double faint_limit);

/* `sky` must outlive the window. The cache holds up to cache_stars stars (40 bytes each), and more
 * only where a single query needs more. */
bst_status bst_faint_stars_create(bst_ctx *ctx, const bst_faint_sky *sky, int cache_stars,
                                  bst_faint_stars **out) BST_MUST_CHECK;
/* Frees a cache of faint stars; NULL is allowed. */
void bst_faint_stars_free(bst_faint_stars *faint);

/* Statistical stars within radius_rad (0 to pi) of `centre` (unit, ICRS) that are not fainter than
 * v_limit (at most BST_FAINT_LIMIT_V; a fainter one is taken as that), by cell. They have no proper
 * motion and no colour (NAN). Writes at most `capacity` and returns in *count how many there are in
 * all. Allocates while cells are looked at for the first time. BST_ERR_ARGUMENT; BST_ERR_MEMORY. */
bst_status bst_faint_stars_query(bst_ctx *ctx, bst_faint_stars *faint, bst_vec3 centre,
                                 double radius_rad, double v_limit, bst_star *out, int capacity,
                                 int *count) BST_MUST_CHECK;

#endif
