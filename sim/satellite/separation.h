/* Planes that separate the convex bodies of a pose. Internal to sim/satellite. */
#ifndef BST_SATELLITE_SEPARATION_H
#define BST_SATELLITE_SEPARATION_H

#include "sim/satellite/pose.h"

/* A direction from one body to another that separates them.
 *
 * Given:     pose   a model with at most BST_SEPARATION_BODIES bodies
 *            a, b   two of its bodies
 * Returned:  true and *axis (unit, body frame: all of b is beyond all of a along it); false: none
 * of the tried directions separates them, or the model has too many bodies Notes:     a ray from a
 * never meets b if it does not advance along the axis; else b is never on the ray's backward
 * continuation. Tried are the normals of plane faces, axes of shells, and the line of centres. Kept
 * for bodies that do not move against each other. */
bool bst_separation(bst_satellite_pose *pose, int a, int b, bst_vec3 *axis);

#endif
