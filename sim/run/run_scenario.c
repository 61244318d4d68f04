#include "sim/run/run_scenario.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/cli/cli.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/wall_clock.h"
#include "sim/io/manifest.h"
#include "sim/run/run_internal.h"
#include "sim/run/run_link.h"
#include "sim/run/run_losses.h"
#include "sim/run/run_pacing.h"
#include "sim/run/run_space.h"
#include "sim/run/run_summary.h"

/* The state of the sensor with this scope "observer/sensor". */
static bst_run_sensor_watch *find_sensor(bst_run_execution *run, const char *scope) {
    bst_run_sensor_watch *sensor = run->sensors;
    while (strcmp(sensor->scope, scope) != 0) {
        sensor++; /* every scope of the engine belongs to a sensor */
    }
    return sensor;
}

/* The selection of a channel, restored or new; NULL: there is no room for it. */
static bst_run_watched *watched_channel(const bst_run_execution *run, bst_run_sensor_watch *sensor,
                                        const char *channel) {
    for (int i = 0; i < sensor->channel_count; i++) {
        if (strcmp(sensor->channels[i].channel, channel) == 0) {
            return &sensor->channels[i];
        }
    }
    if (sensor->channel_count == BST_RUN_WATCHED_CHANNELS) {
        return NULL;
    }
    bst_run_watched *watched = &sensor->channels[sensor->channel_count++];
    const bst_run_pixels pixels = bst_run_pixels_of(run, sensor);
    bst_run_watch(watched, run->recorder, channel, &pixels);
    return watched;
}

/* Observer `wants`: rejects messages that nothing uses; many come at the plant's rate. */
static bool wants(void *user, const char *scope, const char *channel, const void *payload,
                  int64_t tick, bst_hook_mark *mark) {
    bst_run_execution *run = user;
    if (!mark->of) {
        bst_run_sensor_watch *sensor = find_sensor(run, scope);
        mark->of = watched_channel(run, sensor, channel);
        if (!mark->of) {
            return true;
        }
    }
    return bst_run_wants(mark->of, run->recorder, payload, tick, mark);
}

/* Feeds a channel message to the sensor's tracking-loop summary and metrics. */
static bst_status judge(bst_run_execution *run, bst_run_sensor_watch *sensor, const char *channel,
                        const void *payload, int64_t tick) {
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        BST_TRY(bst_run_metrics_truth(&run->hooks, sensor->metrics, payload));
        return bst_loop_summary_truth(&run->hooks, sensor->summary, payload);
    }
    if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        bst_loop_summary_tracks(sensor->summary, payload, tick);
        return bst_run_metrics_tracks(&run->hooks, sensor->metrics, payload);
    }
    if (strcmp(channel, BST_CHANNEL_TRACKS_SMOOTHED) == 0) {
        bst_run_metrics_smoothed(sensor->metrics, payload);
    } else if (strcmp(channel, BST_CHANNEL_TRACK_IDENTITIES) == 0) {
        bst_run_metrics_identities(sensor->metrics, payload);
    } else if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        bst_run_metrics_detections(sensor->metrics, payload);
    } else if (strcmp(channel, BST_CHANNEL_CONTROL_STATUS) == 0) {
        bst_loop_summary_status(sensor->summary, payload);
    } else if (strcmp(channel, BST_CHANNEL_TASK) == 0) {
        int object = ((const bst_task *)payload)->object;
        int target = object >= 0 ? object : sensor->target;
        bst_loop_summary_retarget(sensor->summary, target);
        bst_run_metrics_retarget(sensor->metrics, target);
    }
    return BST_OK;
}

