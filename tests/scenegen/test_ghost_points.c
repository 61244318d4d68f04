/* Points that stand for the image of a ghost: light and moments in closed form, and the sum of
 * their Gaussians against integrals of the ghost. */
#include "scenegen/smear/ghost_points.h"

#include "boresight/vec.h"
#include "tests/test_support.h"

static bst_disc_points make_points(const bst_ghost *ghost, const bst_ghost_points_aim *aim,
                                   double *error) {
    bst_ctx ctx = {0};
    bst_disc_points points = {.count = 0};
    bst_assert_ok(&ctx, bst_ghost_points(&ctx, ghost, aim, &points, error));
    return points;
}

/* Light 1 about the centre, alike on both axes, with a variance of each; a ghost's light is spread
 * over all directions. */
static void check_moments(const bst_disc_points *p, double variance, double tolerance) {
    double light = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    for (int i = 0; i < p->count; i++) {
        const bst_disc_point *at = &p->items[i];
        light += at->share;
        x += at->share * at->offset.x;
        y += at->share * at->offset.y;
        xx += at->share * (at->offset.x * at->offset.x + at->offset.z);
        xy += at->share * at->offset.x * at->offset.y;
        yy += at->share * (at->offset.y * at->offset.y + at->offset.z);
        assert_true(at->share > 0.0 && at->offset.z >= 0.0);
    }
    bst_assert_close(light, 1.0, 1e-12);
    bst_assert_close(x, 0.0, tolerance * sqrt(variance) + 1e-12);
    bst_assert_close(y, 0.0, tolerance * sqrt(variance) + 1e-12);
    bst_assert_close(xx, variance, tolerance * variance);
    bst_assert_close(xy, 0.0, tolerance * variance + 1e-12);
    bst_assert_close(yy, variance, tolerance * variance);
}

/* Light per px^2 of all points under a Gaussian PSF. */
static double light_at(const bst_disc_points *p, double sigma, double x, double y) {
    double sum = 0.0;
    for (int i = 0; i < p->count; i++) {
        const bst_disc_point *at = &p->items[i];
        double v = sigma * sigma + at->offset.z;
        double dx = x - at->offset.x, dy = y - at->offset.y;
        sum += at->share * exp(-0.5 * (dx * dx + dy * dy) / v) / (2.0 * BST_PI * v);
    }
    return sum;
}

/* The same of an even disc: rows of it, each between its ends. */
static double disc_at(double r, double sigma, double x, double y) {
    enum { ROWS = 2000 };
    double sum = 0.0, root = sigma * sqrt(2.0);
    for (int k = 0; k < ROWS; k++) { /* even in the angle: smooth at the ends */
        double t = BST_PI * ((k + 0.5) / ROWS - 0.5), v = r * sin(t), half = r * cos(t);
        double d = (y - v) / sigma;
        sum += BST_PI / ROWS * half * exp(-0.5 * d * d) / (sigma * sqrt(2.0 * BST_PI)) * 0.5 *
               (erf((x + half) / root) - erf((x - half) / root));
    }
    return sum;
}

/* Discs and rings: the variance of each axis is (r^2 + hole^2) / 4; the light is that of the ring
 * to the error that is stated, which is what was asked for. */
