#include <assert.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "sim/engine/kernel/engine_internal.h"
#include "sim/link/wire.h"
#include "sim/onboard/knowledge.h"

void bst_engine_count(bst_engine *engine, const char *what) {
    pthread_mutex_lock(&engine->counting);
    int i = 0, order = 1;
    while (i < engine->counter_count && (order = strncmp(engine->counters[i].name, what,
                                                         sizeof engine->counters->name - 1)) < 0) {
        i++;
    }
    counter *c = &engine->counters[i];
    if (i < engine->counter_count && order == 0) {
        c->count++;
    } else if (engine->counter_count < MAX_COUNTERS) {
        memmove(c + 1, c, (size_t)(engine->counter_count - i) * sizeof *c);
        snprintf(c->name, sizeof c->name, "%s", what);
        c->count = 1;
        engine->counter_count++;
    }
    pthread_mutex_unlock(&engine->counting);
}

bst_ctx *bst_step_ctx(struct bst_step *step) {
    return step->ctx;
}
int64_t bst_step_tick(const struct bst_step *step) {
    return step->tick;
}
double bst_step_seconds(const struct bst_step *step) {
    return (double)step->tick / (double)step->engine->tick_rate_hz;
}

int bst_step_lane(const struct bst_step *step) {
    return step->lane;
}

static const bst_sample no_sample = {NULL, 0, -1, true};

/* The message at a position of an input port's log. Position -1: an empty sample. */
static bst_sample sample_at(struct bst_step *step, const port_state *port, int64_t position) {
    if (position < 0) {
        return no_sample;
    }
    const slot *s = bst_log_slot(port->log, position);
    bst_sample sample = {s->payload, s->written_tick, s->sequence, false};
    if (port->max_age_ticks > 0 && step->tick - s->written_tick > port->max_age_ticks) {
        sample.stale = true;
        if (!step->ahead) {
            bst_engine_count(step->engine, "stale_input");
        }
    }
    return sample;
}

bst_sample bst_step_latest(struct bst_step *step, int port_index) {
    assert(step && port_index >= 0);
    const port_state *port = &step->self->ports[port_index];
    if (!port->log) {
        return no_sample;
    }
    bst_log_lock(port->log);
    bst_sample sample =
        sample_at(step, port, bst_log_newest(port->log, port->delay_ticks, step->tick));
    bst_log_unlock(port->log);
    return sample;
}

bst_sample bst_step_next(struct bst_step *step, int port_index) {
    port_state *port = &step->self->ports[port_index];
    if (!port->log) {
        return no_sample;
    }
    int64_t *cursor = step->ahead ? &step->ahead[port_index] : &port->cursor;
    bst_log_lock(port->log);
    int64_t position =
        bst_log_unread(step->engine, port->log, cursor, port->delay_ticks, step->tick);
    *cursor += position >= 0;
    bst_sample sample = sample_at(step, port, position);
    bst_log_unlock(port->log);
    return sample;
}

bst_status bst_engine_heard(bst_ctx *ctx, const bst_engine *engine, bst_status status) {
    const bst_ctx *own = engine->hooks.ctx;
    return status == BST_OK || !own || own == ctx ? status
                                                  : bst_fail(ctx, status, "%s", own->message);
}

/* Releases the resources that a message of a channel owns, such as the frame buffer. */
static void release_slot(const channel *ch, slot *s) {
    if (s->owned && ch->type->release) {
        ch->type->release(s->payload);
    }
    s->owned = false;
}

/* Makes the step of a module instance fail when the step returns. */
static void fail_in_step(struct bst_step *step, const char *what) {
    if (step->hook_status == BST_OK) {
        step->hook_status = bst_fail(step->ctx, BST_ERR_STATE, "%s %s", step->self->name, what);
    }
}

void bst_step_set_lookahead(struct bst_step *step, int port_index, int64_t tick) {
    port_state *port = &step->self->ports[port_index];
    if (!(step->self->spec.desc->flags & BST_MODULE_HAS_LOOKAHEAD)) {
        fail_in_step(step, "sets a lookahead without the flag BST_MODULE_HAS_LOOKAHEAD");
    }
    port->silent_until = tick > port->silent_until ? tick : port->silent_until;
}

