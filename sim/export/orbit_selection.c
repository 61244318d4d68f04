#include "sim/export/orbit_selection.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void choose(bst_orbit_selection *s, int object) {
    s->count += !s->chosen[object];
    s->chosen[object] = true;
}

/* Selects the objects whose indices or names a query returns. A table that was not recorded selects
 * none. */
static bst_status choose_rows(bst_ctx *ctx, const bst_run_reader *run, const bst_world *world,
                              const char *sql, bst_orbit_selection *s) {
    bst_io_rows *rows;
    bool more;
    bst_ctx quiet;
    bst_ctx_init(&quiet, NULL, NULL, BST_LOG_ERROR);
    if (bst_io_rows_open(&quiet, run, sql, 0, 0, &rows) != BST_OK) {
        return BST_OK;
    }
    bst_status status;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        int64_t object = bst_io_rows_kind(rows, 0) == BST_CELL_TEXT
                             ? bst_world_find_object(world, bst_io_rows_text(rows, 0))
                             : bst_io_rows_int(rows, 0);
        if (object >= 0 && object < bst_world_object_count(world)) {
            choose(s, (int)object);
        }
    }
    bst_io_rows_close(rows);
    return status;
}

static bst_status choose_seen(bst_ctx *ctx, const bst_run_reader *run, const bst_world *world,
                              bst_orbit_selection *s) {
    BST_TRY(choose_rows(ctx, run, world,
                        "SELECT DISTINCT id FROM truth WHERE kind = 'object' AND in_field = 1", s));
    BST_TRY(choose_rows(ctx, run, world, "SELECT DISTINCT object FROM sightings", s));
    return choose_rows(ctx, run, world, "SELECT target FROM sensors", s);
}

/* Selects the objects with this name or catalogue number; false: none. */
static bool choose_entry(const bst_world *world, const char *entry, size_t length,
                         bst_orbit_selection *s) {
    bool found = false, number = length > 0 && strspn(entry, "0123456789") >= length;
    char digits[16];
    snprintf(digits, sizeof digits, "%.*s", (int)(length < 15 ? length : 15), entry);
    for (int i = 0; i < bst_world_object_count(world); i++) {
        const bst_world_object_info *info = bst_world_object(world, i);
        bool named = strlen(info->name) == length && strncmp(info->name, entry, length) == 0;
        if (named || (number && length < 10 && info->norad > 0 && info->norad == atoi(digits))) {
            choose(s, i);
            found = true;
        }
    }
    return found;
}

/* Parses a list of objects: each entry is the longest text up to a comma that names an object. */
static bst_status choose_list(bst_ctx *ctx, const bst_world *world, const char *text,
                              bst_orbit_selection *s) {
    for (const char *entry = text;;) {
        entry += strspn(entry, " ");
        const char *first_end = strchr(entry, ',') ? strchr(entry, ',') : entry + strlen(entry);
        const char *end = entry + strlen(entry);
        while (end > first_end && !choose_entry(world, entry, (size_t)(end - entry), s)) {
            for (end--; end > first_end && *end != ','; end--) {
            }
        }
        if (end <= first_end && !choose_entry(world, entry, (size_t)(first_end - entry), s)) {
            return bst_fail(ctx, BST_ERR_NOT_FOUND,
                            "--objects: the run has no object \"%.*s\" among its %d; give names or "
                            "NORAD numbers of its objects, or all, or seen",
                            (int)(first_end - entry < 200 ? first_end - entry : 200), entry,
                            bst_world_object_count(world));
        }
        if (*end == '\0') {
            return BST_OK;
        }
        entry = end + 1;
    }
}

bst_status bst_orbit_selection_make(bst_ctx *ctx, const bst_run_reader *run, const bst_world *world,
                                    const char *text, bst_orbit_selection *out) {
    int objects = bst_world_object_count(world);
    *out = (bst_orbit_selection){.chosen = calloc((size_t)objects + 1, sizeof *out->chosen)};
    if (!out->chosen) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d objects", objects);
    }
    bool few = !text && objects <= BST_ORBIT_SELECTION_MOST;
    if (few || (text && strcmp(text, "all") == 0)) {
        for (int i = 0; i < objects; i++) {
            choose(out, i);
        }
        return BST_OK;
    }
    if (text && strcmp(text, "seen") != 0) {
        return choose_list(ctx, world, text, out);
    }
    BST_TRY(choose_seen(ctx, run, world, out));
    out->left_out = objects - out->count;
    return BST_OK;
}

void bst_orbit_selection_free(bst_orbit_selection *selection) {
    free(selection->chosen);
    *selection = (bst_orbit_selection){0};
}
