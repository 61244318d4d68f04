/* Panels of time series: which lines they have, and their samples from the tables. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memory.h"
#include "view/plot_limits.h"
#include "view/plot_samples.h"
#include "view/plot_truth.h"
#include "view/plot_values.h"
#include "view/real_time_factor.h"
#include "view/recorded_run.h"
#include "view/recorded_run_internal.h"

/* A panel of plots with a common axis. */
static const struct {
    const char *name, *title, *unit;
} panels[BST_VIEW_PANELS] = {
    {"pointing_error", "Pointing error", "px"},
    {"snr", "SNR of the target", ""},
    {"track_error", "Track error", "arcsec"},
    {"innovation", "Innovation", "arcsec"},
    {"mount", "Mount angles", "deg"},
    {"third_axis", "Third mount axis", "deg"},
    {"limits", "At a limit", ""},
    {"body_rate", "Body rate", "deg/s"},
    {"detections", "Detections", ""},
    {"attitude_error", "Attitude error, from stars", "arcsec"},
    {"background", "Background", "e-"},
    {"latency", "Age of the result", "s"},
    {"wheels", "Reaction wheels", "rpm"},
    {"real_time_factor", "Real-time factor", ""},
};

/* How the value of a line follows from the columns behind its time. */
typedef enum value_kind {
    VALUE_PLAIN,       /* one column */
    VALUE_LENGTH,      /* two components */
    VALUE_ANGLE,       /* right ascension and declination of two directions, deg */
    VALUE_THREE_SIGMA, /* two variances, rad^2 */
    VALUE_INNOVATION,  /* a state of a track (bst_view_track_state), after the one before it */
    VALUE_INNOVATION_SIGMA,
    VALUE_REAL_TIME, /* of file wall_clock.csv, no table */
} value_kind;

/* Columns of a state of the target's track. */
#define TRACK_STATES                                                                              \
    "SELECT time_s, track_id, misses_in_row, ra_deg, dec_deg, rate_east_arcsec_per_s,"            \
    " rate_north_arcsec_per_s, cov_d1_d1_rad2, cov_d1_d2_rad2, cov_d2_d2_rad2, cov_d1_r1_rad2ps," \
    " cov_d1_r2_rad2ps, cov_d2_r1_rad2ps, cov_d2_r2_rad2ps, cov_r1_r1_rad2ps2,"                   \
    " cov_r1_r2_rad2ps2, cov_r2_r2_rad2ps2 FROM tracks WHERE sensor = ?1 AND target_of_interest"  \
    " = 1"

/* Panel of the wheels: it has a line for each wheel there is. */
enum { WHEELS_PANEL = 12 };
/* Speed of a wheel. All wheels are among the first rows: each time has a row of each. */
#define WHEEL(n)                                                                              \
    {                                                                                         \
        WHEELS_PANEL, "wheel " #n, "wheels", "time_s", "speed_rpm", " AND wheel = " #n, NULL, \
            false, VALUE_PLAIN, "rowid < 10000 AND wheel = " #n                               \
    }
#define OF_TARGET " AND target_of_interest = 1"

/* A line of a panel: its samples by time, columns `values` of the rows of `table` of the sensor for
 * which `where` holds. sql: its own query; ?1: the sensor; ?2: the target. `only`: the panel is
 * left out if no row fits; "": any row does. */
