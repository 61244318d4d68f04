#include "sim/analysis/loop/loop_sensors.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

#include "sim/cli/load.h"
#include "sim/cli/print_json.h"

/* Prints one sensor's loops and adds them to the report. */
static bst_status report(bst_ctx *ctx, const bst_loop_report_request *r,
                         const bst_loop_model *model, cJSON *sensors, bool first) {
    cJSON *node = bst_loop_json(model);
    if (!node) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    cJSON_AddItemToArray(sensors, node);
    if (!r->json || strcmp(r->json, "-") != 0) {
        bst_loop_print(model);
    }
    return r->plot && first ? bst_loop_plot(ctx, r->plot, model) : BST_OK;
}

static bst_status all_sensors(bst_ctx *ctx, const bst_loop_report_request *r,
                              const bst_scenario *scenario, cJSON *root) {
    const bst_observer_config *observers = scenario->observers.items;
    cJSON_AddStringToObject(root, "scenario", scenario->name);
    cJSON *sensors = cJSON_AddArrayToObject(root, "sensors");
    bool first = true;
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensor = observers[o].sensors.items;
        for (int s = 0; s < observers[o].sensors.count; s++) {
            char name[160];
            snprintf(name, sizeof name, "%s/%s", observers[o].name, sensor[s].name);
            if (r->sensor && strcmp(r->sensor, name) != 0) {
                continue;
            }
            bst_loop_model *model;
            BST_TRY(bst_loop_model_create(ctx, scenario, o, s, &r->loop, &model));
            if (!model) {
                continue;
            }
            bst_status status = report(ctx, r, model, sensors, first);
            first = false;
            bst_loop_model_free(model);
            BST_TRY(status);
        }
    }
    if (first) {
        BST_TRY(bst_load_check_sensor(ctx, scenario, r->sensor));
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        r->sensor ? "--sensor %s: has no mount that moves under command"
                                  : "%s: no sensor has a mount that moves under command",
                        r->sensor ? r->sensor : scenario->file);
    }
    return BST_OK;
}

bst_status bst_loop_report_sensors(bst_ctx *ctx, const bst_loop_report_request *request,
                                   const bst_scenario *scenario) {
    cJSON *root = cJSON_CreateObject();
    bst_status status = root ? all_sensors(ctx, request, scenario, root)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    if (status == BST_OK && request->json) {
        return bst_cli_write_json(ctx, request->json, root);
    }
    cJSON_Delete(root);
    return status;
}
