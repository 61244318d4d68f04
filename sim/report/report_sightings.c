/* Report of sightings: the tables passes and sightings of a run with several objects. */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/json_member.h"
#include "sim/core/text.h"
#include "sim/report/report_plots.h"

/* maximum objects in the timeline and in the table; sensors with their own colour; points of the
 * curves */
enum { ROWS = 40, LISTED = 25, SENSORS = 7, POINTS = 400 };

typedef struct sensor_names {
    char names[SENSORS][100];
    int count;
} sensor_names;

/* Chart colour of a sensor; grey beyond the number of named sensors. */
static int colour_of(int64_t sensor) {
    return sensor >= 0 && sensor < SENSORS ? (int)sensor : BST_CHART_GREY;
}

/* Reads the names "observer/sensor" of the run's sensors. */
static bst_status read_names(bst_ctx *ctx, const bst_run_reader *run, sensor_names *out) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    out->count = 0;
    BST_TRY(bst_io_rows_open(ctx, run, "SELECT observer, name FROM sensors ORDER BY sensor", 0, 0,
                             &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           out->count < SENSORS) {
        char *name = out->names[out->count++];
        size_t n =
            (size_t)snprintf(name, sizeof out->names[0], "%.49s/", bst_io_rows_text(rows, 0));
        snprintf(name + n, sizeof out->names[0] - n, "%.49s", bst_io_rows_text(rows, 1));
    }
    bst_io_rows_close(rows);
    return status;
}

static void put_legend(FILE *out, const sensor_names *names, bst_chart_key key, bool others) {
    fputs("<ul class=\"legend\">\n", out);
    for (int i = 0; i < names->count; i++) {
        bst_chart_legend(out, key, colour_of(i), names->names[i]);
    }
    if (others) {
        bst_chart_legend(out, key, BST_CHART_GREY, "in the field, not detected");
    }
    fputs("</ul>\n", out);
}

/* ------------------------------------------------------------------ figures */

/* Writes the key figures of surveillance: objects and passes seen, revisit time, custody. */
static void put_cards(FILE *out, const bst_run_reader *run) {
    const cJSON *f = cJSON_GetObjectItemCaseSensitive(bst_run_reader_manifest(run), "sightings");
    char text[32], note[120], more[32];
    if (!cJSON_IsObject(f)) {
        return; /* without summary: charts only */
    }
    fputs("<div class=\"cards\">\n", out);
    snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "objects_seen"));
    snprintf(note, sizeof note, "of %.0f, %.0f of them in a field",
             bst_json_member_number(f, "objects"), bst_json_member_number(f, "objects_in_field"));
    bst_report_page_card(out, text, "", "objects seen", note);
    snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "passes_seen"));
    snprintf(note, sizeof note, "of %.0f through a field", bst_json_member_number(f, "passes"));
    bst_report_page_card(out, text, "", "passes seen", note);
    snprintf(note, sizeof note, "at most %s s",
             bst_report_page_number(more, bst_json_member_number(f, "revisit_most_s"), 4));
    bst_report_page_card(
        out, bst_report_page_number(text, bst_json_member_number(f, "revisit_mean_s"), 4), "s",
        "revisit, mean", note);
    snprintf(note, sizeof note, "%s %% of those seen",
             bst_report_page_number(more,
                                    100.0 * bst_json_member_number(f, "custody_fraction_seen"), 3));
    bst_report_page_card(
        out,
        bst_report_page_number(text, 100.0 * bst_json_member_number(f, "custody_fraction_all"), 3),
        "%", "object custody, mean of all", note);
    snprintf(note, sizeof note, "tracks %s arcsec",
             bst_report_page_number(more, bst_json_member_number(f, "track_rms_arcsec"), 3));
    bst_report_page_card(
        out, bst_report_page_number(text, bst_json_member_number(f, "place_rms_arcsec"), 3),
        "arcsec", "detections from truth, RMS", note);
    if (bst_json_member_number(f, "tasks") > 0.0) {
        snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "tasks_done"));
        snprintf(note, sizeof note, "of %.0f; %.0f not found, %.0f lost",
                 bst_json_member_number(f, "tasks"), bst_json_member_number(f, "tasks_not_found"),
                 bst_json_member_number(f, "tasks_lost"));
        bst_report_page_card(out, text, "", "tasks done", note);
    }
    fputs("</div>\n", out);
}

