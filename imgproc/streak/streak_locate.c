#include "imgproc/streak/streak_locate.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/messages.h"
#include "boresight/vec.h"
#include "imgproc/measure/cosmic_ray.h"

/* most point sources replaced by a streak */
enum { MOST_PIECES = 64 };
/* Point density, px^-2, above which bright streaks are not searched among points: a point per 26
 * px, about the length of the shortest streak searched for. */
static const double CROWD_PER_PX = 0.0015;
/* Above this SNR a source counts as a point unless its area exceeds a point's by these limits.
 * Design choices: at about twice the threshold the area is known well enough; 10 px are the
 * rounding of a point's edge. */
static const double BRIGHT_POINT_SNR = 12.0, AREA_SHARE = 1.6, AREA_PIXELS = 10.0;
/* Design choices. A point is no piece of a line if it has OWN_LIGHT times the light of a piece of
 * its size, and OWN_LIGHT_SNR more, above any maximum of noise. A line may lose LOST_SNR when other
 * sources are masked: 1.5 standard deviations of its own noise. */
static const double OWN_LIGHT = 3.0, OWN_LIGHT_SNR = 6.0, LOST_SNR = 1.5;

bst_status bst_streak_locator_create(bst_ctx *ctx, const bst_imgproc_gauss *psf, bst_parallel *pool,
                                     const bst_streak_locator_limits *limits,
                                     bst_streak_locator *out) {
    *out = (bst_streak_locator){0};
    int side = (int)ceil(1.25 * limits->max_px + 6.0 * limits->fwhm_px) + 14;
    side = side < BST_PSF_MAX_SIDE ? side : BST_PSF_MAX_SIDE;
    bst_status status = bst_streak_search_create(ctx, pool, limits->max_width, limits->max_height,
                                                 limits->max_px, &out->search);
    if (status == BST_OK) {
        status = bst_streak_fit_create(ctx, psf, side, &out->fit);
    }
    if (status == BST_OK) {
        out->excluded = calloc((size_t)side * (size_t)side, 1);
        out->pieces = calloc(MOST_PIECES, sizeof *out->pieces);
        if (!out->excluded || !out->pieces) {
            status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a stamp of %d px", side);
        }
    }
    if (status != BST_OK) {
        bst_streak_locator_free(out);
    }
    return status;
}

void bst_streak_locator_free(bst_streak_locator *l) {
    bst_streak_search_free(&l->search);
    bst_streak_fit_free(&l->fit);
    free(l->excluded);
    free(l->pieces);
    *l = (bst_streak_locator){0};
}

/* Radius at which a matched-filtered point of this SNR falls below half a standard deviation, with
 * a margin for PSF errors, px. */
static double disc_radius(double snr, double sigma_px) {
    return 2.3 * sigma_px * sqrt(log(2.0 * fmax(snr, 2.0))) + 0.5;
}

/* Distance from a line, px, and position along it, 0 to 1. */
static double distance_to_line(const bst_streak_line *line, double x, double y, double *along) {
    double ux = line->x1 - line->x0, uy = line->y1 - line->y0;
    double length = fmax(hypot(ux, uy), 1e-6);
    double px = x - line->x0, py = y - line->y0;
    *along = (px * ux + py * uy) / (length * length);
    return fabs(px * uy - py * ux) / length;
}

/* Drops point sources that are fragments of a streak, up to beyond_px past its ends. Each has at
 * most SNR piece_snr, within noise. Returns their number and stores them in `pieces`. */
static int drop_fragments(bst_streak_locator *l, bst_imgproc_locator *found, int count,
                          const bst_streak_line *line, double sigma_px, double piece_snr,
                          double beyond_px) {
    double length = hypot(line->x1 - line->x0, line->y1 - line->y0);
    int pieces = 0;
    for (int i = 0; i < count && pieces < MOST_PIECES; i++) {
        bst_imgproc_found *f = &found->found[i];
        double along,
            distance = distance_to_line(line, f->source.shape.x_px, f->source.shape.y_px, &along);
        double beyond = fmax(-along, along - 1.0) * length;
        bool inside = distance < 3.0 * sigma_px + 0.5 && beyond < beyond_px;
        bool own = !f->streak && f->snr > OWN_LIGHT * piece_snr + OWN_LIGHT_SNR;
        if (inside && !own && !f->dropped && !bst_label_is_charge(f->label)) {
            f->dropped = true;
            assert(pieces < found->capacity);
            l->pieces[pieces++] = i;
        }
    }
    return pieces;
}

