#include "sim/eval/run_metrics.h"

#include <stdlib.h>
#include <string.h>

#include "sim/eval/frame_scores.h"
#include "sim/eval/growing.h"

/* frames whose truth is kept for late messages: 1 s of latency at 60 Hz, and the smoother's lag */
enum { WAITING = 128 };

/* Threshold of a detector that states none, SNR. */
static const double USUAL_THRESHOLD_SNR = 5.0;

typedef struct known_object {
    uint32_t id;
    bst_vec3 direction; /* geometric with light time, mid-exposure */
    double x_px, y_px;  /* mean over the exposure */
    double snr;
    bool lit; /* not occulted and illuminated */
} known_object;

typedef struct known_frame {
    int64_t exposure_id; /* -1: none */
    double mid_tick;
    bst_quat q_cam_from_gcrf;
    bst_light light;
    double track_error2_px2; /* of the track of interest, squared; NAN: none, or another object's */
    known_object *objects;
    int count, room;
} known_frame;

typedef struct seen_track {
    int64_t id, frames, near_frames;
} seen_track;

struct bst_run_metrics {
    bst_camera camera;
    int target;
    known_frame frames[WAITING];
    int newest;
    seen_track *tracks;
    int64_t track_count, track_room;
    uint8_t *objects; /* [objects of the world] bit 0: seen, bit 1: tracked */
    int object_count;
    bst_error_statistics track_error;
    double smoothed2_px2, filtered2_px2; /* sums of squares over smoothed_frames */
    double threshold_snr;                /* of the latest detections that state one */
    bst_frame_scores *scores;
    bst_scored_object *scored; /* work space of a frame */
    int scored_room;
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
    m->threshold_snr = USUAL_THRESHOLD_SNR;
    bst_status status = bst_frame_scores_create(
        ctx, objects, BST_RIGHT_TARGET_PX * bst_camera_scale_rad(&m->camera), &m->scores);
    if (status != BST_OK) {
        bst_run_metrics_free(m);
        return status;
    }
    *out = m;
    return BST_OK;
}

void bst_run_metrics_free(bst_run_metrics *m) {
    if (m) {
        for (int i = 0; i < WAITING; i++) {
            free(m->frames[i].objects);
        }
        bst_frame_scores_free(m->scores);
        free(m->scored);
        free(m->tracks);
        free(m->objects);
        free(m);
    }
}

/* Makes room for a number of items; false: there is no memory. */
static bool make_room(void **items, int64_t room, size_t item_bytes) {
    void *more = realloc(*items, (size_t)(room + 1) * item_bytes);
    *items = more ? more : *items;
    return more != NULL;
}

/* Saves or restores a frame that waits for late messages. */
static bool archive_frame(known_frame *f, bst_archive *archive, int most) {
    BST_ARCHIVE(archive, f->exposure_id);
    BST_ARCHIVE(archive, f->mid_tick);
    BST_ARCHIVE(archive, f->q_cam_from_gcrf);
    BST_ARCHIVE(archive, f->light);
    BST_ARCHIVE(archive, f->track_error2_px2);
    f->count = bst_archive_count(archive, f->count, most);
    if (bst_archive_is_restoring(archive) && f->count > f->room) {
        if (!make_room((void **)&f->objects, f->count, sizeof *f->objects)) {
            return false;
        }
        f->room = f->count;
    }
    for (int i = 0; i < f->count; i++) {
        known_object *object = &f->objects[i];
        BST_ARCHIVE(archive, object->id);
        BST_ARCHIVE(archive, object->direction);
        BST_ARCHIVE(archive, object->x_px);
        BST_ARCHIVE(archive, object->y_px);
        BST_ARCHIVE(archive, object->snr);
        bst_archive_bool(archive, &object->lit);
    }
    return true;
}

bst_status bst_run_metrics_archive(bst_run_metrics *m, bst_archive *archive) {
    bool enough = true;
    m->target = (int)bst_archive_integer(archive, m->target, -1, m->object_count - 1);
    m->newest = (int)bst_archive_integer(archive, m->newest, 0, WAITING - 1);
    for (int i = 0; i < WAITING && enough; i++) {
        enough = archive_frame(&m->frames[i], archive, INT32_MAX / 2);
    }
    m->track_count = bst_archive_integer(archive, m->track_count, 0, INT32_MAX);
    if (enough && bst_archive_is_restoring(archive) && m->track_count > m->track_room) {
        enough = make_room((void **)&m->tracks, m->track_count, sizeof *m->tracks);
        m->track_room = enough ? m->track_count : m->track_room;
    }
    if (!enough) {
        m->track_count = 0;
        return bst_fail(bst_archive_ctx(archive), BST_ERR_MEMORY,
                        "out of memory for the figures of a run");
    }
    bst_archive_bytes(archive, m->tracks, (size_t)m->track_count * sizeof *m->tracks);
    bst_archive_bytes(archive, m->objects, (size_t)m->object_count);
    bst_error_statistics_archive(&m->track_error, archive);
    BST_ARCHIVE(archive, m->smoothed2_px2);
    BST_ARCHIVE(archive, m->filtered2_px2);
    BST_ARCHIVE(archive, m->figures);
    BST_ARCHIVE(archive, m->threshold_snr);
    return bst_frame_scores_archive(m->scores, archive);
}

