/* The error that a grid of the Fourier path brings into the image of a point, pixel by pixel. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_ERROR_H
#define BST_SCENEGEN_FOURIER_FOURIER_ERROR_H

#include "scenegen/fourier/fourier_grid.h"

/* Pixels in classes of their light: class k has 2^-(k + 1) to 2^-k of the brightest pixel's, the
 * last one all that is less. */
enum { BST_LIGHT_CLASSES = 20 };

typedef struct bst_fourier_error {
    double most[BST_LIGHT_CLASSES]; /* error of a pixel of the class, over the PSF's peak */
} bst_fourier_error;

/* The largest errors for any place of the point between the grid's samples, of all field nodes.
 * axis: along x and y. BST_ERR_MEMORY. */
bst_status bst_fourier_error_measure(bst_ctx *ctx, const bst_psf *psf, const bst_fourier_band *band,
                                     const bst_fourier_axis axis[2],
                                     bst_fourier_error *out) BST_MUST_CHECK;

/* Error of the worst pixel, in its sigma, of a point with `peak_e` electrons in its brightest pixel
 * on noise of variance dark_variance_e2; of its wings alone, if so asked. */
double bst_fourier_error_sigma(const bst_fourier_error *error, bool wings, double peak_e,
                               double dark_variance_e2);

#endif
