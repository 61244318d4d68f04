/* Gaussian jitter noise with a given spectral density about two axes, step by step. */
#ifndef BST_GIMBAL_JITTER_JITTER_NOISE_H
#define BST_GIMBAL_JITTER_JITTER_NOISE_H

#include <stdint.h>

#include "boresight/rng.h"
#include "gimbal/jitter/jitter_table.h"

enum { BST_NOISE_POINTS = 2048 };

/* Noise generator by overlapping blocks.
 *
 * A block has BST_NOISE_POINTS nodes: the inverse FFT of independent complex normal values with the
 * density's share of their bin. Blocks overlap by half under a sine window, whose squared weights
 * add up to one. The result is Gaussian with the density's integral as variance at every step. Its
 * spectrum is the density smoothed over 1 / (2 T), T = BST_NOISE_POINTS nodes. x and y are real and
 * imaginary part, independent of each other. A band far below the step rate has a node every
 * `stride` steps (a power of two, at least 20 nodes per shortest period), with cubic interpolation.
 * Block and node depend only on step number and key. */
typedef struct bst_jitter_noise {
    bst_rng_key key;
    double dt_s;
    int64_t stride;
    int lines;                         /* bins from -lines to lines are not empty */
    double gain[BST_NOISE_POINTS / 2]; /* of bins k and -k */
    double turn_re[BST_NOISE_POINTS / 2], turn_im[BST_NOISE_POINTS / 2], window[BST_NOISE_POINTS];
    int64_t block[2]; /* blocks in the two slots; -1: none */
    double x[2][BST_NOISE_POINTS], y[2][BST_NOISE_POINTS];
    int64_t interval; /* interval of the current cubic; -1: none */
    double cubic[2][4];
} bst_jitter_noise;

/* Initialises the noise.
 *
 * Given:     density  per axis, squares of the output's unit per Hz
 *            top_hz   frequencies above it are omitted */
void bst_jitter_noise_init(bst_jitter_noise *noise, const bst_jitter_density *density,
                           double top_hz, double dt_s, bst_rng_key key);

/* Noise at step n >= 0, in any order; ascending n is fast. */
void bst_jitter_noise_at(bst_jitter_noise *noise, int64_t n, double out[2]);

#endif
