#include "gimbal/attitude_filter.h"
#include "gimbal/attitude_sensors.h"
#include "sim/core/symmetric.h"
#include "tests/test_support.h"

#include "gimbal/spacecraft_config.h"

static bst_ctx ctx;

static bst_gyro_config gyro_config(double arw, double rrw) {
    bst_gyro_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_gyro_config_table, &c));
    c.angle_random_walk_deg_rth = arw;
    c.rate_random_walk_deg_rth3 = rrw;
    return c;
}

static bst_star_tracker_config tracker_config(double across, double about) {
    bst_star_tracker_config c = {.axis = {0.3, -0.5, 0.8},
                                 .noise_arcsec = across,
                                 .noise_about_axis_arcsec = about,
                                 .rate_limit_degps = 10.0};
    return c;
}

static bst_quat turned(bst_quat q, bst_vec3 r) {
    return bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(r, -1.0)), q));
}

/* Allan variance of the rate: v^2 / t from the angle walk, u^2 t / 3 from the rate walk
 * (Farrenkopf's gyro; IEEE Std 952). */
static void test_allan_deviation(void **state) {
    (void)state;
    enum { SAMPLES = 1 << 17 };
    double dt = 0.1;
    bst_gyro_config c = gyro_config(0.02, 3.0);
    bst_gyro gyro;
    bst_gyro_init(&gyro, &c, dt, bst_rng_make_key(1, 0, "a", "gyro"));
    double *angle = malloc((SAMPLES + 1) * sizeof *angle);
    assert_non_null(angle);
    angle[0] = 0.0;
    for (int n = 0; n < SAMPLES; n++) {
        angle[n + 1] = angle[n] + bst_gyro_measure(&gyro, (bst_vec3){0, 0, 0}).y;
    }
    for (int m = 1; m <= 4096; m *= 4) {
        double sum = 0.0, t = m * dt;
        int count = 0;
        for (int n = 0; n + 2 * m <= SAMPLES; n++, count++) {
            double d = angle[n + 2 * m] - 2.0 * angle[n + m] + angle[n];
            sum += d * d;
        }
        double variance = sum / (2.0 * t * t * count);
        double v = gyro.angle_walk, u = gyro.rate_walk;
        double expected = v * v / t + u * u * t / 3.0;
        /* relative sigma of an Allan variance of N / m independent terms: about sqrt(2 m / N) */
        double sigma = sqrt(2.0 * m / SAMPLES);
        bst_assert_close(variance / expected, 1.0, 4.0 * sigma + 0.01);
    }
    free(angle);
}

static void test_tracker_noise(void **state) {
    (void)state;
    bst_star_tracker_config c = tracker_config(5.0, 40.0);
    bst_star_tracker tracker;
    bst_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_quat q = bst_quat_unit((bst_quat){0.4, 0.2, -0.7, 0.5});
    enum { N = 20000 };
    double sum[3][3] = {{0}};
    for (int n = 0; n < N; n++) {
        bst_vec3 e = bst_attitude_error(bst_star_tracker_measure(&tracker, n, q), q);
        double v[3] = {e.x, e.y, e.z};
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                sum[i][j] += v[i] * v[j] / N;
            }
        }
    }
    bst_mat3 expected = bst_star_tracker_covariance(&tracker);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { /* 4 sigma of a covariance of N draws */
            double size = sqrt(expected.m[i][i] * expected.m[j][j]);
            bst_assert_close(sum[i][j], expected.m[i][j], 4.0 * size * sqrt(2.0 / N));
        }
    }
    /* the alignment error turns what is measured by just that */
    c.alignment_arcsec[1] = 100.0;
    c.noise_arcsec = c.noise_about_axis_arcsec = 1e-6;
    bst_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_vec3 e = bst_attitude_error(bst_star_tracker_measure(&tracker, 0, q), q);
    bst_assert_close(e.y / BST_ARCSEC_RAD, 100.0, 1e-5);
    bst_assert_close(e.x / BST_ARCSEC_RAD, 0.0, 1e-5);
}

