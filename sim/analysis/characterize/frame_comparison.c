#include "sim/analysis/characterize/frame_comparison.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"

static const double CLIP = 5.0;

double bst_comparison_frequency(int band) {
    return 0.5 * band / (BST_COMPARISON_BANDS - 1);
}

/* Percentiles of the values that are no NAN; the values are sorted. Returns the number of them. */
static size_t find_percentiles(float *values, size_t count, bst_frame_statistics *out) {
    size_t n = 0;
    for (size_t i = 0; i < count; i++) {
        if (!isnan(values[i])) {
            values[n++] = values[i];
        }
    }
    bst_sort_floats(values, n);
    out->median_dn = bst_sorted_median(values, n);
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        double at = bst_sensor_percentiles[i] / 100.0 * ((double)n - 1.0) + 0.5;
        out->percentiles_dn[i] = n > 0 ? (double)values[(size_t)at] - out->median_dn : NAN;
    }
    return n;
}

/* Subtracts the line through the means of the rows, limits outliers, sets NAN to 0. */
static double flatten(float *d, int width, int height, const bst_clipped_moments *core) {
    double sy = 0.0, sm = 0.0, sym = 0.0, syy = 0.0, n = 0.0, sum2 = 0.0;
    for (int y = 0; y < height; y++) {
        double mean = 0.0, count = 0.0;
        for (int x = 0; x < width; x++) {
            float *v = &d[(size_t)y * (size_t)width + (size_t)x];
            *v = isnan(*v) ? *v : (float)fmin(fmax((double)*v, core->low), core->high);
            mean += isnan(*v) ? 0.0 : (double)*v;
            count += !isnan(*v);
        }
        if (count > 0.0) {
            mean /= count;
            n++;
            sy += y;
            sm += mean;
            syy += (double)y * y;
            sym += y * mean;
        }
    }
    double slope = (n * sym - sy * sm) / (n * syy - sy * sy), level = (sm - slope * sy) / n;
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        int y = (int)(i / (size_t)width);
        d[i] = isnan(d[i]) ? 0.0F : (float)((double)d[i] - level - slope * y);
        sum2 += (double)d[i] * (double)d[i];
    }
    return sum2;
}

bst_status bst_frame_statistics_of(bst_ctx *ctx, const float *image, int width, int height,
                                   bst_frame_statistics *out) {
    assert(image && out && width > BST_COMPARISON_LAGS && height > BST_COMPARISON_LAGS);
    size_t pixels = (size_t)width * (size_t)height;
    float *d = malloc(pixels * sizeof *d);
    if (!d) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    memcpy(d, image, pixels * sizeof *d);
    size_t n = find_percentiles(d, pixels, out);
    bst_clipped_moments core = bst_clipped_moments_of(d, n, CLIP);
    memcpy(d, image, pixels * sizeof *d);
    double variance = flatten(d, width, height, &core) / (double)pixels;
    for (int lag = 1; lag <= BST_COMPARISON_LAGS; lag++) {
        double rows = 0.0, columns = 0.0;
        size_t w = (size_t)width, step = (size_t)lag;
        for (size_t y = 0; y < (size_t)height; y++) {
            const float *row = d + y * w;
            double sum = 0.0, down = 0.0;
            for (size_t x = step; x < w; x++) {
                sum += (double)(row[x] * row[x - step]);
            }
            for (size_t x = 0; x < w && y >= step; x++) {
                down += (double)(row[x] * row[x - step * w]);
            }
            rows += sum;
            columns += down;
        }
        out->along_rows[lag - 1] = rows / ((double)(width - lag) * height) / variance;
        out->along_columns[lag - 1] = columns / ((double)width * (height - lag)) / variance;
    }
    for (int k = 0; k < BST_COMPARISON_BANDS; k++) {
        double sum = 1.0;
        for (int lag = 1; lag <= BST_COMPARISON_LAGS; lag++) {
            double u = lag / (BST_COMPARISON_LAGS + 1.0);
            double window = u < 0.5 ? 1.0 - 6.0 * u * u * (1.0 - u) : 2.0 * pow(1.0 - u, 3.0);
            double turn = 2.0 * BST_PI * bst_comparison_frequency(k) * lag;
            sum += 2.0 * window * out->along_rows[lag - 1] * cos(turn);
        }
        out->spectrum[k] = sum * variance;
    }
    free(d);
    return BST_OK;
}
