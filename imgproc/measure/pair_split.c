#include "imgproc/measure/pair_split.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "imgproc/detect/background.h"
#include "sim/core/chi_square.h"
#include "sim/core/cholesky.h"

/* The test by second derivatives, taken as differences between pixels, finds at least this share of
 * the gain of a pair (tests/imgproc/pair_resolution.c). */
static const double FOUND_SHARE = 0.4;
/* Shares of the light in the fainter source from which the fit starts: equal and 4:1. */
static const double START_SHARE[3] = {0.5, 0.2, 0.8};
/* A pair farther apart than NEAR_FWHM needs more gain: noise anywhere on the stamp, of some 16
 * places, may be its second source; exp(-5.5 / 2) is 1/16.
 * On a streak of known motion it may be anywhere along the path: 1/2. */
static const double NEAR_FWHM = 1.0, ELSEWHERE = 5.5, ON_PATH = 1.4;
/* A streak of unknown rate is preferred to a pair if its chi-square is lower by this: a likelihood
 * ratio of exp(2) = 7, a design choice. Fainter ones cannot be separated
 * (tests/imgproc/pair_resolution.c, `moving`). */
static const double STREAK_LEAD = 4.0;
/* SNR of the sources of which widths are taken, above the one from which widths are fitted
 * (imgproc/measure/locate.c). It is that of the matched filter's peak: an estimate of the light
 * with the width given, whose noise is uncorrelated with that of the width. A choice by the fitted
 * light takes the wider ones (`boresight pd --pair --snr 22.4`: 0.2 % of single sources split, 1 %
 * asked).
 */
static const double WIDTH_SNR = 25.0;
/* Least number of them whose median is preferred to the width of the known PSF, and the most of
 * which it is taken: design choices. */
enum { LEAST_WIDTHS = 5, MOST_WIDTHS = 255 };

/* Coefficients of the second derivatives (xx, xy, yy) of the single source's image in its
 * residuals, px^2; and the drop of chi-square by them. The latest fit on the stamp must be that of
 * the source. False: not determined. */
static bool find_elongation(const bst_fit *fit, const bst_fit_data *data,
                            const bst_imgproc_stamp *stamp, const bst_imgproc_source *s,
                            double out[3], double *gain) {
    enum { N = 6 };
    const int stride = bst_simd_layout_round_up(stamp->width), n = stride * stamp->height;
    const float *m = fit->model;
    double a[N][N] = {{0.0}}, g[N] = {0.0}, right[N];
    for (int y = 1; y + 1 < stamp->height; y++) {
        for (int x = 1; x + 1 < stamp->width; x++) {
            int k = y * stride + x;
            if (!(fit->valid[k] > 0.0f)) {
                continue;
            }
            double middle = (double)m[k];
            double share = middle + s->widening_px2 * (double)m[k + 3 * n];
            double j[N] = {
                share,
                s->flux_e * (double)m[k + n],
                s->flux_e * (double)m[k + 2 * n],
                0.5 * s->flux_e * ((double)m[k + 1] + (double)m[k - 1] - 2.0 * middle),
                0.25 * s->flux_e *
                    ((double)m[k + stride + 1] + (double)m[k - stride - 1] -
                     (double)m[k + stride - 1] - (double)m[k - stride + 1]),
                0.5 * s->flux_e * ((double)m[k + stride] + (double)m[k - stride] - 2.0 * middle)};
            double model = (double)fit->fixed[k] + s->flux_e * share;
            double weight = 1.0 / (data->noise_e * data->noise_e + data->excess * fmax(model, 0.0));
            double r = (double)fit->value[k] - model;
            for (int p = 0; p < N; p++) {
                for (int q = 0; q <= p; q++) {
                    a[p][q] += weight * j[p] * j[q];
                }
                g[p] += weight * j[p] * r;
            }
        }
    }
    for (int p = 0; p < N; p++) {
        right[p] = g[p];
    }
    if (!bst_cholesky_factor(a[0], N, N, 1e-9)) {
        return false;
    }
    bst_cholesky_solve(a[0], N, N, g);
    *gain = 0.0;
    for (int p = 0; p < N; p++) {
        *gain += g[p] * right[p];
    }
    for (int p = 0; p < 3; p++) {
        out[p] = g[3 + p];
    }
    return true;
}

