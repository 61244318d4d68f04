#include "sim/report/report_study.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/core/text.h"

/* Maximum rows of tables; metrics in the table of settings. */
enum { MOST_SETTINGS = 200, MOST_FAILED = 50, MOST_WORST = 8, COLUMNS = 6 };

/* Writes an HTML table cell; `number` aligns it right. */
static void put_cell(FILE *out, bool number, const char *text) {
    fputs(number ? "<td class=\"n\">" : "<td>", out);
    bst_html_text(out, text);
    fputs("</td>", out);
}

static void put_head_cell(FILE *out, bool number, const char *text) {
    fputs(number ? "<th scope=\"col\" class=\"n\">" : "<th scope=\"col\">", out);
    bst_html_text(out, text);
    fputs("</th>", out);
}

/* ------------------------------------------------------------------ warnings */

static const bst_report_study_metric_view *find_metric(const bst_report_study_view *v,
                                                       const char *name) {
    for (int i = 0; i < v->metric_count; i++) {
        if (strcmp(v->metrics[i].name, name) == 0) {
            return &v->metrics[i];
        }
    }
    return NULL;
}

/* Number of runs of the study with a finite value of the metric. */
static int64_t numbers_of(const bst_report_study_view *v, const bst_report_study_metric_view *m) {
    int64_t n = 0;
    for (int64_t r = 0; r < v->runs; r++) {
        n += isfinite(m->of_run[r]);
    }
    return n;
}

/* Collects the study's warnings: missing or failed runs, and runs without acquisition. */
static void gather_warnings(const bst_report_study_view *v, bst_report_warnings *w) {
    int64_t failed = 0, done = 0;
    char text[BST_COUNT_TEXT];
    for (int64_t r = 0; r < v->runs; r++) {
        failed += !v->done[r];
        done += v->done[r];
    }
    if (v->runs < v->expected_runs) {
        bst_report_warnings_add(w, BST_SEVERITY_PROBLEM,
                                "%" PRId64 " of %" PRId64
                                " runs are missing: boresight study FOLDER "
                                "--resume makes them.",
                                v->expected_runs - v->runs, v->expected_runs);
    }
    if (failed > 0) {
        bst_report_warnings_add(w, BST_SEVERITY_PROBLEM, "%" PRId64 " of %" PRId64 " runs failed.",
                                failed, v->runs);
    }
    const bst_report_study_metric_view *acquired = find_metric(v, "acquired");
    int64_t never = 0, lost = 0;
    for (int64_t r = 0; acquired && r < v->runs; r++) {
        never += acquired->of_run[r] == 0.0;
    }
    if (never > 0) {
        bst_report_warnings_add(w, BST_SEVERITY_WARNING,
                                "In %" PRId64 " of %" PRId64
                                " runs the target was never acquired: "
                                "figures of pointing and track are of the others alone.",
                                never, done);
    }
    const bst_report_study_metric_view *end = find_metric(v, "in_track_at_end");
    for (int64_t r = 0; end && acquired && r < v->runs; r++) {
        lost += end->of_run[r] == 0.0 && acquired->of_run[r] == 1.0;
    }
    if (lost > 0) {
        bst_report_warnings_add(w, BST_SEVERITY_WARNING,
                                "In %s the target was acquired and not in track at the end.",
                                bst_text_of_count(text, lost, "run", "runs"));
    }
    static const struct {
        const char *metric, *text;
    } counts[] = {{"wrong_target_frames", "frames with another object for target"},
                  {"false_tracks", "tracks near no object"}};
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        const bst_report_study_metric_view *m = find_metric(v, counts[k].metric);
        int64_t n = 0;
        for (int64_t r = 0; m && r < v->runs; r++) {
            n += m->of_run[r] > 0.0;
        }
        if (n > 0) {
            bst_report_warnings_add(w, BST_SEVERITY_WARNING, "%s with %s (%s).",
                                    bst_text_of_count(text, n, "run", "runs"), counts[k].text,
                                    counts[k].metric);
        }
    }
    for (int i = 0; i < v->metric_count; i++) {
        const bst_report_study_metric_view *m = &v->metrics[i];
        int64_t n = numbers_of(v, m);
        if (n == 0 && done > 0) {
            bst_report_warnings_add(w, BST_SEVERITY_NOTE, "No run has a number for %s.", m->name);
        }
    }
    if (v->replicates > 1 && v->replicates < 10) {
        bst_report_warnings_add(w, BST_SEVERITY_NOTE,
                                "Settings have %" PRId64
                                " runs each: their bootstrap intervals are too "
                                "short.",
                                v->replicates);
    }
}

