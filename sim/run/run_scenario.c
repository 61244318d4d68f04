#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/cli/cli.h"
#include "sim/cli/plugins.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/json_number.h"
#include "sim/core/wall_clock.h"
#include "sim/device/device.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/engine/simulation.h"
#include "sim/eval/loop_summary.h"
#include "sim/io/manifest.h"
#include "sim/io/wcs.h"
#include "sim/run/run_link.h"
#include "sim/run/run_losses.h"
#include "sim/run/run_pacing.h"
#include "sim/run/run_pictures.h"
#include "sim/run/run_scenario.h"
#include "sim/run/run_sightings.h"
#include "sim/run/run_space.h"
#include "sim/run/run_summary.h"
#include "sim/run/run_watched.h"

enum { WATCHED_CHANNELS = 32 };

/* A sensor with its evaluation and pictures. */
typedef struct watched_sensor {
    char scope[160];
    int recorder_index;
    bst_run_watched channels[WATCHED_CHANNELS];
    int channel_count;
    bst_loop_summary *summary;
    int target; /* object of its cue, -1: none */
    bst_run_metrics *metrics;
    bst_run_pictures *pictures; /* of the first sensor of a recorded run; else NULL */
} watched_sensor;

typedef struct run_state {
    bst_ctx *ctx;
    bst_ctx hooks;           /* for on_message and on_event, which another thread may call */
    pthread_mutex_t summing; /* protects the summaries during the run */
    const bst_scenario *scenario;
    bst_recorder *recorder;
    watched_sensor *sensors;
    int sensor_count;
    double most_s;                /* limit of stepping time; 0: none */
    bool cut;                     /* the limit was reached */
    bst_run_sightings *sightings; /* NULL: not requested */
    bool progress;
    double started, shown; /* wall seconds */
} run_state;

/* The state of the sensor with this scope "observer/sensor". */
static watched_sensor *find_sensor(run_state *run, const char *scope) {
    watched_sensor *sensor = run->sensors;
    while (strcmp(sensor->scope, scope) != 0) {
        sensor++; /* every scope of the engine belongs to a sensor */
    }
    return sensor;
}

/* Observer `wants`: rejects messages that nothing uses; many come at the plant's rate. */
static bool wants(void *user, const char *scope, const char *channel, const void *payload,
                  int64_t tick, bst_hook_mark *mark) {
    run_state *run = user;
    if (!mark->of) {
        watched_sensor *sensor = find_sensor(run, scope);
        if (sensor->channel_count == WATCHED_CHANNELS) {
            return true;
        }
        mark->of = &sensor->channels[sensor->channel_count++];
        const bst_run_pixels pixels = {
            .recorded = run->recorder && run->scenario->record.frames != BST_RECORD_NO_FRAMES,
            .pictured = sensor->pictures != NULL,
            .duration_ticks = run->scenario->duration_ticks};
        bst_run_watch(mark->of, run->recorder, channel, &pixels);
    }
    return bst_run_wants(mark->of, run->recorder, payload, tick, mark);
}

/* Feeds a channel message to the sensor's tracking-loop summary and metrics. */
static bst_status judge(run_state *run, watched_sensor *sensor, const char *channel,
                        const void *payload, int64_t tick) {
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        BST_TRY(bst_run_metrics_truth(&run->hooks, sensor->metrics, payload));
        return bst_loop_summary_truth(&run->hooks, sensor->summary, payload);
    }
    if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        bst_loop_summary_tracks(sensor->summary, payload, tick);
        return bst_run_metrics_tracks(&run->hooks, sensor->metrics, payload);
    }
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
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
    run_state *run = user;
    watched_sensor *sensor = find_sensor(run, scope);
    if (run->recorder && bst_recorder_wants(run->recorder, channel)) {
        BST_TRY(bst_recorder_channel(&run->hooks, run->recorder, sensor->recorder_index, channel,
                                     payload, tick));
    }
    if (sensor->pictures) {
        BST_TRY(bst_run_pictures_message(&run->hooks, sensor->pictures, channel, payload));
    }
    BST_TRY(bst_run_sightings_message(&run->hooks, run->sightings, (int)(sensor - run->sensors),
                                      channel, payload));
    pthread_mutex_lock(&run->summing);
    bst_status status = judge(run, sensor, channel, payload, tick);
    pthread_mutex_unlock(&run->summing);
    return status;
}

