#include "obsgen/streak_noise.h"

#include <math.h>

#include "sim/core/simd.h"

/* Draws of pixels; those of other clutter stay below. */
static const uint64_t PIXEL_NOISE = (uint64_t)1 << 60;

enum {
    ROWS = BST_STREAK_ROWS,
    WIDE = BST_STREAK_WIDE,
    LANES = 16,
    WHITE = BST_STREAK_NOISE + 2 * BST_STREAK_TAPS /* pixels across */
};

void bst_streak_noise_set(bst_streak_noise *w, double sigma) {
    if (w->sigma == sigma) {
        return;
    }
    w->reach = (int)fmin(ceil(3.0 * sigma), BST_STREAK_TAPS);
    double square = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = -w->reach; i <= w->reach; i++) {
            double tap = exp(-0.5 * i * i / (sigma * sigma));
            square += pass ? 0.0 : tap * tap;
            w->taps[i + w->reach] = (float)(tap / sqrt(square));
        }
    }
    w->sigma = sigma;
}

void bst_streak_noise_init(bst_streak_noise *w) {
    double low = -9.0, square = 0.0;
    for (int i = 0; i < BST_STREAK_NORMALS; i++) {
        double high = 9.0, p = (i + 0.5) / BST_STREAK_NORMALS;
        for (int k = 0; k < 40; k++) {
            double z = 0.5 * (low + high);
            *(0.5 * erfc(-z * sqrt(0.5)) < p ? &low : &high) = z;
        }
        w->normals[i] = (float)low;
        square += low * low / BST_STREAK_NORMALS;
    }
    for (int i = 0; i < BST_STREAK_NORMALS; i++) {
        w->normals[i] = (float)((double)w->normals[i] / sqrt(square));
    }
}

/* bst_philox4x32 of LANES counters. */
typedef struct lanes {
    uint32_t c0[LANES], c1[LANES], c2[LANES], c3[LANES];
} lanes;

BST_CLONES static void draw_lanes(bst_rng_key key, lanes *l) {
    uint32_t key0 = key.k[0], key1 = key.k[1];
    for (int round = 0; round < 10; round++) {
        for (int i = 0; i < LANES; i++) {
            uint64_t p0 = (uint64_t)0xD2511F53u * l->c0[i];
            uint64_t p1 = (uint64_t)0xCD9E8D57u * l->c2[i];
            l->c0[i] = (uint32_t)(p1 >> 32) ^ l->c1[i] ^ key0;
            l->c2[i] = (uint32_t)(p0 >> 32) ^ l->c3[i] ^ key1;
            l->c1[i] = (uint32_t)p1;
            l->c3[i] = (uint32_t)p0;
        }
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
}

/* White noise of the pixels of up to LANES sections from `first` pixels before their middles on,
 * eight to a draw. The filter's many taps smooth the steps of the table. */
static void white(const bst_streak_noise *w, bst_rng_key key, int64_t exposure_id, bool by_row,
                  const bst_streak_section *s, int sections, int first, int count,
                  float out[LANES][WHITE]) {
    int groups = (count + 14) / 8;
    for (int k = 0; k < groups; k++) {
        lanes l;
        for (int i = 0; i < LANES; i++) {
            const bst_streak_section *one = &s[i < sections ? i : 0];
            uint64_t draw = PIXEL_NOISE | (uint64_t)by_row << 56 |
                            (uint64_t)(uint32_t)(one->at + 65536) << 24 |
                            (uint64_t)(((one->middle - first) >> 3) + k + 65536);
            l.c0[i] = (uint32_t)draw;
            l.c1[i] = (uint32_t)(draw >> 32);
            l.c2[i] = (uint32_t)exposure_id;
            l.c3[i] = (uint32_t)((uint64_t)exposure_id >> 32);
        }
        draw_lanes(key, &l);
        for (int i = 0; i < sections; i++) {
            int from = 8 * k - ((s[i].middle - first) & 7);
            uint32_t words[4] = {l.c0[i], l.c1[i], l.c2[i], l.c3[i]};
            int low = from < 0 ? -from : 0, high = count - from < 8 ? count - from : 8;
            for (int p = low; p < high; p++) {
                out[i][from + p] =
                    w->normals[(words[p >> 1] >> (p & 1 ? 16 : 0)) & (BST_STREAK_NORMALS - 1)];
            }
        }
    }
}

/* out[r] = sum of taps[i] in[r + i]; rows: a multiple of eight. */
BST_CLONES static void filter(const float *in, const float *taps, int count, int rows, float *out) {
    for (int first = 0; first < rows; first += 8) {
        float sum[8] = {0.0f};
        for (int i = 0; i < count; i++) {
            for (int r = 0; r < 8; r++) {
                sum[r] += taps[i] * in[first + r + i];
            }
        }
        for (int r = 0; r < 8; r++) {
            out[first + r] = sum[r];
        }
    }
}

/* Filtered along the way. */
static void add_along(const bst_streak_noise *w, double shot, bst_streak_section *s, int count) {
    int top = w->reach + 1;
    for (int k = 0; k < count; k++) {
        float sum[WIDE] = {0.0f};
        for (int i = -w->reach; i <= w->reach; i++) {
            int n = k + i;
            /* the way leaves no more than a row a step */
            int row = n >= 0 && n < count ? s[k].middle - s[n].middle + top : -1;
            if (row >= 0 && row <= 2 * top) {
                for (int r = 0; r < WIDE; r++) {
                    sum[r] += w->taps[i + w->reach] * s[n].noise[row + r];
                }
            }
        }
        for (int r = 0; r < WIDE; r++) {
            float light = s[k].output[r];
            s[k].output[r] =
                light + sum[r] * sqrtf(1.0f + (float)shot * (light > 0.0f ? light : 0.0f));
        }
    }
}

void bst_streak_noise_add(const bst_streak_noise *w, bst_rng_key key, int64_t exposure_id,
                          bool by_row, double shot, bst_streak_section *s, int count) {
    int half = ROWS + w->reach + 1, rows = 2 * half + 1;
    float noise[LANES][WHITE] = {{0.0f}};
    for (int first = 0; first < count; first += LANES) {
        int sections = count - first < LANES ? count - first : LANES;
        white(w, key, exposure_id, by_row, &s[first], sections, half + w->reach,
              rows + 2 * w->reach, noise);
        for (int k = 0; k < sections; k++) {
            filter(noise[k], w->taps, 2 * w->reach + 1, (rows + 7) & ~7, s[first + k].noise);
        }
    }
    add_along(w, shot, s, count);
}
