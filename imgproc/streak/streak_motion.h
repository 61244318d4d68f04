/* How the stars of a frame moved, from their streaks. */
#ifndef BST_IMGPROC_STREAK_STREAK_MOTION_H
#define BST_IMGPROC_STREAK_STREAK_MOTION_H

#include "imgproc/measure/locate.h"

enum {
    BST_STREAK_MOTION_STARS = 12,
    BST_STREAK_MOTION_COUNT = 3, /* length, end minus start across it, bend along it; px */
};

typedef struct bst_streak_motion {
    int max_side; /* of a stamp */
    float *
        planes; /* of bst_source_profile_render_motion; then the pixels, and 1 where there is one */
    float *scratch;
    float *pixels; /* [BST_STREAK_MOTION_STARS]: each star's last two planes */
    struct bst_streak_motion_star *stars; /* [BST_STREAK_MOTION_STARS] */
    int count;
    double ex, ey, binning, sigma_px; /* the path's direction; sensor pixels per pixel; PSF */
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

/* Corrects a frame's motion by what up to BST_STREAK_MOTION_STARS bright streaks that stand alone
 * show, fitted jointly with their places, fluxes and widths (Gauss-Newton, as bst_fit_run): what
 * the telemetry does not know (drift of the platform, jitter) or gets wrong (noise). Both would
 * else move the stars: a bend that is not known shifts all along their path alike, by up to 0.7 of
 * its error, and a path of the wrong direction turns the error ellipses.
 *
 * begin: a new frame. False when stars are points or their streaks too short to tell (4 sigma of
 * the PSF), or when the motion bends by more than a tenth of its length (the camera was starting or
 * stopping): nothing is to be measured then. add: takes the streaks of the frame or of a part of
 * it. solve: the priors, 1 sigma in px of the frame, are of the difference to frame->motion:
 * length_px of the path's length and direction, bend_px of the bend. *motion: a copy of
 * frame->motion, which is corrected; `profiles` are made for the frame's sigma. False, and nothing
 * changed, when no streak was bright enough. */
bool bst_streak_motion_begin(bst_streak_motion *work, const bst_locate_frame *frame);
/* Adds bright isolated streaks of the frame, or of a part of it, in order of their SNR. */
void bst_streak_motion_add(bst_streak_motion *work, const bst_locate_frame *frame,
                           const bst_candidates *candidates);

/* Fits the motion jointly to all streaks added; the comment above gives the arguments. False, with
 * *motion unchanged, if the fit is not possible. */
bool bst_streak_motion_solve(bst_streak_motion *work, const bst_imgproc_gauss *psf,
                             bst_source_profiles *profiles, const bst_camera *camera,
                             double length_px, double bend_px, bst_camera_motion *motion);

#endif
