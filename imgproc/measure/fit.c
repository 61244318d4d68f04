#include "imgproc/measure/fit.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/background.h"
#include "sim/core/cholesky.h"
#include "sim/core/pages.h"

enum { MAX_ITERATIONS = 15, MAX_SUMS = BST_FIT_MAX_PARAMETERS * (BST_FIT_MAX_PARAMETERS + 3) / 2 };

/* convergence: step below this share of the standard deviation, and a larger share for neighbours,
 * whose results are not kept */
/* least pivot of the Cholesky factorisation, relative to its diagonal element */
static const double LEAST_PIVOT = 1e-11;
static const double SETTLED = 0.03, NEIGHBOUR_SETTLED = 0.1;
/* Design choices that keep Gauss-Newton where its linear model holds: largest step, px, about a
 * sigma of the narrowest PSF; least flux after a step, share of that before; limits of the widening
 * relative to the PSF's variance, for images of 0.63 to 1.7 times its width. */
static const double MOST_STEP_PX = 0.7, LEAST_FLUX = 0.1, LEAST_WIDENING = -0.6,
                    MOST_WIDENING = 1.8;

bst_status bst_fit_create(bst_ctx *ctx, const bst_imgproc_gauss *psf,
                          const bst_source_profiles *profiles, int max_side, bst_fit *out) {
    assert(psf && profiles && out && max_side > 0);
    size_t plane = (size_t)max_side * (size_t)bst_simd_layout_round_up(max_side);
    *out = (bst_fit){.psf = psf, .profiles = profiles, .max_side = max_side};
    out->value = bst_pages_zero(plane, sizeof(float));
    out->fixed = bst_pages_zero(plane, sizeof(float));
    out->valid = bst_pages_zero(plane, sizeof(float));
    out->model = bst_pages_zero(plane * 4 * BST_FIT_MAX_FREE, sizeof(float));
    out->scratch = bst_pages_zero(bst_source_profile_scratch(max_side), sizeof(float));
    if (!out->value || !out->fixed || !out->valid || !out->model || !out->scratch) {
        bst_fit_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a fit on %d x %d pixels", max_side,
                        max_side);
    }
    return BST_OK;
}

void bst_fit_free(bst_fit *fit) {
    bst_pages_free(fit->value);
    bst_pages_free(fit->fixed);
    bst_pages_free(fit->valid);
    bst_pages_free(fit->model);
    bst_pages_free(fit->scratch);
    *fit = (bst_fit){0};
}

bst_imgproc_stamp bst_fit_stamp(const bst_imgproc_source *source, double reach_px, int max_side,
                                int width, int height) {
    assert(source && reach_px > 0.0 && max_side > 0 && width > 0 && height > 0);
    const bst_imgproc_shape *s = &source->shape;
    double limit = 0.5 * (max_side - 2);
    double half_x, half_y;
    bst_imgproc_shape_reach(s, &half_x, &half_y);
    double rx = fmin(half_x + reach_px, limit), ry = fmin(half_y + reach_px, limit);
    int x0 = (int)fmax(floor(s->x_px - rx + 0.5), 0.0);
    int y0 = (int)fmax(floor(s->y_px - ry + 0.5), 0.0);
    int x1 = (int)fmin(floor(s->x_px + rx + 0.5), width - 1.0);
    int y1 = (int)fmin(floor(s->y_px + ry + 0.5), height - 1.0);
    return (bst_imgproc_stamp){x0, y0, x1 >= x0 ? x1 - x0 + 1 : 0, y1 >= y0 ? y1 - y0 + 1 : 0};
}

static int plane_of(const bst_imgproc_stamp *stamp) {
    return bst_simd_layout_round_up(stamp->width) * stamp->height;
}

/* True if a stamp fits into the work space. */
static bool fits_in(const bst_fit *fit, const bst_imgproc_stamp *stamp) {
    return stamp->width > 0 && stamp->height > 0 && stamp->width <= fit->max_side &&
           stamp->height <= fit->max_side;
}

