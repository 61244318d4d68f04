#include "imgproc/calibrate/pixel_learner.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/pages.h"

enum {
    MEMORY_LOOKS = 64, /* number of looks after which older ones are halved in weight */
    CHECK_EVERY = 4    /* a masked pixel is re-checked in one of so many frames */
};

/* Motion of the sky beyond which a star's light has left the pixel: px, or FWHM. */
static const double MOVED_PX = 3.0, MOVED_FWHM = 1.5;
/* An offset from the boresight's steady motion above this, px or share of that motion, is a slew.
 */
static const double JUMP_PX = 10.0, JUMP_SHARE = 0.25;
/* A pixel whose smallest log-likelihood sum falls below this is no longer suspected. */
static const double DISMISSED = -6.0;
/* Prior: one star in this number appears sharper than the PSF before any star is identified. */
static const double SHARP_PRIOR = 1000.0;
/* Largest shape term of one frame: frames are correlated through errors of the PSF model. */
static const double SHAPE_MOST = 5.0;
/* Excess, in sigma, above which a masked pixel still counts as bad; probability that a good pixel
 * exceeds it by noise or by sources of a crowded field. */
static const double STILL_SIGMAS = 3.0, STILL_CHANCE = 0.02;

/* Largest sum of a masked pixel, relative to the threshold: a recovered pixel is unmasked after
 * about twelve re-checks. */
static const double SURE = 1.25;
/* Least assumed probability that a masked pixel shows its defect again: one bad in under a quarter
 * of the re-checks is unmasked at times. */
static const double STILL_LEAST = 0.7;

typedef struct suspect {
    int32_t pixel;
    uint8_t binning;
    bool bad;
    uint16_t shown, looks;
    float sky, hit,
        at_rest;        /* log-likelihood ratios against each; bad: at_rest is that of `still` */
    float direction[3]; /* pixel's direction in GCRF at the latest return that counted */
    /* boresight offset, rad, at the latest return that counted against light at rest in the frame
     */
    float offset[2];
} suspect;

struct bst_pixel_learner {
    bst_camera camera;
    double bad_from, moved_rad;
    int capacity;
    suspect *items, *merged; /* [capacity], ascending in pixel */
    int count, bad_count;
    int64_t lost;
    bool waits, changed[BST_STEP_LANES];
    bst_pixel_map maps[BST_STEP_LANES];
    double stars, sharp_stars;
    /* attitudes of the latest two frames */
    bst_quat q[2];
    double time_s[2];
    int frames;
    /* Boresight under steady motion since the first frame; its rate in GCRF, rad/s, from the latest
     * steady frames; and the boresight's offset from it along x and y, rad. */
    bst_quat q_steady;
    bst_vec3 steady_radps;
    double offset[2], offset_limit;
};

const bst_config_desc bst_pixel_learner_config_table[] = {
    BST_BOOL(
        bst_pixel_learner_config, enabled, "true",
        "Learn which pixels are bad from frames in which the sky moves and a maximum does not."),
    BST_INT(bst_pixel_learner_config, capacity, "", 16, 4000000, "65536",
            "Room for bad pixels and pixels under suspicion; 130 bytes each."),
    BST_REAL(bst_pixel_learner_config, false_alarm_probability, "", 1e-12, 0.01, "1e-5",
             "Greatest chance that a good pixel under suspicion is taken for bad."),
    BST_FORMER("false_rate", "false_alarm_probability"),
    BST_CONFIG_END,
};

bst_status bst_pixel_learner_create(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_pixel_learner_config *config,
                                    bst_pixel_learner **out) {
    assert(camera && config && out);
    *out = NULL;
    bst_pixel_learner *l = calloc(1, sizeof *l);
    if (!l) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for learning bad pixels");
    }
    l->camera = *camera;
    l->capacity = (int)config->capacity;
    l->bad_from = -log(config->false_alarm_probability);
    l->moved_rad = bst_camera_scale_rad(camera) * fmax(MOVED_PX, MOVED_FWHM * camera->psf_fwhm_px);
    l->items = bst_pages_zero((size_t)l->capacity, sizeof *l->items);
    l->merged = bst_pages_zero((size_t)l->capacity, sizeof *l->merged);
    bst_status status =
        l->items && l->merged
            ? BST_OK
            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d bad pixels", l->capacity);
    for (int i = 0; i < BST_STEP_LANES && status == BST_OK; i++) {
        status = bst_bad_rows_create(ctx, (int)camera->width_px, (int)camera->height_px,
                                     l->capacity, &l->maps[i].rows);
    }
    if (status != BST_OK) {
        bst_pixel_learner_free(l);
        return status;
    }
    *out = l;
    return BST_OK;
}

