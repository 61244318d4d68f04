/* Geometry of the full mounts: axes, camera attitude, and inverse kinematics for two or three axes.
 */
#ifndef BST_GIMBAL_MOUNT_MOUNT_GEOMETRY_H
#define BST_GIMBAL_MOUNT_MOUNT_GEOMETRY_H

#include <stdbool.h>

#include "boresight/vec.h"

enum { BST_MOUNT_MOST = 3 };

/* Mount types. At zero angles the camera has the body's axes in both types; all angles are
 * right-handed.
 *
 * azimuth_elevation: the outer axis (azimuth) is along body +x, the mount's zenith. The inner one
 * (elevation) is along the rotated y axis, so that positive elevations raise the boresight towards
 * body +x. Boresight in body axes: (sin e, -cos e sin a, cos e cos a). The poles, where a target
 * needs a fast azimuth (keyhole), are body +x and -x, at elevations of +-90 degrees.
 *
 * cross_elevation: the outer axis is along body y, the inner one along the rotated x axis, as in
 * second_order. Boresight: (cos i sin o, -sin i, cos i cos o); poles at body +-y.
 *
 * A third axis is on the inner stage, along the outer axis at zero angles (azimuth_elevation:
 * rotated x, cross_elevation: rotated y): a cross-axis of the boresight. Near the pole it replaces
 * the outer axis. */
typedef enum bst_mount_type {
    BST_MOUNT_AZIMUTH_ELEVATION = 0,
    BST_MOUNT_CROSS_ELEVATION,
} bst_mount_type;

/* Converts between body axes and the mount's base frame (bst_mount_chain): first axis along the
 * outer axis, second along the inner one at zero angles. It is its own inverse. */
static inline bst_vec3 bst_mount_swap(int type, bst_vec3 v) {
    return type == BST_MOUNT_AZIMUTH_ELEVATION ? v : (bst_vec3){v.y, v.x, -v.z};
}

/* Axis k at zero angles: unit vector, body axes. */
bst_vec3 bst_mount_axis_body(int type, int axis);

/* Camera attitude relative to the body.
 *
 * Given:     angle_rad  outer, inner, third (0 if there is none) */
bst_quat bst_mount_attitude(int type, const double angle_rad[BST_MOUNT_MOST]);

/* A mount solution: angles (outer in (-pi, pi]) and rates. */
typedef struct bst_mount_pose {
    double angle_rad[BST_MOUNT_MOST], rate_radps[BST_MOUNT_MOST];
} bst_mount_pose;

/* Inverse kinematics: outer and inner angle (inner in [-pi/2, pi/2], third 0) for a direction
 * (unit, body axes) and its derivative. On the pole the outer angle is outer_at_pole_rad and its
 * rate zero. The other solution is outer + pi, pi - inner. */
bst_mount_pose bst_mount_solve(int type, bst_vec3 direction_body, bst_vec3 rate_body_radps,
                               double outer_at_pole_rad);

/* Inner and third angle for a direction at given outer angle and rate; third in [-pi/2, pi/2].
 * Regular except at a third angle of +-pi/2, and so at the pole. */
bst_mount_pose bst_mount_solve_rest(int type, bst_vec3 direction_body, bst_vec3 rate_body_radps,
                                    double outer_rad, double outer_radps);

/* Outer angle of a three-axis mount while the direction passes the pole faster than the outer axis
 * can turn. Along the great circle the azimuth is A(t) = atan(tan(w t) / sin r), t from the closest
 * approach r, w the rate. The outer axis follows min(|A|, rate_limit |t|), which equals the azimuth
 * at both ends. Half of its turn is done at the closest approach. The third axis then needs at most
 * about 0.6 of half a turn's time times w.
 *
 * Given:     pose  solution of bst_mount_solve
 * Returned:  *outer_rad   that of `pose`, changed by at most pi/2
 *            *outer_radps  its rate */
void bst_mount_pass_pole(int type, bst_vec3 direction_body, bst_vec3 rate_body_radps,
                         double rate_limit_radps, const bst_mount_pose *pose, double *outer_rad,
                         double *outer_radps);

#endif
