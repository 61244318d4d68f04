/* Area of a convex polygon outside of others that overlap each other. */
#ifndef BST_SATELLITE_POLYGON_COVERS_H
#define BST_SATELLITE_POLYGON_COVERS_H

#include "sim/satellite/polygon_clip.h"

/* Polygons of a list, at most. */
enum { BST_POLYGON_COVERS_MAX = 12 };

/* Half of a plane: u x + v y + w >= 0. */
typedef struct bst_half_plane {
    double u, v, w;
} bst_half_plane;

/* Four of them, for loops over many. */
enum { BST_HALF_PLANES = 4 };
typedef struct bst_half_planes {
    double u[BST_HALF_PLANES], v[BST_HALF_PLANES], w[BST_HALF_PLANES];
} bst_half_planes;

/* A list of convex sets, each the intersection of half planes, with its work memory. Only those
 * half planes matter whose border crosses the polygon of which the area is wanted. */
typedef struct bst_polygon_covers {
    bst_half_plane *sides;
    bst_point2 *work;
    bst_point2 *corners; /* of sets that have them: see bst_polygon_covers_corners */
    int corner_first[BST_POLYGON_COVERS_MAX + 1]; /* likewise, as `first` */
    int corner_sides[BST_POLYGON_COVERS_MAX +
                     1];                   /* by set: sides of the polygon of these corners */
    int first[BST_POLYGON_COVERS_MAX + 1]; /* sides of set i: sides[first[i]] to sides[first[i + 1]
                                              - 1]; first[0] is 0 */
    int count;
    int pending; /* sides of the next set */
} bst_polygon_covers;

/* Allocates the memory of an empty list; later calls allocate nothing. BST_ERR_MEMORY. The caller
 * frees it with bst_polygon_covers_free. */
bst_status bst_polygon_covers_create(bst_ctx *ctx, bst_polygon_covers *covers) BST_MUST_CHECK;
/* Frees the memory of a list; the struct belongs to the caller. */
void bst_polygon_covers_free(bst_polygon_covers *covers);

/* Empties the list. */
void bst_polygon_covers_clear(bst_polygon_covers *covers);
/* Starts the next set again, if something was added to it. */
void bst_polygon_covers_restart(bst_polygon_covers *covers);
/* Adds a side to the next set of the list. False: there is no room. */
bool bst_polygon_covers_add(bst_polygon_covers *covers, bst_half_plane side);
/* Room for the corners, counter-clockwise, of a convex polygon that is the intersection of the
 * sides of the next set so far, within any polygon of which the area is wanted: a set of many sides
 * then costs less, because it is cut by the few sides of that. To be filled before
 * bst_polygon_covers_end. NULL: there is none, which changes no area. */
bst_point2 *bst_polygon_covers_corners(bst_polygon_covers *covers, int count);
/* Ends the set that bst_polygon_covers_add began. False: the list is full. */
bool bst_polygon_covers_end(bst_polygon_covers *covers);

/* Half planes of which a convex polygon is the intersection.
 *
 * Given:     points  [count], counter-clockwise, in the same plane
 * Returned:  sides   [(count + BST_HALF_PLANES - 1) / BST_HALF_PLANES], filled up with planes that
 *                    contain everything; the number of these blocks is the return value
 * Notes:     edges as short as rounding have no direction, and become such planes too */
int bst_half_planes_of(const bst_point2 *points, int count, bst_half_planes *sides);

/* Return value of bst_half_planes_crossing. */
enum { BST_HALF_PLANES_APART = -1 };

/* Finds the half planes whose border crosses a polygon.
 *
 * Given:     sides   [blocks], at most BST_POLYGON_CORNERS_MAX planes
 *            points  [count] of the polygon
 *            bounds  lowest and highest x, lowest and highest y of the points
 * Returned:  indices  [BST_HALF_PLANES * blocks] room; the number of these planes is the return
 *                     value: 0 if all of them contain the polygon, BST_HALF_PLANES_APART if one
 *                     has no part of it */
int bst_half_planes_crossing(const bst_half_planes *sides, int blocks, const bst_point2 *points,
                             int count, const double bounds[4], int *indices);

/* Keeps what a convex polygon has in some half planes.
 *
 * Given:     points  [count], counter-clockwise
 *            sides   [side_count]
 * Returned:  out     [count + side_count] room, not `points`; the number of its corners is the
 *                    return value; 0: none
 *            *cut    false: nothing was removed
 * Reference: Sutherland and Hodgman, Comm. ACM 17, 32 (1974) */
int bst_polygon_keep(const bst_point2 *points, int count, const bst_half_plane *sides,
                     int side_count, bst_point2 *out, bool *cut);

/* Area of a convex polygon outside of all sets of the list.
 *
 * Given:     points  [count], counter-clockwise
 * Returned:  the area; below 0: too many of them overlap each other; use bst_polygon_clip
 * Notes:     of set i, what earlier ones leave of its intersection counts, which is the same
 *            problem with fewer sets. */
double bst_polygon_uncovered_area(const bst_polygon_covers *covers, const bst_point2 *points,
                                  int count);

#endif
