#include "imgproc/measure/locate.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/blooming.h"
#include "imgproc/measure/cosmic_ray.h"
#include "imgproc/measure/light_scale.h"
#include "imgproc/measure/other_path.h"
#include "imgproc/measure/own_path.h"
#include "imgproc/measure/pair_split.h"
#include "imgproc/measure/peak_centroid.h"
#include "imgproc/measure/same_streak.h"
#include "imgproc/measure/source_moments.h"
#include "sim/core/pages.h"

enum {
    FIRST_GROUP = 32, /* brightest sources, fitted before the others */
    /* fits per thread at least; a smaller group is done before another thread wakes */
    FITS_A_TIME = 16,
    STARTS_A_TIME = 512
};

/* A neighbour that is further than this from its interpolated peak asks for a new fit. */
static const double MOVED_PX = 0.1;

/* the width of the PSF is measured on sources above this SNR */
static const double WIDTH_FIT_SNR = 20.0;
/* Point and streak shape are both fitted if the streak's output is above this share of the point's,
 * or the squared point output is within these limits below the squared streak output. */
static const double CLOSE_SHARE = 0.8, CLEAR_CHI = 3.0, CLEAR_SHARE = 0.04;

bst_status bst_imgproc_locator_create(bst_ctx *ctx, const bst_known_psf *known,
                                      const bst_imgproc_locator_limits *limits,
                                      bst_imgproc_locator *out) {
    assert(limits && out && limits->capacity > 0);
    const int threads = limits->threads, capacity = limits->capacity;
    const int max_width = limits->max_width, max_height = limits->max_height;
    *out = (bst_imgproc_locator){.threads = threads,
                                 .max_side = limits->max_side,
                                 .capacity = capacity,
                                 .columns = max_width / BST_LOCATE_CELL_PX + 1,
                                 .rows = max_height / BST_LOCATE_CELL_PX + 1};
    bst_imgproc_gauss_init(&out->psf);
    bst_scratch_pool_init(&out->lent, threads);
    out->found = bst_pages_zero((size_t)capacity, sizeof *out->found);
    out->next = bst_pages_zero((size_t)capacity, sizeof *out->next);
    out->from = calloc((size_t)capacity, sizeof *out->from);
    out->chosen = bst_pages_zero(
        (size_t)max_width * (size_t)max_height / 4 + (size_t)max_width + (size_t)max_height + 1, 1);
    out->cell = calloc((size_t)out->columns * (size_t)out->rows, sizeof *out->cell);
    out->charged_capacity = 16 * capacity;
    out->charged = bst_pages_zero((size_t)out->charged_capacity, sizeof *out->charged);
    out->fits = calloc((size_t)threads, sizeof *out->fits);
    if (!out->found || !out->next || !out->from || !out->chosen || !out->cell || !out->charged ||
        !out->fits) {
        bst_imgproc_locator_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d detections", capacity);
    }
    bst_status status = bst_source_profiles_create(ctx, known, &out->profiles);
    for (int i = 0; i < threads && status == BST_OK; i++) {
        status = bst_fit_create(ctx, &out->psf, &out->profiles, limits->max_side, &out->fits[i]);
    }
    if (status != BST_OK) {
        bst_imgproc_locator_free(out);
    }
    return status;
}

void bst_imgproc_locator_free(bst_imgproc_locator *l) {
    bst_pages_free(l->found);
    bst_pages_free(l->next);
    free(l->from);
    bst_pages_free(l->chosen);
    free(l->cell);
    bst_pages_free(l->charged);
    for (int i = 0; l->fits && i < l->threads; i++) {
        bst_fit_free(&l->fits[i]);
    }
    free(l->fits);
    bst_source_profiles_free(&l->profiles);
    *l = (bst_imgproc_locator){0};
}

/* Initial source at an interpolated peak: a point, or the local star streak. */
static bst_imgproc_source initial_source(const bst_imgproc_locator *l, const bst_locate_frame *f,
                                         const bst_imgproc_found *found, bool streak) {
    bst_imgproc_source s = {.flux_e = found->top_snr * found->noise_e / l->light[streak].response,
                            .widening_px2 = found->source.widening_px2};
    s.shape = (bst_imgproc_shape){
        .x_px = found->top_x_px, .y_px = found->top_y_px, .sigma_px = f->sigma_px};
    if (streak) {
        bst_peak_centroid_star_path(f, &s.shape);
    } else {
        bst_peak_centroid_camera_path(f, &s.shape);
    }
    if (f->uneven) {
        bst_peak_centroid_on_path(f, &s.shape);
    }
    return s;
}

