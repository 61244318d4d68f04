#include <stdlib.h>

#include "boresight/rng.h"
#include "scenegen/smear/motion.h"
#include "tests/test_support.h"

static const double sigma_px = 0.85;

static bst_status make_nodes(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                             double tolerance, double widest, bst_smear_node_list *list) {
    bst_smear_node_aim aim = {.psf_sigma_px = sigma_px, .tolerance = tolerance, .widest = widest};
    return bst_smear_nodes_from_path(ctx, path, count, &aim, list);
}

static void moments_of(const bst_smear_node_list *list, double *weight, double mean[3],
                       double cov[3][3]) {
    *weight = 0.0;
    for (int i = 0; i < 3; i++) {
        mean[i] = 0.0;
    }
    for (int n = 0; n < list->count; n++) {
        *weight += list->items[n].weight;
        for (int i = 0; i < 3; i++) {
            mean[i] += list->items[n].weight * list->items[n].p[i];
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            cov[i][j] = 0.0;
            for (int n = 0; n < list->count; n++) {
                cov[i][j] += list->items[n].weight * (list->items[n].p[i] - mean[i]) *
                             (list->items[n].p[j] - mean[j]);
            }
        }
    }
}

/* A short triangle of a path becomes one group: weight, mean and covariance are the path's. */
static void a_group_keeps_its_moments(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_smear_path_point path[] = {
        {{5.0, 7.0, 1.0}, 0.0}, {{5.3, 7.0, 1.0}, 0.5}, {{5.3, 7.4, 0.8}, 1.0}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, make_nodes(&ctx, path, 3, 0.03, true, &list));
    double weight, mean[3], cov[3][3];
    moments_of(&list, &weight, mean, cov);
    /* midpoints (5.15, 7) and (5.3, 7.2): mean (5.225, 7.1, 0.95) */
    bst_assert_close(weight, 1.0, 1e-14); /* rounding */
    bst_assert_close(mean[0], 5.225, 1e-13);
    bst_assert_close(mean[1], 7.1, 1e-13);
    bst_assert_close(mean[2], 0.95, 1e-13);
    /* var x: within (0.3^2 / 12) / 2, between 0.075^2; var y: (0.4^2 / 12) / 2 + 0.1^2; nodes and
     * widening together miss at most 2 tolerance sigma^2 = 0.043 of them */
    double wide = list.items[0].variance;
    bst_assert_close(cov[0][0] + wide, 0.00375 + 0.005625, 0.043);
    bst_assert_close(cov[1][1] + wide, 0.4 * 0.4 / 24.0 + 0.01, 0.043);
    list.count = 0;
    /* a finer tolerance keeps the covariance */
    const bst_smear_path_point small[] = {
        {{0, 0, 0}, 0.0}, {{0.1, 0.0, 0.0}, 0.3}, {{0.1, 0.1, 0.0}, 0.6}, {{0, 0.1, 0.1}, 1.0}};
    bst_assert_ok(&ctx, make_nodes(&ctx, small, 4, 1e-4, false, &list));
    moments_of(&list, &weight, mean, cov);
    double m[3] = {0}, s[3][3] = {{0}};
    enum { STEPS = 30000 };
    for (int k = 0; k < STEPS; k++) { /* the path by midpoints */
        double u = (k + 0.5) / STEPS, p[3];
        int g = u < 0.3 ? 0 : u < 0.6 ? 1 : 2;
        double v = (u - small[g].s) / (small[g + 1].s - small[g].s);
        for (int i = 0; i < 3; i++) {
            p[i] = small[g].p[i] + v * (small[g + 1].p[i] - small[g].p[i]);
            m[i] += p[i] / STEPS;
        }
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                s[i][j] += p[i] * p[j] / STEPS;
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        bst_assert_close(mean[i], m[i], 1e-9); /* midpoint rule: 1/STEPS^2 */
        for (int j = 0; j < 3; j++) {
            /* 2 tolerance sigma^2 = 1.5e-4 may be missed */
            bst_assert_close(cov[i][j], s[i][j] - m[i] * m[j], 1.5e-4);
        }
    }
    free(list.items);
}

