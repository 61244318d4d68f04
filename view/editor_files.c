#define _XOPEN_SOURCE 700 /* realpath */
/* Scenario files and element sets that the editor offers. */
#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/astro/elements.h"
#include "sim/astro/tle.h"
#include "sim/cli/shipped.h"
#include "sim/core/json_member.h"
#include "view/editor.h"
#include "view/editor_internal.h"
#include "view/scenario_list.h"

/* ------------------------------------------------------------------ scenarios */

static bool is_same_folder(const char *a, const char *b) {
    struct stat one, two;
    return stat(a, &one) == 0 && stat(b, &two) == 0 && one.st_dev == two.st_dev &&
           one.st_ino == two.st_ino;
}

bst_status bst_view_editor_list(bst_ctx *ctx, cJSON **out) {
    char folder[PATH_MAX], found[PATH_MAX], shipped[PATH_MAX], prefix[PATH_MAX + 8];
    if (!getcwd(folder, sizeof folder)) {
        return bst_fail(ctx, BST_ERR_IO, "the working folder cannot be read: %s", strerror(errno));
    }
    *out = cJSON_CreateObject();
    cJSON_AddStringToObject(*out, "folder", folder);
    cJSON *list = cJSON_AddArrayToObject(*out, "files");
    bst_cli_shipped_file("scenarios", found, sizeof found);
    if (!realpath(found, shipped)) {
        snprintf(shipped, sizeof shipped, "scenarios");
    }
    snprintf(prefix, sizeof prefix, "%s/", shipped);
    bst_view_scenarios_add(".", "", false, list);
    if (is_same_folder("scenarios", shipped)) {
        bst_view_scenarios_add("scenarios", "scenarios/", true, list);
    } else {
        bst_view_scenarios_add("scenarios", "scenarios/", false, list);
        bst_view_scenarios_add(shipped, prefix, true, list);
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ satellites */

/* True if a name has the text in it, without regard to case. */
static bool has_text(const char *name, const char *text) {
    size_t length = strlen(text);
    for (; *name; name++) {
        size_t i = 0;
        while (i < length && tolower((unsigned char)name[i]) == tolower((unsigned char)text[i])) {
            i++;
        }
        if (i == length) {
            return true;
        }
    }
    return false;
}

static bst_status add_satellite(bst_ctx *ctx, const bst_elements *elements, cJSON *list) {
    char line1[BST_TLE_CHARS + 1], line2[BST_TLE_CHARS + 1];
    BST_TRY(bst_tle_format(ctx, elements, line1, line2));
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    cJSON_AddStringToObject(node, "name", elements->name);
    cJSON_AddNumberToObject(node, "norad", elements->norad);
    cJSON_AddStringToObject(node, "line1", line1);
    cJSON_AddStringToObject(node, "line2", line2);
    return BST_OK;
}

/* True if a satellite is in the list: some are in both files. */
static bool is_listed(const cJSON *list, int norad) {
    const cJSON *node;
    cJSON_ArrayForEach(node, list) {
        if (bst_json_member_number(node, "norad") == norad) {
            return true;
        }
    }
    return false;
}

/* Adds the satellites of a file that match; counts them all. */
static bst_status find_in_file(bst_ctx *ctx, const char *file, const char *find, int *total,
                               cJSON *list) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_status status =
        bst_elements_load(ctx, file, &(bst_elements_options){.skip_bad_sets = true}, &sets, &count);
    for (int i = 0; i < count && status == BST_OK; i++) {
        char number[16];
        snprintf(number, sizeof number, "%d", sets[i].norad);
        if ((has_text(sets[i].name, find) || strncmp(number, find, strlen(find)) == 0) &&
            !is_listed(list, sets[i].norad)) {
            ++*total;
            status = cJSON_GetArraySize(list) < BST_VIEW_EDITOR_SATELLITES
                         ? add_satellite(ctx, &sets[i], list)
                         : BST_OK;
        }
    }
    free(sets);
    return status;
}

bst_status bst_view_editor_satellites(bst_ctx *ctx, const char *body, cJSON **out) {
    static const char *const files[] = {"scenarios/catalogue_2022-06.tle",
                                        "scenarios/objects_2022-06.tle"};
    bst_json *request;
    const char *find;
    int total = 0;
    BST_TRY(bst_view_editor_body(ctx, body, "find", &request, &find));
    *out = cJSON_CreateObject();
    cJSON *list = cJSON_AddArrayToObject(*out, "satellites");
    bst_status status = BST_OK;
    for (size_t i = 0; i < sizeof files / sizeof *files && status == BST_OK && *find; i++) {
        char path[PATH_MAX];
        bst_cli_shipped_file(files[i], path, sizeof path);
        status = find_in_file(ctx, path, find, &total, list);
    }
    cJSON_AddNumberToObject(*out, "total", total);
    bst_json_free(request);
    return status;
}
