/* bst_sim: one run of a model, step by step. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/api/api_internal.h"
#include "sim/link/link.h"
#include "sim/world/world.h"

static bst_engine *engine_of(const bst_sim *sim) {
    return bst_simulation_engine(sim->simulation);
}

/* Observer of the engine: stops at the wanted message and passes it on. */
static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    bst_sim *sim = user;
    if (channel == sim->wanted_channel && (!sim->wanted_scope || scope == sim->wanted_scope)) {
        sim->arrived = true;
        bst_engine_pause(engine_of(sim));
    }
    const bst_sim_observer *observer = &sim->observer;
    return observer->message ? observer->message(observer->user, scope, channel, payload, tick)
                             : BST_OK;
}

static bst_status on_event(void *user, int64_t tick, const char *instance, const char *kind,
                           const char *text) {
    const bst_sim_observer *observer = &((bst_sim *)user)->observer;
    return observer->event(observer->user, tick, instance, kind, text);
}

static bool on_interrupted(void *user, int64_t tick) {
    const bst_sim_observer *observer = &((bst_sim *)user)->observer;
    return observer->interrupted(observer->user, tick);
}

/* Registers only the observers that are needed: others cost time at the plant's rate. */
static void set_hooks(bst_sim *sim) {
    const bst_sim_observer *observer = &sim->observer;
    const bst_engine_hooks hooks = {
        .user = sim,
        .message = observer->message || sim->wanted_channel ? on_message : NULL,
        .event = observer->event ? on_event : NULL,
        .interrupted = observer->interrupted ? on_interrupted : NULL};
    bst_engine_set_hooks(engine_of(sim), &hooks);
}

/* True if messages from outside change the world of a scenario. */
static bool changes_world(const bst_scenario *scenario) {
    const bst_object_config *objects = scenario->world.objects.items;
    for (int i = 0; i < scenario->world.objects.count; i++) {
        if (objects[i].external_states) {
            return true;
        }
    }
    return false;
}

bst_status bst_sim_build(bst_ctx *ctx, bst_sim *sim, uint64_t run) {
    const bst_model *model = sim->model;
    BST_TRY(bst_model_prepare(ctx, model));
    bst_sim_end_views(sim);
    free(sim->mapped);
    bst_simulation_free(sim->simulation);
    bst_shared_model_free(sim->own);
    sim->mapped = NULL;
    sim->simulation = NULL;
    sim->own = NULL;
    if (changes_world(&model->scenario)) {
        const bst_shared_model_options how = {.device = model->device, .threads = model->threads};
        BST_TRY(bst_shared_model_create(ctx, &model->scenario, &how, &sim->own));
    }
    const bst_simulation_options how = {.threads = model->threads,
                                        .shared = sim->own ? sim->own : model->shared,
                                        .other_run = true,
                                        .run = run,
                                        .local_link = true};
    BST_TRY(bst_simulation_create(ctx, &model->scenario, &how, &sim->simulation));
    bst_engine_hold_frames(engine_of(sim));
    sim->tick = 0;
    sim->failed = false;
    set_hooks(sim);
    sim->mapped = calloc((size_t)bst_engine_channel_count(engine_of(sim)) + 1, sizeof *sim->mapped);
    return sim->mapped ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a sim");
}

bst_status bst_sim_create(bst_ctx *ctx, const bst_model *model, const bst_sim_options *options,
                          bst_sim **out) {
    assert(model && out);
    *out = NULL;
    bst_sim *sim = calloc(1, sizeof *sim);
    if (!sim) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a sim");
    }
    sim->model = model;
    bst_status status = bst_sim_build(
        ctx, sim, options && options->other_run ? options->run : bst_model_run(model));
    if (status != BST_OK) {
        bst_sim_free(sim);
        return status;
    }
    *out = sim;
    return BST_OK;
}

void bst_sim_free(bst_sim *sim) {
    if (sim) {
        bst_sim_end_views(sim);
        free(sim->mapped);
        bst_simulation_free(sim->simulation);
        bst_shared_model_free(sim->own);
        free(sim);
    }
}

void bst_sim_observe(bst_sim *sim, const bst_sim_observer *observer) {
    sim->observer = observer ? *observer : (bst_sim_observer){.user = NULL};
    set_hooks(sim);
}

/* ---- stepping ---- */

