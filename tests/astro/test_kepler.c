/* Two-body motion against the closed forms of each conic, forwards and backwards. */
#include "sim/astro/kepler.h"

#include <stdlib.h>

#include "tests/test_support.h"

#define MU 3.986004418e14

typedef struct point {
    bst_vec3 r, v;
    double t; /* since pericentre */
} point;

/* Turned out of the plane by fixed angles, so that no coordinate is zero by chance. */
static bst_vec3 turn(double x, double y) {
    bst_quat q = bst_quat_from_rotvec((bst_vec3){0.7, -1.1, 0.4});
    return bst_quat_rotate(q, (bst_vec3){x, y, 0});
}

/* Pericentre distance q; `anomaly` is eccentric (e < 1) or hyperbolic (e > 1). */
static point on_conic(double q, double e, double anomaly) {
    point p;
    if (e < 1) {
        double a = q / (1 - e), n = sqrt(MU / (a * a * a)), b = a * sqrt(1 - e * e);
        double rate = n / (1 - e * cos(anomaly));
        p.r = turn(a * (cos(anomaly) - e), b * sin(anomaly));
        p.v = turn(-a * sin(anomaly) * rate, b * cos(anomaly) * rate);
        p.t = (anomaly - e * sin(anomaly)) / n;
    } else {
        double a = q / (e - 1), n = sqrt(MU / (a * a * a)), b = a * sqrt(e * e - 1);
        double rate = n / (e * cosh(anomaly) - 1);
        p.r = turn(a * (e - cosh(anomaly)), b * sinh(anomaly));
        p.v = turn(-a * sinh(anomaly) * rate, b * cosh(anomaly) * rate);
        p.t = (e * sinh(anomaly) - anomaly) / n;
    }
    return p;
}

/* A parabola by Barker's equation; d = tan(nu / 2). */
static point on_parabola(double q, double d) {
    double k = sqrt(MU / (2 * q)), c = 2 / (1 + d * d); /* 1 + cos nu */
    return (point){turn(q * (1 - d * d), 2 * q * d), turn(-k * d * c, k * c),
                   sqrt(2 * q * q * q / MU) * (d + d * d * d / 3)};
}

static void expect_between(point from, point to, double tolerance) {
    bst_ctx ctx = {0};
    bst_vec3 r, v;
    bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, from.r, from.v, to.t - from.t, &r, &v));
    double dr = bst_vec3_norm(bst_vec3_sub(r, to.r)), dv = bst_vec3_norm(bst_vec3_sub(v, to.v));
    bst_assert_close(dr / bst_vec3_norm(to.r), 0, tolerance);
    bst_assert_close(dv / bst_vec3_norm(to.v), 0, tolerance);
}

/* Rounding: the time itself is known to 1e-16 of the period, which near the pericentre of an
 * eccentric orbit is worth that much times (1 + e) / (1 - e) of the local radius and more. */
static void ellipses(void **state) {
    (void)state;
    const double e[] = {0, 1e-9, 0.01, 0.73, 0.99};
    const double tolerance[] = {3e-14, 3e-14, 3e-14, 3e-13, 3e-11};
    for (int k = 0; k < 5; k++) {
        for (double from = -3.1; from < 3.2; from += 0.31) {
            for (double to = -3.1; to < 3.2; to += 0.29) {
                expect_between(on_conic(7e6, e[k], from), on_conic(7e6, e[k], to), tolerance[k]);
            }
        }
    }
}

static void open_orbits(void **state) {
    (void)state;
    const double e[] = {1.0001, 1.5, 10};
    for (int k = 0; k < 3; k++) {
        for (double from = -3; from < 3.1; from += 0.5) {
            for (double to = -3; to < 3.1; to += 0.37) {
                /* 1/a loses four digits at e = 1.0001, and r x v far out four more */
                expect_between(on_conic(7e6, e[k], from), on_conic(7e6, e[k], to),
                               k == 0 ? 1e-8 : 1e-12);
            }
        }
    }
    /* from 3e10 m through the pericentre and as far out again: (r / q)^2 = 2e7 times the rounding
     */
    expect_between(on_conic(7e6, 1.5, -8), on_conic(7e6, 1.5, 8), 1e-8);
    expect_between(on_conic(7e6, 1.5, 8), on_conic(7e6, 1.5, 0), 1e-8);
    /* the other way round nothing is, however far: 4e17 m */
    expect_between(on_conic(7e6, 1.5, 0), on_conic(7e6, 1.5, 25), 1e-12);
    expect_between(on_conic(7e6, 1.5, 0), on_conic(7e6, 1.5, -25), 1e-12);
}

static void nearly_parabolic_orbits(void **state) {
    (void)state;
    for (double from = -4; from < 4.1; from += 0.8) {
        for (double to = -4; to < 4.1; to += 0.7) {
            expect_between(on_parabola(7e6, from), on_parabola(7e6, to), 1e-12);
        }
    }
    /* either side of the parabola by 1e-10 in velocity: the orbit moves by about as much */
    for (int side = -1; side <= 1; side += 2) {
        point from = on_parabola(7e6, -0.5), to = on_parabola(7e6, 2.0);
        from.v = bst_vec3_scale(from.v, 1 + side * 1e-10);
        expect_between(from, to, 3e-9);
    }
}

