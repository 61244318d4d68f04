/* Conservative synchronisation: limits the window of a logical process by what other processes may
 * still write to its inputs. Every function is called with the executor's lock held. */
#include "sim/engine/kernel/executor_internal.h"

void bst_sync_wake(bst_executor *x) {
    if (x->sleeping > 0) {
        pthread_cond_broadcast(&x->changed);
    }
}

int64_t bst_sync_least_clock(const bst_executor *x) {
    int64_t least = INT64_MAX;
    for (int k = 0; k < x->count; k++) {
        least = x->processes[k].clock < least ? x->processes[k].clock : least;
    }
    return least;
}

/* No message that an input has not yet seen becomes visible before this tick. */
static int64_t safe_before(const bst_executor *x, const process_input *input) {
    const logical_process *source = &x->processes[input->source];
    int64_t silent = source->clock;
    if (input->mode == BST_COPY_SAMPLED) {
        return silent; /* copies exist up to the clock only */
    }
    silent = source->horizon > silent ? source->horizon : silent;
    silent = input->output->lookahead > silent ? input->output->lookahead : silent;
    return bst_tick_sum(silent, input->delay_ticks);
}

/* End of the next window of a logical process, exclusive. least: clock of the slowest process. */
static int64_t limit_of(const bst_executor *x, const logical_process *self, int64_t least) {
    int64_t rate = x->engine->tick_rate_hz, limit = x->end;
    int64_t lead = bst_tick_sum(least, BST_MOST_LEAD_S * rate);
    limit = lead < limit ? lead : limit;
    for (int i = 0; i < self->input_count; i++) {
        int64_t safe = safe_before(x, &self->inputs[i]);
        limit = safe < limit ? safe : limit;
    }
    if (self->kind == BST_PROCESS_DEFERRED) {
        int64_t next = self->samples[self->first_sample % BST_MOST_SAMPLES].tick + 1;
        return next < limit ? next : limit;
    }
    if (self->linked && !x->link_ahead) {
        /* until the inputs of multi-sensor modules are copied, at the tick of their step */
        int64_t link_tick = x->processes[x->link].horizon;
        int64_t last = link_tick < self->clock ? self->clock : bst_tick_sum(link_tick, 1);
        limit = last < limit ? last : limit;
    }
    if (!x->caller_only && self->heap.count > 0) {
        int64_t due = x->engine->due[self->heap.items[0]];
        int64_t window = bst_tick_sum(due > self->clock ? due : self->clock, rate);
        limit = window < limit ? window : limit;
    }
    return limit;
}

/* Checks the backlog of a process: records, retained frames and samples are below their limits. */
static bool has_room(const bst_executor *x, const logical_process *self) {
    if (self->log.filled - self->log.observed >= BST_MOST_SEGMENTS ||
        __atomic_load_n(&self->frames, __ATOMIC_RELAXED) > BST_MOST_FRAMES_HELD) {
        return false;
    }
    for (int k = self->follower; k >= 0; k = x->processes[k].next_follower) {
        const logical_process *other = &x->processes[k];
        if (other->next_sample - other->first_sample >= BST_MOST_SAMPLES) {
            return false;
        }
    }
    return true;
}

bool bst_sync_can_step(bst_executor *x, logical_process *self, int64_t least) {
    if (self->busy || self->status != BST_OK || self->clock >= x->end || !has_room(x, self)) {
        return false;
    }
    if (self->kind == BST_PROCESS_DEFERRED &&
        (self->first_sample == self->next_sample ||
         self->samples[self->first_sample % BST_MOST_SAMPLES].look == BST_LOOK_BUSY)) {
        return false;
    }
    self->limit = limit_of(x, self, least);
    if (self->linked && !x->link_ahead) {
        self->link_tick =
            x->processes[x->link].horizon < self->clock ? INT64_MAX : x->processes[x->link].horizon;
    }
    return self->kind == BST_PROCESS_DEFERRED
               ? self->limit > self->samples[self->first_sample % BST_MOST_SAMPLES].tick
               : self->limit > self->clock;
}

/* Sets the clock of an idle deferred process to its next sample, else to the clock of
 * its source. */
static void follow_source(const bst_executor *x, logical_process *self) {
    if (!self->busy && self->status == BST_OK) {
        self->clock = self->first_sample < self->next_sample
                          ? self->samples[self->first_sample % BST_MOST_SAMPLES].tick
                          : x->processes[self->source].clock;
    }
}

