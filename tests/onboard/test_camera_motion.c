#include <stdlib.h>

#include "boresight/camera_motion.h"
#include "boresight/rng.h"
#include "tests/test_support.h"

enum { CAPACITY = 64 };

/* Attitude that turns at a constant rate about a fixed camera axis. */
static bst_quat turning(double seconds, bst_vec3 rate_radps) {
    bst_quat start = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7});
    return bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(rate_radps, seconds)), start);
}

static bst_pointing_telemetry *telemetry(int samples, int64_t step_ticks, bst_vec3 rate) {
    bst_pointing_telemetry *t = calloc(1, sizeof *t + CAPACITY * sizeof(bst_pointing_sample));
    assert_non_null(t);
    t->capacity = CAPACITY;
    t->written = samples;
    for (int n = 0; n < samples; n++) {
        bst_quat q = turning((double)(n * step_ticks) / 6000.0, rate);
        if (n % 3 == 1) {
            q = (bst_quat){-q.x, -q.y, -q.z, -q.w}; /* the same attitude */
        }
        t->items[n % CAPACITY] =
            (bst_pointing_sample){.tick = n * step_ticks, .q_cam_from_gcrf = q};
    }
    return t;
}

static double difference(bst_quat a, bst_quat b) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b))));
}

/* At a constant rate the mean is the attitude at mid-exposure and the turn is rate times time,
 * whether samples bracket the exposure, lie inside it, end before it, or were overwritten before
 * it. 1e-12 rad: rounding. */
static void constant_rate(void **state) {
    (void)state;
    bst_vec3 rate = {1e-3, -2e-3, 5e-4};
    static const struct {
        int samples;
        int64_t start, end;
    } cases[] = {{40, 600, 3600},  {40, 613, 3571},  {10, 300, 3300},
                 {200, 100, 3100}, {40, 1000, 1000}, {40, 1050, 1051}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        bst_pointing_telemetry *t = telemetry(cases[c].samples, 100, rate);
        bst_camera_motion m;
        assert_true(bst_camera_motion_from_telemetry(t, cases[c].start, cases[c].end, &m));
        double span = (double)(cases[c].end - cases[c].start) / 6000.0;
        double middle = 0.5 * (double)(cases[c].start + cases[c].end) / 6000.0;
        bst_assert_close(difference(m.q_cam_from_gcrf, turning(middle, rate)), 0.0, 1e-12);
        bst_assert_close(m.turn_cam_rad.x, rate.x * span, 1e-12);
        bst_assert_close(m.turn_cam_rad.y, rate.y * span, 1e-12);
        bst_assert_close(m.turn_cam_rad.z, rate.z * span, 1e-12);
        bst_assert_close(bst_vec3_norm(m.bend_cam_rad), 0.0, 1e-12);
        free(t);
    }
}

/* Constant acceleration about x: mean r = a T^2 / 6, least-squares turn a T^2 / 2, bend a T^2 / 12,
 * exposure from rest; 1e-9 rad: chords of 1/60 s under 1e-3 rad/s^2 err by a h^2 / 12. */
static void accelerated(void **state) {
    (void)state;
    bst_pointing_telemetry *t = telemetry(40, 100, (bst_vec3){0, 0, 0});
    const double a = 1e-3;
    for (int n = 0; n < 40; n++) {
        double s = n / 60.0;
        t->items[n].q_cam_from_gcrf = bst_quat_from_rotvec((bst_vec3){0.5 * a * s * s, 0, 0});
    }
    bst_camera_motion m;
    assert_true(bst_camera_motion_from_telemetry(t, 0, 3000, &m));
    bst_vec3 mean = bst_quat_to_rotvec(m.q_cam_from_gcrf);
    double limit = a / (60.0 * 60.0) / 6.0;
    bst_assert_close(mean.x, a * 0.25 / 6.0, limit);
    bst_assert_close(m.turn_cam_rad.x, a * 0.25 / 2.0, limit);
    bst_assert_close(m.bend_cam_rad.x, a * 0.25 / 12.0, limit);
    free(t);
}

