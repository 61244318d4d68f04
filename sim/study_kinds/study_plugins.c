#include "sim/study_kinds/study_plugins.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cjson/cJSON.h>

#include "sim/cli/plugins.h"
#include "sim/io/manifest.h"

bst_status bst_study_plugins_take(bst_ctx *ctx, bst_study_plugins *p,
                                  const bst_scenario *scenario) {
    for (int i = 0; i < scenario->plugin_count; i++) {
        const bst_scenario_plugin_use *use = &scenario->plugins[i];
        bool known = false;
        for (int k = 0; k < p->count; k++) {
            known = known || strcmp(p->items[k].file, use->file) == 0;
        }
        if (known) {
            continue;
        }
        bst_scenario_plugin_use *items = realloc(p->items, ((size_t)p->count + 1) * sizeof *items);
        p->items = items ? items : p->items;
        bst_study_note *notes = realloc(p->notes, ((size_t)p->count + 1) * sizeof *notes);
        p->notes = notes ? notes : p->notes;
        if (!items || !notes) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the plug-ins of a study");
        }
        items[p->count] = *use;
        notes[p->count] = (bst_study_note){.key = "plugin"};
        snprintf(notes[p->count].value, sizeof notes->value, "%s sha256 %s", use->file,
                 use->sha256);
        p->count++;
    }
    return BST_OK;
}

void bst_study_plugins_free(bst_study_plugins *p) {
    free(p->items);
    free(p->notes);
    *p = (bst_study_plugins){.count = 0};
}

static void path_of(const char *out, char path[4200]) {
    snprintf(path, 4200, "%.4000s/plugins.json", out);
}

/* Recorded SHA-256 digest of a library; NULL: not in the list. */
static const char *recorded(const cJSON *list, const char *file) {
    const cJSON *item;
    cJSON_ArrayForEach(item, list) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(item, "file"));
        if (name && strcmp(name, file) == 0) {
            return cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(item, "sha256"));
        }
    }
    return NULL;
}

static bst_status compare(bst_ctx *ctx, const char *path, const bst_scenario_plugin_use *uses,
                          int count, bst_status differing) {
    bst_json *json;
    BST_TRY(bst_json_load(ctx, path, &json));
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(bst_json_root(json), "plugins");
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        const char *sha256 = recorded(list, uses[i].file);
        if (!sha256 || strcmp(sha256, uses[i].sha256) != 0) {
            status =
                bst_fail(ctx, differing,
                         "plug-in %s has been changed since the study began (SHA-256 %.16s..., "
                         "then %.16s...); put the former one back, or begin anew in another "
                         "folder",
                         uses[i].file, uses[i].sha256, sha256 ? sha256 : "none");
        }
    }
    bst_json_free(json);
    return status;
}

bst_status bst_study_plugins_settle(bst_ctx *ctx, const bst_study_plugins *p, const char *out) {
    char path[4200];
    path_of(out, path);
    if (p->count == 0) {
        return BST_OK;
    }
    if (access(path, F_OK) == 0) {
        return compare(ctx, path, p->items, p->count, BST_ERR_STATE);
    }
    cJSON *root = cJSON_CreateObject();
    cJSON *list = cJSON_AddArrayToObject(root, "plugins");
    for (int i = 0; i < p->count; i++) {
        cJSON *item = cJSON_CreateObject();
        cJSON_AddStringToObject(item, "file", p->items[i].file);
        cJSON_AddStringToObject(item, "sha256", p->items[i].sha256);
        cJSON_AddItemToArray(list, item);
    }
    char *text = cJSON_Print(root);
    cJSON_Delete(root);
    bst_status status = text ? bst_io_write_file_atomic(ctx, path, text, strlen(text))
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the plug-ins");
    free(text);
    return status;
}

bst_status bst_study_read_scenario(bst_ctx *ctx, const bst_study_run *run, bst_scenario *out) {
    char path[4200];
    BST_TRY(bst_plugins_scenario_read(ctx, run->scenario, out));
    if (out->plugin_count == 0 || !run->out) {
        return BST_OK;
    }
    path_of(run->out, path);
    return access(path, F_OK) != 0
               ? BST_OK
               : compare(ctx, path, out->plugins, out->plugin_count, BST_ERR_IO);
}
