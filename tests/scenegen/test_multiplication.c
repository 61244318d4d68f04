/* The law of the multiplication register as the kernel draws it: quantiles against closed forms,
 * and its divergence from the gamma distribution. */
#include "scenegen/detector/multiplication.h"

#include <math.h>

#include "tests/test_support.h"

static double below_normal(double z) {
    return 0.5 * erfc(-z / sqrt(2.0));
}

/* Upper tail of the gamma distribution of whole shape n: exp(-x) times the sum of x^k / k!. */
static double gamma_above(int n, double x) {
    double sum = 0.0;
    for (int k = 0; k < n; k++) {
        sum += exp(-x + k * log(x) - lgamma(k + 1.0));
    }
    return sum;
}

static void quantiles_are_those_of_the_gamma_distribution(void **state) {
    (void)state;
    for (double z = -7.0; z <= 7.0; z += 0.35) {
        double x = bst_multiplication_quantile(1, z); /* exponential distribution */
        double want = z < 0.0 ? -log1p(-below_normal(z)) : -log(below_normal(-z));
        bst_assert_close(x / want, 1.0, 1e-10); /* bisection to 80 binary digits, sums of doubles */
    }
    for (int n = 2; n <= 60; n += 7) {
        for (double z = -2.0; z <= 7.0; z += 0.5) {
            double p = gamma_above(n, bst_multiplication_quantile(n, z));
            bst_assert_close(p / below_normal(-z), 1.0, 1e-9);
        }
    }
}

/* What the kernel draws of n electrons with normal deviate z. */
static double drawn(const float *table, int n, double z) {
    double at = (z / (double)BST_MULTIPLY_REACH + 1.0) * 0.5 * BST_MULTIPLY_STEPS;
    int step = (int)at, row = n < BST_MULTIPLY_FEW ? n - 1 : BST_MULTIPLY_FEW - 1;
    const float *t = table + row * (BST_MULTIPLY_STEPS + 1) + step;
    double lacks = (double)t[0] + (at - step) * (double)(t[1] - t[0]);
    return fmax(bst_multiplication_expansion(n, z) + lacks, 0.0);
}

/* Normal deviate of which n electrons give x: the draws grow with the deviate. */
static double deviate_of(const float *table, int n, double x) {
    double low = -6.99, high = 6.99;
    for (int i = 0; i < 50; i++) {
        double mid = 0.5 * (low + high);
        *(drawn(table, n, mid) < x ? &low : &high) = mid;
    }
    return 0.5 * (low + high);
}

/* Chi-square divergence of what is drawn from the gamma distribution, in classes of a quarter of an
 * electron: below 2e-9, so that it takes more than 5e8 draws of one number of electrons to tell
 * them apart. */
static void draws_have_the_law_of_the_register(void **state) {
    (void)state;
    static float table[BST_MULTIPLICATION_FLOATS];
    bst_multiplication_table(table);
    const int shapes[] = {1, 2, 3, 4, 5, 7, 9, 12, 15, 16, 17, 20, 30, 60, 200};
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        int n = shapes[i];
        double divergence = 0.0, before = 1.0, drawn_before = 1.0, reach = n + 6.0 * sqrt(n) + 8.0;
        for (double x = 0.25; x < reach; x += 0.25) {
            double above = gamma_above(n, x), got = below_normal(-deviate_of(table, n, x));
            double p = before - above, q = drawn_before - got;
            if (p > 1e-8) {
                divergence += (q - p) * (q - p) / p;
            }
            before = above;
            drawn_before = got;
        }
        if (!(divergence < 2e-9)) {
            print_error("%d electrons: divergence %g\n", n, divergence);
        }
        assert_true(divergence < 2e-9);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quantiles_are_those_of_the_gamma_distribution),
        cmocka_unit_test(draws_have_the_law_of_the_register),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
