/* How long and wide a source is. */
#ifndef BST_IMGPROC_MEASURE_SOURCE_MOMENTS_H
#define BST_IMGPROC_MEASURE_SOURCE_MOMENTS_H

#include "imgproc/measure/deblend.h"

#define BST_EXTENT_SNR 10.0 /* below, extents are the model's own */

/* Principal axes of the measured or modelled second moments of *found, number i, from pixels up to
 * `wider` beyond its stamp. Whether they are measured. */
bool bst_source_moments_measure(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                                double wider);

/* A point that is longer than the PSF: fits it as a streak along the axis of its moments, as long
 * as that lowers chi-square on the same pixels. Moments give the length roughly, the parabola
 * through three values of chi-square gives it well. */
void bst_source_moments_own_streak(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);

#endif
