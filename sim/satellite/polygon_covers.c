#include "sim/satellite/polygon_covers.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Corners of all polygons of a list; of all intersections that are kept at the same time. */
enum { POINTS = 1024, WORK = 8192 };

/* Distance over the extent of a polygon below which two corners are one. */
static const double TINY = 1e-12;

/* Corners of an intersection, at most. */
enum { CORNERS = BST_POLYGON_INTERSECTION_MAX };

/* Intersections after which bst_polygon_uncovered_area gives up: their number can double with each
 * polygon. */
enum { INTERSECTIONS_MAX = 200 };

bst_status bst_polygon_covers_create(bst_ctx *ctx, bst_polygon_covers *covers) {
    *covers = (bst_polygon_covers){.points = malloc(POINTS * sizeof *covers->points),
                                   .work = malloc(WORK * sizeof *covers->work)};
    if (!covers->points || !covers->work) {
        bst_polygon_covers_free(covers);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the shadows of a satellite");
    }
    return BST_OK;
}

void bst_polygon_covers_free(bst_polygon_covers *covers) {
    free(covers->points);
    free(covers->work);
    *covers = (bst_polygon_covers){0};
}

bst_point2 *bst_polygon_covers_begin(bst_polygon_covers *covers, int count) {
    int used = covers->first[covers->count];
    return covers->count < BST_POLYGON_COVERS_MAX && used + count <= POINTS ? covers->points + used
                                                                            : NULL;
}

/* True if two corners are one: an edge between them would have a direction of rounding errors. */
static bool is_same(bst_point2 a, bst_point2 b, double tiny) {
    return fabs(a.x - b.x) <= tiny && fabs(a.y - b.y) <= tiny;
}

void bst_polygon_covers_end(bst_polygon_covers *covers, int count) {
    assert(covers->count < BST_POLYGON_COVERS_MAX);
    int first = covers->first[covers->count], n = 0;
    bst_point2 *p = covers->points + first;
    double extent = 0.0;
    for (int i = 1; i < count; i++) {
        double far = fabs(p[i].x - p[0].x) + fabs(p[i].y - p[0].y);
        extent = far > extent ? far : extent;
    }
    for (int i = 0; i < count; i++) {
        bool same = n > 0 && is_same(p[n - 1], p[i], TINY * extent);
        if (!same) {
            p[n++] = p[i];
        }
    }
    while (n > 1 && is_same(p[n - 1], p[0], TINY * extent)) {
        n--;
    }
    if (n >= 3) {
        covers->first[++covers->count] = first + n;
    }
}

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

/* A sum of areas in progress. */
typedef struct sum {
    const bst_polygon_covers *covers;
    int used;          /* points of the work memory */
    int intersections; /* so far; above INTERSECTIONS_MAX: given up */
} sum;

/* Area of a polygon outside of the first `covers` polygons of the list. */
static double uncovered(sum *s, const bst_point2 *p, int count, int covers) {
    double area = bst_polygon_area(p, count);
    int start = s->used;
    for (int i = covers - 1; i >= 0; i--) {
        const bst_point2 *q = s->covers->points + s->covers->first[i];
        int q_count = s->covers->first[i + 1] - s->covers->first[i], room = count + q_count;
        if (room > CORNERS || s->used + 2 * room > WORK || ++s->intersections > INTERSECTIONS_MAX) {
            s->intersections = INTERSECTIONS_MAX + 1;
            return 0.0;
        }
        bst_point2 *out = s->covers->work + start;
        int n = bst_polygon_intersection(p, count, q, q_count, out + room, out);
        if (n == count && memcmp(out, p, (size_t)n * sizeof *p) == 0) {
            return 0.0; /* the polygon covers all */
        }
        s->used = start + n;
        area -= n > 0 ? uncovered(s, out, n, i) : 0.0;
        s->used = start;
    }
    return area;
}

double bst_polygon_uncovered_area(const bst_polygon_covers *covers, const bst_point2 *points,
                                  int count) {
    sum s = {.covers = covers};
    double area = uncovered(&s, points, count, covers->count);
    return s.intersections > INTERSECTIONS_MAX ? -1.0 : fmax(area, 0.0);
}
