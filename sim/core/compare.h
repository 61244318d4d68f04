/* Orders of numbers for qsort and bsearch. */
#ifndef BST_CORE_COMPARE_H
#define BST_CORE_COMPARE_H

/* Ascending, of two doubles; NAN is equal to everything. */
static inline int bst_compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Ascending, of two ints. */
static inline int bst_compare_ints(const void *a, const void *b) {
    int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

#endif
