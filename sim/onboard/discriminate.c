#include "sim/onboard/discriminate.h"

#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/arena.h"
#include "sim/core/heapsort.h"
#include "sim/optics/photometry.h"

enum { BAND = 8, MAG_BINS = 60, KEEP_MISSED = 8, KEEP_CHARGE = 50 };
enum { MOST_SEEN = INT_MAX / 2 }; /* frames in which a source was seen: a limit of saved states */

static const double EXPECTED_OBJECTS = 10.0; /* expected in a frame without earlier ones */
/* 1 sigma position error between frames besides the covariance: attitude, distortion, pixels */
static const double PLACE_SIGMA_PX = 0.15;
static const double SAME_SIGMAS = 4.0;
static const double SAME_MAG = 0.75;
static const double MAX_GATE_PX = 3.0;
/* star streaks longer than this are distinguished from points */
static const double STREAK_PX = 3.0;
static const double LONG_SHARE = 3.0; /* length-to-width ratio that no blend of two points has */
/* Log-odds threshold of a suspected pixel (odds 200). At most one in two hundred sources at rest in
 * the frame is ever labelled as a hot pixel. */
static const double SUSPICIOUS = 5.3;
static const double FAINT_SNR = 8.0; /* below this SNR a hot pixel can look like light */
static const double STAR_REDETECTED = 0.6;

/* A source of earlier frames, by its direction on the sky. */
typedef struct earlier_source {
    bst_vec3 first, latest;       /* apparent directions */
    double first_var, latest_var; /* rad^2 per axis */
    double v_mag;
    int seen, missed; /* frames */
    bool moved;
    /* first seen in a region that an earlier frame had covered; not yet confirmed or refuted */
    bool fresh;
    bool blend;
    /* in the current frame */
    double x_px, y_px;
    bool inside, taken;
    int next; /* next in the row band's list */
} earlier_source;

/* Charge of earlier frames at a sensor pixel. */
typedef struct charged {
    int64_t pixel;
    int seen, missed;
} charged;

/* Statistics of new sources by brightness: how many the next frame tested, how many stayed at rest.
 */
typedef struct outcome {
    double judged, stayed;
} outcome;

struct bst_discriminator {
    bst_arena arena; /* of all arrays below */
    bst_camera camera;
    int capacity, room;
    earlier_source *sources; /* [room] sources of earlier frames */
    int count;
    charged *charge, *merged; /* [room], ascending in pixel */
    int charge_count;
    int *keys_order;
    int *again; /* [capacity]: earlier source that a detection matches, -1: none */
    int64_t *keys;
    int *band;
    int bands;
    outcome outcomes[2][MAG_BINS]; /* [isolated, blended] */
    /* of the latest frame with attitude, and of the latest frame */
    bool covered, charge_covered;
    bst_quat q_cam_from_gcrf;
    bst_window window, charge_window;
};

static void lay_out(bst_discriminator *d) {
    size_t room = (size_t)d->room, capacity = (size_t)d->capacity;
    BST_ARENA_TAKE(&d->arena, d->sources, room);
    BST_ARENA_TAKE(&d->arena, d->charge, room);
    BST_ARENA_TAKE(&d->arena, d->merged, room);
    BST_ARENA_TAKE(&d->arena, d->keys, capacity);
    BST_ARENA_TAKE(&d->arena, d->keys_order, capacity);
    BST_ARENA_TAKE(&d->arena, d->again, capacity);
    BST_ARENA_TAKE(&d->arena, d->band, (size_t)d->bands);
}

bst_status bst_discriminator_create(bst_ctx *ctx, const bst_camera *camera, int capacity,
                                    bst_discriminator **out) {
    assert(camera && out && capacity > 0);
    *out = NULL;
    bst_discriminator *d = calloc(1, sizeof *d);
    if (!d) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for discrimination");
    }
    d->camera = *camera;
    d->capacity = capacity;
    d->room = 3 * capacity;
    d->bands = (int)camera->height_px / BAND + 1;
    lay_out(d);
    bst_status status = bst_arena_alloc(ctx, &d->arena, "the memory of earlier detections");
    if (status != BST_OK) {
        bst_discriminator_free(d);
        return status;
    }
    lay_out(d);
    *out = d;
    return BST_OK;
}

