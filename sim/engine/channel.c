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
    const slot *s = &ch->slots[sequence % ch->depth];
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
        if (ch->slots[sequence % ch->depth].written_tick + port->delay_ticks <= step->tick) {
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
    port->uses_next = true;
    while (port->cursor < oldest) {
        port->cursor++;
        bst_engine_count(step->engine, "queue_overflow");
    }
    if (port->cursor >= ch->written ||
        ch->slots[port->cursor % ch->depth].written_tick + port->delay_ticks > step->tick) {
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

static bst_status commit_port(struct bst_step *step, int port_index) {
    bst_engine *engine = step->engine;
    port_state *port = &step->self->ports[port_index];
    channel *ch = &engine->channels[port->channel];
    slot *s = &ch->slots[ch->written % ch->depth];
    s->written_tick = step->tick;
    s->owned = ch->type->release != NULL;
    ch->written++;
    port->writing = false;
    for (int i = 0; i < engine->instance_count; i++) {
        instance *reader = engine->instances[i];
        for (int p = 0; p < reader->spec.desc->port_count; p++) {
            port_state *in = &reader->ports[p];
            if (in->channel != port->channel ||
                !(reader->spec.desc->ports[p].flags & BST_PORT_TRIGGER)) {
                continue;
            }
            if (in->trigger_count == TRIGGER_RING) {
                bst_engine_count(engine, "trigger_overflow");
                continue;
            }
            in->trigger[(in->trigger_head + in->trigger_count) % TRIGGER_RING] =
                step->tick + in->delay_ticks;
            in->trigger_count++;
            reader->due = bst_engine_due(reader);
        }
    }
    if (engine->hooks.message) {
        return engine->hooks.message(engine->hooks.user, ch->scope, ch->type->name, s->payload,
                                     step->tick);
    }
    return BST_OK;
}

bst_status bst_engine_commit(struct bst_step *step) {
    const bst_module_desc *desc = step->self->spec.desc;
    BST_TRY(step->hook_status);
    for (int p = 0; p < desc->port_count; p++) {
        if (step->self->ports[p].writing) {
            BST_TRY(commit_port(step, p));
        }
    }
    return BST_OK;
}

void *bst_step_write(struct bst_step *step, int port_index, int *capacity) {
    port_state *port = &step->self->ports[port_index];
    channel *ch = &step->engine->channels[port->channel];
    if (port->writing) {
        /* a second message in one step: the first goes out */
        bst_status status = commit_port(step, port_index);
        if (step->hook_status == BST_OK) {
            step->hook_status = status;
        }
    }
    slot *s = &ch->slots[ch->written % ch->depth];
    release_slot(ch, s);
    if (ch->type->kind == BST_CHANNEL_LATEST && ch->depth > 1 && ch->written > 0) {
        const slot *previous = &ch->slots[(ch->written - 1) % ch->depth];
        memcpy(s->payload, previous->payload,
               ch->type->header_bytes + ch->type->item_bytes * (size_t)ch->capacity);
    }
    port->writing = true;
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
    slot *s = &ch->slots[(ch->written - 1) % ch->depth];
    return s->written_tick == step->tick ? s->payload : NULL;
}

/* Frames go back to their pool as soon as every reader has read them. */
void bst_engine_release_read(bst_engine *engine) {
    for (int c = 0; c < engine->channel_count; c++) {
        channel *ch = &engine->channels[c];
        if (!ch->type->release || ch->released == ch->written) {
            continue;
        }
        int64_t read_by_all = ch->written;
        for (int i = 0; i < engine->instance_count; i++) {
            const instance *reader = engine->instances[i];
            for (int p = 0; p < reader->spec.desc->port_count; p++) {
                const port_state *port = &reader->ports[p];
                if (port->channel == c && reader->spec.desc->ports[p].direction == BST_PORT_IN &&
                    port->cursor < read_by_all) {
                    read_by_all = port->cursor;
                }
            }
        }
        int64_t oldest = ch->written > ch->depth ? ch->written - ch->depth : 0;
        if (ch->released < oldest) {
            ch->released = oldest;
        }
        for (; ch->released < read_by_all; ch->released++) {
            release_slot(ch, &ch->slots[ch->released % ch->depth]);
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
