#include "sim/app/plugins.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/version.h"

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
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the path of a plugin");
    }
    snprintf(all, bytes, "%s%s%s", before, *before ? ":" : "", path);
    int failed = setenv(BST_PLUGINS_VARIABLE, all, 1);
    free(all);
    return failed ? bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the path of a plugin")
                  : BST_OK;
}

static bst_status append(bst_ctx *ctx, const char *path, const bst_module_desc *module,
                         bst_registry *registry) {
    if (module->abi != BST_MODULE_ABI) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "plugin %s has a module of interface %d, this program takes %d: build it "
                        "with the headers of Boresight %s",
                        path, module->abi, BST_MODULE_ABI, bst_version());
    }
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *other = registry->modules[i];
        if (strcmp(other->role, module->role) == 0 && strcmp(other->type, module->type) == 0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plugin %s: there is a module of role \"%s\" and type \"%s\" already; "
                            "give it a type of its own",
                            path, module->role, module->type);
        }
    }
    const bst_module_desc **list =
        realloc((void *)(uintptr_t)registry->modules, ((size_t)registry->count + 1) * sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the modules of plugin %s", path);
    }
    list[registry->count++] = module;
    registry->modules = list;
    return BST_OK;
}

static bst_status load(bst_ctx *ctx, const char *path, bst_registry *registry) {
    char here[PATH_BYTES + 2];
    /* a name without a folder would be looked for among the system's libraries */
    snprintf(here, sizeof here, "%s%s", strchr(path, '/') ? "" : "./", path);
    void *library = dlopen(here, RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        return bst_fail(ctx, BST_ERR_IO, "cannot load a plugin: %s", dlerror());
    }
    const bst_module_desc *const *modules = dlsym(library, BST_PLUGIN_SYMBOL);
    if (!modules) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s is no plugin: it does not define the list " BST_PLUGIN_SYMBOL, path);
    }
    /* of the libboresight that it is linked with */
    const char *(*version)(void) = NULL;
    *(void **)(void *)&version = dlsym(library, "bst_version");
    if (version && strcmp(version(), bst_version()) != 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "plugin %s is linked with libboresight %s, this program is Boresight %s",
                        path, version(), bst_version());
    }
    for (; *modules; modules++) {
        BST_TRY(append(ctx, path, *modules, registry));
    }
    return BST_OK;
}

static bst_status load_all(bst_ctx *ctx, const char *paths, bst_registry *registry) {
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

bst_status bst_plugins_registry(bst_ctx *ctx, bst_registry *out) {
    const bst_registry *own = bst_app_registry();
    const char *paths = getenv(BST_PLUGINS_VARIABLE);
    *out = (bst_registry){NULL, 0};
    const bst_module_desc **list = calloc((size_t)own->count, sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d modules", own->count);
    }
    memcpy(list, own->modules, (size_t)own->count * sizeof *list);
    *out = (bst_registry){list, own->count};
    bst_status status = load_all(ctx, paths ? paths : "", out);
    if (status != BST_OK) {
        bst_plugins_free(out);
    }
    return status;
}

void bst_plugins_free(bst_registry *registry) {
    free((void *)(uintptr_t)registry->modules);
    *registry = (bst_registry){NULL, 0};
}

bst_status bst_plugins_scenario_read(bst_ctx *ctx, const bst_json *json, bst_scenario *out) {
    bst_registry registry;
    *out = (bst_scenario){.format = 0}; /* may be freed after a failure */
    BST_TRY(bst_plugins_registry(ctx, &registry));
    bst_status status = bst_scenario_read(ctx, json, &registry, out);
    bst_plugins_free(&registry);
    return status;
}
