#include "sim/dynamics/integrators.h"
#include "tests/test_support.h"

static void oscillator(const void *user, const double *y, double *rate) {
    const double *w = user;
    rate[0] = y[1];
    rate[1] = -*w * *w * y[0];
}

/* Fourth order on a closed form: sixteen times less with half the step. */
static void test_rk4_order(void **state) {
    (void)state;
    double w = 3.0, error[2];
    for (int k = 0; k < 2; k++) {
        int steps = 200 << k;
        double y[2] = {1.0, 0.0};
        for (int n = 0; n < steps; n++) {
            bst_dynamics_rk4_step(oscillator, &w, 2, 4.0 / steps, y);
        }
        error[k] = hypot(y[0] - cos(12.0), y[1] / w + sin(12.0));
    }
    assert_true(error[0] < 1e-4);
    bst_assert_close(log2(error[0] / error[1]), 4.0, 0.05); /* the next order is 1 % */
}

/* A damped oscillator with a constant force, by the matrix: over any step what the closed form
 * gives, at steps of many cycles too. */
static void test_matrix_exp_is_exact(void **state) {
    (void)state;
    double w = 7.0, z = 0.03, force = 2.0, damped = w * sqrt(1.0 - z * z);
    static const double steps[4] = {1e-6, 0.01, 0.5, 20.0};
    for (int i = 0; i < 4; i++) {
        double t = steps[i];
        const double a[9] = {0, t, 0, -w * w * t, -2 * z * w * t, t, 0, 0, 0};
        double e[9];
        bst_dynamics_matrix_exp(3, a, e);
        double rest = force / (w * w), s = sin(damped * t), c = cos(damped * t),
               d = exp(-z * w * t);
        double x0 = 0.3, v0 = -1.0, x = x0 - rest;
        double expected_x = rest + d * (x * c + (v0 + z * w * x) / damped * s);
        double expected_v = d * (v0 * c - (w * w * x + z * w * v0) / damped * s);
        /* squaring a matrix k times multiplies rounding by 2^k: 20 s are 4000 scaled steps */
        bst_assert_close(e[0] * x0 + e[1] * v0 + e[2] * force, expected_x, 1e-11);
        bst_assert_close(e[3] * x0 + e[4] * v0 + e[5] * force, expected_v, 1e-10);
    }
}

static void test_eigen(void **state) {
    (void)state;
    /* a tridiagonal 1, -2, 1 matrix: -2 + 2 cos(k pi / (n + 1)) */
    enum { N = 6 };
    double a[N * N] = {0}, value[N], vector[N * N];
    for (int i = 0; i < N; i++) {
        a[i * N + i] = -2.0;
        if (i > 0) {
            a[i * N + i - 1] = a[(i - 1) * N + i] = 1.0;
        }
    }
    bst_dynamics_symmetric_eigen(N, a, value, vector);
    for (int k = 0; k < N; k++) {
        bst_assert_close(value[k], -2.0 + 2.0 * cos((N - k) * BST_PI / (N + 1)), 1e-14);
        for (int i = 0; i < N; i++) { /* A v = value v */
            double sum = 0.0;
            for (int j = 0; j < N; j++) {
                sum += a[i * N + j] * vector[j * N + k];
            }
            bst_assert_close(sum, value[k] * vector[i * N + k], 1e-14);
        }
    }
    const double diagonal[9] = {3, 0, 0, 0, 1, 0, 0, 0, 2};
    double v3[9], e3[3];
    bst_dynamics_symmetric_eigen(3, diagonal, e3, v3);
    bst_assert_close(e3[0], 1.0, 0.0);
    bst_vec3 x = {v3[0], v3[3], v3[6]}, y = {v3[1], v3[4], v3[7]}, z = {v3[2], v3[5], v3[8]};
    bst_assert_close(bst_vec3_dot(bst_vec3_cross(x, y), z), 1.0, 1e-15); /* right-handed */
}

