#include "imgproc/streak/common_streak.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "imgproc/streak/common_streak_internal.h"
#include "imgproc/value_of_rank.h"
#include "sim/core/simd.h"

/* LINE_HALF: samples of a line on either side of a pixel, LINE_STEP px apart. */
enum { LINE_HALF = 5, LINE_STEP = 2, DIRECTIONS = 16, LINE_REACH = BST_STREAK_LINE_REACH };
enum { MOST_REACH = 12, REFINING_STARS = 15 };
/* Samples on either side that overlap: those of the widest PSF six times over. */
enum { OVERLAP = 12 };
/* Values of which the greatest is sought at a time. */
enum { LANES = 16 };

/* Assumed width of the PSF. */
static const double USUAL_PSF_SIGMA_PX = 1.0;
/* Widest PSF: three standard deviations fit into MOST_REACH. */
static const double MOST_PSF_SIGMA_PX = 4.0;
/* A source this near to a brighter one, and fainter by this share, is what its subtraction left. */
static const double GHOST_PX = 15.0, GHOST_SHARE = 0.25;
/* Points brighter than BRIGHT_SNR leave residuals up to GHOST_PX, fainter ones up to
 * BST_STREAK_CLOSE_PX. */
static const double BRIGHT_SNR = 100.0;
/* Share of the quality of a source's own path that a refined one keeps: its ends, by all stars, are
 * more accurate, unless crowded stars have moved them to wrong places. */
static const double LEAST_REFINED = 0.9;
/* A shape where streaks overlap is brighter than either: the light along which its path is extended
 * is this share of its own. */
static const double EXTENDED_SHARE = 0.5;
/* Ends of paths that are the same, px. */
static const double SAME_ENDS_PX = 3.0;
/* Least SNR of the stars that refine the path. */
static const double REFINING_SNR = 15.0;
/* Least share of the path inside the frame, by its squared light, for a star whose middle is too.
 */
static const double USUAL_INSIDE = 0.25;

typedef bst_streak_finder finder;

/* Greatest of the values and zero. */
BST_CLONES
static float highest_value(const float *values, size_t count) {
    float most[LANES] = {0.0f};
    size_t i = 0;
    for (; i + LANES <= count; i += LANES) {
        for (int k = 0; k < LANES; k++) {
            most[k] = values[i + (size_t)k] > most[k] ? values[i + (size_t)k] : most[k];
        }
    }
    for (; i < count; i++) {
        most[0] = fmaxf(most[0], values[i]);
    }
    for (int k = 1; k < LANES; k++) {
        most[0] = fmaxf(most[0], most[k]);
    }
    return most[0];
}

/* Adds a row, scaled. */
BST_CLONES
static void add_scaled(float *restrict to, const float *restrict from, float by, int count) {
    for (int x = 0; x < count; x++) {
        to[x] += by * from[x];
    }
}

void bst_streak_finder_convolve(finder *f, const float *from_image, float *to_image,
                                double sigma_px, bool squared) {
    const int w = f->width, h = f->height, reach = (int)ceil(3.0 * sigma_px);
    float kernel[2 * MOST_REACH + 1];
    double squares = 0.0;
    for (int k = -reach; k <= reach; k++) {
        double v = exp(-0.5 * k * k / (sigma_px * sigma_px));
        squares += v * v;
        kernel[k + reach] = (float)v;
    }
    for (int k = 0; k <= 2 * reach; k++) {
        kernel[k] /= (float)sqrt(squares);
        kernel[k] = squared ? kernel[k] * kernel[k] : kernel[k];
    }
    memset(to_image, 0, (size_t)w * (size_t)h * sizeof *to_image);
    for (int y = 0; y < h; y++) {
        float *to = &f->scratch[y * w];
        memset(to, 0, (size_t)w * sizeof *to);
        for (int k = -reach; k <= reach; k++) {
            int first = k < 0 ? -k : 0, last = k > 0 ? w - k : w;
            add_scaled(to + first, &from_image[y * w + k + first], kernel[k + reach], last - first);
        }
    }
    for (int y = 0; y < h; y++) {
        for (int k = -reach; k <= reach; k++) {
            if (y + k >= 0 && y + k < h) {
                add_scaled(&to_image[y * w], &f->scratch[(y + k) * w], kernel[k + reach], w);
            }
        }
    }
}

