/* A command holds at the time at which it takes effect, at any latency: what the gimbal sees then
 * is on the aim, also when that is several frames and control periods later. */
#include "control/control.h"
#include "sim/onboard/knowledge.h"
#include "tests/test_support.h"

#define TICKS 1000

/* A line of sight of a close pass: 2 deg/s at 60 s, over a great circle. */
static bst_vec3 sight(double seconds) {
    double a = atan(2.0 * BST_DEG_RAD * (seconds - 60.0));
    return (bst_vec3){cos(a), 0.6 * sin(a), 0.8 * sin(a)};
}

static bst_status cue_direction_at(void *user, bst_ctx *ctx, double seconds, bool *valid,
                                   bst_vec3 *direction) {
    (void)user;
    (void)ctx;
    *valid = true;
    *direction = sight(seconds);
    return BST_OK;
}

static bst_status cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    *out = (bst_onboard_cue){.sigma_rad = 1e-3};
    out->rate_gcrf_radps =
        bst_vec3_scale(bst_vec3_sub(sight(seconds + 0.01), sight(seconds - 0.01)), 0.5 / 0.01);
    return cue_direction_at(user, ctx, seconds, &out->valid, &out->direction_gcrf);
}

/* Greatest distance between what a command says and the aim over the control period that it serves,
 * of a line of sight at its fastest and of one whose rate changes most (28 s on). */
static double worst(double latency_s, double period_s, bool acceleration) {
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.strategy = BST_CONTROL_RATE;
    config.command_latency_s = latency_s;
    config.guidance.acceleration_feed_forward = acceleration;
    const bst_control_env env = {.tick_rate_hz = TICKS,
                                 .pixel_rad = 10 * BST_ARCSEC_RAD,
                                 .width_px = 1024,
                                 .height_px = 1024,
                                 .cue_at = cue_at,
                                 .cue_direction_at = cue_direction_at};
    static bst_control control;
    bst_assert_ok(&ctx, bst_control_init(&ctx, &control, &config, &env));
    const bst_nav_telemetry nav = {.sun_m = {1.5e11, 0, 0}}; /* at rest: no aberration */
    bst_control_telemetry(&control, NULL, &nav);
    double off = 0.0;
    for (int64_t tick = 40 * TICKS; tick < 100 * TICKS; tick += (int64_t)(period_s * TICKS)) {
        bool commanded;
        bst_los_command c;
        bst_control_status status;
        bst_assert_ok(&ctx, bst_control_update(&ctx, &control, tick, &commanded, &c, &status));
        assert_true(commanded);
        assert_int_equal(c.tick, tick + (int64_t)llround(latency_s * TICKS));
        for (int k = 0; k <= 10; k++) {
            double t = period_s * k / 10;
            bst_vec3 d = bst_vec3_axpy(c.direction_gcrf, t, c.rate_gcrf_radps);
            d = bst_vec3_axpy(d, 0.5 * t * t, c.accel_gcrf_radps2);
            off = fmax(off, bst_vec3_angle(d, sight((double)c.tick / TICKS + t)));
        }
    }
    return off;
}

static void on_the_aim_at_any_latency(void **state) {
    (void)state;
    const double latencies_s[] = {0.0, 0.05, 0.35, 1.7, 20.0};
    const double w = 2.0 * BST_DEG_RAD;
    for (int i = 0; i < 5; i++) {
        /* straight on for 50 ms: half the greatest acceleration, 0.65 w^2, times its square; the
         * rate is that of a difference over half a second, off by its third derivative, 2 w^3,
         * times 0.01 */
        double plain = worst(latencies_s[i], 0.05, false);
        assert_true(plain < 1.01 * (0.5 * 0.65 * w * w * 0.0025 + 0.05 * 2.1 * w * w * w * 0.0105));
        /* with the acceleration a control period of half a second will do: third derivatives are
         * left, 2 w^3 (0.125 / 6 + 0.5 * 0.0104) */
        double curved = worst(latencies_s[i], 0.5, true);
        assert_true(curved < 1.05 * 2.0 * w * w * w * (0.125 / 6.0 + 0.5 * 0.0105));
        assert_true(worst(latencies_s[i], 0.5, false) > 5.0 * curved);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(on_the_aim_at_any_latency)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
