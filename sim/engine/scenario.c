#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/engine/scenario.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/engine/stand_in.h"

enum { FORMAT_VERSION = 1 };

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
             "Master seed of all random numbers, a hexadecimal string."),
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
    BST_CONFIG_END,
};

/* Keys that every module has besides those of its own table. */
typedef struct common_config {
    char type[64];
    double rate_hz, offset_s;
} common_config;

static const bst_config_desc common_table[] = {
    BST_STRING(common_config, type, NULL, "Which of the alternatives is used."),
    BST_REAL(common_config, rate_hz, "Hz", 0, 1e6, "0",
             "Steps per second; 0: the module's default."),
    BST_REAL(common_config, offset_s, "s", 0, 1e9, "0", "Time of the first step."),
    {.key = "delay_s",
     .type = BST_CONFIG_RAW,
     .doc = "Seconds after which what arrives on an input is seen, by channel."},
    BST_CONFIG_END,
};

static bool is_common(const char *key) {
    for (const bst_config_desc *d = common_table; d->key; d++) {
        if (strcmp(d->key, key) == 0) {
            return true;
        }
    }
    return false;
}

/* A copy of `node` with only the common keys, or only the others. */
static cJSON *part_of(const cJSON *node, bool common) {
    cJSON *part = cJSON_CreateObject();
    for (const cJSON *item = node->child; item && part; item = item->next) {
        if (is_common(item->string) == common) {
            cJSON_AddItemToObject(part, item->string, cJSON_Duplicate(item, 1));
        }
    }
    return part;
}

static const bst_module_desc *find_module(const bst_registry *registry, const char *role,
                                          const char *type) {
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        if (strcmp(m->role, role) == 0 &&
            (!type || strcmp(m->type, type) == 0 || (m->also && strcmp(m->also, type) == 0))) {
            return m;
        }
    }
    return NULL;
}

/* "a", "b", "c": the types of a role, or all roles when role is NULL. */
static void list_names(const bst_registry *registry, const char *role, char *buffer, size_t bytes) {
    buffer[0] = '\0';
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        if (role && strcmp(m->role, role) != 0) {
            continue;
        }
        if (!role && (m->flags & BST_MODULE_LINKS || find_module(registry, m->role, NULL) != m)) {
            continue; /* a role is listed once, and those that link sensors are not theirs */
        }
        size_t used = strlen(buffer);
        snprintf(buffer + used, bytes - used, "%s\"%s\"", used ? ", " : "",
                 role ? m->type : m->role);
    }
}

/* The folder of a file: what relative paths in it start from. */
static void folder_of(const char *file, char *folder, size_t bytes) {
    const char *slash = strrchr(file, '/');
    snprintf(folder, bytes, "%.*s", slash ? (int)(slash - file) : 1, slash ? file : ".");
}

/* Makes the path of a file that exists absolute, so that the resolved scenario can be run from any
 * folder. A file that does not exist is left to those who open it, from the folder of the scenario
 * that names it; `must_exist`: it is an error, when the path is relative. */
static bst_status resolve_path(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                               const char *where, bool must_exist, char *path, size_t bytes) {
    if (!*path) {
        return BST_OK;
    }
    char folder[sizeof s->base_dir], joined[sizeof folder + 520];
    folder_of(bst_json_file(json, where), folder, sizeof folder);
    if (path[0] == '/') {
        snprintf(joined, sizeof joined, "%s", path);
    } else {
        snprintf(joined, sizeof joined, "%s/%s", folder, path);
    }
    char *real = realpath(joined, NULL);
    if (!real && path[0] != '/' && must_exist) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s: there is no file %s", s->file, where, joined);
    }
    if (!real && path[0] != '/' && strcmp(folder, s->base_dir) != 0) {
        /* whoever opens it starts from base_dir */
        real = realpath(folder, NULL);
        snprintf(joined, sizeof joined, "%s/%s", real ? real : folder, path);
        free(real);
        real = strdup(joined);
    }
    if (!real) {
        return BST_OK;
    }
    size_t length = strlen(real);
    bst_status status =
        length < bytes ? BST_OK
                       : bst_fail(ctx, BST_ERR_CONFIG,
                                  "%s: %s: the full path of \"%s\" is %zu bytes long (allowed: "
                                  "%zu); move the file",
                                  s->file, where, path, length, bytes - 1);
    if (status == BST_OK) {
        memcpy(path, real, length + 1);
    }
    free(real);
    return status;
}

