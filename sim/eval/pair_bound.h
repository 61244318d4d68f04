/* Two-point resolution: the separation at which a test can tell two sources from one. */
#ifndef BST_EVAL_PAIR_BOUND_H
#define BST_EVAL_PAIR_BOUND_H

#include "boresight/status.h"
#include "sim/eval/location_bound.h"

/* Draws sources of unit flux on a region of pixels. */
typedef struct bst_pair_image {
    int count;               /* pixels of the region */
    double x_px, y_px;       /* a place near its middle */
    double largest_apart_px; /* separation up to which both sources of a pair are inside */
    /* Sets share [count] to the fractions of the light in each pixel, for the centroid (x, y). */
    void (*draw)(void *user, double x_px, double y_px, double *share);
    void *user;
} bst_pair_image;

/* A pair of sources of the same shape. */
typedef struct bst_close_pair {
    double flux_e;       /* of both */
    double ratio;        /* brightness of the first over that of the second */
    double x_px, y_px;   /* centroid of the light */
    double dx_px, dy_px; /* from the first to the second */
} bst_close_pair;

/* Distance D between a pair's image and the nearest image of one source, in standard deviations of
 * the noise: D^2 = min sum (pair - one)^2 / variance over flux and position, with the variance of
 * bst_eval_bound_noise and the pair's light.
 *
 * Given:     image  region that holds the pair
 *            noise  of a pixel without the pair
 * Errors:    BST_ERR_MEMORY */
bst_status bst_pair_distance(bst_ctx *ctx, const bst_pair_image *image, const bst_close_pair *pair,
                             const bst_eval_bound_noise *noise, double *distance) BST_MUST_CHECK;

/* Highest probability at which a test finds a pair at the distance D from one source, if it splits
 * a share `rate` of single sources.
 *
 * Returned:  known: Q(Q^-1(rate) - D), separation, direction and ratio are known (Neyman and
 *            Pearson 1933, Phil. Trans. A 231, 289)
 *            unknown: three parameters more than those of one source are estimated: the tail of
 *            non-central chi-square with three degrees of freedom and non-centrality D^2 beyond the
 *            quantile 1 - rate of the central one */
typedef struct bst_pair_pd {
    double known, unknown;
} bst_pair_pd;
bst_pair_pd bst_pair_pd_at(double distance, double rate);

/* Separations at which those probabilities, as means over directions and positions in the pixel,
 * are pd.
 *
 * Given:     flux_e  of both sources
 *            ratio   of their brightness
 *            rate    share of single sources that are split, 0 < rate < pd
 * Returned:  px; NAN: not within image->largest_apart_px
 * Errors:    BST_ERR_MEMORY */
typedef struct bst_pair_separations {
    double known_px, unknown_px;
} bst_pair_separations;
bst_status bst_pair_separations_at(bst_ctx *ctx, const bst_pair_image *image, double flux_e,
                                   double ratio, const bst_eval_bound_noise *noise, double rate,
                                   double pd, bst_pair_separations *out) BST_MUST_CHECK;

#endif