/* Renders source k of the fit on the stamp into the work space. */
static float *render(const bst_fit *fit, const bst_imgproc_stamp *stamp,
                     const bst_imgproc_source *source, int k) {
    float *m = fit->model + (size_t)k * 4 * (size_t)plane_of(stamp);
    bst_source_profile_render(fit->profiles, fit->psf, &source->shape, stamp, fit->scratch, m);
    return m;
}

/* Image planes from which the normal equations are accumulated. */
typedef struct terms {
    const float *value, *fixed, *valid;
    /* derivatives by x, by y and by variance follow at n, 2 n, 3 n */
    const float *model[BST_FIT_MAX_FREE];
    float flux[BST_FIT_MAX_FREE], widening[BST_FIT_MAX_FREE];
    int n;
    float noise2;
} terms;

#define BST_SIMD_KERNELS "imgproc/measure/fit_kernels.inc"
#include "sim/core/simd_each.inc"

/* Loads the stamp's pixels and the light of the fixed sources; returns the number of usable pixels.
 */
static int load_stamp(bst_fit *fit, const bst_fit_data *data, const bst_imgproc_stamp *stamp,
                      const bst_imgproc_source *const *fixed, int fixed_count) {
    int n = plane_of(stamp);
    memset(fit->fixed, 0, (size_t)n * sizeof(float));
    for (int s = 0; s < fixed_count; s++) {
        const float *m = render(fit, stamp, fixed[s], 0);
        BST_SIMD_PICK(add_light)
        (fit->fixed, m, n, (float)fixed[s]->flux_e, (float)fixed[s]->widening_px2);
    }
    return BST_SIMD_PICK(load_pixels)(fit, data, stamp);
}

/* Normal equations of the source fit. Parameters: x, y, flux of each source, then flux times
 * widening of the first (only if it is fitted alone). */
typedef struct equations {
    bool free_width;
    int parameters;
    double a[BST_FIT_MAX_PARAMETERS][BST_FIT_MAX_PARAMETERS]; /* matrix or its Cholesky factor */
    double g[BST_FIT_MAX_PARAMETERS];                         /* right-hand side or step */
} equations;

/* Accumulates the normal equations at the current sources; returns chi-square. */
static double accumulate(bst_fit *fit, const bst_fit_request *r, equations *e) {
    const bst_imgproc_stamp *stamp = r->stamp;
    const int count = r->free_count;
    terms t = {.value = fit->value,
               .fixed = fit->fixed,
               .valid = fit->valid,
               .n = plane_of(stamp),
               .noise2 = (float)(r->data->noise_e * r->data->noise_e / r->data->excess)};
    for (int s = 0; s < count; s++) {
        t.model[s] = render(fit, stamp, r->free[s], s);
        t.flux[s] = (float)r->free[s]->flux_e;
        t.widening[s] = (float)r->free[s]->widening_px2;
    }
    float sums[(MAX_SUMS + 1) * BST_LANES];
    BST_SIMD_PICK(sum_terms)(&t, count, e->free_width, sums);
    const float *at = sums;
    /* the kernels weight by 1 / (noise2 + m): excess times the weight */
    const double scale = 1.0 / r->data->excess;
    for (int p = 0; p < e->parameters; p++) {
        for (int q = 0; q <= p; q++, at += BST_LANES) {
            e->a[p][q] = scale * bst_simd_layout_sum(at);
        }
        e->g[p] = scale * bst_simd_layout_sum(at);
        at += BST_LANES;
    }
    return scale * bst_simd_layout_sum(at);
}

static double clamp(double v, double lo, double hi) {
    return v < lo ? lo : v > hi ? hi : v;
}

/* Cholesky factorisation of the normal matrix; false if it is not positive definite. */
static bool factor(equations *e) {
    return bst_cholesky_factor(e->a[0], BST_FIT_MAX_PARAMETERS, e->parameters, LEAST_PIVOT);
}

/* Solves the normal equations with the Cholesky factor. */
static void solve(const equations *e, double *x) {
    bst_cholesky_solve(e->a[0], BST_FIT_MAX_PARAMETERS, e->parameters, x);
}

/* Moves the sources by the step in e->g, at most limit_px from their start. Returns true if the
 * step is below the convergence limit. */
