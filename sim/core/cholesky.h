/* Solves small symmetric positive definite systems. A matrix a has `stride` numbers per row; the
 * lower triangle of order n is used. */
#ifndef BST_CORE_CHOLESKY_H
#define BST_CORE_CHOLESKY_H

#include <math.h>
#include <stdbool.h>

/* Replaces the lower triangle by its Cholesky factor. False: a pivot is not above `least_share` (>=
 * 0) of its diagonal element, or overflows. */
static inline bool bst_cholesky_factor(double *a, int stride, int n, double least_share) {
    for (int j = 0; j < n; j++) {
        double *row = a + j * stride, whole = row[j], d = whole;
        for (int k = 0; k < j; k++) {
            d -= row[k] * row[k];
        }
        if (!(d > least_share * whole) || !(whole < 1e280)) {
            return false;
        }
        row[j] = sqrt(d);
        for (int i = j + 1; i < n; i++) {
            double *below = a + i * stride, s = below[j];
            for (int k = 0; k < j; k++) {
                s -= below[k] * row[k];
            }
            below[j] = s / row[j];
        }
    }
    return true;
}

/* Solves the factored system; replaces b [n] by the solution. */
static inline void bst_cholesky_solve(const double *l, int stride, int n, double *b) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) {
            b[i] -= l[i * stride + k] * b[k];
        }
        b[i] /= l[i * stride + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) {
            b[i] -= l[k * stride + i] * b[k];
        }
        b[i] /= l[i * stride + i];
    }
}

#endif
