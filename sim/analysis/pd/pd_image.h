/* Images of targets with a non-Gaussian PSF, for SNR and Cramer-Rao bound. */
#ifndef BST_ANALYSIS_PD_PD_IMAGE_H
#define BST_ANALYSIS_PD_PD_IMAGE_H

#include "sim/eval/location_bound.h"
#include "sim/eval/target_match.h"
#include "sim/optics/psf.h"

typedef struct bst_pd_image bst_pd_image;

/* Creates tables of the PSF for targets that move by up to longest_px during an exposure. `psf`
 * must outlive them. BST_ERR_MEMORY. */
bst_status bst_pd_image_create(bst_ctx *ctx, const bst_psf *psf, double longest_px,
                               bst_pd_image **out) BST_MUST_CHECK;
/* Frees an image of the PSF; NULL is allowed. */
void bst_pd_image_free(bst_pd_image *image);

/* Sums of share^2 and share^3 over the pixels of a target of unit flux, for its position in field
 * and pixel (to 1/32 px). */
void bst_pd_image_powers(bst_pd_image *image, const bst_eval_match_target *place, double out[2]);

/* Cramer-Rao bound of a target with flux_e, as bst_location_bound_of. */
bst_status bst_pd_image_bound(bst_ctx *ctx, bst_pd_image *image, const bst_eval_match_target *place,
                              double flux_e, const bst_eval_bound_noise *noise,
                              bst_location_bound *out) BST_MUST_CHECK;

/* Fractions of a target's light in the pixels x0 .. x0 + width - 1 and y0 .. y0 + height - 1, for
 * its exact position in the pixel: cubic interpolation of the tables.
 *
 * Returned:  share  [height][width] */
void bst_pd_image_shares(const bst_pd_image *image, const bst_eval_match_target *place, int x0,
                         int y0, int width, int height, double *share);

#endif
