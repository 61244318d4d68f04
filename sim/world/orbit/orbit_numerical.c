/* Creates numerically integrated orbits from their configuration. */
#include <stdlib.h>
#include <string.h>

#include "sim/world/world_build.h"

static const char *const state_kinds[] = {"cartesian", "keplerian", "element_set", "relative",
                                          NULL};

const bst_config_desc bst_initial_state_table[] = {
    BST_ENUM(bst_initial_state_config, source, state_kinds, "\"cartesian\"",
             "cartesian: position and velocity below. keplerian: the elements below. element_set: "
             "what the orbit's element set gives at that time by SGP4. relative: the "
             "orbit's reference, offset_rtn_m and rate_rtn_mps at that time."),
    BST_FORMER("from", "source"),
    BST_REAL(bst_initial_state_config, at_s, "s", -1e9, 1e9, "0", "Time of the state."),
    BST_REALS(bst_initial_state_config, position_gcrf_m, "m", -1e10, 1e10, "[0, 0, 0]",
              "cartesian: geocentric position."),
    BST_REALS(bst_initial_state_config, velocity_gcrf_mps, "m/s", -1e6, 1e6, "[0, 0, 0]",
              "cartesian: velocity."),
    BST_OPEN_REAL(
        bst_initial_state_config, semi_major_axis_m, "m", -1e10, 1e10,
        "keplerian: semi-major axis, negative for a hyperbola; or the radius of perigee."),
    BST_OPEN_REAL(bst_initial_state_config, perigee_radius_m, "m", 0, 1e10,
                  "keplerian: distance of the perigee from the Earth's centre."),
    BST_REAL(bst_initial_state_config, eccentricity, "", 0, 100, "0",
             "keplerian: any conic, hyperbolas too."),
    BST_REAL(bst_initial_state_config, inclination_deg, "deg", 0, 180, "0",
             "keplerian: against the equator of GCRF."),
    BST_REAL(bst_initial_state_config, raan_deg, "deg", -360, 360, "0",
             "keplerian: right ascension of the ascending node."),
    BST_REAL(bst_initial_state_config, arg_perigee_deg, "deg", -360, 360, "0",
             "keplerian: argument of perigee."),
    BST_OPEN_REAL(bst_initial_state_config, true_anomaly_deg, "deg", -360, 360,
                  "keplerian: true anomaly at at_s; or the mean anomaly. Neither: at the perigee."),
    BST_OPEN_REAL(bst_initial_state_config, mean_anomaly_deg, "deg", -1e6, 1e6,
                  "keplerian: mean anomaly at at_s, of a hyperbola the hyperbolic one."),
    BST_CONFIG_END,
};

static const char *const gravity_words[] = {"builtin", "two_body", "j6", NULL};

const bst_config_desc bst_force_table[] = {
    BST_PATH_OR(
        bst_force_config, gravity, gravity_words, "\"builtin\"",
        "\"builtin\" (EGM2008), \"two_body\", \"j6\" (its zonal terms 2 to 6), or a file in "
        "the ICGEM format (.gfc), relative to the scenario's folder."),
    BST_INT(bst_force_config, degree, "", 0, BST_GRAVITY_MAX_DEGREE, "20",
            "builtin or file: degree of the field (builtin has 20)."),
    BST_INT(bst_force_config, order, "", 0, BST_GRAVITY_MAX_DEGREE, "20",
            "builtin or file: order of the field, at most its degree."),
    BST_BOOL(bst_force_config, sun, "true", "The Sun's gravity."),
    BST_BOOL(bst_force_config, moon, "true", "The Moon's gravity."),
    BST_BOOL(bst_force_config, solar_pressure, "true",
             "Pressure of sunlight, with the Earth's shadow."),
    BST_BOOL(bst_force_config, drag, "true", "Drag of air that turns with the Earth."),
    BST_BOOL(bst_force_config, shape, "false",
             "Sunlight and air act on the facets of the object's shape, with its attitude and with "
             "shadows between parts, instead of on srp_area_m2, cr and drag_area_m2."),
    BST_REAL(bst_force_config, density_scale, "", 0, 1000, "1",
             "What the mean density of the air is multiplied by."),
    BST_REAL(bst_force_config, tolerance, "", 1e-11, 1e-3, "1e-9",
             "Of the integrator's steps: relative size of the last term of the acceleration."),
    BST_CONFIG_END,
};

