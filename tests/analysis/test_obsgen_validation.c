/* The comparison of generator and images on runs that are made up here: figures of both sides,
 * their ratios and differences, intervals and verdicts. Linked with a wrap of the run itself. */
#include <cjson/cJSON.h>
#include <unistd.h>

#include "boresight/vec.h"
#include "sim/analysis/calibration/obsgen_validation.h"
#include "sim/analysis/calibration/watch.h"
#include "tests/test_support.h"

enum { SEEDS = 6, FRAMES = 5, SOURCES = 40 };

static int played[2];       /* runs with images, with the generator */
static double place_off[2]; /* px, of all detections */
static double track_off[2]; /* px */
static double confirm_s[2];
static int alarms[2]; /* a frame */
static int missed[2]; /* of the sources of a frame at SNR 6.5 */
static bool dark;     /* sources are too faint for any figure */

static bool is_generator(const bst_scenario *scenario) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[0].sensors.items;
    return sensors[0].observation_source == BST_OBSERVE_GENERATOR;
}

bst_status __wrap_bst_watch_run(bst_ctx *ctx, const bst_scenario *scenario,
                                const bst_calibration_watcher *watcher, const char *device,
                                int threads, bst_loop_figures *figures);
bst_status __wrap_bst_watch_run(bst_ctx *ctx, const bst_scenario *scenario,
                                const bst_calibration_watcher *watcher, const char *device,
                                int threads, bst_loop_figures *figures) {
    (void)device;
    (void)threads;
    int g = is_generator(scenario);
    /* each pair of runs is of one number of the scenario */
    assert_int_equal(scenario->run, played[g]);
    int number = played[g]++;
    bst_truth *truth = test_calloc(1, sizeof *truth + (SOURCES + 3) * sizeof truth->items[0]);
    bst_detections *found = test_calloc(1, sizeof *found + 99 * sizeof found->items[0]);
    for (int f = 0; f < FRAMES; f++) {
        truth->count = SOURCES + 3;
        found->count = 0;
        for (int i = 0; i < SOURCES + 3; i++) {
            double x = 20.0 * (i % 8) + 10, y = 20.0 * (i / 8) + 10;
            truth->items[i] = (bst_truth_item){.x_centroid_px = x,
                                               .y_centroid_px = y,
                                               .x_start_px = x,
                                               .x_end_px = x,
                                               .y_start_px = y,
                                               .y_end_px = y,
                                               .snr = i < 20 ? 6.5 : 12.0,
                                               .flags = BST_TRUTH_IN_FIELD};
            /* the last three do not count: too faint, hidden, out of the field */
            if (dark || i == SOURCES) {
                truth->items[i].snr = 2.9;
            } else if (i > SOURCES) {
                truth->items[i].flags =
                    i == SOURCES + 1 ? BST_TRUTH_IN_FIELD | BST_TRUTH_OCCULTED : 0;
            } else if (i >= missed[g]) {
                bool rough = i == 39; /* not fitted: a sigma of a pixel */
                found->items[found->count++] =
                    (bst_detection){.x_px = x + (rough ? 0.9 : 0.6 * place_off[g]),
                                    .y_px = y - (rough ? 0.9 : 0.8 * place_off[g]),
                                    .cov_xx = 0.01,
                                    .cov_yy = rough ? 1.0 : 0.01};
            }
        }
        for (int k = 0; k < alarms[g] + (f == 0 && number == 0 && g == 0); k++) {
            found->items[found->count++] = (bst_detection){.x_px = 500 + k, .y_px = 500};
        }
        bst_assert_ok(ctx, watcher->frame(watcher->user, ctx, truth, found));
        watcher->track_error(watcher->user, track_off[g]);
    }
    test_free(truth);
    test_free(found);
    *figures = (bst_loop_figures){.time_to_confirm_s = number == 5 ? NAN : confirm_s[g] + number};
    return BST_OK;
}

static cJSON *compare(bool *equivalent) {
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH], text[20000];
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    bst_test_template(path, "validation");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    played[0] = played[1] = 0;
    const bst_obsgen_validation_options options = {.scenario = "scenarios/neossat_geo_track.json",
                                                   .load = &load,
                                                   .seeds = SEEDS,
                                                   .threads = 1,
                                                   .json = path};
    bst_assert_ok(&ctx, bst_obsgen_validation_run(&ctx, &options, equivalent));
    assert_int_equal(played[0], SEEDS);
    assert_int_equal(played[1], SEEDS);
    FILE *file = fopen(path, "r");
    size_t bytes = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    unlink(path);
    text[bytes] = '\0';
    cJSON *root = cJSON_Parse(text);
    assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(root, "equivalent")), *equivalent);
    assert_int_equal(cJSON_GetObjectItem(root, "runs")->valueint, SEEDS);
    return root;
}

static const cJSON *figure(const cJSON *root, const char *name) {
    const cJSON *item;
    cJSON_ArrayForEach(item, cJSON_GetObjectItem(root, "figures")) {
        if (strcmp(cJSON_GetObjectItem(item, "name")->valuestring, name) == 0) {
            return item;
        }
    }
    fail_msg("no figure %s", name);
    return NULL;
}

static double number(const cJSON *item, const char *key) {
    return cJSON_GetObjectItem(item, key)->valuedouble;
}

