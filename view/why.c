#include "view/why.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "view/plot_values.h"
#include "view/recorded_run_internal.h"

/* Sources of an exposure that are compared with the target. */
enum { SOURCES_MOST = 20000 };

/* Rows of a table in the order of exposures. */
typedef struct cursor {
    bst_io_rows *rows; /* NULL: not recorded */
    bool more;
} cursor;

/* Tables of a sensor from an exposure on. */
typedef struct tables {
    const bst_view_run *run;
    const bst_view_sensor *sensor;
    cursor truth, frames, detections, tracks, track_frames;
} tables;

/* A source of the truth. */
typedef struct source {
    double x, y, v_mag;
    int64_t id;
    bool star;
} source;

/* What of an exposure is compared. */
typedef struct frame_sources {
    source *items; /* [SOURCES_MOST] */
    int count;
    bool listed;
    double x, y, dx, dy;             /* target: middle, and its path */
    double ra_deg, dec_deg;          /* target */
    double detection_x, detection_y; /* nearest detection */
    double detection_variance;       /* per axis, px^2 */
} frame_sources;

static bst_status open_cursor(bst_ctx *ctx, const tables *t, const char *table, const char *columns,
                              int64_t exposure, cursor *out) {
    bst_ctx ignored = {0};
    *out = (cursor){NULL, false};
    if (bst_view_open_from(&ignored, t->run, t->sensor->sensor.index, table, columns, exposure,
                           &out->rows) != BST_OK) {
        out->rows = NULL;
        return BST_OK;
    }
    return bst_io_rows_next(ctx, out->rows, &out->more);
}

/* Moves to the next row of an exposure. False: there is none. */
static bst_status next_of(bst_ctx *ctx, cursor *c, int64_t exposure, bool first, bool *found) {
    *found = false;
    if (!c->rows) {
        return BST_OK;
    }
    if (!first && c->more) {
        BST_TRY(bst_io_rows_next(ctx, c->rows, &c->more));
    }
    while (c->more && bst_io_rows_int(c->rows, 0) < exposure) {
        BST_TRY(bst_io_rows_next(ctx, c->rows, &c->more));
    }
    *found = c->more && bst_io_rows_int(c->rows, 0) == exposure;
    return BST_OK;
}

static void close_tables(tables *t) {
    cursor *all[] = {&t->truth, &t->frames, &t->detections, &t->tracks, &t->track_frames};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        if (all[i]->rows) {
            bst_io_rows_close(all[i]->rows);
        }
    }
}

static bst_status open_tables(bst_ctx *ctx, tables *t, int64_t exposure) {
    BST_TRY(
        open_cursor(ctx, t, "truth",
                    "kind, id, in_field, occulted, saturated, x_mid_px, y_mid_px, x_start_px, "
                    "y_start_px, x_end_px, y_end_px, v_mag, snr, sunlit_fraction, ra_deg, dec_deg",
                    exposure, &t->truth));
    BST_TRY(open_cursor(ctx, t, "detection_frames", "threshold_snr, lost", exposure, &t->frames));
    BST_TRY(open_cursor(ctx, t, "detections",
                        "x_px, y_px, label, snr, blend, cov_xx_px2, cov_yy_px2", exposure,
                        &t->detections));
    BST_TRY(open_cursor(ctx, t, "track_frames", "attitude_valid", exposure, &t->track_frames));
    return open_cursor(ctx, t, "tracks",
                       "track_id, status, x_px, y_px, misses_in_row, cov_d1_d1_rad2, "
                       "cov_d2_d2_rad2, ra_deg, dec_deg",
                       exposure, &t->tracks);
}

/* ------------------------------------------------------------------ an exposure */

static bst_status read_truth(bst_ctx *ctx, tables *t, int64_t exposure, frame_sources *s,
                             bst_view_why_facts *f) {
    bool found;
    for (bool first = true;; first = false) {
        BST_TRY(next_of(ctx, &t->truth, exposure, first, &found));
        if (!found) {
            return BST_OK;
        }
        const bst_io_rows *r = t->truth.rows;
        const char *kind = bst_io_rows_text(r, 1);
        bool star = strcmp(kind, "star") == 0;
        if (!star && strcmp(kind, "object") != 0) {
            continue; /* a ghost */
        }
        if (!star && bst_io_rows_int(r, 2) == t->sensor->target) {
            s->listed = f->listed = true;
            f->in_field = bst_io_rows_int(r, 3) == 1;
            f->occulted = bst_io_rows_int(r, 4) == 1;
            f->saturated = bst_io_rows_int(r, 5) == 1;
            s->x = bst_io_rows_real(r, 6);
            s->y = bst_io_rows_real(r, 7);
            s->dx = bst_io_rows_real(r, 10) - bst_io_rows_real(r, 8);
            s->dy = bst_io_rows_real(r, 11) - bst_io_rows_real(r, 9);
            f->snr = bst_io_rows_real(r, 13);
            f->sunlit_fraction = bst_io_rows_real(r, 14);
            s->ra_deg = bst_io_rows_real(r, 15);
            s->dec_deg = bst_io_rows_real(r, 16);
        } else if (s->count < SOURCES_MOST) {
            s->items[s->count++] = (source){bst_io_rows_real(r, 6), bst_io_rows_real(r, 7),
                                            bst_io_rows_real(r, 12), bst_io_rows_int(r, 2), star};
        }
    }
}