void bst_pixel_learner_free(bst_pixel_learner *l) {
    if (!l) {
        return;
    }
    bst_pages_free(l->items);
    bst_pages_free(l->merged);
    for (int i = 0; i < BST_STEP_LANES; i++) {
        bst_bad_rows_free(&l->maps[i].rows);
    }
    free(l);
}

static void archive_suspect(bst_archive *archive, suspect *s) {
    BST_ARCHIVE(archive, s->pixel);
    BST_ARCHIVE(archive, s->binning);
    bst_archive_bool(archive, &s->bad);
    BST_ARCHIVE(archive, s->shown);
    BST_ARCHIVE(archive, s->looks);
    BST_ARCHIVE(archive, s->sky);
    BST_ARCHIVE(archive, s->hit);
    BST_ARCHIVE(archive, s->at_rest);
    BST_ARCHIVE(archive, s->direction);
    BST_ARCHIVE(archive, s->offset);
}

/* True if a pixel with its binning lies on the sensor, after pixel `last`. */
static bool is_in_order(const bst_pixel_learner *l, const suspect *s, int32_t last) {
    int64_t width = l->camera.width_px, x = s->pixel % width, y = s->pixel / width;
    return s->pixel > last && s->binning >= 1 && x + s->binning <= width &&
           y + s->binning <= l->camera.height_px;
}

bst_status bst_pixel_learner_archive(bst_pixel_learner *l, bst_archive *archive) {
    assert(l && archive);
    bool valid = true;
    l->count = bst_archive_count(archive, l->count, l->capacity);
    l->bad_count = 0;
    for (int i = 0; i < l->count; i++) {
        suspect *s = &l->items[i];
        archive_suspect(archive, s);
        valid = valid && is_in_order(l, s, i > 0 ? s[-1].pixel : -1);
        l->bad_count += s->bad;
    }
    l->lost = bst_archive_integer(archive, l->lost, 0, INT64_MAX / 2);
    bst_archive_bool(archive, &l->waits);
    for (int i = 0; i < BST_STEP_LANES; i++) {
        bst_archive_bool(archive, &l->changed[i]);
        BST_ARCHIVE(archive, l->maps[i].turn);
        BST_TRY(bst_bad_rows_archive(&l->maps[i].rows, archive));
    }
    BST_ARCHIVE(archive, l->stars);
    BST_ARCHIVE(archive, l->sharp_stars);
    BST_ARCHIVE(archive, l->q);
    BST_ARCHIVE(archive, l->time_s);
    l->frames = (int)bst_archive_integer(archive, l->frames, 0, INT32_MAX / 2);
    BST_ARCHIVE(archive, l->q_steady);
    BST_ARCHIVE(archive, l->steady_radps);
    BST_ARCHIVE(archive, l->offset);
    BST_ARCHIVE(archive, l->offset_limit);
    if (!valid) {
        l->count = l->bad_count = 0;
        return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                        "the saved state has suspected pixels that are not on the sensor of %lld x "
                        "%lld or not in order",
                        (long long)l->camera.width_px, (long long)l->camera.height_px);
    }
    return BST_OK;
}

void bst_pixel_learner_note_star(bst_pixel_learner *l, bool sharp) {
    l->stars += 1.0;
    l->sharp_stars += sharp ? 1.0 : 0.0;
}

/* ---- Likelihood ratios ---- */

/* p(deviation | defective pixel) / p(deviation | light), normal densities.
 *
 * Given:     deviation  largest deviation of the pixel's shape from the PSF, sigma
 *            alone      deviation expected of charge in one pixel, sigma
 *            tries      number of deviations of which this is the largest
 *            any        share of light with an arbitrary deviation */
