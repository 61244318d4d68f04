/* Time series reduced to columns, against a search over all samples. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sim/io/decimate.h"

static uint64_t seed = 7;

/* Uniform in 0 to 1 (Knuth's MMIX generator, upper bits). */
static double uniform(void) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(seed >> 11) / 9007199254740992.0;
}

/* Samples at uneven times, some equal, some gaps; returns their number. */
static size_t make_samples(bst_io_sample *samples, size_t most) {
    size_t count = (size_t)(uniform() * (double)most);
    double time_s = -3.0;
    for (size_t i = 0; i < count; i++) {
        time_s += uniform() < 0.1 ? 0.0 : uniform() * (uniform() < 0.05 ? 20.0 : 0.1);
        samples[i] = (bst_io_sample){time_s, uniform() < 0.05 ? NAN : uniform() - 0.5};
    }
    return count;
}

/* Extremes of all samples of a column; false: it has none. */
static bool brute_force(const bst_io_sample *samples, size_t count, double from_s, double to_s,
                        int columns, int column, bst_io_extent *out) {
    double width = (to_s - from_s) / columns;
    bool any = false;
    *out = (bst_io_extent){from_s + (column + 0.5) * width, NAN, NAN};
    for (size_t i = 0; i < count; i++) {
        if (samples[i].time_s < from_s || samples[i].time_s > to_s) {
            continue;
        }
        int its = (int)((samples[i].time_s - from_s) / width);
        if ((its < columns - 1 ? its : columns - 1) == column) {
            any = true;
            out->low = fmin(out->low, samples[i].value);
            out->high = fmax(out->high, samples[i].value);
        }
    }
    return any;
}

static void assert_same(bst_io_extent a, bst_io_extent b) {
    /* the same arithmetic on the same numbers: no tolerance */
    assert_true(a.time_s == b.time_s);
    assert_true(a.low == b.low || (isnan(a.low) && isnan(b.low)));
    assert_true(a.high == b.high || (isnan(a.high) && isnan(b.high)));
}

static void check(const bst_io_sample *samples, size_t count, double from_s, double to_s,
                  int columns) {
    static bst_io_extent out[64];
    size_t n = bst_io_decimate(samples, count, from_s, to_s, columns, out), k = 0, inside = 0;
    const bst_io_sample *before = NULL, *after = NULL;
    for (size_t i = 0; i < count; i++) {
        inside += samples[i].time_s >= from_s && samples[i].time_s <= to_s;
        before = samples[i].time_s < from_s ? &samples[i] : before;
        after = !after && samples[i].time_s > to_s ? &samples[i] : after;
    }
    assert_true(n <= (size_t)columns + 2);
    if (before) {
        assert_same(out[k++], (bst_io_extent){before->time_s, before->value, before->value});
    }
    if (inside <= (size_t)columns) {
        for (size_t i = 0; i < count; i++) {
            if (samples[i].time_s >= from_s && samples[i].time_s <= to_s) {
                assert_same(out[k++],
                            (bst_io_extent){samples[i].time_s, samples[i].value, samples[i].value});
            }
        }
    } else {
        for (int column = 0; column < columns; column++) {
            bst_io_extent expected;
            if (brute_force(samples, count, from_s, to_s, columns, column, &expected)) {
                assert_same(out[k++], expected);
            }
        }
    }
    if (after) {
        assert_same(out[k++], (bst_io_extent){after->time_s, after->value, after->value});
    }
    assert_int_equal(n, k);
}

static void test_against_brute_force(void **state) {
    (void)state;
    static bst_io_sample samples[400];
    for (int trial = 0; trial < 400; trial++) {
        size_t count = make_samples(samples, 400);
        double last = count ? samples[count - 1].time_s : 1.0, from_s = -4.0 + uniform() * 5.0;
        double to_s = from_s + 0.001 + uniform() * (last + 4.0);
        int columns = 1 + (int)(uniform() * 60.0);
        check(samples, count, from_s, to_s, columns);
        if (count > 1 && samples[0].time_s < last) { /* ends on samples */
            check(samples, count, samples[0].time_s, last, columns);
        }
    }
}

static void test_no_samples(void **state) {
    (void)state;
    bst_io_extent out[12];
    assert_int_equal(bst_io_decimate(NULL, 0, 0.0, 1.0, 10, out), 0);
}

static void test_sort(void **state) {
    (void)state;
    static bst_io_sample samples[300];
    double sum = 0.0, sorted_sum = 0.0;
    for (int i = 0; i < 300; i++) {
        samples[i] = (bst_io_sample){floor(uniform() * 50.0), i};
        sum += samples[i].time_s * i;
    }
    bst_io_sort_samples(samples, 300);
    for (int i = 0; i < 300; i++) {
        assert_true(i == 0 || samples[i - 1].time_s <= samples[i].time_s);
        sorted_sum += samples[i].time_s * samples[i].value; /* integers: exact */
    }
    assert_true(sum == sorted_sum);
    /* falling throughout, and one sample alone too early at each place */
    for (int early = 0; early <= 5; early++) {
        for (int i = 0; i < 5; i++) {
            samples[i].time_s = early == 5 ? -i : i == early ? -1.0 : i;
        }
        bst_io_sort_samples(samples, 5);
        for (int i = 1; i < 5; i++) {
            assert_true(samples[i - 1].time_s < samples[i].time_s);
        }
    }
}

/* Thinning keeps the extremes of all samples, of every four, and the order. */
static void test_thin(void **state) {
    (void)state;
    static bst_io_sample samples[403], all[403];
    for (int trial = 0; trial < 100; trial++) {
        size_t count = make_samples(samples, 403);
        memcpy(all, samples, sizeof all);
        size_t left = bst_io_thin_samples(samples, count), k = 0;
        assert_true(left <= count / 2 + 2);
        for (size_t i = 0; i < count; i += 4) {
            double low = NAN, high = NAN, kept_low = NAN, kept_high = NAN;
            for (size_t j = i; j < i + 4 && j < count; j++) {
                low = fmin(low, all[j].value);
                high = fmax(high, all[j].value);
            }
            double end = i + 4 < count ? all[i + 4].time_s : INFINITY;
            for (int n = 0;
                 n < 2 && k < left && samples[k].time_s <= end && (n == 0 || low != high);
                 n++, k++) {
                kept_low = fmin(kept_low, samples[k].value);
                kept_high = fmax(kept_high, samples[k].value);
                if (isnan(low)) {
                    n = 2; /* four gaps are one gap */
                }
            }
            assert_true(kept_low == low || (isnan(low) && isnan(kept_low)));
            assert_true(kept_high == high || (isnan(high) && isnan(kept_high)));
        }
        assert_int_equal(k, left);
        for (size_t i = 1; i < left; i++) {
            assert_true(samples[i - 1].time_s <= samples[i].time_s);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_brute_force),
        cmocka_unit_test(test_no_samples),
        cmocka_unit_test(test_sort),
        cmocka_unit_test(test_thin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