/* Whether a path is one of the words that stand for something else than a file. */
static bool is_word(const bst_config_desc *desc, const char *path) {
    for (const char *const *word = desc->choices; word && *word; word++) {
        if (strcmp(*word, path) == 0) {
            return true;
        }
    }
    return false;
}

/* Makes the files that a table names absolute. `must_exist`: a file that is not there is an error,
 * outside of lists. */
static bst_status resolve_paths(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                                const char *where, const bst_config_desc *table, void *object,
                                bool must_exist) {
    for (const bst_config_desc *d = table; d && d->key; d++) {
        char path[400];
        char *member = (char *)object + d->offset;
        snprintf(path, sizeof path, "%s/%s", where, d->key);
        if (d->type == BST_CONFIG_OBJECT) {
            BST_TRY(resolve_paths(ctx, json, s, path, d->children, member, must_exist));
        } else if (d->type == BST_CONFIG_LIST) {
            const bst_config_list *list = (const void *)member;
            for (int i = 0; i < list->count; i++) {
                snprintf(path, sizeof path, "%s/%s/%d", where, d->key, i);
                BST_TRY(resolve_paths(ctx, json, s, path, d->children,
                                      (char *)list->items + (size_t)i * d->item_bytes, false));
            }
        } else if (d->type == BST_CONFIG_PATH && *member && !is_word(d, member)) {
            BST_TRY(resolve_path(ctx, json, s, path, must_exist, member, d->size));
        }
    }
    return BST_OK;
}

static bst_status read_delays(bst_ctx *ctx, const bst_scenario *scenario, const cJSON *node,
                              const char *path, bst_module_config *module) {
    char where[400];
    snprintf(where, sizeof where, "%s/delay_s", path);
    if (node && !cJSON_IsObject(node)) {
        return bst_config_fail(ctx, scenario->file, where, node, "wrong type",
                               "an object of seconds by channel");
    }
    for (const cJSON *item = node ? node->child : NULL; item; item = item->next) {
        int port = -1;
        char inputs[300] = "";
        for (int p = 0; p < module->desc->port_count; p++) {
            const bst_port *candidate = &module->desc->ports[p];
            if (candidate->direction != BST_PORT_IN) {
                continue;
            }
            if (strcmp(candidate->channel, item->string) == 0) {
                port = p;
            }
            size_t used = strlen(inputs);
            snprintf(inputs + used, sizeof inputs - used, "%s%s", used ? ", " : "",
                     candidate->channel);
        }
        if (port < 0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: %s/delay_s/%s: not an input of this module (allowed: %s)",
                            scenario->file, path, item->string, inputs);
        }
        if (!cJSON_IsNumber(item) || !(item->valuedouble >= 0.0 && item->valuedouble <= 1e6)) {
            snprintf(where, sizeof where, "%s/delay_s/%s", path, item->string);
            return bst_config_fail(ctx, scenario->file, where, item,
                                   cJSON_IsNumber(item) ? "out of range" : "wrong type",
                                   "a number from 0 to 1e6 s");
        }
        if (module->delay_count == BST_MAX_DELAYS) {
            return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s/delay_s: too many delays", scenario->file,
                            path);
        }
        bst_input_delay *delay = &module->delays[module->delay_count++];
        delay->port = port;
        if (bst_seconds_to_ticks(ctx, scenario->tick_rate_hz, item->valuedouble, &delay->ticks) !=
            BST_OK) {
            return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: %s/delay_s/%s", scenario->file, path,
                                   item->string);
        }
    }
    return BST_OK;
}

