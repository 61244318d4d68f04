#include <stdio.h>
#include <string.h>

#include "sim/engine/engine_internal.h"

void bst_engine_count(bst_engine *engine, const char *what) {
    for (int i = 0; i < engine->counter_count; i++) {
        if (strcmp(engine->counters[i].name, what) == 0) {
            engine->counters[i].count++;
            return;
        }
    }
    if (engine->counter_count < MAX_COUNTERS) {
        counter *c = &engine->counters[engine->counter_count++];
        snprintf(c->name, sizeof c->name, "%s", what);
        c->count = 1;
    }
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

static bst_sample sample_at(const struct bst_step *step, const channel *ch, const port_state *port,
                            int64_t sequence) {
    const slot *s = bst_engine_slot(ch, sequence);
    bst_sample sample = {s->payload, s->written_tick, sequence, false};
    if (port->max_age_ticks > 0 && step->tick - s->written_tick > port->max_age_ticks) {
        sample.stale = true;
        bst_engine_count(step->engine, "stale_input");
    }
    return sample;
}

bst_sample bst_step_latest(struct bst_step *step, int port_index) {
    const bst_sample none = {NULL, 0, -1, true};
    port_state *port = &step->self->ports[port_index];
    if (port->channel < 0) {
        return none;
    }
    const channel *ch = &step->engine->channels[port->channel];
    int64_t oldest = ch->written > ch->depth ? ch->written - ch->depth : 0;
    for (int64_t sequence = ch->written - 1; sequence >= oldest; sequence--) {
        if (bst_engine_slot(ch, sequence)->written_tick + port->delay_ticks <= step->tick) {
            return sample_at(step, ch, port, sequence);
        }
    }
    return none;
}

bst_sample bst_step_next(struct bst_step *step, int port_index) {
    const bst_sample none = {NULL, 0, -1, true};
    port_state *port = &step->self->ports[port_index];
    if (port->channel < 0) {
        return none;
    }
    const channel *ch = &step->engine->channels[port->channel];
    int64_t oldest = ch->written > ch->depth ? ch->written - ch->depth : 0;
    while (port->cursor < oldest) {
        port->cursor++;
        bst_engine_count(step->engine, "queue_overflow");
    }
    if (port->cursor >= ch->written ||
        bst_engine_slot(ch, port->cursor)->written_tick + port->delay_ticks > step->tick) {
        return none;
    }
    return sample_at(step, ch, port, port->cursor++);
}

/* Lets go of what a slot owns. */
static void release_slot(const channel *ch, slot *s) {
    if (s->owned && ch->type->release) {
        ch->type->release(s->payload);
    }
    s->owned = false;
}

static bst_status publish(struct bst_step *step, int port_index) {
    bst_engine *engine = step->engine;
    channel *ch = &engine->channels[step->self->ports[port_index].channel];
    slot *s = &ch->slots[ch->head];
    s->written_tick = step->tick;
    s->owned = ch->type->release != NULL;
    ch->written++;
    ch->head = ch->head + 1 == ch->depth ? 0 : ch->head + 1;
    step->writing &= ~(1u << port_index);
    for (int r = 0; r < ch->reader_count; r++) {
        int index = ch->readers[r].instance, p = ch->readers[r].port;
        const instance *other = engine->instances[index];
        if (other->spec.desc->ports[p].flags & BST_PORT_TRIGGER) {
            int64_t visible = step->tick + other->ports[p].delay_ticks;
            if (visible < engine->due[index]) {
                bst_engine_set_due(engine, index, visible);
            }
        }
    }
    if (engine->hooks.message) {
        return engine->hooks.message(engine->hooks.user, ch->scope, ch->type->name, s->payload,
                                     step->tick);
    }
    return BST_OK;
}

bst_status bst_engine_commit(struct bst_step *step) {
    BST_TRY(step->hook_status);
    for (int p = 0; step->writing; p++) {
        if (step->writing & 1u << p) {
            BST_TRY(publish(step, p));
        }
    }
    return BST_OK;
}

void *bst_step_write(struct bst_step *step, int port_index, int *capacity) {
    const port_state *port = &step->self->ports[port_index];
    channel *ch = &step->engine->channels[port->channel];
    if (step->writing & 1u << port_index) {
        /* a second message in one step: the first goes out */
        bst_status status = publish(step, port_index);
        if (step->hook_status == BST_OK) {
            step->hook_status = status;
        }
    }
    slot *s = &ch->slots[ch->head];
    release_slot(ch, s);
    if (ch->type->kind == BST_CHANNEL_LATEST && ch->depth > 1 && ch->written > 0) {
        memcpy(s->payload, bst_engine_slot(ch, ch->written - 1)->payload, ch->payload_bytes);
    }
    step->writing |= 1u << port_index;
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
    if (ch->written == 0) {
        return NULL;
    }
    slot *s = bst_engine_slot(ch, ch->written - 1);
    return s->written_tick == step->tick ? s->payload : NULL;
}

/* Frames go back to their pool as soon as every reader has read them. */
void bst_engine_release_read(bst_engine *engine) {
    for (int k = 0; k < engine->releasable_count; k++) {
        channel *ch = &engine->channels[engine->releasable[k]];
        if (ch->released == ch->written) {
            continue;
        }
        int64_t read_by_all = ch->written;
        for (int r = 0; r < ch->reader_count; r++) {
            const instance *other = engine->instances[ch->readers[r].instance];
            int p = ch->readers[r].port;
            if (other->spec.desc->ports[p].direction == BST_PORT_IN &&
                other->ports[p].cursor < read_by_all) {
                read_by_all = other->ports[p].cursor;
            }
        }
        int64_t oldest = ch->written - ch->depth;
        if (ch->released < oldest) {
            ch->released = oldest; /* writing over them has let them go */
        }
        for (; ch->released < read_by_all; ch->released++) {
            release_slot(ch, bst_engine_slot(ch, ch->released));
        }
    }
}

void bst_step_wake_at(struct bst_step *step, int64_t tick) {
    if (tick > step->tick && tick < step->self->wake) {
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
    bst_status status =
        engine->hooks.event(engine->hooks.user, step->tick, step->self->name, kind, text);
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

void bst_env_set_rate(const bst_module_env *env, double rate_hz) {
    instance *self = env->engine_private;
    self->own_rate_hz = rate_hz;
}
