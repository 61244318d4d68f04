#include "obsgen/streak/streak_noise.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/simd.h"

/* Random stream of pixel noise; those of other false alarms are lower. */
static const uint64_t PIXEL_NOISE = (uint64_t)1 << 60;

enum {
    ROWS = BST_STREAK_ROWS,
    SHOWN = BST_STREAK_SHOWN,
    LANES = 16,
    BEFORE = 8, /* pixels across before the requested ones, and in all */
    WHITE = BEFORE + BST_STREAK_NOISE + 2 * BST_STREAK_TAPS + 14
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

/* Philox state of LANES counters (bst_philox4x32). */
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
 * eight per draw; `out` holds as many before the first. The steps of the quantile table are
 * smoothed by the filter. */
static void white_noise(const bst_streak_noise *w, bst_rng_key key, int64_t exposure_id,
                        bool by_row, const bst_streak_section *s, int sections, int first,
                        int count, float out[LANES][WHITE]) {
    int offset[LANES], groups = 0;
    for (int i = 0; i < sections; i++) {
        offset[i] = (s[i].middle - first) & 7;
        groups = offset[i] + count + 7 > 8 * groups ? (offset[i] + count + 7) / 8 : groups;
    }
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
            const uint32_t words[4] = {l.c0[i], l.c1[i], l.c2[i], l.c3[i]};
            float *to = out[i] + BEFORE + 8 * k - offset[i];
            for (int p = 0; p < 4; p++) {
                to[2 * p] = w->normals[words[p] & (BST_STREAK_NORMALS - 1)];
                to[2 * p + 1] = w->normals[(words[p] >> 16) & (BST_STREAK_NORMALS - 1)];
            }
        }
    }
}

#define BST_SIMD_KERNELS "obsgen/streak/streak_noise_kernels.inc"
#include "sim/core/simd_each.inc"

/* Largest offset of the trail from a section, in rows, within the filter's reach; larger offsets
 * belong to another part of the trail. */
static int row_drift(const bst_streak_noise *w, const bst_streak_section *s, int count) {
    int most = 0;
    for (int k = 0; k < count; k++) {
        for (int n = k + 1; n <= k + w->reach && n < count; n++) {
            int rows = abs(s[n].middle - s[k].middle);
            most = rows > most && rows <= w->reach + 1 ? rows : most;
        }
    }
    return most;
}

void bst_streak_noise_add(const bst_streak_noise *w, bst_rng_key key, int64_t exposure_id,
                          bool by_row, double shot, bst_streak_section *s, int count) {
    int most = row_drift(w, s, count), half = ROWS + most, rows = 2 * half + 1;
    float noise[LANES][WHITE] = {{0.0f}};
    for (int first = 0; first < count; first += LANES) {
        int sections = count - first < LANES ? count - first : LANES;
        white_noise(w, key, exposure_id, by_row, &s[first], sections, half + w->reach,
                    rows + 2 * w->reach, noise);
        for (int k = 0; k < sections; k++) {
            BST_SIMD_PICK(filter)
            (noise[k] + BEFORE, w->taps, 2 * w->reach + 1, (rows + 7) & ~7, s[first + k].noise);
        }
    }
    BST_SIMD_PICK(add_along)(w, (float)shot, most, s, count);
}
