/* Former names in the pointers of a study. */
#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/studies/study_internal.h"
#include "sim/world/world_config.h"

static const bst_config_desc *inside_study(const void *user, const char *raw, const char *key,
                                           const cJSON *node, int index) {
    (void)user;
    (void)node;
    return strcmp(raw, "object") == 0 && !key && index == 0 ? bst_object_config_table : NULL;
}

static const bst_document_tables study_tables = {bst_study_table, inside_study, NULL};
static const bst_document_tables object_tables = {bst_object_config_table, NULL, NULL};

static bool starts_with(const char *text, const char *start) {
    return strncmp(text, start, strlen(start)) == 0;
}

/* Tables of the document that a pointer of an axis or a dispersion leads into. */
static const bst_document_tables *tables_of(const bst_study *study, const char *pointer) {
    bool own = starts_with(pointer, "/pd/") || starts_with(pointer, "/cubes/") ||
               bst_study_population_pointer(pointer);
    return own ? &study_tables : study->tables;
}

/* A string that is a pointer, and values that belong there. What is no pointer stays for the
 * reader's error. */
static bst_status rename_pointer(bst_ctx *ctx, const bst_study *study,
                                 const bst_document_tables *tables, cJSON *pointer, cJSON *values,
                                 const char *where) {
    char warning[500];
    if (!cJSON_IsString(pointer)) {
        return BST_OK;
    }
    const bst_document_tables *in = tables ? tables : tables_of(study, pointer->valuestring);
    snprintf(warning, sizeof warning, "%.300s: %s", study->file, where);
    char *present;
    BST_TRY(bst_json_present_pointer(ctx, in, NULL, pointer->valuestring, NULL, warning, &present));
    bst_status status = BST_OK;
    for (cJSON *v = values ? values->child : NULL; v && status == BST_OK; v = v->next) {
        char *same;
        status = bst_json_present_pointer(ctx, in, NULL, present, v, warning, &same);
        free(status == BST_OK ? same : NULL);
    }
    if (status == BST_OK && strcmp(present, pointer->valuestring) != 0 &&
        !cJSON_SetValuestring(pointer, present)) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    }
    free(present);
    return status;
}

/* "path", "linked_paths" and "values" of the axes or dispersions in a list. */
static bst_status rename_axes(bst_ctx *ctx, const bst_study *study,
                              const bst_document_tables *tables, const cJSON *list,
                              const char *where) {
    char path[200];
    int index = 0;
    for (const cJSON *axis = list ? list->child : NULL; axis; axis = axis->next, index++) {
        snprintf(path, sizeof path, "%s/%d/path", where, index);
        BST_TRY(rename_pointer(ctx, study, tables, cJSON_GetObjectItemCaseSensitive(axis, "path"),
                               cJSON_GetObjectItemCaseSensitive(axis, "values"), path));
        const cJSON *also = cJSON_GetObjectItemCaseSensitive(axis, "linked_paths");
        int k = 0;
        for (cJSON *item = also ? also->child : NULL; item; item = item->next, k++) {
            snprintf(path, sizeof path, "%s/%d/linked_paths/%d", where, index, k);
            BST_TRY(rename_pointer(ctx, study, tables, item, NULL, path));
        }
    }
    return BST_OK;
}

/* Lists of axes or dispersions in the objects of a list. */
static bst_status rename_lists(bst_ctx *ctx, const bst_study *study,
                               const bst_document_tables *tables, const char *list,
                               const char *key) {
    const cJSON *node = cJSON_GetObjectItemCaseSensitive(bst_json_root(study->json), list);
    int index = 0;
    for (const cJSON *item = node ? node->child : NULL; item; item = item->next, index++) {
        char where[80];
        snprintf(where, sizeof where, "/%s/%d/%s", list, index, key);
        BST_TRY(
            rename_axes(ctx, study, tables, cJSON_GetObjectItemCaseSensitive(item, key), where));
    }
    return BST_OK;
}

/* Keys of "set", which are pointers into the scenarios. */
static bst_status rename_set(bst_ctx *ctx, const bst_study *study) {
    const cJSON *set = cJSON_GetObjectItemCaseSensitive(bst_json_root(study->json), "set");
    char where[320];
    if (!cJSON_IsObject(set)) {
        return BST_OK; /* the reader's error */
    }
    BST_TRY(bst_json_check_set(ctx, study->tables, NULL, set, study->file));
    snprintf(where, sizeof where, "%.300s: /set", study->file);
    for (cJSON *item = set->child; item; item = item->next) {
        char *present;
        BST_TRY(bst_json_present_pointer(ctx, study->tables, NULL, item->string, item, where,
                                         &present));
        cJSON_free(item->string);
        item->string = present;
    }
    return BST_OK;
}

bst_status bst_study_rename(bst_ctx *ctx, const bst_study *study) {
    BST_TRY(bst_json_describe(ctx, study->json, &study_tables, true));
    BST_TRY(rename_set(ctx, study));
    BST_TRY(rename_lists(ctx, study, NULL, "sweeps", "axes"));
    BST_TRY(rename_axes(ctx, study, NULL,
                        cJSON_GetObjectItemCaseSensitive(bst_json_root(study->json), "dispersions"),
                        "/dispersions"));
    return rename_lists(ctx, study, &object_tables, "populations", "dispersions");
}
