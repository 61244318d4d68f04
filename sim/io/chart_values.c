#include "sim/io/chart_values.h"

#include <math.h>
#include <stdlib.h>

#include "sim/io/decimate.h"
#include "sim/io/html.h"

/* charts from this width on have the columns of wide ones, in units of the SVG */
#define WIDE 700.0

/* Writes a number, behind a space unless it is the first of a list. */
static void put(FILE *out, double value, int digits, bool first) {
    const char *space = first ? "" : " ";
    if (isfinite(value)) {
        fprintf(out, "%s%.*g", space, digits, value == 0.0 ? 0.0 : value); /* no -0 */
    } else {
        fprintf(out, "%s-", space);
    }
}

void bst_chart_values_of(const bst_chart *c, const char *name, const double *values, size_t n) {
    fprintf(c->out, " data-%s=\"", name);
    for (size_t i = 0; i < n; i++) {
        put(c->out, values[i], 6, i == 0);
    }
    fputc('"', c->out);
}

static void put_axis(FILE *out, const char *name, const bst_chart_axis *axis) {
    fprintf(out, " data-%s=\"%.9g %.9g%s%s\"", name, axis->low, axis->high,
            axis->logarithmic ? " log" : "", axis->bare ? " bare" : "");
    if (axis->label && axis->label[0]) {
        fprintf(out, " data-%s-label=\"", name);
        bst_html_text(out, axis->label);
        fputc('"', out);
    }
}

void bst_chart_values_axes(const bst_chart *c) {
    const double margins[4] = {c->left, c->top, c->width - c->left - c->inner_width,
                               c->height - c->top - c->inner_height};
    put_axis(c->out, "x", &c->x);
    put_axis(c->out, "y", &c->y);
    if (c->x.unit_s > 0.0) {
        fprintf(c->out, " data-unit-s=\"%.9g\"", c->x.unit_s);
    }
    bst_chart_values_of(c, "margins", margins, 4);
}

bool bst_chart_values_rising(const double *x, size_t n) {
    bool rising = n == 0 || isfinite(x[0]);
    for (size_t i = 1; i < n && rising; i++) {
        rising = isfinite(x[i]) && x[i - 1] <= x[i];
    }
    return rising;
}

void bst_chart_values_lists(const bst_chart *c, const char *kind, const bst_chart_list *lists,
                            size_t lists_count, size_t n) {
    fprintf(c->out, " data-kind=\"%s\"", kind);
    for (size_t k = 0; k < lists_count; k++) {
        bst_chart_values_of(c, lists[k].name, lists[k].values, n);
    }
}

void bst_chart_values_chosen(const bst_chart *c, const char *kind, const double *x, const double *y,
                             const size_t *chosen, size_t count) {
    const size_t every = count / BST_CHART_MOST_DOTS + (count % BST_CHART_MOST_DOTS > 0);
    fprintf(c->out, " data-kind=\"%s\"", kind);
    for (int k = 0; k < 2; k++) {
        fprintf(c->out, " data-%s=\"", k == 0 ? "x" : "y");
        for (size_t i = 0; i < count; i += every) {
            put(c->out, (k == 0 ? x : y)[chosen[i]], k == 0 ? 9 : 6, i == 0);
        }
        fputc('"', c->out);
    }
}

/* Writes the list of x, or the id of the list that has it. */
static void put_x(const bst_chart *c, const double *x, size_t n, const bst_io_extent *extents,
                  size_t count) {
    bst_chart_common_x *common = c->common_x;
    const bool wide = c->width >= WIDE, is_common = common && common->x == x && common->n == n;
    if (is_common && common->written[wide]) {
        fprintf(c->out, " data-x=\"#x%d%s\"", common->number, wide ? "w" : "");
        return;
    }
    if (is_common) {
        fprintf(c->out, " id=\"x%d%s\"", common->number, wide ? "w" : "");
        common->written[wide] = true;
    }
    fputs(" data-x=\"", c->out);
    for (size_t i = 0; i < count; i++) {
        put(c->out, extents[i].time_s, 9, i == 0);
    }
    fputc('"', c->out);
}

void bst_chart_values_series(const bst_chart *c, const char *kind, const double *x, const double *y,
                             size_t n) {
    const int columns = c->width >= WIDE ? BST_CHART_COLUMNS_WIDE : BST_CHART_COLUMNS;
    const bool rising = bst_chart_values_rising(x, n), reduced = n > (size_t)columns;
    bst_io_sample *samples = malloc((n + 1) * sizeof *samples);
    bst_io_extent *extents = malloc(((size_t)columns + 2) * sizeof *extents);
    size_t count = n;
    if (!samples || !extents || !(c->x.low < c->x.high) || (reduced && !rising)) {
        free(samples);
        free(extents);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        samples[i] = (bst_io_sample){x[i], isfinite(y[i]) ? y[i] : NAN};
    }
    if (reduced) {
        count = bst_io_decimate(samples, n, c->x.low, c->x.high, columns, extents);
    } else {
        for (size_t i = 0; i < n; i++) {
            extents[i] = (bst_io_extent){samples[i].time_s, samples[i].value, samples[i].value};
        }
    }
    fprintf(c->out, " data-kind=\"%s\"", kind);
    put_x(c, x, n, extents, count);
    fputs(" data-y=\"", c->out);
    for (size_t i = 0; i < count; i++) {
        const bool several = extents[i].high > extents[i].low;
        put(c->out, extents[i].low, several ? 5 : 6, i == 0);
        if (several) {
            fprintf(c->out, ":%.5g", extents[i].high);
        }
    }
    fputc('"', c->out);
    free(samples);
    free(extents);
}
