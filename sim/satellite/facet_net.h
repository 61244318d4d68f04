/* The facets of a model as a net: vertices that facets share, and edges with a facet on each side.
 * Internal to sim/satellite. */
#ifndef BST_SATELLITE_FACET_NET_H
#define BST_SATELLITE_FACET_NET_H

#include "sim/satellite/model.h"

/* An edge from vertex a to b: `left` has it in that sense, `right` in the other one. Without a
 * facet on the right, `right` is the number of facets. */
typedef struct bst_net_edge {
    int a, b, left, right;
} bst_net_edge;

/* Values of `apart`. */
enum { BST_NET_APART = 1, BST_NET_FREE = 2 };

/* Vertices of the same place and joint are one. Edges are in the order of their facets. */
typedef struct bst_facet_net {
    const bst_satellite *satellite;
    int *vertex; /* [vertex_count] vertex of the model */
    int *first;  /* [facet_count + 1] by facet: its first corner; those of facets follow one another
                  */
    int *corner; /* vertices of the net */
    int *beside; /* by corner: facet on the other side of the edge to the next corner, if no third
                    one has that edge; else the number of facets */
    bst_net_edge *edges;
    uint8_t *apart; /* by facet, in any pose: BST_NET_APART: no other one crosses it or overlaps it
                       in its plane; BST_NET_FREE: nor has one of its sides, but those of both */
    float *size_m;  /* by facet: its longest side or diagonal, or a little more */
    int *material;  /* by facet */
    int vertex_count, edge_count;
} bst_facet_net;

/* Makes the net of a model, which outlives it. BST_ERR_MEMORY. The caller frees it with
 * bst_facet_net_free, also after an error. */
bst_status bst_facet_net_make(bst_ctx *ctx, const bst_satellite *satellite,
                              bst_facet_net *out) BST_MUST_CHECK;
/* Sets `apart`, which is 0 for models with joints. BST_ERR_MEMORY. */
bst_status bst_facet_net_find_apart(bst_ctx *ctx, bst_facet_net *net) BST_MUST_CHECK;
/* Frees the memory of a net. */
void bst_facet_net_free(bst_facet_net *net);

#endif