static bst_status read_module(bst_ctx *ctx, const bst_json *json, const bst_registry *registry,
                              const bst_scenario *scenario, const cJSON *node, const char *path,
                              bst_module_config *module) {
    char names[400];
    snprintf(module->name, sizeof module->name, "%s", node->string);
    bool fleet = module->observer < 0;
    const bst_module_desc *any = find_module(registry, node->string, NULL);
    if (!any || (any->flags & BST_MODULE_LINKS) != (fleet ? BST_MODULE_LINKS : 0)) {
        list_names(registry, NULL, names, sizeof names);
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s: no module of this name (allowed: %s)",
                        scenario->file, path, names);
    }
    if (!cJSON_IsObject(node)) {
        return bst_config_fail(ctx, scenario->file, path, node, "wrong type",
                               "an object with a \"type\"");
    }
    cJSON *common_part = part_of(node, true), *own_part = part_of(node, false);
    common_config common;
    bst_status status =
        common_part && own_part ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    if (status == BST_OK) {
        status = bst_config_read(ctx, json, common_part, path, common_table, &common);
    }
    if (status == BST_OK) {
        module->desc = find_module(registry, node->string, common.type);
        if (!module->desc) {
            list_names(registry, node->string, names, sizeof names);
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "%s: %s/type: there is no %s of type \"%s\" (allowed: %s)",
                              scenario->file, path, node->string, common.type, names);
        }
    }
    static const bst_config_desc no_keys[] = {BST_CONFIG_END};
    if (status == BST_OK) {
        module->config = calloc(1, module->desc->config_bytes + 1);
        status = module->config
                     ? bst_config_read(ctx, json, own_part, path,
                                       module->desc->config ? module->desc->config : no_keys,
                                       module->config)
                     : bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    if (status == BST_OK) {
        status =
            resolve_paths(ctx, json, scenario, path, module->desc->config, module->config, true);
    }
    if (status == BST_OK) {
        module->rate_hz = common.rate_hz > 0.0 ? common.rate_hz : module->desc->default_rate_hz;
        module->offset_s = common.offset_s;
        if (module->rate_hz > 0.0 && bst_period_ticks(ctx, scenario->tick_rate_hz, module->rate_hz,
                                                      &module->period_ticks) != BST_OK) {
            status = bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: %s/rate_hz", scenario->file, path);
        } else if (bst_seconds_to_ticks(ctx, scenario->tick_rate_hz, common.offset_s,
                                        &module->offset_ticks) != BST_OK) {
            status = bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: %s/offset_s", scenario->file, path);
        }
    }
    if (status == BST_OK) {
        status = read_delays(ctx, scenario, cJSON_GetObjectItemCaseSensitive(node, "delay_s"), path,
                             module);
    }
    cJSON_Delete(common_part);
    cJSON_Delete(own_part);
    return status;
}

static const cJSON *modules_node(const cJSON *root, int observer, int sensor) {
    const cJSON *node =
        cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(root, "observers"), observer);
    node = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(node, "sensors"), sensor);
    return cJSON_GetObjectItemCaseSensitive(node, "modules");
}

static bst_status read_modules(bst_ctx *ctx, const bst_json *json, const bst_registry *registry,
                               bst_scenario *out) {
    const cJSON *root = bst_json_root(json);
    const bst_observer_config *observers = out->observers.items;
    const cJSON *tasking = cJSON_GetObjectItemCaseSensitive(root, "tasking");
    int total = tasking != NULL;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < out->observers.count; i++) {
            for (int s = 0; s < observers[i].sensors.count; s++) {
                const cJSON *block = modules_node(root, i, s);
                char path[200];
                snprintf(path, sizeof path, "/observers/%d/sensors/%d/modules", i, s);
                if (block && !cJSON_IsObject(block)) {
                    return bst_config_fail(ctx, out->file, path, block, "wrong type", "an object");
                }
                if (pass == 0) {
                    total += cJSON_GetArraySize(block) + 1; /* one may be made */
                    continue;
                }
                for (const cJSON *node = block ? block->child : NULL; node; node = node->next) {
                    bst_module_config *module = &out->modules[out->module_count++];
                    module->observer = i;
                    module->sensor = s;
                    char module_path[300];
                    snprintf(module_path, sizeof module_path, "%s/%.60s", path, node->string);
                    BST_TRY(read_module(ctx, json, registry, out, node, module_path, module));
                }
                BST_TRY(bst_stand_in(ctx, registry, block, i, s, out));
            }
        }
        if (pass == 0) {
            out->modules = calloc((size_t)total + 1, sizeof *out->modules);
            if (!out->modules) {
                return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d modules", total);
            }
        }
    }
    if (tasking) {
        bst_module_config *module = &out->modules[out->module_count++];
        module->observer = module->sensor = -1;
        BST_TRY(read_module(ctx, json, registry, out, tasking, "/tasking", module));
    }
    return BST_OK;
}

/* Names are parts of instance names and file names. */
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

