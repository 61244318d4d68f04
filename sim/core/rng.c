#include "boresight/rng.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/fnv.h"

/* independent of byte order: a seed is the same on every machine */
static uint64_t fnv1a_u64(uint64_t hash, uint64_t value) {
    unsigned char bytes[8];
    for (int i = 0; i < 8; i++) {
        bytes[i] = (unsigned char)(value >> (8 * i));
    }
    return bst_fnv(hash, bytes, sizeof bytes);
}

static uint64_t fnv1a_name(uint64_t hash, const char *name) {
    return bst_fnv(
        hash, name,
        strlen(name) + 1); /* with the terminator, so that "a","bc" and "ab","c" differ */
}

bst_rng_key bst_rng_make_key(uint64_t seed, uint64_t run, const char *instance,
                             const char *stream) {
    uint64_t h = BST_FNV_START;
    h = fnv1a_u64(h, seed);
    h = fnv1a_u64(h, run);
    h = fnv1a_name(h, instance);
    h = fnv1a_name(h, stream);
    /* SplitMix64 finaliser (Steele, Lea and Flood 2014) */
    h ^= h >> 30;
    h *= 0xBF58476D1CE4E5B9u;
    h ^= h >> 27;
    h *= 0x94D049BB133111EBu;
    h ^= h >> 31;
    return (bst_rng_key){{(uint32_t)h, (uint32_t)(h >> 32)}};
}

/* Converts 53 bits of two words to a double in (0, 1). */
static double open_unit(uint32_t high, uint32_t low) {
    uint64_t bits = (((uint64_t)high << 32) | low) >> 11;
    return ((double)bits + 0.5) * 0x1p-53;
}

double bst_rng_uniform(bst_rng_key key, uint64_t a, uint64_t b) {
    bst_philox_words r = bst_rng_words(key, a, b);
    return open_unit(r.w[0], r.w[1]);
}

/* Radius and angle of a point with two normal coordinates (Box and Muller 1958). */
static double normal_radius(bst_rng_key key, uint64_t a, uint64_t b, double *angle) {
    bst_philox_words r = bst_rng_words(key, a, b);
    *angle = 2.0 * BST_PI * open_unit(r.w[2], r.w[3]);
    return sqrt(-2.0 * log(open_unit(r.w[0], r.w[1])));
}

void bst_rng_normal2(bst_rng_key key, uint64_t a, uint64_t b, double out[2]) {
    double angle, radius = normal_radius(key, a, b, &angle);
    out[0] = radius * cos(angle);
    out[1] = radius * sin(angle);
}

double bst_rng_normal(bst_rng_key key, uint64_t a, uint64_t b) {
    double angle, radius = normal_radius(key, a, b, &angle);
    return radius * cos(angle);
}
