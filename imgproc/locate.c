#include "imgproc/locate.h"

#include <math.h>
#include <stdlib.h>

#include "imgproc/charge.h"

enum {
    CELL_PX = 16,
    MAX_FIXED = 12,
    FIRST_GROUP = 32, /* the brightest, which are fitted before the others */
    FITS_A_TIME = 16, /* of one thread; fewer are done before another thread wakes */
    STARTS_A_TIME = 512
};

static const double WIDTH_FIT_SNR = 20.0; /* from here the widening is measured */
static const double MOMENTS_SNR = 10.0;   /* below, extents are the model's own */
/* a streak's filter output above this share of a point's, and a point's whose square is less than a
 * streak's by no more than the other two: both shapes are tried */
static const double CLOSE_SHARE = 0.8, CLEAR_CHI = 3.0, CLEAR_SHARE = 0.04;

bst_status bst_locator_create(bst_ctx *ctx, bst_parallel *pool, int capacity, int max_width,
                              int max_height, int max_side, bst_locator *out) {
    int threads = bst_parallel_threads(pool);
    *out = (bst_locator){.pool = pool,
                         .max_side = max_side,
                         .capacity = capacity,
                         .columns = max_width / CELL_PX + 1,
                         .rows = max_height / CELL_PX + 1};
    bst_psf_init(&out->psf);
    bst_borrow_init(&out->lent, threads);
    out->found = calloc((size_t)capacity, sizeof *out->found);
    out->next = calloc((size_t)capacity, sizeof *out->next);
    out->cell = calloc((size_t)out->columns * (size_t)out->rows, sizeof *out->cell);
    out->charged_capacity = 16 * capacity;
    out->charged = calloc((size_t)out->charged_capacity, sizeof *out->charged);
    out->fits = calloc((size_t)threads, sizeof *out->fits);
    if (!out->found || !out->next || !out->cell || !out->charged || !out->fits) {
        bst_locator_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d detections", capacity);
    }
    bst_status status = bst_profiles_create(ctx, &out->profiles);
    for (int i = 0; i < threads && status == BST_OK; i++) {
        status = bst_fit_create(ctx, &out->psf, &out->profiles, max_side, &out->fits[i]);
    }
    if (status != BST_OK) {
        bst_locator_free(out);
    }
    return status;
}

void bst_locator_free(bst_locator *l) {
    free(l->found);
    free(l->next);
    free(l->cell);
    free(l->charged);
    for (int i = 0; l->fits && i < bst_parallel_threads(l->pool); i++) {
        bst_fit_free(&l->fits[i]);
    }
    free(l->fits);
    bst_profiles_free(&l->profiles);
    *l = (bst_locator){0};
}

static void set_star_path(const bst_locate_frame *f, bst_shape *s) {
    bst_motion_streak(f->motion, f->camera, f->origin_x_px + f->binning * s->x_px,
                      f->origin_y_px + f->binning * s->y_px, &s->dx_px, &s->dy_px);
    bst_motion_bend(f->motion, f->camera, &s->bend_x_px, &s->bend_y_px);
    s->dx_px /= f->binning;
    s->dy_px /= f->binning;
    s->bend_x_px /= f->binning;
    s->bend_y_px /= f->binning;
}

static double shape_norm(const bst_locate_frame *f, bool streak) {
    return streak ? f->filter->streak_norm : f->filter->norm;
}

/* Distance around a path inside which a source's light counts, px. */
static double reach(const bst_locate_frame *f) {
    return fmax(3.0, ceil(3.6 * f->sigma_px));
}

/* How far a fit may move a source from its maximum, px. */
static double fit_limit(const bst_locate_frame *f, double path_px) {
    return 1.5 + f->sigma_px + 0.4 * path_px;
}

/* A found one as a point or a streak at its maximum. */
static bst_source as_shape(const bst_locate_frame *f, const bst_found *found, bool streak) {
    bst_source s = {.flux_e = found->top_snr * found->noise_e / shape_norm(f, streak),
                    .widening_px2 = found->source.widening_px2};
    s.shape =
        (bst_shape){.x_px = found->top_x_px, .y_px = found->top_y_px, .sigma_px = f->sigma_px};
    if (streak) {
        set_star_path(f, &s.shape);
    }
    return s;
}

