/* Fit of a frame's model: fluxes by a linear solution of its own, all parameters from a disturbed
 * start, and displacements of single streaks. */
#include "sim/process/twin/normal_equations.h"
#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

enum { STARS = 4, UNKNOWNS = BST_TWIN_BACKGROUND + STARS };

/* A number from -1 to 1 that looks random. */
static double scatter(int i) {
    double s = sin(12.9898 * i + 4.1) * 43758.5453;
    return 2.0 * (s - floor(s)) - 1.0;
}

/* Solves a x = b by Gauss's elimination. */
static void eliminate(const double a[UNKNOWNS][UNKNOWNS], const double b[UNKNOWNS],
                      double x[UNKNOWNS]) {
    double m[UNKNOWNS][UNKNOWNS + 1];
    for (int i = 0; i < UNKNOWNS; i++) {
        memcpy(m[i], a[i], UNKNOWNS * sizeof(double));
        m[i][UNKNOWNS] = b[i];
    }
    for (int i = 0; i < UNKNOWNS; i++) {
        for (int k = 0; k < UNKNOWNS; k++) {
            double f = k == i ? 0.0 : m[k][i] / m[i][i];
            for (int j = 0; j <= UNKNOWNS; j++) {
                m[k][j] -= f * m[i][j];
            }
        }
    }
    for (int i = 0; i < UNKNOWNS; i++) {
        x[i] = m[i][UNKNOWNS] / m[i][i];
    }
}

static void fluxes_and_background_are_the_linear_solution(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    static double frame[BST_TEST_PIXELS], shape[UNKNOWNS][BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    bst_twin_model m = bst_test_twin_model(stars, STARS);
    double loss;
    bst_test_frame(&m, frame);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        data[i] = (float)(frame[i] + 4.0 * scatter(i));
    }
    m.data_e = data;
    m.variance_e2 = variance;
    stars[1].expected_e = 3000.0; /* by the catalogue: within a factor */
    stars[3].expected_e = 2000.0;
    static const double off[STARS] = {1.04, 0.97, 1.03, 0.98};
    for (int i = 0; i < STARS; i++) {
        stars[i].flux_e *= off[i];
    }
    m.background_e[1] += 2.0;

    /* variances are those of the model at first: read noise, light and error of the form */
    double a[UNKNOWNS][UNKNOWNS] = {{0}}, b[UNKNOWNS] = {0}, x[UNKNOWNS], column[UNKNOWNS];
    static double start[BST_TEST_PIXELS];
    bst_test_frame(&m, start);
    for (int s = 0; s < STARS; s++) {
        bst_twin_star one = stars[s];
        one.flux_e = 1.0;
        bst_test_add_star(&m, &one, 0.0, 0.0, shape[BST_TWIN_BACKGROUND + s]);
    }
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        double u = 2.0 * (i % BST_TEST_NX) / (BST_TEST_NX - 1) - 1.0;
        double v = 2.0 * (i / BST_TEST_NX) / (BST_TEST_NY - 1) - 1.0;
        const double terms[] = {1.0, u, v, u * u, u * v, v * v};
        double light = start[i] - bst_twin_background(&m, i % BST_TEST_NX, i / BST_TEST_NX);
        double w = 1.0 / (5.0 * 5.0 + light + 0.02 * 0.02 * light * light);
        for (int k = 0; k < BST_TWIN_BACKGROUND; k++) {
            shape[k][i] = terms[k];
        }
        for (int j = 0; j < UNKNOWNS; j++) {
            b[j] += w * shape[j][i] * (double)data[i];
            for (int k = 0; k < UNKNOWNS; k++) {
                a[j][k] += w * shape[j][i] * shape[k][i];
            }
        }
    }
    for (int s = 1; s < STARS; s += 2) {
        double e = stars[s].expected_e;
        a[BST_TWIN_BACKGROUND + s][BST_TWIN_BACKGROUND + s] += 1.0 / (e * e);
        b[BST_TWIN_BACKGROUND + s] += 1.0 / e;
    }
    eliminate(a, b, x);

    const bst_twin_freedom fluxes = {.iterations = 6};
    bst_assert_ok(&ctx, bst_twin_model_fit(&ctx, &m, &fluxes, NULL, &loss));
    assert_true(m.converged);
    double chi2 = 0.0;
    bst_test_frame(&m, frame);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        chi2 += ((double)data[i] - frame[i]) * ((double)data[i] - frame[i]) / (double)variance[i];
    }
    for (int s = 1; s < STARS; s += 2) {
        double r = (stars[s].flux_e - stars[s].expected_e) / stars[s].expected_e;
        chi2 += r * r;
    }
    bst_assert_close(loss, 0.5 * chi2, 1e-3 * chi2);
    for (int k = 0; k < BST_TWIN_BACKGROUND; k++) {
        bst_assert_close(m.background_e[k], x[k], 1e-2); /* of sigma 0.4: quadratures differ */
    }
    for (int s = 0; s < STARS; s++) {
        double unit[UNKNOWNS] = {0};
        unit[BST_TWIN_BACKGROUND + s] = 1.0;
        eliminate(a, unit, column);
        double sigma = sqrt(column[BST_TWIN_BACKGROUND + s]);
        bst_assert_close(stars[s].flux_e, x[BST_TWIN_BACKGROUND + s], 0.05 * sigma);
        bst_assert_close(stars[s].sigma_e, sigma, 2e-3 * sigma);
    }
}

