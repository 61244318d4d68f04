#include "imgproc/detect/row_kernels.h"

#include <math.h>
#include <string.h>

#include "imgproc/detect/background.h"
#include "imgproc/detect/simd_layout.h"

/* half of the lanes per variable, so that they stay in registers */
enum { HALF = BST_ROW_LANES / 2, KEYS = 16, MEDIAN_PARTS = BST_ROW_MEDIAN / KEYS, MAX_RADIUS = 32 };
typedef float lanes __attribute__((vector_size(HALF * sizeof(float))));
typedef int16_t keys __attribute__((vector_size(KEYS * sizeof(int16_t))));
typedef int32_t lane_masks __attribute__((vector_size(HALF * sizeof(float))));

BST_CLONES_256
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

BST_CLONES
int bst_row_good(const float *pixels, int count) {
    int good = 0;
    for (int x = 0; x < count; x++) {
        good += pixels[x] > BST_PIXEL_NONE;
    }
    return good;
}

/* The upper half of a float as an integer that sorts like the float. */
static inline int16_t key_of(float value) {
    int32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (int16_t)((bits ^ ((bits >> 31) & 0x7FFFFFFF)) >> 16);
}

/* Middle of the floats with a given key. */
static inline float value_of(int key) {
    int32_t bits = (int32_t)((uint32_t)key << 16 | 0x8000u);
    bits ^= (bits >> 31) & 0x7FFFFFFF;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Largest key that at most half of the values lie below, bit by bit, without branches. */
BST_CLONES_256
float bst_row_median(const float *values, int count) {
    int16_t all[BST_ROW_MEDIAN];
    keys part[MEDIAN_PARTS];
    for (int i = 0; i < BST_ROW_MEDIAN; i++) {
        all[i] = i < count ? key_of(values[i]) : INT16_MAX;
    }
    memcpy(part, all, sizeof part);
    int median = INT16_MIN;
    for (int step = 1 << 15; step > 0; step >>= 1) {
        int16_t trial = (int16_t)(median + step);
        keys below = {0};
        for (int b = 0; b < MEDIAN_PARTS; b++) {
            below -= part[b] < trial;
        }
        uint64_t four[KEYS / 4];
        memcpy(four, &below, sizeof four);
        /* sums of four 16-bit numbers that cannot overflow */
        uint64_t sum = (four[0] + four[1]) + (four[2] + four[3]);
        int rank = (int)((sum * 0x0001000100010001u) >> 48);
        median = rank <= count / 2 ? trial : median;
    }
    return value_of(median);
}

BST_CLONES
void bst_row_line(float *restrict out, int count, float left, float slope, float first) {
    for (int x = 0; x < count; x++) {
        out[x] = left + slope * ((float)x + first);
    }
}

BST_CLONES
void bst_row_electrons(const uint16_t *restrict raw, int count, float offset, float gain,
                       float *restrict out) {
    for (int x = 0; x < count; x++) {
        out[x] = ((float)raw[x] - offset) * gain;
    }
}

/* Largest digital number of a row. */
BST_CLONES
static uint16_t greatest(const uint16_t *raw, int count) {
    uint16_t top = 0;
    for (int x = 0; x < count; x++) {
        top = raw[x] > top ? raw[x] : top;
    }
    return top;
}

/* True if `to` is aligned for non-temporal stores. */
static bool may_stream(const float *to) {
    return (uintptr_t)to % 16 == 0;
}

#define BST_SIMD_KERNELS "imgproc/detect/row_kernels_simd.inc"
#include "sim/core/simd_each.inc"

void bst_row_normalise(const bst_row_input *row, const bst_row_part *parts, int count,
                       float *signal, float *normalised) {
    const uint16_t *raw = row->raw;
    const int saturated_dn = row->saturated_dn;
    int width = count > 0 ? parts[count - 1].end : 0;
    bool full;
    if (row->gain) {
        full = BST_SIMD_PICK(take_raw)(raw, row->gain, parts, count, (float)saturated_dn, signal,
                                       normalised);
    } else {
        full = greatest(raw, width) >= saturated_dn;
        BST_SIMD_PICK(take_level_off)(row->electrons, parts, count, signal, normalised);
    }
    for (int x = full ? 0 : width; x < width; x++) {
        if (raw[x] >= saturated_dn && signal[x] > BST_PIXEL_NONE) {
            signal[x] = BST_PIXEL_SATURATED;
        }
    }
}

BST_CLONES
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

void bst_row_even_4(float *out, size_t stride, int count, const float *const *in,
                    const float *weight, int radius) {
    int x = radius == 3 ? BST_SIMD_PICK(even_4)(out, stride, count, in, weight) : 0;
    for (int k = 0; k < 4 && x < count; k++) {
        const float *row[2 * MAX_RADIUS + 1];
        for (int t = -radius; t <= radius; t++) {
            row[radius + t] = in[k + t] + x;
        }
        bst_row_even(out + (size_t)k * stride + x, count - x, row + radius, weight, radius);
    }
}

BST_CLONES
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
    for (; t + 4 <= taps; t += 4) {
        const float *restrict a = in[t], *restrict b = in[t + 1], *restrict c = in[t + 2],
                              *restrict d = in[t + 3];
        float wa = weight[t], wb = weight[t + 1], wc = weight[t + 2], wd = weight[t + 3];
        for (int x = 0; x < count; x++) {
            out[x] += (wa * a[x] + wb * b[x]) + (wc * c[x] + wd * d[x]);
        }
    }
    for (; t + 2 <= taps; t += 2) {
        const float *restrict a = in[t], *restrict b = in[t + 1];
        float wa = weight[t], wb = weight[t + 1];
        for (int x = 0; x < count; x++) {
            out[x] += wa * a[x] + wb * b[x];
        }
    }
    for (; t < taps; t++) {
        const float *restrict a = in[t];
        float wa = weight[t];
        for (int x = 0; x < count; x++) {
            out[x] += wa * a[x];
        }
    }
}