static double sharpness_likelihood_ratio(double deviation, double alone, double tries, double any) {
    double d = fmax(deviation, 0.0), off = deviation - alone;
    double light = (1.0 - any) * fmin(1.0, tries * exp(-0.5 * d * d)) + any;
    return ((1.0 - any) * exp(-0.5 * off * off) + any) / light;
}

/* Log-likelihood ratio, defective pixel to light, of a maximum's shape. Half of the defects are
 * assumed isolated; for the others one deviating pair of neighbours suffices. */
static double shape_log_likelihood(const bst_pixel_learner *l, const bst_pixel_show *show) {
    const bst_sharpness_test *t = &show->sharp;
    double any = (l->sharp_stars + 1.0) / (l->stars + SHARP_PRIOR);
    double ratio =
        0.5 * sharpness_likelihood_ratio((double)t->all, (double)t->all_alone, 1.0, any) +
        0.5 * sharpness_likelihood_ratio((double)t->worst, (double)t->worst_alone,
                                         (double)BST_SHARP_GROUPS, any);
    return fmin(fmax(log(ratio), -SHAPE_MOST), SHAPE_MOST);
}

/* Direction of a sensor pixel in GCRF. */
static bst_vec3 direction_at(const bst_pixel_learner *l, const bst_pixel_frame *f, int32_t pixel) {
    double half = 0.5 * (f->binning - 1.0);
    bst_vec3 v = bst_camera_unproject(&l->camera, (double)(pixel % l->camera.width_px) + half,
                                      (double)(pixel / l->camera.width_px) + half);
    return bst_quat_rotate(bst_quat_conj(f->q_cam_from_gcrf), v);
}

/* True if a predicted track covers the pixel. */
static bool is_predicted(const bst_pixel_learner *l, const bst_pixel_frame *f, int32_t pixel) {
    double x = (double)(pixel % l->camera.width_px), y = (double)(pixel / l->camera.width_px);
    for (int i = 0; i < f->predicted_count; i++) {
        if (hypot(x - f->predicted[i][0], y - f->predicted[i][1]) < f->predicted[i][2]) {
            return true;
        }
    }
    return false;
}

/* True if the frame's windows cover the pixel. */
static bool is_covered(const bst_pixel_learner *l, const bst_pixel_frame *f, int32_t pixel) {
    int64_t x = pixel % l->camera.width_px, y = pixel / l->camera.width_px;
    int count = f->window_count;
    for (int i = 0; i < (count > 0 ? count : 1); i++) {
        const bst_window *w = count > 0 ? &f->windows[i] : &f->window;
        if (x >= w->x0 && y >= w->y0 && x < w->x0 + w->width && y < w->y0 + w->height) {
            return true;
        }
    }
    return false;
}

/* Probability that a defective pixel shows again: (shown + 1) / (looks + 2). */
static double return_probability(const suspect *s) {
    return (s->shown + 1.0) / (s->looks + 2.0);
}

/* Counts one look at a suspected pixel; older looks are halved once there are MEMORY_LOOKS. */
static void note_look(suspect *s, bool shown) {
    if (s->looks >= MEMORY_LOOKS) {
        s->looks /= 2;
        s->shown /= 2;
    }
    s->looks++;
    s->shown = (uint16_t)(s->shown + shown);
}

static void add_to(float *sum, double by) {
    *sum = (float)((double)*sum + by);
}

/* Updates the sums of a suspected pixel that showed a maximum. Returns true if the sky had moved,
 * so that the return counts. */
static bool update_on_return(const bst_pixel_learner *l, const bst_pixel_frame *f, double q,
                             const bst_pixel_show *show, suspect *s) {
    bst_vec3 now = direction_at(l, f, s->pixel);
    bst_vec3 before = {(double)s->direction[0], (double)s->direction[1], (double)s->direction[2]};
    if (bst_vec3_norm(bst_vec3_sub(now, before)) < l->moved_rad) {
        return false;
    }
    double ratio = log(return_probability(s) / q), shape = shape_log_likelihood(l, show);
    bool elsewhere = hypot(l->offset[0] - (double)s->offset[0],
                           l->offset[1] - (double)s->offset[1]) > l->offset_limit;
    bool jumped = elsewhere && !is_predicted(l, f, s->pixel);
    add_to(&s->hit, ratio);
    add_to(&s->sky, ratio + shape);
    add_to(&s->at_rest, shape + (jumped ? ratio : 0.0));
    note_look(s, true);
    if (elsewhere) {
        s->offset[0] = (float)l->offset[0];
        s->offset[1] = (float)l->offset[1];
    }
    s->direction[0] = (float)now.x;
    s->direction[1] = (float)now.y;
    s->direction[2] = (float)now.z;
    return true;
}

