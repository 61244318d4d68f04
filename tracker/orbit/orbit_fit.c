#include "tracker/orbit/orbit_fit.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"
#include "sim/astro/sgp4_fit.h"
#include "sim/core/cholesky.h"
#include "sim/core/compare.h"
#include "sim/core/tangent.h"
#include "tracker/orbit/orbit_chart.h"
#include "tracker/orbit/orbit_photocentre.h"

enum { PARAMETERS = 6, MAX_ITERATIONS = 60, MAX_ROUNDS = 6 };

/* Largest 1 sigma of the logarithm of range for which the range counts as determined. */
static const double MOST_LOG_SIGMA = 0.5;

typedef struct work {
    bst_ctx *ctx;
    const bst_od_observation *items;
    int count, middle;
    const bst_od_options *options;
    bool *used;
    double (*white)[3];             /* inverse Cholesky factor of each covariance: 11, 21, 22 */
    double *range_m;                /* to the object at the latest state */
    double (*residual)[2];          /* whitened, at the current state */
    double (*side[2])[2];           /* whitened, at displaced states */
    double (*slope)[PARAMETERS][2]; /* d(residual)/d(step) */
} work;

/* ------------------------------------------------------------------ Residuals */

/* Whitened residual of one observation along a propagated orbit. */
static bst_status residual_at(work *w, const bst_od_path *path, int i, double out[2]) {
    const bst_od_observation *o = &w->items[i];
    bst_od_state then;
    bst_od_sight sight;
    BST_TRY(bst_od_path_state(w->ctx, path, o->observer.time_s, &then));
    bst_od_see(&then, &o->observer, &sight);
    bst_tangent axes = bst_tangent_at(o->direction);
    bst_vec3 off = bst_tangent_log(o->direction, sight.direction);
    double a = bst_vec3_dot(axes.e1, off), b = bst_vec3_dot(axes.e2, off);
    out[0] = w->white[i][0] * a;
    out[1] = w->white[i][1] * a + w->white[i][2] * b;
    w->range_m[i] = sight.range_m;
    return BST_OK;
}

/* Whitened residuals, predicted minus measured, of all observations. */
static bst_status residuals(work *w, const bst_od_state *state, double (*out)[2]) {
    bst_od_path *path;
    BST_TRY(bst_od_path_create(w->ctx, &w->options->motion, state, &path));
    bst_status status = BST_OK;
    /* outward from the middle on both sides, so that the integration never restarts */
    for (int i = w->middle; i < w->count && status == BST_OK; i++) {
        status = residual_at(w, path, i, out[i]);
    }
    for (int i = w->middle - 1; i >= 0 && status == BST_OK; i--) {
        status = residual_at(w, path, i, out[i]);
    }
    bst_od_path_free(path);
    return status;
}

static double chi2_of(const double r[2]) {
    return r[0] * r[0] + r[1] * r[1];
}

/* Chi-square over the observations in use. */
static double total_chi2(const work *w, double (*r)[2]) {
    double sum = 0.0;
    for (int i = 0; i < w->count; i++) {
        sum += w->used[i] ? chi2_of(r[i]) : 0.0;
    }
    return sum;
}

/* Jacobian of the residuals by central differences; by differences to one side in a fit that ends
 * early, which needs no covariance to many digits. */
static bst_status residual_jacobian(work *w, const bst_od_chart *c) {
    /* the effect of a range displacement grows with the arc: the step is reduced to stay linear */
    double fine = 1e-4 / (1.0 + c->span_s / 600.0);
    const double step[PARAMETERS] = {1e-5, 1e-5, 1e-5, 1e-5, fine, fine};
    const bool one_sided = w->options->least_gain > 0.0;
    for (int k = 0; k < PARAMETERS; k++) {
        for (int s = 0; s < (one_sided ? 1 : 2); s++) {
            double x[PARAMETERS] = {0.0};
            x[k] = s ? -step[k] : step[k];
            bst_od_chart near = bst_od_chart_moved(c, x);
            bst_od_state state = bst_od_chart_state(&near);
            BST_TRY(residuals(w, &state, w->side[s]));
        }
        double(*const low)[2] = one_sided ? w->residual : w->side[1];
        const double apart = one_sided ? step[k] : 2.0 * step[k];
        for (int i = 0; i < w->count; i++) {
            for (int j = 0; j < 2; j++) {
                w->slope[i][k][j] = (w->side[0][i][j] - low[i][j]) / apart;
            }
        }
    }
    return BST_OK;
}

