/* Attitude and gyro bias from a gyro and star trackers: a multiplicative extended Kalman filter.
 *
 * The error e of the attitude is the body's true turn against the estimate: q_true =
 * bst_quat_from_rotvec(-e) * q; b is the true bias minus the estimated one. e' = -w x e - b -
 * noise. Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control
 * (2014), section 6.2.4. */
#ifndef BST_GIMBAL_SPACECRAFT_ATTITUDE_FILTER_H
#define BST_GIMBAL_SPACECRAFT_ATTITUDE_FILTER_H

#include "boresight/vec.h"

typedef struct bst_attitude_filter {
    bst_quat q_body_from_gcrf;
    bst_vec3 bias_radps;
    double covariance[6][6];      /* of (e, b) */
    double angle_walk, rate_walk; /* of the gyro, as bst_spacecraft_gyro */
} bst_attitude_filter;

/* Starts with an attitude of standard deviation sigma_rad and a bias of zero with
 * bias_sigma_radps, about each axis. */
void bst_attitude_filter_init(bst_attitude_filter *filter, bst_quat q_body_from_gcrf,
                              double sigma_rad, double bias_sigma_radps, double angle_walk,
                              double rate_walk);

/* Carries the estimate over a gyro sample: the angle (rad, body axes) that it says was turned in
 * dt_s. */
void bst_attitude_filter_propagate(bst_attitude_filter *filter, bst_vec3 sample_rad, double dt_s);

/* Takes in an attitude measured age_s ago. error: bst_attitude_filter_error of the measurement
 * against the estimate of then; q_now_from_then: the body's turn since, as estimated; noise: the
 * measurement's covariance, rad^2, body axes of then. The covariance follows in Joseph's form and
 * is made symmetric. correction (may be NULL): the changes of e and b. The gyro's noise since then
 * is left out of account: within a second it is far below a tracker's. */
void bst_attitude_filter_update(bst_attitude_filter *filter, bst_vec3 error, double age_s,
                                bst_quat q_now_from_then, const bst_mat3 *noise,
                                bst_vec3 correction[2]);

/* The error e that takes `estimate` to `q`, the short way round. */
bst_vec3 bst_attitude_filter_error(bst_quat q, bst_quat estimate);

/* Standard deviations (rad, about one axis) that the filter comes to on a resting body with one
 * tracker of equal noise about all axes every dt_s: just before and just after a measurement, and
 * of the bias (rad/s) after it. Farrenkopf, J. Guidance and Control 1 (1978) 282, as solved by
 * Markley and Reynolds, J. Guidance, Control and Dynamics 23 (2000) 1073. */
typedef struct bst_attitude_steady {
    double before_rad, after_rad, bias_radps;
} bst_attitude_steady;

/* Steady standard deviations (see bst_attitude_steady).
 *
 * Given:     angle_walk  angle random walk of the gyro, rad/sqrt(s)
 *            rate_walk   rate random walk of the gyro, rad/s/sqrt(s)
 *            noise_rad   noise of a measurement, 1 sigma per axis
 *            dt_s        time between measurements, s */
bst_attitude_steady bst_attitude_steady_state(double angle_walk, double rate_walk, double noise_rad,
                                              double dt_s);

#endif
