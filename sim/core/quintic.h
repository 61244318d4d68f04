/* Quintic interpolation through six vectors at equal steps, between the third and fourth. */
#ifndef BST_CORE_QUINTIC_H
#define BST_CORE_QUINTIC_H

#include "boresight/vec.h"

#define BST_QUINTIC_POINTS 6
#define BST_QUINTIC_BEFORE 2 /* number of points before the origin of u */

/* Replaces the vectors by Newton's divided differences. Returns the length of the fifth difference:
 * within the middle step the interpolation error of smooth motion is below 1/200 of its change per
 * step. */
static inline double bst_quintic_make(bst_vec3 d[BST_QUINTIC_POINTS]) {
    double last = 1.0; /* factorial of the order */
    for (int order = 1; order < BST_QUINTIC_POINTS; order++) {
        last *= order;
        for (int i = BST_QUINTIC_POINTS - 1; i >= order; i--) {
            d[i] = bst_vec3_scale(bst_vec3_sub(d[i], d[i - 1]), 1.0 / order);
        }
    }
    return last * bst_vec3_norm(d[BST_QUINTIC_POINTS - 1]);
}

/* Value of the quintic u steps after the third point; 0 <= u <= 1. */
static inline bst_vec3 bst_quintic_at(const bst_vec3 d[BST_QUINTIC_POINTS], double u) {
    bst_vec3 sum = d[BST_QUINTIC_POINTS - 1];
    for (int i = BST_QUINTIC_POINTS - 2; i >= 0; i--) {
        sum = bst_vec3_axpy(d[i], u + BST_QUINTIC_BEFORE - i, sum);
    }
    return sum;
}

#endif
