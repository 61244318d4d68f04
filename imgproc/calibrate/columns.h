/* The level of each column of a frame over that of the others: the smear of a frame transfer under
 * light, and offsets of columns. */
#ifndef BST_IMGPROC_CALIBRATE_COLUMNS_H
#define BST_IMGPROC_CALIBRATE_COLUMNS_H

#include "imgproc/imgproc.h"
#include "sim/core/parallel.h"

typedef struct bst_columns {
    int capacity, count;
    float *level_e; /* [count]: over the median of all columns, electrons of a binned pixel */
    float *noise;   /* [count]: noise of a pixel over that of a column without the level, >= 1 */
    float *ordered; /* work space */
    float median_e; /* level over the camera's offset that the columns are compared with */
} bst_columns;

/* Room for a frame of `width` columns. BST_ERR_MEMORY. */
bst_status bst_columns_create(bst_ctx *ctx, int width, bst_columns *out) BST_MUST_CHECK;
/* Frees the memory of the columns' levels and clears the struct, which belongs to the caller. */
void bst_columns_free(bst_columns *columns);

/* Measures the columns of a whole frame: the median of 31 rows, then twice the mean of up to 1024
 * rows within three standard deviations of it, that of the read noise and of the level's counted
 * electrons. A column of which half is near the full well, or with fewer than 31 rows, has the
 * median level. Only a frame transfer's smear is counted light, which adds noise; offsets of
 * columns are electronic. */
void bst_columns_measure(bst_columns *columns, bst_parallel *pool, const bst_camera *camera,
                         const bst_imgproc_frame *frame);

#endif
