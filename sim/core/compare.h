/* Comparison functions for qsort and bsearch, minimum and maximum of three numbers. */
#ifndef BST_CORE_COMPARE_H
#define BST_CORE_COMPARE_H

#include <math.h>

/* Compares two doubles, ascending; NAN equals everything. */
static inline int bst_compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Compares two floats, ascending; NAN equals everything. */
static inline int bst_compare_floats(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Compares two ints, ascending. */
static inline int bst_compare_ints(const void *a, const void *b) {
    int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

/* Minimum (or maximum) of three numbers, ignoring NAN. */
static inline double bst_least_of_3(const double v[3]) {
    return fmin(v[0], fmin(v[1], v[2]));
}
static inline double bst_greatest_of_3(const double v[3]) {
    return fmax(v[0], fmax(v[1], v[2]));
}

#endif
