#include "imgproc/detect/truncated_moments.h"

#include <math.h>
#include <stdbool.h>

#include "boresight/vec.h"

enum { HERMITE = 9, PASSES = 2, COUNTED_PASSES = 4, MOST_ELECTRONS = 80, MOST_STEPS = 100 };

static const double LEAST_COUNTED = 1e-3;

/* Convergence limit: relative change of the variance. At 3 sigma a tenth of a change returns
 * through the correction. */
static const double CLOSE = 0.005;

/* A clip edge at z: normal distribution and density there, and phi(z) He_n(z). */
typedef struct edge {
    double below;
    double hermite[HERMITE];
} edge;

static edge edge_at(double z) {
    edge out = {.below = 0.5 * erfc(-z / sqrt(2.0))};
    out.hermite[0] = exp(-0.5 * z * z) / sqrt(2.0 * BST_PI);
    out.hermite[1] = z * out.hermite[0];
    for (int n = 1; n + 1 < HERMITE; n++) {
        out.hermite[n + 1] = z * out.hermite[n] - n * out.hermite[n - 1];
    }
    return out;
}

/* Integral of He_n(z) phi(z) between the clip edges. */
static double integral(const edge *low, const edge *high, int n) {
    return n > 0 ? low->hermite[n - 1] - high->hermite[n - 1] : high->below - low->below;
}

/* Mean and variance, in sigma, of the Edgeworth distribution between the clip edges. */
static void truncated_edgeworth_moments(const edge *low, const edge *high, double skewness,
                                        double excess, double *mean, double *variance) {
    double m[3] = {0.0};
    const struct {
        int n;
        double weight;
    } series[] = {
        {0, 1.0}, {3, skewness / 6.0}, {4, excess / 24.0}, {6, skewness * skewness / 72.0}};
    for (int i = 0; i < 4; i++) {
        /* z He_n = He_n+1 + n He_n-1, applied twice */
        int n = series[i].n;
        double here = integral(low, high, n);
        double first = integral(low, high, n + 1), second = integral(low, high, n + 2);
        if (n > 0) {
            first += n * integral(low, high, n - 1);
            second += n * (n - 1) * (n > 1 ? integral(low, high, n - 2) : 0.0);
        }
        m[0] += series[i].weight * here;
        m[1] += series[i].weight * first;
        m[2] += series[i].weight * (second + (2 * n + 1) * here);
    }
    *mean = m[1] / m[0];
    *variance = m[2] / m[0] - *mean * *mean;
}

/* Below both limits single electrons are resolved, and the noise is not near-normal. */
static const double FEW_ELECTRONS = 12.0, NARROW_VARIANCE_E2 = 0.8;

/* Moments of the digitised values between the clip edges, and of all values. */
typedef struct counted_moments {
    double inner_mean, inner_variance, mean, variance;
} counted_moments;

/* Adds one digital value's probability to the sums for mean and variance about `about`. */
static void add_value(double probability, double value, double about, double sum[3]) {
    double d = value - about;
    sum[0] += probability;
    sum[1] += probability * d;
    sum[2] += probability * d * d;
}

/* Probability of a value below `upto`, e-: Poisson electrons of mean `counted` plus read noise
 * read_e plus `shift`. */
static double poisson_normal_cdf(double upto, double counted, double shift, double read_e) {
    double sum = 0.0, share = exp(-counted);
    for (int n = 0; n < MOST_ELECTRONS; n++) {
        double z = (upto - shift - n) / read_e;
        if (z < -6.0) {
            break;
        }
        sum += share * (z > 6.0 ? 1.0 : 0.5 * erfc(-z / sqrt(2.0)));
        share *= counted / (n + 1);
    }
    return sum;
}

/* Moments of Poisson electrons plus read noise, digitised in steps of step_e; the clip edges `low`
 * and `high` lie on steps. */
