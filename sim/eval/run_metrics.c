#include "sim/eval/run_metrics.h"

#include <stdlib.h>
#include <string.h>

/* As in loop_summary.c: a track or detection this near is the object's. */
#define NEAR_PX 5.0

/* Frames whose truth is kept for messages that come late: 1 s of latency at 60 Hz. */
enum { WAITING = 64 };

/* Errors in logarithmic bins of 1 % from 1e-5 px. */
enum { BINS = 2600 };
#define BIN_RATIO 1.01
#define BIN_FIRST 1e-5

typedef struct known_object {
    uint32_t id;
    bst_vec3 direction; /* geometric with light time, middle of the exposure */
    double x_px, y_px;  /* mean over the exposure */
} known_object;

typedef struct known_frame {
    int64_t exposure_id; /* -1: none */
    known_object *objects;
    int count, room;
} known_frame;

typedef struct seen_track {
    int64_t id, frames, near_frames;
} seen_track;

typedef struct histogram {
    int64_t count, bins[BINS];
    double square;
} histogram;

struct bst_run_metrics {
    bst_camera camera;
    int target;
    known_frame frames[WAITING];
    int newest;
    seen_track *tracks;
    int64_t track_count, track_room;
    uint8_t *objects; /* [objects of the world]: bit 0 seen, bit 1 tracked */
    int object_count;
    histogram track_error, pointing;
    bool was_in_track;
    bst_run_metric_figures figures;
};

bst_status bst_run_metrics_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                                  int target_object, bst_run_metrics **out) {
    *out = NULL;
    bst_run_metrics *m = calloc(1, sizeof *m);
    int objects = bst_world_object_count(world);
    uint8_t *seen = calloc((size_t)objects + 1, 1);
    if (!m || !seen) {
        free(m);
        free(seen);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the figures of a run");
    }
    m->camera = *bst_world_camera(world, observer, sensor);
    m->target = target_object;
    m->objects = seen;
    m->object_count = objects;
    for (int i = 0; i < WAITING; i++) {
        m->frames[i].exposure_id = -1;
    }
    *out = m;
    return BST_OK;
}

void bst_run_metrics_free(bst_run_metrics *m) {
    if (m) {
        for (int i = 0; i < WAITING; i++) {
            free(m->frames[i].objects);
        }
        free(m->tracks);
        free(m->objects);
        free(m);
    }
}

static void add(histogram *h, double px) {
    double bin = px > BIN_FIRST ? log(px / BIN_FIRST) / log(BIN_RATIO) : 0.0;
    h->bins[bin < BINS - 1 ? (int)bin : BINS - 1]++;
    h->square += px * px;
    h->count++;
}

static double quantile(const histogram *h, double q) {
    int64_t seen = 0;
    for (int b = 0; b < BINS && h->count > 0; b++) {
        seen += h->bins[b];
        if ((double)seen >= q * (double)h->count) {
            return BIN_FIRST * pow(BIN_RATIO, b + 0.5);
        }
    }
    return NAN;
}

static const known_frame *find_frame(const bst_run_metrics *m, int64_t exposure_id) {
    for (int i = 0; i < WAITING; i++) {
        if (m->frames[i].exposure_id == exposure_id) {
            return &m->frames[i];
        }
    }
    return NULL;
}

bst_status bst_run_metrics_truth(bst_ctx *ctx, bst_run_metrics *m, const bst_truth *truth) {
    m->newest = (m->newest + 1) % WAITING;
    known_frame *f = &m->frames[m->newest];
    f->exposure_id = truth->exposure_id;
    f->count = 0;
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *item = &truth->items[i];
        if (item->kind != BST_SOURCE_OBJECT || !(item->flags & BST_TRUTH_IN_FIELD)) {
            continue;
        }
        if (f->count == f->room) {
            int room = 2 * f->room + 16;
            known_object *grown = realloc(f->objects, (size_t)room * sizeof *grown);
            if (!grown) {
                return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the figures of a run");
            }
            f->objects = grown;
            f->room = room;
        }
        f->objects[f->count++] =
            (known_object){item->id,
                           {cos(item->dec_rad) * cos(item->ra_rad),
                            cos(item->dec_rad) * sin(item->ra_rad), sin(item->dec_rad)},
                           item->x_centroid_px,
                           item->y_centroid_px};
        if (item->id < (uint32_t)m->object_count) {
            m->objects[item->id] |= 1;
        }
    }
    return BST_OK;
}

