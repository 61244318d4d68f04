/* What the charts of a report share. */
#ifndef BST_REPORT_REPORT_PLOTS_H
#define BST_REPORT_REPORT_PLOTS_H

#include "sim/report/report.h"

/* A quantity of a frame; NAN: none. */
typedef double (*bst_report_quantity)(const bst_report_frame *frame);

enum { BST_REPORT_SPANS = 512 };

/* Modes over time, in units of the time axis: as they changed, or where that was very often the one
 * in the middle of each of BST_REPORT_SPANS parts of the run. */
typedef struct bst_report_spans {
    double from[BST_REPORT_SPANS], to[BST_REPORT_SPANS];
    int mode[BST_REPORT_SPANS];
    int count;
    bool thinned;
} bst_report_spans;

/* A sensor being drawn, with room for series as long as its frames. */
typedef struct bst_report_drawing {
    FILE *out;
    const bst_report_sensor *sensor;
    double span_s;
    double unit_s; /* of the time axis */
    char time_label[40];
    const bst_report_spans *modes;
    double *x, *y, *z, *w; /* x: the frames' times in units; the others are for use */
} bst_report_drawing;

/* Fills `series` (d->y, d->z or d->w) with a quantity of each frame; returns how many are numbers.
 */
size_t bst_report_fill(const bst_report_drawing *d, bst_report_quantity quantity, double *series);
/* A chart over time with the modes as its ground, begun; the y axis fits low..high. */
bst_chart bst_report_time_chart(const bst_report_drawing *d, const char *name, const char *label,
                                double low, double high, bool logarithmic);

/* Root of the mean square, and percentiles, of n numbers; NAN for none. Sorts them. */
typedef struct bst_report_statistics {
    size_t count;
    double mean, rms, median, p95, p99, worst;
} bst_report_statistics;

/* Mean, RMS and percentiles of values.
 *
 * Given:     values  [n]; sorted in place
 * Returned:  NAN for n = 0 */
bst_report_statistics bst_report_measure(double *values, size_t n);
/* The value of nearest rank at a share (0 to 1) of n ascending numbers; NAN for none. */
double bst_report_percentile(const double *sorted, size_t n, double share);

/* A histogram of what is finite among n values, between low and high. */
typedef struct bst_report_histogram_of {
    const char *name, *label;
    const char *what; /* is counted */
    const double *values;
    size_t n;
    double low, high;
    int bins, colour;
    double (*density)(double x, const void *user); /* expected shares per unit of x, a curve over
                                                      it; NULL: none */
    const void *user;
} bst_report_histogram_of;

/* Draws a histogram as a chart of 360 by 230 px. */
void bst_report_histogram(FILE *out, const bst_report_histogram_of *h);

/* Timeline of modes and of what could be seen (report_timeline.c). */
void bst_report_timeline(const bst_report_drawing *d);
/* Geometry: paths on the sky and on the ground, range and angles (report_sky.c). */
void bst_report_sky(const bst_report_drawing *d);

#endif
