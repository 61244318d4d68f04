#include "imgproc/streak/streak_fragments.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/messages.h"
#include "boresight/vec.h"
#include "imgproc/measure/peak_centroid.h"
#include "imgproc/streak/streak_rays.h"
#include "sim/onboard/discriminate.h"

enum { ROUNDS = 12, FEW_SOURCES = 32 };

/* Variance of a place uniform over a pixel, px^2: widens the PSF to its integral over pixels. */
static const double PIXEL_VARIANCE = 1.0 / 12.0;
/* Sources per pixel from which stars line up everywhere: a source per 41 px. */
static const double CROWD_PER_PX = 0.0006;
/* Half width of the fitted pixels, and their reach beyond the ends, sigma. */
static const double BAND_SIGMA = 4.0, BEYOND_SIGMA = 5.0;
/* Least distance of two maxima on a streak, px: they are no neighbours. */
static const double LEAST_SPACING = 2.0;
/* Half length of the shortest segment, sigma: a shorter one is a blend of two points. */
static const double LEAST_HALF_SIGMA = 3.0;
/* A bend is fitted to segments of this half length, sigma, if chi-square falls by BEND_GAIN. The
 * middle is then at most MOST_BEND of the half length beside the chord. */
static const double BENT_SIGMA = 6.0, BEND_GAIN = 9.0, MOST_BEND = 0.25;
/* Gain of chi-square by which a segment replaces one source, or several; that of a streak with a
 * length which is not fitted may be better by chance. */
static const double ONE_GAIN = 22.0, SOME_GAIN = 9.0, WHOLE_GAIN = -6.0;
/* A point of more than OWN_SHARE of the line's brightness, and OWN_SNR more, is another source. */
static const double OWN_SHARE = 1.5, OWN_SNR = 5.0;
/* Segments along the stars' streaks up to this many of their lengths may be stars in a row. */
static const double STARS_IN_ROW = 2.5;
/* Share of the squared SNR that errors of the PSF and of the rate may add to chi-square. */
static const double UNEVEN_SHARE = 0.05;
/* Pixels on a segment's line are at most 1 px apart along it where none is left out. */
static const double LEAST_HIDDEN_PX = 2.0;
/* Step by which a segment is shortened to the frame. */
static const double TRIM_PX = 0.25;
/* Distance from the frame, sigma, from which no light reaches it: 1e-3 of a segment's brightness.
 */
static const double CUT_SIGMA = 3.0;
/* Standard deviation of the place of a streak that the frame cuts, share of its visible length: the
 * mean square for lengths of which a third to all is visible is 0.42 of it. */
static const double CUT_SHARE = 0.5;

bst_status bst_streak_fragments_create(bst_ctx *ctx, int width, int height, double max_sigma_px,
                                       bst_streak_fragments *out) {
    assert(out && width > 0 && height > 0 && max_sigma_px > 0.0);
    double sigma = sqrt(max_sigma_px * max_sigma_px + PIXEL_VARIANCE);
    double length = hypot(width, height) + 2.0 * BEYOND_SIGMA * sigma;
    *out =
        (bst_streak_fragments){.capacity = (int)(1.5 * length * (2.0 * BAND_SIGMA * sigma + 2.0)),
                               .fragment_capacity = (int)ceil(length / LEAST_SPACING)};
    out->pixels = calloc((size_t)out->capacity, sizeof *out->pixels);
    out->fragments = calloc((size_t)out->fragment_capacity, sizeof *out->fragments);
    out->parts = calloc((size_t)out->fragment_capacity, sizeof *out->parts);
    if (!out->pixels || !out->fragments || !out->parts) {
        bst_streak_fragments_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pixels of long streaks");
    }
    return BST_OK;
}

void bst_streak_fragments_free(bst_streak_fragments *s) {
    free(s->pixels);
    free(s->fragments);
    free(s->parts);
    *s = (bst_streak_fragments){0};
}

/* A frame, its sources and the PSF in it. */
typedef struct view {
    const bst_locate_frame *f;
    bst_imgproc_locator *l;
    double sigma; /* of the PSF with the pixel, px */
    bst_streak_rays rays;
} view;

/* True for a streak of unknown rate. */
static bool is_own_streak(const view *v, const bst_imgproc_found *s) {
    return s->streak && (s->own_streak || !v->f->filter->streak);
}

