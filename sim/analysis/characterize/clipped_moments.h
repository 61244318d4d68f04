/* Mean and variance of values without outliers, and means of blocks. */
#ifndef BST_ANALYSIS_CHARACTERIZE_CLIPPED_MOMENTS_H
#define BST_ANALYSIS_CHARACTERIZE_CLIPPED_MOMENTS_H

#include <stddef.h>

/* A measured quantity; NAN: not determined. */
typedef struct bst_sensor_estimate {
    double value, sigma; /* sigma: standard error */
} bst_sensor_estimate;

/* Moments of the values that are kept. */
typedef struct bst_clipped_moments {
    double mean, variance;
    double low, high; /* limits of the values that are kept */
    size_t count;
} bst_clipped_moments;

/* Mean and variance of values within `clip` standard deviations of their mean, iterated from median
 * and quartiles until the limits stay.
 *
 * Given:     values  [count], sorted here; NAN is skipped
 *            clip    5: a normal distribution loses 6e-7 of its values, and 2e-5 of its variance */
bst_clipped_moments bst_clipped_moments_of(float *values, size_t count, double clip);

/* Standard deviation of normal values from their quartiles. Whole numbers count as spread evenly
 * over +-1/2.
 *
 * Given:     values  [count], sorted here
 * Returned:  NAN without values */
double bst_robust_sigma(float *values, size_t count);

/* Sorts numbers, none of them NAN, ascending, in time proportional to their number. */
void bst_sort_floats(float *values, size_t count);

/* Median of sorted values; NAN without any. */
double bst_sorted_median(const float *values, size_t count);

/* Root of a variance; 0 for a variance that the noise made negative, NAN for one that is NAN. */
bst_sensor_estimate bst_root_estimate(bst_sensor_estimate variance);

/* Mean of values and its standard error from their scatter; NAN values are skipped. */
bst_sensor_estimate bst_mean_estimate(const double *values, int count);
/* Ratio of two independent estimates. */
bst_sensor_estimate bst_sensor_ratio(bst_sensor_estimate above, bst_sensor_estimate below);

#endif