/* Initialises a located source at the interpolated peak of the matched filter. */
static void start_at_peak(const bst_imgproc_locator *l, const bst_locate_frame *f,
                          const bst_candidate *c, bst_imgproc_found *out) {
    *out = (bst_imgproc_found){.peak_snr = c->snr, .peak_x = c->x, .peak_y = c->y};
    out->noise_e = bst_locate_noise_at(f, c->x, c->y);
    double dx, dy;
    out->top_snr = bst_filter_top(f->filter, false, c->x, c->y, &dx, &dy);
    out->top_x_px = c->x + dx;
    out->top_y_px = c->y + dy;
    out->streak = f->filter->streak && c->snr > bst_filter_point_at(f->filter, c->x, c->y);
    out->source = initial_source(l, f, out, out->streak);
}

/* Updates the longest source path of the frame. */
static void update_longest_path(bst_imgproc_locator *l, const bst_imgproc_shape *s) {
    double half_x, half_y;
    bst_imgproc_shape_reach(s, &half_x, &half_y);
    l->longest_px = fmax(l->longest_px, fmax(half_x, half_y));
}

/* True if the matched filters do not decide between point and streak shape. A fit lowers chi-square
 * by the squared filter output, so the outputs rank the shapes. The ranking is uncertain by
 * interpolation errors and by light of neighbours. In a frame with star streaks, a point is always
 * fitted as both. */
