/* Calibration of the camera's geometry from stars at known places. */
#include "boresight/rng.h"
#include "imgproc/identify/camera_calibrator.h"
#include "sim/core/symmetric.h"
#include "tests/test_support.h"

enum { STARS = 20, SIZE = BST_CAMERA_CALIBRATION_SIZE };
static const double SIGMA_PX = 0.1, STAR_SIGMA_PX = 0.05, ROLL_RAD = 1e-4;

typedef struct scene {
    bst_ctx ctx;
    bst_camera_calibrator_config config;
    bst_camera onboard, truth;
    bst_rng_key key;
    bst_camera_calibrator_star stars[STARS];
    bool exact;   /* no errors of places */
    bool slanted; /* each star's errors are three times greater along a direction of its own */
} scene;

/* A camera of 1024 px at 3 arcsec, and the one on board. */
static void make_cameras(scene *s, double scale, double rotation_rad, double k1,
                         const double tangential[2]) {
    s->onboard =
        (bst_camera){.width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = 3.0 / scale};
    bst_assert_ok(&s->ctx, bst_camera_prepare(&s->ctx, &s->onboard));
    const bst_camera_calibration c = {.frames = 1,
                                      .scale = scale,
                                      .rotation_rad = rotation_rad,
                                      .k1 = k1,
                                      .p1 = tangential[0],
                                      .p2 = tangential[1]};
    bst_assert_ok(&s->ctx, bst_camera_apply_calibration(&s->ctx, &s->onboard, &c, &s->truth));
}

static void setup_scene(scene *s, uint64_t seed) {
    *s = (scene){.config = {.enabled = true,
                            .scale_sigma = 0.02,
                            .rotation_sigma_deg = 0.1,
                            .distortion_sigma_px = 1.0,
                            .telemetry_roll_sigma_arcsec = 20.0,
                            .star_sigma_px = STAR_SIGMA_PX},
                 .key = bst_rng_make_key(seed, 0, "test", "camera calibrator")};
}

/* Places random stars of a frame; the attitude differs from the predicted one by 5e-5 rad and about
 * the boresight by what telemetry says. */
static bst_camera_calibrator_frame draw(scene *s, uint64_t frame) {
    bst_vec3 turn = {5e-5 * bst_rng_normal(s->key, frame, 0),
                     5e-5 * bst_rng_normal(s->key, frame, 1), ROLL_RAD};
    for (uint64_t i = 0; i < STARS; i++) {
        bst_camera_calibrator_star *star = &s->stars[i];
        double along = s->slanted ? 3.0 * SIGMA_PX : SIGMA_PX;
        double angle = s->slanted ? BST_PI * bst_rng_uniform(s->key, frame, 200 + i) : 0.0;
        double c = cos(angle), n = sin(angle), a, b;
        star->x_px = 1023.0 * bst_rng_uniform(s->key, frame, 10 + 4 * i);
        star->y_px = 1023.0 * bst_rng_uniform(s->key, frame, 11 + 4 * i);
        star->cam = bst_quat_rotate(bst_quat_conj(bst_quat_from_rotvec(turn)),
                                    bst_camera_unproject(&s->truth, star->x_px, star->y_px));
        a = hypot(along, STAR_SIGMA_PX) * bst_rng_normal(s->key, frame, 12 + 4 * i);
        b = hypot(SIGMA_PX, STAR_SIGMA_PX) * bst_rng_normal(s->key, frame, 13 + 4 * i);
        star->x_px += s->exact ? 0.0 : c * a - n * b;
        star->y_px += s->exact ? 0.0 : n * a + c * b;
        star->cov_xx = c * c * along * along + n * n * SIGMA_PX * SIGMA_PX;
        star->cov_xy = c * n * (along * along - SIGMA_PX * SIGMA_PX);
        star->cov_yy = n * n * along * along + c * c * SIGMA_PX * SIGMA_PX;
    }
    return (bst_camera_calibrator_frame){s->stars, STARS, (double)frame, ROLL_RAD};
}

/* Scale 2 % and rotation 0.1 deg wrong, distortion of 1.2 px at the corner: 1e-4 after 20 frames.
 */