static void normal_equations(const work *w, double n[PARAMETERS][PARAMETERS],
                             double b[PARAMETERS]) {
    memset(n, 0, sizeof(double[PARAMETERS][PARAMETERS]));
    memset(b, 0, sizeof(double[PARAMETERS]));
    for (int i = 0; i < w->count; i++) {
        for (int j = 0; j < 2 && w->used[i]; j++) {
            for (int k = 0; k < PARAMETERS; k++) {
                double s = w->slope[i][k][j];
                b[k] -= s * w->residual[i][j];
                for (int l = 0; l <= k; l++) {
                    n[k][l] += s * w->slope[i][l][j];
                }
            }
        }
    }
    for (int k = 0; k < PARAMETERS; k++) {
        for (int l = 0; l < k; l++) {
            n[l][k] = n[k][l];
        }
    }
}

/* Cholesky factor of the damped normal matrix n (diagonal times 1 + damping), scaled to a unit
 * diagonal; the scale goes to `size`. Returns false if a pivot is below `least`. */
static bool factor_damped(const double n[PARAMETERS][PARAMETERS], double damping, double least,
                          double l[PARAMETERS][PARAMETERS], double size[PARAMETERS]) {
    for (int i = 0; i < PARAMETERS; i++) {
        size[i] = sqrt(n[i][i]);
        if (!(size[i] > 0.0) || !isfinite(size[i])) {
            return false;
        }
    }
    for (int i = 0; i < PARAMETERS; i++) {
        for (int j = 0; j <= i; j++) {
            l[i][j] = i == j ? 1.0 + damping : n[i][j] / (size[i] * size[j]);
        }
    }
    return bst_cholesky_factor(l[0], PARAMETERS, PARAMETERS, least / (1.0 + damping));
}

static void solve(const double l[PARAMETERS][PARAMETERS], const double size[PARAMETERS],
                  const double b[PARAMETERS], double x[PARAMETERS]) {
    for (int i = 0; i < PARAMETERS; i++) {
        x[i] = b[i] / size[i];
    }
    bst_cholesky_solve(l[0], PARAMETERS, PARAMETERS, x);
    for (int i = 0; i < PARAMETERS; i++) {
        x[i] /= size[i];
    }
}

/* Limits a step to the range in which linearisation can hold. */
static void limit_step(double x[PARAMETERS]) {
    static const double most[PARAMETERS] = {0.2, 0.2, 0.5, 0.5, 0.7, 0.7};
    double shrink = 1.0;
    for (int i = 0; i < PARAMETERS; i++) {
        shrink = fmin(shrink, most[i] / fmax(fabs(x[i]), most[i]));
    }
    for (int i = 0; i < PARAMETERS; i++) {
        x[i] *= shrink;
    }
}

static bst_status fail_range(const work *w) {
    return bst_fail(
        w->ctx, BST_ERR_NUMERIC,
        "the %d observations over %.6g s do not determine the range: the arc is too short for "
        "their errors, or the observer moves in the object's orbital plane beside it; observe for "
        "longer, or from another orbit",
        w->count, w->items[w->count - 1].observer.time_s - w->items[0].observer.time_s);
}

static int most_iterations(const bst_od_options *options) {
    return options->most_iterations > 0 ? options->most_iterations : MAX_ITERATIONS;
}