static bool apply_step(const bst_fit_request *r, const equations *e,
                       const bst_imgproc_source *start) {
    const double limit_px = r->limit_px;
    bool settled = true;
    for (int s = 0; s < r->free_count; s++) {
        const double *step = e->g + 3 * s;
        bst_imgproc_source *f = r->free[s];
        double x = clamp(f->shape.x_px + clamp(step[0], -MOST_STEP_PX, MOST_STEP_PX),
                         start[s].shape.x_px - limit_px, start[s].shape.x_px + limit_px);
        double y = clamp(f->shape.y_px + clamp(step[1], -MOST_STEP_PX, MOST_STEP_PX),
                         start[s].shape.y_px - limit_px, start[s].shape.y_px + limit_px);
        /* share of the standard deviation from the diagonal, at least 1e-5 px */
        double share = s == 0 ? SETTLED : NEIGHBOUR_SETTLED;
        double slack_x = fmax(1e-5, share / e->a[3 * s][3 * s]);
        double slack_y = fmax(1e-5, share / e->a[3 * s + 1][3 * s + 1]);
        settled = settled && fabs(x - f->shape.x_px) < slack_x && fabs(y - f->shape.y_px) < slack_y;
        double product = f->flux_e * f->widening_px2;
        double flux = f->flux_e + step[2];
        flux = fmax(flux, LEAST_FLUX * f->flux_e);
        settled = settled && fabs(flux - f->flux_e) < share / e->a[3 * s + 2][3 * s + 2];
        f->shape.x_px = x;
        f->shape.y_px = y;
        f->flux_e = flux;
        if (s == 0 && e->free_width) {
            product += e->g[3 * r->free_count];
            double variance = f->shape.sigma_px * f->shape.sigma_px;
            f->widening_px2 =
                clamp(product / flux, LEAST_WIDENING * variance, MOST_WIDENING * variance);
        }
    }
    return settled;
}

/* Gauss-Newton iterations until convergence; leaves the factorised matrix. Returns false if the
 * pixels do not determine the parameters. */
static bool gauss_newton(bst_fit *fit, const bst_fit_request *r, equations *e,
                         const bst_imgproc_source *start, double *chi) {
    /* a streak's ends constrain a shift only within the PSF's width, so that long streaks need more
     * steps */
    double path = hypot(r->free[0]->shape.dx_px, r->free[0]->shape.dy_px);
    int iterations = MAX_ITERATIONS + (int)fmin(path, BST_PSF_MAX_SIDE);
    bool settled = false;
    for (int iteration = 0; iteration < iterations && !settled; iteration++) {
        *chi = accumulate(fit, r, e);
        if (!factor(e)) {
            return false;
        }
        double gradient[BST_FIT_MAX_PARAMETERS];
        memcpy(gradient, e->g, sizeof gradient);
        solve(e, e->g);
        double gain = 0.0;
        for (int k = 0; k < e->parameters; k++) {
            gain += gradient[k] * e->g[k];
        }
        settled = apply_step(r, e, start) && iteration > 0;
        *chi -= settled ? gain : 0.0; /* predicted gain of the last small step */
    }
    if (settled) {
        return true;
    }
    /* the covariance is that of the final position */
    *chi = accumulate(fit, r, e);
    return factor(e);
}

/* Covariance of the first source, from the inverse of the normal matrix. */
static void set_errors(const equations *e, bst_imgproc_source *out) {
    double column[3][BST_FIT_MAX_PARAMETERS];
    for (int c = 0; c < 3; c++) {
        memset(column[c], 0, sizeof column[c]);
        column[c][c] = 1.0;
        solve(e, column[c]);
    }
    out->cov_xx = column[0][0];
    out->cov_xy = column[0][1];
    out->cov_yy = column[1][1];
    out->flux_variance = column[2][2];
    if (e->free_width) {
        double last[BST_FIT_MAX_PARAMETERS] = {0};
        last[e->parameters - 1] = 1.0;
        solve(e, last);
        out->widening_variance = last[e->parameters - 1] / (out->flux_e * out->flux_e);
    }
}