/* True if the source may have light at a place on the segment: it is no charge. */
static bool is_light(const bst_imgproc_found *s) {
    return !s->dropped && !s->bleed && !bst_label_is_charge(s->label);
}

/* Segment of a source's path; a point has length 0. */
static bst_segment segment_of(const view *v, const bst_imgproc_source *s) {
    const bst_imgproc_shape *p = &s->shape;
    return (bst_segment){.x_px = p->x_px,
                         .y_px = p->y_px,
                         .angle_rad = atan2(p->dy_px, p->dx_px),
                         .half_px = 0.5 * hypot(p->dx_px, p->dy_px),
                         .flux_e = s->flux_e,
                         .sigma_px = v->sigma};
}

/* Place of a source on a segment, in the segment's own coordinates. */
typedef struct position {
    double across, near_px; /* near_px: of its nearer end from the segment's middle, along it */
    double side;            /* -1 or 1: the end of the segment that it is nearer to */
} position;

static position position_on(const view *v, const bst_segment *on, const bst_imgproc_found *s) {
    const bst_segment path = segment_of(v, &s->source);
    position out = {0};
    bool streak = is_own_streak(v, s);
    double middle;
    out.across = bst_segment_distance(on, path.x_px, path.y_px, &middle);
    out.near_px = fabs(middle);
    out.side = middle < 0.0 ? -1.0 : 1.0;
    for (int e = -1; streak && e <= 1; e += 2) {
        double x, y, along;
        bst_segment_place(&path, e * path.half_px, &x, &y);
        out.across = fmax(out.across, bst_segment_distance(on, x, y, &along));
        out.near_px = fmin(out.near_px, fmax(out.side * along, 0.0));
    }
    return out;
}

/* Takes the pixels along a segment that hold no light of others; false: too many. */
static bool take_pixels(bst_streak_fragments *j, const view *v, const bst_segment *s) {
    const double band = BAND_SIGMA * v->sigma, reach = s->half_px + BEYOND_SIGMA * v->sigma;
    const double c = fabs(cos(s->angle_rad)), q = fabs(sin(s->angle_rad));
    const double bow = fabs(s->bend_per_px) * s->half_px * s->half_px + band;
    int x0 = (int)fmax(ceil(s->x_px - c * reach - q * bow), 0.0);
    int x1 = (int)fmin(floor(s->x_px + c * reach + q * bow), v->f->width - 1.0);
    int y0 = (int)fmax(ceil(s->y_px - q * reach - c * bow), 0.0);
    int y1 = (int)fmin(floor(s->y_px + q * reach + c * bow), v->f->height - 1.0);
    j->count = 0;
    for (int y = y0; y <= y1; y++) {
        const float *row = v->f->signal + (size_t)y * (size_t)v->f->width;
        for (int x = x0; x <= x1; x++) {
            double along, across = bst_segment_distance(s, x, y, &along);
            if (across > band || fabs(along) > reach || !(row[x] > BST_PIXEL_NONE)) {
                continue;
            }
            if (j->count == j->capacity) {
                return false;
            }
            j->pixels[j->count++] = (bst_segment_pixel){(float)x, (float)y, row[x]};
        }
    }
    return true;
}

/* Leaves out the pixels that hold light of a source. */
static void leave_out(bst_streak_fragments *j, const view *v, const bst_imgproc_found *s) {
    const bst_segment path = segment_of(v, &s->source);
    /* where a filtered point of this SNR falls below half a standard deviation */
    double radius = 2.3 * v->sigma * sqrt(log(2.0 * fmax(s->snr, 2.0))) + 0.5;
    int kept = 0;
    for (int i = 0; i < j->count; i++) {
        const bst_segment_pixel *p = &j->pixels[i];
        double along,
            across = bst_segment_distance(&path, (double)p->x_px, (double)p->y_px, &along);
        double beyond = fmax(fabs(along) - path.half_px, 0.0);
        if (hypot(across, beyond) > radius) {
            j->pixels[kept++] = *p;
        }
    }
    j->count = kept;
}

/* Leaves out the pixels beyond an end of a segment, from along_px on. */
static void leave_out_beyond(bst_streak_fragments *j, const bst_segment *on, double side,
                             double along_px) {
    int kept = 0;
    for (int i = 0; i < j->count; i++) {
        const bst_segment_pixel *p = &j->pixels[i];
        double along;
        (void)bst_segment_distance(on, (double)p->x_px, (double)p->y_px, &along);
        if (side * along < along_px) {
            j->pixels[kept++] = *p;
        }
    }
    j->count = kept;
}