/* Error of an iteration that did not converge: an undetermined range has no minimum. */
static bst_status fail_to_converge(const work *w, const double n[PARAMETERS][PARAMETERS]) {
    double l[PARAMETERS][PARAMETERS], size[PARAMETERS], x[PARAMETERS];
    const double range[PARAMETERS] = {[4] = 1.0};
    if (!factor_damped(n, 0.0, 1e-15, l, size)) {
        return fail_range(w);
    }
    solve(l, size, range, x);
    if (!(x[4] < MOST_LOG_SIGMA * MOST_LOG_SIGMA)) {
        return fail_range(w);
    }
    return bst_fail(w->ctx, BST_ERR_NUMERIC,
                    "the fit of an orbit does not converge in %d iterations: the arc is too short "
                    "for its errors, the object moves beside the observer, or observations are of "
                    "another object; use a longer arc or leave out wrong observations",
                    most_iterations(w->options));
}

/* What the linear model predicts holds for steps that are hardly damped. */
static const double MOST_DAMPING = 1.0;

/* Levenberg-Marquardt iteration over the observations in use. */
static bst_status minimise(work *w, bst_od_chart *c, double n[PARAMETERS][PARAMETERS],
                           int *iterations) {
    bst_od_state state = bst_od_chart_state(c);
    BST_TRY(residuals(w, &state, w->residual));
    double cost = total_chi2(w, w->residual), damping = 1e-3;
    const int most = most_iterations(w->options);
    for (*iterations = 1; *iterations <= most; ++*iterations) {
        double b[PARAMETERS], l[PARAMETERS][PARAMETERS], size[PARAMETERS], x[PARAMETERS];
        BST_TRY(residual_jacobian(w, c));
        normal_equations(w, n, b);
        bool better = false;
        double predicted = INFINITY, linear_gain = INFINITY;
        for (int attempt = 0; attempt < 12 && !better; attempt++) {
            if (!factor_damped(n, damping, 1e-16, l, size)) {
                damping = fmax(10.0 * damping, 1e-12);
                continue;
            }
            solve(l, size, b, x);
            predicted = 0.0; /* of the decrease of chi2 by this step */
            for (int i = 0; i < PARAMETERS; i++) {
                predicted += b[i] * x[i];
            }
            linear_gain = attempt == 0 && damping <= MOST_DAMPING ? predicted : linear_gain;
            limit_step(x);
            bst_od_chart next = bst_od_chart_moved(c, x);
            state = bst_od_chart_state(&next);
            bst_status status = residuals(w, &state, w->side[0]);
            double then = status == BST_OK ? total_chi2(w, w->side[0]) : INFINITY;
            if (then <= cost) {
                better = true;
                *c = next;
                memcpy(w->residual, w->side[0], (size_t)w->count * sizeof *w->residual);
                predicted = fmax(predicted, cost - then);
                cost = then;
                damping = fmax(0.1 * damping, 1e-14);
            } else {
                if (predicted < 1e-6 + 1e-9 * cost) {
                    break; /* converged */
                }
                damping = fmax(10.0 * damping, 1e-12);
            }
        }
        if (predicted < 1e-6 + 1e-9 * cost || linear_gain < w->options->least_gain * cost) {
            return BST_OK;
        }
        if (!better) {
            return fail_to_converge(w, (const double(*)[PARAMETERS])n);
        }
        if (!(c->range_m > 1.0 && c->range_m < 1e10)) {
            return fail_range(w);
        }
    }
    return fail_to_converge(w, (const double(*)[PARAMETERS])n);
}

/* ------------------------------------------------------------------ Complete fit */

/* Rejects outlying observations; true if the selection changed. */
static bool reject_outliers(work *w, bool *changed, double *scratch) {
    int count = 0;
    for (int i = 0; i < w->count; i++) {
        scratch[i] = chi2_of(w->residual[i]);
    }
    qsort(scratch, (size_t)w->count, sizeof *scratch, bst_compare_doubles);
    double limit_chi2 = fmax(w->options->reject_chi2, 10.0 * scratch[w->count / 2]);
    *changed = false;
    for (int i = 0; i < w->count; i++) {
        bool use = !(chi2_of(w->residual[i]) > limit_chi2);
        *changed = *changed || use != w->used[i];
        w->used[i] = use;
        count += use;
    }
    return count >= BST_OD_LEAST;
}

