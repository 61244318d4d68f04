#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/quintic.h"
#include "sim/world/orbit/ephemeris.h"
#include "sim/world/scene/field_objects.h"
#include "sim/world/scene/object_shape.h"
#include "sim/world/scene/view_shapes.h"

/* State of an observer at one instant, shared by all objects in a frame. */
typedef struct eye {
    bool valid;
    int observer;
    double seconds;
    bst_world_state state;
    bst_sky_rotation sky;
} eye;

/* Velocities of one observer at six consecutive seconds, for quintic interpolation. */
typedef struct pace {
    bool made, smooth;
    int observer;
    double second;
    bst_vec3 velocity[BST_QUINTIC_POINTS]; /* at whole seconds, starting BST_QUINTIC_BEFORE seconds
                                              before `second` */
    bst_vec3 quintic[BST_QUINTIC_POINTS];
} pace;

/* Fifth difference, m/s, below which velocities are interpolated; the interpolation error is 200
 * times smaller. */
static const double SMOOTH_MPS = 1e-7;

struct bst_world_view {
    const bst_world *world;
    bst_sky_clock *clock;
    pace pace;
    eye eyes[BST_PATH_NODES]; /* the latest ones, by node of the exposure */
    bst_ephemeris_reader reader;
    bst_view_shapes shapes;
    bool reflected_only; /* shapes without thermal emission */
};

/* Source of positions in a light-time solution; observer and object use the same one. */
typedef enum from { FROM_EPHEMERIS, FROM_ORBIT } from;

/* The observed object and the source of its positions. */
typedef struct looked_at {
    int object;
    from source;
} looked_at;

bst_status bst_world_view_create(bst_ctx *ctx, const bst_world *world, bst_world_view **out) {
    *out = NULL;
    bst_world_view *view = calloc(1, sizeof *view);
    if (!view) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a view of the world");
    }
    view->world = world;
    bst_status status = bst_sky_clock_create_on(ctx, world->sky_grid, &view->clock);
    if (status == BST_OK) {
        status = bst_view_shapes_create(ctx, world, view->clock, &view->shapes);
    }
    if (status != BST_OK) {
        bst_world_view_free(view);
        return status;
    }
    *out = view;
    return BST_OK;
}

void bst_world_view_free(bst_world_view *view) {
    if (view) {
        bst_view_shapes_free(&view->shapes);
        bst_sky_clock_free(view->clock);
        free(view);
    }
}

/* Orbit of an object, or of an observer. */
static const bst_world_orbit *orbit_of(const bst_world *world, int body) {
    return body < world->object_count ? &world->objects[body].orbit
                                      : &world->observers[body - world->object_count].orbit;
}

/* Position of an object or observer, with the velocity from the derivative or from the orbit (see
 * state_of). */
static bst_status position_of(bst_ctx *ctx, bst_world_view *view, int body, double seconds,
                              from source, bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    const bst_world *world = view->world;
    if (source == FROM_EPHEMERIS && bst_ephemeris_at(world->ephemeris, &view->reader, body, seconds,
                                                     position_m, velocity_mps)) {
        return BST_OK;
    }
    bst_world_state state;
    BST_TRY(bst_world_orbit_state(ctx, orbit_of(world, body), view->clock, world->epoch, seconds,
                                  true, &state));
    *position_m = state.position_m;
    *velocity_mps = state.velocity_mps;
    return BST_OK;
}

/* State with the orbit's own velocity. SGP4's velocity differs from the derivative of its position
 * by 0.1 m/s in low orbits, by metres per second at the perigee of transfer orbits. */
static bst_status state_of(bst_ctx *ctx, bst_world_view *view, int body, double seconds,
                           from source, bst_world_state *out) {
    const bst_world *world = view->world;
    BST_TRY(bst_world_orbit_state(ctx, orbit_of(world, body), view->clock, world->epoch, seconds,
                                  true, out));
    bst_vec3 derivative;
    if (source == FROM_EPHEMERIS) {
        (void)bst_ephemeris_at(world->ephemeris, &view->reader, body, seconds, &out->position_m,
                               &derivative);
    }
    return BST_OK;
}

bst_status bst_world_view_object_state(bst_ctx *ctx, bst_world_view *view, int object,
                                       double seconds, bst_world_state *out) {
    assert(view && out && object >= 0 && isfinite(seconds));
    return state_of(ctx, view, object, seconds, FROM_EPHEMERIS, out);
}