static bool is_shape_ambiguous(const bst_locate_frame *f, const bst_imgproc_found *found) {
    if (!f->filter->streak || f->uneven) { /* filters do not know an uneven path */
        return f->filter->streak;
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

/* FWHM of a source's image along its longest axis, as it is drawn: that of the PSF, and with an
 * uneven motion of the camera that of its path. */
static double drawn_fwhm_px(const bst_locate_frame *f, const bst_imgproc_shape *shape) {
    if (!f->uneven) {
        return BST_FWHM_PER_SIGMA * f->sigma_px;
    }
    double v[3];
    bst_imgproc_shape_path_variance(shape, v);
    const double path = 0.5 * (v[0] + v[2]) + hypot(0.5 * (v[0] - v[2]), v[1]);
    return BST_FWHM_PER_SIGMA * sqrt(f->sigma_px * f->sigma_px + path);
}

/* First fit of a source: shape and position. */
static void fit_shape_and_position(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_imgproc_locator *l = w->l;
    const bst_locate_frame *f = w->f;
    if (found->bleed) {
        found->source.fitted = bst_blooming_fit(w, i, found);
        return;
    }
    found->source.widening_px2 = bst_frame_width_mean(&l->width);
    bool bright = (double)found->peak_snr > WIDTH_FIT_SNR;
    if (is_shape_ambiguous(f, found)) {
        bst_imgproc_source point = initial_source(l, f, found, false),
                           streak = initial_source(l, f, found, true);
        bst_imgproc_stamp stamp = bst_deblend_stamp(l, f, &streak);
        found->source = streak;
        bool streak_ok = bst_deblend_fit(w, i, found, &stamp, false);
        streak = found->source;
        found->source = point;
        bool point_ok = bst_deblend_fit(w, i, found, &stamp, false);
        found->streak = streak_ok && (!point_ok || streak.chi_square < found->source.chi_square);
        if (found->streak) {
            found->source = streak;
            if (!bright) {
                return;
            }
        }
    }
    bst_imgproc_stamp stamp = bst_deblend_stamp(l, f, &found->source);
    found->source.fitted = bst_deblend_fit(w, i, found, &stamp, bright);
}

/* True if charge was masked near a candidate: the matched filter responds to such charge beside it
 * too. */
static bool is_charge_near(const bst_imgproc_locator *l, const bst_locate_frame *f,
                           const bst_imgproc_found *found) {
    bst_imgproc_source s = found->source;
    s.shape.x_px = found->peak_x;
    s.shape.y_px = found->peak_y;
    bst_imgproc_stamp stamp =
        bst_fit_stamp(&s, bst_deblend_reach(f), l->max_side, f->width, f->height);
    return bst_cosmic_ray_in(l, f->width, &stamp);
}

/* Falls back to the filter's peak for a source whose fit failed. */
static void use_filter_peak(const bst_imgproc_locator *l, const bst_locate_frame *f,
                            bst_imgproc_found *found) {
    found->source = initial_source(l, f, found, found->streak);
    found->source.cov_xx = found->source.cov_yy = 1.0;
    found->source.cov_xy = 0.0;
    double sigma = found->noise_e / l->light[found->streak].response;
    found->source.flux_variance = sigma * sigma + f->excess * found->source.flux_e;
}

/* Half width and height of a source's light, px. */
static void half_extent(const bst_locate_frame *f, const bst_imgproc_shape *s, double *half_x,
                        double *half_y) {
    bst_imgproc_shape_reach(s, half_x, half_y);
    *half_x += 2.0 * f->sigma_px;
    *half_y += 2.0 * f->sigma_px;
}

/* Flags a source whose light is cut by the frame's edge. */
static void flag_edge(const bst_locate_frame *f, bst_imgproc_found *found) {
    const bst_imgproc_shape *s = &found->source.shape;
    double half_x, half_y;
    half_extent(f, s, &half_x, &half_y);
    if (s->x_px - half_x < -0.5 || s->y_px - half_y < -0.5 || s->x_px + half_x > f->width - 0.5 ||
        s->y_px + half_y > f->height - 0.5) {
        found->flags |= BST_DETECTION_EDGE;
    }
}

/* Flags a source whose light is cut by the frame's edge or falls on full pixels. */
static void flag_light(const bst_locate_frame *f, bst_imgproc_found *found) {
    flag_edge(f, found);
    double half_x, half_y, x = found->source.shape.x_px, y = found->source.shape.y_px;
    half_extent(f, &found->source.shape, &half_x, &half_y);
    int x0 = (int)fmax(x - half_x - 1.0, 0.0), x1 = (int)fmin(x + half_x + 1.0, f->width - 1.0);
    int y0 = (int)fmax(y - half_y - 1.0, 0.0), y1 = (int)fmin(y + half_y + 1.0, f->height - 1.0);
    for (int j = y0; j <= y1; j++) {
        for (int i = x0; i <= x1; i++) {
            if (f->signal[(size_t)j * (size_t)f->width + (size_t)i] == BST_PIXEL_SATURATED) {
                found->flags |= BST_DETECTION_SATURATED;
            }
        }
    }
}

/* True if a fit ended outside the frame. */
static bool is_outside(const bst_locate_frame *f, const bst_imgproc_shape *s) {
    return s->x_px < -0.5 || s->y_px < -0.5 || s->x_px > f->width - 0.5 ||
           s->y_px > f->height - 0.5;
}

/* Labels a source that its fit does not vouch for. */
static void label_artefact(bst_imgproc_found *found) {
    found->label = BST_LABEL_ARTEFACT;
    found->label_probability = 0.9;
}

/* Sets flags and label after the fit. Light beyond the edge fits with any flux, so a source fitted
 * outside the frame falls back to the filter's peak and becomes an ARTEFACT. */
static void set_flags(const bst_imgproc_locator *l, const bst_locate_frame *f,
                      bst_imgproc_found *found) {
    bool outside = is_outside(f, &found->source.shape);
    if (outside) {
        use_filter_peak(l, f, found);
        found->snr = (double)found->peak_snr;
        found->flags |= BST_DETECTION_EDGE;
    }
    flag_light(f, found);
    if (outside || !found->source.fitted) {
        label_artefact(found);
    }
}

/* True if a source may have a path of its own in a frame in which the camera moved unevenly: points
 * where stars are streaks, and what has the stars' path if its pixels deny that. */
static bool is_off_path(const bst_locate_frame *f, const bst_imgproc_found *found) {
    const double pixels = found->source.pixels;
    return found->streak != f->filter->streak ||
           found->source.chi_square > pixels + 4.0 * sqrt(2.0 * pixels);
}

/* Fits an elongated point again as a streak of its own, whose light may reach the frame's edge.
 * Full pixels on its way do not make it saturated: a spike of a bright star ends in the star. */
static void fit_own_streak(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    if (w->f->uneven) {
        if (is_off_path(w->f, found)) {
            bst_own_path_fit(w, i, found);
        }
    } else {
        bst_source_moments_own_streak(w, i, found);
    }
    found->own_streak = found->streak && (!w->f->uneven || found->own_path);
    if (found->own_streak) {
        flag_edge(w->f, found);
        if (is_outside(w->f, &found->source.shape)) {
            label_artefact(found);
        }
    }
}

/* Parallel loop over the located sources from `first` on. */
typedef struct loop {
    bst_imgproc_locator *l;
    const bst_locate_frame *f;
    const bst_candidates *candidates;
    void (*each)(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);
    int first;
} loop;

/* Initialises sources begin to end - 1 at their filter peaks (loop body). */
static void start_range(void *user, int begin, int end) {
    const loop *p = user;
    for (int i = begin; i < end; i++) {
        start_at_peak(p->l, p->f, &p->candidates->items[p->l->from[i]], &p->l->found[i]);
    }
}

/* Applies `each` to the sources in a range and writes results to `next`; dropped sources and charge
 * are skipped. */
static void process_range(void *user, int begin, int end) {
    const loop *p = user;
    bst_imgproc_locator *l = p->l;
    int taken = bst_scratch_pool_take(&l->lent);
    bst_imgproc_worker w = {l, p->f, &l->fits[taken]};
    for (int i = p->first + begin; i < p->first + end; i++) {
        l->next[i] = l->found[i];
        if (!l->found[i].dropped && !bst_label_is_charge(l->found[i].label)) {
            p->each(&w, i, &l->next[i]);
        }
    }
    bst_scratch_pool_give(&l->lent, taken);
}

/* Applies `each` to sources first to end - 1; all read the state before the loop, so the result
 * does not depend on the order. */
static void process_group(bst_imgproc_locator *l, const bst_locate_frame *f, int first, int end,
                          void (*each)(const bst_imgproc_worker *, int, bst_imgproc_found *)) {
    loop p = {l, f, NULL, each, first};
    bst_parallel_for(f->pool, end - first, FITS_A_TIME, process_range, &p);
    for (int i = first; i < end; i++) {
        l->found[i] = l->next[i];
        update_longest_path(l, &l->found[i].source.shape);
    }
}

/* First fit of a source unless it is charge only. */
static void first_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    if (found->charge.pixels > 0 && bst_cosmic_ray_light(w->f, found) < BST_CHARGE_LIGHT_SNR) {
        bst_cosmic_ray_take(found);
        return;
    }
    fit_shape_and_position(w, i, found);
    if (found->charge.pixels > 0 && bst_cosmic_ray_alone(found)) {
        bst_cosmic_ray_take(found);
    }
}

/* Adds the width of a bright source; charge that overflows makes no image of the PSF. */
static void add_width(bst_imgproc_locator *l, const bst_imgproc_found *found) {
    if (!found->bleed) {
        bst_frame_width_add(&l->width, &l->profiles, &found->source);
    }
}

/* Fits the brightest sources, up to `end`, until they say that the PSF is as wide as it is taken
 * for. The others then start with the light that their filter output has in that PSF. */
static void fit_brightest(bst_imgproc_locator *l, const bst_locate_frame *f, int end) {
    bool again = false;
    do {
        for (int i = 0; again && i < end; i++) { /* neighbours are as wide as the new PSF */
            l->found[i].source.widening_px2 = 0.0;
            l->found[i].flags &= ~(unsigned)BST_DETECTION_BLEND; /* the fit sets it */
        }
        process_group(l, f, 0, end, first_fit);
        for (int i = 0; i < end; i++) {
            add_width(l, &l->found[i]);
        }
        again = bst_frame_width_adapt(&l->width, &l->profiles, &l->psf);
    } while (again);
    if (l->width.rounds == 0) {
        return;
    }
    bst_light_scale_adapt(l, f);
    for (int i = end; i < l->count; i++) {
        bst_imgproc_found *found = &l->found[i];
        if (!found->bleed) {
            found->source = initial_source(l, f, found, found->streak);
        }
    }
}

/* Locates a source at the filter's peak; one with charge is fitted, because the filter lacks its
 * masked pixels. */
static void locate_at_peak(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    if (found->charge.pixels > 0) {
        first_fit(w, i, found);
    } else {
        bst_peak_centroid_place(w, i, found);
    }
}

/* End of the group of sources fitted concurrently: three times its begin. */
static int group_end(int first) {
    return first < FIRST_GROUP ? FIRST_GROUP : 3 * first;
}

/* True if a blended source was fitted with outdated neighbours: their number has changed or one has
 * moved from its start position. */
static bool neighbours_changed(const bst_imgproc_worker *w, int i, const bst_imgproc_found *found,
                               const bst_imgproc_stamp *stamp) {
    bst_deblend c;
    bst_deblend_gather(w->l, w->f, i, &found->source, stamp, &c);
    int end = FIRST_GROUP;
    while (end <= i) {
        end = group_end(end);
    }
    int begin = end == FIRST_GROUP ? 0 : end / 3;
    bool changed = c.free_count - 1 + c.fixed_count != found->neighbours;
    for (int k = 0; k < c.fixed_count && !changed; k++) {
        const bst_imgproc_found *other = bst_imgproc_found_of(c.fixed[k]);
        double moved = hypot(other->source.shape.x_px - other->top_x_px,
                             other->source.shape.y_px - other->top_y_px);
        changed = other - w->l->found >= begin && !other->rough && moved > MOVED_PX;
    }
    return changed;
}

/* Second fit of blended sources whose neighbours have moved since the first. */
static void second_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    bst_imgproc_stamp stamp = bst_deblend_stamp(w->l, w->f, &found->source);
    if ((found->flags & BST_DETECTION_BLEND) && found->source.fitted &&
        neighbours_changed(w, i, found, &stamp)) {
        found->flags &= ~(unsigned)BST_DETECTION_BLEND;
        found->source.fitted = bst_deblend_fit(w, i, found, &stamp, false);
    }
}