static const struct {
    int panel;
    const char *name, *table, *time, *values, *where, *sql;
    bool of_target;
    value_kind kind;
    const char *only;
} lines[BST_VIEW_LINES] = {
    {0, "true", "exposures", "", "", "",
     "SELECT e.mid_s, t.x_mid_px - e.boresight_x_px, t.y_mid_px - e.boresight_y_px"
     /* one row an exposure: repeated ones of a hostile file would multiply */
     " FROM truth t JOIN (SELECT exposure_id, mid_s, boresight_x_px, boresight_y_px FROM exposures"
     " WHERE sensor = ?1 GROUP BY exposure_id) e ON e.exposure_id = t.exposure_id"
     " WHERE t.sensor = ?1 AND t.kind = 'object' AND t.id = ?2 AND t.in_field = 1",
     true, VALUE_LENGTH, ""},
    {0, "estimated by control", "control", "time_s", "aim_error_x_px, aim_error_y_px", "", NULL,
     false, VALUE_LENGTH, ""},
    {1, "true", "truth", "", "", "",
     "SELECT mid_s, snr FROM truth WHERE sensor = ?1 AND kind = 'object' AND id = ?2"
     " AND in_field = 1",
     true, VALUE_PLAIN, ""},
    {1, "of the track", "tracks", "time_s", "snr", OF_TARGET, NULL, false, VALUE_PLAIN, ""},
    {2, "true", "tracks", "", "", "",
     "SELECT t.time_s, t.ra_deg, t.dec_deg, u.ra_deg, u.dec_deg FROM tracks t JOIN (SELECT"
     " exposure_id, ra_deg, dec_deg FROM truth WHERE sensor = ?1 AND kind = 'object' AND id = ?2"
     " GROUP BY exposure_id) u ON u.exposure_id = t.exposure_id"
     " WHERE t.sensor = ?1 AND t.target_of_interest = 1",
     true, VALUE_ANGLE, "target_of_interest = 1"},
    {2, "3σ of the filter", "tracks", "time_s", "cov_d1_d1_rad2, cov_d2_d2_rad2", OF_TARGET, NULL,
     true, VALUE_THREE_SIGMA, "target_of_interest = 1"},
    {3, "innovation", "tracks", "", "", "", TRACK_STATES, true, VALUE_INNOVATION,
     "target_of_interest = 1"},
    {3, "3σ expected", "tracks", "", "", "", TRACK_STATES, true, VALUE_INNOVATION_SIGMA,
     "target_of_interest = 1"},
    {4, "outer", "pointing", "time_s", "axis_outer_deg", "", NULL, false, VALUE_PLAIN, ""},
    {4, "inner", "pointing", "time_s", "axis_inner_deg", "", NULL, false, VALUE_PLAIN, ""},
    {5, "third", "mount", "time_s", "axis2_deg", "", NULL, false, VALUE_PLAIN, "axes > 2"},
    {6, "mount", "pointing", "time_s", "limited", "", NULL, false, VALUE_PLAIN, "limited = 1"},
    {6, "wheels", "mount", "time_s", "wheels_saturated", "", NULL, false, VALUE_PLAIN,
     "wheels_saturated = 1"},
    {7, "x", "mount", "time_s", "body_rate_x_degps", "", NULL, false, VALUE_PLAIN,
     "body_rate_x_degps != 0"},
    {7, "y", "mount", "time_s", "body_rate_y_degps", "", NULL, false, VALUE_PLAIN,
     "body_rate_y_degps != 0"},
    {7, "z", "mount", "time_s", "body_rate_z_degps", "", NULL, false, VALUE_PLAIN,
     "body_rate_z_degps != 0"},
    {8, "all", "detection_frames", "mid_s", "detections", "", NULL, false, VALUE_PLAIN, ""},
    {8, "identified stars", "detection_frames", "mid_s", "stars_identified", "", NULL, false,
     VALUE_PLAIN, ""},
    {9, "x", "track_frames", "time_s", "attitude_error_x_arcsec", "", NULL, false, VALUE_PLAIN, ""},
    {9, "y", "track_frames", "time_s", "attitude_error_y_arcsec", "", NULL, false, VALUE_PLAIN, ""},
    {9, "z", "track_frames", "time_s", "attitude_error_z_arcsec", "", NULL, false, VALUE_PLAIN, ""},
    {10, "level", "detection_frames", "mid_s", "background_e", "", NULL, false, VALUE_PLAIN, ""},
    {10, "noise", "detection_frames", "mid_s", "noise_e", "", NULL, false, VALUE_PLAIN, ""},
    {11, "detections", "detection_frames", "mid_s",
     "CAST(written_tick - end_tick AS REAL) / (SELECT tick_rate_hz FROM run)", "", NULL, false,
     VALUE_PLAIN, ""},
    {11, "tracks", "track_frames", "time_s",
     "CAST(written_tick - tick AS REAL) / (SELECT tick_rate_hz FROM run)", "", NULL, false,
     VALUE_PLAIN, ""},
    WHEEL(0),
    WHEEL(1),
    WHEEL(2),
    WHEEL(3),
    WHEEL(4),
    WHEEL(5),
    WHEEL(6),
    WHEEL(7),
    {13, "simulated over wall time", "", "", "", "", "", false, VALUE_REAL_TIME, ""},
};

