/* Filter of the error of the attitude telemetry: a rotation vector that drifts.
 *
 * State in GCRF axes (the error belongs to the spacecraft's attitude knowledge, so it keeps its
 * inertial direction while the gimbal turns the camera): error e and rate r with
 * q_true = q_telemetry * bst_quat_from_rotvec(e); the rate walks at random. */
#ifndef BST_TRACKER_ATTITUDE_ATTITUDE_ERROR_H
#define BST_TRACKER_ATTITUDE_ATTITUDE_ERROR_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

typedef struct bst_attitude_error_params {
    double rate_sigma_radps; /* 1 sigma per axis of the drift rate before any fix */
    double noise_rad2ps3;    /* power spectral density of the drift rate's random walk */
    double jitter_rad;       /* 1 sigma per axis of a frame's own error, not carried to the next */
    double gate_chi2;        /* fixes beyond this (3 degrees of freedom) are not taken ... */
    int gate_patience;       /* ... until this many in a row, fewer while only a few were taken:
                                then the filter starts anew */
    double telemetry_sigma_rad; /* 1 sigma per axis of the telemetry before any fix */
} bst_attitude_error_params;

typedef struct bst_attitude_error {
    bool started;
    double e[6];    /* rad, rad/s */
    double p[6][6]; /* covariance */
    int fixes;      /* taken since the start */
    int rejected_in_row;
} bst_attitude_error;

/* Moves the state by dt_s >= 0. */
void bst_attitude_error_predict(bst_attitude_error *filter, const bst_attitude_error_params *params,
                                double dt_s);

/* Takes a fix: error e_cam_rad in camera axes with covariance (camera axes, rad^2), as
 * bst_attitude_fix has it, the camera's telemetry attitude being q_telemetry_from_gcrf. True when
 * it was taken, false when gated out. */
bool bst_attitude_error_update(bst_attitude_error *filter, const bst_attitude_error_params *params,
                               bst_quat q_telemetry_from_gcrf, bst_vec3 e_cam_rad,
                               const double covariance_cam[3][3]);

/* The predicted error of a frame in the axes of a camera at q_telemetry_from_gcrf: error, rate and
 * covariance (jitter included; may be NULL). Before any fix: zero, with the telemetry's sigma. */
void bst_attitude_error_get(const bst_attitude_error *filter,
                            const bst_attitude_error_params *params, bst_quat q_telemetry_from_gcrf,
                            bst_vec3 *e_cam_rad, bst_vec3 *rate_cam_radps,
                            double covariance_cam[3][3]);

#endif
