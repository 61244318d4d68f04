/* SNR required for a probability of detection, from detections counted over SNR, and the loss
 * against the ideal detector. */
#ifndef BST_EVAL_PD_CURVE_H
#define BST_EVAL_PD_CURVE_H

#include <stdint.h>

/* Detections counted at one SNR. */
typedef struct bst_pd_point {
    double snr;
    int64_t trials, detected;
} bst_pd_point;

/* Probability of detection corrected for chance matches: raw = pd + (1 - pd) chance. Result within
 * 0..1. */
double bst_pd_without_chance(double raw, double chance);

typedef struct bst_pd_needed {
    double snr, sigma; /* NAN: the points do not enclose that probability */
} bst_pd_needed;

/* SNR at which the probability of detection (without chance) is pd, 0.05 <= pd <= 0.95, with its
 * standard deviation. The fit of Q^-1 of the probability is quadratic in SNR (linear with three
 * points), to points between 2 % and 98 %, by maximum likelihood of the binomial counts (probit
 * regression, Finney 1971). For an ideal detector it is linear with slope -1. */
bst_pd_needed bst_pd_snr_at(const bst_pd_point *points, int count, double chance, double pd);

/* Loss in dB, 20 log10(snr / ideal SNR), of a detector that needs `snr` for pd at the false-alarm
 * probability pfa; NAN unless 0 < pfa < pd. */
double bst_pd_loss_db(double snr, double pfa, double pd);

#endif
