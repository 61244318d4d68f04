#include "tests/process/frame_by_sums.h"

#include "tests/test_support.h"

bst_twin_model bst_test_twin_model(bst_twin_star *stars, int count) {
    static const double places[][2] = {{12.3, 8.8}, {30.6, 25.4}, {36.2, 12.1}, {8.9, 30.7}};
    bst_ctx ctx = {0};
    bst_twin_model m = {.camera = {.width_px = BST_TEST_NX,
                                   .height_px = BST_TEST_NY,
                                   .pixel_scale_arcsec = 60.0,
                                   .rotation_deg = 25.0,
                                   .boresight_offset_px = {4.0, -3.0},
                                   .distortion = {.k1 = -2.0, .p1 = 0.1, .p2 = -0.2}},
                        .path = {.q_reference = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7}),
                                 .count = {5, 4},
                                 .coefficients = {{-4e-4, -3e-4, 1e-4, 2e-4, 4e-4},
                                                  {8e-4, 5e-4, 0.0, -6e-4, -9e-4},
                                                  {-4e-3, 2e-3, 1e-3, 5e-3}}},
                        .psf = {.sigma_px = 1.1, .ratio = 2.1, .wide = 0.3},
                        .background_e = {20.0, 4.0, -3.0, 2.0, -1.5, 1.0},
                        .stars = stars,
                        .count = count,
                        .width = BST_TEST_NX,
                        .height = BST_TEST_NY,
                        .noise_e = 5.0,
                        .form_error = 0.02};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &m.camera));
    bst_quat back = bst_quat_conj(bst_twin_path_attitude(&m.path, 0.5));
    for (int i = 0; i < count; i++) {
        bst_vec3 v = bst_camera_unproject(&m.camera, places[i][0], places[i][1]);
        stars[i] = (bst_twin_star){.apparent = bst_quat_rotate(back, v),
                                   .flux_e = 2000.0 + 1500.0 * i,
                                   .sigma_e = 10.0,
                                   .expected_e = NAN,
                                   .inside = 1.0};
    }
    return m;
}

double bst_test_gaussian_part(double sigma, double from_px) {
    double k = 1.0 / (sigma * sqrt(2.0));
    /* the light is drawn to 4.5 standard deviations and half a pixel */
    return fabs(from_px) > 4.5 * sigma + 0.5
               ? 0.0
               : 0.5 * (erf((from_px + 0.5) * k) - erf((from_px - 0.5) * k));
}

void bst_test_add_star(const bst_twin_model *m, const bst_twin_star *s, double dx, double dy,
                       double *pixels) {
    enum { STEPS = 100 }; /* midpoints: 0.1 px apart */
    for (int i = 0; i < STEPS; i++) {
        bst_quat q = bst_twin_path_attitude(&m->path, (i + 0.5) / STEPS);
        double x, y;
        assert_true(bst_camera_project(&m->camera, bst_quat_rotate(q, s->apparent), &x, &y));
        double narrow = m->psf.sigma_px, wide = narrow * m->psf.ratio;
        double columns[BST_TEST_NX][2], rows[BST_TEST_NY][2];
        for (int j = 0; j < BST_TEST_NX; j++) {
            columns[j][0] = (1.0 - m->psf.wide) * bst_test_gaussian_part(narrow, j - x - dx);
            columns[j][1] = m->psf.wide * bst_test_gaussian_part(wide, j - x - dx);
        }
        for (int j = 0; j < BST_TEST_NY; j++) {
            rows[j][0] = bst_test_gaussian_part(narrow, j - y - dy);
            rows[j][1] = bst_test_gaussian_part(wide, j - y - dy);
        }
        for (int j = 0; j < BST_TEST_PIXELS; j++) {
            const double *c = columns[j % BST_TEST_NX], *r = rows[j / BST_TEST_NX];
            pixels[j] += s->flux_e / STEPS * (c[0] * r[0] + c[1] * r[1]);
        }
    }
}

void bst_test_frame(const bst_twin_model *m, double *pixels) {
    for (int j = 0; j < BST_TEST_PIXELS; j++) {
        double u = 2.0 * (j % BST_TEST_NX) / (BST_TEST_NX - 1) - 1.0;
        double v = 2.0 * (j / BST_TEST_NX) / (BST_TEST_NY - 1) - 1.0;
        const double *c = m->background_e;
        pixels[j] = c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * u * v + c[5] * v * v;
    }
    for (int i = 0; i < m->count; i++) {
        bst_test_add_star(m, &m->stars[i], 0.0, 0.0, pixels);
    }
}
