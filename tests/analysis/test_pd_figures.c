/* Figures of a measurement of detection from counts that are made here: closed forms of the ideal
 * detector, bounds, phases and intervals. */
#include <cjson/cJSON.h>

#include "boresight/vec.h"
#include "sim/analysis/pd/pd.h"
#include "sim/eval/detection_theory.h"
#include "tests/io/plot_script.h"
#include "tests/stdout_text.h"
#include "tests/test_support.h"

enum { POINTS = 9 };

typedef struct fixture {
    bst_scenario scenario;
    bst_scenario_module_config imgproc;
    bst_module_desc desc;
    bst_pd_scene scene;
    bst_pd_result result;
} fixture;

#define PIXELS 1e6
#define GAIN 0.8 /* of the SNR that counts: a loss of 1.94 dB */

/* A detector that is ideal but for a gain, with matches by chance. */
static fixture *make(double chance) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->desc = (bst_module_desc){.type = "builtin"};
    f->imgproc = (bst_scenario_module_config){.desc = &f->desc};
    snprintf(f->scenario.name, sizeof f->scenario.name, "test");
    f->scene = (bst_pd_scene){.scenario = &f->scenario,
                              .imgproc = &f->imgproc,
                              .points = POINTS,
                              .own_light = 0.05,
                              .noise_e = 9.0,
                              .sky_e = 50.0,
                              .dark_e = 6.0,
                              .exposure_s = 0.5,
                              .fwhm_px = 2.2,
                              .columns = 5,
                              .rows = 3};
    f->scene.camera.width_px = 1250;
    f->scene.camera.height_px = 800;
    f->result = (bst_pd_result){.false_alarms = 250,
                                .empty_frames = 100,
                                .stars = 30,
                                .frames = 40,
                                .unmatched = 60,
                                .second = 10,
                                .chance_trials = 10000,
                                .chance_hits = (int64_t)(10000 * chance),
                                .pixels = PIXELS,
                                .threshold_snr = 4.75,
                                .process_s = 0.0125,
                                .wall_s = 33};
    for (int i = 0; i < POINTS; i++) {
        bst_pd_tally *t = &f->result.tallies[i];
        f->scene.snr[i] = 3.0 + i;
        f->scene.v_mag[i] = 14.0 - 0.25 * i;
        f->scene.flux_e[i] = 100.0 * (i + 1);
        double pd = bst_eval_ideal_pd(2.5 / PIXELS, GAIN * f->scene.snr[i]);
        t->trials = 1000000;
        t->matched = (int64_t)llround(1e6 * (pd + (1 - pd) * chance));
    }
    return f;
}

