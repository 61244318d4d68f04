/* Search for all stars of a frame by the path that they share: matched filter, joint fit of what it
 * finds, matched filter of what is left. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "imgproc/streak/common_streak_internal.h"
#include "imgproc/streak/streak_deblend.h"

/* ROUNDS: most searches; each goes down by BRIGHTEST_SHARE. SWEEPS: of the fit in a round, and at
 * the end. The search ends when a round adds one star of FEW. */
enum { ROUNDS = 12, SWEEPS = 2, LAST_SWEEPS = 3, FEW = 50 };

/* A round finds stars down to this share of the brightest's SNR: what their subtraction leaves
 * before the fit is fainter. */
static const double BRIGHTEST_SHARE = 0.2;
/* Radius of a point source that is taken out of the fit, PSF sigma. */
static const double POINT_SIGMA = 3.5;
/* Error of a place beside the noise: the path's own error. */
static const double SYSTEMATIC_PX = 0.1;
/* Step of the second derivatives of a response, px. */
static const double STEP_PX = 0.5;
/* Excursions of the field on its grid of whole pixels over those of the formula, the pieces at the
 * edges included; calibrated by tests/imgproc/star_streak_completeness.c. */
static const double FOUND_SHARE = 0.4;

typedef bst_streak_finder finder;

/* Response of a filter to its own path, shifted, for unit noise. */
static double autocorrelation(const bst_star_path *p, double psf_sigma_px, double dx, double dy) {
    double sum = 0.0, most = 100.0 * psf_sigma_px * psf_sigma_px;
    for (int k = 0; k < p->count; k++) {
        for (int l = 0; l < p->count; l++) {
            double u = p->place[k][0] - p->place[l][0] - dx;
            double v = p->place[k][1] - p->place[l][1] - dy, r2 = u * u + v * v;
            sum += r2 < most
                       ? p->light[k] * p->light[l] * exp(-0.25 * r2 / (psf_sigma_px * psf_sigma_px))
                       : 0.0;
        }
    }
    return sum;
}

/* Extent of the path along an axis, px. */
static double extent(const bst_star_path *p, int axis) {
    double low = 0.0, high = 0.0;
    for (int k = 0; k < p->count; k++) {
        low = fmin(low, p->place[k][axis]);
        high = fmax(high, p->place[k][axis]);
    }
    return high - low;
}

double bst_streak_path_threshold(const bst_star_path *path, int width, int height,
                                 double psf_sigma_px, double least_inside, double false_alarms) {
    assert(path && path->count > 0 && width > 0 && height > 0 && psf_sigma_px > 0.0 &&
           least_inside > 0.0 && false_alarms > 0.0);
    const double h = STEP_PX;
    double at = autocorrelation(path, psf_sigma_px, 0.0, 0.0);
    double xx = 2.0 * (1.0 - autocorrelation(path, psf_sigma_px, h, 0.0) / at) / (h * h);
    double yy = 2.0 * (1.0 - autocorrelation(path, psf_sigma_px, 0.0, h) / at) / (h * h);
    double both = 2.0 * (1.0 - autocorrelation(path, psf_sigma_px, h, h) / at) / (h * h);
    double xy = 0.5 * (both - xx - yy), det = fmax(xx * yy - xy * xy, 1e-12);
    double margin = 1.0 - fmin(2.0 * least_inside, 1.0);
    double area = (width + margin * extent(path, 0)) * (height + margin * extent(path, 1));
    double expected = FOUND_SHARE * area * sqrt(det) * pow(2.0 * BST_PI, -1.5) / false_alarms;
    double u = 4.0;
    for (int i = 0; i < 50; i++) { /* u exp(-u^2 / 2) falls beyond 1 */
        u = sqrt(fmax(2.0 * log(fmax(expected * u, 1.0)), 1.0));
    }
    return u;
}

/* Convolves what is left, over its variance, and the weights. */
static void prepare(finder *f, const bst_streak_deblend *d, float *weights) {
    const size_t n = (size_t)f->width * (size_t)f->height;
    for (size_t i = 0; i < n; i++) {
        f->lines[i] = d->residual[i] * d->weight[i];
    }
    bst_streak_finder_convolve(f, f->lines, f->smooth, f->psf_sigma_px, false);
    bst_streak_finder_convolve(f, d->weight, weights, f->psf_sigma_px, true);
}

/* Flux of a star in units of the noise, from the amplitude of its samples in the convolved image:
 * a point of unit flux has the value 1 / (2 sqrt(pi) sigma) there. */
static double flux_of(const finder *f, double amplitude) {
    return amplitude * 2.0 * sqrt(BST_PI) * f->psf_sigma_px * f->path.count;
}

/* Least SNR and share in the frame of a star. */
typedef struct limits {
    double snr, inside;
} limits;

/* What a search has done. */
typedef struct progress {
    int added;
    bool last;
} progress;

