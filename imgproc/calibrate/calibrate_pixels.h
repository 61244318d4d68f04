/* A frame's pixels as electrons, corrected for dark, flat and bad pixels. */
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
    const bst_bad_rows *learned; /* left out too; NULL: none */
    const bst_columns *columns;  /* taken off; NULL: not measured */
    int first_column;            /* of `columns`, that the frame begins with */
} bst_calibrate_pixels;

/* A bst_imgproc_pixel_fn (background.h) for a bst_calibrate_pixels. */
void bst_calibrate_pixels_read(const void *electrons, int y, int x, int count, float *out);

/* Whether nothing is corrected but learned bad pixels are left out: electrons are digital numbers
 * by their gain. */
bool bst_calibrate_pixels_plain(const bst_calibrate_pixels *electrons, bst_row_gain *gain);

#endif
