#include "scenegen/smear/image_nodes.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Largest side of the square of a node, px and PSF sigmas: a Gaussian of the same variance differs
 * in the fourth order. */
#define SIDE_PX 1.0
#define SIDE_SIGMAS 1.2
/* Largest slope of a line's image by its second moment across it: half of 0.4 / sigma^3. */
#define BEND 0.2

/* Moments of the light of a square of cells, px, about the image's first cell. */
typedef struct moments {
    double light, x, y, xx, xy, yy;
} moments;

/* One run. */
typedef struct run {
    const bst_resolved_image *image;
    const bst_image_nodes_aim *aim;
    bst_disc_points *points;
    bst_image_nodes_result *out;
    int shift_x, shift_y; /* cells before the first one in its largest square */
    int top;              /* side of the largest squares, cells */
} run;

/* Moments of one cell. The light of a cell that a straight border cuts is even in its part. */
static moments cell_moments(const run *r, int i, int j) {
    const bst_resolved_image *m = r->image;
    moments out = {0};
    i -= r->shift_x;
    j -= r->shift_y;
    if (i < 0 || j < 0 || i >= m->width || j >= m->height) {
        return out;
    }
    const bst_resolved_cell *c = &m->cells[(size_t)j * (size_t)m->width + (size_t)i];
    if (!(c->light > 0.0F)) {
        return out;
    }
    double size = m->cell_px, light = (double)c->light;
    double dx = fmin(fmax((double)c->moment_x / light, -0.5), 0.5);
    double dy = fmin(fmax((double)c->moment_y / light, -0.5), 0.5);
    double x = (i + 0.5 + dx) * size, y = (j + 0.5 + dy) * size;
    double wide = (1.0 - 2.0 * fabs(dx)) * size, high = (1.0 - 2.0 * fabs(dy)) * size;
    out.light = light;
    out.x = light * x;
    out.y = light * y;
    out.xx = light * (x * x + wide * wide / 12.0);
    out.xy = light * x * y;
    out.yy = light * (y * y + high * high / 12.0);
    return out;
}

static void add(moments *to, const moments *m) {
    to->light += m->light;
    to->x += m->x;
    to->y += m->y;
    to->xx += m->xx;
    to->xy += m->xy;
    to->yy += m->yy;
}

static bst_status push(bst_ctx *ctx, bst_disc_points *list, bst_vec3 offset, double share) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 4096;
        bst_disc_point *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d nodes of an image", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = (bst_disc_point){offset, share};
    return BST_OK;
}

/* Error of a square as one node, in electrons, over that allowed. */
static double error_of(const run *r, const moments *m, int side, double *variance,
                       double *error_e) {
    const bst_image_nodes_aim *a = r->aim;
    double x = m->x / m->light, y = m->y / m->light, size = side * r->image->cell_px;
    double xx = fmax(m->xx / m->light - x * x, 0.0), yy = fmax(m->yy / m->light - y * y, 0.0);
    double xy = m->xy / m->light - x * y, sigma3 = a->sigma_px * a->sigma_px * a->sigma_px;
    double widest = a->widest * a->sigma_px * a->sigma_px;
    *variance = fmin(0.5 * (xx + yy), widest);
    double apart = 0.5 * hypot(xx - yy, 2.0 * xy) + fmax(0.5 * (xx + yy) - widest, 0.0);
    double electrons = m->light * a->electrons;
    *error_e = BEND * electrons * apart / (size * sigma3);
    /* the error falls on pixels with half of the light about */
    double around = 0.5 * electrons / (size * size);
    return *error_e / (a->tolerance_sigma * sqrt(around + a->dark_variance_e2));
}

/* Appends the nodes of a square of cells. *sum: its moments. */
static bst_status add_square(bst_ctx *ctx, run *r, int i, int j, int side, moments *sum) {
    int first = r->points->count;
    *sum = (moments){0};
    double worst_e = r->out->error_e;
    if (side == 1) {
        *sum = cell_moments(r, i, j);
    } else {
        int half = side / 2;
        for (int n = 0; n < 4; n++) {
            moments part;
            BST_TRY(add_square(ctx, r, i + half * (n & 1), j + half * (n >> 1), half, &part));
            add(sum, &part);
        }
    }
    if (!(sum->light > 0.0)) {
        return BST_OK;
    }
    double variance, error_e, size = side * r->image->cell_px;
    if (side > 1 && r->points->count - first > 1 &&
        size > fmax(SIDE_PX, SIDE_SIGMAS * r->aim->sigma_px) * (1.0 + 1e-9)) {
        return BST_OK;
    }
    double part = error_of(r, sum, side, &variance, &error_e);
    if (side > 1 && part > 1.0) {
        return BST_OK;
    }
    r->points->count = first;
    r->out->error_e = fmax(side > 1 ? fmax(worst_e, error_e) : r->out->error_e, error_e);
    bst_vec3 at = {(r->image->x0 * r->image->cell_px) + sum->x / sum->light - r->aim->x0,
                   (r->image->y0 * r->image->cell_px) + sum->y / sum->light - r->aim->y0, variance};
    return push(ctx, r->points, at, sum->light);
}

/* Cells before the first one in its square. */
static int before(int first, int side) {
    int rest = first % side;
    return rest < 0 ? rest + side : rest;
}

bst_status bst_image_nodes(bst_ctx *ctx, const bst_resolved_image *image,
                           const bst_image_nodes_aim *aim, bst_disc_points *points,
                           bst_image_nodes_result *out) {
    run r = {.image = image, .aim = aim, .points = points, .out = out, .top = 1};
    double most = fmax(SIDE_PX, SIDE_SIGMAS * aim->sigma_px) * (1.0 + 1e-9);
    *out = (bst_image_nodes_result){0};
    points->count = 0;
    while (2 * r.top * image->cell_px <= most) {
        r.top *= 2;
    }
    r.shift_x = before(image->x0, r.top);
    r.shift_y = before(image->y0, r.top);
    double area = r.top * image->cell_px;
    area = fmax(area * area, 1e-300);
    for (int j = 0; j < image->height + r.shift_y; j += r.top) {
        for (int i = 0; i < image->width + r.shift_x; i += r.top) {
            moments sum;
            BST_TRY(add_square(ctx, &r, i, j, r.top, &sum));
            out->light += sum.light;
            out->peak = fmax(out->peak, sum.light * fmax(1.0, 1.0 / area));
        }
    }
    out->peak = fmin(out->peak, out->light);
    return BST_OK;
}
