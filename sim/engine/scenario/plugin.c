#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/engine/scenario/plugin.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "boresight/stages.h"
#include "boresight/version.h"
#include "sim/engine/scenario/elf_extent.h"

/* Checks the interface version and the ports of a plug-in's modules. */
static bst_status check_modules(bst_ctx *ctx, const bst_plugin *plugin) {
    for (int i = 0; plugin->modules && plugin->modules[i]; i++) {
        const bst_module_desc *m = plugin->modules[i];
        if (m->abi != BST_MODULE_ABI) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plug-in %s has a module of interface %u, this program takes %u: build "
                            "it with the headers of Boresight %s",
                            plugin->file, m->abi, BST_MODULE_ABI, bst_version());
        }
        if (!m->role || !m->type || !m->create || !m->step || !m->destroy ||
            (m->port_count > 0 && !m->ports)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plug-in %s: its module %d lacks a role, a type, ports, or one of "
                            "create, step and destroy",
                            plugin->file, i);
        }
    }
    return BST_OK;
}

/* Checks the interface version and the kinds of a plug-in's stages. */
static bst_status check_stages(bst_ctx *ctx, const bst_plugin *plugin) {
    for (int i = 0; plugin->stages && plugin->stages[i]; i++) {
        const bst_stage_desc *s = plugin->stages[i];
        if (s->abi != BST_STAGE_ABI) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plug-in %s has a stage of interface %u, this program takes %u: build "
                            "it with the headers of Boresight %s",
                            plugin->file, s->abi, BST_STAGE_ABI, bst_version());
        }
        if (!s->kind || !s->type || !s->functions) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plug-in %s: its stage %d lacks a kind, a type or functions",
                            plugin->file, i);
        }
        bool known = false;
        char kinds[120] = "";
        for (const char *const *kind = bst_stage_kinds; *kind; kind++) {
            size_t used = strlen(kinds);
            known = known || strcmp(*kind, s->kind) == 0;
            snprintf(kinds + used, sizeof kinds - used, "%s\"%s\"", used ? ", " : "", *kind);
        }
        if (!known) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "plug-in %s: its stage \"%s\" is of kind \"%s\" (allowed: %s)",
                            plugin->file, s->type, s->kind, kinds);
        }
    }
    return BST_OK;
}

bst_status bst_plugin_check(bst_ctx *ctx, const bst_plugin *plugin) {
    BST_TRY(check_modules(ctx, plugin));
    return check_stages(ctx, plugin);
}

/* Loads the libboresight that is installed with the program if the dynamic linker finds none. Later
 * libraries then use it. False: there is none. */
static bool load_own_library(void) {
    char path[8192];
    ssize_t length = readlink("/proc/self/exe", path, 4096);
    if (length <= 0 || length >= 4096) {
        return false;
    }
    path[length] = '\0';
    char *end = BST_LIBRARY_FROM_PROGRAM[0] == '/' ? path : strrchr(path, '/') + 1;
    snprintf(end, sizeof path - (size_t)(end - path), "%s", BST_LIBRARY_FROM_PROGRAM);
    return dlopen(path, RTLD_NOW | RTLD_LOCAL) != NULL;
}

