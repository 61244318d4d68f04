/* Background and noise as image processing finds them mesh by mesh, where the light of long streaks
 * is part of them. Inside of the generator. */
#ifndef BST_OBSGEN_LOCAL_SKY_H
#define BST_OBSGEN_LOCAL_SKY_H

#include "sim/core/status.h"

/* Heights of lines, SNR, that what a clipped mean holds of them is tabulated at, four to one. */
enum { BST_LOCAL_SKY_HEIGHTS = 256 };

/* Where a place lies along an axis: between the middles of mesh `first` and the next. */
typedef struct bst_local_sky_place {
    double part; /* of the way from one to the other */
    int first;
} bst_local_sky_place;

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
/* The same at a pixel, sooner where it is on the frame. */
void bst_local_sky_at_pixel(const bst_local_sky *sky, int x, int y, double *level, double *noise);
void bst_local_sky_free(bst_local_sky *sky);

#endif