/* Observer of the engine: records an event. */
static bst_status on_event(void *user, int64_t tick, const char *instance, const char *kind,
                           const char *text) {
    run_state *run = user;
    return run->recorder
               ? bst_recorder_event(&run->hooks, run->recorder, tick, instance, kind, text)
               : BST_OK;
}

/* Receives each evaluated frame for metrics and pictures. */
static void on_judged(void *user, const bst_loop_frame *frame) {
    watched_sensor *sensor = user;
    bst_run_metrics_frame(sensor->metrics, frame);
    if (sensor->pictures) {
        bst_run_pictures_judged(sensor->pictures, frame);
    }
}

/* Prints the progress line on standard error, at most 5 times a second. */
static void show_progress(run_state *run, int64_t tick, bool last) {
    double now = bst_wall_seconds();
    if (!run->progress || (!last && now - run->shown < 0.2)) {
        return;
    }
    run->shown = now;
    double rate = (double)run->scenario->tick_rate_hz;
    double simulated = (double)tick / rate, total = run->scenario->duration_s;
    double wall = now - run->started, factor = wall > 0.0 ? simulated / wall : 0.0;
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
    run_state *run = user;
    show_progress(run, tick, false);
    run->cut = run->most_s > 0.0 && bst_wall_seconds() - run->started > run->most_s;
    return run->cut || bst_stop_requested();
}

/* Copies the figures of a sensor. */
static void get_figures(const watched_sensor *sensor, bst_run_sensor_figures *out) {
    snprintf(out->scope, sizeof out->scope, "%s", sensor->scope);
    bst_loop_summary_figures(sensor->summary, &out->loop);
    bst_run_metrics_figures(sensor->metrics, &out->metrics);
}

/* Summary of a sensor for the manifest. */
static cJSON *summary_of(const watched_sensor *sensor, double real_time_factor) {
    bst_run_sensor_figures figures;
    get_figures(sensor, &figures);
    return bst_run_summary_json(&figures, real_time_factor);
}

/* Adds the misfit of the WCS for distorted cameras to the manifest. */
static void add_misfits(cJSON *root, const bst_scenario *scenario) {
    const bst_observer_config *observers = scenario->observers.items;
    cJSON *node = cJSON_CreateObject();
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            char scope[160];
            snprintf(scope, sizeof scope, "%s/%s", observers[i].name, sensors[s].name);
            double misfit_px = bst_wcs_distortion_misfit_px(&sensors[s].camera);
            if (misfit_px > 0.0) {
                bst_json_add_number(node, scope, misfit_px);
            }
        }
    }
    if (node && node->child) {
        cJSON_AddItemToObject(root, "wcs_misfit_px", node);
    } else {
        cJSON_Delete(node);
    }
}