/* Starts a source at its candidate: at the top of the filter's output, between the pixels. */
static void start(const bst_locate_frame *f, const bst_candidate *c, bst_found *out) {
    *out = (bst_found){.peak_snr = c->snr, .peak_x = c->x, .peak_y = c->y};
    out->noise_e = bst_background_noise_at(f->background, c->x, c->y);
    double dx, dy;
    out->top_snr = bst_filter_top(f->filter, false, c->x, c->y, &dx, &dy);
    out->top_x_px = c->x + dx;
    out->top_y_px = c->y + dy;
    out->streak = f->filter->streak && c->snr > bst_filter_point_at(f->filter, c->x, c->y);
    out->source = as_shape(f, out, out->streak);
}

static void index_cells(bst_locator *l) {
    for (int i = 0; i < l->columns * l->rows; i++) {
        l->cell[i] = -1;
    }
    for (int i = l->count - 1; i >= 0; i--) {
        int *cell =
            &l->cell[l->found[i].peak_y / CELL_PX * l->columns + l->found[i].peak_x / CELL_PX];
        l->found[i].next = *cell;
        *cell = i;
    }
}

/* Cells, first and last, that hold all maxima within margin_px of a range of pixels. */
static void cell_range(double from, double to, double margin_px, int cells, int *first, int *last) {
    double lo = floor((from - margin_px) / CELL_PX), hi = floor((to + margin_px) / CELL_PX);
    *first = lo < 0.0 ? 0 : lo > cells - 1 ? cells - 1 : (int)lo;
    *last = hi < 0.0 ? 0 : hi > cells - 1 ? cells - 1 : (int)hi;
}

static void note_length(bst_locator *l, const bst_shape *s) {
    l->longest_px = fmax(l->longest_px, fmax(0.5 * fabs(s->dx_px) + fabs(s->bend_x_px),
                                             0.5 * fabs(s->dy_px) + fabs(s->bend_y_px)));
}

typedef struct company {
    const bst_source *free[BST_FIT_MAX_FREE];
    int free_count;
    const bst_source *fixed[MAX_FIXED];
    int fixed_count;
} company;

/* The sources that share light with `own`, number i: those centred on its stamp are free, the
 * brightest first; those that only reach into it are fixed. */
static void gather(const bst_locator *l, const bst_locate_frame *f, int i, const bst_source *own,
                   const bst_stamp *stamp, company *out) {
    out->free[0] = own;
    out->free_count = 1;
    out->fixed_count = 0;
    /* a fit moves a source from its maximum by its limit at most */
    double margin = reach(f) + 1.8 * l->longest_px + fit_limit(f, 0.0) + 1.0;
    int first_column, last_column, first_row, last_row;
    cell_range(stamp->x0, stamp->x0 + stamp->width, margin, l->columns, &first_column,
               &last_column);
    cell_range(stamp->y0, stamp->y0 + stamp->height, margin, l->rows, &first_row, &last_row);
    int near[MAX_FIXED + BST_FIT_MAX_FREE], count = 0, across = last_column - first_column + 1;
    for (int c = 0; c < across * (last_row - first_row + 1); c++) {
        int cell = (first_row + c / across) * l->columns + first_column + c % across;
        for (int k = l->cell[cell]; k >= 0; k = l->found[k].next) {
            if (k == i || l->found[k].dropped || bst_charge_label(l->found[k].label)) {
                continue;
            }
            bst_stamp other =
                bst_fit_stamp(&l->found[k].source, reach(f), l->max_side, f->width, f->height);
            if (other.x0 >= stamp->x0 + stamp->width || stamp->x0 >= other.x0 + other.width ||
                other.y0 >= stamp->y0 + stamp->height || stamp->y0 >= other.y0 + other.height) {
                continue;
            }
            /* keep the brightest, in order of number */
            int at = count;
            while (at > 0 && near[at - 1] > k) {
                at--;
            }
            if (count == MAX_FIXED + BST_FIT_MAX_FREE && at == count) {
                continue;
            }
            count += count < MAX_FIXED + BST_FIT_MAX_FREE;
            for (int m = count - 1; m > at; m--) {
                near[m] = near[m - 1];
            }
            near[at] = k;
        }
    }
    for (int n = 0; n < count; n++) {
        const bst_source *s = &l->found[near[n]].source;
        /* a centre just outside still has half its light inside */
        bool inside = s->shape.x_px >= stamp->x0 - 1.5 && s->shape.y_px >= stamp->y0 - 1.5 &&
                      s->shape.x_px <= stamp->x0 + stamp->width + 0.5 &&
                      s->shape.y_px <= stamp->y0 + stamp->height + 0.5;
        if (inside && out->free_count < BST_FIT_MAX_FREE) {
            out->free[out->free_count++] = s;
        } else if (out->fixed_count < MAX_FIXED) {
            out->fixed[out->fixed_count++] = s;
        }
    }
}