/* Sorts the sources near a segment into its fragments and others, whose pixels are left out: of one
 * on the segment's line beyond its end, those beyond the middle of the gap. */
static void sort_sources(bst_streak_fragments *j, const view *v, const bst_segment *on,
                         double line) {
    j->fragment_count = 0;
    for (int i = 0; i < v->l->count; i++) {
        const bst_imgproc_found *s = &v->l->found[i];
        const bst_imgproc_shape *p = &s->source.shape;
        double reach = 12.0 * v->sigma + 0.5 * hypot(p->dx_px, p->dy_px);
        double near, beside = bst_segment_distance(on, p->x_px, p->y_px, &near);
        if (!is_light(s) || beside > reach || fabs(near) > on->half_px + reach) {
            continue;
        }
        const position at = position_on(v, on, s);
        bool alike = at.across < 3.0 * v->sigma &&
                     bst_streak_rays_peak(&v->rays, s) < OWN_SHARE * line + OWN_SNR;
        double gap = at.near_px - on->half_px;
        if (!alike) {
            leave_out(j, v, s);
        } else if (gap > 2.0 * v->sigma) {
            leave_out_beyond(j, on, at.side, on->half_px + 0.5 * gap);
        } else if (j->fragment_count < j->fragment_capacity) {
            j->fragments[j->fragment_count++] = i;
        }
    }
}

/* A segment, its fit, and the output of the filter for points on it. */
typedef struct line {
    bst_segment segment;
    bst_segment_errors errors;
    double output;
    double hidden_px[2]; /* width of the left-out pixels in which its start and end are; 0: none */
} line;

static double output_of(const bst_segment *s, double noise_e) {
    return s->flux_e / (2.0 * s->half_px * noise_e);
}

/* True if a place on a segment is in the frame, or outside by less than margin_px. */
static bool is_inside(const view *v, const bst_segment *s, double along, double margin_px) {
    double x, y, m = 0.5 + margin_px;
    bst_segment_place(s, along, &x, &y);
    return x >= -m && y >= -m && x <= v->f->width - 1.0 + m && y <= v->f->height - 1.0 + m;
}

/* True if the frame cuts an end of a segment, or may do so; side: -1 or 1. */
static bool is_cut(const view *v, const bst_segment *s, double side) {
    return !is_inside(v, s, side * (s->half_px + 2.0 * v->sigma), 0.0);
}

/* Place along a segment where it leaves the frame by margin_px, if its end is cut, or its end. */
static double end_in_frame(const view *v, const bst_segment *s, double side, double margin_px) {
    if (!is_cut(v, s, side)) {
        return side * s->half_px;
    }
    double along = 0.0, most = s->half_px + 4.0 * v->sigma + 4.0 * margin_px;
    while (along < most && is_inside(v, s, side * along, margin_px)) {
        along += TRIM_PX;
    }
    return side * along;
}

/* Moves the ends that the frame cuts to where the segment leaves it by margin_px. */
static void trim(const view *v, double margin_px, bst_segment *s) {
    double start = end_in_frame(v, s, -1.0, margin_px), end = end_in_frame(v, s, 1.0, margin_px);
    double least = 0.5 * (start + end) - TRIM_PX;
    *s = bst_segment_part(s, fmin(start, least), fmax(end, least + 2.0 * TRIM_PX));
}

/* True if chi-square on a number of pixels is that of noise. */
static bool is_even(const bst_segment_errors *e, int count) {
    return e->chi_square < count + sqrt(2.0 * count);
}

/* Fits a segment to the pixels about it, bent if that is better. Light beyond the frame's edge
 * would fit with any length: an end that is cut is where no light of what follows reaches the
 * frame. */
