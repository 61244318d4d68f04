/* Image of stars along a path and the normal equations of its fit, against sums over all pixels and
 * finite differences; the camera is turned, distorted and off centre, the frame is not square. */
#include "sim/process/twin/normal_equations.h"
#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

enum { STARS = 4, MOST = 64 };

static void profile_is_the_integral_of_a_gaussian(void **state) {
    (void)state;
    static const double sigmas[] = {0.4, 1.3, 5.5};
    for (int s = 0; s < 3; s++) {
        double sigma = sigmas[s], at = 20.3;
        bst_twin_profile p;
        bst_twin_profile_at(at, sigma, 3, 60, &p);
        assert_int_equal(p.first, (int)fmax(ceil(at - 4.5 * sigma - 0.5), 3.0));
        assert_int_equal(p.first + p.count - 1, (int)floor(at + 4.5 * sigma + 0.5));
        for (int i = 0; i < p.count; i++) {
            double sum[4] = {0}; /* value; its derivatives by place and logarithm of the width */
            for (int k = 0; k < 400; k++) {
                double u = (p.first + i - 0.5 + (k + 0.5) / 400 - at) / sigma;
                double g = exp(-0.5 * u * u) / (sigma * sqrt(2.0 * BST_PI)) / 400;
                sum[0] += g;
                sum[1] += g * u / sigma;
                sum[2] += g * (u * u - 1.0);
            }
            bst_assert_close(p.value[i], sum[0], 1e-6); /* midpoints of 1/400 px */
            bst_assert_close(p.slope[i], sum[1], 4e-6);
            bst_assert_close(p.width[i], sum[2], 4e-6);
        }
    }
    bst_twin_profile p;
    bst_twin_profile_at(50.2, 1.0, 0, 52, &p); /* cut at the edge */
    assert_int_equal(p.first, 46);
    assert_int_equal(p.count, 6);
    bst_twin_profile_at(80.0, 1.0, 0, 52, &p);
    assert_int_equal(p.count, 0);
}

static void quadratures_are_as_fine_as_the_motion_asks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin_nodes n;
    /* uniform motion of 30 px about y, and a roll that moves the corner by 12 px */
    bst_twin_model m = {.camera = {.width_px = 300, .height_px = 200, .pixel_scale_arcsec = 60.0},
                        .path = {.q_reference = BST_QUAT_IDENTITY, .count = {2, 2}}};
    double scale = 60.0 * BST_ARCSEC_RAD;
    m.path.coefficients[1][1] = 30.0 * scale;
    m.path.coefficients[2][1] = 12.0 / hypot(150.0, 100.0);
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &m.camera));
    bst_assert_ok(&ctx, bst_twin_nodes_create(&ctx, &m, &n));
    /* 42 px in parts of 2 px and 5 px, and one more */
    assert_int_equal(n.count[0], 3 * 22);
    assert_int_equal(n.count[1], 3 * 10);
    for (int c = 0; c < 2; c++) {
        double sum[6] = {0};
        for (int i = 0; i < n.count[c]; i++) {
            const bst_twin_node *a = &n.node[c][i];
            assert_true(i == 0 || a->t > a[-1].t);
            for (int k = 0; k < 6; k++) {
                sum[k] += a->weight * pow(a->t, k);
            }
            bst_quat q = bst_twin_path_attitude(&m.path, a->t);
            bst_assert_close(a->q_cam_from_gcrf.y, q.y, 0.0);
            bst_assert_close(a->q_cam_from_gcrf.z, q.z, 0.0);
        }
        for (int k = 0; k < 6; k++) { /* Gauss's rule with 3 nodes is exact to degree 5 */
            bst_assert_close(sum[k], 1.0 / (k + 1), 1e-14);
        }
    }
    bst_twin_nodes_free(&n);
}

