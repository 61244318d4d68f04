#include <stdlib.h>

#include "sim/world/world_internal.h"

struct bst_view {
    const bst_world *world;
    bst_sky_clock *clock;
};

bst_status bst_view_create(bst_ctx *ctx, const bst_world *world, bst_view **out) {
    *out = NULL;
    bst_view *view = calloc(1, sizeof *view);
    if (!view) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a view of the world");
    }
    view->world = world;
    bst_status status = bst_sky_clock_create(ctx, world->eop, &view->clock);
    if (status != BST_OK) {
        free(view);
        return status;
    }
    *out = view;
    return BST_OK;
}

void bst_view_free(bst_view *view) {
    if (view) {
        bst_sky_clock_free(view->clock);
        free(view);
    }
}

bst_status bst_view_object_state(bst_ctx *ctx, bst_view *view, int object, double seconds,
                                 bst_state *out) {
    return bst_orbit_state(ctx, &view->world->objects[object].orbit, view->clock,
                           view->world->epoch, seconds, true, out);
}

bst_status bst_view_observer_state(bst_ctx *ctx, bst_view *view, int observer, double seconds,
                                   bst_state *out) {
    return bst_orbit_state(ctx, &view->world->observers[observer].orbit, view->clock,
                           view->world->epoch, seconds, true, out);
}

bst_status bst_view_believed(bst_ctx *ctx, bst_view *view, int observer, int sensor, double seconds,
                             bst_state *state, bst_bodies *bodies) {
    double t = bst_believed_seconds(view->world, observer, sensor, seconds);
    BST_TRY(bst_believed_state(ctx, view->world, observer, sensor, view->clock, t, state));
    return bst_view_bodies(ctx, view, t, bodies);
}

bst_status bst_view_earth_frames(bst_ctx *ctx, bst_view *view, double seconds,
                                 bst_earth_frames *out) {
    bst_sky sky;
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(view->world, seconds), &sky));
    *out = sky.frames;
    return BST_OK;
}

bst_status bst_view_bodies(bst_ctx *ctx, bst_view *view, double seconds, bst_bodies *out) {
    bst_sky sky;
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(view->world, seconds), &sky));
    *out = sky.bodies;
    return BST_OK;
}

bst_status bst_view_sight(bst_ctx *ctx, bst_view *view, int observer, int object, double seconds,
                          bst_sight *out) {
    const bst_world *world = view->world;
    bst_sky sky;
    BST_TRY(bst_sky_clock_at(ctx, view->clock, bst_world_time(world, seconds), &sky));
    bst_state eye, target;
    BST_TRY(bst_view_observer_state(ctx, view, observer, seconds, &eye));
    bst_vec3 geometric;
    double emission_s;
    BST_TRY(bst_orbit_line_of_sight(ctx, &world->objects[object].orbit, &eye, view->clock,
                                    world->epoch, &sky.bodies, seconds, true, &geometric, &target,
                                    &emission_s));
    bst_light light = bst_light_at(&sky.bodies, eye.position_m, eye.velocity_mps);
    bst_vec3 to_eye = bst_vec3_sub(eye.position_m, target.position_m);
    bst_vec3 to_sun = bst_vec3_sub(sky.bodies.sun_m, target.position_m);
    out->geometric = bst_vec3_unit(geometric);
    out->apparent = bst_light_aberrate(&light, out->geometric);
    out->range_m = bst_vec3_norm(to_eye);
    out->light_time_s = seconds - emission_s;
    out->phase_rad = bst_vec3_angle(to_eye, to_sun);
    out->sunlit_fraction = bst_sun_fraction(target.position_m, sky.bodies.sun_m);
    const bst_object_info *info = &world->objects[object].info;
    double full = bst_lambert_sphere_v_mag(info->area_m2, info->albedo, out->phase_rad,
                                           out->range_m, bst_vec3_norm(to_sun));
    out->v_mag = out->sunlit_fraction > 0.0 ? full - 2.5 * log10(out->sunlit_fraction) : INFINITY;
    out->occulted =
        bst_earth_occults(eye.position_m, target.position_m, &sky.frames.itrf_from_gcrf);
    return BST_OK;
}
