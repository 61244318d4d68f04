/* Pool of a frame's detections: spatial search by direction, and brightness likelihood. */
#include <assert.h>
#include <stdlib.h>

#include "tracker/mtt/multitarget_internal.h"

void bst_mtt_pool_lay_out(bst_mtt_pool *pool, int capacity, bst_arena *arena) {
    size_t n = (size_t)capacity + 1;
    BST_ARENA_TAKE(arena, pool->order, n);
    BST_ARENA_TAKE(arena, pool->key, n);
    BST_ARENA_TAKE(arena, pool->items, n);
    BST_ARENA_TAKE(arena, pool->used, n);
}

static double component(bst_vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/* Heapsort: moves the root down to its place. */
static void sift(double *key, int *order, int root, int count) {
    for (;;) {
        int child = 2 * root + 1;
        if (child >= count) {
            return;
        }
        if (child + 1 < count && key[child + 1] > key[child]) {
            child++;
        }
        if (!(key[child] > key[root])) {
            return;
        }
        double k = key[root];
        int o = order[root];
        key[root] = key[child];
        order[root] = order[child];
        key[child] = k;
        order[child] = o;
        root = child;
    }
}

void bst_mtt_sort(double *key, int *order, int count) {
    for (int i = count / 2 - 1; i >= 0; i--) {
        sift(key, order, i, count);
    }
    for (int end = count - 1; end > 0; end--) {
        double k = key[0];
        int o = order[0];
        key[0] = key[end];
        order[0] = order[end];
        key[end] = k;
        order[end] = o;
        sift(key, order, 0, end);
    }
}

void bst_mtt_pool_index(bst_mtt_pool *pool) {
    double low[3] = {2, 2, 2}, high[3] = {-2, -2, -2};
    for (int i = 0; i < pool->count; i++) {
        for (int a = 0; a < 3; a++) {
            double v = component(pool->items[i].sky.direction, a);
            low[a] = fmin(low[a], v);
            high[a] = fmax(high[a], v);
        }
    }
    pool->axis = 0;
    for (int a = 1; a < 3; a++) {
        if (high[a] - low[a] > high[pool->axis] - low[pool->axis]) {
            pool->axis = a;
        }
    }
    for (int i = 0; i < pool->count; i++) {
        pool->key[i] = component(pool->items[i].sky.direction, pool->axis);
        pool->order[i] = i;
    }
    bst_mtt_sort(pool->key, pool->order, pool->count);
}

void bst_mtt_pool_archive(bst_mtt_pool *pool, int capacity, bst_archive *archive) {
    BST_ARCHIVE(archive, pool->seconds);
    BST_ARCHIVE(archive, pool->undetected);
    BST_ARCHIVE(archive, pool->tick);
    pool->count = bst_archive_count(archive, pool->count, capacity);
    bst_archive_bytes(archive, pool->items, (size_t)pool->count * sizeof *pool->items);
    bst_archive_bytes(archive, pool->used, (size_t)pool->count * sizeof *pool->used);
    if (bst_archive_is_restoring(archive)) {
        bst_mtt_pool_index(pool); /* the order depends on the items alone */
    }
}

/* First sorted position whose key is at least `key` (binary search). */
static int lower_bound(const bst_mtt_pool *pool, double key) {
    int low = 0, high = pool->count;
    while (low < high) {
        int mid = low + (high - low) / 2;
        if (pool->key[mid] < key) {
            low = mid + 1;
        } else {
            high = mid;
        }
    }
    return low;
}

void bst_mtt_pool_range(const bst_mtt_pool *pool, bst_vec3 direction, double chord, int *begin,
                        int *end) {
    assert(pool && begin && end && chord >= 0.0);
    double centre = component(direction, pool->axis);
    *begin = lower_bound(pool, centre - chord);
    *end = *begin;
    while (*end < pool->count && pool->key[*end] <= centre + chord) {
        ++*end;
    }
}

/* Brightness contributes to the association cost, but is capped: a flare or an eclipse must not
 * cost a track its detection. */
double bst_mtt_brightness_cost(const bst_mtt_track *track, const bst_mtt_detection *detection) {
    double variance =
        track->v_mag_variance + 0.09 + detection->v_mag_sigma * detection->v_mag_sigma;
    double difference = track->v_mag - detection->v_mag;
    double chi2 = difference * difference / variance;
    /* 3 sigma at most: glints are no reason to lose a track */
    return isfinite(chi2) ? 0.5 * fmin(chi2, 9.0) : 0.0;
}
