#include "view/track_history.h"

#include "sim/core/json_number.h"
#include "view/json_list.h"
#include "view/recorded_run_internal.h"

/* A table in the order of exposures, and whether it has a row. */
typedef struct cursor {
    bst_io_rows *rows; /* NULL: not recorded */
    bool more;
} cursor;

static bst_status open_cursor(bst_ctx *ctx, const bst_view_run *run, int64_t sensor,
                              const char *table, const char *columns, int64_t exposure,
                              cursor *out) {
    bst_ctx ignored = {0};
    *out = (cursor){NULL, false};
    if (bst_view_open_from(&ignored, run, sensor, table, columns, exposure, &out->rows) != BST_OK) {
        out->rows = NULL;
        return BST_OK;
    }
    return bst_io_rows_next(ctx, out->rows, &out->more);
}

static bst_status next(bst_ctx *ctx, cursor *c) {
    return bst_io_rows_next(ctx, c->rows, &c->more);
}

/* Adds the detection of an exposure at a place, if there is one. */
static bst_status add_detection(bst_ctx *ctx, cursor *c, int64_t exposure, double x, double y,
                                cJSON *node) {
    for (; c->rows && c->more && bst_io_rows_int(c->rows, 0) <= exposure;) {
        const bst_io_rows *r = c->rows;
        if (bst_io_rows_int(r, 0) == exposure && bst_io_rows_real(r, 1) == x &&
            bst_io_rows_real(r, 2) == y && !cJSON_HasObjectItem(node, "detection")) {
            cJSON *found = cJSON_AddObjectToObject(node, "detection");
            bst_json_add_number(found, "x", x);
            bst_json_add_number(found, "y", y);
            cJSON_AddStringToObject(found, "label", bst_io_rows_text(r, 3));
            bst_json_add_number(found, "snr", bst_io_rows_real(r, 4));
            bst_json_add_number(found, "v_mag", bst_io_rows_real(r, 5));
            cJSON_AddBoolToObject(found, "streak", bst_io_rows_int(r, 6) == 1);
            cJSON_AddBoolToObject(found, "blend", bst_io_rows_int(r, 7) == 1);
        }
        BST_TRY(next(ctx, c));
    }
    return BST_OK;
}

/* Row of the exposure in the list, at or after a place; -1: it is not listed. */
static int64_t row_of(const bst_view_sensor *s, int64_t from, int64_t exposure) {
    while (from < (int64_t)s->count && s->exposures[from].id < exposure) {
        from++;
    }
    return from < (int64_t)s->count && s->exposures[from].id == exposure ? from : -1;
}

/* Which states are listed: of a track, in exposures first to last of the sensor's list. */
typedef struct history {
    const bst_view_sensor *sensor;
    int64_t first, last, track;
    cursor tracks, detections;
} history;

static bst_status list_states(bst_ctx *ctx, history *h, cJSON *out) {
    const bst_view_sensor *s = h->sensor;
    cursor *tracks = &h->tracks;
    cJSON *states = cJSON_AddArrayToObject(out, "states");
    int64_t row = h->first;
    for (; tracks->rows && tracks->more &&
           bst_io_rows_int(tracks->rows, 0) <= s->exposures[h->last].id;) {
        const bst_io_rows *r = tracks->rows;
        const int64_t exposure = bst_io_rows_int(r, 0), found = row_of(s, row, exposure);
        if (bst_io_rows_int(r, 1) == h->track && found >= 0) {
            cJSON *node = bst_view_add_object(states);
            row = found;
            cJSON_AddNumberToObject(node, "frame", (double)found);
            bst_json_add_number(node, "time_s", bst_io_rows_real(r, 2));
            cJSON_AddStringToObject(node, "status", bst_io_rows_text(r, 3));
            cJSON_AddNumberToObject(node, "hits", (double)bst_io_rows_int(r, 4));
            cJSON_AddNumberToObject(node, "misses", (double)bst_io_rows_int(r, 5));
            bst_json_add_number(node, "snr", bst_io_rows_real(r, 8));
            bst_json_add_number(node, "v_mag", bst_io_rows_real(r, 9));
            cJSON_DeleteItemFromObjectCaseSensitive(out, "first_s");
            bst_json_add_number(out, "first_s", bst_io_rows_real(r, 10));
            if (bst_io_rows_int(r, 5) == 0) {
                BST_TRY(add_detection(ctx, &h->detections, exposure, bst_io_rows_real(r, 6),
                                      bst_io_rows_real(r, 7), node));
            }
        }
        BST_TRY(next(ctx, tracks));
    }
    return BST_OK;
}

static bst_status answer(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    bst_view_sensor *s;
    BST_TRY(bst_view_find_sensor(ctx, run, x->sensor, &s));
    if (x->frame >= (int64_t)s->count) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no frame %lld", (long long)x->frame);
    }
    const int64_t first =
        x->frame >= BST_VIEW_TRACK_EXPOSURES ? x->frame - BST_VIEW_TRACK_EXPOSURES + 1 : 0;
    const int64_t exposure = s->exposures[first].id, sensor = s->sensor.index;
    history h = {s, first, x->frame, x->object, {NULL, false}, {NULL, false}};
    x->json = cJSON_CreateObject();
    cJSON_AddNumberToObject(x->json, "track", (double)x->object);
    cJSON_AddBoolToObject(x->json, "earlier", first > 0);
    bst_status status =
        open_cursor(ctx, run, sensor, "tracks",
                    "track_id, time_s, status, hits, misses_in_row, x_px, y_px, snr, v_mag,"
                    " CAST(first_tick AS REAL) / (SELECT tick_rate_hz FROM run)",
                    exposure, &h.tracks);
    status = status == BST_OK ? open_cursor(ctx, run, sensor, "detections",
                                            "x_px, y_px, label, snr, v_mag, streak, blend",
                                            exposure, &h.detections)
                              : status;
    status = status == BST_OK ? list_states(ctx, &h, x->json) : status;
    if (h.tracks.rows) {
        bst_io_rows_close(h.tracks.rows);
    }
    if (h.detections.rows) {
        bst_io_rows_close(h.detections.rows);
    }
    return status;
}

bst_status bst_view_route_track(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? answer(ctx, run, x) : status;
    bst_view_unlock(run);
    return status;
}