/* Converts a time to a tick, rounded up. */
static bst_status tick_of(bst_ctx *ctx, const bst_sim *sim, double seconds, int64_t *out) {
    double rate = (double)sim->model->scenario.tick_rate_hz, ticks = seconds * rate;
    if (!(fabs(ticks) < 9e15)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "cannot run until %g s: allowed is from %g to %g s",
                        seconds, -9e15 / rate, 9e15 / rate);
    }
    /* tolerance for a time rounded to just above its tick */
    *out = (int64_t)ceil(ticks - 1e-6);
    return BST_OK;
}

/* Steps all modules that are due before a tick, or to the wanted message. */
static bst_status advance(bst_ctx *ctx, bst_sim *sim, int64_t until) {
    bst_engine *engine = engine_of(sim);
    bst_sim_end_views(sim);
    bst_status status = bst_engine_advance(ctx, engine, until);
    if (status != BST_OK) {
        sim->failed = status != BST_ERR_INTERRUPTED;
        sim->tick = bst_engine_tick(engine) > sim->tick ? bst_engine_tick(engine) : sim->tick;
        return status;
    }
    sim->tick = bst_engine_is_paused(engine) ? bst_engine_tick(engine) : until;
    return BST_OK;
}

/* Fails if the sim cannot be stepped or saved. */
static bst_status check_alive(bst_ctx *ctx, const bst_sim *sim) {
    return sim->failed ? bst_fail(ctx, BST_ERR_STATE,
                                  "the sim has failed in an earlier step: restore a saved state, "
                                  "or create another")
                       : BST_OK;
}

bst_status bst_sim_run_until(bst_ctx *ctx, bst_sim *sim, double until_s) {
    int64_t until = 0;
    BST_TRY(check_alive(ctx, sim));
    BST_TRY(tick_of(ctx, sim, until_s, &until));
    return until > sim->tick ? advance(ctx, sim, until) : BST_OK;
}

/* Steps the next tick at which a module is due. */
static bst_status step_tick(bst_ctx *ctx, bst_sim *sim, int64_t until, bool *arrived) {
    int64_t next = bst_engine_next_tick(engine_of(sim));
    *arrived = next < until;
    return advance(ctx, sim, *arrived ? next + 1 : until);
}

bst_status bst_sim_step(bst_ctx *ctx, bst_sim *sim, const char *scope, const char *channel,
                        double until_s, bool *arrived) {
    int64_t until = 0;
    bool found = false;
    BST_TRY(check_alive(ctx, sim));
    BST_TRY(tick_of(ctx, sim, until_s, &until));
    if (arrived) {
        *arrived = false;
    }
    int index = channel ? bst_engine_find_channel(engine_of(sim), scope, channel) : -1;
    if (channel && index < 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "no module writes \"%s\"%s%s", channel,
                        scope ? " of " : "", scope ? scope : "");
    }
    if (until <= sim->tick) {
        return BST_OK;
    }
    bst_status status;
    if (channel) {
        const char *own_scope;
        sim->wanted_channel = bst_engine_channel(engine_of(sim), index, &own_scope, NULL);
        sim->wanted_scope = scope ? own_scope : NULL;
        sim->arrived = false;
        set_hooks(sim);
        status = advance(ctx, sim, until);
        sim->wanted_channel = NULL;
        set_hooks(sim);
        found = sim->arrived;
    } else {
        status = step_tick(ctx, sim, until, &found);
    }
    if (arrived) {
        *arrived = found;
    }
    return status;
}

double bst_sim_time_s(const bst_sim *sim) {
    return (double)sim->tick / (double)sim->model->scenario.tick_rate_hz;
}
int64_t bst_sim_tick(const bst_sim *sim) {
    return sim->tick;
}
uint64_t bst_sim_run(const bst_sim *sim) {
    return bst_simulation_run(sim->simulation);
}
const bst_model *bst_sim_model(const bst_sim *sim) {
    return sim->model;
}

const char *bst_sim_counter(const bst_sim *sim, int index, int64_t *count) {
    const char *name;
    return bst_engine_counter(engine_of(sim), index, &name, count) ? name : NULL;
}

/* ---- messages ---- */

const char *bst_sim_channel(const bst_sim *sim, int index, const char **scope) {
    const bst_engine *engine = engine_of(sim);
    return index >= 0 && index < bst_engine_channel_count(engine)
               ? bst_engine_channel(engine, index, scope, NULL)
               : NULL;
}

/* Finds a channel of the sim. */
static bst_status find_channel(bst_ctx *ctx, const bst_sim *sim, const char *scope,
                               const char *channel, int *index) {
    *index = bst_engine_find_channel(engine_of(sim), scope, channel);
    return *index >= 0 ? BST_OK
                       : bst_fail(ctx, BST_ERR_NOT_FOUND, "no module writes \"%s\"%s%s", channel,
                                  scope ? " of " : "", scope ? scope : "");
}

