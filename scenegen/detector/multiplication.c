#include "scenegen/detector/multiplication.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

double bst_multiplication_expansion(double n, double z) {
    double a = 1.0 / sqrt(n), q = z * z;
    double c1 = z * (q - 7.0) / 36.0, c2 = (16.0 - q * (7.0 + 3.0 * q)) / 810.0;
    double c3 = z * (q * (256.0 + 9.0 * q) - 433.0) / 38880.0;
    return n + z / a + (q - 1.0) / 3.0 + a * (c1 + a * (c2 + a * c3));
}

/* Probability that a gamma deviate of shape n is below x (lower) or above: closed form for whole n,
 * the lower one as the series of the terms that the upper one lacks. */
static double gamma_probability(int n, double x, int lower) {
    double term = exp(-x), sum = 0.0;
    if (!lower) {
        for (int k = 0; k < n; k++) {
            sum += term;
            term *= x / (k + 1);
        }
        return sum;
    }
    for (int k = 0; k < n; k++) {
        term *= x / (k + 1);
    }
    for (int k = n; term > 1e-18 * sum; k++) {
        sum += term;
        term *= x / (k + 1);
    }
    return sum;
}

double bst_multiplication_quantile(int n, double z) {
    assert(n >= 1 && n <= 1000 && fabs(z) <= 8.0);
    int lower = z < 0.0;
    double want = log(0.5 * erfc(fabs(z) / sqrt(2.0)));        /* of the smaller tail */
    double low = -80.0, high = log(n + 20.0 * sqrt(n) + 60.0); /* logarithms of the quantile */
    for (int i = 0; i < 80; i++) {
        double mid = 0.5 * (low + high);
        double found = log(gamma_probability(n, exp(mid), lower));
        if (lower ? found < want : found > want) {
            low = mid;
        } else {
            high = mid;
        }
    }
    return exp(0.5 * (low + high));
}

void bst_multiplication_table(float table[BST_MULTIPLICATION_FLOATS]) {
    const double step = 2.0 * (double)BST_MULTIPLY_REACH / BST_MULTIPLY_STEPS;
    for (int n = 1; n <= BST_MULTIPLY_FEW; n++) {
        for (int k = 0; k <= BST_MULTIPLY_STEPS; k++) {
            double z = k * step - (double)BST_MULTIPLY_REACH;
            table[(size_t)(n - 1) * (BST_MULTIPLY_STEPS + 1) + (size_t)k] =
                n < BST_MULTIPLY_FEW ? (float)(bst_multiplication_quantile(n, z) -
                                               bst_multiplication_expansion(n, z))
                                     : 0.0f;
        }
    }
}
