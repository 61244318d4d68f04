/* From counted detections over SNR to the SNR that a probability of detection needs, and its loss
 * against the ideal. */
#ifndef BST_EVAL_PD_CURVE_H
#define BST_EVAL_PD_CURVE_H

#include <stdint.h>

/* What was counted at one SNR. */
typedef struct bst_pd_point {
    double snr;
    int64_t trials, detected;
} bst_pd_point;

/* Probability of detection without chance: where a match comes about by chance with probability
 * `chance`, a share `raw` = pd + (1 - pd) chance is matched. Within 0..1. */
double bst_pd_without_chance(double raw, double chance);

typedef struct bst_pd_needed {
    double snr, sigma; /* NAN: the points do not reach that probability from both sides */
} bst_pd_needed;

/* SNR at which the probability of detection (without chance) is pd, 0.05 <= pd <= 0.95, with its
 * standard deviation. Q^-1 of the probability is a quadratic in the SNR (a line with three points),
 * fitted to the points between 2 % and 98 % by maximum likelihood of the binomial counts (probit
 * regression, Finney 1971); of an ideal detector it is a line of slope -1. */
bst_pd_needed bst_pd_snr_at(const bst_pd_point *points, int count, double chance, double pd);

/* Loss in dB, 20 log10(snr / ideal SNR), of a detector that needs `snr` for pd at the false-alarm
 * probability pfa; NAN unless 0 < pfa < pd. */
double bst_pd_loss_db(double snr, double pfa, double pd);

#endif
