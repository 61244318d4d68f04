/* Pool of work spaces shared by the threads of a loop. Which work space a part of the loop gets is
 * arbitrary, so its old contents must not matter. */
#ifndef BST_IMGPROC_DETECT_SCRATCH_POOL_H
#define BST_IMGPROC_DETECT_SCRATCH_POOL_H

#include <stdatomic.h>

enum { BST_BORROW_MOST = 33 };

typedef struct bst_scratch_pool {
    atomic_flag taken[BST_BORROW_MOST];
    int count; /* at least the number of threads */
} bst_scratch_pool;

static inline void bst_scratch_pool_init(bst_scratch_pool *b, int count) {
    b->count = count < BST_BORROW_MOST ? count : BST_BORROW_MOST;
    for (int i = 0; i < b->count; i++) {
        atomic_flag_clear(&b->taken[i]);
    }
}

/* Takes a free work space, spinning until there is one. Returns its index. */
static inline int bst_scratch_pool_take(bst_scratch_pool *b) {
    for (int i = 0;; i = i + 1 < b->count ? i + 1 : 0) {
        if (!atomic_flag_test_and_set_explicit(&b->taken[i], memory_order_acquire)) {
            return i;
        }
    }
}

/* Returns a work space to the pool. */
static inline void bst_scratch_pool_give(bst_scratch_pool *b, int index) {
    atomic_flag_clear_explicit(&b->taken[index], memory_order_release);
}

#endif
