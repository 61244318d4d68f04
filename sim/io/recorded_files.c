/* Lists the files of recorded frames: files, folders and lists. */
#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "sim/core/file.h"
#include "sim/core/text.h"
#include "sim/io/recorded_files_internal.h"

enum { MOST_FILES = 1 << 20, PATH_ROOM = 4096 };
static const uint64_t MOST_LIST_BYTES = (uint64_t)64 << 20;

/* Adds one path. */
static bst_status add(bst_ctx *ctx, bst_recorded_files *f, const char *path) {
    if (f->count == f->room) {
        int room = f->room ? 2 * f->room : 16;
        char **paths =
            f->count < MOST_FILES ? realloc(f->paths, (size_t)room * sizeof *paths) : NULL;
        if (!paths) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no room for more than %d files", f->count);
        }
        f->paths = paths;
        f->room = room;
    }
    f->paths[f->count] = strdup(path);
    if (!f->paths[f->count]) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the path of a file");
    }
    f->count++;
    return BST_OK;
}

void bst_recorded_files_free(bst_recorded_files *f) {
    for (int i = 0; i < f->count; i++) {
        free(f->paths[i]);
    }
    free(f->paths);
    *f = (bst_recorded_files){0};
}

/* Endings of the files of a kind. */
static const char *const fits_names[] = {".fits", ".fit", ".fts", ".fits.fz", NULL};
static const char *const table_names[] = {".csv", NULL};
static const char *const picture_names[] = {".png", ".tif", ".tiff", NULL};

/* True if a name ends in one of some endings. */
static bool ends_in(const char *name, const char *const *endings) {
    for (; *endings; endings++) {
        if (bst_text_ends_in(name, *endings)) {
            return name[0] != '.';
        }
    }
    return false;
}

static bool exists(const char *folder, const char *name, bool is_folder, char path[PATH_ROOM]) {
    struct stat s;
    int n = snprintf(path, PATH_ROOM, "%s/%s", folder, name);
    return n > 0 && n < PATH_ROOM && stat(path, &s) == 0 &&
           (is_folder ? S_ISDIR(s.st_mode) : S_ISREG(s.st_mode));
}

static int by_name(const void *a, const void *b) {
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* Adds the files of a folder with some endings in the order of their names. */
static bst_status add_named(bst_ctx *ctx, bst_recorded_files *f, const char *folder,
                            const char *const *endings) {
    char path[PATH_ROOM];
    DIR *dir = opendir(folder);
    if (!dir) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", folder, strerror(errno));
    }
    int first = f->count;
    bst_status status = BST_OK;
    for (const struct dirent *e; status == BST_OK && (e = readdir(dir));) {
        if (ends_in(e->d_name, endings) && exists(folder, e->d_name, false, path)) {
            status = add(ctx, f, path);
        }
    }
    closedir(dir);
    if (status == BST_OK && f->count > first) {
        qsort(f->paths + first, (size_t)(f->count - first), sizeof *f->paths, by_name);
    }
    return status;
}

/* Adds what a folder has: FITS files, else a side table, else pictures. */
static bst_status add_folder(bst_ctx *ctx, bst_recorded_files *f, const char *folder) {
    char path[PATH_ROOM];
    if (exists(folder, "run.sqlite", false, path)) { /* a run: its planes are no frames */
        if (!exists(folder, "frames.fits", false, path)) {
            return bst_fail(ctx, BST_ERR_NOT_FOUND,
                            "%s: is a run without frames.fits (allowed: a run that recorded the "
                            "frames of one sensor, or the FITS file of one of several sensors)",
                            folder);
        }
        return add(ctx, f, path);
    }
    if (exists(folder, "ImageFiles", true, path)) {
        return add_folder(ctx, f, path);
    }
    int first = f->count;
    static const char *const *const kinds[] = {fits_names, table_names, picture_names};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds && f->count == first; i++) {
        BST_TRY(add_named(ctx, f, folder, kinds[i]));
        if (kinds[i] == table_names && f->count > first + 1) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "%.300s: has several side tables, as %.300s and %.300s (allowed: one, "
                            "or the paths of those that are meant)",
                            folder, f->paths[first], f->paths[first + 1]);
        }
    }
    return f->count > first
               ? BST_OK
               : bst_fail(ctx, BST_ERR_NOT_FOUND,
                          "%s: holds no FITS file and no picture (allowed: files *.fits, *.fit, "
                          "*.fts, *.fits.fz; *.png, *.tif, *.tiff, with a side table *.csv)",
                          folder);
}

/* Adds the files of a list, a path a line. */
static bst_status add_list(bst_ctx *ctx, bst_recorded_files *f, const char *list) {
    char *text, folder[PATH_ROOM], path[PATH_ROOM];
    size_t bytes;
    int first = f->count;
    BST_TRY(bst_file_read(ctx, list, MOST_LIST_BYTES, "a list of files", &text, &bytes));
    bst_status status = bst_file_check_text(ctx, list, text, bytes);
    const char *slash = strrchr(list, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - list) : 1, slash ? list : ".");
    for (char *line = text; line && status == BST_OK;) {
        char *next = strchr(line, '\n');
        if (next) {
            *next++ = '\0';
        }
        line[strcspn(line, "\r")] = '\0';
        if (*line && *line != '#') {
            bst_file_resolve(folder, line, path, sizeof path);
            status = add(ctx, f, path);
        }
        line = next;
    }
    free(text);
    return status == BST_OK && f->count == first
               ? bst_fail(ctx, BST_ERR_NOT_FOUND,
                          "%s: names no file (allowed: a path a line; # begins a comment)", list)
               : status;
}

bst_status bst_recorded_files_add(bst_ctx *ctx, bst_recorded_files *f, const char *path) {
    struct stat s;
    size_t length = strlen(path);
    if (stat(path, &s) != 0) {
        return bst_fail(ctx, errno == ENOENT ? BST_ERR_NOT_FOUND : BST_ERR_IO,
                        "%.400s: cannot be opened: %s", path, strerror(errno));
    }
    if (S_ISDIR(s.st_mode)) {
        return add_folder(ctx, f, path);
    }
    return length > 4 && strcasecmp(path + length - 4, ".txt") == 0 ? add_list(ctx, f, path)
                                                                    : add(ctx, f, path);
}
