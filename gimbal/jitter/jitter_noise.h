/* Gaussian noise of a given spectrum about two axes, step by step. */
#ifndef BST_GIMBAL_JITTER_JITTER_NOISE_H
#define BST_GIMBAL_JITTER_JITTER_NOISE_H

#include <stdint.h>

#include "boresight/rng.h"
#include "gimbal/jitter/jitter_table.h"

enum { BST_NOISE_POINTS = 2048 };

/* Blocks of BST_NOISE_POINTS nodes, each an inverse Fourier transform of independent complex normal
 * values with the density's share of their bin, overlap by half under a sine window, so that
 * squared weights add up to one: a Gaussian sequence whose variance is the density's integral at
 * every step and whose spectrum is the density, smoothed over 1 / (2 T), T = BST_NOISE_POINTS
 * nodes. x and y are real and imaginary part, independent of each other. A band that ends far below
 * the steps' rate has a node only every `stride` steps (a power of two, at least 20 nodes in the
 * fastest period) and a cubic through four of them between; block and node are functions of the
 * step's number and the key alone. */
typedef struct bst_jitter_noise {
    bst_rng_key key;
    double dt_s;
    int64_t stride;
    int lines;                         /* bins from -lines to lines are not empty */
    double gain[BST_NOISE_POINTS / 2]; /* of bin k and -k */
    double turn_re[BST_NOISE_POINTS / 2], turn_im[BST_NOISE_POINTS / 2], window[BST_NOISE_POINTS];
    int64_t block[2]; /* which ones are in the slots; -1: none */
    double x[2][BST_NOISE_POINTS], y[2][BST_NOISE_POINTS];
    int64_t interval; /* between which nodes the cubic goes; -1: none */
    double cubic[2][4];
} bst_jitter_noise;

/* density: of each axis, in squares of the output's unit. What lies above top_hz is left out. */
void bst_jitter_noise_init(bst_jitter_noise *noise, const bst_jitter_density *density,
                           double top_hz, double dt_s, bst_rng_key key);

/* Values at step n >= 0, in any order; in turn is fast. */
void bst_jitter_noise_at(bst_jitter_noise *noise, int64_t n, double out[2]);

#endif
