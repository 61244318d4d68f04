#include "imgproc/fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/background.h"

enum { MAX_ITERATIONS = 15 };

bst_status bst_fit_create(bst_ctx *ctx, const bst_psf *psf, int max_side, bst_fit *out) {
    size_t pixels = (size_t)max_side * (size_t)max_side;
    *out = (bst_fit){.psf = psf, .max_pixels = (int)pixels};
    out->value = calloc(pixels, sizeof(double));
    out->fixed = calloc(pixels, sizeof(double));
    out->valid = calloc(pixels, sizeof(double));
    out->model = calloc(pixels * 4 * BST_FIT_MAX_FREE, sizeof(double));
    if (!out->value || !out->fixed || !out->valid || !out->model) {
        bst_fit_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a fit on %zu pixels", pixels);
    }
    return BST_OK;
}

void bst_fit_free(bst_fit *fit) {
    free(fit->value);
    free(fit->fixed);
    free(fit->valid);
    free(fit->model);
    *fit = (bst_fit){0};
}

bst_stamp bst_fit_stamp(const bst_source *source, double reach_px, int max_side, int width,
                        int height) {
    const bst_shape *s = &source->shape;
    double limit = 0.5 * (max_side - 2);
    double rx = fmin(0.5 * fabs(s->dx_px) + fabs(s->bend_x_px) + reach_px, limit);
    double ry = fmin(0.5 * fabs(s->dy_px) + fabs(s->bend_y_px) + reach_px, limit);
    int x0 = (int)fmax(floor(s->x_px - rx + 0.5), 0.0);
    int y0 = (int)fmax(floor(s->y_px - ry + 0.5), 0.0);
    int x1 = (int)fmin(floor(s->x_px + rx + 0.5), width - 1.0);
    int y1 = (int)fmin(floor(s->y_px + ry + 0.5), height - 1.0);
    return (bst_stamp){x0, y0, x1 >= x0 ? x1 - x0 + 1 : 0, y1 >= y0 ? y1 - y0 + 1 : 0};
}

/* Renders a source into slot k of the work space. */
static double *render(const bst_fit *fit, const bst_stamp *stamp, const bst_source *source, int k) {
    size_t n = (size_t)stamp->width * (size_t)stamp->height;
    double *m = fit->model + (size_t)k * 4 * n;
    bst_psf_render(fit->psf, &source->shape, stamp, m, m + n, m + 2 * n, m + 3 * n);
    return m;
}

/* Loads pixels and the fixed sources' light; returns the number of pixels that count. */
static int load(bst_fit *fit, const bst_fit_data *data, const bst_stamp *stamp,
                const bst_source *const *fixed, int fixed_count) {
    int n = stamp->width * stamp->height, valid = 0;
    memset(fit->fixed, 0, (size_t)n * sizeof(double));
    for (int s = 0; s < fixed_count; s++) {
        const double *m = render(fit, stamp, fixed[s], 0), *v = m + 3 * (size_t)n;
        for (int i = 0; i < n; i++) {
            fit->fixed[i] += fixed[s]->flux_e * (m[i] + fixed[s]->widening_px2 * v[i]);
        }
    }
    for (int j = 0; j < stamp->height; j++) {
        const float *row =
            data->signal + (size_t)(stamp->y0 + j) * (size_t)data->width + (size_t)stamp->x0;
        for (int i = 0; i < stamp->width; i++) {
            int k = j * stamp->width + i;
            bool use = row[i] > BST_PIXEL_NONE;
            fit->valid[k] = use ? 1.0 : 0.0;
            fit->value[k] = use ? (double)row[i] : 0.0;
            valid += use;
        }
    }
    return valid;
}

/* Lower Cholesky factor in place; false when not positive definite. */
static bool factor(double a[][BST_FIT_MAX_PARAMETERS], int n) {
    for (int j = 0; j < n; j++) {
        double original = a[j][j], d = original;
        for (int k = 0; k < j; k++) {
            d -= a[j][k] * a[j][k];
        }
        if (!(d > 1e-11 * original) || !(original < 1e280)) {
            return false;
        }
        a[j][j] = sqrt(d);
        for (int i = j + 1; i < n; i++) {
            double s = a[i][j];
            for (int k = 0; k < j; k++) {
                s -= a[i][k] * a[j][k];
            }
            a[i][j] = s / a[j][j];
        }
    }
    return true;
}

static void solve(double l[][BST_FIT_MAX_PARAMETERS], int n, double *b) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) {
            b[i] -= l[i][k] * b[k];
        }
        b[i] /= l[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) {
            b[i] -= l[k][i] * b[k];
        }
        b[i] /= l[i][i];
    }
}