void bst_discriminator_use_camera(bst_discriminator *d, const bst_camera *camera) {
    assert(d && camera && camera->width_px == d->camera.width_px);
    d->camera = *camera;
}

void bst_discriminator_free(bst_discriminator *d) {
    if (!d) {
        return;
    }
    bst_arena_free(&d->arena);
    free(d);
}

static void archive_source(bst_archive *archive, earlier_source *s) {
    BST_ARCHIVE(archive, s->first);
    BST_ARCHIVE(archive, s->latest);
    BST_ARCHIVE(archive, s->first_var);
    BST_ARCHIVE(archive, s->latest_var);
    BST_ARCHIVE(archive, s->v_mag);
    s->seen = (int)bst_archive_integer(archive, s->seen, 1, MOST_SEEN);
    s->missed = (int)bst_archive_integer(archive, s->missed, 0, MOST_SEEN);
    bst_archive_bool(archive, &s->moved);
    bst_archive_bool(archive, &s->fresh);
    bst_archive_bool(archive, &s->blend);
}

static void archive_charged(bst_archive *archive, charged *c) {
    BST_ARCHIVE(archive, c->pixel);
    c->seen = (int)bst_archive_integer(archive, c->seen, 1, MOST_SEEN);
    c->missed = (int)bst_archive_integer(archive, c->missed, 0, MOST_SEEN);
}

/* Saves or restores a window on the sensor. */
static void archive_window(bst_archive *archive, const bst_camera *camera, bst_window *w) {
    w->x0 = (int)bst_archive_integer(archive, w->x0, 0, camera->width_px);
    w->y0 = (int)bst_archive_integer(archive, w->y0, 0, camera->height_px);
    w->width = (int)bst_archive_integer(archive, w->width, 0, camera->width_px - w->x0);
    w->height = (int)bst_archive_integer(archive, w->height, 0, camera->height_px - w->y0);
}

void bst_discriminator_archive(bst_discriminator *d, bst_archive *archive) {
    assert(d && archive);
    int sources = bst_archive_count(archive, d->count, d->room);
    for (int i = 0; i < sources; i++) {
        if (bst_archive_is_restoring(archive)) { /* the rest is of the frame in progress */
            d->sources[i] = (earlier_source){.next = -1};
        }
        archive_source(archive, &d->sources[i]);
    }
    d->count = sources;
    d->charge_count = bst_archive_count(archive, d->charge_count, d->room);
    for (int i = 0; i < d->charge_count; i++) {
        archive_charged(archive, &d->charge[i]);
    }
    BST_ARCHIVE(archive, d->outcomes);
    bst_archive_bool(archive, &d->covered);
    bst_archive_bool(archive, &d->charge_covered);
    BST_ARCHIVE(archive, d->q_cam_from_gcrf);
    archive_window(archive, &d->camera, &d->window);
    archive_window(archive, &d->camera, &d->charge_window);
}

/* Sets a detection's label and its probability, clamped to 0 to 1. */
static void set_label(bst_detection *d, bst_label label, double probability) {
    d->label = (int32_t)label;
    d->label_probability = fmin(fmax(probability, 0.0), 1.0);
}

/* True if a pixel position lies in a window, at least `margin` from its edges. */
static bool in_window(const bst_window *w, double x, double y, double margin) {
    return x >= w->x0 + margin && y >= w->y0 + margin && x <= w->x0 + w->width - 1 - margin &&
           y <= w->y0 + w->height - 1 - margin;
}

/* ---- Hot pixels and cosmic rays: charge at the same sensor pixel as before ---- */

/* Sensor pixel of a detection. */
static int64_t pixel_of(const bst_discriminator *d, const bst_detection *item) {
    return (int64_t)llround(item->y_px) * d->camera.width_px + (int64_t)llround(item->x_px);
}

