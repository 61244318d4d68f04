#include "sim/eval/detection_theory.h"

#include <math.h>
#include <stdbool.h>

#include "boresight/vec.h"

/* Density of the standard normal distribution. */
static double density(double x) {
    return exp(-0.5 * x * x) / sqrt(2.0 * BST_PI);
}

double bst_eval_normal_tail(double x) {
    /* the rounding error of x / sqrt 2 is amplified by x in erfc; a first-order term corrects it */
    const double root_half = 0.70710678118654752440;
    double t = x * root_half;
    if (fabs(t) < 1e-3 || fabs(t) > 30.0) {
        return 0.5 * erfc(t);
    }
    double square = 0.5 * x * x,
           lost = fma(0.5 * x, x, -square); /* x^2 / 2 = square + lost (rounding error) */
    double own = t * t, own_lost = fma(t, t, -own);
    double off = ((square - own) + (lost - own_lost)) / (2.0 * t);
    return 0.5 * erfc(t) - exp(-own) / sqrt(BST_PI) * off;
}

/* log Q(x) for x >= 20 and the slope of -log Q. */
static double log_tail(double x, double *slope) {
    double term = 1.0, sum = 0.0, inverse = 1.0 / (x * x);
    for (int n = 1; n <= 10; n++) {
        term *= -(2.0 * n - 1.0) * inverse;
        sum += term;
    }
    *slope = x / (1.0 + sum);
    return -0.5 * x * x - log(x * sqrt(2.0 * BST_PI)) + log1p(sum);
}

/* tail <= 1/4 */
static double far_inverse(double tail) {
    /* Abramowitz and Stegun 26.2.23 */
    double t = sqrt(-2.0 * log(tail));
    double x = t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                       (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
    for (int i = 0; i < 3; i++) {
        if (x > 20.0) {
            double slope, miss = log_tail(x, &slope) - log(tail);
            x += miss / slope;
        } else {
            double miss = (bst_eval_normal_tail(x) - tail) / density(x);
            x += miss / (1.0 + 0.5 * x * miss); /* Halley */
        }
    }
    return x;
}

double bst_eval_normal_tail_inverse(double tail) {
    if (!(tail >= 0.0 && tail <= 1.0)) {
        return NAN;
    }
    if (tail == 0.0 || tail == 1.0) {
        return tail == 0.0 ? INFINITY : -INFINITY;
    }
    if (tail <= 0.25) {
        return far_inverse(tail);
    }
    if (tail >= 0.75) {
        return -far_inverse(1.0 - tail);
    }
    /* erf keeps its relative accuracy near 0, where Q is nearly 1/2 */
    double want = 0.5 - tail, x = want * sqrt(2.0 * BST_PI);
    for (int i = 0; i < 4; i++) {
        double miss = (want - 0.5 * erf(x * 0.70710678118654752440)) / density(x);
        x += miss / (1.0 - 0.5 * x * miss);
    }
    return x;
}

double bst_eval_ideal_pd(double pfa, double snr) {
    return bst_eval_normal_tail(bst_eval_normal_tail_inverse(pfa) - snr);
}

double bst_eval_ideal_snr(double pfa, double pd) {
    return bst_eval_normal_tail_inverse(pfa) - bst_eval_normal_tail_inverse(pd);
}

double bst_eval_matched_filter_pd(double pfa, double snr, double own_light) {
    return bst_eval_normal_tail((bst_eval_normal_tail_inverse(pfa) - snr) /
                                sqrt(1.0 + own_light * snr));
}

double bst_eval_matched_filter_snr(double pfa, double pd, double own_light) {
    /* root of (snr - t)^2 = z^2 (1 + own_light snr) with the sign of z */
    double t = bst_eval_normal_tail_inverse(pfa), z = -bst_eval_normal_tail_inverse(pd);
    double half = 0.5 * own_light * z;
    return t + z * (half + sqrt(half * half + 1.0 + own_light * t));
}

bst_eval_interval bst_eval_wilson_interval(int64_t hits, int64_t trials, double z) {
    if (trials <= 0) {
        return (bst_eval_interval){0.0, 1.0};
    }
    double n = (double)trials, p = (double)hits / n, z2 = z * z / n;
    double middle = (p + 0.5 * z2) / (1.0 + z2);
    double half = z / (1.0 + z2) * sqrt(p * (1.0 - p) / n + 0.25 * z2 / n);
    return (bst_eval_interval){hits <= 0 ? 0.0 : middle - half,
                               hits >= trials ? 1.0 : middle + half};
}

/* Regularised incomplete gamma functions P(a, x) and Q(a, x) = 1 - P. The smaller one has full
 * relative accuracy: series and continued fraction (Abramowitz and Stegun 6.5.29, 6.5.31, the
 * latter by Lentz's method). */
static void gamma_parts(double a, double x, double *lower, double *upper) {
    double front = exp(a * log(x) - x - lgamma(a));
    enum { ROUNDS = 100000 };
    if (x < a + 1.0) {
        double term = 1.0 / a, sum = term;
        for (int n = 1; n < ROUNDS && term > 1e-17 * sum; n++) {
            term *= x / (a + n);
            sum += term;
        }
        *lower = front * sum;
        *upper = 1.0 - *lower;
        return;
    }
    double b = x + 1.0 - a, c = 1e300, d = 1.0 / b, h = d;
    for (int n = 1; n < ROUNDS; n++) {
        double an = -n * (n - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (fabs(c * d - 1.0) < 1e-16) {
            break;
        }
    }
    *upper = front * h;
    *lower = 1.0 - *upper;
}

/* Quantile x of the gamma distribution, lower or upper tail p < 1/2: Newton's method, bisection
 * outside the bracket. */
static double gamma_quantile(double a, double p, bool upper_tail) {
    double z = bst_eval_normal_tail_inverse(p) * (upper_tail ? 1.0 : -1.0);
    double wilson_hilferty = 1.0 - 1.0 / (9.0 * a) + z / (3.0 * sqrt(a));
    double guess = a * pow(fmax(wilson_hilferty, 1e-3), 3.0);
    double lo = 0.0, hi = guess + 10.0 * sqrt(a) + 10.0 - log(p);
    double x = guess;
    for (int i = 0; i < 200 && hi - lo > 1e-15 * hi; i++) {
        double lower, upper;
        gamma_parts(a, x, &lower, &upper);
        bool left = upper_tail ? upper > p : lower < p; /* x is too small */
        *(left ? &lo : &hi) = x;
        double slope = exp((a - 1.0) * log(x) - x - lgamma(a));
        double step = upper_tail ? (upper - p) / slope : (p - lower) / slope;
        if (fabs(step) < 1e-15 * x) {
            break;
        }
        double next = x + step;
        x = next > lo && next < hi ? next : 0.5 * (lo + hi);
    }
    return x;
}

bst_eval_interval bst_eval_poisson_interval(int64_t count, double alpha) {
    double k = (double)(count > 0 ? count : 0);
    return (bst_eval_interval){k > 0.0 ? gamma_quantile(k, 0.5 * alpha, false) : 0.0,
                               gamma_quantile(k + 1.0, 0.5 * alpha, true)};
}
