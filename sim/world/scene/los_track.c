#include "sim/world/scene/los_track.h"

#include <assert.h>
#include <stdlib.h>

static const bst_los_sample *ring_sample(const bst_los_history *history, int64_t number) {
    return &history->items[number % history->capacity];
}

static bst_quat same_sign(bst_quat q, bst_quat as) {
    double dot = q.x * as.x + q.y * as.y + q.z * as.z + q.w * as.w;
    return dot < 0.0 ? (bst_quat){-q.x, -q.y, -q.z, -q.w} : q;
}

/* Attitude at `tick`, interpolated between samples number and number + 1. */
static bst_quat between(const bst_los_history *history, int64_t number, int64_t tick) {
    const bst_los_sample *a = ring_sample(history, number);
    if (a->tick >= tick) {
        return a->q_cam_from_gcrf;
    }
    const bst_los_sample *b = ring_sample(history, number + 1);
    double s = (double)(tick - a->tick) / (double)(b->tick - a->tick);
    return bst_quat_slerp(a->q_cam_from_gcrf, b->q_cam_from_gcrf, s);
}

static bst_status reserve(bst_ctx *ctx, bst_los_track_store *store, int count) {
    if (count <= store->capacity) {
        return BST_OK;
    }
    count += count / 2; /* few later exposures then need more */
    double *time_s = realloc(store->time_s, (size_t)count * sizeof *time_s);
    store->time_s = time_s ? time_s : store->time_s;
    bst_quat *q = realloc(store->q, (size_t)count * sizeof *q);
    store->q = q ? q : store->q;
    if (!time_s || !q) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d line-of-sight samples", count);
    }
    store->capacity = count;
    return BST_OK;
}

bst_status bst_los_track_cut(bst_ctx *ctx, bst_los_track_store *store,
                             const bst_los_history *history, int64_t start_tick, int64_t end_tick,
                             int64_t tick_rate_hz, bst_los_track *out) {
    assert(store && history && out && start_tick <= end_tick && tick_rate_hz > 0);
    int64_t newest = history->written - 1;
    int64_t oldest =
        history->written > history->capacity ? history->written - history->capacity : 0;
    if (newest < 0 || ring_sample(history, oldest)->tick > start_tick ||
        ring_sample(history, newest)->tick < end_tick) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "the line-of-sight history (ticks %lld to %lld) does not cover the "
                        "exposure (%lld to %lld): "
                        "give the gimbal a longer history_s or a rate that divides the exposure",
                        newest < 0 ? 0LL : (long long)ring_sample(history, oldest)->tick,
                        newest < 0 ? -1LL : (long long)ring_sample(history, newest)->tick,
                        (long long)start_tick, (long long)end_tick);
    }
    /* last sample at or before the start, by bisection */
    int64_t low = oldest, high = newest;
    while (low < high) {
        int64_t middle = low + (high - low + 1) / 2;
        if (ring_sample(history, middle)->tick <= start_tick) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    int64_t last = low;
    while (last < newest && ring_sample(history, last)->tick < end_tick) {
        last++;
    }
    int inner = (int)(last - low > 0 ? last - low - 1 : 0);
    BST_TRY(reserve(ctx, store, inner + 2));
    double rate = (double)tick_rate_hz;
    store->time_s[0] = 0.0;
    store->q[0] = between(history, low, start_tick);
    int count = 1;
    for (int64_t n = low + 1; n < last; n++) {
        const bst_los_sample *sample = ring_sample(history, n);
        store->time_s[count] = (double)(sample->tick - start_tick) / rate;
        store->q[count] = same_sign(sample->q_cam_from_gcrf, store->q[count - 1]);
        count++;
    }
    store->time_s[count] = (double)(end_tick - start_tick) / rate;
    store->q[count] =
        same_sign(between(history, last > low ? last - 1 : low, end_tick), store->q[count - 1]);
    *out = (bst_los_track){count + 1, store->time_s, store->q};
    return BST_OK;
}

bst_quat bst_los_track_attitude(const bst_los_track *track, double time_s) {
    assert(track && track->count >= 1 && isfinite(time_s));
    int k = 0, high = track->count - 2; /* the first interval that ends at time_s or later */
    while (k < high) {
        int middle = (k + high) / 2;
        if (track->time_s[middle + 1] < time_s) {
            k = middle + 1;
        } else {
            high = middle;
        }
    }
    double span = track->time_s[k + 1] - track->time_s[k];
    double s = span > 0.0 ? (time_s - track->time_s[k]) / span : 0.0;
    return bst_quat_slerp(track->q_cam_from_gcrf[k], track->q_cam_from_gcrf[k + 1], s);
}

bst_status bst_los_track_part(bst_ctx *ctx, bst_los_track_store *store, const bst_los_track *track,
                              double from_s, double to_s, bst_los_track *out) {
    assert(store && track && out && from_s <= to_s);
    BST_TRY(reserve(ctx, store, track->count + 2));
    int count = 0;
    store->time_s[count] = 0.0;
    store->q[count++] = bst_los_track_attitude(track, from_s);
    for (int k = 0; k < track->count; k++) {
        if (track->time_s[k] > from_s && track->time_s[k] < to_s) {
            store->time_s[count] = track->time_s[k] - from_s;
            store->q[count++] = track->q_cam_from_gcrf[k];
        }
    }
    store->time_s[count] = to_s - from_s;
    store->q[count] = bst_los_track_attitude(track, to_s);
    *out = (bst_los_track){count + 1, store->time_s, store->q};
    return BST_OK;
}

double bst_los_track_moved_px(const bst_camera *camera, bst_quat from, bst_quat to) {
    return bst_los_track_turned_px(camera,
                                   bst_quat_to_rotvec(bst_quat_mul(to, bst_quat_conj(from))));
}

double bst_los_track_turned_px(const bst_camera *camera, bst_vec3 d) {
    double width = (double)camera->width_px, height = (double)camera->height_px;
    double half_px = 0.5 * sqrt(width * width + height * height);
    double scale = bst_camera_scale_rad(camera), stretch = bst_camera_stretch(camera);
    /* a tilt moves points at the corner further than at the centre */
    double tilt = (1.0 + half_px * half_px * scale * scale) * stretch;
    half_px *= stretch;
    return sqrt(d.x * d.x + d.y * d.y) / scale * tilt + fabs(d.z) * half_px;
}

void bst_los_track_store_free(bst_los_track_store *store) {
    free(store->time_s);
    free(store->q);
}
