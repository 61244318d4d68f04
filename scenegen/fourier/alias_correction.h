/* Correction of the periodic wrap-around of far PSF wings.
 *
 * An FFT image of period N px contains a point's light at d, d + N, d - N, ...: wings that leave
 * the frame on one side re-enter on the other. These wings are smooth, so a coarse grid suffices to
 * subtract them: cells of summed light, convolved with the PSF of a fourfold period minus that of
 * the period, both smoothed by a Gaussian of one cell. */
#ifndef BST_SCENEGEN_FOURIER_ALIAS_CORRECTION_H
#define BST_SCENEGEN_FOURIER_ALIAS_CORRECTION_H

#include <stdbool.h>

#include "sim/core/parallel.h"
#include "sim/optics/psf.h"

typedef struct bst_alias_correction bst_alias_correction;

/* One axis: `cells` cells of cell_px cover the period of `pixels` px. Sources and image lie on
 * `used_px` of them. */
typedef struct bst_alias_correction_axis {
    int pixels, cells;
    double cell_px;
    double used_px;
} bst_alias_correction_axis;

/* Creates the correction for one of the PSF's spectra, averaged over the field nodes.
 *
 * Returned:  *out  NULL if wrap-around changes a frame's sum by less than 1e-7 */
bst_status bst_alias_correction_create(bst_ctx *ctx, const bst_psf *psf, int spectrum,
                                       const bst_alias_correction_axis *x,
                                       const bst_alias_correction_axis *y, bst_parallel *pool,
                                       bst_alias_correction **out) BST_MUST_CHECK;
/* Frees an alias correction with its FFT plans; NULL is allowed. */
void bst_alias_correction_free(bst_alias_correction *wrap);

/* Convolves the cells with the correction kernel.
 *
 * Given:     light  electrons per cell, [y cells][x cells]
 * Returned:  light  correction to add to a pixel at each cell's centre, e- */
void bst_alias_correction_run(bst_alias_correction *wrap, float *light);

#endif
