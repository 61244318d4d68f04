/* Geometry of the full mounts: axes, attitude of the camera, and how a direction is laid on two or
 * three axes. */
#ifndef BST_GIMBAL_MOUNT_MOUNT_GEOMETRY_H
#define BST_GIMBAL_MOUNT_MOUNT_GEOMETRY_H

#include <stdbool.h>

#include "boresight/vec.h"

enum { BST_MOUNT_MOST = 3 };

/* At zero angles the camera has the body's axes, in both types; all angles are right-handed.
 *
 * azimuth_elevation: the outer axis (azimuth) lies along body +x, the mount's zenith; the inner one
 * (elevation) along the turned y axis, so that positive elevations raise the boresight towards body
 * +x. Boresight in body axes: (sin e, -cos e sin a, cos e cos a). The poles, where a target needs a
 * fast azimuth (the keyhole), are body +x and -x, at elevations of +-90 degrees.
 *
 * cross_elevation: the outer axis lies along body y, the inner one along the turned x axis, as in
 * second_order. Boresight: (cos i sin o, -sin i, cos i cos o); poles at body +-y.
 *
 * A third axis sits on the inner stage, along the outer axis at zero angles (azimuth_elevation: the
 * turned x, cross_elevation: the turned y): a cross-axis of the boresight. The nearer to the pole,
 * the more it replaces the outer axis. */
typedef enum bst_mount_type {
    BST_MOUNT_AZIMUTH_ELEVATION = 0,
    BST_MOUNT_CROSS_ELEVATION,
} bst_mount_type;

/* The mount's base frame (bst_mount_chain): first axis along the outer axis, second along the inner
 * one at zero angles. The same function leads there and back. */
static inline bst_vec3 bst_mount_swap(int type, bst_vec3 v) {
    return type == BST_MOUNT_AZIMUTH_ELEVATION ? v : (bst_vec3){v.y, v.x, -v.z};
}

/* What axis k turns about at zero angles: unit, body axes. */
bst_vec3 bst_mount_axis_body(int type, int axis);

/* Attitude of the camera in the body. angle_rad: outer, inner, third (0 where there is none). */
bst_quat bst_mount_attitude(int type, const double angle_rad[BST_MOUNT_MOST]);

/* A way to point: angles, turns of the outer axis not counted ((-pi, pi]), and their rates. */
typedef struct bst_mount_pose {
    double angle_rad[BST_MOUNT_MOST], rate_radps[BST_MOUNT_MOST];
} bst_mount_pose;

/* Outer and inner angle, inner in [-pi/2, pi/2], third 0, for a direction (unit, body axes) and its
 * derivative. On the pole the outer angle is outer_at_pole_rad and its rate zero. The other way to
 * point there is outer + pi, pi - inner. */
bst_mount_pose bst_mount_solve(int type, bst_vec3 direction_body, bst_vec3 rate_body_radps,
                               double outer_at_pole_rad);

/* Inner and third angle for a direction when the outer axis is at a given angle and turns at a
 * given rate; third in [-pi/2, pi/2]. Regular wherever the third angle is not +-pi/2: at the pole
 * too. */
bst_mount_pose bst_mount_solve_rest(int type, bst_vec3 direction_body, bst_vec3 rate_body_radps,
                                    double outer_rad, double outer_radps);

/* Where a mount with a third axis turns its outer axis while the direction passes the pole faster
 * than the axis may turn (rate_limit_radps): along the great circle of direction and rate the
 * azimuth goes A(t) = atan(tan(w t) / sin r), t from the closest approach r to the pole, w the
 * rate; the axis takes min(|A|, rate_limit |t|) of it, which is the azimuth itself at both ends,
 * and half of the turn is done when the target is closest: the third axis then needs at most about
 * 0.6 of half a turn's time times w. Angle as bst_mount_solve's, moved by at most pi/2, and rate;
 * `pose` is what that gave. */
void bst_mount_pass_pole(int type, bst_vec3 direction_body, bst_vec3 rate_body_radps,
                         double rate_limit_radps, const bst_mount_pose *pose, double *outer_rad,
                         double *outer_radps);

#endif
