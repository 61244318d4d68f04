/* Hot pixels of a dark-current map: share and law of their rates, and the charge that trails them.
 */
#ifndef BST_ANALYSIS_CHARACTERIZE_HOT_PIXELS_H
#define BST_ANALYSIS_CHARACTERIZE_HOT_PIXELS_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/analysis/characterize/clipped_moments.h"

/* Hot pixels: rates beyond the others whose decimal logarithm is normal. */
typedef struct bst_hot_pixels {
    int64_t found; /* above the limit */
    double limit;  /* rate over that of other pixels */
    bst_sensor_estimate fraction, median, spread_dex;
} bst_hot_pixels;

/* Fits the law of hot pixels to those above a limit; those below it follow from the fit.
 *
 * Given:     excess  [count] rates over the mean of the other pixels; NAN is skipped
 *            limit   above the noise of other pixels, > 0
 *            most    rate from which on a pixel may be full: such ones count as "more than that";
 *                    NAN: none is, below the limit: all hot pixels may be
 * Returned:  NAN estimates with fewer than 20 hot pixels, or where most would lie below the limit
 * Reference: maximum likelihood of a normal distribution cut off below (Cohen 1950) and censored
 *            above (Cohen 1959, Technometrics 1, 217) */
bst_hot_pixels bst_hot_pixels_fit(const float *excess, size_t count, double limit, double most);

enum { BST_TRAIL_PIXELS = 5, BST_TRAIL_SIDES = 4, BST_TRAIL_CLASSES = 4 };

/* Charge behind hot pixels, in the direction away from the output. */
typedef struct bst_charge_trail {
    int used; /* hot pixels */
    /* charge over that of the hot pixel, by distance 1 to 5: rows above, rows below, columns right,
     * columns left */
    double profile[BST_TRAIL_SIDES][BST_TRAIL_PIXELS];
    bst_sensor_estimate parallel, serial; /* sum along the trail, less the other side; NAN */
    /* the same for a quarter of the hot pixels each, by charge: traps hold a share that falls with
     * the charge */
    double class_charge[BST_TRAIL_CLASSES], class_parallel[BST_TRAIL_CLASSES],
        class_serial[BST_TRAIL_CLASSES];
    bool parallel_up, serial_right; /* the trail lies at higher rows, columns */
} bst_charge_trail;

/* Stacks the neighbourhoods of isolated hot pixels.
 *
 * Given:     map    [height][width] charge over the level around, in any unit; NAN: not used
 *            least  smallest charge of a hot pixel, 20 standard deviations of the map or more
 *            most   largest, below saturation
 * Returned:  NAN estimates with fewer than 50 hot pixels
 * Notes:     Profiles are medians, which other hot pixels nearby do not shift; uncertainties from
 *            the scatter of 10 groups.
 * Reference: Massey et al. 2010, trails of warm pixels */
bst_charge_trail bst_charge_trail_measure(const float *map, int width, int height, double least,
                                          double most);

#endif