/* Two-point Gauss-Legendre on one straight stretch. */
static void a_straight_group_is_gauss_legendre(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_smear_path_point path[] = {{{0, 0, 0}, 0.0}, {{1.2, 0, 0}, 1.0}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, make_nodes(&ctx, path, 2, 0.03, true, &list));
    assert_int_equal(list.count, 2);
    double a = 0.6 - 0.6 / sqrt(3.0), b = 0.6 + 0.6 / sqrt(3.0);
    bst_assert_close(fmin(list.items[0].p[0], list.items[1].p[0]), a, 1e-12); /* rounding */
    bst_assert_close(fmax(list.items[0].p[0], list.items[1].p[0]), b, 1e-12);
    bst_assert_close(list.items[0].weight, 0.5, 1e-14);
    free(list.items);
}

/* A path that moves, rests and moves faster: the node of the rest is exact, and groups beside it
 * are beside a jump of the speed. */
static void groups_beside_a_rest_have_a_larger_error(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_smear_path_point path[] = {
        {{0, 0, 0}, 0.0}, {{30, 0, 0}, 0.4}, {{30, 0, 0}, 0.7}, {{90, 0, 0}, 1.0}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, make_nodes(&ctx, path, 4, 0.03, 0.0, &list));
    int rest = 0;
    for (int n = 0; n < list.count; n++) {
        rest = list.items[n].weight > list.items[rest].weight ? n : rest;
    }
    bst_assert_close(list.items[rest].weight, 0.3, 1e-12);
    assert_true(rest > 12 && rest < list.count - 12);
    assert_true(list.items[rest].predicted == 0.0);
    double before = list.items[rest - 12].predicted, after = list.items[rest + 12].predicted;
    assert_true(list.items[rest - 1].predicted > 2.0 * before && before > 0.0);
    assert_true(list.items[rest + 1].predicted > 2.0 * after && after > 0.0);
    free(list.items);
}

static void long_segments_are_cut_and_finer_levels_have_more(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_smear_path_point path[] = {{{0, 0, 0}, 0.0}, {{300, 40, 0}, 1.0}};
    int previous = 0;
    for (double tolerance = 0.03; tolerance > 1e-6; tolerance *= 0.1) {
        bst_smear_node_list list = {0};
        bst_assert_ok(&ctx, make_nodes(&ctx, path, 2, tolerance, true, &list));
        double weight = 0.0;
        for (int n = 0; n < list.count; n++) {
            weight += list.items[n].weight;
        }
        bst_assert_close(weight, 1.0, 1e-12); /* rounding of some thousand terms */
        assert_true(list.count > previous);
        assert_true(list.count > 200 && list.count < 20000);
        previous = list.count;
        free(list.items);
    }
}

/* The image of a path at a place, over its centre's value for one node: by many midpoints. */
enum { PARTS = 4 }; /* of a stretch between points, under 0.3 px */
static double true_image(const bst_smear_path_point *path, int count, double x, double y) {
    double sum = 0.0, total = path[count - 1].s - path[0].s;
    for (int k = 0; k + 1 < count; k++) {
        double w = (path[k + 1].s - path[k].s) / total;
        for (int n = 0; n < PARTS; n++) {
            double u = (n + 0.5) / PARTS;
            double dx = x - path[k].p[0] - u * (path[k + 1].p[0] - path[k].p[0]);
            double dy = y - path[k].p[1] - u * (path[k + 1].p[1] - path[k].p[1]);
            sum += w / PARTS * exp(-0.5 * (dx * dx + dy * dy) / (sigma_px * sigma_px));
        }
    }
    return sum;
}

static double node_image(const bst_smear_node_list *list, double x, double y) {
    double sum = 0.0;
    for (int n = 0; n < list->count; n++) {
        const bst_smear_node *node = &list->items[n];
        double dx = x - node->p[0], dy = y - node->p[1];
        double variance = sigma_px * sigma_px + node->variance;
        sum += node->weight * sigma_px * sigma_px / variance *
               exp(-0.5 * (dx * dx + dy * dy) / variance);
    }
    return sum;
}

