/* How image processing lays out and sums floats for vectors, and functions that the compiler makes
 * vectors of for several instruction sets, of which the loader picks one. Those written as vectors:
 * the files *_kernels.inc, see sim/core/simd.h. */
#ifndef BST_IMGPROC_LANES_H
#define BST_IMGPROC_LANES_H

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

/* Rows are padded to this many floats, and sums over pixels made of as many, one for each place in
 * a group of them: the widest vectors have as many. */
enum { BST_LANES = 16 };

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