/* Observer of the engine: records, draws and evaluates a channel message. */
static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    bst_run_execution *run = user;
    bst_run_sensor_watch *sensor = find_sensor(run, scope);
    const bst_run_steering *steering = run->steering;
    if (steering && steering->message) {
        BST_TRY(steering->message(steering->user, &run->hooks, (int)(sensor - run->sensors),
                                  channel, payload, tick));
    }
    if (run->recorder && bst_recorder_wants(run->recorder, channel)) {
        BST_TRY(bst_recorder_channel(&run->hooks, run->recorder, sensor->recorder_index, channel,
                                     payload, tick));
    }
    if (sensor->pictures) {
        BST_TRY(bst_run_pictures_message(&run->hooks, sensor->pictures, channel, payload));
    }
    BST_TRY(bst_run_sightings_message(&run->hooks, run->sightings, (int)(sensor - run->sensors),
                                      channel, payload));
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        BST_TRY(bst_run_custody_detections(&run->hooks, run->custody, (int)(sensor - run->sensors),
                                           payload));
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        BST_TRY(bst_run_custody_tracks(&run->hooks, run->custody, (int)(sensor - run->sensors),
                                       payload));
    }
    pthread_mutex_lock(&run->summing);
    bst_status status = judge(run, sensor, channel, payload, tick);
    pthread_mutex_unlock(&run->summing);
    return status;
}

/* Observer of the engine: records an event. */
static bst_status on_event(void *user, int64_t tick, const char *instance, const char *kind,
                           const char *text) {
    bst_run_execution *run = user;
    return run->recorder
               ? bst_recorder_event(&run->hooks, run->recorder, tick, instance, kind, text)
               : BST_OK;
}

/* Receives each evaluated frame for metrics and pictures. */
static void on_judged(void *user, const bst_loop_frame *frame) {
    bst_run_sensor_watch *sensor = user;
    bst_run_metrics_frame(sensor->metrics, frame);
    if (sensor->pictures) {
        bst_run_pictures_judged(sensor->pictures, frame);
    }
}

/* Prints the progress line on standard error, at most 5 times a second. */
static void show_progress(bst_run_execution *run, int64_t tick, bool last) {
    double now = bst_wall_seconds();
    if (!run->progress || (!last && now - run->shown < 0.2)) {
        return;
    }
    run->shown = now;
    double rate = (double)run->scenario->tick_rate_hz;
    double simulated = (double)tick / rate, total = (double)run->end_tick / rate;
    double wall = bst_run_wall_s(run), done = simulated - (double)run->begin_tick / rate;
    double factor = wall > 0.0 ? done / wall : 0.0;
    double left = factor > 0.0 ? (total - simulated) / factor : 0.0;
    bst_loop_figures figures;
    bst_loop_frame newest;
    pthread_mutex_lock(&run->summing);
    bst_loop_summary_figures(run->sensors[0].summary, &figures);
    bst_loop_summary_newest(run->sensors[0].summary, &newest);
    pthread_mutex_unlock(&run->summing);
    char error[32] = "-", snr[32] = "-";
    if (newest.error_px < 1e5) {
        snprintf(error, sizeof error, "%.2f px", newest.error_px);
    }
    if (newest.target_snr > 0.0) {
        snprintf(snr, sizeof snr, "%.1f", newest.target_snr);
    }
    fprintf(stderr,
            "\r\033[K%7.1f / %.0f s  frame %lld  %-9s %s  error %s  SNR %s  %.1f x real time  %.0f "
            "s left",
            simulated, total, (long long)figures.frames, bst_mode_name(figures.final_mode),
            newest.in_track ? "in track" : "no track", error, snr, factor, left);
    if (last) {
        fputc('\n', stderr);
    }
    fflush(stderr);
}

/* Stop callback of the engine: true on a stop request or after the wall time limit. */
static bool interrupted(void *user, int64_t tick) {
    bst_run_execution *run = user;
    show_progress(run, tick, false);
    bst_run_wall_clock_note(run->wall_clock, (double)tick / (double)run->scenario->tick_rate_hz);
    run->cut = run->most_s > 0.0 && bst_wall_seconds() - run->started > run->most_s;
    return run->cut || (!(run->steering && run->steering->stops) && bst_stop_requested());
}

