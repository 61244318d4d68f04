#include "sim/engine/kernel/engine.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/wall_clock.h"
#include "sim/engine/kernel/engine_internal.h"

bst_status bst_engine_create(bst_ctx *ctx, int64_t tick_rate_hz, bst_engine **out) {
    assert(out);
    *out = NULL;
    if (tick_rate_hz < 1 || tick_rate_hz > 1000000) {
        return bst_fail(ctx, BST_ERR_CONFIG, "tick rate %lld Hz: allowed are 1 to 1000000",
                        (long long)tick_rate_hz);
    }
    bst_engine *engine = calloc(1, sizeof *engine);
    if (!engine) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the engine");
    }
    engine->tick_rate_hz = tick_rate_hz;
    engine->tick = -1;
    pthread_mutex_init(&engine->counting, NULL);
    *out = engine;
    return BST_OK;
}

static void free_instance(instance *self) {
    if (self) {
        free(self->scope);
        free(self->name);
        free(self->ports);
        free(self->triggers);
        free(self);
    }
}

void bst_engine_free(bst_engine *engine) {
    if (!engine) {
        return;
    }
    bst_executor_free(engine);
    bst_pacing_free(engine->pacing);
    /* Messages release their frames into the writers' pools; therefore before the modules. */
    for (int c = 0; c < engine->channel_count; c++) {
        bst_log_free(engine->channels[c].type, &engine->channels[c].log);
    }
    free(engine->channels);
    free(engine->readers);
    free(engine->releasable);
    free(engine->due);
    free(engine->heap.items);
    free(engine->place);
    for (int i = engine->instance_count - 1; i >= 0; i--) {
        instance *self = engine->instances[i];
        if (self->created) {
            self->spec.desc->destroy(self->self);
        }
        free_instance(self);
    }
    free(engine->instances);
    pthread_mutex_destroy(&engine->counting);
    free(engine);
}

void bst_engine_set_hooks(bst_engine *engine, const bst_engine_hooks *hooks) {
    engine->hooks = *hooks;
}

bst_status bst_engine_add(bst_ctx *ctx, bst_engine *engine, const bst_instance_spec *spec) {
    assert(engine && spec && spec->desc && spec->scope && spec->instance);
    assert(spec->delay_count >= 0 && spec->delay_count <= BST_MAX_DELAYS);
    if (engine->loaded) {
        return bst_fail(ctx, BST_ERR_STATE, "%s: modules are added before loading", spec->instance);
    }
    if (spec->desc->abi != BST_MODULE_ABI) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: module %s/%s was built for interface %u, this is %d", spec->instance,
                        spec->desc->role, spec->desc->type, spec->desc->abi, BST_MODULE_ABI);
    }
    if (engine->instance_count == engine->instance_capacity) {
        int capacity = engine->instance_capacity ? 2 * engine->instance_capacity : 16;
        instance **more = realloc(engine->instances, (size_t)capacity * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for modules");
        }
        engine->instances = more;
        engine->instance_capacity = capacity;
    }
    instance *self = calloc(1, sizeof *self);
    if (self) {
        self->scope = strdup(spec->scope);
        self->name = strdup(spec->instance);
        self->port_count =
            spec->desc->port_count * (spec->member_count > 0 ? spec->member_count : 1);
        self->ports = calloc((size_t)self->port_count + 1, sizeof *self->ports);
        self->triggers = calloc((size_t)self->port_count + 1, sizeof *self->triggers);
    }
    if (!self || !self->scope || !self->name || !self->ports || !self->triggers) {
        free_instance(self);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %s", spec->instance);
    }
    self->spec = *spec;
    self->spec.scope = self->scope;
    self->spec.instance = self->name;
    self->next_period = spec->period_ticks > 0 ? spec->offset_ticks : INT64_MAX;
    self->wake = INT64_MAX;
    for (int p = 0; p < self->port_count; p++) {
        self->ports[p].channel = -1;
    }
    engine->instances[engine->instance_count++] = self;
    return BST_OK;
}

bst_status bst_engine_load(bst_ctx *ctx, bst_engine *engine) {
    if (engine->loaded) {
        return bst_fail(ctx, BST_ERR_STATE, "the engine is loaded already");
    }
    engine->loaded = true;
    BST_TRY(bst_engine_wire(ctx, engine));
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        const bst_instance_spec *spec = &self->spec;
        unsigned flags = spec->desc->flags;
        bst_module_env env = {.ctx = ctx,
                              .instance = self->name,
                              .tick_rate_hz = engine->tick_rate_hz,
                              .period_ticks = spec->period_ticks,
                              .seed = spec->seed,
                              .run = spec->run,
                              .world = flags & BST_MODULE_READS_TRUTH ? spec->world : NULL,
                              .knowledge = spec->knowledge,
                              .device = flags & BST_MODULE_NEEDS_DEVICE ? spec->device : NULL,
                              .link = flags & BST_MODULE_NEEDS_LINK ? spec->link : NULL,
                              .observer = spec->observer,
                              .sensor = spec->sensor,
                              .exposure_s = spec->exposure_s,
                              .frame_exposure_s = spec->frame_exposure_s,
                              .frame_period_s = spec->frame_period_s,
                              .frame_latency_s = spec->frame_latency_s,
                              .los_period_ticks = spec->los_period_ticks,
                              .los_offset_ticks = spec->los_offset_ticks,
                              .members = spec->members,
                              .member_count = spec->member_count,
                              .planes = spec->planes,
                              .mask_threshold_sigma = spec->mask_threshold_sigma,
                              .never_steps = spec->never_steps,
                              .engine_private = self};
        bst_status status = spec->desc->create(&env, spec->config, &self->self);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "%s", self->name);
        }
        self->created = true;
        /* a module without period or trigger is stepped once, so that it can ask to be woken */
        if (spec->period_ticks == 0 && self->trigger_count == 0) {
            self->wake = spec->offset_ticks;
        }
    }
    bst_engine_set_deferred(engine);
    BST_TRY(bst_engine_allocate_channels(ctx, engine));
    return bst_engine_make_schedule(ctx, engine);
}

