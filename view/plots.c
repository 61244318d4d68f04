/* Panels of time series: which lines they have, and their samples from the tables. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memory.h"
#include "view/recorded_run.h"
#include "view/recorded_run_internal.h"

/* Samples of a line that are kept: more are thinned to their extremes. 16 bytes each. */
static const size_t LINE_SAMPLES_MOST = 4000000;
/* Samples of all lines that are kept. */
static const size_t SAMPLES_MOST = 12000000;

/* A panel of plots with a common axis. */
static const struct {
    const char *name, *title, *unit;
} panels[] = {
    {"pointing_error", "Pointing error", "px"},
    {"snr", "SNR of the target", ""},
    {"mount", "Mount angles", "deg"},
    {"detections", "Detections", ""},
    {"attitude_error", "Attitude error, from stars", "arcsec"},
    {"background", "Background", "e-"},
    {"latency", "Age of the result", "s"},
};
enum { PANELS = sizeof panels / sizeof *panels };

/* A line: time and value, or time and two components of which the length is the value. ?1: the
 * sensor; ?2: the target. */
static const struct {
    int panel;
    const char *name, *table, *sql;
    bool of_target;
} lines[BST_VIEW_LINES] = {
    {0, "true", "exposures",
     "SELECT e.mid_s, t.x_mid_px - e.boresight_x_px, t.y_mid_px - e.boresight_y_px"
     /* one row an exposure: repeated ones of a hostile file would multiply */
     " FROM truth t JOIN (SELECT exposure_id, mid_s, boresight_x_px, boresight_y_px FROM exposures"
     " WHERE sensor = ?1 GROUP BY exposure_id) e ON e.exposure_id = t.exposure_id"
     " WHERE t.sensor = ?1 AND t.kind = 'object' AND t.id = ?2 AND t.in_field = 1",
     true},
    {0, "estimated by control", "control",
     "SELECT time_s, aim_error_x_px, aim_error_y_px FROM control WHERE sensor = ?1", false},
    {1, "true", "truth",
     "SELECT mid_s, snr FROM truth WHERE sensor = ?1 AND kind = 'object' AND id = ?2"
     " AND in_field = 1",
     true},
    {1, "of the track", "tracks",
     "SELECT time_s, snr FROM tracks WHERE sensor = ?1 AND target_of_interest = 1", false},
    {2, "outer", "pointing", "SELECT time_s, axis_outer_deg FROM pointing WHERE sensor = ?1",
     false},
    {2, "inner", "pointing", "SELECT time_s, axis_inner_deg FROM pointing WHERE sensor = ?1",
     false},
    {3, "all", "detection_frames",
     "SELECT mid_s, detections FROM detection_frames WHERE sensor = ?1", false},
    {3, "identified stars", "detection_frames",
     "SELECT mid_s, stars_identified FROM detection_frames WHERE sensor = ?1", false},
    {4, "x", "track_frames",
     "SELECT time_s, attitude_error_x_arcsec FROM track_frames WHERE sensor = ?1", false},
    {4, "y", "track_frames",
     "SELECT time_s, attitude_error_y_arcsec FROM track_frames WHERE sensor = ?1", false},
    {4, "z", "track_frames",
     "SELECT time_s, attitude_error_z_arcsec FROM track_frames WHERE sensor = ?1", false},
    {5, "level", "detection_frames",
     "SELECT mid_s, background_e FROM detection_frames WHERE sensor = ?1", false},
    {5, "noise", "detection_frames",
     "SELECT mid_s, noise_e FROM detection_frames WHERE sensor = ?1", false},
    {6, "detections", "detection_frames",
     "SELECT mid_s, CAST(written_tick - end_tick AS REAL) / (SELECT tick_rate_hz FROM run)"
     " FROM detection_frames WHERE sensor = ?1",
     false},
    {6, "tracks", "track_frames",
     "SELECT time_s, CAST(written_tick - tick AS REAL) / (SELECT tick_rate_hz FROM run)"
     " FROM track_frames WHERE sensor = ?1",
     false},
};

/* Lines of the target's truth, and both at once: time and SNR, time and components of the error (no
 * time: no such exposure). The number is compared first: a word takes longer. */
enum { TRUE_ERROR = 0, TRUE_SNR = 2 };
static const char truth_sql[] =
    "SELECT t.mid_s, t.snr, e.mid_s, t.x_mid_px - e.boresight_x_px, t.y_mid_px - e.boresight_y_px"
    " FROM truth t LEFT JOIN (SELECT exposure_id, mid_s, boresight_x_px, boresight_y_px"
    " FROM exposures WHERE sensor = ?1 GROUP BY exposure_id) e ON e.exposure_id = t.exposure_id"
    " WHERE t.id = ?2 AND t.sensor = ?1 AND t.kind = 'object' AND t.in_field = 1";

