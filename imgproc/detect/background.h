/* Estimation of a frame's background level and noise on a mesh. */
#ifndef BST_IMGPROC_DETECT_BACKGROUND_H
#define BST_IMGPROC_DETECT_BACKGROUND_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/detect/row_kernels.h"
#include "imgproc/detect/scratch_pool.h"
#include "sim/core/parallel.h"

/* Pixel values that are not measurements. Every value below BST_PIXEL_NONE is one of them. */
#define BST_PIXEL_BAD (-2e30f)
#define BST_PIXEL_SATURATED (-1e30f)
#define BST_PIXEL_NONE (-1e29f)

typedef struct bst_background {
    int mesh_px, max_columns, max_rows;
    int width, height, columns, rows; /* of the latest frame; columns, rows: of meshes */
    float *level, *noise;             /* [rows][columns], e- and e- RMS of a pixel */
    float *error; /* [rows][columns]: standard error of level, relative to noise */
    /* [rows][columns], of the latest bst_background_read_again: usable pixels, and all pixels */
    int *left, *read;
    float *scratch;         /* work space for medians and smoothing, all meshes */
    float *bands;           /* one per thread: the pixels of a row of meshes */
    size_t band;            /* floats per band */
    bst_scratch_pool *lent; /* pool of bands */
    float median_level, median_noise;
} bst_background;

/* Reads `count` pixels of row y from column x on, e- or BST_PIXEL_... values. It is called by
 * several threads at a time. */
typedef void (*bst_imgproc_pixel_fn)(const void *user, int y, int x, int count, float *out);

/* Allocates a background for frames of up to max_width x max_height pixels and loops of up to
 * `threads` threads.
 *
 * Given:     mesh_px  side of a mesh, px
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_background_free */
bst_status bst_background_create(bst_ctx *ctx, int mesh_px, int max_width, int max_height,
                                 int threads, bst_background *out) BST_MUST_CHECK;
/* Frees the memory of a background and clears the struct, which belongs to the caller. */
void bst_background_free(bst_background *background);

/* The pixels of a frame and its noise model. */
typedef struct bst_background_input {
    bst_imgproc_pixel_fn read;
    const void *user;
    double step_e, origin_e; /* digital value n is origin_e + step_e n electrons, step_e > 0 */
    double read_variance_e2; /* noise variance without shot noise, e-^2 */
} bst_background_input;

/* Estimates background level and noise in each mesh of a frame.
 *
 * The start values are median and MAD of a sample. Four passes of 3 sigma clipping follow; meshes
 * of 4096 pixels or more use half of the rows at first. The last clip cuts midway between digital
 * values. Mean and deviation are then corrected for the clip (truncated_moments.h), and the
 * deviation for the slope of the level. The noise is at least the quantisation noise step_e /
 * sqrt(12). A mesh without usable pixels takes the frame's medians. Finally each mesh is averaged
 * with the pairs of opposite neighbours that agree with it to four standard errors. This keeps a
 * slope and reduces the error to a third where the sky is even. */
void bst_background_read(bst_background *background, bst_parallel *pool,
                         const bst_background_input *input, int width, int height);
/* Estimates the background of the same frame again with pixels masked (detected sources). A mesh
 * with less than a sixteenth of its pixels usable keeps its estimate.
 *
 * Returned:  share of the frame's pixels that were usable */
double bst_background_read_again(bst_background *background, bst_parallel *pool,
                                 const bst_background_input *input);
/* Estimates the background of image [height][width] with normal noise.
 *
 * Given:     step_e  quantisation step, e- */
void bst_background_estimate(bst_background *background, const float *image, int width, int height,
                             float step_e);

/* Background of image row y as linear segments.
 *
 * Returned:  number of segments
 *            parts  [columns + 1] level and 1 / noise of each segment */
int bst_background_parts(const bst_background *background, int y, bst_row_part *parts);
/* Background level, e-, and 1 / noise of every pixel of image row y. Both are bilinear between mesh
 * centres. Beyond the outermost centres the level is extrapolated and the noise is constant. */
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
