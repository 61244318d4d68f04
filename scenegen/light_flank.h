/* Errors of nodes beside the peak of a point's image, where there is less noise, but not always
 * less error. */
#ifndef BST_SCENEGEN_LIGHT_FLANK_H
#define BST_SCENEGEN_LIGHT_FLANK_H

#include <stdbool.h>

#include "scenegen/light_classes.h"

/* By the class of the light: greatest error, and greatest error over the square root of light, both
 * over those of the brightest pixel. */
typedef struct bst_light_flank {
    double error[BST_LIGHT_CLASSES], noisy[BST_LIGHT_CLASSES];
} bst_light_flank;

/* Light of a point, or of a path at least BST_STREAK_SIGMAS long. */
enum { BST_FLANK_POINT, BST_FLANK_STREAK, BST_FLANKS };
#define BST_STREAK_SIGMAS 2.5

/* Raises the class of a pixel with `share` of the brightest pixel's light to its error, which is
 * `noisy` over the square root of light. */
static inline void bst_light_flank_raise(bst_light_flank *flank, double share, double error,
                                         double noisy) {
    int k = bst_light_class(share);
    flank->error[k] = error > flank->error[k] ? error : flank->error[k];
    flank->noisy[k] = noisy > flank->noisy[k] ? noisy : flank->noisy[k];
}

/* Steps of a curve: PARTS in each octave of the peak's light over the dark variance. */
enum {
    BST_FLANK_FIRST = -6,
    BST_FLANK_OCTAVES = 32,
    BST_FLANK_PARTS = 4,
    BST_FLANK_STEPS = BST_FLANK_OCTAVES * BST_FLANK_PARTS + 1
};

/* Error of the worst pixel, in its sigma, over that of the peak in the peak's. */
typedef struct bst_flank_curve {
    float at[BST_FLANK_STEPS];
} bst_flank_curve;

/* Computes the curve of a flank. */
void bst_flank_curve_make(const bst_light_flank *flank, bst_flank_curve *out);

/* Raises a curve to another. */
void bst_flank_curve_raise(bst_flank_curve *curve, const bst_flank_curve *other);

/* Place of a light on any curve: a step, and what the error grows by from there at most. */
typedef struct bst_flank_place {
    int step;
    double grown;
} bst_flank_place;

/* Finds the place of a peak of `light` times the dark variance. */
bst_flank_place bst_flank_place_of(double light);

/* Value of a curve at a place, as bst_flank_curve_at. */
static inline double bst_flank_curve_value(const bst_flank_curve *curve, bst_flank_place place) {
    double grown = (double)curve->at[place.step] * place.grown;
    if (place.step + 1 == BST_FLANK_STEPS) {
        return grown;
    }
    double next = (double)curve->at[place.step + 1];
    return next < grown ? next : grown;
}

/* Value of a curve for a peak of `light` times the dark variance: at least that of the flank, also
 * between the steps and beyond the last one. */
double bst_flank_curve_at(const bst_flank_curve *curve, double light);

#endif
