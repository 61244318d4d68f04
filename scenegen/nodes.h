/* Few weighted nodes that stand for a path: the smear of one exposure as a short sum.
 *
 * A path is cut into groups of time. A group is replaced by nodes that have its duration, its mean
 * place and its covariance: for each principal axis a pair at mean +- sqrt(k) standard deviations
 * (k axes), or one node where the group is small. What is left over is of fourth order in the
 * group's extent: a pair on a straight uniform group is two-point Gauss-Legendre, and jitter inside
 * a group keeps the blur that it causes. */
#ifndef BST_SCENEGEN_NODES_H
#define BST_SCENEGEN_NODES_H

#include "sim/core/status.h"

/* A point of a path, straight and uniform in time up to the next one. Coordinates in pixels (or
 * what moves the image by as much). */
typedef struct bst_path_point {
    double p[3];
    double s; /* time, 0 at exposure start to 1 at its end, ascending */
} bst_path_point;

typedef struct bst_node {
    double p[3];
    double weight; /* share of the exposure; all nodes together: 1 */
} bst_node;

/* A growing array; zero-initialise, free `items`. */
typedef struct bst_node_list {
    bst_node *items;
    int count, capacity;
} bst_node_list;

/* Appends the nodes of a path of `count` >= 2 points (two points at one time: a single node), for a
 * Gaussian PSF of psf_sigma_px, so that the image is right to about `tolerance` of the smeared
 * image's peak. BST_ERR_MEMORY. */
bst_status bst_nodes_from_path(bst_ctx *ctx, const bst_path_point *path, int count,
                               double psf_sigma_px, double tolerance,
                               bst_node_list *list) BST_MUST_CHECK;

/* Largest share of a source's light that falls on one pixel when smeared over nodes[count], PSF
 * centred on a pixel at best; takes at most 128 places of the path. */
double bst_nodes_peak_share(const bst_node *nodes, int count, double psf_sigma_px);

#endif
