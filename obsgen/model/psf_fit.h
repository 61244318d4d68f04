/* What image processing makes of several points merged into one detection, for a PSF that is no
 * Gaussian: the fit of one point on their pixels, and the moments of their light. Internal to the
 * generator. */
#ifndef BST_OBSGEN_MODEL_PSF_FIT_H
#define BST_OBSGEN_MODEL_PSF_FIT_H

#include "obsgen/model/response.h"
#include "obsgen/streak/path_fit.h"

/* Pixels and noise of a fit. */
typedef struct bst_psf_fit_frame {
    double reach_px; /* half side of the fitted stamp */
    double sigma_px; /* Gaussian nearest to the fitted PSF, without the pixel */
    double limit_px; /* largest move along an axis */
    double noise_e;  /* of a pixel without the sources' light, over the root of the excess noise */
    double saturated_e; /* light of a pixel from which on it is left out; 0: none is */
} bst_psf_fit_frame;

/* Second moments of the light about a fitted point, px^2, without the pixel's own; xx 0: image
 * processing measures none. */
typedef struct bst_psf_fit_moments {
    double xx, xy, yy;
} bst_psf_fit_moments;

/* Fits one point to the light of several on the pixels about `start`, as image processing does with
 * a known PSF: place, flux and widening are free, each pixel has the weight 1 / (noise^2 + fitted
 * light). In the mean over noise.
 *
 * Given:     response  with a tabulated falloff
 *            points    places relative to `start`, px; flux, electrons
 *            start     place of the brightest maximum relative to the centre of a pixel, px
 * Returned:  place relative to `start`, flux in electrons, widening of the variance */
bst_path_point_fit bst_psf_fit_points(const bst_response *response, const bst_path_point *points,
                                      int count, const double start[2],
                                      const bst_psf_fit_frame *frame);

/* Second moments of the light about a fitted point under the Gaussian window of image processing,
 * which is removed by inverse covariances (imgproc/measure/source_moments.c).
 *
 * Given:     as bst_psf_fit_points; the pixels within three times reach_px */
bst_psf_fit_moments bst_psf_fit_measure(const bst_response *response, const bst_path_point *points,
                                        int count, const double start[2],
                                        const bst_psf_fit_frame *frame,
                                        const bst_path_point_fit *fit);

#endif
