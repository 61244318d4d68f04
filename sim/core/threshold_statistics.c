#include "sim/core/threshold_statistics.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

double bst_threshold_maxima(double u, double density) {
    assert(density >= 0.0);
    return density * u * exp(-0.5 * u * u) / (2.0 * BST_PI * sqrt(2.0 * BST_PI));
}

static double upper_tail(double u) {
    return 0.5 * erfc(u / sqrt(2.0));
}

/* Integral over the density of X beyond u, by the midpoint rule in an exponential variable. */
double bst_threshold_exceeds_too(double u, double v, double rho) {
    if (rho >= 1.0 - 1e-12) {
        return upper_tail(fmax(u, v)) / upper_tail(u);
    }
    enum { NODES = 48 };
    double root = sqrt(1.0 - rho * rho), sum = 0.0, total = 0.0, scale = 1.0 / (u + 1.0);
    for (int i = 0; i < NODES; i++) {
        double e = (i + 0.5) / NODES, z = u - scale * log(e);
        double density = exp(-0.5 * (z * z - u * u)) / e; /* phi(z) dz/de, up to a factor */
        sum += density * upper_tail((v - rho * z) / root);
        total += density;
    }
    return sum / total;
}

/* Cumulant generating function with two derivatives; variance 1. */
static void generate(const double *cumulant, double t, double out[3]) {
    double term = t; /* t^(n-1) / (n-1)! */
    out[0] = 0.5 * t * t;
    out[1] = t;
    out[2] = 1.0;
    for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
        int n = i + 3;
        double before = term;
        term *= t / (n - 1);
        out[2] += cumulant[i] * before;
        out[1] += cumulant[i] * term;
        out[0] += cumulant[i] * term * t / n;
    }
}

double bst_threshold_quantile(double u, const bst_threshold_weights *weights,
                              const bst_threshold_noise *noise) {
    enum { PASSES = 5 };
    double cumulant[BST_THRESHOLD_POWERS], step = noise->step_e / noise->noise_e, k[3];
    double scale = noise->counted_e2 / (noise->noise_e * noise->noise_e);
    for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
        scale /= noise->noise_e;
        cumulant[i] = scale * weights->power[i];
    }
    /* cumulants of uniform quantisation: B_n / n step^n with Bernoulli numbers */
    double square = step * step;
    cumulant[1] -= square * square / 120.0 * weights->power[1];
    cumulant[3] += square * square * square / 252.0 * weights->power[3];
    double t = u;
    for (int i = 0; i < PASSES; i++) {
        generate(cumulant, t, k);
        double w = sqrt(2.0 * (t * k[1] - k[0]));
        t -= (w + log(t * sqrt(k[2]) / w) / w - u) * w / (t * k[2]);
        t = t < 0.2 * u ? 0.2 * u : t;
    }
    generate(cumulant, t, k);
    return k[1];
}
