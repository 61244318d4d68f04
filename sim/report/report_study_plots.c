#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/core/text.h"
#include "sim/report/report_plots.h"
#include "sim/report/report_study.h"

/* lines per chart; metrics drawn */
enum { LINES = 6, KEY_METRICS = 6 };

int bst_report_study_key_metrics(const bst_report_study_view *v, int *metrics, int room) {
    /* metrics of most studies come first */
    static const char *const first[] = {"acquired",        "custody",           "time_to_confirm_s",
                                        "pointing_rms_px", "track_rms_px",      "snr_pd50",
                                        "loss_db_pd50",    "detected_fraction", "false_tracks",
                                        "snr_pd90",        "detections"};
    int count = 0;
    for (size_t k = 0; k < sizeof first / sizeof *first; k++) {
        for (int i = 0; i < v->metric_count && count < room; i++) {
            if (strcmp(v->metrics[i].name, first[k]) == 0 && v->metrics[i].varies) {
                metrics[count++] = i;
            }
        }
    }
    for (int i = 0; i < v->metric_count && count < room; i++) {
        bool there = !v->metrics[i].varies;
        for (int k = 0; k < count; k++) {
            there = there || metrics[k] == i;
        }
        if (!there) {
            metrics[count++] = i;
        }
    }
    return count;
}

const char *bst_report_study_label(const bst_report_study_metric_view *m, char text[128]) {
    size_t n = strlen(m->name), unit = strlen(m->unit);
    bool said = unit > 0 && n > unit + 1 && strcmp(m->name + n - unit, m->unit) == 0 &&
                m->name[n - unit - 1] == '_';
    snprintf(text, 128, "%s%s%s", m->name, unit > 0 && !said ? ", " : "", said ? "" : m->unit);
    return text;
}

/* ------------------------------------------------------------------ a metric over an axis */

/* A line of a chart: one point per level of the axis. */
typedef struct curve {
    double x[BST_STUDY_LEVELS], mean[BST_STUDY_LEVELS], low[BST_STUDY_LEVELS],
        high[BST_STUDY_LEVELS];
    int count;
    bool merged; /* points are means of several settings; low and high are the extremes */
} curve;

/* Computes a line. `other`: axis whose value is `level`; NULL: all settings. */
static void make_curve(const bst_report_study_view *v, const bst_report_study_metric_view *m,
                       const bst_report_study_axis_view *axis,
                       const bst_report_study_axis_view *other, double level, curve *out) {
    *out = (curve){.count = 0};
    for (int k = 0; k < axis->level_count; k++) {
        double sum = 0.0, low = INFINITY, high = -INFINITY, own[2] = {NAN, NAN};
        int n = 0;
        for (int64_t i = 0; i < v->settings; i++) {
            if (axis->of_setting[i] == axis->levels[k] && isfinite(m->mean[i]) &&
                (!other || other->of_setting[i] == level)) {
                sum += m->mean[i];
                low = fmin(low, m->mean[i]);
                high = fmax(high, m->mean[i]);
                own[0] = m->low[i];
                own[1] = m->high[i];
                n++;
            }
        }
        if (n == 0) {
            continue;
        }
        out->merged = out->merged || n > 1;
        out->x[out->count] = axis->is_text ? k : axis->levels[k];
        out->mean[out->count] = sum / n;
        out->low[out->count] = n > 1 ? low : own[0];
        out->high[out->count++] = n > 1 ? high : own[1];
    }
}

/* Selects the axis that gets one line per value: the one with the fewest values. */
static const bst_report_study_axis_view *choose_lines(const bst_report_study_view *v,
                                                      const bst_report_study_axis_view *axis) {
    const bst_report_study_axis_view *best = NULL;
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *a = &v->axes[i];
        if (a != axis && a->swept && a->level_count > 1 && a->level_count <= LINES &&
            (!best || a->level_count < best->level_count)) {
            best = a;
        }
    }
    return best;
}

static bst_chart begin(FILE *out, const bst_report_study_axis_view *axis, const char *name,
                       const char *label, double low, double high) {
    bst_chart c = {.out = out,
                   .name = name,
                   .width = 540.0,
                   .height = 290.0,
                   .margin_left = 60.0,
                   .x = {.label = axis->name, .logarithmic = axis->logarithmic},
                   .y = {.label = label}};
    bst_chart_fit(&c.y, low, high, 0.06);
    int n = axis->level_count < BST_STUDY_LEVELS ? axis->level_count : BST_STUDY_LEVELS;
    if (axis->is_text) {
        c.x.bare = true;
        c.x.low = -0.5;
        c.x.high = n - 0.5;
    } else if (axis->logarithmic) {
        /* the ends are levels, not decades */
        double margin = pow(axis->levels[n - 1] / axis->levels[0], 0.04);
        c.x.low = axis->levels[0] / margin;
        c.x.high = axis->levels[n - 1] * margin;
    } else {
        double from = INFINITY, to = -INFINITY;
        bst_chart_widen(axis->levels, (size_t)n, false, &from, &to);
        bst_chart_fit(&c.x, from, to, 0.04);
    }
    bst_chart_begin(&c);
    for (int k = 0; k < n && axis->is_text; k++) {
        char text[32], cut[16];
        bst_report_study_word(axis, axis->levels[k], text);
        snprintf(cut, sizeof cut, "%.15s", text);
        bst_chart_word(&c, k, c.y.low, 0.0, 16.0, "middle", cut);
    }
    return c;
}

