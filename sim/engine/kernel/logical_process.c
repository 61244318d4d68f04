/* Steps the modules of a logical process by its own schedule, in windows. At each step of a reader
 * in another process it copies the messages for that reader. */
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/engine/kernel/executor_internal.h"

/* A window ends after this many bytes of records for observers, or after this time. */
static const size_t most_noted = 1 << 18;
static const double longest_window_s = 0.02;

/* ---- what other processes read ---- */

bst_status bst_process_reach(struct bst_step *step, const channel *ch, const slot *s,
                             channel_reader r) {
    const bst_engine *engine = step->engine;
    const instance *reader = engine->instances[r.instance];
    port_state *port = &engine->instances[r.instance]->ports[r.port];
    if (port->copies == BST_COPY_EACH) {
        port->copied = s->sequence + 1;
        return bst_log_copy(step->ctx, port->log, ch, s);
    }
    if (bst_instance_port(reader, r.port)->flags & BST_PORT_TRIGGER) {
        logical_process *other = &engine->executor->processes[reader->process];
        int64_t visible = bst_tick_sum(step->tick, port->delay_ticks);
        other->sample_due = visible < other->sample_due ? visible : other->sample_due;
    }
    return BST_OK;
}

/* Copies the messages that an input sees at `tick`: the newest one, or all unread ones of
 * a queue. */
static bst_status copy_visible(bst_ctx *ctx, bst_engine *engine, port_state *port, int64_t tick) {
    const channel *ch = &engine->channels[port->channel];
    if (ch->type->kind == BST_CHANNEL_LATEST) {
        int64_t newest = bst_log_newest(&ch->log, port->delay_ticks, tick);
        if (newest < port->copied) {
            return BST_OK;
        }
        port->copied = newest + 1;
        return bst_log_copy(ctx, port->log, ch, bst_log_slot(&ch->log, newest));
    }
    int64_t next = bst_log_unread(engine, &ch->log, &port->copied, port->delay_ticks, tick);
    while (next >= 0) {
        BST_TRY(bst_log_copy(ctx, port->log, ch, bst_log_slot(&ch->log, next)));
        port->copied++;
        next = bst_log_unread(engine, &ch->log, &port->copied, port->delay_ticks, tick);
    }
    return BST_OK;
}

/* Copies the inputs that `reader` takes from this process at `tick`. */
static bst_status copy_inputs(bst_executor *x, logical_process *self, const logical_process *reader,
                              int64_t tick) {
    bst_engine *engine = x->engine;
    for (int m = 0; m < reader->member_count; m++) {
        instance *member = engine->instances[reader->members[m]];
        for (int p = 0; p < member->port_count; p++) {
            port_state *port = &member->ports[p];
            if (port->copies == BST_COPY_SAMPLED &&
                &x->processes[engine->channels[port->channel].process] == self) {
                BST_TRY(copy_visible(&self->ctx, engine, port, tick));
            }
        }
    }
    return BST_OK;
}

/* Marks the triggers of deferred modules at `tick` as processed and finds the next trigger. */
static void announce(bst_engine *engine, logical_process *reader, int64_t tick) {
    reader->sample_due = INT64_MAX;
    reader->sampled_looks = false;
    for (int m = 0; m < reader->member_count; m++) {
        instance *member = engine->instances[reader->members[m]];
        bool steps = false;
        for (int t = 0; t < member->trigger_count; t++) {
            port_state *port = &member->ports[member->triggers[t]];
            const message_log *log = &engine->channels[port->channel].log;
            if (port->copies == BST_COPY_SAMPLED) {
                steps |= bst_log_pass(log, &port->announced, port->delay_ticks, tick);
                int64_t next = bst_log_next_visible(log, port->announced, port->delay_ticks);
                reader->sample_due = next < reader->sample_due ? next : reader->sample_due;
            }
        }
        reader->sampled_looks |= steps && reader->members[m] == reader->looker;
    }
}

/* Next tick after `tick` at which a multi-sensor module steps by its period. */
static int64_t next_link_tick(const bst_executor *x, int64_t tick) {
    const logical_process *link = &x->processes[x->link];
    int64_t next = INT64_MAX;
    for (int m = 0; m < link->member_count; m++) {
        const bst_instance_spec *spec = &x->engine->instances[link->members[m]]->spec;
        int64_t past = tick - spec->offset_ticks, period = spec->period_ticks;
        int64_t due = past < 0 ? spec->offset_ticks : tick + period - past % period;
        next = due < next ? due : next;
    }
    return next;
}

/* Copies the inputs of other processes at the end of a tick. *any: another process may step now. */
static bst_status copy_for_others(bst_executor *x, logical_process *self, int64_t tick, bool *any) {
    for (int k = self->follower; k >= 0; k = x->processes[k].next_follower) {
        logical_process *other = &x->processes[k];
        if (other->sample_due <= tick) {
            BST_TRY(copy_inputs(x, self, other, tick));
            announce(x->engine, other, tick);
            other->sampled = *any = true;
            other->sampled_tick = tick;
        }
    }
    if (self->linked && self->link_tick <= tick) {
        BST_TRY(copy_inputs(x, self, &x->processes[x->link], tick));
        self->link_tick = x->link_ahead ? next_link_tick(x, tick) : INT64_MAX;
        *any = true;
    }
    return BST_OK;
}

/* ---- windows ---- */

