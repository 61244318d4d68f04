/* Rotation and distortion of the focal plane: the convention by hand, the inverse, folds, and the
 * helpers for those who linearise. */
#include "boresight/camera.h"
#include "tests/test_support.h"

static bst_camera make(double scale_arcsec, double rotation_deg, bst_camera_distortion d) {
    bst_camera c = {.width_px = 1024,
                    .height_px = 768,
                    .pixel_scale_arcsec = scale_arcsec,
                    .rotation_deg = rotation_deg,
                    .distortion = d};
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    return c;
}

/* x = 0.3, y = -0.2: r^2 = 0.13, r^4 = 0.0169, r^6 = 0.002197. L = 1 - 0.2 * 0.13 + 0.05 * 0.0169 +
 * 0.1 * 0.002197 = 0.9750647. x' = 0.3 L + 2 * 0.01 * 0.3 * -0.2 + 0.02 (0.13 + 0.18) = 0.29751941,
 * y' = -0.2 L + 0.01 (0.13 + 0.08) + 2 * 0.02 * 0.3 * -0.2 = -0.19531294. */
static void convention_is_brown_s_as_opencv_writes_it(void **state) {
    (void)state;
    bst_camera c = make(100, 0, (bst_camera_distortion){-0.2, 0.05, 0.1, 0.01, 0.02});
    double x, y, scale = bst_camera_scale_rad(&c);
    assert_true(bst_camera_project(&c, (bst_vec3){0.6, -0.4, 2.0}, &x, &y));
    /* 1e-8 of digits above over 4.8e-4 rad per pixel */
    bst_assert_close(x, 511.5 + 0.29751941 / scale, 2e-5);
    bst_assert_close(y, 383.5 - 0.19531294 / scale, 2e-5);
    assert_true(c.geometry.general && bst_camera_distorted(&c));
}

/* The focal plane's x axis lies at rotation_deg from camera +x towards +y. */
static void rotation_turns_the_focal_plane(void **state) {
    (void)state;
    const double angles[] = {0, 90, 180, -37, 30, -90};
    for (int i = 0; i < 6; i++) {
        bst_camera c = make(3, angles[i], (bst_camera_distortion){0});
        double scale = bst_camera_scale_rad(&c), x, y, a = angles[i] * BST_DEG_RAD;
        const double t = 100 * scale;
        assert_true(bst_camera_project(&c, (bst_vec3){t * cos(a), t * sin(a), 1}, &x, &y));
        bst_assert_close(x, 611.5, 1e-9); /* rounding of 100 px */
        bst_assert_close(y, 383.5, 1e-9);
        bst_assert_close(bst_camera_stretch(&c), 1, 0);
        /* a star along camera +x appears turned the other way */
        assert_true(bst_camera_project(&c, (bst_vec3){t, 0, 1}, &x, &y));
        bst_assert_close(x, 511.5 + 100 * cos(a), 1e-9);
        bst_assert_close(y, 383.5 - 100 * sin(a), 1e-9);
        assert_true(c.geometry.general == (angles[i] != 0));
    }
}

static void expect_round_trip(const bst_camera *c, double tolerance_px) {
    for (double px = -0.5; px <= 1023.5; px += 32) {
        for (double py = -0.5; py <= 767.5; py += 32) {
            bst_vec3 d = bst_camera_unproject(c, px, py);
            bst_assert_close(bst_vec3_norm(d), 1, 1e-15);
            double x = NAN, y = NAN;
            assert_true(bst_camera_project(c, bst_vec3_scale(d, 3.7), &x, &y));
            bst_assert_close(x, px, tolerance_px);
            bst_assert_close(y, py, tolerance_px);
        }
    }
}

