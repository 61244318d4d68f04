/* Statistics against closed forms, and intervals against how often they hold. */
#include "sim/studies/statistics.h"
#include "tests/test_support.h"

static void test_closed_forms(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double values[] = {4, NAN, 1, 7, 3, 7, 2, 7, 0, NAN};
    bst_statistics out[2];
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "statistics");
    bst_assert_ok(&ctx, bst_statistics_of(&ctx, values, 5, 2, 100, key, out));
    /* of 4, 1, 3, 2, 0: mean 2, sum of squares 10; quantiles lie between neighbours */
    assert_int_equal(out[0].count, 5);
    assert_int_equal(out[0].missing, 0);
    bst_assert_close(out[0].mean, 2.0, 1e-15); /* rounding */
    bst_assert_close(out[0].std, sqrt(10.0 / 4.0), 1e-15);
    assert_true(out[0].minimum == 0.0 && out[0].maximum == 4.0 && out[0].median == 2.0);
    bst_assert_close(out[0].p05, 0.2, 1e-15);
    bst_assert_close(out[0].p75, 3.0, 1e-15);
    assert_true(out[0].low < 2.0 && out[0].high > 2.0);
    /* equal values have no spread, and what is missing is no value */
    assert_int_equal(out[1].count, 3);
    assert_int_equal(out[1].missing, 2);
    assert_true(out[1].mean == 7.0 && out[1].std == 0.0 && out[1].low == 7.0 && out[1].high == 7.0);
}

static void test_too_few(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double values[] = {3, NAN};
    bst_statistics out[2];
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "statistics");
    bst_assert_ok(&ctx, bst_statistics_of(&ctx, values, 1, 2, 100, key, out));
    assert_true(out[0].mean == 3.0 && isnan(out[0].std) && isnan(out[0].low));
    assert_true(isnan(out[1].mean) && isnan(out[1].median) && out[1].missing == 1);
    assert_true(isnan(bst_study_quantile(values, 0, 0.5)));
}

/* 95 % intervals of the mean of 60 skewed (exponential) draws hold the truth about as often. */
static void test_coverage(void **state) {
    (void)state;
    enum { SETS = 600, RUNS = 60 };
    bst_ctx ctx = {0};
    double values[RUNS];
    int held = 0;
    for (int s = 0; s < SETS; s++) {
        bst_rng_key draws = bst_rng_make_key(7, (uint64_t)s, "test", "draws");
        bst_rng_key key = bst_rng_make_key(7, (uint64_t)s, "test", "bootstrap");
        bst_statistics out;
        for (int i = 0; i < RUNS; i++) {
            values[i] = -log(bst_rng_uniform(draws, 0, (uint64_t)i));
        }
        bst_assert_ok(&ctx, bst_statistics_of(&ctx, values, RUNS, 1, 400, key, &out));
        held += out.low <= 1.0 && out.high >= 1.0;
    }
    /* the percentile bootstrap of 60 exponential draws covers 92.5 to 94 % (its known want, of
     * order 1/n); 0.0107 is the standard deviation of a rate of 600 */
    bst_assert_close((double)held / SETS, 0.935, 0.035);
}

/* With gaps a resample's mean is over what was drawn of them: against sums over every resample of
 * three rows of two columns, 27 of equal probability. */
static void test_gaps(void **state) {
    (void)state;
    enum { RESAMPLES = 40000 };
    bst_ctx ctx = {0};
    const double values[] = {1, 5, NAN, 11, 4, 20};
    bst_statistics out[2];
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "gaps");
    bst_assert_ok(&ctx, bst_statistics_of(&ctx, values, 3, 2, RESAMPLES, key, out));
    for (int c = 0; c < 2; c++) {
        double means[27], mean = c == 0 ? 2.5 : 12;
        int kept = 0;
        for (int i = 0; i < 27; i++) {
            const int rows[3] = {i % 3, i / 3 % 3, i / 9};
            double sum = 0, n = 0;
            for (int k = 0; k < 3; k++) {
                double v = values[2 * rows[k] + c];
                sum += isnan(v) ? 0 : v;
                n += !isnan(v);
            }
            if (n > 0) {
                means[kept++] = sum / n;
            }
        }
        assert_int_equal(kept, c == 0 ? 26 : 27);
        /* the lowest and the highest have 1/27 and more of them: they are the interval's ends */
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < kept; i++) {
            low = fmin(low, means[i]);
            high = fmax(high, means[i]);
        }
        bst_assert_close(out[c].mean, mean, 1e-14);
        bst_assert_close(out[c].low, low, 1e-12);
        bst_assert_close(out[c].high, high, 1e-12);
    }
}

/* Of more runs than are resampled, by the normal distribution: two columns, the second with a value
 * in every third row only. */
static void test_many(void **state) {
    (void)state;
    const int64_t rows = BST_BOOTSTRAP_RUNS + 1;
    bst_ctx ctx = {0};
    double *values = malloc(2 * (size_t)rows * sizeof *values);
    assert_non_null(values);
    for (int64_t i = 0; i < rows; i++) {
        values[2 * i] = (double)(i % 2);
        values[2 * i + 1] = i % 3 == 0 ? (double)(4 * (i % 2)) : NAN;
    }
    bst_statistics out[2];
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "many");
    bst_assert_ok(&ctx, bst_statistics_of(&ctx, values, rows, 2, 10, key, out));
    for (int c = 0; c < 2; c++) {
        const double n = ceil((double)rows / (c ? 3 : 1)), unit = c ? 4.0 : 1.0;
        const double ones = floor(n / 2), mean = ones / n;
        const double std = sqrt(ones * (1 - mean) / (n - 1)); /* n p (1 - p) over n - 1 */
        assert_true((double)out[c].count == n && (double)out[c].missing == (double)rows - n);
        bst_assert_close(out[c].mean, unit * mean, 1e-12);
        bst_assert_close(out[c].std, unit * std, 1e-12);
        bst_assert_close(out[c].low, unit * (mean - 1.959963984540054 * std / sqrt(n)), 1e-12);
        bst_assert_close(out[c].high, unit * (mean + 1.959963984540054 * std / sqrt(n)), 1e-12);
        assert_true(out[c].p25 == 0 && out[c].p75 == unit && out[c].p05 == 0 && out[c].p95 == unit);
    }
    free(values);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_forms), cmocka_unit_test(test_too_few),
        cmocka_unit_test(test_gaps), cmocka_unit_test(test_many), cmocka_unit_test(test_coverage)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