/* Most rows of a table of which several lines are read at once: all their samples are held. */
enum { ROWS_TOGETHER = 500000 };
/* Lines of the target's truth that are read at once with the line of kind VALUE_ANGLE. */
enum { TRUE_ERROR = 0, TRUE_SNR = 2 };

/* Path of the file that says how fast the run was. False: the path is too long. */
static bool wall_clock_path(const bst_view_run *run, char *path, size_t bytes) {
    bst_ctx ignored = {0};
    return bst_run_reader_file(&ignored, run->reader, "wall_clock.csv", path, bytes) == BST_OK;
}

/* Looks whether the table of a line has rows of the sensor that make its panel worth showing: 1 or
 * 0; -1: it cannot be read. */
static int find_recorded(const bst_view_run *run, const bst_view_sensor *s, int line) {
    char sql[160], path[4200];
    const char *only = lines[line].only;
    if (lines[line].kind == VALUE_REAL_TIME) {
        return wall_clock_path(run, path, sizeof path) && bst_view_has_wall_clock(path) ? 1 : 0;
    }
    snprintf(sql, sizeof sql, "SELECT EXISTS(SELECT 1 FROM %s WHERE sensor = ?1%s%s)",
             lines[line].table, only[0] ? " AND " : "", only);
    return !lines[line].of_target || s->target >= 0
               ? (int)bst_run_reader_int(run->reader, sql, s->sensor.index, -1)
               : 0;
}

/* True if the table of a line has rows of the sensor that make its panel worth showing. A look may
 * read the whole table, so it is made once, if no process writes the run. One that fails, which may
 * be for the work of a request alone, is made again. */
static bool is_recorded(const bst_view_run *run, bst_view_sensor *s, int line) {
    if (s->recorded[line] == 0 || run->running) {
        const int found = find_recorded(run, s, line);
        s->recorded[line] = found > 0 ? 1 : found == 0 ? -1 : 0;
    }
    return s->recorded[line] > 0;
}

/* True if a line is in its panel, where that is shown. */
static bool is_in_panel(const bst_view_run *run, bst_view_sensor *s, int line) {
    return lines[line].panel != WHEELS_PANEL || is_recorded(run, s, line);
}

/* True if a panel is shown: a line of it is worth showing. */
static bool is_shown(const bst_view_run *run, bst_view_sensor *s, int panel) {
    bool any = false;
    for (int i = 0; i < BST_VIEW_LINES && !any; i++) {
        any = lines[i].panel == panel && is_recorded(run, s, i);
    }
    return any;
}

void bst_view_add_panels(const bst_view_run *run, bst_view_sensor *s, cJSON *out) {
    for (int k = 0; k < BST_VIEW_PANELS; k++) {
        if (!is_shown(run, s, k)) {
            continue;
        }
        cJSON *names = cJSON_CreateArray();
        for (int i = 0; i < BST_VIEW_LINES; i++) {
            if (lines[i].panel == k && is_in_panel(run, s, i)) {
                cJSON_AddItemToArray(names, cJSON_CreateString(lines[i].name));
            }
        }
        cJSON *node = cJSON_CreateObject();
        cJSON_AddStringToObject(node, "name", panels[k].name);
        cJSON_AddStringToObject(node, "title", panels[k].title);
        cJSON_AddStringToObject(node, "unit", panels[k].unit);
        cJSON_AddItemToObject(node, "lines", names);
        if (strcmp(panels[k].name, "mount") == 0) {
            bst_view_add_stops(run, s, node);
        } else if (k == WHEELS_PANEL) {
            bst_view_add_wheel_limits(run, s, node);
        }
        cJSON_AddItemToArray(out, node);
    }
}

static bst_view_track_state read_state(const bst_io_rows *r) {
    return (bst_view_track_state){
        .time_s = bst_io_rows_real(r, 0),
        .track = bst_io_rows_int(r, 1),
        .misses_in_row = bst_io_rows_int(r, 2),
        .ra_deg = bst_io_rows_real(r, 3),
        .dec_deg = bst_io_rows_real(r, 4),
        .rate_arcsec_per_s = {bst_io_rows_real(r, 5), bst_io_rows_real(r, 6)},
        .d11 = bst_io_rows_real(r, 7),
        .d12 = bst_io_rows_real(r, 8),
        .d22 = bst_io_rows_real(r, 9),
        .dr = {{bst_io_rows_real(r, 10), bst_io_rows_real(r, 11)},
               {bst_io_rows_real(r, 12), bst_io_rows_real(r, 13)}},
        .r11 = bst_io_rows_real(r, 14),
        .r12 = bst_io_rows_real(r, 15),
        .r22 = bst_io_rows_real(r, 16)};
}

