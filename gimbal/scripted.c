#include "gimbal/scripted.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Attitudes closer than this are equal. */
#define SAME_RAD 1e-9
/* Attitudes closer in time than this are simultaneous. */
#define SAME_TICK 1e-3

typedef struct node {
    double tick;
    bst_quat q;
} node;

struct bst_scripted {
    node *nodes; /* ascending ticks; consecutive quaternions have matching signs */
    int64_t count, capacity;
    int64_t last; /* node before the last requested tick */
};

static bst_status add(bst_ctx *ctx, bst_scripted *s, double tick, bst_quat q, const char *where) {
    if (s->count > 0) {
        const node *before = &s->nodes[s->count - 1];
        bst_quat p = before->q;
        if (p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w < 0.0) {
            q = (bst_quat){-q.x, -q.y, -q.z, -q.w};
        }
        if (tick - before->tick < SAME_TICK) {
            double apart = bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(p))));
            return apart <= SAME_RAD
                       ? BST_OK
                       : bst_fail(ctx, BST_ERR_CONFIG,
                                  "%s: the attitude jumps by %.3g deg in no time (allowed: to "
                                  "begin where the frame before it ended, or a period_s longer "
                                  "than its exposure_s)",
                                  where, apart * 180.0 / BST_PI);
        }
    }
    if (s->count == s->capacity) {
        int64_t more = s->capacity ? 2 * s->capacity : 256;
        node *nodes = realloc(s->nodes, (size_t)more * sizeof *nodes);
        if (!nodes) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the attitudes of frames");
        }
        s->nodes = nodes;
        s->capacity = more;
    }
    s->nodes[s->count++] = (node){tick, q};
    return BST_OK;
}

static bst_status fill(bst_ctx *ctx, const bst_frame_updates *updates, bst_frame_cursor c,
                       bst_scripted_missing missing, bst_scripted *s) {
    const char *file = bst_frame_updates_name(updates);
    int64_t last = -1, given = -1;
    double ended = 0.0; /* end tick of the previous frame */
    char where[700];
    for (int i = 0; i < bst_frame_updates_count(updates); i++) {
        const bst_frame_update *u = bst_frame_updates_item(updates, i);
        last = u->node_count > 0 ? u->frame : last;
    }
    if (last < 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: no frame gives a pointing (allowed: q_cam_from_gcrf_start and "
                        "q_cam_from_gcrf_end, or pointing)",
                        file);
    }
    for (; c.frame <= last; bst_frame_cursor_next(&c)) {
        bool has = c.update && c.update->node_count > 0;
        if (!has && missing == BST_SCRIPTED_ERROR) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: frame %lld: has no pointing (allowed: q_cam_from_gcrf_start and "
                            "q_cam_from_gcrf_end, or pointing, in every frame up to the last; or "
                            "the gimbal's missing_frames \"hold\")",
                            file, (long long)c.frame);
        }
        snprintf(where, sizeof where, "%.600s: frame %lld", file, (long long)c.frame);
        if (has && given >= 0 && given < c.frame - 1) {
            BST_TRY(add(ctx, s, ended, s->nodes[s->count - 1].q, where));
        }
        for (int k = 0; has && k < c.update->node_count; k++) {
            const bst_world_pointing_node *n = &c.update->nodes[k];
            bool end = k == c.update->node_count - 1;
            double tick = (double)c.start_tick +
                          (end ? (double)c.exposure_ticks : n->time_s * c.tick_rate_hz);
            BST_TRY(add(ctx, s, tick, n->q_cam_from_gcrf, where));
        }
        given = has ? c.frame : given;
        ended = (double)(c.start_tick + c.exposure_ticks);
    }
    return BST_OK;
}

bst_status bst_scripted_create(bst_ctx *ctx, const bst_frame_updates *updates,
                               const bst_camera *camera, const bst_exposure_config *exposure,
                               int64_t tick_rate_hz, bst_scripted_missing missing,
                               bst_scripted **out) {
    *out = NULL;
    bst_scripted *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the attitudes of frames");
    }
    bst_status status =
        fill(ctx, updates, bst_frame_cursor_begin(updates, camera, exposure, (double)tick_rate_hz),
             missing, s);
    if (status != BST_OK) {
        bst_scripted_free(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_scripted_free(bst_scripted *s) {
    if (s) {
        free(s->nodes);
        free(s);
    }
}

bst_quat bst_scripted_at(bst_scripted *s, int64_t tick) {
    double t = (double)tick;
    if (s->nodes[s->last].tick > t) {
        s->last = 0;
    }
    while (s->last + 1 < s->count && s->nodes[s->last + 1].tick <= t) {
        s->last++;
    }
    const node *a = &s->nodes[s->last];
    if (t <= a->tick || s->last + 1 == s->count) {
        return a->q;
    }
    return bst_quat_slerp(a->q, a[1].q, (t - a->tick) / (a[1].tick - a->tick));
}

int64_t bst_scripted_next(const bst_scripted *s, int64_t tick) {
    for (int64_t k = s->last; k < s->count; k++) {
        int64_t before = (int64_t)floor(s->nodes[k].tick), after = (int64_t)ceil(s->nodes[k].tick);
        if (before > tick) {
            return before;
        }
        if (after > tick) {
            return after;
        }
    }
    return INT64_MAX;
}

int bst_scripted_crowd(const bst_scripted *s, double ticks) {
    int64_t most = 0, first = 0;
    for (int64_t k = 0; k < s->count; k++) {
        while (s->nodes[k].tick - s->nodes[first].tick > ticks) {
            first++;
        }
        most = k - first + 1 > most ? k - first + 1 : most;
    }
    return most > 10000000 ? 10000000 : (int)most;
}
