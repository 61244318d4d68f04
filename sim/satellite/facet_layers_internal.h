/* Parts of facet_layers.h: grid of bins, borders of layers and outlines of facets. Internal to
 * sim/satellite. */
#ifndef BST_SATELLITE_FACET_LAYERS_INTERNAL_H
#define BST_SATELLITE_FACET_LAYERS_INTERNAL_H

#include "sim/satellite/facet_layers.h"

/* Side of a bin, in cells. */
enum { BST_LAYERS_BIN = 8 };

/* Values of `doubtful`, also marks of cells: several layers; borders are marked last. */
enum { BST_LAYERS_SEVERAL = 1, BST_LAYERS_AT_BORDER = 2 };

/* A facet in the view, counter-clockwise. */
typedef struct bst_layers_outline {
    bst_point2 p[BST_LAYERS_CORNERS_MAX];
    int count;
    double low[2], high[2], least, most; /* box, and nearness of the corners */
} bst_layers_outline;

/* Whether borders of layers cross a facet. */
typedef enum bst_layers_cross {
    BST_LAYERS_CROSS_NONE,
    BST_LAYERS_CROSS_BEHIND, /* all that do are behind it */
    BST_LAYERS_CROSS_BEFORE  /* some may be nearer */
} bst_layers_cross;

/* Column or row of a coordinate, within the grid. */
static inline int bst_layers_cell_of(double x, int count) {
    return x > 0.0 ? (x < count ? (int)x : count - 1) : 0;
}

/* Cells or bins of a box: first and last column, first and last row.
 *
 * Given:     size  of a bin, in cells */
static inline void bst_layers_range(const bst_facet_layers *l, const bst_layers_box *b, int size,
                                    int out[4]) {
    out[0] = bst_layers_cell_of((double)b->low[0], l->width) / size;
    out[1] = bst_layers_cell_of((double)b->high[0], l->width) / size;
    out[2] = bst_layers_cell_of((double)b->low[1], l->height) / size;
    out[3] = bst_layers_cell_of((double)b->high[1], l->height) / size;
}

/* Lists the borders of layers: edges of which one facet faces the view. BST_ERR_MEMORY. */
bst_status bst_facet_borders_list(bst_ctx *ctx, bst_facet_layers *layers) BST_MUST_CHECK;
/* Enters them in the bins. BST_ERR_MEMORY. */
bst_status bst_facet_borders_enter(bst_ctx *ctx, bst_facet_layers *layers) BST_MUST_CHECK;

/* Finds whether a border crosses the inside of a facet. One that touches it does not.
 *
 * Given:     own, plane  of the facet, see bst_facet_layers_plane */
bst_layers_cross bst_facet_borders_cross(const bst_facet_layers *layers, const bst_layers_box *box,
                                         const bst_layers_outline *own, const double plane[3]);

/* Number of layers at a place within a facet; below 0: it reaches the middle of no row. */
int bst_facet_borders_layers(const bst_facet_layers *layers, const bst_layers_outline *own);

#endif