/* Final SNR, flags and moments of a source. */
static void finish_source(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_locate_frame *f = w->f;
    if (found->bleed) {
        bst_blooming_finish(f, w->l->light[0].norm, found);
        flag_edge(f, found);
        return;
    }
    if (!found->source.fitted) {
        use_filter_peak(w->l, f, found);
    }
    found->snr = found->source.flux_e * w->l->light[found->streak].norm / found->noise_e;
    if (found->snr < BST_CHARGE_LIGHT_SNR && is_charge_near(w->l, f, found)) {
        found->dropped = true;
        return;
    }
    set_flags(w->l, f, found);
    bool alone = !(found->flags & (BST_DETECTION_BLEND | BST_DETECTION_EDGE));
    if (alone && !found->rough && (!found->streak || f->uneven) &&
        found->label == BST_LABEL_UNKNOWN && found->snr >= BST_EXTENT_SNR) {
        fit_own_streak(w, i, found);
    }
    bst_source_moments_measure(w, i, found, 0.0);
    if (found->streak ||
        (found->snr >= BST_EXTENT_SNR && found->length_px > 1.5 * fmax(found->width_px, 1.0) &&
         found->length_px > 1.5 * drawn_fwhm_px(f, &found->source.shape))) {
        found->flags |= BST_DETECTION_STREAK;
    }
    bst_other_path_judge(w, i, found);
}

