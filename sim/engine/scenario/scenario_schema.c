#include <string.h>

#include <cjson/cJSON.h>

#include "sim/engine/scenario/scenario_internal.h"

/* Says of keys of a module that steps on its inputs alone that they have no effect. */
static void describe_steps(const bst_module_desc *m, cJSON *properties) {
    static const char *const keys[] = {"rate_hz", "offset_s"};
    for (int i = 0; i < 2 && bst_module_steps_on_inputs(m); i++) {
        cJSON_ReplaceItemInObjectCaseSensitive(
            cJSON_GetObjectItemCaseSensitive(properties, keys[i]), "description",
            cJSON_CreateString("No effect: this module steps when its inputs come."));
    }
}

/* JSON Schema of one module: its own keys, the common keys and a fixed "type". `plugin`: the block
 * names a plug-in by "plugin", "type" or both. */
static cJSON *module_schema(const bst_module_desc *m, bool plugin) {
    static const bst_config_desc none[] = {BST_CONFIG_END};
    cJSON *node = bst_config_schema(m->config ? m->config : none);
    cJSON *common = bst_config_schema(bst_module_common_table);
    cJSON *properties = cJSON_GetObjectItemCaseSensitive(node, "properties");
    cJSON *shared = cJSON_GetObjectItemCaseSensitive(common, "properties");
    cJSON_DeleteItemFromObjectCaseSensitive(shared, "description");
    while (shared->child) {
        cJSON *item = cJSON_DetachItemViaPointer(shared, shared->child);
        cJSON_AddItemToObject(properties, item->string, item);
    }
    cJSON_Delete(common);
    describe_steps(m, properties);
    cJSON *type = cJSON_GetObjectItemCaseSensitive(properties, "type");
    cJSON_DeleteItemFromObjectCaseSensitive(type, "maxLength");
    cJSON_DeleteItemFromObjectCaseSensitive(type, "default");
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
    if (!plugin) {
        cJSON_AddItemToArray(required, cJSON_CreateString("type"));
        cJSON_DeleteItemFromObjectCaseSensitive(properties, "plugin");
        return node;
    }
    cJSON *named = cJSON_AddArrayToObject(node, "anyOf");
    for (int i = 0; i < 2; i++) {
        cJSON *choice = cJSON_CreateObject();
        cJSON *key = cJSON_AddArrayToObject(choice, "required");
        cJSON_AddItemToArray(key, cJSON_CreateString(i ? "type" : "plugin"));
        cJSON_AddItemToArray(named, choice);
    }
    if (cJSON_GetArraySize(required) == 0) {
        cJSON_DeleteItemFromObjectCaseSensitive(node, "required");
    }
    return node;
}

/* JSON Schema of a module of an unknown plug-in. */
static cJSON *unknown_module(void) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "type", "object");
    cJSON_AddStringToObject(node, "title", "a module of a plug-in");
    cJSON *common = bst_config_schema(bst_module_common_table);
    cJSON_AddItemToObject(node, "properties",
                          cJSON_DetachItemFromObjectCaseSensitive(common, "properties"));
    cJSON_Delete(common);
    cJSON *required = cJSON_AddArrayToObject(node, "required");
    cJSON_AddItemToArray(required, cJSON_CreateString("plugin"));
    return node;
}

/* Checks whether a module of the registry comes from a plug-in. */
static bool is_from_plugin(const bst_scenario_registry *registry, const bst_module_desc *module) {
    for (int i = 0; i < registry->plugin_count; i++) {
        const bst_module_desc *const *m = registry->plugins[i].modules;
        for (; m && *m; m++) {
            if (*m == module) {
                return true;
            }
        }
    }
    return false;
}

/* JSON Schema of a stage's block with a plug-in, for the registered stages of the kind. */
static cJSON *stage_schemas(const bst_scenario_registry *registry, const char *kind) {
    static const bst_config_desc none[] = {BST_CONFIG_END};
    cJSON *list = cJSON_CreateArray();
    for (int i = 0; i < registry->plugin_count; i++) {
        const bst_stage_desc *const *s = registry->plugins[i].stages;
        for (; s && *s; s++) {
            if (strcmp((*s)->kind, kind) != 0) {
                continue;
            }
            cJSON *node = bst_config_schema((*s)->config ? (*s)->config : none);
            cJSON *properties = cJSON_GetObjectItemCaseSensitive(node, "properties");
            cJSON *type = cJSON_AddObjectToObject(properties, "type");
            cJSON_AddStringToObject(type, "const", (*s)->type);
            cJSON_AddStringToObject(cJSON_AddObjectToObject(properties, "plugin"), "type",
                                    "string");
            if ((*s)->doc) {
                cJSON_AddStringToObject(node, "description", (*s)->doc);
            }
            cJSON_AddItemToArray(list, node);
        }
    }
    return list;
}

/* Inserts the schemas of plug-in stages at the placeholders of bst_config_schema. */
static void fill_stages(cJSON *node, const bst_scenario_registry *registry) {
    for (cJSON *item = node->child; item; item = item->next) {
        fill_stages(item, registry);
    }
    cJSON *plugin = cJSON_GetObjectItemCaseSensitive(node, "then");
    const cJSON *kind = cJSON_GetObjectItemCaseSensitive(plugin, "title");
    if (!cJSON_IsString(kind)) {
        return;
    }
    cJSON *known = stage_schemas(registry, kind->valuestring);
    if (cJSON_GetArraySize(known) > 0) {
        cJSON_AddItemToObject(plugin, "anyOf", known);
    } else {
        cJSON_Delete(known);
    }
}

/* A scenario that extends another requires no other key; only there is "set" allowed. */
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

cJSON *bst_scenario_schema(const bst_scenario_registry *registry) {
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
        cJSON *into = m->flags & BST_MODULE_MULTI_SENSOR ? properties : roles;
        cJSON *role = cJSON_GetObjectItemCaseSensitive(into, m->role);
        if (!role) {
            role = cJSON_AddObjectToObject(into, m->role);
        }
        if (!cJSON_GetObjectItemCaseSensitive(role, "oneOf")) {
            cJSON_AddArrayToObject(role, "oneOf");
        }
        cJSON_AddItemToArray(cJSON_GetObjectItemCaseSensitive(role, "oneOf"),
                             module_schema(m, is_from_plugin(registry, m)));
    }
    /* a block of an unknown plug-in may have any keys; known plug-ins have their own schemas */
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        cJSON *into = m->flags & BST_MODULE_MULTI_SENSOR ? properties : roles;
        cJSON *role = cJSON_GetObjectItemCaseSensitive(into, m->role);
        cJSON *choices = cJSON_GetObjectItemCaseSensitive(role, "oneOf");
        bool known = false;
        for (int k = 0; k < registry->count; k++) {
            known = known || (strcmp(registry->modules[k]->role, m->role) == 0 &&
                              is_from_plugin(registry, registry->modules[k]));
        }
        const cJSON *last = cJSON_GetArrayItem(choices, cJSON_GetArraySize(choices) - 1);
        if (!known && !cJSON_GetObjectItemCaseSensitive(last, "title")) {
            cJSON_AddItemToArray(choices, unknown_module());
        }
    }
    fill_stages(root, registry);
    return root;
}
