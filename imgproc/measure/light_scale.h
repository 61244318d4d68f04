/* SNR of a frame's sources by their light, once the PSF of the fits is no longer that of the
 * matched filter: frame_width.h. */
#ifndef BST_IMGPROC_MEASURE_LIGHT_SCALE_H
#define BST_IMGPROC_MEASURE_LIGHT_SCALE_H

#include "imgproc/measure/deblend.h"

/* Begins a frame whose fits have the PSF of the filter. */
void bst_light_scale_clear(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Follows the fits' PSF, which has become another Gaussian than the filter's, and the widening that
 * was measured beside it.
 *
 * Notes:     Images p of Gaussians of the variances s^2 and t^2 have sum p_s p_t = sum p_m^2, with
 *            m^2 the mean of both: pixels and paths are the same in all three. The filter's output
 *            for a source of one electron is sum p_s p_t / sqrt(sum p_s^2) */
void bst_light_scale_adapt(bst_imgproc_locator *locator, const bst_locate_frame *frame);

#endif
