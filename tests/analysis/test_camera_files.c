/* Files of `boresight calibrate-camera`, with a figure of its own for each key, and the plot as
 * gnuplot gets it. */
#include <cjson/cJSON.h>

#include "sim/analysis/camera/camera_calibration.h"
#include "tests/io/plot_script.h"

enum { STARS = 3 };

static const bst_camera_figures figures = {
    .geometry = {.pixel_scale_arcsec = 3.25,
                 .pixel_scale_sigma_arcsec = 0.001,
                 .distortion = {.k1 = 0.21, .k2 = -0.32, .p1 = 0.043, .p2 = -0.054},
                 .distortion_sigma = {.k1 = 0.021, .k2 = 0.033, .p1 = 0.0042, .p2 = 0.0055},
                 .corner_sigma_px = 0.061,
                 .rms_px = 0.072,
                 .scatter_px = 0.083,
                 .stars = 91,
                 .rejected = 7,
                 .frames = 5},
    .photometry = {.zero_point_mag = 21.75,
                   .zero_point_sigma_mag = 0.012,
                   .colour_term = -0.15,
                   .colour_term_sigma = 0.034,
                   .scatter_mag = 0.056,
                   .stars = 80,
                   .rejected = 3},
    .widths = {.fwhm_px = 2.25,
               .fwhm_sigma_px = 0.02,
               .stars = 60,
               .ninth_px = {2.0, 2.1, 2.2, 2.3, NAN, 2.5, 2.6, 2.7, 2.8}}};

static const bst_camera_fit_star stars[STARS] = {{.id = 77,
                                                  .x_px = 100.5,
                                                  .y_px = 20.25,
                                                  .v_mag = 9.5,
                                                  .b_minus_v = 0.75,
                                                  .rate_e_per_s = 10000,
                                                  .residual_x_px = 0.125,
                                                  .residual_y_px = -0.25},
                                                 {.id = 78,
                                                  .x_px = 300,
                                                  .y_px = 410,
                                                  .v_mag = 8.25,
                                                  .b_minus_v = NAN,
                                                  .rate_e_per_s = 500,
                                                  .residual_x_px = NAN,
                                                  .residual_y_px = NAN},
                                                 {.id = 79,
                                                  .x_px = 640,
                                                  .y_px = 5,
                                                  .v_mag = 7.125,
                                                  .b_minus_v = -0.125,
                                                  .rate_e_per_s = NAN,
                                                  .residual_x_px = -0.5,
                                                  .residual_y_px = 0.0625}};
static const int64_t exposures[STARS] = {4, 4, 6};

static char *text_of(scratch *s, const char *name) {
    static char text[20000];
    FILE *f = fopen(scratch_path(s, name), "rb");
    assert_non_null(f);
    size_t n = fread(text, 1, sizeof text - 1, f);
    text[n] = '\0';
    fclose(f);
    return text;
}

static const cJSON *at(const cJSON *root, const char *group, const char *key) {
    const cJSON *node =
        cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(root, group), key);
    if (!node) {
        fail_msg("the report has no %s/%s", group, key);
    }
    return node;
}

static void assert_value(const cJSON *root, const char *group, const char *key, double value,
                         double sigma) {
    const cJSON *node = at(root, group, key);
    bst_assert_close(cJSON_GetObjectItemCaseSensitive(node, "value")->valuedouble, value, 0.0);
    bst_assert_close(cJSON_GetObjectItemCaseSensitive(node, "standard_error")->valuedouble, sigma,
                     0.0);
}

