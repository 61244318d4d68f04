/* The loops of a second-order mount against closed forms, the bands of its jitter against the
 * configured RMS, and the report of a model whose numbers are all different. */
#include <cjson/cJSON.h>
#include <complex.h>

#include "boresight/vec.h"
#include "gimbal/modules.h"
#include "gimbal/mount/second_order.h"
#include "gimbal/spacecraft/spacecraft_response.h"
#include "sim/analysis/loop/loop_model.h"
#include "sim/cli/load.h"
#include "tests/test_support.h"

#define PX 1e-5 /* rad */
#define GIMBAL "/observers/0/sensors/0/modules/gimbal/"
#define CONTROL "/observers/0/sensors/0/modules/control/"

static double variance_between(const bst_loop_axis *axis, double low_hz, double high_hz) {
    double sum = 0.0;
    for (int i = 0; i < axis->band_count; i++) {
        const bst_tracking_band *b = &axis->bands[i];
        if (b->low_hz >= low_hz - 1e-9 && b->high_hz <= high_hz + 1e-9) {
            sum += b->variance;
        }
    }
    return sum;
}

/* Flat bands have half of the radial variance each; tables the integral of their density, about y
 * times y_scale; lines half of the square of the amplitude; nothing beyond 0.4 of the plant's rate.
 */
static void bands_of_the_jitter(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_jitter_density_point low[] = {{0.5, 2e-3}, {2.0, 2e-3}},
                             high[] = {{300.0, 1e-4}, {500.0, 1e-4}, {800.0, 1e-4}};
    bst_platform_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_platform_config_table, &c));
    c.jitter_low_px_rms = 0.6;
    c.jitter_low_cutoff_hz = 0.05;
    c.jitter_high_px_rms = 0.2;
    c.jitter_high_band_hz[0] = 5;
    c.jitter_high_band_hz[1] = 200;
    c.jitter_psd.low = (bst_config_list){.items = low, .count = 2};
    c.jitter_psd.high = (bst_config_list){.items = high, .count = 3};
    c.jitter_psd.y_scale = 2.5;
    for (int axis = 0; axis < 2; axis++) {
        bst_loop_axis *a = calloc(1, sizeof *a);
        assert_non_null(a);
        double scale = axis == 1 ? 2.5 : 1.0;
        bst_assert_ok(&ctx, bst_loop_platform_bands(&ctx, &c, PX, 1e-3, axis, a));
        bst_assert_close(variance_between(a, 0, 0.05), 0.18, 1e-9);
        bst_assert_close(variance_between(a, 5, 200), 0.02, 1e-9);
        bst_assert_close(variance_between(a, 0.5, 2), scale * 2e-3 * 1.5, 1e-9);
        bst_assert_close(variance_between(a, 300, 1e9), scale * 1e-4 * 100.0, 1e-9); /* to 400 Hz */
        for (int i = 0; i < a->band_count; i++) {
            assert_true(a->bands[i].low_hz <= a->bands[i].high_hz &&
                        a->bands[i].high_hz <= 400.001);
            if (a->bands[i].low_hz >= 0.5 && a->bands[i].high_hz <= 2.0) {
                /* narrow parts, of the density there: two octaves in eight */
                assert_true(a->bands[i].high_hz - a->bands[i].low_hz < 0.2);
                bst_assert_close(a->bands[i].variance / (a->bands[i].high_hz - a->bands[i].low_hz),
                                 scale * 2e-3, 1e-9);
            }
        }
        bst_loop_add_band(a, 7, 6, 1);
        bst_loop_add_band(a, 7, 8, 0);
        int before = a->band_count;
        bst_loop_add_band(a, 7, 7, 0.5);
        assert_int_equal(a->band_count, before + 1);
        bst_assert_close(a->bands[before].variance, 0.5, 0);
        free(a);
    }
}

/* What the attitude estimate adds to an axis: bands without gaps from 0 to 10 Hz, each of the
 * density in its middle over its width, in square pixels; with a spacecraft of known attitude none.
 */
