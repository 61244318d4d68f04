/* Coverage of the cells of a grid by a convex polygon: exact areas and first moments. */
#ifndef BST_SATELLITE_POLYGON_COVERAGE_H
#define BST_SATELLITE_POLYGON_COVERAGE_H

#include "boresight/status.h"
#include "sim/satellite/polygon_clip.h"

/* Corners of a polygon that bst_polygon_coverage_add accepts. */
enum { BST_COVERAGE_CORNERS_MAX = 2048 };

/* Coverage of one cell, or of `run` cells in a row that are covered as a whole. Cell (x, y) reaches
 * from (x, y) to (x + 1, y + 1). */
typedef struct bst_coverage_cell {
    int x, y, run;
    double area;               /* covered fraction */
    double moment_x, moment_y; /* integrals of the distance from the cell's centre over it */
    int first, count;          /* corners of the part within the cell; 0: the cell's own */
} bst_coverage_cell;

/* Growing list of covered cells: zero-initialise, free with bst_polygon_coverage_free; empty it
 * with bst_polygon_coverage_clear to use it again. */
typedef struct bst_polygon_coverage {
    bst_coverage_cell *cells;
    bst_point2 *corners; /* counter-clockwise, about the cell's centre */
    int count, capacity, corner_count, corner_capacity;
} bst_polygon_coverage;

/* Frees the memory of a list. */
void bst_polygon_coverage_free(bst_polygon_coverage *list);
/* Empties a list and keeps its memory. */
void bst_polygon_coverage_clear(bst_polygon_coverage *list);

/* Appends the cells that a convex polygon covers, row by row, from left to right.
 *
 * Given:     corners        [count] in cells, either orientation
 *            width, height  of the grid; what lies outside is left out
 * Errors:    BST_ERR_MEMORY */
bst_status bst_polygon_coverage_add(bst_ctx *ctx, bst_polygon_coverage *list,
                                    const bst_point2 *corners, int count, int width,
                                    int height) BST_MUST_CHECK;

#endif
