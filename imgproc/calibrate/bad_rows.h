/* A sparse bad-pixel map of the sensor: the bad columns of each row. */
#ifndef BST_IMGPROC_CALIBRATE_BAD_ROWS_H
#define BST_IMGPROC_CALIBRATE_BAD_ROWS_H

#include "boresight/messages.h"
#include "boresight/status.h"

typedef struct bst_bad_rows {
    int width, height, capacity, count;
    int *first;      /* [height + 1]: the row's first entry in `column` */
    int32_t *column; /* [capacity], ascending within a row */
} bst_bad_rows;

/* Makes an empty map of a sensor of width x height pixels with room for `capacity`. BST_ERR_MEMORY.
 */
bst_status bst_bad_rows_create(bst_ctx *ctx, int width, int height, int capacity,
                               bst_bad_rows *out) BST_MUST_CHECK;
/* Frees the memory of a list of bad pixels and clears the struct, which belongs to the caller. */
void bst_bad_rows_free(bst_bad_rows *rows);

/* Empties the map. Then come bst_bad_rows_add for each pixel and bst_bad_rows_end. */
void bst_bad_rows_begin(bst_bad_rows *rows);

/* Adds a pixel; pixels come in ascending order of y * width + x. Those beyond the capacity are
 * dropped.
 *
 * Given:     pixel  y * width + x */
void bst_bad_rows_add(bst_bad_rows *rows, int32_t pixel);
/* Completes the map: computes where each row begins. */
void bst_bad_rows_end(bst_bad_rows *rows);

/* Whether pixel y * width + x of the sensor is in the map. */
bool bst_bad_rows_hold(const bst_bad_rows *rows, int32_t pixel);

/* `count` pixels of row y, from column x on, of a window that is read out with binning x binning.
 */
typedef struct bst_bad_rows_run {
    const bst_window *window;
    int binning, y, x, count;
} bst_bad_rows_run;

/* Sets to `value` those of out[run->count] that hold a bad pixel of the sensor. */
void bst_bad_rows_mask(const bst_bad_rows *rows, const bst_bad_rows_run *run, float value,
                       float *out);

#endif
