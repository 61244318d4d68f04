/* Objects too faint for one frame: the sum of several frames along straight paths of unknown rate
 * (shift and add, track before detect).
 *
 * Frames are filtered with the PSF, brought to unit noise, and laid on the first frame's pixels by
 * the camera's attitude, so that stars are at rest in them. A path is a place in the middle of the
 * frames' times and a rate; its output is the sum of the frames' values on it over the root of
 * their number, which is the matched filter for a point that moves so. The search sums groups of
 * four frames at few rates, then the groups at many, on a grid of places and rates; what exceeds a
 * lower threshold there is followed to its maximum between the grid's points, where the threshold
 * that `false_alarms_per_frame` asks for counts. */
#ifndef BST_IMGPROC_STACK_STACK_H
#define BST_IMGPROC_STACK_STACK_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/camera.h"
#include "boresight/config.h"
#include "boresight/vec.h"

enum { BST_STACK_MAX_FRAMES = 64, BST_STACK_MAX_FOUND = 4096 };

typedef struct bst_stack_config {
    int64_t frames;           /* of a stack, a multiple of 4; 0: no stacks */
    double rate_px_per_frame; /* greatest rate that is searched, in x and in y */
    double false_alarms_per_frame;
} bst_stack_config;

extern const bst_config_desc bst_stack_config_table[];

/* One frame, as image processing leaves it. Places on the sensor = origin + binning * place in the
 * frame. */
typedef struct bst_stack_frame {
    const float *signal; /* [height][width]: electrons above the background, or BST_PIXEL_... */
    const struct bst_background *background;
    int width, height;
    double sigma_px; /* of the PSF, in this frame's pixels */
    double time_s;   /* middle of the exposure */
    bst_quat q_cam_from_gcrf;
    double origin_x_px, origin_y_px, binning;
} bst_stack_frame;

/* What a stack shows: a place at the time of its last frame, in that frame's sensor pixels. */
typedef struct bst_stack_found {
    double x_px, y_px, cov_xx, cov_xy, cov_yy; /* px, px^2 */
    double rate_x_pxps, rate_y_pxps;           /* against the stars */
    double rate_sigma_pxps;                    /* of each */
    double snr;                                /* of the sum */
    double flux_e, flux_sigma_e;               /* in one frame */
    bool at_rest;                              /* among the stars, as far as the rate is known */
    int frames;                                /* that were summed */
} bst_stack_found;

typedef struct bst_stack bst_stack;

/* All memory that stacks of frames of up to max_width x max_height pixels need: a byte per pixel
 * and frame and 10 bytes per pixel. `camera` is copied. threads as in bst_parallel_create. The
 * result does not depend on them. BST_ERR_ARGUMENT: frames not a multiple of 4 from 4 to
 * BST_STACK_MAX_FRAMES, a rate not above 0 or so great that a path is longer than 256 px, false
 * alarms not above 0. */
bst_status bst_stack_create(bst_ctx *ctx, const bst_camera *camera, const bst_stack_config *config,
                            int threads, bst_stack **out) BST_MUST_CHECK;
/* Frees a stack with its thread pool; NULL is allowed. */
void bst_stack_free(bst_stack *stack);

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

/* SNR of a sum that counts as a detection in the latest search. */
double bst_stack_threshold_snr(const bst_stack *stack);
/* Number of sums on the grid that the latest search followed to their maximum. */
int64_t bst_stack_followed(const bst_stack *stack);

/* The output that noise alone exceeds `false_alarms` times: maxima over a box of places (side_px)
 * and rates (+-rate_px_per_frame) of a normal field whose gradient has the variance `roughness` per
 * px^2 of place, and that times time_variance (in frames^2) per (px/frame)^2 of rate. Sum over
 * dimensions d of e_d rho_d, e_d the elementary symmetric sums of the sides in units of the field's
 * length, rho_d = (2 pi)^(-(d + 1) / 2) He_{d-1}(u) exp(-u^2 / 2) (Adler and Taylor, Random Fields
 * and Geometry, 2007, theorem 12.4.1 and 15.10.1: the mean Euler characteristic). */
double bst_stack_threshold(double false_alarms, const double side_px[2], double rate_px_per_frame,
                           double roughness, double time_variance);

#endif
