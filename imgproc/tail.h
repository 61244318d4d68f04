/* Tails of normal noise and of what is nearly normal. */
#ifndef BST_IMGPROC_TAIL_H
#define BST_IMGPROC_TAIL_H

/* Maxima above a high u per unit area of a smooth normal field of unit variance; `density` is the
 * square root of the determinant of its gradient's covariance (Adler 1981, theorem 6.3.1). */
double bst_tail_maxima(double u, double density);

/* P(Y > v | X > u) for unit normals of correlation rho. */
double bst_tail_both(double u, double v, double rho);

/* The value that a sum with this skewness and excess kurtosis, of unit variance, exceeds as often
 * as a normal one exceeds u (Cornish and Fisher 1938: to the second order). */
double bst_tail_quantile(double u, double skewness, double excess);

#endif
