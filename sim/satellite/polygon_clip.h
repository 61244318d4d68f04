/* Difference of convex polygons in a plane. */
#ifndef BST_SATELLITE_POLYGON_CLIP_H
#define BST_SATELLITE_POLYGON_CLIP_H

#include <stdbool.h>

#include "boresight/status.h"

typedef struct bst_point2 {
    double x, y;
} bst_point2;

/* Distance of a point to the left of the edge a-b, times the edge's length: exactly 0 at its ends.
 */
static inline double bst_point2_left_of(bst_point2 a, bst_point2 b, bst_point2 p) {
    return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

/* Corners of a convex polygon that the functions below accept. */
enum { BST_POLYGON_CORNERS_MAX = 512 };

/* A convex piece of a polygon: `count` corners from points[first], counter-clockwise; count 0:
 * removed. */
typedef struct bst_polygon_piece {
    int first, count;
} bst_polygon_piece;

/* What is left of a polygon after others were subtracted: disjoint convex pieces. */
typedef struct bst_polygon_clip {
    bst_point2 *points;
    bst_polygon_piece *pieces;
    int point_count, piece_count;
    int point_capacity, piece_capacity;
    bool overflow; /* the capacity did not suffice: the result is too large */
    double tiny;   /* corners closer than this are one */
} bst_polygon_clip;

/* Allocates the memory of a clip; later calls allocate nothing. BST_ERR_MEMORY. The caller frees it
 * with bst_polygon_clip_free. */
bst_status bst_polygon_clip_create(bst_ctx *ctx, bst_polygon_clip *clip) BST_MUST_CHECK;
/* Frees the memory of a clip; the struct belongs to the caller. */
void bst_polygon_clip_free(bst_polygon_clip *clip);

/* True if an edge of one of two convex polygons separates them; they may touch. */
bool bst_polygon_is_separate(const bst_point2 *p, int p_count, const bst_point2 *q, int q_count);

/* Starts with one convex polygon.
 *
 * Given:     points  [count] corners, counter-clockwise, at most BST_POLYGON_CORNERS_MAX */
void bst_polygon_clip_start(bst_polygon_clip *clip, const bst_point2 *points, int count);

/* Removes a convex polygon (as in bst_polygon_clip_start) from all pieces. `overlaps`: it is known
 * to overlap the polygon that the clip was started with. */
void bst_polygon_clip_subtract(bst_polygon_clip *clip, const bst_point2 *points, int count,
                               bool overlaps);

/* Removes all that is outside of a convex polygon (as in bst_polygon_clip_start). */
void bst_polygon_clip_intersect(bst_polygon_clip *clip, const bst_point2 *points, int count);

/* True if nothing is left. */
bool bst_polygon_clip_is_empty(const bst_polygon_clip *clip);

/* Area of all pieces. */
double bst_polygon_clip_area(const bst_polygon_clip *clip);

/* Area of a polygon, positive counter-clockwise. */
double bst_polygon_area(const bst_point2 *points, int count);

/* Convex hull, counter-clockwise, without points on its edges.
 *
 * Given:     points  [count]; sorted in place
 * Returned:  hull    [2 * count] room; the number of its corners is the return value
 * Reference: Andrew, Inf. Proc. Lett. 9, 216 (1979) */
int bst_polygon_hull(bst_point2 *points, int count, bst_point2 *hull);

#endif
