/* How the image of a shape differs from that of a point: place and width of its light, SNR, peak.
 */
#ifndef BST_WORLD_SCENE_SHAPE_LIGHT_H
#define BST_WORLD_SCENE_SHAPE_LIGHT_H

#include "sim/satellite/resolved_image.h"

/* Figures of an image under a Gaussian PSF. The ratios are 1 for a point and fall as it grows. */
typedef struct bst_shape_light_figures {
    double light;      /* in the unit of the image; 0: no light, and all others are as of a point */
    double x_px, y_px; /* centroid, px from the boresight */
    double xx, xy, yy; /* second central moments without the PSF, px^2 */
    double snr_ratio;  /* root of the sum of the squared light of all pixels */
    double filter_ratio; /* largest output of a filter that is matched to a point */
    double peak_ratio;   /* light of the brightest pixel */
} bst_shape_light_figures;

/* Work space. All zero: empty. */
typedef struct bst_shape_light {
    double *grid[2]; /* [capacity] */
    int capacity;
} bst_shape_light;

/* Frees the memory and clears the struct, which belongs to the caller. */
void bst_shape_light_free(bst_shape_light *work);

/* Measures an image.
 *
 * Given:     sigma_px  of the PSF with the pixel, per axis
 * Returned:  *out
 * Errors:    BST_ERR_MEMORY
 * Notes:     the light is put on a grid of half a sigma, or a 64th of the image, and convolved
 *            there: the ratios are right to some per cent. Motion during the exposure is left out.
 */
bst_status bst_shape_light_measure(bst_ctx *ctx, bst_shape_light *work,
                                   const bst_resolved_image *image, double sigma_px,
                                   bst_shape_light_figures *out) BST_MUST_CHECK;

#endif