static void count_moments(double counted, double shift, double read_e, double step_e, double low,
                          double high, counted_moments *out) {
    double reach = 6.0 * sqrt(counted + read_e * read_e) + 3.0, about = counted + shift;
    double inner[3] = {0.0}, all[3] = {0.0};
    int first = (int)floor((about - reach - low) / step_e);
    int end = (int)ceil((about + 1.5 * reach - low) / step_e);
    int inside = (int)lround((high - low) / step_e);
    double before = poisson_normal_cdf(low + first * step_e, counted, shift, read_e);
    for (int k = first; k < end; k++) {
        double after = poisson_normal_cdf(low + (k + 1) * step_e, counted, shift, read_e);
        double value = low + (k + 0.5) * step_e;
        add_value(after - before, value, about, all);
        if (k >= 0 && k < inside) {
            add_value(after - before, value, about, inner);
        }
        before = after;
    }
    out->inner_mean = about + inner[1] / inner[0];
    out->inner_variance = inner[2] / inner[0] - pow(inner[1] / inner[0], 2.0);
    out->mean = about + all[1] / all[0];
    out->variance = all[2] / all[0] - pow(all[1] / all[0], 2.0);
}

/* Solves for mean and deviation at few electrons, where the Edgeworth series fails: the
 * Poisson-normal distribution itself is digitised and clipped. */
static bool solve_poisson(const bst_truncated_moments_noise *noise, double low, double high,
                          double inner_mean, double inner_variance, double *mean,
                          double *deviation) {
    double read_e = sqrt(noise->read_variance_e2), step = noise->step_e;
    double counted = *deviation * *deviation - noise->read_variance_e2 - step * step / 12.0;
    double shift = *mean - counted;
    if (!(noise->read_variance_e2 < NARROW_VARIANCE_E2) || !(read_e > 0.0) ||
        !(counted < FEW_ELECTRONS) || !(step > 0.0) || (high - low) / step > MOST_STEPS) {
        return false;
    }
    counted_moments m;
    counted = fmax(counted, LEAST_COUNTED);
    for (int i = 0; i < COUNTED_PASSES; i++) {
        count_moments(counted, shift, read_e, step, low, high, &m);
        if (!(m.inner_variance > 0.05 * m.variance)) {
            return false;
        }
        double wanted = m.variance * inner_variance / m.inner_variance;
        double before = counted;
        shift += inner_mean - m.inner_mean;
        counted = fmax(counted + wanted - m.variance, LEAST_COUNTED);
        shift -= counted - before;
        if (!(counted < 2.0 * FEW_ELECTRONS)) {
            return false;
        }
    }
    count_moments(counted, shift, read_e, step, low, high, &m);
    *mean = m.mean;
    *deviation = sqrt(m.variance);
    return true;
}

void bst_truncated_moments_solve(const bst_truncated_moments_noise *noise, double low, double high,
                                 double inner_mean, double inner_variance, double *mean,
                                 double *deviation) {
    if (solve_poisson(noise, low, high, inner_mean, inner_variance, mean, deviation)) {
        return;
    }
    /* quantisation limits the resolvable width */
    double steps = noise->step_e * noise->step_e / 12.0, least = 0.25 * steps;
    double inner = fmax(inner_variance - steps, least);
    double variance = fmax(*deviation * *deviation - steps, least);
    for (int i = 0; i < PASSES && variance > 0.0; i++) {
        double sigma = sqrt(variance), counted = fmax(variance - noise->read_variance_e2, 0.0);
        edge a = edge_at((low - *mean) / sigma), b = edge_at((high - *mean) / sigma);
        double shift, share;
        truncated_edgeworth_moments(&a, &b, fmin(counted / (variance * sigma), 1.0),
                                    fmin(counted / (variance * variance), 1.0), &shift, &share);
        if (!(share > 0.1)) { /* edges too close for a correction: keep the input values */
            return;
        }
        *mean = inner_mean - shift * sigma;
        variance = inner / share;
        if (fabs(variance - sigma * sigma) < CLOSE * variance) {
            break;
        }
    }
    *deviation = sqrt(variance + fmin(steps, inner_variance));
}
