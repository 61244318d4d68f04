/* Background level and noise of a frame, by mesh. */
#ifndef BST_IMGPROC_DETECT_BACKGROUND_H
#define BST_IMGPROC_DETECT_BACKGROUND_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/detect/row_kernels.h"
#include "imgproc/detect/scratch_pool.h"
#include "sim/core/parallel.h"

/* Values of pixels that hold no measurement. Anything below BST_PIXEL_NONE is one of them. */
#define BST_PIXEL_BAD (-2e30f)
#define BST_PIXEL_SATURATED (-1e30f)
#define BST_PIXEL_NONE (-1e29f)

typedef struct bst_background {
    int mesh_px, max_columns, max_rows;
    int width, height, columns, rows; /* of the latest frame */
    float *level, *noise;             /* [rows][columns], electrons */
    float *error;                     /* [rows][columns]: standard error of level over noise */
    int *left, *read; /* [rows][columns], of the latest read_again: pixels left, and all of them */
    float *scratch;   /* all meshes, for medians and smoothing */
    float *bands;     /* one for each thread: the pixels of a row of meshes */
    size_t band;      /* floats of a band */
    bst_scratch_pool *lent; /* of bands */
    float median_level, median_noise;
} bst_background;

/* Writes `count` pixels of row y from column x on, electrons or BST_PIXEL_... values. Called from
 * several threads at a time. */
typedef void (*bst_imgproc_pixel_fn)(const void *user, int y, int x, int count, float *out);

/* For loops on up to `threads` threads. */
bst_status bst_background_create(bst_ctx *ctx, int mesh_px, int max_width, int max_height,
                                 int threads, bst_background *out) BST_MUST_CHECK;
/* Frees the memory of a background and clears the struct, which belongs to the caller. */
void bst_background_free(bst_background *background);

/* The pixels of a frame and what their noise is made of. */
typedef struct bst_background_input {
    bst_imgproc_pixel_fn read;
    const void *user;
    double step_e, origin_e; /* the digital values, in electrons: origin_e + step_e n, step_e > 0 */
    double read_variance_e2; /* of the noise that is not counted electrons */
} bst_background_input;

/* Estimates level and noise in each mesh of a frame: median and median absolute deviation of a
 * sample, then mean and standard deviation within 3 sigma, four times, from half of the rows where
 * a mesh has 4096 pixels and more. The last time is cut midway between digital values, and both are
 * corrected for it as the noise of a normal part of read_variance_e2 and counted electrons asks
 * (truncated_moments.h); the deviation also for the slope of the level. No pixel is better known
 * than its step, step_e / sqrt(12). A mesh without usable pixels takes the frame's medians.
 * Then each mesh takes the mean with those pairs of opposite neighbours whose mean agrees with it
 * to four standard errors: a slope stays what it is, and where the sky is even the error falls to a
 * third.
 */
void bst_background_read(bst_background *background, bst_parallel *pool,
                         const bst_background_input *input, int width, int height);
/* The same again of the same frame with pixels left out; returns the share of pixels that were not.
 * A mesh of which less than a sixteenth is left stays as it is. */
double bst_background_read_again(bst_background *background, bst_parallel *pool,
                                 const bst_background_input *input);
/* The same of image [height][width] whose noise is normal. */
void bst_background_estimate(bst_background *background, const float *image, int width, int height,
                             float step_e);

/* Level and 1 / noise of image row y, as bst_background_row, by parts [columns + 1]; returns how
 * many. */
int bst_background_parts(const bst_background *background, int y, bst_row_part *parts);
/* Level and 1 / noise for every pixel of image row y, bilinear between mesh centres; outside them
 * the level goes on as it did, the noise stays. */
void bst_background_row(const bst_background *background, int y, float *level,
                        float *inverse_noise);

/* Background level at a point, e-, interpolated between the meshes.
 *
 * Given:     x_px, y_px  pixel of the frame */
double bst_background_level_at(const bst_background *background, double x_px, double y_px);

/* Noise of a pixel at a point, e-, interpolated between the meshes.
 *
 * Given:     x_px, y_px  pixel of the frame */
double bst_background_noise_at(const bst_background *background, double x_px, double y_px);

#endif
