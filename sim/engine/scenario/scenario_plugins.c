#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/engine/scenario/scenario_internal.h"

bst_status bst_scenario_plugin(bst_ctx *ctx, const bst_json *json, const bst_scenario_stages *in,
                               const char *where, const char *text, bst_plugin *out, bool *skip) {
    const bst_scenario *s = in->scenario;
    char folder[sizeof s->base_dir], path[sizeof folder + 520];
    *skip = in->registry->policy == BST_PLUGINS_SKIP;
    *out = (bst_plugin){.modules = NULL};
    if (*skip) {
        return BST_OK;
    }
    if (in->registry->policy == BST_PLUGINS_REFUSE) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: plug-ins are not loaded here, as --no-plugins asks (found \"%s\")",
                        s->file, where, text);
    }
    if (bst_plugin_registered(text, out)) {
        return BST_OK;
    }
    bst_scenario_folder(bst_json_file(json, where), folder, sizeof folder);
    if (text[0] == '/') {
        snprintf(path, sizeof path, "%s", text);
    } else {
        snprintf(path, sizeof path, "%s/%s", folder, text);
    }
    if (strchr(text, ':') && !strchr(text, '/') && access(path, F_OK) != 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: no plug-in \"%s\" is registered in this process, and there is no "
                        "such file; register it before the scenario is read (in Python with "
                        "boresight.register; another process needs it in plugins=[MODULE])",
                        s->file, where, text);
    }
    if (bst_plugin_open(ctx, path, out) != BST_OK) {
        return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: %s", s->file, where);
    }
    return BST_OK;
}

bst_status bst_scenario_plugin_used(bst_ctx *ctx, bst_scenario *s, const bst_plugin *plugin,
                                    const char *where, const char *type) {
    bst_scenario_plugin_use *more =
        realloc(s->plugins, ((size_t)s->plugin_count + 1) * sizeof *s->plugins);
    if (!more) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the plug-ins of a scenario");
    }
    s->plugins = more;
    bst_scenario_plugin_use *use = &s->plugins[s->plugin_count++];
    *use = (bst_scenario_plugin_use){.where = ""};
    snprintf(use->where, sizeof use->where, "%s", where);
    snprintf(use->file, sizeof use->file, "%s", plugin->file);
    snprintf(use->sha256, sizeof use->sha256, "%s", plugin->sha256);
    snprintf(use->type, sizeof use->type, "%s", type);
    return BST_OK;
}

bst_status bst_scenario_stage(void *user, bst_ctx *ctx, const bst_json *json, const char *path,
                              const char *plugin, const char *kind, const char *type,
                              const bst_stage_desc **out, char *file, size_t bytes) {
    const bst_scenario_stages *stages = user;
    bst_plugin library;
    bool skip;
    *out = NULL;
    BST_TRY(bst_scenario_plugin(ctx, json, stages, path, plugin, &library, &skip));
    if (skip) {
        return BST_OK;
    }
    bst_status status = bst_plugin_stage(ctx, &library, kind, type, out);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "%s: %s", stages->scenario->file, path);
    }
    snprintf(file, bytes, "%s", library.file);
    char where[300];
    snprintf(where, sizeof where, "%.*s", (int)(strrchr(path, '/') - path), path);
    return bst_scenario_plugin_used(ctx, stages->scenario, &library, where, (*out)->type);
}