/* ------------------------------------------------------------------ what was varied */

/* Describes the values of an axis: "5 values from 3 to 48", or the values. */
static void describe_axis(const bst_report_study_view *v, const bst_report_study_axis_view *a,
                          char text[400]) {
    size_t n = 0;
    text[0] = '\0';
    if (a->swept && a->level_count <= 8) {
        for (int k = 0; k < a->level_count; k++) {
            char word[32];
            n += (size_t)snprintf(text + n, 400 - n, "%s%s", k ? ", " : "",
                                  bst_report_study_word(a, a->levels[k], word));
        }
        return;
    }
    double low = INFINITY, high = -INFINITY;
    bst_chart_widen(a->swept ? a->of_setting : a->of_run,
                    (size_t)(a->swept ? v->settings : v->runs), false, &low, &high);
    if (a->is_text) {
        snprintf(text, 400, "%d%s values", a->word_count,
                 a->word_count == BST_STUDY_LEVELS ? " or more" : "");
    } else if (a->swept && a->level_count <= BST_STUDY_LEVELS) {
        snprintf(text, 400, "%d values from %.5g to %.5g", a->level_count, low, high);
    } else {
        snprintf(text, 400, "drawn from %.5g to %.5g", low, high);
    }
}

static void put_identity(FILE *out, const bst_report_study_view *v) {
    bst_report_page_section(out, 2, "What was varied");
    fputs("<table class=\"two\">\n", out);
    bst_report_page_row(out, "kind", "%s", v->kind);
    bst_report_page_row(out, "settings", "%" PRId64, v->settings);
    bst_report_page_row(out, "runs", "%" PRId64 " of %" PRId64 ", %" PRId64 " a setting", v->runs,
                        v->expected_runs, v->replicates);
    bst_report_page_row(out, "seed", "%s", v->seed);
    bst_report_page_row(out, "program", "Boresight %s", v->version);
    bst_report_page_row(out, "digest of the study", "%s", v->digest);
    fputs(
        "</table>\n<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr><th "
        "scope=\"col\">axis</th>"
        "<th scope=\"col\">role</th><th scope=\"col\">values</th><th scope=\"col\">path</th></tr>"
        "</thead>\n<tbody>\n",
        out);
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *a = &v->axes[i];
        char values[400], role[64];
        describe_axis(v, a, values);
        snprintf(role, sizeof role, "%s%s%s",
                 a->swept        ? "sweep"
                 : a->population ? "population"
                                 : "dispersion",
                 a->swept ? ", " : "", a->swept ? a->design : "");
        fputs("<tr>", out);
        put_cell(out, false, a->name);
        put_cell(out, false, role);
        put_cell(out, false, values);
        put_cell(out, false, a->path);
        fputs("</tr>\n", out);
    }
    fputs("</tbody></table></div>\n", out);
    bst_report_page_section_end(out);
}

/* ------------------------------------------------------------------ figures of all runs */

/* Writes the table of statistics of each metric over all runs of the study. */
static bst_status put_overall(bst_ctx *ctx, FILE *out, const bst_report_study_view *v) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    BST_TRY(bst_io_rows_open(
        ctx, v->tables,
        "SELECT s.metric, m.unit, s.mean, s.low, s.high, s.std, s.minimum, s.median,"
        " s.p95, s.maximum, s.runs, s.missing, m.doc FROM statistics s"
        " LEFT JOIN metrics m ON m.metric = s.metric WHERE s.setting IS NULL"
        " ORDER BY s.rowid",
        0, 0, &rows));
    static const char *const heads[] = {"metric", "unit",    "mean",   "95 % from", "to",
                                        "std",    "least",   "median", "95 %",      "greatest",
                                        "runs",   "missing", "meaning"};
    bst_report_page_section(out, 2, "Figures of all runs");
    if (v->settings > 1) {
        fputs(
            "<p class=\"note\">All settings together, each as often as it was run: the figures "
            "depend on the values that were swept. Those of each setting are in "
            "statistics.csv.</p>\n",
            out);
    }
    fputs("<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>", out);
    for (int k = 0; k < 13; k++) {
        put_head_cell(out, k > 1 && k < 12, heads[k]);
    }
    fputs("</tr></thead>\n<tbody>\n", out);
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        fputs("<tr>", out);
        for (int k = 0; k < 13; k++) {
            char text[32];
            bool number = k > 1 && k < 10;
            put_cell(out, k > 1 && k < 12,
                     number ? bst_report_page_number(text, bst_io_rows_real(rows, k), 4)
                            : bst_io_rows_text(rows, k));
        }
        fputs("</tr>\n", out);
    }
    bst_io_rows_close(rows);
    fputs("</tbody></table></div>\n", out);
    bst_report_page_section_end(out);
    return status;
}

