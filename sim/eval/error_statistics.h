/* Statistics of two-component pixel errors in constant memory: RMS, mean, maximum, and percentiles
 * from a histogram. */
#ifndef BST_EVAL_ERROR_STATISTICS_H
#define BST_EVAL_ERROR_STATISTICS_H

#include <stdint.h>

#include "boresight/archive.h"

/* Logarithmic bins of 0.1 % from 1e-5 px to 1e8 px, which is more than 180 degrees at 0.01 arcsec a
 * pixel. */
enum { BST_ERROR_BINS = 30000 };

typedef struct bst_error_statistics {
    int64_t count, bins[BST_ERROR_BINS];
    double sum_x, sum_y, sum2, largest; /* px, px, px^2, px */
} bst_error_statistics;

/* Adds an error with components (x, y) px. Zero the struct first. */
void bst_error_statistics_add(bst_error_statistics *statistics, double x_px, double y_px);
/* Saves or restores the statistics. */
void bst_error_statistics_archive(bst_error_statistics *statistics, bst_archive *archive);
/* RMS of the error magnitudes, px; NAN without errors. */
double bst_error_statistics_rms(const bst_error_statistics *statistics);
/* Length of the mean vector, px; NAN without errors. */
double bst_error_statistics_bias(const bst_error_statistics *statistics);
/* Percentile of the error magnitudes by nearest rank, px, accurate to 0.05 %; NAN without errors.
 * Magnitudes below 1e-5 px are one bin. */
double bst_error_statistics_quantile(const bst_error_statistics *statistics, double q);
/* Largest error magnitude, px; NAN without errors. */
double bst_error_statistics_largest(const bst_error_statistics *statistics);

#endif