/* Selects the brightest candidates into l->from: `fits` of them in order of brightness, the others
 * in order of row, because neighbours on the frame are then neighbours in memory. */
static void select_brightest(bst_imgproc_locator *l, const bst_candidates *candidates, int fits) {
    const int *order = candidates->order;
    if (fits == l->count) {
        memcpy(l->from, order, (size_t)fits * sizeof *order);
        return;
    }
    /* candidates are sorted by row */
    memset(l->chosen, 0, (size_t)candidates->count);
    for (int i = fits; i < l->count; i++) {
        l->chosen[order[i]] = 1;
    }
    memcpy(l->from, order, (size_t)fits * sizeof *order);
    for (int k = 0, next = fits; k < candidates->count; k++) {
        if (l->chosen[k]) {
            assert(next < l->capacity);
            l->from[next++] = k;
        }
    }
}

void bst_locate_prepare(bst_imgproc_locator *l, const bst_locate_frame *f) {
    bst_source_profiles_on(&l->profiles, f->origin_x_px, f->origin_y_px, (int)f->binning);
    l->sharpness.full_e = f->full_e;
    bst_sharpness_set(&l->sharpness, &l->psf, l->profiles.known, (int)f->binning, f->sigma_px);
    bst_source_profiles_set(&l->profiles, &l->psf, f->sigma_px);
}

