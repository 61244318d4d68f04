#include <stdlib.h>

#include "sim/astro/geodesy.h"

#include "boresight/vec.h"
#include "tests/test_support.h"

static void known_points(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double r[3];
    const double a = 6378137.0, b = a * (1.0 - 1.0 / 298.257223563);
    bst_assert_ok(&ctx, bst_astro_geodetic_to_itrf(&ctx, 0.0, 0.0, 0.0, r));
    bst_assert_close(r[0], a, 1e-8); /* rounding of 6e6 m */
    bst_assert_close(r[1], 0.0, 1e-8);
    bst_assert_close(r[2], 0.0, 1e-8);
    bst_assert_ok(&ctx, bst_astro_geodetic_to_itrf(&ctx, BST_PI / 2.0, 1.0, 100.0, r));
    bst_assert_close(hypot(r[0], r[1]), 0.0, 1e-8);
    bst_assert_close(r[2], b + 100.0, 1e-8);
    bst_assert_ok(&ctx, bst_astro_geodetic_to_itrf(&ctx, 0.0, -BST_PI / 2.0, 1e9, r));
    bst_assert_close(r[1], -(a + 1e9), 1e-6);
    /* ERFA's test of eraGd2gc: elong 3.1, phi -0.5, height 2500, WGS84 */
    bst_assert_ok(&ctx, bst_astro_geodetic_to_itrf(&ctx, -0.5, 3.1, 2500.0, r));
    bst_assert_close(r[0], -5599000.5577049947, 1e-7); /* ERFA states 1e-7 */
    bst_assert_close(r[1], 233011.67223479203, 1e-7);
    bst_assert_close(r[2], -3040909.4706983363, 1e-7);
}

static void round_trip(void **state) {
    (void)state;
    static const double heights[] = {-6e6, -5e6, -1e5, -100.0, 0.0, 100.0, 4e5, 3.6e7, 1e9};
    for (size_t k = 0; k < sizeof heights / sizeof *heights; k++) {
        for (int i = -18; i <= 18; i++) {
            for (int j = -17; j <= 18; j += 5) {
                bst_ctx ctx = {0};
                double latitude = BST_PI / 2.0 * i / 18.0, longitude = BST_PI * j / 18.0;
                double r[3], s[3], lat, lon, height;
                bst_assert_ok(&ctx,
                              bst_astro_geodetic_to_itrf(&ctx, latitude, longitude, heights[k], r));
                bst_assert_ok(&ctx, bst_astro_itrf_to_geodetic(&ctx, r, &lat, &lon, &height));
                assert_true(fabs(lat) <= BST_PI / 2.0 && fabs(lon) <= BST_PI);
                bst_assert_ok(&ctx, bst_astro_geodetic_to_itrf(&ctx, lat, lon, height, s));
                /* rounding of angles and of the distance; 1e-15 of it each, a few times */
                double tolerance = 1e-8 + 2e-15 * fabs(heights[k]);
                for (int m = 0; m < 3; m++) {
                    bst_assert_close(s[m], r[m], tolerance);
                }
                /* unique only outside the evolute, which reaches 43 km from the centre */
                bst_assert_close(height, heights[k], tolerance);
                bst_assert_close(lat, latitude, 1e-13);
                if (abs(i) < 18) {
                    bst_assert_close(lon, longitude, 1e-13);
                }
            }
        }
    }
}

static void centre_and_axis(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double lat, lon, height, r[3];
    const double centre[3] = {0, 0, 0}, above_north[3] = {0, 0, 7e6}, below[3] = {0, 0, -7e6};
    const double b = 6378137.0 * (1.0 - 1.0 / 298.257223563);
    bst_assert_ok(&ctx, bst_astro_itrf_to_geodetic(&ctx, centre, &lat, &lon, &height));
    bst_assert_close(fabs(lat), BST_PI / 2.0, 1e-15);
    bst_assert_close(height, -b, 1e-8); /* rounding of 6e6 m */
    bst_assert_ok(&ctx, bst_astro_geodetic_to_itrf(&ctx, lat, lon, height, r));
    bst_assert_close(sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]), 0.0, 1e-8);
    bst_assert_ok(&ctx, bst_astro_itrf_to_geodetic(&ctx, above_north, &lat, &lon, &height));
    bst_assert_close(lat, BST_PI / 2.0, 1e-15);
    assert_true(lon == 0.0);
    bst_assert_close(height, 7e6 - b, 1e-8);
    bst_assert_ok(&ctx, bst_astro_itrf_to_geodetic(&ctx, below, &lat, &lon, &height));
    bst_assert_close(lat, -BST_PI / 2.0, 1e-15);
}

static void bad_values_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double r[3] = {1, 2, 3}, lat, lon, height;
    assert_int_equal(bst_astro_geodetic_to_itrf(&ctx, NAN, 0, 0, r), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "is not finite"));
    assert_int_equal(bst_astro_geodetic_to_itrf(&ctx, 0, INFINITY, 0, r), BST_ERR_ARGUMENT);
    assert_int_equal(bst_astro_geodetic_to_itrf(&ctx, 0, 0, -NAN, r), BST_ERR_ARGUMENT);
    assert_int_equal(bst_astro_geodetic_to_itrf(&ctx, 1.5708, 0, 0, r), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "is not in -90..90"));
    assert_int_equal(bst_astro_geodetic_to_itrf(&ctx, -3.0, 0, 0, r), BST_ERR_ARGUMENT);
    assert_true(r[0] == 1 && r[1] == 2 && r[2] == 3);
    const double bad[3] = {7e6, NAN, 0}, far[3] = {0, 0, -INFINITY};
    assert_int_equal(bst_astro_itrf_to_geodetic(&ctx, bad, &lat, &lon, &height), BST_ERR_ARGUMENT);
    assert_int_equal(bst_astro_itrf_to_geodetic(NULL, far, &lat, &lon, &height), BST_ERR_ARGUMENT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_points),
        cmocka_unit_test(round_trip),
        cmocka_unit_test(centre_and_axis),
        cmocka_unit_test(bad_values_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
