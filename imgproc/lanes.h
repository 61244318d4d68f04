/* Sixteen floats at a time, in functions that are compiled for several instruction sets, of which
 * the loader picks one. Contraction is off for the whole project, so that all round alike. */
#ifndef BST_IMGPROC_LANES_H
#define BST_IMGPROC_LANES_H

#include <stdint.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define BST_CLONES __attribute__((target_clones("default", "avx2", "avx512f")))
/* for comparisons that are kept as numbers, which 512-bit registers are slow at */
#define BST_CLONES_256 __attribute__((target_clones("default", "avx2")))
/* for 16-bit numbers */
#define BST_CLONES_16 __attribute__((target_clones("default", "avx2", "arch=skylake-avx512")))
#else
#define BST_CLONES
#define BST_CLONES_256
#define BST_CLONES_16
#endif

enum { BST_LANES = 16 };

typedef float bst_lanes __attribute__((vector_size(BST_LANES * sizeof(float))));
typedef int32_t bst_lane_ints __attribute__((vector_size(BST_LANES * sizeof(int32_t))));
/* the same wherever floats lie */
typedef float bst_lanes_at
    __attribute__((vector_size(BST_LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

#define BST_LOAD(p) (*(const bst_lanes_at *)(p))
#define BST_STORE(p, v) (*(bst_lanes_at *)(p) = (v))
/* the greater of v and 0 */
#define BST_ABOVE_0(v) ((bst_lanes)((bst_lane_ints)(v) & ((v) > 0.0f)))

/* A number of floats rounded up to whole lanes. */
static inline int bst_lanes_up(int count) {
    return (count + BST_LANES - 1) / BST_LANES * BST_LANES;
}

/* Sum of sixteen floats, always in the same order. */
static inline double bst_lane_sum(const float *v) {
    float s[4];
    for (int i = 0; i < 4; i++) {
        s[i] = (v[i] + v[i + 8]) + (v[i + 4] + v[i + 12]);
    }
    return (double)((s[0] + s[2]) + (s[1] + s[3]));
}

#endif