/* Schedules instances for messages that other processes have written. */
static void deliver(bst_engine *engine, const logical_process *self) {
    for (int m = 0; m < self->member_count; m++) {
        int i = self->members[m];
        if (engine->instances[i]->trigger_count > 0) {
            bst_engine_set_due(engine, i, bst_engine_earliest(engine->instances[i]));
        }
    }
}

/* Drops copies of messages that no later step can read. */
static void trim(bst_executor *x, const logical_process *self) {
    for (int m = 0; m < self->member_count && self->input_count > 0; m++) {
        instance *member = x->engine->instances[self->members[m]];
        for (int p = 0; p < member->port_count; p++) {
            port_state *port = &member->ports[p];
            if (port->copies != BST_COPY_NONE) {
                bst_log_trim(&x->engine->channels[port->channel], port, self->reached - 1);
            }
        }
    }
}

/* The next tick at which a module steps or another process samples its inputs. */
static int64_t next_tick(const bst_executor *x, const logical_process *self) {
    int64_t tick = self->heap.count > 0 ? x->engine->due[self->heap.items[0]] : INT64_MAX;
    for (int k = self->follower; k >= 0; k = x->processes[k].next_follower) {
        const logical_process *other = &x->processes[k];
        if (other->sample_due < tick) {
            tick = other->sample_due;
        }
    }
    return self->linked && self->link_tick < tick ? self->link_tick : tick;
}

/* Steps all due modules of a process in one tick, copies outputs and releases frames. */
static bst_status step_tick(bst_executor *x, logical_process *self, int64_t tick, bool *long_step,
                            bool *over) {
    bst_engine *engine = x->engine;
    self->failed_tick = self->tick = self->last_tick = tick;
    if (self->heap.count > 0) {
        BST_TRY(bst_engine_step_tick(&self->ctx, engine, &self->heap, tick, long_step,
                                     &self->failed_instance));
    }
    self->failed_instance = engine->instance_count;
    BST_TRY(copy_for_others(x, self, tick, over));
    bst_engine_release_read(engine, (int)(self - x->processes));
    return BST_OK;
}

/* After a failed step: copies the inputs of multi-sensor modules that step before it in
 * this tick. */
static bool fed_link(bst_executor *x, logical_process *self, int64_t tick) {
    return self->linked && self->link_tick <= tick &&
           self->failed_instance > x->processes[x->link].members[0] &&
           copy_inputs(x, self, &x->processes[x->link], tick) == BST_OK;
}

/* Selects the work space for a deferred module with `ahead`, by the number of the sample. */
static void take_lane(bst_executor *x, const logical_process *self) {
    if (self->kind == BST_PROCESS_DEFERRED && self->looker >= 0) {
        const sample_point *sample = &self->samples[self->first_sample % BST_MOST_SAMPLES];
        x->engine->instances[self->looker]->lane =
            sample->number >= 0 ? (int)(sample->number % BST_STEP_LANES) : 0;
    }
}

void bst_process_step(bst_executor *x, logical_process *self) {
    bst_engine *engine = x->engine;
    const bool by_clock = self->kind == BST_PROCESS_SENSORS && bst_pacing_by_clock(engine);
    double begun = bst_wall_seconds();
    take_lane(x, self);
    if (self->delivers) {
        deliver(engine, self);
    }
    self->reached = self->limit;
    self->shows_frame = false;
    for (int ticks = 1;; ticks++) {
        int64_t tick = next_tick(x, self);
        if (tick >= self->limit) {
            break;
        }
        if (by_clock && bst_pacing_wait(&self->ctx, engine, tick) != BST_OK) {
            self->interrupted = true;
            self->reached = tick;
            break;
        }
        bool over = false, long_step = false;
        self->status = step_tick(x, self, tick, &long_step, &over);
        if (self->status != BST_OK) {
            self->reached = fed_link(x, self, tick) ? tick + 1 : tick;
            break;
        }
        size_t noted = self->log.segments[self->log.filled % BST_MOST_SEGMENTS].used;
        over |= self->shows_frame || noted > most_noted || (by_clock && noted > 0);
        if (!over && (long_step || ticks % 64 == 0)) {
            over = bst_wall_seconds() - begun > longest_window_s;
        }
        if (over) {
            self->reached = tick + 1;
            break;
        }
    }
    trim(x, self);
    self->took_s[self->windows & 1] = bst_wall_seconds() - begun;
}

void bst_process_look(bst_executor *x, logical_process *self, const sample_point *sample) {
    instance *looker = x->engine->instances[self->looker];
    int lane = (int)(sample->number % BST_STEP_LANES);
    int64_t *cursors = self->cursors[lane];
    for (int p = 0; p < looker->port_count; p++) {
        const port_state *port = &looker->ports[p];
        if (port->copies != BST_COPY_NONE) { /* skip what earlier steps have read */
            bst_log_lock(port->log);
            cursors[p] = port->log->oldest;
            (void)bst_log_pass(port->log, &cursors[p], port->delay_ticks, sample->after);
            bst_log_unlock(port->log);
        }
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    struct bst_step step = {.engine = x->engine,
                            .self = looker,
                            .ctx = &ctx,
                            .tick = sample->tick,
                            .lane = lane,
                            .ahead = cursors};
    (void)looker->spec.desc->ahead(looker->self,
                                   &step); /* the regular step repeats and reports an error */
}