/* Prints losses and counters of the run. */
static void print_losses(const bst_run_execution *run) {
    bst_run_losses_printer printer = {.begun = false};
    for (int i = 0; i < run->sensor_count; i++) {
        bst_run_sensor_figures figures;
        bst_run_get_figures(&run->sensors[i], &figures);
        printer.sensor = run->sensor_count > 1 ? figures.scope : NULL;
        bst_run_losses_report(&figures.metrics.losses, bst_run_losses_print, &printer);
    }
    const char *name;
    int64_t count;
    printer.sensor = NULL;
    for (int i = 0; bst_engine_counter(bst_simulation_engine(run->sim), i, &name, &count); i++) {
        bst_run_losses_report_counter(name, count, bst_run_losses_print, &printer);
    }
}

/* Prints the summary table of the run. */
static void print_table(const bst_run_execution *run, const char *out, double wall) {
    double simulated = bst_run_simulated_s(run);
    for (int i = 0; i < run->sensor_count; i++) {
        bst_run_sensor_figures figures;
        bst_run_get_figures(&run->sensors[i], &figures);
        bst_run_summary_print(&figures);
    }
    bst_run_sightings_print(run->sightings);
    bst_run_custody_print(run->custody);
    print_losses(run);
    bst_run_pacing_print(run->scenario, run->sim);
    bst_run_print_row("wall time", "%.2f", wall, "s");
    bst_run_print_row("speed", "%.1f", wall > 0.0 ? simulated / wall : NAN, "x real time");
    printf("  %-28s %s\n", "results", out);
}

/* Creates summary, metrics and pictures for every sensor of the scenario. */
static bst_status watch_sensors(bst_run_execution *run, const bst_world *world,
                                const bst_run_request *request) {
    const bst_observer_config *observers = run->scenario->observers.items;
    int total = 0;
    for (int i = 0; i < run->scenario->observers.count; i++) {
        total += observers[i].sensors.count;
    }
    run->sensors = calloc((size_t)total, sizeof *run->sensors);
    if (!run->sensors) {
        return bst_fail(run->ctx, BST_ERR_MEMORY, "out of memory for %d sensors", total);
    }
    for (int i = 0; i < run->scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            bst_run_sensor_watch *w = &run->sensors[run->sensor_count];
            snprintf(w->scope, sizeof w->scope, "%s/%s", observers[i].name, sensors[s].name);
            int target =
                *sensors[s].cue.object ? bst_world_find_object(world, sensors[s].cue.object) : -1;
            w->target = target;
            BST_TRY(bst_loop_summary_create(run->ctx, world, i, s, run->scenario->tick_rate_hz,
                                            target, &w->summary));
            run->sensor_count++;
            if (w == run->sensors && request->out) {
                BST_TRY(bst_run_pictures_create(run->ctx, bst_world_camera(world, i, s),
                                                run->scenario->tick_rate_hz, run->scenario->epoch,
                                                target, &w->pictures));
            }
            BST_TRY(bst_run_metrics_create(run->ctx, world, i, s, target, &w->metrics));
            bst_loop_summary_on_frame(w->summary, on_judged, w);
        }
    }
    return BST_OK;
}

/* True if the sensor has an active module of this role. */
static bool has_module(const bst_scenario *scenario, int observer, int sensor, const char *role) {
    for (int i = 0; i < scenario->module_count; i++) {
        const bst_scenario_module_config *m = &scenario->modules[i];
        if (m->observer == observer && m->sensor == sensor && !m->off &&
            strcmp(m->desc->role, role) == 0) {
            return true;
        }
    }
    return false;
}

/* True if a module of the sensor has room for messages on a channel with items. */
static bool has_channel(const bst_run_execution *run, const char *scope, const char *name) {
    const bst_engine *engine = bst_simulation_engine(run->sim);
    const int index = bst_engine_find_channel(engine, scope, name);
    int capacity = 0;
    if (index >= 0) {
        (void)bst_engine_channel(engine, index, NULL, &capacity);
    }
    return capacity > 0;
}