static void test_tracker_blind(void **state) {
    (void)state;
    bst_star_tracker_config c = tracker_config(1, 1);
    c.axis[0] = c.axis[1] = 0.0;
    c.sun_exclusion_deg = 30.0;
    c.earth_exclusion_deg = 20.0;
    c.outage_s[0] = 100.0;
    c.outage_s[1] = 200.0;
    bst_star_tracker tracker;
    bst_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_vec3 zero = {0, 0, 0}, place = {-7e6, 0, 0}, sun = {0, -1.5e11, 0};
    bst_quat q = BST_QUAT_IDENTITY; /* looks along z */
    assert_true(bst_star_tracker_sees(&tracker, 0, q, zero, place, sun));
    assert_false(bst_star_tracker_sees(&tracker, 100.0, q, zero, place, sun));
    assert_true(bst_star_tracker_sees(&tracker, 200.0, q, zero, place, sun));
    assert_false(bst_star_tracker_sees(&tracker, 0, q, (bst_vec3){0.2, 0, 0}, place, sun));
    bst_vec3 near = {0, sin(29.9 * BST_DEG_RAD), cos(29.9 * BST_DEG_RAD)};
    bst_vec3 far = {0, sin(30.1 * BST_DEG_RAD), cos(30.1 * BST_DEG_RAD)};
    assert_false(bst_star_tracker_sees(&tracker, 0, q, zero, place, bst_vec3_scale(near, 1.5e11)));
    assert_true(bst_star_tracker_sees(&tracker, 0, q, zero, place, bst_vec3_scale(far, 1.5e11)));
    /* from 7000 km the limb is 65.66 deg from the centre: the axis must be 85.66 deg off it */
    double angle = asin(6378.137 / 7000.0) + 20.0 * BST_DEG_RAD;
    for (int i = 0; i < 2; i++) {
        double a = angle + (i ? 1e-6 : -1e-6);
        bst_vec3 down = {sin(a), 0, cos(a)};
        assert_int_equal(
            bst_star_tracker_sees(&tracker, 0, q, zero, bst_vec3_scale(down, -7e6), sun), i);
    }
}

/* Riccati's recursion of the code comes to Farrenkopf's closed form. */
static void test_steady_state(void **state) {
    (void)state;
    static const double cases[3][4] = {
        {3e-6, 1e-7, 1.5e-5, 0.25}, {1e-8, 1e-8, 1e-4, 1.0}, {1e-5, 1e-6, 1e-6, 0.1}};
    for (int i = 0; i < 3; i++) {
        double v = cases[i][0], u = cases[i][1], sigma = cases[i][2], dt = cases[i][3];
        bst_attitude_filter f;
        bst_attitude_filter_init(&f, BST_QUAT_IDENTITY, 10.0 * sigma, 100.0 * sigma, v, u);
        bst_mat3 noise = {{{sigma * sigma, 0, 0}, {0, sigma * sigma, 0}, {0, 0, sigma * sigma}}};
        double before = 0.0;
        for (int n = 0; n < 20000; n++) {
            bst_attitude_filter_propagate(&f, (bst_vec3){0, 0, 0}, dt);
            before = sqrt(f.covariance[0][0]);
            bst_attitude_filter_update(&f, (bst_vec3){0, 0, 0}, 0.0, BST_QUAT_IDENTITY, &noise,
                                       NULL);
        }
        bst_attitude_steady s = bst_attitude_steady_state(v, u, sigma, dt);
        /* rounding of the recursion, which is 50 and more of its slowest time constants long */
        bst_assert_close(before / s.before_rad, 1.0, 1e-6);
        bst_assert_close(sqrt(f.covariance[0][0]) / s.after_rad, 1.0, 1e-6);
        bst_assert_close(sqrt(f.covariance[4][4]) / s.bias_radps, 1.0, 1e-6);
    }
}

/* A million updates with a tumbling body, anisotropic noise and late measurements leave the
 * covariance symmetric and positive definite. */
static void test_a_million_updates(void **state) {
    (void)state;
    bst_attitude_filter f;
    bst_attitude_filter_init(&f, BST_QUAT_IDENTITY, 1.0, 1e-4, 1e-8, 1e-12);
    bst_star_tracker_config c = tracker_config(0.01, 1000.0);
    bst_star_tracker tracker;
    bst_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_mat3 noise = bst_star_tracker_covariance(&tracker);
    bst_vec3 turn = {0.003, -0.002, 0.001};
    bst_quat late = bst_quat_from_rotvec(bst_vec3_scale(turn, -2.0));
    for (int n = 0; n < 1000000; n++) {
        bst_attitude_filter_propagate(&f, turn, 0.1);
        bst_attitude_filter_update(&f, (bst_vec3){0, 0, 0}, 0.2, late, &noise, NULL);
        if (n % 50000 == 0 || n == 999999) {
            double lower[36], inverse[36];
            for (int i = 0; i < 6; i++) {
                for (int j = 0; j < 6; j++) {
                    assert_true(f.covariance[i][j] == f.covariance[j][i]);
                    lower[6 * i + j] = f.covariance[i][j];
                }
            }
            assert_true(bst_symmetric_invert(6, lower, inverse)); /* Cholesky succeeds */
        }
    }
}

