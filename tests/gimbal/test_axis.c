/* One axis: the servo against the closed form, limits, slew time, lag. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "gimbal/mount/axis.h"
#include "tests/test_support.h"

static bst_axis_spec spec_with(double damping) {
    return (bst_axis_spec){.rate_limit_radps = 2.0 * BST_DEG_RAD,
                           .accel_limit_radps2 = 4.0 * BST_DEG_RAD,
                           .natural_frequency_radps = 2.0 * BST_PI * 8.0,
                           .damping = damping,
                           .dt_s = 1e-3};
}

/* Free decay from e0 at rest of x'' + 2 d w x' + w^2 x = 0 (textbook solutions). */
static double free_decay(double e0, double w, double d, double t) {
    if (d < 1.0) {
        double wd = w * sqrt(1.0 - d * d);
        return e0 * exp(-d * w * t) * (cos(wd * t) + d * w / wd * sin(wd * t));
    }
    if (d == 1.0) {
        return e0 * exp(-w * t) * (1.0 + w * t);
    }
    double r = w * sqrt(d * d - 1.0), s1 = -d * w + r, s2 = -d * w - r;
    return e0 * (s1 * exp(s2 * t) - s2 * exp(s1 * t)) / (s1 - s2);
}

static void servo_follows_the_closed_form(void **state) {
    (void)state;
    /* the exact discretisation: at a step of 0.4 periods of the undamped swing as at any other */
    const double dampings[] = {0.1, 0.7, 1.0, 2.5}, steps_s[] = {1e-3, 0.05};
    for (int i = 0; i < 8; i++) {
        double damping = dampings[i % 4];
        bst_axis axis;
        bst_axis_spec spec = spec_with(damping);
        spec.dt_s = steps_s[i / 4];
        bst_axis_init(&axis, &spec);
        axis.angle_rad = 1e-6; /* small: no limit is met */
        for (int n = 1; n * spec.dt_s <= 0.5; n++) {
            bst_axis_step(&axis, 0.0, 0.0, 0.0);
            double expected =
                free_decay(1e-6, spec.natural_frequency_radps, damping, n * spec.dt_s);
            /* rounding of 500 multiplications */
            bst_assert_close(axis.angle_rad, expected, 1e-6 * 1e-11);
        }
    }
}

/* Slews to `target_rad` and returns the time after which the axis stays within 3 arcsec. */
static double slew(double target_rad, double target_radps, double noise_rad) {
    bst_axis axis;
    bst_axis_spec spec = spec_with(0.7);
    bst_axis_init(&axis, &spec);
    bst_rng_key key = bst_rng_make_key(1, 0, "slew", "encoder");
    double last_outside = 0.0, before = 0.0;
    for (int n = 1; n <= 60000; n++) {
        double t = n * spec.dt_s;
        bst_axis_step(&axis, target_rad + target_radps * t, target_radps,
                      noise_rad * bst_rng_normal(key, (uint64_t)n, 0));
        /* limits hold to rounding, at every step */
        assert_true(fabs(axis.rate_radps) <= spec.rate_limit_radps * (1 + 1e-9));
        assert_true(fabs(axis.rate_radps - before) / spec.dt_s <=
                    spec.accel_limit_radps2 * (1 + 1e-9));
        before = axis.rate_radps;
        if (fabs(axis.angle_rad - target_rad - target_radps * t) > 3.0 * BST_ARCSEC_RAD) {
            last_outside = t;
        }
    }
    return last_outside;
}

static void slews_respect_limits_and_take_their_time(void **state) {
    (void)state;
    /* time-optimal: 2 sqrt(0.6 / 4) = 0.77 s; shaper and servo may add 0.7 s */
    double t = slew(0.6 * BST_DEG_RAD, 50.0 * BST_ARCSEC_RAD, 0.0);
    assert_true(t > 0.77 && t < 1.5);
    t = slew(0.6 * BST_DEG_RAD, 50.0 * BST_ARCSEC_RAD, 0.3 * BST_ARCSEC_RAD);
    assert_true(t > 0.77 && t < 1.5);
    /* 90 / 2 + 2 / 4 = 45.5 s at best, 48 s at 0.95 of the limit */
    t = slew(-90.0 * BST_DEG_RAD, 0.0, 0.0);
    assert_true(t > 45.5 && t < 50.0);
}

static void constant_rate_leaves_no_lag(void **state) {
    (void)state;
    bst_axis axis;
    bst_axis_spec spec = spec_with(0.7);
    bst_axis_init(&axis, &spec);
    double rate = 0.3 * BST_DEG_RAD;
    for (int n = 1; n <= 10000; n++) {
        bst_axis_step(&axis, rate * n * spec.dt_s, rate, 0.0);
    }
    /* ten seconds are 60 time constants of the shaper: rounding is what is left */
    bst_assert_close(axis.angle_rad, rate * 10.0, 1e-12);
    bst_assert_close(axis.rate_radps, rate, 1e-11);
    assert_false(axis.limited);
}

/* White encoder noise through the servo: variance sigma^2 * h * wn * (1 + 4 d^2) / (4 d) would hold
 * for noise in both loops; in position only it is sigma^2 h wn / (4 d). */
static void encoder_noise_is_filtered_as_the_servo_says(void **state) {
    (void)state;
    bst_axis axis;
    bst_axis_spec spec = spec_with(0.7);
    bst_axis_init(&axis, &spec);
    bst_rng_key key = bst_rng_make_key(3, 0, "noise", "encoder");
    double sigma = 1e-6, sum = 0.0;
    int steps = 400000;
    for (int n = 0; n < steps; n++) {
        bst_axis_step(&axis, 0.0, 0.0, sigma * bst_rng_normal(key, (uint64_t)n, 0));
        sum += axis.angle_rad * axis.angle_rad;
    }
    double expected = sigma * sqrt(spec.dt_s * spec.natural_frequency_radps / (4.0 * 0.7));
    /* 400 s of a process of about 10 Hz: 4000 independent values, 1.1 % of a standard deviation;
     * the step is 1/20 of a radian of the servo: 2 % */
    bst_assert_close(sqrt(sum / steps) / expected, 1.0, 0.06);
}

/* The acceleration is constant within a step: the reference moves by the mean of both rates. */
static void the_reference_moves_by_its_mean_rate(void **state) {
    (void)state;
    const double h = 0.02;
    const bst_axis_spec spec = {.rate_limit_radps = 0.05,
                                .accel_limit_radps2 = 0.02,
                                .natural_frequency_radps = 6,
                                .damping = 0.7,
                                .dt_s = h};
    bst_axis axis;
    bst_axis_init(&axis, &spec);
    double x = 0.0, v = 0.0;
    for (int k = 0; k < 600; k++) {
        bst_axis_step(&axis, 0.3, 0.0, 0.0);
        bst_assert_close(axis.reference_rad - x, 0.5 * (v + axis.reference_radps) * h, 1e-15);
        x = axis.reference_rad;
        v = axis.reference_radps;
    }
    bst_assert_close(x, 0.3, 1e-6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(servo_follows_the_closed_form),
        cmocka_unit_test(slews_respect_limits_and_take_their_time),
        cmocka_unit_test(constant_rate_leaves_no_lag),
        cmocka_unit_test(encoder_noise_is_filtered_as_the_servo_says),
        cmocka_unit_test(the_reference_moves_by_its_mean_rate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
