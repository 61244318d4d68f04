#include "sim/satellite/polygon_cut.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* Corners of an intersection, at most. */
enum { CORNERS = BST_POLYGON_INTERSECTION_MAX };

/* Distances of points to the left of the line a-b, times its length. Returned: the smallest. */
static double distances(const bst_point2 *p, int count, bst_point2 a, bst_point2 b, double *left) {
    double x = b.x - a.x, y = b.y - a.y, least = INFINITY;
    for (int i = 0; i < count; i++) {
        left[i] = x * (p[i].y - a.y) - y * (p[i].x - a.x);
    }
    for (int i = 0; i < count; i++) {
        least = left[i] < least ? left[i] : least;
    }
    return least;
}

static double left_of(bst_point2 a, bst_point2 b, bst_point2 p) {
    double x = b.x - a.x, y = b.y - a.y;
    return x * (p.y - a.y) - y * (p.x - a.x);
}

/* True if a convex polygon contains a point, by bisection of the triangles at its first corner. */
static bool contains(const bst_point2 *q, int count, bst_point2 p) {
    int low = 1, high = count - 1;
    if (left_of(q[0], q[low], p) < 0.0 || left_of(q[0], q[high], p) > 0.0) {
        return false;
    }
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(left_of(q[0], q[middle], p) >= 0.0 ? &low : &high) = middle;
    }
    return left_of(q[low], q[high], p) >= 0.0;
}

bst_polygon_place bst_polygon_place_of(const bst_point2 *p, int p_count, const bst_point2 *q,
                                       int q_count) {
    int inside = 0;
    while (inside < p_count && q_count >= 3 && contains(q, q_count, p[inside])) {
        inside++;
    }
    if (inside == p_count) {
        return BST_POLYGON_WITHIN;
    }
    return inside == 0 && bst_polygon_is_separate(p, p_count, q, q_count) ? BST_POLYGON_APART
                                                                          : BST_POLYGON_CROSSING;
}

/* Keeps what a polygon has to the left of a line, by the distances of its corners. Returned: number
 * of corners; 0: none. There is room for `room` of them, which suffices but for polygons that
 * rounding made concave. */
static int keep_left(const bst_point2 *p, int count, const double *left, int room,
                     bst_point2 *out) {
    int n = 0, last = count - 1;
    for (int i = 0; i < count; last = i++) {
        double before = left[last], now = left[i];
        if (n < room && before * now < 0.0) {
            double u = before / (before - now);
            out[n++] = (bst_point2){p[last].x + u * (p[i].x - p[last].x),
                                    p[last].y + u * (p[i].y - p[last].y)};
        }
        if (n < room && now >= 0.0) {
            out[n++] = p[i];
        }
    }
    return n >= 3 ? n : 0;
}

int bst_polygon_cut(bst_point2 *p, int count, bst_point2 a, bst_point2 b, int room) {
    bst_point2 kept[CORNERS];
    double left[CORNERS];
    assert(room <= CORNERS);
    if (count == 0 || distances(p, count, a, b, left) >= 0.0) {
        return count;
    }
    int n = keep_left(p, count, left, room, kept);
    memcpy(p, kept, (size_t)n * sizeof *p);
    return n;
}

/* A circle about a polygon. */
typedef struct circle {
    bst_point2 centre;
    double radius2; /* square of the radius */
} circle;

static circle circle_about(const bst_point2 *p, int count) {
    circle c = {.radius2 = 0.0};
    for (int i = 0; i < count; i++) {
        c.centre.x += p[i].x / count;
        c.centre.y += p[i].y / count;
    }
    for (int i = 0; i < count; i++) {
        double x = p[i].x - c.centre.x, y = p[i].y - c.centre.y, r2 = x * x + y * y;
        c.radius2 = r2 > c.radius2 ? r2 : c.radius2;
    }
    return c;
}

int bst_polygon_intersection(const bst_point2 *p, int p_count, const bst_point2 *q, int q_count,
                             bst_point2 *work, bst_point2 *out) {
    const bst_point2 *from = p;
    bst_point2 *to = out;
    int n = p_count, room = p_count + q_count;
    double left[CORNERS];
    assert(room <= CORNERS);
    const circle about = circle_about(p, p_count);
    for (int i = 0; i < q_count && n > 0; i++) {
        bst_point2 a = q[i], b = q[i + 1 < q_count ? i + 1 : 0];
        /* the circle alone decides for most edges */
        double middle = left_of(a, b, about.centre), x = b.x - a.x, y = b.y - a.y;
        bool far = middle * middle > about.radius2 * (x * x + y * y);
        if (far && middle < 0.0) {
            return 0;
        }
        if (!far && distances(from, n, a, b, left) < 0.0) {
            n = keep_left(from, n, left, room, to);
            from = to;
            to = from == out ? work : out;
        }
    }
    if (n > 0 && from != out) {
        memcpy(out, from, (size_t)n * sizeof *out);
    }
    return n;
}