/* ------------------------------------------------------------------ settings */

/* Writes the table row of one setting: axis values, metric means and 95 % intervals. */
static void put_setting(FILE *out, const bst_report_study_view *v, int64_t i, const int *metrics,
                        int count) {
    char text[32], ends[2][32], cell[120];
    fprintf(out, "<tr><td class=\"n\">%" PRId64 "</td>", i);
    for (int a = 0; a < v->axis_count; a++) {
        if (v->axes[a].swept) {
            put_cell(out, !v->axes[a].is_text,
                     bst_report_study_word(&v->axes[a], v->axes[a].of_setting[i], text));
        }
    }
    for (int k = 0; k < count; k++) {
        const bst_report_study_metric_view *m = &v->metrics[metrics[k]];
        bst_report_page_number(text, m->mean[i], 3);
        if (isfinite(m->low[i]) && isfinite(m->high[i])) {
            snprintf(cell, sizeof cell, "%s [%s, %s]", text,
                     bst_report_page_number(ends[0], m->low[i], 3),
                     bst_report_page_number(ends[1], m->high[i], 3));
        } else {
            snprintf(cell, sizeof cell, "%s", text);
        }
        put_cell(out, true, cell);
    }
    fputs("</tr>\n", out);
}

/* Writes the table of the study's settings. */
static void put_settings(FILE *out, const bst_report_study_view *v) {
    int metrics[COLUMNS], count = bst_report_study_key_metrics(v, metrics, COLUMNS);
    if (v->settings < 2) {
        return;
    }
    int64_t shown = v->settings < MOST_SETTINGS ? v->settings : MOST_SETTINGS;
    bst_report_page_section(out, 2, "Settings");
    fprintf(out, "<details%s><summary>%" PRId64 " settings</summary>\n",
            v->settings <= 40 ? " open=\"open\"" : "", v->settings);
    fputs("<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>", out);
    put_head_cell(out, true, "setting");
    for (int a = 0; a < v->axis_count; a++) {
        if (v->axes[a].swept) {
            put_head_cell(out, !v->axes[a].is_text, v->axes[a].name);
        }
    }
    for (int k = 0; k < count; k++) {
        char label[128];
        put_head_cell(out, true, bst_report_study_label(&v->metrics[metrics[k]], label));
    }
    fputs("</tr></thead>\n<tbody>\n", out);
    for (int64_t i = 0; i < shown; i++) {
        put_setting(out, v, i, metrics, count);
    }
    fputs("</tbody></table></div>\n</details>\n", out);
    if (shown < v->settings) {
        fprintf(out,
                "<p class=\"note\">%" PRId64 " more are in settings.csv and statistics.csv.</p>\n",
                v->settings - shown);
    }
    fputs(v->replicates > 1 ? "<p class=\"note\">Means of the runs with their 95 % intervals.</p>\n"
                            : "",
          out);
    bst_report_page_section_end(out);
}

/* ------------------------------------------------------------------ runs that ask to be looked at
 */

/* Writes the table of failed runs, grouped by error message. */
static bst_status put_failed(bst_ctx *ctx, FILE *out, const bst_report_study_view *v) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    int64_t failed =
        bst_run_reader_int(v->tables, "SELECT count(*) FROM runs WHERE status <> 'done'", 0, 0);
    if (failed == 0) {
        return BST_OK;
    }
    BST_TRY(bst_io_rows_open(ctx, v->tables,
                             "SELECT count(*), min(run), error FROM runs WHERE status <> 'done'"
                             " GROUP BY error ORDER BY count(*) DESC, min(run) LIMIT ?1",
                             MOST_FAILED, 0, &rows));
    bst_report_page_section(out, 2, "Failed runs");
    fputs(
        "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr><th scope=\"col\" "
        "class=\"n\">runs</th>"
        "<th scope=\"col\" class=\"n\">first</th><th "
        "scope=\"col\">why</th></tr></thead>\n<tbody>\n",
        out);
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        fputs("<tr>", out);
        put_cell(out, true, bst_io_rows_text(rows, 0));
        put_cell(out, true, bst_io_rows_text(rows, 1));
        put_cell(out, false, bst_io_rows_text(rows, 2));
        fputs("</tr>\n", out);
    }
    bst_io_rows_close(rows);
    fputs("</tbody></table></div>\n", out);
    bst_report_page_section_end(out);
    return status;
}