/* Distance of a place from the target's path in the exposure. */
static double from_path(const frame_sources *s, double x, double y) {
    double square = s->dx * s->dx + s->dy * s->dy, along = 0.0;
    if (square > 0.0) {
        along = ((x - s->x) * s->dx + (y - s->y) * s->dy) / square;
        along = fmin(0.5, fmax(-0.5, along));
    }
    return hypot(x - s->x - along * s->dx, y - s->y - along * s->dy);
}

static void find_neighbours(const frame_sources *s, bst_view_why_facts *f, int64_t *object) {
    for (int i = 0; i < s->count; i++) {
        const source *other = &s->items[i];
        double distance = from_path(s, other->x, other->y);
        double *nearest = other->star ? &f->star_px : &f->object_px;
        if (distance < (isnan(*nearest) ? INFINITY : *nearest)) {
            *nearest = distance;
            if (other->star) {
                f->star_v_mag = other->v_mag;
            } else {
                *object = other->id;
            }
        }
    }
}

static bst_status read_detections(bst_ctx *ctx, tables *t, int64_t exposure, frame_sources *s,
                                  bst_view_why_facts *f) {
    bool found;
    for (bool first = true;; first = false) {
        BST_TRY(next_of(ctx, &t->detections, exposure, first, &found));
        if (!found) {
            return BST_OK;
        }
        const bst_io_rows *r = t->detections.rows;
        double x = bst_io_rows_real(r, 1), y = bst_io_rows_real(r, 2);
        double distance = from_path(s, x, y);
        if (distance < (isnan(f->detection_px) ? INFINITY : f->detection_px)) {
            f->detection_px = distance;
            f->detection_snr = bst_io_rows_real(r, 4);
            f->is_star = strcmp(bst_io_rows_text(r, 3), "star") == 0;
            f->is_blend = bst_io_rows_int(r, 5) == 1;
            s->detection_x = x;
            s->detection_y = y;
            s->detection_variance = 0.5 * (bst_io_rows_real(r, 6) + bst_io_rows_real(r, 7));
        }
    }
}

/* Finds the track that the detection updated, and the nearest other one. `status` [32]. */
static bst_status read_tracks(bst_ctx *ctx, tables *t, int64_t exposure, const frame_sources *s,
                              bst_view_why_facts *f, char *status) {
    double scale_rad = t->sensor->pixel_scale_arcsec * BST_ARCSEC_RAD;
    bool found, seen = f->detection_px <= BST_VIEW_WHY_REACH_PX;
    for (bool first = true;; first = false) {
        BST_TRY(next_of(ctx, &t->tracks, exposure, first, &found));
        if (!found) {
            return BST_OK;
        }
        const bst_io_rows *r = t->tracks.rows;
        double x = bst_io_rows_real(r, 3), y = bst_io_rows_real(r, 4);
        bool updated = bst_io_rows_int(r, 5) == 0;
        /* a track that is updated has the place of its detection (sim/run/run_observations.c) */
        if (seen && updated && x == s->detection_x && y == s->detection_y) {
            f->track = bst_io_rows_int(r, 1);
            snprintf(status, 32, "%s", bst_io_rows_text(r, 2));
            continue;
        }
        /* x, y of a track that was not updated are those of an earlier frame: its direction counts,
         * from that of the target, which a detection within reach is taken for */
        double distance =
            updated ? hypot(x - (seen ? s->detection_x : s->x), y - (seen ? s->detection_y : s->y))
                    : bst_view_angle_arcsec(bst_io_rows_real(r, 8), bst_io_rows_real(r, 9),
                                            s->ra_deg, s->dec_deg) /
                          t->sensor->pixel_scale_arcsec;
        if (distance < (isnan(f->near_px) ? INFINITY : f->near_px)) {
            double variance = 0.5 * (bst_io_rows_real(r, 6) + bst_io_rows_real(r, 7));
            f->near_px = distance;
            f->near_track = bst_io_rows_int(r, 1);
            f->near_coasts = !updated;
            f->near_sigma = distance / sqrt(variance / (scale_rad * scale_rad) +
                                            (seen ? s->detection_variance : 0.0));
        }
    }
}

