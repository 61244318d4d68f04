#include "sim/satellite/polygon_covers.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Corners of all polygons of a list; of all intersections that are kept at the same time. */
enum { POINTS = 1024, WORK = 8192 };

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

void bst_polygon_covers_end(bst_polygon_covers *covers, int count) {
    assert(covers->count < BST_POLYGON_COVERS_MAX);
    covers->first[covers->count + 1] = covers->first[covers->count] + count;
    covers->count++;
}

/* Distance of a point to the left of the edge a-b, times the edge's length. */
static double left_of(bst_point2 a, bst_point2 b, bst_point2 p) {
    return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
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

/* Keeps what a polygon has to the left of the line a-b. Returned: number of corners; 0: none. There
 * is room for `room` of them, which suffices but for polygons that rounding made concave. */
static int keep_left(const bst_point2 *p, int count, bst_point2 a, bst_point2 b, int room,
                     bst_point2 *out) {
    int n = 0;
    bst_point2 last = p[count - 1];
    double before = left_of(a, b, last);
    for (int i = 0; i < count; i++) {
        double now = left_of(a, b, p[i]);
        if (n < room && ((before > 0.0 && now < 0.0) || (before < 0.0 && now > 0.0))) {
            double u = before / (before - now);
            out[n++] = (bst_point2){last.x + u * (p[i].x - last.x), last.y + u * (p[i].y - last.y)};
        }
        if (n < room && now >= 0.0) {
            out[n++] = p[i];
        }
        before = now;
        last = p[i];
    }
    return n >= 3 ? n : 0;
}

/* True if a point of the polygon is to the right of the line a-b. */
static bool is_cut(const bst_point2 *p, int count, bst_point2 a, bst_point2 b) {
    int i = 0;
    while (i < count && left_of(a, b, p[i]) >= 0.0) {
        i++;
    }
    return i < count;
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
    int n = p_count;
    const circle about = circle_about(p, p_count);
    for (int i = 0; i < q_count && n > 0; i++) {
        bst_point2 a = q[i], b = q[i + 1 < q_count ? i + 1 : 0];
        /* the circle alone decides for most edges */
        double left = left_of(a, b, about.centre), x = b.x - a.x, y = b.y - a.y;
        bool far = left * left > about.radius2 * (x * x + y * y);
        if (far && left < 0.0) {
            return 0;
        }
        if (!far && is_cut(from, n, a, b)) {
            n = keep_left(from, n, a, b, p_count + q_count, to);
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
        if (s->used + 2 * room > WORK || ++s->intersections > INTERSECTIONS_MAX) {
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