/* True if the table of a line has rows of the sensor. */
static bool is_recorded(const bst_view_run *run, const bst_view_sensor *s, int line) {
    char sql[120];
    snprintf(sql, sizeof sql, "SELECT EXISTS(SELECT 1 FROM %s WHERE sensor = ?1)",
             lines[line].table);
    return (!lines[line].of_target || s->target >= 0) &&
           bst_run_reader_int(run->reader, sql, s->sensor.index, 0) == 1;
}

void bst_view_add_panels(const bst_view_run *run, const bst_view_sensor *s, cJSON *out) {
    for (int k = 0; k < PANELS; k++) {
        cJSON *names = cJSON_CreateArray();
        bool any = false;
        for (int i = 0; i < BST_VIEW_LINES; i++) {
            if (lines[i].panel == k) {
                any = is_recorded(run, s, i) || any;
                cJSON_AddItemToArray(names, cJSON_CreateString(lines[i].name));
            }
        }
        if (!any) {
            cJSON_Delete(names);
            continue;
        }
        cJSON *node = cJSON_CreateObject();
        cJSON_AddStringToObject(node, "name", panels[k].name);
        cJSON_AddStringToObject(node, "title", panels[k].title);
        cJSON_AddStringToObject(node, "unit", panels[k].unit);
        cJSON_AddItemToObject(node, "lines", names);
        cJSON_AddItemToArray(out, node);
    }
}

/* Frees the lines that were not used for the longest time, until there is room for another one. */
static void make_room(bst_view_run *run, const bst_view_line *keep) {
    while (run->samples > SAMPLES_MOST) {
        bst_view_line *oldest = NULL;
        for (int k = 0; k < run->sensors * BST_VIEW_LINES; k++) {
            bst_view_line *line = &run->sensor[k / BST_VIEW_LINES].lines[k % BST_VIEW_LINES];
            if (line->samples && line != keep && (!oldest || line->used < oldest->used)) {
                oldest = line;
            }
        }
        if (!oldest) {
            return;
        }
        run->samples -= oldest->count;
        free(oldest->samples);
        *oldest = (bst_view_line){.samples = NULL};
    }
}

/* Samples that are being read. */
typedef struct collected {
    void *samples;
    size_t room, count;
} collected;

static bst_status collect(bst_ctx *ctx, collected *c, double time_s, double value) {
    const size_t bytes = sizeof(bst_io_sample);
    if (!isfinite(time_s)) {
        return BST_OK;
    }
    if (c->count == LINE_SAMPLES_MOST) {
        c->count = bst_io_thin_samples(c->samples, c->count);
    }
    if (c->room < (c->count + 1) * bytes) {
        BST_TRY(bst_memory_grow(ctx, "out of memory for a time series", &c->samples, &c->room,
                                2 * c->room + 65536));
    }
    ((bst_io_sample *)c->samples)[c->count++] =
        (bst_io_sample){time_s, isfinite(value) ? value : NAN};
    return BST_OK;
}

/* Makes the samples a line, after an error none. */
static bst_status keep_line(bst_ctx *ctx, bst_status status, bst_view_run *run, collected *c,
                            bst_view_line *line) {
    if (status != BST_OK) {
        free(c->samples);
        return status;
    }
    bst_view_sort(c->samples, c->count);
    line->samples = c->samples ? c->samples : calloc(1, sizeof *line->samples);
    line->count = c->count;
    run->samples += line->count;
    make_room(run, line);
    return line->samples ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
}

/* Reads the rows of a query as the samples of a line. */
static bst_status read_line(bst_ctx *ctx, bst_view_run *run, bst_io_rows *rows,
                            bst_view_line *line) {
    const bool vector = bst_io_rows_columns(rows) == 3;
    collected c = {.samples = NULL};
    bst_status status;
    bool more;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        const double value = bst_io_rows_real(rows, 1);
        status = collect(ctx, &c, bst_io_rows_real(rows, 0),
                         vector ? hypot(value, bst_io_rows_real(rows, 2)) : value);
        if (status != BST_OK) {
            break;
        }
    }
    return keep_line(ctx, status, run, &c, line);
}