/* r of the corner: 640 px of 3 arcsec are 0.0093, of 200 arcsec 0.62. */
static void unproject_inverts_project(void **state) {
    (void)state;
    const double angles[] = {0, 90, 180, -37};
    for (int i = 0; i < 4; i++) {
        const bst_camera cameras[] = {
            make(3, angles[i], (bst_camera_distortion){.k1 = 230}),   /* +2 % in the corner */
            make(3, angles[i], (bst_camera_distortion){.k1 = -230}),  /* -2 % */
            make(3, angles[i], (bst_camera_distortion){.k1 = 11000}), /* +95 % */
            make(3, angles[i], (bst_camera_distortion){.k1 = -1500}), /* -17 % */
            make(3, angles[i], (bst_camera_distortion){200, -1e6, 3e10, 0.1, -0.2}),
            make(200, angles[i], (bst_camera_distortion){-0.2, 0.05, 0.1, 0.01, 0.02}),
            make(200, angles[i], (bst_camera_distortion){5, 20, 100, 0, 0}),
            make(0.001, angles[i], (bst_camera_distortion){.k1 = 2e9}),
        };
        for (size_t k = 0; k < sizeof cameras / sizeof *cameras; k++) {
            /* rounding of 500 px is 1e-13 */
            expect_round_trip(&cameras[k], 1e-9);
        }
    }
    bst_camera c = make(3, 12, (bst_camera_distortion){.k1 = 230});
    c.boresight_offset_px[0] = 40.25;
    c.boresight_offset_px[1] = -17;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    expect_round_trip(&c, 1e-9);
    double x, y;
    assert_true(bst_camera_project(&c, (bst_vec3){0, 0, 1}, &x, &y));
    bst_assert_close(x, 551.75, 1e-12);
    bst_assert_close(y, 366.5, 1e-12);
}

/* r (1 + k1 r^2) with k1 < 0 folds at r = 1 / sqrt(-3 k1), whose image is 2/3 of that. */
static double k1_that_folds_at(const bst_camera *c, double corners) {
    double r = 1.5 * corners * bst_camera_scale_rad(c) *
               hypot(0.5 * (double)c->width_px, 0.5 * (double)c->height_px);
    return -1 / (3 * r * r);
}

static void folds_are_refused_inside_the_sensor_only(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_camera c = make(3, -37, (bst_camera_distortion){0});
    const double near[] = {1.5, 1.01, 1.0001, 1.000001, 1 + 1e-9};
    for (int i = 0; i < 5; i++) {
        c.distortion.k1 = k1_that_folds_at(&c, near[i]);
        bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
        expect_round_trip(&c, 1e-9);
    }
    const double over[] = {1 - 1e-9, 0.999, 0.5, 1e-6};
    for (int i = 0; i < 4; i++) {
        c.distortion.k1 = k1_that_folds_at(&c, over[i]);
        assert_int_equal(bst_camera_prepare(&ctx, &c), BST_ERR_CONFIG);
        assert_false(c.geometry.general);
    }
    assert_int_equal(bst_camera_prepare(&ctx, &c), BST_ERR_CONFIG);
    c.distortion.k1 = k1_that_folds_at(&c, 0.5);
    assert_int_equal(bst_camera_prepare(&ctx, &c), BST_ERR_CONFIG);
    /* sqrt(512^2 + 384^2) = 640 */
    assert_non_null(strstr(ctx.message,
                           "the image folds 320.0 px from the boresight, inside the "
                           "sensor, whose farthest corner lies at 640.0 px: weaken the "
                           "coefficients (k1 "));
    /* the fold is where 1 + 3 k1 s + 5 k2 s^2 = 0: none when 9 k1^2 < 20 k2, and one that a later
     * term takes back beyond it is one all the same */
    c.distortion.k2 = 0.4 * c.distortion.k1 * c.distortion.k1;
    assert_int_equal(bst_camera_prepare(&ctx, &c), BST_ERR_CONFIG);
    c.distortion.k2 = 0.5 * c.distortion.k1 * c.distortion.k1;
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    expect_round_trip(&c, 1e-9);
    /* tangential terms fold too: 1 = 6 p2 r on one side */
    c.distortion = (bst_camera_distortion){.p2 = 1 / (6 * 0.5 * 640 * bst_camera_scale_rad(&c))};
    assert_int_equal(bst_camera_prepare(&ctx, &c), BST_ERR_CONFIG);
    c.distortion.p2 = 1 / (6 * 2.1 * 640 * bst_camera_scale_rad(&c));
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    expect_round_trip(&c, 1e-9);
}

