/* What one thread does behind the stepping one: hooks, and steps of instances that nothing else
 * waits for. The stepping thread puts copies of what is needed into a ring of bytes; the other
 * takes them out in the same order, so that everything happens in the order of a run without it. A
 * third one looks ahead of it, at steps whose modules can do part of them out of turn. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/parallel.h"
#include "sim/engine/kernel/engine_internal.h"

enum {
    ALIGN = 16,
    MOST_FRAMES = BST_OVERLAP_FRAMES,
    KIND_BYTES = 48,
    NAME_BYTES = 256,
    GATHERED = 64
};

typedef enum record_kind { SKIP, MESSAGE, EVENT, JOB } record_kind;

/* What the module's `ahead` has done for a job. */
typedef enum look { UNSEEN, LOOKING, SEEN } look;

/* What lies in the ring, its content behind it. */
typedef struct record {
    size_t bytes; /* with the content */
    record_kind kind;
    bool heavy; /* holds a frame */
    int64_t tick;
    const channel *ch; /* MESSAGE */
    /* JOB */
    const char *scope; /* borrowed from an instance */
    int ahead;         /* instance that may look ahead, -1: none */
    int64_t number;    /* of that instance's jobs */
    look looked;
} record;

/* An input of a job, the payload behind it. */
typedef struct job_input {
    size_t bytes;       /* with the payload */
    int instance, port; /* port -1: says that the instance is due */
    int64_t written_tick, sequence;
    bool taken;
} job_input;

struct bst_overlap_job {
    char *inputs;
    size_t bytes;
    int lane;
};

typedef struct event_text {
    char instance[NAME_BYTES], kind[KIND_BYTES], text[400];
} event_text;

struct bst_overlap {
    bst_engine *engine;
    pthread_t thread, looker;
    bool looks;           /* there is a looker */
    pthread_mutex_t lock; /* over what follows, and the records' looked */
    pthread_cond_t changed;
    size_t head, tail, used; /* of the ring: next byte to fill, to read; bytes in use */
    int records, heavy;
    record *waiting[MOST_FRAMES]; /* jobs that are not begun, in order */
    int waiting_count;
    bool stop;
    bst_status status; /* the first failure; ctx has its message */
    bst_ctx ctx;       /* of the thread */
    size_t capacity;
    _Alignas(ALIGN) char ring[];
};

static size_t aligned(size_t bytes) {
    return (bytes + ALIGN - 1) / ALIGN * ALIGN;
}

enum {
    RECORD_BYTES = (sizeof(record) + ALIGN - 1) / ALIGN * ALIGN,
    INPUT_BYTES = (sizeof(job_input) + ALIGN - 1) / ALIGN * ALIGN
};

/* ---- the ring ---- */

/* Where `bytes` fit in one piece, SIZE_MAX: nowhere yet. */
static size_t place(const bst_overlap *o, size_t bytes) {
    if (o->used == 0) {
        return bytes <= o->capacity ? 0 : SIZE_MAX;
    }
    if (o->head > o->tail) {
        return o->capacity - o->head >= bytes ? o->head : o->tail >= bytes ? 0 : SIZE_MAX;
    }
    return o->tail - o->head >= bytes ? o->head : SIZE_MAX;
}

/* Waits for room and returns it, *out NULL after a failure behind. The ring is not locked. */
static bst_status reserve(bst_ctx *ctx, bst_overlap *o, size_t content, bool heavy, record **out) {
    size_t bytes = RECORD_BYTES + aligned(content), at;
    *out = NULL;
    if (bytes > o->capacity) {
        return bst_fail(ctx, BST_ERR_MEMORY, "a message of %zu bytes is too long to overlap",
                        content);
    }
    pthread_mutex_lock(&o->lock);
    while (o->status == BST_OK &&
           ((heavy && o->heavy >= MOST_FRAMES) || (at = place(o, bytes)) == SIZE_MAX)) {
        pthread_cond_broadcast(&o->changed);
        pthread_cond_wait(&o->changed, &o->lock);
    }
    if (o->status != BST_OK) {
        bst_status status = bst_fail(ctx, o->status, "%s", o->ctx.message);
        pthread_mutex_unlock(&o->lock);
        return status;
    }
    if (o->used == 0) {
        o->head = o->tail = 0;
    } else if (at < o->head && o->head < o->capacity) {
        /* the end is too short; every size is a multiple of ALIGN */
        if (o->capacity - o->head >= RECORD_BYTES) {
            *(record *)(void *)&o->ring[o->head] = (record){.kind = SKIP};
        }
        o->used += o->capacity - o->head;
    }
    o->head = at;
    pthread_mutex_unlock(&o->lock);
    *out = (record *)(void *)&o->ring[at];
    **out = (record){.bytes = bytes, .heavy = heavy};
    return BST_OK;
}

