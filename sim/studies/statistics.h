/* What is told of many runs. */
#ifndef BST_STUDIES_STATISTICS_H
#define BST_STUDIES_STATISTICS_H

#include "boresight/rng.h"
#include "boresight/status.h"

/* Of the values that are numbers; NAN where there are too few. */
typedef struct bst_statistics {
    int64_t count, missing; /* numbers; NANs */
    double mean, std;       /* std of the sample: n - 1 */
    double minimum, p05, p25, median, p75, p95, maximum;
    double low, high; /* 95 % interval of the mean */
} bst_statistics;

/* The quantile q of n sorted values, linear between them (definition 7 of Hyndman and Fan 1996,
 * Am. Stat. 50, 361). NAN for none. */
double bst_study_quantile(const double *sorted, int64_t n, double q);

/* Beyond so many runs the interval of a mean is that of a normal distribution, mean +- 1.96 std /
 * sqrt(n), from which the bootstrap's differs by less than its own scatter. */
enum { BST_BOOTSTRAP_RUNS = 5000 };

/* Statistics of `columns` metrics over `rows` runs, values[rows][columns], into out[columns].
 * Intervals are percentile bootstrap intervals of the mean (Efron 1979, Ann. Stat. 7, 1) over
 * `resamples` resamples of the runs, which follow from `key` and are the same for all columns; none
 * for fewer than two numbers. */
bst_status bst_statistics_of(bst_ctx *ctx, const double *values, int64_t rows, int columns,
                             int64_t resamples, bst_rng_key key,
                             bst_statistics *out) BST_MUST_CHECK;

#endif
