#include "sim/io/decimate.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

static int compare_times(const void *a, const void *b) {
    const bst_io_sample *left = a, *right = b;
    return left->time_s < right->time_s ? -1 : left->time_s > right->time_s;
}

void bst_io_sort_samples(bst_io_sample *samples, size_t count) {
    bool rising = true;
    for (size_t i = 1; i < count && rising; i++) {
        rising = samples[i - 1].time_s <= samples[i].time_s;
    }
    if (!rising) {
        qsort(samples, count, sizeof *samples, compare_times);
    }
}

/* Index of the first sample at or after a time. */
static size_t first_from(const bst_io_sample *samples, size_t count, double time_s) {
    size_t low = 0, high = count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (samples[middle].time_s < time_s) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

static bst_io_extent extent_of(const bst_io_sample *sample) {
    return (bst_io_extent){sample->time_s, sample->value, sample->value};
}

/* Extents of the samples first to end - 1, one for each column that has any. */
static size_t fill_columns(const bst_io_sample *samples, size_t first, size_t end, double from_s,
                           double column_s, int columns, bst_io_extent *out) {
    size_t n = 0;
    int current = -1;
    for (size_t i = first; i < end; i++) {
        int column = (int)fmin((samples[i].time_s - from_s) / column_s, columns - 1);
        if (column != current) {
            current = column;
            out[n++] = (bst_io_extent){from_s + (column + 0.5) * column_s, NAN, NAN};
        }
        out[n - 1].low = fmin(out[n - 1].low, samples[i].value);
        out[n - 1].high = fmax(out[n - 1].high, samples[i].value);
    }
    return n;
}

size_t bst_io_decimate(const bst_io_sample *samples, size_t count, double from_s, double to_s,
                       int columns, bst_io_extent *out) {
    assert(from_s < to_s && columns >= 1);
    size_t first = first_from(samples, count, from_s), end = first, n = 0;
    end = first_from(samples, count, to_s);
    while (end < count && samples[end].time_s <= to_s) {
        end++;
    }
    if (first > 0) {
        out[n++] = extent_of(&samples[first - 1]);
    }
    if (end - first <= (size_t)columns) {
        for (size_t i = first; i < end; i++) {
            out[n++] = extent_of(&samples[i]);
        }
    } else {
        n += fill_columns(samples, first, end, from_s, (to_s - from_s) / columns, columns, out + n);
    }
    if (end < count) {
        out[n++] = extent_of(&samples[end]);
    }
    return n;
}

size_t bst_io_thin_samples(bst_io_sample *samples, size_t count) {
    size_t n = 0;
    for (size_t i = 0; i < count; i += 4) {
        size_t end = i + 4 < count ? i + 4 : count, low = i, high = i;
        for (size_t k = i; k < end; k++) {
            if (!(samples[k].value >= samples[low].value)) {
                low = isnan(samples[k].value) ? low : k;
            }
            if (!(samples[k].value <= samples[high].value)) {
                high = isnan(samples[k].value) ? high : k;
            }
        }
        bst_io_sample a = samples[low < high ? low : high], b = samples[low < high ? high : low];
        samples[n++] = a;
        if (low != high) {
            samples[n++] = b;
        }
    }
    return n;
}
