#include "tracker/filter.h"

#include <string.h>

/* Components of state b's mean in the tangent axes at a: direction, then rate. */
static void difference(const bst_sky_state *a, const bst_sky_state *b, double out[4]) {
    bst_tangent axes = bst_tangent_at(a->direction);
    bst_vec3 step = bst_tangent_log(a->direction, b->direction);
    bst_vec3 rate =
        bst_vec3_sub(bst_tangent_carry(b->direction, a->direction, b->rate_radps), a->rate_radps);
    out[0] = bst_vec3_dot(step, axes.e1);
    out[1] = bst_vec3_dot(step, axes.e2);
    out[2] = bst_vec3_dot(rate, axes.e1);
    out[3] = bst_vec3_dot(rate, axes.e2);
}

static void shift_by(bst_sky_state *state, const double x[4]) {
    bst_tangent axes = bst_tangent_at(state->direction);
    bst_sky_shift(state, bst_tangent_vector(&axes, x[0], x[1]),
                  bst_tangent_vector(&axes, x[2], x[3]));
}

void bst_sky_mix(const bst_sky_state *states, const double *weights, int count,
                 bst_sky_state *out) {
    int heaviest = 0;
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        sum += weights[i];
        heaviest = weights[i] > weights[heaviest] ? i : heaviest;
    }
    bst_sky_state base = states[heaviest];
    double mean[4] = {0}, p[4][4] = {{0}};
    for (int i = 0; i < count; i++) {
        double w = weights[i] / sum;
        if (!(w > 0.0)) {
            continue;
        }
        double x[4], own[4][4];
        difference(&base, &states[i], x);
        bst_sky_turn_covariance(&states[i], base.direction, own);
        for (int a = 0; a < 4; a++) {
            mean[a] += w * x[a];
            for (int b = 0; b < 4; b++) {
                p[a][b] += w * (own[a][b] + x[a] * x[b]);
            }
        }
    }
    for (int a = 0; a < 4; a++) {
        for (int b = 0; b < 4; b++) {
            base.covariance[a][b] = p[a][b] - mean[a] * mean[b];
        }
    }
    shift_by(&base, mean);
    *out = base;
}

/* Lower Cholesky factor; columns without variance of their own are zero. */
static void factor(const double p[4][4], double l[4][4]) {
    memset(l, 0, 16 * sizeof(double));
    for (int j = 0; j < 4; j++) {
        double v = p[j][j];
        for (int k = 0; k < j; k++) {
            v -= l[j][k] * l[j][k];
        }
        if (!(v > 1e-14 * p[j][j])) {
            continue;
        }
        l[j][j] = sqrt(v);
        for (int i = j + 1; i < 4; i++) {
            double u = p[i][j];
            for (int k = 0; k < j; k++) {
                u -= l[i][k] * l[j][k];
            }
            l[i][j] = u / l[j][j];
        }
    }
}

void bst_sky_predict_unscented(bst_sky_state *state, double dt_s, double noise_rad2ps3) {
    double l[4][4], weights[8];
    bst_sky_state points[8], start = *state;
    factor(state->covariance, l);
    memset(start.covariance, 0, sizeof start.covariance);
    for (int k = 0; k < 8; k++) {
        double x[4], sign = k < 4 ? 2.0 : -2.0; /* sqrt(n + kappa), n = 4 */
        for (int i = 0; i < 4; i++) {
            x[i] = sign * l[i][k % 4];
        }
        points[k] = start;
        shift_by(&points[k], x);
        bst_sky_predict(&points[k], dt_s, 0.0);
        weights[k] = 0.125;
    }
    bst_sky_state moved;
    bst_sky_mix(points, weights, 8, &moved);
    double dt = fabs(dt_s);
    double(*p)[4] = moved.covariance;
    for (int i = 0; i < 2; i++) {
        p[i][i] += noise_rad2ps3 * dt * dt * dt / 3.0;
        p[i][i + 2] += noise_rad2ps3 * dt * dt_s / 2.0;
        p[i + 2][i] = p[i][i + 2];
        p[i + 2][i + 2] += noise_rad2ps3 * dt;
    }
    *state = moved;
}

void bst_filter_start(const bst_filter_params *params, const bst_sky_state *state,
                      bst_filter_models *models) {
    models->count = 0;
    if (params->kind != BST_FILTER_IMM) {
        return;
    }
    models->count = BST_FILTER_MODELS;
    for (int m = 0; m < BST_FILTER_MODELS; m++) {
        models->state[m] = *state;
    }
    models->probability[1] = params->manoeuvre_s / (params->quiet_s + params->manoeuvre_s);
    models->probability[0] = 1.0 - models->probability[1];
}

static void combine(const bst_filter_models *models, bst_sky_state *state) {
    bst_sky_mix(models->state, models->probability, models->count, state);
}