/* Largest difference of a path's image from its nodes', over the peak. */
static double worst_error(const bst_smear_path_point *path, int count,
                          const bst_smear_node_list *list, double size) {
    double worst = 0.0, peak = 0.0;
    for (double y = -4.0; y < size + 4.0; y += 1.1) {
        for (double x = -4.0; x < size + 4.0; x += 0.9) {
            double image = true_image(path, count, x, y);
            peak = fmax(peak, image);
            worst = fmax(worst, fabs(node_image(list, x, y) - image));
        }
    }
    return worst / peak;
}

/* Paths with jitter at many frequencies, from none to twice the slew, along and across the axes:
 * the image is right to the tolerance, and to the error that is reported. Jitter of a still line of
 * sight needs few nodes when they may be widened. */
static void jitter_is_kept_to_the_tolerance(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    enum { POINTS = 400 };
    bst_smear_path_point path[POINTS];
    for (int trial = 0; trial < 24; trial++) {
        bst_rng_key key = bst_rng_make_key(7, (uint64_t)trial, "test", "path");
        double length = trial % 4 * 4.0, angle = trial * 0.7, jitter = trial % 3 * 0.15;
        for (int k = 0; k < POINTS; k++) {
            double t = (double)k / (POINTS - 1);
            path[k] = (bst_smear_path_point){{0.5 * length * fabs(cos(angle)) * 2.0 * t,
                                              0.5 * length * fabs(sin(angle)) * 2.0 * t, 0.0},
                                             t};
            for (int i = 0; i < 2; i++) {
                for (int f = 0; f < 12; f++) {
                    double phase = 6.283 * bst_rng_uniform(key, (uint64_t)i, (uint64_t)f);
                    path[k].p[i] += jitter * sqrt(2.0 / 12) * sin(6.283 * (2 + 7 * f) * t + phase);
                }
            }
        }
        int previous = 1 << 30;
        for (int widen = 0; widen <= 1; widen++) {
            for (double tolerance = 0.03; tolerance > 2e-4; tolerance *= 0.1) {
                bst_smear_node_list list = {0};
                bst_assert_ok(&ctx, make_nodes(&ctx, path, POINTS, tolerance, widen, &list));
                double error = worst_error(path, POINTS, &list, length);
                assert_true(error <= tolerance);
                /* 2e-6: what the midpoints of the image that is taken for true miss */
                assert_true(error <= bst_smear_nodes_error(list.predicted, 1.0) + 2e-6);
                if (length == 0.0 && tolerance > 0.02) {
                    assert_true(list.count <= previous);
                    previous = list.count;
                }
                free(list.items);
            }
        }
        assert_true(length > 0.0 || previous <= 9);
    }
}

/* Largest error of a short path's image, over its peak, and the error predicted for it. */
static double short_path_error(const bst_smear_path_point *path, int count, double tolerance,
                               double *predicted) {
    bst_ctx ctx = {0};
    bst_smear_node_list list = {0};
    double worst = 0.0, peak = 0.0;
    bst_assert_ok(&ctx, make_nodes(&ctx, path, count, tolerance, 1.0, &list));
    for (double y = -3.0; y <= 3.0; y += 0.2) {
        for (double x = -3.0; x <= 3.0; x += 0.2) {
            double image = true_image(path, count, x, y);
            peak = fmax(peak, image);
            worst = fmax(worst, fabs(node_image(&list, x, y) - image));
        }
    }
    *predicted = bst_smear_nodes_error(list.predicted, 1.0);
    free(list.items);
    return worst / peak;
}

/* Jitter bends a streak like an S, E[y x^3], and reverses a slow one: its mean position across the
 * axis is no parabola, and nodes on a bend have third moments of their own. */
