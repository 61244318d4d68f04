/* Channel mount_status: geometry, limits and state of the mount, as known on board. */
#ifndef BORESIGHT_MESSAGES_MOUNT_STATUS_H
#define BORESIGHT_MESSAGES_MOUNT_STATUS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_MOUNT_STATUS "mount_status"

enum { BST_MOUNT_AXES = 3 }; /* greatest number of axes of a mount */

enum {
    BST_AXIS_STUCK = 1u << 0,     /* does not follow its command */
    BST_AXIS_SATURATED = 1u << 1, /* at its rate, acceleration or torque limit */
    BST_AXIS_AT_STOP = 1u << 2,   /* held by the end of its travel */
};

/* One axis of a mount. Limits are those for commands. */
typedef struct bst_mount_axis {
    bst_vec3 axis_body; /* unit: axis of rotation, right-handed, when all angles are zero */
    double angle_rad;   /* encoder, with whole turns: cable winding */
    double rate_radps;
    double rate_limit_radps, accel_limit_radps2; /* 0: none */
    double min_rad, max_rad; /* travel; both 0: unlimited rotation, angle_rad in (-pi, pi] */
    bool redundant; /* not needed to reach a direction: the mount follows its axis_near_rad, or
                       chooses its angle */
    uint32_t flags; /* BST_AXIS_... */
} bst_mount_axis;

/* Rotation of the body about the axis of its pointing law, on command. */
typedef struct bst_body_roll {
    bst_vec3 axis_body; /* unit; zero: no such rotation */
    double angle_rad, rate_radps;
    double rate_limit_radps, accel_limit_radps2;
} bst_body_roll;

/* mount_status (latest): geometry, limits and state of the mount, as known onboard, at the rate of
 * pointing_telemetry. The attitude of the camera in the body is q_body_from_cam = R(axis 0, angle
 * 0) R(axis 1, angle 1) ... q_body_from_cam_at_zero, axes in order from the body outwards to the
 * camera, R(a, t) the rotation by t about a. */
typedef struct bst_mount_status {
    int64_t tick; /* of validity */
    int32_t axes; /* 0: follows any command at once (an ideal mount) */
    bool wheels_saturated;
    bst_quat q_body_from_cam_at_zero;
    bst_quat q_body_from_gcrf; /* measured */
    bst_vec3 rate_body_radps;  /* measured inertial rate of the body, body axes */
    bst_body_roll roll;
    bst_mount_axis axis[BST_MOUNT_AXES];
} bst_mount_status;

#endif
