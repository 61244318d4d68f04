/* The inner loops over image rows. Each element is computed by the same operations in the same
 * order on every processor, so results do not depend on the instruction set that the loader picks.
 */
#ifndef BST_IMGPROC_ROWS_H
#define BST_IMGPROC_ROWS_H

#include <stdbool.h>
#include <stdint.h>

enum { BST_ROW_LANES = 16 };

/* Sums in separate lanes, added by the caller in lane order. */
typedef struct bst_row_sums {
    float count[BST_ROW_LANES], sum[BST_ROW_LANES], square[BST_ROW_LANES];
} bst_row_sums;

/* Adds count, sum and sum of squares of (value - level) where |value - level| <= limit. */
void bst_row_clipped_sums(const float *row, int count, float level, float limit,
                          bst_row_sums *sums);

/* out = (raw - offset) * gain */
void bst_row_electrons(const uint16_t *raw, int count, float offset, float gain, float *out);

/* Splits a row of electrons: signal = electrons - level, but BST_PIXEL_SATURATED where raw >=
 * saturated_dn; normalised = signal * inverse_noise (saturated pixels with their value), 0 where a
 * pixel is bad. In place allowed for electrons and signal. */
void bst_row_normalise(const uint16_t *raw, const float *electrons, const float *level,
                       const float *inverse_noise, int count, int saturated_dn, float *signal,
                       float *normalised);

/* out[x] = sum over taps of weight[t] * in[t][x]; taps is a multiple of 4. */
void bst_row_combine(float *out, int count, const float *const *in, const float *weight, int taps);

/* a = max(a, b) */
void bst_row_greater(float *a, const float *b, int count);

/* Writes the places and values of the elements above the threshold that exceed their eight
 * neighbours (of equals the first in row-major order); returns how many. above and below may be
 * NULL. */
int bst_row_maxima(const float *above, const float *row, const float *below, int count,
                   float threshold, int32_t *x, float *value);

/* out *= by */
void bst_row_scale(float *out, const float *by, float factor, int count);

#endif
