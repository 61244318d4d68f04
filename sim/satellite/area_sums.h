/* Light of polygons by cell, as sums over their edges: exact areas with first and second moments.
 * Internal to sim/satellite. */
#ifndef BST_SATELLITE_AREA_SUMS_H
#define BST_SATELLITE_AREA_SUMS_H

#include "sim/satellite/resolved_image.h"

/* What edges add: to a cell, and by row_... to all cells to its right. Light and its first moments:
 * about the cell's centre, of a row about its middle. */
typedef struct bst_area_cell {
    double row_light;
    float row_y, light, x, y;
} bst_area_cell;

/* Second moments, less those of the same light spread evenly over the cell. */
typedef struct bst_area_second {
    float row_yy, xx, xy, yy;
} bst_area_second;

/* An edge that stays within the grid without its last column and row, a.y < b.y. */
typedef struct bst_area_edge {
    bst_point2 a, b;
    double slope, steep, light; /* of x over y; of y over x; of a cell */
} bst_area_edge;

/* A grid of sums; zero-initialise, free with bst_area_sums_free. */
typedef struct bst_area_sums {
    bst_area_cell *cells;    /* [height][width + 1], from the column before the first one on */
    bst_area_second *second; /* likewise */
    int width, height;
    size_t capacity;
    /* adds such an edge on this processor: [0] without second moments */
    void (*add_inner[2])(struct bst_area_sums *sums, const bst_area_edge *edge);
} bst_area_sums;

/* Frees the memory. */
void bst_area_sums_free(bst_area_sums *sums);

/* Starts sums without light. BST_ERR_MEMORY. */
bst_status bst_area_sums_begin(bst_ctx *ctx, bst_area_sums *sums, int width,
                               int height) BST_MUST_CHECK;

/* Adds an edge. The sum over the edges of a polygon, clockwise with x to the right and y up, is its
 * light.
 *
 * Given:     a, b   ends, in cells; the corner of cell (0, 0) is the origin
 *            light  of a cell that the polygon covers */
void bst_area_sums_edge(bst_area_sums *sums, bst_point2 a, bst_point2 b, double light);

/* Adds an edge between surfaces of almost the same light without its second moments: with the
 * difference d of their light, those of a cell are wrong by at most 0.016 d. */
void bst_area_sums_faint_edge(bst_area_sums *sums, bst_point2 a, bst_point2 b, double light);

/* Adds a polygon, counter-clockwise. */
void bst_area_sums_polygon(bst_area_sums *sums, const bst_point2 *corners, int count, double light);

/* Adds other sums of the same size, from one row on and before another. */
void bst_area_sums_add(bst_area_sums *to, const bst_area_sums *from, int first, int end);

/* Sets light and moments of an image of the same size, with the second ones.
 *
 * Given:     cell_rad  see bst_visible_surface_resolve */
void bst_area_sums_finish(const bst_area_sums *sums, double cell_rad, bst_resolved_image *image);

#endif
