#include "sim/process/twin/twin_model.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/stop_signals.h"
#include "sim/core/cholesky.h"
#include "sim/process/twin/normal_equations.h"

/* A priori: width of the wide Gaussian over that of the narrow one, its logarithm's standard
 * deviation; of a found star's place, px. */
static const double USUAL_RATIO = 2.5, RATIO_SIGMA = 0.4, PLACE_SIGMA_PX = 3.0;
/* Limits of the PSF. */
static const double LEAST_SIGMA_PX = 0.25, MOST_SIGMA_PX = 4.0, LEAST_RATIO = 1.3, MOST_RATIO = 6.0,
                    MOST_WIDE = 0.8, MOST_WIDE_SIGMA_PX = 6.5;
/* Improvement of the loss that ends a fit. */
static const double LEAST_GAIN = 0.5;

bst_status bst_twin_model_render(bst_ctx *ctx, const bst_twin_model *m, bst_parallel *pool,
                                 float *stars_e) {
    return bst_twin_evaluate(ctx, m, NULL, pool, stars_e, NULL);
}

bst_status bst_twin_model_residual(bst_ctx *ctx, const bst_twin_model *m, bst_parallel *pool,
                                   float *residual) {
    BST_TRY(bst_twin_model_render(ctx, m, pool, residual));
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            size_t i = (size_t)y * (size_t)m->width + (size_t)x;
            residual[i] = m->data_e[i] - residual[i] - (float)bst_twin_background(m, x, y);
        }
    }
    return BST_OK;
}

int bst_twin_path_values(const bst_twin_path *path) {
    return 2 * path->count[0] + path->count[1];
}

double bst_twin_path_length_px(const bst_twin_model *m) {
    enum { SAMPLES = 200 };
    double length = 0.0;
    bst_quat before = bst_twin_path_attitude(&m->path, 0.0);
    for (int i = 1; i <= SAMPLES; i++) {
        bst_quat now = bst_twin_path_attitude(&m->path, (double)i / SAMPLES);
        bst_vec3 turn = bst_quat_to_rotvec(bst_quat_mul(now, bst_quat_conj(before)));
        length += hypot(turn.x, turn.y);
        before = now;
    }
    return length / bst_camera_scale_rad(&m->camera);
}

void bst_twin_star_shift(const bst_twin_model *m, bst_twin_star *s, double dx_px, double dy_px) {
    bst_quat q = bst_twin_path_attitude(&m->path, 0.5);
    double x, y;
    if (bst_camera_project(&m->camera, bst_quat_rotate(q, s->apparent), &x, &y)) {
        bst_vec3 v = bst_camera_unproject(&m->camera, x + dx_px, y + dy_px);
        s->apparent = bst_vec3_unit(bst_quat_rotate(bst_quat_conj(q), v));
    }
}

/* Variances of the pixels by the model. */
static bst_status set_variances(bst_ctx *ctx, bst_twin_model *m, bst_parallel *pool) {
    size_t pixels = (size_t)m->width * (size_t)m->height;
    BST_TRY(bst_twin_model_render(ctx, m, pool, m->variance_e2));
    for (size_t i = 0; i < pixels; i++) {
        double light = fmax((double)m->variance_e2[i], 0.0), form = m->form_error * light;
        m->variance_e2[i] = (float)(m->noise_e * m->noise_e + light + form * form);
    }
    return BST_OK;
}

