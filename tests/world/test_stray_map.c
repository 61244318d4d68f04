/* Maps of stray light over the sensor. */
#include "sim/world/scene/stray_map.h"

#include <stdlib.h>

#include "sim/world/world_config.h"
#include "tests/world/skylight_scene.h"

/* A map of columns x rows numbers, rough over the sensor. */
static float *numbers(int columns, int rows) {
    float *v = malloc((size_t)columns * (size_t)rows * sizeof *v);
    assert_non_null(v);
    for (int i = 0; i < columns * rows; i++) {
        v[i] = (float)(1 + (i * 7) % 23);
    }
    return v;
}

static bst_world *mapped_world(const char *background, int columns, int rows) {
    char text[900];
    snprintf(text, sizeof text, SKY_WORLD("128", "%s"), background);
    bst_ctx ctx = {0};
    bst_world *world = test_world(text);
    bst_assert_ok(
        &ctx, bst_world_set_stray_map(&ctx, world, 0, 0, columns, rows, numbers(columns, rows)));
    return world;
}

/* The map of a pixel between the middles of blocks, in double precision. */
static double between(double x, double y, int columns, int rows) {
    double u = fmin(fmax((x + 0.5) * columns / 128.0 - 0.5, 0.0), columns - 1.0);
    double v = fmin(fmax((y + 0.5) * rows / 128.0 - 0.5, 0.0), rows - 1.0), sum = 0.0;
    int i0 = (int)u, j0 = (int)v;
    for (int j = j0; j < rows && j <= j0 + 1; j++) {
        for (int i = i0; i < columns && i <= i0 + 1; i++) {
            double w = fmax(1.0 - fabs(u - i), 0.0) * fmax(1.0 - fabs(v - j), 0.0);
            sum += w * (1 + ((j * columns + i) * 7) % 23);
        }
    }
    return sum;
}

static const bst_vec3 far_away = {-4e7, 0, 0};

/* Electrons per second, times the factor and the exposure, beside the uniform sky; any window. */
static void maps_are_added(void **state) {
    (void)state;
    const int sizes[][2] = {{128, 128}, {16, 32}, {1, 1}, {64, 2}};
    bst_world *plain = mapped_world("\"stray_map_scale\": 0, \"stray_map_file\": \"x\"", 1, 1);
    bst_skylight *none, *b;
    bst_scene_surroundings around = look_down(far_away, 1.0);
    around.exposure_s = 2.5;
    const bst_window all = {0, 0, 128, 128}, part = {37, 50, 41, 19};
    const bst_skylight_map *without = make(plain, &around, all, &none);
    double sky = bst_skylight_at(without, 5, 5);
    for (int k = 0; k < 4; k++) {
        bst_world *world = mapped_world("\"stray_map_scale\": 3, \"stray_map_file\": \"x\"",
                                        sizes[k][0], sizes[k][1]);
        const bst_window windows[] = {all, part};
        for (int n = 0; n < 2; n++) {
            const bst_window w = windows[n];
            const bst_skylight_map *map = make(world, &around, w, &b);
            assert_int_equal(map->step_px, 1);
            double least = INFINITY;
            for (int y = w.y0; y < w.y0 + w.height; y++) {
                for (int x = w.x0; x < w.x0 + w.width; x++) {
                    double want = sky + 7.5 * between(x, y, sizes[k][0], sizes[k][1]);
                    /* a few roundings of floats below 256 */
                    bst_assert_close(bst_skylight_at(map, x, y), want, 1e-4);
                    least = fmin(least, want);
                }
            }
            bst_assert_close(map->least_e, least, 1e-4);
            bst_skylight_free(b);
            bst_assert_ok(
                &(bst_ctx){0}, /* places alone: the same */
                bst_skylight_create(&(bst_ctx){0}, world, bst_world_camera(world, 0, 0), &b));
            bst_skylight_set_places_only(b);
            bst_assert_ok(&(bst_ctx){0}, bst_skylight_make(&(bst_ctx){0}, b, &around, w, &map));
            bst_assert_close(bst_skylight_at(map, 60, 55),
                             sky + 7.5 * between(60, 55, sizes[k][0], sizes[k][1]), 1e-4);
            bst_skylight_free(b);
        }
        bst_world_free(world);
    }
    bst_skylight_free(none);
    bst_world_free(plain);
}

/* The same scene without the sky's light but that of the bodies, with and without a shape. */
#define BODIES                                                                            \
    "\"model\": \"sky\", \"zodiacal\": false, \"starlight\": false, \"pixel_pitch_um\": " \
    "10, \"pst\": [{\"angle_deg\": 0, \"pst\": 1e-2}, {\"angle_deg\": 180, \"pst\": 1e-4}]"

/* Shares of the stray light of Sun, Moon and Earth: the even light times the map's number. */
static void maps_share_out_the_light_of_bodies(void **state) {
    (void)state;
    const bst_window all = {0, 0, 128, 128};
    bst_scene_surroundings around = look_down(far_away, 1.0);
    char even_text[900];
    snprintf(even_text, sizeof even_text, SKY_WORLD("128", "%s"), BODIES);
    bst_world *even_world = test_world(even_text);
    bst_world *world =
        mapped_world(BODIES ", \"stray_map\": \"share\", \"stray_map_file\": \"x\"", 128, 128);
    bst_skylight *even, *b;
    double light = bst_skylight_at(make(even_world, &around, all, &even), 3, 3);
    const bst_skylight_map *map = make(world, &around, all, &b);
    assert_true(light > 1.0);
    for (int i = 0; i < 128 * 128; i += 37) { /* rounding of floats */
        double want = light * between(i % 128, i / 128, 128, 128);
        bst_assert_close(bst_skylight_at(map, i % 128, i / 128), want, 1e-6 * want);
    }
    bst_skylight_free(even);
    bst_skylight_free(b);
    bst_world_free(even_world);
    bst_world_free(world);
}

static void bad_maps_are_named(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 128, .height_px = 96};
    bst_stray_map *map;
    assert_int_equal(bst_stray_map_create(&ctx, &camera, 100, 96, numbers(100, 96), &map),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "has 100 x 96 pixels, the sensor 128 x 96"));
    const float wrong[] = {NAN, -1.0f, INFINITY};
    for (int i = 0; i < 3; i++) {
        float *v = numbers(128, 96);
        v[128 * 5 + 9] = wrong[i];
        assert_int_equal(bst_stray_map_create(&ctx, &camera, 128, 96, v, &map), BST_ERR_CONFIG);
        assert_non_null(strstr(ctx.message, "at pixel (9, 5) from 0; allowed are 0 to 1e12"));
    }
    camera.background.stray_map = BST_STRAY_MAP_SHARE;
    assert_int_equal(bst_stray_map_create(&ctx, &camera, 128, 96, numbers(128, 96), &map),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "give model \"sky\" and pst"));
    assert_null(map);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(maps_are_added),
        cmocka_unit_test(maps_share_out_the_light_of_bodies),
        cmocka_unit_test(bad_maps_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