static void s_bends_and_reversals_are_predicted(void **state) {
    (void)state;
    enum { COUNT = 120 };
    bst_smear_path_point path[COUNT];
    for (int trial = 0; trial < 8; trial++) {
        bool reversal = trial >= 4;
        double size = 0.06 + 0.03 * (trial % 4), predicted;
        for (int k = 0; k < COUNT; k++) {
            double s = (double)k / (COUNT - 1), u = 2.0 * s - 1.0;
            double x = reversal ? 0.5 * u * u + 0.15 * u : 0.8 * u;
            double y = reversal ? 3.0 * size * u * (1.0 - 0.4 * u) : size * u * (5.0 * u * u - 3.0);
            path[k] = (bst_smear_path_point){{x, y, 0.0}, s};
        }
        for (double tolerance = 0.02; tolerance > 1e-4; tolerance *= 0.5) {
            double error = short_path_error(path, COUNT, tolerance, &predicted);
            /* 2e-6: what the midpoints of the image that is taken for true miss */
            assert_true(error <= predicted + 2e-6);
            /* groups of different speed may add up: BESIDE_ANOTHER in smear_quadrature.c */
            assert_true(predicted <= 1.25 * tolerance);
        }
    }
}

/* A straight path at even speed of short segments and a long one: its fourth moment is that of a
 * uniform distribution, length^4 / 80. A two-point rule for the long one would miss a third. */
static void unequal_segments_keep_their_moments(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    enum { SHORT = 8 };
    bst_smear_path_point path[SHORT + 2];
    bst_smear_node_list list = {0};
    double length = sigma_px, sum[5] = {0.0};
    for (int k = 0; k <= SHORT + 1; k++) {
        double s = k <= SHORT ? 1e-3 * k : 1.0;
        path[k] = (bst_smear_path_point){{length * s, 0.0, 0.0}, s};
    }
    bst_assert_ok(&ctx, make_nodes(&ctx, path, SHORT + 2, 1e-5, 0.0, &list));
    assert_int_equal(list.count, 3);
    for (int n = 0; n < list.count; n++) {
        double x = list.items[n].p[0] - 0.5 * length;
        for (int order = 0; order <= 4; order++) {
            sum[order] += list.items[n].weight * pow(x, order);
        }
    }
    bst_assert_close(sum[2], length * length / 12.0, 1e-9);
    bst_assert_close(sum[4], pow(length, 4) / 80.0, 1e-9);
    free(list.items);
}

/* A slow drift, and a fast jump with little light: the image is right in the noise of its own
 * light, also where that is far below the peak. */
static void a_jump_is_right_beside_the_peak(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    enum { SLOW = 4, FAST = 30, POINTS = SLOW + FAST + 1 };
    bst_smear_path_point path[POINTS];
    for (int trial = 0; trial < 4; trial++) {
        double share = pow(10.0, -2.0 - trial), drift = 0.3;
        double tolerance = 1e-4, worst = 0.0;
        for (int k = 0; k < POINTS; k++) {
            double slow = fmin((double)k / SLOW, 1.0), fast = fmax((double)(k - SLOW) / FAST, 0.0);
            path[k] = (bst_smear_path_point){{(drift * slow + 4.0 * fast) * sigma_px, 0.0, 0.0},
                                             (1.0 - share) * slow + share * fast};
        }
        bst_smear_node_list list = {0};
        double peak = true_image(path, POINTS, 0.5 * drift * sigma_px, 0.0);
        double dark = peak * 4e-5; /* a peak of 25,000 e- in noise of 1 e- */
        bst_assert_ok(&ctx, make_nodes(&ctx, path, POINTS, tolerance, 1.0, &list));
        for (double x = -4.0; x <= 10.0; x += 0.1) {
            double image = true_image(path, POINTS, x * sigma_px, 0.0);
            double error = fabs(node_image(&list, x * sigma_px, 0.0) - image);
            worst = fmax(worst, error / sqrt((image + dark) * peak));
        }
        print_message("         share %g: %.6f, %d nodes\n", share, worst, list.count);
        assert_true(worst <= tolerance);
        free(list.items);
    }
}

static void no_duration_is_one_node(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_smear_path_point path[] = {{{3, 4, 5}, 0.5}, {{3, 4, 5}, 0.5}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, make_nodes(&ctx, path, 2, 0.03, true, &list));
    assert_int_equal(list.count, 1);
    bst_assert_close(list.items[0].weight, 1.0, 0.0);
    bst_assert_close(list.items[0].p[2], 5.0, 0.0);
    free(list.items);
}

/* Closed forms: a point, and a long streak whose peak is erf-share times sqrt(2 pi)-line density.
 */
