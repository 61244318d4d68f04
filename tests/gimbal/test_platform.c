/* The body that carries the mount: noise of its measured attitude, drift, jitter between samples.
 */
#include "gimbal/platform.h"
#include "gimbal/platform_step.h"

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

/* The telemetry of a mount without errors of its own has the error of the body's attitude. */
static void a_reading_is_in_the_measured_body(void **state) {
    (void)state;
    bst_platform_config config = quiet();
    const double bias[3] = {30.0, -50.0, 70.0};
    memcpy(config.attitude_bias_arcsec, bias, sizeof bias);
    const bst_quat nominal = bst_quat_look(bst_vec3_from_radec(2.0, -0.7), (bst_vec3){0, 0, 1});
    const bst_quat camera = bst_quat_unit((bst_quat){0.3, -0.1, 0.2, 0.8});
    bst_platform p = make(&config, nominal);
    const bst_gimbal_reading r = bst_gimbal_exact(&p, 5, camera);
    const bst_vec3 body = turn(nominal, r.q_body_from_gcrf),
                   seen = turn(bst_quat_mul(camera, r.q_body_from_gcrf), r.q_cam_from_gcrf);
    bst_assert_close(body.x / BST_ARCSEC_RAD, 30.0, 1e-3); /* the order of the rotations */
    bst_assert_close(body.y / BST_ARCSEC_RAD, -50.0, 1e-3);
    bst_assert_close(body.z / BST_ARCSEC_RAD, 70.0, 1e-3);
    bst_assert_close(bst_vec3_norm(seen), 0.0, 1e-14);
    assert_true(r.settled);
    bst_platform_free(&p);
}

/* Each number of the bands in its own place. */
static void bands_of_jitter_in_radians(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_platform_config config = quiet();
    config.jitter_low_px_rms = 0.3;
    config.jitter_low_cutoff_hz = 0.07;
    config.jitter_high_px_rms = 0.2;
    config.jitter_high_band_hz[0] = 11;
    config.jitter_high_band_hz[1] = 190;
    bst_jitter_spectrum spectrum;
    bst_assert_ok(&ctx, bst_platform_jitter_spectrum(&ctx, &config, 4e-5, &spectrum));
    bst_assert_close(spectrum.flat.low_rms_rad, 1.2e-5, 1e-20);
    bst_assert_close(spectrum.flat.low_cutoff_hz, 0.07, 0.0);
    bst_assert_close(spectrum.flat.high_rms_rad, 8e-6, 1e-20);
    bst_assert_close(spectrum.flat.high_min_hz, 11.0, 0.0);
    bst_assert_close(spectrum.flat.high_max_hz, 190.0, 0.0);
    bst_jitter_spectrum_free(&spectrum);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(attitude_noise_is_the_same_about_three_axes_and_uncorrelated),
        cmocka_unit_test(drift_turns_the_body_about_its_own_axes),
        cmocka_unit_test(a_reading_is_in_the_measured_body),
        cmocka_unit_test(bands_of_jitter_in_radians),
        cmocka_unit_test(jitter_between_samples_is_linear_on_both_axes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