/* e' P^-1 e of a filter that runs on the sensors' own models: 6 on average. */
static double nees(const bst_attitude_filter *f, bst_quat truth, bst_vec3 bias) {
    bst_vec3 e = bst_attitude_error(truth, f->q_body_from_gcrf),
             b = bst_vec3_sub(bias, f->bias_radps);
    double x[6] = {e.x, e.y, e.z, b.x, b.y, b.z}, inverse[36], sum = 0.0;
    assert_true(bst_symmetric_invert(6, &f->covariance[0][0], inverse));
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            sum += x[i] * inverse[6 * i + j] * x[j];
        }
    }
    return sum;
}

static void test_consistency(void **state) {
    (void)state;
    enum { RUNS = 100, SAMPLES = 3000, EVERY = 5, TIMES = 3 };
    double dt = 0.05, total[TIMES] = {0};
    bst_gyro_config gc = gyro_config(0.02, 0.5);
    gc.bias_sigma_degph = 5.0;
    bst_star_tracker_config tc = tracker_config(6.0, 45.0);
    for (int run = 0; run < RUNS; run++) {
        bst_gyro gyro;
        bst_star_tracker tracker;
        bst_gyro_init(&gyro, &gc, dt, bst_rng_make_key(3, (uint64_t)run, "a", "gyro"));
        bst_star_tracker_init(&tracker, &tc, bst_rng_make_key(3, (uint64_t)run, "a", "tracker"));
        bst_mat3 noise = bst_star_tracker_covariance(&tracker);
        double a[2], b[2], sigma = 60.0 * BST_ARCSEC_RAD;
        bst_rng_key key = bst_rng_make_key(3, (uint64_t)run, "a", "start");
        bst_rng_normal2(key, 0, 0, a);
        bst_rng_normal2(key, 0, 1, b);
        bst_quat q = bst_quat_unit((bst_quat){0.1, 0.2, 0.3, 0.9});
        bst_attitude_filter f;
        bst_attitude_filter_init(&f, turned(q, bst_vec3_scale((bst_vec3){a[0], a[1], b[0]}, sigma)),
                                 sigma, gc.bias_sigma_degph * BST_DEG_RAD / 3600.0, gyro.angle_walk,
                                 gyro.rate_walk);
        for (int n = 1; n <= SAMPLES; n++) {
            /* a turn whose axis wanders, 0.5 deg/s */
            double t = n * dt;
            bst_vec3 turn = bst_vec3_scale((bst_vec3){cos(0.01 * t), sin(0.013 * t), 0.5},
                                           0.5 * BST_DEG_RAD * dt);
            q = turned(q, turn);
            bst_attitude_filter_propagate(&f, bst_gyro_measure(&gyro, turn), dt);
            if (n % EVERY == 0) {
                bst_quat seen = bst_star_tracker_measure(&tracker, n, q);
                bst_attitude_filter_update(&f, bst_attitude_error(seen, f.q_body_from_gcrf), 0.0,
                                           BST_QUAT_IDENTITY, &noise, NULL);
            }
            for (int k = 0; k < TIMES; k++) {
                if (n == (k == 0 ? 20 : k == 1 ? 400 : SAMPLES)) {
                    total[k] += nees(&f, q, gyro.bias_radps) / RUNS;
                }
            }
        }
    }
    /* the mean of 100 chi-square numbers of 6 degrees: sigma sqrt(12 / 100); 3.3 sigma (0.1 %) */
    for (int k = 0; k < TIMES; k++) {
        print_message("mean NEES %.2f of 6\n", total[k]);
        bst_assert_close(total[k], 6.0, 3.3 * sqrt(12.0 / RUNS));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_allan_deviation),   cmocka_unit_test(test_tracker_noise),
        cmocka_unit_test(test_tracker_blind),     cmocka_unit_test(test_steady_state),
        cmocka_unit_test(test_a_million_updates), cmocka_unit_test(test_consistency)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
