/* Kalman filter of the attitude telemetry error: a drifting rotation vector.
 *
 * State in GCRF axes: error e and rate r with q_true = q_telemetry * bst_quat_from_rotvec(e). The
 * error belongs to the spacecraft's attitude knowledge and keeps its inertial direction while the
 * gimbal turns the camera. The rate is a random walk. */
#ifndef BST_TRACKER_ATTITUDE_ATTITUDE_ERROR_H
#define BST_TRACKER_ATTITUDE_ATTITUDE_ERROR_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

typedef struct bst_attitude_error_params {
    double rate_sigma_radps; /* 1 sigma per axis of the drift rate before any fix */
    double noise_rad2ps3;    /* power spectral density of the drift rate's random walk */
    double jitter_rad; /* 1 sigma per axis of a frame's own error, uncorrelated between frames */
    double gate_chi2;  /* fixes with a larger chi-square (3 degrees of freedom) are rejected ... */
    /* ... unless so many in a row are rejected (fewer after few accepted fixes): the filter then
     * restarts */
    int gate_patience;
    double telemetry_sigma_rad; /* 1 sigma per axis of the telemetry before any fix */
} bst_attitude_error_params;

typedef struct bst_attitude_error {
    bool started;
    double e[6];    /* rad, rad/s */
    double p[6][6]; /* covariance */
    int fixes;      /* accepted since the start */
    int rejected_in_row;
} bst_attitude_error;

/* Predicts the attitude error over dt_s >= 0. */
void bst_attitude_error_predict(bst_attitude_error *filter, const bst_attitude_error_params *params,
                                double dt_s);

/* Updates the filter with an attitude fix.
 *
 * Given:     e_cam_rad       measured attitude error in camera axes
 *            covariance_cam  its covariance, camera axes, rad^2
 *            q_telemetry_from_gcrf  camera attitude by telemetry
 * Returned:  false if the fix is gated out */
bool bst_attitude_error_update(bst_attitude_error *filter, const bst_attitude_error_params *params,
                               bst_quat q_telemetry_from_gcrf, bst_vec3 e_cam_rad,
                               const double covariance_cam[3][3]);

/* Predicted attitude error, rate and covariance (jitter included; may be NULL) of a frame in the
 * axes of a camera at q_telemetry_from_gcrf. Before any fix: zero, with the telemetry's sigma. */
void bst_attitude_error_get(const bst_attitude_error *filter,
                            const bst_attitude_error_params *params, bst_quat q_telemetry_from_gcrf,
                            bst_vec3 *e_cam_rad, bst_vec3 *rate_cam_radps,
                            double covariance_cam[3][3]);

#endif