/* Place and light of the brightest 3 x 3 pixels of the single source's residuals, and their SNR: a
 * second source that is so far away that the second derivatives do not describe it. */
typedef struct residue {
    double x_px, y_px, flux_e, snr;
} residue;

static residue find_remainder(const bst_fit *fit, const bst_fit_data *data,
                              const bst_imgproc_stamp *stamp, const bst_imgproc_source *s) {
    const int stride = bst_simd_layout_round_up(stamp->width), n = stride * stamp->height;
    residue best = {.snr = 0.0};
    for (int y = 1; y + 1 < stamp->height; y++) {
        for (int x = 1; x + 1 < stamp->width; x++) {
            double sum = 0.0, variance = 0.0;
            for (int c = 0; c < 9; c++) {
                int k = (y + c / 3 - 1) * stride + x + c % 3 - 1;
                double share =
                    (double)fit->model[k] + s->widening_px2 * (double)fit->model[k + 3 * n];
                double model = (double)fit->fixed[k] + s->flux_e * share;
                sum += (double)fit->value[k] - model;
                variance += data->noise_e * data->noise_e + data->excess * fmax(model, 0.0);
            }
            if (sum > best.snr * sqrt(variance)) {
                best = (residue){stamp->x0 + x, stamp->y0 + y, sum, sum / sqrt(variance)};
            }
        }
    }
    return best;
}

/* True if the light of a source is whole and its own. */
static bool is_whole(const bst_locate_frame *f, const bst_imgproc_found *found,
                     const bst_imgproc_stamp *stamp) {
    if (!found->source.fitted || found->dropped || found->rough || found->bleed ||
        found->charge.pixels > 0 || found->label != BST_LABEL_UNKNOWN ||
        (found->flags & BST_DETECTION_BLEND)) {
        return false;
    }
    for (int y = 0; y < stamp->height; y++) {
        const float *row =
            f->signal + (size_t)(stamp->y0 + y) * (size_t)f->width + (size_t)stamp->x0;
        for (int x = 0; x < stamp->width; x++) {
            if (!(row[x] > BST_PIXEL_NONE)) {
                return false;
            }
        }
    }
    const bst_imgproc_shape *s = &found->source.shape;
    double reach = 2.0 * f->sigma_px;
    return s->x_px - 0.5 * fabs(s->dx_px) > reach && s->y_px - 0.5 * fabs(s->dy_px) > reach &&
           s->x_px + 0.5 * fabs(s->dx_px) < f->width - reach &&
           s->y_px + 0.5 * fabs(s->dy_px) < f->height - reach;
}

/* Start of a pair with the share `faint` of the light in the second source, `d` from the first. */
static void start_pair(const bst_imgproc_source *from, double faint, const double d[2],
                       bst_imgproc_source out[2]) {
    out[0] = out[1] = *from;
    out[0].flux_e = (1.0 - faint) * from->flux_e;
    out[1].flux_e = faint * from->flux_e;
    out[0].shape.x_px -= faint * d[0];
    out[0].shape.y_px -= faint * d[1];
    out[1].shape.x_px += (1.0 - faint) * d[0];
    out[1].shape.y_px += (1.0 - faint) * d[1];
}

/* Fits a pair. Returns chi-square; infinity if the fit fails. */
static double fit_pair(bst_fit *fit, const bst_fit_request *single, bst_imgproc_source out[2]) {
    bst_imgproc_source *both[2] = {&out[0], &out[1]};
    bst_fit_request request = *single;
    request.free = both;
    request.free_count = 2;
    return bst_fit_run(fit, &request) ? out[0].chi_square : INFINITY;
}

/* Chi-square of a source drawn along the path `d`; infinity if the fit fails. */
static double chi_of_path(const bst_imgproc_worker *w, int i, const bst_imgproc_found *from,
                          const bst_imgproc_stamp *stamp, const double d[2]) {
    bst_imgproc_found streak = *from;
    streak.source.shape.dx_px = d[0];
    streak.source.shape.dy_px = d[1];
    return bst_deblend_fit(w, i, &streak, stamp, false) ? streak.source.chi_square : INFINITY;
}

/* Least chi-square of the source as a streak of unknown motion, by parabolas along and across a
 * path of the variance of its elongation; infinity: the fit fails. */
