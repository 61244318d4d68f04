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
/* The same for the fourth moment, of which a square has 1 / 120 of its side's fourth power less
 * than a Gaussian: 3 * 0.4 / (24 * 120). */
#define BEND_4 4.2e-4
/* Where squares of that size end in even light, over that light: the third derivative of a Gaussian
 * has the extremum 0.55, at a corner 0.66; its share of the tolerance is the rest of that for the
 * nodes of images, of which the pixels beside a border have a quarter. */
#define STEP_4 2.3e-4
#define STEP_SHARE 3.6
/* Third moments of a cell that a border cuts across its corners, 0.0026 of its side's cube, times
 * the extremum of a Gaussian's third derivative over 6, and a third: those of the cells along a
 * border have both signs. */
#define SKEW 0.8e-4
/* Error of a pair of nodes, or of four, over that of fewer, below which they are worth it. */
#define PAIR_GAIN 0.5
/* Four nodes at the corners of a rectangle have the second and fourth moments of a square if their
 * variance is that part of the square's, and of its sixth moment 1 / 2,900 of its side's sixth
 * power too much; the extremum of a Gaussian's sixth derivative is 15 * 0.4: that over 720 and
 * 2,900. */
#define FOUR_VARIANCE 0.2256
#define BEND_6 3e-6
/* Light on the pixels with the largest error, which are beside a border, over that at the node. */
#define BESIDE 0.1

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
    double *squares;      /* [squares_y][squares_x] light of the largest squares */
    int squares_x, squares_y;
    double contrast; /* of the current largest square with those about it, relative to its light */
} run;

/* Calls of fmax would take a third of the time. */
static inline double larger(double a, double b) {
    return a > b ? a : b;
}

static inline double within_half(double x) {
    return x < -0.5 ? -0.5 : x > 0.5 ? 0.5 : x;
}

/* Moments of one cell. Without its second moments, the light of a cell that a straight border cuts
 * is even in its part. */
