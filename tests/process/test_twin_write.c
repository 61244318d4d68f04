/* Files of a twin: the fitted path as attitudes, the PSF's samples, and the scenario that names
 * them. Linked with wraps of what writes. */
#include <cjson/cJSON.h>

#include "sim/process/twin/twin_figures.h"
#include "sim/process/twin/twin_internal.h"
#include "tests/io/scratch.h"
#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

static struct {
    cJSON *scenario, *path, *report;
    float *psf, dark[BST_TEST_PIXELS];
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
    if (strstr(path, "_report.json")) {
        written.report = json;
        return BST_OK;
    }
    bool is_path = strstr(path, "_path.json") != NULL;
    assert_string_equal(path, is_path ? "folder/twin_path.json" : "folder/twin.json");
    *(is_path ? &written.path : &written.scenario) = json;
    return BST_OK;
}

WRAP(bst_status, bst_fits_write_map,
     (bst_ctx * ctx, const char *path, int width, int height, const float *pixels,
      const char *unit)) {
    (void)ctx;
    if (strstr(path, "_dark.fits")) {
        assert_string_equal(path, "folder/twin_dark.fits");
        assert_string_equal(unit, "electron/s");
        assert_int_equal(width, BST_TEST_NX);
        assert_int_equal(height, BST_TEST_NY);
        memcpy(written.dark, pixels, sizeof written.dark);
        return BST_OK;
    }
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

/* Attitudes of a path with so many values of its angles across and of its roll. */
static int attitudes_of(bst_twin *t, int across, int roll) {
    bst_ctx ctx = {0};
    bst_twin_camera c;
    const bst_twin_path before = t->model.path;
    t->model.path.count[0] = across;
    t->model.path.count[1] = roll;
    bst_assert_ok(&ctx, bst_twin_write(&ctx, t, &c));
    t->model.path = before;
    int count = cJSON_GetArraySize(member(member(written.path, "frames")->child, "pointing"));
    cJSON_Delete(written.scenario);
    cJSON_Delete(written.path);
    free(written.psf);
    return count;
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
    bst_twin_defect defect = {5, 3, 700.0};
    t.defects = &defect;
    t.defect_count = 1;
    bst_twin_camera c;
    /* a camera at rest, and one that only rolls or only turns */
    assert_int_equal(attitudes_of(&t, 1, 1), 2);
    assert_int_equal(attitudes_of(&t, 1, 3), 257);
    assert_int_equal(attitudes_of(&t, 3, 1), 257);
    bst_assert_ok(&ctx, bst_twin_write(&ctx, &t, &c));
    assert_true(written.stars);

    /* dark current: of an exposure of 2 s */
    bst_assert_close((double)written.dark[0], c.dark_e / 2.0, 1e-6 * c.dark_e);
    bst_assert_close((double)written.dark[3 * BST_TEST_NX + 5], (c.dark_e + 700.0) / 2.0, 1e-3);

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
    assert_string_equal(
        member(member(member(sensor, "camera"), "detector"), "dark_map")->valuestring,
        "twin_dark.fits");
    assert_string_equal(member(member(member(sensor, "modules"), "scenegen"), "type")->valuestring,
                        "opencl");
    assert_int_equal(cJSON_GetArraySize(member(member(root, "record"), "planes")), 2);
    cJSON_Delete(written.scenario);
    cJSON_Delete(written.path);
    free(written.psf);
}

enum { WIDE = 96, HIGH = 64, PIXELS = WIDE * HIGH };

/* A frame of which the residuals are even in blocks of 32 px, with 25 outliers. */
static void make_residuals(bst_twin_frames *f, double *structure_e) {
    static float stars[PIXELS], residual[PIXELS], variance[PIXELS];
    *f = (bst_twin_frames){
        .stars_e = stars, .residual_e = residual, .variance_e2 = variance, .level_dn = 4.25};
    double sum = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        int block = i / WIDE / 32 * 3 + i % WIDE / 32;
        variance[i] = 16.0F;
        residual[i] = (float)(block - 2);
        stars[i] = 0.0F;
    }
    for (int k = 0; k < 25; k++) { /* from 6 to 18 sigma, of both signs, at places of their own */
        residual[(2 * k + 1) * WIDE + 3 * k + 5] =
            (float)((k % 2 ? -1 : 1) * 4.0 * (6.0 + 0.5 * k));
    }
    residual[3] = NAN;
    for (int block = 0; block < 6; block++) {
        double total = 0.0, noise = 0.0, n = 0.0;
        for (int i = 0; i < 32 * 32; i++) {
            int at = (block / 3 * 32 + i / 32) * WIDE + block % 3 * 32 + i % 32;
            if (fabs((double)residual[at]) < 20.0) {
                total += (double)residual[at];
                noise += 16.0;
                n += 1.0;
            }
        }
        sum += (total / n) * (total / n) - noise / n / n;
    }
    *structure_e = sqrt(sum / 6.0);
}

