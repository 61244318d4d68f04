#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/cli/load.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/cli/cli.h"
#include "sim/cli/outputs.h"
#include "sim/cli/plugins.h"
#include "sim/core/file.h"
#include "sim/core/former_names.h"
#include "sim/link/external.h"
#include "sim/registry/registry.h"

/* Longest scenario on the standard input; that of files. */
enum { INPUT_BYTES = 64 << 20 };

/* Makes a module external: changes its type; keeps keys that are common to all modules or define
 * how frames are commanded. One that is external already stays as it is. */
static void make_external(cJSON *module) {
    static const char *const kept[] = {"rate_hz",  "offset_s",    "delay_s", "exposure_s",
                                       "period_s", "description", "platform"};
    bool control = strcmp(module->string, "control") == 0,
         gimbal = strcmp(module->string, "gimbal") == 0;
    const char *type = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(module, "type"));
    if (type && strcmp(type, "external") == 0) {
        return;
    }
    for (cJSON *item = module->child, *next; item; item = next) {
        bool keep = false;
        next = item->next;
        for (size_t i = 0; i < sizeof kept / sizeof *kept; i++) {
            bool holds = i < 3 || i == 5 || (i < 5 && control) || (i == 6 && gimbal);
            keep |= holds && strcmp(item->string, kept[i]) == 0;
        }
        if (!keep) {
            cJSON_Delete(cJSON_DetachItemViaPointer(module, item));
        }
    }
    cJSON_AddStringToObject(module, "type", "external");
}

/* Applies --external: "imgproc,control" of all sensors, or "observer/sensor/imgproc". */
static bst_status apply_external(bst_ctx *ctx, const char *names, bst_json *json) {
    while (*names) {
        int length = (int)strcspn(names, ","), found = 0;
        const cJSON *observer, *sensor;
        cJSON *module;
        cJSON_ArrayForEach(observer,
                           cJSON_GetObjectItemCaseSensitive(bst_json_root(json), "observers")) {
            cJSON_ArrayForEach(sensor, cJSON_GetObjectItemCaseSensitive(observer, "sensors")) {
                const char *o = cJSON_GetStringValue(
                               cJSON_GetObjectItemCaseSensitive(observer, "name")),
                           *s = cJSON_GetStringValue(
                               cJSON_GetObjectItemCaseSensitive(sensor, "name"));
                cJSON_ArrayForEach(module, cJSON_GetObjectItemCaseSensitive(sensor, "modules")) {
                    char full[300];
                    snprintf(full, sizeof full, "%.100s/%.100s/%.64s", o ? o : "", s ? s : "",
                             module->string);
                    bool named =
                        ((int)strlen(full) == length && !strncmp(full, names, (size_t)length)) ||
                        ((int)strlen(module->string) == length &&
                         !strncmp(module->string, names, (size_t)length));
                    if (named && cJSON_IsObject(module) && bst_external_role(module->string)) {
                        make_external(module);
                        found++;
                    }
                }
            }
        }
        if (!found) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--external: the scenario has no module \"%.*s\" that can be outside "
                            "(allowed: imgproc, tracker, control, gimbal, or "
                            "OBSERVER/SENSOR/MODULE)",
                            length, names);
        }
        names += length + (names[length] == ',');
    }
    return BST_OK;
}

static bst_status assign_text(bst_ctx *ctx, bst_json *json, const char *pointer, const char *text) {
    return bst_json_assign(ctx, json, pointer, cJSON_CreateString(text));
}

/* Applies --set, --external and --link to the scenario document. */
static bst_status apply(bst_ctx *ctx, const bst_load_options *options, bst_json *json) {
    for (int i = 0; i < options->set.count; i++) {
        if (bst_json_set(ctx, json, options->set.items[i]) != BST_OK) {
            return bst_fail_prefix(ctx, BST_ERR_ARGUMENT, "%s", bst_json_name(json));
        }
    }
    if (options->external) {
        BST_TRY(apply_external(ctx, options->external, json));
    }
    if (options->link) {
        BST_TRY(assign_text(ctx, json, "/link/address", options->link));
    }
    if (options->link_keys) {
        char *full = realpath(options->link_keys, NULL);
        if (!full) {
            return bst_fail(ctx, BST_ERR_NOT_FOUND, "--link-keys %s: %s", options->link_keys,
                            strerror(errno));
        }
        bst_status status = assign_text(ctx, json, "/link/keys_file", full);
        free(full);
        BST_TRY(status);
    }
    if (options->pacing) {
        BST_TRY(assign_text(ctx, json, "/pacing/mode", options->pacing));
    }
    if (options->seed) {
        BST_TRY(assign_text(ctx, json, "/seed", options->seed));
    }
    if (options->duration_s >= 0.0) {
        BST_TRY(bst_json_assign(ctx, json, "/duration_s", cJSON_CreateNumber(options->duration_s)));
    }
    if (options->run >= 0) {
        BST_TRY(bst_json_assign(ctx, json, "/run", cJSON_CreateNumber((double)options->run)));
    }
    return BST_OK;
}

