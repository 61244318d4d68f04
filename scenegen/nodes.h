/* Few weighted nodes that stand for a path: the smear of one exposure as a short sum.
 *
 * A path is cut into groups of time. Along its principal axis a group is replaced by the nodes and
 * weights of Gaussian quadrature for its own distribution of places (one to three nodes, exact for
 * moments up to the first, third or fifth order; Gautschi 2004, Orthogonal Polynomials, 1.4).
 * Across it, nodes lie on the regression of the path on the quadrature's polynomials, and the
 * variance that is left, which fast jitter makes, widens the PSF of the group's nodes. Widening is
 * the same in all directions; what it does along the axis is taken out of the moments before (those
 * of the distribution that, convolved with the widening, gives the group's). */
#ifndef BST_SCENEGEN_NODES_H
#define BST_SCENEGEN_NODES_H

#include <stdbool.h>

#include "sim/core/status.h"

/* A point of a path, straight and uniform in time up to the next one: two tilts of the camera in
 * pixels of image motion (or the two coordinates of the image), and its roll in pixels of motion at
 * the sensor's corners. */
typedef struct bst_path_point {
    double p[3];
    double s; /* time, 0 at exposure start to 1 at its end, ascending */
} bst_path_point;

typedef struct bst_node {
    double p[3];
    double weight;   /* share of the exposure; all nodes together: 1 */
    double variance; /* px^2, by which the node's PSF is wider per axis */
} bst_node;

/* A growing array; zero-initialise, free `items`. To use it again, set count and error to 0. */
typedef struct bst_node_list {
    bst_node *items;
    int count, capacity;
    double error; /* largest estimate over the groups, in the units of the tolerance */
} bst_node_list;

/* Nodes are widened by at most this many PSF variances. */
#define BST_NODE_WIDEST 1.0

/* Appends the nodes of a path of `count` >= 2 points (two points at one time: a single node), for a
 * PSF whose standard deviation is psf_sigma_px, so that the image is right to about `tolerance` of
 * the smeared image's peak. Nodes are widened by at most `widest` <= BST_NODE_WIDEST PSF variances;
 * with 0, jitter is followed by nodes.
 * Raises list->error. BST_ERR_MEMORY. */
bst_status bst_nodes_from_path(bst_ctx *ctx, const bst_path_point *path, int count,
                               double psf_sigma_px, double tolerance, double widest,
                               bst_node_list *list) BST_MUST_CHECK;

/* Largest share of a source's light that falls on one pixel when smeared over nodes[count], PSF
 * centred on a pixel at best; takes at most 128 places of the path. */
double bst_nodes_peak_share(const bst_node *nodes, int count, double psf_sigma_px);

#endif