/* Finds the reason of an exposure. */
static bst_status explain(bst_ctx *ctx, tables *t, const bst_view_exposure *e, source *room,
                          const char **kind, char *text, size_t bytes) {
    frame_sources s = {.items = room};
    bst_view_why_facts f = {.dropped = e->dropped,
                            .recorded = t->truth.rows != NULL,
                            .star_px = NAN,
                            .object_px = NAN,
                            .detection_px = NAN,
                            .near_px = NAN,
                            .near_sigma = NAN};
    char status[32] = "", name[64] = "another object";
    int64_t object = -1;
    bool processed, tracked;
    BST_TRY(read_truth(ctx, t, e->id, &s, &f));
    BST_TRY(next_of(ctx, &t->track_frames, e->id, true, &tracked));
    f.no_attitude = tracked && bst_io_rows_int(t->track_frames.rows, 1) == 0;
    BST_TRY(next_of(ctx, &t->frames, e->id, true, &processed));
    f.processed = processed;
    if (processed) {
        f.threshold_snr = bst_io_rows_real(t->frames.rows, 1);
        f.lost = bst_io_rows_int(t->frames.rows, 2);
    }
    if (s.listed) {
        find_neighbours(&s, &f, &object);
        BST_TRY(read_detections(ctx, t, e->id, &s, &f));
        BST_TRY(read_tracks(ctx, t, e->id, &s, &f, status));
    }
    if (object >= 0) {
        bst_ctx ignored = {0};
        bst_io_rows *rows;
        bool more = false;
        if (bst_io_rows_open(&ignored, t->run->reader, "SELECT name FROM objects WHERE id = ?1",
                             object, 0, &rows) == BST_OK) {
            if (bst_io_rows_next(&ignored, rows, &more) == BST_OK && more) {
                snprintf(name, sizeof name, "%s", bst_io_rows_text(rows, 0));
            }
            bst_io_rows_close(rows);
        }
    }
    f.object = name;
    f.track_status = status;
    *kind = bst_view_why_reason(&f, text, bytes);
    return BST_OK;
}

/* ------------------------------------------------------------------ frames */

/* Adds the frame's reason, and spans of frames with the same one, from first to last. */
static bst_status add_reasons(bst_ctx *ctx, tables *t, int64_t frame, int64_t first, int64_t last,
                              source *room, cJSON *out) {
    const bst_view_sensor *s = t->sensor;
    const char *before = "";
    cJSON *span = NULL, *spans = cJSON_CreateArray();
    cJSON_AddItemToObject(out, "spans", spans);
    BST_TRY(open_tables(ctx, t, s->exposures[first].id));
    for (int64_t i = first; i <= last; i++) {
        char text[400];
        const char *kind;
        BST_TRY(explain(ctx, t, &s->exposures[i], room, &kind, text, sizeof text));
        if (i == frame) {
            cJSON *node = cJSON_AddObjectToObject(out, "frame");
            cJSON_AddStringToObject(node, "kind", kind);
            cJSON_AddStringToObject(node, "text", text);
        }
        if (strcmp(kind, before) != 0) {
            span = cJSON_CreateObject();
            cJSON_AddItemToArray(spans, span);
            cJSON_AddNumberToObject(span, "first", (double)i);
            cJSON_AddNumberToObject(span, "last", (double)i);
            cJSON_AddStringToObject(span, "kind", kind);
            cJSON_AddStringToObject(span, "text", text);
            before = kind;
        }
        cJSON_SetNumberValue(cJSON_GetObjectItemCaseSensitive(span, "last"), (double)i);
    }
    return BST_OK;
}

static bst_status answer(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x, int64_t first,
                         int64_t last) {
    bst_view_sensor *s;
    BST_TRY(bst_view_find_sensor(ctx, run, x->sensor, &s));
    if (x->frame >= (int64_t)s->count) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no frame %lld", (long long)x->frame);
    }
    x->json = cJSON_CreateObject();
    if (s->target < 0) {
        cJSON_AddNullToObject(x->json, "target");
        return BST_OK;
    }
    cJSON_AddStringToObject(x->json, "target", s->sensor.target);
    tables t = {.run = run, .sensor = s};
    source *room = calloc(SOURCES_MOST, sizeof *room);
    first = first > 0 ? first : 0;
    last = last < (int64_t)s->count ? last : (int64_t)s->count - 1;
    bst_status status = room ? add_reasons(ctx, &t, x->frame, first, last, room, x->json)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the truth");
    close_tables(&t);
    free(room);
    return status;
}

bst_status bst_view_why(bst_ctx *ctx, bst_view_exchange *x, int64_t first, int64_t last) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? answer(ctx, run, x, first, last) : status;
    bst_view_unlock(run);
    return status;
}

bst_status bst_view_route_why(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_why(ctx, x, x->frame - BST_VIEW_WHY_AROUND, x->frame + BST_VIEW_WHY_AROUND);
}

bst_status bst_view_route_reason(bst_ctx *ctx, bst_view_exchange *x) {
    return bst_view_why(ctx, x, x->frame, x->frame);
}
