#include "imgproc/rows.h"

#include <math.h>
#include <string.h>

#include "imgproc/background.h"

/* Several instruction sets by the loader's choice. Contraction is off for the whole project, so
 * the clones round alike. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ROW_FUNCTION __attribute__((target_clones("default", "avx2", "avx512f")))
/* for comparisons that are kept as numbers, which 512-bit registers are slow at */
#define MASK_FUNCTION __attribute__((target_clones("default", "avx2")))
#else
#define ROW_FUNCTION
#define MASK_FUNCTION
#endif

/* Half of the lanes as one value, so that they stay in registers. */
enum { HALF = BST_ROW_LANES / 2, MEDIAN_PARTS = BST_ROW_MEDIAN / HALF };
typedef float lanes __attribute__((vector_size(HALF * sizeof(float))));
typedef int32_t lane_masks __attribute__((vector_size(HALF * sizeof(float))));

MASK_FUNCTION
void bst_row_clipped_sums(const float *restrict pixels, int width, int height, size_t stride,
                          float level, float limit, bst_row_sums *restrict sums) {
    lane_masks n0 = {0}, n1 = {0};
    lanes s0, s1, q0, q1, d0, d1;
    memcpy(&s0, sums->sum, sizeof s0);
    memcpy(&s1, sums->sum + HALF, sizeof s1);
    memcpy(&q0, sums->square, sizeof q0);
    memcpy(&q1, sums->square + HALF, sizeof q1);
    int whole = width / BST_ROW_LANES * BST_ROW_LANES;
    for (int y = 0; y < height; y++) {
        const float *row = pixels + (size_t)y * stride;
        for (int x = 0; x < whole; x += BST_ROW_LANES) {
            memcpy(&d0, row + x, sizeof d0);
            memcpy(&d1, row + x + HALF, sizeof d1);
            d0 -= level;
            d1 -= level;
            lane_masks in0 = (d0 <= limit) & (d0 >= -limit), in1 = (d1 <= limit) & (d1 >= -limit);
            n0 -= in0;
            n1 -= in1;
            d0 = (lanes)((lane_masks)d0 & in0);
            d1 = (lanes)((lane_masks)d1 & in1);
            s0 += d0;
            s1 += d1;
            q0 += d0 * d0;
            q1 += d1 * d1;
        }
    }
    memcpy(sums->sum, &s0, sizeof s0);
    memcpy(sums->sum + HALF, &s1, sizeof s1);
    memcpy(sums->square, &q0, sizeof q0);
    memcpy(sums->square + HALF, &q1, sizeof q1);
    for (int j = 0; j < HALF; j++) {
        sums->count[j] += (float)n0[j];
        sums->count[j + HALF] += (float)n1[j];
    }
    for (int y = 0; y < height && whole < width; y++) {
        const float *row = pixels + (size_t)y * stride + whole;
        for (int j = 0; j < width - whole; j++) {
            float rest = row[j] - level;
            if (fabsf(rest) <= limit) {
                sums->count[j] += 1.0f;
                sums->sum[j] += rest;
                sums->square[j] += rest * rest;
            }
        }
    }
}

/* By rank, without branches: the greatest that no more than half of them are below. */
MASK_FUNCTION
float bst_row_median(const float *values, int count) {
    float v[BST_ROW_MEDIAN];
    lanes part[MEDIAN_PARTS];
    lane_masks below[MEDIAN_PARTS] = {{0}};
    for (int i = 0; i < BST_ROW_MEDIAN; i++) {
        v[i] = i < count ? values[i] : INFINITY;
    }
    memcpy(part, v, sizeof part);
    for (int i = 0; i < count; i++) {
        for (int b = 0; b < MEDIAN_PARTS; b++) {
            below[b] -= v[i] < part[b];
        }
    }
    int32_t rank[BST_ROW_MEDIAN];
    memcpy(rank, below, sizeof rank);
    float median = -INFINITY;
    for (int i = 0; i < count; i++) {
        median = rank[i] <= count / 2 && v[i] > median ? v[i] : median;
    }
    return median;
}

