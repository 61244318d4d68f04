/* Width of the PSF in a frame, as its bright sources have it: jitter that the onboard side does not
 * know makes all images wider. */
#ifndef BST_IMGPROC_MEASURE_FRAME_WIDTH_H
#define BST_IMGPROC_MEASURE_FRAME_WIDTH_H

#include <stdbool.h>

#include "imgproc/detect/psf.h"
#include "imgproc/measure/fit.h"
#include "imgproc/measure/source_profile.h"

enum { BST_FRAME_WIDTH_SOURCES = 32 };

/* Widenings measured on the sources of a frame, relative to the PSF of the fits. */
typedef struct bst_frame_width {
    double sum_px2, weight; /* weighted by the inverse variance, with a prior of no widening */
    double first_px2[BST_FRAME_WIDTH_SOURCES]; /* [count], ascending: of the first sources */
    int count, rounds; /* rounds: how often the PSF has been adapted in this frame */
} bst_frame_width;

/* Begins a frame whose fits have the PSF of `profiles`. */
void bst_frame_width_clear(bst_frame_width *width, const bst_source_profiles *profiles);

/* Adds the widening that a bright source's fit has measured, if it did. The mean leaves out those
 * of more than half of the PSF's variance: pairs and bodies. */
void bst_frame_width_add(bst_frame_width *width, const bst_source_profiles *profiles,
                         const bst_imgproc_source *source);

/* Mean widening of the PSF's variance, px^2 per axis. */
double bst_frame_width_mean(const bst_frame_width *width);

/* Makes a Gaussian PSF as wide as half of its bright sources at least, by the median, if a fit that
 * knows widening to first order finds too little light in them. Known PSFs stay as they are.
 *
 * Returned:  true: `profiles` has changed, the widenings are forgotten; fit the sources again
 * Notes:     the fit of a Gaussian of the variance s^2 (1 + u) by one of s^2 and its derivative has
 *            2 a - a^2 of the light, a = 1 / (1 + u / 2), in uniform noise */
bool bst_frame_width_adapt(bst_frame_width *width, bst_source_profiles *profiles,
                           const bst_imgproc_gauss *psf);

#endif
