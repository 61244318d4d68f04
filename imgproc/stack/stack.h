/* Frame stacking along trial motions (shift and add, track before detect): detects objects too
 * faint for one frame.
 *
 * Frames are matched-filtered, normalised to unit noise, and aligned with the first frame by the
 * camera's attitude, so that stars are at rest. A path is a position at the mean of the frame times
 * and a rate. Its output is the sum of the frames' values along it over the root of their number:
 * the matched filter of a point in linear motion. The search sums groups of four frames at a coarse
 * grid of rates, then the groups at a fine grid. Sums above a lower threshold are refined to their
 * maximum between grid points. There the threshold for `false_alarms_per_frame` applies. */
#ifndef BST_IMGPROC_STACK_STACK_H
#define BST_IMGPROC_STACK_STACK_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "boresight/config.h"
#include "boresight/vec.h"

enum { BST_STACK_MAX_FRAMES = 64, BST_STACK_MAX_FOUND = 4096 };

typedef struct bst_stack_config {
    int64_t frames;           /* frames per stack, a multiple of 4; 0: no stacking */
    double rate_px_per_frame; /* largest rate searched, along x and y */
    double false_alarms_per_frame;
} bst_stack_config;

extern const bst_config_desc bst_stack_config_table[];

/* Input frame. Sensor position = origin + binning * frame position. */
typedef struct bst_stack_frame {
    const float *signal; /* [height][width]: electrons above the background, or BST_PIXEL_... */
    const struct bst_background *background;
    int width, height;
    double sigma_px; /* of the PSF, frame pixels */
    double time_s;   /* mid-exposure */
    bst_quat q_cam_from_gcrf;
    double origin_x_px, origin_y_px, binning;
} bst_stack_frame;

/* Detection of a stack: position at the time of its last frame, in that frame's sensor pixels. */
typedef struct bst_stack_found {
    double x_px, y_px, cov_xx, cov_xy, cov_yy; /* px, px^2 */
    double rate_x_pxps, rate_y_pxps;           /* relative to the stars */
    double rate_sigma_pxps;                    /* per axis */
    double snr;                                /* of the stacked sum */
    double flux_e, flux_sigma_e;               /* per frame */
    bool at_rest;                              /* rate consistent with a star */
    int frames;                                /* number of summed frames */
} bst_stack_found;

typedef struct bst_stack bst_stack;

/* Creates a stack for frames of up to max_width x max_height pixels. It needs one byte per pixel
 * and frame and 10 bytes per pixel.
 *
 * Given:     camera   copied
 *            threads  as in bst_parallel_create; the result does not depend on them
 * Errors:    BST_ERR_ARGUMENT: frames not a multiple of 4 from 4 to BST_STACK_MAX_FRAMES, rate not
 *            above 0 or a path longer than 256 px, false alarms not above 0; BST_ERR_MEMORY */
bst_status bst_stack_create(bst_ctx *ctx, const bst_camera *camera, const bst_stack_config *config,
                            int threads, bst_stack **out) BST_MUST_CHECK;
/* Frees a stack with its thread pool; NULL is allowed. */
void bst_stack_free(bst_stack *stack);

/* Saves or restores the frames of a stack that is not full, and the figures of the latest search.
 *
 * Errors:    BST_ERR_FORMAT for restored frames with attitudes, times or noise that no frame has;
 *            the stack is empty then
 * Notes:     the number of frames of a stack must be the saved one; imgproc/module.c begins a new
 *            stack where it has changed */
bst_status bst_stack_archive(bst_stack *stack, bst_archive *archive) BST_MUST_CHECK;

/* Adds a frame. A stack with config->frames frames is full: bst_stack_search is next.
 *
 * Given:     frame  a frame of other size, position or binning, or one that is not later, starts a
 *                   new stack
 * Returned:  number of frames in the stack */
int bst_stack_add(bst_stack *stack, const bst_stack_frame *frame);

/* Searches a full stack and empties it.
 *
 * Returned:  detections, the strongest first, valid until the next call: first moving objects above
 *            the threshold, then sources at rest that are above it and below SNR 4.5 in a single
 *            frame
 *            *count  number of detections
 * Notes:     pixels with charge at the same position of the sensor in all frames, and sources at
 *            rest, are excluded from the search for motion. A path needs half of the frames. */
const bst_stack_found *bst_stack_search(bst_stack *stack, int *count);

/* Detection threshold, SNR of a stacked sum, of the latest search. */
double bst_stack_threshold_snr(const bst_stack *stack);
/* Number of grid sums that the latest search refined. */
int64_t bst_stack_followed(const bst_stack *stack);

/* Detection threshold of the stack that noise alone exceeds `false_alarms` times, over a box of
 * positions (side_px) and rates (+-rate_px_per_frame).
 *
 * Given:     roughness      variance of the noise field's gradient per px^2 of position
 *            time_variance  factor for the gradient per (px/frame)^2 of rate, frames^2
 * Notes:     Mean Euler characteristic: sum over dimensions d of e_d rho_d. e_d are the elementary
 *            symmetric sums of the sides in units of the field's length; rho_d = (2 pi)^(-(d + 1) /
 *            2) He_{d-1}(u) exp(-u^2 / 2).
 * Reference: Adler and Taylor, Random Fields and Geometry, 2007, theorem 12.4.1 and 15.10.1 */
double bst_stack_threshold(double false_alarms, const double side_px[2], double rate_px_per_frame,
                           double roughness, double time_variance);

#endif
