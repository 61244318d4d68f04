#include "scenegen/smear/ghost_points.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Error at the border of a disc, over the light of its inside, for cells as wide as the PSF's
 * sigma; it grows with the third power (tests/scenegen/test_ghosts.c). */
#define BORDER_ERROR 0.012
/* Cells of a disc, in PSF sigmas: the widest whose Gaussians are as wide as nodes may be, and the
 * narrowest. */
#define WIDEST_CELL 2.0
#define NARROWEST_CELL 0.25
/* A Gaussian's lattice ends here, in its sigmas. */
#define LATTICE_SIGMAS 5.2

/* Error of the profiles of widened nodes over the brightest pixel, beside that of the PSF's own:
 * 1e-5 covers blurs of 0.5 to 9 px (tests/scenegen/test_ghosts.c). */
#define WIDENED_ERROR 1e-5

enum { STRIPS = 16 };

static bst_status push(bst_ctx *ctx, bst_disc_points *list, double x, double y, double variance,
                       double share) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 1024;
        bst_disc_point *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d points of a ghost", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = (bst_disc_point){{x, y, variance}, share};
    return BST_OK;
}

/* Area and moments of a part of a cell. */
typedef struct moments {
    double area, x, y, rr; /* rr: of x^2 + y^2 */
} moments;

/* Adds `sign` times what a disc of radius r about the origin has in a cell: strips by their
 * middles, exact along them. */
static void add_disc(double r, double x0, double y0, double h, double sign, moments *m) {
    double strip = h / STRIPS;
    for (int k = 0; k < STRIPS; k++) {
        double y = y0 + (k + 0.5) * strip, half2 = r * r - y * y;
        if (!(half2 > 0.0)) {
            continue;
        }
        double half = sqrt(half2), a = fmax(x0, -half), b = fmin(x0 + h, half);
        if (b > a) {
            double area = sign * strip * (b - a), x = 0.5 * (a + b);
            m->area += area;
            m->x += area * x;
            m->y += area * y;
            m->rr += area * (x * x + (b - a) * (b - a) / 12.0 + y * y + strip * strip / 12.0);
        }
    }
}

/* Nearest and farthest distance of a cell from the origin. */
static void distances(double x0, double y0, double h, double *near, double *far) {
    double nx = fmax(fmax(x0, -x0 - h), 0.0), ny = fmax(fmax(y0, -y0 - h), 0.0);
    *near = hypot(nx, ny);
    *far = hypot(fmax(fabs(x0), fabs(x0 + h)), fmax(fabs(y0), fabs(y0 + h)));
}

static bst_status fill_disc(bst_ctx *ctx, const bst_ghost *g, double h, bst_disc_points *points) {
    double r = g->radius_px, hole = g->inner_radius_px, total = BST_PI * (r * r - hole * hole);
    double sum = 0.0;
    int reach = (int)ceil(r / h);
    for (int j = -reach; j < reach; j++) {
        for (int i = -reach; i < reach; i++) {
            double x0 = i * h, y0 = j * h, near, far;
            distances(x0, y0, h, &near, &far);
            if (near >= r || far <= hole) {
                continue;
            }
            if (far <= r && near >= hole) {
                BST_TRY(push(ctx, points, x0 + 0.5 * h, y0 + 0.5 * h, h * h / 12.0, h * h));
                sum += h * h;
                continue;
            }
            moments m = {0};
            add_disc(r, x0, y0, h, 1.0, &m);
            if (near < hole) {
                add_disc(hole, x0, y0, h, -1.0, &m);
            }
            if (m.area > 1e-6 * h * h) {
                double x = m.x / m.area, y = m.y / m.area;
                double variance = fmax(0.5 * (m.rr / m.area - x * x - y * y), 0.0);
                BST_TRY(push(ctx, points, x, y, fmin(variance, h * h / 12.0), m.area));
                sum += m.area;
            }
        }
    }
    assert(sum > 0.9 * total);
    for (int k = 0; k < points->count; k++) {
        points->items[k].share /= sum;
    }
    return BST_OK;
}

/* Error of a disc with cells of `cell` PSF sigmas. */
static double disc_error(double cell) {
    double v = 1.0 / (cell * cell) + 1.0 / 12.0;
    return 4.0 * exp(-2.0 * BST_PI * BST_PI * v) + BORDER_ERROR * cell * cell * cell;
}

static bst_status disc_points(bst_ctx *ctx, const bst_ghost *g, const bst_ghost_points_aim *aim,
                              bst_disc_points *points, double *error) {
    double widest = fmin(WIDEST_CELL, sqrt(12.0 * aim->widest)), cell = widest;
    while (cell > NARROWEST_CELL && disc_error(cell) > aim->allowed) {
        cell *= 0.85;
    }
    double area = BST_PI * g->radius_px * g->radius_px;
    double least = sqrt(area / aim->most_points) / aim->sigma_px;
    cell = fmin(fmax(cell, least), widest);
    *error = disc_error(cell);
    return fill_disc(ctx, g, fmin(cell * aim->sigma_px, 0.5 * g->radius_px), points);
}

static bst_status gaussian_points(bst_ctx *ctx, const bst_ghost *g, const bst_ghost_points_aim *aim,
                                  bst_disc_points *points, double *error) {
    double psf2 = aim->sigma_px * aim->sigma_px, all2 = g->sigma_px * g->sigma_px;
    double own2 = fmin(all2, 0.99 * aim->widest * psf2), between2 = all2 - own2;
    *error = WIDENED_ERROR;
    if (!(between2 > 1e-9 * all2)) {
        return push(ctx, points, 0.0, 0.0, all2, 1.0);
    }
    double allowed = fmin(fmax(aim->allowed, 1e-6), 0.05), narrow2 = psf2 + own2;
    double common2 = between2 * narrow2 / (between2 + narrow2);
    double h = BST_PI * sqrt(2.0 * common2 / log(4.0 / allowed));
    double reach = LATTICE_SIGMAS * sqrt(between2);
    h = fmax(h, 2.0 * reach / sqrt((double)aim->most_points));
    *error += 4.0 * exp(-2.0 * BST_PI * BST_PI * common2 / (h * h));
    int n = (int)ceil(reach / h);
    double sum = 0.0;
    for (int j = -n; j <= n; j++) {
        for (int i = -n; i <= n; i++) {
            double r2 = ((double)i * i + (double)j * j) * h * h;
            if (r2 > reach * reach) {
                continue;
            }
            double share = exp(-0.5 * r2 / between2);
            BST_TRY(push(ctx, points, i * h, j * h, own2, share));
            sum += share;
        }
    }
    for (int k = 0; k < points->count; k++) {
        points->items[k].share /= sum;
    }
    return BST_OK;
}

bst_status bst_ghost_points(bst_ctx *ctx, const bst_ghost *ghost, const bst_ghost_points_aim *aim,
                            bst_disc_points *points, double *error) {
    assert(ghost && aim && points && error && aim->sigma_px > 0.0 && aim->most_points > 0);
    points->count = 0;
    *error = 0.0;
    if (ghost->radius_px > 0.0) {
        return disc_points(ctx, ghost, aim, points, error);
    }
    return ghost->sigma_px > 0.0 ? gaussian_points(ctx, ghost, aim, points, error)
                                 : push(ctx, points, 0.0, 0.0, 0.0, 1.0);
}
