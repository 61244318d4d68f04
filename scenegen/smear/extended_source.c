#include "scenegen/smear/extended_source.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/smear/gauss_legendre.h"
#include "scenegen/smear/smear_internal.h"

/* Radius, px (or sigmas of a wider PSF), up to which discs use quadrature, which needs fewer
 * points. */
#define SMALL_RADIUS 12.0
/* Width of a quadrature panel, in PSF sigmas. */
#define PANEL_SIGMAS 1.4

/* Crescents narrower than this (px, or PSF sigmas) use quadrature as well. */
#define THIN_WIDTH 6.0

enum { FINEST = 16 };

/* Scan of a disc on the focal plane. */
typedef struct scan {
    const bst_extended_source_view *view;
    bst_disc disc;
    bst_quat gcrf_from_focal;
    bst_vec3 middle;     /* disc centre, focal-plane axes, unit */
    double sine, cosine; /* of its angular radius */
    double x0, y0;       /* centre relative to the boresight, px */
    double cell;         /* side of the cells that are filled, px */
    int order;           /* quadrature points per cell and axis */
    bst_disc_points *out;
    double total;
} scan;

static bst_status push(bst_ctx *ctx, bst_disc_points *list, double x, double y, double share) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 4096;
        bst_disc_point *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d points of a disc", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    assert(list->count < list->capacity);
    list->items[list->count++] = (bst_disc_point){{x, y, 0.0}, share};
    return BST_OK;
}

/* Chord of the disc at y px; false if there is none. The limb is a cone about the centre: (v .
 * middle)^2 = cos^2 |v|^2, v = (x a, y a, 1). */
static bool chord(const scan *s, double y, double *from, double *to) {
    double a = s->view->scale_rad, t = y * a;
    bst_vec3 m = s->middle;
    /* about the centre's x, for small terms */
    double u0 = m.x / m.z, e = m.x * u0 + m.y * t + m.z, g = u0 * u0 + t * t + 1.0;
    double c2 = s->cosine * s->cosine;
    double p = c2 - m.x * m.x, q = m.x * e - c2 * u0;
    /* e^2 - c2 g = s2 g - (|v|^2 - e^2), the latter the squared sine of the distance */
    bst_vec3 v = {u0, t, 1.0};
    bst_vec3 across = bst_vec3_cross(v, m);
    double r = s->sine * s->sine * g - bst_vec3_dot(across, across);
    double root = q * q + p * r;
    if (!(p > 0.0) || !(root > 0.0)) {
        return false;
    }
    root = sqrt(root);
    *from = (u0 + (q - root) / p) / a;
    *to = (u0 + (q + root) / p) / a;
    return true;
}

/* Adds the points between two x positions of a row. */
static bst_status fill(bst_ctx *ctx, scan *s, double y, double height, double from, double to) {
    double a = s->view->scale_rad;
    for (int k = 0; k < s->order; k++) {
        double x = from + bst_smear_gauss_place[s->order - 1][k] * (to - from);
        bst_vec3 v = {x * a, y * a, 1.0};
        double length = bst_vec3_norm(v);
        bst_vec3 d = bst_quat_rotate(s->gcrf_from_focal, bst_vec3_scale(v, 1.0 / length));
        double share = bst_disc_radiance(&s->disc, d) * a * a / (length * length * length) *
                       height * (to - from) * bst_smear_gauss_weight[s->order - 1][k];
        if (share > 0.0) {
            BST_TRY(push(ctx, s->out, x - s->x0, y - s->y0, share));
            s->total += share;
        }
    }
    return BST_OK;
}

/* Adds one row of points, cell by cell; the outer cells end at the limb. */
static bst_status fill_row(bst_ctx *ctx, scan *s, double y, double height) {
    double from, to;
    if (!chord(s, y, &from, &to)) {
        return BST_OK;
    }
    from = fmax(from, s->view->min_x_px);
    to = fmin(to, s->view->max_x_px);
    double edge = s->view->edge_x_px, cell = s->cell;
    for (double x = from; x < to;) {
        double next = edge + cell * (floor((x - edge) / cell + 1e-9) + 1.0);
        next = fmin(next, to);
        BST_TRY(fill(ctx, s, y, height, x, next));
        x = next;
    }
    return BST_OK;
}

/* Number of strips of a row of cells: as many as the limb's slope requires. */
static int strips_of(const scan *s, double y) {
    double a0, a1, b0, b1, run = INFINITY;
    if (chord(s, y, &a0, &a1) && chord(s, y + s->cell, &b0, &b1)) {
        run = fmax(fabs(a0 - b0), fabs(a1 - b1));
    }
    int strips = 1;
    while (strips < FINEST && strips * s->cell < run) {
        strips *= 2;
    }
    return strips;
}

static bst_status scan_disc(bst_ctx *ctx, scan *s) {
    double reach = 1.01 * tan(asin(s->sine)) / s->view->scale_rad + s->cell;
    /* off axis the image of a circle is larger */
    reach /= s->middle.z * s->middle.z;
    double first = fmax(s->y0 - reach, s->view->min_y_px);
    double last = fmin(s->y0 + reach, s->view->max_y_px);
    double edge = s->view->edge_y_px;
    long long row = (long long)floor((first - edge) / s->cell);
    for (; edge + (double)row * s->cell < last; row++) {
        double y = edge + (double)row * s->cell;
        int strips = strips_of(s, y);
        double height = s->cell / strips;
        for (int n = 0; n < strips * s->order; n++) {
            int k = n % s->order;
            BST_TRY(fill_row(ctx, s,
                             y + height * (n / s->order + bst_smear_gauss_place[s->order - 1][k]),
                             height * bst_smear_gauss_weight[s->order - 1][k]));
        }
    }
    return BST_OK;
}

