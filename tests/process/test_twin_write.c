/* Files of a twin: the fitted path as attitudes, the PSF's samples, and the scenario that names
 * them. Linked with wraps of what writes. */
#include <cjson/cJSON.h>

#include "sim/process/twin/twin_internal.h"
#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

static struct {
    cJSON *scenario, *path;
    float *psf;
    int side;
    bool stars;
} written;

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

WRAP(bst_status, bst_keyword_map_camera, (bst_ctx * ctx, const char *path, struct cJSON **out)) {
    (void)ctx;
    (void)path;
    *out = cJSON_CreateObject();
    return BST_OK;
}

WRAP(bst_status, bst_cli_write_json, (bst_ctx * ctx, const char *path, cJSON *json)) {
    (void)ctx;
    bool is_path = strstr(path, "_path.json") != NULL;
    assert_string_equal(path, is_path ? "folder/twin_path.json" : "folder/twin.json");
    *(is_path ? &written.path : &written.scenario) = json;
    return BST_OK;
}

WRAP(bst_status, bst_fits_write_map,
     (bst_ctx * ctx, const char *path, int width, int height, const float *pixels,
      const char *unit)) {
    (void)ctx;
    (void)unit;
    assert_string_equal(path, "folder/twin_psf.fits");
    assert_int_equal(width, height);
    written.side = width;
    written.psf = malloc((size_t)width * (size_t)width * sizeof *written.psf);
    memcpy(written.psf, pixels, (size_t)width * (size_t)width * sizeof *written.psf);
    return BST_OK;
}

WRAP(bst_status, bst_twin_write_stars,
     (bst_ctx * ctx, const bst_twin *twin, const bst_twin_camera *camera, const char *path)) {
    (void)ctx;
    (void)twin;
    (void)camera;
    assert_string_equal(path, "folder/twin_stars.bin");
    written.stars = true;
    return BST_OK;
}

static const cJSON *member(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(node, key);
    if (!item) {
        fail_msg("there is no %s", key);
    }
    return item;
}

static double number(const cJSON *item) {
    return cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL);
}

static void files_of_the_fit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin_star stars[4];
    bst_process_frame all[2] = {{.exposure_ticks = 15000}, {.exposure_ticks = 20000}};
    bst_process_request own = {.catalogue = "embedded", .out = "folder/run"};
    const bst_twin_request request = {.catalogue = "embedded", .out = "folder/twin.json"};
    bst_twin t = {.request = &request,
                  .model = bst_test_twin_model(stars, 4),
                  .frame = &all[1],
                  .stem = "folder/twin",
                  .read_noise_e = 3.0,
                  .photometry = {.zero_point_mag = 20.0},
                  .process = {.request = &own,
                              .frames = all,
                              .count = 2,
                              .width = BST_TEST_NX,
                              .height = BST_TEST_NY}};
    all[1].start_tick = 70000;
    all[1].values.exposure_s = 2.0;
    all[1].values.gain_e_per_dn = 1.0;
    t.process.map.dn_per_unit = 1.0;
    bst_twin_camera c;
    bst_assert_ok(&ctx, bst_twin_write(&ctx, &t, &c));
    assert_true(written.stars);

    /* PSF: five samples a pixel, to six widths of the wide Gaussian */
    int half = (int)ceil(6.0 * 1.1 * 2.1 * 5.0);
    assert_int_equal(written.side, 2 * half + 1);
    double sum = 0.0, square = 0.0, middle = 0.0;
    for (int i = 0; i < written.side * written.side; i++) {
        double x = (i % written.side - half) / 5.0, y = (i / written.side - half) / 5.0;
        double light = (double)written.psf[i];
        sum += light;
        square += light * (x * x + y * y);
        middle += fabs(x) < 0.1 && fabs(y) < 0.1 ? light : 0.0;
    }
    double wide = 1.1 * 2.1, mean = 0.7 * 1.1 * 1.1 + 0.3 * wide * wide;
    bst_assert_close(square / sum, 2.0 * mean, 1e-3 * mean);
    bst_assert_close(25.0 * middle / sum,
                     (0.7 / (1.1 * 1.1) + 0.3 / (wide * wide)) / (2.0 * BST_PI), 1e-4);

    /* the frame alone, with the fitted path */
    const cJSON *frames = member(written.path, "frames");
    assert_int_equal(cJSON_GetArraySize(frames), 1);
    bst_assert_close(number(member(frames->child, "exposure_s")), 2.0, 0.0);
    int k = 0;
    const cJSON *node = member(frames->child, "pointing")->child;
    for (; node; node = node->next, k++) {
        double u = k / 256.0;
        bst_assert_close(number(member(node, "time_s")), 2.0 * u, 1e-12);
        bst_quat q = bst_twin_path_attitude(&t.model.path, u);
        const cJSON *list = member(node, "q_cam_from_gcrf");
        double sign = number(cJSON_GetArrayItem(list, 3)) * q.w < 0.0 ? -1.0 : 1.0;
        bst_assert_close(number(cJSON_GetArrayItem(list, 0)), sign * q.x, 1e-12);
        bst_assert_close(number(cJSON_GetArrayItem(list, 1)), sign * q.y, 1e-12);
        bst_assert_close(number(cJSON_GetArrayItem(list, 2)), sign * q.z, 1e-12);
    }
    assert_int_equal(k, 257);

    const cJSON *root = written.scenario;
    assert_string_equal(member(root, "name")->valuestring, "twin");
    assert_string_equal(member(member(root, "world"), "star_catalogue")->valuestring,
                        "twin_stars.bin");
    const cJSON *observer = member(root, "observers")->child;
    assert_string_equal(member(member(observer, "orbit"), "states_file")->valuestring,
                        "twin_path.json");
    const cJSON *sensor = member(observer, "sensors")->child;
    assert_string_equal(member(sensor, "frame_updates_file")->valuestring, "twin_path.json");
    bst_assert_close(number(member(member(sensor, "camera"), "pixel_scale_arcsec")), 60.0, 0.0);
    assert_string_equal(member(member(member(sensor, "camera"), "optics"), "psf_file")->valuestring,
                        "twin_psf.fits");
    assert_string_equal(member(member(member(sensor, "modules"), "scenegen"), "type")->valuestring,
                        "opencl");
    assert_int_equal(cJSON_GetArraySize(member(member(root, "record"), "planes")), 2);
    cJSON_Delete(written.scenario);
    cJSON_Delete(written.path);
    free(written.psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(files_of_the_fit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
