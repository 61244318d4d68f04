/* Penumbrae of an image: poses with shadows from several points of the Sun's disc. */
#ifndef BST_SCENEGEN_SMEAR_BODY_PENUMBRA_H
#define BST_SCENEGEN_SMEAR_BODY_PENUMBRA_H

#include "scenegen/smear/body_poses.h"

/* Quadratures of the Sun's disc, from its centre alone (0) to the finest one. */
enum { BST_BODY_SUN_RULES = 8 };

/* Number of points of a quadrature. */
int bst_body_sun_points(int rule);

/* Error of the image of a shadow's border, over the light beside it.
 *
 * Given:     half_width  of the penumbra across the border, PSF sigmas
 * Notes:     a bound that tests/scenegen/test_body_penumbra.c compares with the closed form */
double bst_body_sun_error(int rule, double half_width);

/* Error of an image without penumbrae, or with those of a quadrature, sigma of a pixel.
 *
 * Given:     electrons  of one unit of the image's light
 *            sigma_px   of the PSF and the pixel together
 *            swept      motion of the borders in the exposure, PSF sigmas; 0: at rest */
double bst_body_penumbra_sigma(const bst_resolved_image *image, int rule, double electrons,
                               double sigma_px, double swept, double dark_variance_e2);

/* Replaces each pose by those with the points of a quadrature, or of the finest one for which there
 * is room. Returned: that quadrature. */
int bst_body_penumbra_expand(bst_body_times *times, int rule);

#endif
