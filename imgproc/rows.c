#include "imgproc/rows.h"

#include <math.h>

#include "imgproc/background.h"

/* Several instruction sets by the loader's choice. Contraction is off for the whole project, so
 * the clones round alike. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ROW_FUNCTION __attribute__((target_clones("default", "avx2")))
#else
#define ROW_FUNCTION
#endif

ROW_FUNCTION
void bst_row_clipped_sums(const float *restrict row, int count, float level, float limit,
                          bst_row_sums *restrict sums) {
    float n[BST_ROW_LANES], s[BST_ROW_LANES], q[BST_ROW_LANES];
    for (int j = 0; j < BST_ROW_LANES; j++) {
        n[j] = sums->count[j];
        s[j] = sums->sum[j];
        q[j] = sums->square[j];
    }
    int x = 0;
    for (; x + BST_ROW_LANES <= count; x += BST_ROW_LANES) {
        for (int j = 0; j < BST_ROW_LANES; j++) {
            float d = row[x + j] - level;
            float inside = fabsf(d) <= limit ? 1.0f : 0.0f;
            float kept = fabsf(d) <= limit ? d : 0.0f;
            n[j] += inside;
            s[j] += kept;
            q[j] += kept * kept;
        }
    }
    for (int j = 0; x < count; x++, j++) {
        float d = row[x] - level;
        if (fabsf(d) <= limit) {
            n[j] += 1.0f;
            s[j] += d;
            q[j] += d * d;
        }
    }
    for (int j = 0; j < BST_ROW_LANES; j++) {
        sums->count[j] = n[j];
        sums->sum[j] = s[j];
        sums->square[j] = q[j];
    }
}

ROW_FUNCTION
void bst_row_electrons(const uint16_t *restrict raw, int count, float offset, float gain,
                       float *restrict out) {
    for (int x = 0; x < count; x++) {
        out[x] = ((float)raw[x] - offset) * gain;
    }
}

ROW_FUNCTION
void bst_row_normalise(const uint16_t *restrict raw, const float *electrons,
                       const float *restrict level, const float *restrict inverse_noise, int count,
                       int saturated_dn, float *signal, float *restrict normalised) {
    for (int x = 0; x < count; x++) {
        float value = electrons[x];
        float difference = value - level[x];
        float n = difference * inverse_noise[x];
        normalised[x] = value > BST_PIXEL_NONE ? n : 0.0f;
        float kept = value > BST_PIXEL_NONE ? difference : BST_PIXEL_BAD;
        signal[x] = raw[x] >= saturated_dn && value > BST_PIXEL_NONE ? BST_PIXEL_SATURATED : kept;
    }
}

ROW_FUNCTION
void bst_row_combine(float *restrict out, int count, const float *const *in, const float *weight,
                     int taps) {
    for (int t = 0; t < taps; t += 4) {
        const float *restrict a = in[t], *restrict b = in[t + 1], *restrict c = in[t + 2],
                              *restrict d = in[t + 3];
        float wa = weight[t], wb = weight[t + 1], wc = weight[t + 2], wd = weight[t + 3];
        if (t == 0) {
            for (int x = 0; x < count; x++) {
                out[x] = (wa * a[x] + wb * b[x]) + (wc * c[x] + wd * d[x]);
            }
        } else {
            for (int x = 0; x < count; x++) {
                out[x] += (wa * a[x] + wb * b[x]) + (wc * c[x] + wd * d[x]);
            }
        }
    }
}

ROW_FUNCTION
bool bst_row_best(const float *restrict a, const float *restrict b, int count, float threshold,
                  float *restrict best, uint8_t *restrict mask) {
    uint8_t any = 0;
    for (int x = 0; x < count; x++) {
        float m = a[x] > b[x] ? a[x] : b[x];
        best[x] = m;
        mask[x] = m > threshold ? 255 : 0;
        any |= mask[x];
    }
    return any != 0;
}

ROW_FUNCTION
void bst_row_scale(float *restrict out, const float *restrict by, float factor, int count) {
    for (int x = 0; x < count; x++) {
        out[x] *= by[x] * factor;
    }
}