/* Convolves the image with a Gaussian; the result has unit noise. */
static void convolve(finder *f, double sigma_px) {
    bst_streak_finder_convolve(f, f->image, f->smooth, sigma_px, false);
    f->psf_sigma_px = sigma_px;
}

/* Raises places of a row to the sums along the lines through them. */
BST_CLONES
static void raise_to_line(float *restrict to, const float *restrict from,
                          const int offset[2 * LINE_HALF + 1], float scale, int count) {
    for (int x = 0; x < count; x++) {
        float sum = 0.0f;
        for (int k = 0; k <= 2 * LINE_HALF; k++) {
            sum += from[x + offset[k]];
        }
        sum *= scale;
        to[x] = sum > to[x] ? sum : to[x];
    }
}

/* Largest mean along short lines of many directions through each pixel, in units of its noise. */
static void filter_lines(finder *f) {
    const int w = f->width, h = f->height;
    const double neighbour =
        exp(-0.25 * LINE_STEP * LINE_STEP / (f->psf_sigma_px * f->psf_sigma_px));
    const float scale = (float)(1.0 / sqrt((2 * LINE_HALF + 1) + 4.0 * LINE_HALF * neighbour));
    memset(f->lines, 0, (size_t)w * (size_t)h * sizeof *f->lines);
    for (int d = 0; d < DIRECTIONS; d++) {
        int offset[2 * LINE_HALF + 1];
        for (int k = -LINE_HALF; k <= LINE_HALF; k++) {
            double r = LINE_STEP * k, angle = BST_PI * d / DIRECTIONS;
            offset[k + LINE_HALF] = (int)lround(r * sin(angle)) * w + (int)lround(r * cos(angle));
        }
        for (int y = LINE_REACH; y < h - LINE_REACH; y++) {
            float *to = &f->lines[y * w];
            const float *from = &f->smooth[y * w];
            raise_to_line(to + LINE_REACH, from + LINE_REACH, offset, scale, w - 2 * LINE_REACH);
        }
    }
}

bst_star_path_image bst_streak_finder_image(const finder *f) {
    return (bst_star_path_image){f->smooth, f->width, f->height};
}

/* Median of the light along the path at a place. */
static double light_along(const finder *f, double x_px, double y_px) {
    const bst_star_path_image image = bst_streak_finder_image(f);
    float values[BST_STAR_PATH_ROOM];
    double m[3];
    bst_star_path_map(&f->path, x_px, y_px, m);
    for (int k = 0; k < f->path.count; k++) {
        const double *u = f->path.place[k];
        values[k] = (float)bst_star_path_image_at(&image, x_px + m[0] * u[0] + m[1] * u[1],
                                                  y_px + m[1] * u[0] + m[2] * u[1]);
    }
    return fmax((double)bst_value_of_rank(values, f->path.count, f->path.count / 2), 1.0);
}

/* Makes the path of a shape.
 *
 * Given:     extend  along the light of the source beyond the shape's ends */
static bool fit_shape(finder *f, const bst_streak_shape *s, bool extend) {
    const bst_star_path_image image = bst_streak_finder_image(f);
    double x, y;
    bst_streak_finder_flood(f, s->level, s->from, ++f->floods);
    if (!bst_star_path_fit(&f->path, &image, f->stack, f->count, &x, &y)) {
        return false;
    }
    if (extend) {
        const bst_star_path_star own = {x, y, EXTENDED_SHARE * light_along(f, x, y)};
        bst_star_path_refine(&f->path, &image, &own, 1);
    }
    return true;
}

