/* Nodes that stand for the image of a body: few where its light is even, many at its borders. */
#ifndef BST_SCENEGEN_SMEAR_IMAGE_NODES_H
#define BST_SCENEGEN_SMEAR_IMAGE_NODES_H

#include "sim/world/scene/disc.h"
#include "sim/world/scene/source_body.h"

/* Requirements of the nodes. */
typedef struct bst_image_nodes_aim {
    double sigma_px;  /* of the PSF */
    double widest;    /* largest variance of a node, PSF variances */
    double electrons; /* of one unit of the image's light */
    double dark_variance_e2;
    double tolerance_sigma; /* of the frame's image, in sigma of a pixel */
    bool blurred;           /* many poses: the light of a cell has no sharp borders */
    double x0, y0;          /* origin of the nodes' positions, px from the boresight */
} bst_image_nodes_aim;

/* What the nodes are like. */
typedef struct bst_image_nodes_result {
    double light;   /* of the image */
    double peak;    /* most light in one pixel before the PSF */
    double error_e; /* largest estimated error in a pixel, electrons */
} bst_image_nodes_result;

/* Replaces points by the nodes of an image.
 *
 * Returned:  points  offset: x and y in px of the focal plane without distortion, z the variance in
 *                    px^2 per axis by which the PSF is widened there; share: light
 * Errors:    BST_ERR_MEMORY
 * Notes:     squares of cells become one node at their centroid, with their mean variance, where
 *            the rest of their second moments would not be seen: a line of length 1 px with the
 *            second moment D across it changes its Gaussian image by at most 0.2 D / sigma^3. */
bst_status bst_image_nodes(bst_ctx *ctx, const bst_resolved_image *image,
                           const bst_image_nodes_aim *aim, bst_disc_points *points,
                           bst_image_nodes_result *out) BST_MUST_CHECK;

#endif