static void put_curves(FILE *out, const bst_report_study_view *v,
                       const bst_report_study_metric_view *m,
                       const bst_report_study_axis_view *axis) {
    const bst_report_study_axis_view *lines = choose_lines(v, axis);
    int count = lines ? lines->level_count : 1;
    static const int colours[LINES] = {BST_CHART_BLUE,   BST_CHART_ORANGE, BST_CHART_GREEN,
                                       BST_CHART_VIOLET, BST_CHART_CYAN,   BST_CHART_BROWN};
    curve *list = calloc((size_t)count, sizeof *list);
    double low = INFINITY, high = -INFINITY;
    bool merged = false;
    for (int i = 0; list && i < count; i++) {
        make_curve(v, m, axis, lines, lines ? lines->levels[i] : 0.0, &list[i]);
        size_t n = (size_t)list[i].count;
        bst_chart_widen(list[i].mean, n, false, &low, &high);
        bst_chart_widen(list[i].low, n, false, &low, &high);
        bst_chart_widen(list[i].high, n, false, &low, &high);
        merged = merged || list[i].merged;
    }
    if (!list || !(low <= high)) {
        free(list);
        return;
    }
    char label[128], name[300], text[32], caption[500];
    bst_report_study_label(m, label);
    snprintf(name, sizeof name, "%s against %s", m->name, axis->name);
    bst_report_page_figure(out, BST_PAGE_HALF);
    bst_chart c = begin(out, axis, name, label, low, high);
    for (int i = 0; i < count; i++) {
        size_t n = (size_t)list[i].count;
        bst_chart_area(&c, list[i].x, list[i].low, list[i].high, n, colours[i]);
    }
    for (int i = 0; i < count; i++) {
        size_t n = (size_t)list[i].count;
        if (!axis->is_text) {
            bst_chart_line(&c, list[i].x, list[i].mean, n, colours[i], false);
        }
        bst_chart_whiskers(&c, list[i].x, list[i].low, list[i].high, n, colours[i]);
        bst_chart_dots(&c, list[i].x, list[i].mean, n, colours[i]);
    }
    bst_chart_end(&c);
    if (lines) {
        fputs("<ul class=\"legend\">\n", out);
        for (int i = 0; i < count; i++) {
            char entry[120];
            snprintf(entry, sizeof entry, "%s %s", lines->name,
                     bst_report_study_word(lines, lines->levels[i], text));
            bst_chart_legend(out, BST_KEY_LINE, colours[i], entry);
        }
        fputs("</ul>\n", out);
    }
    snprintf(caption, sizeof caption, "%s %s", m->doc,
             merged
                 ? "Means over the settings of the other axes; the area is from the least to the "
                   "greatest of them."
             : v->replicates > 1 ? "Means of the settings' runs with 95 % intervals."
                                 : "One run for each setting.");
    bst_report_page_figure_end(out, caption);
    free(list);
}

/* Draws designs without grid: a dot per setting. */
static void put_dots(FILE *out, const bst_report_study_view *v,
                     const bst_report_study_metric_view *m,
                     const bst_report_study_axis_view *axis) {
    double low = INFINITY, high = -INFINITY;
    bst_chart_widen(m->mean, (size_t)v->settings, false, &low, &high);
    if (!(low <= high)) {
        return;
    }
    char label[128], name[300];
    bst_report_study_axis_view range = *axis;
    double ends[2] = {INFINITY, -INFINITY};
    bst_chart_widen(axis->of_setting, (size_t)v->settings, false, &ends[0], &ends[1]);
    if (axis->level_count > BST_STUDY_LEVELS) {
        range.levels = ends;
        range.level_count = 2;
        range.logarithmic = ends[0] > 0.0 && ends[1] > 30.0 * ends[0];
    }
    bst_report_study_label(m, label);
    snprintf(name, sizeof name, "%s against %s, a dot for each setting", m->name, axis->name);
    bst_report_page_figure(out, BST_PAGE_THIRD);
    bst_chart c = begin(out, &range, name, label, low, high);
    bst_chart_dots(&c, axis->of_setting, m->mean, (size_t)v->settings, BST_CHART_BLUE);
    bst_chart_end(&c);
    bst_report_page_figure_end(out, "A dot for each setting: the mean of its runs.");
}