/* Updates the sums of a suspected pixel without a maximum. */
static void update_on_miss(double q, suspect *s) {
    double ratio = log((1.0 - return_probability(s)) / (1.0 - q));
    /* light at rest in the frame that may fade below the threshold misses as often as a defect */
    add_to(&s->hit, ratio);
    add_to(&s->sky, ratio);
    note_look(s, false);
}

/* Smallest of the three log-likelihood sums of a suspected pixel. */
static float smallest_sum(const suspect *s) {
    return fminf(s->hit, fminf(s->sky, s->at_rest));
}

/* Re-check of a masked pixel, whose sum is stored in at_rest. Returns true if it is still bad. */
static bool update_on_recheck(const bst_pixel_learner *l, const bst_pixel_check *check,
                              suspect *s) {
    bool still = (double)check->excess > STILL_SIGMAS;
    double p = fmax(return_probability(s), STILL_LEAST);
    add_to(&s->at_rest, still ? log(p / STILL_CHANCE) : log((1.0 - p) / (1.0 - STILL_CHANCE)));
    s->at_rest = fminf(s->at_rest, (float)(SURE * l->bad_from));
    note_look(s, still);
    return s->at_rest > 0.0f;
}

static suspect new_suspect(const bst_pixel_learner *l, const bst_pixel_frame *f,
                           const bst_pixel_show *show, double shape) {
    bst_vec3 d = direction_at(l, f, show->pixel);
    return (suspect){.pixel = show->pixel,
                     .binning = (uint8_t)f->binning,
                     .shown = 1,
                     .looks = 1,
                     .sky = (float)shape,
                     .at_rest = (float)shape,
                     .direction = {(float)d.x, (float)d.y, (float)d.z},
                     .offset = {(float)l->offset[0], (float)l->offset[1]}};
}

/* ---- Frames ---- */

/* Tracks the boresight's offset from steady motion. Light at rest in the frame returns to a pixel
 * when the boresight returns to the same offset. */
static void track_boresight_offset(bst_pixel_learner *l, const bst_pixel_frame *f) {
    bst_quat q = f->q_cam_from_gcrf;
    double scale = bst_camera_scale_rad(&l->camera), dt = f->time_s - l->time_s[1];
    double before = l->time_s[1] - l->time_s[0];
    bst_vec3 turn = {0};
    l->offset_limit = JUMP_PX * scale;
    if (l->frames == 0) {
        l->q_steady = q;
    } else if (dt > 0.0) {
        turn = bst_quat_to_rotvec(bst_quat_mul(bst_quat_conj(l->q[1]), q));
    }
    if (l->frames == 1 && dt > 0.0) {
        l->steady_radps = bst_vec3_scale(turn, 1.0 / dt);
    } else if (l->frames >= 2 && before > 0.0 && dt > 0.0) {
        bst_vec3 last = bst_quat_to_rotvec(bst_quat_mul(bst_quat_conj(l->q[0]), l->q[1]));
        bst_vec3 steady = bst_vec3_scale(last, dt / before);
        bst_quat expected = bst_quat_mul(l->q[1], bst_quat_from_rotvec(steady));
        bst_vec3 off = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(expected)));
        l->offset_limit = fmax(l->offset_limit, JUMP_SHARE * bst_vec3_norm(steady));
        if (hypot(off.x, off.y) <= l->offset_limit) {
            l->steady_radps = bst_vec3_scale(turn, 1.0 / dt);
        }
    }
    if (l->frames > 0 && dt > 0.0) {
        bst_quat step = bst_quat_from_rotvec(bst_vec3_scale(l->steady_radps, dt));
        l->q_steady = bst_quat_unit(bst_quat_mul(l->q_steady, step));
    }
    bst_vec3 offset = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(l->q_steady)));
    l->offset[0] = offset.x;
    l->offset[1] = offset.y;
    l->q[0] = l->q[1];
    l->time_s[0] = l->time_s[1];
    l->q[1] = q;
    l->time_s[1] = f->time_s;
    l->frames++;
}