static void losses(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        double chance = 0.05 * k;
        fixture *f = make(chance);
        bst_pd_figures g;
        bst_pd_figures_of(&f->scene, &f->result, &g);
        bst_assert_close(g.false_alarms_per_frame, 2.5, 1e-12);
        /* Poisson, 95 %: 250 is nearly normal: 250 + 1.92 -+ 1.96 sqrt(250 + 1) (Wilson and
         * Hilferty, 0.3 %) */
        bst_assert_close(g.false_alarms_low, 2.2, 0.012);
        bst_assert_close(g.false_alarms_high, 2.83, 0.012);
        bst_assert_close(g.pfa, 2.5e-6, 1e-18);
        bst_assert_close(g.chance, chance, 1e-12);
        /* counts are rounded to 1e-6 */
        bst_assert_close(g.loss_db_pd50, -20 * log10(GAIN), 1e-3);
        bst_assert_close(g.loss_db_pd90, -20 * log10(GAIN), 1e-3);
        bst_assert_close(g.gain_db_pd90, 20 * log10(GAIN), 1e-3);
        double t = bst_eval_ideal_snr(2.5e-6, 0.5), z = 1.2815515655446004;
        bst_assert_close(g.pd50.snr, t / GAIN, 1e-3);
        bst_assert_close(g.pd90.snr, (t + z) / GAIN, 1e-3);
        /* with its own light: the SNR of the noise without it; at half the median does not move,
         * and (s - t)^2 = z^2 (1 + c s) elsewhere */
        bst_assert_close(g.own_light_db_pd50, -20 * log10(GAIN), 1e-3);
        double h = 0.5 * 0.05 * z * z, s = t + h + sqrt(h * h + z * z * (1 + 0.05 * t));
        bst_assert_close(g.own_light_db_pd90, 20 * log10((t + z) / GAIN / s), 1e-3);
        assert_true(isnan(g.gain_over_single_db_pd50));
        /* errors of the place on the curve and of the false alarms: d t = d ln(pfa) / t */
        double alarms = 1 / sqrt(250) / t / (t + z), own = g.pd90.sigma / g.pd90.snr;
        bst_assert_close(g.loss_db_sigma_pd90, 8.685889638 * sqrt(alarms * alarms + own * own),
                         1e-6);
        bst_pd_figures stack = g;
        stack.gain_db_pd50 = 5.0;
        stack.gain_db_pd90 = 6.0;
        bst_pd_compare_single(&g, &stack);
        bst_assert_close(stack.gain_over_single_db_pd50, 5.0 + g.loss_db_pd50, 1e-12);
        bst_assert_close(stack.gain_over_single_db_pd90, 6.0 + g.loss_db_pd90, 1e-12);
        free(f);
    }
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!item) {
        fail_msg("no key %s", key);
    }
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

typedef struct expected {
    const char *key;
    double value;
} expected;

static void expect(const cJSON *node, const expected *list, size_t count) {
    for (size_t k = 0; k < count; k++) {
        double v = number(node, list[k].key);
        if (!(fabs(v - list[k].value) <= 1e-9 * fabs(list[k].value))) {
            fail_msg("%s = %.12g, expected %.12g", list[k].key, v, list[k].value);
        }
    }
}

