/* Margins against closed forms, and stability against the roots of the closed loop. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "control/loop/stability.h"
#include "tests/test_support.h"

enum { DEGREE = 6 };

/* Polynomials in z, lowest power first, and a delay of whole samples. */
typedef struct rational {
    double num[DEGREE + 1], den[DEGREE + 1];
    double dt_s;
} rational;

static double complex polynomial(const double *p, double complex z) {
    double complex sum = 0.0;
    for (int i = DEGREE; i >= 0; i--) {
        sum = sum * z + p[i];
    }
    return sum;
}

static double complex rational_at(const void *user, double w) {
    const rational *r = user;
    double complex z = cexp(I * w * r->dt_s);
    return polynomial(r->num, z) / polynomial(r->den, z);
}

/* The denominator over its highest power of z: it tends to 1 at infinity. */
static double complex monic_denominator(const void *user, double w) {
    const rational *r = user;
    int degree = DEGREE;
    while (r->den[degree] == 0.0) {
        degree--;
    }
    double complex z = cexp(I * w * r->dt_s);
    return polynomial(r->den, z) / (r->den[degree] * cpow(z, degree));
}

static bst_loop_margins margins_of(const bst_loop *loop) {
    bst_ctx ctx = {0};
    bst_loop_margins m;
    bst_assert_ok(&ctx, bst_loop_analyse(&ctx, loop, &m));
    return m;
}

static double db(double x) {
    return 20.0 * log10(x);
}

static void test_discrete_integrator(void **state) {
    (void)state;
    /* k / (z - 1): closed-loop pole 1 - k */
    rational r = {.num = {0.5}, .den = {-1.0, 1.0}, .dt_s = 0.1};
    bst_loop loop = {rational_at, &r, r.dt_s, 0.0, 0, NULL, 0, NULL, NULL};
    bst_loop_margins m = margins_of(&loop);
    assert_true(m.stable);
    bst_assert_close(m.gain_margin_db, db(4.0), 1e-9); /* at z = -1: rounding */
    assert_true(isinf(m.gain_reduction_db));
    double w = 2.0 * asin(0.25); /* |z - 1| = 2 sin(w / 2) = k */
    bst_assert_close(m.crossover_hz, w / (2 * BST_PI * 0.1), 1e-9);
    bst_assert_close(m.phase_margin_deg, 90.0 - 0.5 * w / BST_DEG_RAD, 1e-6);
    bst_assert_close(m.delay_margin_s, (0.5 * BST_PI - 0.5 * w) / w * 0.1, 1e-9);
    bst_assert_close(m.sensitivity_peak, 1.0 / (1.0 - 0.25), 1e-6); /* at z = -1 */
    assert_null(bst_loop_verdict(&m));
    /* |k / (z - 1 + k)|^2 = 1/2: k^2 = k^2 + 2 (1 - k)(1 - cos w) ... */
    double cosine = (0.25 + 1.0 - 0.5) / 1.0; /* |z - 0.5|^2 = 1.25 - cos w = 2 k^2 = 0.5 */
    bst_assert_close(m.bandwidth_hz, acos(cosine) / (2 * BST_PI * 0.1), 1e-6);

    r.num[0] = 2.5;
    m = margins_of(&loop);
    assert_false(m.stable);
    assert_int_equal(m.unstable_closed, 1);
    bst_assert_close(m.gain_margin_db, db(2.0 / 2.5), 1e-9);
    assert_true(m.phase_margin_deg <= 0.0 && m.delay_margin_s == 0.0);
    assert_string_equal(bst_loop_verdict(&m), "is unstable");
    r.num[0] = 1.1; /* 5.2 dB */
    m = margins_of(&loop);
    assert_string_equal(bst_loop_verdict(&m), "has thin margins");
}

typedef struct delayed {
    double gain, delay_s;
} delayed;

static double complex integrator_with_delay(const void *user, double w) {
    const delayed *d = user;
    return d->gain * cexp(-I * w * d->delay_s) / (I * w);
}

static void test_delay(void **state) {
    (void)state;
    /* K exp(-s T) / s: -180 deg at pi / (2 T), crossover at K */
    delayed d = {2.0, 0.2};
    bst_loop loop = {integrator_with_delay, &d, 1e-3, 0.0, 0, NULL, 0, NULL, NULL};
    bst_loop_margins m = margins_of(&loop);
    assert_true(m.stable);
    bst_assert_close(m.gain_margin_db, db(BST_PI / 2 / 0.4), 1e-6);
    bst_assert_close(m.phase_crossover_hz, 1.0 / 0.8, 1e-6);
    bst_assert_close(m.phase_margin_deg, 90.0 - 0.4 / BST_DEG_RAD, 1e-6);
    bst_assert_close(m.delay_margin_s, BST_PI / 4 - 0.2, 1e-9);
    bst_assert_close(m.crossover_hz, 2.0 / (2 * BST_PI), 1e-9);
    d.delay_s = BST_PI / 4 * 1.001;
    m = margins_of(&loop);
    assert_int_equal(m.unstable_closed, 2);
    d.delay_s = BST_PI / 4 * 0.999;
    assert_true(margins_of(&loop).stable);
}

