/* How far from a line of sight an object may be: variances by hand, and both sides of each limit.
 */
#include "sim/run/run_custody_reach.h"
#include "tests/test_support.h"

/* 4.1 s at 11.5 km/s and 1 km, and six standard deviations: of the shape and plane as they are, of
 * the place along the orbit grown by the drift, at perigee. */
static void reach_of_an_orbit(void **state) {
    (void)state;
    const double table_m = 4.1 * 11500.0 + 1000.0;
    bst_custody_orbit orbit = {.elements = {.eccentricity = 0.0}};
    bst_custody_filter f = {.noise_until_s = 0.0};
    bst_assert_close(bst_run_reach_of(&orbit, &f, 5e4), table_m, 1e-9);
    const double variance[BST_CUSTODY_STATE] = {9.0, 1e4, 2e4, 3e4, 5e4, 7e4};
    for (int k = 0; k < BST_CUSTODY_STATE; k++) {
        f.p[k][k] = variance[k];
    }
    f.p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] = f.p[BST_CUSTODY_ALONG][BST_CUSTODY_DRIFT] = -300.0;
    const double days[3] = {0.0, 40.0, -100.0};
    const double grown[3] = {7e4, 7e4 - 600.0 * 40.0 + 9.0 * 1600.0, 7e4 + 6e4 + 9e4};
    for (int k = 0; k < 3; k++) {
        orbit.elements.eccentricity = 0.0;
        bst_assert_close(bst_run_reach_of(&orbit, &f, 86400.0 * days[k]),
                         table_m + 6.0 * sqrt(11e4 + grown[k]), 1e-6);
        orbit.elements.eccentricity = 0.5; /* three times the variance */
        bst_assert_close(bst_run_reach_of(&orbit, &f, 86400.0 * days[k]),
                         table_m + 6.0 * sqrt(11e4 + 3.0 * grown[k]), 1e-6);
    }
    f.p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] = -1e9; /* of rounding: none */
    bst_assert_close(bst_run_reach_of(&orbit, &f, 0.0), table_m, 1e-9);
}

/* Beside the line, behind the observer, and not known: one object, and many of which it is one. */
static void objects_beside_a_line(void **state) {
    (void)state;
    enum { BEFORE = 3, CASES = 9, ALL = BEFORE + CASES };
    const bst_custody_observation z = {.observer = {.position_m = {7e6, -1e6, 3e5}},
                                       .direction = {0.36, 0.48, 0.8}};
    /* two axes across the line */
    const bst_vec3 u = {0.8, -0.6, 0.0}, v = {0.48, 0.64, -0.6};
    const double reach = 5e4;
    const struct {
        double along, right, up;
        int holds;
    } cases[CASES] = {{1e6, 0, 0, 1},         {1e6, 4.99e4, 0, 1},    {1e6, -5.01e4, 0, 0},
                      {1e6, 0, -4.99e4, 1},   {1e6, 0, 5.01e4, 0},    {1e6, 3.6e4, 3.6e4, 0},
                      {-4.99e4, 1e3, 1e3, 1}, {-5.01e4, 1e3, 1e3, 0}, {2e7, 3e4, -3.9e4, 1}};
    double x[ALL], y[ALL], h[ALL], reaches[ALL];
    double *const place[3] = {x, y, h};
    int out[CASES];
    for (int i = 0; i < ALL; i++) {
        int k = i < BEFORE ? 0 : i - BEFORE;
        bst_vec3 p = bst_vec3_axpy(z.observer.position_m, cases[k].along, z.direction);
        p = bst_vec3_axpy(bst_vec3_axpy(p, cases[k].right, u), cases[k].up, v);
        x[i] = p.x;
        y[i] = p.y;
        h[i] = p.z;
        reaches[i] = i < BEFORE ? 1.0 : reach;
        if (i >= BEFORE) {
            assert_int_equal(bst_run_reach_holds(reach, p, &z), cases[k].holds);
            int any = bst_run_reach_any(place, reaches, i, 1, &z, out);
            assert_int_equal(any, cases[k].holds);
            assert_int_equal(out[0], cases[k].holds);
        }
    }
    assert_true(bst_run_reach_any(place, reaches, BEFORE, CASES, &z, out));
    for (int k = 0; k < CASES; k++) {
        assert_int_equal(out[k], cases[k].holds);
    }
    /* each with its own reach */
    reaches[BEFORE + 2] = 5.02e4;
    reaches[BEFORE + 1] = 4.98e4;
    assert_true(bst_run_reach_any(place, reaches, BEFORE, CASES, &z, out));
    assert_true(out[2] && !out[1]);
    x[BEFORE + 4] = y[BEFORE + 4] = h[BEFORE + 4] =
        NAN; /* a place that is not known may be there */
    assert_true(bst_run_reach_holds(reach, (bst_vec3){NAN, NAN, NAN}, &z));
    assert_true(bst_run_reach_any(place, reaches, BEFORE + 4, 1, &z, out) && out[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(reach_of_an_orbit),
                                       cmocka_unit_test(objects_beside_a_line)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
