/* Series of a sensor's frame quantities for charts: selection, statistics, histogram. */
#include <math.h>
#include <stdlib.h>

#include "sim/core/compare.h"
#include "sim/report/report_plots.h"

bst_chart_axis bst_report_time_axis(const bst_report_drawing *d) {
    return (bst_chart_axis){
        .label = d->time_label, .low = 0.0, .high = d->span_s / d->unit_s, .unit_s = d->unit_s};
}

size_t bst_report_fill(const bst_report_drawing *d, bst_report_quantity quantity, double *series) {
    size_t numbers = 0;
    for (size_t i = 0; i < d->sensor->count; i++) {
        series[i] = quantity(&d->sensor->frames[i]);
        numbers += isfinite(series[i]) ? 1 : 0;
    }
    return numbers;
}

double bst_report_percentile(const double *sorted, size_t n, double share) {
    size_t rank = (size_t)ceil(share * (double)n);
    return n > 0 ? sorted[rank > 0 ? rank - 1 : 0] : NAN;
}

bst_report_statistics bst_report_measure(double *values, size_t n) {
    bst_report_statistics r = {.count = n, .mean = NAN, .rms = NAN};
    double sum = 0.0, squares = 0.0;
    for (size_t i = 0; i < n; i++) {
        sum += values[i];
        squares += values[i] * values[i];
    }
    if (n > 0) {
        qsort(values, n, sizeof *values, bst_compare_doubles);
        r.mean = sum / (double)n;
        r.rms = sqrt(squares / (double)n);
    }
    r.median = bst_report_percentile(values, n, 0.5);
    r.p95 = bst_report_percentile(values, n, 0.95);
    r.p99 = bst_report_percentile(values, n, 0.99);
    r.worst = bst_report_percentile(values, n, 1.0);
    return r;
}
