/* Which instances may be deferred: stepped after all others of a tick, in a logical process of
 * their own. */
#include <string.h>

#include "sim/engine/kernel/engine_internal.h"

/* Checks the flags and ports of a module instance: can it step after all others of a tick? */
static bool may_be_deferred(const bst_engine *engine, const instance *self) {
    if (!(self->spec.desc->flags & BST_MODULE_DEFERRABLE) || self->spec.period_ticks > 0 ||
        self->trigger_count == 0 || self->spec.member_count > 0) {
        return false;
    }
    for (int p = 0; p < self->port_count; p++) {
        const bst_port *port = bst_instance_port(self, p);
        const port_state *state = &self->ports[p];
        if (state->channel < 0) {
            continue;
        }
        const channel *ch = &engine->channels[state->channel];
        const instance *writer = engine->instances[ch->writer];
        bool trigger = port->flags & BST_PORT_TRIGGER;
        if (port->direction == BST_PORT_MODIFY ||
            (port->direction == BST_PORT_OUT && (ch->type->release || ch->type->lends))) {
            return false;
        }
        /* Inputs must become visible only at ticks that the process of the sensor knows
         * in advance. */
        if (port->direction == BST_PORT_IN &&
            (writer->deferred ? trigger && state->delay_ticks > 0
                              : ch->type->kind == BST_CHANNEL_QUEUE && !trigger)) {
            return false;
        }
        if (trigger && writer->spec.member_count > 0) {
            return false;
        }
    }
    return true;
}

/* Checks whether an instance that is not deferred reads an output of this instance. */
static bool has_prompt_reader(const bst_engine *engine, int index) {
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *other = engine->instances[i];
        for (int p = 0; !other->deferred && p < other->port_count; p++) {
            int c = other->ports[p].channel;
            if (c >= 0 && engine->channels[c].writer == index) {
                return true;
            }
        }
    }
    return false;
}

/* Moves deferred instances to the end of the stepping order and renumbers the writers
 * of channels. */
static void move_deferred_last(bst_engine *engine) {
    for (int i = 1; i < engine->instance_count; i++) {
        for (int k = i;
             k > 0 && engine->instances[k - 1]->deferred && !engine->instances[k]->deferred; k--) {
            instance *swap = engine->instances[k];
            engine->instances[k] = engine->instances[k - 1];
            engine->instances[k - 1] = swap;
            for (int c = 0; c < engine->channel_count; c++) {
                int *writer = &engine->channels[c].writer;
                *writer = *writer == k ? k - 1 : *writer == k - 1 ? k : *writer;
            }
        }
    }
}

void bst_engine_set_deferred(bst_engine *engine) {
    for (int i = 0; i < engine->instance_count; i++) {
        engine->instances[i]->deferred =
            engine->instances[i]->spec.desc->flags & BST_MODULE_DEFERRABLE;
    }
    for (bool changed = true; changed;) {
        changed = false;
        for (int i = 0; i < engine->instance_count; i++) {
            instance *self = engine->instances[i];
            if (self->deferred &&
                (!may_be_deferred(engine, self) || has_prompt_reader(engine, i))) {
                self->deferred = false;
                changed = true;
            }
        }
    }
    move_deferred_last(engine);
    for (int i = 0; i < engine->instance_count; i++) {
        engine->instances[i]->order = i;
    }
}
