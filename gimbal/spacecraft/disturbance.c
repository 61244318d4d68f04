#include "gimbal/spacecraft/disturbance.h"

#include "sim/astro/bodies.h"
#include "sim/astro/forces.h"
#include "sim/astro/gravity.h"

#define C bst_disturbance_config
const bst_config_desc bst_disturbance_config_table[] = {
    BST_BOOL(C, gravity_gradient, "true", "The Earth's gravity gradient."),
    BST_REAL(C, srp_area_m2, "m^2", 0, 1e6, "0",
             "Area that meets sunlight, the same from all sides; no force in the Earth's shadow."),
    BST_FORMER("solar_area_m2", "srp_area_m2"),
    BST_REAL(C, cr, "", 0, 2, "1.3",
             "Of the force of sunlight; 1: black, 2: a mirror that faces the Sun."),
    BST_FORMER("solar_coefficient", "cr"),
    BST_REALS(C, centre_of_pressure_m, "m", -1e3, 1e3, "[0, 0, 0.1]",
              "Centre of that area from the centre of mass, body axes."),
    BST_FORMER("solar_lever_m", "centre_of_pressure_m"),
    BST_REALS(C, residual_dipole_am2, "A m^2", -1e4, 1e4, "[0, 0, 0]",
              "Magnetic dipole of the craft in the Earth's field (an axial dipole)."),
    BST_REALS(C, constant_torque_nm, "N m", -1e3, 1e3, "[0, 0, 0]", "Constant torque, body axes."),
    BST_REAL(C, unload_dipole_am2, "A m^2", 0, 1e4, "0",
             "Greatest dipole about each axis of the magnetic torquers that take momentum off the "
             "wheels; 0: none."),
    BST_PATH(
        C, shape_file, "\"\"",
        "Shape of the craft in body axes, a file as of an object's shape (JSON, OBJ, glTF, GLB): "
        "sunlight and air act on its facets, with shadows between parts, in place of "
        "srp_area_m2."),
    BST_REALS(C, centre_of_mass_m, "m", -1e3, 1e3, "[0, 0, 0]",
              "shape_file: place of the centre of mass in the frame of its parts."),
    BST_BOOL(C, drag, "true", "shape_file: torque of the air, in the mean atmosphere of drag."),
    BST_REAL(C, cd, "", 0, 10, "2.2", "shape_file: drag coefficient."),
    BST_CONFIG_END};
#undef C

bst_vec3 bst_spacecraft_solar_torque(const bst_disturbance_config *config,
                                     bst_quat q_body_from_gcrf, bst_vec3 sun_m, double sunlit) {
    double d = bst_vec3_norm(sun_m);
    double force = BST_SUNLIGHT_PRESSURE_PA * (BST_AU_M / d) * (BST_AU_M / d) *
                   config->srp_area_m2 * config->cr * sunlit;
    bst_vec3 away = bst_quat_rotate(q_body_from_gcrf, bst_vec3_scale(sun_m, -force / d));
    return bst_vec3_cross(bst_vec3_from_array(config->centre_of_pressure_m), away);
}

bst_vec3 bst_spacecraft_dipole_field_t(bst_vec3 position_m) {
    static const double reference_m = 6371.2e3, equator_t = 29404.8e-9;
    double r = bst_vec3_norm(position_m), ratio = reference_m / r;
    bst_vec3 u = bst_vec3_scale(position_m, 1.0 / r);
    double size = equator_t * ratio * ratio * ratio;
    return (bst_vec3){-3.0 * size * u.z * u.x, -3.0 * size * u.z * u.y,
                      size * (1.0 - 3.0 * u.z * u.z)};
}

static double clipped(double v, double limit) {
    return fmax(-limit, fmin(limit, v));
}

bst_vec3 bst_spacecraft_unload_dipole(bst_vec3 momentum_nms, bst_vec3 field_t, double limit_am2) {
    double b2 = bst_vec3_dot(field_t, field_t);
    bst_vec3 m = bst_vec3_scale(bst_vec3_cross(momentum_nms, field_t), 1.0 / (BST_UNLOAD_S * b2));
    return (bst_vec3){clipped(m.x, limit_am2), clipped(m.y, limit_am2), clipped(m.z, limit_am2)};
}

bst_vec3 bst_disturbance_torque(const bst_disturbance_config *config, const bst_mat3 *inertia_kgm2,
                                bst_quat q_body_from_gcrf, bst_vec3 position_m, bst_vec3 sun_m,
                                double sunlit, bst_vec3 wheel_momentum_nms) {
    bst_vec3 sum = bst_vec3_from_array(config->constant_torque_nm);
    if (config->gravity_gradient) {
        sum = bst_vec3_add(sum,
                           bst_gravity_gradient_torque(inertia_kgm2, q_body_from_gcrf, position_m));
    }
    if (config->srp_area_m2 > 0.0 && sunlit > 0.0) {
        sum =
            bst_vec3_add(sum, bst_spacecraft_solar_torque(config, q_body_from_gcrf, sun_m, sunlit));
    }
    bst_vec3 dipole = bst_vec3_from_array(config->residual_dipole_am2);
    if (config->unload_dipole_am2 > 0.0 || bst_vec3_norm(dipole) > 0.0) {
        bst_vec3 field =
            bst_quat_rotate(q_body_from_gcrf, bst_spacecraft_dipole_field_t(position_m));
        dipole = bst_vec3_add(dipole, bst_spacecraft_unload_dipole(wheel_momentum_nms, field,
                                                                   config->unload_dipole_am2));
        sum = bst_vec3_add(sum, bst_vec3_cross(dipole, field));
    }
    return sum;
}

bst_status bst_disturbance_surface_create(bst_ctx *ctx, const bst_disturbance_config *c,
                                          bst_surface_torque **out) {
    *out = NULL;
    if (!*c->shape_file) {
        return BST_OK;
    }
    if (c->srp_area_m2 > 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "disturbances/srp_area_m2: %g beside shape_file (allowed: 0, because "
                        "sunlight acts on the facets of the shape)",
                        c->srp_area_m2);
    }
    bst_status status = bst_surface_torque_create(
        ctx, c->shape_file, bst_vec3_from_array(c->centre_of_mass_m), c->drag ? c->cd : 0.0, out);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "disturbances/shape_file");
}