static void learns_scale_rotation_and_distortion(void **state) {
    (void)state;
    scene s;
    setup_scene(&s, 1);
    make_cameras(&s, 1.02, 1.7e-3, 15.0, (const double[2]){1e-3, 0.0});
    bst_camera_calibrator c;
    bst_camera_calibration out;
    bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
    for (uint64_t i = 0; i < 20; i++) {
        bst_camera_calibrator_frame frame = draw(&s, i);
        assert_true(bst_camera_calibrator_update(&c, &frame));
    }
    bst_camera_calibrator_get(&c, &out);
    assert_int_equal(out.frames, 20);
    assert_true(fabs(out.scale - 1.02) < 1e-4); /* asked; 1 sigma is 2e-5 */
    assert_true(fabs(out.rotation_rad - 1.7e-3) < 1e-4);
    assert_true(fabs(out.k1 - 15.0) < 1.5);  /* 1 sigma 0.4 */
    assert_true(fabs(out.p1 - 1e-3) < 3e-3); /* 1 sigma 8e-4 */
    /* the camera has the true places to within the centroids' errors */
    for (int i = 0; i < 9; i++) {
        double x = 511.5 * (i % 3), y = 511.5 * (i / 3), u, v;
        assert_true(bst_camera_project(&c.camera, bst_camera_unproject(&s.truth, x, y), &u, &v));
        assert_true(hypot(u - x, v - y) < 0.3); /* with a common shift by p1 and p2 */
    }
}

/* NEES of the four parameters that stars alone give, over 200 cameras drawn from the prior; in one
 * half of them each star's errors have axes of their own. */
static void covariance_is_that_of_the_errors(void **state) {
    (void)state;
    enum { CAMERAS = 200, FRAMES = 3 };
    double sum[2] = {0.0};
    for (uint64_t n = 0; n < CAMERAS; n++) {
        scene s;
        setup_scene(&s, 100 + n);
        s.slanted = n % 2;
        const double tangential[2] = {0.125 * bst_rng_normal(s.key, 1000, 2),
                                      0.125 * bst_rng_normal(s.key, 1000, 3)};
        make_cameras(&s, 1.0 + 0.02 * bst_rng_normal(s.key, 1000, 0), 0.0,
                     12.0 * bst_rng_normal(s.key, 1000, 1), tangential);
        s.config.rotation_sigma_deg = 0.0;
        bst_camera_calibrator c;
        bst_camera_calibration out;
        bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
        for (uint64_t i = 0; i < FRAMES; i++) {
            bst_camera_calibrator_frame frame = draw(&s, i);
            assert_true(bst_camera_calibrator_update(&c, &frame));
        }
        bst_camera_calibrator_get(&c, &out);
        double scale = s.truth.pixel_scale_arcsec / s.onboard.pixel_scale_arcsec;
        const double e[4] = {out.scale - scale, out.k1 - s.truth.distortion.k1,
                             out.p1 - s.truth.distortion.p1, out.p2 - s.truth.distortion.p2};
        const int of[4] = {0, 2, 3, 4};
        double covariance[4][4], inverse[4][4];
        for (int i = 0; i < 4; i++) {
            for (int k = 0; k < 4; k++) {
                covariance[i][k] = out.covariance[of[i]][of[k]];
            }
        }
        assert_true(bst_symmetric_invert(4, covariance[0], inverse[0]));
        for (int i = 0; i < 4; i++) {
            for (int k = 0; k < 4; k++) {
                sum[s.slanted] += e[i] * inverse[i][k] * e[k] / (0.5 * CAMERAS);
            }
        }
        assert_true(fabs(out.rotation_rad) < 1e-9); /* known exactly */
    }
    print_message("NEES of four: %.3f and %.3f\n", sum[0], sum[1]);
    /* means of 100 chi-squares of four degrees: standard deviation 0.28; 4 sigma */
    bst_assert_close(sum[0], 4.0, 1.13);
    bst_assert_close(sum[1], 4.0, 1.13);
}

/* A scale that drifts by 3e-4 in an hour is followed. */
static void follows_a_drift(void **state) {
    (void)state;
    scene s;
    setup_scene(&s, 3);
    s.config.drift_px_per_sqrt_h = 0.2;
    bst_camera_calibrator c;
    for (uint64_t i = 0; i < 60; i++) {
        make_cameras(&s, 1.0, 0.0, 0.0, (const double[2]){0.0, 0.0});
        s.truth.pixel_scale_arcsec *= 1.0 + 3e-4 * (double)i / 60.0;
        if (i == 0) {
            bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
        }
        bst_camera_calibrator_frame frame = draw(&s, i);
        frame.seconds = 60.0 * (double)i;
        assert_true(bst_camera_calibrator_update(&c, &frame));
    }
    bst_camera_calibration out;
    bst_camera_calibrator_get(&c, &out);
    assert_true(fabs(out.scale - (1.0 + 3e-4 * 59.0 / 60.0)) < 1e-4); /* 1 sigma 3e-5, and lag */
}

