/* Sensors that share nothing but what links them are stepped by several threads: each is an island,
 * with a schedule of its own. All of them go on to the next step of a module that links them, or
 * for a second: a span; then that steps, alone, by the thread that was the last to finish. The
 * calling thread is one of the threads. Which of them does what is left to chance; what comes out
 * is not. Hooks are done by whoever has nothing to step, of whole spans only and one at a time, in
 * the order in which a run on one thread would have done them: by tick, then by the stepping order
 * of the instances. */
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/engine/engine_internal.h"

/* SPANS: of which hooks may be left to do. HOOKS: done in one go. */
enum { ALIGN = 16, KIND_BYTES = 48, MOST_THREADS = 32, SPANS = 8, HOOKS = 32 };
/* A thread sleeps when there was nothing to do for so long: waking takes about as long. */
static const double AWAKE_S = 2e-4;

/* What a hook is to be told; its content follows. */
typedef struct note {
    size_t bytes; /* with the content */
    int64_t tick;
    int instance;
    const channel *ch; /* NULL: an event */
} note;

typedef struct event_text {
    char kind[KIND_BYTES], text[400];
} event_text;

enum { NOTE_BYTES = (sizeof(note) + ALIGN - 1) / ALIGN * ALIGN };

typedef struct notes {
    char *bytes;
    size_t used, room, read;
} notes;

typedef struct island {
    bst_heap heap;
    notes notes[SPANS];
    bst_ctx ctx;
    bst_status status;
    int64_t failed_tick, last_tick;
    int failed_instance;
    double took_s[2]; /* the last spans: frames come every other one */
} island;

struct bst_islands {
    bst_engine *engine;
    island *islands; /* the last one: what links the others */
    int count;       /* without that */
    pthread_t threads[MOST_THREADS];
    int thread_count;
    int *order; /* in which islands of a span are taken: those that will take long first */
    pthread_mutex_t lock; /* over what follows */
    pthread_cond_t changed;
    int sleeping;
    atomic_uint changes; /* for threads that wait awake */
    bst_ctx *ctx;        /* of who does hooks */
    bst_status heard;
    int64_t until_tick, last_tick; /* of the span; of the run */
    int64_t span, hooked;          /* spans that were begun, and whose hooks are done */
    int next, done;                /* islands of the span that were taken, and that are finished */
    bool linked;                   /* and what links them has stepped */
    bool failed;                   /* a step of it did: its hooks are for the caller */
    bool hooking;                  /* somebody does */
    bool running, stop;
};

/* ---- notes ---- */

static bst_status take_note(bst_ctx *ctx, notes *n, const note *head, const void *content,
                            size_t bytes) {
    size_t whole = NOTE_BYTES + (bytes + ALIGN - 1) / ALIGN * ALIGN;
    if (n->used + whole > n->room) {
        size_t room = 2 * (n->room + whole) + 65536;
        char *more = aligned_alloc(ALIGN, room / ALIGN * ALIGN);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu bytes of messages", room);
        }
        memcpy(more, n->bytes ? n->bytes : more, n->used);
        free(n->bytes);
        n->bytes = more;
        n->room = room / ALIGN * ALIGN;
    }
    note *to = (note *)(void *)(n->bytes + n->used);
    *to = *head;
    to->bytes = whole;
    memcpy(n->bytes + n->used + NOTE_BYTES, content, bytes);
    n->used += whole;
    return BST_OK;
}

static notes *notes_of(bst_engine *engine, const instance *self) {
    bst_islands *s = engine->islands;
    return &s->islands[self->island].notes[(s->span - 1) % SPANS];
}

bst_status bst_islands_message(struct bst_step *step, const channel *ch, const void *payload) {
    const bst_channel_type *type = ch->type;
    size_t bytes = type->count
                       ? type->header_bytes + type->item_bytes * (size_t)type->count(payload)
                       : ch->payload_bytes;
    note head = {.tick = step->tick, .instance = step->self->order, .ch = ch};
    return take_note(step->ctx, notes_of(step->engine, step->self), &head, payload, bytes);
}

bst_status bst_islands_event(struct bst_step *step, const char *kind, const char *text) {
    event_text e;
    memset(&e, 0, sizeof e);
    snprintf(e.kind, sizeof e.kind, "%s", kind);
    snprintf(e.text, sizeof e.text, "%s", text);
    note head = {.tick = step->tick, .instance = step->self->order};
    return take_note(step->ctx, notes_of(step->engine, step->self), &head, &e, sizeof e);
}

static note *first_note(const notes *n) {
    return n->read < n->used ? (note *)(void *)(n->bytes + n->read) : NULL;
}

