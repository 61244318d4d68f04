/* The far wings that a periodic transform puts on the wrong side of the frame.
 *
 * An image of period N px shows a point's light at d, d + N, d - N, ...: wings that leave the frame
 * on one side come in on the other. They are smooth there, so a coarse grid takes them out again:
 * cells of summed light, convolved with the PSF of a fourfold period less that of the period, both
 * smoothed by a Gaussian of one cell. */
#ifndef BST_SCENEGEN_FOURIER_ALIAS_CORRECTION_H
#define BST_SCENEGEN_FOURIER_ALIAS_CORRECTION_H

#include <stdbool.h>

#include "sim/core/parallel.h"
#include "sim/optics/psf.h"

typedef struct bst_alias_correction bst_alias_correction;

/* One axis: `cells` cells of cell_px cover the period of `pixels` px; light may sit on, and is
 * wanted on, `used_px` of them. */
typedef struct bst_alias_correction_axis {
    int pixels, cells;
    double cell_px;
    double used_px;
} bst_alias_correction_axis;

/* The field's nodes are taken together, of one of the PSF's spectra. *out is NULL where so little
 * light wraps that a frame's sum stays right to 1e-7. */
bst_status bst_alias_correction_create(bst_ctx *ctx, const bst_psf *psf, int spectrum,
                                       const bst_alias_correction_axis *x,
                                       const bst_alias_correction_axis *y, bst_parallel *pool,
                                       bst_alias_correction **out) BST_MUST_CHECK;
/* Frees an alias correction with its FFT plans; NULL is allowed. */
void bst_alias_correction_free(bst_alias_correction *wrap);

/* light: electrons per cell, [y cells][x cells]; replaced by what is to be added to a pixel at each
 * cell's centre. */
void bst_alias_correction_run(bst_alias_correction *wrap, float *light);

#endif
