#include "sim/eval/consistency.h"

#include <math.h>
#include <string.h>

/* Incomplete gamma function P(a, x) by its series, for x < a + 1. */
static double gamma_series(double a, double x) {
    double term = 1.0 / a, sum = term;
    for (double n = a + 1.0; fabs(term) > 1e-17 * sum; n += 1.0) {
        term *= x / n;
        sum += term;
    }
    return sum * exp(-x + a * log(x) - lgamma(a));
}

/* Q(a, x) = 1 - P(a, x) by its continued fraction (Lentz), for x >= a + 1. */
static double gamma_fraction(double a, double x) {
    double b = x + 1.0 - a, c = 1e300, d = 1.0 / b, h = d;
    for (int i = 1; i < 100000; i++) {
        double an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (fabs(d * c - 1.0) < 1e-16) {
            break;
        }
    }
    return h * exp(-x + a * log(x) - lgamma(a));
}

double bst_eval_chi2_cdf(double x, double dof) {
    if (!(x > 0.0)) {
        return isnan(x) ? NAN : 0.0;
    }
    double a = 0.5 * dof, y = 0.5 * x;
    return y < a + 1.0 ? gamma_series(a, y) : 1.0 - gamma_fraction(a, y);
}

double bst_eval_chi2_quantile(double probability, double dof) {
    if (!(probability > 0.0 && probability < 1.0 && dof > 0.0)) {
        return NAN;
    }
    double low = 0.0, high = dof + 10.0;
    while (bst_eval_chi2_cdf(high, dof) < probability) {
        high *= 2.0;
    }
    while (high - low > 1e-14 * high) {
        double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) {
            break;
        }
        if (bst_eval_chi2_cdf(middle, dof) < probability) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5 * (low + high);
}

void bst_consistency_check(const double *values, int runs, int steps, int dof, double confidence,
                           bst_consistency *out) {
    memset(out, 0, sizeof *out);
    out->runs = runs;
    out->steps = steps;
    double tail = 0.5 * (1.0 - confidence), total = 0.0, low = NAN, high = NAN;
    int count = 0, inside = 0, below = 0, bounds_for = 0;
    for (int k = 0; k < steps; k++) {
        double sum = 0.0;
        int n = 0;
        for (int r = 0; r < runs; r++) {
            double v = values[r * steps + k];
            if (!isnan(v)) {
                sum += v;
                n++;
            }
        }
        if (n == 0) {
            continue;
        }
        if (n != bounds_for) {
            low = bst_eval_chi2_quantile(tail, (double)n * dof);
            high = bst_eval_chi2_quantile(1.0 - tail, (double)n * dof);
            bounds_for = n;
        }
        total += sum;
        count += n;
        out->steps_judged++;
        inside += sum >= low && sum <= high;
        below += sum < low;
    }
    if (count == 0) {
        out->mean_over_dof = out->inside = out->below = out->above = NAN;
        return;
    }
    out->mean_over_dof = total / count / dof;
    out->inside = (double)inside / out->steps_judged;
    out->below = (double)below / out->steps_judged;
    out->above = 1.0 - out->inside - out->below;
}
