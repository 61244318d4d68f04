#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/engine/scenario/module_substitution.h"
#include "sim/engine/scenario/scenario_internal.h"

/* Configuration keys common to all modules. */
typedef struct common_config {
    char plugin[512], type[64];
    double rate_hz, offset_s;
} common_config;

#define TYPE_DOC "Which of the alternatives is used."

const bst_config_desc bst_module_common_table[] = {
    BST_STRING(common_config, type, "\"\"", TYPE_DOC),
    BST_STRING(common_config, plugin, "\"\"",
               "A shared library that has this module, relative to the folder of the file that "
               "says so; \"type\" may be left out where it has one of the role."),
    BST_REAL(common_config, rate_hz, "Hz", 0, 1e6, "0",
             "Steps per second, of modules that step by the clock; 0: the module's default."),
    BST_REAL(common_config, offset_s, "s", 0, 1e9, "0", "Time of the first step by the clock."),
    {.key = "delay_s",
     .type = BST_CONFIG_RAW,
     .doc = "Seconds after which what arrives on an input is seen, by channel."},
    BST_CONFIG_END,
};

bool bst_module_steps_on_inputs(const bst_module_desc *module) {
    return module->flags & (BST_MODULE_INPUTS_ONLY | BST_MODULE_DEFERRABLE);
}

/* True if the key is one that every module block has. */
static bool is_common(const char *key) {
    for (const bst_config_desc *d = bst_module_common_table; d->key; d++) {
        if (strcmp(d->key, key) == 0) {
            return true;
        }
    }
    return false;
}

/* Copies a module's block with only the common keys, or only the others. */
static cJSON *part_of(const cJSON *node, bool common) {
    cJSON *part = cJSON_CreateObject();
    for (const cJSON *item = node->child; item && part; item = item->next) {
        if (is_common(item->string) == common) {
            cJSON_AddItemToObject(part, item->string, cJSON_Duplicate(item, 1));
        }
    }
    return part;
}

static const bst_module_desc *find_module(const bst_scenario_registry *registry, const char *role,
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

const bst_config_desc *bst_scenario_tables_inside(const void *user, const char *raw,
                                                  const char *key, const cJSON *node, int index) {
    const bst_scenario_registry *registry = user;
    bool tasking = strcmp(raw, "tasking") == 0;
    const char *role = tasking && !key ? raw : !tasking && key ? key : NULL;
    const char *type = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(node, "type"));
    if (!role || !(tasking || strcmp(raw, "modules") == 0)) {
        return NULL;
    }
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        if (m->config && strcmp(m->role, role) == 0 &&
            (!type || strcmp(m->type, type) == 0 || (m->also && strcmp(m->also, type) == 0)) &&
            index-- == 0) {
            return m->config;
        }
    }
    return index == 0 ? bst_module_common_table : NULL;
}

/* Lists the types of a role for error messages: "a", "b", "c"; role NULL: all roles. */
static void list_names(const bst_scenario_registry *registry, const char *role, char *buffer,
                       size_t bytes) {
    buffer[0] = '\0';
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        if (role && strcmp(m->role, role) != 0) {
            continue;
        }
        if (!role &&
            (m->flags & BST_MODULE_MULTI_SENSOR || find_module(registry, m->role, NULL) != m)) {
            continue; /* list a role once; skip multi-sensor modules for a sensor's block */
        }
        size_t used = strlen(buffer);
        snprintf(buffer + used, bytes - used, "%s\"%s\"", used ? ", " : "",
                 role ? m->type : m->role);
    }
}

static bst_status read_delays(bst_ctx *ctx, const bst_scenario *scenario, const cJSON *node,
                              const char *path, bst_scenario_module_config *module) {
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

/* True if the module type matches the place of its block: sensor or all sensors. */
static bool fits(const bst_module_desc *desc, const bst_scenario_module_config *module) {
    return (desc->flags & BST_MODULE_MULTI_SENSOR) ==
           (module->observer < 0 ? BST_MODULE_MULTI_SENSOR : 0);
}

/* Finds the module descriptor for a block. NULL: the block's plug-in is skipped. */
static bst_status find_desc(bst_ctx *ctx, const bst_json *json,
                            const bst_scenario_registry *registry, bst_scenario *scenario,
                            const common_config *common, const char *path,
                            bst_scenario_module_config *module) {
    char where[400], names[400];
    snprintf(where, sizeof where, "%s/plugin", path);
    if (*common->plugin) {
        bst_plugin plugin;
        bool skip;
        const bst_scenario_stages in = {registry, scenario};
        BST_TRY(bst_scenario_plugin(ctx, json, &in, where, common->plugin, &plugin, &skip));
        if (skip) {
            return BST_OK;
        }
        const bst_module_desc *desc;
        bst_status status = bst_plugin_module(ctx, &plugin, module->name,
                                              *common->type ? common->type : NULL, &desc);
        if (status == BST_OK && !fits(desc, module)) {
            status =
                bst_fail(ctx, BST_ERR_CONFIG, "plug-in %s: its module \"%s\" belongs %s",
                         plugin.file, desc->type,
                         desc->flags & BST_MODULE_MULTI_SENSOR ? "into \"tasking\", as it links "
                                                                 "sensors"
                                                               : "into a sensor's modules");
        }
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "%s: %s", scenario->file, where);
        }
        module->desc = desc;
        return bst_scenario_plugin_used(ctx, scenario, &plugin, path, desc->type);
    }
    if (!*common->type) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s/type: missing; it is required: " TYPE_DOC,
                        scenario->file, path);
    }
    module->desc = find_module(registry, module->name, common->type);
    if (!module->desc && registry->policy == BST_PLUGINS_SKIP) {
        return BST_OK; /* the command line has loaded the plug-in */
    }
    if (!module->desc) {
        list_names(registry, module->name, names, sizeof names);
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s/type: there is no %s of type \"%s\" (allowed: %s)", scenario->file,
                        path, module->name, common->type, names);
    }
    for (int i = 0; i < registry->plugin_count; i++) {
        const bst_plugin *p = &registry->plugins[i];
        for (int k = 0; p->modules && p->modules[k]; k++) {
            if (p->modules[k] == module->desc) {
                return bst_scenario_plugin_used(ctx, scenario, p, path, module->desc->type);
            }
        }
    }
    return BST_OK;
}

