/* Tracking loop as a linear sampled system: frames measure the pointing with latency, averaged over
 * their exposure; control corrects the command once per frame; the mount follows with its own
 * dynamics. */
#ifndef BST_CONTROL_LOOP_TRACKING_LOOP_H
#define BST_CONTROL_LOOP_TRACKING_LOOP_H

#include "control/loop/stability.h"

/* Mount response sampled every dt_s: to a unit step of the commanded angle, from the step in which
 * the change arrives, and lag behind a unit-rate ramp that starts then (commanded minus actual
 * angle). Both must settle: step at 1, lag at 0. count 0: an ideal mount with delay delay_s that
 * follows rates at once. */
typedef struct bst_control_servo_response {
    double dt_s, delay_s;
    int count;
    const double *step, *ramp_lag;
} bst_control_servo_response;

typedef struct bst_tracking_timing {
    double period_s, exposure_s;
    double arrival_s; /* from mid-exposure until control has the measurement */
    double effect_s;  /* from mid-exposure to the time for which control computes its command */
    double switch_s;  /* from mid-exposure until the mount acts on the command */
} bst_tracking_timing;

/* Alpha-beta filter of the disturbance, and the error of its mount model: the frames show
 * motion_gain times the motion reported by telemetry, motion_late_s later. */
typedef struct bst_tracking_observer {
    double alpha, beta;
    double motion_gain, motion_late_s; /* 1, 0: no model error */
} bst_tracking_observer;

typedef struct bst_tracking_loop bst_tracking_loop;

/* Creates the loop of one axis. The measured error m_k of frame k is the disturbance d averaged
 * over the exposure, minus the mount's angle with a compensator. The correction is the integral of
 * the compensator's output, or the observer's estimate of d extrapolated at its rate. Servo
 * response and compensator (NULL: observer) are copied. Errors: BST_ERR_MEMORY. */
bst_status bst_tracking_loop_create(bst_ctx *ctx, const bst_tracking_timing *timing,
                                    const bst_control_servo_response *servo,
                                    const bst_compensator *compensator,
                                    const bst_tracking_observer *observer,
                                    bst_tracking_loop **out) BST_MUST_CHECK;
/* Frees a tracking loop; NULL is allowed. */
void bst_tracking_loop_free(bst_tracking_loop *loop);

/* Plant of the compensator: from its output to the mount's angle as seen by the frames, at omega
 * rad/s.
 *
 * Given:     user  a bst_tracking_loop */
double complex bst_tracking_plant(const void *user, double omega_radps);

/* Open loop, broken where the mount's motion appears in the frames.
 *
 * Given:     user  a bst_tracking_loop
 * Notes:     With a compensator it is compensator times plant. The observer subtracts the motion
 *            reported by telemetry, so there is no feedback as long as telemetry is right. Its open
 *            loop is g H(tau) / (1 - H(0)). H(tau) is the motion in the frames tau later relative
 *            to the measurement; g and tau are the model error. Its margins are how much more, or
 *            later, the image may move than telemetry reports. If a correction acts before the next
 *            exposure starts, this is the observer's own loop broken at the innovation. With longer
 *            latency the open loop has poles outside the unit circle: the zeros of 1 - H(0).
 * Reference: Morari and Zafiriou, Robust Process Control, 1989, chapter 3 (internal model control)
 */
double complex bst_tracking_open(const void *user, double omega_radps);

/* Open loop if the frames show the motion later_s later still. */
double complex bst_tracking_open_later(const void *user, double omega_radps, double later_s);

/* Response of 1 - H(0), the denominator of the observer's open loop; 1 with a compensator. */
double complex bst_tracking_denominator(const void *user, double omega_radps);

/* Loop for bst_loop_analyse; it refers to `tracking`. */
bst_loop bst_tracking_as_loop(const bst_tracking_loop *tracking);

/* Disturbance rejection: pointing error relative to the disturbance at omega rad/s (any), at
 * offset_s from mid-exposure. */
double complex bst_tracking_rejection(const bst_tracking_loop *loop, double omega_radps,
                                      double offset_s);
/* Noise transfer: pointing error relative to the frames' measurement error at omega rad/s below
 * half the frame rate, at offset_s from mid-exposure. */
double complex bst_tracking_noise(const bst_tracking_loop *loop, double omega_radps,
                                  double offset_s);

/* Flat band of a one-sided spectral density (density times width = variance), any unit; with equal
 * frequencies a line. */
typedef struct bst_tracking_band {
    double low_hz, high_hz, variance;
} bst_tracking_band;

/* Mean square pointing error at mid-exposure caused by disturbance bands. */
double bst_tracking_variance(const bst_tracking_loop *loop, const bst_tracking_band *bands,
                             int count);
/* Mean square pointing error caused by white measurement noise of unit variance per frame. */
double bst_tracking_noise_gain(const bst_tracking_loop *loop);
/* Lag behind a disturbance that grows at unit rate, s. */
double bst_tracking_lag(const bst_tracking_loop *loop);

/* Steady-state gains of the Kalman filter of control/loop/pointing_error.h.
 *
 * Given:     density    white acceleration, rad^2/s^3
 *            sigma_rad  measurement noise, every period_s */
void bst_tracking_observer_gains(double density, double sigma_rad, double period_s, double *alpha,
                                 double *beta);

#endif