/* The scale's variance grows by that of the walk: of the corner's place, in so many hours; also
 * where it is known to 1e-7, but not where it is known exactly. */
static void variance_grows_with_time(void **state) {
    (void)state;
    const double hours[2] = {0.0, 4.0}, corner_px = 512.0 * sqrt(2.0);
    const double drift_px[3] = {0.3, 1e-3, 0.3};
    for (int fine = 0; fine < 3; fine++) {
        double p[2][2];
        for (int k = 0; k < 2; k++) {
            scene s;
            setup_scene(&s, 5);
            s.exact = true;
            s.config.rotation_sigma_deg = s.config.distortion_sigma_px = 0.0;
            s.config.drift_px_per_sqrt_h = drift_px[fine];
            s.config.star_sigma_px = fine == 1 ? 1e-3 : STAR_SIGMA_PX;
            s.config.scale_sigma = fine == 2 ? 0.0 : 0.02;
            make_cameras(&s, 1.0, 0.0, 0.0, (const double[2]){0.0, 0.0});
            bst_camera_calibrator c;
            bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
            bst_camera_calibrator_frame frame = draw(&s, 0);
            for (int i = 0; i < STARS && fine == 1; i++) {
                s.stars[i].cov_xx = s.stars[i].cov_yy = 1e-6;
            }
            for (int i = 0; i < 2; i++) {
                bst_camera_calibration out;
                frame.seconds = 3600.0 * hours[k] * i;
                assert_true(bst_camera_calibrator_update(&c, &frame));
                bst_camera_calibrator_get(&c, &out);
                p[k][i] = out.covariance[0][0];
            }
        }
        if (fine == 2) {
            bst_assert_close(p[1][1], 1e-20, 1e-23); /* what an exact parameter has */
            continue;
        }
        double information = 1.0 / p[0][1] - 1.0 / p[0][0]; /* of a frame */
        double walk = hours[1] * drift_px[fine] * drift_px[fine] / (corner_px * corner_px);
        bst_assert_close(1.0 / p[1][1] - information, 1.0 / (p[1][0] + walk), 1e-3 / p[1][0]);
        assert_true(walk > 0.1 * p[1][0]);
    }
}

/* Standard deviations before the first frame, in the unit of each parameter; the covariance that is
 * given out has the units of the calibration. */
static void units_of_the_covariance(void **state) {
    (void)state;
    scene s;
    setup_scene(&s, 6);
    const double corner_px = 512.0 * sqrt(2.0), corner = corner_px * 3.0 * BST_ARCSEC_RAD;
    make_cameras(&s, 1.0, 0.0, 0.0, (const double[2]){0.0, 0.0});
    bst_camera_calibrator c;
    bst_camera_calibration out;
    bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
    bst_camera_calibrator_get(&c, &out);
    assert_int_equal(out.frames, 0);
    const double sigma[SIZE] = {0.02, 0.1 * BST_DEG_RAD, 1.0 / corner_px, 1.0 / corner_px,
                                1.0 / corner_px};
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) { /* the corner's tangent is its angle to 4e-5 */
            double want = i == k ? sigma[i] * sigma[i] : 0.0;
            bst_assert_close(c.p[i][k], want, 2e-4 * want);
            c.p[i][k] = 1e-8 * (1 + i + k) + (i == k ? 1e-6 : 0.0);
        }
        c.x[i] = 1e-3 * (i + 1);
    }
    c.frames = 7;
    bst_camera_calibrator_get(&c, &out);
    assert_int_equal(out.frames, 7);
    bst_assert_close(out.scale, exp(1e-3), 1e-12);
    bst_assert_close(out.rotation_rad, 2e-3, 1e-15);
    bst_assert_close(out.k1 * corner * corner, 3e-3, 1e-6);
    bst_assert_close(out.p1 * corner, 4e-3, 1e-6);
    bst_assert_close(out.p2 * corner, 5e-3, 1e-6);
    const double unit[SIZE] = {exp(1e-3), 1.0, pow(corner, -2.0), 1.0 / corner, 1.0 / corner};
    double roll = 20.0 * BST_ARCSEC_RAD;
    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            double want = c.p[i][k] * unit[i] * unit[k] + (i == 1 && k == 1 ? roll * roll : 0.0);
            bst_assert_close(out.covariance[i][k], want, 4e-4 * want);
        }
    }
}

