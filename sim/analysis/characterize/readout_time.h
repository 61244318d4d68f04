/* Time of the read-out from the dark charge that packets gather in it. */
#ifndef BST_ANALYSIS_CHARACTERIZE_READOUT_TIME_H
#define BST_ANALYSIS_CHARACTERIZE_READOUT_TIME_H

#include <stdbool.h>

#include "sim/analysis/characterize/clipped_moments.h"

/* Least number of columns with a value in all pixels. */
enum { BST_READOUT_TIME_COLUMNS = 64 };

/* Time in which all rows are read.
 *
 * Given:     bias        [height][width] level of frames without exposure
 *            dark        [height][width] what darks have more, in the unit of bias; NAN: none
 *            exposure_s  of the darks
 *            last_first  the last row is read first, otherwise row 0
 * Returned:  s; NAN: fewer than BST_READOUT_TIME_COLUMNS columns have a value in all pixels
 * Notes:     On its way a packet passes the pixels of its column that are read before it. Slope of
 *            the level against the sum of their dark signals, each column with an offset of its
 *            own, pixels beyond 5 standard deviations left out; a hot pixel marks the rows behind
 *            it. Standard error by leaving out eighths of the columns in turn. */
bst_sensor_estimate bst_readout_time(const float *bias, const float *dark, int width, int height,
                                     double exposure_s, bool last_first);

#endif
