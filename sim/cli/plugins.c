#include "sim/cli/plugins.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

enum { PATH_BYTES = 4096 };

bst_status bst_plugins_add(bst_ctx *ctx, const char *path) {
    const char *before = getenv(BST_PLUGINS_VARIABLE);
    before = before ? before : "";
    if (!*path || strchr(path, ':')) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--plugin: \"%s\" is no path of a shared library without \":\" in it",
                        path);
    }
    size_t bytes = strlen(before) + strlen(path) + 2;
    char *all = malloc(bytes);
    if (!all) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the path of a plug-in");
    }
    snprintf(all, bytes, "%s%s%s", before, *before ? ":" : "", path);
    int failed = setenv(BST_PLUGINS_VARIABLE, all, 1);
    free(all);
    return failed ? bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the path of a plug-in")
                  : BST_OK;
}

bst_status bst_plugins_refuse(bst_ctx *ctx) {
    return setenv(BST_NO_PLUGINS_VARIABLE, "1", 1) == 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for --no-plugins");
}

static bst_scenario_plugin_policy policy_of_environment(void) {
    const char *refused = getenv(BST_NO_PLUGINS_VARIABLE);
    return refused && *refused ? BST_PLUGINS_REFUSE : BST_PLUGINS_LOAD;
}

static bst_status append(bst_ctx *ctx, const char *path, const bst_module_desc *module,
                         bst_scenario_registry *registry) {
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *other = registry->modules[i];
        if (strcmp(other->role, module->role) == 0 && strcmp(other->type, module->type) == 0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plug-in %s: there is a module of role \"%s\" and type \"%s\" already; "
                            "give it a type of its own",
                            path, module->role, module->type);
        }
    }
    const bst_module_desc **list =
        realloc((void *)(uintptr_t)registry->modules, ((size_t)registry->count + 1) * sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the modules of plug-in %s", path);
    }
    list[registry->count++] = module;
    registry->modules = list;
    return BST_OK;
}

static bst_status load(bst_ctx *ctx, const char *path, bst_scenario_registry *registry) {
    bst_plugin plugin;
    BST_TRY(bst_plugin_open(ctx, path, &plugin));
    for (int i = 0; plugin.modules && plugin.modules[i]; i++) {
        BST_TRY(append(ctx, path, plugin.modules[i], registry));
    }
    bst_plugin *list = realloc((void *)(uintptr_t)registry->plugins,
                               ((size_t)registry->plugin_count + 1) * sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the plug-in %s", path);
    }
    list[registry->plugin_count++] = plugin;
    registry->plugins = list;
    return BST_OK;
}

static bst_status load_all(bst_ctx *ctx, const char *paths, bst_scenario_registry *registry) {
    while (*paths) {
        size_t length = strcspn(paths, ":");
        char path[PATH_BYTES];
        if (length >= sizeof path) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            BST_PLUGINS_VARIABLE ": a path of %zu bytes is too long", length);
        }
        memcpy(path, paths, length);
        path[length] = '\0';
        if (length > 0) {
            BST_TRY(load(ctx, path, registry));
        }
        paths += length + (paths[length] == ':');
    }
    return BST_OK;
}

bst_status bst_plugins_registry(bst_ctx *ctx, bst_scenario_registry *out) {
    const bst_scenario_registry *own = bst_registry_shipped();
    const char *paths = getenv(BST_PLUGINS_VARIABLE);
    *out = (bst_scenario_registry){.modules = NULL};
    const bst_module_desc **list = calloc((size_t)own->count, sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d modules", own->count);
    }
    memcpy(list, own->modules, (size_t)own->count * sizeof *list);
    *out = (bst_scenario_registry){.modules = list, .count = own->count};
    bst_status status = load_all(ctx, paths ? paths : "", out);
    if (status != BST_OK) {
        bst_plugins_free(out);
    }
    return status;
}

void bst_plugins_free(bst_scenario_registry *registry) {
    free((void *)(uintptr_t)registry->modules);
    free((void *)(uintptr_t)registry->plugins);
    *registry = (bst_scenario_registry){.modules = NULL};
}

static bst_status read_with(bst_ctx *ctx, const bst_json *json, bst_scenario_plugin_policy policy,
                            bst_scenario *out) {
    bst_scenario_registry registry;
    *out = (bst_scenario){.format = 0}; /* the caller may free it after an error */
    BST_TRY(bst_plugins_registry(ctx, &registry));
    registry.policy = policy;
    bst_status status = bst_scenario_read(ctx, json, &registry, out);
    bst_plugins_free(&registry);
    return status;
}

bst_status bst_plugins_scenario_read(bst_ctx *ctx, const bst_json *json, bst_scenario *out) {
    return read_with(ctx, json, policy_of_environment(), out);
}

bst_status bst_plugins_recorded_read(bst_ctx *ctx, const bst_json *json, bst_scenario *out) {
    return read_with(ctx, json, BST_PLUGINS_SKIP, out);
}

void bst_plugins_tell(const bst_scenario *scenario, cJSON *to) {
    if (scenario->plugin_count == 0) {
        return;
    }
    cJSON *list = cJSON_AddArrayToObject(to, "plugins");
    for (int i = 0; i < scenario->plugin_count; i++) {
        const bst_scenario_plugin_use *use = &scenario->plugins[i];
        cJSON *item = cJSON_CreateObject();
        cJSON_AddStringToObject(item, "where", use->where);
        cJSON_AddStringToObject(item, "type", use->type);
        cJSON_AddStringToObject(item, "file", use->file);
        cJSON_AddStringToObject(item, "sha256", use->sha256);
        cJSON_AddItemToArray(list, item);
    }
}

bst_status bst_plugins_of_scenario(bst_ctx *ctx, const char *path,
                                   bst_scenario_registry *registry) {
    bst_json *json;
    bst_scenario scenario = {.format = 0};
    BST_TRY(bst_json_load_described(ctx, path, bst_registry_tables(), &json));
    registry->policy = policy_of_environment();
    bst_status status = bst_scenario_read(ctx, json, registry, &scenario);
    for (int i = 0; i < scenario.plugin_count && status == BST_OK; i++) {
        bool known = false;
        for (int k = 0; k < registry->plugin_count; k++) {
            known = known || strcmp(registry->plugins[k].file, scenario.plugins[i].file) == 0;
        }
        if (!known) {
            status = load(ctx, scenario.plugins[i].file, registry);
        }
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}
