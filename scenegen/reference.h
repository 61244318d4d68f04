/* The reference image: double precision, pixel-integrated Gaussian PSF, Gauss-Legendre quadrature
 * in time. Slow; what the renderer is measured against. */
#ifndef BST_SCENEGEN_REFERENCE_H
#define BST_SCENEGEN_REFERENCE_H

#include "sim/world/field.h"

/* Expected electrons of the sources (no background) on `window`, [height][width], added to `image`.
 * Between LOS samples the attitude is slerped; a source's direction is the quadratic through its
 * three. Each source's time integral is refined, by halving every stretch between LOS samples,
 * until the source's image changes by less than `tolerance` of its peak (1e-9 for a reference).
 * BST_ERR_NUMERIC when 2^14 parts of a stretch do not suffice. */
bst_status bst_reference_render(bst_ctx *ctx, const bst_camera *camera, bst_window window,
                                const bst_los_track *track, const bst_source *sources, int count,
                                double tolerance, double *image) BST_MUST_CHECK;

/* Share of a unit Gaussian's light, centred at x px with standard deviation sigma_px, on pixel n.
 */
double bst_reference_pixel_share(double x, double sigma_px, int n);

#endif
