/* Normal random deviates in blocks of sixteen, by vector operations. */
#include <math.h>
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

/* Cosine and sine of 2 pi u, 0 < u < 1, accurate to rounding: series after reduction to a quarter
 * turn. */
static inline void turn_of(double u, double *cosine, double *sine) {
    int32_t quarters = (int32_t)(4.0 * u + 0.5);
    double x = (4.0 * u - quarters) * (0.5 * BST_PI), q = x * x, s = 1.0, c = 1.0;
    for (int k = 16; k >= 2; k -= 2) {
        s = 1.0 - s * q * (1.0 / (k * (k + 1.0)));
        c = 1.0 - c * q * (1.0 / (k * (k - 1.0)));
    }
    s *= x;
    double a = quarters & 1 ? s : c, b = quarters & 1 ? c : s;
    *cosine = (quarters + 1) & 2 ? -a : a;
    *sine = quarters & 2 ? -b : b;
}

BST_CLONES void bst_rng_normal_block(bst_rng_key key, uint64_t first,
                                     double out[2][BST_RNG_BLOCK]) {
    uint32_t c0[COUNT], c1[COUNT], c2[COUNT], c3[COUNT], key0 = key.k[0], key1 = key.k[1];
    for (int i = 0; i < COUNT; i++) {
        uint64_t a = first + (uint64_t)i;
        c0[i] = c1[i] = 0;
        c2[i] = (uint32_t)a;
        c3[i] = (uint32_t)(a >> 32);
    }
    for (int round = 0; round < 10; round++) { /* bst_philox4x32 */
        for (int i = 0; i < COUNT; i++) {
            uint64_t p0 = (uint64_t)0xD2511F53u * c0[i], p1 = (uint64_t)0xCD9E8D57u * c2[i];
            c0[i] = (uint32_t)(p1 >> 32) ^ c1[i] ^ key0;
            c2[i] = (uint32_t)(p0 >> 32) ^ c3[i] ^ key1;
            c1[i] = (uint32_t)p1;
            c3[i] = (uint32_t)p0;
        }
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
    for (int i = 0; i < COUNT; i++) {
        double radius = sqrt(-2.0 * log_of(unit_of(c0[i], c1[i]))), cosine, sine;
        turn_of(unit_of(c2[i], c3[i]), &cosine, &sine);
        out[0][i] = radius * cosine;
        out[1][i] = radius * sine;
    }
}
