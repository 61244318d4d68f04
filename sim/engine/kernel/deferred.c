/* Which instances may step behind the stepping thread. */
#include <string.h>

#include "sim/engine/kernel/engine_internal.h"

static bool may_be_apart(const bst_engine *engine, const instance *self) {
    if (!(self->spec.desc->flags & BST_MODULE_APART) || self->spec.period_ticks > 0 ||
        self->trigger_count == 0) {
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
            (port->direction == BST_PORT_OUT && ch->type->release)) {
            return false;
        }
        /* behind, a trigger of their own is looked at only in the tick of what set it off */
        if (port->direction == BST_PORT_IN &&
            (writer->apart ? trigger && state->delay_ticks > 0
                           : ch->type->kind == BST_CHANNEL_QUEUE && !trigger)) {
            return false;
        }
    }
    return true;
}

/* Whether an instance that is not apart reads what this one writes. */
static bool awaited(const bst_engine *engine, int index) {
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *other = engine->instances[i];
        for (int p = 0; !other->apart && p < other->port_count; p++) {
            int c = other->ports[p].channel;
            if (c >= 0 && engine->channels[c].writer == index) {
                return true;
            }
        }
    }
    return false;
}

static void put_last(bst_engine *engine) {
    for (int i = 1; i < engine->instance_count; i++) {
        for (int k = i; k > 0 && engine->instances[k - 1]->apart && !engine->instances[k]->apart;
             k--) {
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

void bst_engine_set_apart(bst_engine *engine) {
    for (int i = 0; i < engine->instance_count; i++) {
        engine->instances[i]->apart = engine->instances[i]->spec.desc->flags & BST_MODULE_APART;
    }
    for (bool changed = true; changed;) {
        changed = false;
        for (int i = 0; i < engine->instance_count; i++) {
            instance *self = engine->instances[i];
            if (self->apart && (!may_be_apart(engine, self) || awaited(engine, i))) {
                self->apart = false;
                changed = true;
            }
        }
    }
    put_last(engine);
    for (int c = 0; c < engine->channel_count; c++) {
        engine->channels[c].apart = engine->instances[engine->channels[c].writer]->apart;
    }
}