/* Adds what is known beforehand. Returns its part of the loss. */
static double add_priors(const bst_twin_model *m, const bst_twin_layout *l, bst_twin_sums *s) {
    double loss = 0.0, *a = s->matrix;
    size_t n = (size_t)l->count;
    if (l->psf >= 0) {
        double off = log(m->psf.ratio / USUAL_RATIO) / RATIO_SIGMA;
        size_t at = (size_t)l->psf + 1;
        loss += 0.5 * off * off;
        if (a) {
            a[at * n + at] += 1.0 / (RATIO_SIGMA * RATIO_SIGMA);
            s->gradient[at] -= off / RATIO_SIGMA;
        }
    }
    for (int i = 0; i < m->count; i++) {
        const bst_twin_star *star = &m->stars[i];
        if (star->expected_e > 0.0 &&
            l->flux[i] >= 0) { /* within a factor: matters for blends and at the edge */
            double off = (star->flux_e - star->expected_e) / star->expected_e;
            size_t at = (size_t)l->flux[i];
            loss += 0.5 * off * off;
            if (a) {
                a[at * n + at] += 1.0 / (star->expected_e * star->expected_e);
                s->gradient[at] -= off / star->expected_e;
            }
        }
        for (int k = 0; k < 2 && a && l->place[i] >= 0; k++) {
            size_t at = (size_t)(l->place[i] + k);
            a[at * n + at] += 1.0 / (PLACE_SIGMA_PX * PLACE_SIGMA_PX);
        }
    }
    return loss;
}

static double within(double value, double low, double high) {
    return fmin(fmax(value, low), high);
}