static void report_of_the_fit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch s;
    scratch_make(&s);
    bst_process_frame frame = {.path = "folder/frame.fits", .place = {.hdu = 3}};
    bst_twin_star stars[4];
    bst_twin t = {.model = bst_test_twin_model(stars, 4),
                  .frame = &frame,
                  .photometry = {.stars = 21,
                                 .zero_point_mag = 20.5,
                                 .colour_mag = -0.07,
                                 .scatter_mag = 0.11,
                                 .bright_mag = 0.05,
                                 .bright = 9},
                  .catalogue_stars = 3};
    snprintf(t.stem, sizeof t.stem, "%s", scratch_path(&s, "twin"));
    double structure_e;
    bst_twin_frames frames;
    make_residuals(&frames, &structure_e);
    t.model.width = WIDE;
    t.model.height = HIGH;
    static const double expected[] = {4200.0, 1500.0, 4000.0,
                                      1.0}; /* two of them off by 0.75 mag */
    for (int i = 0; i < 4; i++) {
        stars[i].icrs = bst_vec3_from_radec(-1.0 + i, 0.2 * i - 0.5);
        stars[i].flux_e = 2000.0 + 1500.0 * i;
        stars[i].expected_e = expected[i];
        stars[i].v_mag = 9.0 + i;
        stars[i].b_minus_v = 0.1 * i;
        stars[i].inside = 1.0 - 0.1 * i;
    }
    stars[3].found = true;
    const bst_twin_camera camera = {.read_noise_e = 6.5, .background_e = 12.5, .pedestal_dn = 3.5};
    bst_twin_figures f = {0};
    const struct {
        const char *key;
        double *to;
    } keys[] = {{"chi2_per_pixel", &f.chi2},
                {"chi2_per_pixel_on_streaks", &f.chi2_streaks},
                {"chi2_per_pixel_without_outliers", &f.chi2_clipped},
                {"chi2_per_pixel_on_streaks_without_outliers", &f.chi2_streaks_clipped},
                {"chi2_per_pixel_by_header_noise", &f.chi2_header},
                {"explained_variance", &f.explained},
                {"explained_variance_of_light", &f.explained_clipped},
                {"explained_variance_on_streaks", &f.explained_streaks},
                {"explained_variance_of_light_by_catalogue", &f.explained_catalogue},
                {"streaks_across_rms_px", &f.across_px},
                {"streaks_along_rms_px", &f.along_px}};
    const int count = (int)(sizeof keys / sizeof *keys);
    for (int i = 0; i < count; i++) {
        *keys[i].to = 1.0 + 0.01 * i;
    }
    f.streaks = 17;
    f.pixels = 6000;
    f.streak_pixels = 400;
    f.streak_outliers = 19; /* below a twentieth */
    f.outliers = 25;
    bst_assert_ok(&ctx, bst_twin_write_report(&ctx, &t, &camera, &f, &frames));
    const cJSON *root = written.report, *node = member(root, "figures");
    assert_true(cJSON_IsTrue(member(root, "streaks_fit")));
    for (int i = 0; i < count; i++) {
        bst_assert_close(number(member(node, keys[i].key)), 1.0 + 0.01 * i, 0.0);
    }
    bst_assert_close(number(member(node, "streaks_measured")), 17, 0.0);
    bst_assert_close(number(member(node, "photometry_scatter_mag")), 0.11, 0.0);
    bst_assert_close(number(member(node, "photometry_scatter_bright_mag")), 0.05, 0.0);
    bst_assert_close(number(member(node, "photometry_stars")), 21, 0.0);
    bst_assert_close(number(member(node, "photometry_stars_bright")), 9, 0.0);
    bst_assert_close(number(member(node, "pixels_on_streaks")), 400, 0.0);
    bst_assert_close(number(member(node, "pixels_on_streaks_beyond_5_sigma")), 19, 0.0);
    node = member(root, "fit");
    bst_assert_close(number(member(node, "psf_wide_sigma_px")), 1.1 * 2.1, 1e-12);
    bst_assert_close(number(member(node, "psf_wide_share")), 0.3, 0.0);
    bst_assert_close(number(member(node, "colour_term_mag")), -0.07, 0.0);
    bst_assert_close(number(member(node, "path_coefficients")), 14, 0.0);
    node = member(root, "camera");
    bst_assert_close(number(member(node, "background_behind_e")), 12.5, 0.0);
    bst_assert_close(number(member(node, "pedestal_dn")), 3.5, 0.0);
    bst_assert_close(number(member(node, "level_rendered_minus_recorded_dn")), 4.25, 0.0);
    node = member(root, "missing");
    bst_assert_close(number(member(node, "stars_in_no_catalogue")), 1, 0.0);
    bst_assert_close(number(member(node, "light_in_no_catalogue")), 6500.0 / 17000.0, 1e-12);
    bst_assert_close(number(member(node, "catalogue_stars_off_by_0.75_mag")), 2, 0.0);
    bst_assert_close(number(member(node, "background_structure_e")), structure_e, 1e-6);
    const cJSON *pixel = member(node, "largest_outliers")->child;
    for (int k = 24; k > 4; k--, pixel = pixel->next) { /* the largest first */
        double sign = k % 2 ? -1.0 : 1.0;
        bst_assert_close(number(member(pixel, "x_px")), 3 * k + 5, 0.0);
        bst_assert_close(number(member(pixel, "y_px")), 2 * k + 1, 0.0);
        bst_assert_close(number(member(pixel, "sigma")), sign * (6.0 + 0.5 * k), 1e-9);
        bst_assert_close(number(member(pixel, "electrons")), sign * 4.0 * (6.0 + 0.5 * k), 1e-9);
    }
    assert_null(pixel);
    node = member(root, "stars")->child;
    for (int i = 0; i < 3; i++, node = node->next) {
        double ra = i == 0 ? 2.0 * BST_PI - 1.0 : i - 1.0;
        bst_assert_close(number(member(node, "ra_deg")), ra * 180.0 / BST_PI, 1e-9);
        bst_assert_close(number(member(node, "dec_deg")), (0.2 * i - 0.5) * 180.0 / BST_PI, 1e-9);
        bst_assert_close(number(member(node, "share_on_frame")), 1.0 - 0.1 * i, 1e-12);
        bst_assert_close(number(member(node, "b_minus_v")), 0.1 * i, 1e-12);
        assert_true(cJSON_IsTrue(member(node, "in_catalogue")));
    }
    assert_true(cJSON_IsFalse(member(node, "in_catalogue")));
    cJSON_Delete(written.report);
    f.streak_outliers = 21;
    bst_assert_ok(&ctx, bst_twin_write_report(&ctx, &t, &camera, &f, &frames));
    assert_true(cJSON_IsFalse(member(written.report, "streaks_fit")));
    cJSON_Delete(written.report);
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(files_of_the_fit),
                                       cmocka_unit_test(report_of_the_fit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
