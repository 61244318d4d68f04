/* Correlated noise of the point filter on the pixels about a streak. Internal to the generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_NOISE_H
#define BST_OBSGEN_STREAK_STREAK_NOISE_H

#include <stdbool.h>

#include "boresight/rng.h"
#include "obsgen/streak/streak_light.h"

/* Filter taps on either side, and noise rows already filtered across the trail. */
enum {
    BST_STREAK_TAPS = 9,
    BST_STREAK_HALF = BST_STREAK_ROWS + BST_STREAK_TAPS + 1,
    BST_STREAK_NOISE = 32, /* 2 BST_STREAK_HALF + 1, rounded up to a multiple of eight */
    BST_STREAK_SHOWN = 8,  /* BST_STREAK_WIDE, rounded up to a multiple of eight */
    BST_STREAK_NORMALS = 4096
};

/* Pixel step along a trail: a frame column if the trail runs mainly along the rows, else a row. */
typedef struct bst_streak_section {
    int at, middle;                 /* along; nearest pixel across */
    float noise[BST_STREAK_NOISE];  /* filtered across */
    float output[BST_STREAK_SHOWN]; /* SNR; elements beyond BST_STREAK_WIDE are unused */
} bst_streak_section;

typedef struct bst_streak_noise {
    double sigma; /* for which the taps are set */
    int reach;
    float taps[2 * BST_STREAK_TAPS + 1]; /* unit sum of squares */
    /* normal quantiles at the middles of equal probability shares */
    float normals[BST_STREAK_NORMALS];
} bst_streak_noise;

/* Computes the table of normal quantiles, scaled to variance 1; needed once. */
void bst_streak_noise_init(bst_streak_noise *noise);

/* Sets the taps of a filter of width sigma, px. */
void bst_streak_noise_set(bst_streak_noise *noise, double sigma);

/* Adds correlated noise of unit variance to the sections' outputs. The noise depends on pixel and
 * exposure only, not on the streak.
 *
 * Given:     shot  variance added by shot noise per unit output */
void bst_streak_noise_add(const bst_streak_noise *noise, bst_rng_key key, int64_t exposure_id,
                          bool by_row, double shot, bst_streak_section *sections, int count);

#endif
