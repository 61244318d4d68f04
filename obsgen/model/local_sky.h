/* Background and noise by mesh, as image processing estimates them, with the light of long streaks.
 * Internal to the generator. */
#ifndef BST_OBSGEN_MODEL_LOCAL_SKY_H
#define BST_OBSGEN_MODEL_LOCAL_SKY_H

#include "boresight/status.h"

/* Table size of line heights (SNR, four per unit) for the light below the clip. */
enum { BST_LOCAL_SKY_HEIGHTS = 256 };

/* Bins of a pixel's light, four per pixel noise; the last one also has all brighter pixels. */
enum { BST_LOCAL_SKY_BINS = 48 };

/* Position of a pixel between the centres of mesh `first` and the next. */
typedef struct bst_local_sky_place {
    double part; /* fraction of the distance */
    int first;
} bst_local_sky_place;

/* Interpolation cell between four mesh centres: value at the left centre and increment to the right
 * one, for the upper and lower row. */
typedef struct bst_local_sky_cell {
    int column, row; /* of the upper left mesh */
    double level[2][2], noise[2][2];
} bst_local_sky_cell;

typedef struct bst_local_sky {
    int mesh, columns, rows, width, height; /* mesh: px; columns, rows: meshes; width, height: px */
    float *level, *noise;                   /* per mesh, see bst_local_sky_settle */
    float *scratch;
    int room;
    bst_local_sky_place *places; /* of the frame's columns, then rows */
    int places_room;
    double sigma; /* for which the tables are computed; 0: none */
    float light[BST_LOCAL_SKY_HEIGHTS], square[BST_LOCAL_SKY_HEIGHTS];
    float
        *pixels; /* number of pixels about sources by mesh and light: [mesh][BST_LOCAL_SKY_BINS] */
    int pixels_room;
} bst_local_sky;

/* Begins a frame.
 *
 * Given:     mesh_px   side of a mesh, px; a remainder of less than half a mesh joins its neighbour
 *            sigma_px  including the pixel width
 * Errors:    BST_ERR_MEMORY */
bst_status bst_local_sky_begin(bst_ctx *ctx, bst_local_sky *sky, int width, int height, int mesh_px,
                               double sigma_px) BST_MUST_CHECK;
/* Adds length_px of a line at a frame pixel.
 *
 * Given:     height  electrons per px over pixel noise: the line's SNR in the point filter */
void bst_local_sky_add(bst_local_sky *sky, int x, int y, double height, double length_px);
/* Light at a distance from a point, in pixel noises per pixel. */
typedef double (*bst_local_sky_light_fn)(const void *user, double distance_px);

/* Begins the light about points of a frame, after bst_local_sky_begin. Errors: BST_ERR_MEMORY. */
bst_status bst_local_sky_begin_wings(bst_ctx *ctx, bst_local_sky *sky) BST_MUST_CHECK;
/* Adds the light about a point of the frame, x, y, up to reach_px from it. */
void bst_local_sky_add_wings(bst_local_sky *sky, double x, double y, double reach_px,
                             bst_local_sky_light_fn light, const void *user);
/* Sets background excess and relative noise by that light, as bst_local_sky_settle does.
 *
 * Given:     shot  variance per light of a pixel, both in noises of a dark pixel
 * Notes:     Image processing iterates mean and standard deviation of the pixels within three
 *            deviations. Here the same is done for the distribution of which the pixels are
 *            samples: normal noise about each pixel's light. */
void bst_local_sky_settle_wings(bst_local_sky *sky, double shot);
/* Converts the accumulated light to background excess, in pixel noises, and relative noise per
 * mesh. Meshes are smoothed as image processing does.
 *
 * Given:     share, crowding  shares of light and squared light that enter */
void bst_local_sky_settle(bst_local_sky *sky, double share, double crowding);
/* Background excess and relative noise at a position, bilinear between mesh centres. */
void bst_local_sky_at(const bst_local_sky *sky, double x, double y, double *level, double *noise);

/* Loads the corner values of a cell, for bst_local_sky_next.
 *
 * Given:     column, row  of the cell's upper left mesh */
void bst_local_sky_enter(const bst_local_sky *sky, int column, int row, bst_local_sky_cell *cell);
/* Frees the memory of a local sky and clears the struct, which belongs to the caller. */
void bst_local_sky_free(bst_local_sky *sky);

/* Bilinear interpolation in a cell. */
static inline double bst_local_sky_mix(const double cell[2][2], double x, double y) {
    double top = cell[0][0] + x * cell[0][1], bottom = cell[1][0] + x * cell[1][1];
    return top + y * (bottom - top);
}

/* Background excess and relative noise at a frame pixel.
 *
 * Given:     cell  cell of the previous pixel, for reuse; its column is -1 at first */
static inline void bst_local_sky_next(const bst_local_sky *sky, bst_local_sky_cell *cell, int x,
                                      int y, double *level, double *noise) {
    const bst_local_sky_place *across = &sky->places[x], *down = &sky->places[sky->width + y];
    if (cell->column != across->first || cell->row != down->first) {
        bst_local_sky_enter(sky, across->first, down->first, cell);
    }
    *level = bst_local_sky_mix(cell->level, across->part, down->part);
    *noise = bst_local_sky_mix(cell->noise, across->part, down->part);
}

#endif