void bst_run_metrics_detections(bst_run_metrics *m, const bst_detections *detections) {
    m->figures.detections += detections->count;
    const known_frame *f = find_frame(m, detections->exposure_id);
    for (int o = 0; f && o < f->count; o++) {
        if ((int)f->objects[o].id != m->target) {
            continue;
        }
        for (int i = 0; i < detections->count; i++) {
            const bst_detection *d = &detections->items[i];
            if (hypot(d->x_px - f->objects[o].x_px, d->y_px - f->objects[o].y_px) <= NEAR_PX) {
                m->figures.detected_frames++;
                return;
            }
        }
    }
}

static bst_status find_track(bst_ctx *ctx, bst_run_metrics *m, int64_t id, seen_track **out) {
    for (int64_t i = m->track_count - 1; i >= 0; i--) { /* identities grow: new ones are last */
        if (m->tracks[i].id == id) {
            *out = &m->tracks[i];
            return BST_OK;
        }
    }
    if (m->track_count == m->track_room) {
        int64_t room = 2 * m->track_room + 64;
        seen_track *grown = realloc(m->tracks, (size_t)room * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the figures of a run");
        }
        m->tracks = grown;
        m->track_room = room;
    }
    *out = &m->tracks[m->track_count++];
    **out = (seen_track){.id = id};
    return BST_OK;
}

bst_status bst_run_metrics_tracks(bst_ctx *ctx, bst_run_metrics *m, const bst_tracks *tracks) {
    const known_frame *f = find_frame(m, tracks->exposure_id);
    double scale = bst_camera_scale_rad(&m->camera);
    for (int i = 0; f && i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (t->status != BST_TRACK_CONFIRMED && t->status != BST_TRACK_COASTING) {
            continue;
        }
        double least_px = INFINITY;
        const known_object *nearest = NULL;
        for (int o = 0; o < f->count; o++) {
            double px = bst_vec3_angle(t->direction_gcrf, f->objects[o].direction) / scale;
            if (px < least_px) {
                least_px = px;
                nearest = &f->objects[o];
            }
        }
        bool near = least_px <= NEAR_PX;
        /* what coasts out of the field is near nothing that is seen, and no evidence */
        if (near || t->status == BST_TRACK_CONFIRMED) {
            seen_track *seen = NULL;
            BST_TRY(find_track(ctx, m, t->id, &seen));
            seen->frames++;
            seen->near_frames += near;
        }
        if (near && nearest->id < (uint32_t)m->object_count) {
            m->objects[nearest->id] |= 2;
        }
        if (near && (int)nearest->id == m->target && t->target_of_interest) {
            add(&m->track_error, least_px);
        }
    }
    return BST_OK;
}

void bst_run_metrics_frame(bst_run_metrics *m, const bst_loop_frame *frame) {
    bst_run_metric_figures *f = &m->figures;
    f->frames++;
    if (frame->settled && !isnan(frame->error_px)) {
        add(&m->pointing, frame->error_px);
    }
    f->in_field_frames += frame->visible && frame->target_snr > 0.0;
    if (frame->visible) {
        f->visible_frames++;
        f->in_track_frames += frame->in_track;
        f->breaks += m->was_in_track && !frame->in_track;
        m->was_in_track = frame->in_track;
    }
    f->in_track_at_end = frame->in_track;
}

void bst_run_metrics_figures(const bst_run_metrics *m, bst_run_metric_figures *out) {
    *out = m->figures;
    const histogram *h = &m->track_error;
    out->track_rms_px = h->count > 0 ? sqrt(h->square / (double)h->count) : NAN;
    out->track_median_px = quantile(h, 0.5);
    out->track_p95_px = quantile(h, 0.95);
    out->pointing_median_px = quantile(&m->pointing, 0.5);
    out->tracks = m->track_count;
    for (int64_t i = 0; i < m->track_count; i++) {
        out->false_tracks += 2 * m->tracks[i].near_frames < m->tracks[i].frames;
    }
    for (int i = 0; i < m->object_count; i++) {
        out->objects_seen += m->objects[i] & 1;
        out->objects_tracked += m->objects[i] == 3;
    }
}
