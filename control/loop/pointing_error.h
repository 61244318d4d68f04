/* Observer of the attitude telemetry error: the rotation measured by the stars, and its rate. */
#ifndef BST_CONTROL_LOOP_POINTING_ERROR_H
#define BST_CONTROL_LOOP_POINTING_ERROR_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/messages.h"

/* q_true = q_telemetry * error, so that the camera looks at the true (inertial) direction s when
 * the telemetry's boresight is at rotate(error, s). In GCRF axes the error of a drifting body turns
 * about a fixed axis and camera slews leave it alone; as a quaternion it may grow without bound.
 *
 * Compensator. Per axis the state is [error, rate] with white acceleration of density q, measured
 * once a frame with standard deviation s: a Kalman filter. Its covariance is one for all axes and
 * does not depend on the data, so that after a dozen frames at a fixed interval T it is the
 * alpha-beta compensator that is optimal for lambda^2 = q T^3 / s^2 (Kalata, "The tracking index",
 * IEEE Trans. AES-20, 1984); before, and across lost frames, the covariance gives the gains that a
 * fixed compensator would not have.
 *
 * q. A disturbance with a flat spectrum up to fc and variance v per axis is not white acceleration;
 * what counts is the error of a prediction to the time of effect. Scanning q for measurement to
 * effect 0.65 to 1.65 s (one frame a second), fc = 0.05 Hz, v = (0.5 px)^2 / 2 gave, radial:
 *
 *     s, px      q = 1e-4   3e-4   1e-3   3e-3 px^2/s^3     alpha, beta at 1e-3
 *     0.02          0.09    0.07   0.06   0.07 px           0.83, 0.65
 *     0.05          0.18    0.13   0.11   0.11 px           0.68, 0.36
 *     0.10          0.26    0.20   0.17   0.17 px           0.55, 0.21
 *
 * q = v (2 pi fc)^3 / 4 is 1e-3 there and scales as the units demand. A constant drift costs
 * nothing: the rate state follows it without lag. */
typedef struct bst_pointing_error {
    double density; /* q, rad^2/s^3 */
    double sigma_floor_rad;
    double initial_sigma_rad, initial_rate_sigma_radps;
    bool started;
    int64_t tick; /* time of validity */
    bst_quat error;
    bst_vec3 rate_gcrf_radps;
    double p_ee, p_er, p_rr;
    int32_t taken;    /* fixes since the start */
    int32_t rejected; /* rejected fixes in a row */
} bst_pointing_error;

/* Initialises the observer; disturbance_rms_rad is radial (two axes). */
void bst_pointing_error_init(bst_pointing_error *e, double disturbance_rms_rad,
                             double disturbance_cutoff_hz, double sigma_floor_rad,
                             double initial_sigma_rad, double initial_rate_sigma_radps);

/* Saves or restores the observer's state, for bst_module_desc.archive. */
void bst_pointing_error_archive(bst_pointing_error *e, bst_archive *archive);

/* Updates the observer with an attitude fix. Invalid fixes and fixes older than the state are
 * ignored. A fix off by more than 8 sigma is rejected, but not more than three in a row; then the
 * filter restarts from it. The limit is lower after fewer than five fixes, and zero after two,
 * which only define error and rate.
 *
 * Returned:  true if the fix was used */
bool bst_pointing_error_update(bst_pointing_error *e, const bst_attitude_fix *fix,
                               double tick_rate_hz);

/* Error predicted to a tick, before or after the last fix. */
bst_quat bst_pointing_error_at(const bst_pointing_error *e, int64_t tick, double tick_rate_hz);

/* Removes corrections from commanded directions: [0] at a tick, [1] and [2] half_s seconds later
 * and earlier.
 *
 * Returned:  *direction   without its correction
 *            *rate_radps  its rate, rad/s */
void bst_pointing_error_uncorrect(const bst_quat correction[3], const bst_vec3 corrected[3],
                                  double half_s, bst_vec3 *direction, bst_vec3 *rate_radps);

#endif
