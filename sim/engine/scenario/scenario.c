#include "sim/engine/scenario/scenario.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/former_names.h"
#include "sim/core/text.h"
#include "sim/engine/scenario/scenario_internal.h"
#include "sim/link/endpoint.h"

enum { FORMAT_VERSION = 1 };

static const bst_config_desc change_table[] = {
    BST_REAL(bst_scenario_change, time_s, "s", 0, 1e9, NULL,
             "Time of the change after the epoch, a whole number of ticks."),
    BST_STRING(
        bst_scenario_change, set, NULL,
        "What changes, as --set takes it: \"/observers/0/sensors/0/exposure/exposure_s=0.2\"; "
        "below /world or /observers."),
    BST_CONFIG_END,
};

const bst_config_desc bst_scenario_table[] = {
    {.key = "boresight",
     .type = BST_CONFIG_INT,
     .unit = "",
     .minimum = FORMAT_VERSION,
     .maximum = FORMAT_VERSION,
     .doc = "Version of the scenario format.",
     .offset = offsetof(bst_scenario, format),
     .size = sizeof(int64_t)},
    {.key = "extends",
     .type = BST_CONFIG_RAW,
     .doc = "A scenario file, relative to this one's folder, whose values hold where this one says "
            "nothing else: each key beside replaces that file's whole key."},
    {.key = "set",
     .type = BST_CONFIG_RAW,
     .doc = "Only with extends: single values in place of that file's, by JSON pointer, as --set "
            "takes them: {\"/observers/0/sensors/0/cue/offset_deg\": 0.1}."},
    BST_STRING(bst_scenario, name, "\"scenario\"", "Name of the scenario."),
    BST_STRING(bst_scenario, epoch_utc, NULL,
               "Start of the simulated time, UTC: YYYY-MM-DDThh:mm:ss[.f]Z."),
    BST_REAL(bst_scenario, duration_s, "s", 0, 1e9, NULL, "Length of the simulated time."),
    BST_INT(bst_scenario, tick_rate_hz, "Hz", 1, 1000000, "6000",
            "Ticks per second; every rate must divide it."),
    BST_SEED(bst_scenario, seed, "\"0x1\"",
             "Master seed of all random numbers: \"0x2A\", \"42\" or 42."),
    BST_INT(bst_scenario, run, "", 0, 9e15, "0",
            "Number of the run in a study: other random numbers, same scene."),
    BST_OBJECT(bst_scenario, world, bst_world_config_table, "{}", "What is out there."),
    BST_LIST(bst_scenario, observers, bst_observer_config, bst_observer_config_table, 1, 1000, NULL,
             "The spacecraft that look."),
    {.key = "tasking",
     .type = BST_CONFIG_RAW,
     .doc = "The module that gives the sensors their targets: {\"type\": ...}; left out: each has "
            "its cue alone."},
    BST_OBJECT(bst_scenario, record, bst_record_config_table, "{}",
               "What is written to the run's folder."),
    BST_OBJECT(bst_scenario, link, bst_link_config_table, "{}",
               "Where other programs connect that play modules of type \"external\"."),
    BST_OBJECT(bst_scenario, pacing, bst_pacing_config_table, "{}",
               "How simulated time goes by the wall clock in boresight run."),
    BST_LIST(bst_scenario, changes, bst_scenario_change, change_table, 0, 10000, "[]",
             "Changes of this scenario while its run goes on, in the order of time; boresight view "
             "writes those that are made by hand. Only boresight run and view make them."),
    BST_CONFIG_END,
};

/* Checks a name of an observer, sensor or object: it becomes part of instance and file names. */
static bst_status check_name(bst_ctx *ctx, const bst_scenario *s, const char *path,
                             const char *name) {
    const char *allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
    if (!*name || strspn(name, allowed) != strlen(name)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: \"%s\" is no name (allowed: letters, digits, _ - .)", s->file,
                        path, name);
    }
    return BST_OK;
}

/* A number of a camera as the scenario gives it; NAN: it does not. */
static double given_number(const cJSON *root, int observer, int sensor, const char *key) {
    const cJSON *o =
        cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(root, "observers"), observer);
    const cJSON *s = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(o, "sensors"), sensor);
    const cJSON *camera = cJSON_GetObjectItemCaseSensitive(s, "camera");
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(camera, key);
    return cJSON_IsNumber(value) ? value->valuedouble : NAN;
}