/* Masks pixels of a stamp that hold light of other sources. */
static void mask_other_sources(bst_streak_locator *l, const bst_locate_frame *f,
                               const bst_imgproc_locator *found, int count,
                               const bst_imgproc_stamp *stamp) {
    memset(l->excluded, 0, (size_t)stamp->width * (size_t)stamp->height);
    for (int i = 0; i < count; i++) {
        const bst_imgproc_found *o = &found->found[i];
        double x = o->source.shape.x_px - stamp->x0, y = o->source.shape.y_px - stamp->y0;
        double radius = disc_radius(o->snr, f->sigma_px);
        if (o->dropped || bst_label_is_charge(o->label) || x < -radius || y < -radius ||
            x > stamp->width + radius || y > stamp->height + radius) {
            continue;
        }
        int top = (int)fmax(ceil(y - radius), 0.0);
        int bottom = (int)fmin(floor(y + radius), stamp->height - 1.0);
        int left = (int)fmax(ceil(x - radius), 0.0);
        int right = (int)fmin(floor(x + radius), stamp->width - 1.0);
        for (int v = top; v <= bottom; v++) {
            for (int u = left; u <= right; u++) {
                if (hypot(u - x, v - y) <= radius) {
                    l->excluded[v * stamp->width + u] = 1;
                }
            }
        }
    }
}

/* True if a streak's light is cut by the frame's edge. */
static bool at_edge(const bst_locate_frame *f, const bst_imgproc_shape *s) {
    double x = 0.5 * fabs(s->dx_px) + 2.0 * f->sigma_px;
    double y = 0.5 * fabs(s->dy_px) + 2.0 * f->sigma_px;
    return s->x_px - x < -0.5 || s->y_px - y < -0.5 || s->x_px + x > f->width - 0.5 ||
           s->y_px + y > f->height - 0.5;
}

/* Covariance of a line whose fit failed: across it that of a point of its SNR, along it a third of
 * its length. */
static void set_line_covariance(const bst_locate_frame *f, const bst_streak_line *line,
                                bst_imgproc_found *out) {
    bst_imgproc_source *s = &out->source;
    double length = hypot(s->shape.dx_px, s->shape.dy_px);
    double c = s->shape.dx_px / length, d = s->shape.dy_px / length;
    /* 0.2 px, design choice: error of the refined line besides noise */
    double across2 = 2.0 * f->sigma_px * f->sigma_px / (line->snr * line->snr) + 0.04;
    double along2 = length * length / 9.0;
    s->cov_xx = along2 * c * c + across2 * d * d;
    s->cov_xy = (along2 - across2) * c * d;
    s->cov_yy = along2 * d * d + across2 * c * c;
    s->flux_variance = s->flux_e * s->flux_e / (line->snr * line->snr);
}

/* A streak measured from a detected line. */
typedef struct measured_streak {
    bst_imgproc_found streak;
    bst_imgproc_stamp stamp;
    bool fitted; /* false: the fit failed, and the values are those of the line */
} measured_streak;