/* One thread's part of a loop. */
typedef struct worker {
    const bst_locator *l;
    const bst_locate_frame *f;
    bst_fit *fit;
} worker;

/* Fits *found, number i, in the shape that its source has. The neighbours' own entries stay as they
 * are: each gets its values from its own fit. */
static bool fit_one(const worker *w, int i, bst_found *found, const bst_stamp *stamp,
                    bool free_width) {
    const bst_locate_frame *f = w->f;
    company c;
    gather(w->l, f, i, &found->source, stamp, &c);
    bst_source copies[BST_FIT_MAX_FREE];
    bst_source *free_sources[BST_FIT_MAX_FREE];
    for (int k = 0; k < c.free_count; k++) {
        copies[k] = *c.free[k];
        free_sources[k] = &copies[k];
    }
    bst_fit_data data = {f->signal, f->width, f->height, found->noise_e};
    double limit = fit_limit(f, hypot(copies[0].shape.dx_px, copies[0].shape.dy_px));
    bool ok = bst_fit_run(w->fit, &data, stamp, free_sources, c.free_count, c.fixed, c.fixed_count,
                          free_width && c.free_count == 1, limit);
    if (!ok && c.free_count > 1) {
        /* the pixels do not determine a neighbour, as at the stamp's edge: it stays as it is */
        int fixed_count = c.fixed_count;
        for (int k = 1; k < c.free_count && fixed_count < MAX_FIXED; k++) {
            c.fixed[fixed_count++] = c.free[k];
        }
        copies[0] = *c.free[0];
        ok = bst_fit_run(w->fit, &data, stamp, free_sources, 1, c.fixed, fixed_count, false, limit);
    }
    if (ok) {
        found->source = copies[0];
    }
    if (c.free_count > 1) {
        found->flags |= BST_DETECTION_BLEND;
    }
    return ok;
}

static bst_stamp stamp_of(const bst_locator *l, const bst_locate_frame *f, const bst_source *s) {
    return bst_fit_stamp(s, reach(f), l->max_side, f->width, f->height);
}

/* Whether the filters leave the shape open. A fit's chi-square is less by the square of its
 * filter's output, so that the two outputs tell which of the shapes fits better, but for what they
 * are off between the pixels and what neighbours add. Most sources of a frame with streaks are
 * streaks: a point is always fitted as both. */
static bool shape_is_open(const bst_locate_frame *f, const bst_found *found) {
    if (!f->filter->streak) {
        return false;
    }
    if (!found->streak) {
        double other = (double)bst_filter_streak_at(f->filter, found->peak_x, found->peak_y);
        return other > CLOSE_SHARE * (double)found->peak_snr;
    }
    float highest = 0.0f;
    int at_x = found->peak_x, at_y = found->peak_y;
    for (int dy = -2; dy <= 2; dy++) {
        for (int dx = -2; dx <= 2; dx++) {
            int x = found->peak_x + dx, y = found->peak_y + dy;
            if (x >= 0 && y >= 0 && x < f->width && y < f->height &&
                bst_filter_point_at(f->filter, x, y) > highest) {
                highest = bst_filter_point_at(f->filter, x, y);
                at_x = x;
                at_y = y;
            }
        }
    }
    double dx, dy, point = bst_filter_top(f->filter, true, at_x, at_y, &dx, &dy);
    double best2 = found->top_snr * found->top_snr;
    return point * point > best2 - CLEAR_CHI - CLEAR_SHARE * best2;
}