static void places_move_as_the_camera_turns(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    const bst_twin_model m = bst_test_twin_model(stars, STARS);
    bst_twin_nodes n;
    bst_assert_ok(&ctx, bst_twin_nodes_create(&ctx, &m, &n));
    bst_twin_place *p = malloc((size_t)n.count[0] * sizeof *p);
    for (int s = 0; s < STARS; s++) {
        bst_twin_star_places(&m, &n, 0, stars[s].apparent, p);
        for (int i = 0; i < n.count[0]; i += 5) {
            bst_vec3 v = bst_quat_rotate(n.node[0][i].q_cam_from_gcrf, stars[s].apparent);
            double x, y;
            assert_true(bst_camera_project(&m.camera, v, &x, &y));
            bst_assert_close(p[i].x_px, x, 4e-6); /* single precision */
            bst_assert_close(p[i].y_px, y, 4e-6);
            for (int axis = 0; axis < 3; axis++) {
                double h = 1e-6, ax, ay, bx, by;
                const bst_vec3 turn = {axis == 0 ? h : 0.0, axis == 1 ? h : 0.0,
                                       axis == 2 ? h : 0.0};
                bst_quat q = bst_quat_from_rotvec(turn);
                assert_true(bst_camera_project(&m.camera, bst_quat_rotate(q, v), &ax, &ay));
                assert_true(
                    bst_camera_project(&m.camera, bst_quat_rotate(bst_quat_conj(q), v), &bx, &by));
                /* of 3400 px/rad; single precision and finite difference */
                bst_assert_close(p[i].dx[axis], (ax - bx) / (2.0 * h), 1e-3);
                bst_assert_close(p[i].dy[axis], (ay - by) / (2.0 * h), 1e-3);
            }
        }
    }
    bst_twin_star_places(&m, &n, 1, bst_vec3_scale(stars[0].apparent, -1.0), p);
    assert_true(p[0].x_px < -1e5F && p[0].y_px < -1e5F && p[0].dx[0] == 0.0F);
    free(p);
    bst_twin_nodes_free(&n);
}

/* Data: the model, disturbed, with a pixel without a value and two beyond the limit of the loss. */
static void make_data(const bst_twin_model *m, float *data, float *variance) {
    static double pixels[BST_TEST_PIXELS];
    bst_test_frame(m, pixels);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        variance[i] = (float)(20.0 + 0.3 * (i % 7) + 0.5 * pixels[i]);
        data[i] = (float)(pixels[i] + 3.0 * sin(1.7 * i) + (i == 500 ? 90.0 : 0.0));
    }
    data[700] = NAN;
    data[1234] -= 200.0F;
}

/* A model with one parameter changed. */
static bst_twin_model changed(const bst_twin_model *m, const bst_twin_layout *l, int parameter,
                              double by, bst_twin_star *stars) {
    bst_twin_model c = *m;
    memcpy(stars, m->stars, STARS * sizeof *stars);
    c.stars = stars;
    for (int axis = 0; axis < 3; axis++) {
        int k = parameter - l->angle[axis];
        if (l->angle[axis] >= 0 && k >= 0 && k < m->path.count[axis == 2]) {
            c.path.coefficients[axis][k] += by / 3000.0; /* about px */
        }
    }
    c.camera.pixel_scale_arcsec *= parameter == l->log_scale ? exp(-by) : 1.0;
    if (l->psf >= 0 && parameter >= l->psf && parameter < l->psf + 3) {
        int k = parameter - l->psf;
        c.psf.sigma_px *= k == 0 ? exp(by) : 1.0;
        c.psf.ratio *= k == 1 ? exp(by) : 1.0;
        c.psf.wide += k == 2 ? by : 0.0;
    }
    if (parameter >= l->background && parameter < l->background + BST_TWIN_BACKGROUND) {
        c.background_e[parameter - l->background] += by;
    }
    for (int i = 0; i < STARS; i++) {
        stars[i].flux_e += parameter == l->flux[i] ? by : 0.0;
        if (l->place[i] >= 0 && (parameter - l->place[i]) / 2 == 0 && parameter >= l->place[i]) {
            bst_twin_star_shift(m, &stars[i], parameter == l->place[i] ? by : 0.0,
                                parameter == l->place[i] ? 0.0 : by);
        }
    }
    return c;
}

static bool is_angle(const bst_twin_layout *l, int parameter) {
    return parameter < l->log_scale && parameter >= 0;
}

