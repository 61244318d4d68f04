#include "sim/core/simd.h"

#include <stdatomic.h>

static atomic_int limit = 16;

/* Widest SIMD width of the processor, in floats. */
static int widest(void) {
#ifdef BST_SIMD_X86
    if (__builtin_cpu_supports("avx512f")) {
        return 16;
    }
    if (__builtin_cpu_supports("avx2")) {
        return 8;
    }
#endif
    return 4;
}

int bst_simd_floats(void) {
    int most = atomic_load_explicit(&limit, memory_order_relaxed), has = widest();
    return has < most ? has : most;
}

void bst_simd_limit(int floats) {
    atomic_store(&limit, floats);
}