/* Nothing outside the field comes back into it through a folded polynomial, and every place on the
 * sensor has one direction. */
static void no_ghosts_from_beyond_the_fold(void **state) {
    (void)state;
    bst_camera c = make(3, 20, (bst_camera_distortion){0});
    c.distortion.k1 = k1_that_folds_at(&c, 1.1);
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    double farthest = bst_camera_half_diagonal_rad(&c);
    for (int i = 0; i < 4000; i++) {
        double angle = farthest + (0.5 * BST_PI - farthest) * pow(i / 4000.0, 3) + 1e-9;
        double around = 2.399963 * i, x, y;
        bst_vec3 v = {sin(angle) * cos(around), sin(angle) * sin(around), cos(angle)};
        bool on = bst_camera_project(&c, v, &x, &y) && x >= -0.5 && x <= 1023.5 && y >= -0.5 &&
                  y <= 767.5;
        assert_false(on);
    }
    double x = 7, y = 7;
    assert_false(bst_camera_project(&c, (bst_vec3){1, 0, 1}, &x, &y));
    assert_false(bst_camera_project(&c, (bst_vec3){0, 0, -1}, &x, &y));
    assert_false(bst_camera_project(&c, (bst_vec3){(double)NAN, 0, 1}, &x, &y));
    assert_true(x == 7 && y == 7);
    /* places without an original: the border's direction, at any distance */
    bst_vec3 border = bst_camera_unproject(&c, 5000, 383.5);
    bst_assert_close(bst_vec3_angle(border, bst_camera_unproject(&c, 1e30, 383.5)), 0, 1e-5);
    assert_true(bst_vec3_angle(border, (bst_vec3){0, 0, 1}) >= farthest);
}

static void jacobian_is_the_derivative(void **state) {
    (void)state;
    const bst_camera c = make(200, -37, (bst_camera_distortion){-0.2, 0.05, 0.1, 0.01, 0.02});
    double scale = bst_camera_scale_rad(&c);
    for (double a = -0.4; a <= 0.4; a += 0.1) {
        for (double b = -0.3; b <= 0.3; b += 0.1) {
            const double h = 1e-5;
            double k[2][2], x[4] = {0}, y[4] = {0};
            const double da[] = {h, -h, 0, 0}, db[] = {0, 0, h, -h};
            for (int i = 0; i < 4; i++) {
                assert_true(
                    bst_camera_project(&c, (bst_vec3){a + da[i], b + db[i], 1}, &x[i], &y[i]));
            }
            bst_camera_jacobian(&c, (bst_vec3){2 * a, 2 * b, 2}, k);
            /* h^2 of the third derivative (about 1) and 1e-13 px over 2 h */
            bst_assert_close(k[0][0], (x[0] - x[1]) / (2 * h) * scale, 1e-8);
            bst_assert_close(k[0][1], (x[2] - x[3]) / (2 * h) * scale, 1e-8);
            bst_assert_close(k[1][0], (y[0] - y[1]) / (2 * h) * scale, 1e-8);
            bst_assert_close(k[1][1], (y[2] - y[3]) / (2 * h) * scale, 1e-8);
            /* singular values within the stated bounds */
            double f =
                k[0][0] * k[0][0] + k[0][1] * k[0][1] + k[1][0] * k[1][0] + k[1][1] * k[1][1];
            double det = k[0][0] * k[1][1] - k[0][1] * k[1][0];
            double big = sqrt(0.5 * (f + sqrt(fmax(f * f - 4 * det * det, 0))));
            assert_true(big <= bst_camera_stretch(&c) + 1e-12);
            assert_true(det / big >= bst_camera_shrink(&c) - 1e-12);
        }
    }
    double k[2][2];
    bst_camera plain = {.width_px = 10, .height_px = 10, .pixel_scale_arcsec = 3};
    bst_camera_jacobian(&plain, (bst_vec3){0.1, 0.2, 1}, k);
    assert_true(k[0][0] == 1 && k[1][1] == 1 && k[0][1] == 0 && k[1][0] == 0);
}

