/* Torque of sunlight and air on the facets of a spacecraft or an object with a shape. */
#ifndef BST_WORLD_SURFACE_TORQUE_H
#define BST_WORLD_SURFACE_TORQUE_H

#include "boresight/status.h"
#include "boresight/vec.h"
#include "sim/satellite/model.h"

/* The shape, with its work memory; for one thread. */
typedef struct bst_surface_torque bst_surface_torque;

/* Prepares the torque on a shape.
 *
 * Given:     shape_file        JSON or a mesh, as bst_satellite_load reads
 *            centre_m          centre of mass in the frame of the shape
 *            drag_coefficient  0: no air
 * Returned:  *out  NULL on error
 * Errors:    those of bst_satellite_load; BST_ERR_MEMORY
 * Ownership: free *out with bst_surface_torque_free */
bst_status bst_surface_torque_create(bst_ctx *ctx, const char *shape_file, bst_vec3 centre_m,
                                     double drag_coefficient,
                                     bst_surface_torque **out) BST_MUST_CHECK;
/* As bst_surface_torque_create, for a satellite that exists, with its surfaces
 * (bst_satellite_make_surfaces); it outlives the torque. */
bst_status bst_surface_torque_create_on(bst_ctx *ctx, const bst_satellite *satellite,
                                        bst_vec3 centre_m, double drag_coefficient,
                                        bst_surface_torque **out) BST_MUST_CHECK;
/* Frees a torque; NULL is allowed. */
void bst_surface_torque_free(bst_surface_torque *torque);

/* Sets the starts of burns, [count], which joints follow; they outlive the torque. */
void bst_surface_torque_set_burns(bst_surface_torque *torque, const double *burn_s, int count);

/* A spacecraft among what acts on its surface. */
typedef struct bst_surface_state {
    bst_quat q_body_from_gcrf;         /* the body axes are those of the shape */
    bst_vec3 position_m, velocity_mps; /* geocentric, GCRF */
    bst_vec3 sun_m;                    /* from the spacecraft, GCRF */
    double sunlit;                     /* visible fraction of the Sun's disc */
    double seconds;                    /* after the epoch, for joints */
    double density_scale;              /* of the mean density of the air; 0: no air */
} bst_surface_state;

/* Torque about the centre of mass, N m, body axes.
 *
 * Notes:     sunlight as bst_shape_light_load, drag as bst_shape_drag_load in the mean atmosphere
 *            (bst_atmosphere_density_kgpm3) that rotates with the Earth about GCRF z. Joints that
 *            follow the observer are turned to the Earth. */
bst_vec3 bst_surface_torque_at(bst_surface_torque *torque, const bst_surface_state *state);

#endif