/* Steps one module instance and publishes its outputs. */
static bst_status step_instance(bst_ctx *ctx, bst_engine *engine, int index, int64_t tick) {
    instance *self = engine->instances[index];
    if (self->next_period <= tick) {
        self->next_period += self->spec.period_ticks;
    }
    if (self->wake <= tick) {
        self->wake = INT64_MAX;
    }
    for (int t = 0; t < self->trigger_count; t++) {
        port_state *port = &self->ports[self->triggers[t]];
        bst_log_lock(port->log);
        (void)bst_log_pass(port->log, &port->trigger_cursor, port->delay_ticks, tick);
        bst_log_unlock(port->log);
    }
    struct bst_step step = {
        .engine = engine, .self = self, .ctx = ctx, .tick = tick, .lane = self->lane};
    self->steps++;
    bst_status status = self->spec.desc->step(self->self, &step);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "%s at %.6f s", self->name,
                               (double)tick / (double)engine->tick_rate_hz);
    }
    BST_TRY(bst_engine_commit(&step)); /* an observer's failure is not attributed to the module */
    bst_engine_set_due(engine, index, bst_engine_earliest(self));
    return BST_OK;
}

bst_status bst_engine_step_tick(bst_ctx *ctx, bst_engine *engine, bst_heap *heap, int64_t tick,
                                bool *long_step, int *failed) {
    while (engine->due[heap->items[0]] <= tick && !engine->paused) {
        int index = heap->items[0];
        *long_step |= engine->instances[index]->spec.period_ticks == 0;
        *failed = index;
        BST_TRY(step_instance(ctx, engine, index, tick));
    }
    return BST_OK;
}

/* Steps all due module instances up to a tick. */
static bst_status run_until(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    int since_clock = 0;
    const bool by_clock = bst_pacing_by_clock(engine);
    engine->paused = false;
    while (engine->instance_count > 0 && !engine->paused) {
        int64_t tick = engine->due[engine->heap.items[0]];
        if (tick >= until_tick) {
            break;
        }
        if (by_clock) {
            BST_TRY(bst_pacing_wait(ctx, engine, tick));
        }
        engine->tick = tick;
        bool long_step = false;
        int failed;
        BST_TRY(bst_engine_step_tick(ctx, engine, &engine->heap, tick, &long_step, &failed));
        bst_engine_release_read(engine, 0);
        /* reading the clock costs as much as a plant step; therefore only every 256 steps or after
         * a long step */
        if (engine->hooks.interrupted && (++since_clock >= 256 || long_step)) {
            since_clock = 0;
            double now = bst_wall_seconds();
            if (now - engine->asked_s > 0.02) {
                engine->asked_s = now;
                if (engine->hooks.interrupted(engine->hooks.user, tick)) {
                    return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted at %.3f s",
                                    (double)tick / (double)engine->tick_rate_hz);
                }
            }
        }
    }
    return BST_OK;
}

bst_status bst_engine_finish(bst_ctx *ctx, bst_engine *engine) {
    assert(engine && engine->loaded);
    for (int i = 0; i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (self->spec.desc->finish) {
            struct bst_step step = {
                .engine = engine, .self = self, .ctx = ctx, .tick = engine->tick};
            bst_status status = self->spec.desc->finish(self->self, &step);
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s", self->name);
            }
        }
    }
    return BST_OK;
}

bst_status bst_engine_run(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    assert(engine && until_tick >= 0);
    if (!engine->loaded) {
        return bst_fail(ctx, BST_ERR_STATE, "the engine is not loaded");
    }
    bst_pacing_thread thread;
    if (engine->pacing) {
        bst_pacing_thread_take(ctx, engine, &thread);
    }
    bst_status status = engine->executor ? bst_executor_run(ctx, engine, until_tick)
                                         : run_until(ctx, engine, until_tick);
    if (engine->pacing) {
        bst_pacing_thread_give_back(engine, &thread);
    }
    if (status == BST_OK || status == BST_ERR_INTERRUPTED) {
        bst_ctx counting = *ctx;
        bst_status counted = bst_engine_finish(&counting, engine);
        if (counted != BST_OK) {
            *ctx = counting;
            return counted;
        }
    }
    return status;
}

