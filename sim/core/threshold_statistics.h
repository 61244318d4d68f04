/* Threshold statistics of normal and nearly normal noise: false alarms, conditional exceedance,
 * quantiles. */
#ifndef BST_CORE_THRESHOLD_STATISTICS_H
#define BST_CORE_THRESHOLD_STATISTICS_H

/* Expected maxima above a high u per unit area of a smooth normal field of unit variance;
 * `density`: square root of the determinant of its gradient's covariance (Adler 1981, theorem
 * 6.3.1). */
double bst_threshold_maxima(double u, double density);

/* P(Y > v | X > u) for standard normals with correlation rho. */
double bst_threshold_exceeds_too(double u, double v, double rho);

/* A weighted sum of independent pixels with unit variance: sums of powers of the weights, from the
 * third on. */
enum { BST_THRESHOLD_POWERS = 22 };
typedef struct bst_threshold_weights {
    double power[BST_THRESHOLD_POWERS];
} bst_threshold_weights;

/* Noise of a pixel: normal, Poisson and quantisation. */
typedef struct bst_threshold_noise {
    double noise_e, counted_e2,
        step_e; /* total noise; variance of Poisson electrons; quantisation step */
} bst_threshold_noise;

/* Value that the weighted sum exceeds with the probability with which a normal variable exceeds u >
 * 0. Saddlepoint approximation from its cumulant generating function (Lugannani and Rice, Advances
 * in Applied Probability 12, 1980; Barndorff-Nielsen's r*), whose cumulants are those of the
 * Poisson distribution and of uniform quantisation times the sums of powers. */
double bst_threshold_quantile(double u, const bst_threshold_weights *weights,
                              const bst_threshold_noise *noise);

#endif
