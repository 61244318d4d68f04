/* Environmental disturbance torques on a spacecraft, N m, body axes. */
#ifndef BST_GIMBAL_SPACECRAFT_DISTURBANCE_H
#define BST_GIMBAL_SPACECRAFT_DISTURBANCE_H

#include <stdbool.h>

#include "boresight/config.h"
#include "boresight/vec.h"
#include "sim/world/surface_torque.h"

typedef struct bst_disturbance_config {
    bool gravity_gradient;
    double srp_area_m2, cr, centre_of_pressure_m[3];
    double residual_dipole_am2[3];
    double constant_torque_nm[3];
    double unload_dipole_am2;
    char shape_file[512]; /* sim/world/surface_torque.h */
    double centre_of_mass_m[3], cd;
    bool drag;
} bst_disturbance_config;

extern const bst_config_desc bst_disturbance_config_table[];

/* Solar radiation torque: force P (1 au / d)^2 A C away from the Sun, at `lever` from the centre of
 * mass.
 *
 * Given:     sun_m   spacecraft to Sun, GCRF
 *            sunlit  visible fraction of the Sun's disc */
bst_vec3 bst_spacecraft_solar_torque(const bst_disturbance_config *config,
                                     bst_quat q_body_from_gcrf, bst_vec3 sun_m, double sunlit);

/* Earth's magnetic field (T, GCRF) at a geocentric position: axial dipole along GCRF z (IGRF-13,
 * g(1,0) = -29404.8 nT at 6371.2 km, 2020). */
bst_vec3 bst_spacecraft_dipole_field_t(bst_vec3 position_m);

/* Magnetic torquer dipole (A m^2, body axes, at most limit_am2 per axis) that unloads momentum_nms
 * (body axes) from the wheels in about BST_UNLOAD_S: (h x B) / (t |B|^2), clipped; its torque is m
 * x B = -(h across B) / t. */
bst_vec3 bst_spacecraft_unload_dipole(bst_vec3 momentum_nms, bst_vec3 field_t, double limit_am2);

#define BST_UNLOAD_S 600.0

/* Prepares the torque on the configured shape.
 *
 * Returned:  *out  NULL without a shape, and on error
 * Errors:    BST_ERR_CONFIG for a shape beside srp_area_m2; those of bst_surface_torque_create
 * Ownership: free *out with bst_surface_torque_free */
bst_status bst_disturbance_surface_create(bst_ctx *ctx, const bst_disturbance_config *config,
                                          bst_surface_torque **out) BST_MUST_CHECK;

/* Sum of all configured disturbance torques, wheel unloading included, without that on a shape. */
bst_vec3 bst_disturbance_torque(const bst_disturbance_config *config, const bst_mat3 *inertia_kgm2,
                                bst_quat q_body_from_gcrf, bst_vec3 position_m, bst_vec3 sun_m,
                                double sunlit, bst_vec3 wheel_momentum_nms);

#endif
