/* Path of the line of sight against splines by their recursive definition. */
#include "sim/process/twin/twin_path.h"

#include "tests/test_support.h"

/* Knot i of clamped, evenly spaced knots for n splines of degree d. */
static double knot(int n, int d, int i) {
    double k = (double)(i - d) / (n - d);
    return k < 0.0 ? 0.0 : k > 1.0 ? 1.0 : k;
}

/* B-spline i of degree k by de Boor's definition; the last interval is closed. */
static double spline(int n, int d, int i, int k, double t) {
    double a = knot(n, d, i), b = knot(n, d, i + k), c = knot(n, d, i + 1),
           e = knot(n, d, i + k + 1);
    if (k == 0) {
        return (t >= a && t < c) || (t >= 1.0 && c >= 1.0 && a < 1.0) ? 1.0 : 0.0;
    }
    return (b > a ? (t - a) / (b - a) * spline(n, d, i, k - 1, t) : 0.0) +
           (e > c ? (e - t) / (e - c) * spline(n, d, i + 1, k - 1, t) : 0.0);
}

static double spline_of(int n, int i, double t) {
    int d = n < 4 ? n - 1 : 3;
    return spline(n, d, i, d, t);
}

static void splines_are_those_of_the_definition(void **state) {
    (void)state;
    static const int counts[] = {1, 2, 3, 4, 5, 7, 19, BST_TWIN_COEFFICIENTS};
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
        for (int j = 0; j <= 26; j++) {
            double t = j / 26.0, value[BST_TWIN_SUPPORT];
            int n = counts[c], first = bst_twin_basis(n, t, value);
            assert_true(first >= 0 && first < n);
            for (int i = 0; i < n; i++) {
                bool in = i >= first && i < first + BST_TWIN_SUPPORT;
                /* rounding */
                bst_assert_close(in ? value[i - first] : 0.0, spline_of(n, i, t), 1e-13);
            }
        }
    }
}

static bst_quat attitude_of(const bst_twin_path *p, double t) {
    double a[3] = {0};
    for (int axis = 0; axis < 3; axis++) {
        int n = p->count[axis == 2];
        for (int i = 0; i < n; i++) {
            a[axis] += p->coefficients[axis][i] * spline_of(n, i, t);
        }
    }
    /* axis and angle, half of it */
    double angle = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]), s = sin(0.5 * angle) / angle;
    const bst_quat turn = {s * a[0], s * a[1], s * a[2], cos(0.5 * angle)};
    return bst_quat_mul(turn, p->q_reference);
}

static void assert_same_attitude(bst_quat a, bst_quat b, double tolerance) {
    double s = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w < 0.0 ? -1.0 : 1.0;
    bst_assert_close(a.x, s * b.x, tolerance);
    bst_assert_close(a.y, s * b.y, tolerance);
    bst_assert_close(a.z, s * b.z, tolerance);
    bst_assert_close(a.w, s * b.w, tolerance);
}

static bst_twin_path some_path(void) {
    return (bst_twin_path){
        .q_reference = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7}),
        .count = {7, 5},
        .coefficients = {{0.01, -0.02, 0.03, 0.015, -0.01, 0.005, 0.02},
                         {-0.02, 0.01, -0.01, 0.025, 0.02, -0.03, 0.01},
                         {0.1, 0.15, -0.05, 0.02, -0.12}},
    };
}

static void attitude_turns_the_reference_by_all_three_angles(void **state) {
    (void)state;
    const bst_twin_path p = some_path();
    for (int i = 0; i <= 10; i++) {
        assert_same_attitude(bst_twin_path_attitude(&p, i / 10.0), attitude_of(&p, i / 10.0),
                             1e-14);
    }
}

static void a_path_comes_back_from_its_attitudes(void **state) {
    (void)state;
    const bst_twin_path p = some_path();
    bst_twin_attitude nodes[40];
    bst_twin_path fitted = {.q_reference = p.q_reference, .count = {7, 5}};
    for (int i = 0; i < 40; i++) {
        double t = i / 39.0;
        nodes[i] = (bst_twin_attitude){t * t, attitude_of(&p, t * t)}; /* uneven times */
    }
    assert_true(bst_twin_path_fit(&fitted, nodes, 40));
    for (int axis = 0; axis < 3; axis++) {
        for (int i = 0; i < p.count[axis == 2]; i++) {
            /* the stiffness of 1e-9 */
            bst_assert_close(fitted.coefficients[axis][i], p.coefficients[axis][i], 1e-8);
        }
    }
}

static void more_coefficients_leave_the_path(void **state) {
    (void)state;
    const bst_twin_path p = some_path(); /* 4 and 2 intervals: 8 and 4 hold their knots */
    bst_twin_path finer = p;
    assert_true(bst_twin_path_refine(&finer, 11, 7));
    assert_int_equal(finer.count[0], 11);
    assert_int_equal(finer.count[1], 7);
    for (int i = 0; i <= 50; i++) {
        assert_same_attitude(bst_twin_path_attitude(&finer, i / 50.0), attitude_of(&p, i / 50.0),
                             1e-8);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(splines_are_those_of_the_definition),
        cmocka_unit_test(attitude_turns_the_reference_by_all_three_angles),
        cmocka_unit_test(a_path_comes_back_from_its_attitudes),
        cmocka_unit_test(more_coefficients_leave_the_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
