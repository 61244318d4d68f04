/* Noise of the filter for points on the pixels about a streak. Inside of the generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_NOISE_H
#define BST_OBSGEN_STREAK_STREAK_NOISE_H

#include <stdbool.h>

#include "boresight/rng.h"
#include "obsgen/streak/streak_light.h"

/* Taps of the filter on either side, and rows of noise that is filtered across the way already. */
enum {
    BST_STREAK_TAPS = 9,
    BST_STREAK_HALF = BST_STREAK_ROWS + BST_STREAK_TAPS + 1,
    BST_STREAK_NOISE = 32, /* 2 BST_STREAK_HALF + 1, a multiple of eight */
    BST_STREAK_SHOWN = 8,  /* BST_STREAK_WIDE, a multiple of eight */
    BST_STREAK_NORMALS = 4096
};

/* One step of a pixel along the way: a column of the frame where the way runs more along the rows,
 * a row otherwise. */
typedef struct bst_streak_section {
    int at, middle;                 /* along, and the nearest pixel across */
    float noise[BST_STREAK_NOISE];  /* filtered across */
    float output[BST_STREAK_SHOWN]; /* SNR; what is behind BST_STREAK_WIDE counts for nothing */
} bst_streak_section;

typedef struct bst_streak_noise {
    double sigma; /* that the taps are for */
    int reach;
    float taps[2 * BST_STREAK_TAPS + 1]; /* with unit sum of squares */
    float normals[BST_STREAK_NORMALS];   /* at the middles of equal shares of probability */
} bst_streak_noise;

/* Computes the table of normal quantiles, scaled to variance 1; needed once. */
void bst_streak_noise_init(bst_streak_noise *noise);

/* Makes the taps of a filter of this width, px. */
void bst_streak_noise_set(bst_streak_noise *noise, double sigma);

/* Adds noise of unit variance and of the filter's correlation to the sections' outputs. Light has
 * shot noise: shot is the variance that an output of one adds. The noise belongs to the pixel of
 * the exposure, whichever streak runs there. */
void bst_streak_noise_add(const bst_streak_noise *noise, bst_rng_key key, int64_t exposure_id,
                          bool by_row, double shot, bst_streak_section *sections, int count);

#endif
