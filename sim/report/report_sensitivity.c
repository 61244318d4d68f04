/* Report of a study's sensitivity: ranked effects of the swept parameters for designs one_at_a_time
 * and morris. */
#include <math.h>
#include <string.h>

#include "sim/report/report_study.h"

/* maximum number of metrics besides wall time; axes in a chart */
enum { METRICS = 6, AXES = 24 };

/* Effect of an axis on a metric: a row of the table sensitivity or speed_sensitivity. */
typedef struct effect {
    const bst_report_study_axis_view *axis;
    double size, error; /* effect by which axes are ranked, and its standard error */
    double sigma;       /* spread of the elementary effects */
    int count;
    /* one at a time: the metric at the smallest and largest value of the axis */
    double at[2], value[2];
} effect;

/* The swept axis of the study with this name; NULL: none. */
static const bst_report_study_axis_view *axis_of(const bst_report_study_view *v, const char *name) {
    for (int i = 0; i < v->axis_count; i++) {
        if (v->axes[i].swept && strcmp(v->axes[i].name, name) == 0) {
            return &v->axes[i];
        }
    }
    return NULL;
}

/* Reads the ranked effects of a design's axes on a metric from `table`. */
static bst_status read_effects(bst_ctx *ctx, const bst_report_study_view *v, const char *table,
                               const char *design, const char *metric, effect list[AXES],
                               int *count) {
    char sql[200];
    bst_io_rows *rows;
    bst_status status;
    bool more;
    *count = 0;
    snprintf(sql, sizeof sql,
             "SELECT design, metric, axis, effect, effect_error, spread, effects FROM %s "
             "ORDER BY sweep, rank",
             table);
    BST_TRY(bst_io_rows_open(ctx, v->tables, sql, 0, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        const bst_report_study_axis_view *axis = axis_of(v, bst_io_rows_text(rows, 2));
        double size = bst_io_rows_real(rows, 3);
        if (axis && *count < AXES && isfinite(size) &&
            strcmp(bst_io_rows_text(rows, 0), design) == 0 &&
            strcmp(bst_io_rows_text(rows, 1), metric) == 0) {
            list[(*count)++] = (effect){.axis = axis,
                                        .size = size,
                                        .error = bst_io_rows_real(rows, 4),
                                        .sigma = bst_io_rows_real(rows, 5),
                                        .count = (int)bst_io_rows_int(rows, 6)};
        }
    }
    bst_io_rows_close(rows);
    return status;
}

/* Limits of the 95 % interval, assumed normal. */
static double low_of(const effect *e) {
    return isfinite(e->error) ? fmax(0.0, e->size - 1.96 * e->error) : e->size;
}

/* Upper limit of the 95 % interval of an effect. */
static double high_of(const effect *e) {
    return isfinite(e->error) ? e->size + 1.96 * e->error : e->size;
}

/* ------------------------------------------------------------------ morris */

/* Labels the rows of a chart with rank and name of the study axes. */
static void put_row_names(const bst_chart *c, const effect *list, int count) {
    for (int i = 0; i < count; i++) {
        char text[80];
        snprintf(text, sizeof text, "%d  %.40s", i + 1, list[i].axis->name);
        bst_chart_word(c, c->x.low, count - i - 0.5, -8.0, 4.0, "end", text);
    }
}

/* Draws the ranked elementary effects (mu*) on a metric, and sigma against mu*. */
static void put_morris(FILE *out, const bst_report_study_metric_view *m, const effect *list,
                       int count) {
    char label[128], text[160];
    double most = 0.0, spread = 0.0;
    for (int i = 0; i < count; i++) {
        most = fmax(most, high_of(&list[i]));
        spread = fmax(spread, list[i].sigma);
    }
    bst_report_study_label(m, label);
    snprintf(text, sizeof text, "Ranked effects on %s", m->name);
    bst_report_page_figure(out, BST_PAGE_HALF);
    bst_chart c = {.out = out,
                   .name = text,
                   .width = 540.0,
                   .height = 56.0 + 24.0 * count,
                   .margin_left = 190.0,
                   .x = {.label = label, .low = 0.0, .high = 1.05 * fmax(most, 1e-12)},
                   .y = {.label = "", .low = 0.0, .high = count, .bare = true}};
    bst_chart_begin(&c);
    for (int i = 0; i < count; i++) {
        double y = count - i;
        bst_chart_bar(&c, 0.0, list[i].size, y - 0.8, y - 0.2, BST_CHART_BLUE, list[i].axis->name);
        bst_chart_bar(&c, low_of(&list[i]), high_of(&list[i]), y - 0.54, y - 0.46, BST_CHART_ORANGE,
                      NULL);
    }
    put_row_names(&c, list, count);
    bst_chart_end(&c);
    snprintf(text, sizeof text,
             "Mean size of %d elementary effects (mu*), over the axis' whole range; with its 95 %% "
             "interval.",
             list[0].count);
    bst_report_page_figure_end(out, text);
    snprintf(text, sizeof text, "Spread against size of the effects on %s", m->name);
    bst_report_page_figure(out, BST_PAGE_HALF);
    bst_chart d = {.out = out,
                   .name = text,
                   .width = 540.0,
                   .height = 260.0,
                   .x = {.label = "mu*", .low = 0.0, .high = 1.1 * fmax(most, 1e-12)},
                   .y = {.label = "sigma", .low = 0.0, .high = 1.15 * fmax(spread, 1e-12)}};
    bst_chart_begin(&d);
    for (int i = 0; i < count; i++) {
        bst_chart_dots(&d, &list[i].size, &list[i].sigma, 1, BST_CHART_BLUE);
        snprintf(text, sizeof text, "%d", i + 1);
        /* avoids overlap: neighbours in rank are often close */
        bst_chart_word(&d, list[i].size, list[i].sigma, i % 2 ? -5.0 : 5.0, -4.0,
                       i % 2 ? "end" : "start", text);
    }
    bst_chart_end(&d);
    bst_report_page_figure_end(
        out,
        "Numbers are the ranks beside. A large sigma: the effect is not linear, or "
        "depends on the other axes.");
}

/* ------------------------------------------------------------------ one at a time */

/* Equality of axis values; NAN (not in the scenario) equals NAN. */
static bool same_value(double a, double b) {
    return a == b || (isnan(a) && isnan(b));
}

/* Checks whether a setting differs from setting 0, the scenario's own, in this axis only. */
static bool differs_in(const bst_report_study_view *v, const bst_report_study_axis_view *axis,
                       int64_t setting) {
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *x = &v->axes[i];
        if (x->swept && same_value(x->of_setting[setting], x->of_setting[0]) == (x == axis)) {
            return false;
        }
    }
    return true;
}