static known_frame *find_frame(bst_run_metrics *m, int64_t exposure_id) {
    for (int i = 0; i < WAITING; i++) {
        if (m->frames[i].exposure_id == exposure_id) {
            return &m->frames[i];
        }
    }
    return NULL;
}

bst_status bst_run_metrics_truth(bst_ctx *ctx, bst_run_metrics *m, const bst_truth *truth) {
    bst_run_losses *lost = &m->figures.losses;
    lost->frames++;
    lost->dropped_frames += truth->dropped;
    lost->truth += truth->lost;
    lost->truth_frames += truth->lost > 0;
    lost->earth_frames += truth->earth_fraction > 0.0;
    lost->moon_frames += truth->moon_fraction > 0.0;
    lost->sun_frames += truth->sun_fraction > 0.0;
    m->newest = (m->newest + 1) % WAITING;
    known_frame *f = &m->frames[m->newest];
    f->exposure_id = truth->exposure_id;
    f->mid_tick = 0.5 * (double)(truth->start_tick + truth->end_tick);
    f->q_cam_from_gcrf = truth->q_cam_from_gcrf_mid;
    f->light = (bst_light){.velocity_mps = truth->velocity_bary_mps, .sun_m = truth->sun_m};
    f->track_error2_px2 = NAN;
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
                           item->y_centroid_px,
                           item->snr,
                           !(item->flags & BST_TRUTH_OCCULTED) && item->snr > 0.0};
        if (item->id < (uint32_t)m->object_count) {
            m->objects[item->id] |= 1;
        }
    }
    return BST_OK;
}

void bst_run_metrics_detections(bst_run_metrics *m, const bst_detections *detections) {
    bst_run_losses *lost = &m->figures.losses;
    m->figures.detections += detections->count;
    m->figures.bad_pixels = detections->bad_pixels;
    m->threshold_snr =
        detections->threshold_snr > 0.0 ? detections->threshold_snr : m->threshold_snr;
    lost->detections += detections->lost;
    lost->detection_frames += detections->lost > 0;
    lost->no_stars_frames += detections->stars_identified == 0;
    const known_frame *f = find_frame(m, detections->exposure_id);
    for (int o = 0; f && o < f->count; o++) {
        if ((int)f->objects[o].id != m->target || !f->objects[o].lit) {
            continue;
        }
        for (int i = 0; i < detections->count; i++) {
            const bst_detection *d = &detections->items[i];
            if (hypot(d->x_px - f->objects[o].x_px, d->y_px - f->objects[o].y_px) <=
                BST_RIGHT_TARGET_PX) {
                m->figures.detected_frames++;
                return;
            }
        }
    }
}

