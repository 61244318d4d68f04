/* Centre of mass of an extended target by a model on board that is fitted to its outline. */
#ifndef BST_IMGPROC_EXTENDED_TARGET_FIT_H
#define BST_IMGPROC_EXTENDED_TARGET_FIT_H

#include "boresight/archive.h"
#include "imgproc/extended/centre_of_mass.h"
#include "imgproc/extended/pose_bank.h"

/* State between frames, and the model. All zero: no model. */
typedef struct bst_target_model_fit {
    bst_target_model *model;
    bst_pose_bank bank;
} bst_target_model_fit;

/* What the fit needs of a frame besides the silhouette. */
typedef struct bst_target_fit_frame {
    const bst_extended_view *view;
    bst_quat q_cam_from_gcrf;
    double middle_s, exposure_s;
} bst_target_fit_frame;

/* Fits the model to a silhouette, and moves the detection to the centre of mass that follows.
 *
 * Given:     config     target_model_sigma
 *            detection  as bst_extended_measure left it
 * Returned:  *detection  position, covariance and range. Unchanged if no hypothesis explains the
 *                        outline, or the centre of the hypotheses is less certain than the
 *                        outline's, or far from it (8 standard deviations); but the covariance
 *                        grows if the whole model is larger than the outline
 * Notes:     a target that touches the frame's edge, or a frame without the Sun's direction, is not
 *            fitted. */
void bst_target_fit_measure(bst_target_model_fit *fit, const bst_extended_config *config,
                            const bst_target_fit_frame *frame, const bst_silhouette *silhouette,
                            bst_detection *detection);

/* Saves or restores the state between frames. */
void bst_target_fit_archive(bst_target_model_fit *fit, bst_archive *archive);

#endif
