#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"
#include "sim/engine/kernel/engine_internal.h"

static int find_channel(const bst_engine *engine, const char *scope, const bst_channel_type *type) {
    for (int i = 0; i < engine->channel_count; i++) {
        if (engine->channels[i].type == type && strcmp(engine->channels[i].scope, scope) == 0) {
            return i;
        }
    }
    return -1;
}

static int by_name(const void *a, const void *b) {
    return strcmp((*(instance *const *)a)->name, (*(instance *const *)b)->name);
}

/* Lists the channels that instances write. */
static bst_status list_channels(bst_ctx *ctx, bst_engine *engine) {
    int most = 0;
    for (int i = 0; i < engine->instance_count; i++) {
        most += engine->instances[i]->port_count;
    }
    engine->channels = calloc((size_t)most + 1, sizeof *engine->channels);
    if (!engine->channels) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for channels");
    }
    /* optional writers, which yield to others, come last */
    for (int k = 0; k < 2 * engine->instance_count; k++) {
        int i = k % engine->instance_count;
        bool yields = k >= engine->instance_count;
        instance *writer = engine->instances[i];
        for (int p = 0; p < writer->port_count; p++) {
            const bst_port *port = bst_instance_port(writer, p);
            if (port->direction != BST_PORT_OUT ||
                yields != ((port->flags & BST_PORT_OPTIONAL) != 0)) {
                continue;
            }
            const bst_channel_type *type = bst_channel_type_find(port->channel);
            if (!type) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: writes the channel \"%s\", which does not exist", writer->name,
                                port->channel);
            }
            const char *scope = bst_instance_port_scope(writer, p);
            int known = find_channel(engine, scope, type);
            if (known >= 0 && yields) {
                continue;
            }
            if (known >= 0) {
                return bst_fail(ctx, BST_ERR_CONFIG, "%s and %s both write the channel %s/%s",
                                engine->instances[engine->channels[known].writer]->name,
                                writer->name, scope, type->name);
            }
            engine->channels[engine->channel_count] =
                (channel){.type = type, .scope = scope, .writer = i, .writer_port = p};
            writer->ports[p].channel = engine->channel_count++;
            writer->ports[p].capacity = port->capacity;
        }
    }
    return BST_OK;
}

static int64_t declared_delay(const bst_instance_spec *spec, int port) {
    for (int i = 0; i < spec->delay_count; i++) {
        if (spec->delays[i].port == port) {
            return spec->delays[i].ticks;
        }
    }
    return 0;
}

static bst_status connect_inputs(bst_ctx *ctx, bst_engine *engine) {
    for (int i = 0; i < engine->instance_count; i++) {
        instance *reader = engine->instances[i];
        for (int p = 0; p < reader->port_count; p++) {
            const bst_port *port = bst_instance_port(reader, p);
            if (port->direction == BST_PORT_OUT) {
                continue;
            }
            port_state *state = &reader->ports[p];
            const bst_channel_type *type = bst_channel_type_find(port->channel);
            const char *scope = bst_instance_port_scope(reader, p);
            state->channel = type ? find_channel(engine, scope, type) : -1;
            if (state->channel < 0) {
                if (port->flags & BST_PORT_OPTIONAL) {
                    continue;
                }
                const char *writers = bst_channel_writers(port->channel);
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: reads the channel %s/%s, which no module writes; add the "
                                "module that makes it%s%s",
                                reader->name, scope, port->channel, writers ? ": " : "",
                                writers ? writers : "");
            }
            state->delay_ticks = declared_delay(&reader->spec, p % reader->spec.desc->port_count);
            if (state->delay_ticks < 1 && (port->flags & BST_PORT_FEEDBACK)) {
                state->delay_ticks = 1;
            }
            if (state->delay_ticks > 0 && port->direction == BST_PORT_MODIFY) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: %s is changed in place and takes no delay", reader->name,
                                type->name);
            }
            if (port->flags & BST_PORT_TRIGGER) {
                assert(reader->trigger_count < reader->port_count);
                reader->triggers[reader->trigger_count++] = p;
            }
            if (state->delay_ticks > 0 && type->in_place) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: %s is extended in place and cannot be read with a delay",
                                reader->name, type->name);
            }
            if (port->max_age_s > 0.0) {
                state->max_age_ticks =
                    (int64_t)(port->max_age_s * (double)engine->tick_rate_hz + 0.5);
            }
        }
    }
    return BST_OK;
}