static moments cell_moments(const run *r, int i, int j) {
    const bst_resolved_image *m = r->image;
    moments out = {0};
    i -= r->shift_x;
    j -= r->shift_y;
    if (i < 0 || j < 0 || i >= m->width || j >= m->height) {
        return out;
    }
    size_t at = (size_t)j * (size_t)m->width + (size_t)i;
    const bst_resolved_cell *c = &m->cells[at];
    if (!(c->light > 0.0F)) {
        return out;
    }
    double size = m->cell_px, light = (double)c->light;
    double dx = within_half((double)c->moment_x / light);
    double dy = within_half((double)c->moment_y / light);
    double x = (i + 0.5 + dx) * size, y = (j + 0.5 + dy) * size;
    out.light = light;
    out.x = light * x;
    out.y = light * y;
    if (m->second) {
        const bst_resolved_second *q = &m->second[at];
        double xx = larger((double)q->xx - light * dx * dx, 0.0) * size * size;
        double yy = larger((double)q->yy - light * dy * dy, 0.0) * size * size;
        out.xx = light * x * x + xx;
        out.xy = light * x * y + ((double)q->xy - light * dx * dy) * size * size;
        out.yy = light * y * y + yy;
        return out;
    }
    double wide = (1.0 - 2.0 * fabs(dx)) * size, high = (1.0 - 2.0 * fabs(dy)) * size;
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

/* Second moments about the centroid, px^2: mean of both axes, and half of the difference of the
 * longest and the shortest axis, of which the angle is half of that of (across, along). */
typedef struct widths {
    double mean, apart, across, along;
} widths;

static widths widths_of(const moments *m) {
    double x = m->x / m->light, y = m->y / m->light;
    double xx = larger(m->xx / m->light - x * x, 0.0), yy = larger(m->yy / m->light - y * y, 0.0);
    double xy = m->xy / m->light - x * y;
    double across = xx - yy, along = 2.0 * xy;
    return (widths){0.5 * (xx + yy), 0.5 * sqrt(across * across + along * along), across, along};
}

/* Error of a square as one node, as a pair along its longest axis that has its second moments, or
 * as four that also have its fourth ones, in electrons, over that allowed.
 *
 * Given:     light, w  of the square
 *            nodes     1, 2 or 4 */
static double error_of(const run *r, double light, const widths *w, int side, int nodes,
                       double *variance, double *error_e) {
    const bst_image_nodes_aim *a = r->aim;
    double size = side * r->image->cell_px, sigma3 = a->sigma_px * a->sigma_px * a->sigma_px;
    double widest = a->widest * a->sigma_px * a->sigma_px, electrons = light * a->electrons;
    double mean = nodes > 1 ? larger(w->mean - w->apart, 0.0) : w->mean, sides = size / a->sigma_px;
    mean *= nodes == 4 ? FOUR_VARIANCE : 1.0;
    *variance = mean < widest ? mean : widest;
    *error_e = nodes > 1 ? SKEW * electrons * size * size / (sigma3 * a->sigma_px)
                         : BEND * electrons * w->apart / (size * sigma3);
    *error_e += BEND * electrons * larger(mean - widest, 0.0) / (size * sigma3);
    double sides4 = sides * sides * sides * sides;
    double bend = nodes == 4 ? BEND_6 * sides * sides : BEND_4;
    *error_e += bend * r->contrast * electrons / (size * a->sigma_px) * sides4;
    double even = electrons / (size * size);
    /* squares of one cell have no smaller neighbours */
    double step_e = side == 1 && r->image->second ? 0.0 : STEP_4 * even * sides4;
    double part = *error_e / sqrt(BESIDE * even + a->dark_variance_e2);
    double step = step_e / (STEP_SHARE * sqrt(even + a->dark_variance_e2));
    *error_e = larger(*error_e, step_e);
    return larger(part, step) / a->tolerance_sigma;
}

/* Appends one node, a pair or four. at: the centroid, and the variance of each. */
static bst_status push_nodes(bst_ctx *ctx, const run *r, bst_vec3 at, double light, const widths *w,
                             int nodes) {
    if (nodes == 1) {
        return push(ctx, r->points, at, light);
    }
    double angle = 0.5 * atan2(w->along, w->across), c = cos(angle), s = sin(angle);
    double least = larger(w->mean - w->apart, 0.0),
           kept = nodes == 4 ? FOUR_VARIANCE * least : least;
    double along = sqrt(larger(w->mean + w->apart - kept, 0.0)), over = sqrt(least - kept);
    for (int n = 0; n < nodes; n++) {
        double u = n & 1 ? along : -along, v = nodes == 2 ? 0.0 : n & 2 ? over : -over;
        const bst_vec3 step = {u * c - v * s, u * s + v * c, 0.0};
        BST_TRY(push(ctx, r->points, bst_vec3_add(at, step), light / nodes));
    }
    return BST_OK;
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
    const widths w = widths_of(sum);
    double part = error_of(r, sum->light, &w, side, 1, &variance, &error_e);
    if (side > 1 && part > 1.0) {
        return BST_OK;
    }
    int nodes = 1;
    for (int more = 2; more <= (r->aim->blurred ? 4 : 2) && r->image->second && part > 1.0;
         more *= 2) {
        double variance_2, error_2_e;
        double part_2 = error_of(r, sum->light, &w, side, more, &variance_2, &error_2_e);
        if (part_2 < PAIR_GAIN * part) {
            nodes = more;
            part = part_2;
            variance = variance_2;
            error_e = error_2_e;
        }
    }
    r->points->count = first;
    r->out->error_e = larger(side > 1 ? worst_e : r->out->error_e, error_e);
    bst_vec3 at = {(r->image->x0 * r->image->cell_px) + sum->x / sum->light - r->aim->x0,
                   (r->image->y0 * r->image->cell_px) + sum->y / sum->light - r->aim->y0, variance};
    return push_nodes(ctx, r, at, sum->light, &w, nodes);
}

/* Cells before the first one in its square. */
static int before(int first, int side) {
    int rest = first % side;
    return rest < 0 ? rest + side : rest;
}

/* Largest difference of a square's light from that of its neighbours, relative to it. */
static double contrast_of(const run *r, int x, int y) {
    double own = r->squares[y * r->squares_x + x], most = 0.0;
    for (int v = y - 1; v <= y + 1; v++) {
        for (int u = x - 1; u <= x + 1; u++) {
            bool inside = u >= 0 && v >= 0 && u < r->squares_x && v < r->squares_y;
            most = larger(most, fabs((inside ? r->squares[v * r->squares_x + u] : 0.0) - own));
        }
    }
    return own > 0.0 ? fmin(most / own, 1.0) : 0.0;
}

/* Sums the light of the largest squares. */
static bst_status sum_squares(bst_ctx *ctx, run *r) {
    const bst_resolved_image *m = r->image;
    r->squares_x = (m->width + r->shift_x + r->top - 1) / r->top;
    r->squares_y = (m->height + r->shift_y + r->top - 1) / r->top;
    r->squares = calloc((size_t)r->squares_x * (size_t)r->squares_y, sizeof *r->squares);
    if (!r->squares) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells", m->width,
                        m->height);
    }
    for (int j = 0; j < m->height; j++) {
        const bst_resolved_cell *row = &m->cells[(size_t)j * (size_t)m->width];
        double *to = &r->squares[(size_t)((j + r->shift_y) / r->top) * (size_t)r->squares_x];
        for (int i = 0; i < m->width; i++) {
            to[(i + r->shift_x) / r->top] += (double)row[i].light;
        }
    }
    return BST_OK;
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
    bst_status status = sum_squares(ctx, &r);
    for (int n = 0; status == BST_OK && n < r.squares_x * r.squares_y; n++) {
        int x = n % r.squares_x, y = n / r.squares_x;
        moments sum;
        if (!(r.squares[n] > 0.0)) {
            continue;
        }
        r.contrast = contrast_of(&r, x, y);
        status = add_square(ctx, &r, x * r.top, y * r.top, r.top, &sum);
        out->light += sum.light;
        out->peak = fmax(out->peak, sum.light * fmax(1.0, 1.0 / area));
    }
    free(r.squares);
    out->peak = fmin(out->peak, out->light);
    return status;
}
