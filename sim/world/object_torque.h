/* Torques on an object with a shape, for its law tumble. */
#ifndef BST_WORLD_OBJECT_TORQUE_H
#define BST_WORLD_OBJECT_TORQUE_H

#include "sim/satellite/body_attitude.h"
#include "sim/satellite/model.h"
#include "sim/world/world_build.h"

/* An object among what turns it. */
typedef struct bst_object_torque bst_object_torque;

/* What turns an object. */
typedef struct bst_object_torque_setup {
    const bst_world_orbit *orbit; /* may still be without its content */
    bst_world_orbit *own; /* its orbit where that is made for the torques alone; it passes to
                             the torques, also on error; NULL: none */
    const bst_satellite *satellite; /* with its surfaces (bst_satellite_make_surfaces) */
    const double *burn_s;           /* [burn_count], for joints */
    int burn_count;
    double drag_coefficient, density_scale;
} bst_object_torque_setup;

/* Prepares the torques on an object.
 *
 * Given:     setup  its members but `own` outlive the torques
 * Returned:  *out   NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_object_torque_free */
bst_status bst_object_torque_create(const bst_world_builder *b,
                                    const bst_object_torque_setup *setup,
                                    bst_object_torque **out) BST_MUST_CHECK;
/* Frees the torques; NULL is allowed. */
void bst_object_torque_free(bst_object_torque *torque);

/* The torque of a phase (bst_body_torque_fn; user: bst_object_torque), with the object's place and
 * sunlight at that time; thread-safe.
 *
 * Notes:     gravity gradient: bst_gravity_gradient_torque of the phase's moments. Sunlight and air
 *            as in bst_surface_torque_at, about the origin of the shape. */
bool bst_object_torque_at(void *user, const bst_attitude_config *phase, double seconds,
                          bst_quat q_body_from_gcrf, bst_vec3 *torque_nm);

#endif
