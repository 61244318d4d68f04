/* Report of the custody of the catalogue: the tables custody and custody_tracks of a run. */
#include <math.h>
#include <stdlib.h>

#include <cjson/cJSON.h>

#include "sim/core/json_member.h"
#include "sim/io/html.h"
#include "sim/report/report_plots.h"

enum { LISTED = 25, MOST_POINTS = 200000 };

/* Writes the key figures: objects, tracks, uncertainty, consistency. */
static void put_cards(FILE *out, const cJSON *f) {
    char text[32], more[32], least[32], note[160];
    fputs("<div class=\"cards\">\n", out);
    snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "in_custody"));
    snprintf(note, sizeof note, "of %.0f, by the uncertainty at the end",
             bst_json_member_number(f, "objects"));
    bst_report_page_card(out, text, "", "objects in custody", note);
    snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "updated"));
    snprintf(note, sizeof note, "last %s s ago, mean",
             bst_report_page_number(more, bst_json_member_number(f, "age_mean_s"), 4));
    bst_report_page_card(out, text, "", "objects updated", note);
    snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "correlated"));
    snprintf(note, sizeof note, "of %.0f; %.0f ambiguous, %.0f of no object",
             bst_json_member_number(f, "tracks"), bst_json_member_number(f, "ambiguous"),
             bst_json_member_number(f, "uncorrelated"));
    bst_report_page_card(out, text, "", "tracks correlated", note);
    snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "cross_tags"));
    bst_report_page_card(out, text, "", "cross-tags", "tracks of another object by the truth");
    if (bst_json_member_number(f, "candidates") > 0.0) {
        snprintf(text, sizeof text, "%.0f", bst_json_member_number(f, "new_objects"));
        snprintf(note, sizeof note, "of %.0f candidates; %.0f wrong by the truth",
                 bst_json_member_number(f, "candidates"), bst_json_member_number(f, "new_wrong"));
        bst_report_page_card(out, text, "", "new objects", note);
    }
    snprintf(note, sizeof note, "all objects: %s m, 90 %% below %s m",
             bst_report_page_number(more, bst_json_member_number(f, "sigma_median_m"), 3),
             bst_report_page_number(least, bst_json_member_number(f, "sigma_p90_m"), 3));
    bst_report_page_card(
        out, bst_report_page_number(text, bst_json_member_number(f, "sigma_updated_median_m"), 3),
        "m", "uncertainty of updated objects, median", note);
    snprintf(note, sizeof note, "%s to %s if consistent (95 %%)",
             bst_report_page_number(least, bst_json_member_number(f, "nees_low"), 3),
             bst_report_page_number(more, bst_json_member_number(f, "nees_high"), 3));
    bst_report_page_card(out,
                         bst_report_page_number(text, bst_json_member_number(f, "nees_mean"), 3),
                         "", "NEES of updated objects", note);
    fputs("</div>\n", out);
}

/* Pairs of a query. */
typedef struct pairs {
    size_t n;
    double *x, *y; /* y = x + room */
} pairs;

static bst_status read_pairs(bst_ctx *ctx, const bst_run_reader *run, const char *sql, pairs *out) {
    bst_io_rows *rows;
    bool more;
    *out = (pairs){.x = malloc(2 * MOST_POINTS * sizeof *out->x)};
    if (!out->x) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the custody of the catalogue");
    }
    out->y = out->x + MOST_POINTS;
    bst_status status = bst_io_rows_open(ctx, run, sql, 0, 0, &rows);
    while (status == BST_OK && (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           out->n < MOST_POINTS) {
        out->x[out->n] = bst_io_rows_real(rows, 0);
        out->y[out->n++] = bst_io_rows_real(rows, 1);
    }
    bst_io_rows_close(rows);
    return status;
}

/* Draws the number of updates since the start over time. */
static bst_status put_updates(bst_ctx *ctx, FILE *out, const bst_run_reader *run, double span_s) {
    pairs p;
    bst_status status = read_pairs(
        ctx, run, "SELECT time_s, 0.0 FROM custody_tracks WHERE object IS NOT NULL ORDER BY time_s",
        &p);
    const char *unit;
    const double unit_s = bst_chart_time_unit(span_s, &unit);
    char label[40];
    for (size_t i = 0; i < p.n; i++) {
        p.x[i] /= unit_s;
        p.y[i] = (double)(i + 1);
    }
    if (status == BST_OK && p.n > 0) {
        snprintf(label, sizeof label, "time since the epoch, %s", unit);
        bst_report_page_figure(out, BST_PAGE_THIRD);
        bst_chart c = {.out = out,
                       .name = "Updates of orbits so far over time",
                       .width = 360.0,
                       .height = 230.0,
                       .x = {.label = label, .low = 0.0, .high = span_s / unit_s, .unit_s = unit_s},
                       .y = {.label = "updates so far", .low = 0.0, .high = 1.05 * (double)p.n}};
        bst_chart_begin(&c);
        bst_chart_line(&c, p.x, p.y, p.n, BST_CHART_BLUE, false);
        bst_chart_end(&c);
        bst_report_page_figure_end(
            out, p.n == MOST_POINTS
                     ? "The first 200,000 tracks that updated an orbit, by their last detection."
                     : "Tracks that updated an orbit, by their last detection.");
    }
    free(p.x);
    return status;
}

