/* What `boresight loop` prints and writes of a model, with a number of its own for each figure. */
#include <cjson/cJSON.h>
#include <stdlib.h>

#include "sim/analysis/loop/loop_model.h"
#include "tests/stdout_text.h"

static bst_loop_margins margins(double first) {
    return (bst_loop_margins){.stable = true,
                              .gain_margin_db = first + 0.1,
                              .gain_reduction_db = first + 0.2,
                              .phase_margin_deg = first + 0.3,
                              .delay_margin_s = first + 0.4,
                              .crossover_hz = first + 0.5,
                              .phase_crossover_hz = first + 0.6,
                              .sensitivity_peak = first + 0.7,
                              .sensitivity_peak_hz = first + 0.8,
                              .bandwidth_hz = first + 0.9};
}

static bst_loop_model *model(void) {
    bst_loop_model *m = calloc(1, sizeof *m);
    assert_non_null(m);
    m->observer_name = "eye";
    m->sensor_name = "tele";
    m->gimbal_type = "full";
    m->compensator = "pid";
    m->timing.period_s = 0.5;
    m->timing.exposure_s = 0.25;
    m->timing.frame_latency_s = 0.125;
    m->timing.command_delay_s = 0.0625;
    m->axes = 2;
    m->axis[0] = (bst_loop_axis){.name = "outer", .tracked = true, .margins = margins(10)};
    m->axis[0].prediction = (bst_loop_prediction){3, 0.31, 0.52, 0.43, 0.64, 0.75};
    m->axis[1] = (bst_loop_axis){.name = "inner", .tracked = true, .margins = margins(20)};
    m->axis[1].prediction = (bst_loop_prediction){4, 0.81, 0.92, 0.83, 0.94, 0.85};
    m->axis[1].servo.there = true;
    m->axis[1].servo.margins = margins(30);
    m->axis[1].servo.margins.delay_margin_s = INFINITY;
    m->bodies = 1;
    m->body[0] = (bst_loop_body){.name = "z", .margins = margins(40)};
    m->body[0].margins.stable = false;
    m->body[0].margins.unstable_closed = 2;
    return m;
}

static void printed(void **state) {
    (void)state;
    static char text[8000];
    bst_stdout_text out;
    bst_loop_model *m = model();
    bst_stdout_take(&out);
    bst_loop_print(m);
    bst_stdout_give(&out, text, sizeof text);
    char line[200];
    bst_assert_has(text, "eye/tele: gimbal full\n");
    bst_assert_has(
        text,
        "frames every 0.5 s exposed 0.25 s, with control 0.125 s after the exposure; commands "
        "0.0625 s on their way");
    static const struct {
        const char *label, *unit;
        double outer;
    } list[] = {{"gain margin", "dB", 10.1},      {"gain reduction margin", "dB", 10.2},
                {"phase margin", "deg", 10.3},    {"delay margin", "s", 10.4},
                {"sensitivity peak", "", 10.7},   {"crossover", "Hz", 10.5},
                {"bandwidth (-3 dB)", "Hz", 10.9}};
    for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
        for (int k = 0; k < 4; k++) { /* outer, inner, its servo, the body */
            char value[40];
            bool endless = k == 2 && i == 3;
            snprintf(value, sizeof value, "%.4g", list[i].outer + 10 * k);
            snprintf(line, sizeof line, endless ? "    %-24s %10s\n" : "    %-24s %10s %s\n",
                     list[i].label, endless ? "none" : value, list[i].unit);
            bst_assert_has(text, line);
        }
    }
    snprintf(line, sizeof line, "    %-24s %10.4g px\n", "predicted pointing RMS", 3.0);
    bst_assert_has(text, line);
    bst_assert_has(
        text,
        "jitter 0.31 left of 0.52 px, of which 0.43 above half the frame rate; frames' errors "
        "0.64; lag 0.75");
    bst_assert_has(text, "  body z axis, attitude loop\n");
    bst_assert_has(text, "2 poles outside the unit circle");
    free(m);
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!item) {
        fail_msg("no %s", key);
    }
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static void assert_margins(const cJSON *node, double first) {
    static const char *const keys[] = {
        "gain_margin_db", "gain_reduction_margin_db", "phase_margin_deg", "delay_margin_s",
        "crossover_hz",   "phase_crossover_hz",       "sensitivity_peak", "sensitivity_peak_hz",
        "bandwidth_hz"};
    for (int i = 0; i < 9; i++) {
        double value = number(node, keys[i]);
        if (first == 30 && i == 3) {
            assert_true(isnan(value)); /* no limit is null */
        } else {
            bst_assert_close(value, first + 0.1 * (i + 1), 1e-12);
        }
    }
}

static void written(void **state) {
    (void)state;
    bst_loop_model *m = model();
    cJSON *root = bst_loop_json(m);
    assert_non_null(root);
    bst_assert_close(number(root, "frame_period_s"), 0.5, 0.0);
    bst_assert_close(number(root, "exposure_s"), 0.25, 0.0);
    bst_assert_close(number(root, "frame_latency_s"), 0.125, 0.0);
    bst_assert_close(number(root, "command_delay_s"), 0.0625, 0.0);
    bst_assert_close(number(root, "predicted_rms_radial_px"), 5.0, 1e-12); /* 3 and 4 */
    const cJSON *axes = cJSON_GetObjectItem(root, "axes"), *inner = cJSON_GetArrayItem(axes, 1);
    assert_margins(cJSON_GetArrayItem(axes, 0), 10);
    assert_margins(inner, 20);
    assert_margins(cJSON_GetObjectItem(inner, "servo"), 30);
    assert_margins(cJSON_GetArrayItem(cJSON_GetObjectItem(root, "body"), 0), 40);
    static const char *const keys[] = {"predicted_rms_px",   "jitter_left_rms_px",
                                       "jitter_open_rms_px", "jitter_above_half_frame_rate_rms_px",
                                       "frame_noise_rms_px", "drift_lag_px"};
    static const double of_inner[] = {4, 0.81, 0.92, 0.83, 0.94, 0.85};
    for (int i = 0; i < 6; i++) {
        bst_assert_close(number(inner, keys[i]), of_inner[i], 0.0);
    }
    cJSON_Delete(root);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(printed), cmocka_unit_test(written)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
