#include "sim/cli/outputs.h"

#include <dirent.h>
#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cjson/cJSON.h>

#include "boresight/config.h"
#include "sim/io/run_files.h"

enum { PATH_BYTES = 4096 };

/* An output path, split into folder and name. */
typedef struct output {
    const bst_option *option;
    const char *path;
    char folder[PATH_BYTES], name[256]; /* parent folder; file name */
    struct stat above, there;
    bool exists;
} output;

/* True if the option names an output file or folder. */
static bool is_output(const bst_option *o) {
    return o->path == BST_PATH_OUTPUT || o->path == BST_PATH_OUTPUT_INTO ||
           o->path == BST_PATH_OUTPUT_FOLDER;
}

static const char *value_of(const bst_option *o) {
    return o->kind == BST_OPTION_TEXT ? *(const char *const *)o->target : NULL;
}

static bool same(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

/* Fails with the option and path of an output. */
static bst_status fail(bst_ctx *ctx, const output *o, const char *what) {
    return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.300s: %s", o->option->name, o->path, what);
}

/* ------------------------------------------------------------------ the path itself */

static bst_status check_characters(bst_ctx *ctx, const output *o) {
    for (const char *c = o->path; *c; c++) {
        if ((unsigned char)*c < 0x20 || *c == 0x7f) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s: the path holds a control character (found 0x%02X after "
                            "\"%.*s\"); give another name",
                            o->option->name, (unsigned)(unsigned char)*c,
                            (int)(c - o->path < 200 ? c - o->path : 200), o->path);
        }
    }
    return BST_OK;
}

/* Splits a path into parent folder and name; trailing slashes are ignored. */
static bst_status split(bst_ctx *ctx, output *o) {
    size_t length = strlen(o->path);
    while (length > 1 && o->path[length - 1] == '/') {
        length--;
    }
    const char *name = o->path + length;
    while (name > o->path && name[-1] != '/') {
        name--;
    }
    size_t above = (size_t)(name - o->path), bytes = length - above;
    while (above > 1 && o->path[above - 1] == '/') {
        above--;
    }
    if (above >= sizeof o->folder || bytes >= sizeof o->name) {
        return fail(ctx, o, "the path is too long (allowed: 255 bytes for the name, 4095 in all)");
    }
    snprintf(o->folder, sizeof o->folder, "%.*s", above ? (int)above : 1, above ? o->path : ".");
    snprintf(o->name, sizeof o->name, "%.*s", (int)bytes, name);
    o->exists = stat(o->path, &o->there) == 0;
    return BST_OK;
}

/* runs/ and studies/ in the working folder are created by `run` and `study`. */
static bool is_made_anyway(const output *o) {
    const char *folder = strncmp(o->folder, "./", 2) == 0 ? o->folder + 2 : o->folder;
    return o->option->path == BST_PATH_OUTPUT_FOLDER &&
           (strcmp(folder, "runs") == 0 || strcmp(folder, "studies") == 0);
}

/* Checks that the folder above the output exists or will be created. */
static bst_status check_above(bst_ctx *ctx, output *o) {
    if (stat(o->folder, &o->above) != 0) {
        if (errno == ENOENT && is_made_anyway(o)) {
            return BST_OK;
        }
        return errno == ENOENT
                   ? bst_fail(ctx, BST_ERR_ARGUMENT,
                              "--%s %.300s: there is no folder %.300s; correct the path, or make "
                              "the folder first: mkdir -p '%.300s'",
                              o->option->name, o->path, o->folder, o->folder)
                   : bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.300s: %.300s: %s", o->option->name,
                              o->path, o->folder, strerror(errno));
    }
    if (!S_ISDIR(o->above.st_mode)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.300s: %.300s: Not a directory",
                        o->option->name, o->path, o->folder);
    }
    return BST_OK;
}