static void find_ends(const bst_report_study_view *v, const bst_report_study_metric_view *m,
                      effect *e) {
    e->at[0] = INFINITY;
    e->at[1] = -INFINITY;
    e->value[0] = e->value[1] = NAN;
    for (int64_t i = 1; i < v->settings; i++) {
        if (!differs_in(v, e->axis, i) || !isfinite(m->mean[i])) {
            continue;
        }
        double at = e->axis->of_setting[i];
        if (at < e->at[0]) {
            e->at[0] = at;
            e->value[0] = m->mean[i];
        }
        if (at > e->at[1]) {
            e->at[1] = at;
            e->value[1] = m->mean[i];
        }
    }
}

static void put_tornado(FILE *out, const bst_report_study_metric_view *m, const effect *list,
                        int count) {
    char label[128], text[200];
    double low = m->mean[0], high = low;
    for (int i = 0; i < count; i++) {
        bst_chart_widen(list[i].value, 2, false, &low, &high);
    }
    bst_report_study_label(m, label);
    snprintf(text, sizeof text, "Change of %s with one axis at a time", m->name);
    bst_report_page_figure(out, BST_PAGE_HALF);
    bst_chart c = {.out = out,
                   .name = text,
                   .width = 540.0,
                   .height = 56.0 + 34.0 * count,
                   .margin_left = 190.0,
                   .x = {.label = label},
                   .y = {.label = "", .low = 0.0, .high = count, .bare = true}};
    bst_chart_fit(&c.x, low, high, 0.2);
    bst_chart_begin(&c);
    for (int i = 0; i < count; i++) {
        for (int end = 0; end < 2; end++) {
            double value = list[i].value[end];
            bool only = list[i].at[0] == list[i].at[1];
            if (isfinite(value) && !(only && end == 1)) {
                char word[32];
                double y = count - i - (end ? 0.5 : 0.1);
                bst_chart_bar(&c, m->mean[0], value, y, y - 0.36,
                              end ? BST_CHART_ORANGE : BST_CHART_BLUE, NULL);
                bst_report_study_word(list[i].axis, list[i].at[end], word);
                bool left = value < m->mean[0];
                bst_chart_word(&c, value, y - 0.18, left ? -4.0 : 4.0, 4.0, left ? "end" : "start",
                               word);
            }
        }
    }
    bst_chart_mark(&c, m->mean[0], BST_CHART_GREY);
    put_row_names(&c, list, count);
    bst_chart_end(&c);
    char caption[400];
    snprintf(caption, sizeof caption,
             "%s From the scenario's own values (dotted) to the least and the greatest value of "
             "each axis.",
             strncmp(m->doc, "The same", 8) == 0 ? "" : m->doc);
    bst_report_page_figure_end(out, caption);
}

