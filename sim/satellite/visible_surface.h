/* What is visible in each cell of an image: fragments of surfaces from front to back. Internal to
 * sim/satellite. */
#ifndef BST_SATELLITE_VISIBLE_SURFACE_H
#define BST_SATELLITE_VISIBLE_SURFACE_H

#include "sim/satellite/resolved_image.h"

/* The part of a facet within a cell. Areas in cells, moments about the cell's centre in cells. */
typedef struct bst_surface_fragment {
    float depth_m;              /* of its middle: behind the body's origin, along the boresight */
    float reach_m;              /* its depths differ from that by up to this */
    float area, area_x, area_y; /* and its first moments */
    float light, light_x, light_y; /* light of the whole fragment, and its first moments */
    int part;
    int curved; /* curved surface that it is a part of; -1: none */
    int next;   /* of the same cell; -1: none */
} bst_surface_fragment;

/* The nearest surface that covers a whole cell with uniform light, and the list of the others. */
typedef struct bst_surface_cell {
    float depth_m, light;
    int part; /* -1: none */
    int first;
} bst_surface_cell;

/* Work memory: zero-initialise, free with bst_visible_surface_free. */
typedef struct bst_visible_surface {
    bst_surface_cell *cells; /* [height][width] */
    bst_surface_fragment *fragments;
    int width, height, fragment_count, fragment_capacity;
    int low[2], high[2]; /* box of the cells in use; high excluded */
    size_t cell_capacity;
} bst_visible_surface;

/* Frees the memory. */
void bst_visible_surface_free(bst_visible_surface *surface);

/* Starts with an empty grid. BST_ERR_MEMORY. */
bst_status bst_visible_surface_begin(bst_ctx *ctx, bst_visible_surface *surface, int width,
                                     int height) BST_MUST_CHECK;

/* Adds a fragment to a cell; `next` is not used. Neighbours on one curved surface become one
 * fragment if they are added in turn. BST_ERR_MEMORY. */
bst_status bst_visible_surface_add(bst_ctx *ctx, bst_visible_surface *surface, int x, int y,
                                   const bst_surface_fragment *fragment) BST_MUST_CHECK;

/* Adds what is visible to an image of the same size, and empties the grid.
 *
 * Given:     gap_m     fragments with less between their depths belong to one surface
 *            cell_rad  angle of a cell on the image's axis; light is multiplied by the cube of the
 *                      cosine of the angle from it, by which a cell's solid angle is smaller
 *            weight    factor on light and cover
 * Returned:  light without the weight */
double bst_visible_surface_resolve(bst_visible_surface *surface, double gap_m, double cell_rad,
                                   double weight, bst_resolved_image *image);

#endif