/* Marks the published bad-pixel maps as out of date. */
static void mark_changed(bst_pixel_learner *l) {
    for (int i = 0; i < BST_STEP_LANES; i++) {
        l->changed[i] = true;
    }
}

/* Updates a known pixel, suspected or bad, with a frame. Returns false if it is dropped. */
static bool update_pixel(bst_pixel_learner *l, const bst_pixel_frame *f, double q,
                         const bst_pixel_show *show, const bst_pixel_check *check, suspect *s) {
    if (s->bad) {
        return !check || update_on_recheck(l, check, s);
    }
    if (s->binning != f->binning || !is_covered(l, f, s->pixel)) {
        return true;
    }
    if (!show) {
        update_on_miss(q, s);
    } else if (!update_on_return(l, f, q, show, s)) {
        l->waits = l->waits || shape_log_likelihood(l, show) > 0.0;
    }
    if ((double)smallest_sum(s) >= l->bad_from) {
        s->bad = true;
        s->at_rest = (float)(SURE * l->bad_from);
    }
    return s->bad || (double)smallest_sum(s) > DISMISSED;
}

static int by_pixel(const void *a, const void *b) {
    const suspect *p = a, *q = b;
    int order = (p->pixel > q->pixel) - (p->pixel < q->pixel);
    return order ? order : (int)q->bad - (int)p->bad;
}

/* Replaces a bad binned pixel by its sensor pixels; unbinned frames then identify the good ones. */
static void split_binned(bst_pixel_learner *l) {
    int before = l->count, kept = 0;
    for (int i = 0; i < before; i++) {
        suspect whole = l->items[i];
        if (!whole.bad || whole.binning == 1) {
            continue;
        }
        l->items[i].binning = 1;
        for (int k = 1; k < whole.binning * whole.binning; k++) {
            suspect part = whole;
            part.binning = 1;
            part.pixel += (int32_t)(k / whole.binning * l->camera.width_px + k % whole.binning);
            if (l->count < l->capacity) {
                l->items[l->count++] = part;
            } else {
                l->lost++;
            }
        }
    }
    if (l->count == before) {
        return;
    }
    qsort(l->items, (size_t)l->count, sizeof l->items[0], by_pixel);
    for (int i = 0; i < l->count; i++) {
        if (kept == 0 || l->items[kept - 1].pixel != l->items[i].pixel) {
            l->items[kept++] = l->items[i];
        }
    }
    l->count = kept;
}

/* Keeps a pixel in the merged list; counts it as lost if the list is full. */
static void keep(bst_pixel_learner *l, const suspect *s, int *count) {
    if (*count < l->capacity) {
        l->merged[(*count)++] = *s;
    } else {
        l->lost++;
    }
}

/* Re-check of a pixel; checks and pixels are both ascending, so *next only advances. */
static const bst_pixel_check *check_of(const bst_pixel_shows *shows, int32_t pixel, int *next) {
    while (*next < shows->check_count && shows->checks[*next].pixel < pixel) {
        (*next)++;
    }
    return *next < shows->check_count && shows->checks[*next].pixel == pixel ? &shows->checks[*next]
                                                                             : NULL;
}