/* Draws dots of two positive quantities on logarithmic axes. `diagonal`: also the line where they
 * are equal. */
static bst_status put_dots(bst_ctx *ctx, FILE *out, const bst_run_reader *run, const char *sql,
                           bst_chart *chart, bool diagonal, const char *caption) {
    pairs p;
    bst_status status = read_pairs(ctx, run, sql, &p);
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    bst_chart_widen(p.x, p.n, chart->x.logarithmic, &low[0], &high[0]);
    bst_chart_widen(p.y, p.n, chart->y.logarithmic, &low[1], &high[1]);
    if (status == BST_OK && p.n > 0 && high[0] >= low[0] && high[1] >= low[1]) {
        bst_chart_fit(&chart->x, low[0], high[0], 0.05);
        bst_chart_fit(&chart->y, low[1], high[1], 0.05);
        const double ends[2] = {fmax(chart->x.low, chart->y.low),
                                fmin(chart->x.high, chart->y.high)};
        chart->out = out;
        chart->width = 360.0;
        chart->height = 230.0;
        bst_report_page_figure(out, BST_PAGE_THIRD);
        bst_chart_begin(chart);
        if (diagonal && ends[1] > ends[0]) {
            bst_chart_line(chart, ends, ends, 2, BST_CHART_GREY, true);
        }
        bst_chart_dots(chart, p.x, p.y, p.n, BST_CHART_BLUE);
        bst_chart_end(chart);
        bst_report_page_figure_end(out, caption);
    }
    free(p.x);
    return status;
}

static bst_status put_table(bst_ctx *ctx, FILE *out, const bst_run_reader *run) {
    static const char *const heads[] = {"object",     "NORAD",  "updates",
                                        "cross-tags", "age, s", "uncertainty, m",
                                        "error, m",   "NEES",   "chi-square, mean"};
    enum { HEADS = sizeof heads / sizeof *heads, WHOLE = 4 };
    bst_io_rows *rows;
    bst_status status;
    bool more;
    BST_TRY(bst_io_rows_open(ctx, run,
                             "SELECT name, norad, updates, cross_tags, age_s, sigma_m, error_m,"
                             " nees, chi2_mean FROM custody WHERE updates > 0"
                             " ORDER BY nees DESC, object LIMIT ?1",
                             LISTED, 0, &rows));
    fprintf(out,
            "<details><summary>The %d updated objects with the largest NEES</summary>\n"
            "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>",
            LISTED);
    for (int k = 0; k < HEADS; k++) {
        fprintf(out, "<th scope=\"col\"%s>%s</th>", k ? " class=\"n\"" : "", heads[k]);
    }
    fputs("</tr></thead>\n<tbody>\n", out);
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        fputs("<tr>", out);
        for (int k = 0; k < HEADS; k++) {
            char text[32];
            fputs(k ? "<td class=\"n\">" : "<td>", out);
            bst_html_text(out, k < WHOLE
                                   ? bst_io_rows_text(rows, k)
                                   : bst_report_page_number(text, bst_io_rows_real(rows, k), 4));
            fputs("</td>", out);
        }
        fputs("</tr>\n", out);
    }
    bst_io_rows_close(rows);
    fputs("</tbody></table></div>\n</details>\n", out);
    return status;
}

static bst_status put_charts(bst_ctx *ctx, FILE *out, const bst_run_reader *run, double span_s) {
    bst_chart age = {.name = "Uncertainty of updated objects against the age of their last update",
                     .x = {.label = "age, h"},
                     .y = {.label = "uncertainty, m", .logarithmic = true}};
    bst_chart error = {.name = "Error of the position against its uncertainty, updated objects",
                       .x = {.label = "uncertainty, m", .logarithmic = true},
                       .y = {.label = "error, m", .logarithmic = true}};
    bst_report_page_grid(out, BST_PAGE_THIRD);
    bst_status status = put_updates(ctx, out, run, span_s);
    if (status == BST_OK) {
        status = put_dots(
            ctx, out, run,
            "SELECT age_s / 3600.0, sigma_m FROM custody WHERE updates > 0 AND sigma_m > 0", &age,
            false,
            "Standard deviation of the position at the end and time since the last "
            "update, each updated object.");
    }
    if (status == BST_OK) {
        status = put_dots(ctx, out, run,
                          "SELECT sigma_m, error_m FROM custody WHERE updates > 0 AND sigma_m > 0"
                          " AND error_m > 0",
                          &error, true,
                          "Error of the position at the end and its standard deviation, each "
                          "updated object; dashed: equal.");
    }
    bst_report_page_grid_end(out);
    return status;
}

bst_status bst_report_custody(bst_ctx *ctx, FILE *out, const bst_run_reader *run, double span_s) {
    const cJSON *f = cJSON_GetObjectItemCaseSensitive(bst_run_reader_manifest(run), "custody");
    if (!cJSON_IsObject(f)) {
        return BST_OK;
    }
    bst_report_page_section(out, 2, "Custody of the catalogue");
    put_cards(out, f);
    bst_status status = put_charts(ctx, out, run, span_s > 0.0 ? span_s : 1.0);
    status = status == BST_OK ? put_table(ctx, out, run) : status;
    bst_report_page_section_end(out);
    return status;
}
