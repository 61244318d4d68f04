/* Linear model of a mount axis and its servo at an operating point, for stability analysis and
 * compensator design. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_RESPONSE_H
#define BST_GIMBAL_MOUNT_MOUNT_RESPONSE_H

#include <complex.h>

#include "gimbal/mount/mount_config.h"

/* Linear plant of one axis with the others locked: inertia, viscous friction, cable, flexible mode;
 * motor torque held over each step. Not included: sliding and static friction, limits, encoder
 * quantisation and rate coupling. State [angle, rate, flex angle, flex rate], input commanded
 * acceleration, rad/s^2: x(n + 1) = step x(n) + drive u(n - delay). */
typedef struct bst_mount_linear {
    double inertia_kgm2; /* about the axis, including all stages on it */
    double dt_s;
    int delay_steps;
    double step[4][4], drive[4];
    double line_of_sight_fraction; /* of the flex angle */
} bst_mount_linear;

/* Linearises axis k of the joints at given angles; exact for the step dt_s (matrix exponential). */
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

/* Linear model of one axis with its servo. */
typedef struct bst_mount_axis_model {
    bst_mount_linear linear;
    bst_compensator compensator;
    double reference_feed_forward; /* share of the reference's acceleration */
    double model_feed_forward;
    double viscous_nms, spring_nm; /* fed forward from the reference's rate and angle */
} bst_mount_axis_model;

/* Frequency responses of an axis; all signals sampled at the plant rate, delays included. */
typedef struct bst_mount_axis_gains {
    double complex plant; /* motor torque, N m, to encoder angle, rad */
    /* encoder error, rad, to torque, N m; the servo's open loop is compensator * plant */
    double complex compensator;
    double complex command;       /* commanded angle to line-of-sight angle */
    double complex encoder_noise; /* encoder error to line-of-sight angle */
    /* torque on the axis, N m, held over a step, to line-of-sight angle, rad */
    double complex disturbance;
} bst_mount_axis_gains;

/* Creates the model of one axis (0 outer, 1 inner, 2 third) of a mount at given angles for a plant
 * step dt_s.
 *
 * Errors:    BST_ERR_CONFIG as bst_mount_config_joints and bst_compensator_init; BST_ERR_ARGUMENT
 *            for an axis that the mount lacks */
bst_status bst_mount_axis_model_init(bst_ctx *ctx, int type, const bst_mount_config *config,
                                     const double angle_rad[BST_CHAIN_MOST], double dt_s, int axis,
                                     bst_mount_axis_model *out) BST_MUST_CHECK;

/* Frequency responses above zero and below half the plant rate. The command is the shaped
 * reference, which follows a command within the rate and acceleration limits without lag (gain
 * one). */
void bst_mount_axis_response(const bst_mount_axis_model *model, double frequency_hz,
                             bst_mount_axis_gains *out);

/* Compensator of an axis' servo, by configured gains or designed for `linear`. */
bst_status bst_mount_servo_compensator(bst_ctx *ctx, const bst_mount_servo_config *config,
                                       const bst_mount_linear *linear,
                                       bst_compensator *out) BST_MUST_CHECK;

#endif