static void few_samples(void **state) {
    (void)state;
    bst_pointing_telemetry *t = telemetry(0, 100, (bst_vec3){0, 0, 0});
    bst_camera_motion m = {.turn_cam_rad = {9, 9, 9}};
    assert_false(bst_camera_motion_from_telemetry(t, 0, 100, &m));
    assert_true(m.turn_cam_rad.x == 9.0);
    free(t);
    t = telemetry(1, 100, (bst_vec3){1, 0, 0});
    assert_true(bst_camera_motion_from_telemetry(t, 50, 150, &m));
    bst_assert_close(difference(m.q_cam_from_gcrf, t->items[0].q_cam_from_gcrf), 0.0, 1e-15);
    bst_assert_close(bst_vec3_norm(m.turn_cam_rad), 0.0, 0.0);
    free(t);
}

/* The path against projecting a fixed direction at both ends. */
static void check_streak(bst_camera c) {
    bst_camera_motion m = {.q_cam_from_gcrf = bst_quat_unit((bst_quat){0.1, 0.2, 0.3, 0.9}),
                           .turn_cam_rad = {1e-4, -5e-5, 2e-3}};
    bst_quat end =
        bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(m.turn_cam_rad, 0.5)), m.q_cam_from_gcrf);
    bst_quat start =
        bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(m.turn_cam_rad, -0.5)), m.q_cam_from_gcrf);
    bst_vec3 star =
        bst_quat_rotate(bst_quat_conj(m.q_cam_from_gcrf), bst_camera_unproject(&c, 900.0, 100.0));
    double x0 = 0, y0 = 0, x1 = 0, y1 = 0, dx, dy;
    assert_true(bst_camera_project(&c, bst_quat_rotate(start, star), &x0, &y0));
    assert_true(bst_camera_project(&c, bst_quat_rotate(end, star), &x1, &y1));
    bst_camera_motion_streak(&m, &c, 900.0, 100.0, &dx, &dy);
    /* rounding of rotations at 1e5 px per radian */
    bst_assert_close(dx, x1 - x0, 1e-8);
    bst_assert_close(dy, y1 - y0, 1e-8);
    assert_true(hypot(dx, dy) > 3.0);
}

static void streak_is_the_stars_path(void **state) {
    (void)state;
    bst_camera c = {.width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = 3.0};
    check_streak(c);
    bst_ctx ctx = {0};
    c.rotation_deg = -37;
    c.distortion.k1 = 300;
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    check_streak(c);
    /* the bend at the boresight: tilted by a small rotation vector, the boresight's own direction
     * moves as projecting it says */
    bst_camera_motion m = {.q_cam_from_gcrf = BST_QUAT_IDENTITY, .bend_cam_rad = {3e-5, -7e-5, 0}};
    double bx, by, x = 0, y = 0;
    bst_camera_motion_bend(&m, &c, &bx, &by);
    bst_vec3 v = bst_quat_rotate(bst_quat_from_rotvec(m.bend_cam_rad), (bst_vec3){0, 0, 1});
    assert_true(bst_camera_project(&c, v, &x, &y));
    bst_assert_close(bx, x - 511.5, 1e-4); /* third order: 300 (7e-5)^2 of 5 px */
    bst_assert_close(by, y - 511.5, 1e-4);
    /* what is added in pixels is there in pixels: both are linear but for the same third order */
    double x0, y0, x1, y1, cx, cy;
    bst_camera_motion_streak(&m, &c, 511.5, 511.5, &x0, &y0);
    bst_camera_motion_add(&m, &c, 0.7, -0.4, 0.3, 0.2);
    bst_camera_motion_streak(&m, &c, 511.5, 511.5, &x1, &y1);
    bst_camera_motion_bend(&m, &c, &cx, &cy);
    bst_assert_close(x1 - x0, 0.7, 1e-6);
    bst_assert_close(y1 - y0, -0.4, 1e-6);
    bst_assert_close(cx - bx, 0.3, 1e-9);
    bst_assert_close(cy - by, 0.2, 1e-9);
}

/* Noise of the telemetry is no bend, and its effect on a true bend is reported. 50 samples in the
 * exposure: the least-squares coefficient of a Legendre polynomial of degree 2 has sigma
 * sqrt(5 / 50) of a sample's. */