static bool key_less(const void *context, int a, int b) {
    const int64_t *keys = context;
    return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
}

/* Number of earlier frames in which a pixel held charge. */
static int earlier_charge_count(const bst_discriminator *d, int64_t pixel) {
    int lo = 0, hi = d->charge_count;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (d->charge[mid].pixel < pixel) {
            lo = mid + 1;
        } else {
            hi = mid;
        }
    }
    return lo < d->charge_count && d->charge[lo].pixel == pixel ? d->charge[lo].seen : 0;
}

/* Log-odds that a detection is caused by a pixel under suspicion of the bad-pixel learner. */
static double bad_pixel_log_odds(const bst_discriminator *d, const bst_frame_knowledge *f,
                                 const bst_detection *item) {
    return f->suspicion ? f->suspicion(f->suspicion_user, (int32_t)pixel_of(d, item)) : 0.0;
}

/* Labels charge as hot pixel (again at the same sensor pixel) or cosmic ray (pixel covered before
 * without charge). */
static void label_hot_pixel_or_cosmic_ray(const bst_discriminator *d, const bst_frame_knowledge *f,
                                          bst_detection *item) {
    int64_t pixel = pixel_of(d, item);
    bool again = earlier_charge_count(d, pixel) > 0 || bad_pixel_log_odds(d, f, item) >= SUSPICIOUS;
    if (item->label == BST_LABEL_HIT && !again) {
        /* the centroid of several charged pixels may round to a neighbour */
        const int64_t row = d->camera.width_px;
        again = earlier_charge_count(d, pixel - 1) + earlier_charge_count(d, pixel + 1) +
                    earlier_charge_count(d, pixel - row) + earlier_charge_count(d, pixel + row) >
                0;
    }
    bool looked = d->charge_covered && in_window(&d->charge_window, item->x_px, item->y_px, 0.0);
    double charge = item->label_probability; /* probability that it is charge, not light */
    if (again) {
        set_label(item, BST_LABEL_HOT_PIXEL, 0.99 * charge);
    } else if (looked) {
        set_label(item, BST_LABEL_HIT, 0.95 * charge);
    } else if (item->label == BST_LABEL_HIT) {
        set_label(item, BST_LABEL_HIT, 0.8 * charge);
    } else {
        set_label(item, BST_LABEL_HOT_PIXEL, 0.5 * charge);
    }
}

/* Merges the frame's charge into the list of earlier charge; both are ascending in pixel. */
static void store_charge(bst_discriminator *d, const bst_window *window,
                         const bst_detections *out) {
    int fresh = 0;
    for (int i = 0; i < out->count && fresh < d->capacity; i++) {
        if (bst_label_is_charge(out->items[i].label)) {
            d->keys_order[fresh] = fresh;
            d->keys[fresh++] = pixel_of(d, &out->items[i]);
        }
    }
    bst_heapsort_indices(d->keys_order, fresh, key_less, d->keys);
    int a = 0, b = 0, count = 0;
    while ((a < d->charge_count || b < fresh) && count < d->room) {
        int64_t old = a < d->charge_count ? d->charge[a].pixel : INT64_MAX;
        int64_t now = b < fresh ? d->keys[d->keys_order[b]] : INT64_MAX;
        charged c = {now, 1, 0};
        if (old <= now) {
            c = d->charge[a++];
            if (old == now) {
                c.seen++;
                c.missed = 0;
            } else {
                c.missed += in_window(window, (double)(old % d->camera.width_px),
                                      (double)(old / d->camera.width_px), 0.0);
            }
        }
        while (b < fresh && d->keys[d->keys_order[b]] == c.pixel) {
            b++;
        }
        if (c.missed < (c.seen > 1 ? KEEP_CHARGE : KEEP_MISSED)) {
            d->merged[count++] = c;
        }
    }
    charged *swap = d->charge;
    d->charge = d->merged;
    d->merged = swap;
    d->charge_count = count;
    d->charge_covered = true;
    d->charge_window = *window;
}

