/* Coherent pick-up: a sine along the rows, of one frequency, and a phase that grows equally from
 * row to row or is any in each. */
#ifndef BST_ANALYSIS_CHARACTERIZE_PICK_UP_LINE_H
#define BST_ANALYSIS_CHARACTERIZE_PICK_UP_LINE_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"
#include "sim/analysis/characterize/clipped_moments.h"

/* Spectrum of the rows and the strongest line in it. */
typedef struct bst_pick_up_line {
    int bins;           /* frequencies 0, 1/width, ... below 1/2 cycles/px */
    double *power;      /* [bins] mean over rows, relative to the continuum: 1 is white noise */
    double least_ratio; /* power over the continuum from which a line is certain */
    bool found;
    bst_sensor_estimate frequency; /* cycles/px */
    bst_sensor_estimate amplitude; /* half of peak to peak, in the unit of the rows */
    bst_sensor_estimate phase;     /* growth from row to row, cycles; NAN: not coherent */
    bool locked;                   /* of one phase in all frames: cancels in their differences */
    double phase_deg;              /* of pixel (0, 0), if locked and coherent; otherwise NAN */
    double pair_power; /* mean square in differences of pairs, half of it; NAN: no pairs */
} bst_pick_up_line;

/* Finds the line.
 *
 * Given:     rows  [height][width] without levels of rows and columns; changed: outliers are
 *                  clipped at 6 robust standard deviations
 * Errors:    BST_ERR_MEMORY
 * Ownership: free(out->power)
 * Notes:     The mean spectrum of H rows of white noise scatters by 1/sqrt(H); a line has 7 of
 *            that. Uncertainties come from the scatter of 8 groups of rows.
 * Reference: Welch 1967, with a Hann window and rows as segments */
bst_status bst_pick_up_line_find(bst_ctx *ctx, float *rows, int width, int height,
                                 bst_pick_up_line *out) BST_MUST_CHECK;

/* Measures the amplitude of a line that was found in other rows.
 *
 * Given:     rows  as for bst_pick_up_line_find
 *            line  its frequency
 * Returned:  line->amplitude
 * Errors:    BST_ERR_MEMORY */
bst_status bst_pick_up_line_amplitude(bst_ctx *ctx, float *rows, int width, int height,
                                      bst_pick_up_line *line) BST_MUST_CHECK;

/* Phase of a line at pixel (0, 0), as the detector's key pick_up/phase_deg has it.
 *
 * Given:     rows  as for bst_pick_up_line_find
 *            line  its frequency and growth from row to row
 * Returned:  -180 to 180 deg; NAN: the rows are not coherent */
double bst_pick_up_line_phase_deg(const float *rows, int width, int height,
                                  const bst_pick_up_line *line);

/* Mean square of a sine by the covariance of pixels 1, 2, ... `lags` apart, to which white noise
 * does not add; not below 0. */
double bst_pick_up_line_power(const double *covariance, int lags, double cycles_px);

#endif
