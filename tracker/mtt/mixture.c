/* Gaussian mixtures of sky states: moments and reduction. */
#include "tracker/mtt/mixture.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* Components below this share of the total weight are dropped. */
#define LEAST_WEIGHT 1e-4
/* Number of heaviest components considered for merging. */
#define MOST 40

/* A mixture component in the tangent axes of a common state. */
typedef struct component {
    double weight, log_det;
    double x[4], p[4][4];
} component;

void bst_sky_shift_by(bst_sky_state *state, const double x[4]) {
    bst_tangent axes = bst_tangent_at(state->direction);
    bst_sky_shift(state, bst_tangent_vector(&axes, x[0], x[1]),
                  bst_tangent_vector(&axes, x[2], x[3]));
}

/* Expresses a state as a component in the tangent axes of `base`. */
static void to_component(const bst_sky_state *base, const bst_sky_state *state, double weight,
                         component *out) {
    out->weight = weight;
    bst_sky_difference(base, state, out->x);
    bst_sky_turn_covariance(state, base->direction, out->p);
}

/* Accumulates first and second moments of a component. */
static void add_moments(component *sum, const component *c, double share) {
    for (int a = 0; a < 4; a++) {
        sum->x[a] += share * c->x[a];
        for (int b = 0; b < 4; b++) {
            sum->p[a][b] += share * (c->p[a][b] + c->x[a] * c->x[b]);
        }
    }
}

/* Converts accumulated moments to mean and central covariance. */
static void centre_moments(component *sum) {
    for (int a = 0; a < 4; a++) {
        for (int b = 0; b < 4; b++) {
            sum->p[a][b] -= sum->x[a] * sum->x[b];
        }
    }
}

/* Sky state of a component. */
static bst_sky_state state_of(const bst_sky_state *base, const component *c) {
    bst_sky_state out = *base;
    memcpy(out.covariance, c->p, sizeof out.covariance);
    bst_sky_shift_by(&out, c->x);
    return out;
}

void bst_sky_mix(const bst_sky_state *states, const double *weights, int count,
                 bst_sky_state *out) {
    assert(states && weights && out && count >= 1);
    int heaviest = 0;
    double total = 0.0;
    for (int i = 0; i < count; i++) {
        total += weights[i];
        heaviest = weights[i] > weights[heaviest] ? i : heaviest;
    }
    bst_sky_state base = states[heaviest];
    component sum = {.weight = total};
    for (int i = 0; i < count; i++) {
        if (weights[i] > 0.0) {
            component c;
            to_component(&base, &states[i], weights[i], &c);
            add_moments(&sum, &c, weights[i] / total);
        }
    }
    centre_moments(&sum);
    *out = state_of(&base, &sum);
}

double bst_mixture_log_det4(const double p[4][4]) {
    double a[4][4], sum = 0.0;
    memcpy(a, p, sizeof a);
    for (int k = 0; k < 4; k++) {
        if (!(a[k][k] > 0.0)) {
            return INFINITY;
        }
        sum += log(a[k][k]);
        for (int i = k + 1; i < 4; i++) {
            double f = a[i][k] / a[k][k];
            for (int j = k; j < 4; j++) {
                a[i][j] -= f * a[k][j];
            }
        }
    }
    return sum;
}

/* Moment-preserving merge of two components. */
static component merge_components(const component *a, const component *b) {
    component sum = {.weight = a->weight + b->weight};
    add_moments(&sum, a, a->weight / sum.weight);
    add_moments(&sum, b, b->weight / sum.weight);
    centre_moments(&sum);
    sum.log_det = bst_mixture_log_det4(sum.p);
    return sum;
}

/* Bound on the increase of the Kullback-Leibler divergence by merging (Runnalls 2007, eq. 21). */
static double merge_cost(const component *a, const component *b) {
    component both = merge_components(a, b);
    return both.weight * both.log_det - a->weight * a->log_det - b->weight * b->log_det;
}

int bst_sky_reduce(bst_sky_state *states, double *weights, int count, int keep) {
    assert(states && weights && count >= 1 && keep >= 1);
    component list[MOST];
    int heaviest = 0, n = 0;
    double total = 0.0;
    for (int i = 0; i < count; i++) {
        total += weights[i];
        heaviest = weights[i] > weights[heaviest] ? i : heaviest;
    }
    bst_sky_state base = states[heaviest];
    for (int i = 0; i < count; i++) {
        if (!(weights[i] > LEAST_WEIGHT * total)) {
            continue;
        }
        int at = n;
        if (n == MOST) {
            at = 0;
            for (int k = 1; k < n; k++) {
                at = list[k].weight < list[at].weight ? k : at;
            }
            if (list[at].weight >= weights[i]) {
                continue;
            }
        } else {
            n++;
        }
        to_component(&base, &states[i], weights[i], &list[at]);
        list[at].log_det = bst_mixture_log_det4(list[at].p);
    }
    double prices[MOST][MOST];
    for (int i = 0; n > keep && i < n; i++) {
        for (int j = 0; j < i; j++) {
            prices[i][j] = merge_cost(&list[i], &list[j]);
        }
    }
    while (n > keep) {
        int a = 1, b = 0;
        for (int i = 1; i < n; i++) {
            for (int j = 0; j < i; j++) {
                if (prices[i][j] < prices[a][b]) {
                    a = i;
                    b = j;
                }
            }
        }
        list[b] = merge_components(&list[a], &list[b]);
        n--;
        if (a < n) {
            list[a] = list[n];
            for (int j = 0; j < n; j++) {
                if (j != a) {
                    prices[a > j ? a : j][a > j ? j : a] = prices[n][j];
                }
            }
        }
        for (int j = 0; j < n; j++) {
            if (j != b) {
                prices[b > j ? b : j][b > j ? j : b] = merge_cost(&list[b], &list[j]);
            }
        }
    }
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        sum += list[i].weight;
    }
    for (int i = 0; i < n; i++) {
        states[i] = state_of(&base, &list[i]);
        weights[i] = list[i].weight / sum;
    }
    return n;
}
