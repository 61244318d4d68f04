/* Grid error of the Fourier render path for the image of a point, by pixel brightness. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_ERROR_H
#define BST_SCENEGEN_FOURIER_FOURIER_ERROR_H

#include "scenegen/fourier/fourier_grid.h"
#include "scenegen/light_classes.h"

/* Distances from a point for which its errors are known: steps of BST_FAR_STEP_PX. */
enum { BST_FAR_STEPS = 24, BST_FAR_STEP_PX = 2 };

typedef struct bst_fourier_error {
    /* largest error of a pixel of the class, relative to the PSF's peak; the same of a pixel at
     * least n steps away along an axis */
    double most[BST_LIGHT_CLASSES], far[BST_FAR_STEPS];
    /* the same of what the widening kernel differs from a Gaussian's convolution, for a node
     * widened by widest_px2; about in proportion to the widening */
    double widened[BST_LIGHT_CLASSES], far_widened[BST_FAR_STEPS], widest_px2;
} bst_fourier_error;

/* Measures the largest grid errors over all sub-sample positions and field nodes.
 *
 * Given:     axis        grid along x and y
 *            binning     of read-out pixels, whose mean error is over the mean light of their peak
 *            widest_px2  largest widening of a node; 0: none
 * Errors:    BST_ERR_MEMORY */
bst_status bst_fourier_error_measure(bst_ctx *ctx, const bst_psf *psf, const bst_fourier_band *band,
                                     const bst_fourier_axis axis[2], int binning, double widest_px2,
                                     bst_fourier_error *out) BST_MUST_CHECK;

/* A point's light and noise. */
typedef struct bst_fourier_point {
    double electrons;        /* in all pixels */
    double peak_e;           /* light in its brightest pixel */
    double dark_variance_e2; /* noise variance of a dark pixel */
    double widening_px2;     /* of its nodes */
    double gap_px; /* distance from the window, which contains only its wings; 0: inside */
} bst_fourier_point;

/* Error of the worst pixel of a point, in that pixel's sigma. */
double bst_fourier_error_sigma(const bst_fourier_error *error, const bst_fourier_point *point);

#endif
