/* Configuration of the full gimbal types azimuth_elevation and cross_elevation. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_CONFIG_H
#define BST_GIMBAL_MOUNT_MOUNT_CONFIG_H

#include "boresight/compensator.h"
#include "gimbal/mount/mount_geometry.h"
#include "gimbal/mount/mount_joints.h"
#include "gimbal/platform.h"

/* Arrays of three are for the outer, inner and third axis. */
typedef struct bst_mount_friction_config {
    double coulomb_nm[3], breakaway_nm[3], stribeck_degps[3], viscous_nms_per_rad[3];
} bst_mount_friction_config;

typedef struct bst_mount_cable_config {
    double stiffness_nm_per_rad[3], zero_deg[3];
} bst_mount_cable_config;

typedef struct bst_mount_encoder_config {
    double resolution_arcsec, noise_arcsec;
} bst_mount_encoder_config;

typedef struct bst_mount_flexible_config {
    double frequency_hz[3], damping[3], inertia_fraction[3], line_of_sight_fraction[3];
} bst_mount_flexible_config;

typedef struct bst_mount_servo_config {
    bst_compensator_config compensator;
    int64_t delay_steps;
    double model_feed_forward, friction_feed_forward;
    double settle_tolerance_arcsec;
} bst_mount_servo_config;

typedef struct bst_mount_fault_config {
    int32_t stuck_axis; /* 0 none, 1 outer, ... */
    double stuck_from_s;
} bst_mount_fault_config;

typedef struct bst_mount_config {
    bool third_axis;
    double inertia_outer_kgm2[6], inertia_inner_kgm2[6], inertia_third_kgm2[6];
    double motor_torque_nm[3], rate_limit_degps[3], accel_limit_degps2[3];
    double travel_min_deg[3], travel_max_deg[3], start_deg[3];
    double stop_restitution;
    bst_mount_friction_config friction;
    bst_mount_cable_config cable;
    bst_mount_encoder_config encoder;
    bst_mount_flexible_config flexible;
    bst_mount_servo_config servo;
    bst_mount_fault_config fault;
    int32_t integrator; /* bst_mount_joint_method */
    bst_platform_config platform;
} bst_mount_config;

extern const bst_config_desc bst_mount_config_table[];

/* Creates the joints at the start angles, without faults.
 *
 * Errors:    BST_ERR_CONFIG, with the key, for an unphysical inertia, breakaway below Coulomb
 *            torque, empty travel, a start outside it, or a mode that leaves no inertia. Also for a
 *            step dt_s above a tenth of a mode's period; the message states the largest step */
bst_status bst_mount_config_joints(bst_ctx *ctx, int type, const bst_mount_config *config,
                                   double dt_s, bst_mount_joints *joints) BST_MUST_CHECK;

#endif
