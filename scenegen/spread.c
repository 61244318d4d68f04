#include "scenegen/spread.h"

#include <math.h>

#include "sim/core/vec.h"

enum { QUADRATURE = 40, TRIALS = 16 };

double bst_spread_value(const bst_spread *spread, double t) {
    double z = 2.0 * t / spread->taps, q = 1.0 - z * z;
    return q > 0.0 ? exp(spread->beta * (sqrt(q) - 1.0)) : 0.0;
}

double bst_spread_transform(const bst_spread *spread, double nu) {
    /* t = taps / 2 sin(a): the midpoint rule in a converges exponentially down to exp(-beta) */
    double half = 0.5 * spread->taps, sum = 0.0;
    for (int i = 0; i < QUADRATURE; i++) {
        double a = 0.5 * BST_PI * (i + 0.5) / QUADRATURE, c = cos(a);
        sum += exp(spread->beta * (c - 1.0)) * c * cos(2.0 * BST_PI * nu * half * sin(a));
    }
    return sum * BST_PI * half / QUADRATURE;
}

/* Error of one choice: what the neighbouring bands leak into the PSF's frequencies. */
static double leak(const bst_spread *spread, const bst_spread_band *band, double density) {
    double sum = 0.0;
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        double nu = (i + 0.5) * band->step / density;
        if (!(band->weight[i] > 0.0)) {
            continue;
        }
        if (nu >= 0.5) { /* lost */
            sum += band->weight[i];
            continue;
        }
        double own = fabs(bst_spread_transform(spread, nu)), others = 0.0;
        for (int m = 1; m <= 2; m++) {
            others += fabs(bst_spread_transform(spread, nu - m)) +
                      fabs(bst_spread_transform(spread, nu + m));
        }
        sum += band->weight[i] * fmin(others / own, 2.0);
    }
    return sum;
}

double bst_spread_choose(bst_spread *spread, const bst_spread_band *band, double density) {
    double best = INFINITY, beta = 0.0;
    for (int n = 0; n < TRIALS; n++) {
        spread->beta = spread->taps * (0.8 + 1.8 * n / (TRIALS - 1));
        double error = leak(spread, band, density);
        if (error < best) {
            best = error;
            beta = spread->beta;
        }
    }
    spread->beta = beta;
    return best;
}
