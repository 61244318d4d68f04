/* Polynomial of an orbit through ten knots, with an estimate of its error. Internal to sim/world.
 */
#ifndef BST_WORLD_ORBIT_EPHEMERIS_POLYNOMIAL_H
#define BST_WORLD_ORBIT_EPHEMERIS_POLYNOMIAL_H

#include <math.h>
#include <stdbool.h>

#include "sim/astro/kepler.h"
#include "sim/world/orbit/ephemeris.h"

/* Knots of the interpolating polynomial, and knots for its error estimate: one more on either
 * side. */
enum { POINTS = 10, CHECKED = BST_EPHEMERIS_KNOTS, BEFORE = CHECKED / 2 - 1 };

/* Maximum of |(u - o_0) ... (u - o_9)| / 10! between the two middle knots, in steps. Times the
 * tenth difference it is the polynomial's error. */
#define ERROR_OF_DIFFERENCE 2.4033e-4
/* Lagrange weights of the ten knots at u steps after the fifth knot, 0 <= u <= 1, and their
 * derivatives with respect to u. */
static inline void lagrange(double u, double weight[POINTS], double slope[POINTS]) {
    /* products of the factors before and after each knot, with derivatives */
    static const double divisor[POINTS] = {-362880, 40320, -10080, 4320,   -2880,
                                           2880,    -4320, 10080,  -40320, 362880};
    double left = 1.0, left_slope = 0.0, right[POINTS], right_slope[POINTS];
    right[POINTS - 1] = 1.0;
    right_slope[POINTS - 1] = 0.0;
    for (int j = POINTS - 1; j > 0; j--) {
        double x = u + (POINTS / 2 - 1) - j;
        right[j - 1] = right[j] * x;
        right_slope[j - 1] = right_slope[j] * x + right[j];
    }
    for (int j = 0; j < POINTS; j++) {
        double x = u + (POINTS / 2 - 1) - j;
        weight[j] = left * right[j] / divisor[j];
        slope[j] = (left_slope * right[j] + left * right_slope[j]) / divisor[j];
        left_slope = left_slope * x + left;
        left *= x;
    }
}

/* Tenth difference of p[0..10]. */
static inline double tenth_difference(const double *p) {
    return (p[0] + p[10]) - 10.0 * (p[1] + p[9]) + 45.0 * (p[2] + p[8]) - 120.0 * (p[3] + p[7]) +
           210.0 * (p[4] + p[6]) - 252.0 * p[5];
}

/* Checks the estimated error of the polynomial through the inner ten of twelve knots. False for
 * NAN. */
static inline bool is_accurate(double p[3][CHECKED], double limit_m) {
    double a = 0.0, b = 0.0;
    for (int i = 0; i < 3; i++) {
        double first = tenth_difference(p[i]), second = tenth_difference(p[i] + 1);
        a += first * first;
        b += second * second;
    }
    return ERROR_OF_DIFFERENCE * sqrt(a) <= limit_m && ERROR_OF_DIFFERENCE * sqrt(b) <= limit_m;
}

/* Estimated interpolation error at the perigee of a two-body orbit, relative to the semi-major
 * axis. */
static inline double perigee_error(double e, double radians_per_step) {
    /* along the axis; across it the place is odd, and its tenth difference about perigee is 0 */
    double p[POINTS + 1] = {0};
    for (int j = 0; j <= POINTS / 2; j++) {
        p[POINTS / 2 + j] = p[POINTS / 2 - j] =
            cos(bst_kepler_eccentric_anomaly(j * radians_per_step, e));
    }
    return ERROR_OF_DIFFERENCE * fabs(tenth_difference(p));
}

#endif
