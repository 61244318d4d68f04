/* Statistics of a study's metrics over runs: mean, bootstrap interval, quantiles. */
#ifndef BST_STUDIES_STATISTICS_H
#define BST_STUDIES_STATISTICS_H

#include "boresight/rng.h"
#include "boresight/status.h"

/* Of the finite values; NAN if there are too few. */
typedef struct bst_statistics {
    int64_t count, missing; /* count: finite values; missing: NAN */
    double mean, std;       /* std: of the sample, n - 1 */
    double minimum, p05, p25, median, p75, p95, maximum;
    double low, high; /* 95 % interval of the mean */
} bst_statistics;

/* Quantile q of n sorted values with linear interpolation (definition 7 of Hyndman and Fan 1996,
 * Am. Stat. 50, 361). NAN for none. */
double bst_study_quantile(const double *sorted, int64_t n, double q);

/* Above this number of runs the interval of a mean is normal, mean +- 1.96 std / sqrt(n); the
 * bootstrap's differs by less than its own scatter. */
enum { BST_BOOTSTRAP_RUNS = 5000 };

/* Computes statistics of `columns` metrics over `rows` runs, values[rows][columns], into
 * out[columns]. Intervals of the mean are percentile bootstrap intervals (Efron 1979, Ann. Stat. 7,
 * 1) over `resamples` resamples, drawn from `key` and common to all columns; none for fewer than
 * two numbers. */
bst_status bst_statistics_of(bst_ctx *ctx, const double *values, int64_t rows, int columns,
                             int64_t resamples, bst_rng_key key,
                             bst_statistics *out) BST_MUST_CHECK;

#endif
