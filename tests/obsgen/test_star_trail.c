/* What the camera's true path does to streaks, against sums over the plane. */
#include "boresight/vec.h"
#include "obsgen/streak/star_trail.h"
#include "tests/test_support.h"

enum { STEPS = 401 };

typedef struct path {
    double x[STEPS], y[STEPS];
} path;

static bst_star_trail_path route_of(const path *p) {
    return (bst_star_trail_path){p->x, p->y, STEPS};
}

/* Places less their mean, ends with half the weight. */
static void centre(path *p) {
    double x = 0.0, y = 0.0;
    for (int k = 0; k < STEPS; k++) {
        double w = (k == 0 || k == STEPS - 1 ? 0.5 : 1.0) / (STEPS - 1);
        x += w * p->x[k];
        y += w * p->y[k];
    }
    for (int k = 0; k < STEPS; k++) {
        p->x[k] -= x;
        p->y[k] -= y;
    }
}

/* The shift of a model, drawn at even times, that overlaps most with the path's light: by trying.
 */
static void best_shift(const path *p, double dx, double dy, double bend_y, double sigma,
                       double best[2]) {
    double most = 0.0, centre_x = 0.0, centre_y = 0.0;
    for (double step = 0.2; step > 0.004; step *= 0.5) {
        double from_x = centre_x, from_y = centre_y;
        for (int j = -4; j <= 4; j++) {
            for (int i = -4; i <= 4; i++) {
                double sum = 0.0, sx = from_x + i * step, sy = from_y + j * step;
                for (int k = 0; k < STEPS; k += 4) {
                    for (int m = 0; m < 60; m++) {
                        double u = (m + 0.5) / 30.0 - 1.0;
                        double ax = p->x[k] - 0.5 * u * dx - sx;
                        double ay = p->y[k] - 0.5 * u * dy - bend_y * 0.5 * (3 * u * u - 1) - sy;
                        sum += exp(-0.25 * (ax * ax + ay * ay) / (sigma * sigma));
                    }
                }
                if (sum > most) {
                    most = sum;
                    centre_x = sx;
                    centre_y = sy;
                }
            }
        }
    }
    best[0] = centre_x;
    best[1] = centre_y;
}

static void fits_land_where_the_light_overlaps_most(void **state) {
    (void)state;
    const double sigma = 0.9;
    path even, trembling, bent;
    for (int k = 0; k < STEPS; k++) {
        double u = 2.0 * k / (STEPS - 1) - 1.0;
        even.x[k] = 4.0 * u;
        even.y[k] = -3.0 * u;
        trembling.x[k] = 5.0 * u + 0.4 * cos(3.0 * u + 0.4);
        trembling.y[k] = 0.25 * sin(9.0 * u);
        bent.x[k] = 6.0 * u;
        bent.y[k] = 2.0 * 0.5 * (3.0 * u * u - 1.0) + 0.5 * u * u * u * u;
    }
    centre(&even);
    centre(&trembling);
    centre(&bent);
    double bias[2], best[2];
    bst_star_trail_path p = route_of(&even);
    bst_star_trail_bias(&p, 8.0, -6.0, 0.0, 0.0, sigma, bias);
    bst_assert_close(hypot(bias[0], bias[1]), 0.0, 1e-6); /* even: by symmetry */
    /* to first order in the trembling, 0.4 of 1.3 px: a fifth of it; the grid of the trial */
    p = route_of(&trembling);
    bst_star_trail_bias(&p, 10.0, 0.0, 0.0, 0.0, sigma, bias);
    best_shift(&trembling, 10.0, 0.0, 0.0, sigma, best);
    assert_true(fabs(best[0]) > 0.05);
    bst_assert_close(bias[0], best[0], 0.2 * fabs(best[0]) + 0.01);
    bst_assert_close(bias[1], best[1], 0.2 * fabs(best[1]) + 0.01);
    /* a known bend is found in several rounds */
    p = route_of(&bent);
    bst_star_trail_bias(&p, 12.0, 0.0, 0.0, 2.0, sigma, bias);
    best_shift(&bent, 12.0, 0.0, 2.0, sigma, best);
    bst_assert_close(bias[0], best[0], 0.02);
    bst_assert_close(bias[1], best[1], 0.02);
}

/* Least squares with the weights 1 / (noise + model) on a fine grid: place of the fit of a Gaussian
 * at rest to light that was at 0 for `rest` of the exposure and then moved evenly to `end`, less
 * the mean of the path, x. */
