/* Stars sorted into cells of the sky, for queries of those near a direction. */
#ifndef BST_IMGPROC_IDENTIFY_SKY_CELLS_H
#define BST_IMGPROC_IDENTIFY_SKY_CELLS_H

#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"

/* Bands of declination, each divided into cells of right ascension. Zero-initialise. */
typedef struct bst_sky_cells {
    int bands;
    int *band_first;   /* [bands + 1] first cell of each band */
    int32_t *head;     /* [cells] latest star of each cell; -1: none */
    int32_t *next;     /* [room] star before it in the same cell */
    float (*place)[3]; /* [room] unit vectors */
    int count, room;
} bst_sky_cells;

/* Opens an empty set of up to `room` stars with cells of about side_rad. BST_ERR_MEMORY. */
bst_status bst_sky_cells_open(bst_ctx *ctx, bst_sky_cells *sky, double side_rad,
                              int room) BST_MUST_CHECK;
/* Frees the set's memory. */
void bst_sky_cells_close(bst_sky_cells *sky);

/* Adds a star (unit vector); its index is the number of stars before it. */
void bst_sky_cells_add(bst_sky_cells *sky, bst_vec3 v);

/* Renumbers the stars in order of their cells, so that neighbours are close in memory; no star can
 * be added afterwards. BST_ERR_MEMORY. */
bst_status bst_sky_cells_sort(bst_ctx *ctx, bst_sky_cells *sky) BST_MUST_CHECK;

/* Finds the stars within radius_rad of a direction.
 *
 * Given:     most  most stars to find
 * Returned:  out   their indices, in no particular but a fixed order; may be NULL
 *            number of them, at most `most` */
int bst_sky_cells_near(const bst_sky_cells *sky, bst_vec3 v, double radius_rad, int most,
                       uint32_t *out);

#endif
