/* Where to look in a frame while a target is followed. */
#ifndef BST_IMGPROC_WINDOW_PLAN_H
#define BST_IMGPROC_WINDOW_PLAN_H

#include "imgproc/detect/region_of_interest.h"
#include "imgproc/identify/predicted_stars.h"

/* What is known of a frame before it is looked at. */
typedef struct bst_window_plan_input {
    const bst_camera *camera;
    const bst_imgproc_config *config;
    const bst_imgproc *ip; /* whose latest frame tells how bright stars must be */
    const bst_frame_message *message;
    const bst_camera_motion *motion;
    const bst_light *light;
    const bst_predictions *predictions;
    double predictions_age_s; /* in the middle of the exposure */
    bst_quat q_cam_from_gcrf; /* then */
} bst_window_plan_input;

/* Sets *windows round what the tracker predicts and round bright stars, those of `sky`, which are
 * set anew; *use false: the whole frame is to be looked at. Errors as bst_predicted_stars_expect.
 */
bst_status bst_window_plan_make(bst_ctx *ctx, const bst_window_plan_input *input,
                                bst_predicted_stars *sky, bst_region_of_interest *windows,
                                bool *use) BST_MUST_CHECK;

#endif