static void errors_against_bounds(void **state) {
    (void)state;
    fixture *f = make(0.0);
    bst_pd_tally *t = &f->result.tallies[4];
    *t = (bst_pd_tally){.trials = 500,
                        .matched = 400,
                        .error_sum = {8.0, -20.0},
                        .error_square = {36.0, 64.0},
                        .bound_square = {0.4, 1.0},
                        .flux_sum = 12.0,
                        .flux_square = 4.0,
                        .flux_bound_square = 0.05,
                        .chi_square = 880.0,
                        .bounds = 10};
    /* means by phase: 0.3 of 20 in x, -0.5 of 9 in y; of a single one nothing is known */
    t->phase_sum[0][1] = 6.0;
    t->phase_count[0][1] = 20;
    t->phase_sum[1][2] = -4.5;
    t->phase_count[1][2] = 9;
    t->phase_sum[1][3] = 7.0;
    t->phase_count[1][3] = 1;
    bst_pd_figures g;
    bst_pd_figures_of(&f->scene, &f->result, &g);
    cJSON *root = bst_pd_json(&f->scene, &f->result, &g);
    const cJSON *p = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "points"), 4);
    const expected points[] = {{"snr", 7.0},
                               {"v_mag", 13.0},
                               {"flux_e", 500.0},
                               {"trials", 500},
                               {"detected", 400},
                               {"pd", 0.8},
                               {"centroid_rms_over_bound", sqrt(100.0 / 400 / (1.4 / 10))},
                               {"centroid_rms_over_bound_x", sqrt(36.0 / 400 / 0.04)},
                               {"centroid_rms_over_bound_y", sqrt(64.0 / 400 / 0.1)},
                               {"centroid_rms_x_px", 0.3},
                               {"centroid_rms_y_px", 0.4},
                               {"centroid_bias_x_px", 0.02},
                               {"centroid_bias_y_px", -0.05},
                               {"centroid_chi_square", 2.2},
                               {"flux_rms_over_bound", sqrt(4.0 / 400 / 0.005)},
                               {"flux_bias", 0.03},
                               {"phase_bias_px", 0.5},
                               {"phase_bias_sigma_px", 0.4 / 3}};
    expect(p, points, sizeof points / sizeof *points);
    /* Wilson at 400 of 500: (p + z^2 / 2n -+ z sqrt(p q / n + z^2 / 4 n^2)) / (1 + z^2 / n) */
    double z2 = 1.959963984540054 * 1.959963984540054 / 500, middle = (0.8 + z2 / 2) / (1 + z2),
           half = 1.959963984540054 * sqrt(0.16 / 500 + z2 / 2000) / (1 + z2);
    bst_assert_close(number(p, "pd_low"), middle - half, 1e-9);
    bst_assert_close(number(p, "pd_high"), middle + half, 1e-9);
    bst_assert_close(number(p, "ideal_pd"), bst_eval_ideal_pd(2.5e-6, 7), 1e-12);
    bst_assert_close(number(p, "matched_filter_pd"), bst_eval_matched_filter_pd(2.5e-6, 7, 0.05),
                     1e-12);
    const expected whole[] = {{"width_px", 1250},
                              {"height_px", 800},
                              {"fwhm_px", 2.2},
                              {"noise_e", 9},
                              {"background_e", 56},
                              {"exposure_s", 0.5},
                              {"targets_per_frame", 15},
                              {"frames", 40},
                              {"empty_frames", 100},
                              {"threshold_snr", 4.75},
                              {"false_alarms_per_frame", 2.5},
                              {"star_detections_per_frame", 0.3},
                              {"unmatched_per_frame_with_targets", 1.5},
                              {"further_per_frame_with_targets", 0.25},
                              {"process_ms", 12.5},
                              {"wall_s", 33},
                              {"snr_pd50", g.pd50.snr},
                              {"loss_db_pd90_sigma", g.loss_db_sigma_pd90},
                              {"loss_over_matched_filter_db_pd50", g.own_light_db_pd50},
                              {"snr_pd90", g.pd90.snr},
                              {"loss_db_pd50", g.loss_db_pd50},
                              {"loss_db_pd90", g.loss_db_pd90},
                              {"loss_db_pd50_sigma", g.loss_db_sigma_pd50},
                              {"loss_over_matched_filter_db_pd90", g.own_light_db_pd90},
                              {"chance", g.chance},
                              {"false_alarms_low", g.false_alarms_low},
                              {"false_alarms_high", g.false_alarms_high}};
    expect(root, whole, sizeof whole / sizeof *whole);
    assert_true(isnan(number(root, "false_alarms_requested")));
    assert_null(cJSON_GetObjectItem(root, "stack_frames"));
    cJSON_Delete(root);
    /* a streak: its axes, no phases; a stack's gain */
    double sharpness[1] = {0};
    f->scene.sharpness = sharpness;
    f->scene.options.stack = 4;
    f->scene.options.false_alarms = 3.0;
    f->scene.options.rates_px = 2.75;
    g.gain_db_pd50 = 3.5;
    g.gain_db_pd90 = 3.25;
    g.gain_over_single_db_pd50 = 4.5;
    g.gain_over_single_db_pd90 = 4.25;
    root = bst_pd_json(&f->scene, &f->result, &g);
    p = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "points"), 4);
    bst_assert_close(number(p, "centroid_rms_along_px"), 0.3, 1e-12);
    bst_assert_close(number(p, "centroid_bias_across_px"), -0.05, 1e-12);
    assert_null(cJSON_GetObjectItem(p, "phase_bias_px"));
    bst_assert_close(number(root, "gain_ideal_db"), 6.020599913, 1e-8);
    const expected stacked[] = {{"false_alarms_requested", 3},
                                {"stack_frames", 4},
                                {"stack_rate_px_per_frame", 2.75},
                                {"gain_db_pd50", 3.5},
                                {"gain_db_pd90", 3.25},
                                {"gain_over_single_db_pd50", 4.5},
                                {"gain_over_single_db_pd90", 4.25}};
    expect(root, stacked, sizeof stacked / sizeof *stacked);
    cJSON_Delete(root);
    free(f);
}

