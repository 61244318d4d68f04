/* Errors of a fitted segment against the inverse of a Fisher matrix that is summed from differences
 * of its image: bent, in several directions, with either end held. */
#include <string.h>

#include "imgproc/streak/segment_fit.h"
#include "tests/test_support.h"

enum { WIDE = 64, HIGH = 48, ALONG = 0, ACROSS, TURN, HALF, FLUX, WIDTH, BEND, ALL };
static const double NOISE_E = 9.0, EXCESS = 1.3;

/* The segment after a small change of one parameter; with one end held (side -1: the start) the
 * middle moves by half of what the other end does. */
static bst_segment changed(bst_segment s, int parameter, double by, double side) {
    double c = cos(s.angle_rad), q = sin(s.angle_rad);
    s.x_px += parameter == ALONG ? c * by : parameter == ACROSS ? -q * by : 0.0;
    s.y_px += parameter == ALONG ? q * by : parameter == ACROSS ? c * by : 0.0;
    s.angle_rad += parameter == TURN ? by : 0.0;
    s.half_px += parameter == HALF ? by : parameter == ALONG ? -side * by : 0.0;
    s.flux_e += parameter == FLUX ? by : 0.0;
    s.sigma_px *= parameter == WIDTH ? exp(by) : 1.0;
    s.bend_per_px += parameter == BEND ? by : 0.0;
    return s;
}

/* Inverse of the leading part of a matrix by elimination; parameters that are not free have none.
 */
static void invert(double a[ALL][ALL], const bool free[ALL], double out[ALL][ALL]) {
    for (int p = 0; p < ALL; p++) {
        for (int k = 0; k < ALL; k++) {
            out[p][k] = p == k;
            a[p][k] = free[p] && free[k] ? a[p][k] : p == k;
        }
    }
    for (int p = 0; p < ALL; p++) {
        double pivot = a[p][p];
        for (int k = 0; k < ALL; k++) {
            a[p][k] /= pivot;
            out[p][k] /= pivot;
        }
        for (int r = 0; r < ALL; r++) {
            double factor = r == p ? 0.0 : a[r][p];
            for (int k = 0; k < ALL; k++) {
                a[r][k] -= factor * a[p][k];
                out[r][k] -= factor * out[p][k];
            }
        }
    }
}

static void compare(const bst_segment *truth, const bst_segment_freedom *freedom) {
    static const double step[ALL] = {1e-4, 1e-4, 1e-5, 1e-4, 1.0, 1e-5, 1e-7};
    static bst_segment_pixel pixels[WIDE * HIGH];
    const double side = freedom->held[0] == freedom->held[1] ? 0.0 : freedom->held[0] ? -1.0 : 1.0;
    double a[ALL][ALL] = {{0.0}}, v[ALL][ALL];
    for (int i = 0; i < WIDE * HIGH; i++) {
        double x = i % WIDE, y = (double)(i / WIDE), d[ALL];
        double light = truth->flux_e * bst_segment_share(truth, x, y);
        pixels[i] = (bst_segment_pixel){(float)x, (float)y, (float)light};
        for (int p = 0; p < ALL; p++) {
            bst_segment more = changed(*truth, p, step[p], side),
                        less = changed(*truth, p, -step[p], side);
            d[p] = (more.flux_e * bst_segment_share(&more, x, y) -
                    less.flux_e * bst_segment_share(&less, x, y)) /
                   (2.0 * step[p]);
            for (int k = 0; k <= p; k++) {
                a[p][k] += d[p] * d[k] / (NOISE_E * NOISE_E + EXCESS * light);
                a[k][p] = a[p][k];
            }
        }
    }
    /* law of an end: 26 / m^4 with the squared SNR m^2 of a pixel's length */
    double per_px = a[FLUX][FLUX] * truth->flux_e * truth->flux_e / (2.0 * truth->half_px);
    double end = 26.0 / (per_px * per_px);
    invert(a,
           (const bool[ALL]){!(freedom->held[0] && freedom->held[1]), true, true,
                             !freedom->held[0] && !freedom->held[1], true, true, freedom->bent},
           v);
    if (freedom->held[0] && freedom->held[1]) {
        v[ALONG][ALONG] = 1.0;
    }
    const double c = cos(truth->angle_rad), q = sin(truth->angle_rad);
    double along = v[ALONG][ALONG] + 0.5 * end, across = v[ACROSS][ACROSS], both = v[ALONG][ACROSS];
    bst_segment found = *truth;
    bst_segment_errors e;
    const bst_segment_data data = {pixels, WIDE * HIGH, NOISE_E, EXCESS};
    assert_true(bst_segment_fit_run(&data, 5.0, freedom, &found, &e));
    bst_assert_close(found.x_px, truth->x_px, 1e-4);
    bst_assert_close(found.y_px, truth->y_px, 1e-4);
    const double all = along + across;
    bst_assert_close(e.end_variance, end, 1e-4 * end);
    bst_assert_close(e.cov_xx, c * c * along + q * q * across - 2.0 * c * q * both, 1e-4 * all);
    bst_assert_close(e.cov_yy, q * q * along + c * c * across + 2.0 * c * q * both, 1e-4 * all);
    bst_assert_close(e.cov_xy, c * q * (along - across) + (c * c - q * q) * both, 1e-4 * all);
    bst_assert_close(e.turn_variance, v[TURN][TURN], 1e-4 * v[TURN][TURN]);
    bst_assert_close(e.flux_variance, v[FLUX][FLUX], 1e-4 * v[FLUX][FLUX]);
}

static void errors_of_bent_segments(void **state) {
    (void)state;
    static const bst_segment_freedom freedoms[] = {{{false, false}, true},
                                                   {{false, false}, false},
                                                   {{true, false}, true},
                                                   {{false, true}, false},
                                                   {{true, true}, true}};
    for (int n = 0; n < 6; n++) {
        const bst_segment truth = {.x_px = 30.3,
                                   .y_px = 22.8,
                                   .angle_rad = 0.4 + 1.1 * n,
                                   .half_px = 11.0 + n,
                                   .bend_per_px = n % 3 == 0   ? 0.02
                                                  : n % 3 == 1 ? -0.013
                                                               : 0.0,
                                   .flux_e = 6000.0,
                                   .sigma_px = 1.1};
        for (size_t k = 0; k < sizeof freedoms / sizeof *freedoms; k++) {
            compare(&truth, &freedoms[k]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(errors_of_bent_segments)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