static void normal_equations_are_sums_over_the_pixels(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS], light[BST_TEST_PIXELS];
    static double frame[BST_TEST_PIXELS], up[BST_TEST_PIXELS], down[BST_TEST_PIXELS],
        slope[MOST][BST_TEST_PIXELS], matrix[MOST * MOST], gradient[MOST];
    static bst_twin_layout l;
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS], others[STARS];
    bst_twin_model m = bst_test_twin_model(stars, STARS);
    make_data(&m, data, variance);
    m.data_e = data;
    m.variance_e2 = variance;
    m.background_e[4] += 0.5; /* so that the gradient is not that of the minimum */
    stars[1].flux_e *= 1.05;
    stars[2].found = true;
    stars[3].sigma_e = 1e9; /* stays as it is */
    const bst_twin_freedom all = {
        .path = true, .roll = true, .scale = true, .psf = true, .least_snr = 3.0};
    bst_twin_layout_make(&m, &all, &l);
    /* 5 + 5 + 4 of the path, scale, 3 of the PSF, 6 of the background, 3 fluxes, one place */
    assert_int_equal(l.count, 14 + 1 + 3 + 6 + 3 + 2);
    assert_int_equal(l.flux[3], -1);
    assert_int_equal(l.place[0], -1);
    bst_twin_sums s = {.matrix = matrix, .gradient = gradient};
    bst_assert_ok(&ctx, bst_twin_evaluate(&ctx, &m, &l, NULL, light, &s));

    bst_test_frame(&m, frame);
    double loss = 0.0;
    static double weight[BST_TEST_PIXELS];
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        double stars_e = frame[i] - bst_twin_background(&m, i % BST_TEST_NX, i / BST_TEST_NX);
        /* of up to 400 e-; the quadratures differ, and where a Gaussian is cut */
        bst_assert_close(light[i], stars_e, 5e-2);
        double u = fabs(data[i] - frame[i]) / sqrt(variance[i]);
        weight[i] = isfinite(data[i]) ? (u > 4.0 ? 4.0 / u : 1.0) / variance[i] : 0.0;
        loss += !isfinite(data[i]) ? 0.0 : u > 4.0 ? 4.0 * u - 8.0 : 0.5 * u * u;
    }
    bst_assert_close(s.loss, loss, 1e-3 * loss);
    for (int k = 0; k < l.count; k++) {
        double h = 1e-3;
        bst_twin_model c = changed(&m, &l, k, h, others);
        bst_test_frame(&c, up);
        c = changed(&m, &l, k, -h, others);
        bst_test_frame(&c, down);
        for (int i = 0; i < BST_TEST_PIXELS; i++) {
            slope[k][i] = (up[i] - down[i]) / (2.0 * h) * (is_angle(&l, k) ? 3000.0 : 1.0);
        }
    }
    for (int a = 0; a < l.count; a++) {
        double g = 0.0, scale = 0.0;
        for (int i = 0; i < BST_TEST_PIXELS; i++) {
            g += weight[i] > 0.0 ? weight[i] * slope[a][i] * (data[i] - frame[i]) : 0.0;
            scale += weight[i] * slope[a][i] * slope[a][i];
        }
        /* residuals of about one sigma: parts of the square root of the diagonal element */
        bst_assert_close(gradient[a], g, 3e-2 * sqrt(scale));
        for (int b = 0; b <= a; b++) {
            double sum = 0.0, other = 0.0;
            for (int i = 0; i < BST_TEST_PIXELS; i++) {
                sum += weight[i] * slope[a][i] * slope[b][i];
                other += weight[i] * slope[b][i] * slope[b][i];
            }
            /* rotations are taken as small: the roll is about the boresight of the moment, which
             * is up to 3 px from that of its parameter, of up to 25 px to the stars */
            bool roll = a >= l.angle[2] && l.angle[2] + m.path.count[1] > b &&
                        (a < l.log_scale || b >= l.angle[2]);
            double most = (roll ? 8e-2 : 6e-3) * sqrt(scale * other);
            bst_assert_close(matrix[a * l.count + b], sum, most);
        }
    }
}

