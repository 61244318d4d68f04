/* Gauss's method and Lambert's problem, against examples that textbooks print. */
#include "sim/astro/gauss_angles.h"
#include "sim/astro/kepler.h"
#include "sim/astro/lambert.h"
#include "tests/test_support.h"

static const double MU = 3.986004418e14;

static double distance(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b));
}

/* A site on a spheroid, seen from the centre: Curtis equation 5.56. */
static bst_vec3 site(double latitude_deg, double sidereal_deg, double height_m) {
    const double re = 6378e3, f = 0.003353;
    double s = sin(latitude_deg * BST_DEG_RAD), c = cos(latitude_deg * BST_DEG_RAD);
    double root = sqrt(1.0 - (2.0 * f - f * f) * s * s);
    double across = (re / root + height_m) * c;
    return (bst_vec3){across * cos(sidereal_deg * BST_DEG_RAD),
                      across * sin(sidereal_deg * BST_DEG_RAD),
                      (re * (1.0 - f) * (1.0 - f) / root + height_m) * s};
}

/* Curtis, Orbital Mechanics for Engineering Students, example 5.11: a = 10,000 km, e = 0.1, i = 30,
 * node 270, perigee 90 degrees. */
static void curtis_example_5_11(void **state) {
    (void)state;
    static const double t[3] = {0.0, 118.10, 237.58}, ra[3] = {43.537, 54.420, 64.318};
    static const double dec[3] = {-8.7833, -12.074, -15.105}, lst[3] = {44.506, 45.000, 45.499};
    bst_ctx ctx = {0};
    bst_gauss_sight sights[3];
    bst_gauss_orbit orbits[BST_GAUSS_ROOTS];
    int count;
    for (int i = 0; i < 3; i++) {
        sights[i] =
            (bst_gauss_sight){t[i], bst_vec3_from_radec(ra[i] * BST_DEG_RAD, dec[i] * BST_DEG_RAD),
                              site(40.0, lst[i], 1e3)};
    }
    bst_assert_ok(&ctx, bst_gauss_angles(&ctx, 3.986e14, sights, orbits, &count));
    assert_int_equal(count, 1);
    /* the book prints its own rounded intermediate steps: 0.1 km and 5 digits; root 9241.8 km */
    bst_assert_close(orbits[0].geocentric_range_m, 9241.8e3, 1.5e3);
    assert_true(distance(orbits[0].position_m[1], (bst_vec3){5659.1e3, 6533.8e3, 3270.1e3}) < 2e3);
    assert_true(distance(orbits[0].velocity_mps, (bst_vec3){-3880.0, 5115.6, -2239.7}) < 35.0);
}

/* Vallado, Fundamentals of Astrodynamics and Applications, example 7-2 (the third, fifth and sixth
 * of his observations): the orbit they were made of has a = 12,246.023 km, e = 0.2, i = 40, node
 * 330 degrees. */
static void vallado_example_7_2(void **state) {
    (void)state;
    static const double day[3] = {0.4864351851851852, 0.49199074074074073, 0.4947685185185185};
    static const double ra[3] = {0.939913, 45.025748, 67.886655};
    static const double dec[3] = {18.667717, 35.664741, 36.996583};
    static const bst_vec3 observer[3] = {{4054881.0, 2748195.0, 4074237.0},
                                         {3956224.0, 2888232.0, 4074364.0},
                                         {3905073.0, 2956935.0, 4074430.0}};
    bst_ctx ctx = {0};
    bst_gauss_sight sights[3];
    bst_gauss_orbit orbits[BST_GAUSS_ROOTS];
    int count;
    for (int i = 0; i < 3; i++) {
        sights[i] = (bst_gauss_sight){
            86400.0 * day[i], bst_vec3_from_radec(ra[i] * BST_DEG_RAD, dec[i] * BST_DEG_RAD),
            observer[i]};
    }
    bst_assert_ok(&ctx, bst_gauss_angles(&ctx, MU, sights, orbits, &count));
    assert_true(count >= 1);
    double nearest = INFINITY;
    for (int i = 0; i < count; i++) {
        nearest = fmin(nearest, distance(orbits[i].position_m[1],
                                         (bst_vec3){6313378.130, 5247505.633, 6467707.164}));
    }
    /* printed to 1 mm. (The book's velocity comes of Gibbs's method; tests/tracker/test_orbit.c
     * refines this orbit to the one that the observations were made of.) */
    assert_true(nearest < 0.01);
}