static void all_parameters_come_back(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    static double frame[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS], truth[STARS];
    bst_twin_model m = bst_test_twin_model(stars, STARS);
    const bst_twin_model sound = m;
    double loss;
    memcpy(truth, stars, sizeof truth);
    bst_test_frame(&m, frame);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        data[i] = (float)frame[i];
    }
    m.data_e = data;
    m.variance_e2 = variance;
    m.noise_e = 0.3;
    m.form_error = 0.0;
    stars[2].found = true; /* its place is fitted too, about 3 px */
    bst_twin_star_shift(&m, &stars[2], 0.4, -0.3);
    m.psf.sigma_px = 1.25;
    m.psf.ratio = 2.4;
    m.psf.wide = 0.2;
    m.path.coefficients[0][2] += 1e-4;
    m.path.coefficients[1][3] -= 1.5e-4;
    m.camera.pixel_scale_arcsec *= 1.002;
    const bst_twin_freedom all = {.path = true, .scale = true, .psf = true, .iterations = 25};
    bst_assert_ok(&ctx, bst_twin_model_fit(&ctx, &m, &all, NULL, &loss));
    /* noise-free data, and what is expected of the ratio: 2.5 within a factor of exp(0.4) */
    bst_assert_close(m.psf.sigma_px, 1.1, 5e-3);
    bst_assert_close(m.psf.ratio, 2.1, 2e-2);
    bst_assert_close(m.psf.wide, 0.3, 1e-2);
    for (int i = 0; i < STARS; i++) {
        bst_assert_close(stars[i].flux_e, truth[i].flux_e, 2e-3 * truth[i].flux_e);
        for (int k = 0; k <= 4; k++) {
            double ax, ay, bx, by, t = k / 4.0;
            bst_quat p = bst_twin_path_attitude(&m.path, t),
                     q = bst_twin_path_attitude(&sound.path, t);
            assert_true(
                bst_camera_project(&m.camera, bst_quat_rotate(p, stars[i].apparent), &ax, &ay));
            assert_true(
                bst_camera_project(&sound.camera, bst_quat_rotate(q, truth[i].apparent), &bx, &by));
            bst_assert_close(ax, bx, 2e-2); /* px, of 0.5 at the start */
            bst_assert_close(ay, by, 2e-2);
        }
    }
}

static void ratio_is_drawn_towards_the_usual_one(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    static double frame[BST_TEST_PIXELS], matrix[32 * 32], gradient[32];
    static bst_twin_layout l;
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    bst_twin_model m = bst_test_twin_model(stars, STARS);
    double loss;
    bst_test_frame(&m, frame);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        data[i] = (float)(frame[i] + 8.0 * scatter(i));
    }
    m.data_e = data;
    m.variance_e2 = variance;
    m.noise_e = 60.0; /* the pixels say little */
    const bst_twin_freedom psf = {.psf = true, .iterations = 60};
    for (int i = 0; i < 4; i++) { /* each call ends when it gains less than half a unit */
        bst_assert_ok(&ctx, bst_twin_model_fit(&ctx, &m, &psf, NULL, &loss));
    }
    assert_true(m.psf.ratio > 2.15 && m.psf.ratio < 2.6);
    bst_twin_layout_make(&m, &psf, &l);
    bst_twin_sums s = {.matrix = matrix, .gradient = gradient};
    bst_assert_ok(&ctx, bst_twin_evaluate(&ctx, &m, &l, NULL, NULL, &s));
    /* at the best ratio what is expected balances the pixels; steps end at a gain of 0.5 */
    double expected = -log(m.psf.ratio / 2.5) / (0.4 * 0.4);
    bst_assert_close(gradient[l.psf + 1] + expected, 0.0, 0.25 * fabs(expected) + 0.05);
}

