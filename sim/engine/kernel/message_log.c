/* Message logs of channels: which message an input reads, by ticks, on any thread. */
#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"
#include "sim/engine/kernel/engine_internal.h"

size_t bst_log_used_bytes(const channel *ch, const void *payload) {
    const bst_channel_type *type = ch->type;
    return type->count ? type->header_bytes + type->item_bytes * (size_t)type->count(payload)
                       : ch->payload_bytes;
}

/* ---- reading ---- */

int64_t bst_log_newest(const message_log *log, int64_t delay, int64_t tick) {
    for (int64_t position = log->written - 1; position >= log->oldest; position--) {
        if (bst_log_slot(log, position)->written_tick + delay <= tick) {
            return position;
        }
    }
    return -1;
}

int64_t bst_log_unread(bst_engine *engine, const message_log *log, int64_t *cursor, int64_t delay,
                       int64_t tick) {
    while (*cursor < log->oldest) {
        (*cursor)++;
        bst_engine_count(engine, "queue_overflow");
    }
    return bst_log_next_visible(log, *cursor, delay) <= tick ? *cursor : -1;
}

bool bst_log_pass(const message_log *log, int64_t *cursor, int64_t delay, int64_t tick) {
    int64_t before = *cursor;
    if (*cursor < log->oldest) {
        *cursor = log->oldest;
    }
    while (bst_log_next_visible(log, *cursor, delay) <= tick) {
        (*cursor)++;
    }
    return *cursor > before;
}

int64_t bst_log_next_visible(const message_log *log, int64_t cursor, int64_t delay) {
    int64_t next = cursor > log->oldest ? cursor : log->oldest;
    return next < log->written ? bst_log_slot(log, next)->written_tick + delay : INT64_MAX;
}

/* ---- copies ---- */

/* Doubles the capacity of a full copy of a message log. */
static bst_status grow(bst_ctx *ctx, message_log *log) {
    int depth = log->depth > 0 ? 2 * log->depth : 4;
    slot *slots = calloc((size_t)depth, sizeof *slots);
    if (!slots) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d messages", depth);
    }
    int kept = 0;
    for (int64_t position = log->oldest; position < log->written; position++) {
        slots[kept++] = *bst_log_slot(log, position);
    }
    free(log->slots);
    log->slots = slots;
    log->depth = depth;
    log->head = kept;
    return BST_OK;
}

bst_status bst_log_copy(bst_ctx *ctx, message_log *to, const channel *ch, const slot *from) {
    bst_status status = BST_OK;
    pthread_mutex_lock(&to->lock);
    if (to->written - to->oldest == to->depth) {
        status = grow(ctx, to);
    }
    slot *s = status == BST_OK ? &to->slots[to->head] : NULL;
    if (s && !s->payload && !(s->payload = bst_pages_zero(1, ch->payload_bytes))) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a copy of %s/%s", ch->scope,
                          ch->type->name);
    }
    if (status == BST_OK) {
        memcpy(s->payload, from->payload, bst_log_used_bytes(ch, from->payload));
        s->written_tick = from->written_tick;
        s->sequence = from->sequence;
        s->owned = from->owned;
        if (s->owned) {
            ch->type->retain(s->payload);
            __atomic_fetch_add(to->frames, 1, __ATOMIC_RELAXED);
        }
        bst_log_advance(to);
    }
    pthread_mutex_unlock(&to->lock);
    return status;
}

/* First position of the log that a step after `tick` may read. */
static int64_t first_needed(const channel *ch, const port_state *port, int64_t tick) {
    const message_log *log = port->log;
    int64_t newest = bst_log_newest(log, port->delay_ticks, tick);
    if (newest < 0) {
        return log->oldest;
    }
    if (ch->type->release) {
        return newest + 1; /* frames are not retained for a reader that leaves them in the queue */
    }
    bool queue = ch->type->kind == BST_CHANNEL_QUEUE;
    int64_t needed = queue && port->cursor < newest ? port->cursor : newest;
    return needed > newest - ch->log.depth ? needed : newest - ch->log.depth;
}

void bst_log_trim(const channel *ch, port_state *port, int64_t tick) {
    message_log *log = port->log;
    pthread_mutex_lock(&log->lock);
    int64_t needed = first_needed(ch, port, tick);
    for (; log->oldest < needed; log->oldest++) {
        slot *s = bst_log_slot(log, log->oldest);
        if (s->owned) {
            ch->type->release(s->payload);
            __atomic_fetch_sub(log->frames, 1, __ATOMIC_RELAXED);
        }
        s->owned = false;
    }
    pthread_mutex_unlock(&log->lock);
}

void bst_log_free(const bst_channel_type *type, message_log *log) {
    for (int s = 0; log->slots && s < log->depth; s++) {
        if (log->slots[s].owned && type->release) {
            type->release(log->slots[s].payload);
        }
        bst_pages_free(log->slots[s].payload);
    }
    free(log->slots);
    if (log->copied) {
        pthread_mutex_destroy(&log->lock);
    }
}