/* Barrel distortion sees more of the sky than the pixels at the boresight would say. */
static void reach_holds_the_field(void **state) {
    (void)state;
    const bst_camera_distortion cases[] = {{.k1 = -1500}, {.k1 = 1500}, {.k1 = 230, .p1 = 0.3}};
    for (int i = 0; i < 3; i++) {
        const bst_camera c = make(3, 33, cases[i]);
        const double windows[][4] = {{-5, -5, 1028, 772}, {700, 20, 900, 120}};
        for (int w = 0; w < 2; w++) {
            const double *r = windows[w];
            bst_vec3 centre = bst_camera_unproject(&c, 0.5 * (r[0] + r[2]), 0.5 * (r[1] + r[3]));
            double reach = bst_camera_reach_rad(&c, centre, r[0], r[1], r[2], r[3], 0), seen = 0;
            for (int k = 0; k <= 100; k++) {
                for (int m = 0; m <= 100; m++) {
                    bst_vec3 v = bst_camera_unproject(&c, r[0] + 0.01 * k * (r[2] - r[0]),
                                                      r[1] + 0.01 * m * (r[3] - r[1]));
                    seen = fmax(seen, bst_vec3_angle(centre, v));
                }
            }
            assert_true(reach >= seen && reach < 1.2 * seen);
        }
        double w_px, h_px, scale = bst_camera_scale_rad(&c);
        bst_camera_field_px(&c, &w_px, &h_px);
        for (int k = 0; k < 400; k++) {
            double u = k % 100 / 49.5 - 1;
            double a = (k < 200 ? u : k < 300 ? 1 : -1) * 0.4999 * w_px * scale;
            double b = (k >= 200 ? u : k < 100 ? 1 : -1) * 0.4999 * h_px * scale;
            double cs = cos(33 * BST_DEG_RAD), sn = sin(33 * BST_DEG_RAD), x, y;
            assert_true(
                bst_camera_project(&c, (bst_vec3){cs * a - sn * b, sn * a + cs * b, 1}, &x, &y));
            assert_true(x > -0.51 && x < 1023.51 && y > -0.51 && y < 767.51);
        }
    }
    double w_px, h_px;
    bst_camera plain = {.width_px = 10, .height_px = 20, .pixel_scale_arcsec = 3};
    bst_camera_field_px(&plain, &w_px, &h_px);
    assert_true(w_px == 10 && h_px == 20);
}

/* Coefficients of one sign: the second derivative of r (1 + k1 r^2 + k2 r^4 + k3 r^6) is
 * 6 k1 r + 20 k2 r^3 + 42 k3 r^5, greatest where the bound ends, a tenth beyond the corner; the
 * tangential terms bend by 6 |p| at most. Corner of 1024 x 768 pixels of 200 arcsec: 640 px. */
static void curvature_is_bounded_by_the_second_derivative(void **state) {
    (void)state;
    const bst_camera_distortion d = {0.2, 0.3, 0.4, 0.03, -0.04};
    const bst_camera c = make(200, 0, d);
    double r = 0.0;
    for (int i = 0; i < 4; i++) {
        bst_vec3 v = bst_camera_unproject(&c, i & 1 ? 1023.5 : -0.5, i & 2 ? 767.5 : -0.5);
        r = fmax(r, hypot(v.x, v.y) / v.z);
    }
    r *= 1.1;
    double want = 6 * 0.2 * r + 20 * 0.3 * pow(r, 3) + 42 * 0.4 * pow(r, 5) + 6 * 0.05;
    bst_assert_close(c.geometry.curvature, want, 1e-9); /* rounding, and the inverse's 1e-10 px */
}

/* Within image_radius every place has an original: it is how near the image of the domain's edge
 * comes to the boresight, found here by walking round it. */