bst_status bst_plugin_open(bst_ctx *ctx, const char *path, bst_plugin *out) {
    *out = (bst_plugin){.modules = NULL};
    char *full = realpath(path, NULL);
    if (!full || strlen(full) >= sizeof out->file) {
        bool missing = !full;
        free(full);
        return missing ? bst_fail(ctx, BST_ERR_NOT_FOUND,
                                  "plug-in %s: there is no such file; build it, or correct the "
                                  "path",
                                  path)
                       : bst_fail(ctx, BST_ERR_IO, "plug-in %s: the full path is too long", path);
    }
    snprintf(out->file, sizeof out->file, "%s", full);
    free(full);
    if (bst_sha256_file(ctx, out->file, out->sha256) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_IO, "plug-in");
    }
    if (bst_elf_check_extent(ctx, out->file) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_IO, "plug-in");
    }
    void *library = dlopen(out->file, RTLD_NOW | RTLD_LOCAL);
    if (!library && load_own_library()) {
        library = dlopen(out->file, RTLD_NOW | RTLD_LOCAL);
    }
    if (!library) {
        return bst_fail(ctx, BST_ERR_IO,
                        "plug-in %s cannot be loaded (%s); is it a shared library, built with "
                        "-shared -fPIC, and is what it is linked with found (LD_LIBRARY_PATH)?",
                        out->file, dlerror());
    }
    out->modules = dlsym(library, BST_PLUGIN_MODULES);
    out->stages = dlsym(library, BST_PLUGIN_STAGES);
    if (!out->modules && !out->stages) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s is no plug-in: it defines neither the list " BST_PLUGIN_MODULES
                        " nor " BST_PLUGIN_STAGES,
                        out->file);
    }
    /* of the libboresight that the plug-in is linked with */
    const char *(*version)(void) = NULL;
    *(void **)(void *)&version = dlsym(library, "bst_version");
    if (version && strcmp(version(), bst_version()) != 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "plug-in %s is linked with libboresight %s, this program is Boresight %s: "
                        "build it against this one's",
                        out->file, version(), bst_version());
    }
    return bst_plugin_check(ctx, out);
}

/* Lists the content of a plug-in for error messages: module "x" of role "y", ... */
static void list_content(const bst_plugin *plugin, char *text, size_t bytes) {
    text[0] = '\0';
    for (int i = 0; plugin->modules && plugin->modules[i]; i++) {
        size_t used = strlen(text);
        snprintf(text + used, bytes - used, "%smodule \"%s\" of role \"%s\"", used ? ", " : "",
                 plugin->modules[i]->type, plugin->modules[i]->role);
    }
    for (int i = 0; plugin->stages && plugin->stages[i]; i++) {
        size_t used = strlen(text);
        snprintf(text + used, bytes - used, "%sstage \"%s\" of kind \"%s\"", used ? ", " : "",
                 plugin->stages[i]->type, plugin->stages[i]->kind);
    }
    if (!*text) {
        snprintf(text, bytes, "nothing");
    }
}

/* Error: a plug-in has no module or stage that fits, or several. */
static bst_status not_one(bst_ctx *ctx, const bst_plugin *plugin, const char *what,
                          const char *name, const char *type, int fitting) {
    char content[300];
    list_content(plugin, content, sizeof content);
    if (fitting > 1 && !type) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "plug-in %s has several for \"%s\"; choose one by \"type\" (it has: %s)",
                        plugin->file, name, content);
    }
    return bst_fail(ctx, BST_ERR_CONFIG, "plug-in %s has no %s \"%s\"%s%s%s (it has: %s)",
                    plugin->file, what, name, type ? " of type \"" : "", type ? type : "",
                    type ? "\"" : "", content);
}

bst_status bst_plugin_module(bst_ctx *ctx, const bst_plugin *plugin, const char *role,
                             const char *type, const bst_module_desc **out) {
    int fitting = 0;
    for (int i = 0; plugin->modules && plugin->modules[i]; i++) {
        const bst_module_desc *m = plugin->modules[i];
        if (strcmp(m->role, role) == 0 && (!type || strcmp(m->type, type) == 0)) {
            *out = m;
            fitting++;
        }
    }
    return fitting == 1 ? BST_OK : not_one(ctx, plugin, "module of role", role, type, fitting);
}

bst_status bst_plugin_stage(bst_ctx *ctx, const bst_plugin *plugin, const char *kind,
                            const char *type, const bst_stage_desc **out) {
    int fitting = 0;
    for (int i = 0; plugin->stages && plugin->stages[i]; i++) {
        const bst_stage_desc *s = plugin->stages[i];
        if (strcmp(s->kind, kind) == 0 && (!type || strcmp(s->type, type) == 0)) {
            *out = s;
            fitting++;
        }
    }
    return fitting == 1 ? BST_OK : not_one(ctx, plugin, "stage of kind", kind, type, fitting);
}