/* True for what the subtraction of a brighter source left. */
static bool is_ghost(const bst_common_streak *s, const bst_detection *d) {
    for (int i = 0; i < s->count; i++) {
        const bst_detection *o = &s->items[i];
        if (hypot(d->x_px - o->x_px, d->y_px - o->y_px) < GHOST_PX &&
            d->flux_e < GHOST_SHARE * o->flux_e) {
            return true;
        }
    }
    return false;
}

/* Stars to find. */
typedef struct wanted {
    double least_snr;
    int most;
    double least_inside; /* share of the path */
    bool outside;        /* also stars whose place is outside the frame */
} wanted;

/* Finds the stars one after the other; those that are not kept are subtracted, too. */
static bst_status find_stars(bst_ctx *ctx, finder *f, const wanted *q, bst_common_streak *out) {
    const bst_star_path_image image = bst_streak_finder_image(f);
    const int most = q->most;
    if (f->filter && bst_path_filter_is_of(f->filter, &f->path)) {
        bst_path_filter_restart(f->filter, &image);
    } else {
        BST_TRY(bst_path_filter_renew(ctx, &f->path, &image, NULL, f->psf_sigma_px, q->least_inside,
                                      &f->filter));
    }
    bst_path_filter *filter = f->filter;
    const bool point = f->path.count == 1;
    out->items = f->items;
    out->count = 0;
    memset(f->scratch, 0, (size_t)f->width * (size_t)f->height * sizeof *f->scratch);
    /* bright points leave many rings; a peak of theirs costs little */
    const int tries = (point || q->outside ? 20 : 2) * most;
    for (int i = 0; i < tries && out->count < most; i++) {
        bst_path_filter_peak peak;
        if (!bst_path_filter_highest(filter, &peak) || peak.snr < q->least_snr) {
            break;
        }
        bst_detection d = {.x_px = peak.x_px,
                           .y_px = peak.y_px,
                           .flux_e = peak.amplitude * f->sigma,
                           .flux_sigma_e = peak.amplitude * f->sigma / peak.snr,
                           .snr = peak.snr,
                           .cov_xx = peak.cov_xx,
                           .cov_xy = peak.cov_xy,
                           .cov_yy = peak.cov_yy,
                           .flags = peak.inside < BST_STREAK_WHOLE ? BST_DETECTION_EDGE : 0};
        bool inside = q->outside || (d.x_px >= 0.0 && d.y_px >= 0.0 && d.x_px <= f->width - 1 &&
                                     d.y_px <= f->height - 1);
        bool left = is_ghost(out, &d) || (!point && bst_streak_finder_is_covered(f, &peak));
        if (!point && q->outside && bst_streak_finder_is_uneven(f, &peak)) {
            bst_path_filter_leave_out(filter, &peak, BST_STREAK_CLOSE_PX);
            continue;
        }
        if (inside && peak.whole && !left) {
            f->items[out->count++] = d;
            if (!point) {
                bst_streak_finder_cover(f, &peak);
            }
        }
        bst_path_filter_subtract(filter, &peak);
        if (point) {
            bst_path_filter_leave_out(filter, &peak,
                                      peak.snr > BRIGHT_SNR ? GHOST_PX : BST_STREAK_CLOSE_PX);
        }
    }
    return BST_OK;
}

/* Value of a sample inside a streak of unit amplitude: the convolved samples overlap. */
static double overlap(const finder *f) {
    double sum = 0.0, step = BST_STAR_PATH_STEP_PX / f->psf_sigma_px;
    for (int k = -OVERLAP; k <= OVERLAP; k++) {
        sum += exp(-0.25 * k * k * step * step);
    }
    return sum;
}

