/* Partitions module instances into logical processes and connects their inputs. Sensors get
 * separate processes if only delayed outputs of multi-sensor modules connect them. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/kernel/executor_internal.h"

static bool is_multi_sensor(const instance *self) {
    return self->spec.member_count > 0;
}

static bool belongs_to_sensor(const instance *self) {
    return !self->deferred && !is_multi_sensor(self);
}

/* True if a module modifies messages of the channel. */
static bool is_modified(const bst_engine *engine, const channel *ch) {
    for (int r = 0; r < ch->reader_count; r++) {
        const channel_reader *reader = &ch->readers[r];
        const instance *self = engine->instances[reader->instance];
        if (bst_instance_port(self, reader->port)->direction == BST_PORT_MODIFY) {
            return true;
        }
    }
    return false;
}

/* Checks whether an input permits a separate process: an input of a sensor's module is from its own
 * sensor, or delayed from a multi-sensor module; an input of a multi-sensor module is
 * no trigger. */
static bool can_cross(const bst_engine *engine, const instance *self, int p) {
    const bst_port *port = bst_instance_port(self, p);
    const channel *ch = &engine->channels[self->ports[p].channel];
    if (is_multi_sensor(self)) {
        return port->direction == BST_PORT_IN && !(port->flags & BST_PORT_TRIGGER);
    }
    return !is_multi_sensor(engine->instances[ch->writer]) ||
           (port->direction == BST_PORT_IN && self->ports[p].delay_ticks > 0 &&
            !ch->type->in_place && !is_modified(engine, ch));
}

/* Checks whether the sensors of an engine can be stepped in separate logical processes. */
static bool can_separate(const bst_engine *engine) {
    const char *scope = NULL;
    bool several = false;
    for (int i = 0; i < engine->instance_count; i++) {
        const instance *self = engine->instances[i];
        if (self->spec.desc->flags & BST_MODULE_NEEDS_LINK) {
            return false; /* one connection to another program serves all sensors */
        }
        if (belongs_to_sensor(self)) {
            several |= scope && strcmp(scope, self->scope) != 0;
            scope = self->scope;
        }
        for (int p = 0; p < self->port_count; p++) {
            const port_state *port = &self->ports[p];
            const channel *ch = port->channel >= 0 ? &engine->channels[port->channel] : NULL;
            bool output = bst_instance_port(self, p)->direction == BST_PORT_OUT;
            /* a lending writer waits in its step for observers: only one process may do so */
            if (ch &&
                (output ? ch->type->lends && self->spec.planes : !can_cross(engine, self, p))) {
                return false;
            }
        }
    }
    return several && !engine->pacing;
}

/* Number of the process of an earlier instance with the same scope; -1: none. */
static int find_process(const bst_engine *engine, int before, const char *scope, bool deferred) {
    for (int i = 0; i < before; i++) {
        const instance *other = engine->instances[i];
        if (other->deferred == deferred && !is_multi_sensor(other) &&
            strcmp(other->scope, scope) == 0) {
            return other->process;
        }
    }
    return -1;
}

/* Assigns a process to each instance: first sensors, then multi-sensor modules, then deferred
 * modules. Returns the number of processes. */
static int number_processes(bst_executor *x, bool separate) {
    bst_engine *engine = x->engine;
    int count = 0;
    x->link = -1;
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (belongs_to_sensor(self)) {
            int known = separate ? find_process(engine, i, self->scope, false) : 0;
            self->process = known >= 0 ? known : count;
            count = self->process >= count ? self->process + 1 : count;
        }
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (is_multi_sensor(self)) {
            x->link = separate && x->link < 0 ? count++ : x->link;
            self->process = separate ? x->link : 0;
            count = count > 0 ? count : 1;
        }
    }
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (self->deferred) {
            int known = find_process(engine, i, self->scope, true);
            self->process = known >= 0 ? known : count++;
        }
    }
    return count;
}

/* Kind of logical process an instance belongs to. */
static process_kind kind_of(const bst_executor *x, const instance *self) {
    return self->deferred                             ? BST_PROCESS_DEFERRED
           : x->link >= 0 && self->process == x->link ? BST_PROCESS_LINK
                                                      : BST_PROCESS_SENSORS;
}

