#include "sim/world/scene/view_shapes.h"

#include <stdlib.h>

#include "sim/satellite/interreflection.h"

/* Place of an object at a time, for its heat balance. */
static bool heat_place(void *user, int object, double seconds, bst_object_place *out) {
    const bst_view_shapes *view = user;
    const bst_world *world = view->world;
    bst_ctx quiet = {0};
    bst_world_state state;
    bst_sky_rotation sky;
    if (bst_sky_clock_at(&quiet, view->clock, bst_world_time(world, seconds), &sky) != BST_OK ||
        bst_world_orbit_state(&quiet, &world->objects[object].orbit, view->clock, world->epoch,
                              seconds, true, &state) != BST_OK) {
        return false;
    }
    *out = (bst_object_place){
        state.position_m, state.velocity_mps, sky.bodies.sun_m,
        bst_astro_sun_fraction(state.position_m, bst_bodies_sunlight_from(&sky.bodies),
                               sky.bodies.pole)};
    return true;
}

/* Allocates the work memory for the heat balances of the world. */
static bst_status make_heats(bst_ctx *ctx, bst_view_shapes *view) {
    const bst_world *world = view->world;
    for (int i = 0; i < world->object_count; i++) {
        const bst_world_object_info *info = &world->objects[i].info;
        int balance =
            info->shape ? bst_brightness_config_of(info->brightness)->heat_balance : BST_HEAT_NONE;
        if (balance == BST_HEAT_NONE) {
            continue;
        }
        bst_object_heat **heat = &view->heats[info->shape->index];
        BST_TRY(bst_object_heat_create(ctx, info->shape, balance == BST_HEAT_TRANSIENT, heat));
        (*heat)->place = heat_place;
        (*heat)->user = view;
        (*heat)->object = i;
    }
    return BST_OK;
}

/* Allocates the work memory for the shapes of the world. */
static bst_status make_poses(bst_ctx *ctx, bst_view_shapes *view) {
    const bst_world *world = view->world;
    view->poses = calloc((size_t)world->shape_count, sizeof(bst_satellite_pose *));
    view->heats = calloc((size_t)world->shape_count, sizeof(bst_object_heat *));
    if (!view->poses || !view->heats) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a view of the world");
    }
    for (int i = 0; i < world->shape_count; i++) {
        BST_TRY(bst_satellite_pose_create(ctx, world->shapes[i]->satellite, &view->poses[i]));
        view->poses[i]->burn_s = world->shapes[i]->burn_s;
        view->poses[i]->burn_count = world->shapes[i]->burn_count;
        if (world->shapes[i]->interreflection) {
            BST_TRY(bst_interreflection_create(ctx, world->shapes[i]->satellite,
                                               &view->poses[i]->interreflection));
        }
    }
    return BST_OK;
}

bst_status bst_view_shapes_create(bst_ctx *ctx, const bst_world *world, bst_sky_clock *clock,
                                  bst_view_shapes *out) {
    int vertices = 0;
    *out = (bst_view_shapes){.world = world, .clock = clock};
    if (world->shape_count > 0) {
        BST_TRY(make_poses(ctx, out));
        BST_TRY(make_heats(ctx, out));
    }
    for (int i = 0; i < world->shape_count; i++) {
        int n = world->shapes[i]->satellite->vertex_count;
        vertices = n > vertices ? n : vertices;
    }
    return world->occulter_count > 0 ? bst_occultation_create(ctx, vertices, &out->occultation)
                                     : BST_OK;
}

void bst_view_shapes_free(bst_view_shapes *s) {
    for (int i = 0; s->poses && i < s->world->shape_count; i++) {
        if (s->poses[i]) {
            bst_interreflection_free(s->poses[i]->interreflection);
        }
        bst_satellite_pose_free(s->poses[i]);
    }
    for (int i = 0; s->heats && i < s->world->shape_count; i++) {
        bst_object_heat_free(s->heats[i]);
    }
    free(s->poses);
    free(s->heats);
    bst_occultation_free(s->occultation);
}

/* An object as a body of occultations. */
static bst_occultation_body body_of(const bst_view_shapes *shapes, int object, bst_vec3 position_m,
                                    bst_vec3 velocity_mps, double seconds) {
    const bst_world_object_info *info = &shapes->world->objects[object].info;
    return (bst_occultation_body){
        .position_m = position_m,
        .velocity_mps = velocity_mps,
        .seconds = seconds,
        .radius_m = info->shape ? info->shape->satellite->radius_m : sqrt(info->area_m2 / BST_PI),
        .shape = info->shape,
        .pose = info->shape ? shapes->poses[info->shape->index] : NULL};
}

bst_view_mutual bst_view_shapes_occultations(const bst_view_shapes *shapes,
                                             const bst_view_emission *at, bst_vec3 eye_m,
                                             bst_vec3 sun_m) {
    const bst_world *world = shapes->world;
    bst_view_mutual out = {1.0, 1.0};
    bst_occultation_body body =
        body_of(shapes, at->object, at->position_m, at->velocity_mps, at->seconds);
    for (int i = 0; i < world->occulter_count; i++) {
        int other = world->occulters[i];
        for (int side = 0; side < 2 && other != at->object; side++) {
            /* sunlight passed it before the emission, the light to the observer passes after */
            double seconds = at->seconds, sign = side == 0 ? -1.0 : 1.0;
            bst_ctx quiet = {0};
            bst_world_state s;
            bool known = true;
            for (int k = 0; k < 2 && known; k++) {
                known = bst_world_orbit_state(&quiet, &world->objects[other].orbit, shapes->clock,
                                              world->epoch, seconds, true, &s) == BST_OK;
                double way = known ? bst_vec3_norm(bst_vec3_sub(s.position_m, at->position_m)) : 0;
                seconds = at->seconds + sign * way / BST_LIGHT_SPEED_MPS;
            }
            if (!known) {
                continue;
            }
            bst_occultation_body front =
                body_of(shapes, other, s.position_m, s.velocity_mps, seconds);
            if (side == 0) {
                out.sunlight *=
                    1.0 - bst_occultation_of_sun(shapes->occultation, &body, &front, sun_m);
            } else {
                out.visible *= 1.0 - bst_occultation_from_eye(shapes->occultation, &body, &front,
                                                              eye_m, sun_m);
            }
        }
    }
    return out;
}