/* Reads the two lines of the target's truth, a table that may have gigabytes, at once. */
static bst_status read_truth(bst_ctx *ctx, bst_view_run *run, bst_io_rows *rows,
                             bst_view_line *error, bst_view_line *snr) {
    collected errors = {.samples = NULL}, snrs = errors;
    bst_status status;
    bool more;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        status = collect(ctx, &snrs, bst_io_rows_real(rows, 0), bst_io_rows_real(rows, 1));
        if (status == BST_OK && !bst_io_rows_is_null(rows, 2)) {
            status = collect(ctx, &errors, bst_io_rows_real(rows, 2),
                             hypot(bst_io_rows_real(rows, 3), bst_io_rows_real(rows, 4)));
        }
        if (status != BST_OK) {
            break;
        }
    }
    error->used = snr->used = run->requests;
    const bst_status kept = keep_line(ctx, status, run, &errors, error);
    status = keep_line(ctx, status, run, &snrs, snr);
    return kept == BST_OK ? status : kept;
}

/* Reads a line if it is not held. A table that was not recorded gives a line without samples. */
static bst_status need_line(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int k) {
    bst_view_line *line = &s->lines[k];
    line->used = ++run->requests;
    if (line->samples) {
        return BST_OK;
    }
    bst_ctx ignored = {0};
    bst_io_rows *rows = NULL;
    const bool known = !lines[k].of_target || s->target >= 0;
    bst_view_line *error = &s->lines[TRUE_ERROR], *snr = &s->lines[TRUE_SNR];
    const bool both = known && lines[k].of_target && !error->samples && !snr->samples;
    if (both && bst_io_rows_open(&ignored, run->reader, truth_sql, s->sensor.index, s->target,
                                 &rows) == BST_OK) {
        bst_status status = read_truth(ctx, run, rows, error, snr);
        bst_io_rows_close(rows);
        return status;
    }
    if (!known || bst_io_rows_open(&ignored, run->reader, lines[k].sql, s->sensor.index, s->target,
                                   &rows) != BST_OK) {
        line->samples = calloc(1, sizeof *line->samples);
        return line->samples ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    bst_status status = read_line(ctx, run, rows, line);
    bst_io_rows_close(rows);
    return status;
}

/* Appends the extents of a line. */
static bst_status append_line(bst_ctx *ctx, const bst_view_line *line, const bst_view_plot *plot,
                              bst_view_bytes *out) {
    const size_t head = sizeof(double), extent = sizeof(bst_io_extent);
    size_t room = 0;
    BST_TRY(bst_memory_grow(ctx, "out of memory for a plot", &out->data, &room,
                            out->bytes + head + ((size_t)plot->columns + 2) * extent));
    char *at = (char *)out->data + out->bytes;
    bst_io_extent *extents = (bst_io_extent *)(void *)(at + head);
    size_t count = bst_io_decimate(line->samples, line->count, plot->from_s, plot->to_s,
                                   plot->columns, extents);
    double number = (double)count;
    memcpy(at, &number, head);
    out->bytes += head + count * extent;
    return BST_OK;
}

static bst_status plot_panel(bst_ctx *ctx, bst_view_run *run, const bst_view_plot *plot,
                             bst_view_bytes *out) {
    bst_view_sensor *s;
    int panel = 0;
    BST_TRY(bst_view_find_sensor(ctx, run, plot->sensor, &s));
    while (panel < PANELS && strcmp(panels[panel].name, plot->panel) != 0) {
        panel++;
    }
    if (panel == PANELS) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no panel \"%s\"", plot->panel);
    }
    if (!(plot->from_s < plot->to_s) || plot->columns < 1 || plot->columns > BST_VIEW_COLUMNS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "from %g to %g s in %d columns (allowed: a range of time, 1 to %d columns)",
                        plot->from_s, plot->to_s, plot->columns, BST_VIEW_COLUMNS);
    }
    for (int i = 0; i < BST_VIEW_LINES; i++) {
        if (lines[i].panel == panel) {
            BST_TRY(need_line(ctx, run, s, i));
            BST_TRY(append_line(ctx, &s->lines[i], plot, out));
        }
    }
    return BST_OK;
}

bst_status bst_view_run_plot(bst_ctx *ctx, bst_view_run *run, const bst_view_plot *plot,
                             bst_view_bytes *out) {
    *out = (bst_view_bytes){.data = NULL};
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? plot_panel(ctx, run, plot, out) : status;
    bst_view_unlock(run);
    if (status != BST_OK) {
        free(out->data);
        *out = (bst_view_bytes){.data = NULL};
    }
    return status;
}
