/* Random numbers that depend on names and counters only: never on call order, threads or list
 * positions.
 *
 * A key is derived from (master seed, run number, instance name, stream name); a draw from (key,
 * counter). Draws with the same key and counter are equal; different keys or counters are
 * independent. */
#ifndef BORESIGHT_RNG_H
#define BORESIGHT_RNG_H

#include <stdint.h>

#include "boresight/philox_shared.h"

#pragma GCC visibility push(default)

/* The 64-bit key of one stream. */
typedef struct bst_rng_key {
    uint32_t k[2];
} bst_rng_key;

/* Key of stream `stream` of instance `instance` ("observer/sensor/module") in run `run` of master
 * seed `seed`. Mixing: 64-bit FNV-1a over the bytes, finished by SplitMix64. */
bst_rng_key bst_rng_make_key(uint64_t seed, uint64_t run, const char *instance, const char *stream);

/* Four uniform 32-bit words for counter (a, b): a is usually a frame or tick, b a draw or pixel. */
static inline bst_philox_words bst_rng_words(bst_rng_key key, uint64_t a, uint64_t b) {
    return bst_philox4x32(key.k[0], key.k[1], (uint32_t)b, (uint32_t)(b >> 32), (uint32_t)a,
                          (uint32_t)(a >> 32));
}

/* Uniform double in the open interval (0, 1), 53 bits. */
double bst_rng_uniform(bst_rng_key key, uint64_t a, uint64_t b);

/* Two independent standard normal deviates for counter (a, b) (Box and Muller 1958). */
void bst_rng_normal2(bst_rng_key key, uint64_t a, uint64_t b, double out[2]);

/* bst_rng_normal2 for the counters (first, 0), (first + 1, 0), ... to rounding (1e-15), the first
 * deviates in out[0]; at a sixth of the cost for each. */
#define BST_RNG_BLOCK 16
void bst_rng_normal_block(bst_rng_key key, uint64_t first, double out[2][BST_RNG_BLOCK]);

/* One standard normal deviate: the first of bst_rng_normal2. */
double bst_rng_normal(bst_rng_key key, uint64_t a, uint64_t b);

#pragma GCC visibility pop

#endif