bst_status bst_sim_view(bst_ctx *ctx, const bst_sim *sim, const char *scope, const char *channel,
                        bst_sim_message *out) {
    assert(sim && channel && out);
    int index;
    *out = (bst_sim_message){.sequence = -1};
    BST_TRY(find_channel(ctx, sim, scope, channel, &index));
    bst_sample sample = bst_engine_newest(engine_of(sim), index);
    const bst_channel_type *type = bst_channel_type_find(channel);
    out->payload = sample.payload;
    out->written_tick = sample.written_tick;
    out->sequence = sample.sequence;
    (void)bst_engine_channel(engine_of(sim), index, NULL, &out->capacity);
    out->items = sample.payload && type->count ? type->count(sample.payload) : 0;
    return BST_OK;
}

bst_status bst_sim_view_frame(bst_ctx *ctx, bst_sim *sim, const char *scope, bst_sim_frame *out) {
    assert(sim && out);
    int index;
    *out = (bst_sim_frame){.message = NULL};
    BST_TRY(find_channel(ctx, sim, scope, BST_CHANNEL_FRAME, &index));
    const bst_frame_message *message = bst_engine_newest(engine_of(sim), index).payload;
    if (!message || !message->frame) {
        return BST_OK;
    }
    BST_TRY(bst_frame_map(message->frame, ctx, &out->pixels));
    if (sim->mapped[index]) {
        bst_frame_unmap(message->frame); /* lent already: maps nest */
    }
    sim->mapped[index] = message->frame;
    out->message = message;
    out->width = message->frame->width;
    out->height = message->frame->height;
    return BST_OK;
}

void bst_sim_end_views(bst_sim *sim) {
    for (int c = 0; sim->mapped && c < bst_engine_channel_count(engine_of(sim)); c++) {
        if (sim->mapped[c]) {
            bst_frame_unmap(sim->mapped[c]);
            sim->mapped[c] = NULL;
        }
    }
}

/* ---- commands ---- */

bst_status bst_sim_command(bst_ctx *ctx, bst_sim *sim, const char *scope, const char *channel,
                           const void *payload) {
    assert(sim && channel && payload);
    bst_link_type type = bst_wire_type_of(channel);
    if (type == BST_LINK_TYPES) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no message \"%s\"", channel);
    }
    bst_status status =
        bst_link_put(ctx, bst_simulation_link(sim->simulation), scope, type, payload);
    return status == BST_ERR_FORMAT ? bst_fail_prefix(ctx, BST_ERR_ARGUMENT, "%s", channel)
                                    : status;
}

bst_status bst_sim_command_pointing(bst_ctx *ctx, bst_sim *sim, const char *scope,
                                    const bst_los_sample *samples, int count) {
    assert(sim && count >= 0 && (samples || count == 0));
    bst_link_pointing *pointing = calloc(1, sizeof *pointing + (size_t)count * sizeof *samples);
    if (!pointing) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d attitudes", count);
    }
    pointing->count = count;
    memcpy(pointing->items, samples, (size_t)count * sizeof *samples);
    bst_status status = bst_sim_command(ctx, sim, scope, "pointing", pointing);
    free(pointing);
    return status;
}

bst_status bst_sim_command_state(bst_ctx *ctx, bst_sim *sim, const char *object, double time_s,
                                 bst_vec3 position_m, bst_vec3 velocity_mps) {
    assert(sim && object);
    const double values[7] = {time_s,         position_m.x,   position_m.y,  position_m.z,
                              velocity_mps.x, velocity_mps.y, velocity_mps.z};
    for (int i = 0; i < 7; i++) {
        if (!isfinite(values[i])) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a time, position or velocity is not finite",
                            object);
        }
    }
    const bst_world_state state = {position_m, velocity_mps};
    return bst_world_steer(ctx, bst_simulation_world(sim->simulation), object, time_s, &state);
}

bst_status bst_sim_command_attitude(bst_ctx *ctx, bst_sim *sim, const char *object, double time_s,
                                    bst_quat q, bst_vec3 rate) {
    assert(sim && object);
    const double values[8] = {time_s, q.x, q.y, q.z, q.w, rate.x, rate.y, rate.z};
    for (int i = 0; i < 8; i++) {
        if (!isfinite(values[i])) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a time, attitude or rate is not finite",
                            object);
        }
    }
    return bst_world_turn(ctx, bst_simulation_world(sim->simulation), object, time_s, q, rate);
}
