#include "imgproc/streak/streak_fit.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/background.h"
#include "sim/core/cholesky.h"

enum { PARAMETERS = 5, MAX_ITERATIONS = 20 };

/* Convergence: a smaller change of chi-square moves the source by less than a tenth of its error.
 */
static const double SETTLED = 0.01;

/* Least pivot of the Cholesky factorisation, relative to its diagonal element. */
static const double LEAST_PIVOT = 1e-9;

static const double PATH_STEP_PX = 0.02;

bst_status bst_streak_fit_create(bst_ctx *ctx, const bst_imgproc_gauss *psf, int max_side,
                                 bst_streak_fit *out) {
    size_t pixels = (size_t)max_side * (size_t)max_side;
    *out = (bst_streak_fit){.psf = psf, .max_side = max_side};
    out->image = calloc(6 * pixels, sizeof(double));
    out->spare = calloc(3 * pixels, sizeof(double));
    if (!out->image || !out->spare) {
        bst_streak_fit_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a fit on %zu pixels", pixels);
    }
    return BST_OK;
}

void bst_streak_fit_free(bst_streak_fit *fit) {
    free(fit->image);
    free(fit->spare);
    *fit = (bst_streak_fit){0};
}

typedef struct normal {
    double a[PARAMETERS][PARAMETERS], g[PARAMETERS], square;
} normal;

/* Solves a x = b for symmetric positive definite a; false if it is not. */
static bool solve(double a[PARAMETERS][PARAMETERS], double *b) {
    double l[PARAMETERS][PARAMETERS];
    memcpy(l, a, sizeof l);
    if (!bst_cholesky_factor(l[0], PARAMETERS, PARAMETERS, LEAST_PIVOT)) {
        return false;
    }
    bst_cholesky_solve(l[0], PARAMETERS, PARAMETERS, b);
    return true;
}

/* Chi-square of the streak model; its image stays in fit->image. */
static double evaluate_streak(bst_streak_fit *fit, const bst_fit_data *data,
                              const bst_imgproc_stamp *stamp, const uint8_t *excluded,
                              const bst_imgproc_source *s) {
    size_t n = (size_t)stamp->width * (size_t)stamp->height;
    double *share = fit->image, *by_v = share + 3 * n, chi = 0.0;
    bst_imgproc_gauss_render(fit->psf, &s->shape, stamp, share, share + n, share + 2 * n, by_v);
    double noise2 = data->noise_e * data->noise_e;
    for (int j = 0; j < stamp->height; j++) {
        const float *row =
            data->signal + (size_t)(stamp->y0 + j) * (size_t)data->width + (size_t)stamp->x0;
        for (int i = 0; i < stamp->width; i++) {
            size_t k = (size_t)j * (size_t)stamp->width + (size_t)i;
            if (!excluded[k] && row[i] > BST_PIXEL_NONE) {
                double total = s->flux_e * (share[k] + s->widening_px2 * by_v[k]);
                double r = (double)row[i] - total;
                chi += r * r / (noise2 + data->excess * fmax(total, 0.0));
            }
        }
    }
    return chi;
}

/* Accumulates the normal equations at the streak evaluated last. */
static void accumulate_streak(bst_streak_fit *fit, const bst_fit_data *data,
                              const bst_imgproc_stamp *stamp, const uint8_t *excluded,
                              const bst_imgproc_source *s, normal *out) {
    size_t n = (size_t)stamp->width * (size_t)stamp->height;
    double *share = fit->image, *by_x = share + n, *by_y = by_x + n, *by_v = by_y + n;
    double *along_x = by_v + n, *along_y = along_x + n, *spare = fit->spare;
    bst_imgproc_shape moved = s->shape;
    moved.dx_px += PATH_STEP_PX;
    bst_imgproc_gauss_render(fit->psf, &moved, stamp, along_x, spare, spare + n, spare + 2 * n);
    moved = s->shape;
    moved.dy_px += PATH_STEP_PX;
    bst_imgproc_gauss_render(fit->psf, &moved, stamp, along_y, spare, spare + n, spare + 2 * n);
    memset(out, 0, sizeof *out);
    double noise2 = data->noise_e * data->noise_e;
    for (int j = 0; j < stamp->height; j++) {
        const float *row =
            data->signal + (size_t)(stamp->y0 + j) * (size_t)data->width + (size_t)stamp->x0;
        for (int i = 0; i < stamp->width; i++) {
            size_t k = (size_t)j * (size_t)stamp->width + (size_t)i;
            out->square += share[k] * share[k];
            if (excluded[k] || !(row[i] > BST_PIXEL_NONE) || share[k] + along_x[k] == 0.0) {
                continue;
            }
            double model = share[k] + s->widening_px2 * by_v[k];
            double total = s->flux_e * model;
            double weight = 1.0 / (noise2 + data->excess * fmax(total, 0.0));
            double r = (double)row[i] - total;
            double d[PARAMETERS] = {s->flux_e * by_x[k], s->flux_e * by_y[k],
                                    s->flux_e * (along_x[k] - share[k]) / PATH_STEP_PX,
                                    s->flux_e * (along_y[k] - share[k]) / PATH_STEP_PX, model};
            for (int p = 0; p < PARAMETERS; p++) {
                out->g[p] += weight * d[p] * r;
                for (int q = 0; q <= p; q++) {
                    out->a[p][q] += weight * d[p] * d[q];
                }
            }
        }
    }
    for (int p = 0; p < PARAMETERS; p++) {
        for (int q = p + 1; q < PARAMETERS; q++) {
            out->a[p][q] = out->a[q][p];
        }
    }
}