static void mix_models(const bst_filter_params *params, double dt_s, bst_filter_models *models) {
    double start = 1.0 / params->quiet_s, end = 1.0 / params->manoeuvre_s, both = start + end;
    double settled = -expm1(-both * dt_s) / both;
    double change[2] = {start * settled, end * settled}; /* away from model 0, from model 1 */
    bst_filter_models before = *models;
    for (int to = 0; to < BST_FILTER_MODELS; to++) {
        double weights[BST_FILTER_MODELS];
        for (int from = 0; from < BST_FILTER_MODELS; from++) {
            weights[from] =
                before.probability[from] * (from == to ? 1.0 - change[from] : change[from]);
        }
        models->probability[to] = weights[0] + weights[1];
        if (models->probability[to] > 0.0) {
            bst_sky_mix(before.state, weights, BST_FILTER_MODELS, &models->state[to]);
        }
    }
}

void bst_filter_predict(const bst_filter_params *params, double dt_s, bst_sky_state *state,
                        bst_filter_models *models) {
    if (models->count == 0) {
        if (params->kind == BST_FILTER_UKF) {
            bst_sky_predict_unscented(state, dt_s, params->noise_rad2ps3);
        } else {
            bst_sky_predict(state, dt_s, params->noise_rad2ps3);
        }
        return;
    }
    mix_models(params, dt_s, models);
    bst_sky_predict(&models->state[0], dt_s, params->noise_rad2ps3);
    bst_sky_predict(&models->state[1], dt_s, params->manoeuvre_noise_rad2ps3);
    combine(models, state);
}

void bst_filter_shift(bst_sky_state *state, bst_filter_models *models, bst_vec3 direction_rad,
                      bst_vec3 rate_radps) {
    bst_vec3 at = state->direction;
    for (int m = 0; m < models->count; m++) {
        bst_vec3 own = models->state[m].direction;
        bst_sky_shift(&models->state[m], bst_tangent_carry(at, own, direction_rad),
                      bst_tangent_carry(at, own, rate_radps));
    }
    bst_sky_shift(state, direction_rad, rate_radps);
}

static double log_density(const bst_sky_innovation *innovation) {
    return -0.5 * innovation->chi2 - 0.5 * innovation->log_det_s - log(2.0 * BST_PI);
}

bool bst_filter_evaluate(const bst_sky_state *state, const bst_filter_models *models,
                         const bst_filter_candidate *candidate, bst_filter_fit *out) {
    const bst_sky_state *first = models->count ? &models->state[0] : state;
    if (!bst_sky_innovate(first, candidate->measurement, candidate->extra, &out->innovation)) {
        return false;
    }
    out->chi2 = out->innovation.chi2;
    out->log_likelihood = log_density(&out->innovation);
    if (models->count == 0) {
        return true;
    }
    bst_sky_innovation other;
    if (!bst_sky_innovate(&models->state[1], candidate->measurement, candidate->extra, &other)) {
        return false;
    }
    double a = log(models->probability[0]) + out->log_likelihood;
    double b = log(models->probability[1]) + log_density(&other);
    double high = fmax(a, b);
    out->chi2 = fmin(out->chi2, other.chi2);
    out->log_likelihood = high > -INFINITY ? high + log(exp(a - high) + exp(b - high)) : high;
    return true;
}

/* Updates one Gaussian; returns ln of the hypotheses' total weight. */
static double update_one(bst_sky_state *state, const bst_filter_candidate *candidates, int count,
                         double miss_weight, double hit_weight) {
    bst_sky_state hypotheses[BST_FILTER_CANDIDATES + 1];
    double logs[BST_FILTER_CANDIDATES + 1], weights[BST_FILTER_CANDIDATES + 1];
    int n = 0;
    if (miss_weight > 0.0) {
        hypotheses[n] = *state;
        logs[n++] = log(miss_weight);
    }
    for (int i = 0; i < count && i < BST_FILTER_CANDIDATES; i++) {
        bst_sky_innovation innovation;
        if (bst_sky_innovate(state, candidates[i].measurement, candidates[i].extra, &innovation)) {
            hypotheses[n] = *state;
            bst_sky_update(&hypotheses[n], &innovation);
            logs[n++] = log(hit_weight) + log_density(&innovation);
        }
    }
    if (n == 0) {
        return 0.0;
    }
    double high = logs[0], sum = 0.0;
    for (int i = 1; i < n; i++) {
        high = fmax(high, logs[i]);
    }
    for (int i = 0; i < n; i++) {
        weights[i] = exp(logs[i] - high);
        sum += weights[i];
    }
    if (n == 1) {
        *state = hypotheses[0];
    } else {
        bst_sky_mix(hypotheses, weights, n, state);
    }
    return high + log(sum);
}

void bst_filter_update(bst_sky_state *state, bst_filter_models *models,
                       const bst_filter_candidate *candidates, int count, double miss_weight,
                       double hit_weight) {
    if (models->count == 0) {
        (void)update_one(state, candidates, count, miss_weight, hit_weight);
        return;
    }
    double logs[BST_FILTER_MODELS], high = -INFINITY, sum = 0.0;
    for (int m = 0; m < models->count; m++) {
        logs[m] = log(models->probability[m]) +
                  update_one(&models->state[m], candidates, count, miss_weight, hit_weight);
        high = fmax(high, logs[m]);
    }
    for (int m = 0; m < models->count; m++) {
        models->probability[m] = exp(logs[m] - high);
        sum += models->probability[m];
    }
    for (int m = 0; m < models->count; m++) {
        models->probability[m] /= sum;
    }
    combine(models, state);
}