/* Opens the recorder with all sensors of the run. */
static bst_status open_recorder(bst_run_execution *run, const bst_world *world) {
    const bst_scenario *scenario = run->scenario;
    const bst_observer_config *observers = scenario->observers.items;
    bst_recorder_sensor *list = calloc((size_t)run->sensor_count, sizeof *list);
    if (!list) {
        return bst_fail(run->ctx, BST_ERR_MEMORY, "out of memory for the recorder");
    }
    int n = 0;
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            const char *scope = run->sensors[n].scope; /* watch_sensors has the same order */
            list[n++] = (bst_recorder_sensor){
                .observer = observers[i].name,
                .sensor = sensors[s].name,
                .target = *sensors[s].cue.object ? sensors[s].cue.object : NULL,
                .camera = bst_world_camera(world, i, s),
                .has_truth = has_module(scenario, i, s, "scenegen"),
                .has_regions = has_channel(run, scope, BST_CHANNEL_REGIONS_OF_INTEREST),
                .has_wheels = has_channel(run, scope, BST_CHANNEL_WHEEL_STATUS)};
        }
    }
    char program[64];
    snprintf(program, sizeof program, "boresight %s", bst_version());
    bst_recorder_info info = {.epoch = scenario->epoch,
                              .tick_rate_hz = scenario->tick_rate_hz,
                              .program = program,
                              .sensors = list,
                              .sensor_count = n,
                              .begin_tick = run->begin_tick,
                              .world = world};
    bst_status status =
        bst_recorder_create(run->ctx, run->store, &scenario->record, &info, &run->recorder);
    for (int i = 0; status == BST_OK && i < n; i++) {
        run->sensors[i].recorder_index =
            bst_recorder_find(run->recorder, list[i].observer, list[i].sensor);
    }
    free(list);
    return status;
}

static void free_run(bst_run_execution *run) {
    for (int i = 0; i < run->sensor_count; i++) {
        bst_loop_summary_free(run->sensors[i].summary);
        bst_run_metrics_free(run->sensors[i].metrics);
        bst_run_pictures_free(run->sensors[i].pictures);
    }
    free(run->sensors);
    bst_run_sightings_free(run->sightings);
    bst_run_custody_free(run->custody);
    pthread_mutex_destroy(&run->summing);
}

/* Writes the files after frames and tables: pictures, and last the manifest. `ended`: status of the
 * run; after a failure it writes as much as possible. */
static bst_status write_ending(bst_run_execution *run, double wall, bst_status ended,
                               bst_ctx *ctx) {
    char why[BST_MESSAGE_BYTES];
    memcpy(why, ctx->message, sizeof why);
    bool failed = ended != BST_OK && ended != BST_ERR_INTERRUPTED;
    bst_status status = BST_OK;
    if (!failed && !run->request->no_pictures) {
        bst_loop_figures figures;
        bst_loop_summary_figures(run->sensors->summary, &figures);
        status = bst_run_pictures_write(ctx, run->sensors->pictures, bst_run_folder(run->store),
                                        run->scenario->name, &figures);
    }
    bst_status sealed = bst_run_seal(status == BST_OK ? ctx : NULL, run->store);
    status = status == BST_OK ? sealed : status;
    if (status != BST_OK && !failed) {
        memcpy(why, ctx->message, sizeof why);
    }
    bst_ctx *own = run->ctx;
    bst_ctx unheard = *ctx;
    run->ctx = status == BST_OK ? ctx : &unheard;
    bst_status worst = failed ? ended : status != BST_OK ? status : ended;
    bst_status written =
        bst_run_write_manifest(run, wall, worst, failed || status != BST_OK ? why : NULL);
    run->ctx = own;
    return status == BST_OK ? written : status;
}

/* Steps the simulation to its end. */
static bst_status step_through(bst_run_execution *run, double *wall) {
    bst_ctx *ctx = run->ctx;
    bst_engine *engine = bst_simulation_engine(run->sim);
    const bst_engine_hooks hooks = {run, on_message, on_event, interrupted, wants, &run->hooks};
    bst_engine_set_hooks(engine, &hooks);
    BST_TRY(bst_run_pacing_begin(ctx, run->scenario, run->sim));
    for (int i = 0; i < run->request->change_count; i++) {
        BST_TRY(on_event(run, run->start_tick, "scenario", "change", run->request->changes[i].set));
    }
    run->started = bst_wall_seconds();
    bst_run_wall_clock_go(run->wall_clock);
    bst_status status = bst_run_advance(run);
    bst_run_wall_clock_stop(run->wall_clock);
    *wall = bst_run_wall_s(run);
    ctx->warnings += run->hooks.warnings;
    for (int i = 0; i < run->sensor_count; i++) {
        bst_loop_summary_finish(run->sensors[i].summary);
    }
    show_progress(run, bst_engine_tick(engine), !run->part_ended);
    return status;
}