static double own_streak(const bst_imgproc_worker *w, int i, const bst_imgproc_source *one,
                         const bst_imgproc_stamp *stamp, double variance, double angle) {
    bst_imgproc_found streak = w->l->found[i];
    if (streak.streak || !(variance > 0.0)) {
        return INFINITY;
    }
    streak.source = *one;
    double length = sqrt(12.0 * variance), d[2] = {length * cos(angle), length * sin(angle)};
    double lowest = chi_of_path(w, i, &streak, stamp, d);
    for (int round = 0; round < 6 && isfinite(lowest); round++) {
        double share = round < 2 ? 0.2 : round < 4 ? 0.1 : 0.04;
        double h[2] = {share * (round % 2 ? -d[1] : d[0]), share * (round % 2 ? d[0] : d[1])};
        double low = chi_of_path(w, i, &streak, stamp, (double[2]){d[0] - h[0], d[1] - h[1]});
        double high = chi_of_path(w, i, &streak, stamp, (double[2]){d[0] + h[0], d[1] + h[1]});
        double bend = low + high - 2.0 * lowest;
        double step = bend > 0.0 ? 0.5 * (low - high) / bend : low < high ? -2.0 : 2.0;
        step = fmax(-2.0, fmin(step, 2.0));
        const double there[2] = {d[0] + step * h[0], d[1] + step * h[1]};
        double chi = chi_of_path(w, i, &streak, stamp, there);
        if (chi < lowest) {
            lowest = chi;
            d[0] = there[0];
            d[1] = there[1];
        }
    }
    return lowest;
}

/* What the residuals of the single source suggest: elongation (its variance along `angle`), and a
 * second source. */
typedef struct suggestion {
    double variance_px2, angle;
    residue rest;
} suggestion;

/* Fits the single source of the request and reads its residuals. False: nothing hints at a pair. */
static bool find_suggestion(bst_fit *fit, const bst_fit_request *single, double least_gain,
                            suggestion *out) {
    double q[3], expected;
    const bst_imgproc_source *one = single->free[0];
    if (!bst_fit_run(fit, single) ||
        !find_elongation(fit, single->data, single->stamp, one, q, &expected)) {
        return false;
    }
    out->rest = find_remainder(fit, single->data, single->stamp, one);
    /* the greater eigenvalue of [xx, xy; xy, yy], and its direction */
    out->variance_px2 = 0.5 * (q[0] + q[2]) + hypot(0.5 * (q[0] - q[2]), q[1]);
    out->angle = 0.5 * atan2(2.0 * q[1], q[0] - q[2]);
    return fmax(expected, out->rest.snr * out->rest.snr) >= FOUND_SHARE * least_gain;
}

/* Best pair of all starts: sets its sources and its gain. Returns the start: 3, beside the single
 * source; -1: none. */
static int fit_best(bst_fit *fit, const bst_fit_request *single, const suggestion *hint,
                    bst_pair *out) {
    const bst_imgproc_source *one = single->free[0];
    double lowest = INFINITY;
    int best = -1;
    for (int k = hint->variance_px2 > 0.0 ? 0 : 3; k < (hint->rest.snr > 0.0 ? 4 : 3); k++) {
        bst_imgproc_source both[2] = {*one, *one};
        if (k < 3) {
            double length = sqrt(hint->variance_px2 / (START_SHARE[k] * (1.0 - START_SHARE[k])));
            const double d[2] = {length * cos(hint->angle), length * sin(hint->angle)};
            start_pair(one, START_SHARE[k], d, both);
        } else {
            both[1].shape.x_px = hint->rest.x_px;
            both[1].shape.y_px = hint->rest.y_px;
            both[1].flux_e = hint->rest.flux_e;
        }
        double chi = fit_pair(fit, single, both);
        if (chi < lowest) {
            lowest = chi;
            best = k;
            out->source[0] = both[0];
            out->source[1] = both[1];
        }
    }
    out->gain = one->chi_square - lowest;
    return best;
}

/* Puts the brighter source first and sets both covariances: a fit has that of its first source. */
static bool finish_pair(bst_fit *fit, const bst_fit_request *single, bst_pair *pair) {
    if (pair->source[1].flux_e > pair->source[0].flux_e) {
        bst_imgproc_source first = pair->source[0];
        pair->source[0] = pair->source[1];
        pair->source[1] = first;
    }
    bool good = true;
    for (int k = 1; k >= 0 && good; k--) {
        bst_imgproc_source copy[2] = {pair->source[k], pair->source[1 - k]};
        good = isfinite(fit_pair(fit, single, copy));
        pair->source[k] = copy[0];
    }
    return good;
}

