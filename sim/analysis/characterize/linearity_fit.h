/* Linearity, full well and gain from flats of several exposures. */
#ifndef BST_ANALYSIS_CHARACTERIZE_LINEARITY_FIT_H
#define BST_ANALYSIS_CHARACTERIZE_LINEARITY_FIT_H

#include "sim/analysis/characterize/linearity_series.h"

enum { BST_LINEARITY_TERMS = 3 };

/* Level and noise of a frame without light. */
typedef struct bst_linearity_dark {
    double level[BST_STACK_BLOCKS];      /* DN */
    double variance[BST_STACK_BLOCKS];   /* of a pixel between frames, DN^2; NAN: unknown */
    bst_neighbour_covariance neighbours; /* between frames */
    double level_variance;               /* of the level from frame to frame, DN^2 */
} bst_linearity_dark;

/* What the series says; NAN: not determined. */
typedef struct bst_linearity {
    bool saturates;                    /* the longest exposures show the same signal */
    bool of_converter;                 /* it is the converter that saturates, not the pixel */
    int used;                          /* exposures below saturation */
    double largest_dn;                 /* signal of the longest of these, mean of the blocks */
    bst_sensor_estimate gain_e_per_dn; /* photon transfer, freed of the non-linearity */
    bst_sensor_estimate saturation_dn; /* signal above the level without light */
    bst_sensor_estimate full_well_e;   /* NAN where the converter saturates */
    bst_sensor_estimate terms[BST_LINEARITY_TERMS]; /* of n (1 + c1 u + c2 u^2 + c3 u^3), u = n over
                                                       the full well */
    bst_sensor_estimate error;         /* departure from the slope at 0, at largest_dn, share */
    double significance;               /* chi-squared of the curve against a line, per term */
    double slope_dn_per_s;             /* at 0, mean of the blocks */
    double shape[BST_LINEARITY_TERMS]; /* of the curve over slope times time, in time over
                                          longest_s; mean of the blocks */
    double longest_s;                  /* of the series */
} bst_linearity;

/* Fits the detector's response to each of the blocks.
 *
 * Given:     series  6 exposures or more
 *            gain_e_per_dn, gain_sigma  used where the series has no pairs below saturation
 * Notes:     Signal of an exposure t: a t (1 + b1 t + b2 t^2 + b3 t^3), by least squares with the
 *            noise of each mean. The full well is where the curve reaches the saturated signal;
 *            terms c_i = b_i t_full^i. Exposures count as saturated beyond the break of photon
 *            transfer, where the variance falls below a quarter of its maximum; those with pixels
 *            within 5 standard deviations of it are left out. Errors from the scatter of the
 * blocks, times what is common to all blocks. Reference: Janesick 2007, Photon Transfer, chapters 5
 * and 7 */
void bst_linearity_fit(const bst_linearity_series *series, const bst_linearity_dark *dark,
                       bst_sensor_estimate gain, bst_linearity *out);

/* Slope of the logarithms: relative change of the signal over that of the charge, at a signal.
 *
 * Given:     signal_dn  above the level without light */
double bst_linearity_slope(const bst_linearity *fit, double signal_dn);

#endif
