#include "sim/eval/location_bound.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/symmetric.h"

enum { N = BST_BOUND_COUNT };

bst_status bst_location_bound_of(bst_ctx *ctx, const bst_location_image *image, double flux_e,
                                 const bst_eval_bound_noise *noise, bst_location_bound *out) {
    const double *share = image->share, *by_x = image->by_x, *by_y = image->by_y;
    double variance = noise->noise_e * noise->noise_e, fisher[N][N] = {{0.0}}, sharpness = 0.0;
    if (!(flux_e > 0.0 && variance > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a bound needs flux and noise above 0 (flux %g e-, noise %g e-)", flux_e,
                        noise->noise_e);
    }
    for (int p = 0; p < image->count; p++) {
        double slope[N] = {flux_e * by_x[p], flux_e * by_y[p], share[p], 1.0};
        double v = variance + (noise->own_shot_noise ? fmax(flux_e * share[p], 0.0) : 0.0);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j <= i; j++) {
                fisher[i][j] += slope[i] * slope[j] / v;
            }
        }
        sharpness += share[p] * share[p];
    }
    if (!bst_symmetric_invert(N, fisher[0], out->covariance[0])) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "%d pixels do not determine place, flux and background", image->count);
    }
    out->snr = flux_e * sqrt(sharpness / variance);
    return BST_OK;
}

void bst_location_bound_along(const bst_location_bound *bound, double dx, double dy,
                              double out[2]) {
    double length = hypot(dx, dy), c = length > 0.0 ? dx / length : 1.0,
           s = length > 0.0 ? dy / length : 0.0;
    double xx = bound->covariance[BST_BOUND_X][BST_BOUND_X],
           xy = bound->covariance[BST_BOUND_X][BST_BOUND_Y],
           yy = bound->covariance[BST_BOUND_Y][BST_BOUND_Y];
    out[0] = c * c * xx + 2.0 * c * s * xy + s * s * yy;
    out[1] = s * s * xx - 2.0 * c * s * xy + c * c * yy;
}

/* Gaussian image and its derivatives on a rectangle of pixels; by_x, by_y NULL: not computed. */
typedef struct image {
    int x0, y0, width, height, pixels;
    double *share, *by_x, *by_y;         /* [height][width] */
    double *row_share, *row_slope;       /* [width], of one quadrature node */
    double *column_share, *column_slope; /* [height] */
    double *memory;
} image;

/* Fractions of a 1-D Gaussian at `centre` in pixels 0 .. count-1, and their derivatives with
 * respect to the centre. Pixels beyond 8.3 sigma are omitted: below 1e-16. */
static void profile(double centre, double sigma, int count, double *share, double *slope,
                    int *first, int *last) {
    double reach = 8.3 * sigma;
    *first = (int)fmax(0.0, floor(centre - reach + 0.5));
    *last = (int)fmin(count - 1.0, floor(centre + reach + 0.5));
    double scale = 1.0 / (sigma * sqrt(2.0)), peak = 1.0 / (sigma * sqrt(2.0 * BST_PI));
    double t = (*first - 0.5 - centre) * scale;
    double step = erf(t), bell = exp(-t * t);
    for (int i = *first; i <= *last; i++) {
        t = (i + 0.5 - centre) * scale;
        double next = erf(t), next_bell = exp(-t * t);
        share[i] = 0.5 * (next - step);
        slope[i] = peak * (bell - next_bell);
        step = next;
        bell = next_bell;
    }
}

/* Adds a Gaussian at one node of the streak to the image. */
static void add_node(image *m, double x, double y, double sigma, double weight) {
    int x1, x2, y1, y2;
    profile(x - m->x0, sigma, m->width, m->row_share, m->row_slope, &x1, &x2);
    profile(y - m->y0, sigma, m->height, m->column_share, m->column_slope, &y1, &y2);
    for (int j = y1; j <= y2; j++) {
        double s = weight * m->column_share[j], d = weight * m->column_slope[j];
        size_t row = (size_t)j * (size_t)m->width;
        for (int i = x1; i <= x2; i++) {
            m->share[row + (size_t)i] += s * m->row_share[i];
        }
        for (int i = x1; i <= x2 && m->by_x; i++) {
            m->by_x[row + (size_t)i] += s * m->row_slope[i];
            m->by_y[row + (size_t)i] += d * m->row_share[i];
        }
    }
}

/* Six-point Gauss-Legendre rule on [-1/2, 1/2] (Abramowitz and Stegun, table 25.4). */
static const double gauss_node[3] = {0.5 * 0.238619186083197, 0.5 * 0.661209386466265,
                                     0.5 * 0.932469514203152};
