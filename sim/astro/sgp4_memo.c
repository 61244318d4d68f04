/* The memo of a resonant orbit's integration: a sequence lock whose writers do not wait (Boehm,
 * "Can seqlocks get along with programming language memory models?", MSPC 2012). */
#include "sim/astro/sgp4_internal.h"

bool bst_sgp4_recall(bst_sgp4_memo *memo, bst_sgp4_knot *knot) {
    unsigned before = atomic_load_explicit(&memo->version, memory_order_acquire);
    if (before == 0 || before % 2 != 0) {
        return false;
    }
    knot->steps = atomic_load_explicit(&memo->steps, memory_order_relaxed);
    knot->n = atomic_load_explicit(&memo->n, memory_order_relaxed);
    knot->lambda = atomic_load_explicit(&memo->lambda, memory_order_relaxed);
    knot->perigee.re = atomic_load_explicit(&memo->perigee_re, memory_order_relaxed);
    knot->perigee.im = atomic_load_explicit(&memo->perigee_im, memory_order_relaxed);
    atomic_thread_fence(memory_order_acquire);
    return atomic_load_explicit(&memo->version, memory_order_relaxed) == before;
}

void bst_sgp4_remember(bst_sgp4_memo *memo, const bst_sgp4_knot *knot) {
    unsigned before = atomic_load_explicit(&memo->version, memory_order_relaxed);
    if (before % 2 != 0 ||
        !atomic_compare_exchange_strong_explicit(&memo->version, &before, before + 1,
                                                 memory_order_acquire, memory_order_relaxed)) {
        return;
    }
    atomic_thread_fence(memory_order_release);
    atomic_store_explicit(&memo->steps, knot->steps, memory_order_relaxed);
    atomic_store_explicit(&memo->n, knot->n, memory_order_relaxed);
    atomic_store_explicit(&memo->lambda, knot->lambda, memory_order_relaxed);
    atomic_store_explicit(&memo->perigee_re, knot->perigee.re, memory_order_relaxed);
    atomic_store_explicit(&memo->perigee_im, knot->perigee.im, memory_order_relaxed);
    atomic_store_explicit(&memo->version, before + 2, memory_order_release);
}
