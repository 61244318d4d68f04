#include "imgproc/extended/outline.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

static int by_place(const void *a, const void *b) {
    const bst_outline_point *p = a, *q = b;
    if (p->x_px != q->x_px) {
        return p->x_px < q->x_px ? -1 : 1;
    }
    return (p->y_px > q->y_px) - (p->y_px < q->y_px);
}

/* Twice the area of a triangle, positive if a, b, c turn from +x towards +y. */
static double turn(bst_outline_point a, bst_outline_point b, bst_outline_point c) {
    return (b.x_px - a.x_px) * (c.y_px - a.y_px) - (b.y_px - a.y_px) * (c.x_px - a.x_px);
}

/* Removes the corner whose triangle with its neighbours is the smallest. */
static int remove_flattest(bst_outline_point *hull, int count) {
    int flattest = 0;
    double least = INFINITY;
    for (int i = 0; i < count; i++) {
        double area = turn(hull[(i + count - 1) % count], hull[i], hull[(i + 1) % count]);
        if (area < least) {
            least = area;
            flattest = i;
        }
    }
    for (int i = flattest; i + 1 < count; i++) {
        hull[i] = hull[i + 1];
    }
    return count - 1;
}

void bst_outline_make(bst_outline_point *points, int count, bst_outline_point *hull,
                      bst_outline *out) {
    assert(points && hull && out && count >= 0);
    qsort(points, (size_t)count, sizeof *points, by_place);
    int n = 0;
    for (int i = 0; i < count; i++) {
        while (n >= 2 && turn(hull[n - 2], hull[n - 1], points[i]) <= 0.0) {
            n--;
        }
        hull[n++] = points[i];
    }
    int lower = n + 1;
    for (int i = count - 2; i >= 0; i--) {
        while (n >= lower && turn(hull[n - 2], hull[n - 1], points[i]) <= 0.0) {
            n--;
        }
        hull[n++] = points[i];
    }
    n = n > 1 ? n - 1 : n; /* the last is the first */
    while (n > BST_OUTLINE_CORNERS) {
        n = remove_flattest(hull, n);
    }
    out->count = n;
    for (int i = 0; i < n; i++) {
        out->corner[i] = hull[i];
    }
}

double bst_outline_centroid(const bst_outline *o, double *x_px, double *y_px) {
    assert(o && x_px && y_px);
    double area = 0.0, x = 0.0, y = 0.0, mean_x = 0.0, mean_y = 0.0;
    for (int i = 0; i < o->count; i++) {
        bst_outline_point a = o->corner[i], b = o->corner[(i + 1) % o->count];
        bst_outline_point first = o->corner[0];
        double part = turn(first, a, b);
        area += part;
        x += part * (first.x_px + a.x_px + b.x_px);
        y += part * (first.y_px + a.y_px + b.y_px);
        mean_x += a.x_px / o->count;
        mean_y += a.y_px / o->count;
    }
    *x_px = area > 0.0 ? x / (3.0 * area) : mean_x;
    *y_px = area > 0.0 ? y / (3.0 * area) : mean_y;
    return 0.5 * area;
}

void bst_outline_bounds(const bst_outline *o, double *x0_px, double *y0_px, double *x1_px,
                        double *y1_px) {
    assert(o && x0_px && y0_px && x1_px && y1_px);
    *x0_px = *y0_px = INFINITY;
    *x1_px = *y1_px = -INFINITY;
    for (int i = 0; i < o->count; i++) {
        *x0_px = fmin(*x0_px, o->corner[i].x_px);
        *y0_px = fmin(*y0_px, o->corner[i].y_px);
        *x1_px = fmax(*x1_px, o->corner[i].x_px);
        *y1_px = fmax(*y1_px, o->corner[i].y_px);
    }
}

void bst_outline_extent(const bst_outline *o, double *length_px, double *angle_rad,
                        double *width_px) {
    assert(o && length_px && angle_rad && width_px);
    double longest = 0.0, narrowest = INFINITY;
    *angle_rad = 0.0;
    for (int i = 0; i < o->count; i++) {
        bst_outline_point a = o->corner[i], b = o->corner[(i + 1) % o->count];
        double side = hypot(b.x_px - a.x_px, b.y_px - a.y_px), across = 0.0;
        for (int k = 0; k < o->count; k++) {
            bst_outline_point c = o->corner[k];
            double dx = c.x_px - a.x_px, dy = c.y_px - a.y_px, distance = hypot(dx, dy);
            if (distance > longest) {
                longest = distance;
                *angle_rad = dx < 0.0 ? atan2(-dy, -dx) : atan2(dy, dx);
            }
            across = side > 0.0 ? fmax(across, turn(a, b, c) / side) : across;
        }
        narrowest = side > 0.0 ? fmin(narrowest, across) : narrowest;
    }
    *length_px = longest;
    *width_px = isfinite(narrowest) ? narrowest : 0.0;
}

double bst_outline_extent_along(const bst_outline *o, double x, double y) {
    assert(o);
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < o->count; i++) {
        double along = x * o->corner[i].x_px + y * o->corner[i].y_px;
        low = fmin(low, along);
        high = fmax(high, along);
    }
    return o->count > 0 ? high - low : 0.0;
}
