/* Labels of the detections that the PSF wings of a frame's bright stars cause. */
#ifndef BST_IMGPROC_WING_LABELS_H
#define BST_IMGPROC_WING_LABELS_H

#include "boresight/camera_motion.h"
#include "imgproc/detect/psf_wings.h"
#include "imgproc/identify/predicted_stars.h"
#include "sim/onboard/discriminate.h"

/* A frame whose stars have been identified. */
typedef struct bst_wing_labels_input {
    const bst_camera *camera;
    const bst_frame_knowledge *known;
    const bst_camera_motion *motion; /* NULL: unknown */
    int binning;
    double exposure_s;
    bst_psf_wings_ground_fn ground; /* background of the frame */
    const void *user;               /* first argument of `ground` */
} bst_wing_labels_input;

/* Labels artefacts in the PSF wings of bright stars: catalogue stars, including those beside the
 * frame if the attitude is from stars, and saturated sources.
 *
 * Returned:  sky->expected  updated
 *            *out           labels and their probabilities (bst_psf_wings_label)
 * Errors:    those of bst_predicted_stars_expect */
bst_status bst_wing_labels_make(bst_ctx *ctx, const bst_wing_labels_input *input,
                                bst_predicted_stars *sky, bst_psf_wings *wings,
                                bst_detections *out) BST_MUST_CHECK;

#endif
