/* What runs of a study put into their tables and labels: figures of a detection curve, figures of
 * a loop, labels of a binned window. Linked with wraps of what measures and runs. */
#include <cjson/cJSON.h>

#include "boresight/vec.h"
#include "sim/analysis/pd/pd.h"
#include "sim/eval/detection_theory.h"
#include "sim/run/run_scenario.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_labels.h"
#include "tests/test_support.h"

/* ------------------------------------------------------------------ a run of a study */

static void run_of(const char *file, int64_t number, bst_study_result *out,
                   const bst_study_kind **kind) {
    bst_ctx ctx = {0};
    bst_study study;
    bst_assert_ok(&ctx, bst_study_open(&ctx, file, NULL, &study));
    bst_study_value *values = test_calloc(BST_STUDY_AXES, sizeof *values);
    cJSON *settings = NULL;
    bst_study_run run = {.study = &study, .place = bst_study_place_of(&study, number)};
    bst_study_values(&study, &run.place, values);
    bst_assert_ok(&ctx,
                  bst_study_document(&ctx, &study, &run.place, values, &run.scenario, &settings));
    run.settings = settings;
    *kind = bst_study_kind_of(study.config.kind);
    const bst_study_worker_place place = {.threads = 3, .device = ""};
    void *worker;
    bst_assert_ok(&ctx, (*kind)->open(&ctx, NULL, &place, &worker));
    bst_assert_ok(&ctx, (*kind)->run(&ctx, worker, &run, out));
    (*kind)->close(worker);
    bst_json_free(run.scenario);
    cJSON_Delete(settings);
    test_free(values);
    bst_study_close(&study);
}

typedef struct expected {
    const char *name;
    double value; /* NAN: none */
} expected;

static void expect(const bst_study_metric *metrics, int count, const double *row,
                   const expected *list, int size) {
    assert_int_equal(count, size);
    for (int k = 0; k < size; k++) {
        int i = 0;
        while (i < count && strcmp(metrics[i].name, list[k].name) != 0) {
            i++;
        }
        assert_true(i < count);
        if (!(isnan(list[k].value) ? isnan(row[i])
                                   : fabs(row[i] - list[k].value) <= 1e-12 * fabs(row[i]))) {
            fail_msg("%s = %.17g, expected %.17g", list[k].name, row[i], list[k].value);
        }
    }
}

bst_status __wrap_bst_stars_open(bst_ctx *ctx, const char *path, bst_stars **out);
bst_status __wrap_bst_stars_open(bst_ctx *ctx, const char *path, bst_stars **out) {
    (void)path;
    *out = NULL;
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "no stars");
}

bst_status __wrap_bst_study_warm_device(bst_ctx *ctx, bst_study_warm *warm);
bst_status __wrap_bst_study_warm_device(bst_ctx *ctx, bst_study_warm *warm) {
    (void)ctx;
    (void)warm;
    return BST_OK;
}

/* ------------------------------------------------------------------ a detection curve */

enum { POINTS = 9, STREAK = 15 };

static bst_pd_figures measured;

bst_status __wrap_bst_pd_scene_open(bst_ctx *ctx, const bst_scenario *scenario,
                                    const bst_pd_options *o, bst_pd_scene *out);
