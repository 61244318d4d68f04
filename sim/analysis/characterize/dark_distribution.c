#include "sim/analysis/characterize/dark_distribution.h"

#include <math.h>
#include <stddef.h>

#include "sim/analysis/characterize/simplex_search.h"

/* Nodes of the normal laws of the logarithms, as equal steps: a trapezoidal rule, which converges
 * exponentially for them. */
enum { CORE_NODES = 11, HOT_NODES = 61, MOST_TURNS = 700 };
static const double CORE_REACH = 3.5, HOT_REACH = 4.5;

/* Tolerances of the logarithms of the shares. The real tail has fewer pixels near the 99th
 * percentile and more beyond the 99.9th than a lognormal law: they set how the misfit is shared.
 * With 0.06, 0.2, 0.2, 0.4 from the 95th on, the 99th of NEOSSat's dark was 31 % too high
 * (docs/results/characterize.md). */
static const double TOLERANCES[BST_SENSOR_PERCENTILES] = {0.3,  0.15, 0.06, 0.04,
                                                          0.06, 0.14, 0.3,  0.36};
static const double MOST_MISSED = 3.0;
/* Cost of parameters without a value. */
static const double UNDEFINED = 1e12;

/* What the cost function needs. */
typedef struct fit {
    const double *percentiles;
    const bst_dark_noise *noise;
} fit;

/* Share of a normal law below z. */
static double normal_below(double z) {
    return 0.5 * erfc(-z / sqrt(2.0));
}

/* Share below a rate of pixels with `extra` on top of the core. */
static double core_below(const bst_dark_distribution *d, const bst_dark_noise *noise, double extra,
                         double rate) {
    double s2 = log1p(d->dsnu * d->dsnu), s = sqrt(s2), sum = 0.0, weights = 0.0;
    for (int i = 0; i < CORE_NODES; i++) {
        double z = CORE_REACH * (2.0 * i / (CORE_NODES - 1.0) - 1.0), w = exp(-0.5 * z * z);
        double mean = d->dark * exp(s * z - 0.5 * s2) + extra;
        double sigma = sqrt(noise->variance + mean / noise->exposure_s);
        sum += w * normal_below((rate - mean) / sigma);
        weights += w;
    }
    return sum / weights;
}

double bst_dark_distribution_below(const bst_dark_distribution *d, const bst_dark_noise *noise,
                                   double rate_e_per_s) {
    double sum = 0.0, weights = 0.0;
    for (int i = 0; i < HOT_NODES; i++) {
        double z = HOT_REACH * (2.0 * i / (HOT_NODES - 1.0) - 1.0), w = exp(-0.5 * z * z);
        double extra = d->hot_median * pow(10.0, d->hot_spread_dex * z);
        weights += w;
        if (extra < 2.0 * rate_e_per_s + 10.0 * sqrt(noise->variance)) { /* else none is below */
            sum += w * core_below(d, noise, extra, rate_e_per_s);
        }
    }
    return (1.0 - d->hot_fraction) * core_below(d, noise, 0.0, rate_e_per_s) +
           d->hot_fraction * sum / weights;
}

/* Parameters of the search: logarithms, and the logit of the share. */
static bst_dark_distribution of_parameters(const double *x) {
    return (bst_dark_distribution){.dark = exp(x[0]),
                                   .dsnu = exp(x[1]),
                                   .hot_fraction = 1.0 / (1.0 + exp(-x[2])),
                                   .hot_median = exp(x[3]),
                                   .hot_spread_dex = exp(x[4])};
}

/* Logarithm of the share beyond percentile i over the real one, in tolerances. */
static double missed_by(const fit *f, const bst_dark_distribution *d, int i) {
    double share = bst_sensor_percentiles[i] / 100.0;
    double below = bst_dark_distribution_below(d, f->noise, f->percentiles[i]);
    double ratio = share < 0.4 ? below / share : (1.0 - below) / (1.0 - share);
    return log(fmax(ratio, 1e-9)) / TOLERANCES[i];
}

/* Sum of squares of what the percentiles are missed by (callback). */
static double cost_of(const void *user, const double *x) {
    const bst_dark_distribution d = of_parameters(x);
    double sum = d.hot_spread_dex > 2.0 || d.dsnu > 3.0 ? 1e6 : 0.0;
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        double missed = missed_by(user, &d, i);
        sum += missed * missed;
    }
    return isfinite(sum) ? sum : UNDEFINED;
}

bool bst_dark_distribution_fit(const double percentiles[BST_SENSOR_PERCENTILES],
                               const bst_dark_noise *noise, const bst_dark_distribution *start,
                               bst_dark_distribution *out) {
    const fit f = {percentiles, noise};
    *out = (bst_dark_distribution){NAN, NAN, NAN, NAN, NAN};
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        if (!isfinite(percentiles[i])) {
            return false;
        }
    }
    double p16 = fmax(percentiles[1], 1e-6), p50 = fmax(percentiles[2], 1e-6), best = INFINITY;
    const bst_dark_distribution starts[2] = {{p16, 0.1, 0.8, 0.35 * p50, 0.6},
                                             {0.9 * p50, 0.2, 0.3, 0.8 * p50, 0.5}};
    const double step[5] = {0.1, 0.3, 0.5, 0.3, 0.1};
    for (int i = 0; i < (start ? 1 : 2); i++) {
        const bst_dark_distribution *s = start ? start : &starts[i];
        double x[5] = {log(s->dark), log(s->dsnu),
                       log(s->hot_fraction / fmax(1.0 - s->hot_fraction, 1e-6)), log(s->hot_median),
                       log(s->hot_spread_dex)};
        double cost =
            bst_simplex_search(cost_of, &f, 5, x, step, start ? MOST_TURNS / 3 : MOST_TURNS);
        if (cost < best) {
            best = cost;
            *out = of_parameters(x);
        }
    }
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        if (!(fabs(missed_by(&f, out, i)) < MOST_MISSED)) {
            return false;
        }
    }
    return true;
}
