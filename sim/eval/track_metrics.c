#include "sim/eval/track_metrics.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/arena.h"
#include "sim/eval/gospa.h"
#include "sim/eval/ospa2.h"

typedef struct object_record {
    int64_t visible, tracked, last_track; /* frame counts, and track identity (0: none yet) */
    double first_seen_s, first_tracked_s;
    int breaks;
} object_record;

typedef struct track_record {
    int64_t id, frames;
    int alone; /* latest frames in a row without an object */
    bool ghost;
} track_record;

struct bst_track_metrics {
    bst_arena arena; /* of all arrays below */
    int objects, max_tracks, max_at_once;
    double cutoff;
    int64_t frames;
    double first_s, last_s, gospa2, gospa, ospa2;
    bst_ospa2 *window;
    int tracks;
    object_record *object;
    track_record *track;
    int64_t
        *paired; /* number of frames in which track t was paired with object o: [t * objects + o] */
    double *distance;
    int *row, *pair, *identity;
};

static void lay_out(bst_track_metrics *m) {
    size_t objects = (size_t)m->objects + 1, tracks = (size_t)m->max_tracks;
    size_t now = (size_t)m->max_at_once;
    BST_ARENA_TAKE(&m->arena, m->object, objects);
    BST_ARENA_TAKE(&m->arena, m->track, tracks);
    BST_ARENA_TAKE(&m->arena, m->paired, tracks * objects);
    BST_ARENA_TAKE(&m->arena, m->distance, objects * now);
    BST_ARENA_TAKE(&m->arena, m->row, objects);
    BST_ARENA_TAKE(&m->arena, m->pair, objects);
    BST_ARENA_TAKE(&m->arena, m->identity, now);
}

bst_status bst_track_metrics_create(bst_ctx *ctx, int objects, int max_tracks, int max_at_once,
                                    double cutoff_rad, bst_track_metrics **out) {
    *out = NULL;
    if (objects < 0 || max_tracks < 1 || max_at_once < 1 || !(cutoff_rad > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "track metrics: need room for a track and a cutoff > 0");
    }
    bst_track_metrics *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "track metrics: out of memory");
    }
    m->objects = objects;
    m->max_tracks = max_tracks;
    m->max_at_once = max_at_once;
    m->cutoff = cutoff_rad;
    lay_out(m);
    bst_status status = bst_arena_alloc(ctx, &m->arena, "the figures of tracks");
    if (status == BST_OK) {
        const bst_ospa2_params window = {objects, max_at_once, BST_TRACK_WINDOW, cutoff_rad, 2.0};
        status = bst_ospa2_create(ctx, &window, &m->window);
    }
    if (status != BST_OK) {
        bst_track_metrics_free(m);
        return status;
    }
    lay_out(m);
    *out = m;
    return BST_OK;
}

void bst_track_metrics_free(bst_track_metrics *m) {
    if (m) {
        bst_arena_free(&m->arena);
        bst_ospa2_free(m->window);
        free(m);
    }
}

/* Index of the record of a track; new tracks are added. */
static int identify(bst_track_metrics *m, int64_t id) {
    /* identities increase: search from the newest */
    for (int t = m->tracks - 1; t >= 0; t--) {
        if (m->track[t].id == id) {
            return t;
        }
    }
    if (m->tracks == m->max_tracks) {
        return -1;
    }
    m->track[m->tracks] = (track_record){.id = id};
    return m->tracks++;
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

bst_status bst_track_metrics_frame(bst_ctx *ctx, bst_track_metrics *m, double seconds,
                                   const bst_vec3 *truth, const bool *visible,
                                   const int64_t *track_ids, const bst_vec3 *track_directions,
                                   int tracks) {
    if (tracks > m->max_at_once) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "track metrics: %d tracks in a frame, room for %d",
                        tracks, m->max_at_once);
    }
    for (int t = 0; t < tracks; t++) {
        m->identity[t] = identify(m, track_ids[t]);
        if (m->identity[t] < 0) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "track metrics: more than %d identities; give more room",
                            m->max_tracks);
        }
    }
    int rows = 0;
    for (int o = 0; o < m->objects; o++) {
        if (!visible[o]) {
            continue;
        }
        for (int t = 0; t < tracks; t++) {
            m->distance[rows * tracks + t] = bst_vec3_angle(truth[o], track_directions[t]);
        }
        assert(rows < m->objects);
        m->row[rows++] = o;
        if (m->object[o].visible++ == 0) {
            m->object[o].first_seen_s = seconds;
        }
    }
    bst_gospa_result gospa;
    BST_TRY(bst_gospa(ctx, m->distance, rows, tracks, m->cutoff, 2.0, m->pair, &gospa));
    m->gospa2 += gospa.gospa * gospa.gospa;
    m->gospa += gospa.gospa;
    double ospa2;
    const bst_ospa2_input window = {m->distance, m->row, rows, track_ids, tracks};
    BST_TRY(bst_ospa2_frame(ctx, m->window, &window, &ospa2));
    m->ospa2 += ospa2;
    for (int t = 0; t < tracks; t++) {
        m->track[m->identity[t]].alone++;
    }
    for (int r = 0; r < rows; r++) {
        if (m->pair[r] >= 0) {
            int t = m->identity[m->pair[r]], o = m->row[r];
            m->paired[t * m->objects + o]++;
            m->track[t].alone = 0;
            record_track(&m->object[o], seconds, m->track[t].id);
        }
    }
    for (int t = 0; t < tracks; t++) {
        track_record *track = &m->track[m->identity[t]];
        track->frames++;
        track->ghost |= track->alone > BST_TRACK_GHOST_FRAMES;
    }
    m->first_s = m->frames == 0 ? seconds : m->first_s;
    m->last_s = seconds;
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
        out->breaks += object->breaks;
        wait += object->tracked > 0 ? object->first_tracked_s - object->first_seen_s : 0.0;
    }
    out->tracks = m->tracks;
    for (int t = 0; t < m->tracks; t++) {
        int64_t most = 0, all = 0;
        for (int o = 0; o < m->objects; o++) {
            int64_t n = m->paired[t * m->objects + o];
            all += n;
            most = n > most ? n : most;
        }
        most_sum += most;
        paired_sum += all;
        out->ghosts += m->track[t].ghost;
        out->false_tracks += 2 * all < m->track[t].frames;
    }
    out->coverage = visible > 0 ? (double)tracked / (double)visible : NAN;
    out->time_to_confirm_s = out->objects_tracked > 0 ? wait / out->objects_tracked : NAN;
    out->purity = paired_sum > 0 ? (double)most_sum / (double)paired_sum : NAN;
    out->false_tracks_per_hour = out->hours > 0.0 ? out->false_tracks / out->hours : NAN;
}