bst_status __wrap_bst_pd_scene_open(bst_ctx *ctx, const bst_scenario *scenario,
                                    const bst_pd_options *o, bst_pd_scene *out) {
    (void)ctx;
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[0].sensors.items;
    /* run 3 of the study: its second background, its second streak, its second read noise */
    bst_assert_close(sensors[0].camera.read_noise_e, 12.0, 0);
    bst_assert_close(o->low, 3.0, 0);
    bst_assert_close(o->high, 9.0, 0);
    bst_assert_close(o->step, 1.0, 0);
    bst_assert_close(o->streak_px, STREAK, 0);
    bst_assert_close(o->star_streak_px, 0.0, 0);
    bst_assert_close(o->false_alarms, 4.0, 0);
    bst_assert_close(o->background_e, -1.0, 0);
    bst_assert_close(o->jitter_px, -1.0, 0);
    bst_assert_close(o->min_separation_px, 24.0, 0);
    assert_int_equal(o->trials, 1000);
    assert_int_equal(o->threads, 3);
    assert_true(!o->known_rate && !o->stars && o->quiet && !o->sensor);
    *out = (bst_pd_scene){.options = *o,
                          .points = POINTS,
                          .fwhm_px = 2.25,
                          .noise_e = 9.5,
                          .sky_e = 51.0,
                          .dark_e = 6.5};
    for (int i = 0; i < POINTS; i++) {
        out->snr[i] = 2.5 + i;
        out->v_mag[i] = 15.0 - 2.5 * log10(out->snr[i] / 2.5);
    }
    return BST_OK;
}

void __wrap_bst_pd_scene_close(bst_pd_scene *scene);
void __wrap_bst_pd_scene_close(bst_pd_scene *scene) {
    (void)scene;
}

