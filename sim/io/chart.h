/* SVG charts for HTML reports: axes, lines, dots, bars, bands. Colours come from the page's style
 * sheet (bst_chart_style), so that charts suit light and dark pages and print. The output depends
 * on the data only. Elements hold their values as attributes (sim/io/chart_values.h), from which a
 * script of the page makes the chart interactive. sim/io/plot.h makes separate pictures with
 * gnuplot.
 * Order of calls: bst_chart_begin, then background before foreground, bst_chart_end. Errors are
 * those of the stream. */
#ifndef BST_IO_CHART_H
#define BST_IO_CHART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

typedef struct bst_chart_axis {
    const char *label; /* "": none */
    double low, high;
    bool logarithmic;
    bool bare; /* no ticks and no numbers */
    double
        unit_s; /* of an axis of time since the epoch: its unit in seconds; 0: another quantity */
} bst_chart_axis;

/* x values that lines and dots of several charts of a page have in common: the page holds them
 * once. The charts have the same x axis. Begin with `x`, `n` and `number` set. */
typedef struct bst_chart_common_x {
    const double *x; /* the array that is passed to bst_chart_line and bst_chart_dots */
    size_t n;
    int number;      /* of this list in the page */
    bool written[2]; /* in its columns of wide and of narrow charts */
} bst_chart_common_x;

typedef struct bst_chart {
    FILE *out;
    const char *name;     /* description for screen readers */
    double width, height; /* of the SVG, in its units; about pixels */
    bst_chart_axis x, y;
    double margin_left;           /* minimum left margin; increased if the numbers need it */
    bst_chart_common_x *common_x; /* NULL: none */
    /* plotting area, set by bst_chart_begin */
    double left, top, inner_width, inner_height;
} bst_chart;

/* Colours. The first eight are distinguishable with colour vision deficiency. */
typedef enum bst_chart_colour {
    BST_CHART_BLUE,
    BST_CHART_ORANGE,
    BST_CHART_GREEN,
    BST_CHART_RED,
    BST_CHART_VIOLET,
    BST_CHART_BROWN,
    BST_CHART_CYAN,
    BST_CHART_GREY,
    BST_CHART_MODE /* + a bst_mode: backgrounds of the modes */
} bst_chart_colour;

/* Writes the style sheet that charts need, without the <style> tags. */
void bst_chart_style(FILE *out);

/* Extends low..high to the finite values among n (only positive ones if `logarithmic`). Begin with
 * low = INFINITY, high = -INFINITY. */
void bst_chart_widen(const double *values, size_t n, bool logarithmic, double *low, double *high);
/* Sets an axis to a range, which may be empty or a point: adds `margin` (0.05) of its length on
 * either side, or whole decades on a logarithmic axis. */
void bst_chart_fit(bst_chart_axis *axis, double low, double high, double margin);

/* Positions of about `wanted` ticks from low to high, at most `room`. *decimals: digits after the
 * point, -1: use %g. Returns their number. */
int bst_chart_ticks(double low, double high, bool logarithmic, int wanted, double *ticks, int room,
                    int *decimals);

/* A point of a thinned line. */
typedef struct bst_chart_point {
    double x, y; /* y NAN: gap in the line */
} bst_chart_point;

/* Thins a line for drawing: of the points in each of `columns` equal parts of low..high it keeps
 * the first, lowest, highest and last. Up to 4 * columns points are unchanged. x ascends. A part
 * without finite y is a gap. Returns the number of points, at most 5 * columns + 1, the capacity of
 * `out`. */
size_t bst_chart_thin(const double *x, const double *y, size_t n, double low, double high,
                      int columns, bst_chart_point *out);

/* Begins a chart: opens the SVG element and draws the axes.
 *
 * Given:     chart  with output, name, size and axes set; its layout members are filled in */
void bst_chart_begin(bst_chart *chart);
/* Ends a chart: draws its frame and closes the SVG element. */
void bst_chart_end(bst_chart *chart);

/* Draws background bands from from[i] to to[i] over the full height. `title`: tooltip; NULL:
 * none. */
void bst_chart_bands(const bst_chart *chart, const double *from, const double *to, size_t n,
                     int colour, const char *title);
/* Draws a line through points, thinned if there are many; a non-finite y is a gap. */
void bst_chart_line(const bst_chart *chart, const double *x, const double *y, size_t n, int colour,
                    bool dashed);
/* Draws dots; of several dots at one pixel only one. */
void bst_chart_dots(const bst_chart *chart, const double *x, const double *y, size_t n, int colour);
/* Fills the area between low and high, for confidence bands. */
void bst_chart_area(const bst_chart *chart, const double *x, const double *low, const double *high,
                    size_t n, int colour);
/* Draws a vertical interval (error bar) at each x. */
void bst_chart_whiskers(const bst_chart *chart, const double *x, const double *low,
                        const double *high, size_t n, int colour);
/* Draws a bar from (x0, y0) to (x1, y1). */
void bst_chart_bar(const bst_chart *chart, double x0, double x1, double y0, double y1, int colour,
                   const char *title);
/* Draws a horizontal line at y. */
void bst_chart_rule(const bst_chart *chart, double y, int colour);
/* Draws a vertical line at x, if x is on the axis. */
void bst_chart_mark(const bst_chart *chart, double x, int colour);
/* Writes text at a position of the axes plus (dx, dy); anchor "start", "middle" or "end". */
void bst_chart_word(const bst_chart *chart, double x, double y, double dx, double dy,
                    const char *anchor, const char *text);

/* Unit for a time span: name ("s", "min", "h", "d") and its length in seconds. */
double bst_chart_time_unit(double span_s, const char **name);

/* One entry of the legend below a chart, as HTML. */
typedef enum bst_chart_key {
    BST_KEY_LINE,
    BST_KEY_DASHED,
    BST_KEY_DOT,
    BST_KEY_GROUND
} bst_chart_key;

/* Writes one entry of the legend, as an HTML list item.
 *
 * Given:     colour  number of the colour
 *            text    plain text; escaped here */
void bst_chart_legend(FILE *out, bst_chart_key key, int colour, const char *text);

#endif
