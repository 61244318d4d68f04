#include "sim/satellite/commanded_attitude.h"

#include <pthread.h>
#include <stdlib.h>

#include "sim/core/archive.h"

enum { KEPT = 4096 };

typedef struct command {
    double seconds;
    bst_quat q;
    bst_vec3 rate_radps;
} command;

struct bst_commanded_attitude {
    pthread_mutex_t lock;
    command commands[KEPT]; /* ring buffer: command n is at commands[n % KEPT] */
    int64_t count;
};

bst_status bst_commanded_attitude_create(bst_ctx *ctx, bst_commanded_attitude **out) {
    *out = calloc(1, sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for attitudes that come by message");
    }
    pthread_mutex_init(&(*out)->lock, NULL);
    return BST_OK;
}

void bst_commanded_attitude_free(bst_commanded_attitude *ring) {
    if (ring) {
        pthread_mutex_destroy(&ring->lock);
        free(ring);
    }
}

bst_status bst_commanded_attitude_add(bst_ctx *ctx, bst_commanded_attitude *ring, double seconds,
                                      bst_quat q, bst_vec3 rate_radps) {
    pthread_mutex_lock(&ring->lock);
    double last = ring->count > 0 ? ring->commands[(ring->count - 1) % KEPT].seconds : -INFINITY;
    bool later = seconds > last;
    if (later) {
        ring->commands[ring->count++ % KEPT] = (command){seconds, q, rate_radps};
    }
    pthread_mutex_unlock(&ring->lock);
    return later ? BST_OK
                 : bst_fail(ctx, BST_ERR_ARGUMENT,
                            "an attitude at %.9g s after one at %.9g s (allowed: in the order of "
                            "time)",
                            seconds, last);
}

bool bst_commanded_attitude_at(bst_commanded_attitude *ring, double seconds, bst_quat *q,
                               double *rate_radps) {
    pthread_mutex_lock(&ring->lock);
    int64_t low = ring->count > KEPT ? ring->count - KEPT : 0, high = ring->count;
    /* the last command at or before `seconds`; else the oldest one that is kept */
    bool holds = ring->count > 0 && (low > 0 || ring->commands[0].seconds <= seconds);
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (ring->commands[middle % KEPT].seconds <= seconds) {
            low = middle;
        } else {
            high = middle;
        }
    }
    command from = ring->commands[low % KEPT];
    pthread_mutex_unlock(&ring->lock);
    if (holds) {
        *q = bst_quat_turn_frame(from.q, bst_vec3_scale(from.rate_radps, seconds - from.seconds));
        *rate_radps = bst_vec3_norm(from.rate_radps);
    }
    return holds;
}

void bst_commanded_attitude_archive(bst_commanded_attitude *ring, bst_archive *archive) {
    pthread_mutex_lock(&ring->lock);
    ring->count = bst_archive_integer(archive, ring->count, 0, INT64_MAX - KEPT);
    int kept = ring->count < KEPT ? (int)ring->count : KEPT;
    bst_archive_bytes(archive, ring->commands, (size_t)kept * sizeof *ring->commands);
    pthread_mutex_unlock(&ring->lock);
}