/* Measures the streak of a detected line: fits position, path and flux. */
static void measure_streak(bst_streak_locator *l, const bst_locate_frame *f,
                           const bst_imgproc_locator *found, int count, const bst_streak_line *line,
                           double beyond_px, measured_streak *result) {
    bst_imgproc_found *out = &result->streak;
    bst_imgproc_stamp *stamp = &result->stamp;
    *out = (bst_imgproc_found){.peak_snr = (float)line->snr, .streak = true};
    bst_imgproc_source *s = &out->source;
    s->shape = (bst_imgproc_shape){.x_px = 0.5 * (line->x0 + line->x1),
                                   .y_px = 0.5 * (line->y0 + line->y1),
                                   .dx_px = line->x1 - line->x0,
                                   .dy_px = line->y1 - line->y0,
                                   .sigma_px = found->profiles.sigma_px};
    s->widening_px2 = bst_frame_width_mean(&found->width);
    out->noise_e = bst_background_noise_at(f->background, s->shape.x_px, s->shape.y_px);
    double length = hypot(s->shape.dx_px, s->shape.dy_px);
    /* norm of a streak that is long compared with the PSF: 1 / sqrt(2 sqrt(pi) sigma length) */
    double norm = 1.0 / sqrt(2.0 * sqrt(BST_PI) * f->sigma_px * (length + 2.0));
    s->flux_e = line->snr * out->noise_e / norm;
    double reach = fmax(3.0, ceil(3.6 * f->sigma_px)) + 0.1 * length + beyond_px;
    *stamp = bst_fit_stamp(s, reach, l->fit.max_side, f->width, f->height);
    bst_fit_data data = {f->signal, f->width, f->height, out->noise_e, f->excess};
    mask_other_sources(l, f, found, count, stamp);
    result->fitted = bst_streak_fit_run(&l->fit, &data, stamp, l->excluded, s, &norm);
    if (!result->fitted) {
        set_line_covariance(f, line, out);
    }
    out->peak_x = (int)floor(s->shape.x_px + 0.5);
    out->peak_y = (int)floor(s->shape.y_px + 0.5);
    out->snr = s->flux_e * norm / out->noise_e;
    double path = hypot(s->shape.dx_px, s->shape.dy_px);
    double variance = f->sigma_px * f->sigma_px;
    out->length_px = BST_FWHM_PER_SIGMA * sqrt(path * path / 12.0 + variance);
    out->width_px = BST_FWHM_PER_SIGMA * f->sigma_px;
    double angle = atan2(s->shape.dy_px, s->shape.dx_px);
    out->angle_rad = angle > 0.5 * BST_PI     ? angle - BST_PI
                     : angle <= -0.5 * BST_PI ? angle + BST_PI
                                              : angle;
    out->flags = BST_DETECTION_STREAK;
    if (at_edge(f, &s->shape)) {
        out->flags |= BST_DETECTION_EDGE;
    }
    const bst_imgproc_shape *p = &s->shape;
    if (p->x_px < -0.5 || p->y_px < -0.5 || p->x_px > f->width - 0.5 || p->y_px > f->height - 0.5) {
        out->label = BST_LABEL_ARTEFACT;
        out->label_probability = 0.9;
    }
}

/* Chi-square of the dropped fragments as separate point sources, on the stamp of the latest fit. */
static double chi_square_of_points(bst_streak_locator *l, const bst_locate_frame *f,
                                   const bst_imgproc_locator *found, int pieces,
                                   const bst_imgproc_stamp *stamp, double noise) {
    size_t n = (size_t)stamp->width * (size_t)stamp->height;
    double *total = l->fit.image, *share = total + n, chi = 0.0;
    memset(total, 0, n * sizeof(double));
    for (int i = 0; i < pieces; i++) {
        const bst_imgproc_source *s = &found->found[l->pieces[i]].source;
        bst_imgproc_gauss_render(l->fit.psf, &s->shape, stamp, share, share + n, share + 2 * n,
                                 share + 3 * n);
        for (size_t k = 0; k < n; k++) {
            total[k] += s->flux_e * (share[k] + s->widening_px2 * share[k + 3 * n]);
        }
    }
    for (int j = 0; j < stamp->height; j++) {
        const float *row =
            f->signal + (size_t)(stamp->y0 + j) * (size_t)f->width + (size_t)stamp->x0;
        for (int i = 0; i < stamp->width; i++) {
            size_t k = (size_t)j * (size_t)stamp->width + (size_t)i;
            if (!l->excluded[k] && row[i] > BST_PIXEL_NONE) {
                double r = (double)row[i] - total[k];
                chi += r * r / (noise * noise + fmax(total[k], 0.0));
            }
        }
    }
    return chi;
}

/* Combined SNR of the two brightest points on the line; the streak map limits their values. */
static double snr_of_points(const bst_streak_locator *l, const bst_imgproc_locator *found,
                            int pieces, const bst_streak_line *line) {
    double first = line->point_snr[0], second = line->point_snr[1];
    for (int i = 0; i < pieces; i++) {
        const bst_imgproc_found *f = &found->found[l->pieces[i]];
        double snr = f->streak ? 0.0 : f->snr;
        if (snr > first) {
            second = i > 0 ? first : second;
            first = snr;
        } else if (snr > second) {
            second = snr;
        }
    }
    return hypot(first, second);
}

