/* Background level and noise of a frame, by mesh. */
#ifndef BST_IMGPROC_BACKGROUND_H
#define BST_IMGPROC_BACKGROUND_H

#include <stdbool.h>

#include "sim/core/status.h"

/* Values of pixels that hold no measurement. Anything below BST_PIXEL_NONE is one of them. */
#define BST_PIXEL_BAD (-2e30f)
#define BST_PIXEL_SATURATED (-1e30f)
#define BST_PIXEL_NONE (-1e29f)

typedef struct bst_background {
    int mesh_px, max_columns, max_rows;
    int width, height, columns, rows; /* of the latest frame */
    float *level, *noise;             /* [rows][columns], electrons */
    float *scratch;                   /* sample of a mesh; later all meshes, for medians */
    float *row_level, *row_noise;     /* [columns], for one image row */
    float median_level, median_noise;
} bst_background;

bst_status bst_background_create(bst_ctx *ctx, int mesh_px, int max_width, int max_height,
                                 bst_background *out) BST_MUST_CHECK;
void bst_background_free(bst_background *background);

/* Estimates level and noise in each mesh of image [height][width]: median and median absolute
 * deviation of a sample, then mean and standard deviation within 3 sigma, twice, on every second
 * row of a large mesh, the deviation corrected for the clipping. noise_floor (> 0) is the least
 * noise reported. A mesh without usable pixels takes the frame's medians. */
void bst_background_estimate(bst_background *background, const float *image, int width, int height,
                             float step_e);

/* Level and 1 / noise for every pixel of image row y, bilinear between mesh centres, constant
 * outside them. */
void bst_background_row(const bst_background *background, int y, float *level,
                        float *inverse_noise);
/* Noise at a place. */
double bst_background_noise_at(const bst_background *background, double x_px, double y_px);

#endif
