#define _XOPEN_SOURCE 700 /* scandir, st_mtim */
#include "view/start_page.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/cli/shipped.h"
#include "sim/core/json_member.h"
#include "sim/io/run_files.h"
#include "sim/io/run_reader.h"

/* Runs that are listed, and entries of a folder that are looked at. */
enum { RUNS_LISTED = 24, ENTRIES_MOST = 4096 };
/* Longest scenario and picture that are read, bytes. */
static const long FILE_BYTES = 16L << 20;

static const char runs_folder[] = "runs";

/* Reads a whole file; NULL: none, or too long. Free it. */
static char *read_file(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    char *text = NULL;
    long size = file && fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    if (size >= 0 && size <= FILE_BYTES && fseek(file, 0, SEEK_SET) == 0) {
        text = malloc((size_t)size + 1);
        *bytes = text ? fread(text, 1, (size_t)size, file) : 0;
        if (text) {
            text[*bytes] = '\0';
        }
    }
    if (file) {
        fclose(file);
    }
    return text;
}

static bool is_name(const char *name) {
    return name[0] && name[0] != '.' && !strchr(name, '/');
}

/* Path of an entry; false: too long. */
static bool join(const char *folder, const char *name, char *path, size_t bytes) {
    int length = snprintf(path, bytes, "%s/%s", folder, name);
    return length >= 0 && (size_t)length < bytes;
}

static int is_json(const struct dirent *entry) {
    const char *dot = strrchr(entry->d_name, '.');
    return is_name(entry->d_name) && dot && strcmp(dot, ".json") == 0;
}

static int is_listed(const struct dirent *entry) {
    return is_name(entry->d_name);
}

/* Adds a scenario file; schemas and other JSON files are left out. */
static void add_scenario(const char *folder, const char *name, cJSON *list) {
    char path[4400];
    size_t bytes;
    char *text = join(folder, name, path, sizeof path) ? read_file(path, &bytes) : NULL;
    cJSON *root = text ? cJSON_Parse(text) : NULL;
    if (bst_json_member(root, "boresight") || bst_json_member(root, "extends")) {
        cJSON *node = cJSON_CreateObject();
        const char *description = cJSON_GetStringValue(bst_json_member(root, "description"));
        cJSON_AddStringToObject(node, "file", name);
        cJSON_AddStringToObject(node, "description", description ? description : "");
        cJSON_AddItemToArray(list, node);
    }
    cJSON_Delete(root);
    free(text);
}

static void list_scenarios(cJSON *list) {
    char folder[4096];
    struct dirent **entries;
    bst_cli_shipped_file("scenarios", folder, sizeof folder);
    int count = scandir(folder, &entries, is_json, alphasort);
    for (int i = 0; i < count; i++) {
        if (i < ENTRIES_MOST) {
            add_scenario(folder, entries[i]->d_name, list);
        }
        free(entries[i]);
    }
    if (count >= 0) {
        free(entries);
    }
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
    list_scenarios(cJSON_AddArrayToObject(*out, "scenarios"));
    list_runs(cJSON_AddArrayToObject(*out, "runs"));
    return BST_OK;
}

bst_status bst_view_start_scenario(bst_ctx *ctx, const char *name, char *path, size_t bytes) {
    char folder[4096];
    struct stat found;
    bst_cli_shipped_file("scenarios", folder, sizeof folder);
    if (is_name(name) && join(folder, name, path, bytes) && stat(path, &found) == 0 &&
        S_ISREG(found.st_mode)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no shipped scenario of this name");
}

bst_status bst_view_start_run(bst_ctx *ctx, const char *name, char *path, size_t bytes) {
    if (is_name(name) && join(runs_folder, name, path, bytes) && bst_io_folder_is_run(path)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no run of this name in runs/");
}

bst_status bst_view_start_picture(bst_ctx *ctx, const char *name, bst_view_bytes *out) {
    char folder[512], path[600];
    BST_TRY(bst_view_start_run(ctx, name, folder, sizeof folder));
    out->data =
        join(folder, "quicklook.png", path, sizeof path) ? read_file(path, &out->bytes) : NULL;
    return out->data ? BST_OK : bst_fail(ctx, BST_ERR_NOT_FOUND, "the run has no picture");
}