const bst_config_desc bst_orbit_spacecraft_table[] = {
    BST_REAL(bst_orbit_spacecraft_config, mass_kg, "kg", 1e-6, 1e9, "500", "Mass."),
    BST_REAL(bst_orbit_spacecraft_config, drag_area_m2, "m2", 0, 1e6, "4",
             "Cross-section in the air."),
    BST_REAL(bst_orbit_spacecraft_config, cd, "", 0, 10, "2.2", "Coefficient of drag."),
    BST_REAL(bst_orbit_spacecraft_config, srp_area_m2, "m2", 0, 1e6, "4",
             "Cross-section in sunlight."),
    BST_REAL(bst_orbit_spacecraft_config, cr, "", 0, 10, "1.3",
             "Coefficient of solar pressure: 1 black, 2 a mirror that faces the Sun."),
    BST_CONFIG_END,
};

static bst_status keplerian(const bst_world_builder *b, const bst_initial_state_config *given,
                            const char *path, double gm, bst_world_state *out) {
    bst_initial_state_config all = *given;
    const bst_initial_state_config *s = &all;
    if (bst_keplerian_resolve(b->ctx, &all) != BST_OK) {
        return bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %s/state", b->scenario, path);
    }
    double p = s->perigee_radius_m * (1.0 + s->eccentricity);
    double nu = s->true_anomaly_deg * BST_DEG_RAD, opening = 1.0 + s->eccentricity * cos(nu);
    double r = p / opening, speed = sqrt(gm / p);
    bst_vec3 position = {r * cos(nu), r * sin(nu), 0.0};
    bst_vec3 velocity = {-speed * sin(nu), speed * (s->eccentricity + cos(nu)), 0.0};
    bst_quat turn = bst_quat_mul(
        bst_quat_from_rotvec((bst_vec3){0.0, 0.0, s->raan_deg * BST_DEG_RAD}),
        bst_quat_mul(bst_quat_from_rotvec((bst_vec3){s->inclination_deg * BST_DEG_RAD, 0.0, 0.0}),
                     bst_quat_from_rotvec((bst_vec3){0.0, 0.0, s->arg_perigee_deg * BST_DEG_RAD})));
    out->position_m = bst_quat_rotate(turn, position);
    out->velocity_mps = bst_quat_rotate(turn, velocity);
    return BST_OK;
}

static bst_status initial_state(const bst_world_builder *b, const bst_orbit_config *config,
                                const bst_world_state *other, const char *path, double gm,
                                bst_world_state *out) {
    const bst_initial_state_config *s = &config->state;
    switch (s->source) {
        case BST_STATE_CARTESIAN:
            *out = (bst_world_state){bst_vec3_from_array(s->position_gcrf_m),
                                     bst_vec3_from_array(s->velocity_gcrf_mps)};
            return BST_OK;
        case BST_STATE_KEPLERIAN:
            return keplerian(b, s, path, gm, out);
        default:
            *out = *other;
            return BST_OK;
    }
}

