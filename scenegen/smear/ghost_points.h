/* Ghosts with a size: the image as a set of points for the renderer. */
#ifndef BST_SCENEGEN_SMEAR_GHOST_POINTS_H
#define BST_SCENEGEN_SMEAR_GHOST_POINTS_H

#include "sim/optics/ghosts.h"
#include "sim/world/scene/disc.h"

/* Requirements of the points. */
typedef struct bst_ghost_points_aim {
    double sigma_px; /* of the PSF */
    double widest;   /* largest variance of a point, PSF variances */
    double allowed;  /* error of a pixel over the light of the brightest one */
    int most_points; /* if the error allows no fewer, it is larger */
} bst_ghost_points_aim;

/* Replaces points by those of a ghost's image.
 *
 * Returned:  points  offset: x and y in px from the ghost's centre, z the variance in px^2 per axis
 *                    by which the PSF is widened there; share: light, 1 in all
 *            error   estimated error of a pixel over the light of the brightest one
 * Errors:    BST_ERR_MEMORY
 * Notes:     a disc is cut into square cells of side h. Each is a Gaussian at its centroid, with
 *            the mean of its second moments as variance: h^2 / 12 inside. A Gaussian is a lattice
 *            of narrower ones, whose variances add. The error of a lattice of Gaussians of
 *            variance v is 4 exp(-2 pi^2 v / h^2) (Poisson's sum). */
bst_status bst_ghost_points(bst_ctx *ctx, const bst_ghost *ghost, const bst_ghost_points_aim *aim,
                            bst_disc_points *points, double *error) BST_MUST_CHECK;

#endif