/* Checks that an existing output is a file or folder as the option requires. */
static bst_status check_kind(bst_ctx *ctx, const output *o) {
    bool folder = o->exists && S_ISDIR(o->there.st_mode);
    if (o->option->path == BST_PATH_OUTPUT_FOLDER) {
        if (o->exists && !folder) {
            return fail(ctx, o, "Not a directory; give the name of a folder");
        }
    } else if (folder && o->option->path == BST_PATH_OUTPUT) {
        return fail(ctx, o, "is a folder; give the name of a file in it");
    } else if (o->exists && !folder && !S_ISREG(o->there.st_mode) && !S_ISCHR(o->there.st_mode)) {
        return fail(ctx, o, "is not a regular file; give another path");
    }
    if (o->exists && S_ISCHR(o->there.st_mode)) {
        return BST_OK;
    }
    const char *written = folder ? o->path : o->folder;
    if ((folder || o->above.st_ino) && access(written, W_OK | X_OK) != 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--%s %.300s: %.300s cannot be written to: %s",
                        o->option->name, o->path, written, strerror(errno));
    }
    return BST_OK;
}

/* Checks that the output is not a file of a run's or study's folder. */
static bst_status check_owner(bst_ctx *ctx, const output *o) {
    if (o->option->path == BST_PATH_OUTPUT_FOLDER) {
        return BST_OK;
    }
    bool run = bst_run_owns(o->name) && bst_io_folder_is_run(o->folder);
    bool study = bst_io_study_owns(o->name) && bst_io_folder_is_study(o->folder);
    return !run && !study
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT,
                          "--%s %.300s: is a file of the %s in that folder, which is not changed; "
                          "give another name",
                          o->option->name, o->path, run ? "run" : "study");
}

/* ------------------------------------------------------------------ what is read */

static bst_status fail_read(bst_ctx *ctx, const output *o, const char *input, const char *why) {
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "--%s %.300s: is the %s %.300s, which is read%s%s; give another path",
                    o->option->name, o->path, S_ISDIR(o->there.st_mode) ? "folder" : "file", input,
                    *why ? ": " : "", why);
}

/* Protects the files of a run or study that the command reads. */
static bst_status spare_folder(bst_ctx *ctx, const output *o, const char *folder) {
    DIR *dir = opendir(folder);
    bst_status status = BST_OK;
    for (struct dirent *entry; dir && status == BST_OK && (entry = readdir(dir)) != NULL;) {
        struct stat info;
        if ((bst_run_owns(entry->d_name) || bst_io_study_owns(entry->d_name)) &&
            fstatat(dirfd(dir), entry->d_name, &info, 0) == 0 && same(&info, &o->there)) {
            status =
                bst_fail(ctx, BST_ERR_ARGUMENT,
                         "--%s %.300s: is the file %.200s/%s, which is read; give another path",
                         o->option->name, o->path, folder, entry->d_name);
        }
    }
    if (dir) {
        closedir(dir);
    }
    return status;
}

/* Protects files that a JSON document names by absolute paths. */
static bst_status spare_named(bst_ctx *ctx, const output *o, const cJSON *node, const char *by) {
    for (const cJSON *item = node ? node->child : NULL; item; item = item->next) {
        struct stat info;
        if (cJSON_IsString(item) && item->valuestring[0] == '/' &&
            stat(item->valuestring, &info) == 0 && same(&info, &o->there)) {
            char why[400];
            snprintf(why, sizeof why, "%.300s names it", by);
            return fail_read(ctx, o, item->valuestring, why);
        }
        BST_TRY(spare_named(ctx, o, item, by));
    }
    return BST_OK;
}

/* Checks that the output would not overwrite an input. */
static bst_status spare(bst_ctx *ctx, const output *o, const char *input) {
    struct stat info;
    if (!o->exists || S_ISCHR(o->there.st_mode) || stat(input, &info) != 0) {
        return BST_OK;
    }
    if (same(&info, &o->there)) {
        /* a page goes into the folder that it describes */
        return o->option->path == BST_PATH_OUTPUT_INTO && S_ISDIR(info.st_mode)
                   ? BST_OK
                   : fail_read(ctx, o, input, "");
    }
    if (!S_ISDIR(info.st_mode) || S_ISDIR(o->there.st_mode)) {
        return BST_OK;
    }
    BST_TRY(spare_folder(ctx, o, input));
    char path[PATH_BYTES + 32];
    int n = snprintf(path, sizeof path, "%s/scenario.json", input);
    bst_ctx quiet = {0};
    bst_json *json = NULL;
    if (n < 0 || (size_t)n >= sizeof path || bst_json_load(&quiet, path, &json) != BST_OK) {
        return BST_OK;
    }
    bst_status status = spare_named(ctx, o, bst_json_root(json), path);
    bst_json_free(json);
    return status;
}