/* True if the fit converged to a streak that is already found. */
static bool is_known(const bst_locate_frame *f, const bst_imgproc_locator *found, int points,
                     const bst_imgproc_found *streak) {
    for (int i = points; i < found->count; i++) {
        const bst_imgproc_shape *s = &found->found[i].source.shape;
        bst_streak_line line = {.x0 = s->x_px - 0.5 * s->dx_px,
                                .y0 = s->y_px - 0.5 * s->dy_px,
                                .x1 = s->x_px + 0.5 * s->dx_px,
                                .y1 = s->y_px + 0.5 * s->dy_px};
        const bst_imgproc_shape *n = &streak->source.shape;
        double along, distance = distance_to_line(&line, n->x_px, n->y_px, &along);
        double turn =
            fabs(s->dx_px * n->dy_px - s->dy_px * n->dx_px) / fmax(hypot(s->dx_px, s->dy_px), 1.0);
        if (distance < 3.0 * f->sigma_px && along > -0.1 && along < 1.1 &&
            turn < 8.0 * f->sigma_px) {
            return true;
        }
    }
    return false;
}

/* Adds a detected line as a streak if it explains the data better than point sources. Points up to
 * beyond_px past its ends become its fragments; with `bare`, only those not too bright for it.
 * Returns false, with all points restored, if the points explain the data better. */
static bool try_streak(bst_streak_locator *l, const bst_locate_frame *f, bst_imgproc_locator *found,
                       int points, const bst_streak_line *line, double beyond_px, bool bare) {
    double length = hypot(line->x1 - line->x0, line->y1 - line->y0);
    double piece =
        bare ? line->snr * sqrt(3.5 * f->sigma_px / (length + 3.5 * f->sigma_px)) : INFINITY;
    int pieces = drop_fragments(l, found, points, line, f->sigma_px, piece, beyond_px);
    measured_streak own;
    measure_streak(l, f, found, points, line, beyond_px, &own);
    const bst_imgproc_found *streak = &own.streak;
    /* a line whose SNR comes from other sources loses it once they are masked */
    bool good = own.fitted ? streak->snr > line->snr - LOST_SNR : bare && pieces == 0;
    good = good && !is_known(f, found, points, streak);
    if (good && pieces > 0) {
        /* parameters: three per point, five per streak */
        int parameters = 0;
        for (int k = 0; k < pieces; k++) {
            parameters += found->found[l->pieces[k]].streak ? 5 : 3;
        }
        double chi = chi_square_of_points(l, f, found, pieces, &own.stamp, streak->noise_e);
        good = streak->snr > snr_of_points(l, found, pieces, line) &&
               streak->source.chi_square + 5.0 <= chi + parameters;
    }
    for (int k = 0; k < pieces; k++) {
        found->found[l->pieces[k]].dropped = good;
    }
    if (good) {
        assert(found->count < found->capacity);
        found->found[found->count++] = *streak;
    }
    return good;
}

/* Tests the detected lines and adds the streaks among them. */
static void add_streaks(bst_streak_locator *l, const bst_locate_frame *f,
                        bst_imgproc_locator *found, int points, int lines) {
    for (int i = 0; i < lines && found->count < found->capacity; i++) {
        const bst_streak_line *line = &l->search.found[i];
        /* a point may be the only visible part of the streak, or a star on or beside it */
        double hidden = 2.0 * disc_radius(line->snr, f->sigma_px);
        if (!try_streak(l, f, found, points, line, hidden, false)) {
            try_streak(l, f, found, points, line, 3.0 * f->sigma_px, true);
        }
    }
}

/* Masks a point in the streak map. */
static void mask_point(bst_streak_locator *l, double x, double y, double snr, double sigma,
                       double widen) {
    bst_streak_map_blank(&l->search.map, x, y, x, y, widen * disc_radius(snr, sigma));
}

/* Masks a cosmic-ray track in the streak map, whose faint pixels are not masked in the signal. */
static void mask_cosmic_ray(bst_streak_locator *l, const bst_imgproc_found *o) {
    /* half length of a uniform track, from its second moment */
    double half = 0.5 * sqrt(12.0) / BST_FWHM_PER_SIGMA * o->length_px;
    double dx = half * cos(o->angle_rad), dy = half * sin(o->angle_rad);
    double x = o->source.shape.x_px, y = o->source.shape.y_px;
    bst_streak_map_blank(&l->search.map, x - dx, y - dy, x + dx, y + dy,
                         3.0 * o->source.shape.sigma_px + 1.5);
}

