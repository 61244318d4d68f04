/* Database of star patterns for identification without an attitude. */
#ifndef BST_IMGPROC_IDENTIFY_STAR_PATTERNS_H
#define BST_IMGPROC_IDENTIFY_STAR_PATTERNS_H

#include <stdint.h>

#include "imgproc/identify/star_quad.h"
#include "sim/catalogue/stars.h"

/* Quads of the locally brightest stars of the whole sky, in a hash table over their codes.
 * Immutable after its creation. */
typedef struct bst_star_patterns bst_star_patterns;

typedef struct bst_star_patterns_options {
    double field_rad;   /* shorter side of the camera's field, 0.003 to 0.8 rad */
    double v_limit;     /* faintest V that the camera sees */
    double julian_year; /* epoch for proper motion */
} bst_star_patterns_options;

/* Builds the database.
 *
 * Of the catalogue's stars those are kept that have fewer than a fixed number of brighter kept ones
 * about them, so that every field holds about a dozen. Each kept star forms quads with its nearest
 * neighbours.
 *
 * Given:     stars  not needed after the call
 * Errors:    BST_ERR_ARGUMENT for a field out of range, BST_ERR_MEMORY, those of the catalogue
 * Ownership: free *out with bst_star_patterns_free */
bst_status bst_star_patterns_create(bst_ctx *ctx, const bst_stars *stars,
                                    const bst_star_patterns_options *options,
                                    bst_star_patterns **out) BST_MUST_CHECK;
/* Frees a database; NULL is allowed. */
void bst_star_patterns_free(bst_star_patterns *patterns);

/* Size of a database. */
typedef struct bst_star_patterns_info {
    int stars;           /* kept */
    int64_t patterns;    /* quads */
    double depth_v_mag;  /* faintest V that was considered */
    double stars_per_sr; /* mean density of catalogue stars down to that */
    int64_t bytes;
} bst_star_patterns_info;
/* Reads the size of a database. */
void bst_star_patterns_get_info(const bst_star_patterns *patterns, bst_star_patterns_info *out);

/* A pattern of the database that agrees with a quad: catalogue directions of A, B, C and D. */
typedef struct bst_star_patterns_match {
    bst_vec3 icrs[4];
    double size_ratio; /* size of the pattern over that of the quad */
} bst_star_patterns_match;

/* Patterns whose code agrees with a quad's.
 *
 * Given:     tolerance      largest difference of each of the four numbers of the code
 *            scale_tolerance  largest relative difference of the sizes
 *            capacity       most matches to write
 * Returned:  the number of matches in all */
int bst_star_patterns_find(const bst_star_patterns *patterns, const bst_star_quad *quad,
                           double tolerance, double scale_tolerance, bst_star_patterns_match *out,
                           int capacity);

#endif