static void peak_shares(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_smear_node point = {{0, 0, 0}, 1.0, 0.0, 0.0, 0.0};
    double line = erf(0.5 / (sigma_px * sqrt(2.0)));
    bst_assert_close(bst_smear_nodes_peak_share(&point, 1, sigma_px), line * line, 1e-15);
    const bst_smear_path_point path[] = {{{0, 0, 0}, 0.0}, {{50, 0, 0}, 1.0}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, make_nodes(&ctx, path, 2, 1e-3, true, &list));
    double expected = line * line * sigma_px * sqrt(2.0 * 3.14159265358979) / 50.0;
    /* the sum over nodes stands for the integral: 1 % at this spacing */
    bst_assert_close(bst_smear_nodes_peak_share(list.items, list.count, sigma_px), expected,
                     0.01 * expected);
    free(list.items);
}

/* One group in the place of a long straight path: the predicted error is at least that of the image
 * at the path's middle, in closed form, and at most 0.3 above it, where the bound is up to 0.6
 * above it. Images that move by less than the path have less of the difference. */
static void long_groups_smooth_their_error(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double sigma = 0.85, lengths[2][3] = {{0.9, 1.3, 1.7}, {2.4, 3.0, 4.4}};
    const double tolerances[2][3] = {{0.02, 0.02, 0.02}, {0.01, 0.03, 0.1}};
    double before = 0.0;
    for (int n = 2; n <= 3; n++) {
        for (int l = 0; l < 3; l++) {
            double length = lengths[n - 2][l] * sigma, mean = 0.0, light = 0.0;
            const bst_smear_path_point path[] = {{{0.0, 0.0, 0.0}, 0.0}, {{length, 0.0, 0.0}, 1.0}};
            const bst_smear_node_aim aim = {.psf_sigma_px = sigma,
                                            .tolerance = tolerances[n - 2][l]};
            bst_smear_node_list list = {0};
            bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, 2, &aim, &list));
            assert_int_equal(list.count, n);
            for (int k = 0; k < n; k++) {
                double x = (list.items[k].p[0] - 0.5 * length) / sigma, own = 0.0;
                mean += list.items[k].weight * exp(-0.5 * x * x);
                for (int j = 0; j < n; j++) {
                    double d = (list.items[k].p[0] - list.items[j].p[0]) / sigma;
                    own += list.items[j].weight * exp(-0.5 * d * d);
                }
                light = fmax(light, own);
            }
            double half = 0.5 * length / sigma;
            double error = fabs(mean - sqrt(0.5 * BST_PI) / half * erf(half / sqrt(2.0))) / light;
            double bound = list.error[BST_NODE_SCALES - 2],
                   predicted = list.predicted[BST_NODE_SCALES - 2];
            print_message("         %d nodes, %.1f sigma: error %.5f, predicted %.5f, bound %.5f\n",
                          n, length / sigma, error, predicted, bound);
            assert_true(error <= predicted && predicted <= bound);
            assert_true(predicted <= 1.3 * error);
            assert_true(n == 2 || l < 2 || bound > 1.5 * error);
            before = 0.0;
            for (int k = 0; k < BST_NODE_SCALES; k++) {
                double part = 1.0 - list.predicted[k] / list.error[k];
                assert_true(part >= before - 1e-12);
                before = part;
            }
            assert_true(before < 1.0);
            free(list.items);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(long_groups_smooth_their_error),
        cmocka_unit_test(a_group_keeps_its_moments),
        cmocka_unit_test(a_straight_group_is_gauss_legendre),
        cmocka_unit_test(groups_beside_a_rest_have_a_larger_error),
        cmocka_unit_test(jitter_is_kept_to_the_tolerance),
        cmocka_unit_test(long_segments_are_cut_and_finer_levels_have_more),
        cmocka_unit_test(s_bends_and_reversals_are_predicted),
        cmocka_unit_test(unequal_segments_keep_their_moments),
        cmocka_unit_test(a_jump_is_right_beside_the_peak),
        cmocka_unit_test(no_duration_is_one_node),
        cmocka_unit_test(peak_shares),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
