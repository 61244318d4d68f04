/* Cramer-Rao bound of a source's place and flux on a pixelated frame, the background unknown. */
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

/* Noise of a pixel: variance noise_e^2, plus the source's expected light in it if own_shot_noise
 * (its photons arrive as a Poisson process). */
typedef struct bst_eval_bound_noise {
    double noise_e;
    bool own_shot_noise;
} bst_eval_bound_noise;

/* Least covariance of any unbiased estimate of (x, y, flux, background), and the source's SNR,
 * sqrt(sum s^2) / noise_e: without its own light's noise. */
typedef struct bst_location_bound {
    double covariance[BST_BOUND_COUNT][BST_BOUND_COUNT];
    double snr;
} bst_location_bound;

/* A source's image: shares of its light in the pixels, and their derivatives by its place. */
typedef struct bst_location_image {
    const double *share, *by_x, *by_y; /* [count] */
    int count;
} bst_location_image;

/* The bound from any image: `share` [count] is the part of the source's light in each pixel of a
 * region, by_x and by_y its derivatives by the source's place, 1/px. The background, equal in all
 * those pixels, is estimated from them too. Fisher information sum (dm)(dm)^T / variance with
 * m = flux share + background (Winick 1986, JOSA A 3, 1809, for photon noise; Kay, Fundamentals of
 * Statistical Signal Processing I, 1993, eq. 3.31). BST_ERR_ARGUMENT for a flux or noise that is
 * not positive, BST_ERR_NUMERIC where the pixels do not determine the four numbers. */
bst_status bst_location_bound_of(bst_ctx *ctx, const bst_location_image *image, double flux_e,
                                 const bst_eval_bound_noise *noise,
                                 bst_location_bound *out) BST_MUST_CHECK;

/* A Gaussian PSF integrated over pixels, its centroid at (x_px, y_px), moved uniformly along
 * (dx_px, dy_px) during the exposure; 0, 0: at rest. */
typedef struct bst_eval_bound_source {
    double x_px, y_px, dx_px, dy_px;
    double sigma_px; /* before the pixel's own integration */
    double flux_e;
} bst_eval_bound_source;

/* The bound on the pixels whose centres lie within margin_px of the rectangle around the streak, no
 * sensor's edge near. Smear by Gauss-Legendre quadrature to 1e-9 of the peak. BST_ERR_ARGUMENT for
 * sigma_px outside 0.01 .. 1000 or a region above 1e7 pixels, BST_ERR_MEMORY; and as above. */
bst_status bst_location_bound_gaussian(bst_ctx *ctx, const bst_eval_bound_source *source,
                                       const bst_eval_bound_noise *noise, double margin_px,
                                       bst_location_bound *out) BST_MUST_CHECK;

/* Variances of the place along and across the direction (dx, dy), px^2: out = {along, across}.
 * Length 0 stands for the x axis. */
void bst_location_bound_along(const bst_location_bound *bound, double dx, double dy, double out[2]);

/* Sums of share^2 and of share^3 over all pixels of such a Gaussian of unit flux: its SNR is flux
 * times the root of the first over noise_e. */
bst_status bst_eval_gaussian_powers(bst_ctx *ctx, const bst_eval_bound_source *source,
                                    double out[2]) BST_MUST_CHECK;

#endif
