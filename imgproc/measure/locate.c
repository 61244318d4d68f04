#include "imgproc/measure/locate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/blooming.h"
#include "imgproc/measure/cosmic_ray.h"
#include "imgproc/measure/peak_centroid.h"
#include "imgproc/measure/source_moments.h"

enum {
    FIRST_GROUP = 32, /* the brightest, which are fitted before the others */
    FITS_A_TIME = 16, /* of one thread; fewer are done before another thread wakes */
    STARTS_A_TIME = 512
};

/* a neighbour that moved further from its maximum's top matters */
static const double MOVED_PX = 0.1;

static const double WIDTH_FIT_SNR = 20.0; /* from here the widening is measured */
/* a streak's filter output above this share of a point's, and a point's whose square is less than a
 * streak's by no more than the other two: both shapes are tried */
static const double CLOSE_SHARE = 0.8, CLEAR_CHI = 3.0, CLEAR_SHARE = 0.04;

bst_status bst_imgproc_locator_create(bst_ctx *ctx, const bst_known_psf *known,
                                      const bst_imgproc_locator_limits *limits,
                                      bst_imgproc_locator *out) {
    const int threads = limits->threads, capacity = limits->capacity;
    const int max_width = limits->max_width, max_height = limits->max_height;
    *out = (bst_imgproc_locator){.threads = threads,
                                 .max_side = limits->max_side,
                                 .capacity = capacity,
                                 .columns = max_width / BST_LOCATE_CELL_PX + 1,
                                 .rows = max_height / BST_LOCATE_CELL_PX + 1};
    bst_imgproc_gauss_init(&out->psf);
    bst_scratch_pool_init(&out->lent, threads);
    out->found = calloc((size_t)capacity, sizeof *out->found);
    out->next = calloc((size_t)capacity, sizeof *out->next);
    out->from = calloc((size_t)capacity, sizeof *out->from);
    out->chosen = calloc(
        (size_t)max_width * (size_t)max_height / 4 + (size_t)max_width + (size_t)max_height + 1, 1);
    out->cell = calloc((size_t)out->columns * (size_t)out->rows, sizeof *out->cell);
    out->charged_capacity = 16 * capacity;
    out->charged = calloc((size_t)out->charged_capacity, sizeof *out->charged);
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
    free(l->found);
    free(l->next);
    free(l->from);
    free(l->chosen);
    free(l->cell);
    free(l->charged);
    for (int i = 0; l->fits && i < l->threads; i++) {
        bst_fit_free(&l->fits[i]);
    }
    free(l->fits);
    bst_source_profiles_free(&l->profiles);
    *l = (bst_imgproc_locator){0};
}

static void set_star_path(const bst_locate_frame *f, bst_imgproc_shape *s) {
    bst_camera_motion_streak(f->motion, f->camera, f->origin_x_px + f->binning * s->x_px,
                             f->origin_y_px + f->binning * s->y_px, &s->dx_px, &s->dy_px);
    bst_camera_motion_bend(f->motion, f->camera, &s->bend_x_px, &s->bend_y_px);
    s->dx_px /= f->binning;
    s->dy_px /= f->binning;
    s->bend_x_px /= f->binning;
    s->bend_y_px /= f->binning;
}

/* A found one as a point or a streak at its maximum. */
static bst_imgproc_source as_shape(const bst_locate_frame *f, const bst_imgproc_found *found,
                                   bool streak) {
    bst_imgproc_source s = {.flux_e = found->top_snr * found->noise_e / bst_locate_norm(f, streak),
                            .widening_px2 = found->source.widening_px2};
    s.shape = (bst_imgproc_shape){
        .x_px = found->top_x_px, .y_px = found->top_y_px, .sigma_px = f->sigma_px};
    if (streak) {
        set_star_path(f, &s.shape);
    }
    return s;
}

/* Starts a source at its candidate: at the top of the filter's output, between the pixels. */
static void start(const bst_locate_frame *f, const bst_candidate *c, bst_imgproc_found *out) {
    *out = (bst_imgproc_found){.peak_snr = c->snr, .peak_x = c->x, .peak_y = c->y};
    out->noise_e = bst_locate_noise_at(f, c->x, c->y);
    double dx, dy;
    out->top_snr = bst_filter_top(f->filter, false, c->x, c->y, &dx, &dy);
    out->top_x_px = c->x + dx;
    out->top_y_px = c->y + dy;
    out->streak = f->filter->streak && c->snr > bst_filter_point_at(f->filter, c->x, c->y);
    out->source = as_shape(f, out, out->streak);
}