/* Run of pixels above the threshold in row y that touches columns *lo to *hi, which it replaces.
 * Returns its length; 0: none. */
static int run_above_threshold(const bst_filter *filter, double threshold, int y, int *lo,
                               int *hi) {
    int first = *lo - 1, last = *hi + 1, count = 0;
    while (first <= last && !(first >= 0 && first < filter->width &&
                              (double)bst_filter_point_at(filter, first, y) > threshold)) {
        first++;
    }
    while (last >= first && !(last >= 0 && last < filter->width &&
                              (double)bst_filter_point_at(filter, last, y) > threshold)) {
        last--;
    }
    if (first > last) {
        return 0;
    }
    while (first > 0 && (double)bst_filter_point_at(filter, first - 1, y) > threshold) {
        first--;
    }
    while (last < filter->width - 1 &&
           (double)bst_filter_point_at(filter, last + 1, y) > threshold) {
        last++;
    }
    for (int x = first; x <= last; x++) {
        count += (double)bst_filter_point_at(filter, x, y) > threshold;
    }
    *lo = first;
    *hi = last;
    return count;
}

/* Number of pixels above the threshold connected to a maximum, row by row; counting stops at
 * `enough`. */
static int area_above_threshold(const bst_filter *filter, double threshold, int x, int y,
                                double enough) {
    int lo = x, hi = x, count = run_above_threshold(filter, threshold, y, &lo, &hi);
    for (int step = -1; step <= 1; step += 2) {
        int l = lo, h = hi, more = count;
        for (int v = y + step; more > 0 && v >= 0 && v < filter->height && count < enough;
             v += step) {
            more = run_above_threshold(filter, threshold, v, &l, &h);
            count += more;
        }
    }
    return count;
}

/* True if a source is too bright for a streak fragment of its area. A filtered point exceeds a
 * threshold t on 4 pi sigma^2 ln(snr / t) pixels. */
static bool is_bright_point(const bst_locate_frame *f, const bst_imgproc_found *o) {
    double snr = (double)o->peak_snr, threshold = f->filter->threshold;
    if (o->streak || (o->flags & BST_DETECTION_BLEND) || !(snr > BRIGHT_POINT_SNR)) {
        return false;
    }
    double area = 4.0 * BST_PI * f->sigma_px * f->sigma_px * log(fmax(snr / threshold, 1.0));
    double most = AREA_SHARE * area + AREA_PIXELS;
    return area_above_threshold(f->filter, threshold, o->peak_x, o->peak_y, most) < most;
}

void bst_streak_locate(bst_streak_locator *l, const bst_locate_frame *f,
                       const bst_candidates *candidates, double false_alarms,
                       bst_imgproc_locator *found) {
    assert(l && f && candidates && found && false_alarms > 0.0);
    int points = found->count;
    bst_streak_search_fill(&l->search, f->signal, f->width, f->height, f->background, f->sigma_px);
    for (int i = 0; i < points; i++) {
        const bst_imgproc_found *o = &found->found[i];
        bool saturated = o->flags & BST_DETECTION_SATURATED;
        if (bst_label_is_charge(o->label)) {
            mask_cosmic_ray(l, o);
        } else if (saturated || is_bright_point(f, o)) {
            mask_point(l, o->source.shape.x_px, o->source.shape.y_px, o->snr, f->sigma_px,
                       saturated ? 1.5 : 1.0);
        }
    }
    /* with so many points, chance alignments of points are everywhere */
    if (candidates->count < CROWD_PER_PX * (double)f->width * (double)f->height) {
        add_streaks(l, f, found, points, bst_streak_search_bright(&l->search));
    }
    int light = 0;
    for (int i = 0; i < points; i++) {
        const bst_imgproc_found *o = &found->found[i];
        if (!o->dropped && !bst_label_is_charge(o->label)) {
            light++;
            mask_point(l, o->source.shape.x_px, o->source.shape.y_px, o->snr, f->sigma_px, 1.0);
        }
    }
    for (int i = points; i < candidates->count; i++) {
        const bst_candidate *c = &candidates->items[candidates->order[i]];
        mask_point(l, c->x, c->y, (double)c->snr, f->sigma_px, 1.0);
    }
    add_streaks(l, f, found, points, bst_streak_search_faint(&l->search, false_alarms, light));
}