static double octic(double a, double b, double c, double x) {
    return pow(x, 8) + a * pow(x, 6) + b * pow(x, 3) + c;
}

static void all_positive_roots_are_found(void **state) {
    (void)state;
    double roots[BST_GAUSS_ROOTS];
    /* from three wanted roots r, the coefficients follow by linear equations */
    static const double wanted[3] = {1.0, 1.3, 1.9};
    double m[3][4];
    for (int i = 0; i < 3; i++) {
        double x = wanted[i];
        m[i][0] = pow(x, 6);
        m[i][1] = pow(x, 3);
        m[i][2] = 1.0;
        m[i][3] = -pow(x, 8);
    }
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            double f = m[i][k] / m[k][k];
            for (int j = 0; j < 4 && i != k; j++) {
                m[i][j] -= f * m[k][j];
            }
        }
    }
    double a = m[0][3] / m[0][0], b = m[1][3] / m[1][1], c = m[2][3] / m[2][2];
    for (double unit = 1.0; unit < 1e9; unit *= 4.2e7) {
        int found = bst_gauss_roots(a * pow(unit, 2), b * pow(unit, 5), c * pow(unit, 8), roots);
        assert_int_equal(found, 3);
        for (int i = 0; i < 3; i++) {
            /* roots of a polynomial with coefficients of 1e-16: over its slope there, about 0.1 */
            bst_assert_close(roots[i] / unit, wanted[i], 1e-12);
        }
    }
    assert_int_equal(bst_gauss_roots(1.0, 1.0, 1.0, roots), 0);
    assert_int_equal(bst_gauss_roots(-3.0, 1.0, -1.0, roots), 1);
    /* against the sum of terms: relative to the largest, 3 * 1.7^6 */
    bst_assert_close(octic(-3.0, 1.0, -1.0, roots[0]), 0.0, 1e-12);
    assert_int_equal(bst_gauss_roots(0.0, 0.0, -1.0, roots), 1);
    bst_assert_close(roots[0], 1.0, 1e-15); /* rounding */
    assert_int_equal(bst_gauss_roots(0.0, 0.0, 0.0, roots), 0);
    assert_int_equal(bst_gauss_roots(NAN, 0.0, 0.0, roots), 0);
}

static void directions_in_one_plane_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_gauss_orbit orbits[BST_GAUSS_ROOTS];
    int count;
    bst_gauss_sight s[3];
    for (int i = 0; i < 3; i++) {
        s[i] = (bst_gauss_sight){60.0 * i, bst_vec3_from_radec(0.1 * i * i + 0.3, 0.0),
                                 bst_vec3_from_radec(0.06 * i, 0.0)};
        s[i].observer_m = bst_vec3_scale(s[i].observer_m, 7e6);
    }
    assert_int_equal(bst_gauss_angles(&ctx, MU, s, orbits, &count), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "one plane"));
    s[1] = s[2] = s[0];
    s[1].time_s = 60.0;
    s[2].time_s = 120.0;
    assert_int_equal(bst_gauss_angles(&ctx, MU, s, orbits, &count), BST_ERR_NUMERIC);
    s[2].time_s = 10.0;
    assert_int_equal(bst_gauss_angles(&ctx, MU, s, orbits, &count), BST_ERR_ARGUMENT);
}

/* ------------------------------------------------------------------ Lambert */

/* Curtis example 5.2. */
static void curtis_example_5_2(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_vec3 v1, v2;
    bst_assert_ok(&ctx, bst_lambert(&ctx, 3.986e14, (bst_vec3){5000e3, 10000e3, 2100e3},
                                    (bst_vec3){-14600e3, 2500e3, 7000e3}, 3600.0,
                                    (bst_lambert_way){0}, &v1, &v2));
    /* printed to 0.1 m/s with a gravitational parameter of four digits */
    assert_true(distance(v1, (bst_vec3){-5992.5, 1925.4, 3245.6}) < 0.2);
    assert_true(distance(v2, (bst_vec3){-3312.5, -4196.6, -385.29}) < 0.2);
}

