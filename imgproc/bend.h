/* How the stars of a frame moved unevenly, from their streaks. */
#ifndef BST_IMGPROC_BEND_H
#define BST_IMGPROC_BEND_H

#include "imgproc/locate.h"

enum { BST_BEND_STARS = 16 };

typedef struct bst_bend {
    int max_pixels; /* of a stamp */
    double *render; /* [3][4][max_pixels]: as the bend is, a step more and a step less */
} bst_bend;

bst_status bst_bend_create(bst_ctx *ctx, int max_side, bst_bend *out) BST_MUST_CHECK;
void bst_bend_free(bst_bend *bend);

/* Measures along the stars' path the bend of their motion, on up to BST_BEND_STARS bright streaks
 * that stand alone, jointly with their places, fluxes and widths (Gauss-Newton, as bst_fit_run),
 * given that it is frame->motion's with standard deviation prior_px, px of the frame. A jitter that
 * the telemetry does not see, and the noise of what it sees, would else shift all stars along their
 * path alike: by up to 0.7 of the error of the bend.
 *
 * Replaces frame->motion's bend in *motion (a copy of it) and sets *shift_px to 1 sigma of the
 * shift, along the path, that what is still unknown of the bend gives all streaks alike. False,
 * and nothing changed, when stars are points or their streaks too short to tell (4 sigma of the
 * PSF), when prior_px is 0, or when no streak is bright enough. */
bool bst_bend_measure(bst_bend *bend, const bst_psf *psf, const bst_locate_frame *frame,
                      const bst_candidates *candidates, double prior_px, bst_motion *motion,
                      double *shift_px);

#endif
