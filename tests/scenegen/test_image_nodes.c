/* Nodes that stand for the image of a body: light and moments against sums over the cells, the
 * image behind the PSF against that of the cells themselves. The grid of cells begins before the
 * boresight in x and beyond it in y, beside the borders of the squares, and is not square. */
#include <stdlib.h>

#include "scenegen/smear/image_nodes.h"
#include "tests/test_support.h"

enum { WIDTH = 43, HEIGHT = 26, CELLS = WIDTH * HEIGHT, PIXELS = 20 };

static double cell = 0.25, sigma = 1.1;

static bst_resolved_cell cells[CELLS];
static bst_resolved_second second[CELLS];

typedef struct moments {
    double light, x, y, xx, xy, yy;
} moments;

static uint32_t draw(uint32_t *s) {
    *s = *s * 1664525u + 1013904223u;
    return *s >> 8;
}

static double even(uint32_t *s) {
    return draw(s) / 16777216.0;
}

enum { UNEVEN, DISC, LINES, KINDS };

/* Light of cell (i, j): each with its own, a disc with a sharp border, or two slanting lines. */
static double light_of(int kind, int i, int j, uint32_t *s) {
    double x = i + 0.5 - 20.0, y = j + 0.5 - 14.0;
    double noise = even(s);
    return kind == UNEVEN ? fmax(noise - 0.3, 0.0)
           : kind == DISC ? (hypot(x, y) < 9.0 ? 1.0 : 0.0)
                          : (fabs(0.8 * x - 0.6 * y) < 0.5 || fabs(0.28 * x + 0.96 * y) < 0.5);
}

static bst_resolved_image make(int kind, bool with_second) {
    uint32_t s = 77;
    bst_resolved_image m = {.cell_px = cell,
                            .x0 = -27,
                            .y0 = 6,
                            .width = WIDTH,
                            .height = HEIGHT,
                            .cells = cells,
                            .second = with_second ? second : NULL};
    for (int n = 0; n < CELLS; n++) {
        double e = light_of(kind, n % WIDTH, n / WIDTH, &s), dx = 0.4 * even(&s) - 0.2,
               dy = 0.4 * even(&s) - 0.2, xx = 0.05 * even(&s), yy = 0.07 * even(&s);
        double xy = (2.0 * even(&s) - 1.0) * sqrt(xx * yy);
        cells[n] = (bst_resolved_cell){(float)e, (float)(e * dx), (float)(e * dy), 1.0f};
        second[n] = (bst_resolved_second){(float)(e * (dx * dx + xx)), (float)(e * (dx * dy + xy)),
                                          (float)(e * (dy * dy + yy))};
    }
    return m;
}

/* Moments of a cell, px and px^2 from the boresight. Without second moments its light is even in a
 * rectangle about its centroid that reaches the nearer borders. */
