#include "imgproc/extended/outline.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"

/* Standard deviation of the lines through opposite points from the centre, share of the size: what
 * is not symmetric. scenarios/inspection.json: a hundredth leaves 2 frames
 * with more than 3 % of error, this none. */
static const double LINE_SIGMA = 0.005;
/* Standard deviation of the centroid, share of size and angle: a rod that points 63 deg away from
 * the image's plane, tan = 2, moves it by half. */
static const double CENTROID_SIGMA = 0.5;
/* Rounds in which lines that miss the place lose weight: three and five give the same,
 * ten lock onto wrong lines. */
enum { ROUNDS = 5 };

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

/* A line through two opposite points of support: normal and distance from the centroid, px, and the
 * range of directions in which they support the outline. */
typedef struct support_line {
    double nx, ny, distance_px, range_rad;
} support_line;

static int by_size(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Corner farthest along a direction. */
static bst_outline_point support(const bst_outline *o, double x, double y) {
    bst_outline_point best = o->corner[0];
    for (int i = 1; i < o->count; i++) {
        bst_outline_point p = o->corner[i];
        best = x * p.x_px + y * p.y_px > x * best.x_px + y * best.y_px ? p : best;
    }
    return best;
}

/* The lines of all directions; their points change only at the normals of the sides. */
static int support_lines(const bst_outline *o, double x_px, double y_px, support_line *line) {
    double normal[BST_OUTLINE_CORNERS];
    for (int i = 0; i < o->count; i++) {
        bst_outline_point a = o->corner[i], b = o->corner[(i + 1) % o->count];
        double angle = atan2(a.x_px - b.x_px, b.y_px - a.y_px);
        normal[i] = angle < 0.0 ? angle + BST_PI : angle;
    }
    qsort(normal, (size_t)o->count, sizeof *normal, by_size);
    for (int i = 0; i < o->count; i++) {
        double end = i + 1 < o->count ? normal[i + 1] : normal[0] + BST_PI;
        double middle = 0.5 * (normal[i] + end), x = cos(middle), y = sin(middle);
        bst_outline_point p = support(o, x, y), q = support(o, -x, -y);
        double dx = p.x_px - q.x_px, dy = p.y_px - q.y_px, length = hypot(dx, dy);
        line[i] =
            (support_line){.nx = -dy / length, .ny = dx / length, .range_rad = end - normal[i]};
        line[i].distance_px = line[i].nx * (p.x_px - x_px) + line[i].ny * (p.y_px - y_px);
    }
    return o->count;
}

void bst_outline_centre(const bst_outline *o, double angle_rad, double *x_px, double *y_px) {
    assert(o && angle_rad >= 0.0 && x_px && y_px);
    double length, angle, width, x = 0.0, y = 0.0;
    double area = bst_outline_centroid(o, x_px, y_px);
    if (!(area > 0.0) || !(angle_rad > 0.0)) {
        return;
    }
    bst_outline_extent(o, &length, &angle, &width);
    support_line line[BST_OUTLINE_CORNERS];
    int count = support_lines(o, *x_px, *y_px, line);
    double sigma = LINE_SIGMA * length, prior = CENTROID_SIGMA * length * angle_rad;
    for (int round = 0; round < ROUNDS; round++) {
        double xx = 1.0 / (prior * prior), yy = xx, xy = 0.0, bx = 0.0, by = 0.0;
        for (int i = 0; i < count; i++) {
            const support_line *l = &line[i];
            double miss = (l->distance_px - l->nx * x - l->ny * y) / sigma;
            double w = l->range_rad / (BST_PI * sigma * sigma);
            w = round > 0 ? w / (1.0 + miss * miss) : w;
            xx += w * l->nx * l->nx;
            xy += w * l->nx * l->ny;
            yy += w * l->ny * l->ny;
            bx += w * l->nx * l->distance_px;
            by += w * l->ny * l->distance_px;
        }
        double determinant = xx * yy - xy * xy;
        x = (yy * bx - xy * by) / determinant;
        y = (xx * by - xy * bx) / determinant;
    }
    *x_px += x;
    *y_px += y;
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
