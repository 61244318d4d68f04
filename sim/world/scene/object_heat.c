#include "sim/world/scene/object_heat.h"

#include <stdlib.h>

bst_status bst_object_heat_create(bst_ctx *ctx, const bst_object_shape *shape, bool transient,
                                  bst_object_heat **out) {
    size_t facets = (size_t)shape->satellite->facet_count + 1;
    bst_object_heat *h = *out = calloc(1, sizeof *h);
    if (h) {
        h->load_wpm2 = calloc(facets, sizeof *h->load_wpm2);
        h->kelvin = calloc(facets, sizeof *h->kelvin);
    }
    bst_status status =
        h && h->load_wpm2 && h->kelvin
            ? BST_OK
            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the temperatures of an object");
    if (status == BST_OK && transient) {
        status = bst_heat_history_create(ctx, shape->satellite, &h->history);
    }
    if (status != BST_OK) {
        bst_object_heat_free(h);
        *out = NULL;
    }
    return status;
}

void bst_object_heat_free(bst_object_heat *h) {
    if (h) {
        bst_heat_history_free(h->history);
        free(h->load_wpm2);
        free(h->kelvin);
        free(h);
    }
}

/* An instant of the balance: the object's attitude and what the loads follow from. */
typedef struct instant {
    const bst_object_heat *heat;
    const bst_object_shape *shape;
    const bst_brightness_config *brightness;
    bst_earthlight *earthlight; /* work memory */
} instant;

/* What heats an object at a place. *q: its attitude. */
static void environment_at(const instant *c, const bst_object_place *at, double seconds,
                           bst_quat *q, bst_heat_environment *out) {
    bst_vec3 to_sun = bst_vec3_sub(at->sun_m, at->position_m);
    double au = bst_vec3_norm(to_sun) / BST_AU_M, earth_au = bst_vec3_norm(at->sun_m) / BST_AU_M;
    bst_attitude_state state = {at->position_m, at->velocity_mps, bst_vec3_unit(to_sun), seconds};
    *q = bst_body_attitude_at(c->shape->attitude, &state);
    const bst_earth_surface surface = {.diffuse = c->brightness->earth_albedo, .fineness = 1};
    bst_earthlight_at(&surface, at->position_m, bst_vec3_unit(at->sun_m), c->earthlight);
    bst_earthlight_turn(*q, c->earthlight);
    double sine = BST_EARTH_RADIUS_M / bst_vec3_norm(at->position_m);
    *out = (bst_heat_environment){
        .sun = bst_quat_rotate(*q, state.sun),
        .earth = bst_quat_rotate(*q, bst_vec3_unit(bst_vec3_scale(at->position_m, -1.0))),
        .sunlight_wpm2 = BST_SOLAR_IRRADIANCE_WPM2 * at->sunlit_fraction / (au * au),
        .earthlight = c->earthlight,
        .earthlight_wpm2 = BST_SOLAR_IRRADIANCE_WPM2 / (earth_au * earth_au),
        .earth_sine = fmin(sine, 1.0),
        .earth_infrared_wpm2 = c->brightness->earth_infrared_w_per_m2};
}

/* The source of a history (bst_heat_source). */
static bool past(void *user, bst_satellite_pose *pose, double seconds, bst_heat_environment *out) {
    const instant *c = user;
    bst_object_place at;
    bst_quat q;
    if (!c->heat->place(c->heat->user, c->heat->object, seconds, &at)) {
        return false;
    }
    environment_at(c, &at, seconds, &q, out);
    bst_satellite_aim aim = {
        .sun = out->sun, .earth = out->earth, .target = out->earth, .seconds = seconds};
    bst_satellite_pose_set(pose, &aim);
    return true;
}

/* Temperatures in balance with the present loads. */
static const double *steady(bst_object_heat *h, const instant *c, bst_satellite_pose *pose,
                            const bst_object_place *at, double seconds) {
    const bst_satellite *s = c->shape->satellite;
    bst_heat_environment e;
    bst_quat q;
    environment_at(c, at, seconds, &q, &e);
    bst_heat_loads(pose, &e, h->load_wpm2);
    for (int i = 0; i < s->facet_count; i++) {
        h->kelvin[i] =
            bst_heat_steady_k(h->load_wpm2[i], s->materials[s->facets[i].material].emissivity);
    }
    return h->kelvin;
}

void bst_object_heat_glow(bst_object_heat *h, const bst_object_shape *shape,
                          bst_satellite_pose *pose, const bst_brightness_config *b,
                          const bst_scene_lighting *l, bst_vec3 velocity_mps, bst_scene_glow *out) {
    bst_earthlight earthlight;
    instant c = {h, shape, b, &earthlight};
    const bst_object_place at = {l->object_m, velocity_mps, l->sun_m, l->sunlit_fraction};
    bst_vec3 to_eye = bst_vec3_sub(l->eye_m, l->object_m);
    double range2 = bst_vec3_dot(to_eye, to_eye);
    const double *kelvin =
        h->history ? bst_heat_history_at(h->history, pose, l->seconds, past, &c) : NULL;
    bst_heat_environment now;
    bst_quat q;
    environment_at(&c, &at, l->seconds, &q, &now);
    bst_vec3 observer = bst_quat_rotate(q, bst_vec3_unit(to_eye));
    bst_satellite_aim aim = {
        .sun = now.sun, .earth = now.earth, .target = observer, .seconds = l->seconds};
    bst_satellite_pose_set(pose, &aim);
    kelvin = kelvin ? kelvin : steady(h, &c, pose, &at, l->seconds);
    bst_thermal_emission emission;
    bst_heat_emission(pose, observer, kelvin, &emission);
    double total = 0.0, fourth = 0.0;
    for (int i = 0; i < emission.count; i++) {
        double sr = emission.bins[i].area_m2 / range2, t = emission.bins[i].kelvin;
        out->emissions[i] = (bst_scene_emission){sr, t, emission.bins[i].deviation};
        total += sr;
        fourth += sr * t * t * t * t;
    }
    out->emission_count = emission.count;
    out->emission_sr = total;
    out->temperature_k = total > 0.0 ? sqrt(sqrt(fourth / total)) : 0.0;
}