bool bst_fit_run(bst_fit *fit, const bst_fit_request *r) {
    assert(fit && r && r->data && r->stamp && r->free);
    assert(r->free_count >= 1 && r->free_count <= BST_FIT_MAX_FREE && r->fixed_count >= 0);
    equations e;
    e.free_width = r->free_width && r->free_count == 1;
    e.parameters = 3 * r->free_count + (e.free_width ? 1 : 0);
    if (!fits_in(fit, r->stamp) || r->free_count < 1 || r->free_count > BST_FIT_MAX_FREE) {
        return false;
    }
    int pixels = load_stamp(fit, r->data, r->stamp, r->fixed, r->fixed_count);
    if (pixels < e.parameters + 1) {
        return false;
    }
    bst_imgproc_source start[BST_FIT_MAX_FREE];
    for (int s = 0; s < r->free_count; s++) {
        start[s] = *r->free[s];
    }
    double chi = 0.0;
    bool good = gauss_newton(fit, r, &e, start, &chi);
    for (int s = 0; s < r->free_count; s++) {
        const bst_imgproc_source *f = r->free[s];
        good = good && isfinite(f->shape.x_px) && isfinite(f->shape.y_px) && isfinite(f->flux_e) &&
               f->flux_e > 0.0;
    }
    if (!good) {
        for (int s = 0; s < r->free_count; s++) {
            *r->free[s] = start[s];
        }
        return false;
    }
    set_errors(&e, r->free[0]);
    r->free[0]->chi_square = chi;
    r->free[0]->pixels = pixels;
    r->free[0]->fitted = true;
    return true;
}

double bst_fit_norm(const bst_fit *fit, const bst_imgproc_stamp *stamp) {
    double sum = 0.0;
    int stride = bst_simd_layout_round_up(stamp->width);
    for (int j = 0; j < stamp->height; j++) {
        for (int i = 0; i < stamp->width; i++) {
            double m = (double)fit->model[j * stride + i];
            sum += m * m;
        }
    }
    return sqrt(sum);
}

bool bst_fit_moments(bst_fit *fit, const bst_fit_data *data, const bst_imgproc_stamp *stamp,
                     const bst_imgproc_source *source, const bst_imgproc_source *const *fixed,
                     int fixed_count, double out[3]) {
    if (!fits_in(fit, stamp) ||
        load_stamp(fit, data, stamp, fixed, fixed_count) < stamp->width * stamp->height) {
        return false;
    }
    const bst_imgproc_shape *s = &source->shape;
    double base = s->sigma_px * s->sigma_px + fmax(source->widening_px2, 0.0) + 1.0 / 12.0;
    double path[3];
    bst_imgproc_shape_path_variance(s, path);
    double wxx = 2.0 * (base + path[0]), wxy = 2.0 * path[1], wyy = 2.0 * (base + path[2]);
    double det = wxx * wyy - wxy * wxy;
    double ixx = wyy / det, iyy = wxx / det, ixy = -wxy / det;
    float sums[4 * BST_LANES];
    BST_SIMD_PICK(sum_moments)
    (fit, stamp, (const double[2]){s->x_px - stamp->x0, s->y_px - stamp->y0},
     (const double[3]){ixx, ixy, iyy}, sums);
    double sum = bst_simd_layout_sum(sums), mxx = bst_simd_layout_sum(sums + BST_LANES);
    double mxy = bst_simd_layout_sum(sums + 2 * BST_LANES),
           myy = bst_simd_layout_sum(sums + 3 * BST_LANES);
    if (!(sum > 0.0)) {
        return false;
    }
    mxx /= sum;
    mxy /= sum;
    myy /= sum;
    double m = mxx * myy - mxy * mxy;
    if (!(mxx > 0.0 && myy > 0.0 && m > 0.0)) {
        return false;
    }
    /* for a Gaussian under a Gaussian window, inverse covariances add */
    double cxx = myy / m - ixx, cyy = mxx / m - iyy, cxy = -mxy / m - ixy;
    double c = cxx * cyy - cxy * cxy;
    if (!(cxx > 0.0 && cyy > 0.0 && c > 1e-6)) {
        return false;
    }
    out[0] = cyy / c;
    out[1] = -cxy / c;
    out[2] = cxx / c;
    return true;
}
