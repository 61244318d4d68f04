/* A sparse bad-pixel map of the sensor: the bad columns of each row. */
#ifndef BST_IMGPROC_CALIBRATE_BAD_ROWS_H
#define BST_IMGPROC_CALIBRATE_BAD_ROWS_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "boresight/status.h"

typedef struct bst_bad_rows {
    int width, height, capacity, count;
    int *first;      /* [height + 1]: index in `column` of the row's first bad pixel */
    int32_t *column; /* [capacity], ascending within a row */
} bst_bad_rows;

/* Creates an empty bad-pixel map of a sensor of width x height pixels.
 *
 * Given:     capacity  most bad pixels it can hold
 * Errors:    BST_ERR_MEMORY */
bst_status bst_bad_rows_create(bst_ctx *ctx, int width, int height, int capacity,
                               bst_bad_rows *out) BST_MUST_CHECK;
/* Frees the memory of a list of bad pixels and clears the struct, which belongs to the caller. */
void bst_bad_rows_free(bst_bad_rows *rows);

/* Saves or restores a map of the same sensor and capacity.
 *
 * Errors:    BST_ERR_FORMAT for restored rows or columns out of range; the map is empty then */
bst_status bst_bad_rows_archive(bst_bad_rows *rows, bst_archive *archive) BST_MUST_CHECK;

/* Empties the map. Call bst_bad_rows_add for each bad pixel next, then bst_bad_rows_end. */
void bst_bad_rows_begin(bst_bad_rows *rows);

/* Adds a bad pixel to the map, in ascending order of pixel. Pixels beyond the capacity are dropped.
 *
 * Given:     pixel  y * width + x */
void bst_bad_rows_add(bst_bad_rows *rows, int32_t pixel);
/* Completes the map: computes where each row begins. */
void bst_bad_rows_end(bst_bad_rows *rows);

/* True if sensor pixel y * width + x is in the bad-pixel map. */
bool bst_bad_rows_hold(const bst_bad_rows *rows, int32_t pixel);

/* A run of `count` binned pixels in row y of a read-out window, starting at column x. */
typedef struct bst_bad_rows_run {
    const bst_window *window;
    int binning, y, x, count;
} bst_bad_rows_run;

/* Sets out[i] to `value` if binned pixel i of the run contains a bad sensor pixel. */
void bst_bad_rows_mask(const bst_bad_rows *rows, const bst_bad_rows_run *run, float value,
                       float *out);

#endif