/* Writes the manifest. `why`: message of a failed run, else NULL. */
static bst_status write_manifest(const run_state *run, bst_simulation *sim, const bst_run *store,
                                 double wall, bst_status ended, const char *why) {
    const bst_scenario *scenario = run->scenario;
    cJSON *root = cJSON_CreateObject();
    char text[64];
    cJSON_AddStringToObject(root, "program", "boresight");
    cJSON_AddStringToObject(root, "version", bst_version());
    cJSON_AddStringToObject(root, "git_revision", bst_version_git_revision());
    cJSON_AddStringToObject(root, "scenario", scenario->name);
    cJSON_AddStringToObject(root, "scenario_file", scenario->file);
    cJSON_AddStringToObject(root, "epoch_utc", scenario->epoch_utc);
    cJSON_AddBoolToObject(root, "complete", ended == BST_OK);
    cJSON_AddStringToObject(root, "ended",
                            ended == BST_OK                ? "complete"
                            : ended == BST_ERR_INTERRUPTED ? "interrupted"
                                                           : "failed");
    if (why) {
        cJSON_AddStringToObject(root, "error", why);
    }
    snprintf(text, sizeof text, "0x%llX", (unsigned long long)scenario->seed);
    cJSON_AddStringToObject(root, "seed", text);
    cJSON_AddNumberToObject(root, "run", (double)scenario->run);
    const bst_device *device = bst_simulation_device(sim);
    cJSON_AddStringToObject(root, "device", device ? bst_device_description(device) : "");
    cJSON *kernels = cJSON_AddObjectToObject(root, "kernels");
    for (int i = 0; device && bst_device_built(device, i); i++) {
        const bst_device_kernel_source *kernel = bst_device_built(device, i);
        snprintf(text, sizeof text, "%08x%08x", kernel->hash_high, kernel->hash_low);
        cJSON_AddStringToObject(kernels, kernel->name, text);
    }
    bst_plugins_tell(scenario, root);
    bst_stars_info stars;
    bst_stars_get_info(bst_world_stars(bst_simulation_world(sim)), &stars);
    cJSON_AddStringToObject(root, "star_catalogue", stars.source);
    cJSON_AddNumberToObject(root, "stars", (double)stars.count);
    cJSON_AddNumberToObject(root, "last_tick", (double)bst_engine_tick(bst_simulation_engine(sim)));
    cJSON_AddNumberToObject(root, "wall_time_s", wall);
    cJSON_AddNumberToObject(root, "warnings", run->ctx->warnings);
    add_misfits(root, scenario);
    cJSON *counters = cJSON_AddObjectToObject(root, "counters");
    const char *name;
    int64_t count;
    for (int i = 0; bst_engine_counter(bst_simulation_engine(sim), i, &name, &count); i++) {
        cJSON_AddNumberToObject(counters, name, (double)count);
    }
    for (int i = 0; i < run->sensor_count; i++) {
        bst_run_metric_figures figures;
        bst_run_metrics_figures(run->sensors[i].metrics, &figures);
        bst_run_losses_add(root, run->sensors[i].scope, &figures.losses);
    }
    double simulated =
        (double)(bst_engine_tick(bst_simulation_engine(sim)) + 1) / (double)scenario->tick_rate_hz;
    double factor = wall > 0.0 ? simulated / wall : NAN;
    if (run->sensor_count > 1) {
        cJSON *sensors = cJSON_AddObjectToObject(root, "sensors");
        for (int i = 0; i < run->sensor_count; i++) {
            cJSON_AddItemToObject(sensors, run->sensors[i].scope,
                                  summary_of(&run->sensors[i], factor));
        }
    }
    bst_run_sightings_add(run->sightings, root);
    bst_run_pacing_add(root, scenario, sim);
    cJSON_AddItemToObject(root, "summary", summary_of(&run->sensors[0], factor));
    bst_status status = bst_io_run_write_json(run->ctx, store, "manifest.json", root);
    cJSON_Delete(root);
    return status;
}

/* Prints losses and counters of the run. */
static void print_losses(const run_state *run, bst_simulation *sim) {
    bst_run_losses_printer printer = {.begun = false};
    for (int i = 0; i < run->sensor_count; i++) {
        bst_run_sensor_figures figures;
        get_figures(&run->sensors[i], &figures);
        printer.sensor = run->sensor_count > 1 ? figures.scope : NULL;
        bst_run_losses_report(&figures.metrics.losses, bst_run_losses_print, &printer);
    }
    const char *name;
    int64_t count;
    printer.sensor = NULL;
    for (int i = 0; bst_engine_counter(bst_simulation_engine(sim), i, &name, &count); i++) {
        bst_run_losses_report_counter(name, count, bst_run_losses_print, &printer);
    }
}

/* Prints the summary table of the run. */
static void print_table(const run_state *run, bst_simulation *sim, const char *out, double wall) {
    double simulated = (double)(bst_engine_tick(bst_simulation_engine(sim)) + 1) /
                       (double)run->scenario->tick_rate_hz;
    for (int i = 0; i < run->sensor_count; i++) {
        bst_run_sensor_figures figures;
        get_figures(&run->sensors[i], &figures);
        bst_run_summary_print(&figures);
    }
    bst_run_sightings_print(run->sightings);
    print_losses(run, sim);
    bst_run_pacing_print(run->scenario, sim);
    bst_run_print_row("wall time", "%.2f", wall, "s");
    bst_run_print_row("speed", "%.1f", wall > 0.0 ? simulated / wall : NAN, "x real time");
    printf("  %-28s %s\n", "results", out);
}

