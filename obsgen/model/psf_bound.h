/* Cramer-Rao bound of position and flux for a non-Gaussian PSF. Internal to the generator. */
#ifndef BST_OBSGEN_MODEL_PSF_BOUND_H
#define BST_OBSGEN_MODEL_PSF_BOUND_H

#include "obsgen/model/crlb_table.h"
#include "obsgen/model/response.h"

/* Tabulates the Fisher information of a PSF, integrated over pixels and drawn along x, as
 * bst_crlb_table_init does for a Gaussian.
 *
 * Given:
 *   side      the PSF and the Gaussian that widens it
 *   binning   sensor pixels per pixel that is read, per axis
 *   x_px, y_px  place in the field, sensor px
 *   sigma_px  deviation of the Gaussian with the same noise-equivalent area, before integration
 *             over the pixel, px that are read: the lengths of the table go with it
 *
 * Returned: the table. BST_ERR_MEMORY.
 *
 * Notes: the mean over places in the pixel of the sums over pixels is the integral over the plane,
 * taken on a grid of a third of a pixel; the image and its gradient are Fourier sums of the OTF.
 * A PSF without circular symmetry has the bound of streaks along x in all directions. */
bst_status bst_psf_bound_init(bst_ctx *ctx, const bst_response_side *side, int binning, double x_px,
                              double y_px, double sigma_px, bst_crlb_table *out) BST_MUST_CHECK;

#endif