typedef struct ranked {
    double badness;
    int64_t row;
} ranked;

/* Comparison for qsort: largest badness first, then row. */
static int worst_first(const void *a, const void *b) {
    const ranked *x = a, *y = b;
    return x->badness != y->badness ? (x->badness < y->badness) - (x->badness > y->badness)
                                    : (x->row > y->row) - (x->row < y->row);
}

/* Writes the runs with the lowest custody, or the largest pointing error. */
static void put_worst(FILE *out, const bst_report_study_view *v) {
    const bst_report_study_metric_view *custody = find_metric(v, "custody"),
                                       *pointing = find_metric(v, "pointing_rms_px");
    ranked *list = malloc((size_t)(v->runs > 0 ? v->runs : 1) * sizeof *list);
    int metrics[COLUMNS], count = bst_report_study_key_metrics(v, metrics, COLUMNS);
    int64_t n = 0;
    for (int64_t r = 0; list && custody && pointing && r < v->runs; r++) {
        double held = custody->of_run[r], error = pointing->of_run[r];
        if (v->done[r] && isfinite(held)) {
            /* custody in steps of 0.01; then by pointing error */
            double worse = isfinite(error) ? error / (1.0 + error) : 1.0;
            list[n++] = (ranked){100.0 - floor(100.0 * held) + 0.999 * worse, r};
        }
    }
    if (n >= 2 * MOST_WORST) {
        qsort(list, (size_t)n, sizeof *list, worst_first);
        bst_report_page_section(out, 2, "Runs with the least custody");
        fputs("<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>", out);
        put_head_cell(out, true, "run");
        for (int a = 0; a < v->axis_count; a++) {
            put_head_cell(out, !v->axes[a].is_text, v->axes[a].name);
        }
        for (int k = 0; k < count; k++) {
            char label[128];
            put_head_cell(out, true, bst_report_study_label(&v->metrics[metrics[k]], label));
        }
        fputs("</tr></thead>\n<tbody>\n", out);
        for (int i = 0; i < MOST_WORST; i++) {
            int64_t r = list[i].row;
            char text[32];
            fprintf(out, "<tr><td class=\"n\">%" PRId64 "</td>", v->run_numbers[r]);
            for (int a = 0; a < v->axis_count; a++) {
                put_cell(out, !v->axes[a].is_text,
                         bst_report_study_word(&v->axes[a], v->axes[a].of_run[r], text));
            }
            for (int k = 0; k < count; k++) {
                put_cell(out, true,
                         bst_report_page_number(text, v->metrics[metrics[k]].of_run[r], 4));
            }
            fputs("</tr>\n", out);
        }
        fputs(
            "</tbody></table></div>\n<p class=\"note\">boresight study FOLDER --emit RUN writes "
            "the "
            "scenario of one, to be run by hand; what it gives is the same to the last "
            "digit.</p>\n",
            out);
        bst_report_page_section_end(out);
    }
    free(list);
}

/* ------------------------------------------------------------------ cards */

/* Writes a card with the mean over all runs of a study with one setting, and its interval. */
static void put_mean_card(FILE *out, const bst_report_study_view *v,
                          const bst_report_study_metric_view *m) {
    bst_io_rows *rows;
    bst_ctx unheard = {0};
    bool more;
    char text[32], note[120], ends[2][32];
    if (bst_io_rows_open(&unheard, v->tables,
                         "SELECT metric, mean, low, high FROM statistics WHERE setting IS NULL", 0,
                         0, &rows) != BST_OK) {
        return;
    }
    while (bst_io_rows_next(&unheard, rows, &more) == BST_OK && more) {
        if (strcmp(bst_io_rows_text(rows, 0), m->name) == 0) {
            snprintf(note, sizeof note, "95 %%: %s to %s",
                     bst_report_page_number(ends[0], bst_io_rows_real(rows, 2), 3),
                     bst_report_page_number(ends[1], bst_io_rows_real(rows, 3), 3));
            bst_report_page_card(out, bst_report_page_number(text, bst_io_rows_real(rows, 1), 3),
                                 m->unit, m->name, note);
        }
    }
    bst_io_rows_close(rows);
}