static void bands_of_the_attitude(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_spacecraft_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_spacecraft_config_table, &c));
    bst_loop_axis *a = calloc(1, sizeof *a);
    assert_non_null(a);
    bst_loop_body_bands(&c, 0, PX, a);
    assert_int_equal(a->band_count, 0);
    c.type = BST_CRAFT_RIGID_BODY;
    for (int axis = 0; axis < 3; axis++) {
        a->band_count = 0;
        bst_loop_body_bands(&c, axis, PX, a);
        assert_int_equal(a->band_count, 61);
        bst_assert_close(a->bands[0].low_hz, 0.0, 0.0);
        bst_assert_close(a->bands[0].high_hz, 1e-5, 1e-12);
        bst_assert_close(a->bands[60].high_hz, 10.0, 1e-6);
        double sum = 0.0, integral = 0.0;
        for (int i = 1; i <= 60; i++) {
            bst_assert_close(a->bands[i].low_hz, a->bands[i - 1].high_hz, 0.0);
            bst_assert_close(log10(a->bands[i].high_hz / a->bands[i].low_hz), 0.1, 1e-9);
            sum += a->bands[i].variance;
        }
        for (int i = 0; i < 6000; i++) { /* by logarithmic steps of a thousandth of a decade */
            double f = pow(10.0, -5.0 + (i + 0.5) * 1e-3);
            integral += bst_spacecraft_noise_at(&c, axis, f).knowledge * f * 1e-3 * log(10.0);
        }
        bst_assert_close(sum * PX * PX / integral, 1.0, 0.01); /* ten bands in a decade */
    }
    free(a);
}

static bst_loop_model *model_of_file(const char *file, bst_json **json, bst_scenario *scenario,
                                     const char *const *sets, int count) {
    bst_ctx ctx = {0};
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    const bst_loop_options options = {.fix_sigma_px = 0.03};
    bst_loop_model *model;
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    for (int i = 0; i < count; i++) {
        load.set.items[load.set.count++] = sets[i];
    }
    bst_assert_ok(&ctx, bst_load_scenario(&ctx, file, &load, json, scenario));
    bst_assert_ok(&ctx, bst_loop_model_create(&ctx, scenario, 0, 0, &options, &model));
    assert_non_null(model);
    return model;
}

static bst_loop_model *model_of(bst_json **json, bst_scenario *scenario, const char *const *sets,
                                int count) {
    return model_of_file("scenarios/neossat_geo_track.json", json, scenario, sets, count);
}

