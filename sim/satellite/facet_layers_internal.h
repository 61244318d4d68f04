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

/* How borders of layers are about a facet. */
typedef enum bst_layers_cross {
    BST_LAYERS_CROSS_NONE,
    BST_LAYERS_CROSS_TOUCHING,
    BST_LAYERS_CROSS_BEHIND, /* some cross it, all of them behind it: not looked for if no other
                                facet crosses it (`apart`) */
    BST_LAYERS_CROSS_BEFORE  /* some cross it and may be nearer */
} bst_layers_cross;

/* Values of `known`: nothing hides any of the facet, or others hide all of it; no border before it
 * touches it. */
enum { BST_LAYERS_KNOWN_ALL = 1, BST_LAYERS_KNOWN_NOTHING = 2 };

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

/* Finds whether a border crosses the inside of a facet.
 *
 * Given:     own, plane  of the facet, see bst_facet_layers_plane */
bst_layers_cross bst_facet_borders_cross(const bst_facet_layers *layers, const bst_layers_box *box,
                                         const bst_layers_outline *own, const double plane[3]);

/* True if a border crosses or touches another one elsewhere than in a common end: the number of
 * layers on its sides changes there. */
bool bst_facet_borders_meet(const bst_facet_layers *layers, int border);

/* How a border is about a convex polygon: it touches it, at most, if it is neither apart nor
 * crosses it. */
typedef enum bst_layers_place {
    BST_LAYERS_PLACE_APART,
    BST_LAYERS_PLACE_TOUCHING,
    BST_LAYERS_PLACE_CROSSING
} bst_layers_place;

/* Finds the part of a border a-b within a polygon, counter-clockwise: from t[0] to t[1] along it,
 * if it crosses it. */
bst_layers_place bst_facet_borders_part(const bst_point2 *points, int count, bst_point2 a,
                                        bst_point2 b, double t[2]);

/* Lists the borders across the inside of a facet that may hide a part of it, each once.
 *
 * Given:     own, plane  see bst_facet_borders_cross
 * Returned:  out[room]; their number is the return value; below 0: there are more */
int bst_facet_borders_before(const bst_facet_layers *layers, const bst_layers_box *box,
                             const bst_layers_outline *own, const double plane[3], int *out,
                             int room);

/* What of a facet is seen. */
typedef enum bst_layers_seen {
    BST_LAYERS_SEEN_ALL,
    BST_LAYERS_SEEN_NOTHING,
    BST_LAYERS_SEEN_PIECES, /* those in layers->clip */
    BST_LAYERS_SEEN_UNKNOWN
} bst_layers_seen;

/* Finds the visibility of a place of a facet. Unknown: another facet is as near, or the place is
 * off the grid. */
bst_layers_seen bst_facet_layers_point_visibility(const bst_facet_layers *layers,
                                                  const bst_layers_box *box, const double plane[3],
                                                  bst_point2 place);
/* True if all of a facet is on the grid. */
bool bst_facet_layers_is_within(const bst_facet_layers *layers, int facet);
/* True if a facet covers a place; its border does. */
bool bst_facet_layers_covers(const bst_facet_layers *layers, int facet, bst_point2 place);
/* Splits a facet that no other one crosses along the borders before it (facet_split.c). Unknown:
 * too many of them, or see above. */
bst_layers_seen bst_facet_layers_split(bst_facet_layers *layers, const bst_layers_box *box,
                                       const bst_layers_outline *own, const double plane[3]);

/* Number of layers at a place within a facet; below 0: it reaches the middle of no row. */
int bst_facet_borders_layers(const bst_facet_layers *layers, const bst_layers_outline *own);

#endif