static void rings(void **state) {
    (void)state;
    const double sigma = 1.3;
    const struct {
        double r, hole, allowed;
    } cases[] = {{6.0, 0.0, 1e-2}, {9.0, 4.1, 1e-3}, {14.3, 11.0, 3e-4}, {3.0, 1.0, 1e-4}};
    for (int n = 0; n < 4; n++) {
        double r = cases[n].r, hole = cases[n].hole, error;
        const bst_ghost ghost = {.radius_px = r, .inner_radius_px = hole};
        const bst_ghost_points_aim aim = {sigma, 0.3, cases[n].allowed, 100000};
        bst_disc_points p = make_points(&ghost, &aim, &error);
        /* strips of cells by their middles: a 16th of a cell, squared */
        check_moments(&p, 0.25 * (r * r + hole * hole), 1e-3);
        double area = BST_PI * (r * r - hole * hole), most = 0.0;
        bool coarse = error > cases[n].allowed;
        assert_true(!coarse || n == 3); /* cells have a least size */
        for (int i = 0; i < p.count; i++) {
            assert_true(p.items[i].offset.z <= 0.3 * sigma * sigma * (1.0 + 1e-12));
        }
        for (int k = 0; k < 40; k++) { /* along a slanting line through all of it */
            double at = 1.3 * r * k / 40.0, x = at * cos(0.7), y = at * sin(0.7);
            double want = disc_at(r, sigma, x, y);
            want -= hole > 0.0 ? disc_at(hole, sigma, x, y) : 0.0;
            most = fmax(most, fabs(light_at(&p, sigma, x, y) * area - want));
        }
        assert_true(most <= error);
        assert_true(most > 1e-3 * error || n == 3); /* not for nothing */
        free(p.items);
    }
}

/* Gaussians: one point where it may be that wide, else a lattice of narrower ones. */
static void gaussians(void **state) {
    (void)state;
    const double sigma = 1.1;
    for (int n = 0; n < 4; n++) {
        double own = (const double[]){0.5, 1.4, 4.0, 9.0}[n], error;
        const bst_ghost ghost = {.sigma_px = own};
        const bst_ghost_points_aim aim = {sigma, 0.8, n == 3 ? 1e-2 : 1e-4, 20000};
        bst_disc_points p = make_points(&ghost, &aim, &error);
        assert_int_equal(p.count == 1, n == 0);
        check_moments(&p, own * own, 2e-5); /* the lattice ends at 5.2 sigma */
        double all = own * own + sigma * sigma, most = 0.0;
        for (int i = 0; i < p.count; i++) {
            assert_true(p.items[i].offset.z <= 0.8 * sigma * sigma || n == 0);
        }
        for (int k = 0; k < 60; k++) {
            double x = 0.05 * k * own, y = 0.031 * k * own;
            double want = exp(-0.5 * (x * x + y * y) / all); /* over the brightest */
            most = fmax(most, fabs(light_at(&p, sigma, x, y) * 2.0 * BST_PI * all - want));
        }
        /* the next terms of Poisson's sum: the square of the first, with diagonals */
        assert_true(most <= error * (1.0 + error) && error <= 1.01 * aim.allowed + 1e-5);
        assert_true(n == 0 || most > 0.8 * aim.allowed); /* not finer than asked for */
        free(p.items);
    }
}

/* A point stays one; of few points the error is larger, and their number is kept. */
static void points_and_their_number(void **state) {
    (void)state;
    const bst_ghost point = {.intensity = 1.0};
    bst_ghost_points_aim aim = {1.0, 0.4, 1e-4, 200};
    double error, fine;
    bst_disc_points p = make_points(&point, &aim, &error);
    assert_int_equal(p.count, 1);
    bst_assert_close(p.items[0].offset.x + p.items[0].offset.y + p.items[0].offset.z, 0.0, 0.0);
    bst_assert_close(p.items[0].share, 1.0, 0.0);
    bst_assert_close(error, 0.0, 0.0);
    free(p.items);
    const bst_ghost disc = {.radius_px = 10.0}, blur = {.sigma_px = 12.0};
    for (int k = 0; k < 2; k++) {
        const bst_ghost *g = k ? &blur : &disc;
        aim.most_points = 400;
        p = make_points(g, &aim, &error);
        /* cells at the border of a disc are more than its area holds; a lattice in its circle */
        assert_true(p.count > 200 && p.count < 500);
        free(p.items);
        aim.most_points = 100000;
        p = make_points(g, &aim, &fine);
        assert_true(p.count > 1000 && fine < 0.5 * error);
        free(p.items);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(rings), cmocka_unit_test(gaussians),
                                       cmocka_unit_test(points_and_their_number)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