/* First fit: shape and place. */
static void locate_one(const worker *w, int i, bst_found *found) {
    const bst_locator *l = w->l;
    const bst_locate_frame *f = w->f;
    double widening = l->widening_weight > 0.0 ? l->widening_sum / l->widening_weight : 0.0;
    found->source.widening_px2 = widening;
    bool bright = (double)found->peak_snr > WIDTH_FIT_SNR;
    if (shape_is_open(f, found)) {
        bst_source point = as_shape(f, found, false), streak = as_shape(f, found, true);
        bst_stamp stamp = stamp_of(l, f, &streak);
        found->source = streak;
        bool streak_ok = fit_one(w, i, found, &stamp, false);
        streak = found->source;
        found->source = point;
        bool point_ok = fit_one(w, i, found, &stamp, false);
        found->streak = streak_ok && (!point_ok || streak.chi_square < found->source.chi_square);
        if (found->streak) {
            found->source = streak;
            if (!bright) {
                return;
            }
        }
    }
    bst_stamp stamp = stamp_of(l, f, &found->source);
    found->source.fitted = fit_one(w, i, found, &stamp, bright);
}

/* What the fit of a bright source says of the PSF's width. */
static void note_widening(bst_locator *l, const bst_locate_frame *f, const bst_found *found) {
    bool measured = found->source.fitted && found->source.widening_variance > 0.0;
    double variance = f->sigma_px * f->sigma_px;
    if (measured && fabs(found->source.widening_px2) < 0.5 * variance) {
        /* no single source counts for more than one that is good to 3 % */
        double floor = 0.03 * variance;
        double weight = 1.0 / (found->source.widening_variance + floor * floor);
        l->widening_sum += weight * found->source.widening_px2;
        l->widening_weight += weight;
    }
}

/* Principal axes of the measured or modelled second moments. */
static bool measure_extent(const worker *w, int i, bst_found *found, double wider) {
    const bst_locate_frame *f = w->f;
    const bst_shape *s = &found->source.shape;
    double base = s->sigma_px * s->sigma_px + fmax(found->source.widening_px2, 0.0);
    double m[3];
    bst_shape_path_variance(s, m);
    m[0] += base;
    m[2] += base;
    bool measured = false;
    if (found->snr >= MOMENTS_SNR && !(found->flags & BST_DETECTION_EDGE)) {
        bst_stamp stamp =
            bst_fit_stamp(&found->source, reach(f) + wider, w->l->max_side, f->width, f->height);
        company c;
        gather(w->l, f, i, &found->source, &stamp, &c);
        const bst_source *others[BST_FIT_MAX_FREE + MAX_FIXED];
        int count = 0;
        for (int k = 1; k < c.free_count; k++) {
            others[count++] = c.free[k];
        }
        for (int k = 0; k < c.fixed_count; k++) {
            others[count++] = c.fixed[k];
        }
        bst_fit_data data = {f->signal, f->width, f->height, found->noise_e};
        double d[3];
        if (bst_fit_moments(w->fit, &data, &stamp, &found->source, others, count, d)) {
            /* the pixel's own variance off */
            d[0] = fmax(d[0] - 1.0 / 12.0, 0.01);
            d[2] = fmax(d[2] - 1.0 / 12.0, 0.01);
            if (d[0] * d[2] > d[1] * d[1]) {
                m[0] = d[0];
                m[1] = d[1];
                m[2] = d[2];
                measured = true;
            }
        }
    }
    double mean = 0.5 * (m[0] + m[2]), half = hypot(0.5 * (m[0] - m[2]), m[1]);
    double limit = 0.5 * w->l->max_side;
    found->length_px = fmin(BST_FWHM_PER_SIGMA * sqrt(mean + half), limit);
    found->width_px = fmin(BST_FWHM_PER_SIGMA * sqrt(fmax(mean - half, 0.0)), limit);
    found->angle_rad = half > 1e-9 * mean ? 0.5 * atan2(2.0 * m[1], m[0] - m[2]) : 0.0;
    return measured;
}

