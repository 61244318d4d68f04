/* Cramer-Rao bound of a source's position and flux in a pixelated frame with unknown background. */
#ifndef BST_EVAL_LOCATION_BOUND_H
#define BST_EVAL_LOCATION_BOUND_H

#include <stdbool.h>

#include "boresight/status.h"

enum {
    BST_BOUND_X, /* px */
    BST_BOUND_Y,
    BST_BOUND_FLUX,       /* e- */
    BST_BOUND_BACKGROUND, /* e- per pixel */
    BST_BOUND_COUNT
};

/* Noise of a pixel: variance noise_e^2, plus the expected light of the source if own_shot_noise
 * (Poisson photons). */
typedef struct bst_eval_bound_noise {
    double noise_e;
    bool own_shot_noise;
} bst_eval_bound_noise;

/* Lower bound of the covariance of any unbiased estimate of (x, y, flux, background), and the
 * source's SNR, sqrt(sum s^2) / noise_e, without its own photon noise. */
typedef struct bst_location_bound {
    double covariance[BST_BOUND_COUNT][BST_BOUND_COUNT];
    double snr;
} bst_location_bound;

/* Image of a source: fractions of its light in the pixels, and derivatives with respect to its
 * position. */
typedef struct bst_location_image {
    const double *share, *by_x, *by_y; /* [count] */
    int count;
} bst_location_image;

/* Cramer-Rao bound for any image. `share` [count]: fraction of the source's light in each pixel of
 * a region; by_x, by_y: derivatives with respect to the position, 1/px. A constant background is
 * estimated from the same pixels. Fisher information sum (dm)(dm)^T / variance with m = flux share
 * + background (Winick 1986, JOSA A 3, 1809, for photon noise; Kay, Fundamentals of Statistical
 * Signal Processing I, 1993, eq. 3.31). BST_ERR_ARGUMENT: flux or noise not positive;
 * BST_ERR_NUMERIC: the pixels do not determine the four parameters. */
bst_status bst_location_bound_of(bst_ctx *ctx, const bst_location_image *image, double flux_e,
                                 const bst_eval_bound_noise *noise,
                                 bst_location_bound *out) BST_MUST_CHECK;

/* A Gaussian PSF, integrated over pixels, centroid (x_px, y_px), moving uniformly by (dx_px, dy_px)
 * during the exposure. */
typedef struct bst_eval_bound_source {
    double x_px, y_px, dx_px, dy_px;
    double sigma_px; /* before integration over the pixel */
    double flux_e;
} bst_eval_bound_source;

/* Cramer-Rao bound of a Gaussian streak on the pixels whose centres are within margin_px of the
 * rectangle around the streak, far from the sensor's edges. Smear by Gauss-Legendre quadrature,
 * error 1e-9 of the peak. BST_ERR_ARGUMENT: sigma_px outside 0.01 .. 1000 or a region above 1e7
 * pixels; BST_ERR_MEMORY; errors of bst_location_bound_of. */
bst_status bst_location_bound_gaussian(bst_ctx *ctx, const bst_eval_bound_source *source,
                                       const bst_eval_bound_noise *noise, double margin_px,
                                       bst_location_bound *out) BST_MUST_CHECK;

/* A rectangle of pixels. */
typedef struct bst_eval_region {
    int x0, y0, width, height;
    double *work; /* [2 (width + height)], lent */
} bst_eval_region;

/* Fractions of the light of a Gaussian streak in the pixels of a region, as in
 * bst_location_bound_gaussian.
 *
 * Returned:  share  [height][width] */
void bst_eval_gaussian_shares(const bst_eval_bound_source *source, const bst_eval_region *region,
                              double *share);

/* Position variances along and across the direction (dx, dy), px^2: out = {along, across}. Length
 * 0: the x axis. */
void bst_location_bound_along(const bst_location_bound *bound, double dx, double dy, double out[2]);

/* Sums of share^2 and share^3 over all pixels of a Gaussian streak of unit flux. Its SNR is flux *
 * sqrt(first sum) / noise_e. */
bst_status bst_eval_gaussian_powers(bst_ctx *ctx, const bst_eval_bound_source *source,
                                    double out[2]) BST_MUST_CHECK;

#endif
