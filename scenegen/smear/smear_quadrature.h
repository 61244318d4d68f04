/* Few weighted nodes that stand for a path: the smear of one exposure as a short sum.
 *
 * A path is cut into groups of time. Along its principal axis a group is replaced by the nodes and
 * weights of Gaussian quadrature for its own distribution of places (one to three nodes, exact for
 * moments up to the first, third or fifth order; Gautschi 2004, Orthogonal Polynomials, 1.4).
 * Across it, nodes lie on the regression of the path on the quadrature's polynomials, and the
 * variance that is left, which fast jitter makes, widens the PSF of the group's nodes. Widening is
 * the same in all directions; what it does along the axis is taken out of the moments before (those
 * of the distribution that, convolved with the widening, gives the group's). */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_H
#define BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_H

#include <stdbool.h>

#include "boresight/status.h"

/* A point of a path, straight and uniform in time up to the next one: two tilts of the camera in
 * pixels of image motion (or the two coordinates of the image), and its roll in pixels of motion at
 * the sensor's corners. */
typedef struct bst_smear_path_point {
    double p[3];
    double s; /* time, 0 at exposure start to 1 at its end, ascending */
} bst_smear_path_point;

typedef struct bst_smear_node {
    double p[3];
    double weight;   /* share of the exposure; all nodes together: 1 */
    double variance; /* px^2, by which the node's PSF is wider per axis */
    double error;    /* of its group, over the peak that the group has alone */
} bst_smear_node;

/* Motions, over the path's, for which the error is estimated; see bst_smear_nodes_error. */
enum { BST_NODE_SCALES = 9 };

/* A growing array; zero-initialise, free `items`. To use it again, bst_smear_nodes_clear. */
typedef struct bst_smear_node_list {
    bst_smear_node *items;
    int count, capacity;
    /* largest estimate over the groups, in the units of the tolerance, for images that move by
     * scales of the path: 2^((k - BST_NODE_SCALES + 2) / 2), so that the last but one is 1 */
    double error[BST_NODE_SCALES];
} bst_smear_node_list;

/* Nodes are widened by at most this many PSF variances. */
#define BST_NODE_WIDEST 1.0

/* What nodes are made for. */
typedef struct bst_smear_node_aim {
    double psf_sigma_px;
    double tolerance;  /* of the smeared image's peak */
    double widest;     /* nodes are widened by at most so many PSF variances, BST_NODE_WIDEST at
                          most; 0: jitter is followed by nodes */
    double wide_field; /* px of the path's tilts per px of image motion at the boresight: 1, or more
                          where they are px in the sensor's corners, which a tangent plane moves
                          further; 0 is 1 */
    double curvature;  /* bound of the second derivative of the image's place by the path, 1/px */
    /* what pixels show, over their peak, of the PSF's second, fourth and sixth derivatives, over
     * those of a Gaussian of psf_sigma_px; 0 is 1 */
    double pixel_part[3];
} bst_smear_node_aim;

/* Appends the nodes of a path of `count` >= 2 points (two points at one time: a single node), so
 * that the image is right to about the tolerance. Raises list->error. BST_ERR_MEMORY. */
bst_status bst_smear_nodes_from_path(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                                     const bst_smear_node_aim *aim,
                                     bst_smear_node_list *list) BST_MUST_CHECK;

/* Empties the list. */
void bst_smear_nodes_clear(bst_smear_node_list *list);

/* The error of an image that moves by `scale` of the path's motion: at least that of any group,
 * whose parts go with the second to sixth power of it. */
double bst_smear_nodes_error(const double error[BST_NODE_SCALES], double scale);

#endif
