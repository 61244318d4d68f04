/* Statistics of two-component errors in fixed memory: exact RMS, mean and largest, percentiles from
 * a histogram. */
#ifndef BST_EVAL_ERROR_STATISTICS_H
#define BST_EVAL_ERROR_STATISTICS_H

#include <stdint.h>

/* Logarithmic bins of 0.1 % from 1e-5 px to 1e8 px, which is more than 180 degrees at 0.01 arcsec a
 * pixel. */
enum { BST_ERROR_BINS = 30000 };

typedef struct bst_error_statistics {
    int64_t count, bins[BST_ERROR_BINS];
    double sum_x, sum_y, sum2, largest; /* px, px, px^2, px */
} bst_error_statistics;

/* Adds an error of components (x, y) px; its size is hypot(x, y). Zero the struct to begin. */
void bst_error_statistics_add(bst_error_statistics *statistics, double x_px, double y_px);
/* Root of the mean square of the sizes, px; NAN without errors. */
double bst_error_statistics_rms(const bst_error_statistics *statistics);
/* Length of the mean vector, px; NAN without errors. */
double bst_error_statistics_bias(const bst_error_statistics *statistics);
/* Percentile of the sizes by nearest rank (the smallest size that at least a share q of all does
 * not exceed), px, right to 0.05 %; NAN without errors. Sizes below 1e-5 px are one bin. */
double bst_error_statistics_quantile(const bst_error_statistics *statistics, double q);
/* Largest size, px; NAN without errors. */
double bst_error_statistics_largest(const bst_error_statistics *statistics);

#endif