static double fitted_bias(double sigma, double rest, double end, double noise) {
    enum { SUB = 4, REACH = 3 * SUB * 2, PARTS = 40 };
    double c = 0.0, flux = 1.0, s2 = sigma * sigma, cell = 1.0 / (SUB * SUB);
    for (int round = 0; round < 60; round++) {
        double a[3] = {0.0}, g[2] = {0.0};
        for (int j = -REACH; j <= REACH; j++) {
            for (int i = -REACH; i <= REACH; i++) {
                double x = (double)i / SUB, y = (double)j / SUB, data = 0.0;
                for (int k = 0; k <= PARTS; k++) {
                    double at = k == 0 ? 0.0 : end * (k - 0.5) / PARTS;
                    double share = k == 0 ? rest : (1.0 - rest) / PARTS;
                    data += share * exp(-0.5 * ((x - at) * (x - at) + y * y) / s2);
                }
                data /= 2.0 * BST_PI * s2;
                double p = exp(-0.5 * ((x - c) * (x - c) + y * y) / s2) / (2.0 * BST_PI * s2);
                double slope = flux * p * (x - c) / s2, w = cell / (noise + flux * p);
                a[0] += w * slope * slope;
                a[1] += w * slope * p;
                a[2] += w * p * p;
                g[0] += w * slope * (data - flux * p);
                g[1] += w * p * (data - flux * p);
            }
        }
        double det = a[0] * a[2] - a[1] * a[1];
        c += 0.5 * (a[2] * g[0] - a[1] * g[1]) / det;
        flux += 0.5 * (a[0] * g[1] - a[1] * g[0]) / det;
    }
    return c - (1.0 - rest) * 0.5 * end;
}

static void bright_points_land_nearer_to_the_centroid(void **state) {
    (void)state;
    static bst_blend_weights weights;
    bst_blend_weights_init(&weights);
    const double sigma = 0.9, rest = 0.6, end = 2.0;
    path p;
    for (int k = 0; k < STEPS; k++) {
        p.x[k] = 0.0;
        p.y[k] = end * fmax((double)k / (STEPS - 1) - rest, 0.0) / (1.0 - rest);
    }
    centre(&p);
    bst_star_trail_path route = route_of(&p);
    double before = -INFINITY;
    /* light on the brightest pixel of 0.02, 2, 200 times the noise's variance */
    for (double noise = 10.0; noise > 1e-4; noise *= 0.01) {
        double bias[2] = {0.0, 0.0}, light = 1.0 / (2.0 * BST_PI * sigma * sigma) / noise;
        bst_star_trail_point_bias(&route, &weights, light, sigma, bias);
        double fit = fitted_bias(sigma, rest, end, noise);
        bst_assert_close(bias[0], 0.0, 1e-4);
        /* the table's distances are half a sigma apart; 41 steps of the fit's light: 0.01 px */
        bst_assert_close(bias[1], fit, 0.01 + 0.05 * fabs(fit));
        assert_true(bias[1] > before + 0.01);
        before = bias[1];
    }
}

static void the_way_has_the_light_of_the_path(void **state) {
    (void)state;
    static bst_star_trail_node nodes[BST_ROUTE_NODES];
    const double sigma = 0.9, s = sigma * sqrt(2.0);
    path p;
    /* at rest for a half, then 100 px */
    for (int k = 0; k < STEPS; k++) {
        double u = (double)k / (STEPS - 1);
        p.x[k] = u < 0.5 ? 0.0 : 200.0 * (u - 0.5);
        p.y[k] = 0.0;
    }
    bst_star_trail_path route = route_of(&p);
    int count = bst_star_trail_lay(&route, sigma, nodes);
    assert_true(count > 80 && count < 130);
    double rest = 0.0, on = 0.0;
    for (int i = 0; i < count; i++) {
        assert_true(i == 0 || nodes[i].time >= nodes[i - 1].time);
        rest = fabs(nodes[i].x) < 0.3 ? nodes[i].light : rest;
        on = fabs(nodes[i].x - 50.0) < 0.8 ? nodes[i].light : on;
    }
    /* half of a point's light and half of the end of a streak's; a streak's in its middle: of 100
     * px half the light, sqrt(2 pi) s of its length */
    double line = 0.5 * sqrt(2.0 * BST_PI) * s / 100.0;
    bst_assert_close(rest, 0.5 + 0.5 * line, 0.02); /* the node is up to 0.3 px off */
    bst_assert_close(on, line, 1e-3 * line + 1e-5);
}