int bst_streak_finder_choose(const finder *f, const bst_common_streak *found, const bool *chosen,
                             bst_star_path_star *stars, int most) {
    const double light = overlap(f);
    int count = 0;
    for (int i = 0; i < found->count && count < most; i++) {
        if (!chosen || chosen[i]) {
            stars[count++] = (bst_star_path_star){found->items[i].x_px, found->items[i].y_px,
                                                  found->items[i].flux_e / f->sigma * light};
        }
    }
    return count;
}

/* Improves the path by stars. */
static void refine_path(finder *f, const bst_common_streak *found, const bool *chosen) {
    const bst_star_path_image image = bst_streak_finder_image(f);
    bst_star_path_star stars[REFINING_STARS];
    int count = bst_streak_finder_choose(f, found, chosen, stars, REFINING_STARS);
    bst_star_path_refine(&f->path, &image, stars, count);
}

bst_status bst_streak_finder_find_all(bst_ctx *ctx, finder *f, bst_common_streak *out) {
    out->sigma = f->sigma;
    out->ends_margin = fmin(f->path.margin[0], f->path.margin[1]);
    for (int e = 0; e < 2; e++) {
        out->ends[e] = (bst_common_streak_point){f->path.ends[e][0], f->path.ends[e][1]};
    }
    const wanted all = {f->options.least_snr, f->options.max_sources, USUAL_INSIDE,
                        f->path.count > 1};
    return find_stars(ctx, f, &all, out);
}

/* How well the brightest stars fit the path: the sum of their squared SNR, each with half the
 * weight of a brighter one. A path that is too short makes two stars of one, and one that is too
 * long takes in noise. */
static double fit_quality(const bst_common_streak *s) {
    double sum = 0.0, weight = 1.0;
    for (int i = 0; i < s->count && i < REFINING_STARS; i++) {
        sum += weight * s->items[i].snr * s->items[i].snr;
        weight *= 0.5;
    }
    return sum;
}

bool bst_streak_finder_points_fit_worse(const finder *f, double quality) {
    assert(f);
    const size_t pixels = (size_t)f->width * (size_t)f->height;
    /* the response to a point is the image; weights of stars add up to less than 2 */
    const double snr = (double)highest_value(f->smooth, pixels);
    return snr >= REFINING_SNR && 2.0 * snr * snr <= quality;
}

/* True if a path of the same ends has been measured. */
static bool is_known(finder *f) {
    const bst_star_path *p = &f->path;
    for (int i = 0; i < f->measured_count; i++) {
        double most = 0.0;
        for (int k = 0; k < 4; k++) {
            most = fmax(most, fabs(f->measured[i][k] - p->ends[k / 2][k % 2]));
        }
        if (most < SAME_ENDS_PX) {
            return true;
        }
    }
    return false;
}

/* Notes the ends of a path that has been measured. */
static void note_path(finder *f, const bst_star_path *path) {
    if (f->measured_count < BST_STREAK_SHAPES) {
        memcpy(f->measured[f->measured_count++], path->ends, sizeof f->measured[0]);
    }
}

bst_status bst_streak_finder_measure(bst_ctx *ctx, bst_streak_finder *f, int index, bool extend,
                                     bst_star_path *path, double *quality) {
    assert(f && path && quality && index >= BST_STREAK_FINDER_POINT && index < f->shape_count);
    bst_common_streak found;
    const wanted bright = {REFINING_SNR, REFINING_STARS, USUAL_INSIDE, false};
    *quality = 0.0;
    if (index == BST_STREAK_FINDER_POINT) {
        bst_star_path_point(&f->path);
        BST_TRY(find_stars(ctx, f, &bright, &found));
        *quality = fit_quality(&found);
        *path = f->path;
        return BST_OK;
    }
    if (!fit_shape(f, &f->shapes[index], extend) || is_known(f)) {
        return BST_OK;
    }
    note_path(f, &f->path);
    f->path.margin[0] = f->path.margin[1] = 0.0; /* one source may end in another's light */
    *path = f->path;
    BST_TRY(find_stars(ctx, f, &bright, &found));
    *quality = fit_quality(&found);
    refine_path(f, &found, NULL);
    BST_TRY(find_stars(ctx, f, &bright, &found));
    double refined = fit_quality(&found);
    if (refined > LEAST_REFINED * *quality) {
        *quality = refined;
        *path = f->path;
        note_path(f, path);
    }
    return BST_OK;
}

