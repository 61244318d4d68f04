/* Description of a run: its state, figures, sensors, modes and events. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/core/json_member.h"
#include "sim/core/json_number.h"
#include "view/noise_free.h"
#include "view/recorded_run.h"
#include "view/recorded_run_internal.h"

/* Changes of the mode that are listed. */
enum { MODES_MOST = 20000 };
/* Names of objects that are sent. */
enum { NAMES_MOST = 5000 };

/* Copies a member of the manifest that the page shows. */
static void copy(cJSON *to, const cJSON *manifest, const char *key) {
    const cJSON *item = bst_json_member(manifest, key);
    if (item) {
        cJSON_AddItemToObject(to, key, cJSON_Duplicate(item, true));
    }
}

/* Name of the folder without those above it. */
static const char *base_name(const char *folder) {
    const char *slash = strrchr(folder, '/');
    return slash && slash[1] ? slash + 1 : folder;
}

static bst_status add_sensor(bst_ctx *ctx, bst_view_run *run, int number, cJSON *list) {
    bst_view_sensor *s;
    BST_TRY(bst_view_find_sensor(ctx, run, number, &s));
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    cJSON_AddStringToObject(node, "observer", s->sensor.observer);
    cJSON_AddStringToObject(node, "name", s->sensor.name);
    cJSON_AddStringToObject(node, "target", s->sensor.target);
    cJSON_AddNumberToObject(node, "width_px", (double)s->width_px);
    cJSON_AddNumberToObject(node, "height_px", (double)s->height_px);
    bst_json_add_number(node, "pixel_scale_arcsec", s->pixel_scale_arcsec);
    cJSON_AddNumberToObject(node, "frames", (double)s->count);
    bst_view_add_panels(run, s, cJSON_AddArrayToObject(node, "panels"));
    bst_view_add_planes(run, s, node);
    return BST_OK;
}

static bst_status describe(bst_ctx *ctx, bst_view_run *run, cJSON *out) {
    static const char *const keys[] = {"scenario",    "epoch_utc", "seed",    "run",
                                       "device",      "version",   "ended",   "error",
                                       "wall_time_s", "warnings",  "summary", "git_revision"};
    const cJSON *manifest = bst_run_reader_manifest(run->reader);
    cJSON_AddStringToObject(out, "name", base_name(bst_run_reader_folder(run->reader)));
    cJSON_AddStringToObject(
        out, "state",
        bst_run_state_name(run->running ? BST_RUN_RUNNING : bst_run_reader_state(run->reader)));
    cJSON_AddStringToObject(out, "viewer_version", bst_version());
    cJSON *copied = cJSON_AddObjectToObject(out, "manifest");
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        copy(copied, manifest, keys[i]);
    }
    cJSON *sensors = cJSON_AddArrayToObject(out, "sensors");
    for (int i = 0; i < run->sensors; i++) {
        BST_TRY(add_sensor(ctx, run, i, sensors));
    }
    cJSON *problems = cJSON_AddArrayToObject(out, "problems");
    const char *problem;
    for (int i = 0; (problem = bst_run_reader_problem(run->reader, i)); i++) {
        cJSON_AddItemToArray(problems, cJSON_CreateString(problem));
    }
    return BST_OK;
}

bst_status bst_view_keep(bst_status status, cJSON **out) {
    if (status != BST_OK) {
        cJSON_Delete(*out);
        *out = NULL;
    }
    return status;
}

bst_status bst_view_run_describe(bst_ctx *ctx, bst_view_run *run, cJSON **out) {
    *out = cJSON_CreateObject();
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? describe(ctx, run, *out) : status;
    bst_view_unlock(run);
    return bst_view_keep(status, out);
}

/* ------------------------------------------------------------------ modes and events */