/* Steps the simulation without writing. */
static bst_status step_only(bst_run_execution *run, const bst_run_request *request, double *wall) {
    if (request->metrics) {
        const bst_world *world = bst_simulation_world(run->sim);
        BST_TRY(bst_run_sightings_create(run->ctx, world, &run->scenario->record,
                                         run->scenario->tick_rate_hz, NULL, &run->sightings));
        BST_TRY(bst_run_custody_create(run->ctx, world, run->scenario, NULL, &run->custody));
    }
    run->most_s = request->most_s;
    bst_status status = step_through(run, wall);
    if (status != BST_OK && !(status == BST_ERR_INTERRUPTED && run->cut)) {
        return status;
    }
    BST_TRY(bst_run_sightings_finish(run->ctx, run->sightings, bst_run_seconds(run)));
    return bst_run_custody_finish(run->ctx, run->custody, bst_run_seconds(run));
}

/* Judges by the targets of changed cues, where the earlier part of the run had others. */
static void take_targets(bst_run_execution *run) {
    bool cue_changed = false;
    for (int i = 0; i < run->request->change_count; i++) {
        cue_changed = cue_changed || strstr(run->request->changes[i].set, "/cue");
    }
    for (int i = 0; cue_changed && i < run->sensor_count; i++) {
        bst_run_sensor_watch *sensor = &run->sensors[i];
        bst_loop_summary_retarget(sensor->summary, sensor->target);
        bst_run_metrics_retarget(sensor->metrics, sensor->target);
    }
}

/* Begins file wall_clock.csv, or goes on with it. */
static bst_status open_wall_clock(bst_run_execution *run, bool resumes) {
    char path[4200];
    const double begin_s = (double)run->start_tick / (double)run->scenario->tick_rate_hz;
    BST_TRY(bst_run_file(run->ctx, run->store, BST_RUN_WALL_CLOCK, path, sizeof path));
    return bst_run_wall_clock_open(run->ctx, path, resumes, begin_s, &run->wall_clock);
}

/* Opens the folder of the run with its tables and the recorder. */
static bst_status open_record(bst_run_execution *run, const bst_run_request *request) {
    bst_ctx *ctx = run->ctx;
    const bst_world *world = bst_simulation_world(run->sim);
    const bool resumes = bst_run_resumes(request);
    BST_TRY(bst_run_check_space(ctx, run->scenario, request->out, request->force));
    BST_TRY(resumes ? bst_run_reopen(ctx, request->out, request->overwrite, &run->store)
                    : bst_run_create(ctx, request->out, request->overwrite, &run->store));
    cJSON *echo =
        request->echo ? cJSON_Duplicate(request->echo, true) : bst_scenario_echo(run->scenario);
    bst_status status = echo ? bst_io_run_write_json(ctx, run->store, "scenario.json", echo)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    cJSON_Delete(echo);
    BST_TRY(status);
    BST_TRY(open_recorder(run, world));
    BST_TRY(bst_run_sightings_create(ctx, world, &run->scenario->record,
                                     run->scenario->tick_rate_hz, run->store, &run->sightings));
    BST_TRY(bst_run_custody_create(ctx, world, run->scenario, run->store, &run->custody));
    BST_TRY(resumes ? bst_run_resume(run, request->restored) : BST_OK);
    BST_TRY(open_wall_clock(run, resumes));
    take_targets(run);
    return bst_run_link_record(ctx, run->sim, bst_run_folder(run->store));
}

/* Completes the recorder and its files after the last step, or after an error. `status`: of the
 * run so far. Returns the status of the run. */
