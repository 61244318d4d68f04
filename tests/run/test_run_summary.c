/* The keys of a summary, each with its own number. */
#include <cjson/cJSON.h>

#include "boresight/messages.h"
#include "sim/run/run_summary.h"
#include "tests/test_support.h"

static void every_key(void **state) {
    (void)state;
    const bst_run_sensor_figures figures = {
        .loop = {.frames = 1,
                 .final_mode = BST_MODE_COAST,
                 .time_to_confirm_s = 2.5,
                 .time_to_acquire_s = 3.5,
                 .time_to_settle_s = 4.5,
                 .visible_frames = 5,
                 .breaks = 6,
                 .custody = 0.75,
                 .track_fraction = 0.25,
                 .wrong_target_frames = 7,
                 .pointing_frames = 8,
                 .pointing_rms_px = 9.5,
                 .pointing_median_px = 10.5,
                 .pointing_p95_px = 11.5,
                 .pointing_p99_px = 12.5,
                 .pointing_max_px = NAN,
                 .pointing_bias_px = 13.5},
        .metrics = {.detected_fraction = 0.125,
                    .detections = 14,
                    .track_frames = 15,
                    .track_rms_px = 16.5,
                    .track_median_px = 17.5,
                    .track_p95_px = 18.5,
                    .track_max_px = 19.5,
                    .smoothed_frames = 32,
                    .smoothed_rms_px = 33.5,
                    .smoothed_filtered_rms_px = 34.5,
                    .tracks = 20,
                    .false_tracks = 21,
                    .scored_frames = 27,
                    .gospa_px = 28.5,
                    .ospa2_px = 29.5,
                    .purity = 0.875,
                    .id_switches = 30,
                    .ghosts = 31,
                    .bad_pixels = 22,
                    .losses = {.earth_frames = 23, .moon_frames = 24, .sun_frames = 25}}};
    static const struct {
        const char *key;
        double value;
    } keys[] = {{"frames", 1},
                {"time_to_confirm_s", 2.5},
                {"time_to_acquire_s", 3.5},
                {"time_to_settle_s", 4.5},
                {"visible_frames", 5},
                {"breaks", 6},
                {"custody", 0.75},
                {"track_fraction", 0.25},
                {"wrong_target_frames", 7},
                {"pointing_frames", 8},
                {"pointing_rms_px", 9.5},
                {"pointing_median_px", 10.5},
                {"pointing_p95_px", 11.5},
                {"pointing_p99_px", 12.5},
                {"pointing_bias_px", 13.5},
                {"detected_fraction", 0.125},
                {"detections", 14},
                {"track_frames", 15},
                {"track_rms_px", 16.5},
                {"track_median_px", 17.5},
                {"track_p95_px", 18.5},
                {"track_max_px", 19.5},
                {"smoothed_frames", 32},
                {"smoothed_rms_px", 33.5},
                {"smoothed_filtered_rms_px", 34.5},
                {"tracks", 20},
                {"false_tracks", 21},
                {"scored_frames", 27},
                {"gospa_px", 28.5},
                {"ospa2_px", 29.5},
                {"track_purity", 0.875},
                {"id_switches", 30},
                {"ghosts", 31},
                {"bad_pixels", 22},
                {"earth_frames", 23},
                {"moon_frames", 24},
                {"sun_frames", 25},
                {"real_time_factor", 26.5}};
    cJSON *node = bst_run_summary_json(&figures, 26.5);
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, keys[i].key);
        assert_true(cJSON_IsNumber(item));
        bst_assert_close(item->valuedouble, keys[i].value, 0);
    }
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(node, "pointing_max_px")));
    assert_string_equal(cJSON_GetObjectItem(node, "final_mode")->valuestring, "coast");
    assert_int_equal(cJSON_GetArraySize(node), sizeof keys / sizeof *keys + 2);
    cJSON_Delete(node);
}

static void no_smoother_no_keys(void **state) {
    (void)state;
    const bst_run_sensor_figures figures = {.metrics = {.smoothed_rms_px = NAN}};
    cJSON *node = bst_run_summary_json(&figures, 1.0);
    assert_null(cJSON_GetObjectItem(node, "smoothed_frames"));
    assert_null(cJSON_GetObjectItem(node, "smoothed_rms_px"));
    cJSON_Delete(node);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_key),
                                       cmocka_unit_test(no_smoother_no_keys)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
