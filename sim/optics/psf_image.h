/* Image of a point source: the PSF integrated over pixels, sampled finer than the pixels. */
#ifndef BST_OPTICS_PSF_IMAGE_H
#define BST_OPTICS_PSF_IMAGE_H

#include "sim/optics/psf.h"

/* Samples per axis of bst_psf_image. */
static inline int bst_psf_image_side(int per_px, int reach_px) {
    return 2 * per_px * reach_px + 1;
}

/* Computes out[j][i], `side` numbers per axis: fraction of a point's light in the pixel with its
 * centre ((i, j) / per_px - reach_px) px from the point, by the PSF of a node (see bst_psf_weights)
 * widened by a Gaussian of blur_px. A Fourier sum over the OTF, by the definition in psf.h, with a
 * period of four times the reach, or twice the reach and 64 px where that is less, 64 px at the
 * least: wings that reach beyond the period's middle fold back. BST_ERR_MEMORY. */
bst_status bst_psf_image(bst_ctx *ctx, const bst_psf *psf, int node, double blur_px, int per_px,
                         int reach_px, double *out) BST_MUST_CHECK;

#endif
