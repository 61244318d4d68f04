/* Light and moments of polygons by cell, against polygons that are cut by each cell and their
 * closed forms. */
#include "sim/satellite/area_sums.h"

#include "tests/satellite/satellite_support.h"

enum { WIDTH = 9, HEIGHT = 7, CELLS = WIDTH * HEIGHT, MOST = 16 };

/* Cuts a polygon by a half plane: coordinate `axis` at least (side 1) or at most (-1) `at`. */
static int cut(const bst_point2 *p, int n, int axis, double side, double at, bst_point2 *out) {
    int count = 0;
    for (int i = 0; i < n; i++) {
        bst_point2 a = p[i], b = p[(i + 1) % n];
        double u = side * ((axis ? a.y : a.x) - at), v = side * ((axis ? b.y : b.x) - at);
        if (u >= 0.0) {
            out[count++] = a;
        }
        if ((u < 0.0) != (v < 0.0)) {
            double t = u / (u - v);
            out[count++] = (bst_point2){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    return count;
}

/* Area, first and second moments about (x, y) of what a polygon has in the cell there. */
static void moments_in(const bst_point2 *p, int n, double x, double y, double m[6]) {
    bst_point2 a[MOST], b[MOST];
    n = cut(p, n, 0, 1.0, x - 0.5, a);
    n = cut(a, n, 0, -1.0, x + 0.5, b);
    n = cut(b, n, 1, 1.0, y - 0.5, a);
    n = cut(a, n, 1, -1.0, y + 0.5, b);
    memset(m, 0, 6 * sizeof *m);
    for (int i = 0; i < n; i++) {
        double u = b[i].x - x, v = b[i].y - y, s = b[(i + 1) % n].x - x, t = b[(i + 1) % n].y - y;
        double c = u * t - s * v;
        m[0] += c / 2.0;
        m[1] += c * (u + s) / 6.0;
        m[2] += c * (v + t) / 6.0;
        m[3] += c * (u * u + u * s + s * s) / 12.0;
        m[4] += c * (2.0 * u * v + u * t + s * v + 2.0 * s * t) / 24.0;
        m[5] += c * (v * v + v * t + t * t) / 12.0;
    }
}

/* Compares the image of sums with the light of polygons. */
static void compare(const bst_area_sums *sums, const double want[CELLS][6], double second) {
    static bst_resolved_cell cells[CELLS];
    static bst_resolved_second seconds[CELLS];
    bst_resolved_image image = {.cell_px = 1.0,
                                .x0 = -3,
                                .y0 = 5,
                                .width = WIDTH,
                                .height = HEIGHT,
                                .cells = cells,
                                .second = seconds};
    const double cell_rad = 0.05;
    bst_area_sums_finish(sums, cell_rad, &image);
    for (int i = 0; i < CELLS; i++) {
        /* a cell of the tangent plane off its middle has the solid angle (1 + r^2)^-3/2 */
        double u = cell_rad * (-3 + i % WIDTH + 0.5), v = cell_rad * (5.5 + (double)(i / WIDTH));
        double c = pow(1.0 + u * u + v * v, -1.5);
        /* single precision of sums of light up to 7 */
        bst_assert_close(cells[i].light, c * want[i][0], 4e-6);
        bst_assert_close(cells[i].moment_x, c * want[i][1], 2e-6);
        bst_assert_close(cells[i].moment_y, c * want[i][2], 2e-6);
        bst_assert_close(seconds[i].xx, c * want[i][3], second);
        bst_assert_close(seconds[i].xy, c * want[i][4], second);
        bst_assert_close(seconds[i].yy, c * want[i][5], second);
        bst_assert_close(cells[i].cover, 0.0, 0.0);
    }
}

static void add_wanted(const bst_point2 *p, int n, double light, double want[CELLS][6]) {
    for (int i = 0; i < CELLS; i++) {
        double m[6];
        moments_in(p, n, i % WIDTH + 0.5, (double)(i / WIDTH) + 0.5, m);
        for (int k = 0; k < 6; k++) {
            want[i][k] += light * m[k];
        }
    }
}

/* Polygons within the grid, at its edges, beyond them on all sides, flat and steep, with corners on
 * borders of cells; one at a time and all together. */
static void polygons_by_cell(void **state) {
    (void)state;
    static const struct {
        bst_point2 p[4];
        int n;
        double light;
    } shapes[] = {
        {{{2.2, 1.3}, {5.7, 2.1}, {3.4, 5.6}}, 3, 1.0},
        {{{1.1, 3.2}, {7.9, 3.4}, {7.8, 3.9}, {1.2, 3.6}}, 4, 2.0}, /* flat */
        {{{4.3, 1.1}, {4.8, 1.2}, {4.6, 5.9}, {4.1, 5.8}}, 4, 0.5}, /* steep */
        {{{2.0, 2.0}, {5.0, 2.0}, {5.0, 4.0}, {2.0, 4.0}}, 4, 3.0}, /* along cells */
        {{{0.2, 0.3}, {8.8, 0.1}, {8.7, 6.9}, {0.4, 6.6}}, 4, 1.0}, /* all cells, to the edges */
        {{{-4.0, -3.0}, {6.0, -2.0}, {3.0, 4.5}}, 3, 1.5},          /* beyond left and bottom */
        {{{4.0, 3.0}, {15.0, 2.0}, {6.0, 12.0}}, 3, 0.7},           /* beyond right and top */
        {{{-9.0, -9.0}, {20.0, -9.0}, {20.0, 20.0}, {-9.0, 20.0}}, 4, 1.0},
        {{{3.3, 2.6}, {3.6, 2.7}, {3.4, 2.9}}, 3, 40.0}, /* in one cell */
        {{{2.5, 4.5}, {6.5, 0.5}, {6.5, 4.5}}, 3, 1.0},  /* a diagonal through corners */
        {{{10.0, 1.0}, {12.0, 1.0}, {11.0, 3.0}}, 3, 1.0},
        {{{-3.0, 1.0}, {-1.0, 1.0}, {-2.0, 3.0}}, 3, 1.0},
    };
    enum { SHAPES = sizeof shapes / sizeof shapes[0] };
    static double want[CELLS][6], all[CELLS][6];
    bst_ctx ctx = {0};
    bst_area_sums sums = {0}, total = {0};
    bst_assert_ok(&ctx, bst_area_sums_begin(&ctx, &total, WIDTH, HEIGHT));
    for (int n = 0; n < SHAPES; n++) {
        memset(want, 0, sizeof want);
        bst_assert_ok(&ctx, bst_area_sums_begin(&ctx, &sums, WIDTH, HEIGHT));
        bst_area_sums_polygon(&sums, shapes[n].p, shapes[n].n, shapes[n].light);
        add_wanted(shapes[n].p, shapes[n].n, shapes[n].light, want);
        compare(&sums, want, 2e-6);
        if (n % 2) { /* in two ranges of rows */
            bst_area_sums_add(&total, &sums, 0, 3);
            bst_area_sums_add(&total, &sums, 3, HEIGHT);
        } else {
            bst_area_sums_polygon(&total, shapes[n].p, shapes[n].n, shapes[n].light);
        }
        add_wanted(shapes[n].p, shapes[n].n, shapes[n].light, all);
    }
    compare(&total, all, 1e-5);
    /* only some rows are added */
    memset(want, 0, sizeof want);
    bst_assert_ok(&ctx, bst_area_sums_begin(&ctx, &total, WIDTH, HEIGHT));
    bst_assert_ok(&ctx, bst_area_sums_begin(&ctx, &sums, WIDTH, HEIGHT));
    bst_area_sums_polygon(&sums, shapes[0].p, shapes[0].n, 1.0);
    bst_area_sums_add(&total, &sums, 2, 4);
    add_wanted(shapes[0].p, shapes[0].n, 1.0, want);
    memset(want, 0, 2 * WIDTH * sizeof want[0]);
    memset(want[4 * WIDTH], 0, (HEIGHT - 4) * WIDTH * sizeof want[0]);
    compare(&total, want, 2e-6);
    bst_area_sums_free(&sums);
    bst_area_sums_free(&total);
}

/* The faint edges have light and first moments; second ones are off by up to 0.016 of their light.
 */
static void faint_edges(void **state) {
    (void)state;
    static const bst_point2 p[] = {{0.7, 1.3}, {6.7, 2.1}, {3.4, 5.6}};
    static double want[CELLS][6];
    bst_ctx ctx = {0};
    bst_area_sums sums = {0};
    bst_assert_ok(&ctx, bst_area_sums_begin(&ctx, &sums, WIDTH, HEIGHT));
    for (int i = 0; i < 3; i++) { /* clockwise */
        bst_area_sums_faint_edge(&sums, p[(i + 1) % 3], p[i], 0.6);
    }
    add_wanted(p, 3, 0.6, want);
    compare(&sums, want, 2.0 * 0.016 * 0.6); /* of two edges at a corner */
    bst_area_sums_free(&sums);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(polygons_by_cell),
                                       cmocka_unit_test(faint_edges)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
