/* Stepping and saved states of a live run. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "sim/cli/stop_signals.h"
#include "sim/core/wall_clock.h"
#include "sim/io/run_files.h"
#include "view/folder_copy.h"
#include "view/live_internal.h"
#include "view/space_scene.h"

/* Wall time between two looks at commands while it runs flat out, s: a command waits so long at
 * most, and a look costs about a millisecond. */
static const double LOOK_S = 0.1;
/* Wall time between two states that are saved without being asked for, s. */
static const double SAVE_EVERY_S = 10.0;
/* Memory of all saved states, bytes. */
static const size_t STATE_BYTES = (size_t)512 << 20;

static void wait_command(bst_view_live *live, double wait_s) {
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    const int64_t nanoseconds = until.tv_nsec + (int64_t)(1e9 * wait_s);
    until.tv_sec += nanoseconds / 1000000000;
    until.tv_nsec = nanoseconds % 1000000000;
    pthread_cond_timedwait(&live->commanded, &live->lock, &until);
}

/* Says of the run's folder whether it is being written. Call it with the lock held. */
static void set_written(bst_view_live *live, bool written) {
    bst_ctx ignored = {0};
    bst_view_run *run;
    if (bst_view_subject_run(&ignored, live->subject, live->run, &run) == BST_OK) {
        bst_view_run_set_written(run, written);
    }
}

/* ------------------------------------------------------------------ pace */

/* Counts the frames that steps wait for, and measures the speed. */
static void look(bst_view_live *live) {
    const double now = bst_wall_seconds();
    const int64_t frames = __atomic_load_n(&live->frames, __ATOMIC_RELAXED);
    if (live->steps > 0) {
        live->steps -= frames - live->frames_then;
        if (live->steps <= 0) {
            live->steps = 0;
            live->paused = true;
        }
    }
    live->frames_then = frames;
    if (now - live->speed_s >= 0.5 && !live->paused) {
        live->speed =
            (double)(live->tick - live->speed_tick) / live->tick_rate_hz / (now - live->speed_s);
        live->speed_tick = live->tick;
        live->speed_s = now;
    }
}

/* Tick to which the run may go now; the present one: it is ahead of the clock. */
static int64_t allowed_tick(bst_view_live *live) {
    const int64_t least = live->period_ticks / 8 > 0 ? live->period_ticks / 8 : 1;
    const double now = bst_wall_seconds();
    if (live->steps > 0) {
        return live->tick + least;
    }
    if (live->rate > 0.0) {
        const double ticks = live->rate * (now - live->anchor_s) * live->tick_rate_hz;
        const int64_t allowed = live->anchor_tick + (int64_t)fmin(ticks, 9e15);
        if ((double)(live->tick - allowed) > live->tick_rate_hz * live->rate || /* rate has risen */
            (double)(allowed - live->tick) >
                live->tick_rate_hz * live->rate) { /* too slow for it */
            bst_view_live_anchor(live);
        }
        const int64_t most = live->tick + (int64_t)ceil(LOOK_S * live->rate * live->tick_rate_hz);
        return allowed < most ? allowed : most;
    }
    const double took = now - live->asked_s;
    const double factor = fmin(2.0, fmax(0.5, LOOK_S / fmax(took, 1e-4)));
    live->chunk_ticks = (int64_t)((double)live->chunk_ticks * factor);
    live->chunk_ticks = live->chunk_ticks < least ? least : live->chunk_ticks;
    live->asked_s = now;
    return live->tick + live->chunk_ticks;
}

/* True if a state is due without a command: at a pause, and now and then. */
static bool save_is_due(bst_view_live *live) {
    const bst_view_state *last =
        live->state_count > 0 ? &live->states[live->state_count - 1] : NULL;
    const bool pause = live->paused && !live->settled;
    if (last && last->tick == live->tick && last->made == live->made) {
        live->settled = live->paused;
        return false;
    }
    if (pause || !last || bst_wall_seconds() - live->saved_s > SAVE_EVERY_S) {
        live->settled = live->paused;
        live->why = !last ? "start" : pause ? "pause" : "automatic";
        return true;
    }
    return false;
}

