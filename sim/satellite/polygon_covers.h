/* Area of a convex polygon outside of others that overlap each other. */
#ifndef BST_SATELLITE_POLYGON_COVERS_H
#define BST_SATELLITE_POLYGON_COVERS_H

#include "sim/satellite/polygon_clip.h"

/* Polygons of a list, at most. */
enum { BST_POLYGON_COVERS_MAX = 12 };

/* Corners of an intersection, at most: the sum of those of both polygons. */
enum { BST_POLYGON_INTERSECTION_MAX = 4 * BST_POLYGON_CORNERS_MAX };

/* A list of convex polygons with its work memory. */
typedef struct bst_polygon_covers {
    bst_point2 *points, *work;
    int first[BST_POLYGON_COVERS_MAX + 1]; /* corners of polygon i: points[first[i]] to
                                              points[first[i + 1] - 1]; first[0] is 0 */
    int count;
} bst_polygon_covers;

/* Where a convex polygon is with regard to another one. */
typedef enum bst_polygon_place {
    BST_POLYGON_APART,   /* they share no area */
    BST_POLYGON_WITHIN,  /* all of it is in the other one */
    BST_POLYGON_CROSSING /* neither */
} bst_polygon_place;

/* Allocates the memory of an empty list; later calls allocate nothing. BST_ERR_MEMORY. The caller
 * frees it with bst_polygon_covers_free. */
bst_status bst_polygon_covers_create(bst_ctx *ctx, bst_polygon_covers *covers) BST_MUST_CHECK;
/* Frees the memory of a list; the struct belongs to the caller. */
void bst_polygon_covers_free(bst_polygon_covers *covers);

/* Place for a polygon of `count` corners, counter-clockwise, that bst_polygon_covers_end appends;
 * NULL: the list is full. */
bst_point2 *bst_polygon_covers_begin(bst_polygon_covers *covers, int count);
/* Appends the polygon that is in the place of bst_polygon_covers_begin, without corners that are
 * one. A polygon of fewer than three is left out. */
void bst_polygon_covers_end(bst_polygon_covers *covers, int count);

/* Where polygon p is with regard to polygon q; both convex and counter-clockwise. Polygons that
 * only touch may count as crossing. */
bst_polygon_place bst_polygon_place_of(const bst_point2 *p, int p_count, const bst_point2 *q,
                                       int q_count);

/* Keeps what a convex polygon, counter-clockwise, has to the left of the line a-b.
 *
 * Given:     points  [room] with `count` corners; room: at most BST_POLYGON_INTERSECTION_MAX
 * Returned:  number of corners; 0: nothing is left */
int bst_polygon_cut(bst_point2 *points, int count, bst_point2 a, bst_point2 b, int room);

/* Intersection of two convex polygons, both counter-clockwise.
 *
 * Given:     p, q  [p_count], [q_count], together at most BST_POLYGON_INTERSECTION_MAX
 *            q     without edges as short as rounding: bst_polygon_covers_end removes them
 *            work  [p_count + q_count]
 * Returned:  out   [p_count + q_count] room; the number of its corners is the return value; 0: none
 * Reference: Sutherland and Hodgman, Comm. ACM 17, 32 (1974) */
int bst_polygon_intersection(const bst_point2 *p, int p_count, const bst_point2 *q, int q_count,
                             bst_point2 *work, bst_point2 *out);

/* Area of a convex polygon outside of all polygons of the list.
 *
 * Given:     points  [count], counter-clockwise
 * Returned:  the area; below 0: too many of them overlap each other; use bst_polygon_clip
 * Notes:     of polygon i, what earlier ones leave of its intersection counts, which is the same
 *            problem with fewer polygons. */
double bst_polygon_uncovered_area(const bst_polygon_covers *covers, const bst_point2 *points,
                                  int count);

#endif
