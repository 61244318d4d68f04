/* The WCS of a camera with rotation and distortion: against the camera's own projection through
 * ERFA, and as astropy reads it from the file. */
#include "sim/io/fits_frames.h"
#include "tests/io/scratch.h"
#include "tests/io/sky_fixture.h"
#include "tests/test_support.h"

enum { CASES = 6, SIDE = 16 };

/* Distortion in the corner, 640 px from the centre. */
static bst_camera lens(bst_ctx *ctx, int i) {
    bst_camera c = fixture_camera();
    c.height_px = 768;
    static const double rotation[CASES] = {30, -37, 90, 180, 12, -75};
    static const double corner[CASES] = {0.02, -0.02, 0.05, -0.05, 0.03, -0.04};
    if (i == 5) {
        c.pixel_scale_arcsec = 100; /* 36 degrees across */
    }
    double r = 640 * bst_camera_scale_rad(&c);
    c.rotation_deg = rotation[i];
    c.distortion.k1 = corner[i] / (r * r);
    if (i == 2) {
        c.distortion.p1 = 0.003 / r;
        c.distortion.p2 = -0.005 / r;
        c.distortion.k2 = -0.01 / (r * r * r * r);
    }
    if (i == 4) {
        c.boresight_offset_px[0] = 60.5;
        c.boresight_offset_px[1] = -33;
    }
    bst_assert_ok(ctx, bst_camera_prepare(ctx, &c));
    return c;
}

static bst_quat attitude(int i) {
    return bst_quat_look(bst_vec3_from_radec(1.0 + 2.0 * i, i == 3 ? 1.5 : -0.3),
                         (bst_vec3){0.3, 0.1, 1.0});
}

static void fit_agrees_with_the_camera(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_light light = fixture_light();
    for (int i = 0; i < CASES; i++) {
        bst_camera camera = lens(&ctx, i);
        bst_wcs wcs;
        bst_assert_ok(&ctx, bst_wcs_fit(&ctx, &camera, attitude(i), &light, &wcs));
        assert_true(wcs.residual_px < 1e-3);
        assert_true(wcs.sip.order >= 2 && wcs.sip.order <= BST_SIP_ORDER);
        bst_assert_close(wcs.crpix[0], bst_camera_centre_x(&camera) + 1.0, 0.0);
        for (int k = 0; k < 31 * 31; k++) {
            double x = -0.5 + 1024.0 * (k % 31) / 30.0, y = -0.5 + 768.0 * (double)(k / 31) / 30.0;
            double ra, dec, x_true = NAN, y_true = NAN, x_back = NAN, y_back = NAN;
            bst_wcs_px_to_sky(&wcs, x, y, &ra, &dec);
            assert_true(bst_wcs_sky_to_px(&wcs, ra, dec, &x_back, &y_back));
            /* the inverse is iterated: each round leaves a tenth, and worse than 1e-4 is not
             * started from; rounding near the pole of case 3 */
            bst_assert_close(x_back, x, 1e-6);
            bst_assert_close(y_back, y, 1e-6);
            assert_true(fixture_project(&camera, attitude(i), &light, ra, dec, &x_true, &y_true));
            /* the limit; edges of the border pixels included */
            bst_assert_close(hypot(x_true - x, y_true - y), 0.0, 1e-3);
        }
    }
}

/* Rotation alone needs no polynomials; an offset boresight is no distortion either. */
static void plain_projection_without_distortion(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_light light = fixture_light();
    bst_camera camera = fixture_camera();
    camera.rotation_deg = -37;
    camera.boresight_offset_px[0] = 100;
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    bst_wcs wcs;
    bst_assert_ok(&ctx, bst_wcs_fit(&ctx, &camera, attitude(0), &light, &wcs));
    assert_int_equal(wcs.sip.order, 0);
    assert_true(wcs.residual_px < 0.01);
    bst_assert_close(wcs.crpix[0], 612.5, 0.0);
    for (int k = 0; k < 9; k++) {
        double x = 511.5 * (k % 3), y = 511.5 * (double)(k / 3), ra, dec, tx = NAN, ty = NAN;
        bst_wcs_px_to_sky(&wcs, x, y, &ra, &dec);
        assert_true(fixture_project(&camera, attitude(0), &light, ra, dec, &tx, &ty));
        bst_assert_close(hypot(tx - x, ty - y), 0.0, 0.01); /* second order of aberration */
    }
}

static void write_case(bst_ctx *ctx, scratch *s, FILE *places, int i, bst_fits_layout layout) {
    bst_camera camera = lens(ctx, i);
    bst_light light = fixture_light();
    bst_fits_info info = {.observer = "neossat",
                          .instrument = "lens",
                          .program = "boresight test",
                          .camera = &camera};
    bst_fits_frame frame = {.exposure_s = 0.5,
                            .window = {.x0 = 500, .y0 = 300, .width = 2 * SIDE, .height = 2 * SIDE},
                            .binning = 2,
                            .bits = 14,
                            .has_wcs = true};
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T23:59:58.25Z", &frame.start));
    bst_assert_ok(ctx, bst_wcs_fit(ctx, &camera, attitude(i), &light, &frame.wcs));
    char name[40];
    snprintf(name, sizeof name, "%s_%d.fits", layout == BST_FITS_CUBE ? "cube" : "ext", i);
    static const uint16_t pixels[SIDE * SIDE];
    bst_fits *fits;
    bst_assert_ok(ctx, bst_fits_create(ctx, scratch_path(s, name), layout, &info, &fits));
    bst_assert_ok(ctx, bst_fits_write(ctx, fits, &frame, pixels, SIDE, SIDE, NULL));
    bst_assert_ok(ctx, bst_fits_close(ctx, fits));
    if (layout == BST_FITS_CUBE) {
        return;
    }
    for (int k = 0; k < 17 * 17; k++) {
        double x = 1023.0 * (k % 17) / 16.0, y = 767.0 * (double)(k / 17) / 16.0, ra, dec;
        bst_vec3 v =
            bst_quat_rotate(bst_quat_conj(attitude(i)), bst_camera_unproject(&camera, x, y));
        bst_vec3_to_radec(bst_light_catalogue_star(&light, v), &ra, &dec);
        fprintf(places, "%d %.15g %.15g %.15g %.15g\n", i, ra / BST_DEG_RAD, dec / BST_DEG_RAD,
                (x + 0.5 - 500) / 2 - 0.5, (y + 0.5 - 300) / 2 - 0.5);
    }
}

static void astropy_agrees(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    FILE *places = fopen(scratch_path(&s, "places.txt"), "w");
    assert_non_null(places);
    for (int i = 0; i < CASES; i++) {
        write_case(&ctx, &s, places, i, BST_FITS_EXTENSIONS);
        write_case(&ctx, &s, places, i, BST_FITS_CUBE);
    }
    assert_int_equal(fclose(places), 0);
    char command[700];
    snprintf(command, sizeof command, "/usr/bin/python3 tests/io/check_sip.py '%s'", s.folder);
    assert_int_equal(system(command), 0);
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fit_agrees_with_the_camera),
        cmocka_unit_test(plain_projection_without_distortion),
        cmocka_unit_test(astropy_agrees),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
