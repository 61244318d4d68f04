#include "sim/studies/statistics.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"

double bst_study_quantile(const double *sorted, int64_t n, double q) {
    if (n == 0) {
        return NAN;
    }
    double at = q * (double)(n - 1);
    int64_t i = (int64_t)floor(at);
    if (i >= n - 1) {
        return sorted[n - 1];
    }
    return sorted[i] + (at - (double)i) * (sorted[i + 1] - sorted[i]);
}

static void describe(const double *values, int64_t rows, int columns, int column, double *scratch,
                     bst_statistics *s) {
    double sum = 0.0, square = 0.0, first = NAN; /* the mean of equal values is exact */
    int64_t n = 0;
    for (int64_t i = 0; i < rows; i++) {
        double x = values[i * columns + column];
        if (!isnan(x)) {
            first = n == 0 ? x : first;
            scratch[n++] = x;
            sum += x - first;
        }
    }
    *s = (bst_statistics){.count = n, .missing = rows - n, .low = NAN, .high = NAN};
    s->mean = n > 0 ? first + sum / (double)n : NAN;
    for (int64_t i = 0; i < n; i++) {
        square += (scratch[i] - s->mean) * (scratch[i] - s->mean);
    }
    s->std = n > 1 ? sqrt(square / (double)(n - 1)) : NAN;
    qsort(scratch, (size_t)n, sizeof *scratch, bst_compare_doubles);
    s->minimum = n > 0 ? scratch[0] : NAN;
    s->maximum = n > 0 ? scratch[n - 1] : NAN;
    s->p05 = bst_study_quantile(scratch, n, 0.05);
    s->p25 = bst_study_quantile(scratch, n, 0.25);
    s->median = bst_study_quantile(scratch, n, 0.5);
    s->p75 = bst_study_quantile(scratch, n, 0.75);
    s->p95 = bst_study_quantile(scratch, n, 0.95);
}

/* Numbers for resampling, relative to the mean of their column to avoid cancellation. */
typedef struct sample {
    const double *centred,
        *there; /* [rows][columns]; there: 1 for a number, 0 for none; NULL: all are numbers */
    int64_t rows;
    int columns;
    bst_rng_key key;
    double *sums, *counts; /* [columns], work space */
} sample;

/* Computes the means of a bootstrap resample; NAN if none of a column's numbers was drawn. */
static void resample(const sample *s, uint64_t number, double *restrict means) {
    const double *restrict centred = s->centred, *restrict there = s->there;
    double *restrict sums = s->sums, *restrict counts = s->counts;
    int64_t rows = s->rows;
    int columns = s->columns;
    memset(sums, 0, (size_t)columns * sizeof *sums);
    memset(counts, 0, (size_t)columns * sizeof *counts);
    bst_philox_words words = {{0, 0, 0, 0}};
    for (int64_t i = 0; i < rows; i++) {
        if (i % 4 == 0) {
            words = bst_rng_words(s->key, number, (uint64_t)(i / 4));
        }
        /* rows are far below 2^32: the draw is uniform to rows / 2^32 */
        int64_t row = (int64_t)(((uint64_t)words.w[i % 4] * (uint64_t)rows) >> 32);
        const double *from = centred + row * columns;
        for (int c = 0; c < columns; c++) {
            sums[c] += from[c];
        }
        const double *is = there ? there + row * columns : NULL;
        for (int c = 0; is && c < columns; c++) {
            counts[c] += is[c];
        }
    }
    for (int c = 0; c < columns; c++) {
        double n = there ? counts[c] : (double)rows;
        means[c] = n > 0.0 ? sums[c] / n : NAN;
    }
}

static void set_interval(double *means, int64_t n, bst_statistics *s) {
    int64_t kept = 0;
    for (int64_t i = 0; i < n; i++) {
        if (!isnan(means[i])) {
            means[kept++] = means[i];
        }
    }
    qsort(means, (size_t)kept, sizeof *means, bst_compare_doubles);
    s->low = s->mean + bst_study_quantile(means, kept, 0.025);
    s->high = s->mean + bst_study_quantile(means, kept, 0.975);
}

bst_status bst_statistics_of(bst_ctx *ctx, const double *values, int64_t rows, int columns,
                             int64_t resamples, bst_rng_key key, bst_statistics *out) {
    size_t cells = (size_t)rows * (size_t)columns, wide = (size_t)columns;
    size_t most = (size_t)(rows > resamples ? rows : resamples);
    double *centred = malloc(cells * sizeof *centred + 1), *sums = malloc(wide * sizeof *sums + 1);
    double *means = malloc((size_t)resamples * wide * sizeof *means + 1);
    double *scratch = malloc(most * sizeof *scratch + 1);
    double *there = malloc(cells * sizeof *there + 1), *counts = malloc(wide * sizeof *counts + 1);
    bool gaps = false;
    bst_status status = BST_OK;
    if (!centred || !sums || !means || !scratch || !there || !counts) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for statistics");
        goto exit;
    }
    for (int c = 0; c < columns; c++) {
        describe(values, rows, columns, c, scratch, &out[c]);
    }
    if (rows > BST_BOOTSTRAP_RUNS) {
        for (int c = 0; c < columns; c++) {
            double half = 1.959963984540054 * out[c].std / sqrt((double)out[c].count);
            out[c].low = out[c].mean - half;
            out[c].high = out[c].mean + half;
        }
        goto exit;
    }
    for (size_t i = 0; i < cells; i++) {
        bool missing = isnan(values[i]);
        there[i] = missing ? 0.0 : 1.0;
        centred[i] = missing ? 0.0 : values[i] - out[i % wide].mean;
        gaps = gaps || missing;
    }
    for (int64_t b = 0; b < resamples && rows > 1; b++) {
        const sample s = {centred, gaps ? there : NULL, rows, columns, key, sums, counts};
        resample(&s, (uint64_t)b, means + (size_t)b * wide);
    }
    for (int c = 0; c < columns && rows > 1; c++) {
        for (int64_t b = 0; b < resamples; b++) {
            scratch[b] = means[(size_t)b * wide + (size_t)c];
        }
        if (out[c].count > 1) {
            set_interval(scratch, resamples, &out[c]);
        }
    }
exit:
    free(centred);
    free(sums);
    free(means);
    free(scratch);
    free(there);
    free(counts);
    return status;
}