static void noise_is_no_bend(void **state) {
    (void)state;
    enum { TRIALS = 400 };
    const double sample = 5e-7, sigma = sample * sqrt(5.0 / 50.0);
    for (int bent = 0; bent < 2; bent++) {
        double true_bend = bent ? 20.0 * sigma : 0.0, error2 = 0.0, stated2 = 0.0;
        for (uint64_t trial = 0; trial < TRIALS; trial++) {
            bst_rng_key key = bst_rng_make_key(trial, 0, "test", "noise_is_no_bend");
            bst_pointing_telemetry *t = telemetry(60, 60, (bst_vec3){1e-3, -2e-3, 0});
            for (int n = 0; n < 60; n++) {
                double e[2], u = ((double)(n * 60) - 1800.0) / 1500.0;
                bst_rng_normal2(key, 0, (uint64_t)n, e);
                bst_vec3 off = {sample * e[0] + true_bend * (1.5 * u * u - 0.5), sample * e[1], 0};
                t->items[n].q_cam_from_gcrf =
                    bst_quat_mul(bst_quat_from_rotvec(off), t->items[n].q_cam_from_gcrf);
            }
            bst_camera_motion m;
            assert_true(bst_camera_motion_from_telemetry(t, 300, 3300, &m));
            for (int k = 0; k < BST_CAMERA_MOTION_KNOTS; k++) { /* nor is it a departure */
                assert_true(m.departure_cam_rad[0][k] == 0.0 && m.departure_cam_rad[1][k] == 0.0);
            }
            error2 += pow(m.bend_cam_rad.x - true_bend, 2) + pow(m.bend_cam_rad.y, 2);
            stated2 += 2.0 * m.bend_sigma_rad * m.bend_sigma_rad;
            free(t);
        }
        error2 /= TRIALS * 2.0 * sigma * sigma;
        stated2 /= TRIALS * 2.0 * sigma * sigma;
        if (bent) {
            /* 800 draws: 5 %, three of them */
            bst_assert_close(error2, 1.0, 0.15);
            bst_assert_close(stated2, 1.0, 0.1);
        } else {
            /* of the positive-part estimator at the origin, by quadrature over the chi-square of 2
             * degrees of freedom: E[(1 - 2/s)+^2 s] / 2 = 0.35 */
            assert_true(error2 < 0.45);
            /* a third is stated of a bend that noise hides, 1 - 2/s of others: E of the larger,
             * 1/3 for s < 3, is 0.382 */
            bst_assert_close(stated2, 0.382, 0.03);
        }
    }
}

/* A camera that settles, r = a exp(-k t) about y, t from 0 to 1 over the exposure: the departure is
 * r less its Legendre coefficients of degrees 0 to 2, here by the midpoint rule. Chords between 100
 * samples and their sums err by a (k / 100)^2 / 8 and less. */
static void settling_departs_from_a_bend(void **state) {
    (void)state;
    enum { STEPS = 20000 };
    const double a = 2e-4, k = 8.0;
    bst_pointing_telemetry *t = telemetry(60, 100, (bst_vec3){0, 0, 0});
    for (int n = 0; n < 60; n++) {
        const double at = (n - 5) / 50.0;
        t->items[n].q_cam_from_gcrf = bst_quat_from_rotvec((bst_vec3){0, a * exp(-k * at), 0});
    }
    bst_camera_motion m;
    assert_true(bst_camera_motion_from_telemetry(t, 500, 5500, &m));
    double c[3] = {0.0};
    for (int n = 0; n < STEPS; n++) {
        const double at = (n + 0.5) / STEPS, u = 2.0 * at - 1.0, r = a * exp(-k * at) / STEPS;
        c[0] += r;
        c[1] += 3.0 * r * u;
        c[2] += 5.0 * r * (1.5 * u * u - 0.5);
    }
    const double limit = a * (k / 50.0) * (k / 50.0) / 8.0 * 2.0;
    for (int n = 0; n < BST_CAMERA_MOTION_KNOTS; n++) {
        const double at = (double)n / (BST_CAMERA_MOTION_KNOTS - 1), u = 2.0 * at - 1.0;
        const double left = a * exp(-k * at) - c[0] - c[1] * u - c[2] * (1.5 * u * u - 0.5);
        bst_assert_close(m.departure_cam_rad[1][n], left, limit);
        bst_assert_close(m.departure_cam_rad[0][n], 0.0, 1e-12);
    }
    /* a star goes to +x when the camera turns about +y: a / scale px, at 1 px of 1e-5 rad */
    bst_camera camera = {.width_px = 64, .height_px = 64, .pixel_scale_arcsec = 2.0626480624709636};
    double x, y;
    bst_camera_motion_departure(&m, &camera, 0, &x, &y);
    bst_assert_close(x, m.departure_cam_rad[1][0] / 1e-5, 1e-6);
    bst_assert_close(y, 0.0, 1e-9);
    assert_true(x > 3.0);
    assert_true(bst_camera_motion_is_uneven(&m, &camera, 0.85));
    assert_false(bst_camera_motion_is_uneven(&m, &camera, 40.0));
    free(t);
}

