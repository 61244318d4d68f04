/* Sensors that share nothing but what links them are stepped by several threads: each is an island,
 * with a schedule of its own. All of them go on to the next step of a module that links them, or
 * for a second; then that steps, alone. Meanwhile the calling thread does the hooks of the span
 * before, in the order in which a run on one thread would have done them: by tick, then by the
 * stepping order of the instances. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/engine/engine_internal.h"

enum { ALIGN = 16, KIND_BYTES = 48, MOST_THREADS = 32 };

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
    notes notes[2]; /* of this span and of the one before */
    bst_ctx ctx;
    bst_status status;
    int64_t failed_tick, last_tick;
    int failed_instance;
} island;

struct bst_islands {
    bst_engine *engine;
    island *islands; /* the last one: what links the others */
    int count;       /* without that */
    int now;         /* which of the notes are being written */
    pthread_t threads[MOST_THREADS];
    int thread_count;
    pthread_mutex_t lock; /* over what follows */
    pthread_cond_t changed;
    int64_t until_tick;
    int next, done; /* islands of the span that were taken, and that are finished */
    bool stop;
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

static notes *notes_of(const bst_engine *engine, const instance *self) {
    const bst_islands *s = engine->islands;
    return &s->islands[self->island].notes[s->now];
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

/* Does the hooks of one span, up to and with a step that failed. */
static bst_status do_hooks(bst_ctx *ctx, bst_engine *engine, int which, int64_t last_tick,
                           int last_instance) {
    bst_islands *s = engine->islands;
    const bst_engine_hooks *hooks = &engine->hooks;
    bst_status status = BST_OK;
    while (status == BST_OK) {
        notes *from = NULL;
        note *next = NULL;
        for (int i = 0; i <= s->count; i++) {
            note *n = first_note(&s->islands[i].notes[which]);
            if (n && (!next || is_before(n->tick, n->instance, next->tick, next->instance))) {
                next = n;
                from = &s->islands[i].notes[which];
            }
        }
        if (!next || is_before(last_tick, last_instance, next->tick, next->instance)) {
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
    for (int i = 0; i <= s->count; i++) {
        s->islands[i].notes[which].used = s->islands[i].notes[which].read = 0;
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

static void *work(void *user) {
    bst_islands *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        if (s->next >= s->count) {
            pthread_cond_wait(&s->changed, &s->lock);
            continue;
        }
        island *self = &s->islands[s->next++];
        int64_t until = s->until_tick;
        pthread_mutex_unlock(&s->lock);
        step_island(s->engine, self, until);
        pthread_mutex_lock(&s->lock);
        if (++s->done == s->count) {
            pthread_cond_broadcast(&s->changed);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

static void begin_span(bst_islands *s, int64_t until_tick) {
    pthread_mutex_lock(&s->lock);
    s->until_tick = until_tick;
    s->next = s->done = 0;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
}

static void end_span(bst_islands *s) {
    pthread_mutex_lock(&s->lock);
    while (s->done < s->count) {
        pthread_cond_wait(&s->changed, &s->lock);
    }
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i < s->count; i++) {
        int64_t tick = s->islands[i].last_tick;
        s->engine->tick = tick > s->engine->tick ? tick : s->engine->tick;
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

bst_status bst_islands_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    bst_islands *s = engine->islands;
    bst_status status = BST_OK, heard = BST_OK;
    bool interrupted = false;
    double asked = bst_wall_seconds();
    int64_t from;
    while (heard == BST_OK && !interrupted && !first_failure(s) &&
           (from = first_due(s)) < until_tick) {
        int64_t until = next_until(s, from, until_tick);
        begin_span(s, until);
        heard = do_hooks(ctx, engine, !s->now, INT64_MAX, 0);
        end_span(s);
        if (!first_failure(s)) {
            step_island(engine, &s->islands[s->count], until);
        }
        s->now = !s->now;
        double now = bst_wall_seconds();
        if (engine->hooks.interrupted && now - asked > 0.02) {
            asked = now;
            interrupted = engine->hooks.interrupted(engine->hooks.user, engine->tick);
        }
    }
    const island *failed = first_failure(s);
    if (heard == BST_OK) {
        heard = failed
                    ? do_hooks(ctx, engine, !s->now, failed->failed_tick, failed->failed_instance)
                    : do_hooks(ctx, engine, !s->now, INT64_MAX, 0);
    }
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
        free(s->islands[i].notes[0].bytes);
        free(s->islands[i].notes[1].bytes);
    }
    free(s->islands);
    free(s);
}

static bst_status fill(bst_ctx *ctx, bst_islands *s) {
    bst_engine *engine = s->engine;
    s->islands = calloc((size_t)s->count + 1, sizeof *s->islands);
    bool enough = s->islands != NULL;
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
    int wanted = threads < count ? threads : count;
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
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i < s->thread_count; i++) {
        pthread_join(s->threads[i], NULL);
    }
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    free_islands(s);
    engine->islands = NULL;
}