static void note_length(bst_imgproc_locator *l, const bst_imgproc_shape *s) {
    l->longest_px = fmax(l->longest_px, fmax(0.5 * fabs(s->dx_px) + fabs(s->bend_x_px),
                                             0.5 * fabs(s->dy_px) + fabs(s->bend_y_px)));
}

/* Whether the filters leave the shape open. A fit's chi-square is less by the square of its
 * filter's output, so that the two outputs tell which of the shapes fits better, but for what they
 * are off between the pixels and what neighbours add. Most sources of a frame with streaks are
 * streaks: a point is always fitted as both. */
static bool shape_is_open(const bst_locate_frame *f, const bst_imgproc_found *found) {
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
static void locate_one(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_imgproc_locator *l = w->l;
    const bst_locate_frame *f = w->f;
    if (found->bleed) {
        found->source.fitted = bst_blooming_fit(w, i, found);
        return;
    }
    double widening = l->widening_weight > 0.0 ? l->widening_sum / l->widening_weight : 0.0;
    found->source.widening_px2 = widening;
    bool bright = (double)found->peak_snr > WIDTH_FIT_SNR;
    if (shape_is_open(f, found)) {
        bst_imgproc_source point = as_shape(f, found, false), streak = as_shape(f, found, true);
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

/* What the fit of a bright source says of the PSF's width. */
static void note_widening(bst_imgproc_locator *l, const bst_locate_frame *f,
                          const bst_imgproc_found *found) {
    bool measured = found->source.fitted && found->source.widening_variance > 0.0 && !found->bleed;
    double variance = f->sigma_px * f->sigma_px;
    if (measured && fabs(found->source.widening_px2) < 0.5 * variance) {
        /* no single source counts for more than one that is good to 3 % */
        double floor = 0.03 * variance;
        double weight = 1.0 / (found->source.widening_variance + floor * floor);
        l->widening_sum += weight * found->source.widening_px2;
        l->widening_weight += weight;
    }
}

/* Whether charge was taken off about a candidate: the filters answer to it besides its own place.
 */
static bool is_charge_near(const bst_imgproc_locator *l, const bst_locate_frame *f,
                           const bst_imgproc_found *found) {
    bst_imgproc_source s = found->source;
    s.shape.x_px = found->peak_x;
    s.shape.y_px = found->peak_y;
    bst_imgproc_stamp stamp =
        bst_fit_stamp(&s, bst_deblend_reach(f), l->max_side, f->width, f->height);
    return bst_cosmic_ray_in(l, f->width, &stamp);
}

/* A candidate whose fit failed keeps its maximum's place. */
static void use_maximum(const bst_locate_frame *f, bst_imgproc_found *found) {
    found->source = as_shape(f, found, found->streak);
    found->source.cov_xx = found->source.cov_yy = 1.0;
    found->source.cov_xy = 0.0;
    double sigma = found->noise_e / bst_locate_norm(f, found->streak);
    found->source.flux_variance = sigma * sigma + found->source.flux_e;
}

static void half_extent(const bst_locate_frame *f, const bst_imgproc_shape *s, double *half_x,
                        double *half_y) {
    *half_x = 0.5 * fabs(s->dx_px) + fabs(s->bend_x_px) + 2.0 * f->sigma_px;
    *half_y = 0.5 * fabs(s->dy_px) + fabs(s->bend_y_px) + 2.0 * f->sigma_px;
}

static void flag_edge(const bst_locate_frame *f, bst_imgproc_found *found) {
    const bst_imgproc_shape *s = &found->source.shape;
    double half_x, half_y;
    half_extent(f, s, &half_x, &half_y);
    if (s->x_px - half_x < -0.5 || s->y_px - half_y < -0.5 || s->x_px + half_x > f->width - 0.5 ||
        s->y_px + half_y > f->height - 0.5) {
        found->flags |= BST_DETECTION_EDGE;
    }
}

/* Flags and plausibility. The light of a source beyond the edge fits with any flux: a place outside
 * of the frame is that of the maximum instead. */
static void judge(const bst_locate_frame *f, bst_imgproc_found *found) {
    const bst_imgproc_source *s = &found->source;
    bool outside = s->shape.x_px < -0.5 || s->shape.y_px < -0.5 || s->shape.x_px > f->width - 0.5 ||
                   s->shape.y_px > f->height - 0.5;
    if (outside) {
        use_maximum(f, found);
        found->snr = (double)found->peak_snr;
        found->flags |= BST_DETECTION_EDGE;
    }
    flag_edge(f, found);
    double half_x, half_y, x = s->shape.x_px, y = s->shape.y_px;
    half_extent(f, &s->shape, &half_x, &half_y);
    int x0 = (int)fmax(x - half_x - 1.0, 0.0), x1 = (int)fmin(x + half_x + 1.0, f->width - 1.0);
    int y0 = (int)fmax(y - half_y - 1.0, 0.0), y1 = (int)fmin(y + half_y + 1.0, f->height - 1.0);
    for (int j = y0; j <= y1; j++) {
        for (int i = x0; i <= x1; i++) {
            if (f->signal[(size_t)j * (size_t)f->width + (size_t)i] == BST_PIXEL_SATURATED) {
                found->flags |= BST_DETECTION_SATURATED;
            }
        }
    }
    if (outside || !s->fitted) {
        found->label = BST_LABEL_ARTEFACT;
        found->label_probability = 0.9;
    }
}

/* A loop over the found ones from `first` on. */
typedef struct loop {
    bst_imgproc_locator *l;
    const bst_locate_frame *f;
    const bst_candidates *candidates;
    void (*each)(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);
    int first;
} loop;

static void start_some(void *user, int begin, int end) {
    const loop *p = user;
    for (int i = begin; i < end; i++) {
        start(p->f, &p->candidates->items[p->l->from[i]], &p->l->found[i]);
    }
}

/* Makes of each of `found` that is to be seen to what `next` becomes. */
static void do_some(void *user, int begin, int end) {
    const loop *p = user;
    bst_imgproc_locator *l = p->l;
    int taken = bst_scratch_pool_take(&l->lent);
    bst_imgproc_worker w = {l, p->f, &l->fits[taken]};
    for (int i = p->first + begin; i < p->first + end; i++) {
        l->next[i] = l->found[i];
        if (!l->found[i].dropped && !bst_cosmic_ray_label(l->found[i].label)) {
            p->each(&w, i, &l->next[i]);
        }
    }
    bst_scratch_pool_give(&l->lent, taken);
}

/* Numbers first to end all see one another, and the others, as they were before. */
static void do_all(bst_imgproc_locator *l, const bst_locate_frame *f, int first, int end,
                   void (*each)(const bst_imgproc_worker *, int, bst_imgproc_found *)) {
    loop p = {l, f, NULL, each, first};
    bst_parallel_for(f->pool, end - first, FITS_A_TIME, do_some, &p);
    for (int i = first; i < end; i++) {
        l->found[i] = l->next[i];
        note_length(l, &l->found[i].source.shape);
    }
}

static void first_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    if (found->charge.pixels > 0 && bst_cosmic_ray_light(w->f, found) < BST_CHARGE_LIGHT_SNR) {
        bst_cosmic_ray_take(found);
        return;
    }
    locate_one(w, i, found);
    if (found->charge.pixels > 0 && bst_cosmic_ray_alone(found)) {
        bst_cosmic_ray_take(found);
    }
}

/* Places by the filter; charge hides some of its pixels from the filter. */
static void place(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    if (found->charge.pixels > 0) {
        first_fit(w, i, found);
    } else {
        bst_peak_centroid_place(w, i, found);
    }
}

/* The numbers that are fitted at a time end at powers of three times the first group. */
static int group_end(int first) {
    return first < FIRST_GROUP ? FIRST_GROUP : 3 * first;
}

/* Whether number i was fitted before its neighbour had its place: with a neighbour that is gone
 * now, or held one where it is not any more. */
static bool company_changed(const bst_imgproc_worker *w, int i, const bst_imgproc_found *found,
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

/* Blends, now that every neighbour has its place. */
static void second_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    bst_imgproc_stamp stamp = bst_deblend_stamp(w->l, w->f, &found->source);
    if ((found->flags & BST_DETECTION_BLEND) && found->source.fitted &&
        company_changed(w, i, found, &stamp)) {
        found->flags &= ~(unsigned)BST_DETECTION_BLEND;
        found->source.fitted = bst_deblend_fit(w, i, found, &stamp, false);
    }
}

static void finish(const bst_imgproc_worker *w, int i, bst_imgproc_found *found) {
    const bst_locate_frame *f = w->f;
    if (found->bleed) {
        bst_blooming_finish(f, found);
        flag_edge(f, found);
        return;
    }
    if (!found->source.fitted) {
        use_maximum(f, found);
    }
    found->snr = found->source.flux_e * bst_locate_norm(f, found->streak) / found->noise_e;
    if (found->snr < BST_CHARGE_LIGHT_SNR && is_charge_near(w->l, f, found)) {
        found->dropped = true;
        return;
    }
    judge(f, found);
    bool alone = !(found->flags & (BST_DETECTION_BLEND | BST_DETECTION_EDGE));
    if (alone && !found->rough && !found->streak && found->label == BST_LABEL_UNKNOWN &&
        found->snr >= BST_EXTENT_SNR) {
        bst_source_moments_own_streak(w, i, found);
    }
    bst_source_moments_measure(w, i, found, 0.0);
    if (found->streak ||
        (found->snr >= BST_EXTENT_SNR && found->length_px > 1.5 * fmax(found->width_px, 1.0) &&
         found->length_px > 1.5 * BST_FWHM_PER_SIGMA * f->sigma_px)) {
        found->flags |= BST_DETECTION_STREAK;
    }
}

static void set_laws(bst_imgproc_locator *l, const bst_locate_frame *f) {
    bst_imgproc_worker w = {l, f, &l->fits[0]};
    bst_imgproc_shape shape = {
        .x_px = 0.5 * f->width, .y_px = 0.5 * f->height, .sigma_px = f->sigma_px};
    l->law[0] = bst_peak_centroid_law_of(&w, &shape);
    if (f->filter->streak) {
        set_star_path(f, &shape);
        l->law[1] = bst_peak_centroid_law_of(&w, &shape);
    }
}

/* l->from: the brightest, of which `fits` by brightness and the others as they lie on the frame,
 * because what is near on the frame is near in memory. */
static void choose(bst_imgproc_locator *l, const bst_candidates *candidates, int fits) {
    const int *order = candidates->order;
    if (fits == l->count) {
        memcpy(l->from, order, (size_t)fits * sizeof *order);
        return;
    }
    /* candidates are by row */
    memset(l->chosen, 0, (size_t)candidates->count);
    for (int i = fits; i < l->count; i++) {
        l->chosen[order[i]] = 1;
    }
    memcpy(l->from, order, (size_t)fits * sizeof *order);
    for (int k = 0, next = fits; k < candidates->count; k++) {
        if (l->chosen[k]) {
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
    l->count = candidates->count < l->capacity ? candidates->count : l->capacity;
    l->longest_px = 0.0;
    int fits = l->max_fits > 0 && l->max_fits < l->count ? l->max_fits : l->count;
    choose(l, candidates, fits);
    loop p = {l, f, candidates, NULL, 0};
    bst_parallel_for(f->pool, l->count, STARTS_A_TIME, start_some, &p);
    for (int i = 0; i < l->count; i++) {
        note_length(l, &l->found[i].source.shape);
    }
    bst_deblend_index(l, f);
    double variance = f->sigma_px * f->sigma_px;
    l->widening_sum = 0.0;
    l->widening_weight = 1.0 / (0.0025 * variance * variance); /* no widening, to 5 % */
    bst_locate_prepare(l, f);
    bst_blooming_join(l, f);
    bst_cosmic_ray_remove(l, f);
    for (int first = 0, end; first < fits; first = end) {
        end = group_end(first) < fits ? group_end(first) : fits;
        do_all(l, f, first, end, first_fit);
        for (int i = first; i < end; i++) {
            note_widening(l, f, &l->found[i]);
        }
    }
    bst_deblend_drop_doubles(l, f, fits);
    if (fits < l->count) {
        set_laws(l, f);
        do_all(l, f, fits, l->count, place);
    }
    do_all(l, f, 0, fits, second_fit);
    do_all(l, f, 0, l->count, finish);
}

void bst_locate_again(bst_imgproc_locator *l, const bst_locate_frame *f, int i) {
    bst_imgproc_worker w = {l, f, &l->fits[0]};
    bst_imgproc_found found = l->found[i];
    if (!found.rough || found.dropped) {
        return;
    }
    found.rough = false;
    found.flags = 0;
    first_fit(&w, i, &found);
    if (found.source.fitted) {
        finish(&w, i, &found);
        l->found[i] = found;
    }
}

/* A found one that is not fitted. */
static void keep_maximum(const bst_locate_frame *f, bst_imgproc_found *found) {
    use_maximum(f, found);
    found->snr = (double)found->peak_snr;
    found->length_px = found->width_px = BST_FWHM_PER_SIGMA * f->sigma_px;
}

static void start_roughly(void *user, int begin, int end) {
    const loop *p = user;
    start_some(user, begin, end);
    for (int i = begin; i < end; i++) {
        keep_maximum(p->f, &p->l->found[i]);
    }
}

void bst_locate_roughly(bst_imgproc_locator *l, const bst_locate_frame *f,
                        const bst_candidates *candidates) {
    l->count = candidates->count < l->capacity ? candidates->count : l->capacity;
    choose(l, candidates, l->count);
    loop p = {l, f, candidates, NULL, 0};
    bst_parallel_for(f->pool, l->count, STARTS_A_TIME, start_roughly, &p);
}