static void commit(bst_overlap *o, record *r) {
    pthread_mutex_lock(&o->lock);
    o->head += r->bytes;
    o->used += r->bytes;
    o->heavy += r->heavy;
    o->records++;
    if (r->kind == JOB) {
        o->waiting[o->waiting_count++] = r;
    }
    /* to wake a thread costs more than a small message does: they may gather */
    if (r->kind == JOB || r->heavy || o->records >= GATHERED) {
        pthread_cond_broadcast(&o->changed);
    }
    pthread_mutex_unlock(&o->lock);
}

static void *content_of(record *r) {
    return (char *)r + RECORD_BYTES;
}

/* Of a message: what its readers may look at. */
static size_t used_bytes(const channel *ch, const void *payload) {
    const bst_channel_type *type = ch->type;
    return type->count ? type->header_bytes + type->item_bytes * (size_t)type->count(payload)
                       : ch->payload_bytes;
}

bst_status bst_overlap_message(bst_ctx *ctx, bst_engine *engine, const channel *ch,
                               const void *payload, int64_t tick) {
    bst_overlap *o = engine->overlap;
    record *r;
    size_t bytes = used_bytes(ch, payload);
    BST_TRY(reserve(ctx, o, bytes, ch->type->release && !ch->mark.bare, &r));
    r->kind = MESSAGE;
    r->tick = tick;
    r->ch = ch;
    memcpy(content_of(r), payload, bytes);
    if (ch->type->retain) {
        ch->type->retain(content_of(r));
    }
    commit(o, r);
    return ch->type->lends ? bst_overlap_drain(ctx, engine) : BST_OK;
}

bst_status bst_overlap_event(bst_ctx *ctx, bst_engine *engine, int64_t tick, const char *source,
                             const char *kind, const char *text) {
    bst_overlap *o = engine->overlap;
    record *r;
    BST_TRY(reserve(ctx, o, sizeof(event_text), false, &r));
    r->kind = EVENT;
    r->tick = tick;
    event_text *e = content_of(r);
    snprintf(e->instance, sizeof e->instance, "%s", source);
    snprintf(e->kind, sizeof e->kind, "%s", kind);
    snprintf(e->text, sizeof e->text, "%s", text);
    commit(o, r);
    return BST_OK;
}

/* ---- steps behind ---- */

/* Appends an input; `to` NULL: only its size. */
static size_t add_input(char *to, int index, int port, const channel *ch, int64_t sequence) {
    const slot *s = ch ? bst_engine_slot(ch, sequence) : NULL;
    size_t payload = s ? used_bytes(ch, s->payload) : 0, bytes = INPUT_BYTES + aligned(payload);
    if (to) {
        *(job_input *)(void *)to = (job_input){.bytes = bytes,
                                               .instance = index,
                                               .port = port,
                                               .written_tick = s ? s->written_tick : 0,
                                               .sequence = sequence};
        if (s) {
            memcpy(to + INPUT_BYTES, s->payload, payload);
            if (ch->type->retain) {
                ch->type->retain(to + INPUT_BYTES);
            }
        }
    }
    return bytes;
}

/* Puts aside what an instance would read now; `to` NULL: only how many bytes that takes. */
static size_t put_aside(bst_engine *engine, int index, int64_t tick, char *to) {
    instance *self = engine->instances[index];
    size_t bytes = 0;
    bool due = false;
    for (int p = 0; p < self->port_count; p++) {
        port_state *port = &self->ports[p];
        if (bst_instance_port(self, p)->direction != BST_PORT_IN || port->channel < 0 ||
            engine->channels[port->channel].apart) {
            continue;
        }
        const channel *ch = &engine->channels[port->channel];
        int64_t sequence;
        if (ch->type->kind == BST_CHANNEL_LATEST) {
            if ((sequence = bst_engine_newest(ch, port, tick)) >= 0) {
                bytes += add_input(to ? to + bytes : NULL, index, p, ch, sequence);
            }
            continue;
        }
        sequence = bst_engine_unread(engine, ch, port, tick);
        int64_t first = port->cursor;
        for (; sequence >= 0; sequence = bst_engine_unread(engine, ch, port, tick)) {
            bytes += add_input(to ? to + bytes : NULL, index, p, ch, sequence);
            port->cursor++;
        }
        port->cursor = to ? port->cursor : first;
    }
    for (int t = 0; t < self->trigger_count; t++) {
        port_state *port = &self->ports[self->triggers[t]];
        const channel *ch = &engine->channels[port->channel];
        if (!ch->apart) {
            int64_t cursor = port->trigger_cursor;
            due = bst_engine_pass_trigger(ch, port, tick) || due;
            port->trigger_cursor = to ? port->trigger_cursor : cursor;
        }
    }
    return due ? bytes + add_input(to ? to + bytes : NULL, index, -1, NULL, 0) : bytes;
}