/* Nodes in all directions are a pixel apart, or less by what rounding to steps of the path leaves:
 * none is taken for one at another place. */
static void nodes_of_all_directions(void **state) {
    (void)state;
    static path p;
    static bst_star_trail_node nodes[BST_ROUTE_NODES];
    for (int n = 0; n < 16; n++) {
        double c = cos(BST_PI * n / 8.0), s = sin(BST_PI * n / 8.0), length = 25.0;
        for (int k = 0; k < STEPS; k++) {
            double u = (double)k / (STEPS - 1) - 0.5;
            p.x[k] = length * c * u;
            p.y[k] = length * s * u;
        }
        const bst_star_trail_path route = route_of(&p);
        int count = bst_star_trail_lay(&route, 1.1, nodes), on = 0;
        for (int i = 0; i < count; i++) {
            on += nodes[i].time > 0.0 && nodes[i].time < 1.0;
            double apart =
                i ? hypot(nodes[i].x - nodes[i - 1].x, nodes[i].y - nodes[i - 1].y) : 1.0;
            assert_true(apart > 0.69 && apart < 1.1);
        }
        assert_true(on >= 24);
    }
}

/* The nodes of an even, straight path are on it, at the place of their time, up to its very ends,
 * where only steps to one side are near. */
static void the_way_of_an_even_path_is_the_path(void **state) {
    (void)state;
    static path p;
    static bst_star_trail_node nodes[BST_ROUTE_NODES];
    const double dx = 23.0, dy = -14.0;
    for (int k = 0; k < STEPS; k++) {
        double u = (double)k / (STEPS - 1) - 0.5;
        p.x[k] = dx * u;
        p.y[k] = dy * u;
    }
    const bst_star_trail_path route = route_of(&p);
    int count = bst_star_trail_lay(&route, 1.1, nodes), on = 0;
    for (int i = 0; i < count; i++) {
        if (nodes[i].time > 0.0 && nodes[i].time < 1.0) {
            on++;
            /* nodes are even between two steps of the path, a fifteenth of a pixel apart */
            bst_assert_close(nodes[i].x, dx * (nodes[i].time - 0.5), 1e-9);
            bst_assert_close(nodes[i].y, dy * (nodes[i].time - 0.5), 1e-9);
        }
    }
    assert_true(on > 20);
    /* light beyond the ends is half of that at them and falls off */
    assert_true(nodes[0].time == 0.0 && nodes[count - 1].time == 1.0);
    assert_true(nodes[0].x < -0.5 * dx - 1.1 && nodes[count - 1].y < 0.5 * dy - 1.1);
}

static void the_way_of_a_trembling_camera_is_the_ridge_of_the_light(void **state) {
    (void)state;
    static bst_star_trail_node nodes[BST_ROUTE_NODES];
    const double sigma = 1.2, length = 60.0;
    path p;
    /* across by 1 px, faster than the camera moves by the width of the filter */
    for (int k = 0; k < STEPS; k++) {
        p.x[k] = length * ((double)k / (STEPS - 1) - 0.5);
        p.y[k] = sin(1.1 * k);
    }
    bst_star_trail_path route = route_of(&p);
    int count = bst_star_trail_lay(&route, sigma, nodes), inner = 0;
    double least = INFINITY, most = 0.0;
    for (int i = 0; i < count; i++) {
        if (fabs(nodes[i].x) < 0.5 * length - 5.0) {
            inner++;
            assert_true(fabs(nodes[i].y) < 0.25);
            least = fmin(least, nodes[i].light);
            most = fmax(most, nodes[i].light);
        }
    }
    /* of an even line, widened by half a square pixel: no saddles that would break it up */
    double s2 = 2.0 * sigma * sigma, line = sqrt(2.0 * BST_PI / (s2 + 0.5)) * s2 / length;
    assert_true(inner > 40);
    assert_true(least > 0.95 * most);
    bst_assert_close(most / line, 1.0, 0.05);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fits_land_where_the_light_overlaps_most),
        cmocka_unit_test(bright_points_land_nearer_to_the_centroid),
        cmocka_unit_test(the_way_has_the_light_of_the_path),
        cmocka_unit_test(nodes_of_all_directions),
        cmocka_unit_test(the_way_of_an_even_path_is_the_path),
        cmocka_unit_test(the_way_of_a_trembling_camera_is_the_ridge_of_the_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