static void image_radius_is_the_nearest_of_the_border(void **state) {
    (void)state;
    const bst_camera_distortion cases[] = {{.k1 = -0.3, .p1 = 0.02}, {.k1 = -0.3, .p2 = -0.03}};
    for (int i = 0; i < 2; i++) {
        const bst_camera c = make(100, 0, cases[i]);
        double least = INFINITY, domain = c.geometry.domain * (1 - 1e-9);
        double scale = bst_camera_scale_rad(&c);
        for (int k = 0; k < 3600; k++) {
            double a = 2 * BST_PI * k / 3600, x, y;
            assert_true(
                bst_camera_project(&c, (bst_vec3){domain * cos(a), domain * sin(a), 1}, &x, &y));
            least = fmin(least, scale * hypot(x - 511.5, y - 383.5));
        }
        bst_assert_close(c.geometry.image_radius, least, 1e-6); /* 0.05 degrees squared, 1e-9 */
    }
}

/* Without turn and tangential terms the fold lies at r = 1 / sqrt(-3 k1). */
static void beyond_the_fold_by_a_margin(void **state) {
    (void)state;
    bst_camera c = make(3, 0, (bst_camera_distortion){0});
    c.distortion.k1 = k1_that_folds_at(&c, 1.2);
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    double fold = 1 / sqrt(-3 * c.distortion.k1), scale = bst_camera_scale_rad(&c);
    const double off[] = {-1, 1, 9, 11};
    for (int i = 0; i < 4; i++) {
        double r = fold + off[i] * scale;
        assert_true(bst_camera_beyond_fold(&c, (bst_vec3){0.6 * r, 0.8 * r, 1}, 10) ==
                    (off[i] > 0 && off[i] < 10));
    }
    assert_false(bst_camera_beyond_fold(&c, (bst_vec3){0, -fold - scale, -1}, 10));
}

/* What is beyond the fold is reckoned with where the rectangle reaches beyond its image, 700 px
 * from (511.5, 383.5): downwards from y = 1083.5 on, upwards from -316.5, to the sides likewise. */
static void reach_beyond_the_fold(void **state) {
    (void)state;
    bst_camera c = make(3, 0, (bst_camera_distortion){0});
    c.distortion.k1 = k1_that_folds_at(&c, 700.0 / 640.0);
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    const struct {
        double window[4];
        bool folds;
    } cases[] = {{{500, 300, 520, 1080}, false}, {{500, 300, 520, 1090}, true},
                 {{500, -310, 520, 400}, false}, {{500, -330, 520, 400}, true},
                 {{400, 380, 1208, 390}, false}, {{400, 380, 1218, 390}, true},
                 {{-185, 380, 600, 390}, false}, {{-195, 380, 600, 390}, true}};
    for (int i = 0; i < 8; i++) {
        const double *w = cases[i].window;
        double with = bst_camera_reach_rad(&c, (bst_vec3){0, 0, 1}, w[0], w[1], w[2], w[3], 50);
        double plain = bst_camera_reach_rad(&c, (bst_vec3){0, 0, 1}, w[0], w[1], w[2], w[3], 0);
        bst_assert_close(with - plain, cases[i].folds ? 50 * bst_camera_scale_rad(&c) : 0, 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(curvature_is_bounded_by_the_second_derivative),
        cmocka_unit_test(image_radius_is_the_nearest_of_the_border),
        cmocka_unit_test(beyond_the_fold_by_a_margin),
        cmocka_unit_test(reach_beyond_the_fold),
        cmocka_unit_test(convention_is_brown_s_as_opencv_writes_it),
        cmocka_unit_test(rotation_turns_the_focal_plane),
        cmocka_unit_test(unproject_inverts_project),
        cmocka_unit_test(folds_are_refused_inside_the_sensor_only),
        cmocka_unit_test(no_ghosts_from_beyond_the_fold),
        cmocka_unit_test(jacobian_is_the_derivative),
        cmocka_unit_test(reach_holds_the_field),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