/* Fits *found with its path set to `path` px along `angle`; chi-square, or infinity. */
static double try_path(const worker *w, int i, bst_found *found, const bst_stamp *stamp,
                       const bst_source *start_from, double path, double angle) {
    found->source = *start_from;
    found->source.shape.dx_px = path * cos(angle);
    found->source.shape.dy_px = path * sin(angle);
    return fit_one(w, i, found, stamp, false) ? found->source.chi_square : INFINITY;
}

/* A point that is longer than the PSF: fits it as a streak along the axis of its moments, as long
 * as that lowers chi-square on the same pixels. Moments give the length roughly, the parabola
 * through three values of chi-square gives it well. */
static void fit_own_streak(const worker *w, int i, bst_found *found) {
    const bst_locate_frame *f = w->f;
    double psf_fwhm = BST_FWHM_PER_SIGMA * f->sigma_px;
    for (int round = 0; round < 4; round++) {
        if (!measure_extent(w, i, found, 2.0 * reach(f)) || found->length_px < 1.5 * psf_fwhm) {
            return;
        }
        double spread = (found->length_px * found->length_px - psf_fwhm * psf_fwhm) /
                        (BST_FWHM_PER_SIGMA * BST_FWHM_PER_SIGMA);
        double path = fmin(sqrt(12.0 * spread), 0.4 * w->l->max_side), angle = found->angle_rad;
        bst_found before = *found;
        bst_source longest = before.source;
        longest.shape.dx_px = 1.2 * path * cos(angle);
        longest.shape.dy_px = 1.2 * path * sin(angle);
        bst_stamp stamp = stamp_of(w->l, f, &longest);
        double old_path = hypot(before.source.shape.dx_px, before.source.shape.dy_px);
        double old_angle = atan2(before.source.shape.dy_px, before.source.shape.dx_px);
        double old_chi = try_path(w, i, found, &stamp, &before.source, old_path, old_angle);
        double low = try_path(w, i, found, &stamp, &before.source, 0.8 * path, angle);
        double high = try_path(w, i, found, &stamp, &before.source, 1.2 * path, angle);
        double chi = try_path(w, i, found, &stamp, &before.source, path, angle);
        double bend = low + high - 2.0 * chi, step = 0.0;
        if (isfinite(bend)) {
            step = bend > 0.0 ? 0.1 * (low - high) / bend : low < high ? -0.2 : 0.2;
            step = fmax(-0.2, fmin(step, 0.2));
            chi = try_path(w, i, found, &stamp, &before.source, path * (1.0 + step), angle);
        }
        if (!(chi < old_chi - 9.0)) {
            *found = before;
            return;
        }
        found->streak = true;
        found->snr = found->source.flux_e * bst_fit_norm(w->fit, &stamp) / found->noise_e;
    }
}

/* Whether charge was taken off about a candidate: the filters answer to it besides its own place.
 */
static bool is_charge_near(const bst_locator *l, const bst_locate_frame *f,
                           const bst_found *found) {
    bst_source s = found->source;
    s.shape.x_px = found->peak_x;
    s.shape.y_px = found->peak_y;
    bst_stamp stamp = bst_fit_stamp(&s, reach(f), l->max_side, f->width, f->height);
    return bst_charge_in(l, f->width, &stamp);
}