/* The part has begun: its simulation is there, and its folder has the scenario. */
static void begin_part(bst_view_live *live) {
    bst_ctx ignored = {0};
    bst_view_run *run;
    live->part_begun = true;
    if (bst_view_subject_run(&ignored, live->subject, live->run, &run) == BST_OK) {
        bst_view_space_forget(run);
    }
    if (live->begun) {
        live->begun(live->begun_user);
        live->begun = NULL;
    }
}

static bst_run_action next(void *user, int64_t tick, int64_t *until_tick) {
    bst_view_live *live = user;
    bst_run_action action = BST_RUN_ADVANCE;
    pthread_mutex_lock(&live->lock);
    live->tick = tick;
    if (!live->part_begun) {
        begin_part(live);
    }
    for (look(live);;) {
        int64_t most = INT64_MAX;
        if (bst_stop_requested()) {
            action = BST_RUN_END;
            break;
        }
        if (bst_run_parts_due(live->parts, live->made, tick, &most)) {
            live->why = "change";
            action = BST_RUN_PART;
            break;
        }
        if (live->command_count > 0) {
            const bool acts = bst_view_live_obey(live, tick, &action);
            bst_view_feed_wake(live->feed);
            if (acts) {
                break;
            }
            continue;
        }
        if (save_is_due(live)) {
            action = BST_RUN_SAVE;
            break;
        }
        if (!live->paused) {
            const int64_t allowed = allowed_tick(live);
            *until_tick = live->until_tick = allowed < most ? allowed : most;
            action = BST_RUN_ADVANCE;
            if (*until_tick > tick) {
                break;
            }
        }
        wait_command(live, live->paused ? 0.2 : 0.01);
    }
    pthread_mutex_unlock(&live->lock);
    return action;
}

/* Opens the run's folder for the page, once it exists. Call it with the lock held. */
static void open_folder(bst_view_live *live) {
    char partial[sizeof live->out + 16];
    snprintf(partial, sizeof partial, "%s.partial", live->out);
    if (bst_view_subject_open(&live->ctx, live->subject, partial, &live->run) != BST_OK) {
        snprintf(live->message, sizeof live->message, "%s", live->ctx.message);
        live->run = -1;
    }
    set_written(live, true);
}

/* Takes a message of a run that another caller steps. */
static bst_status on_watched(void *user, bst_ctx *ctx, int sensor, const char *channel,
                             const void *payload, int64_t tick) {
    bst_view_live *live = user;
    __atomic_store_n(&live->tick, tick, __ATOMIC_RELAXED);
    if (!live->opened) { /* only this thread comes here */
        live->opened = true;
        pthread_mutex_lock(&live->lock);
        open_folder(live);
        pthread_mutex_unlock(&live->lock);
    }
    return bst_view_feed_message(live->feed, ctx, sensor, channel, payload, tick);
}

static bst_status on_message(void *user, bst_ctx *ctx, int sensor, const char *channel,
                             const void *payload, int64_t tick) {
    bst_view_live *live = user;
    if (sensor == 0 &&
        (strcmp(channel, live->counted) == 0 ||
         (strcmp(channel, BST_CHANNEL_TRUTH) == 0 && ((const bst_truth *)payload)->dropped))) {
        __atomic_fetch_add(&live->frames, 1, __ATOMIC_RELAXED);
    }
    return bst_view_feed_message(live->feed, ctx, sensor, channel, payload, tick);
}

/* ------------------------------------------------------------------ states */

static void drop_state(bst_view_live *live, int index) {
    free(live->states[index].bytes);
    memmove(&live->states[index], &live->states[index + 1],
            (size_t)(--live->state_count - index) * sizeof live->states[0]);
}

/* State that goes first: the first, the last and those that were asked for stay longest, and the
 * one to go to stays. 0: none. */
static int choose_victim(const bst_view_live *live) {
    int second = 0;
    for (int i = 1; i < live->state_count; i++) {
        if (live->states[i].id == live->go_to) {
            continue;
        }
        if (strcmp(live->states[i].why, "saved") != 0) {
            return i;
        }
        second = second > 0 ? second : i;
    }
    return second;
}

/* Makes room for another state. */
static void make_room(bst_view_live *live, size_t bytes) {
    size_t held = bytes;
    int victim;
    for (int i = 0; i < live->state_count; i++) {
        held += live->states[i].size;
    }
    while ((live->state_count == BST_VIEW_LIVE_STATES || held > STATE_BYTES) &&
           (victim = choose_victim(live)) > 0) {
        held -= live->states[victim].size;
        drop_state(live, victim);
    }
}

