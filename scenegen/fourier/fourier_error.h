/* Grid error of the Fourier render path for the image of a point, by pixel brightness. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_ERROR_H
#define BST_SCENEGEN_FOURIER_FOURIER_ERROR_H

#include "scenegen/fourier/fourier_grid.h"

/* Brightness classes: class k has 2^-(k + 1) to 2^-k of the brightest pixel's light; the last one
 * all below. */
enum { BST_LIGHT_CLASSES = 20 };

typedef struct bst_fourier_error {
    /* largest error of a pixel of the class, relative to the PSF's peak */
    double most[BST_LIGHT_CLASSES];
} bst_fourier_error;

/* Measures the largest grid errors over all sub-sample positions and field nodes.
 *
 * Given:     axis  grid along x and y
 * Errors:    BST_ERR_MEMORY */
bst_status bst_fourier_error_measure(bst_ctx *ctx, const bst_psf *psf, const bst_fourier_band *band,
                                     const bst_fourier_axis axis[2],
                                     bst_fourier_error *out) BST_MUST_CHECK;

/* Error of the worst pixel, in its sigma, of a point with `peak_e` electrons in its brightest pixel
 * and dark noise variance dark_variance_e2; of its wings only, if `wings`. */
double bst_fourier_error_sigma(const bst_fourier_error *error, bool wings, double peak_e,
                               double dark_variance_e2);

#endif
