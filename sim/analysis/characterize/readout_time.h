/* Time of the read-out from the dark charge that packets gather in it. */
#ifndef BST_ANALYSIS_CHARACTERIZE_READOUT_TIME_H
#define BST_ANALYSIS_CHARACTERIZE_READOUT_TIME_H

#include <stdbool.h>

#include "sim/analysis/characterize/clipped_moments.h"

/* Least number of columns with a value in all pixels. */
enum { BST_READOUT_TIME_COLUMNS = 64 };

/* What the time of the read-out is found in. */
typedef struct bst_readout_frames {
    const float *bias; /* [height][width] level of frames without exposure */
    const float *dark; /* [height][width] what darks have more, in the same unit; NAN: none */
    double bias_variance, dark_variance; /* of a pixel's noise in each; that of dark has both */
    int width, height;
    double exposure_s; /* of the darks */
    bool last_first;   /* the last row is read first, otherwise row 0 */
} bst_readout_frames;

/* Time in which all rows are read.
 *
 * Returned:  s; NAN: fewer than BST_READOUT_TIME_COLUMNS columns have a value in all pixels, or the
 *            dark signal is not above the noise
 * Notes:     On its way a packet passes the pixels of its column that are read before it. Slope of
 *            the level against the sum of their dark signals, each column with an offset of its
 *            own, pixels beyond 5 standard deviations left out; a hot pixel marks the rows behind
 *            it. What the noise of bias adds to the products, and that of dark to the squares (a
 *            random walk), is subtracted. Standard error by leaving out eighths of the columns in
 *            turn. */
bst_sensor_estimate bst_readout_time(const bst_readout_frames *f);

#endif
