/* Charts as SVG for a page of HTML: axes, lines, dots, bars, bands and lanes. They take their
 * colours from the page (bst_chart_style), so that they can be read on light and dark ground and in
 * print, need no other program, and are the same bytes for the same data. sim/io/plot.h draws
 * pictures that stand alone, through gnuplot.
 *
 * Order of calls: bst_chart_begin, then what is behind before what is in front, bst_chart_end.
 * Errors are those of the stream. */
#ifndef BST_IO_CHART_H
#define BST_IO_CHART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

typedef struct bst_chart_axis {
    const char *label; /* "" for none */
    double low, high;
    bool logarithmic;
    bool bare; /* no ticks and no numbers */
} bst_chart_axis;

typedef struct bst_chart {
    FILE *out;
    const char *name;     /* what it shows, for those who cannot see it */
    double width, height; /* of the whole, units of the SVG; about pixels */
    bst_chart_axis x, y;
    double margin_left; /* of the plotting area at least; more where the numbers need it */
    /* set by bst_chart_begin: the plotting area */
    double left, top, inner_width, inner_height;
} bst_chart;

/* Colours. The first eight can be told apart by people who do not see all colours. */
typedef enum bst_chart_colour {
    BST_CHART_BLUE,
    BST_CHART_ORANGE,
    BST_CHART_GREEN,
    BST_CHART_RED,
    BST_CHART_VIOLET,
    BST_CHART_BROWN,
    BST_CHART_CYAN,
    BST_CHART_GREY,
    BST_CHART_MODE /* + a bst_mode: grounds of the modes */
} bst_chart_colour;

/* Writes the style sheet that charts need, without the <style> tags. */
void bst_chart_style(FILE *out);

/* Widens low..high by the finite values among n (only those above 0 where `logarithmic`); begin
 * with low = INFINITY, high = -INFINITY. */
void bst_chart_widen(const double *values, size_t n, bool logarithmic, double *low, double *high);
/* Makes an axis of a range that may be empty or a point: a margin of `margin` of its length (0.05)
 * on either side, whole decades on a logarithmic one. */
void bst_chart_fit(bst_chart_axis *axis, double low, double high, double margin);

/* Places of about `wanted` ticks from low to high, at most `room`; *decimals gets the digits after
 * the point that tell them apart, -1 where %g is better. Returns their number. */
int bst_chart_ticks(double low, double high, bool logarithmic, int wanted, double *ticks, int room,
                    int *decimals);

/* A point of a thinned line. */
typedef struct bst_chart_point {
    double x, y; /* y NAN: the line is broken here */
} bst_chart_point;

/* Thins a line out: of the points of each of `columns` equal parts of low..high the first, the
 * lowest, the highest and the last remain, in their order; what a drawing of so many columns shows
 * stays the same. Up to 4 * columns points are kept as they are. x ascends. A part in which no y is
 * finite breaks the line. Returns the number of points, at most 5 * columns + 1: the room in `out`.
 */
size_t bst_chart_thin(const double *x, const double *y, size_t n, double low, double high,
                      int columns, bst_chart_point *out);

/* Begins a chart: opens the SVG element and draws the axes.
 *
 * Given:     chart  with output, name, size and axes set; its layout members are filled in */
void bst_chart_begin(bst_chart *chart);
/* Ends a chart: draws its frame and closes the SVG element. */
void bst_chart_end(bst_chart *chart);

/* Grounds from from[i] to to[i], the whole height. `title` is shown under the pointer; NULL for
 * none. */
void bst_chart_bands(const bst_chart *chart, const double *from, const double *to, size_t n,
                     int colour, const char *title);
/* A line through points; one whose y is not finite breaks it. Thinned out where there are many. */
void bst_chart_line(const bst_chart *chart, const double *x, const double *y, size_t n, int colour,
                    bool dashed);
/* Points; of many in one place one is drawn. */
void bst_chart_dots(const bst_chart *chart, const double *x, const double *y, size_t n, int colour);
/* An area between low and high, for intervals along a curve. */
void bst_chart_area(const bst_chart *chart, const double *x, const double *low, const double *high,
                    size_t n, int colour);
/* A vertical interval at each x. */
void bst_chart_whiskers(const bst_chart *chart, const double *x, const double *low,
                        const double *high, size_t n, int colour);
/* A bar from x0 to x1 and y0 to y1. */
void bst_chart_bar(const bst_chart *chart, double x0, double x1, double y0, double y1, int colour,
                   const char *title);
/* A horizontal line at y. */
void bst_chart_rule(const bst_chart *chart, double y, int colour);
/* A vertical line at x; nothing if x is outside the axis. */
void bst_chart_mark(const bst_chart *chart, double x, int colour);
/* A word at a place of the axes, dx and dy beside it; anchor "start", "middle" or "end". */
void bst_chart_word(const bst_chart *chart, double x, double y, double dx, double dy,
                    const char *anchor, const char *text);

/* Units for a span of time: its name ("s", "min", "h", "d") and how many seconds it has. */
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
