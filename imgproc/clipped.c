#include "imgproc/clipped.h"

#include <math.h>

#include "sim/core/vec.h"

enum { HERMITE = 9, PASSES = 2 };

/* A share of a change of the variance comes back as a change of its correction: a tenth at 3 sigma.
 */
static const double CLOSE = 0.005;

/* An edge at z: the normal law and density there, and phi(z) He_n(z). */
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

/* Integral of He_n(z) phi(z) between the edges. */
static double integral(const edge *low, const edge *high, int n) {
    return n > 0 ? low->hermite[n - 1] - high->hermite[n - 1] : high->below - low->below;
}

/* Mean and variance between the edges, in deviations. */
static void moments(const edge *low, const edge *high, double skewness, double excess, double *mean,
                    double *variance) {
    double m[3] = {0.0};
    const struct {
        int n;
        double weight;
    } series[] = {
        {0, 1.0}, {3, skewness / 6.0}, {4, excess / 24.0}, {6, skewness * skewness / 72.0}};
    for (int i = 0; i < 4; i++) {
        /* z He_n = He_n+1 + n He_n-1, twice */
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

void bst_clipped_solve(const bst_clipped_noise *noise, double low, double high, double inner_mean,
                       double inner_variance, double *mean, double *deviation) {
    /* no distribution narrower than that is told from its steps */
    double steps = noise->step_e * noise->step_e / 12.0, least = 0.25 * steps;
    double inner = fmax(inner_variance - steps, least);
    double variance = fmax(*deviation * *deviation - steps, least);
    for (int i = 0; i < PASSES && variance > 0.0; i++) {
        double sigma = sqrt(variance), counted = fmax(variance - noise->read_variance_e2, 0.0);
        edge a = edge_at((low - *mean) / sigma), b = edge_at((high - *mean) / sigma);
        double shift, share;
        moments(&a, &b, fmin(counted / (variance * sigma), 1.0),
                fmin(counted / (variance * variance), 1.0), &shift, &share);
        if (!(share > 0.1)) { /* the edges are too near for a law: as they were found */
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
