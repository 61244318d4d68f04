/* Shadows on single points of a curved surface. Internal to sim/satellite. */
#ifndef BST_SATELLITE_POINT_SHADOW_H
#define BST_SATELLITE_POINT_SHADOW_H

#include "sim/satellite/pose.h"

/* True if another body of the model is between a point and a light.
 *
 * Given:     view   that bst_pose_look prepared toward the light
 *            own    convex body that the point is on, which casts no shadow on it
 *            point  body frame */
bool bst_point_is_shadowed(bst_satellite_pose *pose, int view, int own, bst_vec3 point);

#endif