/* The splitting run back in time comes back: it is symmetric, to rounding of 2000 steps. */
static void test_symmetric_in_time(void **state) {
    (void)state;
    bst_dynamics_free_body body = {{1.0, 0.5, 0.4}, {0.1, -0.2, 0.05}};
    bst_quat q = bst_quat_unit((bst_quat){0.3, 0.1, -0.2, 0.9}), start = q;
    double pi[3] = {0.5, -0.3, 0.8};
    for (int n = 0; n < 1000; n++) {
        bst_dynamics_turn_free_body(&body, 0.05, &q, pi);
    }
    assert_true(fabs(q.w - start.w) > 0.01);
    for (int n = 0; n < 1000; n++) {
        bst_dynamics_turn_free_body(&body, -0.05, &q, pi);
    }
    bst_assert_close(q.w, start.w, 1e-12);
    bst_assert_close(q.x, start.x, 1e-12);
    bst_assert_close(pi[1], -0.3, 1e-12);
}

/* Principal axes of bodies turned in all directions: orthonormal, right-handed, ascending, and
 * v_k turned back is an axis of the body. */
static void principal_axes_are_right_handed(void **state) {
    (void)state;
    const double inertia[3] = {2.0, 3.0, 5.0};
    for (int turn = 0; turn < 60; turn++) {
        double angle = 0.1 * turn;
        bst_quat q = bst_quat_from_rotvec(
            (bst_vec3){angle * cos(1.3 * turn), angle * sin(0.7 * turn), 0.5 - 0.05 * turn});
        const bst_vec3 axes[3] = {bst_quat_rotate(q, (bst_vec3){1, 0, 0}),
                                  bst_quat_rotate(q, (bst_vec3){0, 1, 0}),
                                  bst_quat_rotate(q, (bst_vec3){0, 0, 1})};
        double a[9] = {0}, value[3], v[9];
        for (int k = 0; k < 3; k++) {
            /* which of the axes has which moment changes from turn to turn */
            const double e[3] = {axes[k].x, axes[k].y, axes[k].z};
            for (int i = 0; i < 9; i++) {
                a[i] += inertia[(k + turn) % 3] * e[i / 3] * e[i % 3];
            }
        }
        bst_dynamics_symmetric_eigen(3, a, value, v);
        bst_vec3 x = {v[0], v[3], v[6]}, y = {v[1], v[4], v[7]}, z = {v[2], v[5], v[8]};
        const bst_vec3 found[3] = {x, y, z};
        bst_assert_close(bst_vec3_dot(bst_vec3_cross(x, y), z), 1.0, 1e-14); /* rounding */
        for (int k = 0; k < 3; k++) {
            bst_assert_close(value[k], inertia[k], 1e-14);
            /* the body's axis of this moment, up to its sign */
            double along = bst_vec3_dot(found[k], axes[(k - turn % 3 + 3) % 3]);
            bst_assert_close(fabs(along), 1.0, 1e-14);
        }
    }
}

/* A symmetric body with a wheel along its axis: the momentum across the axis turns in the body at
 * p / A - (p - h) / C, p along the axis, moments A across and C along it, h of the wheel. */
static void a_wheel_along_each_axis(void **state) {
    (void)state;
    const double across = 2.0, along = 3.0, wheel = 0.7, p = 1.0, dt = 0.01;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        bst_dynamics_free_body body = {.shift = {0.0}};
        bst_quat q = BST_QUAT_IDENTITY;
        double pi[3], angle = 10.0 * (p / across - (p - wheel) / along);
        for (int m = 0; m < 3; m++) {
            body.per_moment[m] = 1.0 / (m == i ? along : across);
        }
        body.shift[i] = wheel;
        pi[i] = p;
        pi[j] = 0.3;
        pi[k] = -0.2;
        bst_vec3 before = {pi[0], pi[1], pi[2]};
        for (int n = 0; n < 1000; n++) {
            bst_dynamics_turn_free_body4(&body, dt, &q, pi);
        }
        /* of fourth order: some 1e-10 after 1000 steps of 5 mrad */
        bst_assert_close(pi[i], p, 1e-8);
        bst_assert_close(pi[j], 0.3 * cos(angle) + 0.2 * sin(angle), 1e-8);
        bst_assert_close(pi[k], -0.2 * cos(angle) + 0.3 * sin(angle), 1e-8);
        /* the momentum in space stays */
        bst_vec3 back = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){pi[0], pi[1], pi[2]});
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(back, before)), 0.0, 1e-11);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rk4_order),
                                       cmocka_unit_test(test_matrix_exp_is_exact),
                                       cmocka_unit_test(test_eigen),
                                       cmocka_unit_test(principal_axes_are_right_handed),
                                       cmocka_unit_test(test_symmetric_in_time),
                                       cmocka_unit_test(a_wheel_along_each_axis)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