bst_status bst_streak_finder_search(bst_ctx *ctx, bst_streak_finder *f, const bst_star_path *path,
                                    bst_common_streak *out) {
    assert(f && path && out);
    *out = (bst_common_streak){.items = f->items};
    f->path = *path;
    return bst_streak_finder_find_all(ctx, f, out);
}

bst_status bst_streak_finder_find(bst_ctx *ctx, bst_streak_finder *f, int index,
                                  bst_common_streak *out) {
    assert(f && out);
    *out = (bst_common_streak){.items = f->items};
    if (index == BST_STREAK_FINDER_POINT) {
        bst_star_path_point(&f->path);
        return bst_streak_finder_find_all(ctx, f, out);
    }
    double quality;
    bst_star_path path;
    f->measured_count = 0;
    BST_TRY(bst_streak_finder_measure(ctx, f, index, false, &path, &quality));
    if (!(quality > 0.0)) {
        return BST_OK;
    }
    return bst_streak_finder_search(ctx, f, &path, out);
}

bst_status bst_streak_finder_repeat(bst_ctx *ctx, bst_streak_finder *f, const bool *chosen,
                                    bst_common_streak *out) {
    assert(f && chosen && out);
    refine_path(f, out, chosen);
    return bst_streak_finder_find_all(ctx, f, out);
}

const bst_star_path *bst_streak_finder_path(const bst_streak_finder *f) {
    return &f->path;
}

int bst_streak_finder_shapes(const bst_streak_finder *f) {
    return f->shape_count;
}

static bst_status allocate(bst_ctx *ctx, finder *f, int width, int height) {
    const size_t n = (size_t)width * (size_t)height;
    f->image = calloc(4 * n, sizeof *f->image);
    f->label = calloc(2 * n, sizeof *f->label);
    f->items = calloc((size_t)f->options.max_sources + REFINING_STARS, sizeof *f->items);
    if (!f->image || !f->label || !f->items) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame of %d x %d px", width,
                        height);
    }
    f->smooth = f->image + n;
    f->lines = f->image + 2 * n;
    f->scratch = f->image + 3 * n;
    f->stack = f->label + n;
    return BST_OK;
}

bst_status bst_streak_finder_create(bst_ctx *ctx, const float *pixels, int width, int height,
                                    const bst_common_streak_options *options,
                                    bst_streak_finder **out) {
    assert(pixels && options && out && width > 0 && height > 0);
    *out = NULL;
    finder *f = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame");
    }
    f->width = width;
    f->height = height;
    f->options = *options;
    f->path.centre[0] = 0.5 * (width - 1);
    f->path.centre[1] = 0.5 * (height - 1);
    f->path.tangent_per_px = options->tangent_per_px;
    bst_status status = allocate(ctx, f, width, height);
    if (status != BST_OK) {
        bst_streak_finder_free(f);
        return status;
    }
    memcpy(f->image, pixels, (size_t)width * (size_t)height * sizeof *f->image);
    bst_streak_finder_clean(f);
    convolve(f, options->psf_sigma_px > 0.0 ? fmin(options->psf_sigma_px, MOST_PSF_SIGMA_PX)
                                            : USUAL_PSF_SIGMA_PX);
    if (!options->known_path) {
        filter_lines(f);
        f->shape_count = bst_streak_finder_list_shapes(f, f->shapes);
    }
    *out = f;
    return BST_OK;
}

void bst_streak_finder_free(bst_streak_finder *f) {
    if (!f) {
        return;
    }
    bst_path_filter_free(f->filter);
    free(f->image);
    free(f->label);
    free(f->items);
    free(f);
}