/* Returns the record of a track; new tracks are added. */
static bst_status find_track(bst_ctx *ctx, bst_run_metrics *m, int64_t id, seen_track **out) {
    for (int64_t i = m->track_count - 1; i >= 0;
         i--) { /* track identities increase: search from the newest */
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

/* Adds the east and north components of a track's direction error. */
static void add_track_error(bst_run_metrics *m, bst_vec3 direction, bst_vec3 truth,
                            double scale_rad) {
    bst_vec3 pole =
        hypot(truth.x, truth.y) < 1e-6 ? bst_vec3_make(1, 0, 0) : bst_vec3_make(0, 0, 1);
    bst_vec3 east = bst_vec3_unit(bst_vec3_cross(pole, truth));
    bst_vec3 error = bst_vec3_sub(bst_vec3_unit(direction), truth);
    bst_error_statistics_add(&m->track_error, bst_vec3_dot(error, east) / scale_rad,
                             bst_vec3_dot(error, bst_vec3_cross(truth, east)) / scale_rad);
}

/* Scores all tracks of a frame against all objects in the field. */
static bst_status score_tracks(bst_ctx *ctx, bst_run_metrics *m, const known_frame *f,
                               const bst_tracks *tracks) {
    BST_TRY(bst_grow(ctx, (void **)&m->scored, f->count + 1, &m->scored_room, sizeof *m->scored));
    int count = 0;
    for (int o = 0; o < f->count; o++) {
        const known_object *object = &f->objects[o];
        if (object->id < (uint32_t)m->object_count) {
            m->scored[count++] = (bst_scored_object){
                object->id, object->direction, object->lit && object->snr >= m->threshold_snr};
        }
    }
    const bst_scored_frame frame = {&m->camera, f->mid_tick, f->q_cam_from_gcrf,
                                    f->light,   m->scored,   count};
    return bst_frame_scores_add(ctx, m->scores, &frame, tracks);
}

bst_status bst_run_metrics_tracks(bst_ctx *ctx, bst_run_metrics *m, const bst_tracks *tracks) {
    known_frame *f = find_frame(m, tracks->exposure_id);
    double scale = bst_camera_scale_rad(&m->camera);
    bst_run_losses *lost = &m->figures.losses;
    lost->tracks += tracks->lost;
    lost->track_frames += tracks->lost > 0;
    lost->no_attitude_frames += !tracks->attitude.valid;
    for (int i = 0; f && i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (t->status != BST_TRACK_CONFIRMED && t->status != BST_TRACK_COASTING) {
            continue;
        }
        double least_px = INFINITY;
        const known_object *nearest = NULL;
        for (int o = 0; o < f->count; o++) {
            const known_object *object = &f->objects[o];
            double px = bst_vec3_angle(t->direction_gcrf, object->direction) / scale;
            if (px < least_px) {
                least_px = px;
                nearest = object;
            }
            if (t->target_of_interest && (int)object->id == m->target &&
                px <= BST_RIGHT_TARGET_PX) {
                add_track_error(m, t->direction_gcrf, object->direction, scale);
                f->track_error2_px2 = px * px;
            }
        }
        bool near = least_px <= BST_RIGHT_TARGET_PX;
        /* a coasting track outside the field is near no visible object; it does not count as
         * false */
        if (near || t->status == BST_TRACK_CONFIRMED) {
            seen_track *seen = NULL;
            BST_TRY(find_track(ctx, m, t->id, &seen));
            seen->frames++;
            seen->near_frames += near;
        }
        if (near && nearest->id < (uint32_t)m->object_count) {
            m->objects[nearest->id] |= 2;
        }
    }
    return f ? score_tracks(ctx, m, f, tracks) : BST_OK;
}

void bst_run_metrics_identities(bst_run_metrics *m, const bst_track_identities *identities) {
    m->figures.losses.identities += identities->lost;
    m->figures.losses.identity_frames += identities->lost > 0;
}

void bst_run_metrics_smoothed(bst_run_metrics *m, const bst_tracks_smoothed *tracks) {
    m->figures.losses.smoothed_tracks += tracks->lost;
    m->figures.losses.smoothed_track_frames += tracks->lost > 0;
    const known_frame *f = find_frame(m, tracks->exposure_id);
    double scale = bst_camera_scale_rad(&m->camera);
    if (!f || !isfinite(f->track_error2_px2)) {
        return; /* the filtered state is another object's */
    }
    for (int i = 0; i < tracks->count; i++) {
        for (int o = 0; tracks->items[i].target_of_interest && o < f->count; o++) {
            if ((int)f->objects[o].id == m->target) {
                double px =
                    bst_vec3_angle(tracks->items[i].direction_gcrf, f->objects[o].direction) /
                    scale;
                m->smoothed2_px2 += px * px;
                m->filtered2_px2 += f->track_error2_px2;
                m->figures.smoothed_frames++;
            }
        }
    }
}

void bst_run_metrics_frame(bst_run_metrics *m, const bst_loop_frame *frame) {
    m->figures.in_field_frames += frame->visible && frame->target_snr > 0.0;
}

void bst_run_metrics_retarget(bst_run_metrics *m, int target_object) {
    m->target = target_object;
}

void bst_run_metrics_figures(const bst_run_metrics *m, bst_run_metric_figures *out) {
    *out = m->figures;
    out->detected_fraction = out->in_field_frames > 0
                                 ? (double)out->detected_frames / (double)out->in_field_frames
                                 : NAN;
    out->track_frames = m->track_error.count;
    out->track_rms_px = bst_error_statistics_rms(&m->track_error);
    out->track_median_px = bst_error_statistics_quantile(&m->track_error, 0.5);
    out->track_p95_px = bst_error_statistics_quantile(&m->track_error, 0.95);
    out->track_max_px = bst_error_statistics_largest(&m->track_error);
    double smoothed = (double)out->smoothed_frames;
    out->smoothed_rms_px = smoothed > 0.0 ? sqrt(m->smoothed2_px2 / smoothed) : NAN;
    out->smoothed_filtered_rms_px = smoothed > 0.0 ? sqrt(m->filtered2_px2 / smoothed) : NAN;
    bst_track_figures scores;
    bst_frame_scores_figures(m->scores, &scores);
    double scale = bst_camera_scale_rad(&m->camera);
    out->scored_frames = scores.frames;
    out->gospa_px = scores.gospa_mean / scale;
    out->ospa2_px = scores.ospa2_mean / scale;
    out->purity = scores.purity;
    out->id_switches = scores.breaks;
    out->ghosts = scores.ghosts;
    out->tracks = m->track_count;
    for (int64_t i = 0; i < m->track_count; i++) {
        out->false_tracks += 2 * m->tracks[i].near_frames < m->tracks[i].frames;
    }
    for (int i = 0; i < m->object_count; i++) {
        out->objects_seen += m->objects[i] & 1;
        out->objects_tracked += m->objects[i] == 3;
    }
}
