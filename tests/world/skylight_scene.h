/* Scenes for the tests of the sky background: a camera that looks from a place near the Earth. */
#ifndef TESTS_WORLD_SKYLIGHT_SCENE_H
#define TESTS_WORLD_SKYLIGHT_SCENE_H

#include "sim/world/scene/skylight.h"
#include "tests/world/world_support.h"

#define FULL_SUN pow(10.0, 0.4 * 26.74)

static bst_scene_surroundings look_down(bst_vec3 eye, double y_rad) {
    bst_scene_surroundings a = {
        .eye_m = eye,
        .bodies = {.sun_m = {BST_AU_M, 0, 0}, .moon_m = {0, 0, 3.844e8}, .pole = {0, 0, 1}},
        .itrf_from_gcrf = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
        .exposure_s = 1};
    a.light.sun_m = bst_vec3_sub(a.bodies.sun_m, eye);
    /* rows of the rotation: camera axes in GCRF */
    double c = cos(y_rad), s = sin(y_rad);
    bst_vec3 z = {-c, s, 0}, xx = {s, c, 0}, yy = bst_vec3_cross(z, xx);
    bst_mat3 m = {{{xx.x, xx.y, xx.z}, {yy.x, yy.y, yy.z}, {z.x, z.y, z.z}}};
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        a.q[k] = bst_quat_from_mat3(&m);
    }
    return a;
}

#define SKY_WORLD(size, background)                                                    \
    "{\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": "      \
    "\"neossat\", " TEST_NEOSSAT                                                       \
    ", \"sensors\": [{\"camera\": {\"pixel_scale_arcsec\": 20, \"aperture_m\": 0.15, " \
    "\"width_px\": " size ", \"height_px\": " size                                     \
    ", \"background_mag_arcsec2\": 21, \"background\": {" background "}}}]}]}"

static inline const bst_skylight_map *make(bst_world *world, const bst_scene_surroundings *around,
                                           bst_window window, bst_skylight **skylight) {
    bst_ctx ctx = {0};
    const bst_skylight_map *map;
    bst_assert_ok(&ctx, bst_skylight_create(&ctx, world, bst_world_camera(world, 0, 0), skylight));
    bst_assert_ok(&ctx, bst_skylight_make(&ctx, *skylight, around, window, &map));
    return map;
}

#endif
