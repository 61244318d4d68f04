/* Extended sources: a disc as a set of points for the renderer. */
#ifndef BST_SCENEGEN_SMEAR_EXTENDED_SOURCE_H
#define BST_SCENEGEN_SMEAR_EXTENDED_SOURCE_H

#include "scenegen/smear/smear_quadrature.h"
#include "sim/world/scene/disc.h"

/* View of the source at mid-exposure, and the wanted part of the disc. */
typedef struct bst_extended_source_view {
    bst_quat q_focal_from_gcrf;  /* to focal-plane axes */
    double scale_rad;            /* per pixel */
    double edge_x_px, edge_y_px; /* position of a pixel border relative to the boresight */
    double sigma_px;             /* of the PSF */
    double min_x_px, max_x_px, min_y_px,
        max_y_px; /* limits relative to the boresight; light outside is skipped */
    int most_points;
} bst_extended_source_view;

/* Computes the points of the source's disc: x and y of the offset from its centre, px of the
 * undistorted focal plane; z is 0. Small discs and thin crescents use Gauss-Legendre
 * quadrature of the lit part. Large discs are scanned pixel by pixel up to the limb.
 *
 * Returned:  *peak  upper bound of the light share in one pixel
 * Errors:    BST_ERR_MEMORY */
bst_status bst_extended_source_points(bst_ctx *ctx, const bst_scene_source *source,
                                      const bst_extended_source_view *view, bst_disc_points *points,
                                      double *peak) BST_MUST_CHECK;

/* Replaces a path's nodes by those of all points along it: positions of `list` plus the points'
 * offsets times `stretch`, and likewise their variances (offset.z, px^2). Errors: BST_ERR_MEMORY.
 */
bst_status bst_extended_source_spread(bst_ctx *ctx, const bst_disc_points *points, double stretch,
                                      bst_smear_node_list *list) BST_MUST_CHECK;

#endif
