/* Layout and summation order of float rows for SIMD (sim/core/simd.h). */
#ifndef BST_IMGPROC_DETECT_SIMD_LAYOUT_H
#define BST_IMGPROC_DETECT_SIMD_LAYOUT_H

#include "sim/core/simd.h"

/* Rows are padded to a multiple of this many floats, the width of the widest vectors; sums over
 * pixels have as many lanes. */
enum { BST_LANES = 16 };

/* Rounds a number of floats up to whole lanes. */
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