static void expect(const cJSON *root, const char *name, double image, double generator, bool ratio,
                   double margin) {
    const cJSON *item = figure(root, name);
    bst_assert_close(number(item, "image"), image, 1e-9);
    bst_assert_close(number(item, "generator"), generator, 1e-9);
    double value = ratio ? generator / image : generator - image, middle = ratio ? 1.0 : 0.0;
    bst_assert_close(number(item, ratio ? "ratio" : "difference"), value, 1e-9);
    bst_assert_close(number(item, "margin"), margin, 0);
    double low = number(item, "low"), high = number(item, "high");
    assert_true(low <= value + 1e-9 && high >= value - 1e-9);
    assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(item, "inside")),
                     low >= middle - margin && high <= middle + margin);
    assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(item, "beyond")),
                     fabs(value - middle) > margin + 2 * number(item, "sigma"));
}

static void set_sides(double off, double track, double confirm, int alarm, int miss) {
    place_off[0] = 0.2;
    track_off[0] = 0.5;
    confirm_s[0] = 20;
    alarms[0] = 2;
    missed[0] = 5;
    place_off[1] = off;
    track_off[1] = track;
    confirm_s[1] = confirm;
    alarms[1] = alarm;
    missed[1] = miss;
}

static void equal_sides(void **state) {
    (void)state;
    bool equivalent;
    set_sides(0.2, 0.5, 20, 2, 5);
    cJSON *root = compare(&equivalent);
    assert_true(equivalent);
    expect(root, "Pd at SNR 6 to 7", 0.75, 0.75, false, 0.02);
    expect(root, "Pd at SNR 10 to 15", 1, 1, false, 0.02);
    /* per axis: off / sqrt 2 */
    expect(root, "RMS of places, px", 0.2 / sqrt(2), 0.2 / sqrt(2), true, 0.05);
    expect(root, "RMS of the track, px", 0.5, 0.5, true, 0.05);
    expect(root, "time to confirm, s", 22, 22, true, 0.1);
    /* one more in one of 30 frames */
    expect(root, "false alarms per frame", 2 + 1.0 / 30, 2, true, 0.1);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "figures")), 6);
    /* the extra alarm is in one run of six: the interval is that of how often it is drawn, and the
     * variance of a mean of six has a divisor of five */
    const cJSON *item = figure(root, "false alarms per frame");
    double sigma = 2.0 / (2 + 1.0 / 30) / (2 + 1.0 / 30) * sqrt(5.0 / 36 / 5) / 5;
    bst_assert_close(number(item, "sigma"), sigma, 0.1 * sigma);
    bst_assert_close(number(item, "high"), 1.0, 1e-9);                /* not drawn at all: 33 % */
    bst_assert_close(number(item, "low"), 2 / (2 + 3.0 / 30), 0.005); /* drawn three times: 5 % */
    cJSON_Delete(root);
}

static void each_side_that_differs(void **state) {
    (void)state;
    static const struct {
        double off, track, confirm;
        int alarm, miss;
        const char *name;
    } cases[] = {{0.22, 0.5, 20, 2, 5, "RMS of places, px"},
                 {0.2, 0.53, 20, 2, 5, "RMS of the track, px"},
                 {0.2, 0.5, 23, 2, 5, "time to confirm, s"},
                 {0.2, 0.5, 20, 3, 5, "false alarms per frame"},
                 {0.2, 0.5, 20, 2, 6, "Pd at SNR 6 to 7"}};
    for (int k = 0; k < 5; k++) {
        bool equivalent;
        set_sides(cases[k].off, cases[k].track, cases[k].confirm, cases[k].alarm, cases[k].miss);
        cJSON *root = compare(&equivalent);
        assert_false(equivalent);
        const cJSON *item;
        cJSON_ArrayForEach(item, cJSON_GetObjectItem(root, "figures")) {
            bool own = strcmp(cJSON_GetObjectItem(item, "name")->valuestring, cases[k].name) == 0;
            assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(item, "inside")), !own);
            assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(item, "beyond")), own);
        }
        cJSON_Delete(root);
    }
}

/* Alarms of the generator where images have none are not equal, and neither is nothing at all. */
static void one_side_alone_is_not_equivalent(void **state) {
    (void)state;
    bool equivalent;
    set_sides(0.2, 0.5, 20, 1, 5);
    alarms[0] = -1; /* no alarm in the first frame either */
    cJSON *root = compare(&equivalent);
    assert_false(equivalent);
    const cJSON *alone = cJSON_GetObjectItem(root, "one_sided");
    assert_int_equal(cJSON_GetArraySize(alone), 1);
    const cJSON *item = cJSON_GetArrayItem(alone, 0);
    assert_string_equal(cJSON_GetObjectItem(item, "name")->valuestring, "false alarms per frame");
    bst_assert_close(number(item, "image"), 0.0, 0.0);
    bst_assert_close(number(item, "generator"), 1.0, 1e-9);
    cJSON_Delete(root);
    set_sides(0.2, NAN, NAN, -1, SOURCES);
    missed[0] = SOURCES;
    track_off[0] = confirm_s[0] = NAN;
    alarms[0] = -1;
    dark = true;
    root = compare(&equivalent);
    dark = false;
    assert_false(equivalent);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "figures")), 0);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "one_sided")), 0);
    cJSON_Delete(root);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_sides),
        cmocka_unit_test(each_side_that_differs),
        cmocka_unit_test(one_side_alone_is_not_equivalent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
