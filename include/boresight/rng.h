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

/* Derives the key of a random stream from names.
 *
 * Given:     seed      master seed
 *            run       number of the run
 *            instance  "observer/sensor/module"
 *            stream    name of the stream within the instance
 * Notes:     64-bit FNV-1a over the bytes, with the terminators of the names, then the finaliser of
 *            SplitMix64.
 * Reference: Steele, Lea and Flood 2014 (SplitMix64) */
bst_rng_key bst_rng_make_key(uint64_t seed, uint64_t run, const char *instance, const char *stream);

/* Four uniform 32-bit words for one counter (a, b).
 *
 * Given:     a  usually a frame or tick
 *            b  usually a draw or pixel
 * Notes:     equal arguments give equal words. */
static inline bst_philox_words bst_rng_words(bst_rng_key key, uint64_t a, uint64_t b) {
    return bst_philox4x32(key.k[0], key.k[1], (uint32_t)b, (uint32_t)(b >> 32), (uint32_t)a,
                          (uint32_t)(a >> 32));
}

/* Uniform deviate in the open interval (0, 1), 53 bits, for counter (a, b). */
double bst_rng_uniform(bst_rng_key key, uint64_t a, uint64_t b);

/* Two independent standard normal deviates for counter (a, b).
 *
 * Reference: Box and Muller 1958 */
void bst_rng_normal2(bst_rng_key key, uint64_t a, uint64_t b, double out[2]);

/* number of deviates in a block */
#define BST_RNG_BLOCK 16

/* bst_rng_normal2 for the 16 counters (first, 0), (first + 1, 0), ..., six times as fast.
 *
 * Given:     first  first counter
 * Returned:  out  [0][i], [1][i]: the two deviates of counter first + i, equal to those of
 *                 bst_rng_normal2 within 1e-15 */
void bst_rng_normal_block(bst_rng_key key, uint64_t first, double out[2][BST_RNG_BLOCK]);

/* bst_rng_normal for the 16 counters (a, first), (a, first + 1), ...
 *
 * Returned:  out  [i]: the deviate of counter (a, first + i), equal to that of bst_rng_normal
 *                 within 1e-15 */
void bst_rng_normal_draws(bst_rng_key key, uint64_t a, uint64_t first, double out[BST_RNG_BLOCK]);

/* bst_rng_uniform for the 16 counters (a, first), (a, first + 1), ...
 *
 * Returned:  out  [i]: the deviate of counter (a, first + i) */
void bst_rng_uniform_draws(bst_rng_key key, uint64_t a, uint64_t first, double out[BST_RNG_BLOCK]);

/* One standard normal deviate for counter (a, b): the first of bst_rng_normal2. */
double bst_rng_normal(bst_rng_key key, uint64_t a, uint64_t b);

#pragma GCC visibility pop

#endif