bool bst_pair_fit(const bst_imgproc_worker *w, int i, double widening_px2, double least_gain,
                  bst_pair *out) {
    assert(w && out && i >= 0 && i < w->l->count);
    const bst_locate_frame *f = w->f;
    const bst_imgproc_found *found = &w->l->found[i];
    bst_imgproc_stamp stamp = bst_deblend_stamp(w->l, f, &found->source);
    if (!is_whole(f, found, &stamp)) {
        return false;
    }
    bst_deblend c;
    bst_deblend_gather(w->l, f, i, &found->source, &stamp, &c);
    bst_imgproc_source one = found->source, *free_one[1] = {&one};
    one.widening_px2 = widening_px2;
    bst_fit_data data = {f->signal, f->width, f->height, found->noise_e, f->excess};
    const bst_fit_request single = {
        .data = &data,
        .stamp = &stamp,
        .free = free_one,
        .free_count = 1,
        .fixed = c.fixed,
        .fixed_count = c.fixed_count,
        .limit_px = bst_deblend_fit_limit(f, hypot(one.shape.dx_px, one.shape.dy_px))};
    suggestion hint;
    int start = c.free_count == 1 && find_suggestion(w->fit, &single, least_gain, &hint)
                    ? fit_best(w->fit, &single, &hint, out)
                    : -1;
    if (start < 0) {
        return false;
    }
    double dx = out->source[1].shape.x_px - out->source[0].shape.x_px;
    double dy = out->source[1].shape.y_px - out->source[0].shape.y_px;
    double apart = hypot(dx, dy) / (BST_FWHM_PER_SIGMA * f->sigma_px);
    double more = found->streak && start < 3 ? ON_PATH : apart < NEAR_FWHM ? 0.0 : ELSEWHERE;
    double chi = one.chi_square - out->gain - STREAK_LEAD;
    return out->gain > least_gain + more &&
           own_streak(w, i, &one, &stamp, hint.variance_px2, hint.angle) > chi &&
           finish_pair(w->fit, &single, out);
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median widening of the bright sources: pairs among them, which look wider, do not move it much.
 */
static double median_widening(const bst_imgproc_locator *l, int fits) {
    double all[MOST_WIDTHS];
    int count = 0;
    for (int i = 0; i < fits && count < MOST_WIDTHS; i++) {
        const bst_imgproc_found *found = &l->found[i];
        if (found->top_snr > WIDTH_SNR && found->source.fitted &&
            found->source.widening_variance > 0.0 && !found->bleed && !found->dropped) {
            all[count++] = found->source.widening_px2;
        }
    }
    qsort(all, (size_t)count, sizeof *all, ascending);
    return count >= LEAST_WIDTHS ? 0.5 * (all[(count - 1) / 2] + all[count / 2]) : 0.0;
}

void bst_pair_split(bst_imgproc_locator *l, const bst_locate_frame *f, int fits, double rate) {
    assert(l && f && fits <= l->count && rate > 0.0);
    const bst_imgproc_worker w = {l, f, &l->fits[0]};
    double least_gain = bst_chi_square3_quantile(rate), widening = median_widening(l, fits);
    int before = l->count;
    for (int i = 0; i < fits && l->count < l->capacity; i++) {
        bst_pair pair;
        if (!bst_pair_fit(&w, i, widening, least_gain, &pair)) {
            continue;
        }
        bst_imgproc_found *first = &l->found[i], *second = &l->found[l->count++];
        *second = *first;
        first->source = pair.source[0];
        second->source = pair.source[1];
        first->neighbours = second->neighbours = first->neighbours + 1;
        first->flags |= BST_DETECTION_BLEND;
        second->flags |= BST_DETECTION_BLEND;
        second->top_x_px = second->source.shape.x_px;
        second->top_y_px = second->source.shape.y_px;
        second->peak_x = (int)fmin(fmax(floor(second->top_x_px + 0.5), 0.0), f->width - 1.0);
        second->peak_y = (int)fmin(fmax(floor(second->top_y_px + 0.5), 0.0), f->height - 1.0);
    }
    if (l->count > before) {
        bst_deblend_index(l, f);
    }
}
