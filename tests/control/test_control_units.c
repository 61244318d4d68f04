/* What a controller gives its parts when it begins: each setting in the unit of its part, from its
 * own key. */
#include "control/control.h"
#include "tests/test_support.h"

static const double PIXEL_RAD = 4.0 * BST_ARCSEC_RAD, RATE_HZ = 250.0;

static void init(bst_control *control, int compensator, bool compensates) {
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    config.command_latency_s = 0.032;
    config.compensate_attitude = compensates;
    config.compensator.type = compensator;
    config.compensator.gain_scale = 1.25;
    config.compensator.delay_s = 0.4;
    config.servo_lag_s = 0.011;
    config.disturbance_px_rms = 0.6;
    config.disturbance_cutoff_hz = 0.07;
    config.fix_sigma_floor_px = 0.03;
    config.attitude_sigma_arcsec = 9.0;
    config.drift_sigma_arcsec_per_s = 0.2;
    config.arrival_tolerance_px = 5.0;
    const bst_control_env env = {.tick_rate_hz = RATE_HZ,
                                 .pixel_rad = PIXEL_RAD,
                                 .width_px = 640,
                                 .height_px = 480,
                                 .frame_exposure_s = 0.2,
                                 .frame_period_s = 0.5,
                                 .frame_latency_s = 0.3};
    bst_assert_ok(&ctx, bst_control_init(&ctx, control, &config, &env));
    bst_config_free(bst_control_config_table, &config);
}

static void check_common(const bst_control *c) {
    assert_int_equal(c->latency_ticks, 8);
    const bst_pointing_error *e = &c->pointing_error;
    bst_assert_close(e->sigma_floor_rad / BST_ARCSEC_RAD, 0.12, 1e-12);
    bst_assert_close(e->initial_sigma_rad / BST_ARCSEC_RAD, 9.0, 1e-12);
    bst_assert_close(e->initial_rate_sigma_radps / BST_ARCSEC_RAD, 0.2, 1e-12);
    assert_true(c->guidance.env.tick_rate_hz == RATE_HZ && c->guidance.env.pixel_rad == PIXEL_RAD);
    assert_ptr_equal(c->guidance.env.user, c);
}

/* The density of white acceleration with the error of a disturbance up to a frequency. */
static void without_compensator(void **state) {
    (void)state;
    static bst_control c;
    init(&c, BST_CONTROL_OBSERVER, false);
    check_common(&c);
    double variance = pow(0.6 * PIXEL_RAD, 2) / 2.0; /* of each of two axes */
    bst_assert_close(c.pointing_error.density / (variance * pow(2.0 * BST_PI * 0.07, 3) / 4.0), 1.0,
                     1e-12);
    assert_false(c.model_error.active);
}

static void with_observer(void **state) {
    (void)state;
    static bst_control c;
    init(&c, BST_CONTROL_OBSERVER, true);
    check_common(&c);
    const bst_model_error *m = &c.model_error;
    assert_true(m->active && m->gain == 1.25 && m->late_s == 0.4);
    assert_true(m->exposure_s == 0.2 && m->tick_rate_hz == RATE_HZ);
    bst_assert_close(m->jump_rad / BST_ARCSEC_RAD, 20.0, 1e-12);
}

static void with_image_error(void **state) {
    (void)state;
    static bst_control c;
    init(&c, BST_COMPENSATOR_PID, true);
    check_common(&c);
    const bst_image_loop_env *e = &c.image_loop.env;
    assert_true(e->tick_rate_hz == RATE_HZ && e->frame_period_s == 0.5 &&
                e->frame_exposure_s == 0.2 && e->frame_latency_s == 0.3 &&
                e->command_latency_s == 0.032 && e->servo_lag_s == 0.011);
    bst_assert_close(e->jump_rad / BST_ARCSEC_RAD, 20.0, 1e-12);
    assert_false(c.model_error.active);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(without_compensator),
                                       cmocka_unit_test(with_observer),
                                       cmocka_unit_test(with_image_error)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
