/* Values of plots that follow from several columns: angles, and the innovation of a track that is
 * recomputed from its recorded states, against the filter that made them. */
#include "view/plot_values.h"

#include "boresight/vec.h"
#include "tests/test_support.h"

static void test_angle(void **state) {
    (void)state;
    /* 1e-6: rounding of directions near 360 deg, and of an arc sine near 1 */
    bst_assert_close(bst_view_angle_arcsec(359.9999, 60.0, 0.0001, 60.0), 0.36, 1e-6);
    bst_assert_close(bst_view_angle_arcsec(10.0, -30.0, 10.0, -30.0), 0.0, 0.0);
    bst_assert_close(bst_view_angle_arcsec(0.0, 0.0, 180.0, 0.0), 648000.0, 1e-6);
    bst_assert_close(bst_view_three_sigma_arcsec(BST_ARCSEC_RAD * BST_ARCSEC_RAD,
                                                 7.0 * BST_ARCSEC_RAD * BST_ARCSEC_RAD),
                     6.0, 1e-12); /* rounding */
}

/* One axis of a filter with direction and rate, in arcsec and s. */
typedef struct axis {
    double d, r, dd, dr, rr;
} axis;

/* Predicts and updates an axis by a measurement. Returned: innovation; *variance: its own. */
static double update(axis *a, double dt_s, double measured, double noise2, double *variance) {
    double d = a->d + dt_s * a->r, dr = a->dr + dt_s * a->rr;
    double dd = a->dd + 2.0 * dt_s * a->dr + dt_s * dt_s * a->rr;
    *variance = dd + noise2;
    double gain_d = dd / *variance, gain_r = dr / *variance, innovation = measured - d;
    *a = (axis){d + gain_d * innovation, a->r + gain_r * innovation, dd * (1.0 - gain_d),
                dr * (1.0 - gain_d), a->rr - gain_r * dr};
    return innovation;
}

/* The state of two axes at a place of the sky. */
static bst_view_track_state state_of(double time_s, const axis *east, const axis *north) {
    const double u = BST_ARCSEC_RAD * BST_ARCSEC_RAD, dec = -40.0 + north->d / 3600.0;
    return (bst_view_track_state){
        .time_s = time_s,
        .track = 3,
        .ra_deg = 359.9999 + east->d / 3600.0 / cos(dec * BST_DEG_RAD),
        .dec_deg = dec,
        .rate_arcsec_per_s = {east->r, north->r},
        .d11 = east->dd * u,
        .d22 = north->dd * u,
        .dr = {{east->dr * u, 0.0}, {0.0, north->dr * u}},
        .r11 = east->rr * u,
        .r22 = north->rr * u,
    };
}

static void test_innovation(void **state) {
    (void)state;
    axis east = {0.0, 0.0, 9.0, 0.0, 4.0}, north = east;
    bst_view_track_state before = state_of(0.0, &east, &north);
    for (int k = 1; k < 12; k++) {
        double variance[2], dt_s = 0.5 + 0.1 * k, found, sigma3;
        double time_s = before.time_s + dt_s;
        double a = update(&east, dt_s, sin(3.7 * k), 0.25, &variance[0]);
        double b = update(&north, dt_s, cos(2.3 * k), 0.16, &variance[1]);
        bst_view_track_state after = state_of(time_s, &east, &north);
        assert_true(bst_view_innovation(&before, &after, &found, &sigma3));
        /* 1e-4: degrees near the edge of a turn hold 6e-14 of one, over a gain of some 0.1; and
         * the scale of right ascension changes by 1e-5 with the declination of the correction */
        bst_assert_close(found, hypot(a, b), 1e-4);
        bst_assert_close(sigma3, 3.0 * sqrt(0.5 * (variance[0] + variance[1])), 1e-6);
        after.misses_in_row = 1;
        assert_false(bst_view_innovation(&before, &after, &found, &sigma3));
        after.misses_in_row = 0;
        after.track = 4;
        assert_false(bst_view_innovation(&before, &after, &found, &sigma3));
        after.track = 3;
        after.d11 = 1.0; /* it grew: no detection */
        assert_false(bst_view_innovation(&before, &after, &found, &sigma3));
        after.d11 = NAN;
        assert_false(bst_view_innovation(&before, &after, &found, &sigma3));
        before = state_of(time_s, &east, &north);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_angle),
                                       cmocka_unit_test(test_innovation)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
