/* The PSF of a camera as its stars show it: oversampled, over the field, with wings. */
#ifndef BST_ANALYSIS_CAMERA_EFFECTIVE_PSF_H
#define BST_ANALYSIS_CAMERA_EFFECTIVE_PSF_H

#include <stdbool.h>

#include "boresight/status.h"

/* Samples per pixel and axis; nodes of the field grid along an axis at most; parts of the stars
 * that are left out in turn for the standard errors. */
enum {
    BST_EFFECTIVE_PSF_OVERSAMPLING = 4,
    BST_EFFECTIVE_PSF_NODES = 5,
    BST_EFFECTIVE_PSF_PARTS = 8
};

/* A star and the pixels around it. */
typedef struct bst_effective_psf_star {
    const float *pixels;     /* [side][side], side = 2 half_px + 1, electrons; NAN: no value */
    double x_px, y_px;       /* first place, from the centre of the middle pixel */
    double field_x, field_y; /* place between the first (0) and the last node (1) of each axis */
    double noise_e;          /* of a pixel without the star */
    int part; /* 0 to BST_EFFECTIVE_PSF_PARTS - 1; equal for one star in all frames */
} bst_effective_psf_star;

/* Size of the PSF and of its field grid. */
typedef struct bst_effective_psf_options {
    int columns, rows; /* nodes, 1 to BST_EFFECTIVE_PSF_NODES */
    int half_px;       /* reach of the wings, 6 to 64 */
} bst_effective_psf_options;

typedef struct bst_effective_psf {
    bst_effective_psf_options options;
    int side;        /* samples, 2 half_px oversampling + 1, the star's place on the middle one */
    double *value;   /* [nodes][side][side] share of a star's light in a pixel that is centred
                        there; sum over a grid of whole pixels 1 */
    double *without; /* [PARTS][nodes][side][side] the same without one part of the stars */
    int stars;       /* used */
    int iterations;
    double chi_squared; /* of a pixel within 3 px of a star, on average over the stars */
    double form_error;  /* error of the form, as a share of a pixel's light */
} bst_effective_psf;

/* Measures the effective PSF (that after integration over the pixel).
 *
 * Each star's place, light and level are fitted with the PSF of the iteration before, bilinear
 * between the nodes. What is left of the pixels, over the star's light, corrects the samples nearby
 * of all nodes by weighted least squares; the samples are then smoothed by local polynomials, of
 * wider windows in the wings. The weights make bright stars give the wings. The middle is the
 * centre of the light within 3 px; the mean of the outermost pixel is 0.
 *
 * Given:     stars  [count]
 * Returned:  *out
 * Errors:    BST_ERR_RANGE: fewer than 10 stars a node, or the field's stars do not reach the
 * nodes; BST_ERR_MEMORY Ownership: free with bst_effective_psf_free Reference: Anderson & King
 * 2000, PASP 112, 1360 */
bst_status bst_effective_psf_fit(bst_ctx *ctx, const bst_effective_psf_star *stars, int count,
                                 const bst_effective_psf_options *options,
                                 bst_effective_psf *out) BST_MUST_CHECK;
/* Frees the samples. */
void bst_effective_psf_free(bst_effective_psf *psf);

/* Turns an effective PSF into that before integration over the pixel, by division of the transfer
 * functions. Frequencies near and above one cycle per pixel, where the pixel's own transfer
 * function vanishes, are left out: of PSFs with a FWHM below about 1.3 px a part is lost.
 *
 * Given:     plane  [side][side] of BST_EFFECTIVE_PSF_OVERSAMPLING
 * Returned:  out    [side][side], sum 1
 * Errors:    BST_ERR_MEMORY */
bst_status bst_effective_psf_undo_pixel(bst_ctx *ctx, const double *plane, int side,
                                        double *out) BST_MUST_CHECK;

/* Figures of a PSF. Those that the outermost light would spoil are of what lies within 5 px. */
enum { BST_EFFECTIVE_PSF_RADII = 6 };
typedef struct bst_effective_psf_figures {
    double xx_px2, xy_px2, yy_px2;             /* second moments within 5 px of the centre */
    double encircled[BST_EFFECTIVE_PSF_RADII]; /* share of the light within the radii */
} bst_effective_psf_figures;
/* Radii of the encircled energy, px. */
extern const double bst_effective_psf_radius_px[BST_EFFECTIVE_PSF_RADII];

/* Measures the figures of samples.
 *
 * Given:     plane  [side][side] of BST_EFFECTIVE_PSF_OVERSAMPLING, centred on the middle one */
bst_effective_psf_figures bst_effective_psf_measure(const double *plane, int side);

/* Standard error by the delete-a-group jackknife: sqrt((n - 1) / n sum (value - mean)^2), of seven
 * degrees of freedom.
 *
 * Reference: Efron & Tibshirani 1993, An Introduction to the Bootstrap, equation 11.5 */
double bst_effective_psf_standard_error(const double without[BST_EFFECTIVE_PSF_PARTS]);

enum { BST_EFFECTIVE_PSF_POOL = 3 }; /* samples on each side */
/* Pools the standard errors of samples over BST_EFFECTIVE_PSF_POOL samples on each side: their
 * geometric mean, as they fall steeply from the middle, times what makes it unbiased. Of single
 * ones, the root mean square of error over standard error is 1.18, that of Student's law of seven
 * degrees of freedom. 0 stays 0.
 *
 * Given:     sigma  [side][side]
 * Returned:  pooled  [side][side] */
void bst_effective_psf_pool_errors(const double *sigma, int side, double *pooled);

#endif