static bst_status close_record(bst_run_execution *run, bool stepped, bst_status status,
                               double wall) {
    bst_ctx *ctx = run->ctx;
    /* an error while closing must not replace the reason of the end */
    bst_ctx closing = *ctx;
    if (stepped && !run->part_ended && (status == BST_OK || status == BST_ERR_INTERRUPTED)) {
        bst_status summed =
            bst_run_sightings_finish(&closing, run->sightings, bst_run_seconds(run));
        summed = summed == BST_OK
                     ? bst_run_custody_finish(&closing, run->custody, bst_run_seconds(run))
                     : summed;
        if (status == BST_OK && summed != BST_OK) {
            *ctx = closing;
            status = summed;
        }
    }
    bst_status closed = bst_recorder_close(&closing, run->recorder);
    run->recorder = NULL;
    bst_status clocked = bst_run_wall_clock_close(closed == BST_OK ? &closing : NULL,
                                                  run->wall_clock, bst_run_seconds(run));
    closed = closed == BST_OK ? clocked : closed;
    if (closed == BST_OK) {
        closed = bst_run_link_recorded(&closing, run->sim);
    }
    if (status == BST_OK && closed != BST_OK) {
        *ctx = closing;
        status = closed;
    }
    if (stepped && !run->part_ended) {
        bst_ctx after = *ctx;
        bst_status written = write_ending(run, wall, status, &after);
        if (status == BST_OK && written != BST_OK) {
            *ctx = after;
            status = written;
        }
    }
    return status;
}

/* Steps the simulation and records it. BST_OK: the folder is complete. An interrupted run is closed
 * and keeps its .partial name. */
static bst_status execute(bst_run_execution *run, const bst_run_request *request, double *wall) {
    bst_status status = open_record(run, request);
    if (!run->store) {
        return status;
    }
    bool stepped = status == BST_OK;
    if (stepped) {
        status = step_through(run, wall);
    }
    status = close_record(run, stepped, status, *wall);
    if (status == BST_OK) {
        status = bst_run_finish(run->ctx, run->store);
    } else {
        bst_run_abandon(run->store);
    }
    return status;
}

static bst_status fill_report(bst_run_execution *run, double wall, double part,
                              bst_run_report *report) {
    report->sensors = calloc((size_t)run->sensor_count, sizeof *report->sensors);
    if (!report->sensors) {
        return bst_fail(run->ctx, BST_ERR_MEMORY, "out of memory for the figures of the run");
    }
    report->count = run->sensor_count;
    report->wall_s = wall;
    report->part = part;
    report->has_sightings = bst_run_sightings_figures(run->sightings, &report->sightings);
    report->has_custody = bst_run_custody_figures(run->custody, &report->custody);
    for (int i = 0; i < run->sensor_count; i++) {
        const bst_run_sensor_watch *sensor = &run->sensors[i];
        bst_run_sensor_figures *f = &report->sensors[i];
        bst_run_get_figures(sensor, f);
    }
    return BST_OK;
}

bst_status bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                            const bst_run_request *request, bst_run_report *report) {
    bst_run_execution run = {.ctx = ctx,
                             .scenario = scenario,
                             .sim = sim,
                             .progress = request->progress,
                             .request = request,
                             .steering = request->steering};
    double wall = 0.0;
    bst_ctx_init(&run.hooks, ctx->log, ctx->log_user, ctx->log_level);
    pthread_mutex_init(&run.summing, NULL);
    bst_status status = bst_run_plan(&run, request);
    if (status == BST_OK) {
        status = watch_sensors(&run, bst_simulation_world(sim), request);
    }
    if (status == BST_OK && bst_stop_requested()) {
        status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted before the run began");
    }
    if (status == BST_OK) {
        status = request->out ? execute(&run, request, &wall) : step_only(&run, request, &wall);
    }
    if (status == BST_OK && request->print) {
        print_table(&run, request->out, wall);
    }
    if (status == BST_OK && report) {
        double part = run.cut ? bst_run_seconds(&run) / scenario->duration_s : 1.0;
        status = fill_report(&run, wall, part, report);
    }
    if (request->part_ended) {
        *request->part_ended = run.part_ended;
    }
    free_run(&run);
    return status;
}
