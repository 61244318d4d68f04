/* How image processing lays out and sums floats for vectors (sim/core/simd.h). */
#ifndef BST_IMGPROC_DETECT_SIMD_LAYOUT_H
#define BST_IMGPROC_DETECT_SIMD_LAYOUT_H

#include "sim/core/simd.h"

/* Rows are padded to this many floats, and sums over pixels made of as many, one for each place in
 * a group of them: the widest vectors have as many. */
enum { BST_LANES = 16 };

/* A number of floats rounded up to whole lanes. */
static inline int bst_simd_layout_round_up(int count) {
    return (count + BST_LANES - 1) / BST_LANES * BST_LANES;
}

/* Sum of sixteen floats, always in the same order. */
static inline double bst_simd_layout_sum(const float *v) {
    float s[4];
    for (int i = 0; i < 4; i++) {
        s[i] = (v[i] + v[i + 8]) + (v[i + 4] + v[i + 12]);
    }
    return (double)((s[0] + s[2]) + (s[1] + s[3]));
}

#endif
