/* The manifest of a run. */
#include <math.h>
#include <stdio.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/cli/plugins.h"
#include "sim/core/json_number.h"
#include "sim/device/device.h"
#include "sim/io/manifest.h"
#include "sim/io/wcs.h"
#include "sim/run/run_internal.h"
#include "sim/run/run_losses.h"
#include "sim/run/run_pacing.h"
#include "sim/run/run_summary.h"

/* Summary of a sensor for the manifest. */
static cJSON *summary_of(const bst_run_sensor_watch *sensor, double real_time_factor) {
    bst_run_sensor_figures figures;
    bst_run_get_figures(sensor, &figures);
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

/* Adds how the run ended, and which part of the scenario it covers. */
static void add_ending(cJSON *root, const bst_run_execution *run, bst_status ended,
                       const char *why) {
    const double rate = (double)run->scenario->tick_rate_hz;
    cJSON_AddBoolToObject(root, "complete", ended == BST_OK);
    cJSON_AddStringToObject(root, "ended",
                            ended == BST_OK                ? "complete"
                            : ended == BST_ERR_INTERRUPTED ? "interrupted"
                                                           : "failed");
    if (why) {
        cJSON_AddStringToObject(root, "error", why);
    }
    if (run->begin_tick > 0) {
        cJSON_AddNumberToObject(root, "begins_at_s", (double)run->begin_tick / rate);
    }
    if (run->end_tick < run->scenario->duration_ticks) {
        cJSON_AddNumberToObject(root, "until_s", (double)run->end_tick / rate);
    }
}

bst_status bst_run_write_manifest(const bst_run_execution *run, double wall, bst_status ended,
                                  const char *why) {
    const bst_scenario *scenario = run->scenario;
    bst_simulation *sim = run->sim;
    cJSON *root = cJSON_CreateObject();
    char text[64];
    cJSON_AddStringToObject(root, "program", "boresight");
    cJSON_AddStringToObject(root, "version", bst_version());
    cJSON_AddStringToObject(root, "git_revision", bst_version_git_revision());
    cJSON_AddStringToObject(root, "scenario", scenario->name);
    cJSON_AddStringToObject(root, "scenario_file", scenario->file);
    cJSON_AddStringToObject(root, "epoch_utc", scenario->epoch_utc);
    add_ending(root, run, ended, why);
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
    double simulated = bst_run_simulated_s(run);
    double factor = wall > 0.0 ? simulated / wall : NAN;
    if (run->sensor_count > 1) {
        cJSON *sensors = cJSON_AddObjectToObject(root, "sensors");
        for (int i = 0; i < run->sensor_count; i++) {
            cJSON_AddItemToObject(sensors, run->sensors[i].scope,
                                  summary_of(&run->sensors[i], factor));
        }
    }
    bst_run_sightings_add(run->sightings, root);
    bst_run_custody_add(run->custody, root);
    bst_run_pacing_add(root, scenario, sim);
    cJSON_AddItemToObject(root, "summary", summary_of(&run->sensors[0], factor));
    bst_status status = bst_io_run_write_json(run->ctx, run->store, "manifest.json", root);
    cJSON_Delete(root);
    return status;
}
