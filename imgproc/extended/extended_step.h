/* Extended targets in the processing of one frame by the module. */
#ifndef BST_IMGPROC_EXTENDED_EXTENDED_STEP_H
#define BST_IMGPROC_EXTENDED_EXTENDED_STEP_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "imgproc/extended/handover.h"
#include "imgproc/extended/target_fit.h"
#include "sim/optics/photometry.h"

/* State between frames, and targets of the current frame. */
typedef struct bst_extended_step {
    const bst_extended_config *config;
    bst_handover handover;
    bst_extended_view view;
    bst_quat q_cam_from_gcrf;
    double middle_s;                 /* middle of the exposure */
    bst_target_model_fit fit;        /* of the largest target, with config->target_model */
    bst_silhouettes targets, points; /* extended ones, and small ones that stay points */
} bst_extended_step;

/* Onboard knowledge of the frame. */
typedef struct bst_extended_input {
    const bst_camera *camera;
    const bst_frame_message *message;
    const bst_silhouettes *silhouettes; /* of the frame */
    bool sun_known;
    bst_vec3 sun_m; /* observer to Sun, GCRF */
    bst_quat q_cam_from_gcrf;
    double middle_s; /* middle of the exposure */
} bst_extended_input;

/* Opens the step: reads config->target_model, if there is one.
 *
 * Given:     config  outlives the step
 *            whole   frames are processed one by one and as a whole
 * Errors:    BST_ERR_CONFIG if extended targets are wanted without that; those of
 *            bst_target_model_load
 * Ownership: free with bst_extended_step_close, also after an error */
bst_status bst_extended_step_open(bst_ctx *ctx, bst_extended_step *step,
                                  const bst_extended_config *config, bool whole) BST_MUST_CHECK;
/* Frees the model; the struct belongs to the caller. */
void bst_extended_step_close(bst_extended_step *step);

/* Selects the extended targets (bst_handover_select). Call it before stars are identified. Without
 * config->enabled it does nothing. */
void bst_extended_step_begin(bst_extended_step *step, const bst_extended_input *input,
                             bst_detections *out);

/* Appends a detection for each selected target; of a full message the last detection is lost. With
 * a model on board the largest one has the place that follows from it (bst_target_fit_measure).
 * Objects that are almost large enough are moved by the offset of their centroid of light, so that
 * the position is continuous (bst_extended_correct_point).
 *
 * Given:     exposure_s  of the frame
 *            zero_point  of the frame
 *            capacity    items that `out` has room for */
void bst_extended_step_append(bst_extended_step *step, double exposure_s,
                              const bst_optics_zero_point *zero_point, bst_detections *out,
                              int capacity);

/* Saves or restores the state between frames. */
void bst_extended_step_archive(bst_extended_step *step, bst_archive *archive);

#endif