/* Reads the block of one module. desc of *module stays NULL if its plug-in is skipped. */
static bst_status read_module(bst_ctx *ctx, const bst_json *json,
                              const bst_scenario_registry *registry, bst_scenario *scenario,
                              const cJSON *node, const char *path,
                              bst_scenario_module_config *module) {
    char names[400];
    snprintf(module->name, sizeof module->name, "%s", node->string);
    const bst_module_desc *any = find_module(registry, node->string, NULL);
    bool plugin = cJSON_GetObjectItemCaseSensitive(node, "plugin") != NULL;
    if (!plugin && (!any || !fits(any, module))) {
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
        status = bst_config_read(ctx, json, common_part, path, bst_module_common_table, &common);
    }
    if (status == BST_OK) {
        status = find_desc(ctx, json, registry, scenario, &common, path, module);
    }
    if (status != BST_OK || !module->desc) {
        cJSON_Delete(common_part);
        cJSON_Delete(own_part);
        return status;
    }
    module->plugin = plugin;
    static const bst_config_desc no_keys[] = {BST_CONFIG_END};
    bst_scenario_stages stages = {registry, scenario};
    const bst_stage_loader loader = {&stages, bst_scenario_stage};
    module->config = calloc(1, module->desc->config_bytes + 1);
    status = module->config
                 ? bst_stage_read_config(ctx, json, own_part, path,
                                         module->desc->config ? module->desc->config : no_keys,
                                         &loader, module->config)
                 : bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    if (status == BST_OK) {
        status = bst_scenario_paths(ctx, json, scenario, path, module->desc->config, module->config,
                                    true);
    }
    if (status == BST_OK) {
        module->given_rate_hz = common.rate_hz;
        module->rate_hz = bst_module_steps_on_inputs(module->desc) ? 0.0
                          : common.rate_hz > 0.0                   ? common.rate_hz
                                                                   : module->desc->default_rate_hz;
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

bst_status bst_scenario_modules(bst_ctx *ctx, const bst_json *json,
                                const bst_scenario_registry *registry, bst_scenario *out) {
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
                    total +=
                        cJSON_GetArraySize(block) + 1; /* plus one substitute that may be added */
                    continue;
                }
                bool whole = true;
                for (const cJSON *node = block ? block->child : NULL; node; node = node->next) {
                    bst_scenario_module_config *module = &out->modules[out->module_count++];
                    module->observer = i;
                    module->sensor = s;
                    char module_path[300];
                    snprintf(module_path, sizeof module_path, "%s/%.60s", path, node->string);
                    BST_TRY(read_module(ctx, json, registry, out, node, module_path, module));
                    if (!module->desc) { /* its plug-in is skipped */
                        *module = (bst_scenario_module_config){.desc = NULL};
                        out->module_count--;
                        whole = false;
                    }
                }
                if (whole) {
                    BST_TRY(bst_module_substitution(ctx, registry, block, i, s, out));
                }
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
        bst_scenario_module_config *module = &out->modules[out->module_count++];
        module->observer = module->sensor = -1;
        BST_TRY(read_module(ctx, json, registry, out, tasking, "/tasking", module));
        out->module_count -= module->desc == NULL;
    }
    return BST_OK;
}

const bst_scenario_module_config *bst_scenario_module(const bst_scenario *scenario, int observer,
                                                      int sensor, const char *role) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        if (module->observer == observer && module->sensor == sensor && !module->off &&
            strcmp(module->desc->role, role) == 0) {
            return module;
        }
    }
    return NULL;
}

bool bst_scenario_module_number(const bst_scenario_module_config *module, const char *key,
                                double *out) {
    for (const bst_config_desc *d = module ? module->desc->config : NULL; d && d->key; d++) {
        const char *at = (const char *)module->config + d->offset;
        if (strcmp(d->key, key) == 0 && d->type == BST_CONFIG_REAL) {
            memcpy(out, at, sizeof *out);
            return true;
        }
        if (strcmp(d->key, key) == 0 && d->type == BST_CONFIG_INT) {
            int64_t value;
            memcpy(&value, at, sizeof value);
            *out = (double)value;
            return true;
        }
    }
    return false;
}