/* Normal equations at the current sources. Parameters: x, y, flux of each, then the product of flux
 * and widening of the first. Returns chi-square. */
static double accumulate(bst_fit *fit, const bst_fit_data *data, const bst_stamp *stamp,
                         bst_source *const *free, int count, bool free_width,
                         double a[][BST_FIT_MAX_PARAMETERS], double *g) {
    int n = stamp->width * stamp->height, parameters = 3 * count + (free_width ? 1 : 0);
    for (int s = 0; s < count; s++) {
        render(fit, stamp, free[s], s);
    }
    for (int p = 0; p < parameters; p++) {
        g[p] = 0.0;
        for (int q = 0; q <= p; q++) {
            a[p][q] = 0.0;
        }
    }
    double noise2 = data->noise_e * data->noise_e, chi = 0.0;
    for (int i = 0; i < n; i++) {
        double j[BST_FIT_MAX_PARAMETERS], total = fit->fixed[i];
        for (int s = 0; s < count; s++) {
            const double *m = fit->model + (size_t)s * 4 * (size_t)n + (size_t)i;
            double share = m[0] + free[s]->widening_px2 * m[3 * (size_t)n];
            total += free[s]->flux_e * share;
            j[3 * s] = free[s]->flux_e * m[(size_t)n];
            j[3 * s + 1] = free[s]->flux_e * m[2 * (size_t)n];
            j[3 * s + 2] = share;
            if (s == 0 && free_width) {
                j[2] = m[0];
                j[3 * count] = m[3 * (size_t)n];
            }
        }
        double weight = fit->valid[i] / (noise2 + fmax(total, 0.0));
        double r = fit->value[i] - total;
        chi += weight * r * r;
        for (int p = 0; p < parameters; p++) {
            double wj = weight * j[p];
            g[p] += wj * r;
            for (int q = 0; q <= p; q++) {
                a[p][q] += wj * j[q];
            }
        }
    }
    return chi;
}

static double clamp(double v, double lo, double hi) {
    return v < lo ? lo : v > hi ? hi : v;
}