/* What is printed of a measurement: the row of the point above, losses and their intervals. */
static void words_of_a_measurement(void **state) {
    (void)state;
    static char text[8000];
    bst_stdout_text out;
    char line[400];
    fixture *f = make(0.0);
    f->result.tallies[4] = (bst_pd_tally){.trials = 500,
                                          .matched = 400,
                                          .error_sum = {8.0, -20.0},
                                          .error_square = {36.0, 64.0},
                                          .bound_square = {0.4, 1.0},
                                          .flux_sum = 12.0,
                                          .flux_square = 4.0,
                                          .flux_bound_square = 0.05,
                                          .chi_square = 880.0,
                                          .bounds = 10};
    f->result.tallies[4].phase_sum[1][2] = -4.5;
    f->result.tallies[4].phase_count[1][2] = 9;
    f->scene.options.false_alarms = 2.25;
    bst_pd_figures g;
    bst_pd_figures_of(&f->scene, &f->result, &g);
    bst_stdout_take(&out);
    bst_pd_print(&f->scene, &f->result, &g);
    bst_stdout_give(&out, text, sizeof text);
    bst_assert_has(text, "1250 x 800 px, FWHM 2.2 px, noise 9 e- per pixel, 0.5 s; points\n");
    bst_assert_has(text,
                   "40 frames with up to 15 targets, 100 without; processing 12.5 ms a frame, "
                   "33.0 s in all");
    /* Wilson at 400 of 500: 0.7627 to 0.8327 (the closed form above) */
    snprintf(
        line, sizeof line,
        "  7.000   13.00      500  0.8000  0.7627 to 0.8327 %6.4f %7.4f    1.500   1.265   1.414"
        "   2.20   +0.0300   0.5000\n",
        bst_eval_ideal_pd(2.5e-6, 7), bst_eval_matched_filter_pd(2.5e-6, 7, 0.05));
    bst_assert_has(text, line);
    bst_assert_has(text, "false alarms per frame 2.5 (95 %: 2.2 to 2.83), 2.25 requested\n");
    const struct {
        const char *pd;
        double share, snr, loss, sigma, own;
    } losses[] = {
        {"0.5", 0.5, g.pd50.snr, g.loss_db_pd50, g.loss_db_sigma_pd50, g.own_light_db_pd50},
        {"0.9", 0.9, g.pd90.snr, g.loss_db_pd90, g.loss_db_sigma_pd90, g.own_light_db_pd90}};
    for (int k = 0; k < 2; k++) {
        snprintf(
            line, sizeof line,
            "  Pd %s at SNR %.3f, ideal %.3f: loss %.2f dB (95 %%: %.2f to %.2f), %.2f dB over",
            losses[k].pd, losses[k].snr, bst_eval_ideal_snr(2.5e-6, losses[k].share),
            losses[k].loss, losses[k].loss - 1.959963985 * losses[k].sigma,
            losses[k].loss + 1.959963985 * losses[k].sigma, losses[k].own);
        bst_assert_has(text, line);
        assert_true(losses[k].sigma > 0.01);
    }
    free(f);
}