/* ------------------------------------------------------------------ both */

/* Draws the sensitivity chart of one metric: Morris effects, or tornado. */
static bst_status put_metric(bst_ctx *ctx, FILE *out, const bst_report_study_view *v,
                             const bst_report_study_metric_view *m, const char *table,
                             bool morris) {
    effect list[AXES];
    int count;
    BST_TRY(
        read_effects(ctx, v, table, morris ? "morris" : "one_at_a_time", m->name, list, &count));
    if (count > 0 && morris) {
        put_morris(out, m, list, count);
    } else if (count > 0) {
        for (int i = 0; i < count; i++) {
            find_ends(v, m, &list[i]);
        }
        put_tornado(out, m, list, count);
    }
    return BST_OK;
}

/* True if a swept axis of the study belongs to this sampling design. */
static bool has_design(const bst_report_study_view *v, const char *design) {
    for (int i = 0; i < v->axis_count; i++) {
        if (v->axes[i].swept && strcmp(v->axes[i].design, design) == 0) {
            return true;
        }
    }
    return false;
}

bst_status bst_report_study_plot_sensitivity(bst_ctx *ctx, FILE *out,
                                             const bst_report_study_view *v) {
    int metrics[METRICS], count = bst_report_study_key_metrics(v, metrics, METRICS);
    bool there[2] = {has_design(v, "one_at_a_time"), has_design(v, "morris")};
    if ((!there[0] && !there[1]) || v->settings < 2) {
        return BST_OK;
    }
    bst_report_page_section(out, 2, "What matters");
    for (int morris = 0; morris < 2; morris++) {
        if (!there[morris]) {
            continue;
        }
        bst_report_page_grid(out, BST_PAGE_HALF);
        for (int k = 0; k < count; k++) {
            BST_TRY(put_metric(ctx, out, v, &v->metrics[metrics[k]], "sensitivity", morris == 1));
        }
        BST_TRY(put_metric(ctx, out, v, &v->wall, "speed_sensitivity", morris == 1));
        BST_TRY(put_metric(ctx, out, v, &v->cpu, "speed_sensitivity", morris == 1));
        bst_report_page_grid_end(out);
    }
    bst_report_page_section_end(out);
    return BST_OK;
}
