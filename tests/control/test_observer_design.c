/* Default gains of the observer: margins at frame periods from 0.2 to 5 s and latencies from a
 * tenth of a period to ten, by the loop with the mount's true response. */
#include "control/loop/observer_design.h"

#include "boresight/vec.h"
#include "control/control.h"
#include "gimbal/mount/axis.h"
#include "tests/test_support.h"

#define DT 1e-3
enum { RESPONSE = 1500 };
/* So small that the axis meets no limit. */
#define TINY 1e-9

/* of second_order by default */
static const bst_axis_spec spec = {.rate_limit_radps = 2 * BST_DEG_RAD,
                                   .accel_limit_radps2 = 4 * BST_DEG_RAD,
                                   .natural_frequency_radps = 2 * BST_PI * 8.0,
                                   .damping = 0.7,
                                   .dt_s = DT};

static double step_of[RESPONSE], lag_of[RESPONSE];

static bst_control_servo_response default_servo(void) {
    bst_axis axis;
    bst_axis_init(&axis, &spec);
    for (int n = 0; n < RESPONSE; n++) {
        bst_axis_step(&axis, TINY, 0.0, 0.0);
        step_of[n] = axis.angle_rad / TINY;
    }
    bst_axis_init(&axis, &spec);
    for (int n = 0; n < RESPONSE; n++) {
        bst_axis_step(&axis, TINY * n * DT, TINY, 0.0);
        lag_of[n] = n * DT - axis.angle_rad / TINY;
    }
    return (bst_control_servo_response){
        .dt_s = DT, .count = RESPONSE, .step = step_of, .ramp_lag = lag_of};
}

/* As a scenario leaves them. */
static bst_control_config defaults(void) {
    bst_ctx ctx = {0};
    bst_control_config config = {0};
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    return config;
}

static bst_loop_margins margins_of(const bst_control_config *config, double period, double exposure,
                                   double latency, const bst_control_servo_response *servo,
                                   bool *lowered) {
    bst_ctx ctx = {0};
    const bst_image_loop_env env = {.tick_rate_hz = 1000.0,
                                    .frame_period_s = period,
                                    .frame_exposure_s = exposure,
                                    .frame_latency_s = latency - config->command_latency_s,
                                    .command_latency_s = config->command_latency_s,
                                    .servo_lag_s = config->servo_lag_s};
    bst_control_config plain = *config;
    plain.robust_observer = false;
    double asked, density;
    bst_assert_ok(&ctx, bst_control_observer_density(&ctx, &plain, &env, 1.0, NULL, &asked));
    bst_assert_ok(&ctx, bst_control_observer_density(&ctx, config, &env, 1.0, NULL, &density));
    assert_true(density <= asked && density > 0.0);
    *lowered = density < asked;
    bst_tracking_observer observer = {.motion_gain = 1.0};
    bst_tracking_observer_gains(density, config->fix_sigma_floor_px, period, &observer.alpha,
                                &observer.beta);
    double effect = 0.5 * exposure + latency;
    const bst_tracking_timing timing = {period, exposure, effect - config->command_latency_s,
                                        effect, effect};
    bst_tracking_loop *tracking;
    bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &timing, servo, NULL, &observer, &tracking));
    bst_loop loop = bst_tracking_as_loop(tracking);
    bst_loop_margins m;
    bst_assert_ok(&ctx, bst_loop_analyse(&ctx, &loop, &m));
    bst_tracking_loop_free(tracking);
    return m;
}

static void test_default_margins(void **state) {
    (void)state;
    const bst_control_servo_response servo = default_servo();
    const bst_control_config config = defaults();
    static const double periods[] = {0.2, 1.0, 5.0};
    static const double latencies[] = {0.1, 0.5, 0.8, 1.3, 10.0};
    int lowered_in = 0;
    for (size_t p = 0; p < sizeof periods / sizeof *periods; p++) {
        for (size_t l = 0; l < sizeof latencies / sizeof *latencies; l++) {
            for (int short_one = 0; short_one < 2; short_one++) {
                double exposure = periods[p] * (short_one ? 0.1 : 0.9);
                double latency = fmax(periods[p] * latencies[l], config.command_latency_s);
                bool lowered;
                bst_loop_margins m =
                    margins_of(&config, periods[p], exposure, latency, &servo, &lowered);
                lowered_in += lowered;
                if (bst_loop_verdict(&m)) {
                    fail_msg("every %g s, exposed %g s, %g s late: %g dB, %g deg, peak %g",
                             periods[p], exposure, latency, m.gain_margin_db, m.phase_margin_deg,
                             m.sensitivity_peak);
                }
            }
        }
    }
    /* short latencies keep the gains of the disturbance, long ones do not */
    assert_in_range(lowered_in, 5, 25);
}

static void test_as_asked(void **state) {
    (void)state;
    const bst_control_servo_response servo = default_servo();
    bst_control_config config = defaults();
    config.robust_observer = false;
    bool lowered;
    bst_loop_margins m = margins_of(&config, 1.0, 0.5, 5.0, &servo, &lowered);
    assert_false(lowered);
    assert_true(m.stable); /* telemetry is right: there is no loop to be unstable */
    assert_string_equal(bst_loop_verdict(&m), "has thin margins");
}

/* A frame arrives half an exposure and its latency after its middle, and acts a command's latency
 * later. */
static void test_timing(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_control_config config = defaults();
    config.disturbance_px_rms = 3.0;
    const bst_image_loop_env env = {.tick_rate_hz = 1000.0,
                                    .frame_period_s = 1.0,
                                    .frame_exposure_s = 0.7,
                                    .frame_latency_s = 0.9,
                                    .command_latency_s = 0.45,
                                    .servo_lag_s = 0.03};
    const double pixel = 2e-5;
    bst_control_config plain = config;
    plain.robust_observer = false;
    bst_observer_request request = {
        .timing = {1.0, 0.7, 0.35 + 0.9, 0.35 + 0.9 + 0.45, 0.35 + 0.9 + 0.45},
        .servo_lag_s = 0.03,
        .sigma = config.fix_sigma_floor_px * pixel};
    double density, expected;
    bst_assert_ok(&ctx,
                  bst_control_observer_density(&ctx, &plain, &env, pixel, NULL, &request.density));
    bst_assert_ok(&ctx, bst_control_observer_density(&ctx, &config, &env, pixel, NULL, &density));
    bst_assert_ok(&ctx, bst_observer_design(&ctx, &request, NULL, &expected));
    assert_true(expected < 0.5 * request.density); /* the margins bind */
    bst_assert_close(density, expected, 1e-12 * expected);
    /* half an exposure more would not be the same */
    request.timing.arrival_s += 0.35;
    request.timing.effect_s += 0.35;
    request.timing.switch_s += 0.35;
    bst_assert_ok(&ctx, bst_observer_design(&ctx, &request, NULL, &expected));
    assert_true(expected < 0.9 * density);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_default_margins),
        cmocka_unit_test(test_as_asked),
        cmocka_unit_test(test_timing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
