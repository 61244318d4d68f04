/* The pointing-error compensator: steady gains, jitter left over, large errors, signs, outliers. */
#include "boresight/rng.h"
#include "control/loop/pointing_error.h"
#include "tests/test_support.h"

#define TICKS 1000
#define PX (3.0 * BST_ARCSEC_RAD)

static void make(bst_pointing_error *e) {
    bst_pointing_error_init(e, 0.5 * PX, 0.05, 0.02 * PX, 60.0 * BST_ARCSEC_RAD,
                            10.0 * BST_ARCSEC_RAD);
}

/* A fix that says: the truth is the telemetry turned by `error` (GCRF rotation). */
static bst_attitude_fix fix_of(int64_t tick, bst_quat telemetry, bst_quat error, double sigma) {
    bst_quat stars = bst_quat_mul(telemetry, error);
    bst_attitude_fix fix = {.valid = true,
                            .stars = 20,
                            .tick = tick,
                            .q_cam_from_gcrf = stars,
                            .sigma_rad = {sigma, sigma, 5 * sigma}};
    fix.error_cam_rad = bst_quat_to_rotvec(bst_quat_mul(stars, bst_quat_conj(telemetry)));
    return fix;
}

static bst_quat minus(bst_quat q) {
    return (bst_quat){-q.x, -q.y, -q.z, -q.w};
}

static double difference(bst_quat a, bst_quat b) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b))));
}

static bst_quat telemetry_at(int k) {
    /* slews of half a degree every few frames */
    return bst_quat_look((bst_vec3){1.0, 0.2 + 0.01 * (k / 5 % 3), -0.3}, (bst_vec3){0, 0, 1});
}

static void constant_drift_is_followed_without_lag(void **state) {
    (void)state;
    bst_pointing_error e;
    make(&e);
    bst_vec3 drift = {4.0 * BST_ARCSEC_RAD, -3.0 * BST_ARCSEC_RAD, 2.0 * BST_ARCSEC_RAD};
    for (int k = 0; k < 60; k++) {
        bst_quat error = bst_quat_from_rotvec(bst_vec3_scale(drift, k));
        bst_quat tel = telemetry_at(k);
        /* one attitude has two quaternions: both must do */
        bst_attitude_fix fix = fix_of(k * TICKS, k % 2 ? minus(tel) : tel, error, 0.02 * PX);
        assert_true(bst_pointing_error_update(&e, &fix, TICKS));
    }
    bst_quat ahead = bst_pointing_error_at(&e, 59 * TICKS + 1650, TICKS);
    bst_quat expected = bst_quat_from_rotvec(bst_vec3_scale(drift, 60.65));
    /* noise-free: the initial rate of zero has died away by (1 - beta)^60 */
    assert_true(difference(ahead, expected) < 1e-5 * PX);
}

static void error_may_grow_past_half_a_turn(void **state) {
    (void)state;
    bst_pointing_error e;
    make(&e);
    bst_vec3 drift = {0.0, 300.0 * BST_ARCSEC_RAD, 400.0 * BST_ARCSEC_RAD};
    bst_pointing_error_init(&e, 0.5 * PX, 0.05, 0.02 * PX, 60.0 * BST_ARCSEC_RAD,
                            1000.0 * BST_ARCSEC_RAD);
    for (int k = 0; k < 4000; k++) { /* 555 degrees in all */
        bst_quat error = bst_quat_from_rotvec(bst_vec3_scale(drift, k));
        bst_attitude_fix fix = fix_of(k * TICKS, telemetry_at(k), error, 0.02 * PX);
        assert_true(bst_pointing_error_update(&e, &fix, TICKS));
        if (k > 30) {
            bst_quat ahead = bst_pointing_error_at(&e, k * TICKS + 1000, TICKS);
            bst_quat expected = bst_quat_from_rotvec(bst_vec3_scale(drift, k + 1));
            assert_true(difference(ahead, expected) < 1e-3 * PX);
        }
    }
}

static void gains_settle_where_the_riccati_equation_says(void **state) {
    (void)state;
    bst_pointing_error e;
    make(&e);
    double sigma = 0.05 * PX;
    for (int k = 0; k < 200; k++) {
        bst_attitude_fix fix = fix_of(k * TICKS, telemetry_at(0), BST_QUAT_IDENTITY, sigma);
        (void)bst_pointing_error_update(&e, &fix, TICKS);
    }
    /* alpha = p_ee+ / sigma^2, beta = p_er+ / sigma^2. For white acceleration of density q and
     * T = 1 s the steady state of numpy's iteration of the Riccati equation at q = 1e-3 px^2/s^3,
     * s = 0.05 px is alpha 0.675, beta 0.360; q here is 0.969e-3. */
    bst_assert_close(e.p_ee / (sigma * sigma), 0.675, 0.005);
    bst_assert_close(e.p_er / (sigma * sigma), 0.360, 0.006);
}