static double complex conditional(const void *user, double w) {
    double complex s = I * w;
    return *(const double *)user * (s + 1) * (s + 1) / (s * s * s);
}

static void test_conditionally_stable(void **state) {
    (void)state;
    /* s^3 + K (s + 1)^2: Routh says stable for K > 1/2 */
    double k = 2.0;
    bst_loop loop = {conditional, &k, 1e-4, 0.0, 0, NULL, 0, NULL, NULL};
    bst_loop_margins m = margins_of(&loop);
    assert_true(m.stable && isinf(m.gain_margin_db));
    bst_assert_close(m.gain_reduction_db, db(4.0), 1e-6);
    k = 0.4;
    m = margins_of(&loop);
    assert_int_equal(m.unstable_closed, 2);
}

/* A static plant has no crossover. */
static void test_no_crossover(void **state) {
    (void)state;
    rational r = {.num = {0.4}, .den = {0.0, 1.0}, .dt_s = 1.0};
    bst_loop loop = {rational_at, &r, r.dt_s, 0.0, 0, NULL, 0, NULL, NULL};
    bst_loop_margins m = margins_of(&loop);
    assert_true(m.stable && isinf(m.phase_margin_deg) && isinf(m.delay_margin_s));
    assert_true(m.crossover_hz == 0.0 && m.bandwidth_hz == 0.0);
    bst_assert_close(m.gain_margin_db, db(2.5), 1e-9);
    r.den[1] = 0.0;
    bst_ctx ctx = {0};
    assert_int_equal(bst_loop_analyse(&ctx, &loop, &m), BST_ERR_NUMERIC);
}

/* Roots by Durand and Kerner's iteration. */
static void roots_of(const double *p, int degree, double complex *root) {
    for (int i = 0; i < degree; i++) {
        root[i] = cpow(0.4 + 0.9 * I, i);
    }
    for (int turn = 0; turn < 2000; turn++) {
        double moved = 0.0;
        for (int i = 0; i < degree; i++) {
            double complex q = polynomial(p, root[i]) / p[degree];
            for (int k = 0; k < degree; k++) {
                q /= k == i ? 1.0 : root[i] - root[k];
            }
            root[i] -= q;
            moved = fmax(moved, cabs(q));
        }
        if (moved < 1e-15) {
            return;
        }
    }
}

static void multiply(double *p, double a, double b, double c) { /* by a + b z + c z^2 */
    double out[DEGREE + 1] = {0};
    for (int i = 0; i <= DEGREE; i++) {
        out[i] += a * p[i];
        if (i + 1 <= DEGREE) {
            out[i + 1] += b * p[i];
        }
        if (i + 2 <= DEGREE) {
            out[i + 2] += c * p[i];
        }
    }
    memcpy(p, out, sizeof out);
}

