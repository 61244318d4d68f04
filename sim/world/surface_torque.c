#include "sim/world/surface_torque.h"

#include <assert.h>
#include <stdlib.h>

#include "sim/astro/atmosphere.h"
#include "sim/astro/forces.h"
#include "sim/satellite/shape_forces.h"

/* rotation of the Earth, rad/s (WGS 84) */
#define EARTH_RADPS 7.292115e-5

struct bst_surface_torque {
    bst_satellite *own; /* NULL: another's */
    bst_satellite_pose *pose;
    bst_vec3 centre_m;
    double drag_coefficient; /* 0: no air */
};

bst_status bst_surface_torque_create_on(bst_ctx *ctx, const bst_satellite *satellite,
                                        bst_vec3 centre_m, double drag_coefficient,
                                        bst_surface_torque **out) {
    bst_surface_torque *t = *out = calloc(1, sizeof *t);
    if (!t) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the shape of a spacecraft");
    }
    t->centre_m = centre_m;
    t->drag_coefficient = drag_coefficient;
    bst_status status = bst_satellite_pose_create(ctx, satellite, &t->pose);
    if (status != BST_OK) {
        bst_surface_torque_free(t);
        *out = NULL;
    }
    return status;
}

bst_status bst_surface_torque_create(bst_ctx *ctx, const char *shape_file, bst_vec3 centre_m,
                                     double drag_coefficient, bst_surface_torque **out) {
    bst_satellite *satellite;
    *out = NULL;
    BST_TRY(bst_satellite_load(ctx, shape_file, &satellite));
    bst_satellite_make_surfaces(satellite);
    bst_status status =
        bst_surface_torque_create_on(ctx, satellite, centre_m, drag_coefficient, out);
    if (status == BST_OK) {
        (*out)->own = satellite;
    } else {
        bst_satellite_free(satellite);
    }
    return status;
}

void bst_surface_torque_set_burns(bst_surface_torque *t, const double *burn_s, int count) {
    t->pose->burn_s = burn_s;
    t->pose->burn_count = count;
}

void bst_surface_torque_free(bst_surface_torque *t) {
    if (t) {
        bst_satellite_pose_free(t->pose);
        bst_satellite_free(t->own);
        free(t);
    }
}

bst_vec3 bst_surface_torque_at(bst_surface_torque *t, const bst_surface_state *state) {
    assert(t && state);
    bst_quat q = state->q_body_from_gcrf;
    bst_vec3 sun = bst_quat_rotate(q, bst_vec3_unit(state->sun_m));
    bst_vec3 earth = bst_quat_rotate(q, bst_vec3_unit(bst_vec3_scale(state->position_m, -1.0)));
    const bst_satellite_aim aim = {
        .sun = sun, .earth = earth, .target = earth, .seconds = state->seconds};
    bst_vec3 sum = {0.0, 0.0, 0.0};
    bst_satellite_pose_set(t->pose, &aim);
    if (state->sunlit > 0.0) {
        double au2 = bst_vec3_dot(state->sun_m, state->sun_m) / (BST_AU_M * BST_AU_M);
        sum = bst_vec3_scale(bst_shape_light_load(t->pose, sun, t->centre_m).torque,
                             BST_SUNLIGHT_PRESSURE_PA * state->sunlit / au2);
    }
    const bst_vec3 spin = {0.0, 0.0, EARTH_RADPS};
    bst_vec3 wind = bst_vec3_sub(state->velocity_mps, bst_vec3_cross(spin, state->position_m));
    double density = t->drag_coefficient > 0.0 && state->density_scale > 0.0
                         ? state->density_scale *
                               bst_atmosphere_density_kgpm3(bst_astro_height_m(state->position_m))
                         : 0.0;
    double speed2 = bst_vec3_dot(wind, wind);
    if (density > 0.0 && speed2 > 0.0) {
        bst_vec3 ahead = bst_quat_rotate(q, bst_vec3_unit(wind));
        sum = bst_vec3_axpy(sum, 0.5 * density * speed2 * t->drag_coefficient,
                            bst_shape_drag_load(t->pose, ahead, t->centre_m).torque);
    }
    return sum;
}
