/* A source that is a disc as a set of points for the renderer. */
#ifndef BST_SCENEGEN_SMEAR_EXTENDED_SOURCE_H
#define BST_SCENEGEN_SMEAR_EXTENDED_SOURCE_H

#include "scenegen/smear/smear_quadrature.h"
#include "sim/world/scene/disc.h"

/* How the camera looks at the source at mid-exposure, and which part of the disc is wanted. */
typedef struct bst_extended_source_view {
    bst_quat q_focal_from_gcrf;  /* into the axes of the focal plane */
    double scale_rad;            /* of a pixel */
    double edge_x_px, edge_y_px; /* where, from the boresight, there is a border of pixels */
    double sigma_px;             /* of the PSF */
    double min_x_px, max_x_px, min_y_px,
        max_y_px; /* from the boresight; light beyond is left out */
    int most_points;
} bst_extended_source_view;

/* Makes the points of the source's disc: x and y of the offset from its middle in pixels of the
 * undistorted focal plane, z unused. Small discs and thin crescents are Gauss-Legendre quadrature
 * of the lit part; large ones are scanned, pixel by pixel, with the limb where it is. *peak: share
 * of the light on the brightest pixel at most. BST_ERR_MEMORY. */
bst_status bst_extended_source_points(bst_ctx *ctx, const bst_scene_source *source,
                                      const bst_extended_source_view *view, bst_disc_points *points,
                                      double *peak) BST_MUST_CHECK;

/* Replaces a path's nodes by those of all points that move along it: places of `list` plus the
 * points' offsets times `stretch`. BST_ERR_MEMORY. */
bst_status bst_extended_source_spread(bst_ctx *ctx, const bst_disc_points *points, double stretch,
                                      bst_smear_node_list *list) BST_MUST_CHECK;

#endif
