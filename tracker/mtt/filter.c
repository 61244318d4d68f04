#include "tracker/mtt/filter.h"

#include <assert.h>
#include <string.h>

#include "sim/core/invariant.h"

/* Number of models of the IMM. */
#define MODELS 2
/* Most components of one level of process noise. */
#define LEVEL_COMPONENTS (BST_FILTER_COMPONENTS / BST_FILTER_LEVELS)

/* Mean time after which an object takes any level of process noise anew, s. */
static const double LEVEL_SOJOURN_S = 1000.0;
/* Time after which such changes are taken into account: few objects change twice in it. */
static const double LEVEL_SWITCH_S = 4.0;

/* Probabilities of the levels of a new track, and of one taken anew: a steady object begins to
 * manoeuvre more often than a manoeuvring one becomes steady. The first level has more because the
 * lower ones cannot be excluded soon. */
static const double LEVELS_AT_START[BST_FILTER_LEVELS] = {0.5, 0.1, 0.4},
                    LEVELS_ANEW[BST_FILTER_LEVELS] = {0.9, 0.05, 0.05};

/* Lower Cholesky factor; columns of zero variance are zero. */
static void cholesky_factor(const double p[4][4], double l[4][4]) {
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
    assert(state && isfinite(dt_s) && noise_rad2ps3 >= 0.0);
    double l[4][4], weights[8];
    bst_sky_state points[8], start = *state;
    cholesky_factor(state->covariance, l);
    memset(start.covariance, 0, sizeof start.covariance);
    for (int k = 0; k < 8; k++) {
        double x[4], sign = k < 4 ? 2.0 : -2.0; /* sigma point spread sqrt(n + kappa), n = 4 */
        for (int i = 0; i < 4; i++) {
            x[i] = sign * l[i][k % 4];
        }
        points[k] = start;
        bst_sky_shift_by(&points[k], x);
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
    assert(params && models && state && bst_is_covariance(&state->covariance[0][0], 4));
    models->count = models->levels = 0;
    models->unswitched_s = 0.0;
    if (params->kind != BST_FILTER_IMM) {
        return;
    }
    models->count = MODELS;
    for (int m = 0; m < MODELS; m++) {
        models->state[m] = *state;
    }
    models->probability[1] =
        params->manoeuvre_sojourn_s / (params->quiescent_sojourn_s + params->manoeuvre_sojourn_s);
    models->probability[0] = 1.0 - models->probability[1];
}

/* Sets a state to the moments of its mixture. */
static void merge_models(const bst_filter_models *models, bst_sky_state *state) {
    bst_sky_mix(models->state, models->probability, models->count, state);
}

/* IMM mixing of the two models by their transition probabilities over dt_s. */
static void mix_models(const bst_filter_params *params, double dt_s, bst_filter_models *models) {
    double start = 1.0 / params->quiescent_sojourn_s, end = 1.0 / params->manoeuvre_sojourn_s,
           both = start + end;
    double settled = -expm1(-both * dt_s) / both;
    /* probability flow out of model 0, out of model 1 */
    double change[2] = {start * settled, end * settled};
    bst_filter_models before = *models;
    for (int to = 0; to < MODELS; to++) {
        double weights[MODELS];
        for (int from = 0; from < MODELS; from++) {
            weights[from] =
                before.probability[from] * (from == to ? 1.0 - change[from] : change[from]);
        }
        models->probability[to] = weights[0] + weights[1];
        if (models->probability[to] > 0.0) {
            bst_sky_mix(before.state, weights, MODELS, &models->state[to]);
        }
    }
}

/* Predicts one Gaussian by the EKF or UKF. */
static void predict_gaussian(const bst_filter_params *params, double dt_s, double noise_rad2ps3,
                             bst_sky_state *state) {
    if (params->kind == BST_FILTER_UKF) {
        bst_sky_predict_unscented(state, dt_s, noise_rad2ps3);
    } else {
        bst_sky_predict(state, dt_s, noise_rad2ps3);
    }
}

/* Power spectral density of the acceleration on a level of process noise. */
static double level_noise(const bst_filter_params *params, int level) {
    double share = (double)level / (BST_FILTER_LEVELS - 1);
    return params->noise_rad2ps3 * pow(params->steady_noise_rad2ps3 / params->noise_rad2ps3, share);
}

/* Gives each component all levels of process noise. */
static void start_levels(const bst_sky_state *state, bst_filter_models *models) {
    if (models->count == 0) {
        models->count = 1;
        models->state[0] = *state;
        models->probability[0] = 1.0;
    }
    int n = bst_sky_reduce(models->state, models->probability, models->count, LEVEL_COMPONENTS);
    for (int i = n * BST_FILTER_LEVELS - 1; i >= 0; i--) { /* the first n are the source */
        models->state[i] = models->state[i % n];
        models->level[i] = i / n;
        models->probability[i] = models->probability[i % n] * LEVELS_AT_START[i / n];
    }
    models->count = n * BST_FILTER_LEVELS;
    models->levels = BST_FILTER_LEVELS;
    models->unswitched_s = 0.0;
}

/* Appends the hypotheses of one level, reduced to `keep`, to the components. */
static void append_level(bst_filter_models *models, int level, bst_sky_state *hypotheses,
                         double *weights, int n, int keep) {
    double total = 0.0;
    for (int i = 0; i < n; i++) {
        total += weights[i];
    }
    if (!(total > 0.0)) {
        return;
    }
    if (n > 1 && keep == 1) {
        bst_sky_mix(hypotheses, weights, n, &hypotheses[0]);
        weights[0] = n = 1;
    } else {
        n = bst_sky_reduce(hypotheses, weights, n, keep);
    }
    for (int i = 0; i < n; i++) {
        int at = models->count++;
        assert(at < BST_FILTER_COMPONENTS);
        models->state[at] = hypotheses[i];
        models->probability[at] = weights[i] * total;
        models->level[at] = level;
    }
}

/* Changes between the levels of process noise over dt_s, once LEVEL_SWITCH_S have passed. */
static void switch_levels(double dt_s, bst_filter_models *models) {
    models->unswitched_s += dt_s;
    if (models->unswitched_s < LEVEL_SWITCH_S) {
        return;
    }
    double anew = -expm1(-models->unswitched_s / LEVEL_SOJOURN_S);
    models->unswitched_s = 0.0;
    bst_filter_models before = *models;
    models->count = 0;
    for (int level = 0; level < BST_FILTER_LEVELS; level++) {
        bst_sky_state moved[BST_FILTER_COMPONENTS];
        double weights[BST_FILTER_COMPONENTS];
        int own = 0;
        for (int i = 0; i < before.count; i++) {
            bool stays = before.level[i] == level;
            moved[i] = before.state[i];
            weights[i] =
                before.probability[i] * (anew * LEVELS_ANEW[level] + (stays ? 1.0 - anew : 0.0));
            own += stays;
        }
        append_level(models, level, moved, weights, before.count, own > 0 ? own : LEVEL_COMPONENTS);
    }
}

void bst_filter_predict(const bst_filter_params *params, double dt_s, bst_sky_state *state,
                        bst_filter_models *models) {
    assert(params && state && models && dt_s >= 0.0);
    assert(models->count >= 0 && models->count <= BST_FILTER_COMPONENTS);
    bool adaptive = params->kind != BST_FILTER_IMM && params->steady_noise_rad2ps3 > 0.0;
    if (!adaptive || models->count == 0) {
        models->levels = 0;
    }
    if (adaptive && models->levels == 0) {
        start_levels(state, models);
    } else if (adaptive) {
        switch_levels(dt_s, models);
    }
    if (models->count == 0) {
        predict_gaussian(params, dt_s, params->noise_rad2ps3, state);
        return;
    }
    if (params->kind == BST_FILTER_IMM) {
        mix_models(params, dt_s, models);
        bst_sky_predict(&models->state[0], dt_s, params->noise_rad2ps3);
        bst_sky_predict(&models->state[1], dt_s, params->manoeuvre_noise_rad2ps3);
    } else {
        for (int m = 0; m < models->count; m++) {
            double noise =
                models->levels > 0 ? level_noise(params, models->level[m]) : params->noise_rad2ps3;
            predict_gaussian(params, dt_s, noise, &models->state[m]);
        }
    }
    merge_models(models, state);
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

/* Log of the Gaussian density of an innovation, rad^-2. */
static double log_density(const bst_sky_innovation *innovation) {
    return -0.5 * innovation->chi2 - 0.5 * innovation->log_det_s - log(2.0 * BST_PI);
}

bool bst_filter_evaluate(const bst_filter_params *params, const bst_sky_state *state,
                         const bst_filter_models *models, const bst_filter_candidate *candidate,
                         bst_filter_fit *out) {
    assert(params && state && models && candidate && candidate->measurement && out);
    bool imm = params->kind == BST_FILTER_IMM && models->count > 0;
    if (!bst_sky_innovate(imm ? &models->state[0] : state, candidate->measurement, candidate->extra,
                          &out->innovation)) {
        return false;
    }
    out->chi2 = out->innovation.chi2;
    out->log_likelihood = log_density(&out->innovation);
    if (models->count == 0) {
        return true;
    }
    double sum = 0.0, high = -INFINITY, logs[BST_FILTER_COMPONENTS];
    out->chi2 = INFINITY;
    for (int m = 0; m < models->count; m++) {
        bst_sky_innovation own;
        if (!bst_sky_innovate(&models->state[m], candidate->measurement, candidate->extra, &own)) {
            return false;
        }
        logs[m] = log(models->probability[m]) + log_density(&own);
        high = fmax(high, logs[m]);
        out->chi2 = fmin(out->chi2, own.chi2);
    }
    for (int m = 0; m < models->count; m++) {
        sum += exp(logs[m] - high);
    }
    out->log_likelihood = high > -INFINITY ? high + log(sum) : high;
    return true;
}

/* Appends the association hypotheses of one Gaussian of weight exp(log_weight): each candidate
 * detection, and a miss. Returns the new count. */
static int branch_hypotheses(const bst_sky_state *state, double log_weight,
                             const bst_filter_evidence *evidence, bst_sky_state *hypotheses,
                             double *logs, int n) {
    assert(evidence->count >= 0 && evidence->count <= BST_FILTER_CANDIDATES);
    assert(n >= 0 && n <= (BST_FILTER_COMPONENTS - 1) * (BST_FILTER_CANDIDATES + 1));
    if (evidence->miss_weight > 0.0) {
        hypotheses[n] = *state;
        logs[n++] = log_weight + log(evidence->miss_weight);
    }
    for (int i = 0; i < evidence->count; i++) {
        const bst_filter_candidate *candidate = &evidence->candidates[i];
        bst_sky_innovation innovation;
        if (bst_sky_innovate(state, candidate->measurement, candidate->extra, &innovation)) {
            hypotheses[n] = *state;
            bst_sky_update(&hypotheses[n], &innovation);
            logs[n++] = log_weight + candidate->log_weight + log(evidence->hit_weight) +
                        log_density(&innovation);
        }
    }
    return n;
}

/* Converts log weights to weights whose largest is 1; returns ln of their total before that. */
static double to_weights(double *logs, int n) {
    double high = -INFINITY, sum = 0.0;
    for (int i = 0; i < n; i++) {
        high = fmax(high, logs[i]);
    }
    for (int i = 0; i < n; i++) {
        logs[i] = exp(logs[i] - high);
        sum += logs[i];
    }
    return high + log(sum);
}

/* Updates one Gaussian with the candidate detections; returns ln of the total weight of its
 * hypotheses. */
static double update_gaussian(bst_sky_state *state, const bst_filter_evidence *evidence) {
    bst_sky_state hypotheses[BST_FILTER_CANDIDATES + 1];
    double weights[BST_FILTER_CANDIDATES + 1];
    int n = branch_hypotheses(state, 0.0, evidence, hypotheses, weights, 0);
    if (n == 0) {
        return 0.0;
    }
    double total = to_weights(weights, n);
    if (n == 1) {
        *state = hypotheses[0];
    } else {
        bst_sky_mix(hypotheses, weights, n, state);
    }
    return total;
}

/* Updates the models of an IMM and their probabilities. */
static void update_models(bst_filter_models *models, const bst_filter_evidence *evidence) {
    double sum = 0.0;
    for (int m = 0; m < models->count; m++) {
        models->probability[m] =
            log(models->probability[m]) + update_gaussian(&models->state[m], evidence);
    }
    (void)to_weights(models->probability, models->count);
    for (int m = 0; m < models->count; m++) {
        sum += models->probability[m];
    }
    for (int m = 0; m < models->count; m++) {
        models->probability[m] /= sum;
    }
}

/* Updates the components of each level of process noise, whose share follows their total
 * likelihood. */
static void update_levels(bst_filter_models *models, const bst_filter_evidence *evidence,
                          int components) {
    enum { MOST = BST_FILTER_COMPONENTS * (BST_FILTER_CANDIDATES + 1) };
    bst_sky_state hypotheses[MOST];
    double weights[MOST], sum = 0.0;
    int first[BST_FILTER_LEVELS + 1] = {0}, n = 0;
    for (int level = 0; level < BST_FILTER_LEVELS; level++) {
        for (int m = 0; m < models->count; m++) {
            if (models->level[m] == level && models->probability[m] > 0.0) {
                n = branch_hypotheses(&models->state[m], log(models->probability[m]), evidence,
                                      hypotheses, weights, n);
            }
        }
        first[level + 1] = n;
    }
    if (n == 0) {
        return;
    }
    (void)to_weights(weights, n);
    for (int i = 0; i < n; i++) {
        sum += weights[i];
    }
    for (int i = 0; i < n; i++) {
        weights[i] /= sum;
    }
    int keep = components > BST_FILTER_LEVELS ? components / BST_FILTER_LEVELS : 1;
    models->count = 0;
    for (int level = 0; level < BST_FILTER_LEVELS; level++) {
        append_level(models, level, hypotheses + first[level], weights + first[level],
                     first[level + 1] - first[level], keep);
    }
}

/* Updates a mixture and reduces it to at most the given number of components. */
static void update_mixture(const bst_sky_state *state, bst_filter_models *models,
                           const bst_filter_evidence *evidence, int components) {
    enum { MOST = BST_FILTER_COMPONENTS * (BST_FILTER_CANDIDATES + 1) };
    bst_sky_state hypotheses[MOST];
    double weights[MOST];
    int n = 0;
    for (int m = 0; m < models->count; m++) {
        n = branch_hypotheses(&models->state[m], log(models->probability[m]), evidence, hypotheses,
                              weights, n);
    }
    if (models->count == 0) {
        models->levels = 0;
        n = branch_hypotheses(state, 0.0, evidence, hypotheses, weights, 0);
    }
    if (n == 0) {
        return;
    }
    (void)to_weights(weights, n);
    n = bst_sky_reduce(hypotheses, weights, n, components);
    models->count = n;
    memcpy(models->state, hypotheses, (size_t)n * sizeof *hypotheses);
    memcpy(models->probability, weights, (size_t)n * sizeof *weights);
}

void bst_filter_update(const bst_filter_params *params, bst_sky_state *state,
                       bst_filter_models *models, const bst_filter_evidence *evidence,
                       int components) {
    assert(params && state && models && evidence);
    assert(evidence->count >= 0 && evidence->count <= BST_FILTER_CANDIDATES);
    assert(components >= 1 && components <= BST_FILTER_COMPONENTS);
    if (params->kind == BST_FILTER_IMM && models->count > 0) {
        update_models(models, evidence);
        merge_models(models, state);
    } else if (models->count > 0 && models->levels > 0) {
        update_levels(models, evidence, components);
        merge_models(models, state);
    } else if (models->count > 0 || components > 1) {
        update_mixture(state, models, evidence, components);
        if (models->count > 0) {
            merge_models(models, state);
        }
    } else {
        (void)update_gaussian(state, evidence);
    }
}
