/* Which facets of a model others hide from a direction or an observer. Internal to sim/satellite.
 */
#ifndef BST_SATELLITE_FACET_LAYERS_H
#define BST_SATELLITE_FACET_LAYERS_H

#include "sim/satellite/facet_net.h"
#include "sim/satellite/polygon_clip.h"

/* Corners of a facet, at most. */
enum { BST_LAYERS_CORNERS_MAX = 128 };

/* Box of a facet in a view, in cells, and how near it is: levels of its nearest and farthest place,
 * 0: the nearest. An empty box is off the grid. */
typedef struct bst_layers_box {
    float low[2], high[2];
    int facet;
    uint16_t nearest, farthest;
} bst_layers_box;

/* Bin of a vertex, within the grid. */
typedef struct bst_layers_bin_of {
    int x, y;
} bst_layers_bin_of;

/* Where the border of a layer crosses the middle of a row. */
typedef struct bst_layers_crossing {
    double x;
    int row, border, layers; /* more to its right; after counting: layers there */
} bst_layers_crossing;

/* An edge that is the border of a layer. */
typedef struct bst_layers_border {
    bst_point2 a, b;
    double near[2]; /* at a and b */
    bst_layers_box box;
    int layers;  /* more to the right of a-b, with y down */
    int outside; /* layers on its emptier side where it crosses the middle of a row; -1: nowhere */
} bst_layers_border;

/* Work memory of a view: zero-initialise, free with bst_facet_layers_free. Set by the caller before
 * bst_facet_layers_find: */
typedef struct bst_facet_layers {
    const bst_facet_net *net;
    bst_point2 *at;     /* by vertex of the net: place in the view, in cells of a grid */
    double *near;       /* by vertex: linear on a facet, greater for what hides */
    uint8_t *facing;    /* by facet, and 0 for one more; of those, corners are clockwise in the view
                           with x to the right and y up */
    int width, height;  /* of the grid */
    double same;        /* differences of `near` that are none */
    double cells_per_m; /* no two places of a facet are farther apart in the view; 0: not known */
    /* results */
    uint8_t
        *doubtful; /* by facet: others may hide it; 1: all or nothing, but for planes that cross */
    /* work memory */
    bst_layers_bin_of *vertex_bins; /* by vertex of the net */
    uint8_t *off;                   /* likewise: sides of the grid that it is beyond, as bits, and
                                       whether it is about a bin that is looked for */
    uint8_t *about;                 /* by bin: it or one beside it is looked for */
    uint8_t *known;        /* by facet: what is seen of it, and 0 for one more; see facet_cut.c */
    uint8_t *crowded;      /* by cell: something may be hidden there */
    bst_layers_box *boxes; /* by facet that faces the view, of those that are looked at */
    int (*bins)[4];        /* likewise: first and last column, first and last row of its
                              bins */
    int *order;            /* facets that face the view in the bins that are needed, the nearest
                              first */
    int *chosen;           /* facets in these bins */
    bst_layers_crossing *crossings; /* of borders with the middles of rows, in order */
    bst_layers_crossing *sorted;    /* room for them */
    int *row_first;                 /* [height + 1] */
    bst_layers_border *borders;
    int *border_first, *border_entries; /* borders by bin; [bins + 1] */
    uint8_t *marked;                    /* by bin: a cell is marked in `crowded` */
    int *bin_first;                     /* [bins + 1] */
    bst_layers_box *entries;            /* by bin, the nearest first */
    uint8_t *needed;                    /* by bin */
    int *seen, stamp;                   /* by facet: cut in which it was last looked at */
    int bins_x, bins_y, entry_capacity, crossing_count, crossing_capacity, order_count;
    double level_from, level_per; /* levels of nearness: per unit from this one on */
    int border_count, border_capacity, border_entry_capacity, row_capacity, sorted_capacity;
    size_t cell_capacity;
    bst_polygon_clip clip;
} bst_facet_layers;

/* Frees the memory. */
void bst_facet_layers_free(bst_facet_layers *layers);

/* Allocates what depends on the model and the grid. BST_ERR_MEMORY. */
bst_status bst_facet_layers_begin(bst_ctx *ctx, bst_facet_layers *layers, const bst_facet_net *net,
                                  int width, int height) BST_MUST_CHECK;

/* Finds the facets that others may hide, from `at` and `facing`.
 *
 * Given:     wanted  by facet: 0: not asked for
 * Errors:    BST_ERR_MEMORY
 * Notes:     borders of layers are edges with one facet that faces the view. In cells without a
 *            border the number of layers is that at the centre, which changes along a row where a
 *            border is crossed. Facets in cells with one layer, and with no border that has another
 *            layer behind it or before it, are whole. */
bst_status bst_facet_layers_find(bst_ctx *ctx, bst_facet_layers *layers,
                                 const uint8_t *wanted) BST_MUST_CHECK;

/* Cuts from a doubtful facet what others hide. Where planes cross, it is cut along the line.
 *
 * Returned:  true: nothing hides any of it. false: layers->clip holds what is left, convex pieces
 *            counter-clockwise */
bool bst_facet_layers_cut(bst_facet_layers *layers, int facet);

/* Where what is left of a facet ends at a nearer border: both ends of that line, how much nearer
 * the border is at most, and the sides of the facet that the line ends at: their directions in the
 * view and the facets beside them; 0 and -1: at none. */
typedef struct bst_layers_end {
    bst_point2 place[2], side[2];
    int beside[2];
    double gap;
} bst_layers_end;

/* Room for the lines of a facet. */
enum { BST_LAYERS_ENDS = 256 };

/* Lists the lines at which bst_facet_layers_cut has cut a facet, the last one that it was called
 * for.
 *
 * Returned:  out  [BST_LAYERS_ENDS]; their number is the return value; below 0: there are more */
int bst_facet_layers_ends(const bst_facet_layers *layers, int facet, bst_layers_end *out);

/* Plane of a facet in the view: near = out[0] + out[1] x + out[2] y. False: it has no area. */
bool bst_facet_layers_plane(const bst_facet_layers *layers, int facet, double out[3]);

#endif