bst_status bst_world_view_observer_state(bst_ctx *ctx, bst_world_view *view, int observer,
                                         double seconds, bst_world_state *out) {
    assert(view && out && observer >= 0 && isfinite(seconds));
    return state_of(ctx, view, view->world->object_count + observer, seconds, FROM_EPHEMERIS, out);
}

/* Computes the velocity knots around a second; reuses those of the previous second. */
static void make_pace(bst_world_view *view, const bst_world_orbit *orbit, int observer,
                      double second) {
    pace *p = &view->pace;
    bst_ctx quiet = {0};
    bst_world_state state;
    int known = 0;
    if (p->made && p->smooth && p->observer == observer && p->second + 1.0 == second) {
        known = BST_QUINTIC_POINTS - 1;
        memmove(p->velocity, p->velocity + 1, (size_t)known * sizeof *p->velocity);
    }
    p->made = p->smooth = true;
    p->observer = observer;
    p->second = second;
    for (int i = known; i < BST_QUINTIC_POINTS && p->smooth; i++) {
        p->smooth = bst_world_orbit_state(&quiet, orbit, view->clock, view->world->epoch,
                                          second + i - BST_QUINTIC_BEFORE, true, &state) == BST_OK;
        p->velocity[i] = state.velocity_mps;
    }
    memcpy(p->quintic, p->velocity, sizeof p->quintic);
    p->smooth = p->smooth && bst_quintic_make(p->quintic) <= SMOOTH_MPS;
}

/* State of an observer at high rate, as the gimbal needs it: interpolates the velocity. */
static bst_status dense_state(bst_ctx *ctx, bst_world_view *view, int observer, double seconds,
                              bst_world_state *out) {
    const bst_world *world = view->world;
    const bst_world_orbit *orbit = &world->observers[observer].orbit;
    const pace *p = &view->pace;
    double second = floor(seconds);
    if (orbit->source == BST_ORBIT_SGP4 && orbit->burn_count == 0 && fabs(seconds) < 1e12 &&
        (!p->made || p->observer != observer || p->second != second)) {
        make_pace(view, orbit, observer, second);
    }
    bst_vec3 derivative;
    if (p->made && p->smooth && p->observer == observer && p->second == second &&
        bst_ephemeris_at(world->ephemeris, &view->reader, world->object_count + observer, seconds,
                         &out->position_m, &derivative)) {
        out->velocity_mps = bst_quintic_at(p->quintic, seconds - second);
        return BST_OK;
    }
    return bst_world_view_observer_state(ctx, view, observer, seconds, out);
}

bst_status bst_world_view_nav(bst_ctx *ctx, bst_world_view *view, int observer, int sensor,
                              double seconds, bst_world_state *state, bst_bodies *bodies) {
    double t = bst_world_nav_seconds(view->world, observer, sensor, seconds);
    BST_TRY(dense_state(ctx, view, observer, t, state));
    bst_world_nav_estimate(view->world, observer, sensor, t, state);
    return bst_world_view_bodies(ctx, view, t, bodies);
}

bst_status bst_world_view_earth_frames(bst_ctx *ctx, bst_world_view *view, double seconds,
                                       bst_astro_earth_frames *out) {
    bst_sky_rotation sky;
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(view->world, seconds), &sky));
    *out = sky.frames;
    return BST_OK;
}

bst_status bst_world_view_bodies(bst_ctx *ctx, bst_world_view *view, double seconds,
                                 bst_bodies *out) {
    bst_sky_rotation sky;
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(view->world, seconds), &sky));
    *out = sky.bodies;
    return BST_OK;
}

/* State of an observer with Sun, Earth rotation and bodies at a time. */
static bst_status eye_at(bst_ctx *ctx, bst_world_view *view, int observer, double seconds,
                         from source, eye *out) {
    *out = (eye){.observer = observer, .seconds = seconds};
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(view->world, seconds), &out->sky));
    BST_TRY(
        state_of(ctx, view, view->world->object_count + observer, seconds, source, &out->state));
    out->valid = true;
    return BST_OK;
}

/* True if states that come during a run change an orbit: also at times that were requested before.
 */
static bool is_external(const bst_world_orbit *orbit) {
    while (orbit && !orbit->external) {
        orbit = orbit->reference;
    }
    return orbit != NULL;
}

