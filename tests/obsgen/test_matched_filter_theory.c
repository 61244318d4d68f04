/* Matched filters in closed form, against plain sums. */
#include "boresight/vec.h"
#include "obsgen/model/matched_filter_theory.h"
#include "tests/test_support.h"

/* Sum over a fine grid of the product of two drawn streaks, 1/px^2. */
static double product_by_sum(bst_obsgen_path_px p, bst_obsgen_path_px q, double sigma) {
    const double step = 0.25, reach = 20.0;
    enum { PARTS = 100 };
    const double pi = 3.14159265358979323846;
    double sum = 0.0;
    for (double y = -reach; y <= reach; y += step) {
        for (double x = -reach; x <= reach; x += step) {
            double value[2];
            const bst_obsgen_path_px both[2] = {p, q};
            for (int k = 0; k < 2; k++) {
                value[k] = 0.0;
                for (int i = 0; i < PARTS; i++) {
                    double u = (i + 0.5) / PARTS - 0.5;
                    double dx = x - u * both[k].dx, dy = y - u * both[k].dy;
                    double r2 = (dx * dx + dy * dy) / (sigma * sigma);
                    value[k] += r2 < 60.0 ? exp(-0.5 * r2) / PARTS : 0.0;
                }
                value[k] /= 2.0 * pi * sigma * sigma;
            }
            sum += value[0] * value[1] * step * step;
        }
    }
    return sum;
}

static void products_are_those_of_sums(void **state) {
    (void)state;
    const double sigma = 1.2;
    const bst_obsgen_path_px paths[][2] = {{{0, 0}, {0, 0}},
                                           {{6, 0}, {0, 0}},
                                           {{8, 3}, {8, 3}},
                                           {{10, -4}, {3, 7}},
                                           {{0, 20}, {1, 0}}};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        double expected = product_by_sum(paths[i][0], paths[i][1], sigma);
        /* what the header states; the sum itself is right to 1e-4 */
        bst_assert_close(bst_matched_product(paths[i][0], paths[i][1], sigma), expected,
                         0.01 * expected);
        bst_assert_close(bst_matched_product(paths[i][1], paths[i][0], sigma), expected,
                         0.01 * expected);
    }
}

static void efficiency_is_one_for_its_own_filter_and_less_else(void **state) {
    (void)state;
    const bst_obsgen_path_px point = {0, 0}, streak = {12, 5}, other = {-5, 12};
    /* rounding, and the 1 % of products of crossed streaks */
    bst_assert_close(bst_matched_efficiency(point, point, 0.9), 1.0, 1e-12);
    bst_assert_close(bst_matched_efficiency(streak, streak, 0.9), 1.0, 1e-12);
    double far = bst_matched_efficiency(streak, other, 0.9),
           near = bst_matched_efficiency(streak, (bst_obsgen_path_px){12, 6}, 0.9);
    assert_true(far < near && near < 1.0 && far > 0.0);
    /* a long streak of length L through a point filter: SNR falls as sqrt(2 sqrt(pi) sigma / L) */
    bst_obsgen_path_px longest = {200, 0};
    double expected = sqrt(2.0 * sqrt(3.14159265358979323846) * 0.9 / 200.0);
    bst_assert_close(bst_matched_efficiency(longest, point, 0.9), expected, 0.01 * expected);
}

static void falloff_is_the_autocorrelation(void **state) {
    (void)state;
    /* Gaussian: exp(-d^2 / 4 sigma^2); closed form, rounding */
    bst_assert_close(bst_matched_falloff(1.5, 2.0, 0.0, 1.1), exp(-6.25 / (4.0 * 1.21)), 1e-12);
    /* a long streak: a triangle along it, 1 - d / L, but for its rounded top and foot */
    bst_assert_close(bst_matched_falloff(30.0, 0.0, 60.0, 1.0), 0.5, 0.01);
    bst_assert_close(bst_matched_falloff(0.0, 0.0, 60.0, 1.0), 1.0, 1e-12);
    /* no step where the forms for short and other streaks meet */
    double s = sqrt(2.0);
    bst_assert_close(bst_matched_falloff(1.0, 0.5, 0.0501 * s, 1.0),
                     bst_matched_falloff(1.0, 0.5, 0.0499 * s, 1.0), 1e-3);
}

/* White noise: every pixel is its own, so Pfa = rate / pixels. Smooth noise: the law of its maxima.
 */