static void note_given(const cJSON *root, bst_scenario *s) {
    const bst_observer_config *observers = s->observers.items;
    for (int i = 0; i < s->observers.count; i++) {
        bst_sensor_config *sensors = observers[i].sensors.items;
        for (int k = 0; k < observers[i].sensors.count; k++) {
            sensors[k].given_psf_fwhm_px = given_number(root, i, k, "psf_fwhm_px");
            sensors[k].given_throughput = given_number(root, i, k, "throughput");
            sensors[k].given_flux_v0 = given_number(root, i, k, "photon_flux_v0_per_s_m2");
        }
    }
}

static bst_status prepare_cameras(bst_ctx *ctx, bst_scenario *s) {
    const bst_observer_config *observers = s->observers.items;
    for (int i = 0; i < s->observers.count; i++) {
        for (int k = 0; k < observers[i].sensors.count; k++) {
            bst_camera *camera = &((bst_sensor_config *)observers[i].sensors.items)[k].camera;
            if (bst_camera_resolve_scale(ctx, camera) != BST_OK ||
                bst_camera_resolve_figures(ctx, camera) != BST_OK) {
                return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /observers/%d/sensors/%d/camera",
                                       s->file, i, k);
            }
            bool image = bst_camera_prepare(ctx, camera) == BST_OK;
            if (!image || bst_detector_config_check(ctx, &camera->detector) != BST_OK ||
                bst_detector_config_check_size(ctx, &camera->detector, camera->width_px,
                                               camera->height_px) != BST_OK) {
                return bst_fail_prefix(ctx, BST_ERR_CONFIG,
                                       "%s: /observers/%d/sensors/%d/camera/%s", s->file, i, k,
                                       image ? "detector" : "distortion");
            }
        }
    }
    return BST_OK;
}

/* Completes Keplerian elements with derived values, so that the resolved scenario contains them. */
static bst_status resolve_state(bst_ctx *ctx, const bst_scenario *s, const char *list, int index,
                                bst_orbit_config *orbit) {
    bool keplerian =
        orbit->source == BST_ORBIT_NUMERICAL && orbit->state.source == BST_STATE_KEPLERIAN;
    if (keplerian && bst_keplerian_resolve(ctx, &orbit->state) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: %s/%d/orbit/state", s->file, list, index);
    }
    return BST_OK;
}

static bst_status resolve_states(bst_ctx *ctx, bst_scenario *s) {
    bst_observer_config *observers = s->observers.items;
    bst_object_config *objects = s->world.objects.items;
    for (int i = 0; i < s->observers.count; i++) {
        BST_TRY(resolve_state(ctx, s, "/observers", i, &observers[i].orbit));
    }
    for (int i = 0; i < s->world.objects.count; i++) {
        BST_TRY(resolve_state(ctx, s, "/world/objects", i, &objects[i].orbit));
    }
    return BST_OK;
}

static bst_status check_names(bst_ctx *ctx, const bst_scenario *s) {
    const bst_observer_config *observers = s->observers.items;
    if (!bst_text_is_file_name(s->name)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /name: \"%s\" cannot be the name of a folder (allowed: 1 to 63 bytes "
                        "without \"/\" and control characters, not beginning with \".\")",
                        s->file, s->name);
    }
    for (int i = 0; i < s->observers.count; i++) {
        char path[100];
        snprintf(path, sizeof path, "/observers/%d/name", i);
        BST_TRY(check_name(ctx, s, path, observers[i].name));
        for (int k = 0; k < i; k++) {
            if (strcmp(observers[k].name, observers[i].name) == 0) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: %s: \"%s\" is the name of /observers/%d too", s->file, path,
                                observers[i].name, k);
            }
        }
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int k = 0; k < observers[i].sensors.count; k++) {
            snprintf(path, sizeof path, "/observers/%d/sensors/%d/name", i, k);
            BST_TRY(check_name(ctx, s, path, sensors[k].name));
            for (int m = 0; m < k; m++) {
                if (strcmp(sensors[m].name, sensors[k].name) == 0) {
                    return bst_fail(ctx, BST_ERR_CONFIG,
                                    "%s: %s: \"%s\" is the name of sensor %d too", s->file, path,
                                    sensors[k].name, m);
                }
            }
        }
    }
    return BST_OK;
}

