/* Internal functions of the gravity field: built-in table and creation. */
#ifndef BST_ASTRO_GRAVITY_INTERNAL_H
#define BST_ASTRO_GRAVITY_INTERNAL_H

#include "sim/astro/gravity.h"

/* The built-in table (gravity_table.c): C and S by degree, then order. */
extern const double bst_gravity_table_gm_m3ps2, bst_gravity_table_radius_m;
extern const double bst_gravity_table[][2];

/* Index of degree n, order m in a coefficient table. */
static inline size_t bst_gravity_index(int n, int m) {
    return (size_t)n * (size_t)(n + 1) / 2 + (size_t)m;
}

/* Creates a field from fully normalised coefficients cs[bst_gravity_index(n, m)] = {C, S}, which
 * are copied. */
bst_status bst_gravity_make(bst_ctx *ctx, double gm_m3ps2, double radius_m, int degree, int order,
                            const double (*cs)[2], bst_gravity **out) BST_MUST_CHECK;

#endif
