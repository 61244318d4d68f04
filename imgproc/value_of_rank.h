/* Selection by rank: medians without sorting. */
#ifndef BST_IMGPROC_VALUE_OF_RANK_H
#define BST_IMGPROC_VALUE_OF_RANK_H

#include <stdbool.h>

/* Moves the values below a pivot, or those up to it, to the front; returns their number. Without
 * branches that depend on the values. */
static inline int bst_value_partition(float *values, int count, float pivot, bool up_to) {
    int below = 0;
    for (int i = 0; i < count; i++) {
        float v = values[i];
        values[i] = values[below];
        values[below] = v;
        below += up_to ? v <= pivot : v < pivot;
    }
    return below;
}

/* The value that would be at place k in ascending order.
 *
 * Given:     values  [count] finite; reordered
 *            k       0 to count - 1
 * Reference: Hoare 1961, CACM 4, 321 (FIND) */
static inline float bst_value_of_rank(float *values, int count, int k) {
    while (count > 1) {
        /* median of three */
        float a = values[0], b = values[count / 2], c = values[count - 1];
        float pivot = a < b ? (b < c ? b : (a < c ? c : a)) : (a < c ? a : (b < c ? c : b));
        int below = bst_value_partition(values, count, pivot, false);
        if (k < below) {
            count = below;
            continue;
        }
        values += below;
        count -= below;
        k -= below;
        int equal = bst_value_partition(values, count, pivot, true);
        if (k < equal || equal == 0) { /* 0: not a number */
            return pivot;
        }
        values += equal;
        count -= equal;
        k -= equal;
    }
    return values[0];
}

#endif
