/* Observers of a parallel run. Each logical process logs its messages and events in its own order.
 * An idle thread passes them to the observers, merged by tick and stepping order as on
 * one thread. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/kernel/executor_internal.h"

enum { ALIGN = 16, KIND_BYTES = 48 };

/* Header of each logged message or event. */
typedef struct record {
    size_t bytes; /* including the content */
    int64_t tick;
    int instance;
    const channel *ch; /* NULL: an event */
    int *frames;       /* counter of retained frames if the message holds a frame; else NULL */
} record;

typedef struct event_text {
    char kind[KIND_BYTES], text[400];
} event_text;

enum { RECORD_BYTES = (sizeof(record) + ALIGN - 1) / ALIGN * ALIGN };

/* ---- recording ---- */

/* Appends a message or event to the records of a process. */
static bst_status append(bst_ctx *ctx, record_segment *to, const record *head, const void *content,
                         size_t bytes) {
    size_t whole = RECORD_BYTES + (bytes + ALIGN - 1) / ALIGN * ALIGN;
    if (to->used + whole > to->room) {
        size_t room = (to->used + whole) / 2 * 3 + 4096;
        char *more = aligned_alloc(ALIGN, room / ALIGN * ALIGN);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu bytes of messages", room);
        }
        if (to->used > 0) {
            memcpy(more, to->bytes, to->used);
        }
        free(to->bytes);
        to->bytes = more;
        to->room = room / ALIGN * ALIGN;
    }
    record *r = (record *)(void *)(to->bytes + to->used);
    *r = *head;
    r->bytes = whole;
    memcpy(to->bytes + to->used + RECORD_BYTES, content, bytes);
    to->used += whole;
    return BST_OK;
}

void bst_observers_begin_window(observer_log *log) {
    record_segment *next = &log->segments[log->filled % BST_MOST_SEGMENTS], *widest = next;
    for (int64_t n = log->filled + 1; n < log->observed + BST_MOST_SEGMENTS; n++) {
        record_segment *other = &log->segments[n % BST_MOST_SEGMENTS];
        widest = other->room > widest->room ? other : widest;
    }
    const record_segment held = *next;
    *next = *widest;
    *widest = held;
}

static logical_process *process_of(const struct bst_step *step) {
    return &step->engine->executor->processes[step->self->process];
}

static record_segment *segment_of(logical_process *self) {
    return &self->log.segments[self->log.filled % BST_MOST_SEGMENTS];
}

/* Checks whether another process has failed: observers do not get later records. */
static bool another_failed(const bst_executor *x, const logical_process *self) {
    for (int k = 0; k < x->count; k++) {
        const logical_process *other = &x->processes[k];
        if (other != self && !other->busy && other->status != BST_OK) {
            return true;
        }
    }
    return false;
}

/* Waits until observers have processed all records: the payload is overwritten after the step. Only
 * a process with exclusive use of the calling thread may wait. */
static bst_status await_observers(struct bst_step *step, logical_process *self) {
    bst_executor *x = step->engine->executor;
    pthread_mutex_lock(&x->lock);
    self->log.filled++;
    self->clock = step->tick;
    self->order = step->self->order + 1;
    bst_sync_follow(x, self);
    bst_sync_wake(x);
    while (x->heard == BST_OK && !another_failed(x, self) &&
           self->log.observed < self->log.filled) {
        x->sleeping++;
        pthread_cond_wait(&x->changed, &x->lock);
        x->sleeping--;
    }
    bst_status status = x->heard;
    pthread_mutex_unlock(&x->lock);
    return status == BST_OK ? BST_OK : bst_fail(step->ctx, status, "an observer failed");
}

bst_status bst_observers_message(struct bst_step *step, const channel *ch, const void *payload) {
    logical_process *self = process_of(step);
    bool holds = ch->type->release && !ch->mark.bare;
    record head = {.tick = step->tick,
                   .instance = step->self->order,
                   .ch = ch,
                   .frames = holds ? &self->frames : NULL};
    record_segment *to = segment_of(self);
    BST_TRY(append(step->ctx, to, &head, payload, bst_log_used_bytes(ch, payload)));
    if (holds) {
        ch->type->retain((void *)(uintptr_t)payload);
        __atomic_fetch_add(&self->frames, 1, __ATOMIC_RELAXED);
        self->shows_frame = true;
    }
    return ch->type->lends ? await_observers(step, self) : BST_OK;
}

bst_status bst_observers_event(struct bst_step *step, const char *kind, const char *text) {
    event_text e;
    memset(&e, 0, sizeof e);
    snprintf(e.kind, sizeof e.kind, "%s", kind);
    snprintf(e.text, sizeof e.text, "%s", text);
    record head = {.tick = step->tick, .instance = step->self->order};
    return append(step->ctx, segment_of(process_of(step)), &head, &e, sizeof e);
}

