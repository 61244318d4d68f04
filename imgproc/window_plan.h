/* Plans the windows of a frame to search while a target is tracked. */
#ifndef BST_IMGPROC_WINDOW_PLAN_H
#define BST_IMGPROC_WINDOW_PLAN_H

#include "imgproc/detect/region_of_interest.h"
#include "imgproc/identify/predicted_stars.h"

/* Onboard knowledge of a frame before it is searched. */
typedef struct bst_window_plan_input {
    const bst_camera *camera;
    const bst_imgproc_config *config;
    double v_limit; /* V magnitude of the faintest star that gets a window */
    const bst_frame_message *message;
    const bst_camera_motion *motion;
    const bst_light *light;
    const bst_predictions *predictions;
    double predictions_age_s; /* at mid-exposure */
    bst_quat q_cam_from_gcrf; /* at mid-exposure */
} bst_window_plan_input;

/* Plans windows about the tracker's predicted positions and about bright stars.
 *
 * Returned:  *windows  full-sensor px
 *            sky->expected  updated
 *            *use      false: search the whole frame
 * Errors:    those of bst_predicted_stars_expect */
bst_status bst_window_plan_make(bst_ctx *ctx, const bst_window_plan_input *input,
                                bst_predicted_stars *sky, bst_region_of_interest *windows,
                                bool *use) BST_MUST_CHECK;

#endif