/* upper limit of a payload that is copied without the frame that it owns */
enum { BARE_BYTES = 256 };

/* Passes a published message to the engine's observers, or logs it if the executor runs. */
static bst_status notify(struct bst_step *step, channel *ch, const void *payload) {
    bst_engine *engine = step->engine;
    const bst_engine_hooks *hooks = &engine->hooks;
    if (!hooks->message || step->tick < ch->mark.unwanted_before ||
        (hooks->wants && !bst_observers_want(engine, ch, payload, step->tick))) {
        return BST_OK;
    }
    _Alignas(max_align_t) char bare[BARE_BYTES];
    if (ch->mark.bare && ch->type->release && ch->payload_bytes <= sizeof bare) {
        memcpy(bare, payload, ch->payload_bytes);
        ch->type->retain(bare);
        ch->type->release(bare); /* the reference that the copy has taken */
        payload = bare;
    }
    if (engine->executor) {
        return bst_observers_message(step, ch, payload);
    }
    return bst_engine_heard(
        step->ctx, engine,
        hooks->message(hooks->user, ch->scope, ch->type->name, payload, step->tick));
}

/* Schedules the reader of a message for the tick at which the message becomes visible to it. */
static bst_status reach(struct bst_step *step, const channel *ch, const slot *s,
                        channel_reader reader) {
    bst_engine *engine = step->engine;
    const instance *other = engine->instances[reader.instance];
    const port_state *port = &other->ports[reader.port];
    if (port->copies != BST_COPY_NONE) {
        return bst_process_reach(step, ch, s, reader);
    }
    if (bst_instance_port(other, reader.port)->flags & BST_PORT_TRIGGER) {
        int64_t visible = step->tick + port->delay_ticks;
        if (visible < engine->due[reader.instance]) {
            bst_engine_set_due(engine, reader.instance, visible);
        }
    }
    return BST_OK;
}

/* Checks a message of a plug-in. Built-in modules assert what holds of theirs
 * (sim/messages/message_invariants.h). */
static bst_status check_message(struct bst_step *step, const channel *ch, const void *payload) {
    if (!step->self->spec.plugin) {
        return BST_OK;
    }
    bst_link_type type = bst_wire_type_of(ch->type->name);
    if (type == BST_LINK_TYPES) {
        return BST_OK;
    }
    bst_status status =
        bst_wire_check_struct(step->ctx, bst_wire_message_of(type), payload, ch->capacity);
    return status == BST_OK
               ? BST_OK
               : bst_fail_prefix(step->ctx, BST_ERR_STATE, "%s: its plug-in wrote a wrong message",
                                 step->self->name);
}

/* Publishes what a module instance has written to an output port. */
static bst_status publish(struct bst_step *step, int port_index) {
    bst_engine *engine = step->engine;
    channel *ch = &engine->channels[step->self->ports[port_index].channel];
    slot *s = &ch->log.slots[ch->log.head];
    BST_TRY(check_message(step, ch, s->payload));
    s->written_tick = step->tick;
    s->sequence = ch->log.written;
    s->owned = ch->type->release != NULL;
    bst_log_advance(&ch->log);
    step->self->ports[port_index].writing = false;
    step->writing--;
    if (ch->paced) {
        bst_pacing_done(step, ch, s->payload);
    }
    for (int r = 0; (ch->triggers || ch->crosses) && r < ch->reader_count; r++) {
        BST_TRY(reach(step, ch, s, ch->readers[r]));
    }
    return notify(step, ch, s->payload);
}

bst_status bst_engine_commit(struct bst_step *step) {
    BST_TRY(step->hook_status);
    for (int p = 0; step->writing > 0; p++) {
        if (step->self->ports[p].writing) {
            BST_TRY(publish(step, p));
        }
    }
    return BST_OK;
}

