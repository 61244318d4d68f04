/* Heapsort of indices: in place and without allocation, unlike the C library's qsort. */
#ifndef BST_CORE_HEAPSORT_H
#define BST_CORE_HEAPSORT_H

#include <stdbool.h>

/* Strict order of indices: true if a sorts before b. A total order makes the result unique. */
typedef bool (*bst_index_before)(const void *context, int a, int b);

/* Moves the root of a heap down to its place. */
static inline void bst_heapsort_sift(int *items, int root, int count, bst_index_before before,
                                     const void *context) {
    int moved = items[root];
    for (int child; (child = 2 * root + 1) < count; root = child) {
        if (child + 1 < count && before(context, items[child], items[child + 1])) {
            child++;
        }
        if (!before(context, moved, items[child])) {
            break;
        }
        items[root] = items[child];
    }
    items[root] = moved;
}

/* Sorts `count` indices. */
static inline void bst_heapsort_indices(int *items, int count, bst_index_before before,
                                        const void *context) {
    for (int i = count / 2 - 1; i >= 0; i--) {
        bst_heapsort_sift(items, i, count, before, context);
    }
    for (int end = count - 1; end > 0; end--) {
        int swap = items[0];
        items[0] = items[end];
        items[end] = swap;
        bst_heapsort_sift(items, 0, end, before, context);
    }
}

#endif
