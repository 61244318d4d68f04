/* Edges of what is seen in a frame, found from the light that the PSF spreads beyond them. */
#ifndef BST_IMGPROC_EXTENDED_EDGES_H
#define BST_IMGPROC_EXTENDED_EDGES_H

#include <stdbool.h>

#include "imgproc/extended/outline.h"

/* Neighbours that a pixel is compared with, and steps of the table of slopes. */
enum { BST_EDGES_NEIGHBOURS = 8, BST_EDGES_STEPS = 71 };

/* A frame whose edges are wanted. */
typedef struct bst_edges {
    const float *signal; /* [height][width] above the sky; lent */
    int width, height;
    int dx[BST_EDGES_NEIGHBOURS], dy[BST_EDGES_NEIGHBOURS]; /* to the neighbours, px */
    float share[BST_EDGES_NEIGHBOURS]; /* of a neighbour's signal, below which a pixel is outside */
    double sigma_px;                   /* of the PSF and the pixel */
    double slope[BST_EDGES_STEPS];     /* -d ln(light)/d(distance / sigma) by the distance */
} bst_edges;

/* Prepares a frame's edges.
 *
 * Given:     sigma_px  of the PSF, a Gaussian */
void bst_edges_init(bst_edges *edges, const float *signal, int width, int height, double sigma_px);

/* True if a pixel is outside of what is seen: its light can come from a neighbour about one sigma
 * away, over a straight edge.
 *
 * Notes:     at a distance d outside of a straight edge there is the share Q(d / sigma) of the
 *            light within. So no pixel outside has more than Q(k) of a pixel within that is k sigma
 *            away. With three times that share noise and corners (up to twice the light) count as
 *            outside, and a level of more than half the next pixel's never does. */
bool bst_edges_outside(const bst_edges *edges, int x, int y);

/* Distance outside of an edge, px, from the slope of the light's logarithm, 1/px.
 *
 * Notes:     the light of a surface with a straight edge is L Q(u), u = d / sigma. Its slope
 *            phi(u) / (Q(u) sigma) does not depend on L: surfaces that are dim and such that fill
 *            the wells have their edges in the same place. From u = -1 to 6 */
double bst_edges_distance(const bst_edges *edges, double slope_per_px);

/* Place of the edge whose light reaches a pixel: the pixel's centre less bst_edges_distance along
 * the gradient of the logarithm.
 *
 * Given:     least  signal that counts as least, so that the logarithm is not that of noise
 * Notes:     at a corner of two straight edges the light is the product of theirs, and the gradient
 *            leads to the corner: far out the slope is in proportion to the distance. */
bst_outline_point bst_edges_place(const bst_edges *edges, int x, int y, double least);

#endif