static void on_saved(void *user, int64_t tick, void *bytes, size_t size) {
    bst_view_live *live = user;
    pthread_mutex_lock(&live->lock);
    if (live->go_to > 0) { /* it goes back: what is after that state is dropped anyway */
        free(bytes);
    } else {
        make_room(live, size);
        live->states[live->state_count++] = (bst_view_state){.id = ++live->next_id,
                                                             .tick = tick,
                                                             .bytes = bytes,
                                                             .size = size,
                                                             .made = live->made,
                                                             .why = live->why};
    }
    live->saved_s = bst_wall_seconds();
    live->asked_s = live->saved_s;
    if (live->run < 0) {
        open_folder(live);
    }
    pthread_mutex_unlock(&live->lock);
    bst_view_feed_wake(live->feed);
}

/* Drops the states after the one to go to, and the changes by hand that were made after it. Returns
 * it; the last one if none is to go to. */
static bst_status take_state(bst_ctx *ctx, bst_view_live *live, bst_view_state *out) {
    pthread_mutex_lock(&live->lock);
    int keep = live->state_count;
    if (live->go_to > 0 && bst_view_live_find(live, live->go_to)) {
        while (live->states[keep - 1].id != live->go_to) {
            keep--;
        }
    } else if (live->go_to > 0) {
        snprintf(live->message, sizeof live->message,
                 "that state is no longer kept: the run is at the last one that is");
    }
    while (live->state_count > keep) {
        drop_state(live, live->state_count - 1);
    }
    *out = live->states[keep - 1];
    const bool back = live->go_to > 0;
    if (back) {
        live->paused = true;
        live->steps = 0;
    }
    live->go_to = 0;
    live->branching = false;
    live->tick = out->tick;
    live->made = out->made;
    pthread_mutex_unlock(&live->lock);
    return back ? bst_run_parts_cut(ctx, live->parts, out->made) : BST_OK;
}

/* ------------------------------------------------------------------ parts */

/* Begins a branch: a copy of the run's folder, which is complete, under the next free name. */
static bst_status begin_branch(bst_ctx *ctx, bst_view_live *live) {
    char name[sizeof live->out + 16], partial[sizeof name + 16];
    struct stat found;
    int number = 2;
    do {
        snprintf(name, sizeof name, "%s-%d", live->out, number++);
        snprintf(partial, sizeof partial, "%s.partial", name);
    } while (stat(name, &found) == 0 || stat(partial, &found) == 0);
    if (strlen(name) >= sizeof live->out) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", name);
    }
    BST_TRY(bst_view_copy_run(ctx, live->out, partial));
    pthread_mutex_lock(&live->lock);
    int64_t run;
    bst_status status = bst_view_subject_open(ctx, live->subject, partial, &run);
    if (status == BST_OK) {
        memcpy(live->out, name, strlen(name) + 1);
        live->run = run;
        live->ended = false;
        const bst_view_state *to = bst_view_live_find(live, live->go_to);
        if (to) { /* the page sees the branch where it begins */
            live->tick = to->tick;
            live->made = to->made;
        }
        set_written(live, true);
    }
    pthread_mutex_unlock(&live->lock);
    if (status != BST_OK) {
        bst_view_remove_copy(partial);
    }
    return status;
}

/* Keeps the text of the scenario for the page, and its cameras for the newest frames. */
static void keep_scenario(bst_view_live *live, int64_t tick) {
    bst_ctx ignored = {0};
    bst_json *document;
    bst_scenario changed;
    char *text = NULL;
    if (bst_run_parts_changed(&ignored, live->parts, tick, &document, &changed) == BST_OK) {
        text = cJSON_PrintUnformatted(bst_json_root(document));
        bst_view_feed_restart(live->feed, &changed);
        bst_scenario_free(&changed);
        bst_json_free(document);
    }
    pthread_mutex_lock(&live->lock);
    cJSON_free(live->scenario);
    live->scenario = text;
    live->made = 0;
    const bst_scenario *scenario = bst_run_parts_scenario(live->parts);
    const bst_scenario_change *changes = scenario->changes.items;
    while (live->made < scenario->changes.count && changes[live->made].tick <= tick) {
        live->made++;
    }
    live->part_begun = false;
    bst_view_live_anchor(live);
    live->chunk_ticks = live->period_ticks;
    pthread_mutex_unlock(&live->lock);
}