/* ---- Sources: at the same position of the sky as before ---- */

/* Projects a GCRF direction to the sensor; false if it is out of view. */
static bool project(const bst_discriminator *d, bst_quat q, bst_vec3 direction, double *x,
                    double *y) {
    return bst_camera_project(&d->camera, bst_quat_rotate(q, direction), x, y);
}

/* Projects the earlier sources into this frame and indexes them by row bands. */
static void project_earlier_sources(bst_discriminator *d, const bst_frame_knowledge *f) {
    for (int i = 0; i < d->bands; i++) {
        d->band[i] = -1;
    }
    for (int i = d->count - 1; i >= 0; i--) {
        earlier_source *r = &d->sources[i];
        r->taken = false;
        r->inside = project(d, f->q_cam_from_gcrf, r->latest, &r->x_px, &r->y_px) &&
                    in_window(&f->window, r->x_px, r->y_px, 0.0);
        int band = (int)(r->y_px / BAND);
        if (r->inside && band >= 0 && band < d->bands) {
            r->next = d->band[band];
            d->band[band] = i;
        }
    }
}

/* Position variance of a detection between frames, px^2. */
static double position_variance(const bst_detection *item) {
    return fmax(item->cov_xx, item->cov_yy) + PLACE_SIGMA_PX * PLACE_SIGMA_PX;
}

/* Standard error of a detection's magnitude, at most 1. */
static double mag_sigma(const bst_detection *item) {
    return fmin(bst_photometry_noise_mag(item), 1.0);
}

/* Index of the nearest earlier source of similar brightness; -1: none. */
static int match_earlier_source(bst_discriminator *d, const bst_detection *item) {
    double scale = bst_camera_scale_rad(&d->camera), closest = 1.0;
    int best = -1;
    int band = (int)(item->y_px / BAND);
    for (int b = band - 1; b <= band + 1; b++) {
        for (int i = b >= 0 && b < d->bands ? d->band[b] : -1; i >= 0; i = d->sources[i].next) {
            earlier_source *r = &d->sources[i];
            if (r->taken || fabs(r->v_mag - item->v_mag) > SAME_MAG + 3.0 * mag_sigma(item)) {
                continue;
            }
            double variance = position_variance(item) + r->latest_var / (scale * scale);
            double gate = fmin(SAME_SIGMAS * sqrt(variance), MAX_GATE_PX);
            double distance = hypot(item->x_px - r->x_px, item->y_px - r->y_px) / gate;
            if (distance < closest) {
                closest = distance;
                best = i;
            }
        }
    }
    return best;
}

/* Statistics bin of new sources of a magnitude. */
static outcome *statistics_of(bst_discriminator *d, double v_mag, bool blend) {
    int bin = (int)floor(2.0 * (v_mag + 5.0));
    return &d->outcomes[blend][bin < 0 ? 0 : bin >= MAG_BINS ? MAG_BINS - 1 : bin];
}

/* True if a detection is light of a source: neither charge nor an artefact. */
static bool is_source(const bst_detection *item) {
    return !bst_label_is_charge(item->label) && item->label != BST_LABEL_ARTEFACT;
}

/* Updates an earlier source that was detected again; tests if it has moved. */
static void update_earlier_source(bst_discriminator *d, const bst_detection *item,
                                  bst_vec3 direction, earlier_source *r) {
    double scale = bst_camera_scale_rad(&d->camera);
    double variance = position_variance(item) * scale * scale;
    double away = bst_vec3_angle(direction, r->first);
    r->moved = r->moved || away * away > SAME_SIGMAS * SAME_SIGMAS * (variance + r->first_var);
    r->taken = true;
    r->seen++;
    r->missed = 0;
    r->latest = direction;
    r->latest_var = variance;
}

/* GCRF direction of a detection. */
static bst_vec3 direction_of(const bst_discriminator *d, const bst_frame_knowledge *f,
                             const bst_detection *item) {
    return bst_quat_rotate(bst_quat_conj(f->q_cam_from_gcrf),
                           bst_camera_unproject(&d->camera, item->x_px, item->y_px));
}

