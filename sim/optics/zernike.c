#include "sim/optics/zernike.h"

#include <math.h>
#include <stdlib.h>

void bst_zernike_noll(int j, int *n, int *m) {
    int degree = 0, k = j - 1;
    while (k > degree) {
        k -= ++degree;
    }
    /* within a degree the orders increase in pairs; even j are cosines */
    int order = degree % 2 + 2 * ((k + (degree + 1) % 2) / 2);
    *n = degree;
    *m = j % 2 == 0 ? order : -order;
}

static double binomial(int n, int k) {
    double v = 1.0;
    for (int i = 1; i <= k; i++) {
        v = v * (n - k + i) / i;
    }
    return v;
}

static double factorial(int n) {
    return n < 2 ? 1.0 : n * factorial(n - 1);
}

/* Noll's equations (1) and (2) with expanded powers of r: r^m cos(m t) and r^m sin(m t) are real
 * and imaginary part of (x + i y)^m; the remaining factor is a power of x^2 + y^2. */
void bst_zernike_add(bst_zernike_polynomial *sum, int j, double amount) {
    int n, signed_m;
    bst_zernike_noll(j, &n, &signed_m);
    int m = abs(signed_m), sine = signed_m < 0;
    double scale = amount * sqrt((n + 1.0) * (m > 0 ? 2.0 : 1.0));
    for (int k = 0; k <= (n - m) / 2; k++) {
        double radial = (k % 2 ? -1.0 : 1.0) * factorial(n - k) /
                        (factorial(k) * factorial((n + m) / 2 - k) * factorial((n - m) / 2 - k));
        int power = (n - m) / 2 - k; /* exponent of x^2 + y^2 */
        for (int l = sine; l <= m; l += 2) {
            double angular = binomial(m, l) * (l / 2 % 2 ? -1.0 : 1.0);
            for (int t = 0; t <= power; t++) {
                sum->c[m - l + 2 * (power - t)][l + 2 * t] +=
                    scale * radial * angular * binomial(power, t);
            }
        }
    }
}

double bst_zernike_at(const bst_zernike_polynomial *polynomial, double x, double y) {
    double value = 0.0;
    for (int p = BST_ZERNIKE_DEGREE; p >= 0; p--) {
        double row = 0.0;
        for (int q = BST_ZERNIKE_DEGREE - p; q >= 0; q--) {
            row = row * y + polynomial->c[p][q];
        }
        value = value * x + row;
    }
    return value;
}