/* Flags and plausibility. */
static void judge(const bst_locate_frame *f, bst_found *found) {
    const bst_source *s = &found->source;
    double half_x = 0.5 * fabs(s->shape.dx_px) + fabs(s->shape.bend_x_px) + 2.0 * f->sigma_px;
    double half_y = 0.5 * fabs(s->shape.dy_px) + fabs(s->shape.bend_y_px) + 2.0 * f->sigma_px;
    double x = s->shape.x_px, y = s->shape.y_px;
    if (x - half_x < -0.5 || y - half_y < -0.5 || x + half_x > f->width - 0.5 ||
        y + half_y > f->height - 0.5) {
        found->flags |= BST_DETECTION_EDGE;
    }
    int x0 = (int)fmax(x - half_x - 1.0, 0.0), x1 = (int)fmin(x + half_x + 1.0, f->width - 1.0);
    int y0 = (int)fmax(y - half_y - 1.0, 0.0), y1 = (int)fmin(y + half_y + 1.0, f->height - 1.0);
    for (int j = y0; j <= y1; j++) {
        for (int i = x0; i <= x1; i++) {
            if (f->signal[(size_t)j * (size_t)f->width + (size_t)i] == BST_PIXEL_SATURATED) {
                found->flags |= BST_DETECTION_SATURATED;
            }
        }
    }
    bool outside = x < -0.5 || y < -0.5 || x > f->width - 0.5 || y > f->height - 0.5;
    if (outside || !s->fitted) {
        found->label = BST_LABEL_ARTEFACT;
        found->label_probability = 0.9;
    }
}

/* A candidate whose fit failed keeps its maximum's place. */
static void use_maximum(const bst_locate_frame *f, bst_found *found) {
    found->source = as_shape(f, found, found->streak);
    found->source.cov_xx = found->source.cov_yy = 1.0;
    found->source.cov_xy = 0.0;
    double sigma = found->noise_e / shape_norm(f, found->streak);
    found->source.flux_variance = sigma * sigma + found->source.flux_e;
}

static void drop_doubles(bst_locator *l, const bst_locate_frame *f) {
    double radius = 0.6 * BST_FWHM_PER_SIGMA * f->sigma_px;
    double margin = radius + 1.8 * l->longest_px + 2.0 * fit_limit(f, 0.0);
    for (int i = 0; i < l->count; i++) {
        const bst_shape *a = &l->found[i].source.shape;
        int x0, x1, y0, y1;
        cell_range(a->x_px, a->x_px, margin, l->columns, &x0, &x1);
        cell_range(a->y_px, a->y_px, margin, l->rows, &y0, &y1);
        for (int c = 0; c < (x1 - x0 + 1) * (y1 - y0 + 1); c++) {
            int cell = (y0 + c / (x1 - x0 + 1)) * l->columns + x0 + c % (x1 - x0 + 1);
            for (int k = l->cell[cell]; k >= 0; k = l->found[k].next) {
                const bst_shape *b = &l->found[k].source.shape;
                /* numbers are by brightness: the fainter goes */
                if (k < i && !l->found[k].dropped &&
                    bst_charge_label(l->found[k].label) == bst_charge_label(l->found[i].label) &&
                    hypot(a->x_px - b->x_px, a->y_px - b->y_px) < radius) {
                    l->found[i].dropped = true;
                }
            }
        }
    }
}

/* A loop over the found ones from `first` on. */
typedef struct loop {
    bst_locator *l;
    const bst_locate_frame *f;
    const bst_candidates *candidates;
    void (*each)(const worker *w, int i, bst_found *found);
    int first;
} loop;

static void start_some(void *user, int begin, int end) {
    const loop *p = user;
    for (int i = begin; i < end; i++) {
        start(p->f, &p->candidates->items[p->candidates->order[i]], &p->l->found[i]);
    }
}

/* Makes of each of `found` that is to be seen to what `next` becomes. */
static void do_some(void *user, int begin, int end) {
    const loop *p = user;
    bst_locator *l = p->l;
    int taken = bst_borrow_take(&l->lent);
    worker w = {l, p->f, &l->fits[taken]};
    for (int i = p->first + begin; i < p->first + end; i++) {
        l->next[i] = l->found[i];
        if (!l->found[i].dropped && !bst_charge_label(l->found[i].label)) {
            p->each(&w, i, &l->next[i]);
        }
    }
    bst_borrow_give(&l->lent, taken);
}

