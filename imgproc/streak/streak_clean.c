/* What is done to a frame before its streaks are sought. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "imgproc/streak/common_streak_internal.h"
#include "sim/core/simd.h"

/* Columns whose medians are taken together. */
enum { COLUMNS = 16 };
/* Side of the cells of an uneven background, px. */
enum { CELL = 32 };

/* A background is uneven if the levels of its cells differ by more than this; others stay as they
 * are. Not calibrated: a frame with a glow of 200 sigma is solved without this, one of 1000 is not
 * (docs/results/twin.md). */
static const double UNEVEN_SIGMA = 50.0;
/* Negative pixels below this are bad, sigma. */
static const float LEAST_SIGMA = -5.0f;
/* A pixel above HOT_SIGMA is bad if its neighbours, less their noise, are below this share of it.
 */
static const float HOT_SIGMA = 8.0f, HOT_SHARE = 0.2f, NEIGHBOUR_SIGMA = 2.0f;

typedef bst_streak_finder finder;

/* Keys of values, in the same order; of what is not a number, the greatest. Returns the number of
 * the others. */
BST_CLONES
static int make_keys(const float *restrict values, int count, int32_t *restrict keys) {
    int valid = 0;
    for (int i = 0; i < count; i++) {
        int32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        int32_t key = bits < 0 ? bits ^ INT32_MAX : bits;
        bool number = values[i] == values[i];
        keys[i] = number ? key : INT32_MAX;
        valid += number;
    }
    return valid;
}

BST_CLONES
static int count_up_to(const int32_t *keys, int count, int32_t limit) {
    int sum = 0;
    for (int i = 0; i < count; i++) {
        sum += keys[i] <= limit;
    }
    return sum;
}

/* The value that would be at place k of ascending keys: by halving, as counting needs no branches.
 */