/* Creates summary, metrics and pictures for every sensor of the scenario. */
static bst_status watch_sensors(run_state *run, const bst_world *world,
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
            watched_sensor *w = &run->sensors[run->sensor_count];
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

/* Opens the recorder with all sensors of the run. */
static bst_status open_recorder(run_state *run, const bst_world *world, bst_run *store) {
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
            list[n++] = (bst_recorder_sensor){
                .observer = observers[i].name,
                .sensor = sensors[s].name,
                .target = *sensors[s].cue.object ? sensors[s].cue.object : NULL,
                .camera = bst_world_camera(world, i, s),
                .has_truth = has_module(scenario, i, s, "scenegen")};
        }
    }
    char program[64];
    snprintf(program, sizeof program, "boresight %s", bst_version());
    bst_recorder_info info = {.epoch = scenario->epoch,
                              .tick_rate_hz = scenario->tick_rate_hz,
                              .program = program,
                              .sensors = list,
                              .sensor_count = n,
                              .world = world};
    bst_status status =
        bst_recorder_create(run->ctx, store, &scenario->record, &info, &run->recorder);
    for (int i = 0; status == BST_OK && i < n; i++) {
        run->sensors[i].recorder_index =
            bst_recorder_find(run->recorder, list[i].observer, list[i].sensor);
    }
    free(list);
    return status;
}

static void free_run(run_state *run) {
    for (int i = 0; i < run->sensor_count; i++) {
        bst_loop_summary_free(run->sensors[i].summary);
        bst_run_metrics_free(run->sensors[i].metrics);
        bst_run_pictures_free(run->sensors[i].pictures);
    }
    free(run->sensors);
    bst_run_sightings_free(run->sightings);
    pthread_mutex_destroy(&run->summing);
}

/* Writes the files after frames and tables: pictures, and last the manifest. `ended`: status of the
 * run; after a failure it writes as much as possible. */
static bst_status write_ending(run_state *run, bst_simulation *sim, bst_run *store, double wall,
                               bst_status ended, bst_ctx *ctx) {
    char why[BST_MESSAGE_BYTES];
    memcpy(why, ctx->message, sizeof why);
    bool failed = ended != BST_OK && ended != BST_ERR_INTERRUPTED;
    bst_status status = BST_OK;
    if (!failed) {
        bst_loop_figures figures;
        bst_loop_summary_figures(run->sensors->summary, &figures);
        status = bst_run_pictures_write(ctx, run->sensors->pictures, bst_run_folder(store),
                                        run->scenario->name, &figures);
    }
    bst_status sealed = bst_run_seal(status == BST_OK ? ctx : NULL, store);
    status = status == BST_OK ? sealed : status;
    if (status != BST_OK && !failed) {
        memcpy(why, ctx->message, sizeof why);
    }
    bst_ctx *own = run->ctx;
    bst_ctx unheard = *ctx;
    run->ctx = status == BST_OK ? ctx : &unheard;
    bst_status worst = failed ? ended : status != BST_OK ? status : ended;
    bst_status written =
        write_manifest(run, sim, store, wall, worst, failed || status != BST_OK ? why : NULL);
    run->ctx = own;
    return status == BST_OK ? written : status;
}

/* Simulated time so far in s. */
static double seconds_run(const run_state *run, bst_simulation *sim) {
    return (double)(bst_engine_tick(bst_simulation_engine(sim)) + 1) /
           (double)run->scenario->tick_rate_hz;
}

/* Steps the simulation to its end. */
static bst_status step_through(run_state *run, bst_simulation *sim, double *wall) {
    bst_ctx *ctx = run->ctx;
    const bst_engine_hooks hooks = {run, on_message, on_event, interrupted, wants, &run->hooks};
    bst_engine_set_hooks(bst_simulation_engine(sim), &hooks);
    BST_TRY(bst_run_pacing_begin(ctx, run->scenario, sim));
    run->started = bst_wall_seconds();
    bst_status status =
        bst_engine_run(ctx, bst_simulation_engine(sim), run->scenario->duration_ticks);
    *wall = bst_wall_seconds() - run->started;
    ctx->warnings += run->hooks.warnings;
    for (int i = 0; i < run->sensor_count; i++) {
        bst_loop_summary_finish(run->sensors[i].summary);
    }
    show_progress(run, bst_engine_tick(bst_simulation_engine(sim)), true);
    return status;
}

/* Steps the simulation without writing. */
static bst_status step_only(run_state *run, bst_simulation *sim, const bst_run_request *request,
                            double *wall) {
    if (request->metrics) {
        BST_TRY(bst_run_sightings_create(run->ctx, bst_simulation_world(sim),
                                         &run->scenario->record, run->scenario->tick_rate_hz, NULL,
                                         &run->sightings));
    }
    run->most_s = request->most_s;
    bst_status status = step_through(run, sim, wall);
    if (status != BST_OK && !(status == BST_ERR_INTERRUPTED && run->cut)) {
        return status;
    }
    return bst_run_sightings_finish(run->ctx, run->sightings, seconds_run(run, sim));
}