/* Checks whether instance b must step after instance a within a tick. */
static bool must_follow(const bst_engine *engine, int a, int b) {
    const instance *later = engine->instances[b], *earlier = engine->instances[a];
    for (int p = 0; p < later->port_count; p++) {
        const bst_port *port = bst_instance_port(later, p);
        const port_state *state = &later->ports[p];
        if (port->direction == BST_PORT_OUT || state->channel < 0) {
            continue;
        }
        if (port->direction == BST_PORT_IN && state->delay_ticks > 0) {
            continue;
        }
        if (engine->channels[state->channel].writer == a) {
            return true;
        }
        if (port->direction != BST_PORT_IN || a == b) {
            continue;
        }
        /* readers step after the instances that modify the message */
        for (int q = 0; q < earlier->port_count; q++) {
            if (bst_instance_port(earlier, q)->direction == BST_PORT_MODIFY &&
                earlier->ports[q].channel == state->channel) {
                return true;
            }
        }
    }
    return false;
}

/* Reports an undeclared cycle of instances: follows predecessors until one repeats. */
static bst_status report_cycle(bst_ctx *ctx, const bst_engine *engine, const bool *placed) {
    int n = engine->instance_count;
    int *path = calloc((size_t)n + 1, sizeof *path);
    if (!path) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    int length = 0, current = 0, repeated = -1;
    while (placed[current]) {
        current++;
    }
    while (repeated < 0) {
        assert(length < engine->instance_count);
        path[length++] = current;
        for (int a = 0; a < n; a++) {
            if (!placed[a] && must_follow(engine, a, current)) {
                current = a;
                break;
            }
        }
        for (int k = 0; k < length; k++) {
            if (path[k] == current) {
                repeated = k;
            }
        }
    }
    char text[700] = "";
    snprintf(text, sizeof text, "%s", engine->instances[current]->name);
    for (int k = length - 1; k >= repeated; k--) {
        size_t used = strlen(text);
        snprintf(text + used, sizeof text - used, " -> %s", engine->instances[path[k]]->name);
    }
    free(path);
    return bst_fail(
        ctx, BST_ERR_CONFIG,
        "modules wait for each other within one tick: %s; give one of these inputs a delay_s",
        text);
}

static bst_status sort_instances(bst_ctx *ctx, bst_engine *engine) {
    int n = engine->instance_count;
    bool *placed = calloc((size_t)n + 1, sizeof *placed);
    int *order =
        calloc((size_t)n + 1, sizeof *order); /* order[k]: previous index of the k-th instance */
    instance **sorted = calloc((size_t)n + 1, sizeof *sorted);
    bst_status status = placed && order && sorted
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d modules", n);
    for (int k = 0; status == BST_OK && k < n; k++) {
        int next = -1;
        for (int b = 0; b < n && next < 0; b++) {
            bool ready = !placed[b];
            for (int a = 0; a < n && ready; a++) {
                ready = placed[a] || !must_follow(engine, a, b);
            }
            next = ready ? b : -1;
        }
        if (next < 0) {
            status = report_cycle(ctx, engine, placed);
            break;
        }
        placed[next] = true;
        order[k] = next;
        sorted[k] = engine->instances[next];
    }
    if (status == BST_OK) {
        for (int c = 0; c < engine->channel_count; c++) {
            for (int k = 0; k < n; k++) {
                if (order[k] == engine->channels[c].writer) {
                    engine->channels[c].writer = k;
                    break;
                }
            }
        }
        memcpy(engine->instances, sorted, (size_t)n * sizeof *sorted);
    }
    free(placed);
    free(order);
    free(sorted);
    return status;
}

bst_status bst_engine_wire(bst_ctx *ctx, bst_engine *engine) {
    if (engine->instance_count == 0) {
        return BST_OK;
    }
    qsort(engine->instances, (size_t)engine->instance_count, sizeof *engine->instances, by_name);
    for (int i = 1; i < engine->instance_count; i++) {
        if (strcmp(engine->instances[i - 1]->name, engine->instances[i]->name) == 0) {
            return bst_fail(ctx, BST_ERR_CONFIG, "two modules are named %s",
                            engine->instances[i]->name);
        }
    }
    BST_TRY(list_channels(ctx, engine));
    BST_TRY(connect_inputs(ctx, engine));
    return sort_instances(ctx, engine);
}

/* Estimates the step rate of each instance from its period and its triggers. A few iterations
 * suffice because trigger chains are short; they may include delayed inputs. */
