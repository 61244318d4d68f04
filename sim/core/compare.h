/* Orders of numbers, for qsort and bsearch, and the ends of three. */
#ifndef BST_CORE_COMPARE_H
#define BST_CORE_COMPARE_H

#include <math.h>

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

/* The least and the greatest of three numbers; one that is NAN does not count. */
static inline double bst_least_of_3(const double v[3]) {
    return fmin(v[0], fmin(v[1], v[2]));
}
static inline double bst_greatest_of_3(const double v[3]) {
    return fmax(v[0], fmax(v[1], v[2]));
}

#endif