/* Adds the stars of one search; out->last: it has reached the limit. */
static bst_status search(bst_ctx *ctx, finder *f, bst_streak_deblend *d, float *weights,
                         const limits *least, progress *out) {
    int *added = &out->added;
    bool *last = &out->last;
    double least_snr = least->snr, least_inside = least->inside;
    const bst_star_path_image image = {f->smooth, f->width, f->height};
    bst_path_filter *filter;
    prepare(f, d, weights);
    BST_TRY(bst_path_filter_create_weighted(ctx, &f->path, &image, weights, f->psf_sigma_px,
                                            least_inside, &filter));
    f->weights = weights;
    d->spread = fmax(bst_path_filter_spread(filter), 1.0);
    least_snr *= d->spread;
    *added = 0;
    *last = false;
    double lowest = 0.0;
    for (int i = 0; i < 20 * d->room; i++) {
        bst_path_filter_peak peak;
        if (!bst_path_filter_highest(filter, &peak)) {
            *last = true;
            break;
        }
        lowest = lowest > 0.0 ? lowest : fmax(BRIGHTEST_SHARE * peak.snr, least_snr);
        if (peak.snr < lowest) {
            *last = !(lowest > least_snr);
            break;
        }
        if (bst_streak_finder_remove_point(f, filter, &peak)) {
            if (!isnan(f->point[0])) {
                bst_streak_deblend_leave_out(d, f->point[0], f->point[1],
                                             POINT_SIGMA * f->psf_sigma_px);
            }
            continue;
        }
        if (!peak.whole) {
            bst_path_filter_leave_out(filter, &peak, BST_STREAK_CLOSE_PX);
            continue;
        }
        if (!bst_streak_deblend_add(d, peak.x_px, peak.y_px, flux_of(f, peak.amplitude))) {
            *last = true;
            break;
        }
        (*added)++;
        bst_path_filter_subtract(filter, &peak);
    }
    f->weights = NULL;
    bst_path_filter_free(filter);
    return BST_OK;
}

/* Finds the stars in rounds. */
static bst_status find_and_fit(bst_ctx *ctx, finder *f, bst_streak_deblend *d, float *weights,
                               double least_snr, double least_inside) {
    for (int round = 0; round < ROUNDS; round++) {
        int before = d->count;
        progress done;
        const limits least = {least_snr, least_inside};
        bst_streak_deblend_weigh(d);
        BST_TRY(search(ctx, f, d, weights, &least, &done));
        bst_streak_deblend_fit(d, SWEEPS, before);
        (void)bst_streak_deblend_drop(d, least_snr);
        if (done.last && d->count <= before + before / FEW) {
            break;
        }
    }
    bst_streak_deblend_weigh(d);
    bst_streak_deblend_fit(d, LAST_SWEEPS, 0);
    (void)bst_streak_deblend_drop(d, least_snr);
    return BST_OK;
}

/* Error of a place that is not noise: the map is of first order in the rotation, and half its
 * square is left out. */
static double systematic_of(const bst_star_path *p) {
    double length = hypot(p->ends[1][0] - p->ends[0][0], p->ends[1][1] - p->ends[0][1]);
    double half = 0.5 * length * p->tangent_per_px;
    return SYSTEMATIC_PX + 0.5 * half * half * fmax(p->centre[0], p->centre[1]);
}

static int brighter_first(const void *a, const void *b) {
    double d = ((const bst_detection *)b)->snr - ((const bst_detection *)a)->snr;
    return (d > 0.0) - (d < 0.0);
}

/* Lists the stars of the fit. */
static void list_stars(finder *f, const bst_streak_deblend *d, bst_common_streak *out) {
    out->items = f->items;
    for (int i = 0; i < d->count; i++) {
        const bst_deblended_star *s = &d->stars[i];
        f->items[i] =
            (bst_detection){.x_px = s->x_px,
                            .y_px = s->y_px,
                            .flux_e = s->flux * f->sigma,
                            .flux_sigma_e = s->flux * f->sigma / s->snr,
                            .snr = s->snr,
                            .cov_xx = s->cov_xx,
                            .cov_xy = s->cov_xy,
                            .cov_yy = s->cov_yy,
                            .flags = s->inside < BST_STREAK_WHOLE ? BST_DETECTION_EDGE : 0};
    }
    out->count = d->count;
    qsort(f->items, (size_t)out->count, sizeof *f->items, brighter_first);
}

bst_status bst_streak_finder_follow(bst_ctx *ctx, bst_streak_finder *f, const bst_star_path *path,
                                    double least_snr, double least_inside, bst_common_streak *out) {
    assert(f && path && path->count > 0 && least_snr > 0.0 && least_inside > 0.0 && out);
    const size_t pixels = (size_t)f->width * (size_t)f->height;
    if (path != &f->path) {
        f->path = *path;
    }
    *out = (bst_common_streak){.items = f->items, .sigma = f->sigma};
    for (int e = 0; e < 2; e++) {
        out->ends[e] = (bst_common_streak_point){f->path.ends[e][0], f->path.ends[e][1]};
    }
    /* behind the weights: the images that the search of shapes needs again */
    const size_t kept = f->options.known_path ? 0 : 2 * pixels;
    float *weights = malloc((pixels + kept) * sizeof *weights);
    bst_streak_deblend d = {.width = 0};
    bst_status status = BST_OK;
    if (!weights) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for weights of %d x %d px", f->width,
                          f->height);
    } else {
        if (kept > 0) {
            memcpy(weights + pixels, f->smooth, pixels * sizeof *weights);
            memcpy(weights + 2 * pixels, f->lines, pixels * sizeof *weights);
        }
        const bst_streak_deblend_config config = {.width = f->width,
                                                  .height = f->height,
                                                  .room = f->options.max_sources,
                                                  .path = &f->path,
                                                  .psf_sigma_px = f->psf_sigma_px,
                                                  .shot = f->options.shot_variance / f->sigma};
        status = bst_streak_deblend_create(ctx, f->image, &config, &d);
    }
    if (status == BST_OK) {
        status = find_and_fit(ctx, f, &d, weights, least_snr, least_inside);
    }
    if (status == BST_OK) {
        bst_streak_deblend_finish(&d, systematic_of(path));
        out->sigma = f->sigma * sqrt(d.noise2);
        list_stars(f, &d, out);
    }
    if (weights && kept > 0) {
        memcpy(f->smooth, weights + pixels, pixels * sizeof *weights);
        memcpy(f->lines, weights + 2 * pixels, pixels * sizeof *weights);
    }
    bst_streak_deblend_free(&d);
    free(weights);
    return status;
}
