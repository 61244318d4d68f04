/* Vectors of sixteen floats on the host's processor. */
#ifndef BST_SCENEGEN_LANES_H
#define BST_SCENEGEN_LANES_H

enum { BST_LANES = 16 };

typedef float bst_lanes __attribute__((vector_size(4 * BST_LANES)));

/* Functions on lanes, of which the loader chooses the one for the processor; contraction is off for
 * the whole project, so all give the same numbers. Address sanitizers start after the loader has
 * chosen. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define BST_LANES_FUNCTION __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define BST_LANES_FUNCTION
#endif
/* Their helpers. */
#define BST_LANES_INLINE static inline __attribute__((always_inline))

/* Stores past the caches what is read only after much else; bst_lanes_streamed() before other
 * threads read it. */
BST_LANES_INLINE void bst_lanes_stream(bst_lanes *to, const bst_lanes *from) {
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
    typedef float quarter __attribute__((vector_size(BST_LANES)));
    const quarter *q = (const quarter *)from;
    for (int i = 0; i < 4; i++) {
        __builtin_ia32_movntps((float *)to + 4 * i, q[i]);
    }
#else
    *to = *from;
#endif
}

BST_LANES_INLINE void bst_lanes_streamed(void) {
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
    __builtin_ia32_sfence();
#endif
}

/* Turns the square of 16 vectors of 16 numbers about its diagonal: vectors 8, 4, 2 and 1 apart
 * exchange their halves, quarters, eighths and sixteenths. */
BST_LANES_INLINE void bst_lanes_transpose(bst_lanes v[BST_LANES]) {
    bst_lanes t[BST_LANES];
    for (int i = 0; i < 8; i++) {
        t[i] = __builtin_shufflevector(v[i], v[i + 8], 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20,
                                       21, 22, 23);
        t[i + 8] = __builtin_shufflevector(v[i], v[i + 8], 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26,
                                           27, 28, 29, 30, 31);
    }
    for (int k = 0; k < 8; k++) {
        int i = (k & 3) + 2 * (k & 4);
        v[i] = __builtin_shufflevector(t[i], t[i + 4], 0, 1, 2, 3, 16, 17, 18, 19, 8, 9, 10, 11, 24,
                                       25, 26, 27);
        v[i + 4] = __builtin_shufflevector(t[i], t[i + 4], 4, 5, 6, 7, 20, 21, 22, 23, 12, 13, 14,
                                           15, 28, 29, 30, 31);
    }
    for (int k = 0; k < 8; k++) {
        int i = (k & 1) + 2 * (k & 6);
        t[i] = __builtin_shufflevector(v[i], v[i + 2], 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12,
                                       13, 28, 29);
        t[i + 2] = __builtin_shufflevector(v[i], v[i + 2], 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26,
                                           27, 14, 15, 30, 31);
    }
    for (int i = 0; i < BST_LANES; i += 2) {
        v[i] = __builtin_shufflevector(t[i], t[i + 1], 0, 16, 2, 18, 4, 20, 6, 22, 8, 24, 10, 26,
                                       12, 28, 14, 30);
        v[i + 1] = __builtin_shufflevector(t[i], t[i + 1], 1, 17, 3, 19, 5, 21, 7, 23, 9, 25, 11,
                                           27, 13, 29, 15, 31);
    }
}

#endif