/* ------------------------------------------------------------------ timeline */

/* Selects the objects with the most detections. */
static bst_status choose(bst_ctx *ctx, const bst_run_reader *run, int64_t objects[ROWS],
                         char names[ROWS][48], int *count) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    *count = 0;
    BST_TRY(bst_io_rows_open(ctx, run,
                             "SELECT object, name, sum(detected) FROM passes GROUP BY object"
                             " HAVING sum(detected) > 0 ORDER BY 3 DESC, 1 LIMIT ?1",
                             ROWS, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more && *count < ROWS) {
        objects[*count] = bst_io_rows_int(rows, 0);
        snprintf(names[(*count)++], 48, "%.22s", bst_io_rows_text(rows, 1));
    }
    bst_io_rows_close(rows);
    return status;
}

/* Draws an object's passes through the fields of view as bars in its row of the timeline. */
static bst_status put_passes(bst_ctx *ctx, const bst_chart *c, const bst_run_reader *run,
                             const sensor_names *names, int64_t object, int row, double unit_s) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    BST_TRY(bst_io_rows_open(ctx, run,
                             "SELECT sensor, start_s, end_s, detected, frames FROM passes"
                             " WHERE object = ?1 ORDER BY start_s, sensor",
                             object, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        int64_t sensor = bst_io_rows_int(rows, 0), detected = bst_io_rows_int(rows, 3);
        double from = bst_io_rows_real(rows, 1) / unit_s, to = bst_io_rows_real(rows, 2) / unit_s;
        double least = 1.5 * (c->x.high - c->x.low) / c->inner_width; /* minimum visible width */
        char title[200];
        snprintf(title, sizeof title, "%s: %.6g s to %.6g s, detected in %" PRId64 " of %s",
                 sensor >= 0 && sensor < names->count ? names->names[sensor] : "a sensor",
                 from * unit_s, to * unit_s, detected,
                 bst_text_of_count((char[BST_COUNT_TEXT]){0}, bst_io_rows_int(rows, 4), "frame",
                                   "frames"));
        bst_chart_bar(c, from, fmax(to, from + least), row + 0.15, row + 0.85,
                      detected > 0 ? colour_of(sensor) : BST_CHART_GREY, title);
    }
    bst_io_rows_close(rows);
    return status;
}

/* Draws the timeline of passes of the objects with most detections. */
static bst_status put_timeline(bst_ctx *ctx, FILE *out, const bst_run_reader *run,
                               const sensor_names *names, double span_s) {
    int64_t objects[ROWS];
    char labels[ROWS][48];
    int count;
    const char *unit;
    BST_TRY(choose(ctx, run, objects, labels, &count));
    if (count == 0) {
        fputs("<p class=\"note\">No object was detected.</p>\n", out);
        return BST_OK;
    }
    double unit_s = bst_chart_time_unit(span_s, &unit);
    char label[40], caption[200];
    snprintf(label, sizeof label, "time since the epoch, %s", unit);
    bst_report_page_figure(out, BST_PAGE_WIDE);
    bst_chart c = {.out = out,
                   .name = "Timeline of the objects' passes through the sensors' fields",
                   .width = 1100.0,
                   .height = 50.0 + 17.0 * count,
                   .margin_left = 180.0,
                   .x = {.label = label, .low = 0.0, .high = span_s / unit_s, .unit_s = unit_s},
                   .y = {.label = "", .low = 0.0, .high = count, .bare = true}};
    bst_chart_begin(&c);
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        int row = count - 1 - i;
        bst_chart_word(&c, c.x.low, row + 0.5, -8.0, 4.0, "end", labels[i]);
        status = put_passes(ctx, &c, run, names, objects[i], row, unit_s);
    }
    bst_chart_end(&c);
    put_legend(out, names, BST_KEY_GROUND, true);
    snprintf(caption, sizeof caption, "Who saw what, when: passes of the %s with most detections.",
             bst_text_of_count((char[BST_COUNT_TEXT]){0}, count, "object", "objects"));
    bst_report_page_figure_end(out, caption);
    return status;
}

