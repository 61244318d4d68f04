/* Pixel calibration: digital numbers to electrons, corrected for dark, flat field and bad pixels.
 */
#ifndef BST_IMGPROC_CALIBRATE_CALIBRATE_PIXELS_H
#define BST_IMGPROC_CALIBRATE_CALIBRATE_PIXELS_H

#include "imgproc/calibrate/bad_rows.h"
#include "imgproc/calibrate/columns.h"
#include "imgproc/detect/row_kernels.h"
#include "imgproc/imgproc.h"

typedef struct bst_calibrate_pixels {
    const bst_camera *camera;
    const bst_imgproc_maps *maps;
    const uint8_t *bad; /* [height_px][width_px] of the sensor; NULL: none */
    const bst_imgproc_frame *frame;
    const bst_bad_rows *learned; /* learned bad pixels, masked too; NULL: none */
    const bst_columns *columns;  /* column offsets to subtract, e-; NULL: not measured */
    int first_column;            /* index in `columns` of the frame's first column */
} bst_calibrate_pixels;

/* Reads calibrated pixels of a frame, e-: a bst_imgproc_pixel_fn (background.h) whose user pointer
 * is a bst_calibrate_pixels. */
void bst_calibrate_pixels_read(const void *electrons, int y, int x, int count, float *out);

/* True if no calibration map applies: electrons are then (digital number - offset) x gain, except
 * at learned bad pixels.
 *
 * Returned:  *gain  offset, DN, and gain, e-/DN */
bool bst_calibrate_pixels_plain(const bst_calibrate_pixels *electrons, bst_row_gain *gain);

#endif