static const double gauss_weight[3] = {0.5 * 0.467913934572691, 0.5 * 0.360761573048139,
                                       0.5 * 0.171324492379170};

/* Integrates the Gaussian along the streak by Gauss-Legendre quadrature. */
static void integrate_streak(image *m, const bst_eval_bound_source *s) {
    double length = hypot(s->dx_px, s->dy_px) / s->sigma_px;
    if (length == 0.0) {
        add_node(m, s->x_px, s->y_px, s->sigma_px, 1.0);
        return;
    }
    int parts = (int)ceil(length / 1.5);
    for (int p = 0; p < parts; p++) {
        for (int k = 0; k < 6; k++) {
            double u = k < 3 ? -gauss_node[2 - k] : gauss_node[k - 3];
            double at = (p + 0.5 + u) / parts - 0.5; /* position on the path, -1/2 to 1/2 */
            add_node(m, s->x_px + at * s->dx_px, s->y_px + at * s->dy_px, s->sigma_px,
                     gauss_weight[k < 3 ? 2 - k : k - 3] / parts);
        }
    }
}

static bst_status open_image(bst_ctx *ctx, const bst_eval_bound_source *s, double margin_px,
                             image *out) {
    double half_x = 0.5 * fabs(s->dx_px) + margin_px, half_y = 0.5 * fabs(s->dy_px) + margin_px;
    if (!(s->sigma_px >= 0.01 && s->sigma_px <= 1000.0 && margin_px >= 0.0 && fabs(s->x_px) < 1e8 &&
          fabs(s->y_px) < 1e8 && (2.0 * half_x + 1.0) * (2.0 * half_y + 1.0) <= 1e7)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "no bound for a PSF of sigma %g px, streak (%g, %g) px, margin %g px: "
                        "sigma must be 0.01 to 1000 px and the region at most 1e7 pixels",
                        s->sigma_px, s->dx_px, s->dy_px, margin_px);
    }
    image m = {.x0 = (int)ceil(s->x_px - half_x), .y0 = (int)ceil(s->y_px - half_y)};
    m.width = (int)floor(s->x_px + half_x) - m.x0 + 1;
    m.height = (int)floor(s->y_px + half_y) - m.y0 + 1;
    m.pixels = m.width * m.height;
    size_t n = (size_t)m.pixels;
    m.memory = calloc(3 * n + 2 * (size_t)(m.width + m.height), sizeof *m.memory);
    if (!m.memory) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a bound on %d pixels", m.pixels);
    }
    m.share = m.memory;
    m.by_x = m.share + n;
    m.by_y = m.by_x + n;
    m.row_share = m.by_y + n;
    m.row_slope = m.row_share + m.width;
    m.column_share = m.row_slope + m.width;
    m.column_slope = m.column_share + m.height;
    *out = m;
    return BST_OK;
}

bst_status bst_location_bound_gaussian(bst_ctx *ctx, const bst_eval_bound_source *source,
                                       const bst_eval_bound_noise *noise, double margin_px,
                                       bst_location_bound *out) {
    image m = {.pixels = 0};
    BST_TRY(open_image(ctx, source, margin_px, &m));
    integrate_streak(&m, source);
    const bst_location_image shares = {m.share, m.by_x, m.by_y, m.pixels};
    bst_status status = bst_location_bound_of(ctx, &shares, source->flux_e, noise, out);
    free(m.memory);
    return status;
}

bst_status bst_eval_gaussian_powers(bst_ctx *ctx, const bst_eval_bound_source *source,
                                    double out[2]) {
    image m = {.pixels = 0};
    BST_TRY(open_image(ctx, source, 8.3 * source->sigma_px + 1.0, &m));
    integrate_streak(&m, source);
    out[0] = out[1] = 0.0;
    for (int p = 0; p < m.pixels; p++) {
        double square = m.share[p] * m.share[p];
        out[0] += square;
        out[1] += square * m.share[p];
    }
    free(m.memory);
    return BST_OK;
}

void bst_eval_gaussian_shares(const bst_eval_bound_source *source, const bst_eval_region *r,
                              double *share) {
    image m = {.x0 = r->x0,
               .y0 = r->y0,
               .width = r->width,
               .height = r->height,
               .pixels = r->width * r->height,
               .share = share,
               .row_share = r->work,
               .row_slope = r->work + r->width,
               .column_share = r->work + 2 * (size_t)r->width,
               .column_slope = r->work + 2 * (size_t)r->width + r->height};
    memset(share, 0, (size_t)m.pixels * sizeof *share);
    integrate_streak(&m, source);
}
