/* boresight loop: margins and predicted pointing of a scenario's control loops. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/analysis/loop/loop_model.h"
#include "sim/app/app.h"
#include "sim/cli/load.h"
#include "sim/io/draft_file.h"
#include "sim/io/plot.h"

typedef struct loop_request {
    bst_load_options load;
    bst_loop_options loop;
    const char *plot, *json, *sensor;
    bool help;
} loop_request;

static bst_status write_json(bst_ctx *ctx, const char *path, const cJSON *root) {
    char *text = cJSON_Print(root);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    bool print = strcmp(path, "-") == 0;
    bst_draft draft = {.stream = stdout};
    bst_status status = print ? BST_OK : bst_draft_open(ctx, path, &draft);
    if (status == BST_OK) {
        bool good = fprintf(draft.stream, "%s\n", text) > 0 && fflush(draft.stream) == 0;
        status =
            good ? BST_OK
                 : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
        status = print ? status : bst_draft_close(ctx, &draft, status);
    }
    free(text);
    return status;
}

/* Prints one sensor's loops and adds them to the report. */
static bst_status report(bst_ctx *ctx, const loop_request *r, const bst_loop_model *model,
                         cJSON *sensors, bool first) {
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

static bst_status all_sensors(bst_ctx *ctx, const loop_request *r, const bst_scenario *scenario,
                              cJSON *root) {
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
    return r->json ? write_json(ctx, r->json, root) : BST_OK;
}

int bst_cmd_loop(int argc, char **argv) {
    loop_request r = {.load = BST_LOAD_DEFAULTS, .loop = BST_LOOP_DEFAULTS};
    const bst_option table[] = {
        {.name = "plot",
         .kind = BST_OPTION_TEXT,
         .target = &r.plot,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "Bode, Nyquist, step response and rejection as PNG or SVG (the first sensor's)"},
        {.name = "json",
         .kind = BST_OPTION_TEXT,
         .target = &r.json,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "the figures as JSON; - prints them in place of the table"},
        {.name = "sensor",
         .kind = BST_OPTION_TEXT,
         .target = &r.sensor,
         .argument = "OBSERVER/SENSOR",
         .doc = "this sensor only"},
        {.name = "fix-sigma-px",
         .kind = BST_OPTION_REAL,
         .target = &r.loop.fix_sigma_px,
         .argument = "PX",
         .doc = "error of the attitude from a frame's stars, per axis (default 0.01)",
         .minimum = 0,
         .maximum = 100},
        BST_LOAD_OPTIONS(r.load),
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &r.help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "loop");
    }
    if (r.help) {
        printf(
            "usage: boresight loop SCENARIO.json [options]\n\n"
            "Linearises the control loops of a scenario and prints, for each axis of a mount, the "
            "margins of its\n"
            "servo and of the tracking loop round it, and the pointing error that jitter, drift "
            "and the frames'\n"
            "errors leave. Nothing is simulated.\n\n"
            "  boresight loop scenarios/neossat_geo_track.json --plot loop.png --json loop.json\n\n"
            "options:\n");
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (bst_plot_check_path(&ctx, r.plot) != BST_OK) {
        return bst_options_misuse(&ctx, "loop");
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "loop");
    }
    if (bst_load_check(&ctx, &r.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "loop");
    }
    bst_json *json = NULL;
    bst_scenario scenario;
    if (bst_load_scenario(&ctx, argv[1], &r.load, &json, &scenario) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    cJSON *root = cJSON_CreateObject();
    bst_status status = root ? all_sensors(&ctx, &r, &scenario, root) : BST_ERR_MEMORY;
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", root ? ctx.message : "out of memory");
    }
    cJSON_Delete(root);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status == BST_OK ? BST_EXIT_OK : BST_EXIT_FAILED;
}
