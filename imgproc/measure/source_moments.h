/* Second moments of a source: length, width and angle. */
#ifndef BST_IMGPROC_MEASURE_SOURCE_MOMENTS_H
#define BST_IMGPROC_MEASURE_SOURCE_MOMENTS_H

#include "imgproc/measure/deblend.h"

#define BST_EXTENT_SNR 10.0 /* below this SNR length and width are those of the model */

/* Source is streak-like from this length, FWHM of the PSF: points with noise measure less, blends
 * of two and streaks of 2.5 sigma or more reach it. */
#define BST_OWN_STREAK_LENGTH 1.5
/* The fit as a streak must lower chi-square by this much: for two more parameters noise does so in
 * exp(-9 / 2) = 1 % of the points. */
#define BST_OWN_STREAK_GAIN 9.0

/* Sets length, width and angle of source i from its second moments, measured on pixels up to
 * `wider` px beyond its stamp, or from the model. Returns true if they are measured. */
bool bst_source_moments_measure(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                                double wider);

/* Refits a point that is longer than the PSF as a streak along the axis of its moments, if that
 * lowers chi-square on the same pixels. Moments give a first length; a parabola through three
 * values of chi-square refines it. */
void bst_source_moments_own_streak(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);

#endif
