/* The inner loops over image rows. Each element is computed by the same operations in the same
 * order on every processor, so results do not depend on the instruction set that the loader picks.
 */
#ifndef BST_IMGPROC_DETECT_ROW_KERNELS_H
#define BST_IMGPROC_DETECT_ROW_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { BST_ROW_LANES = 16, BST_ROW_MEDIAN = 96 };

/* Sums in separate lanes, added by the caller in lane order. */
typedef struct bst_row_sums {
    float count[BST_ROW_LANES], sum[BST_ROW_LANES], square[BST_ROW_LANES];
} bst_row_sums;

/* Adds count, sum and sum of squares of (value - level) where |value - level| <= limit, over rows
 * that lie `stride` floats apart. */
void bst_row_clipped_sums(const float *pixels, int width, int height, size_t stride, float level,
                          float limit, bst_row_sums *sums);

/* How many are measurements (not below BST_PIXEL_NONE). */
int bst_row_good(const float *pixels, int count);

/* The value at count / 2 of up to BST_ROW_MEDIAN in ascending order, to 1/256 of itself. */
float bst_row_median(const float *values, int count);

/* out[x] = left + slope * (x + first) */
void bst_row_line(float *out, int count, float left, float slope, float first);

/* Says that a part of a row will be read soon. */
static inline void bst_row_prefetch(const uint16_t *raw, int count) {
    for (int x = 0; x < count; x += 32) {
        __builtin_prefetch(raw + x);
    }
}

/* out = (raw - offset) * gain */
void bst_row_electrons(const uint16_t *raw, int count, float offset, float gain, float *out);

/* A part of an image row, up to column `end`, on which level and 1 / noise are straight lines by
 * column. */
typedef struct bst_row_part {
    int end;
    float level, level_slope, inverse, inverse_slope;
} bst_row_part;

/* Electrons of a digital number: (it - offset) gain. */
typedef struct bst_row_gain {
    float offset, gain;
} bst_row_gain;

/* A row of electrons: of `raw` by their gain, or as given where that is NULL. */
typedef struct bst_row_input {
    const uint16_t *raw;
    const bst_row_gain *gain;
    const float *electrons;
    int saturated_dn; /* raw from which a pixel does not measure */
} bst_row_input;

/* Takes the level off a row: signal = electrons - level, but BST_PIXEL_SATURATED where raw >=
 * saturated_dn; normalised = signal / noise (saturated pixels with their value), 0 where a pixel is
 * bad. The first of the `count` parts begins at column 0. The rows may not overlap. */
void bst_row_normalise(const bst_row_input *row, const bst_row_part *parts, int count,
                       float *signal, float *normalised);

/* out[x] = weight[0] * in[0][x] + sum of weight[t] * (in[-t][x] + in[t][x]), t from 1 to radius */
void bst_row_even(float *out, int count, const float *const *in, const float *weight, int radius);

/* The same for four rows of `out`, `stride` floats apart: row k about in[k]. */
void bst_row_even_4(float *out, size_t stride, int count, const float *const *in,
                    const float *weight, int radius);

/* out[x] = sum over taps of weight[t] * in[t][x] */
void bst_row_combine(float *out, int count, const float *const *in, const float *weight, int taps);

/* out[x] = the greater of floor[x] and the sum over taps of weight[t] * in[t][x]. The same goes to
 * `copy`, which is not wanted soon, unless that is NULL. */
void bst_row_streak(float *out, float *copy, int count, const float *const *in, const float *weight,
                    int taps, const float *floor);

/* Writes the places and values of the elements above the threshold (> 0) that exceed their eight
 * neighbours (of equals the first in row-major order); returns how many. On
 * either side of each row 2 BST_ROW_LANES more floats are read; those next to it must not exceed
 * the threshold. */
int bst_row_maxima(const float *above, const float *row, const float *below, int count,
                   float threshold, int32_t *x, float *value);

/* Half width of the neighbourhood of bst_row_mask. */
enum { BST_ROW_NEAR = 2 };

/* Sets out[x] to BST_PIXEL_BAD where a neighbour exceeds a limit.
 *
 * Given:     rows   [2 BST_ROW_NEAR + 1] rows; BST_ROW_NEAR more floats are read on either side
 *            count  elements of out
 *            out    [count]; elements not set are unchanged */
void bst_row_mask(const float *const *rows, int count, float limit, float *out);

/* out *= by */
void bst_row_scale(float *out, const float *by, float factor, int count);

#endif