/* Of uniform paths the displacement is that of bst_camera_motion_shared_shift, an integral of its
 * own along one axis. 1 %: its formula takes the ends alone, 64 steps here. */
static void uniform_paths_shift_alike(void **state) {
    (void)state;
    static const double lengths[] = {2.5, 5.5, 8.4, 14.0};
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
        double path[BST_CAMERA_MOTION_KNOTS][2], shared[3], along, across;
        const double c = 0.6, s = 0.8;
        for (int k = 0; k < BST_CAMERA_MOTION_KNOTS; k++) {
            const double at = lengths[i] * ((double)k / (BST_CAMERA_MOTION_KNOTS - 1) - 0.5);
            path[k][0] = c * at;
            path[k][1] = s * at;
        }
        const bst_camera_motion_unknown unknown = {.bend_px = 0.3, .drift_px = 1.0};
        bst_camera_motion_uneven_shift(path, 0.9, &unknown, shared);
        bst_camera_motion_shared_shift(lengths[i], 0.9, 0.3, 0.3, &along, &across);
        const double found = c * c * shared[0] + 2.0 * c * s * shared[1] + s * s * shared[2];
        const double side = s * s * shared[0] - 2.0 * c * s * shared[1] + c * c * shared[2];
        bst_assert_close(found / along, 1.0, 0.01);
        bst_assert_close(side / across, 1.0, 0.01);
        /* what is measured of the bend counts as stated, and length and direction do not matter */
        const double covariance[3][3] = {{0.04, 0.0, 0.0}, {0.0, 0.04, 0.0}, {0.0, 0.0, 1e-4}};
        const bst_camera_motion_unknown left = {
            .bend_px = 0.3, .covariance = covariance, .ex = c, .ey = s};
        bst_camera_motion_uneven_shift(path, 0.9, &left, shared);
        bst_camera_motion_shared_shift(lengths[i], 0.9, 0.3, 0.01, &along, &across);
        const double less = c * c * shared[0] + 2.0 * c * s * shared[1] + s * s * shared[2];
        bst_assert_close(less / along, 1.0, 0.01);
    }
}

/* A place at 8 and -6 px of bend: half of what the fit does not follow, 5 % of what it does. */
static void places_are_as_wrong_as_the_bend(void **state) {
    (void)state;
    bst_detection d = {.cov_xx = 1.0, .cov_yy = 2.0};
    bst_camera_motion_widen(8.0, -6.0, 0.0, 0.0, &d);
    bst_assert_close(d.cov_xx, 17.0, 1e-14); /* rounding */
    bst_assert_close(d.cov_xy, -12.0, 1e-14);
    bst_assert_close(d.cov_yy, 11.0, 1e-14);
    d = (bst_detection){.cov_xx = 1.0, .cov_yy = 2.0};
    bst_camera_motion_widen(8.0, -6.0, 8.0, -6.0, &d);
    bst_assert_close(d.cov_xx, 1.16, 1e-14);
    bst_assert_close(d.cov_xy, -0.12, 1e-14);
    bst_assert_close(d.cov_yy, 2.09, 1e-14);
}

/* Samples that alternate by +-e about x have third differences of 8 e, as noise whose variance is
 * 64 e^2 / 20, half of it on each axis: of 50 samples a bend's variance is 5 / 50 of 1.6 e^2. With
 * a bend b of twice that deviation, 1 - 2 / 4 of it is believed (James and Stein's shrinkage), and
 * its deviation is sqrt(1/2) of the noise's. */
