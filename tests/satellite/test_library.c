/* The satellites of scenarios/satellites: each can be built, gives its source, and reflects a
 * plausible part of the light that meets it. */
#include <dirent.h>

#include "tests/satellite/satellite_support.h"

/* Light in all directions for one direction of the Sun, and visible area, by a Fibonacci grid. */
static void judge(bst_satellite_pose *pose, double *reflected_m2, double *visible_m2) {
    enum { DIRECTIONS = 400 };
    bst_vec3 sun = bst_vec3_unit((bst_vec3){0.6, -0.3, -0.5});
    *reflected_m2 = *visible_m2 = 0.0;
    for (int i = 0; i < DIRECTIONS; i++) {
        double z = 1.0 - 2.0 * (i + 0.5) / DIRECTIONS, a = 2.39996323 * i, r = sqrt(1 - z * z);
        bst_satellite_light light = {.sun = sun,
                                     .observer = {r * cos(a), r * sin(a), z},
                                     .sun_radius_rad = 4.65e-3,
                                     .sunlit = 1.0,
                                     .emission = true};
        bst_satellite_aim aim = {sun, {0, 0, 1}, light.observer, 0.0};
        bst_satellite_flux flux;
        bst_satellite_pose_set(pose, &aim);
        bst_satellite_flux_at(pose, &light, &flux);
        assert_true(flux.sun[BST_SUNLIGHT_V] >= 0.0 && isfinite(flux.sun[BST_SUNLIGHT_V]));
        assert_true(flux.error >= 0.0 && isfinite(flux.error));
        *reflected_m2 += flux.sun[BST_SUNLIGHT_V] * 4.0 * BST_PI / DIRECTIONS;
        *visible_m2 += flux.visible_m2 / DIRECTIONS;
    }
}

static void all_satellites_can_be_built(void **state) {
    (void)state;
    DIR *folder = opendir("scenarios/satellites");
    assert_non_null(folder);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(folder));) {
        char path[400];
        if (!strstr(entry->d_name, ".json")) {
            continue;
        }
        snprintf(path, sizeof path, "scenarios/satellites/%s", entry->d_name);
        bst_ctx ctx = {0};
        bst_satellite *s;
        bst_satellite_pose *pose;
        bst_json *json;
        bst_satellite_config config;
        bst_assert_ok(&ctx, bst_json_load(&ctx, path, &json));
        bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "",
                                            bst_satellite_config_table, &config));
        assert_true(strlen(config.source) > 40 && config.confidence > 0);
        bst_config_free(bst_satellite_config_table, &config);
        bst_json_free(json);
        bst_assert_ok(&ctx, bst_satellite_load(&ctx, path, &s));
        bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, s, &pose));
        double reflected, visible;
        judge(pose, &reflected, &visible);
        /* the mean over observers of what they see is of the size of what the Sun sees; narrow
         * lobes fall between the directions of the grid, or count too much */
        if (!(reflected > 0.02 * visible && reflected < 2.0 * visible)) {
            fail_msg("%s: %g m^2 reflected of %g m^2", path, reflected, visible);
        }
        bst_satellite_pose_free(pose);
        bst_satellite_free(s);
        count++;
    }
    closedir(folder);
    assert_true(count >= 15);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_satellites_can_be_built)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