/* The same point in the plot, the ideal curve, and the title. */
static void plot_of_a_measurement(void **state) {
    (void)state;
    static char text[60000];
    char path[700], line[200];
    bst_ctx ctx = {0};
    fixture *f = make(0.0);
    f->result.tallies[4] = (bst_pd_tally){.trials = 500,
                                          .matched = 400,
                                          .error_square = {36.0, 64.0},
                                          .bound_square = {0.4, 1.0},
                                          .flux_square = 4.0,
                                          .flux_bound_square = 0.05,
                                          .chi_square = 880.0,
                                          .bounds = 10};
    bst_pd_figures g;
    bst_pd_figures_of(&f->scene, &f->result, &g);
    plot_script p;
    plot_script_begin(&p);
    snprintf(path, sizeof path, "%s/pd.png", p.folder.folder);
    bst_assert_ok(&ctx, bst_pd_plot(&ctx, path, &f->scene, &f->result, &g));
    plot_script_end(&p, text, sizeof text);
    const char *at = text;
    double row[7], ideal[3], range[2];
    plot_script_numbers(&at, "\n7 ", 6, row);
    /* 100 of 400 px^2 per axis against 0.04 and 0.1; as in the words above */
    const double of_point[6] = {0.8, 0.7627, 0.8327, 1.5, 1.265, 1.414};
    for (int k = 0; k < 6; k++) {
        bst_assert_close(row[k], of_point[k], 5e-4);
    }
    plot_script_numbers(&at, "$ideal << BST_END\n", 3, ideal);
    for (int i = 1; i <= 100; i++) {
        plot_script_numbers(&at, "\n", 3, ideal);
    }
    bst_assert_close(ideal[0], 7.0, 1e-9);
    bst_assert_close(ideal[1], bst_eval_ideal_pd(2.5e-6, 7), 1e-8);
    bst_assert_close(ideal[2], bst_eval_matched_filter_pd(2.5e-6, 7, 0.05), 1e-8);
    plot_script_numbers(&at, "set xrange [", 2, range);
    bst_assert_close(range[0], 3.0 - 0.16, 1e-9);
    bst_assert_close(range[1], 11.0 + 0.16, 1e-9);
    snprintf(line, sizeof line,
             "points, 2.5 false alarms per 1250 x 800 px; loss %.2f dB at 0.5, %.2f dB at 0.9\"",
             g.loss_db_pd50, g.loss_db_pd90);
    bst_assert_has(at, line);
    free(f);
}

/* Stars in cells as bst_pd_sky_stars sorts them, and whether a detection is one of them, against a
 * look at each. */
static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

static void detections_of_stars(void **state) {
    (void)state;
    enum { STARS = 60, COLUMNS = 9, ROWS = 7, CELL = 32 };
    static int first[COLUMNS * ROWS + 1];
    static bst_eval_match_target unsorted[STARS], places[STARS];
    uint64_t seed = 3;
    int cell_of[STARS], n = 0, stars = 0, others = 0;
    for (int i = 0; i < STARS; i++) {
        unsorted[i] = (bst_eval_match_target){224 * draw(&seed), 160 * draw(&seed), 12.0, -5.0};
        cell_of[i] =
            ((int)(unsorted[i].y_px / CELL) + 1) * COLUMNS + (int)(unsorted[i].x_px / CELL) + 1;
    }
    for (int cell = 0; cell < COLUMNS * ROWS; cell++) {
        first[cell] = n;
        for (int i = 0; i < STARS; i++) {
            if (cell_of[i] == cell) {
                places[n++] = unsorted[i];
            }
        }
    }
    first[COLUMNS * ROWS] = n;
    const bst_pd_stars list = {.count = STARS,
                               .places = places,
                               .cell_px = CELL,
                               .columns = COLUMNS,
                               .rows = ROWS,
                               .first = first};
    for (int i = 0; i < 4000; i++) {
        bst_detection d = {.x_px = 224 * draw(&seed), .y_px = 160 * draw(&seed)};
        d.flags = i % 4 == 1 ? BST_DETECTION_STREAK : i % 4 == 2 ? BST_DETECTION_EDGE : 0;
        d.length_px = 160 * draw(&seed);
        d.angle_rad = 3 * draw(&seed);
        double reach = 2.5 * (d.flags & BST_DETECTION_EDGE ? 2 : 1);
        bool expected_star = false;
        for (int k = 0; k < STARS; k++) {
            double x = d.x_px - unsorted[k].x_px, y = d.y_px - unsorted[k].y_px;
            /* along the star's streak of 13 px, or along the detection's own */
            double along = (12 * x - 5 * y) / 13, across = (12 * y + 5 * x) / 13;
            expected_star = expected_star || (fabs(along) <= 6.5 && fabs(across) <= reach);
            if (d.flags & BST_DETECTION_STREAK) {
                double c = cos(d.angle_rad), s = sin(d.angle_rad);
                along = c * x + s * y;
                across = c * y - s * x;
                expected_star = expected_star ||
                                (0.5 * d.length_px > reach
                                     ? fabs(along) <= 0.5 * d.length_px && fabs(across) <= reach
                                     : hypot(x, y) <= reach);
            }
        }
        assert_int_equal(bst_pd_is_star(&list, 2.5, &d), expected_star);
        stars += expected_star;
        others += !expected_star;
    }
    assert_true(stars > 300 && others > 300);
    assert_false(bst_pd_is_star(&(bst_pd_stars){.count = 0}, 2.5, &(bst_detection){0}));
}

