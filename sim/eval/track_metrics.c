#include "sim/eval/track_metrics.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/eval/gospa.h"
#include "sim/eval/growing.h"
#include "sim/eval/ospa2.h"

typedef struct object_record {
    int64_t visible, tracked, last_track; /* frame counts, and track identity (0: none yet) */
    double first_seen_s, first_tracked_s;
    int64_t breaks;
} object_record;

typedef struct track_record {
    int64_t id, frames;
    int64_t alone; /* latest frames in a row without an object */
    int64_t ghost; /* 1: it was alone for too long */
    int64_t latest_pairing;
} track_record;

/* Number of frames in which a track was paired with an object. */
typedef struct pairing {
    int64_t object, frames;
    int64_t earlier; /* another pairing of the track; -1: none */
} pairing;

struct bst_track_metrics {
    int objects;
    double cutoff;
    int64_t frames;
    double first_s, last_s, gospa2, gospa, ospa2;
    bst_ospa2 *window;
    object_record *object; /* [objects] */
    track_record *track;
    pairing *pairings;
    int tracks, track_room, pairing_count, pairing_room;
    /* work space of a frame */
    bst_gospa_pair *near;
    int *identity, *pair; /* record of each track, track of each visible object */
    int near_room, identity_room, pair_room;
};

bst_status bst_track_metrics_create(bst_ctx *ctx, int objects, double cutoff_rad,
                                    bst_track_metrics **out) {
    *out = NULL;
    if (objects < 0 || !(cutoff_rad > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "track metrics: need a cutoff > 0");
    }
    bst_track_metrics *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "track metrics: out of memory");
    }
    m->objects = objects;
    m->cutoff = cutoff_rad;
    m->object = calloc((size_t)objects + 1, sizeof *m->object);
    const bst_ospa2_params window = {BST_TRACK_WINDOW, cutoff_rad, 2.0};
    bst_status status = m->object ? bst_ospa2_create(ctx, &window, &m->window)
                                  : bst_fail(ctx, BST_ERR_MEMORY, "track metrics: out of memory");
    if (status != BST_OK) {
        bst_track_metrics_free(m);
        return status;
    }
    *out = m;
    return BST_OK;
}

void bst_track_metrics_free(bst_track_metrics *m) {
    if (m) {
        bst_ospa2_free(m->window);
        free(m->object);
        free(m->track);
        free(m->pairings);
        free(m->near);
        free(m->identity);
        free(m->pair);
        free(m);
    }
}

bst_status bst_track_metrics_archive(bst_track_metrics *m, bst_archive *archive) {
    BST_ARCHIVE(archive, m->frames);
    BST_ARCHIVE(archive, m->first_s);
    BST_ARCHIVE(archive, m->last_s);
    BST_ARCHIVE(archive, m->gospa2);
    BST_ARCHIVE(archive, m->gospa);
    BST_ARCHIVE(archive, m->ospa2);
    bst_archive_bytes(archive, m->object, (size_t)m->objects * sizeof *m->object);
    BST_TRY(bst_grow_archive(archive, (void **)&m->track, &m->tracks, &m->track_room,
                             sizeof *m->track));
    BST_TRY(bst_grow_archive(archive, (void **)&m->pairings, &m->pairing_count, &m->pairing_room,
                             sizeof *m->pairings));
    for (int i = 0; i < m->pairing_count; i++) {
        pairing *p = &m->pairings[i];
        p->earlier = bst_archive_integer(archive, p->earlier, -1, i - 1);
    }
    for (int t = 0; t < m->tracks; t++) {
        m->track[t].latest_pairing =
            bst_archive_integer(archive, m->track[t].latest_pairing, -1, m->pairing_count - 1);
    }
    return bst_ospa2_archive(m->window, archive);
}

/* Finds the record of a track; new tracks are added. Searches from the newest, because identities
 * increase. */
static bst_status identify(bst_ctx *ctx, bst_track_metrics *m, int64_t id, int *out) {
    for (int t = m->tracks - 1; t >= 0; t--) {
        if (m->track[t].id == id) {
            *out = t;
            return BST_OK;
        }
    }
    BST_TRY(bst_grow(ctx, (void **)&m->track, m->tracks + 1, &m->track_room, sizeof *m->track));
    m->track[m->tracks] = (track_record){.id = id, .latest_pairing = -1};
    *out = m->tracks++;
    return BST_OK;
}

/* Counts a frame in which a track was paired with an object. */
static bst_status count_pairing(bst_ctx *ctx, bst_track_metrics *m, int track, int64_t object) {
    for (int64_t i = m->track[track].latest_pairing; i >= 0; i = m->pairings[i].earlier) {
        if (m->pairings[i].object == object) {
            m->pairings[i].frames++;
            return BST_OK;
        }
    }
    BST_TRY(bst_grow(ctx, (void **)&m->pairings, m->pairing_count + 1, &m->pairing_room,
                     sizeof *m->pairings));
    m->pairings[m->pairing_count] = (pairing){object, 1, m->track[track].latest_pairing};
    m->track[track].latest_pairing = m->pairing_count++;
    return BST_OK;
}

/* Counts an object as tracked; a change of the track counts as a break. */
static void record_track(object_record *object, double seconds, int64_t id) {
    if (object->tracked++ == 0) {
        object->first_tracked_s = seconds;
    } else if (object->last_track != id) {
        object->breaks++;
    }
    object->last_track = id;
}