/* Waits until a branch is asked for. False: the viewer ends. */
static bool wait_asked(bst_view_live *live) {
    bst_run_action action;
    bool branch = false;
    pthread_mutex_lock(&live->lock);
    live->ended = live->paused = true;
    set_written(live, false);
    if (live->until_tick >= bst_run_parts_scenario(live->parts)->duration_ticks) {
        live->tick = bst_run_parts_scenario(live->parts)->duration_ticks;
    }
    bst_view_feed_wake(live->feed);
    while (!branch && !bst_stop_requested()) {
        if (live->command_count > 0) {
            branch = bst_view_live_obey(live, live->tick, &action) && live->branching;
            live->paused = true;
            bst_view_feed_wake(live->feed);
        } else {
            wait_command(live, 0.2);
        }
    }
    pthread_mutex_unlock(&live->lock);
    return branch;
}

/* Waits for a branch, unless one is asked for, and begins it. False: the viewer ends. A branch that
 * cannot be made is a message: the run stays. */
static bool wait_branch(bst_ctx *ctx, bst_view_live *live) {
    while (live->branching || wait_asked(live)) {
        if (begin_branch(ctx, live) == BST_OK) {
            return true;
        }
        pthread_mutex_lock(&live->lock);
        snprintf(live->message, sizeof live->message, "there is no branch: %.900s", ctx->message);
        live->go_to = 0;
        live->branching = false;
        pthread_mutex_unlock(&live->lock);
    }
    return false;
}

/* Takes back a change with which the run could not begin its next part. */
static bst_status take_back(bst_ctx *ctx, bst_view_live *live, int made) {
    pthread_mutex_lock(&live->lock);
    live->made = made;
    snprintf(live->message, sizeof live->message, "the run cannot go on with this change: %.800s",
             ctx->message);
    pthread_mutex_unlock(&live->lock);
    return bst_run_parts_cut(ctx, live->parts, made);
}

bst_status bst_view_live_go(bst_ctx *ctx, bst_view_live *live, bool overwrite,
                            void (*begun)(void *user), void *user) {
    const bst_run_steering steering = {live, next, on_saved, on_message, true};
    bst_view_state from = {.tick = 0};
    bst_status status;
    live->begun = begun;
    live->begun_user = user;
    for (;;) {
        char out[sizeof live->out];
        snprintf(out, sizeof out, "%s", live->out);
        const bst_run_request request = {.out = out, .overwrite = overwrite, .steering = &steering};
        bst_run_part part = {from.bytes, from.size, from.tick, from.made, false};
        keep_scenario(live, part.tick);
        status = bst_run_parts_run(ctx, live->parts, &part, &request);
        const bool changed = bst_run_parts_by_hand(live->parts, from.made) > 0;
        if (status == BST_ERR_INTERRUPTED && part.ended) {
            BST_TRY(take_state(ctx, live, &from));
        } else if (status != BST_OK && !live->part_begun && from.bytes && changed) {
            BST_TRY(take_back(ctx, live, from.made));
        } else if (status == BST_OK && wait_branch(ctx, live)) {
            BST_TRY(take_state(ctx, live, &from));
        } else {
            return status;
        }
    }
}

/* ------------------------------------------------------------------ what others see */

/* Prepares what both kinds of live runs have. */
static bst_status create(bst_ctx *ctx, const bst_scenario *scenario, bst_view_subject *subject,
                         const char *out, bst_view_live **out_live) {
    bst_view_live *live = calloc(1, sizeof *live);
    pthread_condattr_t clock;
    *out_live = NULL;
    if (!live || pthread_mutex_init(&live->lock, NULL) != 0 || pthread_condattr_init(&clock) != 0) {
        free(live);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a live run");
    }
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
    pthread_cond_init(&live->commanded, &clock);
    pthread_condattr_destroy(&clock);
    bst_ctx_init(&live->ctx, NULL, NULL, BST_LOG_ERROR);
    live->subject = subject;
    live->run = -1;
    live->tick_rate_hz = (double)scenario->tick_rate_hz;
    live->duration_s = scenario->duration_s;
    bst_status status = bst_view_feed_create(ctx, scenario, &live->feed);
    const int length = (int)bst_run_folder_length(out);
    if (status == BST_OK && snprintf(live->out, sizeof live->out, "%.*s", length, out) >= 4000) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "%.200s...: the path is too long", out);
    }
    if (status != BST_OK) {
        bst_view_live_free(live);
        return status;
    }
    *out_live = live;
    return BST_OK;
}