/* State of an observer at a node of the exposure, from the view's cache. */
static bst_status known_eye(bst_ctx *ctx, bst_world_view *view, int observer, double seconds,
                            int place, const eye **out) {
    eye *e = &view->eyes[place];
    if (!e->valid || e->observer != observer || e->seconds != seconds ||
        is_external(&view->world->observers[observer].orbit)) {
        BST_TRY(eye_at(ctx, view, observer, seconds, FROM_EPHEMERIS, e));
    }
    *out = e;
    return BST_OK;
}

static double node_time(const bst_world_view_span *span, int i) {
    return span->start_s + (span->end_s - span->start_s) * i / (BST_PATH_NODES - 1);
}

/* Solves light time and aberration for an object. now_m: its position at reception. *emitted_m:
 * position at emission. See bst_world_orbit_line_of_sight. */
static bst_status look(bst_ctx *ctx, bst_world_view *view, const eye *e, looked_at b,
                       bst_vec3 now_m, bst_vec3 *emitted_m, bst_world_sight *out) {
    double tau = 0.0;
    bst_vec3 geometric = {0}, velocity;
    *emitted_m = now_m;
    for (int i = 0; i < 3; i++) {
        if (i > 0) {
            BST_TRY(
                position_of(ctx, view, b.object, e->seconds - tau, b.source, emitted_m, &velocity));
        }
        geometric = bst_light_path(&e->sky.bodies, *emitted_m, e->state.position_m, tau);
        tau = bst_vec3_norm(geometric) / BST_LIGHT_SPEED_MPS;
    }
    bst_light light = bst_light_at(&e->sky.bodies, e->state.position_m, e->state.velocity_mps);
    out->geometric = bst_vec3_unit(geometric);
    out->apparent = bst_light_aberrate(&light, out->geometric);
    out->range_m = bst_vec3_norm(bst_vec3_sub(e->state.position_m, *emitted_m));
    out->light_time_s = tau;
    return BST_OK;
}

void bst_world_view_reflected_only(bst_world_view *view) {
    view->reflected_only = true;
}

/* Brightness of an object, seen from `eye_m`. */
static void shine_at(const bst_world_view *view, const bst_view_emission *at, bst_vec3 eye_m,
                     const bst_bodies *bodies, bst_world_sight *out) {
    const bst_world *world = view->world;
    int object = at->object;
    bst_vec3 emitted_m = at->position_m;
    const bst_world_object_info *info = &world->objects[object].info;
    bst_vec3 to_eye = bst_vec3_sub(eye_m, emitted_m);
    bst_vec3 to_sun = bst_vec3_sub(bodies->sun_m, emitted_m);
    bst_astro_sunlight sunlight;
    bst_astro_sunlight_at(emitted_m, bst_bodies_sunlight_from(bodies), bodies->pole,
                          world->shadow_atmosphere, &sunlight);
    bst_view_mutual others = {1.0, 1.0};
    if (view->shapes.occultation) {
        others = bst_view_shapes_occultations(&view->shapes, at, eye_m,
                                              bst_bodies_sunlight_from(bodies));
        sunlight.disc *= others.sunlight;
        for (int k = 0; k < BST_SUNLIGHT_COLOURS; k++) {
            sunlight.light[k] *= others.sunlight;
        }
    }
    out->phase_rad = bst_vec3_angle(to_eye, to_sun);
    out->sunlit_fraction = sunlight.disc;
    bst_scene_lighting lighting = {.area_m2 = info->area_m2,
                                   .albedo = info->albedo,
                                   .object_m = emitted_m,
                                   .eye_m = eye_m,
                                   .sun_m = bodies->sun_m,
                                   .seconds = at->seconds,
                                   .sunlit_fraction = sunlight.disc,
                                   .sunlight = &sunlight,
                                   .reflected_only = view->reflected_only};
    if (info->shape) {
        bst_object_shape_glow(info->shape, view->shapes.poses[info->shape->index],
                              bst_brightness_config_of(info->brightness), &lighting,
                              at->velocity_mps, &out->glow);
        bst_object_heat *heat = view->shapes.heats[info->shape->index];
        if (heat && !view->reflected_only) {
            bst_object_heat_glow(heat, info->shape, view->shapes.poses[info->shape->index],
                                 bst_brightness_config_of(info->brightness), &lighting,
                                 at->velocity_mps, &out->glow);
        }
    } else {
        bst_brightness_at(info->brightness, &lighting, &out->glow);
    }
    if (others.visible < 1.0) {
        bst_scene_glow_dim(&out->glow, others.visible);
    }
    out->v_mag = out->glow.v_mag;
}