/* Steps the simulation and records it. BST_OK: the folder is complete. An interrupted run is closed
 * and keeps its .partial name. */
static bst_status execute(run_state *run, bst_simulation *sim, const bst_run_request *request,
                          double *wall) {
    bst_ctx *ctx = run->ctx;
    bst_run *store = NULL;
    BST_TRY(bst_run_check_space(ctx, run->scenario, request->out, request->force));
    BST_TRY(bst_run_create(ctx, request->out, request->overwrite, &store));
    cJSON *echo = bst_scenario_echo(run->scenario);
    bst_status status = echo ? bst_io_run_write_json(ctx, store, "scenario.json", echo)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    cJSON_Delete(echo);
    if (status == BST_OK) {
        status = open_recorder(run, bst_simulation_world(sim), store);
    }
    if (status == BST_OK) {
        status = bst_run_sightings_create(ctx, bst_simulation_world(sim), &run->scenario->record,
                                          run->scenario->tick_rate_hz, store, &run->sightings);
    }
    if (status == BST_OK) {
        status = bst_run_link_record(ctx, sim, bst_run_folder(store));
    }
    bool stepped = status == BST_OK;
    if (stepped) {
        status = step_through(run, sim, wall);
    }
    /* an error while closing must not replace the reason of the end */
    bst_ctx closing = *ctx;
    if (stepped && (status == BST_OK || status == BST_ERR_INTERRUPTED)) {
        bst_status summed =
            bst_run_sightings_finish(&closing, run->sightings, seconds_run(run, sim));
        if (status == BST_OK && summed != BST_OK) {
            *ctx = closing;
            status = summed;
        }
    }
    bst_status closed = bst_recorder_close(&closing, run->recorder);
    run->recorder = NULL;
    if (closed == BST_OK) {
        closed = bst_run_link_recorded(&closing, sim);
    }
    if (status == BST_OK && closed != BST_OK) {
        *ctx = closing;
        status = closed;
    }
    if (stepped) {
        bst_ctx after = *ctx;
        bst_status written = write_ending(run, sim, store, *wall, status, &after);
        if (status == BST_OK && written != BST_OK) {
            *ctx = after;
            status = written;
        }
    }
    if (status == BST_OK) {
        status = bst_run_finish(ctx, store);
    } else {
        bst_run_abandon(store);
    }
    return status;
}

static bst_status fill_report(run_state *run, double wall, double part, bst_run_report *report) {
    report->sensors = calloc((size_t)run->sensor_count, sizeof *report->sensors);
    if (!report->sensors) {
        return bst_fail(run->ctx, BST_ERR_MEMORY, "out of memory for the figures of the run");
    }
    report->count = run->sensor_count;
    report->wall_s = wall;
    report->part = part;
    report->has_sightings = bst_run_sightings_figures(run->sightings, &report->sightings);
    for (int i = 0; i < run->sensor_count; i++) {
        const watched_sensor *sensor = &run->sensors[i];
        bst_run_sensor_figures *f = &report->sensors[i];
        get_figures(sensor, f);
    }
    return BST_OK;
}

bst_status bst_run_scenario(bst_ctx *ctx, const bst_scenario *scenario, bst_simulation *sim,
                            const bst_run_request *request, bst_run_report *report) {
    run_state run = {.ctx = ctx, .scenario = scenario, .progress = request->progress};
    double wall = 0.0;
    bst_ctx_init(&run.hooks, ctx->log, ctx->log_user, ctx->log_level);
    pthread_mutex_init(&run.summing, NULL);
    bst_status status = watch_sensors(&run, bst_simulation_world(sim), request);
    if (status == BST_OK && bst_stop_requested()) {
        status = bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted before the run began");
    }
    if (status == BST_OK) {
        status = request->out ? execute(&run, sim, request, &wall)
                              : step_only(&run, sim, request, &wall);
    }
    if (status == BST_OK && request->print) {
        print_table(&run, sim, request->out, wall);
    }
    if (status == BST_OK && report) {
        double part = run.cut ? seconds_run(&run, sim) / scenario->duration_s : 1.0;
        status = fill_report(&run, wall, part, report);
    }
    free_run(&run);
    return status;
}