static bst_status fill_process(bst_ctx *ctx, bst_executor *x, int number) {
    bst_engine *engine = x->engine;
    logical_process *self = &x->processes[number];
    size_t room = (size_t)engine->instance_count + 1, ports = 1;
    bst_ctx_init(&self->ctx, ctx->log, ctx->log_user, ctx->log_level);
    self->last_tick = -1;
    self->source = self->looker = self->follower = self->next_follower = -1;
    self->sample_due = INT64_MAX;
    self->last_numbered_tick = INT64_MIN;
    self->members = calloc(room, sizeof *self->members);
    self->heap.items = calloc(room, sizeof *self->heap.items);
    for (int i = 0; self->members && self->heap.items && i < engine->instance_count; i++) {
        instance *member = engine->instances[i];
        if (member->process == number) {
            self->kind = kind_of(x, member);
            assert((size_t)self->member_count < room);
            self->members[self->member_count++] = i;
            ports += (size_t)member->port_count;
            member->heap = &self->heap;
            engine->place[i] = self->heap.count;
            self->heap.items[self->heap.count++] = i;
            bst_engine_set_due(engine, i, engine->due[i]);
        }
    }
    self->inputs = calloc(ports, sizeof *self->inputs);
    bool enough = self->members && self->heap.items && self->inputs;
    self->order = enough && self->member_count > 0 ? self->members[0] : 0;
    self->horizon = enough && self->heap.count > 0 ? engine->due[self->heap.items[0]] : INT64_MAX;
    return enough ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for logical processes");
}

/* Connects an input to another process: it gets a copy of the message log, which that process
 * fills. */
static bst_status connect(bst_ctx *ctx, bst_executor *x, instance *reader, int p) {
    bst_engine *engine = x->engine;
    port_state *port = &reader->ports[p];
    channel *ch = &engine->channels[port->channel];
    instance *writer = engine->instances[ch->writer];
    logical_process *self = &x->processes[reader->process], *from = &x->processes[writer->process];
    port->log = calloc(1, sizeof *port->log);
    if (!port->log) {
        port->log = &ch->log;
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for logical processes");
    }
    port->log->copied = true;
    port->log->frames = &from->frames;
    pthread_mutex_init(&port->log->lock, NULL);
    port->copies = from->kind == BST_PROCESS_LINK ? BST_COPY_EACH : BST_COPY_SAMPLED;
    ch->crosses = true;
    self->inputs[self->input_count++] = (process_input){.source = writer->process,
                                                        .mode = port->copies,
                                                        .output = &writer->ports[ch->writer_port],
                                                        .delay_ticks = port->delay_ticks};
    if (self->kind == BST_PROCESS_DEFERRED && from->kind == BST_PROCESS_SENSORS &&
        self->source < 0) {
        self->source = writer->process;
        self->next_follower = from->follower;
        from->follower = reader->process;
    }
    if (bst_instance_port(reader, p)->flags & BST_PORT_TRIGGER) {
        self->delivers = true;
    }
    from->linked |= self->kind == BST_PROCESS_LINK;
    return BST_OK;
}

/* ---- an engine that has already run: its state was restored ---- */

/* First message of a channel that an input still needs a copy of, and the end of those that exist
 * at this time. */
static void range_to_copy(bst_engine *engine, const channel *ch, port_state *port, int64_t *first,
                          int64_t *end) {
    const message_log *log = &ch->log;
    int64_t newest = bst_log_newest(log, port->delay_ticks, engine->tick);
    if (ch->type->kind == BST_CHANNEL_QUEUE) {
        (void)bst_log_unread(engine, log, &port->cursor, port->delay_ticks, engine->tick);
        *first = port->cursor;
    } else {
        *first = newest > log->oldest ? newest : log->oldest;
    }
    *end = port->copies == BST_COPY_EACH ? log->written : newest + 1;
    *end = *end > *first ? *end : *first;
}

static int64_t within(int64_t position, int64_t first, int64_t end) {
    return (position < first ? first : position > end ? end : position) - first;
}

/* Copies the messages that an input from another process has not read, and converts its cursors to
 * positions of the copy. */
static bst_status take_over(bst_ctx *ctx, bst_engine *engine, const channel *ch, port_state *port) {
    int64_t first, end;
    range_to_copy(engine, ch, port, &first, &end);
    for (int64_t k = first; k < end; k++) {
        BST_TRY(bst_log_copy(ctx, port->log, ch, bst_log_slot(&ch->log, k)));
    }
    port->copied = end;
    port->announced = port->trigger_cursor;
    port->cursor = within(port->cursor, first, end);
    port->trigger_cursor = within(port->trigger_cursor, first, end);
    return BST_OK;
}

