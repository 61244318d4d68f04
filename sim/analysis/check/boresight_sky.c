#include "sim/analysis/check/boresight_sky.h"

#include <stdlib.h>

#include "sim/world/scene/skylight.h"

/* Stars that are fainter count as background. No star counts add up to a full well. */
#define STAR_LIMIT_V_MAG 15.0

struct bst_boresight_sky {
    bst_camera camera; /* of the pixel at the boresight: edges of discs are looked for on all of a
                          sensor, which takes milliseconds on a large one */
    bst_world_view *view;
    int observer;
    bst_skylight *light;
};

bst_status bst_boresight_sky_create(bst_ctx *ctx, const bst_world *world, bst_world_view *view,
                                    int observer, int sensor, bst_boresight_sky **out) {
    *out = NULL;
    bst_boresight_sky *sky = calloc(1, sizeof *sky);
    if (!sky) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the sky at the boresight");
    }
    sky->camera = *bst_world_camera(world, observer, sensor);
    sky->camera.width_px = sky->camera.height_px = 1;
    sky->camera.boresight_offset_px[0] = sky->camera.boresight_offset_px[1] = 0.0;
    sky->view = view;
    sky->observer = observer;
    bst_status status = bst_skylight_create(ctx, world, &sky->camera, &sky->light);
    if (status != BST_OK) {
        free(sky);
        return status;
    }
    *out = sky;
    return BST_OK;
}

void bst_boresight_sky_free(bst_boresight_sky *sky) {
    if (sky) {
        bst_skylight_free(sky->light);
        free(sky);
    }
}

bst_status bst_boresight_sky_at(bst_ctx *ctx, bst_boresight_sky *sky, double seconds,
                                bst_vec3 direction, double exposure_s, double *e) {
    bst_world_state eye;
    bst_bodies bodies;
    bst_astro_earth_frames frames;
    BST_TRY(bst_world_view_observer_state(ctx, sky->view, sky->observer, seconds, &eye));
    BST_TRY(bst_world_view_bodies(ctx, sky->view, seconds, &bodies));
    BST_TRY(bst_world_view_earth_frames(ctx, sky->view, seconds, &frames));
    bst_scene_surroundings around = {
        .eye_m = eye.position_m,
        .eye_mps = eye.velocity_mps,
        .bodies = bodies,
        .itrf_from_gcrf = frames.itrf_from_gcrf,
        .light = bst_light_at(&bodies, eye.position_m, eye.velocity_mps),
        .exposure_s = exposure_s,
        .v_limit = STAR_LIMIT_V_MAG,
        .faint_limit = STAR_LIMIT_V_MAG};
    /* the camera holds its apparent boresight */
    bst_vec3 apparent = bst_light_aberrate(&around.light, direction);
    bst_quat q = bst_quat_look(apparent, (bst_vec3){0, 0, 1});
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        around.q[k] = q;
    }
    const bst_window pixel = {.width = 1, .height = 1};
    const bst_skylight_map *map;
    BST_TRY(bst_skylight_make(ctx, sky->light, &around, pixel, &map));
    *e = bst_skylight_at(map, 0, 0);
    return BST_OK;
}
