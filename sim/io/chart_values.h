/* The values of a chart as attributes of its SVG elements: a script of the page reads them and
 * makes the chart interactive (view/page/report_charts.js). Only sim/io/chart.c calls these
 * functions.
 *
 * Notes:
 *   Numbers have 6 significant digits, x of series 9, extremes 5; "-" is a value that is not
 * finite. The svg element has data-x and data-y (low and high end, then "log", "bare" if they
 * apply), data-x-label, data-y-label, data-unit-s (unit of an axis of time, s) and data-margins
 * (left, top, right, bottom, in units of the SVG). Other elements have data-kind with lists of
 * equal length (line and dots: data-x, data-y; area and whiskers: data-x, data-low, data-high;
 * bands: data-from, data-to), or one of data-bar (x0 x1 y0 y1), data-rule (y), data-mark (x),
 * data-word (x y dx dy). A value "low:high" has the extremes of a column of samples. data-x="#ID"
 * is the list of the element with this id. */
#ifndef BST_IO_CHART_VALUES_H
#define BST_IO_CHART_VALUES_H

#include "sim/io/chart.h"

/* Columns to which series are reduced, in charts of at least 700 units of width and in others, and
 * the most dots in no order. They bound the size of a page. */
enum { BST_CHART_COLUMNS_WIDE = 1200, BST_CHART_COLUMNS = 600, BST_CHART_MOST_DOTS = 2000 };

/* A list of values and the name of its attribute, without "data-". */
typedef struct bst_chart_list {
    const char *name;
    const double *values;
} bst_chart_list;

/* Writes the attributes of the svg element, after bst_chart_begin has laid it out. */
void bst_chart_values_axes(const bst_chart *chart);

/* True if no x is smaller than the one before, and all are finite. */
bool bst_chart_values_rising(const double *x, size_t n);

/* Writes a series over rising x: each sample, or of more samples than columns the extremes of each
 * column (bst_io_decimate). Lists of x that charts have in common are written once. Without memory
 * nothing is written: the chart then has no values.
 *
 * Given:     kind  "line" or "dots"
 *            x, y  [n]; more values than columns are written only if x rises */
void bst_chart_values_series(const bst_chart *chart, const char *kind, const double *x,
                             const double *y, size_t n);

/* Writes chosen points as they are; of more than BST_CHART_MOST_DOTS every second, third, ... one.
 *
 * Given:     chosen  [count] indices into x and y */
void bst_chart_values_chosen(const bst_chart *chart, const char *kind, const double *x,
                             const double *y, const size_t *chosen, size_t count);

/* Writes lists of equal length.
 *
 * Given:     lists  [lists_count] of [n] values each */
void bst_chart_values_lists(const bst_chart *chart, const char *kind, const bst_chart_list *lists,
                            size_t lists_count, size_t n);

/* Writes a few numbers as the attribute "data-NAME". */
void bst_chart_values_of(const bst_chart *chart, const char *name, const double *values, size_t n);

#endif