/* Matches detections to earlier sources, and updates the statistics of sources that were new in the
 * frame before. */
static void match_to_earlier_frames(bst_discriminator *d, const bst_frame_knowledge *f,
                                    const bst_detections *out) {
    for (int i = 0; i < out->count && i < d->capacity; i++) {
        d->again[i] = is_source(&out->items[i]) ? match_earlier_source(d, &out->items[i]) : -1;
        if (d->again[i] >= 0) {
            update_earlier_source(d, &out->items[i], direction_of(d, f, &out->items[i]),
                                  &d->sources[d->again[i]]);
        }
    }
    for (int i = 0; i < d->count; i++) {
        earlier_source *r = &d->sources[i];
        if (r->fresh && r->inside) {
            outcome *t = statistics_of(d, r->v_mag, r->blend);
            t->judged += 1.0;
            t->stayed += r->taken && !r->moved ? 1.0 : 0.0;
            r->fresh = false;
        }
    }
}

/* Stores a detection as a source for later frames. */
static void store_source(bst_discriminator *d, const bst_detection *item, bst_vec3 direction,
                         bool fresh) {
    if (d->count >= d->room) {
        return;
    }
    double scale = bst_camera_scale_rad(&d->camera);
    double variance = position_variance(item) * scale * scale;
    d->sources[d->count++] = (earlier_source){.first = direction,
                                              .latest = direction,
                                              .first_var = variance,
                                              .latest_var = variance,
                                              .v_mag = item->v_mag,
                                              .seen = 1,
                                              .fresh = fresh,
                                              .blend = (item->flags & BST_DETECTION_BLEND) != 0,
                                              .taken = true,
                                              .next = -1};
}

/* Removes sources not detected for long or far from the current field of view. */
static void remove_old_sources(bst_discriminator *d) {
    int kept = 0;
    for (int i = 0; i < d->count; i++) {
        earlier_source *r = &d->sources[i];
        r->missed += !r->taken;
        if (r->missed <= KEEP_MISSED) {
            d->sources[kept++] = *r;
        }
    }
    d->count = kept;
}

/* Probability that a source without an earlier match is a star. */
static double new_star_probability(bst_discriminator *d, const bst_detection *item) {
    const outcome *t = statistics_of(d, item->v_mag, (item->flags & BST_DETECTION_BLEND) != 0);
    /* prior of two tested sources that moved */
    double stayed = t->stayed / (t->judged + 2.0);
    return fmin(stayed / STAR_REDETECTED, 0.98);
}

/* ---- Labels of a frame ---- */

/* Labels the detections at predicted positions of moving tracks as OBJECT. */
static void label_predicted(const bst_discriminator *d, const bst_frame_knowledge *f,
                            bst_detections *out) {
    double scale = bst_camera_scale_rad(&d->camera);
    for (int p = 0; f->predictions && p < f->predictions->count; p++) {
        const bst_prediction *track = &f->predictions->items[p];
        bst_vec3 direction = bst_vec3_unit(
            bst_vec3_axpy(track->direction_gcrf, f->predictions_age_s, track->rate_gcrf_radps));
        double x, y, closest = fmin(1.0 + 3.0 * track->sigma_rad / scale, 2.0 * MAX_GATE_PX);
        if (!project(d, f->q_cam_from_gcrf, bst_light_aberrate(&f->light, direction), &x, &y)) {
            continue;
        }
        int best = -1;
        for (int i = 0; i < out->count; i++) {
            double distance = hypot(out->items[i].x_px - x, out->items[i].y_px - y);
            if (out->items[i].label == BST_LABEL_UNKNOWN && distance < closest) {
                closest = distance;
                best = i;
            }
        }
        if (best >= 0) {
            set_label(&out->items[best], BST_LABEL_OBJECT, 0.98);
        }
    }
}