static void test_against_roots(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(7, 0, "stability", "loops");
    int seen[4] = {0}, with_integrators = 0, undeclared = 0;
    for (uint64_t n = 0; n < 400; n++) {
        double u[16];
        for (uint64_t i = 0; i < 16; i++) {
            u[i] = bst_rng_uniform(key, n, i);
        }
        rational r = {.num = {1.0}, .den = {1.0}, .dt_s = 0.5};
        /* up to two poles at one, a pair anywhere within radius 1.2, one or two real ones */
        int ones = (int)(3 * u[0]), unstable = 0, degree = ones + 3;
        for (int i = 0; i < ones; i++) {
            multiply(r.den, -1.0, 1.0, 0.0);
        }
        double radius = 1.2 * u[1], angle = BST_PI * u[2], real = 2.0 * u[3] - 1.0;
        if (fabs(radius - 1.0) < 0.01) {
            continue; /* on the contour */
        }
        unstable += radius > 1.0 ? 2 : 0;
        multiply(r.den, radius * radius, -2 * radius * cos(angle), 1.0);
        multiply(r.den, -real, 1.0, 0.0);
        multiply(r.num, u[4] - 0.5, u[5] - 0.5, 2 * u[6] - 1.0);
        double closed[DEGREE + 1];
        for (int i = 0; i <= DEGREE; i++) {
            r.num[i] *= pow(10.0, 2.0 * u[7] - 1.5);
            closed[i] = r.num[i] + r.den[i];
        }
        double complex root[DEGREE];
        roots_of(closed, degree, root);
        int outside = 0;
        double nearest = INFINITY;
        for (int i = 0; i < degree; i++) {
            outside += cabs(root[i]) > 1.0;
            nearest = fmin(nearest, fabs(cabs(root[i]) - 1.0));
        }
        if (nearest < 1e-4) {
            continue; /* closed-loop pole on the circle, or so slow that the walk starts above it */
        }
        bst_loop loop = {rational_at, &r, r.dt_s, 0.0, unstable, NULL, 0, NULL, NULL};
        bst_loop_margins m = margins_of(&loop);
        if (m.unstable_closed != outside) {
            fail_msg("loop %d: %d poles outside by Nyquist, %d by roots", (int)n, m.unstable_closed,
                     outside);
        }
        /* the open loop's poles counted from its denominator: both counts are the roots' */
        bst_loop counted = {rational_at, &r, r.dt_s, 0.0, -1, NULL, 0, monic_denominator, NULL};
        assert_int_equal(margins_of(&counted).unstable_closed, outside);
        loop.unstable_poles = 0;
        if (outside < unstable) { /* an undeclared pole is an error, not a count below 0 */
            bst_ctx ctx = {0};
            assert_int_equal(bst_loop_analyse(&ctx, &loop, &m), BST_ERR_NUMERIC);
            undeclared++;
            loop.unstable_poles = unstable;
            m = margins_of(&loop);
        }
        seen[outside < 3 ? outside : 3]++;
        with_integrators += ones > 0;
        if (m.stable && isfinite(m.gain_margin_db)) { /* at the margin a root lies on the circle */
            double factor = pow(10.0, m.gain_margin_db / 20.0), on = INFINITY;
            for (int i = 0; i <= DEGREE; i++) {
                closed[i] = factor * r.num[i] + r.den[i];
            }
            roots_of(closed, degree, root);
            for (int i = 0; i < degree; i++) {
                on = fmin(on, fabs(cabs(root[i]) - 1.0));
            }
            bst_assert_close(on, 0.0, 1e-6); /* double roots: square root of rounding */
        }
    }
    /* the loops are of all kinds */
    assert_true(seen[0] > 30 && seen[1] > 30 && seen[2] > 30 && with_integrators > 100);
    assert_true(undeclared >= 5);
}

typedef struct modal {
    double gain, mode_hz, damping, share, dt_s;
} modal;

static double complex modal_at(const void *user, double w) {
    const modal *m = user;
    double complex s = I * w;
    double wm = 2 * BST_PI * m->mode_hz;
    return m->gain / s * (1.0 + m->share * wm * wm / (s * s + 2 * m->damping * wm * s + wm * wm));
}

static void test_narrow_mode(void **state) {
    (void)state;
    /* round the mode the loop runs through a circle of the diameter share / (2 damping w_m) to the
     * left of -j / w_m, whose far side it meets the axis on */
    modal p = {1.0, 7.0, 1e-6, 1e-5, 1e-3};
    bst_loop loop = {modal_at, &p, p.dt_s, 0.0, 0, &p.mode_hz, 1, NULL, NULL};
    bst_loop_margins m = margins_of(&loop);
    double wm = 2 * BST_PI * 7.0, radius = 0.5e-5 / (2e-6 * wm);
    double at_axis = radius + sqrt(radius * radius - 1.0 / (wm * wm));
    bst_assert_close(m.gain_margin_db, -db(at_axis), 1e-3); /* share and damping to first order */
    p.share = 1e-3;
    m = margins_of(&loop);
    assert_int_equal(m.unstable_closed, 2);
}

static void test_step_response(void **state) {
    (void)state;
    rational r = {.num = {0.3}, .den = {-1.0, 1.0}, .dt_s = 0.1};
    bst_loop loop = {rational_at, &r, r.dt_s, 0.0, 0, NULL, 0, NULL, NULL};
    double out[40];
    bst_loop_step_response(&loop, 256, NAN, out, 40);
    for (int n = 0; n < 40; n++) {
        bst_assert_close(out[n], 1.0 - pow(0.7, n), 1e-10); /* rounding over 128 terms */
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_discrete_integrator),  cmocka_unit_test(test_delay),
        cmocka_unit_test(test_conditionally_stable), cmocka_unit_test(test_no_crossover),
        cmocka_unit_test(test_against_roots),        cmocka_unit_test(test_narrow_mode),
        cmocka_unit_test(test_step_response),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