/* Value of a row, from column `at`; NAN: none. `before`: state of the row before, which becomes
 * that of this row. */
static double value_of(const bst_io_rows *rows, value_kind kind, int at,
                       bst_view_track_state *before) {
    double innovation, sigma3;
    switch (kind) {
        case VALUE_LENGTH:
            return hypot(bst_io_rows_real(rows, at), bst_io_rows_real(rows, at + 1));
        case VALUE_ANGLE:
            return bst_view_angle_arcsec(bst_io_rows_real(rows, 1), bst_io_rows_real(rows, 2),
                                         bst_io_rows_real(rows, 3), bst_io_rows_real(rows, 4));
        case VALUE_THREE_SIGMA:
            return bst_view_three_sigma_arcsec(bst_io_rows_real(rows, at),
                                               bst_io_rows_real(rows, at + 1));
        case VALUE_INNOVATION:
        case VALUE_INNOVATION_SIGMA: {
            bst_view_track_state now = read_state(rows);
            bool found = bst_view_innovation(before, &now, &innovation, &sigma3);
            *before = now;
            return !found ? NAN : kind == VALUE_INNOVATION ? innovation : sigma3;
        }
        case VALUE_PLAIN:
        case VALUE_REAL_TIME:
        default:
            return bst_io_rows_real(rows, at);
    }
}

/* Reads the rows of a line's own query as its samples. */
static bst_status read_line(bst_ctx *ctx, bst_view_run *run, bst_io_rows *rows, value_kind kind,
                            bst_view_line *line) {
    bst_view_track_state before = {.track = -1};
    bst_view_samples c = {.samples = NULL};
    bst_status status;
    bool more;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        status =
            bst_view_collect(ctx, &c, bst_io_rows_real(rows, 0), value_of(rows, kind, 1, &before));
        if (status != BST_OK) {
            break;
        }
    }
    return bst_view_keep_line(ctx, status, run, &c, line);
}

/* Reads the speed of the run. */
static bst_status read_factors(bst_ctx *ctx, bst_view_run *run, bst_view_line *line) {
    bst_view_samples c = {.samples = NULL};
    char path[4200];
    bst_status status = BST_OK;
    if (wall_clock_path(run, path, sizeof path)) {
        status = bst_view_read_factors(ctx, path, &c);
    }
    return bst_view_keep_line(ctx, status, run, &c, line);
}

/* Number of the line of a kind of which there is one. */
static int line_of(value_kind kind) {
    int k = 0;
    while (k < BST_VIEW_LINES - 1 && lines[k].kind != kind) {
        k++;
    }
    return k;
}

/* Reads the innovations and their spread, which follow from the same rows, at once. */
static bst_status read_innovations(bst_ctx *ctx, bst_view_run *run, bst_io_rows *rows,
                                   bst_view_line *line, bst_view_line *spread) {
    bst_view_track_state before = {.track = -1};
    bst_view_samples values = {.samples = NULL}, sigmas = values;
    bst_status status;
    bool more;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        const bst_view_track_state now = read_state(rows);
        double innovation, sigma3;
        const bool found = bst_view_innovation(&before, &now, &innovation, &sigma3);
        before = now;
        status = bst_view_collect(ctx, &values, now.time_s, found ? innovation : NAN);
        status = status == BST_OK ? bst_view_collect(ctx, &sigmas, now.time_s, found ? sigma3 : NAN)
                                  : status;
        if (status != BST_OK) {
            break;
        }
    }
    line->used = spread->used = run->requests;
    const bst_status kept = bst_view_keep_line(ctx, status, run, &values, line);
    status = bst_view_keep_line(ctx, status, run, &sigmas, spread);
    return kept == BST_OK ? status : kept;
}

/* True if line i is read with line k: from the same rows, not held, and to be shown. */
static bool is_read_with(const bst_view_run *run, bst_view_sensor *s, int i, int k) {
    return !lines[i].sql && strcmp(lines[i].table, lines[k].table) == 0 &&
           strcmp(lines[i].where, lines[k].where) == 0 && !s->lines[i].samples &&
           (!lines[i].of_target || s->target >= 0) && is_in_panel(run, s, i) &&
           is_shown(run, s, lines[i].panel);
}