bool bst_fit_run(bst_fit *fit, const bst_fit_data *data, const bst_stamp *stamp,
                 bst_source *const *free, int free_count, const bst_source *const *fixed,
                 int fixed_count, bool free_width, double limit_px) {
    int n = stamp->width * stamp->height, parameters = 3 * free_count + (free_width ? 1 : 0);
    if (n <= 0 || n > fit->max_pixels || free_count < 1 || free_count > BST_FIT_MAX_FREE) {
        return false;
    }
    int pixels = load(fit, data, stamp, fixed, fixed_count);
    if (pixels < parameters + 1) {
        return false;
    }
    double a[BST_FIT_MAX_PARAMETERS][BST_FIT_MAX_PARAMETERS], g[BST_FIT_MAX_PARAMETERS];
    bst_source start[BST_FIT_MAX_FREE];
    for (int s = 0; s < free_count; s++) {
        start[s] = *free[s];
    }
    bool good = true, settled = false;
    double chi = 0.0;
    double widest = 0.6 * free[0]->shape.sigma_px * free[0]->shape.sigma_px;
    /* a streak's ends tell of a shift only as far as the PSF reaches: it is found step by step */
    double path = hypot(free[0]->shape.dx_px, free[0]->shape.dy_px);
    int iterations = MAX_ITERATIONS + (int)fmin(path, BST_PSF_MAX_SIDE);
    for (int iteration = 0; iteration < iterations && good && !settled; iteration++) {
        chi = accumulate(fit, data, stamp, free, free_count, free_width, a, g);
        good = factor(a, parameters);
        if (!good) {
            break;
        }
        double gradient[BST_FIT_MAX_PARAMETERS];
        memcpy(gradient, g, sizeof gradient);
        solve(a, parameters, g);
        double gain = 0.0;
        for (int k = 0; k < parameters; k++) {
            gain += gradient[k] * g[k];
        }
        settled = iteration > 0;
        for (int s = 0; s < free_count; s++) {
            const double *step = g + 3 * s;
            bst_source *f = free[s];
            double x = clamp(f->shape.x_px + clamp(step[0], -0.7, 0.7),
                             start[s].shape.x_px - limit_px, start[s].shape.x_px + limit_px);
            double y = clamp(f->shape.y_px + clamp(step[1], -0.7, 0.7),
                             start[s].shape.y_px - limit_px, start[s].shape.y_px + limit_px);
            /* a hundredth of the standard deviation that the diagonal promises, at least 1e-5 px; a
             * tenth for the neighbours, whose values are not kept */
            double share = s == 0 ? 0.01 : 0.1;
            double slack_x = fmax(1e-5, share / a[3 * s][3 * s]);
            double slack_y = fmax(1e-5, share / a[3 * s + 1][3 * s + 1]);
            settled =
                settled && fabs(x - f->shape.x_px) < slack_x && fabs(y - f->shape.y_px) < slack_y;
            double product = f->flux_e * f->widening_px2;
            double flux = f->flux_e + step[2];
            flux = flux > 0.1 * f->flux_e ? flux : 0.1 * f->flux_e;
            settled = settled && fabs(flux - f->flux_e) < share / a[3 * s + 2][3 * s + 2];
            f->shape.x_px = x;
            f->shape.y_px = y;
            f->flux_e = flux;
            if (s == 0 && free_width) {
                product += g[3 * free_count];
                f->widening_px2 = clamp(product / flux, -widest, 3.0 * widest);
            }
        }
        chi -= settled ? gain : 0.0; /* what so small a step still brings */
    }
    if (good && !settled) {
        /* the covariance belongs to the place where the fit ended */
        chi = accumulate(fit, data, stamp, free, free_count, free_width, a, g);
        good = factor(a, parameters);
    }
    for (int s = 0; s < free_count; s++) {
        good = good && isfinite(free[s]->shape.x_px) && isfinite(free[s]->shape.y_px) &&
               isfinite(free[s]->flux_e) && free[s]->flux_e > 0.0;
    }
    if (!good) {
        for (int s = 0; s < free_count; s++) {
            *free[s] = start[s];
        }
        return false;
    }
    double column[3][BST_FIT_MAX_PARAMETERS];
    for (int c = 0; c < 3; c++) {
        memset(column[c], 0, sizeof column[c]);
        column[c][c] = 1.0;
        solve(a, parameters, column[c]);
    }
    free[0]->cov_xx = column[0][0];
    free[0]->cov_xy = column[0][1];
    free[0]->cov_yy = column[1][1];
    free[0]->flux_variance = column[2][2];
    if (free_width) {
        double last[BST_FIT_MAX_PARAMETERS] = {0};
        last[parameters - 1] = 1.0;
        solve(a, parameters, last);
        free[0]->widening_variance = last[parameters - 1] / (free[0]->flux_e * free[0]->flux_e);
    }
    free[0]->chi_square = chi;
    free[0]->pixels = pixels;
    free[0]->fitted = true;
    return true;
}

double bst_fit_norm(const bst_fit *fit, const bst_stamp *stamp) {
    double sum = 0.0;
    for (int i = 0; i < stamp->width * stamp->height; i++) {
        sum += fit->model[i] * fit->model[i];
    }
    return sqrt(sum);
}

bool bst_fit_moments(bst_fit *fit, const bst_fit_data *data, const bst_stamp *stamp,
                     const bst_source *source, const bst_source *const *fixed, int fixed_count,
                     double out[3]) {
    int n = stamp->width * stamp->height;
    if (n <= 0 || n > fit->max_pixels || load(fit, data, stamp, fixed, fixed_count) < n) {
        return false;
    }
    const bst_shape *s = &source->shape;
    double base = s->sigma_px * s->sigma_px + fmax(source->widening_px2, 0.0) + 1.0 / 12.0;
    double path[3];
    bst_shape_path_variance(s, path);
    double wxx = 2.0 * (base + path[0]), wxy = 2.0 * path[1], wyy = 2.0 * (base + path[2]);
    double det = wxx * wyy - wxy * wxy;
    double ixx = wyy / det, iyy = wxx / det, ixy = -wxy / det;
    double sum = 0.0, mxx = 0.0, mxy = 0.0, myy = 0.0;
    for (int j = 0; j < stamp->height; j++) {
        double y = stamp->y0 + j - s->y_px;
        for (int i = 0; i < stamp->width; i++) {
            double x = stamp->x0 + i - s->x_px;
            double q = ixx * x * x + 2.0 * ixy * x * y + iyy * y * y;
            int k = j * stamp->width + i;
            double v = exp(-0.5 * q) * (fit->value[k] - fit->fixed[k]);
            sum += v;
            mxx += v * x * x;
            mxy += v * x * y;
            myy += v * y * y;
        }
    }
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
    /* a Gaussian under a Gaussian window: inverse covariances add */
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