/* Rejects "extends" that was not resolved, and "set" in a scenario that extends none. */
static bst_status check_extended(bst_ctx *ctx, const bst_json *json) {
    const cJSON *root = bst_json_root(json);
    if (cJSON_GetObjectItemCaseSensitive(root, "extends")) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /extends: the file that it names has not been read (allowed: in a "
                        "scenario's file; a program reads that by bst_json_load_extended)",
                        bst_json_name(json));
    }
    const cJSON *set = cJSON_GetObjectItemCaseSensitive(root, "set");
    return !set ? BST_OK
                : bst_config_fail(ctx, bst_json_name(json), "/set", set,
                                  "there is nothing that it changes", "only beside \"extends\"");
}

/* Checks the times and the form of the changes. */
static bst_status check_changes(bst_ctx *ctx, bst_scenario *s) {
    bst_scenario_change *changes = s->changes.items;
    for (int i = 0; i < s->changes.count; i++) {
        bst_scenario_change *c = &changes[i];
        bst_status status = bst_seconds_to_ticks(ctx, s->tick_rate_hz, c->time_s, &c->tick);
        if (status == BST_OK) {
            status = bst_json_check_assignment(ctx, c->set);
        }
        if (status == BST_OK && strncmp(c->set, "/world/", 7) != 0 &&
            strncmp(c->set, "/observers/", 11) != 0) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "set: \"%.200s\" cannot change during a run (allowed: keys below "
                              "/world and /observers)",
                              c->set);
        }
        if (status == BST_OK && i > 0 && c->tick < c[-1].tick) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "time_s: %.9g s is before that of the change before (%.9g s): put "
                              "them in the order of time",
                              c->time_s, c[-1].time_s);
        }
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /changes/%d", s->file, i);
        }
    }
    return BST_OK;
}

static bst_status read_scenario(bst_ctx *ctx, const bst_json *json,
                                const bst_scenario_registry *registry, bst_scenario *out) {
    memset(out, 0, sizeof *out);
    BST_TRY(check_extended(ctx, json));
    BST_TRY(bst_config_read(ctx, json, bst_json_root(json), "", bst_scenario_table, out));
    out->written = cJSON_Duplicate(bst_json_root(json), true);
    if (!out->written) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a scenario");
    }
    snprintf(out->file, sizeof out->file, "%s", bst_json_name(json));
    bst_scenario_folder(out->file, out->base_dir, sizeof out->base_dir);
    char address[BST_LINK_ENDPOINT_BYTES];
    if (*out->link.address && bst_link_endpoint_check(ctx, out->link.address, address) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /link/address", out->file);
    }
    if (bst_time_from_utc(ctx, out->epoch_utc, &out->epoch) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /epoch_utc", out->file);
    }
    if (bst_seconds_to_ticks(ctx, out->tick_rate_hz, out->duration_s, &out->duration_ticks) !=
        BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /duration_s", out->file);
    }
    if (bst_recorder_config_check(ctx, &out->record) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s", out->file);
    }
    BST_TRY(check_changes(ctx, out));
    note_given(bst_json_root(json), out);
    BST_TRY(prepare_cameras(ctx, out));
    BST_TRY(resolve_states(ctx, out));
    BST_TRY(check_names(ctx, out));
    BST_TRY(bst_scenario_paths(ctx, json, out, "", bst_scenario_table, out, false));
    return bst_scenario_modules(ctx, json, registry, out);
}

bst_status bst_scenario_read(bst_ctx *ctx, const bst_json *json,
                             const bst_scenario_registry *registry, bst_scenario *out) {
    assert(json && registry && out);
    const bst_document_tables tables = {bst_scenario_table, bst_scenario_tables_inside, registry};
    bst_json *described = NULL;
    bst_status status = BST_OK;
    *out = (bst_scenario){.format = 0};
    if (!bst_json_is_described(json)) {
        BST_TRY(bst_json_copy(ctx, json, &described));
        /* the file of a run that is over is not the user's to change */
        bool warn = registry->policy != BST_PLUGINS_SKIP;
        status = bst_json_describe(ctx, described, &tables, warn);
    }
    if (status == BST_OK) {
        status = read_scenario(ctx, described ? described : json, registry, out);
    }
    if (status != BST_OK) {
        bst_json_name_file(ctx, json);
    }
    bst_json_free(described);
    return status;
}

void bst_scenario_free(bst_scenario *s) {
    for (int i = 0; s->modules && i < s->module_count; i++) {
        bst_scenario_module_config *module = &s->modules[i];
        if (module->config && module->desc && module->desc->config) {
            bst_config_free(module->desc->config, module->config);
        }
        free(module->config);
    }
    free(s->modules);
    free(s->plugins);
    cJSON_Delete(s->written);
    bst_config_free(bst_scenario_table, s);
    memset(s, 0, sizeof *s);
}