/* Advances the clock of multi-sensor modules to the tick before which none is due. */
static void advance_link(const bst_executor *x) {
    logical_process *link = x->link >= 0 ? &x->processes[x->link] : NULL;
    if (link && !link->busy && link->status == BST_OK) {
        int64_t limit = limit_of(x, link, bst_sync_least_clock(x));
        if (limit > link->clock && link->horizon >= limit) {
            link->clock = limit;
        }
    }
}

/* Adds the sampled tick of a source process to the samples of a deferred process. */
static void take_sample(logical_process *self) {
    if (self->sampled) {
        sample_point *sample = &self->samples[self->next_sample++ % BST_MOST_SAMPLES];
        *sample = (sample_point){.tick = self->sampled_tick,
                                 .number = self->sampled_looks ? self->numbered++ : -1,
                                 .after = self->last_numbered_tick};
        if (self->sampled_looks) {
            self->last_numbered_tick = self->sampled_tick;
        }
        self->sampled = false;
    }
}

void bst_sync_follow(bst_executor *x, const logical_process *source) {
    for (int k = source->follower; k >= 0; k = x->processes[k].next_follower) {
        take_sample(&x->processes[k]);
        follow_source(x, &x->processes[k]);
    }
    advance_link(x);
}

/* First step of a multi-sensor module at `tick` or later, if it steps by its period only. */
static int64_t next_step(const bst_executor *x, const instance *member, int64_t tick) {
    int64_t period = member->spec.period_ticks, past = tick - member->spec.offset_ticks;
    if (!x->link_ahead || tick > INT64_MAX - period) {
        return tick;
    }
    return past <= 0 ? member->spec.offset_ticks : tick + (period - past % period) % period;
}

/* Publishes the lookahead of multi-sensor modules' outputs. */
static void take_lookahead(bst_executor *x, logical_process *self) {
    const bst_engine *engine = x->engine;
    self->horizon = engine->due[self->heap.items[0]];
    for (int m = 0; m < self->member_count; m++) {
        instance *member = engine->instances[self->members[m]];
        for (int p = 0; p < member->port_count; p++) {
            member->ports[p].lookahead = next_step(x, member, member->ports[p].silent_until);
        }
    }
}

void bst_sync_end_window(bst_executor *x, logical_process *self) {
    self->busy = false;
    self->windows++;
    self->clock = self->reached;
    self->order = self->members[0];
    self->log.filled += self->log.segments[self->log.filled % BST_MOST_SEGMENTS].used > 0;
    if (self->last_tick > x->engine->tick) {
        x->engine->tick = self->last_tick;
    }
    if (self->status != BST_OK) {
        x->end = self->failed_tick < x->end ? self->failed_tick + 1 : x->end;
    }
    if (self->interrupted) {
        self->interrupted = false;
        x->interrupted = true;
        x->end = self->reached < x->end ? self->reached : x->end;
    }
    if (self->kind == BST_PROCESS_LINK) {
        take_lookahead(x, self);
    } else if (self->kind == BST_PROCESS_DEFERRED && self->status == BST_OK) {
        const sample_point *done = &self->samples[self->first_sample++ % BST_MOST_SAMPLES];
        self->numbers_done += done->number >= 0;
        follow_source(x, self);
    }
    bst_sync_follow(x, self);
    bst_sync_wake(x);
}

void bst_sync_complete_before(const bst_executor *x, int64_t *tick, int *order) {
    *tick = INT64_MAX;
    *order = 0;
    for (int k = 0; k < x->count; k++) {
        const logical_process *self = &x->processes[k];
        bool failed = !self->busy && self->status != BST_OK;
        int64_t own_tick = failed ? self->failed_tick : self->clock;
        int own_order = failed ? self->failed_instance + 1 : self->order;
        if (bst_before(own_tick, own_order, *tick, *order)) {
            *tick = own_tick;
            *order = own_order;
        }
    }
}

sample_point *bst_sync_next_look(logical_process *self) {
    for (int64_t k = self->first_sample; self->looker >= 0 && k < self->next_sample; k++) {
        sample_point *sample = &self->samples[k % BST_MOST_SAMPLES];
        bool begun = self->busy && k == self->first_sample;
        if (!begun && sample->number >= 0 && sample->look == BST_LOOK_NONE &&
            sample->number < self->numbers_done + BST_STEP_LANES) {
            return sample;
        }
    }
    return NULL;
}
