/* The frame's WCS against ERFA's path from catalogue place to pixel. */
#include "sim/io/wcs.h"

#include "tests/io/sky_fixture.h"
#include "tests/test_support.h"

static bst_quat look(double ra_deg, double dec_deg, double roll_deg) {
    bst_vec3 d = bst_vec3_from_radec(ra_deg * BST_DEG_RAD, dec_deg * BST_DEG_RAD);
    bst_quat q = bst_quat_look(d, bst_vec3_perpendicular(d));
    return bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, 0, roll_deg * BST_DEG_RAD}), q);
}

/* Everywhere on the sky, near a pole and across RA 0, at any roll. */
static void test_against_erfa(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_light light = fixture_light();
    static const double places[][3] = {{123.4, 5.6, 30.0},  {0.05, -45.0, 200.0},
                                       {359.9, 12.0, 0.0},  {80.0, 89.9, 77.0},
                                       {10.0, -89.99, 1.0}, {270.0, 66.0, 90.0}};
    for (size_t p = 0; p < sizeof places / sizeof *places; p++) {
        bst_quat q = look(places[p][0], places[p][1], places[p][2]);
        bst_camera camera = fixture_camera();
        camera.width_px = p % 2 ? 640 : 1024; /* lying and standing frames */
        camera.height_px = p % 2 ? 1024 : 640;
        bst_wcs wcs;
        bst_assert_ok(&ctx, bst_wcs_fit(&ctx, &camera, q, &light, &wcs));
        /* second order of aberration over half the field: v/c (0.0105 rad)^2 = 1e-8 rad = 0.7e-3 px
         */
        assert_true(wcs.residual_px < 0.01);
        assert_true(wcs.residual_px > 1e-6);
        bst_assert_close(wcs.crpix[0], p % 2 ? 320.5 : 512.5, 0.0); /* (N + 1) / 2 exactly */
        bst_assert_close(wcs.crpix[1], p % 2 ? 512.5 : 320.5, 0.0);
        double worst = 0.0;
        for (int i = 0; i < 21 * 21; i++) {
            double x = (double)(camera.width_px - 1) * (i % 21) / 20.0;
            double y = (double)(camera.height_px - 1) * (double)(i / 21) / 20.0;
            double ra, dec, x_true = NAN, y_true = NAN, x_back = NAN, y_back = NAN;
            bst_wcs_px_to_sky(&wcs, x, y, &ra, &dec);
            assert_true(bst_wcs_sky_to_px(&wcs, ra, dec, &x_back, &y_back));
            /* rounding: 1e-16 rad of 2 pi is 1e-10 px, a thousand times at 0.01 deg from a pole */
            bst_assert_close(x_back, x, 1e-6);
            bst_assert_close(y_back, y, 1e-6);
            assert_true(fixture_project(&camera, q, &light, ra, dec, &x_true, &y_true));
            worst = fmax(worst, hypot(x_true - x, y_true - y));
        }
        /* the grid of the fit meets the corners, where the misfit is largest; 1e-5 px for the
         * inverse of aberration and the finer grid */
        assert_true(worst <= wcs.residual_px * 1.05 + 1e-5);
        assert_true(worst >= wcs.residual_px * 0.9 - 1e-5);
    }
}

/* Without light's corrections the projection is the camera's own, to rounding. */
static void test_exact_without_light(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_camera camera = fixture_camera();
    camera.width_px = 2048;
    camera.height_px = 333;
    bst_light still = {.velocity_mps = {0, 0, 0}, .sun_m = {0, 1e22, 0}}; /* no deflection */
    bst_quat q = look(200.0, -30.0, 10.0);
    bst_wcs wcs;
    bst_assert_ok(&ctx, bst_wcs_fit(&ctx, &camera, q, &still, &wcs));
    /* 2e-16 rad of rounding at 1.45e-5 rad per pixel, times some tens of operations */
    assert_true(wcs.residual_px < 1e-8);
    bst_vec3 b = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){0, 0, 1});
    double ra, dec;
    bst_vec3_to_radec(b, &ra, &dec);
    bst_assert_close(wcs.crval_deg[0], ra / BST_DEG_RAD, 1e-11); /* rounding in degrees */
    bst_assert_close(wcs.crval_deg[1], dec / BST_DEG_RAD, 1e-11);
    double det = wcs.cd_deg[0][0] * wcs.cd_deg[1][1] - wcs.cd_deg[0][1] * wcs.cd_deg[1][0];
    bst_assert_close(sqrt(fabs(det)) * 3600.0, 3.0, 1e-9); /* pixel scale */
    bst_assert_close(wcs.crpix[0], 1024.5, 0.0);
    bst_assert_close(wcs.crpix[1], 167.0, 0.0);
}

/* A window of binned pixels shows the same sky: pixel i of it is centred on full-sensor pixel
 * x0 + b (i + 1/2) - 1/2. */
static void test_window(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_camera camera = fixture_camera();
    bst_light light = fixture_light();
    bst_wcs full;
    bst_assert_ok(&ctx, bst_wcs_fit(&ctx, &camera, look(33.0, 20.0, 50.0), &light, &full));
    bst_window window = {.x0 = 300, .y0 = 17, .width = 256, .height = 128};
    bst_wcs part = bst_wcs_window(&full, window, 4);
    for (int i = 0; i < 64; i += 9) {
        double ra, dec, x, y;
        bst_wcs_px_to_sky(&full, 300 + 4 * (i + 0.5) - 0.5, 17 + 4 * (0.5 * i + 0.5) - 0.5, &ra,
                          &dec);
        assert_true(bst_wcs_sky_to_px(&part, ra, dec, &x, &y));
        bst_assert_close(x, i, 1e-8); /* rounding */
        bst_assert_close(y, 0.5 * i, 1e-8);
    }
    double x, y;
    assert_false(bst_wcs_sky_to_px(&full, (33.0 + 180.0) * BST_DEG_RAD, 0.0, &x, &y));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_erfa),
        cmocka_unit_test(test_exact_without_light),
        cmocka_unit_test(test_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