/* ------------------------------------------------------------------ objects seen so far */

/* Points of a curve over time. */
typedef struct curve {
    double unit_s; /* seconds per unit of x */
    double *x, *y; /* [room] */
    size_t room;
} curve;

/* Draws the cumulative number of objects detected by a sensor (-1: any) over time. */
static bst_status put_count(bst_ctx *ctx, bst_chart *c, const bst_run_reader *run, int sensor,
                            const curve *k, size_t *total) {
    double *x = k->x, *y = k->y;
    bst_io_rows *rows;
    bst_status status;
    bool more;
    size_t n = 0;
    BST_TRY(bst_io_rows_open(ctx, run,
                             "SELECT min(first_s) FROM passes WHERE first_s IS NOT NULL"
                             " AND (?1 < 0 OR sensor = ?1) GROUP BY object ORDER BY 1",
                             sensor, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more && n + 1 < k->room) {
        x[n] = bst_io_rows_real(rows, 0) / k->unit_s;
        y[n] = (double)(n + 1);
        n++;
    }
    bst_io_rows_close(rows);
    *total = n;
    if (c && status == BST_OK) {
        x[n] = c->x.high;
        y[n] = (double)n;
        bst_chart_line(c, x, y, n + 1, sensor < 0 ? BST_CHART_GREY : colour_of(sensor), sensor < 0);
    }
    return status;
}

/* Draws the cumulative number of detected objects over time, per sensor and in total. */
static bst_status put_counts(bst_ctx *ctx, FILE *out, const bst_run_reader *run,
                             const sensor_names *names, double span_s) {
    size_t room =
        (size_t)bst_run_reader_int(run, "SELECT count(DISTINCT object) FROM passes", 0, 0) + 2;
    const char *unit;
    double unit_s = bst_chart_time_unit(span_s, &unit), *x = malloc(2 * room * sizeof *x);
    size_t total;
    char label[40];
    if (!x) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for who saw what");
    }
    snprintf(label, sizeof label, "time since the epoch, %s", unit);
    const curve k = {unit_s, x, x + room, room};
    bst_status status = put_count(ctx, NULL, run, -1, &k, &total);
    if (status == BST_OK && total > 0) {
        bst_report_page_figure(out, BST_PAGE_WIDE);
        bst_chart c = {
            .out = out,
            .name = "Number of objects seen so far over time",
            .width = 1100.0,
            .height = 260.0,
            .margin_left = 64.0,
            .x = {.label = label, .low = 0.0, .high = span_s / unit_s, .unit_s = unit_s},
            .y = {.label = "objects seen so far", .low = 0.0, .high = 1.05 * (double)total}};
        bst_chart_begin(&c);
        for (int i = -1; i < names->count && status == BST_OK; i++) {
            size_t own;
            status = put_count(ctx, &c, run, i, &k, &own);
        }
        bst_chart_end(&c);
        put_legend(out, names, BST_KEY_LINE, false);
        bst_report_page_figure_end(
            out, "Objects that were detected at least once; dashed: by any sensor.");
    }
    free(x);
    return status;
}

/* ------------------------------------------------------------------ over the objects */

static bst_status put_histogram(bst_ctx *ctx, FILE *out, const bst_run_reader *run, const char *sql,
                                const char *label, double scale, const char *caption) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    size_t n = 0,
           room = (size_t)bst_run_reader_int(run, "SELECT count(*) FROM sightings", 0, 0) + 1;
    double *values = malloc(room * sizeof *values), low = INFINITY, high = -INFINITY;
    if (!values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for who saw what");
    }
    status = bst_io_rows_open(ctx, run, sql, 0, 0, &rows);
    while (status == BST_OK && (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           n < room) {
        values[n++] = scale * bst_io_rows_real(rows, 0);
    }
    bst_io_rows_close(rows);
    bst_chart_widen(values, n, false, &low, &high);
    if (status == BST_OK && n >= 10 && high > low) {
        bst_report_page_figure(out, BST_PAGE_THIRD);
        const bst_report_histogram_of histogram = {.name = caption,
                                                   .label = label,
                                                   .what = "objects",
                                                   .values = values,
                                                   .n = n,
                                                   .low = low,
                                                   .high = high + 1e-9 * (high - low),
                                                   .bins = 30,
                                                   .colour = BST_CHART_BLUE};
        bst_report_histogram(out, &histogram);
        bst_report_page_figure_end(out, caption);
    }
    free(values);
    return status;
}