static bool is_before(int64_t tick, int instance_, int64_t other_tick, int other) {
    return tick < other_tick || (tick == other_tick && instance_ < other);
}

/* Does up to `most` hooks of one span, none after a step that failed. *all: those were all. */
static bst_status do_hooks(bst_ctx *ctx, bst_engine *engine, int64_t span, int most,
                           int64_t last_tick, int last_instance, bool *all) {
    bst_islands *s = engine->islands;
    const bst_engine_hooks *hooks = &engine->hooks;
    bst_status status = BST_OK;
    *all = false;
    for (int done = 0; done < most && status == BST_OK && !*all; done++) {
        notes *from = NULL;
        note *next = NULL;
        for (int i = 0; i <= s->count; i++) {
            note *n = first_note(&s->islands[i].notes[span % SPANS]);
            if (n && (!next || is_before(n->tick, n->instance, next->tick, next->instance))) {
                next = n;
                from = &s->islands[i].notes[span % SPANS];
            }
        }
        if (!next || is_before(last_tick, last_instance, next->tick, next->instance)) {
            *all = true;
            break;
        }
        const void *content = (const char *)next + NOTE_BYTES;
        if (next->ch) {
            status = hooks->message(hooks->user, next->ch->scope, next->ch->type->name, content,
                                    next->tick);
        } else {
            const event_text *e = content;
            status = hooks->event(hooks->user, next->tick, engine->instances[next->instance]->name,
                                  e->kind, e->text);
        }
        status = bst_engine_heard(ctx, engine, status);
        from->read += next->bytes;
    }
    for (int i = 0; i <= s->count && (*all || status != BST_OK); i++) {
        notes *n = &s->islands[i].notes[span % SPANS];
        n->used = n->read = 0;
    }
    return status;
}

/* ---- stepping ---- */

static void step_island(bst_engine *engine, island *self, int64_t until_tick) {
    bst_heap *heap = &self->heap;
    while (self->status == BST_OK && heap->count > 0) {
        int index = heap->items[0];
        int64_t tick = engine->due[index];
        if (tick >= until_tick) {
            break;
        }
        self->last_tick = tick;
        self->status = bst_engine_step(&self->ctx, engine, index, tick);
        if (self->status != BST_OK) {
            self->failed_tick = tick;
            self->failed_instance = index;
        }
    }
}

/* The first step that failed, NULL: none. */
static const island *first_failure(const bst_islands *s) {
    const island *first = NULL;
    for (int i = 0; i <= s->count; i++) {
        const island *one = &s->islands[i];
        if (one->status != BST_OK &&
            (!first || is_before(one->failed_tick, one->failed_instance, first->failed_tick,
                                 first->failed_instance))) {
            first = one;
        }
    }
    return first;
}

/* Tick after the last one of the next span. */
static int64_t next_until(const bst_islands *s, int64_t from, int64_t until_tick) {
    const bst_heap *links = &s->islands[s->count].heap;
    int64_t until = from + s->engine->tick_rate_hz;
    if (links->count > 0 && s->engine->due[links->items[0]] + 1 < until) {
        until = s->engine->due[links->items[0]] + 1;
    }
    return until < until_tick ? until : until_tick;
}

static int64_t first_due(const bst_islands *s) {
    int64_t first = INT64_MAX;
    for (int i = 0; i <= s->count; i++) {
        const bst_heap *heap = &s->islands[i].heap;
        if (heap->count > 0 && s->engine->due[heap->items[0]] < first) {
            first = s->engine->due[heap->items[0]];
        }
    }
    return first;
}

/* Something changed that threads may wait for; by who holds the lock. */
static void tell(bst_islands *s) {
    atomic_fetch_add_explicit(&s->changes, 1, memory_order_release);
    if (s->sleeping > 0) {
        pthread_cond_broadcast(&s->changed);
    }
}

/* Waits for the next change; holds the lock before and after. */
static void await(bst_islands *s) {
    unsigned seen = atomic_load_explicit(&s->changes, memory_order_relaxed);
    pthread_mutex_unlock(&s->lock);
    double begun = bst_wall_seconds();
    bool changed = false;
    while (!changed && bst_wall_seconds() - begun < AWAKE_S) {
        sched_yield();
        changed = atomic_load_explicit(&s->changes, memory_order_acquire) != seen;
    }
    pthread_mutex_lock(&s->lock);
    if (atomic_load_explicit(&s->changes, memory_order_relaxed) == seen) {
        s->sleeping++;
        pthread_cond_wait(&s->changed, &s->lock);
        s->sleeping--;
    }
}

