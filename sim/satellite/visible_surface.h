/* What is visible in each cell of an image: polygons of surfaces, cut where others are nearer.
 * Internal to sim/satellite. */
#ifndef BST_SATELLITE_VISIBLE_SURFACE_H
#define BST_SATELLITE_VISIBLE_SURFACE_H

#include "sim/satellite/polygon_clip.h"
#include "sim/satellite/resolved_image.h"

/* How near a plane is: origin (origin / depth - 1), m, where origin is the depth of the body's
 * origin. Linear in the image; close to the distance in front of the origin. */
typedef struct bst_nearness {
    float middle_m, x_m, y_m; /* at a cell's centre, and its change per cell */
} bst_nearness;

/* The part of a facet within a cell. Areas in cells, moments about the cell's centre in cells. */
typedef struct bst_surface_fragment {
    bst_nearness near;
    float area, area_x, area_y; /* and its first moments */
    float light;                /* of a whole cell of such a surface */
    int body;                   /* fragments of one body hide nothing of each other */
    int16_t part;
    bool front;      /* no part of the satellite: hides what is behind */
    bool more_light; /* light on another fragment of the same plane and body: hides nothing */
    int first, count, next; /* set by this module: its corners, counter-clockwise (count 0: those of
                               the cell), and another one of the same cell; -1: none */
} bst_surface_fragment;

/* Corner of a fragment, from the cell's centre in cells. */
typedef struct bst_fragment_corner {
    float x, y;
} bst_fragment_corner;

/* What reaches a cell: no body yet, one, or several. */
typedef enum bst_cell_kind { BST_CELL_EMPTY, BST_CELL_OF_ONE, BST_CELL_OF_SEVERAL } bst_cell_kind;

/* A cell of one body has the sums of its fragments. One of several has the nearest surface with
 * even light that covers it as a whole, and the list of the others. */
typedef struct bst_surface_cell {
    union {
        struct {
            float area, light, light_x, light_y;
        } sum;
        struct {
            bst_nearness near;
            float light;
        } cover;
    } is;
    int body;     /* the only one, or that of the cover */
    int first;    /* in the list; -1: none */
    int16_t part; /* of the only body, or of the cover; -1: none */
    unsigned char kind;
} bst_surface_cell;

/* Work memory: zero-initialise, free with bst_visible_surface_free. */
typedef struct bst_visible_surface {
    bst_surface_cell *cells; /* [height][width] */
    bst_surface_fragment *fragments;
    bst_fragment_corner *corners;
    struct bst_cell_polygon *polygons; /* of one cell */
    int width, height, fragment_count, fragment_capacity, corner_count, corner_capacity;
    int polygon_capacity;
    int low[2], high[2]; /* box of the cells in use; high excluded */
    size_t cell_capacity;
} bst_visible_surface;

/* Frees the memory. */
void bst_visible_surface_free(bst_visible_surface *surface);

/* Starts with an empty grid. BST_ERR_MEMORY. */
bst_status bst_visible_surface_begin(bst_ctx *ctx, bst_visible_surface *surface, int width,
                                     int height) BST_MUST_CHECK;

/* Says that a body may reach a cell. To be called for all bodies before anything is added, or for
 * none. Body below 0: several. */
void bst_visible_surface_reach(bst_visible_surface *surface, int x, int y, int body);

/* Adds a fragment to a cell.
 *
 * Given:     corners  [count] counter-clockwise, from the cell's centre in cells; count 0: the
 *                     whole cell
 * Errors:    BST_ERR_MEMORY */
bst_status bst_visible_surface_add(bst_ctx *ctx, bst_visible_surface *surface, int x, int y,
                                   const bst_surface_fragment *fragment, const bst_point2 *corners,
                                   int count) BST_MUST_CHECK;

/* Empties a cell. */
void bst_visible_surface_clear(bst_visible_surface *surface, int x, int y);

/* What is visible of a cell. */
typedef struct bst_cell_view {
    double area, light, light_x, light_y; /* first moments about the cell's centre */
    int part;                             /* that covers most of it; -1: none */
} bst_cell_view;

/* Finds what is visible of a cell (cell_visibility.c): cuts from each polygon those that are
 * nearer. Planes that cross are cut along the line where they do.
 *
 * Given:     clip    work memory
 *            same_m  differences of nearness below that are none: the fragment added first is seen
 * Errors:    BST_ERR_MEMORY */
bst_status bst_cell_view_find(bst_ctx *ctx, bst_visible_surface *surface,
                              const bst_surface_cell *cell, bst_polygon_clip *clip, double same_m,
                              bst_cell_view *out) BST_MUST_CHECK;

/* Adds what is visible to an image of the same size, and empties the grid.
 *
 * Given:     clip, same_m  of bst_cell_view_find
 *            cell_rad  angle of a cell on the image's axis; light is multiplied by the cube of the
 *                      cosine of the angle from it, by which a cell's solid angle is smaller
 *            weight    factor on light and cover
 * Returned:  *total  light without the weight
 * Errors:    BST_ERR_MEMORY */
bst_status bst_visible_surface_resolve(bst_ctx *ctx, bst_visible_surface *surface,
                                       bst_polygon_clip *clip, double same_m, double cell_rad,
                                       double weight, bst_resolved_image *image,
                                       double *total) BST_MUST_CHECK;

#endif