static bst_status prepare_cameras(bst_ctx *ctx, bst_scenario *s) {
    const bst_observer_config *observers = s->observers.items;
    for (int i = 0; i < s->observers.count; i++) {
        for (int k = 0; k < observers[i].sensors.count; k++) {
            bst_camera *camera = &((bst_sensor_config *)observers[i].sensors.items)[k].camera;
            bool image = bst_camera_prepare(ctx, camera) == BST_OK;
            if (!image || bst_detector_config_check(ctx, &camera->detector) != BST_OK) {
                return bst_fail_prefix(ctx, BST_ERR_CONFIG,
                                       "%s: /observers/%d/sensors/%d/camera/%s", s->file, i, k,
                                       image ? "detector" : "distortion");
            }
        }
    }
    return BST_OK;
}

static bst_status check_names(bst_ctx *ctx, const bst_scenario *s) {
    const bst_observer_config *observers = s->observers.items;
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

static bst_status check_extended(bst_ctx *ctx, const bst_json *json) {
    const cJSON *root = bst_json_root(json);
    if (cJSON_GetObjectItemCaseSensitive(root, "extends")) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /extends: the file that it names has not been read; load the scenario "
                        "with bst_json_load_extended",
                        bst_json_name(json));
    }
    const cJSON *set = cJSON_GetObjectItemCaseSensitive(root, "set");
    return !set ? BST_OK
                : bst_config_fail(ctx, bst_json_name(json), "/set", set,
                                  "there is nothing that it changes", "only beside \"extends\"");
}

static bst_status read_scenario(bst_ctx *ctx, const bst_json *json, const bst_registry *registry,
                                bst_scenario *out) {
    memset(out, 0, sizeof *out);
    BST_TRY(check_extended(ctx, json));
    BST_TRY(bst_config_read(ctx, json, bst_json_root(json), "", bst_scenario_table, out));
    snprintf(out->file, sizeof out->file, "%s", bst_json_name(json));
    folder_of(out->file, out->base_dir, sizeof out->base_dir);
    if (bst_time_from_utc(ctx, out->epoch_utc, &out->epoch) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /epoch_utc", out->file);
    }
    if (bst_seconds_to_ticks(ctx, out->tick_rate_hz, out->duration_s, &out->duration_ticks) !=
        BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /duration_s", out->file);
    }
    if (bst_record_config_check(ctx, &out->record) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s", out->file);
    }
    BST_TRY(prepare_cameras(ctx, out));
    BST_TRY(check_names(ctx, out));
    BST_TRY(resolve_paths(ctx, json, out, "", bst_scenario_table, out, false));
    return read_modules(ctx, json, registry, out);
}

bst_status bst_scenario_read(bst_ctx *ctx, const bst_json *json, const bst_registry *registry,
                             bst_scenario *out) {
    bst_status status = read_scenario(ctx, json, registry, out);
    if (status != BST_OK) {
        bst_json_name_file(ctx, json);
    }
    return status;
}

void bst_scenario_free(bst_scenario *s) {
    for (int i = 0; s->modules && i < s->module_count; i++) {
        bst_module_config *module = &s->modules[i];
        if (module->config && module->desc->config) {
            bst_config_free(module->desc->config, module->config);
        }
        free(module->config);
    }
    free(s->modules);
    bst_config_free(bst_scenario_table, s);
    memset(s, 0, sizeof *s);
}