void bst_pixel_learner_update(bst_pixel_learner *l, const bst_pixel_frame *f,
                              const bst_pixel_shows *shows) {
    assert(l && f && shows && l->count <= l->capacity);
    track_boresight_offset(l, f);
    l->waits = false;
    /* share of pixels with a maximum, between 1e-7 and 0.1 */
    double q = fmin(fmax(shows->maxima / fmax(shows->pixels, 1.0), 1e-7), 0.1);
    int a = 0, b = 0, next = 0, count = 0;
    bool changed = false, binned = false;
    while (a < l->count || b < shows->count) {
        int32_t old = a < l->count ? l->items[a].pixel : INT32_MAX;
        int32_t now = b < shows->count ? shows->items[b].pixel : INT32_MAX;
        const bst_pixel_show *show = now <= old ? &shows->items[b] : NULL;
        b += show != NULL;
        if (old > now) {
            double shape = shape_log_likelihood(l, show);
            suspect s = new_suspect(l, f, show, shape);
            if (shape > 0.3 * DISMISSED) {
                keep(l, &s, &count);
            }
            continue;
        }
        suspect s = l->items[a++];
        bool before = s.bad,
             kept = update_pixel(l, f, q, show, check_of(shows, s.pixel, &next), &s);
        changed = changed || s.bad != before || !kept;
        binned = binned || (s.bad && s.binning > 1);
        if (kept) {
            keep(l, &s, &count);
        }
    }
    suspect *swap = l->items;
    l->items = l->merged;
    l->merged = swap;
    l->count = count;
    if (binned) {
        split_binned(l);
    }
    if (changed) {
        mark_changed(l);
    }
    l->bad_count = 0;
    for (int i = 0; i < l->count; i++) {
        l->bad_count += l->items[i].bad;
    }
}

int bst_pixel_learner_bad_count(const bst_pixel_learner *l) {
    return l->bad_count;
}

int bst_pixel_learner_suspects(const bst_pixel_learner *l) {
    return l->count - l->bad_count;
}

int64_t bst_pixel_learner_lost(const bst_pixel_learner *l) {
    return l->lost;
}

bool bst_pixel_learner_waits(const bst_pixel_learner *l) {
    return l->waits;
}

double bst_pixel_learner_suspicion(const bst_pixel_learner *l, const bst_pixel_map *used,
                                   int32_t pixel) {
    int lo = 0, hi = l->count;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (l->items[mid].pixel < pixel) {
            lo = mid + 1;
        } else {
            hi = mid;
        }
    }
    if (lo == l->count || l->items[lo].pixel != pixel) {
        return 0.0;
    }
    if (!l->items[lo].bad) {
        return fmax((double)smallest_sum(&l->items[lo]), 0.0);
    }
    return bst_bad_rows_hold(&used->rows, pixel) ? 0.0 : l->bad_from;
}

/* ---- Published bad-pixel map ---- */

const bst_pixel_map *bst_pixel_learner_map(const bst_pixel_learner *l, int slot) {
    assert(l && slot >= 0 && slot < BST_STEP_LANES);
    return &l->maps[slot];
}

void bst_pixel_learner_publish(bst_pixel_learner *l, int slot, int64_t turn) {
    assert(l && slot >= 0 && slot < BST_STEP_LANES);
    bst_pixel_map *map = &l->maps[slot];
    map->turn = turn;
    if (!l->changed[slot]) {
        return;
    }
    l->changed[slot] = false;
    bst_bad_rows_begin(&map->rows);
    for (int i = 0; i < l->count; i++) {
        if (l->items[i].bad) {
            bst_bad_rows_add(&map->rows, l->items[i].pixel);
        }
    }
    bst_bad_rows_end(&map->rows);
}

void bst_pixel_map_check(const bst_pixel_map *map, const bst_locate_frame *f,
                         const bst_window *window, bst_imgproc_pixel_fn read, const void *user,
                         bst_pixel_shows *shows) {
    const bst_bad_rows *rows = &map->rows;
    int b = (int)f->binning;
    for (int v = window->y0; v < window->y0 + f->height * b && rows->count > 0; v++) {
        for (int i = rows->first[v]; i < rows->first[v + 1]; i++) {
            int u = rows->column[i], x = (u - window->x0) / b, y = (v - window->y0) / b;
            bool due = ((uint32_t)(v * 7 + u) + (uint32_t)map->turn) % CHECK_EVERY == 0;
            if (!due || u < window->x0 || x >= f->width || shows->check_count >= shows->capacity) {
                continue;
            }
            float electrons;
            read(user, y, x, 1, &electrons);
            if (electrons > BST_PIXEL_NONE) {
                double noise = bst_locate_noise_at(f, x, y);
                double excess =
                    ((double)electrons - bst_background_level_at(f->background, x, y)) / noise;
                shows->checks[shows->check_count++] =
                    (bst_pixel_check){v * rows->width + u, (float)excess};
            }
        }
    }
}