/* Reads line k, and with it the other lines of the same rows if there are not too many rows: most
 * of the time goes into finding the rows.
 *
 * Given:     alone  line k only
 * Returned:  *done  false: there is no such table, or it lacks a column */
static bst_status read_rows(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int k, bool alone,
                            bool *done) {
    bst_view_samples samples[BST_VIEW_LINES] = {{.samples = NULL}};
    int list[BST_VIEW_LINES], count = 0;
    char sql[2048];
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bst_status status;
    bool more;
    snprintf(sql, sizeof sql, "SELECT max(rowid) FROM %s", lines[k].table);
    const bool together = !alone && bst_run_reader_int(run->reader, sql, 0, 0) <= ROWS_TOGETHER;
    int n = snprintf(sql, sizeof sql, "SELECT %s", lines[k].time);
    for (int i = 0; i < BST_VIEW_LINES; i++) {
        if (i == k || (together && is_read_with(run, s, i, k))) {
            list[count++] = i;
            n += snprintf(sql + n, sizeof sql - (size_t)n, ", %s", lines[i].values);
        }
    }
    snprintf(sql + n, sizeof sql - (size_t)n, " FROM %s WHERE sensor = ?1%s", lines[k].table,
             lines[k].where);
    *done = bst_io_rows_open(&ignored, run->reader, sql, s->sensor.index, 0, &rows) == BST_OK;
    if (!*done) {
        return BST_OK;
    }
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        for (int i = 0, at = 1; status == BST_OK && i < count; i++) {
            const value_kind kind = lines[list[i]].kind;
            status = bst_view_collect(ctx, &samples[i], bst_io_rows_real(rows, 0),
                                      value_of(rows, kind, at, NULL));
            at += kind == VALUE_PLAIN ? 1 : 2;
        }
        if (status != BST_OK) {
            break;
        }
    }
    bst_io_rows_close(rows);
    bst_status kept = status;
    for (int i = 0; i < count; i++) {
        bst_view_line *line = &s->lines[list[i]];
        line->used = run->requests;
        status = bst_view_keep_line(ctx, kept, run, &samples[i], line);
        kept = status == BST_OK ? kept : status;
    }
    return kept;
}

/* Reads a line if it is not held. A table that was not recorded gives a line without samples. */
static bst_status need_line(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int k) {
    bst_view_line *line = &s->lines[k];
    line->used = ++run->requests;
    if (line->samples) {
        return BST_OK;
    }
    if (lines[k].kind == VALUE_REAL_TIME) {
        return read_factors(ctx, run, line);
    }
    bst_ctx ignored = {0};
    bst_io_rows *rows = NULL;
    const int angle = line_of(VALUE_ANGLE);
    bst_view_line *innovation = &s->lines[line_of(VALUE_INNOVATION)],
                  *spread = &s->lines[line_of(VALUE_INNOVATION_SIGMA)];
    const bool known = !lines[k].of_target || s->target >= 0;
    if (known && (k == TRUE_ERROR || k == TRUE_SNR || k == angle) &&
        !s->lines[TRUE_ERROR].samples && !s->lines[TRUE_SNR].samples && !s->lines[angle].samples) {
        bool done;
        BST_TRY(bst_view_read_truth(ctx, run, s, &s->lines[TRUE_ERROR], &s->lines[TRUE_SNR],
                                    &s->lines[angle], &done));
        if (done) {
            return BST_OK;
        }
    }
    for (int alone = 0; known && !lines[k].sql && alone < 2; alone++) {
        bool done;
        BST_TRY(read_rows(ctx, run, s, k, alone, &done));
        if (done) {
            return BST_OK;
        }
    }
    if (!known || !lines[k].sql ||
        bst_io_rows_open(&ignored, run->reader, lines[k].sql, s->sensor.index, s->target, &rows) !=
            BST_OK) {
        line->samples = calloc(1, sizeof *line->samples);
        return line->samples ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    const bool both =
        (line == innovation || line == spread) && !innovation->samples && !spread->samples;
    bst_status status = both ? read_innovations(ctx, run, rows, innovation, spread)
                             : read_line(ctx, run, rows, lines[k].kind, line);
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

/* Number of a panel; BST_VIEW_PANELS: there is none of that name. */
static int panel_named(const char *name) {
    int panel = 0;
    while (panel < BST_VIEW_PANELS && strcmp(panels[panel].name, name) != 0) {
        panel++;
    }
    return panel;
}

static bst_status plot_panel(bst_ctx *ctx, bst_view_run *run, const bst_view_plot *plot,
                             bst_view_bytes *out) {
    bst_view_sensor *s;
    const int panel = panel_named(plot->panel);
    BST_TRY(bst_view_find_sensor(ctx, run, plot->sensor, &s));
    if (panel == BST_VIEW_PANELS) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no panel \"%s\"", plot->panel);
    }
    if (!(plot->from_s < plot->to_s) || plot->columns < 1 || plot->columns > BST_VIEW_COLUMNS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "from %g to %g s in %d columns (allowed: a range of time, 1 to %d columns)",
                        plot->from_s, plot->to_s, plot->columns, BST_VIEW_COLUMNS);
    }
    for (int i = 0; i < BST_VIEW_LINES; i++) {
        if (lines[i].panel == panel && is_in_panel(run, s, i)) {
            BST_TRY(need_line(ctx, run, s, i));
            BST_TRY(append_line(ctx, &s->lines[i], plot, out));
        }
    }
    return BST_OK;
}