static double expected_s(const island *i) {
    return i->took_s[0] > i->took_s[1] ? i->took_s[0] : i->took_s[1];
}

static void begin_span(bst_islands *s) {
    for (int i = 1; i < s->count; i++) {
        int one = s->order[i], k = i;
        for (; k > 0 && expected_s(&s->islands[one]) > expected_s(&s->islands[s->order[k - 1]]);
             k--) {
            s->order[k] = s->order[k - 1];
        }
        s->order[k] = one;
    }
    int64_t from = first_due(s);
    s->until_tick = next_until(s, from, s->last_tick);
    s->next = s->done = 0;
    s->linked = false;
    s->span++;
    tell(s);
}

/* Steps an island of the span; after the last one what links them. The lock is held before and
 * after. */
static void step_one(bst_islands *s) {
    island *self = &s->islands[s->order[s->next++]];
    int64_t until = s->until_tick;
    pthread_mutex_unlock(&s->lock);
    double begun = bst_wall_seconds();
    step_island(s->engine, self, until);
    double took = bst_wall_seconds() - begun;
    pthread_mutex_lock(&s->lock);
    self->took_s[s->span & 1] = took;
    if (++s->done < s->count) {
        return;
    }
    for (int i = 0; i < s->count; i++) {
        int64_t tick = s->islands[i].last_tick;
        s->engine->tick = tick > s->engine->tick ? tick : s->engine->tick;
    }
    if (!first_failure(s)) {
        pthread_mutex_unlock(&s->lock);
        step_island(s->engine, &s->islands[s->count], until);
        pthread_mutex_lock(&s->lock);
    }
    s->linked = true;
    s->failed = first_failure(s) != NULL;
    s->running = s->running && !s->failed && first_due(s) < s->last_tick;
    tell(s);
}

/* Does some hooks of the first span that has any left. */
static void hook_some(bst_islands *s) {
    s->hooking = true;
    int64_t span = s->hooked;
    pthread_mutex_unlock(&s->lock);
    bool all;
    bst_status heard = do_hooks(s->ctx, s->engine, span, HOOKS, INT64_MAX, 0, &all);
    pthread_mutex_lock(&s->lock);
    s->hooking = false;
    s->hooked += all;
    if (heard != BST_OK) {
        s->heard = heard;
        s->running = false;
    }
    if (all || heard != BST_OK) {
        tell(s);
    }
}

/* Does one thing that there is to do, or waits; holds the lock before and after. */
static void do_or_await(bst_islands *s) {
    if (s->running && s->linked && s->span - s->hooked < SPANS - 1) {
        begin_span(s);
    }
    if (s->next < s->count) {
        step_one(s);
    } else if (!s->hooking && s->hooked < s->span - (!s->linked || s->failed) &&
               s->heard == BST_OK) {
        hook_some(s);
    } else {
        await(s);
    }
}

static void *work(void *user) {
    bst_islands *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        do_or_await(s);
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

/* The calling thread's part, until all of it is done but hooks of a span in which a step failed. */
static bool run_spans(bst_islands *s) {
    const bst_engine *engine = s->engine;
    bool interrupted = false;
    double asked = bst_wall_seconds();
    pthread_mutex_lock(&s->lock);
    s->running = first_due(s) < s->last_tick;
    while (s->running || !s->linked || s->hooking) {
        double now = bst_wall_seconds();
        if (engine->hooks.interrupted && !interrupted && now - asked > 0.02) {
            asked = now;
            int64_t tick = engine->tick;
            pthread_mutex_unlock(&s->lock);
            interrupted = engine->hooks.interrupted(engine->hooks.user, tick);
            pthread_mutex_lock(&s->lock);
            s->running = s->running && !interrupted;
        }
        if (s->running || !s->linked || s->hooking) {
            do_or_await(s);
        }
    }
    s->hooking = true; /* what is left is for the caller */
    pthread_mutex_unlock(&s->lock);
    return interrupted;
}

bst_status bst_islands_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    bst_islands *s = engine->islands;
    s->ctx = ctx;
    s->heard = BST_OK;
    s->last_tick = until_tick;
    bool interrupted = run_spans(s);
    const island *failed = first_failure(s);
    bst_status status = BST_OK, heard = s->heard;
    pthread_mutex_lock(&s->lock);
    for (; s->hooked < s->span && heard == BST_OK; s->hooked++) {
        bool all, last = failed && s->hooked == s->span - 1;
        heard = do_hooks(ctx, engine, s->hooked, INT32_MAX, last ? failed->failed_tick : INT64_MAX,
                         last ? failed->failed_instance : 0, &all);
    }
    s->hooking = false;
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i <= s->count; i++) {
        ctx->warnings += s->islands[i].ctx.warnings;
        s->islands[i].ctx.warnings = 0;
    }
    if (heard != BST_OK) {
        return heard;
    }
    if (failed) {
        status = bst_fail(ctx, failed->status, "%s", failed->ctx.message);
    } else if (interrupted) {
        status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted at %.3f s",
                          (double)engine->tick / (double)engine->tick_rate_hz);
    }
    return status;
}

