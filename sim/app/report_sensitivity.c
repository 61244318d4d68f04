/* Which of what was swept matters, and for what: designs one_at_a_time and morris. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/app/report_study.h"

/* Metrics that are told beside the wall time; axes in a chart. */
enum { METRICS = 6, AXES = 24 };

/* What an axis does to a metric. */
typedef struct effect {
    const bst_study_axis_view *axis;
    double size; /* ranks: mean of |elementary effect|, or the largest change */
    /* morris */
    double sigma, low, high; /* spread of the elementary effects; 95 % interval of `size` */
    int count;
    /* one at a time: where the metric goes at the least and the greatest value of the axis */
    double at[2], value[2];
} effect;

static int largest_first(const void *a, const void *b) {
    const effect *x = a, *y = b;
    return x->size != y->size ? (x->size < y->size) - (x->size > y->size)
                              : (x->axis > y->axis) - (x->axis < y->axis);
}

static bool is_design(const bst_study_axis_view *a, const char *design) {
    return a->swept && strcmp(a->design, design) == 0;
}

/* The one axis in which two settings differ; NULL when there are none or several. */
static const bst_study_axis_view *only_difference(const bst_study_view *v, int64_t a, int64_t b) {
    const bst_study_axis_view *found = NULL;
    for (int i = 0; i < v->axis_count; i++) {
        const bst_study_axis_view *x = &v->axes[i];
        if (x->swept && x->of_setting[a] != x->of_setting[b]) {
            if (found) {
                return NULL;
            }
            found = x;
        }
    }
    return found;
}

/* ------------------------------------------------------------------ morris */

/* Place of a value in the axis' range, 0 to 1. */
static double place(const bst_study_view *v, const bst_study_axis_view *a, double value) {
    double low = INFINITY, high = -INFINITY;
    bst_chart_widen(a->of_setting, (size_t)v->settings, false, &low, &high);
    return a->logarithmic ? log(value / low) / log(high / low) : (value - low) / (high - low);
}

/* Elementary effects (Morris 1991, Technometrics 33, 161) of neighbouring settings that differ in
 * this axis alone, over the axis' whole range; the mean of their sizes is mu* of Campolongo et al.
 * 2007, Environ. Model. Softw. 22, 1509. */
static bool find_elementary(const bst_study_view *v, const bst_study_metric_view *m,
                            const bst_study_axis_view *axis, effect *out) {
    double sum = 0.0, squares = 0.0, sizes = 0.0;
    int n = 0;
    for (int64_t i = 0; i + 1 < v->settings; i++) {
        if (only_difference(v, i, i + 1) != axis) {
            continue;
        }
        double change = m->mean[i + 1] - m->mean[i];
        double step = place(v, axis, axis->of_setting[i + 1]) - place(v, axis, axis->of_setting[i]);
        double e = change / step;
        if (isfinite(e)) {
            sum += e;
            sizes += fabs(e);
            squares += e * e;
            n++;
        }
    }
    if (n < 2) {
        return false;
    }
    double mean = sum / n, size = sizes / n;
    *out = (effect){.axis = axis, .size = size, .count = n};
    out->sigma = sqrt(fmax(0.0, (squares - n * mean * mean) / (n - 1)));
    /* of |e|, normal */
    double spread = sqrt(fmax(0.0, (squares - n * size * size) / (n - 1)) / n);
    out->low = fmax(0.0, size - 1.96 * spread);
    out->high = size + 1.96 * spread;
    return true;
}

static void put_row_names(const bst_chart *c, const effect *list, int count) {
    for (int i = 0; i < count; i++) {
        char text[80];
        snprintf(text, sizeof text, "%d  %.40s", i + 1, list[i].axis->name);
        bst_chart_word(c, c->x.low, count - i - 0.5, -8.0, 4.0, "end", text);
    }
}