bst_status bst_world_orbit_make_gravity(const bst_world_builder *b, const bst_force_config *f,
                                        const char *path, bst_gravity **out) {
    bst_ctx *ctx = b->ctx;
    if (f->order > f->degree) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/forces/order: at most the degree, %d (found %d)", b->scenario, path,
                        (int)f->degree, (int)f->order);
    }
    bst_status status;
    if (strcmp(f->gravity, "two_body") == 0) {
        status = bst_gravity_point(ctx, BST_EARTH_MU_M3PS2, out);
    } else if (strcmp(f->gravity, "j6") == 0) {
        status = bst_gravity_builtin(ctx, 6, 0, out);
    } else if (strcmp(f->gravity, "builtin") == 0) {
        status = bst_gravity_builtin(ctx, (int)f->degree, (int)f->order, out);
    } else {
        bst_world_path file = bst_world_path_join(b, f->gravity);
        status = bst_gravity_load(ctx, file.text, (int)f->degree, (int)f->order, out);
    }
    return status == BST_OK
               ? BST_OK
               : bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: %s/forces/gravity", b->scenario, path);
}

/* Burns of a trajectory, and zero burns where the attitude of the shape has a new phase: the
 * integrator's steps end there. *out: [*count], or NULL; the caller frees it. */
static bst_status make_thrusts(const bst_world_builder *b, const bst_config_list *burns,
                               bst_astro_thrust **out, int *count) {
    const bst_burn_config *items = burns->items;
    int edges = b->surface ? b->phase_count : 0;
    *count = 0;
    *out = calloc((size_t)burns->count + (size_t)edges + 1, sizeof **out);
    if (!*out) {
        return bst_fail(b->ctx, BST_ERR_MEMORY, "out of memory for burns");
    }
    for (int i = 0; i < burns->count; i++) {
        (*out)[(*count)++] = (bst_astro_thrust){items[i].time_s, items[i].duration_s,
                                                bst_vec3_from_array(items[i].dv_rtn_mps)};
    }
    for (int i = 0; i < edges; i++) {
        (*out)[(*count)++] = (bst_astro_thrust){.time_s = b->phase_s[i]};
    }
    return BST_OK;
}

bst_status bst_world_orbit_build_numerical(const bst_world_builder *b,
                                           const bst_orbit_config *config,
                                           const bst_config_list *burns,
                                           const bst_world_state *other, const char *path,
                                           bst_world_orbit *orbit) {
    bst_world_state state;
    BST_TRY(initial_state(b, config, other, path, bst_gravity_gm(orbit->gravity), &state));
    const bst_force_config *f = &config->forces;
    const bst_orbit_spacecraft_config *s = &config->spacecraft;
    bst_trajectory_options options = {
        .forces = {.gravity = orbit->gravity,
                   .eop = b->world->eop,
                   .sun = f->sun,
                   .moon = f->moon,
                   .solar_pressure = f->solar_pressure,
                   .drag = f->drag,
                   .density_scale = f->density_scale,
                   .spacecraft = {s->mass_kg, s->drag_area_m2, s->cd, s->srp_area_m2, s->cr}},
        .epoch = b->world->epoch,
        .at_s = config->state.at_s,
        .position_m = state.position_m,
        .velocity_mps = state.velocity_mps,
        .tolerance = f->tolerance};
    if (f->shape && !b->surface) {
        return bst_fail(
            b->ctx, BST_ERR_CONFIG,
            "%s: %s/forces/shape: true, but there is no shape (allowed: false; true for "
            "an object with a shape and without external_states)",
            b->scenario, path);
    }
    orbit->forces = options.forces; /* onboard models know the sphere only */
    options.forces.surface = b->surface;
    const bst_config_list no_burns = {NULL, 0};
    bst_astro_thrust *thrusts;
    BST_TRY(make_thrusts(b, &no_burns, &thrusts, &options.burn_count));
    options.burns = thrusts;
    bst_status status = bst_trajectory_create(b->ctx, &options, &orbit->unburnt);
    free(thrusts);
    if (status == BST_OK && burns->count > 0) {
        BST_TRY(make_thrusts(b, burns, &thrusts, &options.burn_count));
        options.burns = thrusts;
        status = bst_trajectory_create(b->ctx, &options, &orbit->burnt);
        free(thrusts);
    }
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(b->ctx, BST_ERR_CONFIG, "%s: %s", b->scenario, path);
}
