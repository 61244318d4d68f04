/* Several sims in a pool of threads. */
#include "boresight/sim_pool.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/parallel.h"

struct bst_sim_pool {
    bst_parallel *threads;
    bst_status *statuses; /* [room] of the sims in the latest call */
    int room;
};

bst_status bst_sim_pool_create(bst_ctx *ctx, int threads, bst_sim_pool **out) {
    assert(out && threads >= 0);
    *out = NULL;
    bst_sim_pool *pool = calloc(1, sizeof *pool);
    if (!pool) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a pool of sims");
    }
    bst_status status = bst_parallel_create(ctx, threads, &pool->threads);
    if (status != BST_OK) {
        bst_sim_pool_free(pool);
        return status;
    }
    *out = pool;
    return BST_OK;
}

void bst_sim_pool_free(bst_sim_pool *pool) {
    if (pool) {
        bst_parallel_free(pool->threads);
        free(pool->statuses);
        free(pool);
    }
}

/* What the threads of a call of bst_sim_pool_step share. */
typedef struct step_call {
    const bst_ctx *ctx; /* of the caller: its log */
    bst_sim *const *sims;
    const char *channel;
    const int *messages;
    double until_s;
    int *arrived;
    bst_status *statuses;
    int first;                       /* first sim that failed; `count`: none */
    char message[BST_MESSAGE_BYTES]; /* of its error */
    pthread_mutex_t lock;            /* protects these two */
} step_call;

/* Steps one sim to its last message. */
static bst_status step_sim(bst_ctx *ctx, const step_call *call, int index) {
    bst_sim *sim = call->sims[index];
    const int wanted = call->messages ? call->messages[index] : 1;
    int came = 0;
    bool more = true;
    bst_status status = BST_OK;
    if (!call->channel) {
        return bst_sim_run_until(ctx, sim, call->until_s);
    }
    while (status == BST_OK && more && came < wanted) {
        status = bst_sim_step(ctx, sim, NULL, call->channel, call->until_s, &more);
        came += more;
    }
    if (call->arrived) {
        call->arrived[index] = came;
    }
    return status;
}

static void step_some(void *user, int begin, int end) {
    step_call *call = user;
    for (int i = begin; i < end; i++) {
        if (!call->sims[i]) {
            continue;
        }
        bst_ctx own = *call->ctx;
        call->statuses[i] = step_sim(&own, call, i);
        if (call->statuses[i] == BST_OK) {
            continue;
        }
        pthread_mutex_lock(&call->lock);
        if (i < call->first) {
            call->first = i;
            memcpy(call->message, own.message, sizeof own.message);
        }
        pthread_mutex_unlock(&call->lock);
    }
}

bst_status bst_sim_pool_step(bst_ctx *ctx, bst_sim_pool *pool, bst_sim *const *sims, int count,
                             const char *channel, const int *messages, double until_s,
                             int *arrived) {
    assert(pool && count >= 0 && (sims || count == 0));
    if (count > pool->room) {
        bst_status *more = realloc(pool->statuses, (size_t)count * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sims", count);
        }
        pool->statuses = more;
        pool->room = count;
    }
    step_call call = {.ctx = ctx,
                      .sims = sims,
                      .channel = channel,
                      .messages = messages,
                      .until_s = until_s,
                      .arrived = arrived,
                      .statuses = pool->statuses,
                      .first = count,
                      .lock = PTHREAD_MUTEX_INITIALIZER};
    bst_parallel_for(pool->threads, count, 1, step_some, &call);
    pthread_mutex_destroy(&call.lock);
    if (call.first < count) {
        return bst_fail(ctx, pool->statuses[call.first], "sim %d: %s", call.first, call.message);
    }
    return BST_OK;
}

/* First members of both rings (messages/los_history.h, messages/pointing_telemetry.h). */
typedef struct ring_head {
    int64_t written;
    int32_t capacity;
} ring_head;

/* Copies the newest items [kept] of a ring, oldest first. */
static void copy_ring(const ring_head *ring, const char *from, size_t bytes, int kept, char *to) {
    int first = (int)((ring->written - kept) % ring->capacity);
    int straight = ring->capacity - first < kept ? ring->capacity - first : kept;
    memcpy(to, from + (size_t)first * bytes, (size_t)straight * bytes);
    memcpy(to + (size_t)straight * bytes, from, (size_t)(kept - straight) * bytes);
}

static void copy_message(const bst_channel_type *type, const bst_sim_message *view, int index,
                         const bst_sim_columns *columns) {
    char *header = (char *)columns->headers + (size_t)index * type->header_bytes;
    columns->written_at[index] = view->payload ? view->written_tick : -1;
    columns->item_counts[index] = 0;
    if (!view->payload) {
        memset(header, 0, type->header_bytes);
        return;
    }
    memcpy(header, view->payload, type->header_bytes);
    const ring_head *ring = type->in_place ? view->payload : NULL;
    int held = !ring                            ? view->items
               : ring->written < ring->capacity ? (int)ring->written
                                                : ring->capacity;
    columns->item_counts[index] = held;
    int kept = held < columns->item_capacity ? held : columns->item_capacity;
    if (kept == 0) {
        return;
    }
    const char *from = (const char *)view->payload + type->header_bytes;
    char *to =
        (char *)columns->items + (size_t)index * (size_t)columns->item_capacity * type->item_bytes;
    if (ring) {
        copy_ring(ring, from, type->item_bytes, kept, to);
    } else {
        memcpy(to, from, (size_t)kept * type->item_bytes);
    }
}

bst_status bst_sim_pool_view(bst_ctx *ctx, bst_sim *const *sims, int count, const char *scope,
                             const char *channel, const bst_sim_columns *columns) {
    assert(channel && columns && columns->headers && columns->item_counts && columns->written_at &&
           (columns->items || columns->item_capacity == 0));
    const bst_channel_type *type = bst_channel_type_find(channel);
    for (int i = 0; i < count; i++) {
        bst_sim_message view;
        if (sims[i]) {
            BST_TRY(bst_sim_view(ctx, sims[i], scope, channel, &view));
            copy_message(type, &view, i, columns);
        }
    }
    return BST_OK;
}

bst_status bst_sim_pool_command(bst_ctx *ctx, bst_sim *const *sims, int count, const char *scope,
                                const char *channel, const void *payloads) {
    assert(channel && (payloads || count == 0));
    const bst_channel_type *type = bst_channel_type_find(channel);
    if (!type) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no message \"%s\"", channel);
    }
    for (int i = 0; i < count; i++) {
        const char *payload = (const char *)payloads + (size_t)i * type->header_bytes;
        bst_status status =
            sims[i] ? bst_sim_command(ctx, sims[i], scope, channel, payload) : BST_OK;
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "sim %d", i);
        }
    }
    return BST_OK;
}
