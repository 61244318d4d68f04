/* Background and noise as image processing finds them mesh by mesh, where the light of long streaks
 * is part of them. Inside of the generator. */
#ifndef BST_OBSGEN_MODEL_LOCAL_SKY_H
#define BST_OBSGEN_MODEL_LOCAL_SKY_H

#include "boresight/status.h"

/* Heights of lines, SNR, that what a clipped mean holds of them is tabulated at, four to one. */
enum { BST_LOCAL_SKY_HEIGHTS = 256 };

/* Where a place lies along an axis: between the middles of mesh `first` and the next. */
typedef struct bst_local_sky_place {
    double part; /* of the way from one to the other */
    int first;
} bst_local_sky_place;

/* What is mixed between the middles of four meshes: at the upper and lower left one the value, and
 * how much more it is at the right one. */
typedef struct bst_local_sky_cell {
    int column, row; /* of the upper left one */
    double level[2][2], noise[2][2];
} bst_local_sky_cell;

typedef struct bst_local_sky {
    int mesh, columns, rows, width, height; /* px; of meshes; px */
    float *level, *noise;                   /* of each mesh, see below */
    float *scratch;
    int room;
    bst_local_sky_place *places; /* of the frame's columns, then of its rows */
    int places_room;
    double sigma; /* that the tables are for; 0: none */
    float light[BST_LOCAL_SKY_HEIGHTS], square[BST_LOCAL_SKY_HEIGHTS];
} bst_local_sky;

/* Before the lines of a frame. sigma_px with the pixel's own width; mesh_px: side of a mesh; what
 * remains of less than half of one joins its neighbour. BST_ERR_MEMORY. */
bst_status bst_local_sky_begin(bst_ctx *ctx, bst_local_sky *sky, int width, int height, int mesh_px,
                               double sigma_px) BST_MUST_CHECK;
/* Adds length_px of a line at a pixel of the frame that is read; height: its electrons per px over
 * the noise of a pixel, which is its SNR in the filter for points. */
void bst_local_sky_add(bst_local_sky *sky, int x, int y, double height, double length_px);
/* Makes of the lines' light what is too much of the level, in noises of a pixel, and the noise over
 * what it is without them; share and crowding: of the light and of its square that count.
 * Neighbours that agree are averaged as image processing does. */
void bst_local_sky_settle(bst_local_sky *sky, double share, double crowding);
/* Both at a place, bilinear between the meshes' middles. */
void bst_local_sky_at(const bst_local_sky *sky, double x, double y, double *level, double *noise);

/* Loads the corner values of a cell, for bst_local_sky_next.
 *
 * Given:     column, row  of the cell's upper left mesh */
void bst_local_sky_enter(const bst_local_sky *sky, int column, int row, bst_local_sky_cell *cell);
/* Frees the memory of a local sky and clears the struct, which belongs to the caller. */
void bst_local_sky_free(bst_local_sky *sky);

static inline double bst_local_sky_mix(const double cell[2][2], double x, double y) {
    double top = cell[0][0] + x * cell[0][1], bottom = cell[1][0] + x * cell[1][1];
    return top + y * (bottom - top);
}

/* Both at a pixel of the frame. cell: that of the pixel before, its column -1 at first. */
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
