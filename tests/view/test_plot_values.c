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

/* The same where the errors of both axes belong together, those of direction and rate crosswise
 * too: an update by hand with P = D + t (C + C') + t^2 V, S = P + R and K = P S^-1. */
static void test_slanting_innovation(void **state) {
    (void)state;
    const double u = BST_ARCSEC_RAD * BST_ARCSEC_RAD, t = 1.7, y[2] = {1.3, -0.8};
    const double d[2][2] = {{5.0, 1.5}, {1.5, 3.0}}, v[2][2] = {{0.6, -0.3}, {-0.3, 0.9}};
    const double c[2][2] = {{0.4, 0.5}, {-0.2, 0.3}}, noise[2][2] = {{0.5, 0.2}, {0.2, 0.4}};
    double p[2][2], s[2][2], gain[2][2], q[2][2], moved[2];
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            p[i][j] = d[i][j] + t * (c[i][j] + c[j][i]) + t * t * v[i][j];
            s[i][j] = p[i][j] + noise[i][j];
        }
    }
    const double det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    const double inverse[2][2] = {{s[1][1] / det, -s[0][1] / det}, {-s[1][0] / det, s[0][0] / det}};
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            gain[i][j] = p[i][0] * inverse[0][j] + p[i][1] * inverse[1][j];
        }
        for (int j = 0; j < 2; j++) {
            q[i][j] = p[i][j] - gain[i][0] * p[0][j] - gain[i][1] * p[1][j];
        }
        moved[i] = gain[i][0] * y[0] + gain[i][1] * y[1];
    }
    const bst_view_track_state before = {
        .track = 3,
        .ra_deg = 80.0,
        .dec_deg = 35.0,
        .rate_arcsec_per_s = {2.0, -3.0},
        .d11 = d[0][0] * u,
        .d12 = d[0][1] * u,
        .d22 = d[1][1] * u,
        .dr = {{c[0][0] * u, c[0][1] * u}, {c[1][0] * u, c[1][1] * u}},
        .r11 = v[0][0] * u,
        .r12 = v[0][1] * u,
        .r22 = v[1][1] * u};
    bst_view_track_state after = before;
    after.time_s = t;
    after.dec_deg += (-3.0 * t + moved[1]) / 3600.0;
    after.ra_deg += (2.0 * t + moved[0]) / 3600.0 / cos(after.dec_deg * BST_DEG_RAD);
    after.d11 = q[0][0] * u;
    after.d12 = q[0][1] * u;
    after.d22 = q[1][1] * u;
    double found, sigma3;
    assert_true(bst_view_innovation(&before, &after, &found, &sigma3));
    bst_assert_close(found, hypot(y[0], y[1]), 1e-6); /* rounding of degrees */
    bst_assert_close(sigma3, 3.0 * sqrt(0.5 * (s[0][0] + s[1][1])), 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_angle),
                                       cmocka_unit_test(test_innovation),
                                       cmocka_unit_test(test_slanting_innovation)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
