/* What `boresight pd --pair` prints, writes and draws of a measurement, with a number of its own in
 * each field. Linked with a wrap of what begins and ends a plot: its script is read back. */
#include <cjson/cJSON.h>
#include <stdlib.h>

#include "sim/analysis/pd/pd_pair.h"
#include "sim/io/plot.h"
#include "tests/stdout_text.h"

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

static char script[32768];

WRAP(bst_status, bst_plot_begin,
     (bst_ctx * ctx, bst_plot *plot, const char *path, int width, int height)) {
    (void)ctx;
    assert_string_equal(path, "p.png");
    assert_int_equal(width, 1400); /* two panels: points and streaks */
    assert_int_equal(height, 800);
    plot->script = tmpfile();
    return BST_OK;
}

WRAP(bst_status, bst_plot_end, (bst_ctx * ctx, bst_plot *plot, bool *made)) {
    (void)ctx;
    (void)made;
    rewind(plot->script);
    script[fread(script, 1, sizeof script - 1, plot->script)] = '\0';
    fclose(plot->script);
    return BST_OK;
}

/* Wilson's interval as the roots of (p - hits / n)^2 = z^2 p (1 - p) / n. */
static void wilson(double hits, double n, double out[2]) {
    double z2 = 1.959963984540054 * 1.959963984540054, p = hits / n;
    double root = sqrt(z2 * z2 / (4.0 * n * n) + z2 * p * (1.0 - p) / n);
    out[0] = (p + z2 / (2.0 * n) - root) / (1.0 + z2 / n);
    out[1] = (p + z2 / (2.0 * n) + root) / (1.0 + z2 / n);
}

/* Two ratios of points, two of streaks; two SNRs each; the first of all has no separation at 0.9.
 */
static bst_pd_pair_result *result(void) {
    bst_pd_pair_result *r = calloc(1, sizeof *r);
    *r = (bst_pd_pair_result){.count = 4,
                              .sensor = "eye/tele",
                              .scenario = "night",
                              .detector = "mine",
                              .width_px = 640,
                              .height_px = 480,
                              .fwhm_px = 2.25,
                              .noise_e = 8.5,
                              .exposure_s = 0.75,
                              .false_splits = 0.02,
                              .bound_false_splits = 0.03,
                              .frames = 77,
                              .wall_s = 12.5};
    for (int c = 0; c < 4; c++) {
        r->curves[c] = (bst_pd_pair_curve){
            .ratio = c % 2 ? 5.0 : 2.0, .streak_px = c < 2 ? 0.0 : 11.0, .count = 2};
        for (int i = 0; i < 2; i++) {
            double n = 1.0 + 2 * c + i;
            r->curves[c].points[i] =
                (bst_pd_pair_point){.snr = 20.0 + 30.0 * i,
                                    .v_mag = 10.0 + 0.01 * n,
                                    .separations = 2,
                                    .counts = {{0.5 * n, 40, (int64_t)n}, {0.75 * n, 50, 20}},
                                    .singles = 100 + (int64_t)n,
                                    .split = 1 + (int64_t)n,
                                    .needed = {c + i == 0 ? (double)NAN : 1.0 + 0.1 * n, 0.02 * n},
                                    .bound = {0.9 + 0.01 * n, 1.2 + 0.01 * n}};
        }
    }
    r->curves[0].points[0].needed.sigma = (double)NAN;
    return r;
}