static bool fit(bst_streak_fragments *j, const view *v, double noise_e, line *at) {
    bst_segment_freedom freedom = {.bent = false};
    freedom.held[0] = is_cut(v, &at->segment, -1.0) || at->hidden_px[0] > 0.0;
    freedom.held[1] = is_cut(v, &at->segment, 1.0) || at->hidden_px[1] > 0.0;
    trim(v, CUT_SIGMA * v->sigma, &at->segment);
    if (!take_pixels(j, v, &at->segment)) {
        return false;
    }
    sort_sources(j, v, &at->segment, at->output);
    const bst_segment_data data = {j->pixels, j->count, noise_e, v->f->excess};
    const double beyond = (BEYOND_SIGMA - 2.0) * v->sigma;
    bool good = bst_segment_fit_run(&data, beyond, &freedom, &at->segment, &at->errors);
    if (good && at->segment.half_px > BENT_SIGMA * v->sigma) {
        line bent = *at;
        freedom.bent = true;
        if (!is_even(&at->errors, j->count) &&
            bst_segment_fit_run(&data, beyond, &freedom, &bent.segment, &bent.errors) &&
            fabs(bent.segment.bend_per_px) * bent.segment.half_px < MOST_BEND &&
            bent.errors.chi_square < at->errors.chi_square - BEND_GAIN) {
            *at = bent;
        }
    }
    at->output = output_of(&at->segment, noise_e);
    return good;
}

/* Pixels along a segment's line on both sides of a place. */
typedef struct gap {
    double inner, outer;
} gap;

static gap gap_at(const bst_streak_fragments *j, const view *v, const bst_segment *s, double side,
                  double place) {
    gap g = {-s->half_px, s->half_px + BEYOND_SIGMA * v->sigma};
    for (int i = 0; i < j->count; i++) {
        const bst_segment_pixel *p = &j->pixels[i];
        double along, across = bst_segment_distance(s, (double)p->x_px, (double)p->y_px, &along);
        along *= side;
        if (across < v->sigma + 0.5) {
            g.inner = along <= place ? fmax(g.inner, along) : g.inner;
            g.outer = along > place ? fmin(g.outer, along) : g.outer;
        }
    }
    return g;
}

/* Moves an end that is among left-out pixels, or near their edge, to their middle; side: -1 or 1.
 * Returns their width. */
static double centre_hidden(const bst_streak_fragments *j, const view *v, double side,
                            bst_segment *s) {
    const double half = s->half_px, places[3] = {half, half + v->sigma, half - 2.0 * v->sigma};
    for (int k = 0; k < 3 && !is_cut(v, s, side); k++) {
        const gap g = gap_at(j, v, s, side, places[k]);
        if (g.outer - g.inner > LEAST_HIDDEN_PX) {
            const double end = side * 0.5 * (g.inner + g.outer), other = -side * half;
            *s = bst_segment_part(s, fmin(end, other), fmax(end, other));
            return g.outer - g.inner;
        }
    }
    return 0.0;
}

/* Fits a segment with its hidden ends held; false: it is no segment. */
static bool hold_hidden(bst_streak_fragments *j, const view *v, double noise_e, line *at) {
    at->hidden_px[0] = centre_hidden(j, v, -1.0, &at->segment);
    at->hidden_px[1] = centre_hidden(j, v, 1.0, &at->segment);
    return (at->hidden_px[0] == 0.0 && at->hidden_px[1] == 0.0) || fit(j, v, noise_e, at);
}

/* Moves the ends of a segment outwards to where the light ends; false: it is no segment. */
static bool grow(bst_streak_fragments *j, const view *v, double noise_e, line *at) {
    for (int round = 0; round < ROUNDS; round++) {
        const bst_segment before = at->segment;
        if (!fit(j, v, noise_e, at)) {
            return false;
        }
        double change = fabs(at->segment.half_px - before.half_px) +
                        hypot(at->segment.x_px - before.x_px, at->segment.y_px - before.y_px);
        double back = bst_streak_rays_beyond(&v->rays, &at->segment, -1.0, at->output);
        double ahead = bst_streak_rays_beyond(&v->rays, &at->segment, 1.0, at->output);
        if (back + ahead < 2.0 * v->sigma) {
            if (change < v->sigma) {
                break;
            }
            continue; /* with the pixels about the ends of the fit */
        }
        if (round + 1 == ROUNDS) {
            return false; /* its ends do not settle */
        }
        at->segment = bst_segment_part(&at->segment, -at->segment.half_px - back,
                                       at->segment.half_px + ahead);
    }
    return hold_hidden(j, v, noise_e, at);
}