static void put_morris(FILE *out, const bst_study_metric_view *m, const effect *list, int count) {
    char label[128], text[160];
    double most = 0.0, spread = 0.0;
    for (int i = 0; i < count; i++) {
        most = fmax(most, list[i].high);
        spread = fmax(spread, list[i].sigma);
    }
    bst_study_label(m, label);
    snprintf(text, sizeof text, "Ranked effects on %s", m->name);
    bst_page_figure(out, BST_PAGE_HALF);
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
        bst_chart_bar(&c, list[i].low, list[i].high, y - 0.54, y - 0.46, BST_CHART_ORANGE, NULL);
    }
    put_row_names(&c, list, count);
    bst_chart_end(&c);
    snprintf(text, sizeof text,
             "Mean size of %d elementary effects (mu*), over the axis' whole range; with its 95 %% "
             "interval.",
             list[0].count);
    bst_page_figure_end(out, text);
    snprintf(text, sizeof text, "Spread against size of the effects on %s", m->name);
    bst_page_figure(out, BST_PAGE_HALF);
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
        /* neighbours in rank are often at one place */
        bst_chart_word(&d, list[i].size, list[i].sigma, i % 2 ? -5.0 : 5.0, -4.0,
                       i % 2 ? "end" : "start", text);
    }
    bst_chart_end(&d);
    bst_page_figure_end(out,
                        "Numbers are the ranks beside. A large sigma: the effect is not linear, or "
                        "depends on the other axes.");
}

/* ------------------------------------------------------------------ one at a time */

/* Setting 0 has the scenario's own values. */
static bool find_change(const bst_study_view *v, const bst_study_metric_view *m,
                        const bst_study_axis_view *axis, effect *out) {
    *out = (effect){.axis = axis, .at = {INFINITY, -INFINITY}, .value = {NAN, NAN}};
    for (int64_t i = 1; i < v->settings; i++) {
        if (only_difference(v, 0, i) != axis || !isfinite(m->mean[i])) {
            continue;
        }
        out->size = fmax(out->size, fabs(m->mean[i] - m->mean[0]));
        double value = axis->of_setting[i];
        if (value < out->at[0]) {
            out->at[0] = value;
            out->value[0] = m->mean[i];
        }
        if (value > out->at[1]) {
            out->at[1] = value;
            out->value[1] = m->mean[i];
        }
        out->count++;
    }
    return out->count > 0 && isfinite(out->size);
}

static void put_tornado(FILE *out, const bst_study_metric_view *m, const effect *list, int count) {
    char label[128], text[200];
    double low = m->mean[0], high = low;
    for (int i = 0; i < count; i++) {
        bst_chart_widen(list[i].value, 2, false, &low, &high);
    }
    bst_study_label(m, label);
    snprintf(text, sizeof text, "Change of %s with one axis at a time", m->name);
    bst_page_figure(out, BST_PAGE_HALF);
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
                bst_study_word(list[i].axis, list[i].at[end], word);
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
    bst_page_figure_end(out, caption);
}

/* ------------------------------------------------------------------ both */

static void put_metric(FILE *out, const bst_study_view *v, const bst_study_metric_view *m,
                       bool morris) {
    effect *list = calloc((size_t)v->axis_count + 1, sizeof *list);
    int count = 0;
    for (int i = 0; list && i < v->axis_count; i++) {
        const bst_study_axis_view *a = &v->axes[i];
        bool good =
            is_design(a, morris ? "morris" : "one_at_a_time") &&
            (morris ? find_elementary(v, m, a, &list[count]) : find_change(v, m, a, &list[count]));
        count += good;
    }
    if (count > 0) {
        qsort(list, (size_t)count, sizeof *list, largest_first);
        count = count < AXES ? count : AXES;
        if (morris) {
            put_morris(out, m, list, count);
        } else {
            put_tornado(out, m, list, count);
        }
    }
    free(list);
}

void bst_study_plot_sensitivity(FILE *out, const bst_study_view *v) {
    int metrics[METRICS], count = bst_study_key_metrics(v, metrics, METRICS);
    bool there[2] = {false, false};
    for (int i = 0; i < v->axis_count; i++) {
        there[0] = there[0] || is_design(&v->axes[i], "one_at_a_time");
        there[1] = there[1] || is_design(&v->axes[i], "morris");
    }
    if ((!there[0] && !there[1]) || v->settings < 2) {
        return;
    }
    bst_page_section(out, 2, "What matters");
    for (int morris = 0; morris < 2; morris++) {
        if (!there[morris]) {
            continue;
        }
        bst_page_grid(out, BST_PAGE_HALF);
        for (int k = 0; k < count; k++) {
            put_metric(out, v, &v->metrics[metrics[k]], morris == 1);
        }
        put_metric(out, v, &v->wall, morris == 1);
        bst_page_grid_end(out);
    }
    bst_page_section_end(out);
}
