/* Torque of sunlight and air on the facets of a spacecraft with a shape. */
#ifndef BST_GIMBAL_SPACECRAFT_SURFACE_TORQUE_H
#define BST_GIMBAL_SPACECRAFT_SURFACE_TORQUE_H

#include "gimbal/spacecraft/disturbance.h"
#include "gimbal/spacecraft/spacecraft_sky.h"

/* The shape, with its work memory; for one thread. */
typedef struct bst_surface_torque bst_surface_torque;

/* Prepares the torque on the shape of a configuration.
 *
 * Returned:  *out  NULL if it has no shape, and on error
 * Errors:    BST_ERR_CONFIG for impossible shapes, and for a shape beside srp_area_m2; BST_ERR_IO,
 *            BST_ERR_FORMAT, BST_ERR_NOT_FOUND of its files; BST_ERR_MEMORY
 * Ownership: free *out with bst_surface_torque_free */
bst_status bst_surface_torque_create(bst_ctx *ctx, const bst_disturbance_config *config,
                                     bst_surface_torque **out) BST_MUST_CHECK;
/* Frees a torque; NULL is allowed. */
void bst_surface_torque_free(bst_surface_torque *torque);

/* Torque about the centre of mass, N m, body axes, which are those of the shape.
 *
 * Given:     sky      position_m, velocity_mps, sun_m and sunlit count
 *            seconds  after the epoch, for joints
 * Notes:     sunlight as bst_shape_light_load, drag as bst_shape_drag_load in the mean atmosphere
 *            (bst_atmosphere_density_kgpm3) that rotates with the Earth about GCRF z. Joints that
 *            follow the observer are turned to the Earth. */
bst_vec3 bst_surface_torque_at(bst_surface_torque *torque, bst_quat q_body_from_gcrf,
                               const bst_spacecraft_sky *sky, double seconds);

#endif
