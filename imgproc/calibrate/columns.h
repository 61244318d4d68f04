/* Level of each detector column above the median column: frame-transfer smear and column offsets.
 */
#ifndef BST_IMGPROC_CALIBRATE_COLUMNS_H
#define BST_IMGPROC_CALIBRATE_COLUMNS_H

#include "imgproc/imgproc.h"
#include "sim/core/parallel.h"

typedef struct bst_columns {
    int capacity, count;
    float *level_e; /* [count]: column level above the median of all columns, e- per binned pixel */
    /* [count]: pixel noise of a column relative to a column without excess level, >= 1 */
    float *noise;
    float *ordered; /* work space */
    float median_e; /* median column level above the camera's offset, e- */
} bst_columns;

/* Allocates column levels for frames of up to `width` columns. Errors: BST_ERR_MEMORY. */
bst_status bst_columns_create(bst_ctx *ctx, int width, bst_columns *out) BST_MUST_CHECK;
/* Frees the memory of the columns' levels and clears the struct, which belongs to the caller. */
void bst_columns_free(bst_columns *columns);

/* Measures the column levels of a whole frame.
 *
 * A column starts from the median of 31 rows. Two sigma clips at 3 sigma follow, over at most 1024
 * rows; sigma combines read noise, shot noise of the level and quantisation. A column near the full
 * well, or a frame of fewer than 31 rows, gets the median level. Only frame-transfer smear carries
 * shot noise; electronic column offsets do not. */
void bst_columns_measure(bst_columns *columns, bst_parallel *pool, const bst_camera *camera,
                         const bst_imgproc_frame *frame);

#endif