/* ---- the sky of a scene: the world's part in it is made here ---- */

enum { SKY_STARS = 400, SKY_WIDE = 300, SKY_HIGH = 130 };
static bst_truth_item sky_items[SKY_STARS];
static bst_scene_source sky_sources[SKY_STARS];
static const bst_quat sky_attitude = {.w = 0.6, .y = 0.8};

bst_status __wrap_bst_field_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                   bst_field **out);
bst_status __wrap_bst_field_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                   bst_field **out) {
    (void)ctx;
    (void)world;
    assert_int_equal(observer, 1);
    assert_int_equal(sensor, 2);
    *out = (bst_field *)sky_items;
    return BST_OK;
}
void __wrap_bst_field_free(bst_field *field);
void __wrap_bst_field_free(bst_field *field) {
    (void)field;
}
void __wrap_bst_field_set_camera(bst_field *field, const bst_camera *camera);
void __wrap_bst_field_set_camera(bst_field *field, const bst_camera *camera) {
    (void)field;
    assert_int_equal(camera->width_px, SKY_WIDE);
}
bst_quat __wrap_bst_world_body_attitude(const bst_world *world, int observer, int sensor);
bst_quat __wrap_bst_world_body_attitude(const bst_world *world, int observer, int sensor) {
    (void)world;
    assert_int_equal(10 * observer + sensor, 12);
    return sky_attitude;
}
bst_status __wrap_bst_field_query(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                                  int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                                  bst_window window, const bst_field_options *options,
                                  bst_truth *truth, const bst_scene_source **sources, int *count);
bst_status __wrap_bst_field_query(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                                  int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                                  bst_window window, const bst_field_options *options,
                                  bst_truth *truth, const bst_scene_source **sources, int *count) {
    (void)ctx;
    (void)field;
    (void)track;
    (void)truth;
    assert_int_equal(start_tick, 0);
    assert_int_equal(end_tick, 340); /* 1.7 s */
    assert_int_equal(tick_rate_hz, 200);
    assert_int_equal(window.x0, 0);
    assert_int_equal(window.y0, 0);
    assert_int_equal(window.width, SKY_WIDE);
    assert_int_equal(window.height, SKY_HIGH);
    bst_assert_close(options->v_limit, 16.0, 0.0);
    assert_true(options->margin_px >= 32.0);
    *sources = sky_sources;
    *count = SKY_STARS;
    return BST_OK;
}
void __wrap_bst_field_truth_item(const bst_field *field, const bst_los_track *track,
                                 const bst_scene_source *source, bst_window window, int binning,
                                 const bst_truth *header, bst_truth_item *out);
void __wrap_bst_field_truth_item(const bst_field *field, const bst_los_track *track,
                                 const bst_scene_source *source, bst_window window, int binning,
                                 const bst_truth *header, bst_truth_item *out) {
    (void)field;
    (void)track;
    (void)header;
    assert_int_equal(binning, 1);
    assert_int_equal(window.width, SKY_WIDE);
    assert_int_equal(window.height, SKY_HIGH);
    *out = sky_items[source - sky_sources];
}