bst_status bst_view_read_panel(bst_ctx *ctx, bst_view_run *run, int sensor, int panel) {
    bst_status status = bst_view_lock(ctx, run);
    for (int i = 0; status == BST_OK && sensor < run->sensors && i < BST_VIEW_LINES; i++) {
        bst_view_sensor *s = &run->sensor[sensor];
        if (lines[i].panel == panel && is_in_panel(run, s, i) && is_shown(run, s, panel)) {
            status = need_line(ctx, run, s, i);
        }
    }
    bst_view_unlock(run);
    return status;
}

void bst_view_take_looks(bst_view_run *to, bst_view_run *from, int sensor) {
    pthread_mutex_lock(&from->lock);
    if (sensor < to->sensors && sensor < from->sensors) {
        memcpy(to->sensor[sensor].recorded, from->sensor[sensor].recorded,
               sizeof to->sensor[sensor].recorded);
    }
    pthread_mutex_unlock(&from->lock);
}

void bst_view_take_lines(bst_view_run *run, bst_view_run *from, int sensor, int panel) {
    pthread_mutex_lock(&run->lock);
    for (int i = 0; sensor < run->sensors && sensor < from->sensors && i < BST_VIEW_LINES; i++) {
        bst_view_line *line = &run->sensor[sensor].lines[i],
                      *other = &from->sensor[sensor].lines[i];
        if (lines[i].panel == panel && other->samples && !line->samples &&
            bst_view_has_room(run, other->count)) {
            *line = *other;
            line->used = ++run->requests;
            run->samples += line->count;
            from->samples -= line->count;
            *other = (bst_view_line){.samples = NULL};
        }
    }
    pthread_mutex_unlock(&run->lock);
}

void bst_view_begin_wait(bst_view_run *run, int first, int end) {
    pthread_mutex_lock(&run->ahead_lock);
    for (int panel = first; panel < end; panel++) {
        run->ahead[panel] = true;
    }
    pthread_mutex_unlock(&run->ahead_lock);
}

void bst_view_end_wait(bst_view_run *run, int panel) {
    pthread_mutex_lock(&run->ahead_lock);
    run->ahead[panel] = false;
    pthread_cond_broadcast(&run->ahead_changed);
    pthread_mutex_unlock(&run->ahead_lock);
}

/* Waits while a panel is being read ahead. */
static void wait_ahead(bst_view_run *run, const bst_view_plot *plot) {
    const int panel = panel_named(plot->panel);
    pthread_mutex_lock(&run->ahead_lock);
    while (plot->sensor == 0 && panel < BST_VIEW_PANELS && run->ahead[panel]) {
        pthread_cond_wait(&run->ahead_changed, &run->ahead_lock);
    }
    pthread_mutex_unlock(&run->ahead_lock);
}

bst_status bst_view_run_plot(bst_ctx *ctx, bst_view_run *run, const bst_view_plot *plot,
                             bst_view_bytes *out) {
    *out = (bst_view_bytes){.data = NULL};
    wait_ahead(run, plot);
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? plot_panel(ctx, run, plot, out) : status;
    bst_view_unlock(run);
    if (status != BST_OK) {
        free(out->data);
        *out = (bst_view_bytes){.data = NULL};
    }
    return status;
}