static void thresholds_have_their_limits(void **state) {
    (void)state;
    const double pixels = 1048576.0, pi = 3.14159265358979323846;
    double share;
    /* Q(4.763) = 1 / 2^20; the law counts neighbours above as one, which are 1e-6 of them */
    bst_assert_close(bst_matched_pixel_maxima(0.05, 4.7630) * pixels, 1.0, 0.01);
    /* Rice's expected number of maxima, N u exp(-u^2/2) / (2 pi)^1.5 lambda, lambda = 1 / (2
     * sigma^2) for the filtered noise of a Gaussian of sigma */
    const double sigma = 4.0;
    double u = bst_matched_threshold(sigma, 0.0, 1.0, pixels, &share);
    double rate = pixels * u * exp(-0.5 * u * u) / (pow(2.0 * pi, 1.5) * 2.0 * sigma * sigma);
    bst_assert_close(rate, 1.0, 1e-4); /* bisection to 4e-7 */
    assert_true(share == 0.0);
    /* on the pixels alone as many where the field is smooth on them, fewer where it is not: 10 % at
     * 4 px, and beyond half at 0.9 px */
    bst_assert_close(bst_matched_pixel_maxima(sigma, u) * pixels, 1.0, 0.25);
    double sharp = bst_matched_threshold(0.9, 0.0, 1.0, pixels, NULL);
    assert_true(bst_matched_pixel_maxima(0.9, sharp) * pixels < 0.8);
    double more = bst_matched_threshold(1.0, 20.0, 1.0, pixels, &share);
    assert_true(more > bst_matched_threshold(1.0, 0.0, 1.0, pixels, NULL));
    assert_true(share > 0.02 && share < 0.7);
    assert_true(bst_matched_threshold(1.0, 0.0, 10.0, pixels, NULL) <
                bst_matched_threshold(1.0, 0.0, 1.0, pixels, NULL));
}

/* P(next > u | this > u) of two normal variables, summed in small steps. */
static double stays(double u, double rho) {
    const double step = 1e-3, root = sqrt(1.0 - rho * rho);
    double sum = 0.0, total = 0.0;
    for (double z = u + 0.5 * step; z < u + 6.0; z += step) {
        double weight = exp(-0.5 * (z * z - u * u));
        sum += weight * bst_matched_normal_below((rho * z - u) / root);
        total += weight;
    }
    return sum / total;
}

/* Maxima of the two filters are in the ratio of the roughness of their fields, by differences of
 * the autocorrelation, less those that a maximum of the other filter already is. */
static void streak_filters_share_the_false_alarms(void **state) {
    (void)state;
    static const double lengths[] = {0.03, 0.5, 3.0, 12.0, 90.0};
    const double sigma = 1.1, pixels = 1e6, h = 0.02;
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        const double length = lengths[i];
        double share, u = bst_matched_threshold(sigma, length, 1.0, pixels, &share);
        double along = 2.0 * (1.0 - bst_matched_falloff(h, 0.0, length, sigma)) / (h * h);
        double across = 2.0 * (1.0 - bst_matched_falloff(0.0, h, length, sigma)) / (h * h);
        double rho = bst_matched_efficiency((bst_obsgen_path_px){length, 0.0},
                                            (bst_obsgen_path_px){0.0, 0.0}, sigma);
        double point = 1.0 / (2.0 * sigma * sigma), fresh = 1.0 - stays(u, fmin(rho, 0.999999));
        double both = point + sqrt(along * across) * fresh;
        bst_assert_close(share, 1.0 - point / both, 0.01); /* the tail by 48 nodes */
        double rate = pixels * both * u * exp(-0.5 * u * u) / pow(2.0 * BST_PI, 1.5);
        bst_assert_close(rate, 1.0, 0.01);
    }
}

/* One or the other of two normal variables: closed forms for independent ones, for equal ones, and
 * for thresholds of zero (orthant probability). */
static void either_of_two_exceeds(void **state) {
    (void)state;
    const double at[] = {-2.5, -0.4, 0.0, 1.3};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) {
            double p = bst_matched_normal_below(at[i]), q = bst_matched_normal_below(at[k]);
            bst_assert_close(bst_matched_either_above(at[i], at[k], 0.0),
                             1.0 - (1.0 - p) * (1.0 - q), 1e-3);
            bst_assert_close(bst_matched_either_above(at[i], at[k], 1.0), fmax(p, q), 1e-3);
        }
    }
    for (double rho = 0.1; rho < 0.99; rho += 0.2) {
        bst_assert_close(bst_matched_either_above(0.0, 0.0, rho), 0.75 - asin(rho) / (2.0 * BST_PI),
                         1e-3);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(products_are_those_of_sums),
        cmocka_unit_test(efficiency_is_one_for_its_own_filter_and_less_else),
        cmocka_unit_test(falloff_is_the_autocorrelation),
        cmocka_unit_test(thresholds_have_their_limits),
        cmocka_unit_test(streak_filters_share_the_false_alarms),
        cmocka_unit_test(either_of_two_exceeds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