bst_status __wrap_bst_pd_detector_open(bst_ctx *ctx, bst_pd_scene *scene, bst_pd_detector **out);
bst_status __wrap_bst_pd_detector_open(bst_ctx *ctx, bst_pd_scene *scene, bst_pd_detector **out) {
    (void)ctx;
    (void)scene;
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_pd_run(bst_ctx *ctx, bst_pd_scene *scene, bst_pd_detector *detector,
                             bst_pd_result *out);
bst_status __wrap_bst_pd_run(bst_ctx *ctx, bst_pd_scene *scene, bst_pd_detector *detector,
                             bst_pd_result *out) {
    static const int64_t matched[POINTS] = {60, 90, 180, 420, 690, 880, 960, 990, 1000};
    (void)ctx;
    (void)detector;
    *out = (bst_pd_result){.false_alarms = 320,
                           .empty_frames = 80,
                           .chance_trials = 5000,
                           .chance_hits = 250, /* 5 % */
                           .pixels = 1e6,
                           .lost = 7,
                           .threshold_snr = 4.625};
    for (int i = 0; i < POINTS; i++) {
        out->tallies[i] =
            (bst_pd_tally){.trials = 1000,
                           .matched = matched[i],
                           .error_square = {0.5 * (double)matched[i], 0.22 * (double)matched[i]}};
    }
    out->tallies[0].matched = 0;
    bst_pd_figures_of(scene, out, &measured);
    return BST_OK;
}

static void a_detection_curve(void **state) {
    (void)state;
    const bst_study_kind *kind;
    bst_study_result r = {.series = NULL};
    run_of("scenarios/studies/pd_trade.json", 3, &r, &kind);
    const bst_pd_figures *f = &measured;
    assert_true(isfinite(f->pd90.snr) && f->pd90.snr > f->pd50.snr + 0.5);
    const expected whole[] = {{"snr_pd50", f->pd50.snr},
                              {"snr_pd90", f->pd90.snr},
                              /* SNR is proportional to light: 5 magnitudes are a factor 100 */
                              {"v_mag_pd50", 15.0 - 5.0 * log(f->pd50.snr / 2.5) / log(100.0)},
                              {"v_mag_pd90", 15.0 - 5.0 * log(f->pd90.snr / 2.5) / log(100.0)},
                              {"loss_db_pd50", f->loss_db_pd50},
                              {"loss_db_pd90", f->loss_db_pd90},
                              {"loss_db_sigma_pd50", f->loss_db_sigma_pd50},
                              {"loss_db_sigma_pd90", f->loss_db_sigma_pd90},
                              {"false_alarms_per_frame", 4.0},
                              {"false_alarms_low", f->false_alarms_low},
                              {"false_alarms_high", f->false_alarms_high},
                              {"chance", 0.05},
                              {"threshold_snr", 4.625},
                              {"fwhm_px", 2.25},
                              {"noise_e", 9.5},
                              {"sky_e", 51.0},
                              {"dark_e", 6.5},
                              {"empty_frames", 80},
                              {"lost", 7}};
    expect(kind->metrics, kind->metric_count, r.metrics, whole, sizeof whole / sizeof *whole);
    assert_int_equal(r.rows, POINTS);
    /* of 690 in 1000: (0.69 - 0.05) / 0.95; Wilson's ends alike */
    double p = 0.69, z2 = 1.959963984540054 * 1.959963984540054 / 1000,
           half = 1.959963984540054 * sqrt(p * (1 - p) / 1000 + z2 / 4000);
    const expected row[] = {{"snr", 6.5},
                            {"v_mag", 15.0 - 2.5 * log10(6.5 / 2.5)},
                            {"trials", 1000},
                            {"detected", 690},
                            {"pd", 0.64 / 0.95},
                            {"pd_low", ((p + z2 / 2 - half) / (1 + z2) - 0.05) / 0.95},
                            {"pd_high", ((p + z2 / 2 + half) / (1 + z2) - 0.05) / 0.95},
                            {"ideal_pd", bst_eval_ideal_pd(4e-6, 6.5)},
                            {"error_rms_px", 0.6}};
    expect(kind->series, kind->series_count, r.series + 4 * kind->series_count, row,
           sizeof row / sizeof *row);
    int last = kind->series_count - 1;
    assert_true(isnan(r.series[last])); /* no match, no error */
    free(r.series);
}

/* ------------------------------------------------------------------ a loop */

bst_status __wrap_bst_simulation_create(bst_ctx *ctx, const bst_scenario *scenario,
                                        const bst_simulation_options *options,
                                        bst_simulation **out);
bst_status __wrap_bst_simulation_create(bst_ctx *ctx, const bst_scenario *scenario,
                                        const bst_simulation_options *options,
                                        bst_simulation **out) {
    (void)ctx;
    (void)scenario;
    assert_int_equal(options->threads, 3);
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                                   const bst_run_request *request, bst_run_report *report);
bst_status __wrap_bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                                   const bst_run_request *request, bst_run_report *report) {
    (void)ctx;
    (void)scenario;
    (void)sim;
    assert_true(request->metrics && request->overwrite && !request->out);
    *report = (bst_run_report){.count = 2, .wall_s = 6.0, .part = 0.25, .has_sightings = true};
    report->sensors = calloc(2, sizeof *report->sensors);
    assert_non_null(report->sensors);
    for (int i = 0; i < 2; i++) {
        double k = i;
        report->sensors[i].loop = (bst_loop_figures){.frames = 101 + i,
                                                     .visible_frames = 80 + i,
                                                     .time_to_confirm_s = 12.5 + k,
                                                     .time_to_acquire_s = i ? NAN : 14.25,
                                                     .time_to_settle_s = 17.75 + k,
                                                     .custody = 0.625 + 0.1 * k,
                                                     .track_fraction = 0.875 - 0.1 * k,
                                                     .in_track_at_end = i == 1,
                                                     .breaks = 3 + i,
                                                     .wrong_target_frames = 5 + i,
                                                     .pointing_rms_px = 0.31 + k,
                                                     .pointing_median_px = 0.28 + k,
                                                     .pointing_p95_px = 0.7 + k,
                                                     .pointing_p99_px = 0.9 + k,
                                                     .pointing_max_px = 1.1 + k,
                                                     .pointing_bias_px = 0.07 + k};
        report->sensors[i].metrics = (bst_run_metric_figures){.detections = 2345 + i,
                                                              .detected_fraction = 0.95 - 0.1 * k,
                                                              .track_rms_px = 0.11 + k,
                                                              .track_median_px = 0.09 + k,
                                                              .track_p95_px = 0.21 + k,
                                                              .track_max_px = 0.33 + k,
                                                              .tracks = 9 + i,
                                                              .false_tracks = 2 + i,
                                                              .gospa_px = 0.41 + k,
                                                              .ospa2_px = 0.42 + k,
                                                              .purity = 0.99 - 0.1 * k,
                                                              .id_switches = 4 + i,
                                                              .ghosts = 1 + i,
                                                              .objects_seen = 7 + i,
                                                              .objects_tracked = 6 + i};
    }
    report->sightings = (bst_sightings_figures){.objects = 20,
                                                .in_field = 19,
                                                .seen = 18,
                                                .passes = 50,
                                                .passes_seen = 44,
                                                .revisit_mean_s = 640.0,
                                                .revisit_most_s = 900.0,
                                                .custody_fraction = 0.45,
                                                .custody_fraction_all = 0.41,
                                                .gap_mean_s = 1234.5,
                                                .place_rms_arcsec = 0.8,
                                                .track_rms_arcsec = 0.6,
                                                .tasks = 33,
                                                .tasks_done = 29};
    report->has_custody = true;
    report->custody = (bst_custody_figures){.objects = 70,
                                            .updated = 61,
                                            .in_custody = 52,
                                            .tracks = 99,
                                            .correlated = 88,
                                            .ambiguous = 8,
                                            .uncorrelated = 3,
                                            .cross_tags = 1,
                                            .age_mean_s = 321.5,
                                            .sigma_median_m = 951.5,
                                            .sigma_p90_m = 1500.0,
                                            .sigma_updated_median_m = 432.5,
                                            .nees_mean = 6.25};
    return BST_OK;
}

