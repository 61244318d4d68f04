/* Internal functions shared by the charts of a report. */
#ifndef BST_REPORT_REPORT_PLOTS_H
#define BST_REPORT_REPORT_PLOTS_H

#include "sim/report/report.h"

/* A quantity of a report frame; NAN: none. */
typedef double (*bst_report_quantity)(const bst_report_frame *frame);

enum { BST_REPORT_SPANS = 512 };

/* Modes over time, in units of the time axis: each change, or for very many changes the mode at the
 * middle of each of BST_REPORT_SPANS intervals. */
typedef struct bst_report_spans {
    double from[BST_REPORT_SPANS], to[BST_REPORT_SPANS];
    int mode[BST_REPORT_SPANS];
    int count;
    bool thinned;
} bst_report_spans;

/* State of drawing one sensor's charts, with buffers for its series. */
typedef struct bst_report_drawing {
    FILE *out;
    const bst_report_sensor *sensor;
    double span_s;
    double unit_s; /* of the time axis */
    char time_label[40];
    const bst_report_spans *modes;
    double *x, *y, *z, *w;        /* x: times of the frames in units; y, z, w: buffers */
    bst_chart_common_x *common_x; /* x, for all charts over time */
} bst_report_drawing;

/* Axis of time of the charts: the whole run. */
bst_chart_axis bst_report_time_axis(const bst_report_drawing *d);
/* Fills `series` (d->y, d->z or d->w) with a quantity of each frame; returns the number of finite
 * values. */
size_t bst_report_fill(const bst_report_drawing *d, bst_report_quantity quantity, double *series);
/* Begins a chart over time with the modes as background; the y axis covers low..high. */
bst_chart bst_report_time_chart(const bst_report_drawing *d, const char *name, const char *label,
                                double low, double high, bool logarithmic);

/* RMS and percentiles of n numbers; NAN for n = 0. */
typedef struct bst_report_statistics {
    size_t count;
    double mean, rms, median, p95, p99, worst;
} bst_report_statistics;

/* Mean, RMS and percentiles of values.
 *
 * Given:     values  [n]; sorted in place
 * Returned:  NAN for n = 0 */
bst_report_statistics bst_report_measure(double *values, size_t n);
/* Nearest-rank percentile of n ascending numbers at a fraction 0 to 1; NAN for none. */
double bst_report_percentile(const double *sorted, size_t n, double share);

/* Histogram of the finite values among n, from low to high. */
typedef struct bst_report_histogram_of {
    const char *name, *label;
    const char *what; /* name of the counted items */
    const double *values;
    size_t n;
    double low, high;
    int bins, colour;
    double (*density)(
        double x,
        const void *user); /* expected fraction per unit of x, drawn as a curve; NULL: none */
    const void *user;
} bst_report_histogram_of;

/* Draws a histogram as a chart of 360 by 230 px. */
void bst_report_histogram(FILE *out, const bst_report_histogram_of *h);

/* Draws the timeline of modes, visibility, field, track and attitude (report_timeline.c). */
void bst_report_timeline(const bst_report_drawing *d);
/* Draws the geometry: paths on sky and ground, range and angles (report_sky.c). */
void bst_report_sky(const bst_report_drawing *d);

#endif
