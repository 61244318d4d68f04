/* Image of a shape against a point: closed forms of squares and pairs of points under a Gaussian.
 */
#include "sim/world/scene/shape_light.h"
#include "tests/test_support.h"

/* An image of cells, all dark. */
static bst_resolved_image make_image(double cell_px, int x0, int y0, int width, int height) {
    bst_resolved_image m = {
        .cell_px = cell_px, .x0 = x0, .y0 = y0, .width = width, .height = height};
    m.cells = calloc((size_t)width * (size_t)height, sizeof *m.cells);
    assert_non_null(m.cells);
    return m;
}

/* Integral along an axis of the square of a line of length `a` under a Gaussian, of light 1. */
static double squared_line(double a, double sigma) {
    double u = 0.5 * a / sigma;
    return (a * erf(u) - 2.0 * sigma / sqrt(BST_PI) * (1.0 - exp(-u * u))) / (a * a);
}

static void squares(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    const double sigma = 0.9,
                 sides[][2] = {{0.5, 0.5}, {2.0, 1.0}, {6.0, 3.0}, {40.0, 40.0}, {300.0, 150.0}};
    for (int n = 0; n < 5; n++) {
        double cell = sides[n][0] / 256.0, a = sides[n][0], b = sides[n][1];
        int high = (int)(b / cell);
        bst_resolved_image m = make_image(cell, 40, -30, 256, high);
        for (int i = 0; i < 256 * high; i++) {
            m.cells[i].light = 3.0f;
        }
        bst_shape_light_figures f;
        bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, sigma, &f));
        bst_assert_close(f.light, 3.0 * 256 * high, 1e-9 * f.light);
        bst_assert_close(f.x_px, (40 + 128) * cell, 1e-9 * a);
        bst_assert_close(f.y_px, (-30 + 0.5 * high) * cell, 1e-9 * a);
        bst_assert_close(f.xx, a * a / 12.0, 1e-4 * a * a);
        bst_assert_close(f.xy, 0.0, 1e-9 * a * a);
        bst_assert_close(f.yy, b * b / 12.0, 1e-3 * b * b);
        double point = 1.0 / (4.0 * BST_PI * sigma * sigma), s = sigma * sqrt(8.0);
        double snr = sqrt(squared_line(a, sigma) * squared_line(b, sigma) / point);
        double peak = erf(a / s) * erf(b / s) / (a * b) / (2.0 * point);
        double output = erf(a / (s * sqrt(2.0))) * erf(b / (s * sqrt(2.0))) / (a * b) / point;
        /* the grid has a 64th of the image, or half a sigma */
        bst_assert_close(f.snr_ratio, snr, 0.03 * snr);
        bst_assert_close(f.peak_ratio, peak, 0.04 * peak);
        bst_assert_close(f.filter_ratio, output, 0.03 * output);
        free(m.cells);
    }
    bst_shape_light_free(&work);
}

/* Two points, 3 : 1, at a distance d along the diagonal. */
static void two_points(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    const double sigma = 1.1;
    for (int d = 0; d <= 8; d += 2) {
        bst_resolved_image m = make_image(0.5, -3, 5, 16, 16);
        m.cells[0] = (bst_resolved_cell){.light = 3.0f, .moment_x = 0.3f}; /* 0.1 cells */
        bst_resolved_cell *other = &m.cells[d * 17];
        other->light += 1.0f;
        other->moment_x += 0.1f;
        bst_shape_light_figures f;
        bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, sigma, &f));
        double apart = 0.5 * d * sqrt(2.0);
        bst_assert_close(f.x_px, 0.5 * (-3 + 0.6) + 0.25 * 0.5 * d, 1e-6);
        bst_assert_close(f.y_px, 0.5 * (5 + 0.5) + 0.25 * 0.5 * d, 1e-6);
        bst_assert_close(f.xx, 3.0 / 16.0 * 0.25 * d * d, 1e-6);
        bst_assert_close(f.xy, 3.0 / 16.0 * 0.25 * d * d, 1e-6);
        double cross = exp(-0.25 * apart * apart / (sigma * sigma));
        bst_assert_close(f.snr_ratio, sqrt((9.0 + 1.0 + 6.0 * cross) / 16.0), 0.02);
        if (d == 8) { /* apart: the brighter one alone */
            bst_assert_close(f.peak_ratio, 0.75, 0.02);
        }
        free(m.cells);
    }
    bst_shape_light_free(&work);
}

static void no_light(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    bst_resolved_image m = make_image(1.0, 0, 0, 4, 4);
    bst_shape_light_figures f;
    bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, 1.0, &f));
    bst_assert_close(f.light, 0.0, 0);
    bst_assert_close(f.snr_ratio + f.filter_ratio + f.peak_ratio, 3.0, 0);
    free(m.cells);
    bst_shape_light_free(&work);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(squares), cmocka_unit_test(two_points),
                                       cmocka_unit_test(no_light)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