static bst_overlap_job job_of(record *r) {
    int lane = r->ahead >= 0 ? (int)(r->number % BST_STEP_LANES) : 0;
    return (bst_overlap_job){content_of(r), r->bytes - RECORD_BYTES, lane};
}

int bst_overlap_lane(const bst_overlap_job *job) {
    return job->lane;
}

static job_input *next_input(const bst_overlap_job *job, const job_input *input) {
    size_t at = input ? (size_t)((const char *)input - job->inputs) + input->bytes : 0;
    return at < job->bytes ? (job_input *)(void *)&job->inputs[at] : NULL;
}

bst_status bst_overlap_step(bst_ctx *ctx, bst_engine *engine, int index, int64_t tick) {
    const char *scope = engine->instances[index]->scope;
    size_t bytes = 0, filled = 0;
    for (int i = index; i < engine->instance_count; i++) {
        if (strcmp(engine->instances[i]->scope, scope) == 0) {
            bytes += put_aside(engine, i, tick, NULL);
        }
    }
    record *r;
    BST_TRY(reserve(ctx, engine->overlap, bytes, true, &r));
    r->kind = JOB;
    r->tick = tick;
    r->scope = scope;
    char *to = content_of(r);
    for (int i = index; i < engine->instance_count; i++) {
        if (strcmp(engine->instances[i]->scope, scope) == 0) {
            filled += put_aside(engine, i, tick, to + filled);
            bst_engine_set_due(engine, i, bst_engine_earliest(engine, engine->instances[i]));
        }
    }
    bst_overlap_job job = job_of(r);
    r->ahead = -1;
    for (const job_input *i = next_input(&job, NULL); i && r->ahead < 0; i = next_input(&job, i)) {
        instance *self = engine->instances[i->instance];
        if (i->port < 0 && self->spec.desc->ahead) {
            r->ahead = i->instance;
            r->number = self->jobs++;
        }
    }
    commit(engine->overlap, r);
    return BST_OK;
}

static bst_sample give(struct bst_step *step, job_input *input, int port) {
    if (!input) {
        return (bst_sample){NULL, 0, -1, true};
    }
    return bst_engine_sample(step, &step->self->ports[port], (char *)input + INPUT_BYTES,
                             input->written_tick, input->sequence);
}

static bool is_for(const struct bst_step *step, const job_input *input, int port) {
    return step->engine->instances[input->instance] == step->self && input->port == port;
}

bst_sample bst_overlap_latest(struct bst_step *step, int port) {
    job_input *found = NULL;
    for (job_input *i = next_input(step->job, NULL); i; i = next_input(step->job, i)) {
        found = is_for(step, i, port) ? i : found;
    }
    return give(step, found, port);
}

bst_sample bst_overlap_next(struct bst_step *step, int port) {
    job_input *i = next_input(step->job, NULL);
    while (i && (i->taken || !is_for(step, i, port))) {
        i = next_input(step->job, i);
    }
    if (i) {
        i->taken = true;
    }
    return give(step, i, port);
}

static bool is_due(bst_engine *engine, int index, int64_t tick, const bst_overlap_job *job) {
    instance *self = engine->instances[index];
    bool due = false;
    for (const job_input *i = next_input(job, NULL); i; i = next_input(job, i)) {
        due = due || (i->instance == index && i->port < 0);
    }
    for (int t = 0; t < self->trigger_count; t++) {
        port_state *port = &self->ports[self->triggers[t]];
        const channel *ch = &engine->channels[port->channel];
        due = (ch->apart && bst_engine_pass_trigger(ch, port, tick)) || due;
    }
    return due;
}

