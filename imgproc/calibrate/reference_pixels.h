/* Reference pixels: overscan at the sides of a frame, whose level is taken off the others. */
#ifndef BST_IMGPROC_CALIBRATE_REFERENCE_PIXELS_H
#define BST_IMGPROC_CALIBRATE_REFERENCE_PIXELS_H

#include "imgproc/imgproc.h"

/* Work space; zero-initialise it, free with bst_reference_pixels_free. */
typedef struct bst_reference_pixels {
    uint16_t *pixels; /* the latest frame without the level of its reference pixels */
    double *sum;      /* [rows + 1]: running sum of the rows' levels */
    int *count;       /* [rows + 1] */
    size_t capacity, rows;
} bst_reference_pixels;

/* Frees the buffers; a zeroed structure is allowed. */
void bst_reference_pixels_free(bst_reference_pixels *references);

/* Takes the level of the reference pixels off a frame.
 *
 * Given:     config  of image processing
 *            camera  onboard; detector.overscan gives the sides with reference pixels
 *            frame   unbinned; a binned one, and one without reference pixels in its window, stays
 * Returned:  *out    as frame; its pixels are held by `references` until the next call. The level
 *                    of the reference pixels becomes camera->offset_dn, in whole digital numbers;
 *                    pixels at the top of the range stay there
 * Errors:    BST_ERR_MEMORY
 * Notes:     1. with alternating columns, the mean of the reference rows (bottom, top) in even and
 *               in odd columns of the sensor is taken off these columns;
 *            2. the mean of the reference columns (left, right) over 2 smooth_rows + 1 rows is
 *               taken off each row. This adds noise of variance
 *               r^2 / (columns (2 smooth_rows + 1)), r the read noise.
 *            Whole numbers add 1/12 DN^2.
 * Reference: Moseley et al. 2010, Proc. SPIE 7742, 77421B */
bst_status bst_reference_pixels_subtract(bst_ctx *ctx, bst_reference_pixels *references,
                                         const bst_reference_pixels_config *config,
                                         const bst_camera *camera, const bst_imgproc_frame *frame,
                                         bst_imgproc_frame *out) BST_MUST_CHECK;

/* Marks the reference pixels of the sensor as bad.
 *
 * Given:     *bad  [height_px][width_px], or NULL: none yet
 * Errors:    BST_ERR_MEMORY; BST_ERR_CONFIG: enabled, but the sensor has no reference pixels */
bst_status bst_reference_pixels_mask(bst_ctx *ctx, const bst_reference_pixels_config *config,
                                     const bst_camera *camera, uint8_t **bad) BST_MUST_CHECK;

#endif