/* Checks order of time and covariances of the observations. */
static bst_status check(work *w) {
    for (int i = 0; i < w->count; i++) {
        const bst_od_observation *o = &w->items[i];
        /* covariance without the part shared with other observations */
        const double(*s)[2] = o->shared_rad;
        double c11 = o->cov_11 - s[0][0] * s[0][0] - s[0][1] * s[0][1];
        double c12 = o->cov_12 - s[0][0] * s[1][0] - s[0][1] * s[1][1];
        double c22 = o->cov_22 - s[1][0] * s[1][0] - s[1][1] * s[1][1];
        double low = c12 / c11, rest = c22 - low * c12;
        if (!(c11 > 0.0) || !(rest > 0.0) || !isfinite(c11 + rest)) {
            return bst_fail(w->ctx, BST_ERR_ARGUMENT,
                            "observation %d: its covariance is not positive definite", i);
        }
        if (!isfinite(o->observer.time_s) || fabs(bst_vec3_norm(o->direction) - 1.0) > 1e-6 ||
            (i > 0 && !(o->observer.time_s >= o[-1].observer.time_s))) {
            return bst_fail(w->ctx, BST_ERR_ARGUMENT,
                            "observation %d: its direction is no unit vector, or it is earlier "
                            "than the one before",
                            i);
        }
        w->white[i][0] = 1.0 / sqrt(c11);
        w->white[i][2] = 1.0 / sqrt(rest);
        w->white[i][1] = -low * w->white[i][2];
        w->used[i] = true;
    }
    return BST_OK;
}

/* Adds the effect of shared errors to the covariance, as consider parameters (Tapley, Schutz and
 * Born, Statistical Orbit Determination, 2004, section 6.3): the sum over all pairs of observations
 * of g_i g_j^T exp(-|change between them|), g_i the sensitivity of the solution to the error of
 * one. The exponential permits one pass: a = exp(-change) a + g, sum += g a^T + a g^T - g g^T. */
static void add_shared_errors(const work *w, const double l[PARAMETERS][PARAMETERS],
                              const double size[PARAMETERS], double p[PARAMETERS][PARAMETERS]) {
    double past[2][PARAMETERS] = {{0.0}};
    for (int i = 0; i < w->count; i++) {
        const double *white = w->white[i];
        const double(*s)[2] = w->items[i].shared_rad;
        double kept = exp(-w->items[i].shared_change);
        for (int c = 0; c < 2; c++) {
            double *a = past[c], b[PARAMETERS] = {0.0}, g[PARAMETERS];
            const double r[2] = {white[0] * s[0][c], white[1] * s[0][c] + white[2] * s[1][c]};
            for (int k = 0; k < PARAMETERS && w->used[i]; k++) {
                b[k] = w->slope[i][k][0] * r[0] + w->slope[i][k][1] * r[1];
            }
            solve(l, size, b, g);
            for (int k = 0; k < PARAMETERS; k++) {
                a[k] = kept * a[k] + g[k];
            }
            for (int k = 0; k < PARAMETERS; k++) {
                for (int m = 0; m < PARAMETERS; m++) {
                    p[k][m] += g[k] * a[m] + a[k] * g[m] - g[k] * g[m];
                }
            }
        }
    }
}

/* Largest rate of an orbit around the Earth: at its perigee, which is above the ground. */
static double largest_rate_radps(const work *w, const bst_od_state *s) {
    const bst_vec3 momentum = bst_vec3_cross(s->position_m, s->velocity_mps);
    const bst_astro_kepler_elements k = bst_astro_kepler_elements_of(
        bst_od_gm(&w->options->motion), s->position_m, s->velocity_mps);
    const double perigee_m = fmax(k.semi_major_axis_m * (1.0 - k.eccentricity), BST_EARTH_RADIUS_M);
    return bst_vec3_norm(momentum) / (perigee_m * perigee_m);
}

/* Share of the variance of the photocentre's displacement that remains towards the Sun: the errors
 * of spheres in arcs of up to 60,000 s are then within the covariance (design choice). */
static const double SUNWARD = 0.125;