static bst_status run_job(bst_overlap *o, const record *r, bst_overlap_job *job) {
    bst_engine *engine = o->engine;
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (!self->apart || strcmp(self->scope, r->scope) != 0 ||
            !is_due(engine, i, r->tick, job)) {
            continue;
        }
        struct bst_step step = {
            .engine = engine, .self = self, .ctx = &o->ctx, .tick = r->tick, .job = job};
        self->steps++;
        bst_status status = self->spec.desc->step(self->self, &step);
        if (status != BST_OK) {
            return bst_fail_prefix(&o->ctx, status, "%s at %.6f s", self->name,
                                   (double)r->tick / (double)engine->tick_rate_hz);
        }
        BST_TRY(bst_engine_commit(&step));
    }
    return BST_OK;
}

static void let_go(const channel *ch, void *payload) {
    if (ch->type->release) {
        ch->type->release(payload);
    }
}

/* Does what a record asks for, unless something failed before; lets go of what it holds. */
static bst_status work_off(bst_overlap *o, record *r) {
    const bst_engine_hooks *hooks = &o->engine->hooks;
    bst_status status = o->status;
    if (r->kind == MESSAGE) {
        if (status == BST_OK) {
            status = bst_engine_heard(&o->ctx, o->engine,
                                      hooks->message(hooks->user, r->ch->scope, r->ch->type->name,
                                                     content_of(r), r->tick));
        }
        let_go(r->ch, content_of(r));
    } else if (r->kind == EVENT) {
        const event_text *e = content_of(r);
        if (status == BST_OK) {
            status =
                bst_engine_heard(&o->ctx, o->engine,
                                 hooks->event(hooks->user, r->tick, e->instance, e->kind, e->text));
        }
    } else {
        bst_overlap_job job = job_of(r);
        if (status == BST_OK) {
            status = run_job(o, r, &job);
        }
        for (job_input *i = next_input(&job, NULL); i; i = next_input(&job, i)) {
            if (i->port >= 0) {
                const instance *self = o->engine->instances[i->instance];
                let_go(&o->engine->channels[self->ports[i->port].channel], (char *)i + INPUT_BYTES);
            }
        }
    }
    return status;
}

/* ---- ahead ---- */

/* The first job that may be looked at: in its lane nothing else is under way. */
static record *next_ahead(const bst_overlap *o) {
    for (int i = 0; i < o->waiting_count && o->status == BST_OK; i++) {
        record *r = o->waiting[i];
        if (r->ahead >= 0 && r->looked == UNSEEN &&
            r->number < o->engine->instances[r->ahead]->jobs_done + BST_STEP_LANES) {
            return r;
        }
    }
    return NULL;
}

/* Called, and returns, with the lock held. */
static void look_at(bst_overlap *o, record *r) {
    r->looked = LOOKING;
    pthread_mutex_unlock(&o->lock);
    instance *self = o->engine->instances[r->ahead];
    bst_overlap_job job = job_of(r);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    struct bst_step step = {.engine = o->engine,
                            .self = self,
                            .ctx = &ctx,
                            .tick = r->tick,
                            .job = &job,
                            .ahead = true};
    (void)self->spec.desc->ahead(self->self, &step); /* the step will tell what fails */
    for (job_input *i = next_input(&job, NULL); i; i = next_input(&job, i)) {
        i->taken = false;
    }
    pthread_mutex_lock(&o->lock);
    r->looked = SEEN;
    pthread_cond_broadcast(&o->changed);
}

static void *look_ahead(void *user) {
    bst_overlap *o = user;
    pthread_mutex_lock(&o->lock);
    while (!o->stop) {
        record *r = next_ahead(o);
        if (r) {
            look_at(o, r);
        } else {
            pthread_cond_wait(&o->changed, &o->lock);
        }
    }
    pthread_mutex_unlock(&o->lock);
    return NULL;
}

/* Takes the first job for its step: nobody looks at it from here on. While somebody does, there may
 * be another to be looked at. */
static void begin_job(bst_overlap *o, record *r) {
    o->waiting_count--;
    memmove(o->waiting, o->waiting + 1, (size_t)o->waiting_count * sizeof o->waiting[0]);
    while (r->looked == LOOKING) {
        record *other = next_ahead(o);
        if (other) {
            look_at(o, other);
        } else {
            pthread_cond_wait(&o->changed, &o->lock);
        }
    }
    r->looked = SEEN;
}

