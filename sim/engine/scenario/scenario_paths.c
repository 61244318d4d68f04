#define _XOPEN_SOURCE 700 /* realpath */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/scenario/scenario_internal.h"

void bst_scenario_folder(const char *file, char *folder, size_t bytes) {
    const char *slash = strrchr(file, '/');
    snprintf(folder, bytes, "%.*s", slash ? (int)(slash - file) : 1, slash ? file : ".");
}

/* Makes the path of an existing file absolute, so that the resolved scenario runs from any folder.
 * A missing file is left to the function that opens it; with `must_exist`, a missing relative path
 * is an error. */
static bst_status resolve_path(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                               const char *where, bool must_exist, char *path, size_t bytes) {
    if (!*path) {
        return BST_OK;
    }
    char folder[sizeof s->base_dir], joined[sizeof folder + 520];
    bst_scenario_folder(bst_json_file(json, where), folder, sizeof folder);
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
        /* paths are relative to base_dir */
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

/* Checks whether a path value is a keyword of the option and no file. */
static bool is_word(const bst_config_desc *desc, const char *path) {
    for (const char *const *word = desc->choices; word && *word; word++) {
        if (strcmp(*word, path) == 0) {
            return true;
        }
    }
    return false;
}

bst_status bst_scenario_paths(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                              const char *where, const bst_config_desc *table, void *object,
                              bool must_exist) {
    for (const bst_config_desc *d = table; d && d->key; d++) {
        char path[400];
        char *member = (char *)object + d->offset;
        snprintf(path, sizeof path, "%s/%s", where, d->key);
        if (d->type == BST_CONFIG_OBJECT) {
            BST_TRY(bst_scenario_paths(ctx, json, s, path, d->children, member, must_exist));
        } else if (d->type == BST_CONFIG_LIST) {
            const bst_config_list *list = (const void *)member;
            for (int i = 0; i < list->count; i++) {
                snprintf(path, sizeof path, "%s/%s/%d", where, d->key, i);
                BST_TRY(bst_scenario_paths(ctx, json, s, path, d->children,
                                           (char *)list->items + (size_t)i * d->item_bytes, false));
            }
        } else if (d->type == BST_CONFIG_STAGE) {
            const bst_stage_use *use = (const void *)member;
            BST_TRY(bst_scenario_paths(ctx, json, s, where, use->desc ? use->desc->config : NULL,
                                       use->config, must_exist));
        } else if (d->type == BST_CONFIG_PATH && *member && !is_word(d, member)) {
            BST_TRY(resolve_path(ctx, json, s, path, must_exist, member, d->size));
        }
    }
    return BST_OK;
}
