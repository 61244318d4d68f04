/* Attitude and gyro-bias estimation from gyro and star trackers: multiplicative extended Kalman
 * filter.
 *
 * The attitude error e is the rotation of the true body relative to the estimate: q_true =
 * bst_quat_from_rotvec(-e) * q; b is the true minus the estimated bias. e' = -w x e - b - noise.
 * Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
 * section 6.2.4. */
#ifndef BST_GIMBAL_SPACECRAFT_ATTITUDE_FILTER_H
#define BST_GIMBAL_SPACECRAFT_ATTITUDE_FILTER_H

#include "boresight/archive.h"
#include "boresight/vec.h"

typedef struct bst_attitude_filter {
    bst_quat q_body_from_gcrf;
    bst_vec3 bias_radps;
    double covariance[6][6];      /* of (e, b) */
    double angle_walk, rate_walk; /* of the gyro, as bst_spacecraft_gyro */
} bst_attitude_filter;

/* Initialises the filter with an attitude of standard deviation sigma_rad and zero bias of standard
 * deviation bias_sigma_radps, per axis. */
void bst_attitude_filter_init(bst_attitude_filter *filter, bst_quat q_body_from_gcrf,
                              double sigma_rad, double bias_sigma_radps, double angle_walk,
                              double rate_walk);

/* Archives the estimate and its covariance. */
void bst_attitude_filter_archive(bst_attitude_filter *filter, bst_archive *archive);

/* Propagates the estimate over a gyro sample.
 *
 * Given:     sample_rad  measured rotation in dt_s, rad, body axes */
void bst_attitude_filter_propagate(bst_attitude_filter *filter, bst_vec3 sample_rad, double dt_s);

/* Updates the filter with an attitude measured age_s ago. Joseph form; the covariance is
 * symmetrised.
 *
 * Given:     error            bst_attitude_filter_error of the measurement relative to the estimate
 *                             at that time
 *            q_now_from_then  estimated rotation of the body since
 *            noise            covariance of the measurement, rad^2, body axes at that time
 * Returned:  correction  changes of e and b; may be NULL
 * Notes:     gyro noise since then is neglected: within a second it is far below a tracker's */
void bst_attitude_filter_update(bst_attitude_filter *filter, bst_vec3 error, double age_s,
                                bst_quat q_now_from_then, const bst_mat3 *noise,
                                bst_vec3 correction[2]);

/* Error e from `estimate` to `q`, by the shorter rotation. */
bst_vec3 bst_attitude_filter_error(bst_quat q, bst_quat estimate);

/* Steady-state standard deviations (rad, one axis) on a body at rest with one tracker of isotropic
 * noise every dt_s: just before and after a measurement, and of the bias (rad/s) after it.
 * Farrenkopf, J. Guidance and Control 1 (1978) 282, as solved by Markley and Reynolds, J. Guidance,
 * Control and Dynamics 23 (2000) 1073. */
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