static void displacement_of_a_streak(void **state) {
    (void)state;
    static float residual[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    static double moved[BST_TEST_PIXELS], still[BST_TEST_PIXELS], d[3][BST_TEST_PIXELS],
        other[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    bst_twin_model m = bst_test_twin_model(stars, STARS);
    /* a straight path at 8, 15 of 17 px; no turn and no distortion: one direction for all */
    m.camera.rotation_deg = 0.0;
    m.camera.distortion = (bst_camera_distortion){.k1 = 0.0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &m.camera));
    double scale = bst_camera_scale_rad(&m.camera);
    m.path = (bst_twin_path){.q_reference = m.path.q_reference,
                             .count = {2, 1},
                             .coefficients = {{0.0, -15.0 * scale}, {0.0, 8.0 * scale}, {0.0}}};
    bst_vec3 v = bst_camera_unproject(&m.camera, 21.3, 17.6);
    stars[0].apparent = bst_quat_rotate(bst_quat_conj(bst_twin_path_attitude(&m.path, 0.5)), v);
    stars[0].flux_e = 9000.0;
    const double along[2] = {8.0 / 17.0, 15.0 / 17.0}, across[2] = {-along[1], along[0]};
    static const double by[2] = {0.05, -0.08}; /* across, along */
    memset(moved, 0, sizeof moved);
    memset(still, 0, sizeof still);
    bst_test_add_star(&m, &stars[0], by[0] * across[0] + by[1] * along[0],
                      by[0] * across[1] + by[1] * along[1], moved);
    bst_test_add_star(&m, &stars[0], 0.0, 0.0, still);
    double a[3][3] = {{0}};
    for (int k = 0; k < 2; k++) {
        const double *n = k == 0 ? across : along;
        memset(d[k], 0, sizeof d[k]);
        memset(other, 0, sizeof other);
        bst_test_add_star(&m, &stars[0], 1e-3 * n[0], 1e-3 * n[1], d[k]);
        bst_test_add_star(&m, &stars[0], -1e-3 * n[0], -1e-3 * n[1], other);
        for (int i = 0; i < BST_TEST_PIXELS; i++) {
            d[k][i] = (d[k][i] - other[i]) / 2e-3;
        }
    }
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        variance[i] = (float)(25.0 + still[i] + 0.2 * (i % 5));
        residual[i] = (float)(moved[i] - still[i]);
        d[2][i] = still[i];
    }
    residual[20 * BST_TEST_NX + 22] = 900.0F; /* an outlier and a pixel without a value */
    residual[17 * BST_TEST_NX + 21] = NAN;
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        for (int j = 0; j < 3 && i != 20 * BST_TEST_NX + 22 && i != 17 * BST_TEST_NX + 21; j++) {
            for (int k = 0; k < 3; k++) {
                a[j][k] += d[j][i] * d[k][i] / (double)variance[i];
            }
        }
    }
    m.variance_e2 = variance;
    bst_twin_offset o;
    bool measured;
    bst_assert_ok(&ctx, bst_twin_star_offset(&ctx, &m, &stars[0], residual, &o, &measured));
    assert_true(measured);
    /* second order in the displacement, and two pixels less */
    bst_assert_close(o.across_px, by[0], 2e-3);
    bst_assert_close(o.along_px, by[1], 4e-3);
    /* elements of the inverse by cofactors */
    double det = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                 a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                 a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    double s0 = sqrt((a[1][1] * a[2][2] - a[1][2] * a[2][1]) / det);
    double s1 = sqrt((a[0][0] * a[2][2] - a[0][2] * a[2][0]) / det);
    bst_assert_close(o.across_sigma_px, s0, 5e-3 * s0);
    bst_assert_close(o.along_sigma_px, s1, 5e-3 * s1);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        residual[i] = NAN;
    }
    bst_assert_ok(&ctx, bst_twin_star_offset(&ctx, &m, &stars[0], residual, &o, &measured));
    assert_false(measured);
    memset(moved, 0, sizeof moved);
    bst_test_add_star(&m, &stars[0], 1.2 * across[0], 1.2 * across[1], moved);
    for (int i = 0; i < BST_TEST_PIXELS; i++) { /* far beyond one linear step of 2 px */
        residual[i] = (float)(10.0 * (moved[i] - still[i]));
        variance[i] = 1e6F;
    }
    bst_assert_ok(&ctx, bst_twin_star_offset(&ctx, &m, &stars[0], residual, &o, &measured));
    assert_false(measured);
}

static void a_star_is_moved_in_the_image(void **state) {
    (void)state;
    bst_twin_star stars[STARS];
    const bst_twin_model m = bst_test_twin_model(stars, STARS);
    bst_quat q = bst_twin_path_attitude(&m.path, 0.5);
    double x, y, to_x, to_y;
    assert_true(bst_camera_project(&m.camera, bst_quat_rotate(q, stars[1].apparent), &x, &y));
    bst_twin_star_shift(&m, &stars[1], 1.5, -0.7);
    assert_true(bst_camera_project(&m.camera, bst_quat_rotate(q, stars[1].apparent), &to_x, &to_y));
    bst_assert_close(to_x, x + 1.5, 1e-9);
    bst_assert_close(to_y, y - 0.7, 1e-9);
    bst_assert_close(bst_vec3_norm(stars[1].apparent), 1.0, 1e-15);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fluxes_and_background_are_the_linear_solution),
        cmocka_unit_test(all_parameters_come_back),
        cmocka_unit_test(ratio_is_drawn_towards_the_usual_one),
        cmocka_unit_test(displacement_of_a_streak),
        cmocka_unit_test(a_star_is_moved_in_the_image),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
