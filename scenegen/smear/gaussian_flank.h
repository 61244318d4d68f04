/* Where errors of nodes fall in the image of a point with a Gaussian PSF: beside its peak there is
 * less noise, and in pixels wider than the PSF much less. */
#ifndef BST_SCENEGEN_SMEAR_GAUSSIAN_FLANK_H
#define BST_SCENEGEN_SMEAR_GAUSSIAN_FLANK_H

#include "scenegen/light_flank.h"

/* Measures the derivatives of order 2, 3, 4 and 6 of a point's image, along the pixels' rows and at
 * two angles to them, over the greatest along the rows, by the light of the pixel. For a point,
 * those of order 2 also of a covariance that is too large along an angle and as much too small
 * across it.
 *
 * Given:     sigma_px     of the PSF, more than 0
 *            binning      side of a read-out pixel in the sensor's, at least 1
 *            smoothed_px2 variance by which a path along the rows widens the light, derivatives
 *                         along the rows alone; 0: a point's light
 * Returned:  *out         classes without a pixel: 0
 * Notes:     The mean of a derivative over a pixel is the difference of the derivative of one order
 *            less between its edges. Pixels may lie anywhere relative to the point. */
void bst_gaussian_flank_measure(double sigma_px, int binning, double smoothed_px2,
                                bst_light_flank *out);

#endif
