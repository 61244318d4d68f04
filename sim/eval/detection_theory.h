/* Detection theory of a known signal in Gaussian noise, and confidence intervals of counts. */
#ifndef BST_EVAL_DETECTION_THEORY_H
#define BST_EVAL_DETECTION_THEORY_H

#include <stdint.h>

#define BST_NORMAL_95 1.959963984540054 /* two-sided 95 % quantile of the normal distribution */

/* Upper tail Q(x) of the standard normal distribution, accurate to a few ulp where the result is a
 * normal number (x < 37.5). */
double bst_eval_normal_tail(double x);
/* Inverse of Q: x with Q(x) = tail, 0 < tail < 1, accurate to a few ulp (absolutely near 0);
 * infinite at 0 and 1, NAN outside. Tails below 1e-89 use the asymptotic series of Q (Abramowitz
 * and Stegun 26.2.12). */
double bst_eval_normal_tail_inverse(double tail);

/* Probability of detection of a known signal in white Gaussian noise with its matched filter at
 * false-alarm probability pfa: Q(Q^-1(pfa) - snr). It is the upper limit of all detectors (Neyman
 * and Pearson; Kay, Fundamentals of Statistical Signal Processing II, 1998, eq. 4.14). snr:
 * sqrt(sum s^2 / sigma^2). */
double bst_eval_ideal_pd(double pfa, double snr);
/* SNR at which bst_eval_ideal_pd equals pd: Q^-1(pfa) - Q^-1(pd). */
double bst_eval_ideal_snr(double pfa, double pd);

/* Probability of detection of a matched filter if the signal adds its own photon noise. The
 * variance of the filter output grows by own_light times the SNR (of the background's noise):
 * own_light = sum p^3 / (sum p^2)^1.5 / noise_e, with pixel fractions p and noise_e electrons of
 * noise per pixel. pd = Q((Q^-1(pfa) - snr) / sqrt(1 + own_light snr)). */
double bst_eval_matched_filter_pd(double pfa, double snr, double own_light);
/* SNR at which bst_eval_matched_filter_pd equals pd. */
double bst_eval_matched_filter_snr(double pfa, double pd, double own_light);

typedef struct bst_eval_interval {
    double low, high;
} bst_eval_interval;

/* Wilson score interval of a probability after `hits` of `trials` (Wilson 1927, JASA 22, 209); z:
 * two-sided normal quantile. 0 to 1 without trials. */
bst_eval_interval bst_eval_wilson_interval(int64_t hits, int64_t trials, double z);

/* Exact central interval of a Poisson mean after `count` events (Garwood 1936, Biometrika 28, 437)
 * with error probability alpha, 0 < alpha < 1, alpha / 2 on each side: half the chi-square
 * quantiles of 2 count and 2 count + 2 degrees of freedom. Relative error below 1e-9 for counts up
 * to 1e6. */
bst_eval_interval bst_eval_poisson_interval(int64_t count, double alpha);

#endif
