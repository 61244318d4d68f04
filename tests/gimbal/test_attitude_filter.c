#include "gimbal/spacecraft/attitude_filter.h"
#include "gimbal/spacecraft/attitude_sensors.h"
#include "gimbal/spacecraft/attitude_warm_up.h"
#include "sim/core/symmetric.h"
#include "tests/test_support.h"

#include "gimbal/spacecraft/spacecraft_config.h"

static bst_ctx ctx;

static bst_spacecraft_gyro_config gyro_config(double arw, double rrw) {
    bst_spacecraft_gyro_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_gyro_config_table, &c));
    c.angle_random_walk_deg_rth = arw;
    c.rate_random_walk_deg_rth3 = rrw;
    return c;
}

static bst_spacecraft_star_tracker_config tracker_config(double across, double about) {
    bst_spacecraft_star_tracker_config c = {.axis = {0.3, -0.5, 0.8},
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
    bst_spacecraft_gyro_config c = gyro_config(0.02, 3.0);
    bst_spacecraft_gyro gyro;
    bst_spacecraft_gyro_init(&gyro, &c, dt, bst_rng_make_key(1, 0, "a", "gyro"));
    double *angle = malloc((SAMPLES + 1) * sizeof *angle);
    assert_non_null(angle);
    angle[0] = 0.0;
    for (int n = 0; n < SAMPLES; n++) {
        angle[n + 1] = angle[n] + bst_spacecraft_gyro_measure(&gyro, (bst_vec3){0, 0, 0}).y;
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
    bst_spacecraft_star_tracker_config c = tracker_config(5.0, 40.0);
    bst_spacecraft_star_tracker tracker;
    bst_spacecraft_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_quat q = bst_quat_unit((bst_quat){0.4, 0.2, -0.7, 0.5});
    enum { N = 20000 };
    double sum[3][3] = {{0}};
    for (int n = 0; n < N; n++) {
        bst_vec3 e =
            bst_attitude_filter_error(bst_spacecraft_star_tracker_measure(&tracker, n, q), q);
        double v[3] = {e.x, e.y, e.z};
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                sum[i][j] += v[i] * v[j] / N;
            }
        }
    }
    bst_mat3 expected = bst_spacecraft_star_tracker_covariance(&tracker);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { /* 4 sigma of a covariance of N draws */
            double size = sqrt(expected.m[i][i] * expected.m[j][j]);
            bst_assert_close(sum[i][j], expected.m[i][j], 4.0 * size * sqrt(2.0 / N));
        }
    }
    /* the alignment error turns what is measured by just that */
    c.misalignment_arcsec[1] = 100.0;
    c.noise_arcsec = c.noise_about_axis_arcsec = 1e-6;
    bst_spacecraft_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_vec3 e = bst_attitude_filter_error(bst_spacecraft_star_tracker_measure(&tracker, 0, q), q);
    bst_assert_close(e.y / BST_ARCSEC_RAD, 100.0, 1e-5);
    bst_assert_close(e.x / BST_ARCSEC_RAD, 0.0, 1e-5);
}