static void a_second_order_mount(void **state) {
    (void)state;
    const char *const sets[] = {GIMBAL "natural_frequency_hz=1.5", GIMBAL "damping=0.4",
                                GIMBAL "platform/drift_arcsec_per_s=[3,-12,5]"};
    bst_json *json;
    bst_scenario scenario;
    bst_loop_model *m = model_of(&json, &scenario, sets, 3);
    const double w = 2 * BST_PI * 1.5, d = 0.4;
    assert_int_equal(m->axes, 2);
    assert_string_equal(m->axis[0].name, "outer");
    for (int k = 0; k < 2; k++) {
        const bst_loop_margins *g = &m->axis[k].servo.margins;
        assert_true(m->axis[k].servo.there && m->axis[k].servo.continuous && g->stable);
        /* L = (2 d w s + w^2) / s^2 */
        double cross = w * sqrt(2 * d * d + sqrt(4 * d * d * d * d + 1));
        double margin = atan(2 * d * cross / w);
        bst_assert_close(g->crossover_hz, cross / 2 / BST_PI, 1e-3 * cross);
        bst_assert_close(g->phase_margin_deg, margin * 180 / BST_PI, 0.05);
        bst_assert_close(g->delay_margin_s, margin / cross, 1e-3 * margin / cross);
        assert_true(isinf(g->gain_margin_db));
        bst_assert_close(g->sensitivity_peak, 1 / (2 * d * sqrt(1 - d * d)), 2e-3);
        double wide = w * sqrt(1 + 2 * d * d + sqrt((1 + 2 * d * d) * (1 + 2 * d * d) + 1));
        bst_assert_close(g->bandwidth_hz, wide / 2 / BST_PI, 5e-3 * wide);
    }
    const bst_loop_axis *outer = &m->axis[0], *inner = &m->axis[1];
    assert_true(outer->tracked && inner->tracked);
    /* the outer axis turns about y, the inner about x: lags are as the drifts */
    bst_assert_close(outer->prediction.lag_px / inner->prediction.lag_px, 4.0, 1e-9);
    for (int k = 0; k < 2; k++) {
        const bst_loop_prediction *p = &m->axis[k].prediction;
        bst_assert_close(
            p->rms_px * p->rms_px,
            p->jitter_px * p->jitter_px + p->noise_px * p->noise_px + p->lag_px * p->lag_px, 1e-12);
        /* 0.5 and 0.2 px radially, half of each about an axis; of the fast one what lies above 1 Hz
         * of frames each half second */
        bst_assert_close(p->open_px * p->open_px, 0.125 + 0.02, 1e-6);
        bst_assert_close(p->above_px * p->above_px, 0.02, 1e-6);
        assert_true(p->noise_px > 0.0 && p->noise_px < 0.3);
    }
    bst_loop_model_free(m);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* What an attitude estimate that is worse about one axis than about another adds to each loop: the
 * outer axis turns about y, along which the star trackers look, the inner one about x. */
static void the_body_by_axis(void **state) {
    (void)state;
    const char *const sets[] = {GIMBAL "platform/drift_arcsec_per_s=[0,0,0]",
                                GIMBAL "platform/jitter_high_px_rms=0",
                                GIMBAL "platform/jitter_low_px_rms=0",
                                GIMBAL "platform/spacecraft={\"type\": \"rigid_body\"}"};
    bst_json *json;
    bst_scenario scenario;
    bst_loop_model *m = model_of(&json, &scenario, sets, 4);
    const bst_spacecraft_config *craft = NULL;
    for (int i = 0; i < scenario.module_count; i++) {
        if (scenario.modules[i].desc->config == bst_two_axis_config_table) {
            const bst_mount_two_axis_config *mount = scenario.modules[i].config;
            craft = &mount->platform.spacecraft;
        }
    }
    assert_non_null(craft);
    bst_loop_axis *a = calloc(1, sizeof *a);
    assert_non_null(a);
    double open2[2];
    for (int k = 0; k < 2; k++) {
        a->band_count = 0;
        bst_loop_body_bands(craft, k == 0 ? 1 : 0, m->pixel_rad, a);
        open2[k] = variance_between(a, 0.0, 1e9);
        bst_assert_close(pow(m->axis[k].prediction.open_px, 2.0) / open2[k], 1.0, 1e-9);
    }
    assert_true(open2[0] > 1.2 * open2[1]);
    free(a);
    bst_loop_model_free(m);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* Twice the error of a frame is twice the noise; no drift, no lag. */
static void predictions_scale(void **state) {
    (void)state;
    const char *const sets[] = {GIMBAL "platform/drift_arcsec_per_s=[0,0,9]",
                                GIMBAL "platform/jitter_high_px_rms=0"};
    bst_json *json;
    bst_scenario scenario;
    bst_loop_model *m = model_of(&json, &scenario, sets, 2), *twice;
    bst_ctx ctx = {0};
    const bst_loop_options options = {.fix_sigma_px = 0.06};
    bst_assert_ok(&ctx, bst_loop_model_create(&ctx, &scenario, 0, 0, &options, &twice));
    for (int k = 0; k < 2; k++) {
        assert_true(m->axis[k].prediction.lag_px == 0.0);
        bst_assert_close(m->axis[k].prediction.above_px, 0.0, 0.0);
        double ratio = twice->axis[k].prediction.noise_px / m->axis[k].prediction.noise_px;
        /* an observer takes other gains for other noise */
        assert_true(m->observes ? ratio > 1.0 && ratio <= 2.0 : fabs(ratio - 2.0) < 1e-9);
    }
    bst_loop_model_free(m);
    bst_loop_model_free(twice);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* ---- the mount's own response and the observer's gains, as the tracking loop is given them ----
 */

static bst_control_servo_response given[2];
static double drifts_pxps[2];
static int axes_given;

bst_status __real_bst_loop_close_tracking(bst_ctx *ctx, const bst_loop_tracked *tracked,
                                          bst_loop_model *model, bst_loop_axis *axis);
bst_status __wrap_bst_loop_close_tracking(bst_ctx *ctx, const bst_loop_tracked *tracked,
                                          bst_loop_model *model, bst_loop_axis *axis);
bst_status __wrap_bst_loop_close_tracking(bst_ctx *ctx, const bst_loop_tracked *tracked,
                                          bst_loop_model *model, bst_loop_axis *axis) {
    if (tracked->servo->step && axes_given < 2) {
        bst_control_servo_response *out = &given[axes_given];
        size_t bytes = (size_t)tracked->servo->count * sizeof *out->step;
        double *step = malloc(bytes), *lag = malloc(bytes);
        assert_true(step && lag);
        memcpy(step, tracked->servo->step, bytes);
        memcpy(lag, tracked->servo->ramp_lag, bytes);
        *out = *tracked->servo;
        out->step = step;
        out->ramp_lag = lag;
        drifts_pxps[axes_given++] = tracked->drift_pxps;
    }
    return __real_bst_loop_close_tracking(ctx, tracked, model, axis);
}

/* Angle at time t after a unit step of the command: the reference follows it at k times its error,
 * the axis the reference by y'' = 2 d w (r' - y') + w^2 (r - y); in a thousand steps. */
static double follows(double t, double w, double d, double k) {
    double y = 0.0, rate = 0.0, h = t / 1000;
    for (int i = 0; i < 1000; i++) {
        double left = exp(-k * (i + 0.5) * h), middle = y + 0.5 * h * rate;
        double accel = 2 * d * w * (k * left - rate) + w * w * (1 - left - middle);
        rate += h * accel;
        y += h * (rate - 0.5 * h * accel);
    }
    return y;
}

/* Behind a ramp of known rate the axis lags by exp(-d w t) sin(v t) / v, v^2 = w^2 (1 - d^2). */
static void response_and_gains(void **state) {
    (void)state;
    const char *const sets[] = {GIMBAL "natural_frequency_hz=0.7",
                                GIMBAL "damping=0.3",
                                GIMBAL "platform/drift_arcsec_per_s=[3,-12,5]",
                                CONTROL "robust_observer=false",
                                CONTROL "fix_sigma_floor_px=0.05",
                                CONTROL "compensator/gain_scale=0.8",
                                CONTROL "compensator/delay_s=0.07",
                                CONTROL "disturbance_px_rms=1.5",
                                CONTROL "disturbance_cutoff_hz=0.08",
                                CONTROL "command_latency_s=0.13"};
    bst_json *json;
    bst_scenario scenario;
    axes_given = 0;
    bst_loop_model *m = model_of(&json, &scenario, sets, 10), *noisy;
    assert_int_equal(axes_given, 2);
    const double w = 2 * BST_PI * 0.7, d = 0.3, v = w * sqrt(1 - d * d);
    for (int k = 0; k < 2; k++) {
        const bst_control_servo_response *r = &given[k];
        bst_assert_close(drifts_pxps[k], (k == 0 ? -12.0 : 3.0) / 3.0, 1e-12);
        bst_assert_close(r->dt_s, m->timing.gimbal_period_s, 0.0);
        /* until both are at rest to 1e-9 of the command */
        double rest = log(1e9) / (d * w);
        assert_true(r->count * r->dt_s > 0.85 * rest && r->count * r->dt_s < 1.1 * rest);
        for (int n = 0; n < r->count; n += n < 100 ? 1 : 17) {
            double t = (n + 1) * r->dt_s, e = exp(-d * w * t);
            bst_assert_close(r->step[n], follows(t, w, d, fmin(40, 0.2 / r->dt_s)), 0.01);
            bst_assert_close(r->ramp_lag[n], e * sin(v * t) / v, 0.01 / w);
        }
        /* the loop at the delays from mid-exposure on that these keys stand for */
        const bst_loop_timing *t = &m->timing;
        double arrival_s = 0.5 * t->exposure_s + t->frame_latency_s;
        const bst_tracking_timing timing = {.period_s = t->period_s,
                                            .exposure_s = t->exposure_s,
                                            .arrival_s = arrival_s,
                                            .effect_s = arrival_s + 0.13,
                                            .switch_s = arrival_s + t->command_delay_s};
        bst_tracking_loop *own;
        bst_ctx own_ctx = {0};
        assert_true(t->exposure_s > 0.0);
        bst_assert_ok(&own_ctx,
                      bst_tracking_loop_create(&own_ctx, &timing, r, NULL, &m->alpha_beta, &own));
        bst_assert_close(bst_tracking_lag(m->axis[k].tracking), bst_tracking_lag(own), 1e-12);
        for (double hz = 0.01; hz < 0.5; hz *= 1.7) {
            double complex off = bst_tracking_open(m->axis[k].tracking, 2 * BST_PI * hz) -
                                 bst_tracking_open(own, 2 * BST_PI * hz);
            bst_assert_close(cabs(off), 0.0, 1e-9);
        }
        bst_tracking_loop_free(own);
        free((double *)(uintptr_t)r->step);
        free((double *)(uintptr_t)r->ramp_lag);
    }
    bst_assert_close(m->pixel_rad, 3.0 * BST_ARCSEC_RAD, 1e-15);
    bst_assert_close(m->alpha_beta.motion_gain, 0.8, 0.0);
    bst_assert_close(m->alpha_beta.motion_late_s, 0.07, 0.0);
    assert_true(m->observes && !m->lowered);
    /* steady state of white acceleration noise: b^2 / (1 - a) = density T^3 / sigma^2, with half of
     * the radial variance about an axis and a quarter of w^3; a frame's error is at least its floor
     */
    double cutoff = 2 * BST_PI * 0.08;
    double density = 0.5 * 1.5 * 1.5 * cutoff * cutoff * cutoff / 4;
    bst_ctx ctx = {0};
    const bst_loop_options options = {.fix_sigma_px = 0.2};
    bst_assert_ok(&ctx, bst_loop_model_create(&ctx, &scenario, 0, 0, &options, &noisy));
    double a[2] = {m->alpha_beta.alpha, noisy->alpha_beta.alpha};
    double b[2] = {m->alpha_beta.beta, noisy->alpha_beta.beta};
    bst_assert_close(b[0] * b[0] / (1 - a[0]) / density, 1 / 0.05 / 0.05, 1e-3);
    bst_assert_close(b[1] * b[1] / (1 - a[1]) / density, 1 / 0.2 / 0.2, 1e-3);
    bst_loop_model_free(m);
    bst_loop_model_free(noisy);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* A full mount: azimuth about body x, elevation about y, both with a flexible mode whose frequency
 * the free joint raises; the third axis tracks nothing. A step is followed and a ramp not lagged
 * behind in the end. */
static void a_full_mount(void **state) {
    (void)state;
    const char *const sets[] = {GIMBAL "platform/drift_arcsec_per_s=[3,-12,5]",
                                GIMBAL "flexible/frequency_hz=[60,45,0]",
                                GIMBAL "flexible/inertia_fraction=[0.15,0.2,0.15]"};
    bst_json *json;
    bst_scenario scenario;
    axes_given = 0;
    bst_loop_model *m = model_of_file("scenarios/full_plant.json", &json, &scenario, sets, 3);
    assert_int_equal(m->axes, 3);
    assert_int_equal(axes_given, 2);
    const double modes[2] = {60.0, 45.0}, shares[2] = {0.15, 0.2};
    for (int k = 0; k < 2; k++) {
        const bst_loop_axis *axis = &m->axis[k];
        assert_string_equal(axis->name, k ? "inner" : "outer");
        assert_true(axis->tracked && axis->servo.there && !axis->servo.continuous);
        bst_assert_close(drifts_pxps[k], (k ? -12.0 : 3.0) / 3.0, 1e-9);
        assert_int_equal(axis->servo.loop.hints, 2);
        bst_assert_close(axis->servo.hint_hz[0], modes[k], 1e-9);
        bst_assert_close(axis->servo.hint_hz[1] * axis->servo.hint_hz[1] * (1.0 - shares[k]),
                         modes[k] * modes[k], 1e-6);
        const bst_control_servo_response *r = &given[k];
        bst_assert_close(r->step[0], 0.0, 1e-9);
        bst_assert_close(r->step[r->count - 1], 1.0, 1e-6);
        bst_assert_close(r->ramp_lag[r->count - 1], 0.0, 1e-6);
        /* half of a step is made within the time of the crossover at 6 Hz and of the shaper */
        double half_s = 0.0;
        while (r->step[(int)(half_s / r->dt_s + 0.5)] < 0.5) {
            half_s += r->dt_s;
        }
        assert_true(half_s > 0.01 && half_s < 0.1);
        free((double *)(uintptr_t)r->step);
        free((double *)(uintptr_t)r->ramp_lag);
    }
    assert_false(m->axis[2].tracked);
    assert_int_equal(m->axis[2].servo.loop.hints, 0);
    bst_loop_model_free(m);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* Sum of the squares of the third differences of an axis' response to a step. */
static double unevenness(const char *fraction, int axis) {
    const char *const sets[] = {GIMBAL "flexible/frequency_hz=[60,45,0]",
                                GIMBAL "flexible/inertia_fraction=[0.3,0.3,0.3]", fraction};
    bst_json *json;
    bst_scenario scenario;
    axes_given = 0;
    bst_loop_model *m = model_of_file("scenarios/full_plant.json", &json, &scenario, sets, 3);
    assert_int_equal(axes_given, 2);
    const double *x = given[axis].step;
    double sum = 0.0;
    for (int n = 3; n < given[axis].count; n++) {
        double bend = x[n] - 3.0 * x[n - 1] + 3.0 * x[n - 2] - x[n - 3];
        sum += bend * bend;
    }
    for (int k = 0; k < 2; k++) {
        free((double *)(uintptr_t)given[k].step);
        free((double *)(uintptr_t)given[k].ramp_lag);
    }
    bst_loop_model_free(m);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return sum;
}

/* The line of sight that follows the swinging part by that part's share of the inertia is the mean
 * over both, which the torque alone turns: its response is smoother than any other. */
static void the_mean_of_both_inertias_does_not_swing(void **state) {
    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        double mean = unevenness(GIMBAL "flexible/line_of_sight_fraction=[0.3,0.3,0.3]", axis);
        double none = unevenness(GIMBAL "flexible/line_of_sight_fraction=[0,0,0]", axis);
        double away = unevenness(GIMBAL "flexible/line_of_sight_fraction=[-0.3,-0.3,-0.3]", axis);
        double all = unevenness(GIMBAL "flexible/line_of_sight_fraction=[1,1,1]", axis);
        assert_true(mean < 0.5 * none && none < away && mean < 0.5 * all);
    }
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static void expect_margins(const cJSON *node, const bst_loop_margins *m) {
    const struct {
        const char *key;
        double value;
    } keys[] = {{"gain_margin_db", m->gain_margin_db},
                {"gain_reduction_margin_db", m->gain_reduction_db},
                {"phase_margin_deg", m->phase_margin_deg},
                {"delay_margin_s", m->delay_margin_s},
                {"sensitivity_peak", m->sensitivity_peak},
                {"sensitivity_peak_hz", m->sensitivity_peak_hz},
                {"crossover_hz", m->crossover_hz},
                {"phase_crossover_hz", m->phase_crossover_hz},
                {"bandwidth_hz", m->bandwidth_hz}};
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++) {
        bst_assert_close(number(node, keys[k].key), keys[k].value, 0);
    }
    assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(node, "stable")), m->stable);
}

static bst_loop_margins margins_of(double first) {
    return (bst_loop_margins){.stable = first < 500,
                              .gain_margin_db = first,
                              .gain_reduction_db = first + 1,
                              .phase_margin_deg = first + 2,
                              .delay_margin_s = first + 3,
                              .sensitivity_peak = first + 4,
                              .sensitivity_peak_hz = first + 5,
                              .crossover_hz = first + 6,
                              .phase_crossover_hz = first + 7,
                              .bandwidth_hz = first + 8};
}

static void every_key(void **state) {
    (void)state;
    bst_loop_model *m = calloc(1, sizeof *m);
    assert_non_null(m);
    m->observer_name = "eye";
    m->sensor_name = "camera";
    m->gimbal_type = "mount";
    m->compensator = "lead_lag";
    m->timing.period_s = 1.5;
    m->timing.exposure_s = 2.5;
    m->timing.frame_latency_s = 3.5;
    m->timing.command_delay_s = 4.5;
    m->axes = 2;
    m->bodies = 1;
    m->body[0].name = "x";
    m->body[0].margins = margins_of(100);
    for (int k = 0; k < 2; k++) {
        bst_loop_axis *a = &m->axis[k];
        a->name = k ? "inner" : "outer";
        a->tracked = true;
        a->servo.there = k == 1;
        a->margins = margins_of(200 + 20 * k);
        a->servo.margins = margins_of(600);
        a->prediction = (bst_loop_prediction){.rms_px = k ? 4.0 : 3.0,
                                              .jitter_px = 10 + k,
                                              .open_px = 20 + k,
                                              .above_px = 30 + k,
                                              .noise_px = 40 + k,
                                              .lag_px = 50 + k};
    }
    cJSON *root = bst_loop_json(m);
    bst_assert_close(number(root, "frame_period_s"), 1.5, 0);
    bst_assert_close(number(root, "exposure_s"), 2.5, 0);
    bst_assert_close(number(root, "frame_latency_s"), 3.5, 0);
    bst_assert_close(number(root, "command_delay_s"), 4.5, 0);
    bst_assert_close(number(root, "predicted_rms_radial_px"), 5.0, 1e-12);
    for (int k = 0; k < 2; k++) {
        const cJSON *node = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "axes"), k);
        expect_margins(node, &m->axis[k].margins);
        bst_assert_close(number(node, "predicted_rms_px"), 3.0 + k, 0);
        bst_assert_close(number(node, "jitter_left_rms_px"), 10 + k, 0);
        bst_assert_close(number(node, "jitter_open_rms_px"), 20 + k, 0);
        bst_assert_close(number(node, "jitter_above_half_frame_rate_rms_px"), 30 + k, 0);
        bst_assert_close(number(node, "frame_noise_rms_px"), 40 + k, 0);
        bst_assert_close(number(node, "drift_lag_px"), 50 + k, 0);
        const cJSON *servo = cJSON_GetObjectItem(node, "servo");
        assert_int_equal(servo != NULL, k);
        if (servo) {
            expect_margins(servo, &m->axis[1].servo.margins);
        }
    }
    expect_margins(cJSON_GetArrayItem(cJSON_GetObjectItem(root, "body"), 0), &m->body[0].margins);
    cJSON_Delete(root);
    m->compensator = NULL;
    m->bodies = 0;
    root = bst_loop_json(m);
    assert_string_equal(cJSON_GetObjectItem(root, "compensator")->valuestring, "none");
    assert_null(cJSON_GetObjectItem(root, "body"));
    assert_null(cJSON_GetObjectItem(root, "predicted_rms_radial_px"));
    cJSON_Delete(root);
    free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bands_of_the_jitter),
        cmocka_unit_test(bands_of_the_attitude),
        cmocka_unit_test(a_second_order_mount),
        cmocka_unit_test(the_body_by_axis),
        cmocka_unit_test(predictions_scale),
        cmocka_unit_test(response_and_gains),
        cmocka_unit_test(a_full_mount),
        cmocka_unit_test(the_mean_of_both_inertias_does_not_swing),
        cmocka_unit_test(every_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