static void a_whole_period_changes_nothing(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double e[] = {0, 0.01, 0.73, 0.99};
    for (int k = 0; k < 4; k++) {
        point p = on_conic(7e6, e[k], 0.4);
        double a = 7e6 / (1 - e[k]), period = 2 * BST_PI * sqrt(a * a * a / MU);
        for (int n = -1000; n <= 1000; n += 250) {
            bst_vec3 r, v;
            bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, p.r, p.v, n * period, &r, &v));
            /* 1/a = 2/r - v2/mu rounds by 2e-16 x 2/r, the period by 1.5 times that, and on the
             * way round a/r comes in twice more: anomaly per time, and length per anomaly */
            double error = bst_vec3_norm(bst_vec3_sub(r, p.r)) / bst_vec3_norm(p.r);
            bst_assert_close(error, 0, 1e-14 + 3e-14 * abs(n) * pow(a / bst_vec3_norm(p.r), 3));
        }
    }
}

static void energy_and_momentum_are_kept(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    unsigned seed = 12345;
    for (int i = 0; i < 2000; i++) {
        double u[7];
        for (int k = 0; k < 7; k++) {
            seed = seed * 1664525u + 1013904223u;
            u[k] = (double)(seed >> 8) / 8388608.0 - 1.0;
        }
        bst_vec3 r0 = {4e7 * u[0], 4e7 * u[1], 4e7 * u[2]},
                 v0 = {8e3 * u[3], 8e3 * u[4], 8e3 * u[5]};
        if (bst_vec3_norm(r0) < 6e6) {
            continue;
        }
        double t = 2e5 * u[6];
        bst_vec3 r, v, back_r, back_v;
        bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, r0, v0, t, &r, &v));
        bst_vec3 h0 = bst_vec3_cross(r0, v0), h = bst_vec3_cross(r, v);
        double peak = bst_vec3_norm(r) * bst_vec3_norm(v) + bst_vec3_norm(h0);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(h, h0)) / peak, 0, 1e-12);
        double kinetic0 = 0.5 * bst_vec3_dot(v0, v0), potential0 = MU / bst_vec3_norm(r0);
        double kinetic = 0.5 * bst_vec3_dot(v, v), potential = MU / bst_vec3_norm(r);
        bst_assert_close(((kinetic - potential) - (kinetic0 - potential0)) /
                             (kinetic + potential + kinetic0 + potential0),
                         0, 1e-11);
        bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, r, v, -t, &back_r, &back_v));
        /* an orbit that dives close to the centre magnifies rounding */
        double dive = 4e7 * MU / bst_vec3_dot(h0, h0);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(back_r, r0)) / bst_vec3_norm(r0), 0,
                         1e-11 * (1 + dive * dive));
    }
}

static void no_time_is_no_motion(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    point p = on_conic(7e6, 0.3, 1);
    bst_vec3 r, v;
    bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, p.r, p.v, 0, &r, &v));
    assert_true(bst_vec3_norm(bst_vec3_sub(r, p.r)) == 0 &&
                bst_vec3_norm(bst_vec3_sub(v, p.v)) == 0);
    /* a nanosecond is v times it */
    bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, p.r, p.v, 1e-3, &r, &v));
    bst_vec3 expected = bst_vec3_axpy(p.r, 1e-3, p.v);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(r, expected)), 0,
                     1e-5); /* g t^2 / 2 and rounding */
}

static void what_is_no_orbit_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_vec3 r = {7e6, 0, 0}, v = {0, 7e3, 0}, zero = {0, 0, 0}, a, b;
    assert_int_equal(bst_kepler_propagate(&ctx, MU, zero, v, 1, &a, &b), BST_ERR_NUMERIC);
    assert_int_equal(bst_kepler_propagate(&ctx, MU, r, zero, 1, &a, &b), BST_ERR_NUMERIC);
    assert_int_equal(bst_kepler_propagate(&ctx, MU, r, (bst_vec3){5, 0, 0}, 1, &a, &b),
                     BST_ERR_NUMERIC);
    assert_int_equal(bst_kepler_propagate(&ctx, MU, r, v, (double)NAN, &a, &b), BST_ERR_NUMERIC);
    assert_int_equal(
        bst_kepler_propagate(&ctx, MU, (bst_vec3){(double)INFINITY, 0, 0}, v, 1, &a, &b),
        BST_ERR_NUMERIC);
    assert_string_equal(ctx.message, "two-body motion from a rectilinear or non-finite state");
}

/* Kepler's equation holds, in every turn, up to nearly parabolic orbits. */
static void eccentric_anomalies_solve_the_equation(void **state) {
    (void)state;
    const double e[] = {0.0, 1e-3, 0.3, 0.74, 0.97};
    for (int k = 0; k < 5; k++) {
        for (double m = -7.0; m < 14.0; m += 0.173) {
            double x = bst_kepler_eccentric_anomaly(m, e[k]);
            bst_assert_close(x - e[k] * sin(x), m, 1e-13 * 14.0);
            bst_assert_close(x, m, e[k] + 1e-12);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(eccentric_anomalies_solve_the_equation),
        cmocka_unit_test(ellipses),
        cmocka_unit_test(open_orbits),
        cmocka_unit_test(nearly_parabolic_orbits),
        cmocka_unit_test(a_whole_period_changes_nothing),
        cmocka_unit_test(energy_and_momentum_are_kept),
        cmocka_unit_test(no_time_is_no_motion),
        cmocka_unit_test(what_is_no_orbit_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