/* Limits a step component to +-limit. */
static double limited(double v, double limit) {
    return v < -limit ? -limit : v > limit ? limit : v;
}

bool bst_streak_fit_run(bst_streak_fit *fit, const bst_fit_data *data,
                        const bst_imgproc_stamp *stamp, const uint8_t *excluded,
                        bst_imgproc_source *source, double *norm) {
    assert(fit && data && stamp && source && norm);
    if (stamp->width <= 0 || stamp->height <= 0 || stamp->width > fit->max_side ||
        stamp->height > fit->max_side) {
        return false;
    }
    bst_imgproc_source best = *source;
    normal at;
    double chi = evaluate_streak(fit, data, stamp, excluded, &best);
    accumulate_streak(fit, data, stamp, excluded, &best, &at);
    double damping = 1e-3, length = hypot(best.shape.dx_px, best.shape.dy_px);
    bool settled = false;
    for (int iteration = 0; iteration < MAX_ITERATIONS && !settled; iteration++) {
        double a[PARAMETERS][PARAMETERS], step[PARAMETERS];
        memcpy(a, at.a, sizeof a);
        memcpy(step, at.g, sizeof step);
        for (int p = 0; p < PARAMETERS; p++) {
            a[p][p] *= 1.0 + damping;
        }
        if (!solve(a, step)) {
            return false;
        }
        bst_imgproc_source next = best;
        next.shape.x_px += limited(step[0], 2.0);
        next.shape.y_px += limited(step[1], 2.0);
        next.shape.dx_px += limited(step[2], 4.0);
        next.shape.dy_px += limited(step[3], 4.0);
        next.flux_e = fmax(next.flux_e + step[4], 0.2 * next.flux_e);
        double trial = evaluate_streak(fit, data, stamp, excluded, &next);
        if (!(trial <= chi + 1e-9)) {
            damping *= 10.0;
            settled = damping > 1e3;
            continue;
        }
        settled = chi - trial < SETTLED;
        damping = fmax(0.1 * damping, 1e-6);
        best = next;
        chi = trial;
        accumulate_streak(fit, data, stamp, excluded, &best, &at);
    }
    double moved =
        hypot(best.shape.x_px - source->shape.x_px, best.shape.y_px - source->shape.y_px);
    double path = hypot(best.shape.dx_px, best.shape.dy_px);
    if (!isfinite(chi) || !(best.flux_e > 0.0) || moved > 2.0 + 0.5 * length ||
        path > 1.5 * length + 6.0 || path < 0.5) {
        return false;
    }
    double column[3][PARAMETERS] = {{0}};
    static const int wanted[3] = {0, 1, 4};
    for (int c = 0; c < 3; c++) {
        column[c][wanted[c]] = 1.0;
        if (!solve(at.a, column[c])) {
            return false;
        }
    }
    if (!(column[0][0] + column[1][1] < 0.25 * (path + 4.0) * (path + 4.0))) {
        return false;
    }
    *source = best;
    source->cov_xx = column[0][0];
    source->cov_xy = column[0][1];
    source->cov_yy = column[1][1];
    source->flux_variance = column[2][4];
    source->chi_square = chi;
    source->fitted = true;
    *norm = sqrt(at.square);
    return true;
}
