/* Inverse of a symmetric positive definite 3x3 matrix. */
#ifndef BST_TRACKER_SYMMETRIC3_H
#define BST_TRACKER_SYMMETRIC3_H

#include <stdbool.h>

/* Writes the inverse of symmetric positive definite `a` to `out` by Cholesky after scaling the
 * diagonal to 1 (axes of very different size keep their digits). False, `out` untouched, when the
 * scaled matrix has a pivot below 1e-13. */
bool bst_symmetric3_invert(const double a[3][3], double out[3][3]);

#endif