/* Lists the pairs of a frame that are nearer than the cutoff. Returns their number in *count. */
static bst_status find_near(bst_ctx *ctx, bst_track_metrics *m, const bst_track_frame *frame,
                            int *count) {
    /* a chord is shorter than its arc */
    double reach2 = m->cutoff * m->cutoff;
    *count = 0;
    for (int o = 0; o < frame->visible; o++) {
        for (int t = 0; t < frame->tracks; t++) {
            bst_vec3 off = bst_vec3_sub(frame->truth[o], frame->track_directions[t]);
            if (bst_vec3_dot(off, off) < reach2) {
                BST_TRY(
                    bst_grow(ctx, (void **)&m->near, *count + 1, &m->near_room, sizeof *m->near));
                double distance = bst_vec3_angle(frame->truth[o], frame->track_directions[t]);
                m->near[(*count)++] = (bst_gospa_pair){o, t, distance};
            }
        }
    }
    return BST_OK;
}

/* Counts the pairs of a frame. */
static bst_status count_pairs(bst_ctx *ctx, bst_track_metrics *m, const bst_track_frame *frame) {
    for (int t = 0; t < frame->tracks; t++) {
        m->track[m->identity[t]].alone++;
    }
    for (int r = 0; r < frame->visible; r++) {
        if (m->pair[r] >= 0) {
            int t = m->identity[m->pair[r]];
            BST_TRY(count_pairing(ctx, m, t, frame->objects[r]));
            m->track[t].alone = 0;
            record_track(&m->object[frame->objects[r]], frame->seconds, m->track[t].id);
        }
    }
    for (int t = 0; t < frame->tracks; t++) {
        track_record *track = &m->track[m->identity[t]];
        track->frames++;
        track->ghost |= track->alone > BST_TRACK_GHOST_FRAMES;
    }
    return BST_OK;
}

bst_status bst_track_metrics_frame(bst_ctx *ctx, bst_track_metrics *m,
                                   const bst_track_frame *frame) {
    assert(m && frame && frame->visible >= 0 && frame->tracks >= 0);
    BST_TRY(bst_grow(ctx, (void **)&m->identity, frame->tracks + 1, &m->identity_room,
                     sizeof *m->identity));
    BST_TRY(bst_grow(ctx, (void **)&m->pair, frame->visible + 1, &m->pair_room, sizeof *m->pair));
    for (int o = 0; o < frame->visible; o++) {
        int64_t number = frame->objects[o];
        if (number < 0 || number >= m->objects) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "track metrics: object %lld of %d",
                            (long long)number, m->objects);
        }
        if (m->object[number].visible++ == 0) {
            m->object[number].first_seen_s = frame->seconds;
        }
    }
    for (int t = 0; t < frame->tracks; t++) {
        BST_TRY(identify(ctx, m, frame->track_ids[t], &m->identity[t]));
    }
    int near;
    BST_TRY(find_near(ctx, m, frame, &near));
    bst_gospa_result gospa;
    const bst_gospa_problem problem = {m->near,       near,      frame->visible,
                                       frame->tracks, m->cutoff, 2.0};
    BST_TRY(bst_gospa_near(ctx, &problem, m->pair, &gospa));
    m->gospa2 += gospa.gospa * gospa.gospa;
    m->gospa += gospa.gospa;
    double ospa2;
    const bst_ospa2_input window = {frame->objects, frame->visible, frame->track_ids,
                                    frame->tracks,  m->near,        near};
    BST_TRY(bst_ospa2_frame(ctx, m->window, &window, &ospa2));
    m->ospa2 += ospa2;
    BST_TRY(count_pairs(ctx, m, frame));
    m->first_s = m->frames == 0 ? frame->seconds : m->first_s;
    m->last_s = frame->seconds;
    m->frames++;
    return BST_OK;
}

void bst_track_metrics_figures(const bst_track_metrics *m, bst_track_figures *out) {
    memset(out, 0, sizeof *out);
    out->frames = m->frames;
    out->hours = (m->last_s - m->first_s) / 3600.0;
    out->gospa_rms = m->frames > 0 ? sqrt(m->gospa2 / (double)m->frames) : NAN;
    out->gospa_mean = m->frames > 0 ? m->gospa / (double)m->frames : NAN;
    out->ospa2_mean = m->frames > 0 ? m->ospa2 / (double)m->frames : NAN;
    int64_t visible = 0, tracked = 0, most_sum = 0, paired_sum = 0;
    double wait = 0.0;
    for (int o = 0; o < m->objects; o++) {
        const object_record *object = &m->object[o];
        visible += object->visible;
        tracked += object->tracked;
        out->objects_seen += object->visible > 0;
        out->objects_tracked += object->tracked > 0;
        out->breaks += (int)object->breaks;
        wait += object->tracked > 0 ? object->first_tracked_s - object->first_seen_s : 0.0;
    }
    out->tracks = m->tracks;
    for (int t = 0; t < m->tracks; t++) {
        int64_t most = 0, all = 0;
        for (int64_t i = m->track[t].latest_pairing; i >= 0; i = m->pairings[i].earlier) {
            all += m->pairings[i].frames;
            most = m->pairings[i].frames > most ? m->pairings[i].frames : most;
        }
        most_sum += most;
        paired_sum += all;
        out->ghosts += m->track[t].ghost != 0;
        out->false_tracks += 2 * all < m->track[t].frames;
    }
    out->coverage = visible > 0 ? (double)tracked / (double)visible : NAN;
    out->time_to_confirm_s = out->objects_tracked > 0 ? wait / out->objects_tracked : NAN;
    out->purity = paired_sum > 0 ? (double)most_sum / (double)paired_sum : NAN;
    out->false_tracks_per_hour = out->hours > 0.0 ? out->false_tracks / out->hours : NAN;
}