static void table(void **state) {
    (void)state;
    char text[8192];
    bst_pd_pair_result *r = result();
    bst_stdout_text out;
    bst_stdout_take(&out);
    bst_pd_pair_print(r);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_has(text, "eye/tele: 640 x 480 px, FWHM 2.25 px, noise 8.5 e- per pixel, 0.75 s\n");
    bst_assert_has(text, "77 frames; 12.5 s in all\n");
    bst_assert_has(text, "share of single sources that may be split: 0.02\n");
    bst_assert_has(text, "points, 2:1\n");
    bst_assert_has(text, "streaks of 11 px, 5:1\n");
    double w[2];
    char line[200];
    wilson(2, 101, w);
    snprintf(
        line, sizeof line,
        "     20   10.01         -      -    0.910    1.210      -       101   0.0198  %.4f to "
        "%.4f\n",
        w[0], w[1]);
    bst_assert_has(text, line);
    bst_assert_has(text, "0.5 px: 0.025, 0.75 px: 0.400\n");
    /* the third curve's second point: number 6; over the bound 1.6 / 0.96 */
    wilson(7, 106, w);
    snprintf(
        line, sizeof line,
        "     50   10.06     1.600  0.120    0.960    1.260   1.67       106   0.0660  %.4f to "
        "%.4f\n",
        w[0], w[1]);
    bst_assert_has(text, line);
    bst_assert_has(text, "3 px: 0.150, 4.5 px: 0.400\n");
    r->false_splits = 0.0;
    bst_stdout_take(&out);
    bst_pd_pair_print(r);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_has(text, "no test for pairs");
    bst_assert_has(text, "bounds are at 0.03\n");
    r->false_splits = -1.0;
    bst_stdout_take(&out);
    bst_pd_pair_print(r);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_has(text, "bounds are at a share of false splits of 0.03\n");
    free(r);
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(node, key);
    if (!item) {
        fail_msg("there is no %s", key);
    }
    return cJSON_IsNumber(item) ? item->valuedouble
           : cJSON_IsNull(item) ? (double)NAN
                                : strtod(item->valuestring, NULL);
}

static void json(void **state) {
    (void)state;
    bst_pd_pair_result *r = result();
    cJSON *root = bst_pd_pair_json(r);
    bst_assert_close(number(root, "width_px"), 640, 0);
    bst_assert_close(number(root, "height_px"), 480, 0);
    bst_assert_close(number(root, "fwhm_px"), 2.25, 0);
    bst_assert_close(number(root, "noise_e"), 8.5, 0);
    bst_assert_close(number(root, "exposure_s"), 0.75, 0);
    bst_assert_close(number(root, "false_splits_requested"), 0.02, 0);
    bst_assert_close(number(root, "bound_false_splits"), 0.03, 0);
    bst_assert_close(number(root, "frames"), 77, 0);
    bst_assert_close(number(root, "wall_s"), 12.5, 0);
    assert_string_equal(cJSON_GetObjectItem(root, "scenario")->valuestring, "night");
    assert_string_equal(cJSON_GetObjectItem(root, "sensor")->valuestring, "eye/tele");
    assert_string_equal(cJSON_GetObjectItem(root, "detector")->valuestring, "mine");
    const cJSON *curves = cJSON_GetObjectItem(root, "curves");
    assert_int_equal(cJSON_GetArraySize(curves), 4);
    for (int c = 0; c < 4; c++) {
        const cJSON *curve = cJSON_GetArrayItem(curves, c);
        bst_assert_close(number(curve, "ratio"), c % 2 ? 5.0 : 2.0, 0);
        bst_assert_close(number(curve, "streak_px"), c < 2 ? 0.0 : 11.0, 0);
        for (int i = 0; i < 2; i++) {
            const cJSON *p = cJSON_GetArrayItem(cJSON_GetObjectItem(curve, "points"), i);
            double n = 1.0 + 2 * c + i, w[2], loose = 1e-12;
            bst_assert_close(number(p, "snr"), 20.0 + 30.0 * i, 0);
            bst_assert_close(number(p, "v_mag"), 10.0 + 0.01 * n, loose);
            bst_assert_close(number(p, "bound_known_px"), 0.9 + 0.01 * n, loose);
            bst_assert_close(number(p, "bound_unknown_px"), 1.2 + 0.01 * n, loose);
            bst_assert_close(number(p, "singles"), 100 + n, 0);
            bst_assert_close(number(p, "singles_split"), 1 + n, 0);
            bst_assert_close(number(p, "false_splits"), (1 + n) / (100 + n), loose);
            wilson(1 + n, 100 + n, w);
            bst_assert_close(number(p, "false_splits_low"), w[0], 1e-9);
            bst_assert_close(number(p, "false_splits_high"), w[1], 1e-9);
            if (c + i == 0) {
                assert_true(isnan(number(p, "separation_pd90_px")));
                assert_true(isnan(number(p, "separation_pd90_sigma_px")));
            } else {
                bst_assert_close(number(p, "separation_pd90_px"), 1.0 + 0.1 * n, loose);
                bst_assert_close(number(p, "separation_pd90_sigma_px"), 0.02 * n, loose);
            }
            const cJSON *at = cJSON_GetArrayItem(cJSON_GetObjectItem(p, "separations"), 0);
            wilson(n, 40, w);
            bst_assert_close(number(at, "separation_px"), 0.5 * n, loose);
            bst_assert_close(number(at, "pairs"), 40, 0);
            bst_assert_close(number(at, "found"), n, 0);
            bst_assert_close(number(at, "pd"), n / 40, loose);
            bst_assert_close(number(at, "pd_low"), w[0], 1e-9);
            bst_assert_close(number(at, "pd_high"), w[1], 1e-9);
        }
    }
    cJSON_Delete(root);
    free(r);
}

