/* Chi-square with three degrees of freedom. */
#ifndef BST_CORE_CHI_SQUARE_H
#define BST_CORE_CHI_SQUARE_H

/* Probability that the sum of squares of three normal numbers of variance 1, of whose means the
 * squares have the sum d^2, exceeds x: non-central chi-square (Johnson, Kotz and Balakrishnan,
 * Continuous Univariate Distributions 2, 1995, eq. 29.11).
 *
 * Given:     x  >= 0
 *            d  >= 0; 0: central */
double bst_chi_square3_tail(double x, double d);

/* The value that central chi-square exceeds with the probability `tail`, 1e-300 < tail <= 1. */
double bst_chi_square3_quantile(double tail);

#endif
