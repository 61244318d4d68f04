/* Gimbal axis: a command shaper within rate and acceleration limits, and a second-order servo. */
#ifndef BST_GIMBAL_MOUNT_AXIS_H
#define BST_GIMBAL_MOUNT_AXIS_H

#include <stdbool.h>

#include "boresight/archive.h"

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
    double angle_rad, rate_radps;          /* true; angle is not wrapped */
    bool limited;                          /* the last step reached a limit */
} bst_axis;

/* Initialises an axis at rest at angle 0. */
void bst_axis_init(bst_axis *axis, const bst_axis_spec *spec);

/* Command shaper: reference acceleration over the coming step, towards a target that is at
 * target_rad with rate target_radps at its end. Sets `limited` if a limit is reached. */
double bst_axis_shape(bst_axis *axis, double target_rad, double target_radps);

/* Advances an axis by dt_s towards a target that is at target_rad with rate target_radps at the end
 * of the step.
 *
 * Given:     noise_rad  encoder error during the step
 * Notes:     Shaper: the reference (p, v) approaches the target (r, w) along v - w = -f(p - r). f
 *            is linear with gain k near zero and sqrt(2 b |x|) beyond, joined smoothly, with b =
 *            0.8 of the allowed acceleration. Its acceleration A is bounded and constant over a
 *            step. It follows a constant-rate target without lag. Shaped limits are 0.95 of the
 *            axis limits; the remainder is for the servo. Servo: y'' = 2 d wn (v - y') + wn^2 (p -
 *            y - noise). With e = y - p, driven by -A - wn^2 noise held over the step, the
 *            transition matrix is exact for any damping. Motion beyond a limit is clipped. */
void bst_axis_step(bst_axis *axis, double target_rad, double target_radps, double noise_rad);

/* Archives reference and motion of an axis. */
void bst_axis_archive(bst_axis *axis, bst_archive *archive);

/* Adds turns * 2 pi to both angle and reference. */
void bst_axis_unwind(bst_axis *axis, double turns);

#endif