static void plot(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pd_pair_result *r = result();
    bst_assert_ok(&ctx, bst_pd_pair_plot(&ctx, "p.png", r));
    for (int c = 0; c < 4; c++) {
        char begin[32];
        snprintf(begin, sizeof begin, "$c%d << BST_END\n", c);
        char *at = strstr(script, begin);
        assert_non_null(at);
        at += strlen(begin);
        for (int i = 0; i < 2; i++) {
            double n = 1.0 + 2 * c + i, w[2], value[8];
            for (int k = 0; k < 8; k++) {
                value[k] = strtod(at, &at);
            }
            wilson(1 + n, 100 + n, w);
            bst_assert_close(value[0], 20.0 + 30.0 * i, 0);
            if (c + i == 0) {
                assert_true(isnan(value[1]));
                bst_assert_close(value[2], 0.0, 0);
            } else {
                bst_assert_close(value[1], 1.0 + 0.1 * n, 1e-8);
                bst_assert_close(value[2], 1.959963985 * 0.02 * n, 1e-8);
            }
            bst_assert_close(value[3], 0.9 + 0.01 * n, 1e-8);
            bst_assert_close(value[4], 1.2 + 0.01 * n, 1e-8);
            bst_assert_close(value[5], (1 + n) / (100 + n), 1e-8);
            bst_assert_close(value[6], w[0], 1e-8);
            bst_assert_close(value[7], w[1], 1e-8);
        }
    }
    bst_assert_has(script, "set xrange [17:59]\n"); /* 0.85 x 20 to 1.18 x 50 */
    bst_assert_has(script, "set xtics (20, 50)\n");
    bst_assert_has(script, "set origin 0,0.32\n");
    bst_assert_has(script, "set origin 0.5,0.32\n");
    bst_assert_has(script, "set title \"points; FWHM 2.25 px\"");
    bst_assert_has(script, "set title \"streaks of 11 px, known motion; FWHM 2.25 px\"");
    /* of the points: from the bound of 0.91 to a separation of 1.4, with some room */
    bst_assert_has(script, "set yrange [0.728:2.1]\n");
    bst_assert_has(script, "set yrange [0.76:2.7]\n"); /* of streaks: 0.95 to 1.8 */
    bst_assert_has(script, "title '2:1, measured, 95 %', $c0 using 1:5");
    bst_assert_has(script, "title '5:1, measured, 95 %', $c3 using 1:5");
    double w[2];
    char line[64];
    wilson(5, 104, w); /* the highest of the points */
    snprintf(line, sizeof line, "set yrange [0:%.4f", 1.35 * w[1]);
    bst_assert_has(script, line);
    free(r);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(table), cmocka_unit_test(json),
                                       cmocka_unit_test(plot)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
