/* Edges from the light that a PSF spreads beyond them: straight edges by their error function. */
#include "boresight/vec.h"
#include "imgproc/extended/edges.h"
#include "tests/test_support.h"

enum { W = 40, H = 30 };

/* Light outside of a straight edge, of 1 within. */
static double q_of(double u) {
    return 0.5 * erfc(u / sqrt(2.0));
}

/* Each neighbour by itself: the pixel is outside below three times what a straight edge spreads
 * over its distance, and beyond the frame there is no neighbour. */
static void neighbours_by_themselves(void **state) {
    (void)state;
    const struct {
        double sigma;
        int far, diagonal;
    } cases[] = {{0.6, 1, 1}, {2.0, 2, 1}, {3.4, 3, 2}}; /* rounded sigma and sigma / sqrt 2 */
    for (int n = 0; n < 3; n++) {
        for (int k = 0; k < 9; k++) {
            int u = k % 3 - 1, v = k / 3 - 1, reach = u && v ? cases[n].diagonal : cases[n].far;
            if (k == 4) {
                continue;
            }
            double share = 3.0 * q_of(reach * hypot(u, v) / cases[n].sigma);
            for (int side = -1; side <= 1; side += 2) {
                static float signal[W * H];
                bst_edges e;
                memset(signal, 0, sizeof signal);
                int x = 7, y = 21;
                signal[y * W + x] = (float)(1000.0 * share * (1.0 + 1e-4 * side));
                signal[(y + v * reach) * W + x + u * reach] = 1000.0f;
                bst_edges_init(&e, signal, W, H, cases[n].sigma);
                /* of nothing within reach the pixel itself is the brightest */
                assert_int_equal(bst_edges_outside(&e, x, y), side < 0);
            }
        }
    }
    static float dark[W * H];
    bst_edges e;
    memset(dark, 0, sizeof dark);
    bst_edges_init(&e, dark, W, H, 2.0);
    for (int k = 0; k < 4; k++) { /* the corners of the frame */
        assert_false(bst_edges_outside(&e, k % 2 * (W - 1), k / 2 * (H - 1)));
    }
}

/* The distance at which the logarithm of Q(d / s) has a slope, s with the pixel's width. */
static void distances_by_slopes(void **state) {
    (void)state;
    static const float none[1] = {0.0f};
    const double sigma = 1.4, s = sqrt(sigma * sigma + 1.0 / 12.0);
    bst_edges e;
    bst_edges_init(&e, none, 1, 1, sigma);
    for (double u = -0.97; u < 5.95; u += 0.173) {
        double slope = exp(-0.5 * u * u) / sqrt(2.0 * BST_PI) / q_of(u) / s;
        /* linear between steps of 0.1 */
        bst_assert_close(bst_edges_distance(&e, slope) / s, u, 2e-3);
    }
    bst_assert_close(bst_edges_distance(&e, 0.0), -s, 1e-12);
    bst_assert_close(bst_edges_distance(&e, 1e3), 6.0 * s, 1e-9);
}

/* Straight edges in all directions, of two levels: the place is on the edge. */
static void places_on_straight_edges(void **state) {
    (void)state;
    const double sigma = 1.6, s = sqrt(sigma * sigma + 1.0 / 12.0);
    for (int n = 0; n < 16; n++) {
        static float signal[W * H];
        double a = 0.3 + BST_PI / 8.0 * n, level = n % 2 ? 4e3 : 30.0, offset = 0.37;
        for (int i = 0; i < W * H; i++) { /* bright on the side of -(cos a, sin a) */
            double d = cos(a) * (i % W - 19.2) + sin(a) * ((double)(i / W) - 14.7) - offset;
            signal[i] = (float)(level * q_of(d / s));
        }
        bst_edges e;
        bst_edges_init(&e, signal, W, H, sigma);
        for (int y = 10; y < 20; y++) {
            for (int x = 14; x < 25; x++) {
                double d = cos(a) * (x - 19.2) + sin(a) * (y - 14.7) - offset;
                if (d < 0.0 || d > 3.0) {
                    continue;
                }
                bst_outline_point p = bst_edges_place(&e, x, y, 1e-6);
                double off = cos(a) * (p.x_px - 19.2) + sin(a) * (p.y_px - 14.7) - offset;
                double aside = -sin(a) * (p.x_px - x) + cos(a) * (p.y_px - y);
                bst_assert_close(off, 0.0, 0.12); /* the slope is that of 2 px */
                bst_assert_close(aside, 0.0, 0.12);
            }
        }
        /* signals below the least one have no gradient: the pixel itself */
        bst_outline_point p = bst_edges_place(&e, 20, 15, 1e9);
        bst_assert_close(p.x_px, 20.0, 0.0);
        bst_assert_close(p.y_px, 15.0, 0.0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(neighbours_by_themselves),
                                       cmocka_unit_test(distances_by_slopes),
                                       cmocka_unit_test(places_on_straight_edges)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