void *bst_step_write(struct bst_step *step, int port_index, int *capacity) {
    port_state *port = &step->self->ports[port_index];
    channel *ch = &step->engine->channels[port->channel];
    if (step->tick < port->silent_until) {
        fail_in_step(step, "writes an output within its own lookahead");
    }
    if (port->writing) {
        /* a second message in one step: the first one is published now */
        bst_status status = publish(step, port_index);
        if (step->hook_status == BST_OK) {
            step->hook_status = status;
        }
    }
    slot *s = &ch->log.slots[ch->log.head];
    release_slot(ch, s);
    if (ch->type->kind == BST_CHANNEL_LATEST && ch->log.depth > 1 && ch->log.written > 0) {
        memcpy(s->payload, bst_log_slot(&ch->log, ch->log.written - 1)->payload, ch->payload_bytes);
    }
    port->writing = true;
    step->writing++;
    if (capacity) {
        *capacity = ch->capacity;
    }
    return s->payload;
}

void *bst_step_modify(struct bst_step *step, int port_index) {
    const port_state *port = &step->self->ports[port_index];
    if (port->channel < 0) {
        return NULL;
    }
    const channel *ch = &step->engine->channels[port->channel];
    if (ch->log.written == 0) {
        return NULL;
    }
    slot *s = bst_log_slot(&ch->log, ch->log.written - 1);
    return s->written_tick == step->tick ? s->payload : NULL;
}

/* Frames go back to their pool as soon as every reader has read them, or has a copy. */
void bst_engine_release_read(bst_engine *engine, int process) {
    for (int k = 0; k < engine->releasable_count; k++) {
        channel *ch = &engine->channels[engine->releasable[k]];
        if (ch->process != process || ch->released == ch->log.written) {
            continue;
        }
        int64_t read_by_all = ch->log.written - engine->holds_frames;
        for (int r = 0; r < ch->reader_count; r++) {
            const instance *other = engine->instances[ch->readers[r].instance];
            int p = ch->readers[r].port;
            const port_state *port = &other->ports[p];
            int64_t read = port->copies == BST_COPY_NONE ? port->cursor : port->copied;
            if (bst_instance_port(other, p)->direction == BST_PORT_IN && read < read_by_all) {
                read_by_all = read;
            }
        }
        if (ch->released < ch->log.oldest) {
            ch->released = ch->log.oldest; /* overwritten messages have already been released */
        }
        for (; ch->released < read_by_all; ch->released++) {
            release_slot(ch, bst_log_slot(&ch->log, ch->released));
        }
    }
}

void bst_step_wake_at(struct bst_step *step, int64_t tick) {
    if (step->self->spec.desc->flags & BST_MODULE_HAS_LOOKAHEAD) {
        fail_in_step(step,
                     "asks to be woken, which a module with BST_MODULE_HAS_LOOKAHEAD may not");
    } else if (tick > step->tick && tick < step->self->wake) {
        step->self->wake = tick;
    }
}

void bst_step_event(struct bst_step *step, const char *kind, const char *format, ...) {
    bst_engine *engine = step->engine;
    if (!engine->hooks.event) {
        return;
    }
    char text[400];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    bst_status status = engine->executor
                            ? bst_observers_event(step, kind, text)
                            : bst_engine_heard(step->ctx, engine,
                                               engine->hooks.event(engine->hooks.user, step->tick,
                                                                   step->self->name, kind, text));
    if (step->hook_status == BST_OK) {
        step->hook_status = status;
    }
}

void bst_step_count(struct bst_step *step, const char *what) {
    bst_engine_count(step->engine, what);
}

void bst_env_set_capacity(const bst_module_env *env, int port, int items) {
    instance *self = env->engine_private;
    self->ports[port].capacity = items;
}

bool bst_env_writes(const bst_module_env *env, int port) {
    const instance *self = env->engine_private;
    return self->ports[port].channel >= 0;
}

void bst_env_ignore(const bst_module_env *env, int port) {
    instance *self = env->engine_private;
    self->ports[port].channel = -1;
    int kept = 0;
    for (int t = 0; t < self->trigger_count; t++) {
        if (self->triggers[t] != port) {
            self->triggers[kept++] = self->triggers[t];
        }
    }
    self->trigger_count = kept;
}

const bst_camera *bst_env_camera(const bst_module_env *env) {
    return env->knowledge ? bst_knowledge_camera(env->knowledge) : NULL;
}

void bst_env_set_rate(const bst_module_env *env, double rate_hz) {
    instance *self = env->engine_private;
    self->own_rate_hz = rate_hz;
}