/* Any conic, from any place to any other: propagated by the closed form, and back by Lambert. */
static void lambert_undoes_propagation(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double worst = 0.0;
    int tried = 0;
    for (int k = 0; k < 4000; k++) {
        /* radical inverses: an even set of orbits */
        double u[5];
        static const int base[5] = {2, 3, 5, 7, 11};
        for (int d = 0; d < 5; d++) {
            u[d] = 0.0;
            double part = 1.0 / base[d];
            for (int i = k + 1; i; i /= base[d], part /= base[d]) {
                u[d] += part * (i % base[d]);
            }
        }
        double r = 7e6 * pow(6.0, u[0]);
        double speed = sqrt(MU / r) * (0.3 + 1.6 * u[1]), climb = (u[2] - 0.5) * 2.8;
        bst_vec3 r1 = {r, 0.0, 0.0};
        bst_vec3 v1 = {speed * sin(climb), 0.8 * speed * cos(climb), 0.6 * speed * cos(climb)};
        double alpha = 2.0 / r - speed * speed / MU;
        double period = alpha > 0.0 ? 2.0 * BST_PI / sqrt(MU * alpha * alpha * alpha) : 0.0;
        int turns = alpha > 0.0 ? (int)(3.0 * u[3]) : 0;
        double seconds =
            alpha > 0.0 ? (turns + 0.02 + 0.96 * u[4]) * period : (0.05 + 3.0 * u[4]) * r / speed;
        bst_vec3 r2, v2, got1, got2;
        bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, MU, r1, v1, seconds, &r2, &v2));
        bst_vec3 h = bst_vec3_cross(r1, v1), turn = bst_vec3_cross(r1, r2);
        double sine = bst_vec3_norm(turn) / (r * bst_vec3_norm(r2));
        if (sine < 0.02 || bst_vec3_norm(r2) < 1e6) {
            continue; /* the plane is not determined, or the centre is met */
        }
        double off = INFINITY;
        for (int high = 0; high < (turns ? 2 : 1); high++) {
            bst_lambert_way way = {bst_vec3_dot(h, turn) < 0.0, turns, high == 1};
            if (bst_lambert(&ctx, MU, r1, r2, seconds, way, &got1, &got2) == BST_OK) {
                off =
                    fmin(off, distance(got1, v1) / speed + distance(got2, v2) / bst_vec3_norm(v2));
            }
        }
        tried++;
        worst = fmax(worst, off);
        if (!(off < 1e-6)) {
            fail_msg("orbit %d: off by %g (turns %d, alpha r %g)", k, off, turns, alpha * r);
        }
    }
    print_message("Lambert: %d orbits, at most %.2g of the speed off\n", tried, worst);
    assert_true(tried > 3000);
}

static void lambert_refuses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_vec3 v1, v2, r = {7e6, 0.0, 0.0}, s = {0.0, 8e6, 0.0};
    const bst_lambert_way direct = {0}, twice = {.revolutions = 2};
    assert_int_equal(bst_lambert(&ctx, MU, r, bst_vec3_scale(r, -1.5), 3000.0, direct, &v1, &v2),
                     BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "plane"));
    assert_int_equal(bst_lambert(&ctx, MU, r, s, 5000.0, twice, &v1, &v2), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "longer"));
    assert_int_equal(bst_lambert(&ctx, MU, r, s, 0.0, direct, &v1, &v2), BST_ERR_ARGUMENT);
    assert_int_equal(bst_lambert(&ctx, MU, r, (bst_vec3){NAN, 0, 0}, 1.0, direct, &v1, &v2),
                     BST_ERR_ARGUMENT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(curtis_example_5_11),
        cmocka_unit_test(vallado_example_7_2),
        cmocka_unit_test(all_positive_roots_are_found),
        cmocka_unit_test(directions_in_one_plane_are_refused),
        cmocka_unit_test(curtis_example_5_2),
        cmocka_unit_test(lambert_undoes_propagation),
        cmocka_unit_test(lambert_refuses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