static float value_of_rank(const int32_t *keys, int count, int k) {
    int64_t low = INT32_MIN, high = INT32_MAX;
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        if (count_up_to(keys, count, (int32_t)middle) > k) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    const int32_t bits = low < 0 ? (int32_t)low ^ INT32_MAX : (int32_t)low;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Median of the values that are not NAN; 0: none is. */
static float median(finder *f, const float *values, int count) {
    const int valid = make_keys(values, count, f->label);
    return valid > 0 ? value_of_rank(f->label, count, valid / 2) : 0.0f;
}

/* Noise of the image, by the median of its absolute values. */
static double noise_of(finder *f) {
    const size_t pixels = (size_t)f->width * (size_t)f->height;
    for (size_t i = 0; i < pixels; i++) {
        f->scratch[i] = fabsf(f->image[i]);
    }
    return fmax(1.4826 * (double)median(f, f->scratch, (int)pixels), 1e-9);
}

/* Level and noise of a cell; the noise by what lies below the level, where no stars are. */
static void measure_cell(finder *f, int cx, int cy, float out[2]) {
    int count = 0, valid;
    for (int y = cy * CELL; y < (cy + 1) * CELL && y < f->height; y++) {
        for (int x = cx * CELL; x < (cx + 1) * CELL && x < f->width; x++) {
            f->scratch[count++] = f->image[(size_t)y * (size_t)f->width + (size_t)x];
        }
    }
    valid = make_keys(f->scratch, count, f->label);
    out[0] = valid > 0 ? value_of_rank(f->label, count, valid / 2) : 0.0f;
    out[1] = valid > 0 ? (out[0] - value_of_rank(f->label, count, valid / 4)) / 0.6745f : 0.0f;
}

/* Removes a very uneven background, as of the Earth's limb or a ghost: levels of cells, between
 * whose middles it is bilinear. Noise that is greater there is reduced to the frame's. True if the
 * background was so. */
static bool flatten(finder *f) {
    const int nx = (f->width + CELL - 1) / CELL, ny = (f->height + CELL - 1) / CELL;
    float low = HUGE_VALF, high = -HUGE_VALF;
    float(*cells)[2] = (float(*)[2])f->lines; /* not in use yet; a cell has 32 x 32 px */
    if ((size_t)nx * (size_t)ny * 2 > (size_t)f->width * (size_t)f->height) {
        return false;
    }
    for (int i = 0; i < nx * ny; i++) {
        measure_cell(f, i % nx, i / nx, cells[i]);
        low = fminf(low, cells[i][0]);
        high = fmaxf(high, cells[i][0]);
    }
    for (int i = 0; i < nx * ny; i++) {
        f->scratch[i] = cells[i][1];
    }
    const float usual = fmaxf(median(f, f->scratch, nx * ny), 1e-9f);
    if (!((double)(high - low) > UNEVEN_SIGMA * (double)usual)) {
        return false;
    }
    for (int y = 0; y < f->height; y++) {
        float v = fmaxf(((float)y + 0.5f) / CELL - 0.5f, 0.0f);
        int j = (int)v, j1 = j + 1 < ny ? j + 1 : j;
        for (int x = 0; x < f->width; x++) {
            float u = fmaxf(((float)x + 0.5f) / CELL - 0.5f, 0.0f), value[2];
            int i = (int)u, i1 = i + 1 < nx ? i + 1 : i;
            for (int k = 0; k < 2; k++) {
                float top = cells[j * nx + i][k] +
                            (u - (float)i) * (cells[j * nx + i1][k] - cells[j * nx + i][k]);
                float bottom = cells[j1 * nx + i][k] +
                               (u - (float)i) * (cells[j1 * nx + i1][k] - cells[j1 * nx + i][k]);
                value[k] = top + (v - (float)j) * (bottom - top);
            }
            float *at = &f->image[(size_t)y * (size_t)f->width + (size_t)x];
            *at = (*at - value[0]) / fmaxf(value[1] / usual, 1.0f);
        }
    }
    return true;
}

/* Removes the medians of columns and rows and divides by the noise. */
static void remove_background(finder *f) {
    const int w = f->width, h = f->height;
    float *scratch = f->scratch;
    for (int x0 = 0; x0 < w; x0 += COLUMNS) {
        const int columns = x0 + COLUMNS < w ? COLUMNS : w - x0;
        float level[COLUMNS];
        for (int y = 0; y < h; y++) { /* a cache line of each row */
            for (int x = 0; x < columns; x++) {
                scratch[x * h + y] = f->image[(size_t)y * (size_t)w + (size_t)(x0 + x)];
            }
        }
        for (int x = 0; x < columns; x++) {
            level[x] = median(f, &scratch[x * h], h);
        }
        for (int y = 0; y < h; y++) {
            for (int x = 0; x < columns; x++) {
                f->image[(size_t)y * (size_t)w + (size_t)(x0 + x)] -= level[x];
            }
        }
    }
    for (int y = 0; y < h; y++) {
        float *row = &f->image[(size_t)y * (size_t)w];
        float level = median(f, row, w);
        for (int x = 0; x < w; x++) {
            row[x] -= level;
        }
    }
    const size_t pixels = (size_t)w * (size_t)h;
    f->sigma = noise_of(f);
    if (flatten(f)) {
        f->sigma = noise_of(f);
    }
    for (size_t i = 0; i < pixels; i++) {
        float v = f->image[i] / (float)f->sigma;
        f->image[i] = isnan(v) ? 0.0f : v < LEAST_SIGMA ? LEAST_SIGMA : v;
    }
}

/* Clears pixels that stand out from all their neighbours: no PSF is as narrow. */
static void remove_hot_pixels(finder *f) {
    const int w = f->width;
    for (int y = 1; y < f->height - 1; y++) {
        for (int x = 1; x < w - 1; x++) {
            float *at = &f->image[y * w + x], most = LEAST_SIGMA;
            if (*at < HOT_SIGMA) {
                continue;
            }
            for (int k = 0; k < 9; k++) {
                float v = at[(k / 3 - 1) * w + k % 3 - 1];
                most = k != 4 && v > most ? v : most;
            }
            *at = most - NEIGHBOUR_SIGMA < HOT_SHARE * *at ? 0.0f : *at;
        }
    }
}

void bst_streak_finder_clean(finder *f) {
    remove_background(f);
    remove_hot_pixels(f);
}