void bst_report_study_plot_axes(FILE *out, const bst_report_study_view *v) {
    int metrics[KEY_METRICS], count = bst_report_study_key_metrics(v, metrics, KEY_METRICS),
                              swept = 0;
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *a = &v->axes[i];
        /* these designs are shown by their effects */
        bool plotted = strcmp(a->design, "morris") != 0 && strcmp(a->design, "one_at_a_time") != 0;
        swept += a->swept && a->level_count > 1 && plotted;
    }
    if (swept == 0 || v->settings < 2) {
        return;
    }
    bst_report_page_section(out, 2, "Against what was swept");
    for (int k = 0; k < count; k++) {
        const bst_report_study_metric_view *m = &v->metrics[metrics[k]];
        char label[128];
        bst_report_page_section(out, 3, bst_report_study_label(m, label));
        bst_report_page_grid(out, BST_PAGE_HALF);
        for (int i = 0; i < v->axis_count; i++) {
            const bst_report_study_axis_view *a = &v->axes[i];
            bool grid = strcmp(a->design, "grid") == 0 || strcmp(a->design, "list") == 0;
            if (!a->swept || a->level_count < 2) {
                continue;
            }
            if (grid && a->level_count <= BST_STUDY_LEVELS) {
                put_curves(out, v, m, a);
            } else if (!a->is_text && strcmp(a->design, "latin_hypercube") == 0) {
                put_dots(out, v, m, a);
            }
        }
        bst_report_page_grid_end(out);
        bst_report_page_section_end(out);
    }
    bst_report_page_section_end(out);
}

/* ------------------------------------------------------------------ histograms */

void bst_report_study_plot_histograms(FILE *out, const bst_report_study_view *v) {
    int metrics[16], count = bst_report_study_key_metrics(v, metrics, 16), shown = 0;
    double *values = malloc((size_t)(v->runs > 0 ? v->runs : 1) * sizeof *values);
    for (int k = 0; values && k < count && shown < 9; k++) {
        const bst_report_study_metric_view *m = &v->metrics[metrics[k]];
        size_t n = 0;
        for (int64_t r = 0; r < v->runs; r++) {
            if (isfinite(m->of_run[r])) {
                values[n++] = m->of_run[r];
            }
        }
        if (m->rate || n < 10) {
            continue;
        }
        qsort(values, n, sizeof *values, bst_compare_doubles);
        double quarter = values[n / 4], upper = values[n - 1 - n / 4], spread = upper - quarter;
        double low = values[0], high = values[n - 1];
        /* outliers must not compress the chart */
        if (spread > 0.0) {
            low = fmax(low, quarter - 8.0 * spread);
            high = fmin(high, upper + 8.0 * spread);
        }
        if (!(high > low)) {
            continue;
        }
        size_t outside = 0;
        for (size_t i = 0; i < n; i++) {
            outside += values[i] < low || values[i] > high ? 1 : 0;
        }
        if (shown++ == 0) {
            bst_report_page_section(out, 2, "Over all runs");
            bst_report_page_grid(out, BST_PAGE_THIRD);
        }
        char label[128], name[160], caption[400];
        snprintf(name, sizeof name, "Histogram of %s", m->name);
        bst_report_page_figure(out, BST_PAGE_THIRD);
        /* the largest value must be inside the last bin */
        const bst_report_histogram_of histogram = {.name = name,
                                                   .label = bst_report_study_label(m, label),
                                                   .what = "runs",
                                                   .values = values,
                                                   .n = n,
                                                   .low = low,
                                                   .high = high + 1e-9 * (high - low),
                                                   .bins = 30,
                                                   .colour = BST_CHART_BLUE};
        bst_report_histogram(out, &histogram);
        /* omit a description that refers to the previous metric */
        bool refers = strncmp(m->doc, "The same", 8) == 0;
        int used = snprintf(
            caption, sizeof caption, "%s%s%s", refers ? "" : m->doc,
            refers || !m->doc[0] ? "" : " ",
            bst_text_of_count((char[BST_COUNT_TEXT]){0}, (int64_t)(n - outside), "run", "runs"));
        snprintf(caption + used, sizeof caption - (size_t)used,
                 outside > 0 ? "; %zu more lie outside." : ".", outside);
        bst_report_page_figure_end(out, caption);
    }
    if (shown > 0) {
        bst_report_page_grid_end(out);
        bst_report_page_section_end(out);
    }
    free(values);
}