/* Figures of a sensor as the wrap makes them; the second sensor's are others by k. */
static int of_sensor(int i, expected *list) {
    double k = i;
    const expected all[] = {{"frames", 101 + k},
                            {"visible_frames", 80 + k},
                            {"acquired", 1 - k},
                            {"time_to_confirm_s", 12.5 + k},
                            {"time_to_acquire_s", i ? NAN : 14.25},
                            {"time_to_settle_s", 17.75 + k},
                            {"custody", 0.625 + 0.1 * k},
                            {"track_fraction", 0.875 - 0.1 * k},
                            {"in_track_at_end", k},
                            {"breaks", 3 + k},
                            {"wrong_target_frames", 5 + k},
                            {"detections", 2345 + k},
                            {"detected_fraction", 0.95 - 0.1 * k},
                            {"pointing_rms_px", 0.31 + k},
                            {"pointing_median_px", 0.28 + k},
                            {"pointing_p99_px", 0.9 + k},
                            {"pointing_bias_px", 0.07 + k},
                            {"track_rms_px", 0.11 + k},
                            {"track_median_px", 0.09 + k},
                            {"track_p95_px", 0.21 + k},
                            {"tracks", 9 + k},
                            {"false_tracks", 2 + k},
                            {"gospa_px", 0.41 + k},
                            {"ospa2_px", 0.42 + k},
                            {"track_purity", 0.99 - 0.1 * k},
                            {"id_switches", 4 + k},
                            {"ghosts", 1 + k},
                            {"objects_seen", 7 + k},
                            {"objects_tracked", 6 + k}};
    memcpy(list, all, sizeof all);
    return sizeof all / sizeof *all;
}

static void a_loop(void **state) {
    (void)state;
    const bst_study_kind *kind;
    bst_study_result r = {.series = NULL};
    run_of("scenarios/studies/noise.json", 0, &r, &kind);
    const expected together[] = {{"tasks", 33},
                                 {"tasks_done", 29},
                                 {"passes_seen", 44},
                                 {"objects_detected", 18},
                                 {"revisit_mean_s", 640},
                                 {"longest_gap_mean_s", 1234.5},
                                 {"object_custody", 0.41},
                                 {"object_custody_seen", 0.45},
                                 {"place_rms_arcsec", 0.8},
                                 {"tracks_rms_arcsec", 0.6},
                                 {"catalogue_updated", 61},
                                 {"catalogue_in_custody", 52},
                                 {"catalogue_tracks", 88},
                                 {"catalogue_ambiguous", 8},
                                 {"catalogue_cross_tags", 1},
                                 {"catalogue_age_mean_s", 321.5},
                                 {"catalogue_sigma_median_m", 951.5},
                                 {"catalogue_sigma_updated_median_m", 432.5},
                                 {"catalogue_nees", 6.25}};
    expected list[48];
    int n = of_sensor(0, list);
    memcpy(list + n, together, sizeof together);
    expect(kind->metrics, kind->metric_count, r.metrics, list,
           n + (int)(sizeof together / sizeof *together));
    bst_assert_close(r.left_s, 18.0, 1e-9); /* a quarter took 6 s */
    assert_int_equal(r.rows, 2);
    for (int i = 0; i < 2; i++) {
        n = of_sensor(i, list);
        list[n++] = (expected){"sensor", i};
        expect(kind->series, kind->series_count, r.series + i * kind->series_count, list, n);
    }
    free(r.series);
}

