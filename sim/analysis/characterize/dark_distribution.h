/* Law of the dark currents of a sensor whose hot pixels are not separate from the others. */
#ifndef BST_ANALYSIS_CHARACTERIZE_DARK_DISTRIBUTION_H
#define BST_ANALYSIS_CHARACTERIZE_DARK_DISTRIBUTION_H

#include <stdbool.h>

#include "sim/analysis/characterize/sensor_figures.h"

/* The detector model's law: a log-normal one of mean `dark` and relative RMS `dsnu`; a share
 * `hot_fraction` of the pixels has a log-normal rate of its own on top. */
typedef struct bst_dark_distribution {
    double dark, dsnu; /* e-/s, 1 */
    double hot_fraction, hot_median, hot_spread_dex;
} bst_dark_distribution;

/* Noise of a map of dark currents. */
typedef struct bst_dark_noise {
    double variance;   /* besides shot noise of the dark current, (e-/s)^2 */
    double exposure_s; /* of all frames together */
} bst_dark_noise;

/* Share of the pixels of a noisy map that lie below a rate. */
double bst_dark_distribution_below(const bst_dark_distribution *d, const bst_dark_noise *noise,
                                   double rate_e_per_s);

/* Fits the law to percentiles of a map.
 *
 * Given:     percentiles  at bst_sensor_percentiles, e-/s
 *            start        used if not NULL; otherwise two starts are compared
 * Returned:  *out; NAN without a finite percentile
 *            false: a percentile is not finite or is missed by more than three tolerances (5 % up
 *            to the 95th, 10 % to 15 % above)
 * Notes:     The shares beyond the percentiles are compared, by their logarithms. */
bool bst_dark_distribution_fit(const double percentiles[BST_SENSOR_PERCENTILES],
                               const bst_dark_noise *noise, const bst_dark_distribution *start,
                               bst_dark_distribution *out);

#endif
