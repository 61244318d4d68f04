/* Linear model of one axis of a mount and its servo at an operating point, for stability analysis
 * and for the design of the servo's compensator. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_RESPONSE_H
#define BST_GIMBAL_MOUNT_MOUNT_RESPONSE_H

#include <complex.h>

#include "gimbal/mount/mount_config.h"

/* One axis, the others held in place: inertia, viscous friction, cable, flexible mode; motor torque
 * held over each step. Sliding and static friction, limits, encoder steps and the coupling of the
 * axes by rates are not in it. State [angle, rate, flex angle, flex rate], input acceleration asked
 * for, rad/s^2: x(n + 1) = step x(n) + drive u(n - delay). */
typedef struct bst_mount_linear {
    double inertia_kgm2; /* about the axis, with all that it carries */
    double dt_s;
    int delay_steps;
    double step[4][4], drive[4];
    double line_of_sight_fraction; /* of the flex angle */
} bst_mount_linear;

/* Linearises axis k of the joints at angles; exact for the step dt_s (matrix exponential). */
void bst_mount_linearise(const bst_mount_joints *joints, int axis,
                         const double angle_rad[BST_CHAIN_MOST], double dt_s, int delay_steps,
                         double line_of_sight_fraction, bst_mount_linear *out);

/* Sampled frequency response of the axis from the commanded acceleration to the encoder angle.
 *
 * Given:     omega_radps  angular frequency, rad/s
 * Returned:  rad per rad/s^2, with the delay */
double complex bst_mount_linear_encoder(const bst_mount_linear *linear, double omega_radps);

/* Sampled frequency response of the axis from the commanded acceleration to the line of sight.
 *
 * Given:     omega_radps  angular frequency, rad/s
 * Returned:  rad per rad/s^2, with the delay and the line of sight's share of the flex angle */
double complex bst_mount_linear_sight(const bst_mount_linear *linear, double omega_radps);

/* One axis with its servo. At a frequency, all of the sampled signals at the plant's rate, delays
 * in them: */
typedef struct bst_mount_axis_model {
    bst_mount_linear linear;
    bst_compensator compensator;
    double reference_feed_forward; /* share of the reference's acceleration */
    double model_feed_forward;
    double viscous_nms, spring_nm; /* fed forward by the reference's rate and angle */
} bst_mount_axis_model;

typedef struct bst_mount_axis_gains {
    double complex plant;       /* torque of the motor, N m, to encoder angle, rad */
    double complex compensator; /* encoder's error, rad, to torque, N m; the open loop of the servo
                                   is compensator * plant */
    double complex command;     /* commanded angle to angle of the line of sight */
    double complex encoder_noise; /* error of the encoder's reading to angle of the line of sight */
    double complex disturbance;   /* torque on the axis, N m, held over a step, to angle of the line
                                     of   sight, rad */
} bst_mount_axis_gains;

/* The model of one axis (0 outer, 1 inner, 2 third) of a mount of a type with this configuration,
 * at angles, for a plant step of dt_s. BST_ERR_CONFIG as bst_mount_config_joints and
 * bst_compensator_init; BST_ERR_ARGUMENT for an axis that the mount lacks. */
bst_status bst_mount_axis_model_init(bst_ctx *ctx, int type, const bst_mount_config *config,
                                     const double angle_rad[BST_CHAIN_MOST], double dt_s, int axis,
                                     bst_mount_axis_model *out) BST_MUST_CHECK;

/* Responses at a frequency above zero and below half the plant's rate. The command is that of the
 * shaped reference: a command within the limits of rate and acceleration is followed by it without
 * lag (gain one). */
void bst_mount_axis_response(const bst_mount_axis_model *model, double frequency_hz,
                             bst_mount_axis_gains *out);

/* The servo's compensator of an axis, by gains or designed for `linear`. */
bst_status bst_mount_servo_compensator(bst_ctx *ctx, const bst_mount_servo_config *config,
                                       const bst_mount_linear *linear,
                                       bst_compensator *out) BST_MUST_CHECK;

#endif