/* Chi-square of the fragments as sources of their own, and their number of parameters. */
static double chi_square_of_fragments(const bst_streak_fragments *j, const view *v, double noise_e,
                                      int *parameters) {
    bst_segment *part = j->parts;
    *parameters = 0;
    for (int k = 0; k < j->fragment_count; k++) {
        const bst_imgproc_found *s = &v->l->found[j->fragments[k]];
        part[k] = segment_of(v, &s->source);
        *parameters += is_own_streak(v, s) ? 5 : 3;
    }
    double chi = 0.0;
    for (int i = 0; i < j->count; i++) {
        const bst_segment_pixel *p = &j->pixels[i];
        double total = 0.0;
        for (int k = 0; k < j->fragment_count; k++) {
            const double x = (double)p->x_px - part[k].x_px, y = (double)p->y_px - part[k].y_px;
            const double reach = part[k].half_px + 8.0 * v->sigma;
            if (x * x + y * y < reach * reach) {
                total +=
                    part[k].flux_e * bst_segment_share(&part[k], (double)p->x_px, (double)p->y_px);
            }
        }
        double r = (double)p->signal_e - total;
        chi += r * r / (noise_e * noise_e + v->f->excess * fmax(total, 0.0));
    }
    return chi;
}

/* True if a segment may be the streaks of one star, or of two stars in a row. */
static bool is_star(const view *v, const bst_segment *s) {
    bst_imgproc_shape star = {.x_px = s->x_px, .y_px = s->y_px};
    if (!v->f->filter->streak) {
        return false;
    }
    bst_peak_centroid_star_path(v->f, &star);
    double c = cos(s->angle_rad), q = sin(s->angle_rad), length = hypot(star.dx_px, star.dy_px);
    double across = fabs(c * star.dy_px - q * star.dx_px) / length;
    return s->half_px * across < 2.0 * v->sigma &&
           2.0 * s->half_px < 2.0 * v->sigma + STARS_IN_ROW * length;
}

/* True if source i is one of the fragments. */
static bool has_fragment(const bst_streak_fragments *j, int i) {
    for (int k = 0; k < j->fragment_count; k++) {
        if (j->fragments[k] == i) {
            return true;
        }
    }
    return false;
}

/* True if a segment explains the light of its fragments better than these do. */
static bool is_better(const bst_streak_fragments *j, const view *v, double noise_e,
                      const line *at) {
    const double squared_snr = at->segment.flux_e * at->segment.flux_e * at->errors.norm *
                               at->errors.norm / (noise_e * noise_e);
    int of_parts, own = at->segment.bend_per_px == 0.0 ? 6 : 7, free = j->count - own;
    if (free < 1 || at->segment.half_px < LEAST_HALF_SIGMA * v->sigma || is_star(v, &at->segment) ||
        at->errors.chi_square > free + 4.0 * sqrt(2.0 * free) + UNEVEN_SHARE * squared_snr) {
        return false;
    }
    double parts = chi_square_of_fragments(j, v, noise_e, &of_parts);
    double gain = parts - at->errors.chi_square + 2.0 * (of_parts - own);
    bool whole = j->fragment_count == 1 && is_own_streak(v, &v->l->found[j->fragments[0]]);
    return gain > (whole ? WHOLE_GAIN : j->fragment_count == 1 ? ONE_GAIN : SOME_GAIN);
}

/* Adds the variance of the part beyond the frame to a streak that it cuts.
 *
 * Given:     turn_variance  of its direction, rad^2 */
static void widen_cut(const view *v, bst_imgproc_found *s, double turn_variance) {
    const bst_segment path = segment_of(v, &s->source);
    if (!is_cut(v, &path, -1.0) && !is_cut(v, &path, 1.0)) {
        return;
    }
    double along = 2.0 * CUT_SHARE * path.half_px, c = cos(path.angle_rad);
    double q = sin(path.angle_rad), along2 = along * along, across2 = along2 * turn_variance;
    s->source.cov_xx += along2 * c * c + across2 * q * q;
    s->source.cov_xy += (along2 - across2) * c * q;
    s->source.cov_yy += along2 * q * q + across2 * c * c;
    s->flags |= BST_DETECTION_EDGE;
}

/* Sum of the variances of the places of both ends, evenly among the pixels that hide them and one
 * sigma of the PSF beside these. */
static double ends_variance(const view *v, const line *at) {
    double sum = 0.0;
    for (int e = 0; e < 2; e++) {
        double width = at->hidden_px[e] > 0.0 ? at->hidden_px[e] + 2.0 * v->sigma : 0.0;
        sum += width * width / 12.0;
    }
    return sum;
}

