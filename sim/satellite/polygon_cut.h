/* Intersections of convex polygons. */
#ifndef BST_SATELLITE_POLYGON_CUT_H
#define BST_SATELLITE_POLYGON_CUT_H

#include "sim/satellite/polygon_clip.h"

/* Corners of an intersection, at most: the sum of those of both polygons. */
enum { BST_POLYGON_INTERSECTION_MAX = 4 * BST_POLYGON_CORNERS_MAX };

/* Where a convex polygon is with regard to another one. */
typedef enum bst_polygon_place {
    BST_POLYGON_APART,   /* they share no area */
    BST_POLYGON_WITHIN,  /* all of it is in the other one */
    BST_POLYGON_CROSSING /* neither */
} bst_polygon_place;

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
 *            q     without edges as short as rounding
 *            work  [p_count + q_count]
 * Returned:  out   [p_count + q_count] room; the number of its corners is the return value; 0: none
 * Reference: Sutherland and Hodgman, Comm. ACM 17, 32 (1974) */
int bst_polygon_intersection(const bst_point2 *p, int p_count, const bst_point2 *q, int q_count,
                             bst_point2 *work, bst_point2 *out);

#endif
