/* Tails of normal noise and of what is nearly normal. */
#ifndef BST_CORE_THRESHOLD_STATISTICS_H
#define BST_CORE_THRESHOLD_STATISTICS_H

/* Maxima above a high u per unit area of a smooth normal field of unit variance; `density` is the
 * square root of the determinant of its gradient's covariance (Adler 1981, theorem 6.3.1). */
double bst_threshold_maxima(double u, double density);

/* P(Y > v | X > u) for unit normals of correlation rho. */
double bst_threshold_exceeds_too(double u, double v, double rho);

/* A weighted sum of independent pixels, of unit variance: its sums of powers of the weights, from
 * the third on. */
enum { BST_THRESHOLD_POWERS = 22 };
typedef struct bst_threshold_weights {
    double power[BST_THRESHOLD_POWERS];
} bst_threshold_weights;

/* A pixel's noise: normal, counted electrons, digital steps. */
typedef struct bst_threshold_noise {
    double noise_e, counted_e2, step_e; /* all of it; variance of the electrons counted; a step */
} bst_threshold_noise;

/* The value that the sum exceeds as often as a normal one exceeds u > 0, by the saddlepoint of its
 * cumulant generating function (Lugannani and Rice, Advances in Applied Probability 12, 1980;
 * Barndorff-Nielsen's r*): the function's series has the cumulants of the Poisson distribution and
 * of even steps times the sums of powers. */
double bst_threshold_quantile(double u, const bst_threshold_weights *weights,
                              const bst_threshold_noise *noise);

#endif
