/* bst_model: a scenario that has been read and checked, and what its sims share. */
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/api/api_internal.h"
#include "sim/engine/simulation_state.h"
#include "sim/registry/registry.h"
#include "sim/world/world.h"

/* Reads the JSON of a scenario from its file or its text, and applies the overrides. */
static bst_status read_json(bst_ctx *ctx, const char *path, const bst_model_options *options,
                            bst_json **out) {
    BST_TRY(options->text
                ? bst_json_parse_described(ctx, path, options->text, bst_registry_tables(), out)
                : bst_json_load_described(ctx, path, bst_registry_tables(), out));
    for (int i = 0; i < options->assignment_count; i++) {
        BST_TRY(bst_json_set(ctx, *out, options->assignments[i]));
    }
    return BST_OK;
}

/* Lists the names of the sensors. */
static bst_status list_sensors(bst_ctx *ctx, bst_model *model) {
    const bst_observer_config *observers = model->scenario.observers.items;
    int count = 0;
    for (int i = 0; i < model->scenario.observers.count; i++) {
        count += observers[i].sensors.count;
    }
    model->sensors = calloc((size_t)count + 1, sizeof *model->sensors);
    if (!model->sensors) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a model");
    }
    for (int i = 0; i < model->scenario.observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            snprintf(model->sensors[model->sensor_count++], sizeof *model->sensors, "%s/%s",
                     observers[i].name, sensors[s].name);
        }
    }
    return BST_OK;
}

static bst_status read_model(bst_ctx *ctx, const char *path, const bst_model_options *options,
                             bst_model *model) {
    BST_TRY(read_json(ctx, path, options, &model->json));
    bst_scenario_registry registry = *bst_registry_shipped();
    registry.policy = options->no_plugins ? BST_PLUGINS_REFUSE : registry.policy;
    model->read = true; /* free it after an error too */
    BST_TRY(bst_scenario_read(ctx, model->json, &registry, &model->scenario));
    BST_TRY(bst_scenario_digest(ctx, &model->scenario, model->digest));
    return list_sensors(ctx, model);
}

bst_status bst_model_load(bst_ctx *ctx, const char *path, const bst_model_options *options,
                          bst_model **out) {
    static const bst_model_options defaults = {.text = NULL};
    options = options ? options : &defaults;
    assert(path && out && options->assignment_count >= 0 &&
           (options->assignments || options->assignment_count == 0));
    *out = NULL;
    bst_model *model = calloc(1, sizeof *model);
    if (!model) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a model of %s", path);
    }
    pthread_mutex_init(&model->opening, NULL);
    model->threads = options->threads;
    snprintf(model->device, sizeof model->device, "%s", options->device ? options->device : "");
    bst_status status = read_model(ctx, path, options, model);
    if (status != BST_OK) {
        bst_model_free(model);
        return status;
    }
    *out = model;
    return BST_OK;
}

bst_status bst_model_prepare(bst_ctx *ctx, const bst_model *constant) {
    bst_model *model = (bst_model *)constant; /* opened once, under its lock */
    bst_status status = BST_OK;
    pthread_mutex_lock(&model->opening);
    if (!model->shared) {
        const bst_shared_model_options how = {.device = model->device, .threads = model->threads};
        status = bst_shared_model_create(ctx, &model->scenario, &how, &model->shared);
    }
    pthread_mutex_unlock(&model->opening);
    return status;
}

void bst_model_free(bst_model *model) {
    if (model) {
        bst_shared_model_free(model->shared);
        if (model->read) {
            bst_scenario_free(&model->scenario);
        }
        bst_json_free(model->json);
        free(model->sensors);
        pthread_mutex_destroy(&model->opening);
        free(model);
    }
}

const char *bst_model_name(const bst_model *model) {
    return model->scenario.name;
}
const char *bst_model_epoch_utc(const bst_model *model) {
    return model->scenario.epoch_utc;
}
int64_t bst_model_tick_rate_hz(const bst_model *model) {
    return model->scenario.tick_rate_hz;
}
double bst_model_duration_s(const bst_model *model) {
    return model->scenario.duration_s;
}
uint64_t bst_model_seed(const bst_model *model) {
    return model->scenario.seed;
}
uint64_t bst_model_run(const bst_model *model) {
    return (uint64_t)model->scenario.run;
}
int bst_model_sensor_count(const bst_model *model) {
    return model->sensor_count;
}
const char *bst_model_sensor(const bst_model *model, int sensor) {
    return sensor >= 0 && sensor < model->sensor_count ? model->sensors[sensor] : NULL;
}

const bst_camera *bst_model_camera(const bst_model *model, int sensor) {
    if (!model->shared || sensor < 0) {
        return NULL;
    }
    const bst_world *world = model->shared->world;
    for (int o = 0; o < bst_world_observer_count(world); o++) {
        int count = bst_world_sensor_count(world, o);
        if (sensor < count) {
            return bst_world_camera(world, o, sensor);
        }
        sensor -= count;
    }
    return NULL;
}

bst_status bst_model_scenario(bst_ctx *ctx, const bst_model *model, char **out) {
    cJSON *echo = bst_scenario_echo(&model->scenario);
    *out = echo ? cJSON_Print(echo) : NULL;
    cJSON_Delete(echo);
    return *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a scenario's text");
}

void bst_text_free(char *text) {
    cJSON_free(text);
}
