/* Onboard catalogue: the scenario's objects on catalogued orbits, without burns. */
#include <assert.h>
#include <string.h>

#include "sim/onboard/knowledge_internal.h"
#include "sim/world/orbit/ephemeris.h"

int bst_knowledge_object_count(const bst_knowledge *k) {
    return k->world->object_count;
}

const bst_world_object_info *bst_knowledge_object(const bst_knowledge *k, int object) {
    return &k->world->objects[object].info;
}

int bst_knowledge_find_object(const bst_knowledge *k, const char *name) {
    return bst_world_find_object(k->world, name);
}

bool bst_knowledge_is_itself(const bst_knowledge *k, int object) {
    const world_observer *own = &k->world->observers[k->observer];
    return object == own->own_object ||
           (own->norad != 0 && own->norad == k->world->objects[object].info.norad);
}

bool bst_knowledge_apsides(bst_knowledge_view *view, int object, double *perigee_m,
                           double *apogee_m) {
    const bst_world *world = view->knowledge->world;
    const double mu = BST_EARTH_MU_M3PS2;
    bst_ctx quiet = {0};
    bst_world_state state;
    if (bst_world_orbit_state(&quiet, &world->objects[object].orbit, view->clock, world->epoch, 0.0,
                              false, &state) != BST_OK) {
        return false;
    }
    bst_vec3 h = bst_vec3_cross(state.position_m, state.velocity_mps);
    double energy = 0.5 * bst_vec3_dot(state.velocity_mps, state.velocity_mps) -
                    mu / bst_vec3_norm(state.position_m);
    double p = bst_vec3_dot(h, h) / mu;
    double e = sqrt(fmax(1.0 + 2.0 * energy * p / mu, 0.0));
    *perigee_m = p / (1.0 + e);
    *apogee_m = e < 1.0 ? p / (1.0 - e) : INFINITY;
    return true;
}

bool bst_knowledge_element_age(const bst_knowledge *k, int object, double *seconds) {
    return bst_world_element_age(k->world, object, seconds);
}

double bst_knowledge_places(const bst_knowledge *k, double seconds, double *x_m, double *y_m,
                            double *z_m) {
    double t = bst_ephemeris_places(k->world->ephemeris, seconds, x_m, y_m, z_m);
    for (int i = 0; i < k->world->object_count; i++) {
        if (k->world->objects[i].orbit.burn_count > 0) {
            x_m[i] = y_m[i] = z_m[i] = NAN;
        }
    }
    return t;
}

double bst_knowledge_places_time(double seconds) {
    return bst_ephemeris_places_time(seconds);
}

bst_status bst_knowledge_near(bst_ctx *ctx, bst_knowledge_view *view, double seconds, bst_vec3 axis,
                              double half_angle_rad, int *indices, int *count) {
    double t;
    bst_world_state eye;
    BST_TRY(bst_onboard_nav_eye(ctx, view, seconds, &t, &eye));
    const bst_ephemeris_cone cone = {
        .apex_m = eye.position_m, .axis = axis, .half_angle_rad = half_angle_rad};
    *count = bst_ephemeris_near(view->knowledge->world->ephemeris, t, &cone, indices);
    return BST_OK;
}

bst_status bst_knowledge_eye_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                bst_world_state *eye, bst_bodies *bodies) {
    double t;
    bst_sky_rotation sky;
    BST_TRY(bst_onboard_nav_eye(ctx, view, seconds, &t, eye));
    BST_TRY(
        bst_sky_clock_at(ctx, view->clock, bst_time_add(view->knowledge->world->epoch, t), &sky));
    *bodies = sky.bodies;
    return BST_OK;
}

/* Geometry of an object that the spacecraft sees. */
typedef struct line_of_sight {
    double seconds, emission_s; /* of the world: reception and emission */
    bst_world_state eye, target;
    bst_sky_rotation sky;
    bst_vec3 line_m;
} line_of_sight;

static bst_status line_of_sight_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                   double seconds, line_of_sight *out) {
    const bst_world *world = view->knowledge->world;
    BST_TRY(bst_onboard_nav_eye(ctx, view, seconds, &out->seconds, &out->eye));
    BST_TRY(
        bst_sky_clock_at(ctx, view->clock, bst_time_add(world->epoch, out->seconds), &out->sky));
    const bst_world_reception at = {&out->eye, view->clock, world->epoch, &out->sky.bodies,
                                    out->seconds};
    return bst_world_orbit_line_of_sight(ctx, &world->objects[object].orbit, &at, false,
                                         &out->line_m, &out->target, &out->emission_s);
}

bst_status bst_knowledge_direction_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                      double seconds, bst_vec3 *geometric) {
    assert(view && geometric && isfinite(seconds));
    line_of_sight los;
    BST_TRY(line_of_sight_at(ctx, view, object, seconds, &los));
    *geometric = bst_vec3_unit(los.line_m);
    return BST_OK;
}