/* ---- making them ---- */

/* Gives each instance the number of its island; returns their number, 0 when the engine cannot be
 * parted: frames that threads would share, or a message that makes another island step. */
static int part(bst_engine *engine) {
    int count = 0;
    if (engine->releasable_count > 0) {
        return 0;
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        self->order = i;
        self->island = -1;
        for (int k = 0; k < i && self->island < 0; k++) {
            const instance *other = engine->instances[k];
            bool same = other->island >= 0 && strcmp(other->scope, self->scope) == 0;
            self->island = same ? other->island : -1;
        }
        if (self->island < 0 && self->spec.member_count == 0) {
            self->island = count++;
        }
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (self->spec.member_count > 0) {
            self->island = count;
            if (self->trigger_count > 0) {
                return 0;
            }
        }
        for (int t = 0; t < self->trigger_count; t++) {
            const channel *ch = &engine->channels[self->ports[self->triggers[t]].channel];
            if (engine->instances[ch->writer]->spec.member_count > 0) {
                return 0;
            }
        }
    }
    return count;
}

static void free_islands(bst_islands *s) {
    for (int i = 0; s->islands && i <= s->count; i++) {
        free(s->islands[i].heap.items);
        for (int k = 0; k < SPANS; k++) {
            free(s->islands[i].notes[k].bytes);
        }
    }
    free(s->islands);
    free(s->order);
    free(s);
}

static bst_status fill(bst_ctx *ctx, bst_islands *s) {
    bst_engine *engine = s->engine;
    s->islands = calloc((size_t)s->count + 1, sizeof *s->islands);
    s->order = calloc((size_t)s->count + 1, sizeof *s->order);
    bool enough = s->islands && s->order;
    for (int i = 0; enough && i < s->count; i++) {
        s->order[i] = i;
    }
    for (int i = 0; enough && i <= s->count; i++) {
        island *self = &s->islands[i];
        self->last_tick = -1;
        bst_ctx_init(&self->ctx, ctx->log, ctx->log_user, ctx->log_level);
        self->heap.items = calloc((size_t)engine->instance_count + 1, sizeof *self->heap.items);
        enough = self->heap.items != NULL;
    }
    if (!enough) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sensors", s->count);
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        self->heap = &s->islands[self->island].heap;
        engine->place[i] = self->heap->count;
        self->heap->items[self->heap->count++] = i;
    }
    for (int i = 0; i < engine->instance_count; i++) {
        bst_engine_set_due(engine, i, engine->due[i]);
    }
    return BST_OK;
}

bst_status bst_engine_part(bst_ctx *ctx, bst_engine *engine, int threads, bool *parted) {
    *parted = false;
    if (!engine->loaded || engine->overlap || engine->islands) {
        return bst_fail(ctx, BST_ERR_STATE, "an engine is parted once, after loading");
    }
    int count = part(engine);
    if (count < 2 || threads < 2) {
        return BST_OK;
    }
    bst_islands *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sensors", count);
    }
    s->engine = engine;
    s->count = s->next = s->done = count;
    s->linked = true;
    bst_status status = fill(ctx, s);
    if (status != BST_OK) {
        free_islands(s);
        return status;
    }
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    sigset_t all, before; /* signals are the main thread's */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int wanted = (threads < count ? threads : count) - 1;
    while (s->thread_count < wanted && s->thread_count < MOST_THREADS &&
           pthread_create(&s->threads[s->thread_count], NULL, work, s) == 0) {
        s->thread_count++;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    engine->islands = s;
    if (s->thread_count == 0) {
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot start a thread");
    }
    *parted = true;
    return BST_OK;
}

void bst_islands_stop(bst_engine *engine) {
    bst_islands *s = engine->islands;
    if (!s) {
        return;
    }
    pthread_mutex_lock(&s->lock);
    s->stop = true;
    tell(s);
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i < s->thread_count; i++) {
        pthread_join(s->threads[i], NULL);
    }
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    free_islands(s);
    engine->islands = NULL;
}