/* Makes source i the streak of a segment and drops the other fragments. */
static void replace(bst_streak_fragments *j, const view *v, int i, const line *at) {
    bst_imgproc_found *s = &v->l->found[i];
    unsigned flags = BST_DETECTION_STREAK;
    for (int k = 0; k < j->fragment_count; k++) {
        bst_imgproc_found *part = &v->l->found[j->fragments[k]];
        flags |= part->flags & (unsigned)BST_DETECTION_SATURATED;
        part->dropped = true;
    }
    const bst_segment *g = &at->segment;
    const double c = cos(g->angle_rad), q = sin(g->angle_rad), ends = ends_variance(v, at);
    const double bend = 2.0 / 3.0 * g->bend_per_px * g->half_px * g->half_px;
    const double per_px = g->flux_e / (2.0 * g->half_px);
    s->dropped = false;
    s->streak = s->own_streak = s->joined = true;
    s->rough = false;
    s->flags = flags | (v->f->filter->streak ? BST_DETECTION_OTHER_PATH : 0u);
    s->label = BST_LABEL_UNKNOWN;
    s->label_probability = 0.0;
    s->source =
        (bst_imgproc_source){.shape = {.x_px = g->x_px,
                                       .y_px = g->y_px,
                                       .dx_px = 2.0 * g->half_px * c,
                                       .dy_px = 2.0 * g->half_px * q,
                                       .bend_x_px = -bend * q,
                                       .bend_y_px = bend * c,
                                       .sigma_px = v->l->profiles.sigma_px},
                             .flux_e = g->flux_e,
                             .widening_px2 = s->source.widening_px2,
                             .cov_xx = at->errors.cov_xx + 0.25 * ends * c * c,
                             .cov_xy = at->errors.cov_xy + 0.25 * ends * c * q,
                             .cov_yy = at->errors.cov_yy + 0.25 * ends * q * q,
                             .flux_variance = at->errors.flux_variance + ends * per_px * per_px,
                             .chi_square = at->errors.chi_square,
                             .pixels = j->count,
                             .fitted = true};
    s->snr = g->flux_e * at->errors.norm / s->noise_e;
    s->length_px =
        BST_FWHM_PER_SIGMA * sqrt(g->half_px * g->half_px / 3.0 + v->f->sigma_px * v->f->sigma_px);
    s->width_px = BST_FWHM_PER_SIGMA * v->f->sigma_px;
    s->angle_rad = remainder(g->angle_rad, BST_PI);
    widen_cut(v, s, at->errors.turn_variance);
}

/* Joins the fragments of the streak that source i is a part of, if it is one. */
static void join(bst_streak_fragments *j, const view *v, int i) {
    const bst_imgproc_found *s = &v->l->found[i];
    line at = {.output = 0.0};
    if (is_own_streak(v, s)) {
        at.segment = segment_of(v, &s->source);
        if (at.segment.half_px < LEAST_HALF_SIGMA * v->sigma) {
            return;
        }
    } else if (!bst_streak_rays_start(&v->rays, s, &at.segment)) {
        return;
    }
    at.output = output_of(&at.segment, s->noise_e);
    if (grow(j, v, s->noise_e, &at) && has_fragment(j, i) && is_better(j, v, s->noise_e, &at)) {
        /* the light beyond the frame is no light of its image: the SNR stays */
        double whole = at.segment.half_px;
        trim(v, 0.0, &at.segment);
        double share = at.segment.half_px / whole;
        at.errors.norm /= share;
        at.errors.flux_variance *= share * share;
        replace(j, v, i, &at);
    }
}

void bst_streak_fragments_join(bst_streak_fragments *j, const bst_locate_frame *f, int candidates,
                               bst_imgproc_locator *l) {
    assert(j && f && l && j->capacity > 0);
    view v = {.f = f, .l = l};
    bst_streak_rays_set(&v.rays, f);
    v.sigma = v.rays.sigma_px;
    const int sources = candidates > l->count ? candidates : l->count;
    bool crowd = sources > FEW_SOURCES + CROWD_PER_PX * (double)f->width * (double)f->height;
    for (int i = 0; i < l->count && !crowd; i++) {
        const bst_imgproc_found *s = &l->found[i];
        if (is_light(s) && !s->rough && s->label == BST_LABEL_UNKNOWN) {
            join(j, &v, i);
        }
    }
    /* those that were found whole */
    for (int i = 0; i < l->count; i++) {
        bst_imgproc_found *s = &l->found[i];
        if (is_light(s) && !s->joined && is_own_streak(&v, s)) {
            widen_cut(&v, s, 0.0);
        }
    }
}