static void settle_rates(bst_engine *engine) {
    for (int round = 0; round < 8; round++) {
        for (int i = 0; i < engine->instance_count; i++) {
            instance *self = engine->instances[i];
            double rate = self->own_rate_hz;
            if (self->spec.period_ticks > 0) {
                rate += (double)engine->tick_rate_hz / (double)self->spec.period_ticks;
            }
            for (int t = 0; t < self->trigger_count; t++) {
                rate += engine->channels[self->ports[self->triggers[t]].channel].rate_hz;
            }
            self->rate_hz = rate;
            for (int p = 0; p < self->port_count; p++) {
                if (bst_instance_port(self, p)->direction == BST_PORT_OUT) {
                    engine->channels[self->ports[p].channel].rate_hz = rate;
                }
            }
        }
    }
}

/* Lists the readers of each channel, and the channels whose messages own frames. */
static bst_status list_readers(bst_ctx *ctx, bst_engine *engine) {
    int most = 0;
    for (int i = 0; i < engine->instance_count; i++) {
        most += engine->instances[i]->port_count;
    }
    engine->readers = calloc((size_t)most + 1, sizeof *engine->readers);
    engine->releasable = calloc((size_t)engine->channel_count + 1, sizeof *engine->releasable);
    if (!engine->readers || !engine->releasable) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for channels");
    }
    channel_reader *next = engine->readers;
    for (int c = 0; c < engine->channel_count; c++) {
        channel *ch = &engine->channels[c];
        if (ch->type->release) {
            engine->releasable[engine->releasable_count++] = c;
        }
        ch->readers = next;
        for (int i = 0; i < engine->instance_count; i++) {
            const instance *self = engine->instances[i];
            for (int p = 0; p < self->port_count; p++) {
                if (bst_instance_port(self, p)->direction != BST_PORT_OUT &&
                    self->ports[p].channel == c) {
                    *next++ = (channel_reader){i, p};
                    ch->triggers |= (bst_instance_port(self, p)->flags & BST_PORT_TRIGGER) != 0;
                }
            }
        }
        ch->reader_count = (int)(next - ch->readers);
    }
    return BST_OK;
}

/* Longest time in seconds that a message must be kept for this reader. */
static double longest_wait_s(const bst_engine *engine, const channel *ch, channel_reader r) {
    const instance *self = engine->instances[r.instance];
    double wait = (double)self->ports[r.port].delay_ticks / (double)engine->tick_rate_hz;
    bool triggered = bst_instance_port(self, r.port)->flags & BST_PORT_TRIGGER;
    if (ch->type->kind == BST_CHANNEL_QUEUE && !triggered && self->rate_hz > 0.0) {
        wait += 1.0 / self->rate_hz;
    }
    return wait;
}

static bst_status allocate_channel(bst_ctx *ctx, const bst_engine *engine, channel *ch) {
    double waiting = 0.0;
    for (int r = 0; r < ch->reader_count; r++) {
        waiting = fmax(waiting, ch->rate_hz * longest_wait_s(engine, ch, ch->readers[r]));
    }
    if (waiting > 1e5) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s/%s: %.0f messages would wait for a reader (allowed: 100000); shorten "
                        "the delay or the rates' ratio",
                        ch->scope, ch->type->name, waiting);
    }
    /* delay / period + 1, one for the message being written and one for a later writer in
     * the tick */
    ch->log.depth = ch->type->in_place ? 1 : (int)ceil(waiting) + 3;
    ch->capacity = engine->instances[ch->writer]->ports[ch->writer_port].capacity;
    ch->payload_bytes = ch->type->header_bytes + ch->type->item_bytes * (size_t)ch->capacity;
    ch->log.slots = calloc((size_t)ch->log.depth, sizeof *ch->log.slots);
    bool enough = ch->log.slots != NULL;
    for (int s = 0; enough && s < ch->log.depth; s++) {
        ch->log.slots[s].payload = bst_pages_zero(1, ch->payload_bytes);
        enough = ch->log.slots[s].payload != NULL;
    }
    for (int r = 0; r < ch->reader_count; r++) {
        const channel_reader *reader = &ch->readers[r];
        engine->instances[reader->instance]->ports[reader->port].log = &ch->log;
    }
    return enough ? BST_OK
                  : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the channel %s/%s", ch->scope,
                             ch->type->name);
}

bst_status bst_engine_allocate_channels(bst_ctx *ctx, bst_engine *engine) {
    BST_TRY(list_readers(ctx, engine));
    settle_rates(engine);
    for (int c = 0; c < engine->channel_count; c++) {
        BST_TRY(allocate_channel(ctx, engine, &engine->channels[c]));
    }
    return BST_OK;
}