/* Brightness of an object in a sight, and occultation by the Earth. */
static void shine(const bst_world_view *view, const eye *e, bst_view_emission *at,
                  bst_world_sight *out) {
    at->seconds = e->seconds - out->light_time_s;
    shine_at(view, at, e->state.position_m, &e->sky.bodies, out);
    out->occulted =
        bst_astro_earth_occults(e->state.position_m, at->position_m, e->sky.bodies.pole);
}

/* True if object and observer are too near for the interpolated ephemeris. */
static bool too_near(bst_vec3 a_m, bst_vec3 b_m) {
    return bst_vec3_norm(bst_vec3_sub(a_m, b_m)) < BST_EPHEMERIS_NEAREST_M;
}

bst_status bst_world_view_sight(bst_ctx *ctx, bst_world_view *view, int observer, int object,
                                double seconds, bst_world_sight *out) {
    eye e;
    bst_vec3 now, velocity, emitted;
    from source = FROM_EPHEMERIS;
    BST_TRY(eye_at(ctx, view, observer, seconds, source, &e));
    BST_TRY(position_of(ctx, view, object, seconds, source, &now, &velocity));
    if (too_near(now, e.state.position_m)) {
        source = FROM_ORBIT;
        BST_TRY(eye_at(ctx, view, observer, seconds, source, &e));
        BST_TRY(position_of(ctx, view, object, seconds, source, &now, &velocity));
    }
    BST_TRY(look(ctx, view, &e, (looked_at){object, source}, now, &emitted, out));
    shine(view, &e, &(bst_view_emission){object, emitted, velocity, 0.0}, out);
    return BST_OK;
}

bst_status bst_world_view_sight_from(bst_ctx *ctx, bst_world_view *view,
                                     const bst_world_state *place, int object, double seconds,
                                     bst_world_sight *out) {
    eye e = {.observer = -1, .seconds = seconds, .state = *place};
    bst_vec3 now, velocity, emitted;
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(view->world, seconds), &e.sky));
    BST_TRY(position_of(ctx, view, object, seconds, FROM_ORBIT, &now, &velocity));
    BST_TRY(look(ctx, view, &e, (looked_at){object, FROM_ORBIT}, now, &emitted, out));
    shine(view, &e, &(bst_view_emission){object, emitted, velocity, 0.0}, out);
    return BST_OK;
}

/* Computes the apparent path of an object seen by an observer during an exposure. */
static bst_status path_from(bst_ctx *ctx, bst_world_view *view,
                            const eye *const eyes[BST_PATH_NODES], looked_at b,
                            bst_scene_source_path *path, bst_scene_path_light *light,
                            bst_world_sight *mid) {
    for (int i = 0; i < BST_PATH_NODES; i++) {
        const eye *e = eyes[i];
        bst_vec3 now, velocity, emitted;
        BST_TRY(position_of(ctx, view, b.object, e->seconds, b.source, &now, &velocity));
        path->place[i] = bst_vec3_sub(now, e->state.position_m);
        light->eye_m[i] = e->state.position_m;
        light->sun_m[i] = e->sky.bodies.sun_m;
        if (i % 2 != 0) {
            continue;
        }
        bst_world_sight sight = {0};
        BST_TRY(look(ctx, view, e, b, now, &emitted, &sight));
        bst_vec3 unit = bst_vec3_unit(path->place[i]);
        bst_vec3 relative = bst_vec3_sub(e->state.velocity_mps, velocity);
        bst_vec3 about = bst_vec3_axpy(unit, 1.0 / BST_LIGHT_SPEED_MPS, relative);
        bst_vec3 apparent = bst_vec3_scale(sight.apparent, bst_vec3_dot(sight.apparent, about));
        path->shift[i / 2] = bst_vec3_sub(apparent, unit);
        if (i == BST_PATH_NODES / 2) {
            shine(view, e, &(bst_view_emission){b.object, emitted, velocity, 0.0}, &sight);
            *mid = sight;
            light->lag_m = bst_vec3_sub(emitted, now);
            light->earth_bary_mps = e->sky.bodies.earth_bary_mps;
            light->pole = e->sky.bodies.pole;
            light->light_time_s = sight.light_time_s;
        }
    }
    return BST_OK;
}