/* Writes a card with the smallest and largest mean over settings: an overall mean would depend on
 * the swept values. */
static void put_range_card(FILE *out, const bst_report_study_view *v,
                           const bst_report_study_metric_view *m) {
    double low = INFINITY, high = -INFINITY;
    char text[80], ends[2][32];
    bst_chart_widen(m->mean, (size_t)v->settings, false, &low, &high);
    if (low <= high) {
        bst_report_page_number(ends[0], low, 3);
        bst_report_page_number(ends[1], high, 3);
        bool same = strcmp(ends[0], ends[1]) == 0;
        snprintf(text, sizeof text, "%s%s%s", ends[0], same ? "" : " to ", same ? "" : ends[1]);
        bst_report_page_card(out, text, m->unit, m->name, "");
    }
}

/* Writes the key figures of the study: number of runs and metric means. */
static void put_cards(FILE *out, const bst_report_study_view *v) {
    char text[32], note[120];
    int metrics[COLUMNS], count = bst_report_study_key_metrics(v, metrics, 5);
    fputs("<div class=\"cards\">\n", out);
    snprintf(text, sizeof text, "%" PRId64, v->runs - v->failed);
    snprintf(note, sizeof note, "of %" PRId64 "; %" PRId64 " failed", v->expected_runs, v->failed);
    bst_report_page_card(out, text, "", "runs done", note);
    for (int k = 0; k < count; k++) {
        (v->settings > 1 ? put_range_card : put_mean_card)(out, v, &v->metrics[metrics[k]]);
    }
    fputs("</div>\n", out);
    if (v->settings > 1) {
        fprintf(out,
                "<p class=\"note\">From the least to the greatest mean of the %" PRId64
                " settings.</p>\n",
                v->settings);
    } else {
        fputs("<p class=\"note\">Means over all runs that have a number.</p>\n", out);
    }
}

/* ------------------------------------------------------------------ all of it */

static bst_status put_page(bst_ctx *ctx, FILE *out, const bst_report_study_view *v) {
    char title[200], folder[256], nonce[BST_SHA256_TEXT];
    snprintf(title, sizeof title, "Study %.150s", v->name);
    BST_TRY(bst_report_page_nonce(ctx, bst_run_reader_manifest(v->tables), title, nonce));
    bst_report_warnings *warnings = calloc(1, sizeof *warnings);
    if (!warnings) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the report");
    }
    gather_warnings(v, warnings);
    bst_report_page_begin(out, title, nonce);
    bool whole = v->runs == v->expected_runs;
    fprintf(out, "<p class=\"sub\"><span class=\"badge %s\">%s</span> Folder ",
            !whole          ? "bad"
            : v->failed > 0 ? "fair"
                            : "good",
            !whole          ? "not complete"
            : v->failed > 0 ? "complete, with failed runs"
                            : "complete");
    bst_html_text(out, bst_report_folder(v->tables, folder));
    fputs("</p>\n", out);
    bst_report_warnings_write(out, warnings);
    free(warnings);
    BST_TRY(put_failed(ctx, out, v));
    put_identity(out, v);
    bst_report_page_section(out, 2, "In short");
    put_cards(out, v);
    bst_report_page_section_end(out);
    BST_TRY(bst_report_study_plot_sensitivity(ctx, out, v));
    BST_TRY(bst_report_study_plot_curves(ctx, out, v));
    bst_report_study_plot_axes(out, v);
    bst_report_study_plot_histograms(out, v);
    put_worst(out, v);
    put_settings(out, v);
    BST_TRY(put_overall(ctx, out, v));
    fprintf(out,
            "<p class=\"note\">Made by Boresight %s. study.sqlite and the CSV files beside it hold "
            "all tables.</p>\n",
            bst_version());
    return bst_report_page_end(ctx, out, nonce);
}

bst_status bst_report_study(bst_ctx *ctx, bst_run_reader *tables, FILE *out) {
    bst_report_study_view view;
    bst_status status = bst_report_study_view_read(ctx, tables, &view);
    if (status == BST_OK) {
        status = put_page(ctx, out, &view);
    }
    bst_report_study_view_free(&view);
    return status;
}
