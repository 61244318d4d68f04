/* Vectors of floats as wide as the processor has them.
 *
 * A file of kernels is compiled once for each width:
 *
 *     #define BST_SIMD_KERNELS "imgproc/fit_kernels.inc"
 *     #include "sim/core/simd_each.inc"
 *
 * In it bst_floats is a vector of BST_WIDTH floats and bst_ints its comparison's, and
 * BST_SIMD(name) names a function of that width; BST_SIMD_PICK(name)(...) calls the one for this
 * processor. Code for 16 floats at a time is not written: what the compiler makes of such vectors
 * on processors without registers for them goes through memory, five times slower.
 *
 * Contraction is off for the whole project, so that all widths round alike; a kernel that sums does
 * so in BST_LANES separate sums (imgproc/lanes.h), whatever the width. */
#ifndef BST_CORE_SIMD_H
#define BST_CORE_SIMD_H

#include <stdint.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define BST_SIMD_X86
#endif

#define BST_SIMD_TYPES(width)                                                   \
    typedef float bst_floats_##width __attribute__((vector_size(4 * (width)))); \
    typedef int32_t bst_ints_##width __attribute__((vector_size(4 * (width)))); \
    /* the same wherever floats lie */                                          \
    typedef float bst_floats_at_##width                                         \
        __attribute__((vector_size(4 * (width)), aligned(sizeof(float)), may_alias));
BST_SIMD_TYPES(4)
BST_SIMD_TYPES(8)
BST_SIMD_TYPES(16)
#undef BST_SIMD_TYPES

#define BST_LOAD(p) (*(const bst_floats_at *)(p))
#define BST_STORE(p, v) (*(bst_floats_at *)(p) = (v))
/* the greater of v and 0 */
#define BST_ABOVE_0(v) ((bst_floats)((bst_ints)(v) & ((v) > 0.0f)))
#define BST_SIMD_INLINE static inline __attribute__((always_inline))

/* Floats of the widest vectors that the processor has and bst_simd_limit lets be: 4, 8 or 16. */
int bst_simd_floats(void);
/* For tests that compare the widths: none wider than this from now on. */
void bst_simd_limit(int floats);

#ifdef BST_SIMD_X86
#define BST_SIMD_PICK(name) \
    (bst_simd_floats() == 16 ? name##_16 : bst_simd_floats() == 8 ? name##_8 : name##_4)
#else
#define BST_SIMD_PICK(name) name##_4
#endif

#endif
