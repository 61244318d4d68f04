/* Index over the sky cells of a catalogue, in memory: which cells may have stars in a cone.
 *
 * Each cell has a cap that contains its stars, and the magnitude of its brightest star. Cells with
 * consecutive numbers are neighbours: 32 of them have a common cap, and 32 of these groups as well.
 * 32 caps that belong together lie together, and the compiler tests several of them at once. */
#ifndef BST_CATALOGUE_CELL_INDEX_H
#define BST_CATALOGUE_CELL_INDEX_H

#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"
#include "sim/catalogue/star_index.h"

/* Caps per cap of the next level */
#define BST_CELL_BRANCHES 32u

/* Caps that have a common one in the next level; the last ones of a level may be empty. */
typedef struct bst_cell_block {
    float x[BST_CELL_BRANCHES]; /* centre; beyond all reach if the cap has no stars */
    float y[BST_CELL_BRANCHES];
    float z[BST_CELL_BRANCHES];
    float radius[BST_CELL_BRANCHES];      /* chord that contains the stars at J2000, rad */
    float motion[BST_CELL_BRANCHES];      /* largest proper motion, rad/yr */
    int32_t brightest[BST_CELL_BRANCHES]; /* V of the brightest star, 1e-5 mag */
} bst_cell_block;

enum { BST_CELL_LEVELS = 3 }; /* cells, groups, regions */

typedef struct bst_cell_index {
    bst_cell_block *level[BST_CELL_LEVELS]; /* [blocks[k]]; one allocation */
    uint32_t blocks[BST_CELL_LEVELS];
} bst_cell_index;

/* A cone of the sky in which cells are searched. */
typedef struct bst_cell_cone {
    bst_vec3 centre;   /* unit, ICRS axes */
    double radius_rad; /* with all from where stars may enter but proper motion */
    double years;      /* of proper motion, 0 or more */
    int32_t faintest;  /* V of the faintest stars that count, 1e-5 mag */
} bst_cell_cone;

/* Where a search is: the groups and cells that are still to be visited. */
typedef struct bst_cell_search {
    const bst_cell_index *index;
    float centre[3], reach, years;
    int32_t faintest;
    uint32_t block[BST_CELL_LEVELS]; /* whose caps are visited */
    uint32_t hits[BST_CELL_LEVELS];  /* bit i: cap i of it is to be visited */
} bst_cell_search;

/* Builds the index of a catalogue's cells; free *out with bst_cell_index_free. BST_ERR_MEMORY. */
bst_status bst_cell_index_create(bst_ctx *ctx, const bst_star_view *view,
                                 bst_cell_index **out) BST_MUST_CHECK;

/* Frees an index; NULL is allowed. */
void bst_cell_index_free(bst_cell_index *index);

/* Begins a search. */
void bst_cell_search_begin(const bst_cell_index *index, const bst_cell_cone *cone,
                           bst_cell_search *search);

/* Next cells, by ascending number, that may have stars in the cone that are not fainter than its
 * limit. No cell with such a star is missed; a cell without one may be among them.
 *
 * Given:     room    at least BST_CELL_BRANCHES
 * Returned:  cells   [room]
 *            their number; 0: there are no more */
uint32_t bst_cell_search_next(bst_cell_search *search, uint32_t *cells, uint32_t room);

#endif