bool bst_observers_want(bst_engine *engine, channel *ch, const void *payload, int64_t tick) {
    const bst_engine_hooks *hooks = &engine->hooks;
    if (!engine->executor) {
        return hooks->wants(hooks->user, ch->scope, ch->type->name, payload, tick, &ch->mark);
    }
    pthread_mutex_lock(&engine->executor->asking);
    bool wanted = hooks->wants(hooks->user, ch->scope, ch->type->name, payload, tick, &ch->mark);
    pthread_mutex_unlock(&engine->executor->asking);
    return wanted;
}

/* ---- calling observers ---- */

/* The first unprocessed record before segment `end`; NULL: none. */
static record *first_record(observer_log *log, int64_t end) {
    while (log->reading < end) {
        record_segment *s = &log->segments[log->reading % BST_MOST_SEGMENTS];
        if (log->read < s->used) {
            return (record *)(void *)(s->bytes + log->read);
        }
        s->used = log->read = 0;
        log->reading++;
    }
    return NULL;
}

/* The log with the next record in the merged order; NULL: none. */
static observer_log *next_log(bst_executor *x) {
    observer_log *from = NULL;
    const record *next = NULL;
    for (int k = 0; k < x->count; k++) {
        observer_log *log = &x->processes[k].log;
        const record *r = first_record(log, log->readable);
        if (r && (!next || bst_before(r->tick, r->instance, next->tick, next->instance))) {
            next = r;
            from = log;
        }
    }
    return from;
}

bool bst_observers_ready(bst_executor *x) {
    int64_t tick;
    int order;
    bst_sync_complete_before(x, &tick, &order);
    for (int k = 0; k < x->count && !x->observing && x->heard == BST_OK; k++) {
        observer_log *log = &x->processes[k].log;
        const record *r = first_record(log, log->filled);
        if (r && bst_before(r->tick, r->instance, tick, order)) {
            return true;
        }
    }
    return false;
}

bool bst_observers_behind(const bst_executor *x) {
    for (int k = 0; k < x->count; k++) {
        const observer_log *log = &x->processes[k].log;
        if (log->filled - log->observed >= BST_MOST_SEGMENTS / 2) {
            return true;
        }
    }
    return false;
}

/* Releases the frame of a logged message. */
static void release_record(record *r) {
    if (r->frames) {
        r->ch->type->release((char *)r + RECORD_BYTES);
        __atomic_fetch_sub(r->frames, 1, __ATOMIC_RELAXED);
    }
}

/* Passes a logged message or event to the observers. */
static bst_status call_observer(bst_executor *x, const record *r) {
    const bst_engine_hooks *hooks = &x->engine->hooks;
    const void *content = (const char *)r + RECORD_BYTES;
    if (r->ch) {
        return hooks->message(hooks->user, r->ch->scope, r->ch->type->name, content, r->tick);
    }
    const event_text *e = content;
    return hooks->event(hooks->user, r->tick, x->engine->instances[r->instance]->name, e->kind,
                        e->text);
}

void bst_observers_work(bst_executor *x) {
    int64_t tick;
    int order;
    x->observing = true;
    bst_sync_complete_before(x, &tick, &order);
    for (int k = 0; k < x->count; k++) {
        x->processes[k].log.readable = x->processes[k].log.filled;
    }
    pthread_mutex_unlock(&x->lock);
    bst_status heard = BST_OK;
    for (int n = 0; n < BST_RECORDS_AT_ONCE && heard == BST_OK; n++) {
        observer_log *log = next_log(x);
        record *r = log ? first_record(log, log->readable) : NULL;
        if (!r || !bst_before(r->tick, r->instance, tick, order)) {
            break;
        }
        heard = call_observer(x, r);
        release_record(r);
        log->read += r->bytes;
    }
    (void)next_log(x); /* removes completed segments */
    pthread_mutex_lock(&x->lock);
    for (int k = 0; k < x->count; k++) {
        x->processes[k].log.observed = x->processes[k].log.reading;
    }
    x->heard = heard;
    x->observing = false;
    bst_sync_wake(x);
}

void bst_observers_discard(bst_executor *x) {
    for (int k = 0; k < x->count; k++) {
        observer_log *log = &x->processes[k].log;
        /* including the segment of a window that failed */
        int64_t end =
            log->filled - log->reading < BST_MOST_SEGMENTS ? log->filled + 1 : log->filled;
        for (record *r = first_record(log, end); r; r = first_record(log, end)) {
            release_record(r);
            log->read += r->bytes;
        }
    }
}