static void test_tracker_blind(void **state) {
    (void)state;
    bst_spacecraft_star_tracker_config c = tracker_config(1, 1);
    c.axis[0] = c.axis[1] = 0.0;
    c.sun_exclusion_deg = 30.0;
    c.earth_exclusion_deg = 20.0;
    c.outage_s[0] = 100.0;
    c.outage_s[1] = 200.0;
    bst_spacecraft_star_tracker tracker;
    bst_spacecraft_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_vec3 zero = {0, 0, 0}, place = {-7e6, 0, 0}, sun = {0, -1.5e11, 0};
    bst_quat q = BST_QUAT_IDENTITY; /* looks along z */
    assert_true(bst_spacecraft_star_tracker_sees(&tracker, 0, q, zero, place, sun));
    assert_false(bst_spacecraft_star_tracker_sees(&tracker, 100.0, q, zero, place, sun));
    assert_true(bst_spacecraft_star_tracker_sees(&tracker, 200.0, q, zero, place, sun));
    assert_false(
        bst_spacecraft_star_tracker_sees(&tracker, 0, q, (bst_vec3){0.2, 0, 0}, place, sun));
    bst_vec3 near = {0, sin(29.9 * BST_DEG_RAD), cos(29.9 * BST_DEG_RAD)};
    bst_vec3 far = {0, sin(30.1 * BST_DEG_RAD), cos(30.1 * BST_DEG_RAD)};
    assert_false(bst_spacecraft_star_tracker_sees(&tracker, 0, q, zero, place,
                                                  bst_vec3_scale(near, 1.5e11)));
    assert_true(
        bst_spacecraft_star_tracker_sees(&tracker, 0, q, zero, place, bst_vec3_scale(far, 1.5e11)));
    /* from 7000 km the limb is 65.66 deg from the centre: the axis must be 85.66 deg off it */
    double angle = asin(6378.137 / 7000.0) + 20.0 * BST_DEG_RAD;
    for (int i = 0; i < 2; i++) {
        double a = angle + (i ? 1e-6 : -1e-6);
        bst_vec3 down = {sin(a), 0, cos(a)};
        assert_int_equal(
            bst_spacecraft_star_tracker_sees(&tracker, 0, q, zero, bst_vec3_scale(down, -7e6), sun),
            i);
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
    bst_spacecraft_star_tracker_config c = tracker_config(0.01, 1000.0);
    bst_spacecraft_star_tracker tracker;
    bst_spacecraft_star_tracker_init(&tracker, &c, bst_rng_make_key(2, 0, "a", "tracker"));
    bst_mat3 noise = bst_spacecraft_star_tracker_covariance(&tracker);
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
    bst_vec3 e = bst_attitude_filter_error(truth, f->q_body_from_gcrf),
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
    bst_spacecraft_gyro_config gc = gyro_config(0.02, 0.5);
    gc.bias_sigma_degph = 5.0;
    bst_spacecraft_star_tracker_config tc = tracker_config(6.0, 45.0);
    for (int run = 0; run < RUNS; run++) {
        bst_spacecraft_gyro gyro;
        bst_spacecraft_star_tracker tracker;
        bst_spacecraft_gyro_init(&gyro, &gc, dt, bst_rng_make_key(3, (uint64_t)run, "a", "gyro"));
        bst_spacecraft_star_tracker_init(&tracker, &tc,
                                         bst_rng_make_key(3, (uint64_t)run, "a", "tracker"));
        bst_mat3 noise = bst_spacecraft_star_tracker_covariance(&tracker);
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
            /* a turn whose axis drifts, 0.5 deg/s */
            double t = n * dt;
            bst_vec3 turn = bst_vec3_scale((bst_vec3){cos(0.01 * t), sin(0.013 * t), 0.5},
                                           0.5 * BST_DEG_RAD * dt);
            q = turned(q, turn);
            bst_attitude_filter_propagate(&f, bst_spacecraft_gyro_measure(&gyro, turn), dt);
            if (n % EVERY == 0) {
                bst_quat seen = bst_spacecraft_star_tracker_measure(&tracker, n, q);
                bst_attitude_filter_update(&f, bst_attitude_filter_error(seen, f.q_body_from_gcrf),
                                           0.0, BST_QUAT_IDENTITY, &noise, NULL);
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

/* Against numpy, with everything that could be zero or alike different: block matrices of the error
 * model F = [C, -dt; 0, 1] with C the turn of the axes and its noise, and H = [1, age]. */
static void expect_filter(const bst_attitude_filter *f, const double turn[9],
                          const double covariance[21]) {
    bst_mat3 m = bst_quat_to_mat3(f->q_body_from_gcrf);
    for (int i = 0; i < 9; i++) {
        bst_assert_close(m.m[i / 3][i % 3], turn[i], 1e-14);
    }
    for (int i = 0, n = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++, n++) {
            /* rounding, of the greater variances too */
            double scale = sqrt(f->covariance[i][i] * f->covariance[j][j]);
            bst_assert_close(f->covariance[i][j], covariance[n], 1e-9 * scale);
            assert_true(f->covariance[i][j] == f->covariance[j][i]);
        }
    }
}

static void test_correlated(void **state) {
    (void)state;
    static const double factor[6][6] = {{3},
                                        {1, 2.5},
                                        {-0.7, 0.6, 2.2},
                                        {0.9, -0.4, 0.5, 1.8},
                                        {-0.3, 0.8, -0.6, 0.4, 1.5},
                                        {0.5, -0.2, 0.7, -0.5, 0.3, 1.2}};
    static const double carried_turn[9] = {
        7.469191342891944e-01, -5.967381125949153e-01, -2.932838758086421e-01,
        5.238166784093630e-01, 7.997665570112789e-01,  -2.932397341877582e-01,
        4.095459610994387e-01, 6.539938274160705e-02,  9.099423204160549e-01};
    static const double carried[21] = {
        8.967605434017300e-08,  2.955634860384643e-08,  7.205331077885338e-08,
        -2.249463360461004e-08, 7.152276448151376e-09,  5.807489109010311e-08,
        2.691551011645519e-10,  -1.361025661531459e-11, 1.514076899317487e-11,
        5.459999999999999e-12,  -8.931859085979665e-11, 1.690746176005763e-10,
        -6.358415911355323e-11, -1.700000000000001e-13, 4.500000000000000e-12,
        1.531433571719781e-10,  -5.284969137947406e-14, 1.016928629762102e-10,
        -1.999999999999991e-14, -4.800000000000001e-13, 3.560000000000000e-12};
    static const double updated_turn[9] = {
        7.472510062281810e-01, -5.963404520353878e-01, -2.932473341007567e-01,
        5.235676132500858e-01, 8.000712295056841e-01,  -2.928531749407401e-01,
        4.092589498674160e-01, 6.530002284450211e-02,  9.100785784589857e-01};
    static const double updated[21] = {
        3.694108131937182e-09,  1.030471617556698e-09,  2.931217552194248e-09,
        -4.386834584774524e-10, 7.159222416300551e-10,  1.958980534495798e-09,
        5.668334379254982e-12,  -1.553169281488546e-12, 2.362130510632250e-12,
        4.261036835571924e-12,  -6.903689931820565e-12, 6.821916304353994e-13,
        -1.641909070270662e-12, 6.889960673385627e-13,  3.431202748102121e-12,
        9.609733632433268e-12,  4.268268179025451e-13,  -9.036174171663305e-13,
        -8.688320443381261e-13, 2.234470725230122e-13,  2.802592621336756e-12};
    static const double changes[6] = {2.697153386780862e-04,  -1.951095332536239e-04,
                                      4.811865320548370e-04,  2.646687272792246e-06,
                                      -2.862350825938547e-06, 2.640232207471546e-06};
    bst_attitude_filter f;
    bst_attitude_filter_init(&f, bst_quat_unit((bst_quat){0.1, -0.2, 0.3, 0.9}), 1.0, 1.0, 3e-5,
                             2e-6);
    f.bias_radps = (bst_vec3){2e-4, -1e-4, 3e-4};
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            double sum = 0.0;
            for (int k = 0; k < 6; k++) {
                sum += factor[i][k] * factor[j][k];
            }
            f.covariance[i][j] = sum * (i < 3 ? 1e-4 : 1e-6) * (j < 3 ? 1e-4 : 1e-6);
        }
    }
    bst_attitude_filter_propagate(&f, (bst_vec3){0.02, -0.03, 0.015}, 0.25);
    expect_filter(&f, carried_turn, carried);
    const bst_mat3 noise = {{{4e-9, 1e-9, -0.5e-9}, {1e-9, 3e-9, 0.7e-9}, {-0.5e-9, 0.7e-9, 2e-9}}};
    bst_vec3 correction[2];
    bst_attitude_filter_update(&f, (bst_vec3){3e-4, -2e-4, 5e-4}, 1.7,
                               bst_quat_from_rotvec((bst_vec3){0.05, -0.04, 0.07}), &noise,
                               correction);
    expect_filter(&f, updated_turn, updated);
    const double got[6] = {correction[0].x, correction[0].y, correction[0].z,
                           correction[1].x, correction[1].y, correction[1].z};
    for (int i = 0; i < 6; i++) {
        bst_assert_close(got[i], changes[i], 1e-9 * fabs(changes[i]));
    }
    bst_assert_close(f.bias_radps.x, 2e-4 + changes[3], 1e-15);
    bst_assert_close(f.bias_radps.y, -1e-4 + changes[4], 1e-15);
    bst_assert_close(f.bias_radps.z, 3e-4 + changes[5], 1e-15);
}

/* After a warm-up with a gyro whose bias walks by many of the filter's standard deviations,
 * attitude and bias at the epoch are those of the sensors, within the covariance: two unlike star
 * trackers, a slowly turning body. */
static void warm_up_ends_at_the_epoch(void **state) {
    (void)state;
    enum { RUNS = 30 };
    const double arcsec = BST_ARCSEC_RAD;
    double square[2] = {0.0, 0.0}, walked = 0.0;
    for (uint64_t run = 0; run < RUNS; run++) {
        bst_spacecraft_gyro gyro = {.angle_walk = 0.5 * arcsec,
                                    .rate_walk = 0.2 * arcsec,
                                    .response = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                    .bias_radps = {40 * arcsec, -25 * arcsec, 60 * arcsec},
                                    .dt_s = 0.1};
        const bst_spacecraft_star_tracker trackers[2] = {
            {.axis = {0, 0, 1},
             .across = {1, 0, 0},
             .sigma_rad = {5 * arcsec, 40 * arcsec},
             .alignment = BST_QUAT_IDENTITY,
             .key = bst_rng_make_key(3, run, "a", "tracker0")},
            {.axis = {1, 0, 0},
             .across = {0, 1, 0},
             .sigma_rad = {8 * arcsec, 30 * arcsec},
             .alignment = BST_QUAT_IDENTITY,
             .key = bst_rng_make_key(3, run, "a", "tracker1")}};
        const bst_attitude_past past = {
            .seconds = 400.0,
            .q_body_from_gcrf = bst_quat_unit((bst_quat){0.2, -0.4, 0.3, 0.8}),
            .rate_radps = {1e-3, -4e-4, 7e-4},
            .gyro = &gyro,
            .trackers = 2,
            .tracker = {&trackers[0], &trackers[1]},
            .rate_hz = {2.0, 1.0},
            .key = bst_rng_make_key(3, run, "a", "warm_up")};
        bst_attitude_filter f;
        bst_attitude_filter_init(&f, past.q_body_from_gcrf, 100 * arcsec, 100 * arcsec,
                                 gyro.angle_walk, gyro.rate_walk);
        bst_attitude_warm_up(&past, &f);
        bst_vec3 e = bst_attitude_filter_error(past.q_body_from_gcrf, f.q_body_from_gcrf);
        bst_vec3 b = bst_vec3_sub(f.bias_radps, gyro.bias_radps);
        const double x[2][3] = {{e.x, e.y, e.z}, {b.x, b.y, b.z}};
        for (int part = 0; part < 2; part++) {
            double p[9], inverse[9];
            for (int i = 0; i < 9; i++) {
                p[i] = f.covariance[3 * part + i / 3][3 * part + i % 3];
            }
            assert_true(bst_symmetric_invert(3, p, inverse));
            for (int i = 0; i < 9; i++) {
                square[part] += x[part][i / 3] * inverse[i] * x[part][i % 3] / (3.0 * RUNS);
            }
            walked += part ? gyro.rate_walk * sqrt(past.seconds) / sqrt(p[0]) / RUNS : 0.0;
        }
    }
    assert_true(walked > 5.0);
    for (int part = 0; part < 2; part++) { /* 90 degrees of freedom: four standard deviations */
        bst_assert_close(square[part], 1.0, 4.0 * sqrt(2.0 / 90.0));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(warm_up_ends_at_the_epoch), cmocka_unit_test(test_correlated),
        cmocka_unit_test(test_allan_deviation),      cmocka_unit_test(test_tracker_noise),
        cmocka_unit_test(test_tracker_blind),        cmocka_unit_test(test_steady_state),
        cmocka_unit_test(test_a_million_updates),    cmocka_unit_test(test_consistency)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
