/* The WCS of frames of other programs gives the camera's attitude. */
#include "tests/io/written_fits.h"

/* The WCS of a header gives the attitude that shows the sky so: a camera at RA 90, Dec 0 with rows
 * to the south and columns to the west. */
static void test_wcs(void **state) {
    (void)state;
    for (int flip = 0; flip < 2; flip++) {
        fixture f = begin("wcs.fits");
        begin_image(&f, true, 8, 3, 3, 0);
        card(&f, "CRPIX1  =                   2.");
        card(&f, "CRPIX2  =                   2.");
        card(&f, "CRVAL1  =                  90.");
        card(&f, "CRVAL2  =                   0.");
        card(&f, "CDELT1  =               -0.001");
        card(&f, "CDELT2  = %20.3f", flip ? 0.001 : -0.001);
        end_header(&f);
        put(&f, "123456789", 9);
        save(&f, f.count);
        bst_frame_source *s;
        bst_frame_place frame;
        bst_quat q;
        double scale;
        bst_assert_ok(&f.ctx, bst_frame_source_open(&f.ctx, f.path, NULL, &s));
        bst_assert_ok(&f.ctx, bst_frame_source_select(&f.ctx, s, 0, &frame));
        assert_false(bst_keyword_wcs(s, &frame, !flip, &q, &scale)); /* mirrored */
        assert_true(bst_keyword_wcs(s, &frame, flip, &q, &scale));
        bst_assert_close(scale, 3.6, 1e-12);                   /* rounding */
        bst_vec3 z = bst_quat_rotate(q, (bst_vec3){0, 1, 0});  /* RA 90 */
        bst_vec3 y = bst_quat_rotate(q, (bst_vec3){0, 0, -1}); /* south */
        bst_assert_close(z.z, 1.0, 1e-12);
        bst_assert_close(y.y, 1.0, 1e-9); /* a pixel to the right is 1.7e-5 rad away */
        bst_frame_source_close(s);
        end(&f);
    }
}

/* Direction at a pixel of a header's WCS, first pixel 1: standard coordinates (xi, eta), deg, of
 * the plane that touches the sphere at CRVAL = (ra, dec) (Calabretta and Greisen 2002,
 * section 5.1). */
static bst_vec3 in_the_sky(const double cd[2][2], double x_px, double y_px, double ra, double dec) {
    double xi = (cd[0][0] * x_px + cd[0][1] * y_px) * BST_DEG_RAD;
    double eta = (cd[1][0] * x_px + cd[1][1] * y_px) * BST_DEG_RAD;
    bst_vec3 east = {-sin(ra), cos(ra), 0.0},
             north = {-sin(dec) * cos(ra), -sin(dec) * sin(ra), cos(dec)};
    bst_vec3 at = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)};
    return bst_vec3_unit(bst_vec3_axpy(bst_vec3_axpy(at, xi, east), eta, north));
}

/* The same far from the equator, turned, with pixels that are not square and a reference outside
 * the frame, as a matrix and as scales with an angle: the middle of the frame and its right edge
 * are where the header says. */
static void test_turned_wcs(void **state) {
    (void)state;
    enum { WIDTH = 7, HEIGHT = 5 };
    const double ra = 213.0, dec = 52.0, angle = 31.0 * BST_DEG_RAD, dx = -0.002, dy = -0.0021;
    /* rotation of the axes, after the scales */
    const double cd[2][2] = {{dx * cos(angle), -dy * sin(angle)},
                             {dx * sin(angle), dy * cos(angle)}};
    for (int matrix = 0; matrix < 3; matrix++) {
        fixture f = begin("turned.fits");
        begin_image(&f, true, 8, WIDTH, HEIGHT, 0);
        card(&f, "CRPIX1  = %20.3f", -3.25);
        card(&f, "CRPIX2  = %20.3f", 11.5);
        card(&f, "CRVAL1  = %20.3f", ra);
        card(&f, "CRVAL2  = %20.3f", dec);
        if (matrix == 1) {
            card(&f, "CD1_1   = %20.13E", cd[0][0]);
            card(&f, "CD1_2   = %20.13E", cd[0][1]);
            card(&f, "CD2_1   = %20.13E", cd[1][0]);
            card(&f, "CD2_2   = %20.13E", cd[1][1]);
        } else {
            card(&f, "CDELT1  = %20.4f", dx);
            card(&f, "CDELT2  = %20.4f", dy);
            if (matrix == 2) { /* the rotation by itself, without the scales */
                card(&f, "PC1_1   = %20.13E", cos(angle));
                card(&f, "PC1_2   = %20.13E", -dy / dx * sin(angle));
                card(&f, "PC2_1   = %20.13E", dx / dy * sin(angle));
                card(&f, "PC2_2   = %20.13E", cos(angle));
            } else {
                card(&f, "CROTA2  = %20.4f", angle / BST_DEG_RAD);
            }
        }
        end_header(&f);
        put(&f, "12345678901234567890123456789012345", WIDTH * HEIGHT);
        save(&f, f.count);
        bst_frame_source *s;
        bst_frame_place frame;
        bst_quat q;
        double scale;
        bst_assert_ok(&f.ctx, bst_frame_source_open(&f.ctx, f.path, NULL, &s));
        bst_assert_ok(&f.ctx, bst_frame_source_select(&f.ctx, s, 0, &frame));
        assert_true(bst_keyword_wcs(s, &frame, false, &q, &scale));
        bst_assert_close(scale, 3600.0 * sqrt(dx * dy), 1e-9); /* 13 digits */
        double x = 4.0 + 3.25, y = 3.0 - 11.5;                 /* the middle, from CRPIX */
        bst_vec3 z = in_the_sky(cd, x, y, ra * BST_DEG_RAD, dec * BST_DEG_RAD);
        bst_vec3 right = in_the_sky(cd, x + 3.0, y, ra * BST_DEG_RAD, dec * BST_DEG_RAD);
        bst_vec3 seen = bst_quat_rotate(q, z), edge = bst_quat_rotate(q, right);
        bst_assert_close(bst_vec3_angle(seen, (bst_vec3){0, 0, 1}), 0.0, 1e-10); /* 13 digits */
        bst_assert_close(edge.x, bst_vec3_angle(z, right), 1e-10);
        bst_assert_close(edge.y, 0.0,
                         1e-8); /* 1.1e-4 rad from the axis: the plane's bend is 1e-8 */
        bst_frame_source_close(s);
        end(&f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wcs),
        cmocka_unit_test(test_turned_wcs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
