/* Attitude and centre of mass of a target whose model is on board: hypotheses that compete. */
#ifndef BST_IMGPROC_EXTENDED_POSE_BANK_H
#define BST_IMGPROC_EXTENDED_POSE_BANK_H

#include <stdint.h>

#include "imgproc/extended/pose_filter.h"

/* Hypotheses, at most. */
enum { BST_POSE_BANK = 12 };

/* Hypotheses between frames; no pointers. All zero: none. */
typedef struct bst_pose_bank {
    bst_pose_filter filter[BST_POSE_BANK]; /* the best first */
    int count;
    uint32_t trial;  /* attitudes tried so far */
    double middle_s; /* time of the latest frame */
    double score;    /* of the best before this frame, faded */
} bst_pose_bank;

/* Estimate of a frame. */
typedef struct bst_pose_estimate {
    double x_px, y_px;             /* centre of mass, local axes of the sight */
    double cov_xx, cov_xy, cov_yy; /* px^2, with the differences of the hypotheses */
    double depth_m;                /* of the centre of mass along local z */
    double depth_sigma_share;      /* its standard deviation, share of it */
} bst_pose_estimate;

/* By how much the whole body of the best hypothesis is larger than the outline, px, at most as much
 * as that; 0: there is no hypothesis. */
double bst_pose_bank_hidden_px(const bst_pose_bank *bank, bst_target_model *model,
                               const bst_target_sight *sight);

/* Removes hypotheses that are no poses: after a state was restored from damaged bytes. */
void bst_pose_bank_check(bst_pose_bank *bank);

/* Follows the hypotheses to a frame, and tries new ones.
 *
 * Given:     sight     outline of the frame
 *            middle_s  time of its middle
 *            depth_m   of the target if no hypothesis is followed
 * Returned:  *out  estimate
 * Value:     false: no hypothesis explains the outline
 * Notes:     attitudes on trial are spread evenly over all rotations (Shoemake 1992, with an
 *            additive recurrence), each with the place and depth that fit best; the best few become
 *            hypotheses. Hypotheses have a score, the sum of their costs, which fades; the estimate
 *            is their mean with the weights exp(-score / 2). */
bool bst_pose_bank_step(bst_pose_bank *bank, bst_target_model *model, const bst_target_sight *sight,
                        double middle_s, double depth_m, bst_pose_estimate *out);

#endif