/* Numbers first to end all see one another, and the others, as they were before. */
static void do_all(bst_locator *l, const bst_locate_frame *f, int first, int end,
                   void (*each)(const worker *, int, bst_found *)) {
    loop p = {l, f, NULL, each, first};
    bst_parallel_for(l->pool, end - first, FITS_A_TIME, do_some, &p);
    for (int i = first; i < end; i++) {
        l->found[i] = l->next[i];
        note_length(l, &l->found[i].source.shape);
    }
}

static void first_fit(const worker *w, int i, bst_found *found) {
    if (found->charge.pixels > 0 && bst_charge_light(w->f, found) < BST_CHARGE_LIGHT_SNR) {
        bst_charge_take(found);
        return;
    }
    locate_one(w, i, found);
    if (found->charge.pixels > 0 && bst_charge_alone(found)) {
        bst_charge_take(found);
    }
}

/* Blends, now that every neighbour has its place. */
static void second_fit(const worker *w, int i, bst_found *found) {
    if ((found->flags & BST_DETECTION_BLEND) && found->source.fitted) {
        found->flags &= ~(unsigned)BST_DETECTION_BLEND;
        bst_stamp stamp = stamp_of(w->l, w->f, &found->source);
        found->source.fitted = fit_one(w, i, found, &stamp, false);
    }
}

static void finish(const worker *w, int i, bst_found *found) {
    const bst_locate_frame *f = w->f;
    if (!found->source.fitted) {
        use_maximum(f, found);
    }
    found->snr = found->source.flux_e * shape_norm(f, found->streak) / found->noise_e;
    if (found->snr < BST_CHARGE_LIGHT_SNR && is_charge_near(w->l, f, found)) {
        found->dropped = true;
        return;
    }
    judge(f, found);
    bool alone = !(found->flags & (BST_DETECTION_BLEND | BST_DETECTION_EDGE));
    if (alone && !found->streak && found->label == BST_LABEL_UNKNOWN && found->snr >= MOMENTS_SNR) {
        fit_own_streak(w, i, found);
    }
    measure_extent(w, i, found, 0.0);
    if (found->streak ||
        (found->snr >= MOMENTS_SNR && found->length_px > 1.5 * fmax(found->width_px, 1.0) &&
         found->length_px > 1.5 * BST_FWHM_PER_SIGMA * f->sigma_px)) {
        found->flags |= BST_DETECTION_STREAK;
    }
}

void bst_locate(bst_locator *l, const bst_locate_frame *f, const bst_candidates *candidates) {
    l->count = candidates->count < l->capacity ? candidates->count : l->capacity;
    l->longest_px = 0.0;
    loop p = {l, f, candidates, NULL, 0};
    bst_parallel_for(l->pool, l->count, STARTS_A_TIME, start_some, &p);
    for (int i = 0; i < l->count; i++) {
        note_length(l, &l->found[i].source.shape);
    }
    index_cells(l);
    double variance = f->sigma_px * f->sigma_px;
    l->widening_sum = 0.0;
    l->widening_weight = 1.0 / (0.0025 * variance * variance); /* no widening, to 5 % */
    bst_sharpness_set(&l->sharpness, &l->psf, f->sigma_px);
    bst_profiles_set(&l->profiles, &l->psf, f->sigma_px);
    bst_charge_remove(l, f);
    for (int first = 0, end; first < l->count; first = end) {
        end = first < FIRST_GROUP ? FIRST_GROUP : 3 * first;
        end = end < l->count ? end : l->count;
        do_all(l, f, first, end, first_fit);
        for (int i = first; i < end; i++) {
            note_widening(l, f, &l->found[i]);
        }
    }
    drop_doubles(l, f);
    do_all(l, f, 0, l->count, second_fit);
    do_all(l, f, 0, l->count, finish);
}

void bst_locate_roughly(bst_locator *l, const bst_locate_frame *f,
                        const bst_candidates *candidates) {
    l->count = candidates->count < l->capacity ? candidates->count : l->capacity;
    for (int i = 0; i < l->count; i++) {
        bst_found *found = &l->found[i];
        start(f, &candidates->items[candidates->order[i]], found);
        use_maximum(f, found);
        found->snr = (double)found->peak_snr;
        found->length_px = found->width_px = BST_FWHM_PER_SIGMA * f->sigma_px;
    }
}