/* Adds an observation to the right-hand side of the normal equations for one standard deviation of
 * the displacement that stays towards the Sun; returns the share of the variance that is left. */
static double add_sunward(const work *w, int i, double sigma, double rhs[PARAMETERS]) {
    const bst_od_observation *o = &w->items[i];
    const bst_vec3 across = bst_tangent_project(o->direction, o->sun);
    const double length = bst_vec3_norm(across), *white = w->white[i];
    if (!(length > 0.0)) {
        return 1.0;
    }
    const bst_tangent axes = bst_tangent_at(o->direction);
    const double x = bst_vec3_dot(axes.e1, across) / length;
    const double y = bst_vec3_dot(axes.e2, across) / length, all = sqrt(2.0 * SUNWARD) * sigma;
    for (int k = 0; k < PARAMETERS && w->used[i]; k++) {
        rhs[k] += all * (w->slope[i][k][0] * white[0] * x +
                         w->slope[i][k][1] * (white[1] * x + white[2] * y));
    }
    return 1.0 - SUNWARD;
}

/* Adds the effect of the photocentre's displacement to the covariance, as consider parameters along
 * the axes of GCRF and, for a part, towards the Sun: N^-1 B N^-1 with B the covariance that they
 * give the normal equations. */
static bst_status add_photocentre(const work *w, const bst_od_state *state,
                                  const double l[PARAMETERS][PARAMETERS],
                                  const double size[PARAMETERS], double p[PARAMETERS][PARAMETERS]) {
    double b[PARAMETERS][PARAMETERS], half[PARAMETERS][PARAMETERS], column[PARAMETERS];
    double sunward[PARAMETERS] = {0.0};
    bst_od_photocentre_effect *items = calloc((size_t)w->count, sizeof *items);
    if (!items) {
        return bst_fail(w->ctx, BST_ERR_MEMORY, "out of memory for %d observations", w->count);
    }
    for (int i = 0; i < w->count; i++) {
        const bst_od_observation *o = &w->items[i];
        const double *white = w->white[i];
        double sigma =
            bst_od_photocentre_rad(w->options->photocentre_m, o->photocentre_factor, w->range_m[i]);
        sigma *= sqrt(add_sunward(w, i, sigma, sunward));
        const bst_tangent axes = bst_tangent_at(o->direction);
        const double e1[3] = {axes.e1.x, axes.e1.y, axes.e1.z};
        const double e2[3] = {axes.e2.x, axes.e2.y, axes.e2.z};
        items[i].time_s = o->observer.time_s;
        items[i].direction = o->direction;
        for (int c = 0; c < 3 && w->used[i]; c++) {
            const double r0 = white[0] * e1[c], r1 = white[1] * e1[c] + white[2] * e2[c];
            for (int k = 0; k < PARAMETERS; k++) {
                items[i].rhs[c][k] = sigma * (w->slope[i][k][0] * r0 + w->slope[i][k][1] * r1);
            }
        }
    }
    bst_od_photocentre_covariance(items, w->count, largest_rate_radps(w, state), b);
    free(items);
    for (int k = 0; k < PARAMETERS * PARAMETERS; k++) {
        b[k / PARAMETERS][k % PARAMETERS] += sunward[k / PARAMETERS] * sunward[k % PARAMETERS];
    }
    for (int k = 0; k < PARAMETERS; k++) { /* B is symmetric: its rows are its columns */
        solve(l, size, b[k], half[k]);
    }
    for (int k = 0; k < PARAMETERS; k++) {
        double across[PARAMETERS];
        for (int i = 0; i < PARAMETERS; i++) {
            across[i] = half[i][k];
        }
        solve(l, size, across, column);
        for (int i = 0; i < PARAMETERS; i++) {
            p[i][k] += column[i];
        }
    }
    return BST_OK;
}

/* Covariance of the coordinate steps: independent errors times the variance factor, plus shared
 * errors. */