/* Appends the visible points of some light sources by quadrature. */
static bst_status add_quadrature(bst_ctx *ctx, const bst_scene_source *source, int lights,
                                 const bst_extended_source_view *view, double x0, double y0,
                                 bst_disc_points *points) {
    int first = points->count, kept = first;
    double a = view->scale_rad;
    bst_vec3 z = bst_vec3_unit(source->apparent_mid);
    BST_TRY(bst_disc_make_points(ctx, source, lights, PANEL_SIGMAS * view->sigma_px * a, points));
    for (int i = first; i < points->count; i++) {
        bst_vec3 d =
            bst_quat_rotate(view->q_focal_from_gcrf, bst_vec3_add(z, points->items[i].offset));
        double x = d.x / d.z / a, y = d.y / d.z / a;
        if (x >= view->min_x_px && x <= view->max_x_px && y >= view->min_y_px &&
            y <= view->max_y_px) {
            points->items[kept++] = (bst_disc_point){{x - x0, y - y0, 0.0}, points->items[i].share};
        }
    }
    points->count = kept;
    return BST_OK;
}

/* True if a light's crescent is too thin for the scan. */
static bool thin(const bst_disc_aspect *aspect, double radius_px, double sigma_px) {
    return radius_px * (1.0 + aspect->cosine) < THIN_WIDTH * fmax(1.0, sigma_px);
}

bst_status bst_extended_source_points(bst_ctx *ctx, const bst_scene_source *source,
                                      const bst_extended_source_view *view, bst_disc_points *points,
                                      double *peak) {
    assert(source && view && points && peak);
    points->count = 0;
    *peak = 1.0;
    const bst_scene_source_shape *shape = source->shape;
    bst_vec3 middle = bst_quat_rotate(view->q_focal_from_gcrf, bst_vec3_unit(source->apparent_mid));
    if (!(middle.z > 0.0)) {
        return BST_OK;
    }
    double a = view->scale_rad, x0 = middle.x / middle.z / a, y0 = middle.y / middle.z / a;
    double radius_px = tan(asin(shape->radius)) / a;
    if (radius_px <= SMALL_RADIUS * fmax(1.0, view->sigma_px)) {
        return add_quadrature(ctx, source, BST_DISC_ALL, view, x0, y0, points);
    }
    scan s = {.view = view,
              .gcrf_from_focal = bst_quat_conj(view->q_focal_from_gcrf),
              .middle = middle,
              .sine = shape->radius,
              .cosine = sqrt(1.0 - shape->radius * shape->radius),
              .x0 = x0,
              .y0 = y0,
              .cell = fmax(1.0, floor(view->sigma_px)),
              .out = points};
    bst_disc_begin(source, &s.disc);
    int apart = BST_DISC_SPECULAR;
    double scanned = shape->thermal + shape->diffuse + shape->earthshine;
    if (thin(&s.disc.sun, radius_px, view->sigma_px)) {
        apart |= BST_DISC_SUN;
        scanned -= shape->diffuse;
        s.disc.sun.scale = 0.0;
    }
    if (thin(&s.disc.earth, radius_px, view->sigma_px)) {
        apart |= BST_DISC_EARTH;
        scanned -= shape->earthshine;
        s.disc.earth.scale = 0.0;
    }
    s.order = (int)fmin(fmax(ceil(2.2 * s.cell / view->sigma_px), 2.0), BST_SMEAR_GAUSS_MOST);
    double wide = fmin(2.0 * radius_px, view->max_x_px - view->min_x_px);
    double high = fmin(2.0 * radius_px, view->max_y_px - view->min_y_px);
    double squares = fmax(wide * high, 0.0);
    while (s.order > 1 && squares / (s.cell * s.cell) * s.order * s.order > view->most_points) {
        s.order--;
    }
    while (squares / (s.cell * s.cell) > view->most_points) {
        s.cell += 1.0;
    }
    double top = s.disc.thermal + s.disc.sun.scale + s.disc.earth.scale;
    if (top > 0.0) {
        BST_TRY(scan_disc(ctx, &s));
    }
    double reach = 1.1 * radius_px;
    bool complete = x0 - reach > view->min_x_px && x0 + reach < view->max_x_px &&
                    y0 - reach > view->min_y_px && y0 + reach < view->max_y_px;
    for (int i = 0; i < points->count && complete; i++) {
        points->items[i].share *= scanned / s.total;
    }
    BST_TRY(add_quadrature(ctx, source, apart, view, x0, y0, points));
    *peak = fmin(1.0, top * a * a + 1.0 - scanned);
    return BST_OK;
}

bst_status bst_extended_source_spread(bst_ctx *ctx, const bst_disc_points *points, double stretch,
                                      bst_smear_node_list *list) {
    assert(points && list && points->count >= 0 && list->count >= 0);
    long long need = (long long)list->count * points->count;
    if (need > INT32_MAX / 64) {
        return bst_fail(ctx, BST_ERR_MEMORY,
                        "a disc of %d points on a path of %d nodes is too much", points->count,
                        list->count);
    }
    BST_TRY(bst_smear_reserve(ctx, (void **)&list->items, &list->capacity, need > 0 ? (int)need : 1,
                              sizeof *list->items));
    for (int p = points->count - 1; p >= 0; p--) { /* from the last one: in place */
        for (int k = 0; k < list->count; k++) {
            bst_smear_node node = list->items[k];
            node.p[0] += points->items[p].offset.x * stretch;
            node.p[1] += points->items[p].offset.y * stretch;
            node.weight *= points->items[p].share;
            node.variance += points->items[p].offset.z * stretch * stretch;
            list->items[(size_t)p * (size_t)list->count + (size_t)k] = node;
        }
    }
    list->count = (int)need;
    return BST_OK;
}