/* Changes the model by a step of the parameters. */
static void apply(bst_twin_model *m, const bst_twin_layout *l, const double *step) {
    for (int i = 0; i < m->count; i++) {
        m->stars[i].flux_e += l->flux[i] >= 0 ? step[l->flux[i]] : 0.0;
        m->stars[i].flux_e = fmax(m->stars[i].flux_e, 0.0); /* of two that are one streak */
        if (l->place[i] >= 0) {
            bst_twin_star_shift(m, &m->stars[i], within(step[l->place[i]], -2.0, 2.0),
                                within(step[l->place[i] + 1], -2.0, 2.0));
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        for (int k = 0; k < m->path.count[axis == 2] && l->angle[axis] >= 0; k++) {
            m->path.coefficients[axis][k] += step[l->angle[axis] + k];
        }
    }
    if (l->log_scale >= 0) {
        m->camera.pixel_scale_arcsec *= exp(-within(step[l->log_scale], -0.01, 0.01));
    }
    if (l->psf >= 0) {
        bst_twin_psf *p = &m->psf;
        p->sigma_px = within(p->sigma_px * exp(within(step[l->psf], -0.3, 0.3)), LEAST_SIGMA_PX,
                             MOST_SIGMA_PX);
        p->ratio = within(p->ratio * exp(within(step[l->psf + 1], -0.3, 0.3)), LEAST_RATIO,
                          fmin(MOST_RATIO, MOST_WIDE_SIGMA_PX / p->sigma_px));
        p->wide = within(p->wide + within(step[l->psf + 2], -0.2, 0.2), 0.0, MOST_WIDE);
    }
    for (int k = 0; k < BST_TWIN_BACKGROUND; k++) {
        m->background_e[k] += step[l->background + k];
    }
}

/* State of a fit. */
typedef struct fit {
    bst_twin_layout layout;
    bst_twin_sums sums;
    bst_twin_model before;
    double *factor, *step;
    double damping;
} fit;

static void fit_free(fit *f) {
    free(f->sums.matrix);
    free(f->sums.gradient);
    free(f->before.stars);
    free(f->factor);
    free(f->step);
}

static bst_status fit_create(bst_ctx *ctx, const bst_twin_model *m, fit *f) {
    size_t n = (size_t)f->layout.count;
    f->sums.matrix = malloc(n * n * sizeof *f->sums.matrix);
    f->sums.gradient = malloc(n * sizeof *f->sums.gradient);
    f->factor = malloc(n * n * sizeof *f->factor);
    f->step = malloc(n * sizeof *f->step);
    f->before.stars = malloc(BST_TWIN_STARS * sizeof *f->before.stars);
    f->damping = 1e-3;
    (void)m;
    return f->sums.matrix && f->sums.gradient && f->factor && f->step && f->before.stars
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a fit of %zu parameters", n);
}

static void keep(bst_twin_model *to, const bst_twin_model *from) {
    bst_twin_star *stars = to->stars;
    memcpy(stars, from->stars, (size_t)from->count * sizeof *stars);
    *to = *from;
    to->stars = stars;
}

/* Step of damped normal equations; false: not solvable. */
static bool solve(fit *f) {
    int n = f->layout.count;
    memcpy(f->factor, f->sums.matrix, (size_t)n * (size_t)n * sizeof *f->factor);
    memcpy(f->step, f->sums.gradient, (size_t)n * sizeof *f->step);
    for (int i = 0; i < n; i++) {
        double *d = &f->factor[(size_t)i * (size_t)n + (size_t)i];
        *d = *d > 0.0 ? *d * (1.0 + f->damping) : 1.0; /* 1: nothing depends on it */
    }
    if (!bst_cholesky_factor(f->factor, n, n, 1e-13)) {
        return false;
    }
    bst_cholesky_solve(f->factor, n, n, f->step);
    return true;
}

/* Tries steps until one improves the loss. *gain 0: none does. */
static bst_status improve(bst_ctx *ctx, bst_twin_model *m, fit *f, bst_parallel *pool, double *loss,
                          double *gain) {
    *gain = 0.0;
    for (int tries = 0; tries < 8; tries++) {
        if (solve(f)) {
            bst_twin_sums trial = {.matrix = NULL};
            keep(&f->before, m);
            apply(m, &f->layout, f->step);
            BST_TRY(bst_twin_evaluate(ctx, m, NULL, pool, NULL, &trial));
            double now = trial.loss + add_priors(m, &f->layout, &trial);
            if (now < *loss) {
                *gain = *loss - now;
                *loss = now;
                f->damping = fmax(0.2 * f->damping, 1e-9);
                return BST_OK;
            }
            keep(m, &f->before);
        }
        f->damping *= 10.0;
    }
    return BST_OK;
}

/* Standard deviations of the fluxes, from the inverse of the normal equations. */
static void set_sigmas(bst_twin_model *m, fit *f) {
    int n = f->layout.count;
    f->damping = 1e-9;
    bool solved = solve(f);
    for (int i = 0; i < m->count; i++) {
        if (f->layout.flux[i] < 0) {
            continue;
        }
        memset(f->step, 0, (size_t)n * sizeof *f->step);
        f->step[f->layout.flux[i]] = 1.0;
        if (solved) {
            bst_cholesky_solve(f->factor, n, n, f->step);
        }
        m->stars[i].sigma_e = solved ? sqrt(f->step[f->layout.flux[i]]) : NAN;
    }
}

/* Iterations of a fit that is set up. */
static bst_status iterate(bst_ctx *ctx, bst_twin_model *m, fit *f, int iterations,
                          bst_parallel *pool, double *loss) {
    BST_TRY(set_variances(ctx, m, pool));
    m->converged = false;
    for (int i = 0; i <= iterations; i++) {
        double gain;
        if (bst_stop_requested()) {
            return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
        }
        BST_TRY(bst_twin_evaluate(ctx, m, &f->layout, pool, NULL, &f->sums));
        *loss = f->sums.loss + add_priors(m, &f->layout, &f->sums);
        if (i == iterations) {
            break;
        }
        BST_TRY(improve(ctx, m, f, pool, loss, &gain));
        if (gain < LEAST_GAIN) {
            m->converged = true;
            break;
        }
    }
    set_sigmas(m, f);
    return BST_OK;
}

bst_status bst_twin_model_fit(bst_ctx *ctx, bst_twin_model *m, const bst_twin_freedom *freedom,
                              bst_parallel *pool, double *loss) {
    assert(m && freedom && loss);
    fit f = {.damping = 0.0};
    bst_twin_layout_make(m, freedom, &f.layout);
    bst_status status = fit_create(ctx, m, &f);
    if (status == BST_OK) {
        status = iterate(ctx, m, &f, freedom->iterations, pool, loss);
    }
    fit_free(&f);
    return status;
}