static bst_status put_table(bst_ctx *ctx, FILE *out, const bst_run_reader *run) {
    static const char *const heads[] = {"object",           "NORAD",          "passes seen",
                                        "detected",         "tracked",        "object custody, %",
                                        "revisit, s",       "longest gap, s", "place RMS, arcsec",
                                        "track RMS, arcsec"};
    bst_io_rows *rows;
    bst_status status;
    bool more;
    BST_TRY(bst_io_rows_open(ctx, run,
                             "SELECT name, norad, passes_seen, detected, tracked,"
                             " 100.0 * custody_fraction, revisit_mean_s, longest_gap_s,"
                             " place_rms_arcsec, track_rms_arcsec FROM sightings"
                             " WHERE sensor IS NULL AND detected > 0"
                             " ORDER BY detected DESC, object LIMIT ?1",
                             LISTED, 0, &rows));
    fprintf(out,
            "<details><summary>The %d objects with most detections</summary>\n"
            "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>",
            LISTED);
    for (int k = 0; k < 10; k++) {
        fprintf(out, "<th scope=\"col\"%s>%s</th>", k ? " class=\"n\"" : "", heads[k]);
    }
    fputs("</tr></thead>\n<tbody>\n", out);
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        fputs("<tr>", out);
        for (int k = 0; k < 10; k++) {
            char text[32];
            fputs(k ? "<td class=\"n\">" : "<td>", out);
            bst_html_text(out, k < 5 ? bst_io_rows_text(rows, k)
                                     : bst_report_page_number(text, bst_io_rows_real(rows, k), 4));
            fputs("</td>", out);
        }
        fputs("</tr>\n", out);
    }
    bst_io_rows_close(rows);
    fputs("</tbody></table></div>\n</details>\n", out);
    return status;
}

static bst_status put_all(bst_ctx *ctx, FILE *out, const bst_run_reader *run, double span_s) {
    sensor_names names;
    BST_TRY(read_names(ctx, run, &names));
    put_cards(out, run);
    BST_TRY(put_timeline(ctx, out, run, &names, span_s));
    BST_TRY(put_counts(ctx, out, run, &names, span_s));
    bst_report_page_grid(out, BST_PAGE_THIRD);
    bst_status status = put_histogram(
        ctx, out, run,
        "SELECT custody_fraction FROM sightings WHERE sensor IS NULL AND detected > 0",
        "object custody, %", 100.0,
        "Object custody (share of the time that the last detection is no older than "
        "record.custody_timeout_s) of the objects that were seen.");
    if (status == BST_OK) {
        status = put_histogram(
            ctx, out, run,
            "SELECT revisit_mean_s FROM sightings WHERE sensor IS NULL AND revisits > 0",
            "revisit, min", 1.0 / 60.0,
            "Mean time between two passes with detections, of the objects that had two.");
    }
    if (status == BST_OK) {
        status = put_histogram(
            ctx, out, run,
            "SELECT min(place_rms_arcsec, 20) FROM sightings WHERE sensor IS NULL"
            " AND place_rms_arcsec IS NOT NULL",
            "place, arcsec", 1.0,
            "RMS of the detections' places from the truth, by object; 20 stands for more.");
    }
    bst_report_page_grid_end(out);
    return status == BST_OK ? put_table(ctx, out, run) : status;
}

bst_status bst_report_sightings(bst_ctx *ctx, FILE *out, const bst_run_reader *run, double span_s) {
    if (bst_run_reader_int(run, "SELECT count(*) FROM sightings", 0, 0) == 0 ||
        bst_run_reader_int(run, "SELECT count(DISTINCT object) FROM passes", 0, 0) < 2) {
        return BST_OK;
    }
    bst_report_page_section(out, 2, "Who saw what");
    bst_status status = put_all(ctx, out, run, span_s > 0.0 ? span_s : 1.0);
    bst_report_page_section_end(out);
    return status;
}
