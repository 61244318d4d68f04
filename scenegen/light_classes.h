/* Brightness classes of the pixels of a point's image. */
#ifndef BST_SCENEGEN_LIGHT_CLASSES_H
#define BST_SCENEGEN_LIGHT_CLASSES_H

#include <math.h>

/* Class k has 2^-(k + 1) to 2^-k of the brightest pixel's light; the last one all below. */
enum { BST_LIGHT_CLASSES = 20 };

/* Class of a pixel with `share` of the brightest pixel's light. */
static inline int bst_light_class(double share) {
    int exponent;
    (void)frexp(fmax(share, 1e-12), &exponent); /* fraction in [2^(e-1), 2^e) */
    int k = exponent > 0 ? 0 : -exponent;
    return k < BST_LIGHT_CLASSES ? k : BST_LIGHT_CLASSES - 1;
}

/* Where errors of nodes fall, by the class of the light there: the greatest error, and the greatest
 * error over the square root of light, both over those of the brightest pixel. */
typedef struct bst_light_flank {
    double error[BST_LIGHT_CLASSES], noisy[BST_LIGHT_CLASSES];
} bst_light_flank;

/* Light of a point, or of a path at least BST_STREAK_SIGMAS long. */
enum { BST_FLANK_POINT, BST_FLANK_STREAK, BST_FLANKS };
#define BST_STREAK_SIGMAS 2.5

/* Starts with no error. */
static inline void bst_light_flank_clear(bst_light_flank *flank) {
    *flank = (bst_light_flank){.error = {0.0}};
}

/* Raises the class of a pixel with `share` of the brightest pixel's light to its error. */
static inline void bst_light_flank_raise(bst_light_flank *flank, double share, double error) {
    int k = bst_light_class(share);
    double noisy = error / sqrt(fmax(share, 1e-12));
    flank->error[k] = error > flank->error[k] ? error : flank->error[k];
    flank->noisy[k] = noisy > flank->noisy[k] ? noisy : flank->noisy[k];
}

#endif
