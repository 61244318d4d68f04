/* Measures the camera motion during the exposure from the star streaks of a frame. */
#ifndef BST_IMGPROC_STREAK_STREAK_MOTION_H
#define BST_IMGPROC_STREAK_STREAK_MOTION_H

#include "imgproc/measure/locate.h"

enum {
    BST_STREAK_MOTION_STARS = 12,
    BST_STREAK_MOTION_COUNT = 3, /* length, end minus start across it, bend along it; px */
};

typedef struct bst_streak_motion {
    int max_side;  /* of a stamp */
    float *planes; /* planes of bst_source_profile_render_motion, then pixels and their validity */
    float *scratch;
    float *pixels; /* [BST_STREAK_MOTION_STARS]: each star's last two planes */
    struct bst_streak_motion_star *stars; /* [BST_STREAK_MOTION_STARS] */
    int count;
    double ex, ey, binning, sigma_px; /* direction of the path; sensor pixels per pixel; PSF */
    /* of the latest solution: length, across and bend, sensor px^2 */
    double covariance[BST_STREAK_MOTION_COUNT][BST_STREAK_MOTION_COUNT];
} bst_streak_motion;

/* Allocates the work space of the fit of the camera's motion.
 *
 * Given:     max_side  largest side of a stamp, px
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_streak_motion_free */
bst_status bst_streak_motion_create(bst_ctx *ctx, int max_side,
                                    bst_streak_motion *out) BST_MUST_CHECK;
/* Frees the memory of a work space and clears the struct, which belongs to the caller. */
void bst_streak_motion_free(bst_streak_motion *work);

/* Starts a new frame. Measures the camera motion from up to BST_STREAK_MOTION_STARS bright isolated
 * star streaks, fitted jointly with their positions, fluxes and widths (Gauss-Newton, as
 * bst_fit_run). It corrects what the telemetry lacks (platform drift, jitter) or gets wrong
 * (noise). An unknown bend would shift all stars along their path by up to 0.7 of its error. A
 * wrong path direction would rotate the error ellipses.
 *
 * Call bst_streak_motion_begin, then bst_streak_motion_add for each part of the frame, then
 * bst_streak_motion_solve.
 *
 * Returned:  false if there is nothing to measure: stars are points, streaks are shorter than 4
 *            sigma of the PSF (2 where the camera starts or stops), or the path bends by more than
 *            half of its length */
bool bst_streak_motion_begin(bst_streak_motion *work, const bst_locate_frame *frame);
/* Adds bright isolated streaks of the frame, or of a part of it, in order of their SNR. */
void bst_streak_motion_add(bst_streak_motion *work, const bst_locate_frame *frame,
                           const bst_candidates *candidates);

/* Fits the motion jointly to all streaks added.
 *
 * Given:     profiles   set for the frame's sigma
 *            length_px  1 sigma prior of the error of frame->motion: length and direction of the
 *                       path, frame px
 *            bend_px    1 sigma prior of the error of its bend, frame px
 *            *motion    copy of frame->motion
 * Returned:  *motion    corrected; its bend_sigma_rad is that of the bend along the streaks, and
 *                       work->covariance that of all three
 *            false, with *motion unchanged, if no streak was bright enough */
bool bst_streak_motion_solve(bst_streak_motion *work, const bst_imgproc_gauss *psf,
                             bst_source_profiles *profiles, const bst_camera *camera,
                             double length_px, double bend_px, bst_camera_motion *motion);

#endif