ROW_FUNCTION
void bst_row_line(float *restrict out, int count, float left, float slope, float first) {
    for (int x = 0; x < count; x++) {
        out[x] = left + slope * ((float)x + first);
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
void bst_row_even(float *restrict out, int count, const float *const *in, const float *weight,
                  int radius) {
    const float *restrict m = in[0];
    int t = 1;
    if (radius >= 3) {
        const float *restrict a = in[-3], *restrict b = in[-2], *restrict c = in[-1],
                              *restrict e = in[1], *restrict f = in[2], *restrict g = in[3];
        float w0 = weight[0], w1 = weight[1], w2 = weight[2], w3 = weight[3];
        for (int x = 0; x < count; x++) {
            out[x] = (w0 * m[x] + w1 * (c[x] + e[x])) + (w2 * (b[x] + f[x]) + w3 * (a[x] + g[x]));
        }
        t = 4;
    } else {
        for (int x = 0; x < count; x++) {
            out[x] = weight[0] * m[x];
        }
    }
    for (; t <= radius; t++) {
        const float *restrict a = in[-t], *restrict b = in[t];
        float w = weight[t];
        for (int x = 0; x < count; x++) {
            out[x] += w * (a[x] + b[x]);
        }
    }
}

ROW_FUNCTION
void bst_row_combine(float *restrict out, int count, const float *const *in, const float *weight,
                     int taps) {
    int t = 0;
    if (taps >= 8) {
        const float *restrict a = in[0], *restrict b = in[1], *restrict c = in[2],
                              *restrict d = in[3], *restrict e = in[4], *restrict f = in[5],
                              *restrict g = in[6], *restrict h = in[7];
        float wa = weight[0], wb = weight[1], wc = weight[2], wd = weight[3], we = weight[4],
              wf = weight[5], wg = weight[6], wh = weight[7];
        for (int x = 0; x < count; x++) {
            out[x] = ((wa * a[x] + wb * b[x]) + (wc * c[x] + wd * d[x])) +
                     ((we * e[x] + wf * f[x]) + (wg * g[x] + wh * h[x]));
        }
        t = 8;
    } else {
        memset(out, 0, (size_t)count * sizeof *out);
    }
    for (; t + 8 <= taps; t += 8) {
        const float *restrict a = in[t], *restrict b = in[t + 1], *restrict c = in[t + 2],
                              *restrict d = in[t + 3], *restrict e = in[t + 4],
                              *restrict f = in[t + 5], *restrict g = in[t + 6],
                              *restrict h = in[t + 7];
        float wa = weight[t], wb = weight[t + 1], wc = weight[t + 2], wd = weight[t + 3],
              we = weight[t + 4], wf = weight[t + 5], wg = weight[t + 6], wh = weight[t + 7];
        for (int x = 0; x < count; x++) {
            out[x] += ((wa * a[x] + wb * b[x]) + (wc * c[x] + wd * d[x])) +
                      ((we * e[x] + wf * f[x]) + (wg * g[x] + wh * h[x]));
        }
    }
    for (; t < taps; t += 4) {
        const float *restrict a = in[t], *restrict b = in[t + 1], *restrict c = in[t + 2],
                              *restrict d = in[t + 3];
        float wa = weight[t], wb = weight[t + 1], wc = weight[t + 2], wd = weight[t + 3];
        for (int x = 0; x < count; x++) {
            out[x] += (wa * a[x] + wb * b[x]) + (wc * c[x] + wd * d[x]);
        }
    }
}

ROW_FUNCTION
void bst_row_greater(float *restrict a, const float *restrict b, int count) {
    for (int x = 0; x < count; x++) {
        a[x] = a[x] > b[x] ? a[x] : b[x];
    }
}

/* Whether any of the lanes is set. */
static inline bool any(const lane_masks *m) {
    uint64_t part[HALF / 2];
    memcpy(part, m, sizeof part);
    return ((part[0] | part[1]) | (part[2] | part[3])) != 0;
}

static inline void take(lanes *out, const float *from) {
    memcpy(out, from, sizeof *out);
}

MASK_FUNCTION
int bst_row_maxima(const float *above, const float *row, const float *below, int count,
                   float threshold, int32_t *x, float *value) {
    enum { STEP = 4 * HALF };
    int found = 0;
    for (int at = 0; at < count; at += HALF) {
        lanes v, n[8];
        if (at % STEP == 0) {
            lanes v1, v2, v3;
            take(&v, row + at);
            take(&v1, row + at + HALF);
            take(&v2, row + at + 2 * HALF);
            take(&v3, row + at + 3 * HALF);
            lane_masks high =
                ((v > threshold) | (v1 > threshold)) | ((v2 > threshold) | (v3 > threshold));
            if (!any(&high)) {
                at += STEP - HALF;
                continue;
            }
        }
        take(&v, row + at);
        lane_masks top = v > threshold;
        if (!any(&top)) {
            continue;
        }
        take(&n[0], above + at - 1);
        take(&n[1], above + at);
        take(&n[2], above + at + 1);
        take(&n[3], row + at - 1);
        take(&n[4], row + at + 1);
        take(&n[5], below + at - 1);
        take(&n[6], below + at);
        take(&n[7], below + at + 1);
        top &= ((v > n[0]) & (v > n[1])) & ((v > n[2]) & (v > n[3]));
        top &= ((v >= n[4]) & (v >= n[5])) & ((v >= n[6]) & (v >= n[7]));
        if (!any(&top)) {
            continue;
        }
        for (int i = 0; i < HALF && at + i < count; i++) {
            if (top[i]) {
                x[found] = at + i;
                value[found++] = row[at + i];
            }
        }
    }
    return found;
}

ROW_FUNCTION
void bst_row_scale(float *restrict out, const float *restrict by, float factor, int count) {
    for (int x = 0; x < count; x++) {
        out[x] *= by[x] * factor;
    }
}