/* Sets the clocks and the schedules of the processes to the state of the engine. */
static void continue_processes(bst_executor *x) {
    bst_engine *engine = x->engine;
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        bst_engine_set_due(engine, i, bst_engine_earliest(self));
        for (int p = 0; p < self->port_count; p++) {
            self->ports[p].lookahead = self->ports[p].silent_until;
        }
    }
    for (int k = 0; k < x->count; k++) {
        logical_process *self = &x->processes[k];
        self->clock = self->reached = engine->tick + 1;
        self->horizon = self->heap.count > 0 ? engine->due[self->heap.items[0]] : INT64_MAX;
        for (int m = 0; self->kind == BST_PROCESS_DEFERRED && m < self->member_count; m++) {
            const instance *member = engine->instances[self->members[m]];
            for (int t = 0; t < member->trigger_count; t++) {
                const port_state *port = &member->ports[member->triggers[t]];
                int64_t next = bst_log_next_visible(&engine->channels[port->channel].log,
                                                    port->announced, port->delay_ticks);
                if (port->copies == BST_COPY_SAMPLED && next < self->sample_due) {
                    self->sample_due = next;
                }
            }
        }
    }
}

/* Selects the first instance with `ahead` whose triggers all come from other processes. */
static bst_status find_looker(bst_ctx *ctx, bst_executor *x, logical_process *self) {
    for (int m = 0; m < self->member_count && self->looker < 0; m++) {
        const instance *member = x->engine->instances[self->members[m]];
        bool looks = member->spec.desc->ahead != NULL;
        for (int t = 0; t < member->trigger_count; t++) {
            looks = looks && member->ports[member->triggers[t]].copies != BST_COPY_NONE;
        }
        self->looker = looks ? self->members[m] : -1;
    }
    for (int k = 0; k < BST_STEP_LANES && self->looker >= 0; k++) {
        size_t ports = (size_t)x->engine->instances[self->looker]->port_count;
        self->cursors[k] = calloc(ports + 1, sizeof **self->cursors);
        if (!self->cursors[k]) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for logical processes");
        }
    }
    return BST_OK;
}

/* Checks whether all multi-sensor modules step periodically and declare a lookahead. */
static bool steps_by_periods(const bst_executor *x) {
    bool all = x->link >= 0;
    const logical_process *link = all ? &x->processes[x->link] : NULL;
    for (int m = 0; all && m < link->member_count; m++) {
        const bst_instance_spec *spec = &x->engine->instances[link->members[m]]->spec;
        all = spec->period_ticks > 0 && (spec->desc->flags & BST_MODULE_HAS_LOOKAHEAD);
    }
    return all;
}

bst_status bst_partition_make(bst_ctx *ctx, bst_executor *x, int threads) {
    bst_engine *engine = x->engine;
    x->count = number_processes(x, threads > 1 && can_separate(engine));
    x->processes = calloc((size_t)x->count + 1, sizeof *x->processes);
    if (!x->processes) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for logical processes");
    }
    int sensors = 0;
    for (int k = 0; k < x->count; k++) {
        BST_TRY(fill_process(ctx, x, k));
        sensors += x->processes[k].kind == BST_PROCESS_SENSORS;
    }
    x->caller_only = sensors == 1;
    for (int c = 0; c < engine->channel_count; c++) {
        channel *ch = &engine->channels[c];
        ch->process = engine->instances[ch->writer]->process;
        for (int r = 0; r < ch->reader_count; r++) {
            instance *reader = engine->instances[ch->readers[r].instance];
            if (reader->process != ch->process) {
                BST_TRY(connect(ctx, x, reader, ch->readers[r].port));
                BST_TRY(take_over(ctx, engine, ch, &reader->ports[ch->readers[r].port]));
            }
        }
    }
    if (engine->tick >= 0) {
        continue_processes(x);
    }
    x->link_ahead = steps_by_periods(x);
    for (int k = 0; k < x->count; k++) {
        BST_TRY(find_looker(ctx, x, &x->processes[k]));
        x->processes[k].link_tick = x->link >= 0 ? x->processes[x->link].horizon : INT64_MAX;
    }
    return BST_OK;
}

void bst_partition_free(bst_executor *x) {
    bst_engine *engine = x->engine;
    for (int i = 0; i < engine->instance_count; i++) {
        for (int p = 0; p < engine->instances[i]->port_count; p++) {
            port_state *port = &engine->instances[i]->ports[p];
            if (port->log && port->log->copied) {
                bst_log_free(engine->channels[port->channel].type, port->log);
                free(port->log);
                port->log = NULL;
            }
        }
    }
    for (int k = 0; x->processes && k < x->count; k++) {
        logical_process *self = &x->processes[k];
        for (int s = 0; s < BST_MOST_SEGMENTS; s++) {
            free(self->log.segments[s].bytes);
        }
        for (int lane = 0; lane < BST_STEP_LANES; lane++) {
            free(self->cursors[lane]);
        }
        free(self->members);
        free(self->inputs);
        free(self->heap.items);
    }
    free(x->processes);
}