static void one_thread_or_many_and_derivatives_or_none(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS], light[BST_TEST_PIXELS],
        residual[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    bst_twin_model m = bst_test_twin_model(stars, STARS);
    make_data(&m, data, variance);
    m.data_e = data;
    m.variance_e2 = variance;
    m.psf.wide = 0.0; /* no wide Gaussian: its nodes are skipped */
    bst_assert_ok(&ctx, bst_twin_model_render(&ctx, &m, NULL, light));
    bst_assert_ok(&ctx, bst_twin_model_residual(&ctx, &m, NULL, residual));
    static double frame[BST_TEST_PIXELS];
    bst_test_frame(&m, frame);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        double b = bst_twin_background(&m, i % BST_TEST_NX, i / BST_TEST_NX);
        bst_assert_close(light[i], frame[i] - b, 5e-2);
        if (i == 700) {
            assert_true(isnan(residual[i]));
        } else {
            bst_assert_close(residual[i], data[i] - frame[i], 5e-2);
        }
    }
    assert_int_equal(bst_twin_path_values(&m.path), 5 + 5 + 4);
}

static void length_of_a_path_without_its_roll(void **state) {
    (void)state;
    bst_twin_model m = {.camera = {.width_px = 300, .height_px = 200, .pixel_scale_arcsec = 60.0},
                        .path = {.q_reference = BST_QUAT_IDENTITY, .count = {2, 2}}};
    double scale = 60.0 * BST_ARCSEC_RAD;
    m.path.coefficients[0][1] = -12.0 * scale;
    m.path.coefficients[1][1] = 35.0 * scale;
    m.path.coefficients[2][1] = 1e-3;
    bst_assert_close(bst_twin_path_length_px(&m), 37.0, 1e-4); /* hypot(12, 35) */
}

/* Light of long frames, whose tiles lie far from one another along one axis. */
static void light_reaches_all_tiles_of_long_frames(void **state) {
    (void)state;
    enum { LONG = 170, SHORT = 40 };
    static float light[LONG * SHORT], data[LONG * SHORT], variance[LONG * SHORT];
    static double sum[LONG * SHORT];
    for (int tall = 0; tall < 2; tall++) {
        bst_ctx ctx = {0};
        bst_twin_star stars[3];
        bst_twin_model m = bst_test_twin_model(stars, 3);
        const int width = tall ? SHORT : LONG, height = tall ? LONG : SHORT;
        m.width = width;
        m.height = height;
        m.data_e = data; /* not read: the light alone */
        m.variance_e2 = variance;
        m.camera.width_px = width;
        m.camera.height_px = height;
        bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &m.camera));
        bst_quat back = bst_quat_conj(bst_twin_path_attitude(&m.path, 0.5));
        static const double places[][2] = {{150.0, 9.0}, {97.3, 30.2}, {14.0, 26.0}};
        memset(sum, 0, sizeof sum);
        for (int i = 0; i < 3; i++) {
            bst_vec3 v = bst_camera_unproject(&m.camera, places[i][tall], places[i][!tall]);
            stars[i].apparent = bst_quat_rotate(back, v);
            for (int k = 0; k < 100; k++) {
                double x, y, t = (k + 0.5) / 100, wide = m.psf.wide;
                v = bst_quat_rotate(bst_twin_path_attitude(&m.path, t), stars[i].apparent);
                assert_true(bst_camera_project(&m.camera, v, &x, &y));
                for (int c = 0; c < 2; c++) {
                    double sigma = m.psf.sigma_px * (c ? m.psf.ratio : 1.0);
                    double e = stars[i].flux_e * (c ? wide : 1.0 - wide) / 100;
                    for (int row = 0; row < height; row++) {
                        double share = bst_test_gaussian_part(sigma, row - y);
                        for (int col = 0; share > 0.0 && col < width; col++) {
                            sum[row * width + col] +=
                                e * share * bst_test_gaussian_part(sigma, col - x);
                        }
                    }
                }
            }
        }
        bst_assert_ok(&ctx, bst_twin_model_render(&ctx, &m, NULL, light));
        for (int i = 0; i < LONG * SHORT; i++) {
            bst_assert_close(light[i], sum[i], 5e-2); /* of up to 300 e-, as above */
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profile_is_the_integral_of_a_gaussian),
        cmocka_unit_test(quadratures_are_as_fine_as_the_motion_asks),
        cmocka_unit_test(places_move_as_the_camera_turns),
        cmocka_unit_test(normal_equations_are_sums_over_the_pixels),
        cmocka_unit_test(one_thread_or_many_and_derivatives_or_none),
        cmocka_unit_test(length_of_a_path_without_its_roll),
        cmocka_unit_test(light_reaches_all_tiles_of_long_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
