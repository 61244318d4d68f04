/* The body that carries the mount: noise of its measured attitude, drift, jitter between samples.
 */
#include "gimbal/platform.h"

#include "tests/test_support.h"

enum { RATE = 1000 };

static bst_platform_config quiet(void) {
    bst_platform_config c;
    memset(&c, 0, sizeof c);
    c.jitter_low_cutoff_hz = 0.05;
    c.jitter_high_band_hz[0] = 5;
    c.jitter_high_band_hz[1] = 200;
    return c;
}

static bst_platform make(const bst_platform_config *config, bst_quat nominal) {
    bst_ctx ctx = {0};
    bst_platform p;
    memset(&p, 0, sizeof p);
    const bst_platform_setup setup = {.q_nominal_from_gcrf = nominal,
                                      .pixel_rad = 3 * BST_ARCSEC_RAD,
                                      .dt_s = 1.0 / RATE,
                                      .jitter_key = bst_rng_make_key(1, 0, "test", "jitter"),
                                      .attitude_key = bst_rng_make_key(1, 0, "test", "attitude")};
    bst_assert_ok(&ctx, bst_platform_init(&ctx, &p, config, &setup));
    return p;
}

/* Rotation vector that turns frame `from` into frame `to`, in the axes of either. */
static bst_vec3 turn(bst_quat from, bst_quat to) {
    bst_quat d = bst_quat_mul(to, bst_quat_conj(from));
    double sign = d.w < 0 ? 2.0 : -2.0; /* small angles: half-angle sines */
    return (bst_vec3){sign * d.x, sign * d.y, sign * d.z};
}

/* White noise of sigma about each of three axes: covariance sigma^2 I, nothing shared. */
static void attitude_noise_is_the_same_about_three_axes_and_uncorrelated(void **state) {
    (void)state;
    enum { N = 20000 };
    bst_platform_config config = quiet();
    config.attitude_noise_arcsec = 2.0;
    bst_quat nominal = bst_quat_look(bst_vec3_from_radec(1.0, 0.4), (bst_vec3){0, 0, 1});
    bst_platform p = make(&config, nominal);
    double c[3][3] = {{0}}, mean[3] = {0};
    for (int64_t n = 0; n < N; n++) {
        bst_vec3 v = turn(nominal, bst_platform_measured_body(&p, n));
        const double a[3] = {v.x / BST_ARCSEC_RAD, v.y / BST_ARCSEC_RAD, v.z / BST_ARCSEC_RAD};
        for (int i = 0; i < 3; i++) {
            mean[i] += a[i] / N;
            for (int j = 0; j < 3; j++) {
                c[i][j] += a[i] * a[j] / N;
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        bst_assert_close(mean[i], 0.0, 5 * 2.0 / sqrt(N));
        for (int j = 0; j < 3; j++) {
            /* sampling: 4 sqrt(2 / N) of a variance, 4 / sqrt(N) of a covariance; five sigma */
            bst_assert_close(c[i][j], i == j ? 4.0 : 0.0, 5 * 4.0 * sqrt(2.0 / N));
        }
    }
}

/* A constant rate about each axis alone, and its sign: the body's axes turn by +rate. */
static void drift_turns_the_body_about_its_own_axes(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_quat nominal = bst_quat_look(bst_vec3_from_radec(-2.0, -0.9), (bst_vec3){0, 0, 1});
    for (int axis = 0; axis < 3; axis++) {
        bst_platform_config config = quiet();
        config.drift_arcsec_per_s[axis] = 3.0;
        bst_platform p = make(&config, nominal);
        bst_assert_ok(&ctx, bst_platform_advance(&ctx, &p, 10 * RATE, 10.0, (bst_vec3){0, 0, 0}));
        bst_vec3 v = turn(nominal, p.body.q_body_from_gcrf);
        const double got[3] = {v.x, v.y, v.z};
        for (int i = 0; i < 3; i++) {
            bst_assert_close(got[i] / BST_ARCSEC_RAD, i == axis ? 30.0 : 0.0, 1e-6);
        }
    }
}

/* Between two samples the line of sight moves on the straight line between them, on both axes. */
static void jitter_between_samples_is_linear_on_both_axes(void **state) {
    (void)state;
    bst_platform_config config = quiet();
    config.jitter_high_px_rms = 5.0;
    bst_quat nominal = bst_quat_look(bst_vec3_from_radec(0.7, -1.1), (bst_vec3){0.3, 1.0, 0.2});
    bst_quat straight = {0, 0, 0, 1};
    bst_platform p = make(&config, nominal), q = make(&config, nominal);
    bst_platform other = make(&config, straight); /* the same draws in other axes */
    double moved[2] = {0};
    for (int64_t n = 0; n < 50; n++) {
        double at[2][2];
        for (int k = 0; k < 2; k++) {
            bst_vec3 v = turn(nominal, bst_platform_true_camera(&q, n + k, 0.0, straight));
            bst_vec3 w = turn(straight, bst_platform_true_camera(&other, n + k, 0.0, straight));
            at[k][0] = v.x;
            at[k][1] = v.y;
            bst_assert_close(v.x, w.x, 1e-14);
            bst_assert_close(v.y, w.y, 1e-14);
            bst_assert_close(v.z, 0.0, 1e-14);
        }
        const double fractions[] = {0.25, 0.7};
        for (int k = 0; k < 2; k++) {
            double f = fractions[k];
            bst_vec3 v = turn(nominal, bst_platform_true_camera_between(&p, n, f, 0.0, straight));
            /* 15 arcsec of shake: third order of the angles is 4e-13 rad */
            bst_assert_close(v.x, at[0][0] + f * (at[1][0] - at[0][0]), 1e-11);
            bst_assert_close(v.y, at[0][1] + f * (at[1][1] - at[0][1]), 1e-11);
        }
        moved[0] += fabs(at[1][0] - at[0][0]);
        moved[1] += fabs(at[1][1] - at[0][1]);
    }
    /* there was something to interpolate: arcseconds a step on both axes */
    assert_true(moved[0] > 50 * 0.1 * BST_ARCSEC_RAD && moved[1] > 50 * 0.1 * BST_ARCSEC_RAD);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(attitude_noise_is_the_same_about_three_axes_and_uncorrelated),
        cmocka_unit_test(drift_turns_the_body_about_its_own_axes),
        cmocka_unit_test(jitter_between_samples_is_linear_on_both_axes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