/* Scale and rotation that were found by other means: their errors are independent of all others',
 * whose covariance stays; what is known exactly stays so. A camera that folds the image changes
 * nothing. */
static void coarse_places_are_set(void **state) {
    (void)state;
    for (int exact = 0; exact < 2; exact++) {
        scene s;
        setup_scene(&s, 7);
        s.config.rotation_sigma_deg = exact ? 0.0 : 0.1;
        make_cameras(&s, 1.001, 0.0, 2.0, (const double[2]){0.0, 0.0});
        bst_camera_calibrator c, before;
        bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
        bst_camera_calibrator_frame frame = draw(&s, 0);
        assert_true(bst_camera_calibrator_update(&c, &frame));
        assert_true(c.p[0][2] != 0.0 && c.p[1][3] != 0.0);
        before = c;
        bst_assert_ok(&s.ctx, bst_camera_calibrator_set(&s.ctx, &c, 1.01, 2e-3, 3e-4));
        bst_assert_close(c.x[0], log(1.01), 1e-15);
        bst_assert_close(c.x[1], 2e-3, 0.0);
        for (int i = 0; i < SIZE; i++) {
            for (int k = 0; k < SIZE; k++) {
                double want = i >= 2 && k >= 2 ? before.p[i][k]
                              : i != k         ? 0.0
                              : i && exact     ? 1e-20
                                               : 9e-8;
                bst_assert_close(c.p[i][k], want, 1e-9 * fabs(want));
            }
        }
        for (int i = 2; i < SIZE; i++) {
            bst_assert_close(c.x[i], before.x[i], 0.0);
        }
        /* its camera has the new scale: a place 300 px from the middle */
        double u, v;
        bst_vec3 d = bst_camera_unproject(&s.onboard, 811.5, 511.5);
        assert_true(bst_camera_project(&c.camera, d, &u, &v));
        bst_assert_close(hypot(u - 511.5, v - 511.5), 300.0 / 1.01, 0.2); /* and 2.0 of k1 */
        c.x[2] = -5.0; /* the place of a radius r is r (1 - 5 r^2), which falls from 0.26 on */
        before = c;
        assert_int_equal(bst_camera_calibrator_set(&s.ctx, &c, 1.0, 0.0, 1.0), BST_ERR_CONFIG);
        assert_memory_equal(&before, &c, sizeof c);
    }
}

/* Frames that no camera explains change nothing; outliers are left out; telemetry without a roll
 * leaves the rotation. */
static void rejects_what_does_not_fit(void **state) {
    (void)state;
    scene s;
    setup_scene(&s, 4);
    make_cameras(&s, 1.001, 0.0, 0.0, (const double[2]){0.0, 0.0});
    bst_camera_calibrator c, before;
    bst_camera_calibrator_begin(&s.config, &s.onboard, &c);
    bst_camera_calibrator_frame frame = draw(&s, 0);
    frame.count = 3;
    assert_false(bst_camera_calibrator_update(&c, &frame));
    frame = draw(&s, 0);
    for (int i = 0; i < STARS; i += 2) {
        s.stars[i].x_px += 30.0 * (i % 4 ? 1 : -1);
    }
    before = c;
    assert_false(bst_camera_calibrator_update(&c, &frame));
    assert_memory_equal(&before, &c, sizeof c);
    frame = draw(&s, 1);
    s.stars[3].y_px += 5.0;
    frame.telemetry_roll_rad = NAN;
    assert_true(bst_camera_calibrator_update(&c, &frame));
    bst_camera_calibration out;
    bst_camera_calibrator_get(&c, &out);
    assert_true(fabs(out.scale - 1.001) < 4e-4); /* 1 sigma 1e-4 */
    assert_true(fabs(out.rotation_rad) < 1e-5);
    assert_true(sqrt(out.covariance[1][1]) > 0.09 * BST_DEG_RAD);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(learns_scale_rotation_and_distortion),
        cmocka_unit_test(covariance_is_that_of_the_errors),
        cmocka_unit_test(follows_a_drift),
        cmocka_unit_test(variance_grows_with_time),
        cmocka_unit_test(units_of_the_covariance),
        cmocka_unit_test(coarse_places_are_set),
        cmocka_unit_test(rejects_what_does_not_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