void bst_locate(bst_imgproc_locator *l, const bst_locate_frame *f,
                const bst_candidates *candidates) {
    assert(l && f && candidates && f->width > 0 && f->height > 0 && f->binning >= 1);
    l->count = candidates->count < l->capacity ? candidates->count : l->capacity;
    l->longest_px = 0.0;
    int fits = l->max_fits > 0 && l->max_fits < l->count ? l->max_fits : l->count;
    select_brightest(l, candidates, fits);
    bst_light_scale_clear(l, f);
    loop p = {l, f, candidates, NULL, 0};
    bst_parallel_for(f->pool, l->count, STARTS_A_TIME, start_range, &p);
    for (int i = 0; i < l->count; i++) {
        update_longest_path(l, &l->found[i].source.shape);
    }
    bst_deblend_index(l, f);
    bst_locate_prepare(l, f);
    bst_blooming_join(l, f);
    bst_cosmic_ray_remove(l, f);
    /* those that know no width of their own wait for that of the others */
    int brightest = 0;
    while (brightest < fits && brightest < FIRST_GROUP &&
           (double)l->found[brightest].peak_snr > WIDTH_FIT_SNR) {
        brightest++;
    }
    bst_frame_width_clear(&l->width, &l->profiles);
    fit_brightest(l, f, brightest);
    for (int first = brightest, end; first < fits; first = end) {
        end = group_end(first) < fits ? group_end(first) : fits;
        process_group(l, f, first, end, first_fit);
        for (int i = first; i < end; i++) {
            add_width(l, &l->found[i]);
        }
    }
    bst_deblend_drop_doubles(l, f, fits);
    if (fits < l->count) {
        bst_peak_centroid_set_laws(l, f);
        process_group(l, f, fits, l->count, locate_at_peak);
    }
    process_group(l, f, 0, fits, second_fit);
    if (l->false_splits > 0.0) {
        bst_pair_split(l, f, fits, l->false_splits);
    }
    process_group(l, f, 0, l->count, finish_source);
}

bool bst_locate_again(bst_imgproc_locator *l, const bst_locate_frame *f, int i) {
    assert(l && f && i >= 0 && i < l->count);
    bst_imgproc_worker w = {l, f, &l->fits[0]};
    bst_imgproc_found found = l->found[i];
    if (!found.rough || found.dropped) {
        return false;
    }
    found.rough = false;
    found.flags = 0;
    first_fit(&w, i, &found);
    if (!found.source.fitted) {
        return false;
    }
    finish_source(&w, i, &found);
    /* streaks were joined before: this one would be a second detection of one */
    if (found.dropped ||
        (found.own_streak && bst_same_streak_found(l, f, i, &found.source.shape))) {
        return false;
    }
    l->found[i] = found;
    return true;
}

/* Keeps a source at the filter's peak without a fit. */
static void keep_filter_peak(const bst_imgproc_locator *l, const bst_locate_frame *f,
                             bst_imgproc_found *found) {
    use_filter_peak(l, f, found);
    found->snr = (double)found->peak_snr;
    found->length_px = found->width_px = BST_FWHM_PER_SIGMA * f->sigma_px;
}

/* Initialises sources at their filter peaks without a fit (loop body). */
static void start_roughly(void *user, int begin, int end) {
    const loop *p = user;
    start_range(user, begin, end);
    for (int i = begin; i < end; i++) {
        keep_filter_peak(p->l, p->f, &p->l->found[i]);
    }
}

void bst_locate_roughly(bst_imgproc_locator *l, const bst_locate_frame *f,
                        const bst_candidates *candidates) {
    l->count = candidates->count < l->capacity ? candidates->count : l->capacity;
    select_brightest(l, candidates, l->count);
    bst_light_scale_clear(l, f);
    loop p = {l, f, candidates, NULL, 0};
    bst_parallel_for(f->pool, l->count, STARTS_A_TIME, start_roughly, &p);
}