static void slow_jitter_leaves_less_than_a_fifth_of_a_pixel(void **state) {
    (void)state;
    enum { LINES = 16, RUNS = 20 };
    bst_rng_key key = bst_rng_make_key(5, 0, "jitter", "test");
    double sum = 0.0;
    int count = 0;
    for (uint64_t run = 0; run < RUNS; run++) {
        bst_pointing_error e;
        make(&e);
        double f[2][LINES], phase[2][LINES], a = 0.5 * PX / sqrt(2.0) * sqrt(2.0 / LINES);
        for (int i = 0; i < 2 * LINES; i++) {
            f[i / LINES][i % LINES] =
                0.05 * (i % LINES + bst_rng_uniform(key, run, (uint64_t)(4 * i))) / LINES;
            phase[i / LINES][i % LINES] =
                2 * BST_PI * bst_rng_uniform(key, run, (uint64_t)(4 * i + 1));
        }
        for (int k = 0; k < 300; k++) {
            for (int part = 0; part < 4; part++) { /* the measurement, then where it takes effect */
                double t = part == 0 ? k : k + 0.65 + 0.25 * (part - 1);
                double v[2] = {0.0, 0.0};
                for (int axis = 0; axis < 2; axis++) {
                    for (int i = 0; i < LINES; i++) {
                        v[axis] += a * cos(2 * BST_PI * f[axis][i] * t + phase[axis][i]);
                    }
                }
                /* a boresight along z: the error's x and y matter; drift of 5 arcsec/s on top */
                bst_vec3 truth = {v[0] + 3.0 * BST_ARCSEC_RAD * t, v[1] - 4.0 * BST_ARCSEC_RAD * t,
                                  0.0};
                if (part == 0) {
                    double n[2];
                    bst_rng_normal2(key, 1000 + run, (uint64_t)k, n);
                    truth.x += 0.03 * PX * n[0];
                    truth.y += 0.03 * PX * n[1];
                    bst_attitude_fix fix = fix_of(k * TICKS, BST_QUAT_IDENTITY,
                                                  bst_quat_from_rotvec(truth), 0.03 * PX);
                    (void)bst_pointing_error_update(&e, &fix, TICKS);
                } else if (k > 20) {
                    bst_quat est = bst_pointing_error_at(&e, llround(t * TICKS), TICKS);
                    double d = difference(est, bst_quat_from_rotvec(truth)) / PX;
                    sum += d * d;
                    count++;
                }
            }
        }
    }
    print_message("slow jitter of 0.5 px leaves %.3f px\n", sqrt(sum / count));
    assert_true(sqrt(sum / count) < 0.1); /* the header's table: 0.06 to 0.11 */
}

static void wrong_fixes_are_left_out_until_they_insist(void **state) {
    (void)state;
    bst_pointing_error e;
    make(&e);
    bst_attitude_fix fix;
    for (int k = 0; k < 30; k++) {
        fix = fix_of(k * TICKS, telemetry_at(k), BST_QUAT_IDENTITY, 0.02 * PX);
        assert_true(bst_pointing_error_update(&e, &fix, TICKS));
    }
    bst_quat wrong = bst_quat_from_rotvec((bst_vec3){0, 0, 300.0 * PX});
    for (int k = 30; k < 33; k++) {
        fix = fix_of(k * TICKS, telemetry_at(k), wrong, 0.02 * PX);
        assert_false(bst_pointing_error_update(&e, &fix, TICKS));
        assert_true(difference(bst_pointing_error_at(&e, k * TICKS, TICKS), BST_QUAT_IDENTITY) <
                    0.01 * PX);
    }
    fix = fix_of(33 * TICKS, telemetry_at(33), wrong, 0.02 * PX);
    assert_true(bst_pointing_error_update(&e, &fix, TICKS));
    assert_true(difference(bst_pointing_error_at(&e, 33 * TICKS, TICKS), wrong) < 1e-6 * PX);

    fix = fix_of(20 * TICKS, telemetry_at(33), wrong, 0.02 * PX); /* late */
    assert_false(bst_pointing_error_update(&e, &fix, TICKS));
    fix = fix_of(34 * TICKS, telemetry_at(33), wrong, 0.02 * PX);
    fix.valid = false;
    assert_false(bst_pointing_error_update(&e, &fix, TICKS));
}

/* Error and rate from two fixes, the first of them wrong: the third is worth as much. */
static void a_bad_first_fix_is_forgotten_at_once(void **state) {
    (void)state;
    bst_pointing_error e;
    make(&e);
    bst_quat wrong = bst_quat_from_rotvec((bst_vec3){0, 0, 3.0 * PX});
    for (int k = 0; k < 4; k++) {
        bst_attitude_fix fix =
            fix_of(k * TICKS, telemetry_at(k), k == 0 ? wrong : BST_QUAT_IDENTITY, 0.02 * PX);
        assert_true(bst_pointing_error_update(&e, &fix, TICKS));
        if (k >= 2) {
            /* the fixes' own error; the rate of the first two would have led 3 px astray */
            assert_true(difference(bst_pointing_error_at(&e, k * TICKS, TICKS), BST_QUAT_IDENTITY) <
                        0.1 * PX);
        }
    }
}

static void nothing_known_is_no_error(void **state) {
    (void)state;
    bst_pointing_error e;
    make(&e);
    assert_true(difference(bst_pointing_error_at(&e, 12345, TICKS), BST_QUAT_IDENTITY) == 0.0);
}

