/* Line through the non-destructive reads of a ramp: weights and noise. */
#ifndef BST_OPTICS_RAMP_FIT_H
#define BST_OPTICS_RAMP_FIT_H

#include "boresight/detector_config.h"

/* Weights of the reads in the signal of the whole exposure.
 *
 * Given:     used    of the reads from the first on, 2 to ramp->reads
 * Returned:  weight  [used]; signal = sum of weight x read
 * Notes:     slope: 12 (N - 1) (i - (n - 1) / 2) / (n (n^2 - 1)) for read i of n that are used, of
 *            N (least squares with equal weights) */
void bst_ramp_weights(const bst_detector_ramp_config *ramp, int used, double *weight);

/* Variance of the shot noise of the signal over that of the charge, for a constant flux.
 *
 * Notes:     slope: 6/5 (N^2 + 1) / (N (N + 1)) (Garnett and Forrest 1993, Proc. SPIE 1946, 395) */
double bst_ramp_excess(const bst_detector_ramp_config *ramp);

/* Read noise of the signal, e-.
 *
 * Given:     read_noise_e  of a single read, independent of the others; the ramp's 1/f noise is
 *                          added to it
 *
 *            used          reads, 2 to ramp->reads
 *
 * Notes:     slope of all reads: read_noise_e sqrt(12 (N - 1) / (N (N + 1))) (as above)
 *
 *            1/f noise: covariance sigma^2 / 6 sum over k = 0 ... 5 of e^(-|i - j| / 4^k) */
double bst_ramp_noise_e(const bst_detector_ramp_config *ramp, double read_noise_e, int used);

#endif