bst_status bst_world_view_path(bst_ctx *ctx, bst_world_view *view, const bst_world_view_span *span,
                               int object, bst_scene_source_path *path, bst_scene_path_light *light,
                               bst_world_sight *mid) {
    const eye *eyes[BST_PATH_NODES];
    for (int i = 0; i < BST_PATH_NODES; i++) {
        BST_TRY(known_eye(ctx, view, span->observer, node_time(span, i), i, &eyes[i]));
    }
    BST_TRY(path_from(ctx, view, eyes, (looked_at){object, FROM_EPHEMERIS}, path, light, mid));
    double nearest = INFINITY;
    for (int i = 0; i < BST_PATH_NODES; i++) {
        nearest = fmin(nearest, bst_vec3_norm(path->place[i]));
    }
    if (nearest < BST_EPHEMERIS_NEAREST_M) {
        eye direct[BST_PATH_NODES];
        for (int i = 0; i < BST_PATH_NODES; i++) {
            BST_TRY(eye_at(ctx, view, span->observer, eyes[i]->seconds, FROM_ORBIT, &direct[i]));
            eyes[i] = &direct[i];
        }
        BST_TRY(path_from(ctx, view, eyes, (looked_at){object, FROM_ORBIT}, path, light, mid));
    }
    return BST_OK;
}

/* Weights of the five positions of a quartic. */
typedef struct quartic {
    double weight[BST_PATH_NODES];
} quartic;

static quartic quartic_at(double u) {
    quartic q;
    for (int k = 0; k < BST_PATH_NODES; k++) {
        q.weight[k] = 1.0;
        for (int m = 0; m < BST_PATH_NODES; m++) {
            q.weight[k] *= m == k ? 1.0 : (u * (BST_PATH_NODES - 1) - m) / (k - m);
        }
    }
    return q;
}

/* The quartic through five positions. */
static bst_vec3 through(const quartic *q, const bst_vec3 place[BST_PATH_NODES]) {
    bst_vec3 sum = {0};
    for (int k = 0; k < BST_PATH_NODES; k++) {
        sum = bst_vec3_axpy(sum, q->weight[k], place[k]);
    }
    return sum;
}

/* Object, observer and bodies at time u of a span, from the path of the span. */
typedef struct instant {
    bst_view_emission at;
    bst_vec3 eye_m;
    bst_bodies bodies;
} instant;

static instant instant_at(const bst_world_view *view, const bst_world_view_span *span, int object,
                          const bst_scene_source_path *path, const bst_scene_path_light *light,
                          double u) {
    const quartic now = quartic_at(u);
    instant out = {.eye_m = through(&now, light->eye_m),
                   .bodies = {.sun_m = through(&now, light->sun_m),
                              .earth_bary_mps = light->earth_bary_mps,
                              .pole = light->pole}};
    double duration_s = span->end_s - span->start_s;
    out.at = (bst_view_emission){
        object,
        bst_vec3_add(bst_vec3_add(out.eye_m, through(&now, path->place)), light->lag_m),
        {0, 0, 0},
        span->start_s + u * duration_s - light->light_time_s};
    if (view->world->objects[object].info.shape && duration_s > 0.0) {
        const double h =
            1e-2; /* the difference of a quartic: exact to h^2 of the third derivative */
        const quartic next = quartic_at(u + h), last = quartic_at(u - h);
        bst_vec3 after = bst_vec3_add(through(&next, light->eye_m), through(&next, path->place));
        bst_vec3 before = bst_vec3_add(through(&last, light->eye_m), through(&last, path->place));
        out.at.velocity_mps =
            bst_vec3_scale(bst_vec3_sub(after, before), 1.0 / (2.0 * h * duration_s));
    }
    return out;
}

void bst_scene_view_light(const bst_world_view *view, const bst_world_view_span *span, int object,
                          const bst_scene_source_path *path, const bst_scene_path_light *light,
                          double u, bst_world_sight *out) {
    instant now = instant_at(view, span, object, path, light, u);
    shine_at(view, &now.at, now.eye_m, &now.bodies, out);
}