static void all_figures_are_in_the_files(void **state) {
    (void)state;
    static char script[20000];
    bst_ctx ctx = {0};
    scratch s;
    plot_script p;
    scratch_make(&s);
    plot_script_begin(&p);
    const bst_camera camera = {.width_px = 700, .height_px = 450};
    const bst_camera_calibration_request request = {.out = s.folder, .camera = "/the/camera"};
    bst_assert_ok(&ctx, bst_camera_calibration_write(&ctx, &request, &camera, &figures, stars,
                                                     exposures, STARS));
    plot_script_end(&p, script, sizeof script);
    cJSON *report = cJSON_Parse(text_of(&s, "report.json"));
    assert_non_null(report);
    assert_value(report, "geometry", "pixel_scale_arcsec", 3.25, 0.001);
    assert_value(report, "geometry", "k1", 0.21, 0.021);
    assert_value(report, "geometry", "k2", -0.32, 0.033);
    assert_value(report, "geometry", "p1", 0.043, 0.0042);
    assert_value(report, "geometry", "p2", -0.054, 0.0055);
    assert_value(report, "psf", "fwhm_px", 2.25, 0.02);
    assert_value(report, "photometry", "zero_point_mag", 21.75, 0.012);
    assert_value(report, "photometry", "colour_term", -0.15, 0.034);
    static const struct {
        const char *group, *key;
        double value;
    } plain[] = {{"geometry", "stars", 91},     {"geometry", "rejected", 7},
                 {"geometry", "frames", 5},     {"geometry", "corner_sigma_px", 0.061},
                 {"geometry", "rms_px", 0.072}, {"geometry", "scatter_px", 0.083},
                 {"psf", "stars", 60},          {"photometry", "stars", 80},
                 {"photometry", "rejected", 3}, {"photometry", "scatter_mag", 0.056}};
    for (size_t i = 0; i < sizeof plain / sizeof *plain; i++) {
        bst_assert_close(at(report, plain[i].group, plain[i].key)->valuedouble, plain[i].value,
                         0.0);
    }
    for (int i = 0; i < 9; i++) {
        const cJSON *one = cJSON_GetArrayItem(at(report, "psf", "fwhm_px_by_ninth"), i);
        assert_true(i == 4 ? cJSON_IsNull(one) : one->valuedouble == figures.widths.ninth_px[i]);
    }
    cJSON_Delete(report);
    cJSON *scenario = cJSON_Parse(text_of(&s, "camera.json"));
    assert_non_null(scenario);
    bst_assert_close(at(scenario, "set", "/the/camera/pixel_scale_arcsec")->valuedouble, 3.25, 0.0);
    bst_assert_close(at(scenario, "set", "/the/camera/distortion/k1")->valuedouble, 0.21, 0.0);
    bst_assert_close(at(scenario, "set", "/the/camera/distortion/k2")->valuedouble, -0.32, 0.0);
    bst_assert_close(at(scenario, "set", "/the/camera/distortion/p1")->valuedouble, 0.043, 0.0);
    bst_assert_close(at(scenario, "set", "/the/camera/distortion/p2")->valuedouble, -0.054, 0.0);
    cJSON_Delete(scenario);
    assert_string_equal(strchr(text_of(&s, "stars.csv"), '\n') + 1,
                        "4,77,100.5000,20.2500,0.12500,-0.25000,9.500,0.750,10000\r\n"
                        "4,78,300.0000,410.0000,,,8.250,,500\r\n"
                        "6,79,640.0000,5.0000,-0.50000,0.06250,7.125,-0.125,\r\n");
    /* arrows of 500 times the residuals, in the frame with y downwards; V of one electron a second
     * by colour */
    const char *from = script;
    double row[4];
    plot_script_numbers(&from, "$left << EOD\n", 4, row);
    assert_true(row[0] == 100.5 && row[1] == 20.25 && row[2] == 62.5 && row[3] == -125.0);
    plot_script_numbers(&from, "\n", 4, row);
    assert_true(row[0] == 640.0 && row[1] == 5.0 && row[2] == -250.0 && row[3] == 31.25);
    plot_script_numbers(&from, "$light << EOD\n", 2, row);
    assert_true(row[0] == 0.75 && row[1] == 9.5 + 10.0);
    assert_memory_equal(from, "\nEOD", 4);
    plot_script_numbers(&from, "set xrange [", 2, row);
    assert_true(row[0] == 0.0 && row[1] == 700.0);
    plot_script_numbers(&from, "set yrange [", 2, row);
    assert_true(row[0] == 450.0 && row[1] == 0.0);
    assert_non_null(strstr(from, "21.750000 + -0.150000 * x"));
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_figures_are_in_the_files)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