void bst_row_streak(float *out, float *copy, int count, const float *const *in, const float *weight,
                    int taps, const float *floor) {
    bool streamed = copy && may_stream(copy);
    int x = BST_SIMD_PICK(streak)(out, streamed ? copy : NULL, count, in, weight, taps, floor);
    if (streamed) {
        bst_simd_stream_end();
    }
    int whole = streamed ? x : 0;
    for (; x < count; x++) {
        float sum = 0.0f;
        for (int t = 0; t < taps; t++) {
            sum += weight[t] * in[t][x];
        }
        out[x] = sum > floor[x] ? sum : floor[x];
    }
    if (copy) {
        memcpy(copy + whole, out + whole, (size_t)(count - whole) * sizeof *out);
    }
}

int bst_row_maxima(const float *above, const float *row, const float *below, int count,
                   float threshold, int32_t *x, float *value) {
    return BST_SIMD_PICK(maxima)(above, row, below, count, threshold, x, value);
}

BST_CLONES
void bst_row_scale(float *restrict out, const float *restrict by, float factor, int count) {
    for (int x = 0; x < count; x++) {
        out[x] *= by[x] * factor;
    }
}

BST_CLONES
void bst_row_mask(const float *const *rows, int count, float limit, float *restrict out) {
    enum { BLOCK = 256 };
    const float *restrict a = rows[0], *restrict b = rows[1], *restrict c = rows[2],
                          *restrict d = rows[3], *restrict e = rows[4];
    for (int first = 0; first < count; first += BLOCK) {
        float top[BLOCK + 2 * BST_ROW_NEAR];
        int n = count - first < BLOCK ? count - first : BLOCK, at = first - BST_ROW_NEAR;
        for (int x = 0; x < n + 2 * BST_ROW_NEAR; x++) {
            float u = a[at + x] > b[at + x] ? a[at + x] : b[at + x];
            float v = c[at + x] > d[at + x] ? c[at + x] : d[at + x];
            u = u > v ? u : v;
            top[x] = u > e[at + x] ? u : e[at + x];
        }
        for (int x = 0; x < n; x++) {
            float u = top[x] > top[x + 1] ? top[x] : top[x + 1];
            float v = top[x + 2] > top[x + 3] ? top[x + 2] : top[x + 3];
            u = u > v ? u : v;
            u = u > top[x + 4] ? u : top[x + 4];
            out[first + x] = u > limit ? BST_PIXEL_BAD : out[first + x];
        }
    }
}
