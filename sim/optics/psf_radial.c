#include <math.h>
#include <stdlib.h>

#include "sim/optics/psf_internal.h"

bst_status bst_optics_radial_create(bst_ctx *ctx, double limit, bst_optics_radial_otf *out) {
    out->limit = limit;
    out->value = calloc(BST_RADIAL_NODES, sizeof *out->value);
    return out->value ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF's table");
}

double bst_optics_radial_frequency(double limit, int i) {
    double t = (double)i / (BST_RADIAL_NODES - 1);
    return limit * t * t;
}

double bst_optics_radial_at(const bst_optics_radial_otf *table, double f) {
    if (!(f < table->limit)) {
        return 0.0;
    }
    double u = sqrt(f / table->limit) * (BST_RADIAL_NODES - 1);
    int i = (int)u;
    i = i < 1 ? 1 : i > BST_RADIAL_NODES - 3 ? BST_RADIAL_NODES - 3 : i;
    const double *v = table->value + i;
    double t = u - i, p = t + 1.0, m = t - 1.0, n = t - 2.0;
    return -t * m * n / 6.0 * v[-1] + 0.5 * p * m * n * v[0] - 0.5 * p * t * n * v[1] +
           p * t * m / 6.0 * v[2];
}

/* The transform of (1 + r^2 / a^2)^-b is 2 (x / 2)^v K_v(x) / Gamma(v), x = 2 pi a f, v = b - 1
 * (Abramowitz and Stegun 11.4.44), with K_v(x) = integral exp(-x cosh t) cosh(v t) dt from 0 to
 * infinity (9.6.24): the trapezoid rule converges geometrically. */
double bst_optics_moffat_otf(double alpha_px, double beta, double f) {
    const double step = 0.05;
    double x = 2.0 * BST_PI * alpha_px * f, v = beta - 1.0;
    if (!(x > 1e-12)) {
        return 1.0;
    }
    double scale = v * log(0.5 * x) - lgamma(v), sum = 0.5 * exp(scale - x), peak = asinh(v / x);
    for (double t = step;; t += step) {
        double e = scale - x * cosh(t);
        double term = 0.5 * (exp(e + v * t) + exp(e - v * t));
        sum += term;
        if (t > peak && term < 1e-18 * sum) {
            break;
        }
        if (t > peak + 60.0) {
            break;
        }
    }
    return 2.0 * step * sum;
}

/* Area of a segment of the unit circle of half-angle A: A - sin A cos A, by tan^2(A / 2) = y2 / x2,
 * from which sine and cosine are rational in x and y. */
static double segment(double y2, double x2) {
    double x = sqrt(x2), y = sqrt(y2), sum = x2 + y2;
    return 2.0 * atan2(y, x) - 2.0 * x * y * (x2 - y2) / (sum * sum);
}

/* Area common to two circles of radii a >= b with centres d apart. */
static double lens(double a, double b, double d) {
    if (d >= a + b) {
        return 0.0;
    }
    if (d <= a - b) {
        return BST_PI * b * b;
    }
    /* half-angle formulas are precise near tangency: triangle of sides a, b, d with half perimeter
     * s, tan^2(A / 2) = (s - b)(s - c) / (s (s - a)) */
    double s = 0.5 * (a + b + d);
    double to_a = fmax(s - a, 0.0), to_b = fmax(s - b, 0.0), to_d = fmax(s - d, 0.0);
    double part = segment(to_a * to_d, s * to_b);
    return a * a * part + b * b * (a == b ? part : segment(to_b * to_d, s * to_a));
}

double bst_optics_annulus_otf(double inner, double s) {
    double whole = 0.25 * BST_PI * (1.0 - inner * inner);
    double area = lens(0.5, 0.5, s);
    if (inner > 0.0) {
        area += lens(0.5 * inner, 0.5 * inner, s) - 2.0 * lens(0.5, 0.5 * inner, s);
    }
    return area / whole;
}
