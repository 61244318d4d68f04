/* Inner loops over image rows for background and matched filter. Each element is computed by the
 * same operations in the same order on every processor. Results therefore do not depend on the
 * instruction set chosen at load time. */
#ifndef BST_IMGPROC_DETECT_ROW_KERNELS_H
#define BST_IMGPROC_DETECT_ROW_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { BST_ROW_LANES = 16, BST_ROW_MEDIAN = 96 };

/* Sums in separate SIMD lanes; the caller adds them in lane order. */
typedef struct bst_row_sums {
    float count[BST_ROW_LANES], sum[BST_ROW_LANES], square[BST_ROW_LANES];
} bst_row_sums;

/* Sums for sigma clipping: count, sum and sum of squares of (value - level) where |value - level|
 * <= limit.
 *
 * Given:     stride  distance of rows, floats */
void bst_row_clipped_sums(const float *pixels, int width, int height, size_t stride, float level,
                          float limit, bst_row_sums *sums);

/* Number of pixels that are measurements (not below BST_PIXEL_NONE). */
int bst_row_good(const float *pixels, int count);

/* Median of up to BST_ROW_MEDIAN values (the value of rank count / 2), to 1/256 of itself. */
float bst_row_median(const float *values, int count);

/* Linear ramp: out[x] = left + slope * (x + first). */
void bst_row_line(float *out, int count, float left, float slope, float first);

/* Prefetches part of a row of digital numbers. */
static inline void bst_row_prefetch(const uint16_t *raw, int count) {
    for (int x = 0; x < count; x += 32) {
        __builtin_prefetch(raw + x);
    }
}

/* Converts digital numbers to electrons: out = (raw - offset) * gain. */
void bst_row_electrons(const uint16_t *raw, int count, float offset, float gain, float *out);

/* Segment of an image row, up to column `end`, on which background level and 1 / noise are linear.
 */
typedef struct bst_row_part {
    int end;
    float level, level_slope, inverse, inverse_slope;
} bst_row_part;

/* Conversion of digital numbers to electrons: (raw - offset) * gain. */
typedef struct bst_row_gain {
    float offset, gain;
} bst_row_gain;

/* Input row: electrons if raw is NULL, else digital numbers with their gain. */
typedef struct bst_row_input {
    const uint16_t *raw;
    const bst_row_gain *gain;
    const float *electrons;
    int saturated_dn; /* digital number from which a pixel is saturated */
} bst_row_input;

/* Subtracts the background from a row and divides by its noise.
 *
 * Given:     parts  [count] segments of the background, the first from column 0 on
 * Returned:  signal      electrons above the background; BST_PIXEL_SATURATED where raw >=
 *                        saturated_dn
 *            normalised  signal / noise, saturated pixels with their value; 0 where a pixel is bad
 * Notes:     The rows may not overlap. */
void bst_row_normalise(const bst_row_input *row, const bst_row_part *parts, int count,
                       float *signal, float *normalised);

/* Symmetric FIR filter: out[x] = weight[0] * in[0][x] + sum of weight[t] * (in[-t][x] + in[t][x]),
 * t from 1 to radius. */
void bst_row_even(float *out, int count, const float *const *in, const float *weight, int radius);

/* bst_row_even for four rows of `out`, `stride` floats apart: row k uses in[k] as its centre. */
void bst_row_even_4(float *out, size_t stride, int count, const float *const *in,
                    const float *weight, int radius);

/* Weighted sum of rows: out[x] = sum over taps of weight[t] * in[t][x]. */
void bst_row_combine(float *out, int count, const float *const *in, const float *weight, int taps);

/* Streak filter: out[x] is the larger of floor[x] and the sum over taps of weight[t] * in[t][x].
 *
 * Returned:  copy  the same values, written past the cache; NULL: not wanted */
void bst_row_streak(float *out, float *copy, int count, const float *const *in, const float *weight,
                    int taps, const float *floor);

/* Finds the local maxima of a row above the threshold (> 0): elements that exceed their eight
 * neighbours; of equal ones the first in row-major order.
 *
 * Given:     above, row, below  2 BST_ROW_LANES more floats are read on either side; the adjacent
 *                               ones must not exceed the threshold
 * Returned:  number of maxima, with their columns and values */
int bst_row_maxima(const float *above, const float *row, const float *below, int count,
                   float threshold, int32_t *x, float *value);

/* Half width of the neighbourhood of bst_row_mask. */
enum { BST_ROW_NEAR = 2 };

/* Masks neighbours of bright pixels: sets out[x] to BST_PIXEL_BAD where a neighbour exceeds a
 * limit.
 *
 * Given:     rows   [2 BST_ROW_NEAR + 1] rows; BST_ROW_NEAR more floats are read on either side
 *            count  elements of out
 *            out    [count]; elements not set are unchanged */
void bst_row_mask(const float *const *rows, int count, float limit, float *out);

/* Scales a row: out *= factor * by. */
void bst_row_scale(float *out, const float *by, float factor, int count);

#endif