bst_status bst_view_live_create(bst_ctx *ctx, bst_run_parts *parts, bst_view_subject *subject,
                                const char *out, bst_view_live **out_live) {
    const bst_scenario *scenario = bst_run_parts_scenario(parts);
    const bst_observer_config *observers = scenario->observers.items;
    const bst_exposure_config *exposure =
        &((const bst_sensor_config *)observers[0].sensors.items)->exposure;
    BST_TRY(create(ctx, scenario, subject, out, out_live));
    bst_view_live *live = *out_live;
    live->parts = parts;
    live->paused = true;
    live->period_ticks =
        (int64_t)ceil(fmax(exposure->period_s, exposure->exposure_s) * live->tick_rate_hz);
    live->counted = bst_scenario_module(scenario, 0, 0, "tracker")   ? BST_CHANNEL_TRACKS
                    : bst_scenario_module(scenario, 0, 0, "imgproc") ? BST_CHANNEL_DETECTIONS
                                                                     : BST_CHANNEL_TRUTH;
    return BST_OK;
}

bst_status bst_view_live_watch(bst_ctx *ctx, const bst_scenario *scenario,
                               bst_view_subject *subject, const char *out,
                               bst_view_live **out_live) {
    BST_TRY(create(ctx, scenario, subject, out, out_live));
    (*out_live)->steering = (bst_run_steering){.user = *out_live, .message = on_watched};
    return BST_OK;
}

const bst_run_steering *bst_view_live_steering(bst_view_live *live) {
    return &live->steering;
}

void bst_view_live_free(bst_view_live *live) {
    if (live) {
        while (live->state_count > 0) {
            drop_state(live, live->state_count - 1);
        }
        for (int i = 0; i < live->command_count; i++) {
            cJSON_Delete(live->commands[i]);
        }
        cJSON_free(live->scenario);
        bst_view_feed_free(live->feed);
        pthread_cond_destroy(&live->commanded);
        pthread_mutex_destroy(&live->lock);
        free(live);
    }
}

bst_view_feed *bst_view_live_feed(bst_view_live *live) {
    return live->feed;
}

char *bst_view_live_scenario(bst_view_live *live) {
    pthread_mutex_lock(&live->lock);
    char *copy = live->scenario ? strdup(live->scenario) : NULL;
    pthread_mutex_unlock(&live->lock);
    return copy;
}

cJSON *bst_view_live_state(bst_view_live *live) {
    cJSON *node = cJSON_CreateObject();
    pthread_mutex_lock(&live->lock);
    const int64_t tick = __atomic_load_n(&live->tick, __ATOMIC_RELAXED);
    cJSON_AddNumberToObject(node, "time_s", (double)tick / live->tick_rate_hz);
    cJSON_AddBoolToObject(node, "steered", live->parts != NULL);
    cJSON_AddNumberToObject(node, "duration_s", live->duration_s);
    cJSON_AddBoolToObject(node, "paused", live->paused);
    cJSON_AddNumberToObject(node, "steps", (double)live->steps);
    cJSON_AddBoolToObject(node, "ended", live->ended);
    cJSON_AddNumberToObject(node, "rate", live->rate);
    cJSON_AddNumberToObject(node, "speed", live->paused ? 0.0 : live->speed);
    cJSON_AddNumberToObject(node, "run", (double)live->run);
    cJSON_AddNumberToObject(node, "changes", live->made);
    cJSON_AddNumberToObject(node, "obeyed", (double)live->obeyed);
    cJSON_AddStringToObject(node, "message", live->message);
    cJSON *states = cJSON_AddArrayToObject(node, "states");
    for (int i = 0; i < live->state_count; i++) {
        cJSON *state = cJSON_CreateObject();
        cJSON_AddNumberToObject(state, "id", (double)live->states[i].id);
        cJSON_AddNumberToObject(state, "time_s", (double)live->states[i].tick / live->tick_rate_hz);
        cJSON_AddStringToObject(state, "why", live->states[i].why);
        cJSON_AddItemToArray(states, state);
    }
    pthread_mutex_unlock(&live->lock);
    return node;
}
