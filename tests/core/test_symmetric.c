#include <math.h>

#include "sim/core/symmetric.h"
#include "tests/test_support.h"

/* The Hilbert matrix 1 / (i + j + 1): its inverse holds whole numbers, by binomials (Choi, "Tricks
 * or treats with the Hilbert matrix", American Mathematical Monthly 90, 1983). */
static double binomial(int n, int k) {
    double v = 1.0;
    for (int i = 1; i <= k; i++) {
        v = v * (n - k + i) / i;
    }
    return v;
}

static double hilbert_inverse(int n, int i, int j) {
    double centre = binomial(i + j, i);
    double value =
        (i + j + 1) * binomial(n + i, n - j - 1) * binomial(n + j, n - i - 1) * centre * centre;
    return (i + j) % 2 ? -value : value;
}

static void test_hilbert(void **state) {
    (void)state;
    for (int n = 1; n <= 6; n++) {
        double a[BST_SYMMETRIC_MOST * BST_SYMMETRIC_MOST],
            out[BST_SYMMETRIC_MOST * BST_SYMMETRIC_MOST];
        double condition = 0.0;
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < n; j++) {
                a[i * n + j] = 1.0 / (i + j + 1);
                condition = fmax(condition, fabs(hilbert_inverse(n, i, j)));
            }
        }
        assert_true(bst_symmetric_invert(n, a, out));
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < n; j++) {
                double truth = hilbert_inverse(n, i, j);
                /* rounding of the elements of `a` alone moves the inverse by its condition */
                bst_assert_close(out[i * n + j], truth, 1e-15 * n * condition * fabs(truth));
                assert_true(out[i * n + j] == out[j * n + i]);
            }
        }
    }
}

/* Units of very different size change no digit: angles in rad, rates in rad/s, range in m. */
static void test_sizes(void **state) {
    (void)state;
    double a[9] = {4e-12, 1e-15, 1e-3, 1e-15, 1e-18, 2e-7, 1e-3, 2e-7, 1e6}, b[9];
    assert_true(bst_symmetric_invert(3, a, b));
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double sum = 0.0, size = 0.0;
            for (int k = 0; k < 3; k++) {
                sum += a[i * 3 + k] * b[k * 3 + j];
                size += fabs(a[i * 3 + k] * b[k * 3 + j]);
            }
            bst_assert_close(sum, i == j, 1e-15 * size); /* a few roundings of the sum's terms */
        }
    }
    double in_place[9];
    for (int i = 0; i < 9; i++) {
        in_place[i] = a[i];
    }
    assert_true(bst_symmetric_invert(3, in_place, in_place));
    for (int i = 0; i < 9; i++) {
        assert_true(in_place[i] == b[i]);
    }
}

static void test_refused(void **state) {
    (void)state;
    double out[4] = {7, 7, 7, 7};
    const double cases[][4] = {
        {1, 1, 1, 1}, /* singular */
        {1, 2, 2, 1}, /* indefinite */
        {0, 0, 0, 1}, /* nothing known of an axis */
        {-1, 0, 0, 1},
        {NAN, 0, 0, 1},
        {1, NAN, NAN, 1},
        {INFINITY, 0, 0, 1},
        {1, 1 - 1e-14, 1 - 1e-14, 1}, /* pivot 2e-14 */
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_false(bst_symmetric_invert(2, cases[i], out));
        for (int k = 0; k < 4; k++) {
            assert_true(out[k] == 7.0);
        }
    }
    const double allowed[4] = {1, 1 - 1e-12, 1 - 1e-12, 1}; /* pivot 2e-12 */
    assert_true(bst_symmetric_invert(2, allowed, out));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hilbert),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