bst_status bst_engine_advance(bst_ctx *ctx, bst_engine *engine, int64_t until_tick) {
    assert(engine && until_tick >= 0);
    if (!engine->loaded) {
        return bst_fail(ctx, BST_ERR_STATE, "the engine is not loaded");
    }
    return engine->executor ? bst_executor_run(ctx, engine, until_tick)
                            : run_until(ctx, engine, until_tick);
}

void bst_engine_pause(bst_engine *engine) {
    engine->paused = engine->executor == NULL;
}
bool bst_engine_is_paused(const bst_engine *engine) {
    return engine->paused;
}

int64_t bst_engine_next_tick(const bst_engine *engine) {
    assert(engine->loaded && !engine->executor);
    return engine->instance_count > 0 ? engine->due[engine->heap.items[0]] : INT64_MAX;
}

void bst_engine_hold_frames(bst_engine *engine) {
    engine->holds_frames = true;
}

int bst_engine_channel_count(const bst_engine *engine) {
    return engine->channel_count;
}

const char *bst_engine_channel(const bst_engine *engine, int index, const char **scope,
                               int *capacity) {
    assert(index >= 0 && index < engine->channel_count);
    const channel *ch = &engine->channels[index];
    if (scope) {
        *scope = ch->scope;
    }
    if (capacity) {
        *capacity = ch->capacity;
    }
    return ch->type->name;
}

bst_sample bst_engine_newest(const bst_engine *engine, int index) {
    assert(index >= 0 && index < engine->channel_count);
    const message_log *log = &engine->channels[index].log;
    if (log->written == 0) {
        return (bst_sample){.sequence = -1, .stale = true};
    }
    const slot *s = bst_log_slot(log, log->written - 1);
    return (bst_sample){s->payload, s->written_tick, s->sequence, false};
}

int bst_engine_find_channel(const bst_engine *engine, const char *scope, const char *name) {
    for (int c = 0; c < engine->channel_count; c++) {
        const channel *ch = &engine->channels[c];
        if (strcmp(ch->type->name, name) == 0 && (!scope || strcmp(ch->scope, scope) == 0)) {
            return c;
        }
    }
    return -1;
}

bst_status bst_engine_wake(bst_ctx *ctx, bst_engine *engine, const char *name, int64_t tick) {
    for (int i = 0; engine->loaded && i < engine->instance_count; i++) {
        instance *self = engine->instances[i];
        if (strcmp(self->name, name) == 0) {
            self->wake = tick < self->wake ? tick : self->wake;
            bst_engine_set_due(engine, i, bst_engine_earliest(self));
            return BST_OK;
        }
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "no module is called %s", name);
}

int64_t bst_engine_tick(const bst_engine *engine) {
    return engine->tick;
}
int bst_engine_instance_count(const bst_engine *engine) {
    return engine->instance_count;
}
const char *bst_engine_instance_name(const bst_engine *engine, int index) {
    return engine->instances[index]->name;
}
int64_t bst_engine_instance_steps(const bst_engine *engine, int index) {
    return engine->instances[index]->steps;
}

bool bst_engine_counter(const bst_engine *engine, int index, const char **name, int64_t *count) {
    if (index < 0 || index >= engine->counter_count) {
        return false;
    }
    *name = engine->counters[index].name;
    *count = engine->counters[index].count;
    return true;
}

bst_status bst_period_ticks(bst_ctx *ctx, int64_t tick_rate_hz, double rate_hz, int64_t *out) {
    double period = (double)tick_rate_hz / rate_hz;
    double nearest = floor(period + 0.5);
    if (!(rate_hz > 0.0) || period < 1.0 - 1e-9 || nearest > 9e15) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "a rate of %g Hz is not between 0 and the tick rate of %lld Hz", rate_hz,
                        (long long)tick_rate_hz);
    }
    if (fabs(period - nearest) > 1e-9 * period) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "a rate of %g Hz does not divide the tick rate of %lld Hz; the nearest "
                        "that do are %.9g and %.9g Hz",
                        rate_hz, (long long)tick_rate_hz, (double)tick_rate_hz / ceil(period),
                        (double)tick_rate_hz / floor(period));
    }
    *out = (int64_t)nearest;
    return BST_OK;
}

bst_status bst_seconds_to_ticks(bst_ctx *ctx, int64_t tick_rate_hz, double seconds, int64_t *out) {
    double ticks = seconds * (double)tick_rate_hz;
    double nearest = floor(ticks + 0.5);
    if (!(fabs(ticks) < 9e15)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "a time of %g s is out of range", seconds);
    }
    if (fabs(ticks - nearest) > 1e-6 * fmax(1.0, fabs(ticks) * 1e-6)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "a time of %.12g s is no whole number of ticks at %lld Hz; the nearest "
                        "that are %.12g and %.12g s",
                        seconds, (long long)tick_rate_hz, floor(ticks) / (double)tick_rate_hz,
                        ceil(ticks) / (double)tick_rate_hz);
    }
    *out = (int64_t)nearest;
    return BST_OK;
}
