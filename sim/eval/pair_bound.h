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

/* Probabilities of detection of a pair. */
typedef struct bst_pair_pd {
    double known;   /* separation, direction and ratio are known to the test */
    double unknown; /* three parameters more than those of one source are estimated */
} bst_pair_pd;

/* Highest probability at which a test finds a pair at the distance D from one source, if it splits
 * a share `rate` of single sources, 0 < rate < 1.
 *
 * Returned:  known: Q(Q^-1(rate) - D) (Neyman and Pearson 1933, Phil. Trans. A 231, 289); unknown:
 *            the tail of non-central chi-square with three degrees of freedom and non-centrality
 *            D^2 beyond the quantile 1 - rate of the central one */
bst_pair_pd bst_pair_pd_at(double distance, double rate);

/* Separations at which those probabilities have a value, px; NAN: not within
 * bst_pair_image.largest_apart_px. */
typedef struct bst_pair_separations {
    double known_px, unknown_px;
} bst_pair_separations;

/* Finds the separations at which the means of both probabilities over directions and positions in
 * the pixel are pd.
 *
 * Given:     pair  its flux and ratio; place and separation are not read
 *            rate  share of single sources that are split, 0 < rate < pd < 1
 * Errors:    BST_ERR_MEMORY */
bst_status bst_pair_separations_at(bst_ctx *ctx, const bst_pair_image *image,
                                   const bst_close_pair *pair, const bst_eval_bound_noise *noise,
                                   double rate, double pd,
                                   bst_pair_separations *out) BST_MUST_CHECK;

#endif
