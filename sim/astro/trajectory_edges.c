/* Burns of a trajectory as edges in time: discontinuities of acceleration or velocity. */
#include <stdlib.h>

#include "sim/astro/trajectory_internal.h"

static int by_time(const void *a, const void *b) {
    double x = ((const bst_trajectory_edge *)a)->time_s,
           y = ((const bst_trajectory_edge *)b)->time_s;
    return (x > y) - (x < y);
}

/* End time of a burn; its start for an impulse, or if the duration is below the time resolution. */
static double end_of(const bst_astro_thrust *burn) {
    return burn->time_s + burn->duration_s;
}

static bool is_impulse(const bst_astro_thrust *burn) {
    return !(end_of(burn) > burn->time_s);
}

bst_status bst_trajectory_edges_make(bst_ctx *ctx, const bst_astro_thrust *burns, int count,
                                     bst_trajectory_edges *out) {
    *out = (bst_trajectory_edges){NULL, 0, NULL};
    out->items = calloc(2 * (size_t)count + 1, sizeof *out->items);
    out->impulses_rtn_mps = calloc((size_t)count + 1, sizeof *out->impulses_rtn_mps);
    if (!out->items || !out->impulses_rtn_mps) {
        bst_trajectory_edges_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d burns", count);
    }
    int n = 0;
    for (int i = 0; i < count; i++) {
        out->items[n++].time_s = burns[i].time_s;
        if (!is_impulse(&burns[i])) {
            out->items[n++].time_s = end_of(&burns[i]);
        }
    }
    qsort(out->items, (size_t)n, sizeof *out->items, by_time);
    int impulses = 0;
    for (int i = 0; i < n; i++) {
        double time = out->items[i].time_s;
        if (out->count > 0 && out->items[out->count - 1].time_s == time) {
            continue;
        }
        bst_trajectory_edge *edge = &out->items[out->count++];
        *edge = (bst_trajectory_edge){.time_s = time, .first_impulse = impulses};
        for (int k = 0; k < count; k++) {
            const bst_astro_thrust *b = &burns[k];
            if (is_impulse(b) && b->time_s == time) {
                out->impulses_rtn_mps[impulses++] = b->dv_rtn_mps;
            } else if (!is_impulse(b) && b->time_s <= time && time < end_of(b)) {
                edge->thrust_rtn_mps2 = bst_vec3_axpy(edge->thrust_rtn_mps2,
                                                      1.0 / (end_of(b) - b->time_s), b->dv_rtn_mps);
            }
        }
        edge->impulse_count = impulses - edge->first_impulse;
    }
    return BST_OK;
}

void bst_trajectory_edges_free(bst_trajectory_edges *edges) {
    free(edges->items);
    free(edges->impulses_rtn_mps);
    *edges = (bst_trajectory_edges){NULL, 0, NULL};
}
