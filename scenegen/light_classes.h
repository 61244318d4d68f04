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

#endif