/* ------------------------------------------------------------------ labels */

static const bst_world_object_info object = {.name = "SAT \"7\"", .norad = 44801};

const bst_world_object_info *__wrap_bst_world_object(const bst_world *world, int number);
const bst_world_object_info *__wrap_bst_world_object(const bst_world *world, int number) {
    (void)world;
    assert_int_equal(number, 5);
    return &object;
}

static const cJSON *label(const cJSON *root, int i) {
    return cJSON_GetArrayItem(cJSON_GetObjectItem(root, "objects"), i);
}

static void expect_label(const cJSON *node, const expected *list, int size) {
    assert_non_null(node);
    for (int k = 0; k < size; k++) {
        const cJSON *item = cJSON_GetObjectItem(node, list[k].name);
        if (!item || !(fabs(item->valuedouble - list[k].value) <= 1e-10)) {
            fail_msg("%s = %.12g, expected %.12g", list[k].name, item ? item->valuedouble : NAN,
                     list[k].value);
        }
    }
}

/* A frame of 200 x 150 pixels of 2 x 2, from the corner (40, 22) of the sensor. */
static void labels_of_a_binned_window(void **state) {
    (void)state;
    char text[8192] = "";
    bst_frame frame = {.width = 200, .height = 150};
    const bst_frame_message m = {
        .frame = &frame, .exposure_id = 8, .window = {40, 22, 400, 300}, .binning = 2};
    bst_truth *truth = test_calloc(1, sizeof *truth + 5 * sizeof truth->items[0]);
    truth->background_e = 12.5;
    truth->count = 5;
    /* light beside the chief ray by (0.5, -0.25) px; the middle of the path is its lowest place */
    truth->items[0] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                       .id = 5,
                                       .norad = 44801,
                                       .x_start_px = 89.5,
                                       .y_start_px = 121.5,
                                       .x_mid_px = 101.5,
                                       .y_mid_px = 111.5,
                                       .x_end_px = 113.5,
                                       .y_end_px = 116.5,
                                       .x_chief_px = 101.0,
                                       .y_chief_px = 117.0,
                                       .x_centroid_px = 101.5,
                                       .y_centroid_px = 116.75,
                                       .ra_rad = 1.25,
                                       .dec_rad = -0.5,
                                       .v_mag = 13.5,
                                       .electrons = 1200,
                                       .snr = 9.0};
    truth->items[1] = truth->items[0]; /* no light */
    truth->items[1].electrons = 0.0;
    truth->items[2] = (bst_truth_item){.kind = BST_SOURCE_STAR,
                                       .id = 77,
                                       .x_start_px = 239.5,
                                       .y_start_px = 171.5,
                                       .x_mid_px = 239.5,
                                       .y_mid_px = 171.5,
                                       .x_end_px = 239.5,
                                       .y_end_px = 171.5,
                                       .x_chief_px = 239.5,
                                       .y_chief_px = 171.5,
                                       .x_centroid_px = 239.5,
                                       .y_centroid_px = 171.5,
                                       .v_mag = 11.0,
                                       .electrons = 5000,
                                       .snr = 40};
    truth->items[3] = truth->items[2]; /* too faint */
    truth->items[3].v_mag = 12.1;
    truth->items[4] = truth->items[0]; /* its light ends a quarter of a pixel above the frame */
    truth->items[4].y_mid_px = truth->items[4].y_start_px = truth->items[4].y_end_px = 21.5;
    FILE *stream = fmemopen(text, sizeof text, "w");
    bst_study_labels l = {.stream = stream, .star_limit_v_mag = 12.0, .mask = true};
    bst_study_labels_frame(&l, &m, "2022-06-16T22:10:00", 0.5, truth);
    fclose(stream);
    cJSON *root = cJSON_Parse(text);
    assert_non_null(root);
    assert_int_equal(l.frames, 1);
    assert_int_equal(l.satellites, 1);
    assert_int_equal(l.stars, 1);
    bst_assert_close(l.snr_sum, 9.0, 0);
    bst_assert_close(l.longest_px, sqrt(24.0 * 24 + 5 * 5), 1e-12);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "objects")), 2);
    /* pixel edges: (89.5 + 0.5 - 40 + 0.5) / 400 of the width, (121.5 - 0.25 - 22 + 0.5) / 300 */
    const expected satellite[] = {{"class_id", 1},
                                  {"x_start", 50.5 / 400},
                                  {"x_mid", 62.5 / 400},
                                  {"x_end", 74.5 / 400},
                                  {"x_min", 50.5 / 400},
                                  {"x_max", 74.5 / 400},
                                  {"x_center", 62.5 / 400},
                                  {"bbox_width", 24.0 / 400},
                                  {"y_start", 99.75 / 300},
                                  {"y_mid", 89.75 / 300},
                                  {"y_end", 94.75 / 300},
                                  {"y_min", 89.75 / 300},
                                  {"y_max", 99.75 / 300},
                                  {"y_center", 94.75 / 300},
                                  {"bbox_height", 10.0 / 300},
                                  {"x_centroid", 62.0 / 400},
                                  {"y_centroid", 95.25 / 300},
                                  {"x_chief", 61.5 / 400},
                                  {"y_chief", 95.5 / 300},
                                  {"magnitude", 13.5},
                                  {"pe_per_sec", 2400},
                                  {"seg_id", 1},
                                  {"snr_aperture", 9},
                                  {"ra", 1.25 * 180 / BST_PI},
                                  {"dec", -0.5 * 180 / BST_PI}};
    expect_label(label(root, 0), satellite, sizeof satellite / sizeof *satellite);
    assert_string_equal(cJSON_GetObjectItem(label(root, 0), "object_name")->valuestring,
                        "SAT \"7\"");
    assert_string_equal(cJSON_GetObjectItem(label(root, 0), "object_id")->valuestring, "44801");
    const expected star[] = {{"class_id", 2},    {"x_center", 0.5}, {"y_center", 0.5},
                             {"bbox_width", 0},  {"seg_id", 3},     {"x_chief", 0.5},
                             {"y_centroid", 0.5}};
    expect_label(label(root, 1), star, sizeof star / sizeof *star);
    assert_string_equal(cJSON_GetObjectItem(label(root, 1), "object_id")->valuestring, "77");
    const expected whole[] = {
        {"sequence_id", 8}, {"plane", 0}, {"exposure_s", 0.5}, {"background_e", 12.5}};
    expect_label(root, whole, sizeof whole / sizeof *whole);
    cJSON_Delete(root);
    /* boxes of a given size, in pixels of the frame */
    truth->count = 1;
    l.box_px = 12.0;
    stream = l.stream = fmemopen(text, sizeof text, "w");
    bst_study_labels_frame(&l, &m, "2022-06-16T22:10:01", 0.5, truth);
    fclose(stream);
    root = cJSON_Parse(strchr(text, '{'));
    const expected box[] = {{"bbox_width", 12.0 / 200}, {"bbox_height", 12.0 / 150}};
    expect_label(label(root, 0), box, 2);
    cJSON_Delete(root);
    test_free(truth);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_detection_curve),
        cmocka_unit_test(a_loop),
        cmocka_unit_test(labels_of_a_binned_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
