/* Random deviates in blocks of sixteen, by vector operations. */
#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/core/simd.h"

enum { COUNT = BST_RNG_BLOCK };

/* Uniform deviate in (0, 1): 53 bits of two words plus half a bit. */
static inline double unit_of(uint32_t high, uint32_t low) {
    double upper = (double)(int32_t)(high >> 5);
    double lower = (double)(int32_t)((high & 31u) << 21 | low >> 11);
    return (upper * 0x1p26 + lower + 0.5) * 0x1p-53;
}

/* ln x for 0 < x < 1, accurate to rounding: x = 2^n m, 0.7 < m < 1.42, ln m = 2 artanh((m - 1) / (m
 * + 1)). */
static inline double log_of(double x) {
    int64_t bits;
    memcpy(&bits, &x, sizeof bits);
    int32_t above = (int32_t)(bits >> 32) - 0x3FE6A09E; /* the upper half of sqrt(1/2) */
    int32_t n = above >> 20;
    bits -= n * (INT64_C(1) << 52);
    double m;
    memcpy(&m, &bits, sizeof m);
    double t = (m - 1.0) / (m + 1.0), q = t * t, series = 1.0 / 23.0;
    for (int k = 21; k >= 3; k -= 2) {
        series = series * q + 1.0 / k;
    }
    return n * 0.69314718055994531 + 2.0 * (t + t * q * series);
}

/* sin(pi y), |y| <= 1/2, accurate to rounding: its series. */
static inline double half_turn_sine(double y) {
    double x = y * BST_PI, q = x * x, series = 1.0;
    for (int k = 22; k >= 2; k -= 2) {
        series = 1.0 - series * q * (1.0 / (k * (k + 1.0)));
    }
    return series * x;
}

/* Cosine and sine of 2 pi u, 0 < u < 1, without a choice of one of two series, which would keep the
 * compiler from vector operations. */
static inline double turn_cosine(double u) {
    int32_t half = (int32_t)(2.0 * u);
    return (2 * half - 1) * half_turn_sine(2.0 * u - 0.5 - half);
}

static inline double turn_sine(double u) {
    int32_t half = (int32_t)(2.0 * u + 0.5);
    return (1 - 2 * (half & 1)) * half_turn_sine(2.0 * u - half);
}

/* Sixteen counters of Philox, or the words that it makes of them. */
typedef struct counters {
    uint32_t c[4][COUNT];
} counters;

/* Counters (a, b + i), or (a + i, b) if the steps are of a. */
static BST_INLINED void count_up(counters *n, uint64_t a, uint64_t b, bool of_a) {
    for (int i = 0; i < COUNT; i++) {
        uint64_t ai = of_a ? a + (uint64_t)i : a, bi = of_a ? b : b + (uint64_t)i;
        n->c[0][i] = (uint32_t)bi;
        n->c[1][i] = (uint32_t)(bi >> 32);
        n->c[2][i] = (uint32_t)ai;
        n->c[3][i] = (uint32_t)(ai >> 32);
    }
}

/* bst_philox4x32 of each counter, in place. */
static BST_INLINED void encrypt(bst_rng_key key, counters *n) {
    uint32_t key0 = key.k[0], key1 = key.k[1];
    for (int round = 0; round < 10; round++) {
#pragma GCC unroll 1 /* a loop that is unrolled first is not vectorised */
        for (int i = 0; i < COUNT; i++) {
            uint64_t p0 = (uint64_t)0xD2511F53u * n->c[0][i];
            uint64_t p1 = (uint64_t)0xCD9E8D57u * n->c[2][i];
            n->c[0][i] = (uint32_t)(p1 >> 32) ^ n->c[1][i] ^ key0;
            n->c[2][i] = (uint32_t)(p0 >> 32) ^ n->c[3][i] ^ key1;
            n->c[1][i] = (uint32_t)p1;
            n->c[3][i] = (uint32_t)p0;
        }
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
}

BST_CLONES void bst_rng_normal_block(bst_rng_key key, uint64_t first,
                                     double out[2][BST_RNG_BLOCK]) {
    assert(out);
    counters n;
    count_up(&n, first, 0, true);
    encrypt(key, &n);
    for (int i = 0; i < COUNT; i++) {
        double radius = sqrt(-2.0 * log_of(unit_of(n.c[0][i], n.c[1][i])));
        double turn = unit_of(n.c[2][i], n.c[3][i]);
        out[0][i] = radius * turn_cosine(turn);
        out[1][i] = radius * turn_sine(turn);
    }
}

BST_CLONES void bst_rng_normal_draws(bst_rng_key key, uint64_t a, uint64_t first,
                                     double out[BST_RNG_BLOCK]) {
    assert(out);
    counters n;
    count_up(&n, a, first, false);
    encrypt(key, &n);
    for (int i = 0; i < COUNT; i++) {
        double square = -2.0 * log_of(unit_of(n.c[0][i], n.c[1][i]));
        out[i] = sqrt(square) * turn_cosine(unit_of(n.c[2][i], n.c[3][i]));
    }
}

BST_CLONES void bst_rng_uniform_draws(bst_rng_key key, uint64_t a, uint64_t first,
                                      double out[BST_RNG_BLOCK]) {
    assert(out);
    counters n;
    count_up(&n, a, first, false);
    encrypt(key, &n);
    for (int i = 0; i < COUNT; i++) {
        out[i] = unit_of(n.c[0][i], n.c[1][i]);
    }
}