static void covariance_of_steps(const work *w, const double l[PARAMETERS][PARAMETERS],
                                const double size[PARAMETERS], double variance_factor,
                                double p[PARAMETERS][PARAMETERS]) {
    for (int k = 0; k < PARAMETERS; k++) {
        double unit[PARAMETERS] = {0.0}, x[PARAMETERS];
        unit[k] = 1.0;
        solve(l, size, unit, x);
        for (int i = 0; i < PARAMETERS; i++) {
            p[i][k] = variance_factor * x[i];
        }
    }
    add_shared_errors(w, l, size, p);
}

/* Counts used and rejected observations; RMS residual of the solution. */
static void count_residuals(work *w, bst_od_solution *out) {
    double squares = 0.0;
    out->chi2 = total_chi2(w, w->residual);
    out->used = 0;
    for (int i = 0; i < w->count; i++) {
        if (w->used[i]) {
            const double *white = w->white[i], *r = w->residual[i];
            double a = r[0] / white[0], b = (r[1] - white[1] * a) / white[2];
            squares += a * a + b * b;
            out->used++;
        }
    }
    out->rejected = w->count - out->used;
    out->dof = 2 * out->used - PARAMETERS;
    out->rms_rad = sqrt(0.5 * squares / out->used);
    out->variance_factor = w->options->scale_variance
                               ? (BST_OD_PRIOR_DOF + out->chi2) / (BST_OD_PRIOR_DOF + out->dof)
                               : 1.0;
}

/* Converts the fit to a solution: state, covariance, range sigma. */
static bst_status finish_solution(work *w, const bst_od_chart *c,
                                  const double n[PARAMETERS][PARAMETERS], bst_od_solution *out) {
    double l[PARAMETERS][PARAMETERS], size[PARAMETERS], p[PARAMETERS][PARAMETERS];
    double map[6][PARAMETERS];
    if (!factor_damped(n, 0.0, 1e-15, l, size)) {
        return fail_range(w);
    }
    count_residuals(w, out);
    covariance_of_steps(w, (const double(*)[PARAMETERS])l, size, out->variance_factor, p);
    out->state = bst_od_chart_state(c);
    if (w->options->photocentre_m > 0.0) {
        BST_TRY(add_photocentre(w, &out->state, (const double(*)[PARAMETERS])l, size, p));
    }
    bst_od_chart_jacobian(c, map);
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int a = 0; a < PARAMETERS; a++) {
                for (int b = 0; b < PARAMETERS; b++) {
                    sum += map[i][a] * 0.5 * (p[a][b] + p[b][a]) * map[j][b];
                }
            }
            out->covariance[i][j] = out->covariance[j][i] = sum;
        }
    }
    out->range_m = c->range_m;
    double log_sigma = sqrt(p[4][4]);
    out->range_sigma_m = c->range_m * log_sigma;
    double u = c->u_ps, t = c->span_s;
    /* range rate = range * u */
    out->range_rate_sigma_mps =
        c->range_m * sqrt(fmax(0.0, u * u * p[4][4] + 2.0 * u / t * p[4][5] + p[5][5] / (t * t)));
    return isfinite(log_sigma) && log_sigma < MOST_LOG_SIGMA ? BST_OK : fail_range(w);
}

/* Nonlinearity of the fit: relative departure of the sum of squares from the covariance's
 * prediction, two standard deviations of range along the valley; 0 if linear. */
static double nonlinearity(work *w, const bst_od_chart *c, const double n[PARAMETERS][PARAMETERS],
                           const bst_od_solution *s) {
    double l[PARAMETERS][PARAMETERS], size[PARAMETERS], column[PARAMETERS], worst = 0.0;
    const double range[PARAMETERS] = {[4] = 1.0};
    if (!factor_damped(n, 0.0, 1e-15, l, size)) {
        return INFINITY;
    }
    solve(l, size, range, column);
    for (int side = -2; side <= 2; side += 4) {
        double x[PARAMETERS];
        for (int i = 0; i < PARAMETERS; i++) {
            x[i] = side * column[i] / sqrt(column[4]);
        }
        bst_od_chart there = bst_od_chart_moved(c, x);
        bst_od_state state = bst_od_chart_state(&there);
        bst_ctx *ctx = w->ctx;
        bst_ctx quiet = {0};
        w->ctx = &quiet;
        bst_status status = residuals(w, &state, w->side[0]);
        w->ctx = ctx;
        double excess =
            status == BST_OK ? (total_chi2(w, w->side[0]) - s->chi2) / 4.0 - 1.0 : INFINITY;
        worst = fmax(worst, fabs(excess));
    }
    return worst;
}

