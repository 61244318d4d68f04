/* One gimbal axis: a command shaper that respects the rate and acceleration limits, and a
 * second-order servo that follows it. */
#ifndef BST_GIMBAL_MOUNT_AXIS_H
#define BST_GIMBAL_MOUNT_AXIS_H

#include <stdbool.h>

typedef struct bst_axis_spec {
    double rate_limit_radps, accel_limit_radps2;
    double natural_frequency_radps, damping;
    double dt_s;
} bst_axis_spec;

typedef struct bst_axis {
    bst_axis_spec spec;
    double shaper_gain_per_s;
    /* exact discrete servo: error states (angle, rate) relative to the shaped reference */
    double phi[2][2], gamma[2];
    double reference_rad, reference_radps; /* shaped */
    double angle_rad, rate_radps;          /* true; angle not wrapped here */
    double accel_radps2;                   /* mean over the last step */
    bool limited;                          /* the last step met a limit */
} bst_axis;

/* At rest at angle 0. */
void bst_axis_init(bst_axis *axis, const bst_axis_spec *spec);

/* The shaper alone: the acceleration with which the reference goes through the coming step, towards
 * a target that will be at target_rad and move at target_radps at its end. Sets `limited` where a
 * limit is met. */
double bst_axis_shape(bst_axis *axis, double target_rad, double target_radps);

/* Advances by dt_s towards a target that will be at target_rad and move at target_radps at the end
 * of the step; noise_rad is the encoder's error during the step.
 *
 * Shaper: the reference (p, v) approaches the target (r, w) along v - w = -f(p - r), f linear with
 * gain k near zero and sqrt(2 b |x|) beyond, joined smoothly, b = 0.8 of the allowed acceleration;
 * its acceleration A is constant over a step and bounded, and it follows a target of constant rate
 * without lag. Shaped limits are 0.95 of the axis limits: the rest is left to the servo.
 *
 * Servo: y'' = 2 d wn (v - y') + wn^2 (p - y - noise). With e = y - p, driven by -A - wn^2 noise
 * held over the step, the transition matrix is exact for any damping. What would break a limit is
 * cut at it. */
void bst_axis_step(bst_axis *axis, double target_rad, double target_radps, double noise_rad);

/* Adds turns * 2 pi to angle and reference alike. */
void bst_axis_unwind(bst_axis *axis, double turns);

#endif
