/* One hypothesis of a target's attitude, rotation and range, followed from outline to outline. */
#ifndef BST_IMGPROC_EXTENDED_POSE_FILTER_H
#define BST_IMGPROC_EXTENDED_POSE_FILTER_H

#include "imgproc/extended/target_model.h"

/* State: turn of the body (3, rad, body axes), its rate (3, rad/s), logarithm of the depth and its
 * rate (1/s); then, of the current frame alone, the centre of mass (2, px). */
enum { BST_POSE_STATES = 8, BST_POSE_UNKNOWNS = 10 };

/* A hypothesis; no pointers. */
typedef struct bst_pose_filter {
    bst_target_pose pose;
    bst_vec3 rate_radps; /* body axes */
    double approach;     /* rate of the logarithm of the depth, 1/s */
    double covariance[BST_POSE_STATES * BST_POSE_STATES];
    double centre_xx, centre_xy, centre_yy; /* of x_px, y_px */
    double cost;   /* of the latest frame: robust square sum of the residuals and of the changes */
    double inside; /* share of the directions that agree with the outline */
    double score;  /* fading sum of costs */
    int frames;    /* that it has followed */
} bst_pose_filter;

/* Starts a hypothesis at a pose, which is uncertain by the given standard deviations, with an
 * unknown rate. */
void bst_pose_filter_start(bst_pose_filter *filter, const bst_target_pose *pose, double turn_rad,
                           double depth_share);

/* Moves a hypothesis on by some seconds: the rate is constant in the body but for noise, since a
 * body without torque changes it by up to about its square per second. */
void bst_pose_filter_predict(bst_pose_filter *filter, double seconds);

/* Fits a hypothesis to an outline.
 *
 * Given:     start   pose at which the search starts; the prior is that of the filter
 *            rounds  of Gauss-Newton
 * Returned:  false: nothing of the model is seen in that pose; the filter is unchanged
 * Notes:     unknowns are the states, with the prediction as prior, and the place of the centre of
 *            mass. Residuals are the differences of the outlines along BST_TARGET_DIRECTIONS, with
 *            a loss that ends (Geman and McClure 1987): parts that are dark or hidden make the
 *            measured outline too small, which costs no more than some sigma. Surfaces that appear
 *            and vanish make steps in the cost: the best round counts, not the last. */
bool bst_pose_filter_update(bst_pose_filter *filter, bst_target_model *model,
                            const bst_target_sight *sight, const bst_target_pose *start,
                            int rounds);

/* Standard deviation of a measured outline along a direction, px. */
double bst_pose_filter_sigma_px(const bst_target_sight *sight);

/* Robust square sum of the differences of two outlines.
 *
 * Given:     scale  factor on the width of the loss
 * Returned:  *inside  share of directions within twice the standard deviation; may be NULL */
double bst_pose_filter_cost(const bst_target_sight *sight, const bst_target_outline *outline,
                            double scale, double *inside);

/* Weight of a residual, 1 / px^2. */
double bst_pose_filter_weight(double residual_px, double sigma_px, double scale);

#endif