bst_status bst_knowledge_line_at(bst_ctx *ctx, bst_knowledge_view *view, int object, double seconds,
                                 bst_onboard_line *out) {
    assert(view && out && isfinite(seconds));
    line_of_sight los;
    BST_TRY(line_of_sight_at(ctx, view, object, seconds, &los));
    *out = (bst_onboard_line){.direction = bst_vec3_unit(los.line_m),
                              .range_m = bst_vec3_norm(los.line_m),
                              .eye = los.eye,
                              .object = los.target};
    return BST_OK;
}

bst_status bst_knowledge_sight_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                  double seconds, bst_world_sight *out) {
    assert(view && out && isfinite(seconds));
    const bst_world *world = view->knowledge->world;
    const bst_world_object_info *info = &world->objects[object].info;
    line_of_sight los;
    BST_TRY(line_of_sight_at(ctx, view, object, seconds, &los));
    const double t = los.seconds, emission_s = los.emission_s;
    const bst_world_state eye = los.eye, target = los.target;
    const bst_sky_rotation sky = los.sky;
    const bst_vec3 line = los.line_m;
    bst_light light = bst_light_at(&sky.bodies, eye.position_m, eye.velocity_mps);
    bst_vec3 to_eye = bst_vec3_sub(eye.position_m, target.position_m);
    bst_vec3 to_sun = bst_vec3_sub(sky.bodies.sun_m, target.position_m);
    bst_astro_sunlight sunlight;
    bst_astro_sunlight_at(target.position_m, bst_bodies_sunlight_from(&sky.bodies), sky.bodies.pole,
                          world->shadow_atmosphere, &sunlight);
    *out = (bst_world_sight){.geometric = bst_vec3_unit(line),
                             .range_m = bst_vec3_norm(to_eye),
                             .light_time_s = t - emission_s,
                             .phase_rad = bst_vec3_angle(to_eye, to_sun),
                             .sunlit_fraction = sunlight.disc};
    out->apparent = bst_light_aberrate(&light, out->geometric);
    bst_scene_lighting lighting = {.area_m2 = info->area_m2,
                                   .albedo = info->albedo,
                                   .object_m = target.position_m,
                                   .eye_m = eye.position_m,
                                   .sun_m = sky.bodies.sun_m,
                                   .seconds = emission_s,
                                   .sunlit_fraction = sunlight.disc,
                                   .sunlight = &sunlight};
    bst_brightness_at(info->brightness, &lighting, &out->glow);
    out->v_mag = out->glow.v_mag;
    out->occulted = bst_astro_earth_occults(eye.position_m, target.position_m, sky.bodies.pole);
    return BST_OK;
}

bool bst_knowledge_view_task(bst_knowledge_view *view, const bst_task *task) {
    if (!task || task->id == view->task.id) {
        const bool changed = view->cue_changed && !view->tasked;
        view->cue_changed = false;
        return changed;
    }
    view->task = *task;
    view->tasked = task->object >= 0 && task->object < view->knowledge->world->object_count;
    bst_onboard_forget_cue(view);
    return true;
}

/* Archives what the scenario's cue is, and forgets what was computed for another one. */
static void archive_own_cue(bst_knowledge_view *view, bst_archive *archive) {
    const bst_knowledge *k = view->knowledge;
    const int64_t own = k->world->observers[k->observer].sensors[k->sensor].cue_object;
    const bst_quat own_error = view->cue_error;
    int64_t object = own;
    bst_quat error = own_error;
    BST_ARCHIVE(archive, object);
    BST_ARCHIVE(archive, error);
    bst_archive_bool(archive, &view->cue_changed);
    if (object != own || memcmp(&error, &own_error, sizeof error) != 0) {
        view->cue_changed = true;
        bst_onboard_forget_cue(view);
    }
}

void bst_knowledge_view_archive(bst_knowledge_view *view, bst_archive *archive) {
    int64_t last = view->knowledge->world->object_count - 1;
    int64_t tasked = bst_archive_integer(archive, view->tasked ? view->task.object : -1, -1, last);
    BST_ARCHIVE(archive, view->task);
    if (bst_archive_is_restoring(archive)) {
        view->tasked = tasked >= 0;
        view->task.object = view->tasked ? (int32_t)tasked : view->task.object;
    }
    for (int i = 0; i < BST_CUE_KNOTS; i++) {
        bst_onboard_cue_knot *knot = &view->knots[i];
        bst_archive_bool(archive, &knot->made);
        bst_archive_bool(archive, &knot->known);
        BST_ARCHIVE(archive, knot->second);
        BST_ARCHIVE(archive, knot->direction);
    }
    BST_ARCHIVE(archive, view->checked);
    bst_archive_bool(archive, &view->any_checked);
    bst_archive_bool(archive, &view->smooth);
    BST_ARCHIVE(archive, view->cued);
    BST_ARCHIVE(archive, view->clock_offset_s);
    archive_own_cue(view, archive);
}
