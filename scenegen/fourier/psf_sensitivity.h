/* How sensitive the image of a PSF is to nodes that replace a path: derivatives by direction, and
 * where they fall. */
#ifndef BST_SCENEGEN_FOURIER_PSF_SENSITIVITY_H
#define BST_SCENEGEN_FOURIER_PSF_SENSITIVITY_H

#include "boresight/status.h"
#include "scenegen/light_flank.h"
#include "scenegen/smear/smear_quadrature.h"
#include "sim/optics/psf.h"

typedef struct bst_psf_sensitivity {
    const bst_psf *psf; /* lent */
    double cutoff;      /* highest frequency, cycles/px */
    /* greatest derivatives of order 2, 4 and 6 along directions pi d / BST_NODE_DIRECTIONS from the
     * x axis, over the peak and those of a Gaussian of the sigma given */
    double part[BST_NODE_DIRECTIONS][3];
    /* the same of order 4 and 6, smoothed along the direction by n / BST_SMOOTH_PER of the
     * Gaussian's variance */
    double smooth[BST_NODE_DIRECTIONS][BST_SMOOTH_STEPS][2];
    /* image of a comb along a streak, over the streak's light, by the teeth per px, BST_ROW_STEPS
     * of them up to most_per_px */
    double row[BST_NODE_DIRECTIONS][BST_ROW_STEPS], most_per_px;
    /* least light up to n / BST_LIGHT_PER sigma from the peak along the direction, to either side,
     * over that of the peak */
    double light[BST_NODE_DIRECTIONS][BST_LIGHT_STEPS];
    /* of the derivatives of order 2, 4 and 6 along each direction; the greatest of all */
    bst_flank_curve flank[BST_FLANKS][BST_NODE_DIRECTIONS][3], any_flank[BST_FLANKS];
    /* of a path: of order 4 and 6 smoothed by at least n + 1 steps, and of a row of groups */
    bst_flank_curve smooth_flank[BST_NODE_DIRECTIONS][BST_SMOOTH_STEPS - 1][2],
        row_flank[BST_NODE_DIRECTIONS][BST_ROW_LENGTHS];
} bst_psf_sensitivity;

/* Mean of exp(2 pi i f x) over `binning` pixels in a row, about their centre. */
double bst_psf_binned(double f, int binning);

/* Measures the derivatives of a PSF over all its field nodes, in read-out pixels of `binning` by
 * `binning` of the sensor's. Peak and light are those of such pixels.
 *
 * Given:     cutoff    highest frequency, cycles/px
 *            sigma_px  of the Gaussian
 * Errors:    BST_ERR_MEMORY */
bst_status bst_psf_sensitivity_measure(bst_ctx *ctx, const bst_psf *psf, double cutoff,
                                       double sigma_px, int binning,
                                       bst_psf_sensitivity *out) BST_MUST_CHECK;

#endif
