/* Inverse of small symmetric positive definite matrices. */
#ifndef BST_CORE_SYMMETRIC_H
#define BST_CORE_SYMMETRIC_H

#include <stdbool.h>

#define BST_SYMMETRIC_MOST 8

/* Writes the inverse of the symmetric positive definite n x n matrix `a` (row by row, its lower
 * triangle is read, n <= BST_SYMMETRIC_MOST) to `out`, exactly symmetric, by Cholesky after scaling
 * the diagonal to 1, so that axes of very different scale keep their precision. False, `out`
 * untouched, when a pivot of the scaled matrix is below 1e-13: the inverse's relative error, about
 * n 1e-16 / pivot, would leave fewer than three digits. `out` may be `a`. */
bool bst_symmetric_invert(int n, const double *a, double *out);

#endif