/* True if a source is longer than close pairs of stars in a frame of point-like stars. */
static bool is_long_streak(const bst_detection *item) {
    return (item->flags & BST_DETECTION_STREAK) && !(item->flags & BST_DETECTION_BLEND) &&
           item->length_px > LONG_SHARE * item->width_px;
}

/* Labels a source by the rules in discriminate.h. */
static void label_source(bst_discriminator *d, const bst_frame_knowledge *f, double unlisted,
                         int again, bst_detection *item) {
    bool open = item->label == BST_LABEL_UNKNOWN;
    double star = 0.0;
    if (again >= 0) {
        const earlier_source *r = &d->sources[again];
        star = r->moved ? 0.05 : 1.0 - 0.1 / r->seen;
    } else {
        bst_vec3 direction = direction_of(d, f, item);
        double x, y;
        bool looked = d->covered && project(d, d->q_cam_from_gcrf, direction, &x, &y) &&
                      in_window(&d->window, x, y, MAX_GATE_PX);
        star = looked ? new_star_probability(d, item)
                      : 1.0 - fmin(EXPECTED_OBJECTS / (EXPECTED_OBJECTS + unlisted), 0.9);
        store_source(d, item, direction, looked);
    }
    if (!open) {
        return;
    }
    if (item->flags & BST_DETECTION_EDGE) {
        set_label(item, BST_LABEL_ARTEFACT, 0.9);
    } else if (f->streak_px >= STREAK_PX) {
        const unsigned shape = item->flags & (BST_DETECTION_STREAK | BST_DETECTION_OTHER_PATH);
        const bool drawn = shape == BST_DETECTION_STREAK;
        set_label(item, drawn ? BST_LABEL_STAR : BST_LABEL_OBJECT, drawn ? 0.9 : 0.95);
    } else if ((again < 0 || d->sources[again].moved) && is_long_streak(item)) {
        set_label(item, BST_LABEL_OBJECT, 0.95);
    } else if (star > 0.5) {
        set_label(item, BST_LABEL_STAR, star);
    } else {
        set_label(item, BST_LABEL_OBJECT, 1.0 - star);
    }
}

void bst_discriminator_label(bst_discriminator *d, const bst_frame_knowledge *f,
                             bst_detections *out) {
    assert(d && f && out && out->count >= 0 && out->count <= d->capacity);
    double unlisted = 0.0;
    for (int i = 0; i < out->count; i++) {
        bst_detection *item = &out->items[i];
        double odds = item->label == BST_LABEL_UNKNOWN ? bad_pixel_log_odds(d, f, item) : 0.0;
        if (bst_label_is_charge(item->label)) {
            label_hot_pixel_or_cosmic_ray(d, f, item);
        } else if (odds >= SUSPICIOUS) {
            set_label(item, BST_LABEL_HOT_PIXEL, 1.0 - exp(-odds));
        } else if (item->label == BST_LABEL_UNKNOWN && item->snr < FAINT_SNR &&
                   earlier_charge_count(d, pixel_of(d, item)) > 1) {
            set_label(item, BST_LABEL_HOT_PIXEL, 0.8);
        }
        unlisted += item->label == BST_LABEL_UNKNOWN;
    }
    store_charge(d, &f->window, out);
    for (int i = 0; i < out->count && !f->oriented; i++) {
        bst_detection *item = &out->items[i];
        if (item->label == BST_LABEL_UNKNOWN && (item->flags & BST_DETECTION_EDGE)) {
            set_label(item, BST_LABEL_ARTEFACT, 0.9);
        }
    }
    if (!f->oriented) {
        return;
    }
    label_predicted(d, f, out);
    project_earlier_sources(d, f);
    match_to_earlier_frames(d, f, out);
    for (int i = 0; i < out->count && i < d->capacity; i++) {
        if (is_source(&out->items[i])) {
            label_source(d, f, unlisted, d->again[i], &out->items[i]);
        }
    }
    remove_old_sources(d);
    d->covered = true;
    d->q_cam_from_gcrf = f->q_cam_from_gcrf;
    d->window = f->window;
}