/* The filter of an angle and its rate, written as Kalman's matrices: F = (1 dt; 0 1), white
 * acceleration of density q, variance of a fix the mean of those across the boresight, at fixes at
 * uneven times. The boresight lies along x, so that the angle's parts are about y and z. */
static void uneven_fixes_go_by_kalmans_matrices(void **state) {
    (void)state;
    const int64_t ticks[] = {0, 700, 2000, 2150, 4000};
    const double sx[] = {0.03, 0.05, 0.02, 0.04, 0.03}, sy[] = {0.04, 0.02, 0.06, 0.04, 0.09};
    const double off[] = {0.5, 0.9, 1.7, 1.4, 3.0}; /* about y; a third of it about z */
    bst_pointing_error e;
    make(&e);
    bst_quat telemetry = bst_quat_look((bst_vec3){1, 0, 0}, (bst_vec3){0, 0, 1});
    double w = 2.0 * BST_PI * 0.05, q = 0.5 * PX * 0.5 * PX * w * w * w / 8.0;
    double rate0 = 10.0 * BST_ARCSEC_RAD, angle = 0.0, rate = 0.0;
    double p[2][2] = {{0.0}};
    for (int k = 0; k < 5; k++) {
        bst_vec3 turn = {0.0, off[k] * PX, off[k] * PX / 3.0};
        bst_attitude_fix fix = fix_of(ticks[k], telemetry, bst_quat_from_rotvec(turn), 0.0);
        fix.sigma_rad[0] = sx[k] * PX;
        fix.sigma_rad[1] = sy[k] * PX;
        fix.sigma_rad[2] = 7.0 * PX;
        assert_true(bst_pointing_error_update(&e, &fix, TICKS));
        double r = 0.5 * (sx[k] * sx[k] + sy[k] * sy[k]) * PX * PX, z = off[k] * PX;
        if (k == 0) {
            angle = z;
            p[0][0] = r;
            p[1][1] = rate0 * rate0;
        } else {
            double dt = (double)(ticks[k] - ticks[k - 1]) / TICKS;
            const double f[2][2] = {{1.0, dt}, {0.0, 1.0}};
            double m[2][2] = {{q * dt * dt * dt / 3.0, q * dt * dt / 2.0},
                              {q * dt * dt / 2.0, q * dt}};
            for (int i = 0; i < 2; i++) {
                for (int j = 0; j < 2; j++) {
                    for (int a = 0; a < 2; a++) {
                        for (int b = 0; b < 2; b++) {
                            m[i][j] += f[i][a] * p[a][b] * f[j][b];
                        }
                    }
                }
            }
            angle += rate * dt;
            double gain[2] = {m[0][0] / (m[0][0] + r), m[1][0] / (m[0][0] + r)};
            double miss = z - angle;
            angle += gain[0] * miss;
            rate += gain[1] * miss;
            for (int i = 0; i < 2; i++) {
                for (int j = 0; j < 2; j++) {
                    p[i][j] = m[i][j] - gain[i] * m[0][j];
                }
            }
        }
        /* rounding; turns of 1e-4 rad commute to 1e-9 of each other */
        bst_assert_close(e.p_ee / p[0][0], 1.0, 1e-9);
        bst_assert_close(e.p_er, p[0][1], 1e-9 * sqrt(p[0][0] * p[1][1]));
        bst_assert_close(e.p_rr / p[1][1], 1.0, 1e-9);
        bst_vec3 got = bst_quat_to_rotvec(e.error);
        bst_assert_close(got.y / PX, angle / PX, 1e-6);
        bst_assert_close(got.z / PX, angle / PX / 3.0, 1e-6);
        bst_assert_close(e.rate_gcrf_radps.y / PX, rate / PX, 1e-6);
        bst_assert_close(e.rate_gcrf_radps.z / PX, rate / PX / 3.0, 1e-6);
        bst_vec3 later = bst_quat_to_rotvec(bst_pointing_error_at(&e, ticks[k] + 300, TICKS));
        bst_assert_close(later.y / PX, (angle + 0.3 * rate) / PX, 1e-6);
    }
    /* a roll about the boresight, which stars tell badly, is no reason to leave a fix out */
    bst_vec3 rolled = {400.0 * PX, 3.0 * PX, PX};
    bst_attitude_fix fix = fix_of(5000, telemetry, bst_quat_from_rotvec(rolled), 0.03 * PX);
    assert_true(bst_pointing_error_update(&e, &fix, TICKS));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uneven_fixes_go_by_kalmans_matrices),
        cmocka_unit_test(constant_drift_is_followed_without_lag),
        cmocka_unit_test(error_may_grow_past_half_a_turn),
        cmocka_unit_test(gains_settle_where_the_riccati_equation_says),
        cmocka_unit_test(slow_jitter_leaves_less_than_a_fifth_of_a_pixel),
        cmocka_unit_test(wrong_fixes_are_left_out_until_they_insist),
        cmocka_unit_test(a_bad_first_fix_is_forgotten_at_once),
        cmocka_unit_test(nothing_known_is_no_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
