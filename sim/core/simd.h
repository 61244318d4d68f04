/* SIMD vectors of floats, as wide as the processor supports: by the compiler from loops in
 * functions marked BST_CLONES, or explicit.
 *
 * A file of kernels is compiled once for each width:
 *
 *     #define BST_SIMD_KERNELS "imgproc/measure/fit_kernels.inc"
 *     #include "sim/core/simd_each.inc"
 *
 * In it bst_floats is a vector of BST_WIDTH floats and bst_ints its comparison's, and
 * BST_SIMD(name) names a function of that width; BST_SIMD_PICK(name)(...) calls the one for this
 * processor. Code for 16 floats at a time is not written: what the compiler makes of such vectors
 * on processors without registers for them goes through memory, five times slower.
 *
 * Contraction is off for the whole project, so that all widths round alike; a kernel that sums does
 * so in BST_LANES separate sums (imgproc/detect/simd_layout.h), whatever the width. */
#ifndef BST_CORE_SIMD_H
#define BST_CORE_SIMD_H

#include <stdint.h>
#include <string.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define BST_SIMD_X86
#endif

/* Marks a function of plain loops that is compiled for several instruction sets; the loader selects
 * one. Not with sanitizers, which are not initialised at that time. */
#if defined(BST_SIMD_X86) && defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define BST_CLONES __attribute__((target_clones("default", "avx2", "avx512f")))
/* for comparisons stored as numbers, which are slow with 512-bit registers */
#define BST_CLONES_256 __attribute__((target_clones("default", "avx2")))
/* for 16-bit numbers */
#define BST_CLONES_16 __attribute__((target_clones("default", "avx2", "arch=skylake-avx512")))
#else
#define BST_CLONES
#define BST_CLONES_256
#define BST_CLONES_16
#endif

/* for what is to be compiled with its caller, also for wider registers */
#define BST_INLINED inline __attribute__((always_inline))

#define BST_SIMD_TYPES(width)                                                   \
    typedef float bst_floats_##width __attribute__((vector_size(4 * (width)))); \
    typedef int32_t bst_ints_##width __attribute__((vector_size(4 * (width)))); \
    /* independent of alignment */                                              \
    typedef float bst_floats_at_##width                                         \
        __attribute__((vector_size(4 * (width)), aligned(sizeof(float)), may_alias));
BST_SIMD_TYPES(4)
BST_SIMD_TYPES(8)
BST_SIMD_TYPES(16)
#undef BST_SIMD_TYPES

#define BST_LOAD(p) (*(const bst_floats_at *)(p))
#define BST_STORE(p, v) (*(bst_floats_at *)(p) = (v))
/* max(v, 0) */
#define BST_ABOVE_0(v) ((bst_floats)((bst_ints)(v) & ((v) > 0.0f)))
#define BST_SIMD_INLINE static inline __attribute__((always_inline))

/* Stores a vector to memory aligned to 16 bytes, bypassing the caches, so that the cache line is
 * not read first. Call bst_simd_stream_end() before other threads read it. */
#ifdef BST_SIMD_X86
#define BST_STREAM(to, v) bst_simd_stream(to, (const char *)&(v), BST_WIDTH)
BST_SIMD_INLINE void bst_simd_stream(float *to, const char *from, int floats) {
    for (int i = 0; i < floats; i += 4) {
        bst_floats_4 part;
        memcpy(&part, from + sizeof(float) * (size_t)i, sizeof part);
        __builtin_ia32_movntps(to + i, part);
    }
}
#else
#define BST_STREAM(to, v) BST_STORE(to, v)
#endif

/* Makes streamed stores visible to other threads. */
static inline void bst_simd_stream_end(void) {
#ifdef BST_SIMD_X86
    __builtin_ia32_sfence();
#endif
}

/* Width of the vectors in use, in floats: 4, 8 or 16, limited by processor and bst_simd_limit. */
int bst_simd_floats(void);
/* For tests that compare widths: limits the vector width from now on. */
void bst_simd_limit(int floats);

#ifdef BST_SIMD_X86
#define BST_SIMD_PICK(name) \
    (bst_simd_floats() == 16 ? name##_16 : bst_simd_floats() == 8 ? name##_8 : name##_4)
#else
#define BST_SIMD_PICK(name) name##_4
#endif

#endif
