/* Selection by rank: medians without sorting. */
#ifndef BST_IMGPROC_VALUE_OF_RANK_H
#define BST_IMGPROC_VALUE_OF_RANK_H

/* The value that would be at place k in ascending order.
 *
 * Given:     values  [count] finite; reordered
 *            k       0 to count - 1
 * Reference: Hoare 1961, CACM 4, 321 (FIND) */
static inline float bst_value_of_rank(float *values, int count, int k) {
    int low = 0, high = count - 1;
    while (low < high) {
        /* median of three */
        float a = values[low], b = values[low + (high - low) / 2], c = values[high];
        float pivot = a < b ? (b < c ? b : (a < c ? c : a)) : (a < c ? a : (b < c ? c : b));
        int i = low, j = high;
        while (i <= j) {
            while (values[i] < pivot) {
                i++;
            }
            while (values[j] > pivot) {
                j--;
            }
            if (i <= j) {
                float v = values[i];
                values[i++] = values[j];
                values[j--] = v;
            }
        }
        if (k <= j) {
            high = j;
        } else if (k >= i) {
            low = i;
        } else {
            break;
        }
    }
    return values[k];
}

#endif