static void *work(void *user) {
    bst_overlap *o = user;
    pthread_mutex_lock(&o->lock);
    for (;;) {
        while (o->records == 0 && !o->stop) {
            pthread_cond_wait(&o->changed, &o->lock);
        }
        if (o->records == 0) {
            break;
        }
        record *r = (record *)(void *)&o->ring[o->tail];
        if (o->capacity - o->tail < RECORD_BYTES || r->kind == SKIP) {
            o->used -= o->capacity - o->tail;
            o->tail = 0;
            r = (record *)(void *)o->ring;
        }
        if (r->kind == JOB) {
            begin_job(o, r);
        }
        pthread_mutex_unlock(&o->lock);
        bst_status status = work_off(o, r);
        pthread_mutex_lock(&o->lock);
        o->status = status;
        if (r->kind == JOB && r->ahead >= 0) {
            o->engine->instances[r->ahead]->jobs_done++;
        }
        o->tail += r->bytes;
        o->used -= r->bytes;
        o->heavy -= r->heavy;
        o->records--;
        pthread_cond_broadcast(&o->changed);
    }
    pthread_mutex_unlock(&o->lock);
    return NULL;
}

bst_status bst_overlap_drain(bst_ctx *ctx, bst_engine *engine) {
    bst_overlap *o = engine->overlap;
    pthread_mutex_lock(&o->lock);
    while (o->records > 0) {
        pthread_cond_broadcast(&o->changed);
        pthread_cond_wait(&o->changed, &o->lock);
    }
    ctx->warnings += o->ctx.warnings;
    o->ctx.warnings = 0;
    bst_status status =
        o->status == BST_OK ? BST_OK : bst_fail(ctx, o->status, "%s", o->ctx.message);
    pthread_mutex_unlock(&o->lock);
    return status;
}

static bool has_ahead(const bst_engine *engine) {
    bool any = false;
    for (int i = 0; i < engine->instance_count; i++) {
        any |= engine->instances[i]->apart && engine->instances[i]->spec.desc->ahead;
    }
    return any;
}

bst_status bst_overlap_start(bst_ctx *ctx, bst_engine *engine) {
    /* room for a few frames with all that goes with them */
    size_t most = 4096;
    for (int c = 0; c < engine->channel_count; c++) {
        most += RECORD_BYTES + 2 * (INPUT_BYTES + aligned(engine->channels[c].payload_bytes));
    }
    for (int i = 0; i < engine->instance_count; i++) {
        for (int p = 0; p < engine->instances[i]->port_count; p++) {
            int c = engine->instances[i]->ports[p].channel;
            most += c >= 0 ? INPUT_BYTES + aligned(engine->channels[c].payload_bytes) : 0;
        }
    }
    size_t capacity = aligned(4 * most);
    bst_overlap *o = aligned_alloc(ALIGN, aligned(sizeof *o + capacity));
    if (!o) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for overlapping");
    }
    memset(o, 0, sizeof *o);
    o->engine = engine;
    o->capacity = capacity;
    bst_ctx_init(&o->ctx, ctx->log, ctx->log_user, ctx->log_level);
    pthread_mutex_init(&o->lock, NULL);
    pthread_cond_init(&o->changed, NULL);
    /* signals are the main thread's */
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = bst_core_thread_start(&o->thread, work, o);
    /* without it all is done by the other */
    o->looks = !error && has_ahead(engine) && bst_core_thread_start(&o->looker, look_ahead, o) == 0;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (error) {
        pthread_cond_destroy(&o->changed);
        pthread_mutex_destroy(&o->lock);
        free(o);
        return bst_fail(ctx, BST_ERR_MEMORY, "cannot start a thread: %s", strerror(error));
    }
    engine->overlap = o;
    return BST_OK;
}

void bst_overlap_stop(bst_engine *engine) {
    bst_overlap *o = engine->overlap;
    if (!o) {
        return;
    }
    pthread_mutex_lock(&o->lock);
    o->stop = true;
    pthread_cond_broadcast(&o->changed);
    pthread_mutex_unlock(&o->lock);
    pthread_join(o->thread, NULL);
    if (o->looks) {
        pthread_join(o->looker, NULL);
    }
    pthread_cond_destroy(&o->changed);
    pthread_mutex_destroy(&o->lock);
    free(o);
    engine->overlap = NULL;
}
