/* Smear quadrature: replaces a path by few weighted nodes.
 *
 * A path is divided into time groups. Along its principal axis a group is replaced by the nodes and
 * weights of Gaussian quadrature for its own distribution of positions (one to three nodes, exact
 * for moments up to the first, third or fifth order; Gautschi 2004, Orthogonal Polynomials, 1.4).
 * Across it, nodes lie on the regression of the path on the quadrature's polynomials. The remaining
 * variance, from fast jitter, widens the PSF of the group's nodes. The widening is isotropic; its
 * contribution along the axis is removed from the moments first (deconvolution). */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_H
#define BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_H

#include <stdbool.h>

#include "boresight/status.h"

/* A path point; the path is straight and uniform in time up to the next point. Coordinates: two
 * tilts of the camera in px of image motion (or two image coordinates), and roll in px at the
 * sensor's corners. */
typedef struct bst_smear_path_point {
    double p[3];
    double s; /* time, 0 at exposure start to 1 at its end, ascending */
} bst_smear_path_point;

typedef struct bst_smear_node {
    double p[3];
    double weight;    /* share of the exposure; all nodes sum to 1 */
    double variance;  /* px^2 by which the node's PSF is widened per axis */
    double error;     /* bound of its group, relative to the group's own peak; chooses the nodes */
    double predicted; /* at most that bound, for images that move like the path */
} bst_smear_node;

/* Motion scales for which the error is estimated; see bst_smear_nodes_error. */
enum { BST_NODE_SCALES = 9 };

/* Directions for which the PSF's derivatives are known: pi d / BST_NODE_DIRECTIONS from x. */
enum { BST_NODE_DIRECTIONS = 12, BST_ROW_STEPS = 32 };

/* Smoothing for which its derivatives are known: variances of n / BST_SMOOTH_PER of that of the
 * Gaussian, along the direction. */
enum { BST_SMOOTH_STEPS = 5, BST_SMOOTH_PER = 10 };

/* Lengths of the groups of a row, in sigma of the Gaussian, that are kept apart. */
enum { BST_ROW_LENGTHS = 8 };
static inline int bst_row_length(double sigmas) {
    static const double upto[BST_ROW_LENGTHS - 1] = {1.9, 2.15, 2.4, 2.7, 3.1, 3.7, 4.5};
    int n = 0;
    while (n < BST_ROW_LENGTHS - 1 && sigmas >= upto[n]) {
        n++;
    }
    return n;
}

/* Patterns of missed highest moments in the image: a row of equal groups, and the derivatives of
 * order 4 and 6 of a group, smoothed by at least n of those steps. */
enum {
    BST_PATTERN_ROW,                                       /* + bst_row_length */
    BST_PATTERN_GROUP = BST_PATTERN_ROW + BST_ROW_LENGTHS, /* + 2 n, + 1 for order 6 */
    BST_PATTERNS = BST_PATTERN_GROUP + 2 * BST_SMOOTH_STEPS
};

/* Growing array of nodes: zero-initialise, free `items`. bst_smear_nodes_clear allows reuse. */
typedef struct bst_smear_node_list {
    bst_smear_node *items;
    int count, capacity;
    /* largest error bound over the groups, relative to the peak, for images that move by
     * 2^((k - BST_NODE_SCALES + 2) / 2) of the path; the last but one is 1. Nodes are chosen by it
     */
    double error[BST_NODE_SCALES];
    /* the same of the predicted error: at most the bound, which takes the greatest derivative of
     * the PSF for the whole length of a group */
    double predicted[BST_NODE_SCALES];
    /* what is predicted without the missed highest moments, and those by their pattern in the
     * image; bits d of `directions` along which they are, 0 if the PSF's derivatives are not known
     * by direction */
    double higher[BST_NODE_SCALES], missed[BST_NODE_SCALES][BST_PATTERNS];
    unsigned directions;
    bool rests; /* a path of the nodes rests somewhere (bst_motion_rests) */
} bst_smear_node_list;

/* Largest widening of a node, PSF variances. */
#define BST_NODE_WIDEST 1.0

/* Distances from a PSF's peak for which its light is known: BST_LIGHT_STEPS of 1 / BST_LIGHT_PER
 * sigma. */
enum { BST_LIGHT_STEPS = 49, BST_LIGHT_PER = 8 };

/* Requirements of the nodes. */
typedef struct bst_smear_node_aim {
    double psf_sigma_px;
    double tolerance; /* relative to the smeared image's peak */
    /* largest node widening, PSF variances, at most BST_NODE_WIDEST; 0: nodes follow the jitter */
    double widest;
    /* px of the path's tilts per px of image motion at the boresight: 1, or more if they are px in
     * the sensor's corners, which a tangent plane moves further; 0 means 1 */
    double wide_field;
    double curvature; /* bound of the second derivative of the image position by the path, 1/px */
    /* variance by which binning widens that Gaussian, and further variance against which the length
     * of a group smooths derivatives: of the sensor's pixel, or of the PSF's shape; px^2 */
    double binned_variance, further_variance;
    /* PSF derivatives of order 2, 4, 6 in pixels, relative to their peak and to a Gaussian of
     * psf_sigma_px; 0 means 1 */
    double pixel_part[3];
    /* the same along directions of the image, for the predicted error; NULL: in all the same.
     * turns: the path is that of a camera's tilts, which move the image at right angles to their
     * axis. unlike_rad: how far the image's direction may differ from that at the boresight,
     * besides by roll */
    const double (*direction_part)[3]; /* [BST_NODE_DIRECTIONS] */
    /* with it, of order 4 and 6 with smoothing; NULL: as a Gaussian loses by it */
    const double (*smooth_part)[BST_SMOOTH_STEPS][2]; /* [BST_NODE_DIRECTIONS] */
    /* with it, ripple of a row of equal groups by groups per px, up to most_per_px */
    const double (*row_ripple)[BST_ROW_STEPS]; /* [BST_NODE_DIRECTIONS] */
    double most_per_px;
    /* with it, least light up to a distance from the PSF's peak, over that of the peak */
    const double (*light_part)[BST_LIGHT_STEPS]; /* [BST_NODE_DIRECTIONS] */
    bool turns;
    double unlike_rad;
} bst_smear_node_aim;

/* Appends the nodes of a path of `count` >= 2 points (two points at one time: a single node), so
 * that the image is accurate to about the tolerance. Raises list->error. Errors: BST_ERR_MEMORY. */
bst_status bst_smear_nodes_from_path(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                                     const bst_smear_node_aim *aim,
                                     bst_smear_node_list *list) BST_MUST_CHECK;

/* Empties a node list. */
void bst_smear_nodes_clear(bst_smear_node_list *list);

/* Error of an image that moves by `scale` of the path: an upper bound over the groups, whose terms
 * go with the second to sixth power of the scale. */
double bst_smear_nodes_error(const double error[BST_NODE_SCALES], double scale);

#endif