/* Schema of one module: its own keys, the common ones, and "type" fixed. */
static cJSON *module_schema(const bst_module_desc *m) {
    static const bst_config_desc none[] = {BST_CONFIG_END};
    cJSON *node = bst_config_schema(m->config ? m->config : none);
    cJSON *common = bst_config_schema(common_table);
    cJSON *properties = cJSON_GetObjectItemCaseSensitive(node, "properties");
    cJSON *shared = cJSON_GetObjectItemCaseSensitive(common, "properties");
    cJSON_DeleteItemFromObjectCaseSensitive(shared, "description");
    while (shared->child) {
        cJSON *item = cJSON_DetachItemViaPointer(shared, shared->child);
        cJSON_AddItemToObject(properties, item->string, item);
    }
    cJSON_Delete(common);
    cJSON *type = cJSON_GetObjectItemCaseSensitive(properties, "type");
    cJSON_DeleteItemFromObjectCaseSensitive(type, "maxLength");
    cJSON_DeleteItemFromObjectCaseSensitive(type, "description");
    if (m->also) {
        cJSON *names = cJSON_AddArrayToObject(type, "enum");
        cJSON_AddItemToArray(names, cJSON_CreateString(m->type));
        cJSON_AddItemToArray(names, cJSON_CreateString(m->also));
    } else {
        cJSON_AddStringToObject(type, "const", m->type);
    }
    cJSON_AddStringToObject(type, "description", m->doc);
    cJSON *delays = cJSON_GetObjectItemCaseSensitive(properties, "delay_s");
    cJSON_AddStringToObject(delays, "type", "object");
    cJSON_AddBoolToObject(delays, "additionalProperties", 0);
    cJSON *inputs = cJSON_AddObjectToObject(delays, "properties");
    for (int p = 0; p < m->port_count; p++) {
        if (m->ports[p].direction == BST_PORT_IN) {
            cJSON *input = cJSON_AddObjectToObject(inputs, m->ports[p].channel);
            cJSON_AddStringToObject(input, "type", "number");
            cJSON_AddNumberToObject(input, "minimum", 0);
        }
    }
    cJSON *required = cJSON_GetObjectItemCaseSensitive(node, "required");
    if (!required) {
        required = cJSON_AddArrayToObject(node, "required");
    }
    cJSON_AddItemToArray(required, cJSON_CreateString("type"));
    return node;
}

/* A scenario that extends another needs nothing else; only such a one has "set". */
static void extended_schema(cJSON *root, cJSON *properties) {
    cJSON *extends = cJSON_GetObjectItemCaseSensitive(properties, "extends");
    cJSON *set = cJSON_GetObjectItemCaseSensitive(properties, "set");
    cJSON_AddStringToObject(extends, "type", "string");
    cJSON_AddStringToObject(set, "type", "object");
    cJSON *names = cJSON_AddObjectToObject(set, "propertyNames");
    cJSON_AddStringToObject(names, "pattern", "^/");
    cJSON *needed = cJSON_CreateArray();
    cJSON_AddItemToArray(needed, cJSON_CreateString("extends"));
    cJSON *either = cJSON_AddArrayToObject(root, "anyOf");
    for (int own = 0; own < 2; own++) {
        cJSON *choice = cJSON_CreateObject();
        cJSON_AddItemToObject(choice, "required",
                              own ? cJSON_DetachItemFromObjectCaseSensitive(root, "required")
                                  : cJSON_Duplicate(needed, 1));
        cJSON_AddItemToArray(either, choice);
    }
    cJSON_AddItemToObject(cJSON_AddObjectToObject(root, "dependentRequired"), "set", needed);
}

cJSON *bst_scenario_schema(const bst_registry *registry) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "$schema", "https://json-schema.org/draft/2020-12/schema");
    cJSON_AddStringToObject(root, "title", "Boresight scenario");
    cJSON *table = bst_config_schema(bst_scenario_table);
    while (table->child) {
        cJSON *item = cJSON_DetachItemViaPointer(table, table->child);
        cJSON_AddItemToObject(root, item->string, item);
    }
    cJSON_Delete(table);
    cJSON *properties = cJSON_GetObjectItemCaseSensitive(root, "properties");
    cJSON_AddStringToObject(cJSON_AddObjectToObject(properties, "$schema"), "type", "string");
    extended_schema(root, properties);
    cJSON *node = cJSON_GetObjectItemCaseSensitive(properties, "observers");
    const char *const down[] = {"items", "properties", "sensors", "items", "properties", "modules"};
    for (size_t i = 0; i < sizeof down / sizeof *down; i++) {
        node = cJSON_GetObjectItemCaseSensitive(node, down[i]);
    }
    cJSON_AddStringToObject(node, "type", "object");
    cJSON_AddBoolToObject(node, "additionalProperties", 0);
    cJSON *roles = cJSON_AddObjectToObject(node, "properties");
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        cJSON *into = m->flags & BST_MODULE_LINKS ? properties : roles;
        cJSON *role = cJSON_GetObjectItemCaseSensitive(into, m->role);
        if (!role) {
            role = cJSON_AddObjectToObject(into, m->role);
        }
        if (!cJSON_GetObjectItemCaseSensitive(role, "oneOf")) {
            cJSON_AddArrayToObject(role, "oneOf");
        }
        cJSON_AddItemToArray(cJSON_GetObjectItemCaseSensitive(role, "oneOf"), module_schema(m));
    }
    return root;
}
