#define _XOPEN_SOURCE 700 /* scandir, st_mtim */
#include "view/start_page.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/cli/shipped.h"
#include "sim/core/file.h"
#include "sim/core/json_member.h"
#include "sim/core/text.h"
#include "sim/io/run_files.h"
#include "sim/io/run_reader.h"
#include "view/scenario_list.h"

/* Runs that are listed, and entries of a folder that are looked at. */
enum { RUNS_LISTED = 24, ENTRIES_MOST = 4096 };
/* Longest picture that is read, bytes. */
enum { PICTURE_BYTES = 16 << 20 };

static const char runs_folder[] = "runs";

/* Path of an entry; false: too long. */
static bool join(const char *folder, const char *name, char *path, size_t bytes) {
    int length = snprintf(path, bytes, "%s/%s", folder, name);
    return length >= 0 && (size_t)length < bytes;
}

static int is_listed(const struct dirent *entry) {
    return bst_text_is_file_name(entry->d_name);
}

static void list_scenarios(cJSON *list) {
    char folder[4096];
    bst_cli_shipped_file("scenarios", folder, sizeof folder);
    bst_view_scenarios_add(folder, "", true, list);
}

/* A run of the folder. */
typedef struct listed_folder {
    char name[256];
    struct timespec modified;
} listed_folder;

static int newest_first(const void *a, const void *b) {
    const listed_folder *x = a, *y = b;
    if (x->modified.tv_sec != y->modified.tv_sec) {
        return x->modified.tv_sec < y->modified.tv_sec ? 1 : -1;
    }
    return strcmp(x->name, y->name);
}

static void add_run(const listed_folder *run, cJSON *list) {
    char path[512], picture[600];
    bst_ctx ignored = {0};
    bst_run_reader *reader;
    struct stat found;
    if (!join(runs_folder, run->name, path, sizeof path) ||
        bst_run_reader_open(&ignored, path, &reader) != BST_OK) {
        return;
    }
    const char *scenario =
        cJSON_GetStringValue(bst_json_member(bst_run_reader_manifest(reader), "scenario"));
    const char *ended =
        cJSON_GetStringValue(bst_json_member(bst_run_reader_manifest(reader), "ended"));
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "name", run->name);
    cJSON_AddStringToObject(node, "state", bst_run_state_name(bst_run_reader_state(reader)));
    cJSON_AddStringToObject(node, "scenario", scenario ? scenario : "");
    cJSON_AddStringToObject(node, "ended", ended ? ended : "");
    cJSON_AddNumberToObject(node, "modified_s", (double)run->modified.tv_sec);
    cJSON_AddBoolToObject(
        node, "picture",
        join(path, "quicklook.png", picture, sizeof picture) && stat(picture, &found) == 0);
    cJSON_AddItemToArray(list, node);
    bst_run_reader_close(reader);
}

static void list_runs(cJSON *list) {
    struct dirent **entries;
    int count = scandir(runs_folder, &entries, is_listed, alphasort), kept = 0;
    listed_folder *folders = count > 0 ? calloc((size_t)count, sizeof *folders) : NULL;
    for (int i = 0; i < count; i++) {
        char path[512];
        struct stat found;
        if (folders && i < ENTRIES_MOST &&
            join(runs_folder, entries[i]->d_name, path, sizeof path) && stat(path, &found) == 0 &&
            S_ISDIR(found.st_mode) && bst_io_folder_is_run(path)) {
            snprintf(folders[kept].name, sizeof folders[kept].name, "%s", entries[i]->d_name);
            folders[kept++].modified = found.st_mtim;
        }
        free(entries[i]);
    }
    if (count >= 0) {
        free(entries);
    }
    if (kept > 1) {
        qsort(folders, (size_t)kept, sizeof *folders, newest_first);
    }
    for (int i = 0; i < kept && i < RUNS_LISTED; i++) {
        add_run(&folders[i], list);
    }
    free(folders);
}

bst_status bst_view_start_list(bst_ctx *ctx, cJSON **out) {
    *out = cJSON_CreateObject();
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the start page");
    }
    char folder[4096];
    cJSON_AddStringToObject(*out, "folder", getcwd(folder, sizeof folder) ? folder : ".");
    list_scenarios(cJSON_AddArrayToObject(*out, "scenarios"));
    list_runs(cJSON_AddArrayToObject(*out, "runs"));
    return BST_OK;
}

bst_status bst_view_start_scenario(bst_ctx *ctx, const char *name, char *path, size_t bytes) {
    char folder[4096];
    struct stat found;
    bst_cli_shipped_file("scenarios", folder, sizeof folder);
    if (bst_view_is_scenario_name(name) && join(folder, name, path, bytes) &&
        stat(path, &found) == 0 && S_ISREG(found.st_mode)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no shipped scenario of this name");
}

bst_status bst_view_start_run(bst_ctx *ctx, const char *name, char *path, size_t bytes) {
    if (bst_text_is_file_name(name) && join(runs_folder, name, path, bytes) &&
        bst_io_folder_is_run(path)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no run of this name in runs/");
}

bst_status bst_view_start_picture(bst_ctx *ctx, const char *name, bst_view_bytes *out) {
    char folder[512], path[600];
    BST_TRY(bst_view_start_run(ctx, name, folder, sizeof folder));
    char *data = NULL;
    if (!join(folder, "quicklook.png", path, sizeof path) ||
        bst_file_read(ctx, path, PICTURE_BYTES, "a picture", &data, &out->bytes) != BST_OK) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "the run has no picture");
    }
    out->data = data;
    return BST_OK;
}
