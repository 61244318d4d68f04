/* Forces of sunlight and air on a satellite's shape. */
#ifndef BST_SATELLITE_SHAPE_FORCES_H
#define BST_SATELLITE_SHAPE_FORCES_H

#include "sim/astro/forces.h"
#include "sim/satellite/body_attitude.h"
#include "sim/satellite/pose.h"

/* Area over which sunlight presses on a pose.
 *
 * Given:     pose  joints as bst_satellite_pose_set left them; its view 0 is changed
 *            sun   unit, body frame
 * Returned:  force over the pressure on a black surface, m^2, body frame
 * Notes:     a facet in full sunlight contributes -A cos [(1 - rho_s) s + 2 (rho_s cos + rho_d / 3)
 *            n], with rho_d the diffuse part of the reflectance and rho_s the rest, whose lobe
 *            counts as a mirror. Both are scaled so that the absorptance is that of the surface.
 *            Parts shadow each other; light that hits twice and heat are left out.
 * Reference: Vallado, Fundamentals of Astrodynamics and Applications, section 8.6.4; Milani, Nobili
 *            and Farinella, Non-gravitational Perturbations and Satellite Geodesy (1987) */
bst_vec3 bst_shape_light_area_m2(bst_satellite_pose *pose, bst_vec3 sun);

/* Area of the silhouette of a pose.
 *
 * Given:     direction  unit, body frame: from which it is seen */
double bst_shape_silhouette_m2(bst_satellite_pose *pose, bst_vec3 direction);

/* Force over a pressure, m^2, and its torque about a point over it, m^3; body frame. */
typedef struct bst_shape_load {
    bst_vec3 force, torque;
} bst_shape_load;

/* Force and torque of sunlight on a pose: the force of bst_shape_light_area_m2, each facet's at the
 * centroid of its lit area.
 *
 * Given:     sun       unit, body frame
 *            centre_m  point of reference, such as the centre of mass */
bst_shape_load bst_shape_light_load(bst_satellite_pose *pose, bst_vec3 sun, bst_vec3 centre_m);

/* Drag and its torque on a pose, over the dynamic pressure times the drag coefficient: against the
 * motion, over the area of each facet that meets the air, at its centroid.
 *
 * Given:     ahead     unit, body frame: direction of the motion through the air
 *            centre_m  as in bst_shape_light_load */
bst_shape_load bst_shape_drag_load(bst_satellite_pose *pose, bst_vec3 ahead, bst_vec3 centre_m);

/* A shape with its attitude, for a force model; thread-safe. */
typedef struct bst_shape_forces bst_shape_forces;

/* Prepares the forces on a shape.
 *
 * Given:     satellite, attitude, burn_s  outlive the forces; burn_s: [burn_count], for joints
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_shape_forces_free
 * Notes:     joints that follow the observer are turned to the Earth. */
bst_status bst_shape_forces_create(bst_ctx *ctx, const bst_satellite *satellite,
                                   const bst_body_attitude *attitude, const double *burn_s,
                                   int burn_count, bst_shape_forces **out) BST_MUST_CHECK;
/* Frees the forces on a shape; NULL is allowed. */
void bst_shape_forces_free(bst_shape_forces *forces);

/* The surface for bst_force_model; it belongs to the forces. */
const bst_force_surface *bst_shape_forces_surface(const bst_shape_forces *forces);

#endif