static void a_bend_near_the_noise_is_half_believed(void **state) {
    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        const double e = 1e-6, sigma = e * sqrt(1.6 * 5.0 / 50.0), bend = 2.0 * sigma;
        bst_pointing_telemetry *t = telemetry(60, 60, (bst_vec3){0, 0, 0});
        for (int n = 0; n < 60; n++) {
            double u = ((double)(n * 60) - 1800.0) / 1500.0;
            double off = (n % 2 ? e : -e) + bend * (1.5 * u * u - 0.5);
            t->items[n].q_cam_from_gcrf =
                bst_quat_from_rotvec(axis ? (bst_vec3){0, off, 0} : (bst_vec3){off, 0, 0});
        }
        bst_camera_motion m;
        assert_true(bst_camera_motion_from_telemetry(t, 300, 3300, &m));
        /* what the alternation leaves of a bend, and the chords of the bend: 1 % */
        bst_assert_close((axis ? m.bend_cam_rad.y : m.bend_cam_rad.x) / bend, 0.5, 0.02);
        bst_assert_close(axis ? m.bend_cam_rad.x : m.bend_cam_rad.y, 0.0, 1e-12);
        bst_assert_close(m.bend_sigma_rad / sigma, sqrt(0.5), 0.02);
        free(t);
    }
}

/* Displacement that all streaks share, against closed forms for streaks that are long against
 * their ends: w is the distance from an end in deviations s of the overlap of two profiles, and
 * e = 2 s / length. Along, the weight of a path is w phi(w) about both ends: of the bend it takes
 * 1 - 3 e E w + 1.5 e^2 E w^2 with E w = sqrt(pi / 2) and E w^2 = 2, and of a flat spectrum
 * sum (2 n + 1) k_n^2 = sqrt(pi) / (4 e) - 1. Across, it is Phi at the ends: with 1 / sqrt(2 pi)
 * and 1 / sqrt(pi) / 2 as the integrals of 1 - Phi and Phi (1 - Phi). */
static void streaks_share_what_is_not_known_of_the_motion(void **state) {
    (void)state;
    const double sigma = 0.9, s = sigma * sqrt(2.0);
    static const double lengths[] = {8.0, 20.0, 80.0}; /* in s; phi(8) is 1e-14 */
    for (int i = 0; i < 3; i++) {
        const double length = lengths[i] * s, e = 2.0 / lengths[i];
        double along, across;
        bst_camera_motion_shared_shift(length, sigma, 0.0, 0.02, &along, &across);
        const double k2 = 1.0 - 3.0 * e * sqrt(0.5 * BST_PI) + 3.0 * e * e;
        /* Simpson's rule with 512 steps */
        bst_assert_close(along, pow(k2 * 0.02, 2), 1e-5 * 4e-4);
        bst_assert_close(across, 0.0, 0.0);
        bst_camera_motion_shared_shift(length, sigma, 0.02, 0.02, &along, &across);
        const double flat = (sqrt(BST_PI) / (4.0 * e) - 1.0) / 5.0;
        bst_assert_close(along / 4e-4, flat, 1e-4 * flat);
        const double a = 2.0 - 2.0 * e / sqrt(2.0 * BST_PI);
        const double b = a - 2.0 * e * 0.5 / sqrt(BST_PI);
        bst_assert_close(across / 4e-4, (2.0 * b / (a * a) - 1.0) / 5.0, 1e-5);
    }
    /* a point is at its centroid */
    double along = 1.0, across = 1.0;
    bst_camera_motion_shared_shift(0.4 * sigma, sigma, 0.02, 0.02, &along, &across);
    bst_assert_close(along + across, 0.0, 0.0);
    /* in the axes of the frame: a streak at 30 degrees */
    bst_detections d = {.count = 0};
    bst_camera_motion_set_shared(sqrt(3.0), 1.0, 4.0, 0.4, &d);
    bst_assert_close(d.shared_xx, 0.75 * 4.0 + 0.25 * 0.4, 1e-14); /* rounding */
    bst_assert_close(d.shared_xy, sqrt(3.0) / 4.0 * 3.6, 1e-14);
    bst_assert_close(d.shared_yy, 0.25 * 4.0 + 0.75 * 0.4, 1e-14);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bend_near_the_noise_is_half_believed),
        cmocka_unit_test(noise_is_no_bend),
        cmocka_unit_test(constant_rate),
        cmocka_unit_test(accelerated),
        cmocka_unit_test(few_samples),
        cmocka_unit_test(streak_is_the_stars_path),
        cmocka_unit_test(streaks_share_what_is_not_known_of_the_motion),
        cmocka_unit_test(settling_departs_from_a_bend),
        cmocka_unit_test(uniform_paths_shift_alike),
        cmocka_unit_test(places_are_as_wrong_as_the_bend),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
