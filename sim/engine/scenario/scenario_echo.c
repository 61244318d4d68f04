#include <stdio.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/engine/scenario/module_substitution.h"
#include "sim/engine/scenario/scenario.h"

/* JSON pointer of a module's block in the scenario. */
static void module_path(const bst_scenario_module_config *module, char *path, size_t bytes) {
    if (module->observer < 0) {
        snprintf(path, bytes, "/tasking");
    } else {
        snprintf(path, bytes, "/observers/%d/sensors/%d/modules/%.60s", module->observer,
                 module->sensor, module->name);
    }
}

static cJSON *echo_module(const bst_scenario *s, const bst_scenario_module_config *module) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "type", module->desc->type);
    for (int i = 0; module->plugin && i < s->plugin_count; i++) {
        char where[300];
        module_path(module, where, sizeof where);
        if (strcmp(s->plugins[i].where, where) == 0) {
            cJSON_AddStringToObject(node, "plugin", s->plugins[i].file);
            break;
        }
    }
    if (module->rate_hz > 0.0) {
        cJSON_AddNumberToObject(node, "rate_hz", module->rate_hz);
    }
    cJSON_AddNumberToObject(node, "offset_s", module->offset_s);
    if (module->delay_count > 0 && !bst_module_substitution_delayed(s, module)) {
        cJSON *delays = cJSON_AddObjectToObject(node, "delay_s");
        for (int i = 0; i < module->delay_count; i++) {
            cJSON_AddNumberToObject(delays, module->desc->ports[module->delays[i].port].channel,
                                    (double)module->delays[i].ticks / (double)s->tick_rate_hz);
        }
    }
    cJSON *own =
        module->desc->config ? bst_config_echo(module->desc->config, module->config) : NULL;
    while (own && own->child) {
        cJSON *item = cJSON_DetachItemViaPointer(own, own->child);
        if (bst_module_substitution_taken(s, module, item->string)) {
            cJSON_Delete(item); /* the block states the source of the value */
        } else {
            cJSON_AddItemToObject(node, item->string, item);
        }
    }
    cJSON_Delete(own);
    return node;
}

cJSON *bst_scenario_echo(const bst_scenario *s) {
    cJSON *root = bst_config_echo(bst_scenario_table, s);
    for (int i = 0; root && i < s->module_count; i++) {
        const bst_scenario_module_config *module = &s->modules[i];
        if (module->observer < 0) {
            cJSON_AddItemToObject(root, module->name, echo_module(s, module));
            continue;
        }
        cJSON *sensor = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(root, "observers"),
                                           module->observer);
        sensor =
            cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(sensor, "sensors"), module->sensor);
        cJSON *block = cJSON_GetObjectItemCaseSensitive(sensor, "modules");
        if (!block) {
            block = cJSON_AddObjectToObject(sensor, "modules");
        }
        cJSON_AddItemToObject(block, module->name, echo_module(s, module));
    }
    return root;
}