bst_status bst_load_check(bst_ctx *ctx, bst_load_options *options, const bst_option *table) {
    options->table = table;
    for (int i = 0; i < options->set.count; i++) {
        BST_TRY(bst_json_check_assignment(ctx, options->set.items[i]));
    }
    return BST_OK;
}

bst_status bst_load_check_sensor(bst_ctx *ctx, const bst_scenario *scenario, const char *name) {
    char known[400] = "";
    const bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensors = observers[o].sensors.items;
        for (int s = 0; s < observers[o].sensors.count; s++) {
            char full[160];
            snprintf(full, sizeof full, "%s/%s", observers[o].name, sensors[s].name);
            if (!name || strcmp(full, name) == 0) {
                return BST_OK;
            }
            size_t used = strlen(known);
            snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "", full);
        }
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "--sensor %.160s: %s has no such sensor (allowed: %s)",
                    name, scenario->file, known);
}

/* Checks that no output overwrites a file that the scenario names. */
static bst_status spare_named(bst_ctx *ctx, const bst_option *table, const cJSON *node) {
    for (const cJSON *item = node->child; item; item = item->next) {
        if (cJSON_IsString(item) && item->valuestring[0] == '/') {
            BST_TRY(bst_outputs_spare(ctx, table, item->valuestring, "the scenario names it"));
        }
        BST_TRY(spare_named(ctx, table, item));
    }
    return BST_OK;
}

/* Checks that no output is an input file of the scenario; existing files have absolute paths in the
 * resolved scenario. */
static bst_status spare_inputs(bst_ctx *ctx, const bst_option *table, const bst_json *json,
                               const bst_scenario *scenario) {
    if (!table) {
        return BST_OK;
    }
    const char *file;
    for (int i = 0; (file = bst_json_origin_file(json, i)) != NULL; i++) {
        BST_TRY(bst_outputs_spare(ctx, table, file, "the scenario extends it"));
    }
    cJSON *echo = bst_scenario_echo(scenario);
    if (!echo) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    }
    bst_status status = spare_named(ctx, table, echo);
    cJSON_Delete(echo);
    return status;
}

/* Reads a scenario from the standard input, as a file of the current folder. */
static bst_status load_standard_input(bst_ctx *ctx, bst_json **json) {
    static const char name[] = "standard input";
    size_t room = 65536, bytes = 0;
    char *text = malloc(room + 1);
    while (text && (bytes += fread(text + bytes, 1, room - bytes, stdin)) == room &&
           room < INPUT_BYTES) {
        char *longer = realloc(text, 2 * room + 1);
        if (!longer) {
            free(text);
        }
        text = longer;
        room *= 2;
    }
    bst_status status = BST_OK;
    if (!text) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", name);
    } else if (ferror(stdin)) {
        status = bst_fail(ctx, BST_ERR_IO, "%s: cannot be read", name);
    } else if (bytes == room) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%s: is longer than %d MiB; give a scenario file",
                          name, INPUT_BYTES >> 20);
    } else {
        text[bytes] = '\0';
        status = bst_file_check_text(ctx, name, text, bytes);
    }
    status = status == BST_OK
                 ? bst_json_parse_described(ctx, name, text, bst_registry_tables(), json)
                 : status;
    free(text);
    return status;
}

static bst_status load(bst_ctx *ctx, const char *path, const bst_load_options *options,
                       bst_json **json, bst_scenario *out) {
    BST_TRY(strcmp(path, "-") == 0
                ? load_standard_input(ctx, json)
                : bst_json_load_described(ctx, path, bst_registry_tables(), json));
    bst_status status = apply(ctx, options, *json);
    if (status == BST_OK) {
        status = bst_plugins_scenario_read(ctx, *json, out);
        if (status == BST_OK) {
            status = spare_inputs(ctx, options->table, *json, out);
        }
        if (status != BST_OK) {
            bst_scenario_free(out);
        }
    }
    if (status != BST_OK) {
        bst_json_free(*json);
        *json = NULL;
    }
    return status;
}

bst_status bst_load_scenario(bst_ctx *ctx, const char *path, const bst_load_options *options,
                             bst_json **json, bst_scenario *out) {
    /* the commands that are quiet later on warn of former names too */
    bst_log_level level = ctx->log_level;
    ctx->log_level = level < BST_LOG_WARNING ? BST_LOG_WARNING : level;
    bst_status status = load(ctx, path, options, json, out);
    ctx->log_level = level;
    return status;
}
