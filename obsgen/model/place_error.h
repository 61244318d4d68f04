/* Position error of a faint point: noise moves the maximum of the filter output and bends it.
 * Internal to the generator. */
#ifndef BST_OBSGEN_MODEL_PLACE_ERROR_H
#define BST_OBSGEN_MODEL_PLACE_ERROR_H

#include "obsgen/calibration.h"

/* SNR from which the noise's curvature is negligible: 0.6 % of the error. */
#define BST_PLACE_ERROR_MOST_SNR 30.0

/* Standard deviation of the error at bst_obsgen_snrs, over the bound, as a calibration measures it:
 * from errors within 2.5 bounds, of points that exceed a threshold of 5.1.
 * tests/obsgen/test_place_error.c derives the values. */
extern const double bst_place_error_core[BST_OBSGEN_SNRS];

/* Turns the error of a linear fit into that of the maximum of the noisy output.
 *
 * Given:     snr    of the source without noise, positive
 *            level  output of the filter at the source, with its noise, SNR; positive
 *            h      standard normal draws for the noise's curvature along both axes, and its twist
 *            error  standard normal draws: error of the linear fit, in its standard deviations
 * Returned:  output at the maximum, SNR; a detection exceeds the threshold there
 *            error  of the maximum, in the same unit
 * Notes:     Noise of correlation exp(-r^2 / 4 S^2) is exp(-q^2 / 2) sum a_jk u^j v^k / sqrt(j!
 * k!), q^2 = u^2 + v^2, u = x / sqrt(2) S, with independent standard normal a_jk. The light snr
 * exp(-q^2 / 2) adds to a_00. The maximum by the terms up to the second order is at u = (g + H u) /
 * (level + g u + u H u / 2), g and H their gradient and curvature; the linear fit is u = g / snr.
 * Reference: Kostlan 1993, in From Topology to Computation, 419 (the expansion) */
double bst_place_error_bend(double snr, double level, const double h[3], double error[2]);

#endif