static bst_status list_modes(bst_ctx *ctx, bst_view_run *run, int64_t number, cJSON *list) {
    bst_view_sensor *s;
    bst_io_rows *rows;
    bst_ctx ignored = {0};
    bst_status status;
    bool more;
    char last[32] = "";
    BST_TRY(bst_view_find_sensor(ctx, run, number, &s));
    if (bst_io_rows_open(&ignored, run->reader,
                         "SELECT time_s, mode FROM control WHERE sensor = ?1", s->sensor.index, 0,
                         &rows) != BST_OK) {
        return BST_OK; /* not recorded */
    }
    int count = 0;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more && count < MODES_MOST) {
        const char *mode = bst_io_rows_text(rows, 1);
        if (count > 0 && strncmp(mode, last, sizeof last - 1) == 0) {
            continue;
        }
        snprintf(last, sizeof last, "%s", mode);
        cJSON *node = cJSON_CreateObject();
        bst_json_add_number(node, "time_s", bst_io_rows_real(rows, 0));
        cJSON_AddStringToObject(node, "mode", last);
        cJSON_AddItemToArray(list, node);
        count++;
    }
    bst_io_rows_close(rows);
    return status;
}

bst_status bst_view_run_modes(bst_ctx *ctx, bst_view_run *run, int64_t sensor, cJSON **out) {
    *out = cJSON_CreateObject();
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? list_modes(ctx, run, sensor, cJSON_AddArrayToObject(*out, "modes"))
                              : status;
    bst_view_unlock(run);
    return bst_view_keep(status, out);
}

static bst_status list_events(bst_ctx *ctx, const bst_view_run *run, cJSON *out) {
    bst_io_rows *rows;
    bst_ctx ignored = {0};
    bst_status status;
    bool more;
    cJSON *list = cJSON_AddArrayToObject(out, "events");
    cJSON_AddNumberToObject(
        out, "total", (double)bst_run_reader_int(run->reader, "SELECT count(*) FROM events", 0, 0));
    if (bst_io_rows_open(&ignored, run->reader,
                         "SELECT time_s, source, kind, text FROM events ORDER BY rowid LIMIT ?1",
                         BST_VIEW_EVENTS, 0, &rows) != BST_OK) {
        return BST_OK; /* not recorded */
    }
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        cJSON *node = cJSON_CreateObject();
        bst_json_add_number(node, "time_s", bst_io_rows_real(rows, 0));
        cJSON_AddStringToObject(node, "source", bst_io_rows_text(rows, 1));
        cJSON_AddStringToObject(node, "kind", bst_io_rows_text(rows, 2));
        cJSON_AddStringToObject(node, "text", bst_io_rows_text(rows, 3));
        cJSON_AddItemToArray(list, node);
    }
    bst_io_rows_close(rows);
    return status;
}

bst_status bst_view_run_events(bst_ctx *ctx, bst_view_run *run, cJSON **out) {
    *out = cJSON_CreateObject();
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? list_events(ctx, run, *out) : status;
    bst_view_unlock(run);
    return bst_view_keep(status, out);
}

/* ------------------------------------------------------------------ names */

/* Names of the objects, for their numbers in the truth. */
static void add_names(const bst_view_run *run, cJSON *names) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    char sql[80];
    snprintf(sql, sizeof sql, "SELECT id, name FROM objects LIMIT %d", NAMES_MOST);
    if (bst_io_rows_open(&ignored, run->reader, sql, 0, 0, &rows) != BST_OK) {
        return;
    }
    while (bst_io_rows_next(&ignored, rows, &more) == BST_OK && more) {
        char id[24];
        snprintf(id, sizeof id, "%lld", (long long)bst_io_rows_int(rows, 0));
        cJSON_AddStringToObject(names, id, bst_io_rows_text(rows, 1));
    }
    bst_io_rows_close(rows);
}

bst_status bst_view_run_names(bst_ctx *ctx, bst_view_run *run, cJSON **out) {
    *out = cJSON_CreateObject();
    bst_status status = bst_view_lock(ctx, run);
    if (status == BST_OK) {
        add_names(run, cJSON_AddObjectToObject(*out, "names"));
    }
    bst_view_unlock(run);
    return bst_view_keep(status, out);
}