/* Stars of a look, on the frame and up to 90 px beyond: those of SNR 1 and more are found again at
 * their places, with those beyond the frame in the cells at its edges. */
static void stars_of_a_look(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_scenario scenario = {.tick_rate_hz = 200};
    bst_pd_scene scene = {.scenario = &scenario,
                          .observer = 1,
                          .sensor = 2,
                          .exposure_s = 1.7,
                          .camera = {.width_px = SKY_WIDE, .height_px = SKY_HIGH}};
    const bst_los_track track = {0};
    const bst_scene_source *sources;
    bst_pd_sky *sky;
    bst_pd_stars stars = {.count = 0};
    uint64_t seed = 7;
    int count, expected_count = 0;
    bst_assert_ok(&ctx, bst_pd_sky_open(&ctx, &scene, &sky));
    bst_quat q = bst_pd_sky_attitude(sky, 0.3), about = {.w = cos(0.15), .z = sin(0.15)},
             asked = bst_quat_mul(about, sky_attitude);
    bst_assert_close(q.w, asked.w, 1e-12);
    bst_assert_close(q.x, asked.x, 1e-12);
    bst_assert_close(q.y, asked.y, 1e-12);
    bst_assert_close(q.z, asked.z, 1e-12);
    for (int round = 0; round < 2; round++) { /* the list is filled anew */
        expected_count = 0;
        for (int i = 0; i < SKY_STARS; i++) {
            bst_truth_item *t = &sky_items[i];
            *t = (bst_truth_item){.x_centroid_px = 480 * draw(&seed) - 90,
                                  .y_centroid_px = 310 * draw(&seed) - 90,
                                  .x_start_px = 10 + i,
                                  .x_end_px = 17 + i,
                                  .y_start_px = 20,
                                  .y_end_px = 11,
                                  .snr = i % 5 == 0 ? 0.999 : 1.0 + draw(&seed)};
            t->x_centroid_px = i % 50 == 3 ? NAN : t->x_centroid_px;
            expected_count += i % 5 != 0 && i % 50 != 3;
        }
        bst_assert_ok(&ctx, bst_pd_sky_look(&ctx, sky, &track, &sources, &count));
        bst_assert_ok(&ctx, bst_pd_sky_stars(&ctx, sky, &track, sources, count, &stars));
        assert_int_equal(stars.count, expected_count);
        assert_int_equal(stars.first[stars.columns * stars.rows], expected_count);
        for (int i = 0; i < SKY_STARS; i++) {
            const bst_truth_item *t = &sky_items[i];
            bool there = false;
            for (int k = 0; k < stars.count; k++) {
                const bst_eval_match_target *p = &stars.places[k];
                there = there || (p->x_px == t->x_centroid_px && p->y_px == t->y_centroid_px &&
                                  p->dx_px == 7.0 && p->dy_px == -9.0);
            }
            assert_int_equal(there, t->snr >= 1.0 && !isnan(t->x_centroid_px));
        }
        for (int cell = 0; cell < stars.columns * stars.rows; cell++) {
            for (int k = stars.first[cell]; k < stars.first[cell + 1]; k++) {
                const bst_eval_match_target *p = &stars.places[k];
                int column = cell % stars.columns - 1, row = cell / stars.columns - 1;
                /* cells of 32 px: 9.4 of them across, 4.1 down, one more on each side for the rest
                 */
                assert_int_equal(column, (int)fmin(fmax(floor(p->x_px / 32), -1), 10));
                assert_int_equal(row, (int)fmin(fmax(floor(p->y_px / 32), -1), 5));
            }
        }
    }
    bst_pd_stars_free(&stars);
    bst_pd_sky_close(sky);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(losses),
        cmocka_unit_test(errors_against_bounds),
        cmocka_unit_test(words_of_a_measurement),
        cmocka_unit_test(plot_of_a_measurement),
        cmocka_unit_test(detections_of_stars),
        cmocka_unit_test(stars_of_a_look),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
