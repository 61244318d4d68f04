/* What smear_quadrature.c and smear_quadrature_error.c share. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_INTERNAL_H
#define BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_INTERNAL_H

/* Direction of the largest eigenvalue of a symmetric matrix that is not negative. A tie gives some
 * direction between. */
void bst_smear_nodes_main_axis(double a[3][3], double axis[3]);

#endif