/* Fit with outlier rejection rounds. */
static bst_status fit_rounds(work *w, const bst_od_state *first, double *scratch,
                             bst_od_solution *out) {
    const bst_od_observer *middle = &w->items[w->middle].observer;
    double start = w->items[0].observer.time_s, end = w->items[w->count - 1].observer.time_s;
    bst_od_path *path;
    bst_od_state there;
    BST_TRY(bst_od_path_create(w->ctx, &w->options->motion, first, &path));
    bst_status status = bst_od_path_state(w->ctx, path, middle->time_s, &there);
    bst_od_path_free(path);
    BST_TRY(status);
    bst_od_chart c = bst_od_chart_of(middle, fmax(0.5 * (end - start), 1.0), &there);
    double n[PARAMETERS][PARAMETERS];
    out->iterations = 0;
    bool changed = true;
    for (int round = 0; round < MAX_ROUNDS && changed; round++) {
        int iterations;
        BST_TRY(minimise(w, &c, n, &iterations));
        out->iterations += iterations;
        changed = false;
        if (w->options->reject_chi2 > 0.0 && !reject_outliers(w, &changed, scratch)) {
            return bst_fail(w->ctx, BST_ERR_NUMERIC,
                            "no orbit fits %d of the observations; they are of several objects, or "
                            "their errors are underestimated",
                            BST_OD_LEAST);
        }
    }
    BST_TRY(finish_solution(w, &c, (const double(*)[PARAMETERS])n, out));
    out->bend = nonlinearity(w, &c, (const double(*)[PARAMETERS])n, out);
    return BST_OK;
}

bst_status bst_od_fit(bst_ctx *ctx, const bst_od_observation *observations, int count,
                      const bst_od_options *options, const bst_od_state *first,
                      double *residual_chi2, bst_od_solution *out) {
    assert(options && first && out && count >= 0 && (observations || count == 0));
    *out = (bst_od_solution){0};
    if (count < BST_OD_LEAST) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%d observations are too few: an orbit needs %d",
                        count, BST_OD_LEAST);
    }
    size_t n = (size_t)count;
    work w = {.ctx = ctx,
              .items = observations,
              .count = count,
              .options = options,
              .used = malloc(n * sizeof *w.used),
              .white = malloc(n * sizeof *w.white),
              .range_m = malloc(n * sizeof *w.range_m),
              .residual = malloc(n * sizeof *w.residual),
              .side = {malloc(n * sizeof *w.residual), malloc(n * sizeof *w.residual)},
              .slope = malloc(n * sizeof *w.slope)};
    double *scratch = malloc(n * sizeof *scratch);
    double middle = 0.5 * (observations[0].observer.time_s + observations[n - 1].observer.time_s);
    for (int i = 1; i < count; i++) {
        double now = fabs(observations[i].observer.time_s - middle);
        w.middle = now < fabs(observations[w.middle].observer.time_s - middle) ? i : w.middle;
    }
    bst_status status = BST_OK;
    if (!w.used || !w.white || !w.range_m || !w.residual || !w.side[0] || !w.side[1] || !w.slope ||
        !scratch) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d observations", count);
    }
    status = status == BST_OK ? check(&w) : status;
    status = status == BST_OK ? fit_rounds(&w, first, scratch, out) : status;
    for (int i = 0; i < count && status == BST_OK && residual_chi2; i++) {
        residual_chi2[i] = chi2_of(w.residual[i]);
    }
    free(w.used);
    free(w.white);
    free(w.range_m);
    free(w.residual);
    free(w.side[0]);
    free(w.side[1]);
    free(w.slope);
    free(scratch);
    return status;
}
