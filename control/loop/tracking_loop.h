/* The tracking loop as a linear sampled system: frames measure the pointing late and averaged over
 * their exposure, control corrects the command once a frame, and the mount follows it in its own
 * time. */
#ifndef BST_CONTROL_LOOP_TRACKING_LOOP_H
#define BST_CONTROL_LOOP_TRACKING_LOOP_H

#include "control/loop/stability.h"

/* How a mount follows: its response, sampled every dt_s from the step in which the change arrives
 * on, to a unit step of the commanded angle, and its lag behind a command that begins to move at a
 * unit rate then (angle asked for minus angle). Both end at rest: step at 1, lag at 0. With count 0
 * the mount does what is asked, delay_s late, and follows rates at once. */
typedef struct bst_control_servo_response {
    double dt_s, delay_s;
    int count;
    const double *step, *ramp_lag;
} bst_control_servo_response;

typedef struct bst_tracking_timing {
    double period_s, exposure_s;
    double arrival_s; /* from the middle of an exposure until control has what it showed */
    double effect_s;  /* the same until the time that control computes its command for */
    double switch_s;  /* the same until the mount acts on it */
} bst_tracking_timing;

/* An alpha-beta filter of the disturbance, and what is wrong with its model of the mount: the
 * frames show motion_gain times the motion that telemetry reports, motion_late_s later. */
typedef struct bst_tracking_observer {
    double alpha, beta;
    double motion_gain, motion_late_s; /* 1, 0: nothing */
} bst_tracking_observer;

typedef struct bst_tracking_loop bst_tracking_loop;

/* Per axis: the measured error m_k of frame k, d averaged over the exposure and, with a
 * compensator, less the mount's angle; then either the compensator's output as the rate of the
 * correction, or the observer's estimate of d carried along with its rate. Copies the servo's
 * response and the compensator or, where that is NULL, the observer. BST_ERR_MEMORY. */
bst_status bst_tracking_loop_create(bst_ctx *ctx, const bst_tracking_timing *timing,
                                    const bst_control_servo_response *servo,
                                    const bst_compensator *compensator,
                                    const bst_tracking_observer *observer,
                                    bst_tracking_loop **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_tracking_loop_free(bst_tracking_loop *loop);

/* What the compensator is designed against: from its output to the mount's angle as the frames see
 * it, at omega rad/s. `user` is a bst_tracking_loop. */
double complex bst_tracking_plant(const void *user, double omega_radps);

/* The open loop, broken where the mount's motion shows in the frames: compensator times plant. The
 * observer takes from each measurement what telemetry says of that motion, and so has no loop as
 * long as telemetry is right; its open loop is g H(tau) / (1 - H(0)), H(tau) from a measurement to
 * the motion that it brings about in the frames tau later, g and tau the error of the model: its
 * margins are how much more, or later, the image may move than telemetry says (internal model
 * control: Morari and Zafiriou, Robust Process Control, 1989, chapter 3). When a correction acts
 * before the next exposure begins, that is the observer's own loop broken at the innovation. With
 * more latency the open loop has poles outside the unit circle, the zeros of 1 - H(0) there.
 * `user` is a bst_tracking_loop. */
double complex bst_tracking_open(const void *user, double omega_radps);

/* The same when the frames show the motion later_s later still. */
double complex bst_tracking_open_later(const void *user, double omega_radps, double later_s);

/* Response of 1 - H(0), the denominator of the observer's open loop; 1 with a compensator. */
double complex bst_tracking_denominator(const void *user, double omega_radps);

/* The loop for bst_loop_analyse; it refers to `tracking`. */
bst_loop bst_tracking_as_loop(const bst_tracking_loop *tracking);

/* Pointing error over disturbance at omega rad/s (any), at offset_s from the middle of each
 * exposure: the disturbance of unit amplitude less what the mount makes up for. */
double complex bst_tracking_rejection(const bst_tracking_loop *loop, double omega_radps,
                                      double offset_s);
/* Pointing error there over the frames' measurement error, at omega rad/s below half the frame
 * rate. */
double complex bst_tracking_noise(const bst_tracking_loop *loop, double omega_radps,
                                  double offset_s);

/* A flat band of one-sided spectral density (mean square per Hz times width = variance), or with
 * both frequencies the same a line. Any unit. */
typedef struct bst_tracking_band {
    double low_hz, high_hz, variance;
} bst_tracking_band;

/* Mean square of the pointing error at the middle of the exposures that bands leave. */
double bst_tracking_variance(const bst_tracking_loop *loop, const bst_tracking_band *bands,
                             int count);
/* That of white measurement noise of unit variance a frame. */
double bst_tracking_noise_gain(const bst_tracking_loop *loop);
/* The lag behind a disturbance that grows at a unit rate, s. */
double bst_tracking_lag(const bst_tracking_loop *loop);

/* Gains of the Kalman filter of control/loop/pointing_error.h at rest: white acceleration of
 * density (rad^2/s^3), measured with standard deviation sigma_rad every period_s. */
void bst_tracking_observer_gains(double density, double sigma_rad, double period_s, double *alpha,
                                 double *beta);

#endif
