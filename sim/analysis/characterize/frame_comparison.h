/* Statistics by which simulated frames are compared with real ones. */
#ifndef BST_ANALYSIS_CHARACTERIZE_FRAME_COMPARISON_H
#define BST_ANALYSIS_CHARACTERIZE_FRAME_COMPARISON_H

#include "sim/analysis/characterize/sensor_figures.h"

enum { BST_COMPARISON_LAGS = 48, BST_COMPARISON_BANDS = 25 };

/* Of one frame. */
typedef struct bst_frame_statistics {
    double percentiles_dn[BST_SENSOR_PERCENTILES]; /* bst_sensor_percentiles, over the median */
    double median_dn;
    /* correlation coefficient of pixels 1, 2, ... apart along rows and columns */
    double along_rows[BST_COMPARISON_LAGS], along_columns[BST_COMPARISON_LAGS];
    /* power density along the rows at frequencies 0 to 1/2 cycles/px, DN^2 px */
    double spectrum[BST_COMPARISON_BANDS];
} bst_frame_statistics;

/* Frequency of a value of the spectrum, cycles/px. */
double bst_comparison_frequency(int band);

/* Computes the statistics.
 *
 * Given:     image  [height][width] DN; NAN is left out
 * Errors:    BST_ERR_MEMORY
 * Notes:     For correlation and spectrum a line through the means of the rows is subtracted, and
 *            values beyond five standard deviations of the core are set to that limit: hot pixels
 *            are compared by the percentiles. The spectrum is that of the correlation within 48 px,
 *            with Parzen's window.
 * Reference: Blackman and Tukey 1958, The Measurement of Power Spectra; Parzen 1961, Technometrics
 *            3, 167 */
bst_status bst_frame_statistics_of(bst_ctx *ctx, const float *image, int width, int height,
                                   bst_frame_statistics *out) BST_MUST_CHECK;

#endif
