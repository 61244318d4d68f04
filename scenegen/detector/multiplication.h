/* Multiplication register: table of the law of few electrons, for kernels/readout.cl. */
#ifndef BST_SCENEGEN_DETECTOR_MULTIPLICATION_H
#define BST_SCENEGEN_DETECTOR_MULTIPLICATION_H

#include "scenegen/kernels/scene_shared.h"

enum { BST_MULTIPLICATION_FLOATS = BST_MULTIPLY_FEW * (BST_MULTIPLY_STEPS + 1) };

/* Quantile of the gamma distribution of shape n (density x^(n-1) e^-x / (n-1)!) at the probability
 * of a normal quantile.
 *
 * Given:     n  1 to 1000
 *            z  |z| <= 8
 * Notes:     relative error below 1e-12. */
double bst_multiplication_quantile(int n, double z);

/* Fills table[n - 1][k] with what the expansion of kernels/readout.cl (gamma_expand) lacks of the
 * quantile of n electrons at z = k / BST_MULTIPLY_STEPS * 2 BST_MULTIPLY_REACH -
 * BST_MULTIPLY_REACH; the row of BST_MULTIPLY_FEW electrons is 0.
 *
 * Notes:     with it, the chi-square divergence from the gamma distribution is below 2e-9 for
 *            the numbers of electrons tested, from 1 to 200 (test_multiplication.c). */
void bst_multiplication_table(float table[BST_MULTIPLICATION_FLOATS]);

/* The expansion of kernels/readout.cl in double precision. */
double bst_multiplication_expansion(double n, double z);

#endif
