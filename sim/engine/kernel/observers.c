/* Each process logs the records for observers in its own order. A thread that has nothing to step
 * passes them on, one thread at a time, merged by tick and stepping order: the order of a run on
 * one thread. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/kernel/executor_internal.h"

enum { ALIGN = 16, KIND_BYTES = 48 };

/* Before the content of each message or event. */
typedef struct record {
    size_t bytes; /* with the content */
    int64_t tick;
    int instance;
    const channel *ch; /* NULL: an event */
    int *frames;       /* counts the message, which holds a frame; else NULL */
} record;

typedef struct event_text {
    char kind[KIND_BYTES], text[400];
} event_text;

enum { RECORD_BYTES = (sizeof(record) + ALIGN - 1) / ALIGN * ALIGN };

/* ---- noting down ---- */

static bst_status append(bst_ctx *ctx, record_segment *to, const record *head, const void *content,
                         size_t bytes) {
    size_t whole = RECORD_BYTES + (bytes + ALIGN - 1) / ALIGN * ALIGN;
    if (to->used + whole > to->room) {
        size_t room = 2 * (to->room + whole) + 16384;
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

static logical_process *process_of(const struct bst_step *step) {
    return &step->engine->executor->processes[step->self->process];
}

static record_segment *segment_of(logical_process *self) {
    return &self->log.segments[self->log.filled % BST_MOST_SEGMENTS];
}

/* Whether another process has failed before: then what was noted down since is for nobody. */
static bool another_failed(const bst_executor *x, const logical_process *self) {
    for (int k = 0; k < x->count; k++) {
        const logical_process *other = &x->processes[k];
        if (other != self && !other->busy && other->status != BST_OK) {
            return true;
        }
    }
    return false;
}

/* Has what was noted down until now observed: the payload is overwritten when the step is over.
 * Only a process that has the calling thread for itself may wait. */
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

/* ---- showing ---- */

/* The first record before segment `end` that was not yet shown, NULL: there is none. */
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

/* The log with the next record to be shown, NULL: none is left. */
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

static void let_go(record *r) {
    if (r->frames) {
        r->ch->type->release((char *)r + RECORD_BYTES);
        __atomic_fetch_sub(r->frames, 1, __ATOMIC_RELAXED);
    }
}

static bst_status show(bst_executor *x, const record *r) {
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
        heard = show(x, r);
        let_go(r);
        log->read += r->bytes;
    }
    (void)next_log(x); /* passes over segments that are done */
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
        /* with what a window that failed left behind */
        int64_t end =
            log->filled - log->reading < BST_MOST_SEGMENTS ? log->filled + 1 : log->filled;
        for (record *r = first_record(log, end); r; r = first_record(log, end)) {
            let_go(r);
            log->read += r->bytes;
        }
    }
}