static moments of_cell(const bst_resolved_image *m, int n) {
    const bst_resolved_cell *c = &m->cells[n];
    double e = (double)c->light, x = (m->x0 + n % WIDTH + 0.5) * cell,
           y = (m->y0 + n / WIDTH + 0.5) * cell;
    double mx = (double)c->moment_x * cell, my = (double)c->moment_y * cell;
    moments out = {e,
                   e * x + mx,
                   e * y + my,
                   e * x * x + 2 * x * mx,
                   e * x * y + x * my + y * mx,
                   e * y * y + 2 * y * my};
    if (m->second) {
        out.xx += (double)m->second[n].xx * cell * cell;
        out.xy += (double)m->second[n].xy * cell * cell;
        out.yy += (double)m->second[n].yy * cell * cell;
    } else if (e > 0.0) {
        double dx = mx / e, dy = my / e;
        double wide = 0.5 * cell - fabs(dx), high = 0.5 * cell - fabs(dy);
        out.xx += e * (dx * dx + wide * wide / 3);
        out.xy += e * dx * dy;
        out.yy += e * (dy * dy + high * high / 3);
    }
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

static moments of_image(const bst_resolved_image *m) {
    moments sum = {0};
    for (int n = 0; n < CELLS; n++) {
        const moments c = of_cell(m, n);
        add(&sum, &c);
    }
    return sum;
}

static moments of_points(const bst_disc_points *points, double x0, double y0) {
    moments m = {0};
    for (int i = 0; i < points->count; i++) {
        const bst_disc_point *p = &points->items[i];
        double x = p->offset.x + x0, y = p->offset.y + y0, v = p->offset.z;
        assert_true(p->share > 0.0 && v >= 0.0);
        const moments one = {p->share,         p->share * x,
                             p->share * y,     p->share * (x * x + v),
                             p->share * x * y, p->share * (y * y + v)};
        add(&m, &one);
    }
    return m;
}

/* Most light on a square of four cells, aligned with the boresight, per pixel where it is smaller.
 */
static double peak_of(const bst_resolved_image *m) {
    double squares[16][24] = {{0}}, most = 0.0;
    for (int n = 0; n < CELLS; n++) {
        int x = (int)floor((m->x0 + n % WIDTH) / 4.0) + 7, y = (m->y0 + n / WIDTH) / 4;
        squares[y][x] += (double)m->cells[n].light;
        most = fmax(most, squares[y][x]);
    }
    return most * fmax(1.0, 1.0 / (16.0 * cell * cell));
}

static void moments_are_those_of_the_cells(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_disc_points points = {0};
    for (int n = 0; n < KINDS * 2 * 2 * 4; n++) {
        cell = n / KINDS / 2 % 2 ? 0.19 : 0.25;
        sigma = n / KINDS % 2 ? 1.1 : 0.5; /* squares of up to 1.3 px, or of 1 px */
        const bst_resolved_image m = make(n % KINDS, n / KINDS % 2 == 0);
        bst_image_nodes_aim aim = {.sigma_px = sigma,
                                   .widest = 1.0,
                                   .electrons = 5e3,
                                   .dark_variance_e2 = 100.0,
                                   .tolerance_sigma = pow(10.0, -(n / KINDS / 4)),
                                   .blurred = n / KINDS / 2 % 2 == 1,
                                   .x0 = -3.25,
                                   .y0 = 8.5};
        bst_image_nodes_result result;
        bst_assert_ok(&ctx, bst_image_nodes(&ctx, &m, &aim, &points, &result));
        const moments a = of_points(&points, aim.x0, aim.y0), b = of_image(&m);
        bst_assert_close(a.light, b.light, 1e-9 * b.light); /* sums of doubles of float cells */
        bst_assert_close(result.light, b.light, 1e-9 * b.light);
        bst_assert_close(a.x, b.x, 1e-6 * b.light);
        bst_assert_close(a.y, b.y, 1e-6 * b.light);
        /* the mean of both axes is kept by each node, second moments of a part or more by pairs */
        bst_assert_close(a.xx + a.yy, b.xx + b.yy, 1e-5 * b.light);
        bst_assert_close(result.peak, fmin(peak_of(&m), b.light), 1e-9);
        if (aim.tolerance_sigma < 0.01 && m.second && !aim.blurred) { /* cells in pairs */
            bst_assert_close(a.xx, b.xx, 1e-4 * b.light);
            bst_assert_close(a.xy, b.xy, 1e-4 * b.light);
        }
    }
    free(points.items);
}

/* Adds light with these second moments to pixels, behind the PSF: point by point, at their
 * centres. */
static void expose(double light, double x, double y, double xx, double xy, double yy,
                   double *pixels) {
    xx += sigma * sigma;
    yy += sigma * sigma;
    double det = xx * yy - xy * xy;
    for (int n = 0; n < PIXELS * PIXELS; n++) {
        double dx = n % PIXELS - 11.0 - x, dy = n / PIXELS - 5.0 - y;
        double u = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det;
        pixels[n] += light * exp(-0.5 * u) / (2.0 * BST_PI * sqrt(det));
    }
}

/* The error is within the tolerance, and looser tolerances need fewer nodes. */
static void image_is_that_of_the_cells(void **state) {
    (void)state;
    static double sound[PIXELS * PIXELS], found[PIXELS * PIXELS];
    bst_ctx ctx = {0};
    bst_disc_points points = {0};
    cell = 0.25;
    sigma = 1.1;
    for (int n = 0; n < KINDS * 2; n++) {
        const bst_resolved_image m = make(n % KINDS, true);
        memset(sound, 0, sizeof sound);
        int before = 0;
        for (int k = 0; k < CELLS; k++) {
            const moments c = of_cell(&m, k);
            if (c.light > 0.0) {
                double x = c.x / c.light, y = c.y / c.light;
                expose(c.light, x, y, c.xx / c.light - x * x, c.xy / c.light - x * y,
                       c.yy / c.light - y * y, sound);
            }
        }
        for (int level = 0; level < 4; level++) {
            bst_image_nodes_aim aim = {.sigma_px = sigma,
                                       .widest = 0.5,
                                       .electrons = n % 2 ? 2e4 : 1e6,
                                       .dark_variance_e2 = 100.0,
                                       .tolerance_sigma = 0.01 * pow(10.0, level),
                                       .blurred = n >= KINDS,
                                       .x0 = 2.0,
                                       .y0 = -1.0};
            bst_image_nodes_result result;
            bst_assert_ok(&ctx, bst_image_nodes(&ctx, &m, &aim, &points, &result));
            memset(found, 0, sizeof found);
            for (int i = 0; i < points.count; i++) {
                const bst_disc_point *p = &points.items[i];
                expose(p->share, p->offset.x + 2.0, p->offset.y - 1.0, p->offset.z, 0.0,
                       p->offset.z, found);
            }
            double worst = 0.0, worst_e = 0.0;
            for (int i = 0; i < PIXELS * PIXELS; i++) {
                double error_e = fabs(found[i] - sound[i]) * aim.electrons;
                worst_e = fmax(worst_e, error_e);
                worst = fmax(worst, error_e / sqrt(sound[i] * aim.electrons + 100.0));
            }
            /* as large as allowed, or not smaller than one cell in two nodes */
            assert_true(worst <= aim.tolerance_sigma);
            assert_true(worst >= (level == 0 ? 0.02 : 0.08) * aim.tolerance_sigma);
            /* the estimate is a bound, and no loose one */
            assert_true(level == 3 || worst_e <= result.error_e);
            assert_true(worst_e >= 0.06 * result.error_e);
            assert_true(level == 0 || points.count <= before);
            before = points.count;
        }
    }
    free(points.items);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(moments_are_those_of_the_cells),
        cmocka_unit_test(image_is_that_of_the_cells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
