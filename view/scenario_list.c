#define _XOPEN_SOURCE 700 /* scandir */
#include "view/scenario_list.h"

#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/file.h"
#include "sim/core/json_member.h"
#include "sim/core/text.h"

/* The scenario of the README, which is listed first. */
static const char main_scenario[] = "neossat_geo_track.json";

/* Longest file that is looked at, bytes, and files that one extends in turn. */
enum { LISTED_BYTES = 4 << 20, EXTENDED_MOST = 4 };

bool bst_view_is_scenario_name(const char *name) {
    static const char ending[] = ".json";
    const size_t length = strlen(name), end = sizeof ending - 1;
    return bst_text_is_file_name(name) && name[0] != '-' && length > end &&
           strcmp(name + length - end, ending) == 0;
}

static cJSON *read_json(const char *path) {
    bst_ctx ignored = {0};
    char *text = NULL;
    size_t bytes;
    if (bst_file_read(&ignored, path, LISTED_BYTES, "a scenario", &text, &bytes) != BST_OK) {
        return NULL;
    }
    cJSON *root = cJSON_ParseWithLength(text, bytes);
    free(text);
    return root;
}

/* Text of a key in a scenario: its own, by "set" or as a member. NULL: none. */
static const char *own_text(const cJSON *root, const char *key) {
    char pointer[64];
    snprintf(pointer, sizeof pointer, "/%s", key);
    const char *text = bst_json_member_text(bst_json_member(root, "set"), pointer, NULL);
    return text ? text : bst_json_member_text(root, key, NULL);
}

/* Adds the text of a key to a node: that of the file, or of the files that it extends. */
static void add_text(const char *folder, const cJSON *root, const char *key, cJSON *node) {
    cJSON *read = NULL; /* of the file that is extended */
    char base[PATH_MAX], path[PATH_MAX];
    snprintf(base, sizeof base, "%s", folder);
    for (int i = 0; i < EXTENDED_MOST && root && !own_text(root, key); i++) {
        const char *extends = bst_json_member_text(root, "extends", "");
        bst_file_resolve(base, extends, path, sizeof path);
        cJSON *next = *extends ? read_json(path) : NULL;
        cJSON_Delete(read);
        root = read = next;
        snprintf(base, sizeof base, "%s", path);
        char *slash = strrchr(base, '/');
        *(slash ? slash : base) = '\0';
    }
    const char *text = root ? own_text(root, key) : NULL;
    cJSON_AddStringToObject(node, key, text ? text : "");
    cJSON_Delete(read);
}

/* Adds a file if it is a scenario: an object with "boresight", or one that extends another. */
static void add_file(const char *folder, const char *name, const char *file, bool shipped,
                     cJSON *list) {
    char path[PATH_MAX];
    const int n = snprintf(path, sizeof path, "%s/%s", folder, name);
    cJSON *root = n > 0 && (size_t)n < sizeof path ? read_json(path) : NULL;
    if (bst_json_member(root, "boresight") || bst_json_member(root, "extends")) {
        cJSON *node = cJSON_CreateObject();
        cJSON_AddItemToArray(list, node);
        cJSON_AddStringToObject(node, "file", file);
        add_text(folder, root, "name", node);
        add_text(folder, root, "description", node);
        cJSON_AddBoolToObject(node, "shipped", shipped);
    }
    cJSON_Delete(root);
}

static int is_listed(const struct dirent *entry) {
    return bst_view_is_scenario_name(entry->d_name);
}

static int main_first(const struct dirent **a, const struct dirent **b) {
    const bool first = strcmp((*a)->d_name, main_scenario) == 0,
               second = strcmp((*b)->d_name, main_scenario) == 0;
    return first != second ? second - first : alphasort(a, b);
}

void bst_view_scenarios_add(const char *folder, const char *prefix, bool shipped, cJSON *list) {
    struct dirent **entries = NULL;
    const int count = scandir(folder, &entries, is_listed, main_first);
    for (int i = 0; i < count; i++) {
        char file[PATH_MAX];
        const int n = snprintf(file, sizeof file, "%s%s", prefix, entries[i]->d_name);
        if (n > 0 && (size_t)n < sizeof file && cJSON_GetArraySize(list) < BST_VIEW_SCENARIOS) {
            add_file(folder, entries[i]->d_name, file, shipped, list);
        }
        free(entries[i]);
    }
    free(entries);
}