/* Checks that the output would not overwrite any input of the command line. */
static bst_status spare_inputs(bst_ctx *ctx, const bst_option *table, const output *o, int words,
                               char *const *word) {
    for (int i = 0; i < words; i++) {
        BST_TRY(spare(ctx, o, word[i]));
    }
    for (const bst_option *in = table; in->name; in++) {
        if (in->path != BST_PATH_INPUT) {
            continue;
        }
        if (in->kind == BST_OPTION_LIST) {
            const bst_option_list *list = in->target;
            for (int i = 0; i < list->count; i++) {
                BST_TRY(spare(ctx, o, list->items[i]));
            }
        } else if (value_of(in)) {
            BST_TRY(spare(ctx, o, value_of(in)));
        }
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ all outputs */

/* Checks whether two outputs are the same file, existing or not. */
static bool clash(const output *a, const output *b) {
    if (a->exists && b->exists) {
        return same(&a->there, &b->there) && !S_ISCHR(a->there.st_mode);
    }
    return a->exists == b->exists && same(&a->above, &b->above) && strcmp(a->name, b->name) == 0;
}

/* Applies all checks to one output path. */
static bst_status check_one(bst_ctx *ctx, const bst_option *table, int words, char *const *word,
                            output *o) {
    BST_TRY(check_characters(ctx, o));
    BST_TRY(split(ctx, o));
    BST_TRY(check_above(ctx, o));
    BST_TRY(check_kind(ctx, o));
    BST_TRY(check_owner(ctx, o));
    return spare_inputs(ctx, table, o, words, word);
}

bst_status bst_outputs_check(bst_ctx *ctx, const bst_option *table, const bool *given, int words,
                             char *const *word) {
    for (int i = 0; table[i].name; i++) {
        output o = {.option = &table[i], .path = value_of(&table[i])};
        /* "-" is standard output for commands that support it */
        if (!given[i] || !is_output(&table[i]) || strcmp(o.path, "-") == 0) {
            continue;
        }
        BST_TRY(check_one(ctx, table, words, word, &o));
        for (int k = 0; k < i; k++) {
            output other = {.option = &table[k], .path = value_of(&table[k])};
            if (!given[k] || !is_output(&table[k]) || strcmp(other.path, "-") == 0) {
                continue;
            }
            BST_TRY(split(ctx, &other));
            if (stat(other.folder, &other.above) == 0 && clash(&o, &other)) {
                return bst_fail(ctx, BST_ERR_ARGUMENT,
                                "--%s %.300s: --%s goes there too; give two paths", table[i].name,
                                o.path, table[k].name);
            }
        }
    }
    return BST_OK;
}

bst_status bst_outputs_spare(bst_ctx *ctx, const bst_option *table, const char *input,
                             const char *why) {
    struct stat info;
    if (stat(input, &info) != 0) {
        return BST_OK;
    }
    for (const bst_option *option = table; option && option->name; option++) {
        output o = {.option = option, .path = is_output(option) ? value_of(option) : NULL};
        if (o.path && stat(o.path, &o.there) == 0 && S_ISREG(o.there.st_mode) &&
            same(&info, &o.there)) {
            return fail_read(ctx, &o, input, why);
        }
    }
    return BST_OK;
}

bst_status bst_outputs_refuse_earlier(bst_ctx *ctx, const char *path, bool overwrite) {
    return overwrite || access(path, F_OK) != 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT,
                          "%s: is there already; give another folder or --overwrite", path);
}