void bst_scene_view_aspect(const bst_world_view *view, const bst_world_view_span *span, int object,
                           const bst_scene_source_path *path, const bst_scene_path_light *light,
                           double u, bst_object_aspect *out) {
    instant now = instant_at(view, span, object, path, light, u);
    bst_scene_lighting lighting = {.object_m = now.at.position_m,
                                   .eye_m = now.eye_m,
                                   .sun_m = now.bodies.sun_m,
                                   .seconds = now.at.seconds};
    bst_object_shape_aspect(view->world->objects[object].info.shape, &lighting, now.at.velocity_mps,
                            out);
}

void bst_scene_view_body(const bst_world_view *view, const bst_world_view_span *span, int object,
                         const bst_scene_source_path *path, const bst_scene_path_light *light,
                         const bst_camera *camera, bst_scene_source_body *out) {
    const bst_world_object_info *info = &view->world->objects[object].info;
    const bst_brightness_config *brightness = bst_brightness_config_of(info->brightness);
    instant middle = instant_at(view, span, object, path, light, 0.5);
    const bst_bodies *bodies = &middle.bodies;
    double rate = bst_body_attitude_rate_radps(info->shape->attitude, middle.at.seconds);
    /* a quarter of a radian between attitudes */
    double steps = ceil(4.0 * rate * (span->end_s - span->start_s)) + 4.0;
    out->satellite = info->shape->satellite;
    out->burn_s = info->shape->burn_s;
    out->burn_count = info->shape->burn_count;
    out->first_part = bst_world_first_part(view->world, object);
    out->times = (int)fmin(steps, BST_SOURCE_BODY_TIMES - 1.0) + 1;
    for (int k = 0; k < out->times; k++) {
        double u = (double)k / (out->times - 1);
        bst_view_emission at = instant_at(view, span, object, path, light, u).at;
        bst_attitude_state state = {at.position_m, at.velocity_mps,
                                    bst_vec3_unit(bst_vec3_sub(bodies->sun_m, at.position_m)),
                                    at.seconds};
        out->q_body_from_gcrf[k] = bst_body_attitude_at(info->shape->attitude, &state);
        for (int end = 0; end < 2; end++) {
            if (k == end * (out->times - 1)) {
                out->object_m[end] = at.position_m;
                out->seconds[end] = at.seconds;
            }
        }
    }
    out->sun_m = bodies->sun_m;
    out->earthshine = brightness->earthshine;
    out->earth_albedo = brightness->earth_albedo;
    bst_astro_sunlight sunlight;
    bst_astro_sunlight_at(middle.at.position_m, bst_bodies_sunlight_from(bodies), bodies->pole,
                          view->world->shadow_atmosphere, &sunlight);
    bst_scene_lighting lighting = {.object_m = middle.at.position_m,
                                   .sun_m = bodies->sun_m,
                                   .sunlit_fraction = sunlight.disc,
                                   .sunlight = &sunlight};
    bst_source_body_set_gain(camera, brightness, &lighting, out);
}

bst_status bst_world_view_near(bst_ctx *ctx, bst_world_view *view, const bst_world_view_span *span,
                               bst_vec3 axis, double half_angle_rad, int *indices, int *count) {
    bst_ephemeris_cone cone = {.axis = axis,
                               .half_angle_rad = half_angle_rad,
                               .half_span_s = 0.5 * (span->end_s - span->start_s)};
    const eye *e;
    const int middle = BST_PATH_NODES / 2;
    BST_TRY(known_eye(ctx, view, span->observer, node_time(span, middle), middle, &e));
    cone.apex_m = e->state.position_m;
    for (int i = 0; i < BST_PATH_NODES; i++) {
        BST_TRY(known_eye(ctx, view, span->observer, node_time(span, i), i, &e));
        bst_vec3 way = bst_vec3_sub(e->state.position_m, cone.apex_m);
        cone.apex_span_m = fmax(cone.apex_span_m, bst_vec3_norm(way));
    }
    *count = bst_ephemeris_near(view->world->ephemeris, node_time(span, middle), &cone, indices);
    return BST_OK;
}

bst_satellite_pose *bst_scene_view_pose(const bst_world_view *view, int object) {
    return view->shapes.poses[view->world->objects[object].info.shape->index];
}

const bst_world_object_info *bst_scene_view_object(const bst_world_view *view, int object) {
    return bst_world_object(view->world, object);
}
