#include <stdlib.h>

#include "scenegen/nodes.h"
#include "tests/test_support.h"

static const double sigma_px = 0.85;

static void moments_of(const bst_node_list *list, double *weight, double mean[3],
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
    const bst_path_point path[] = {
        {{5.0, 7.0, 1.0}, 0.0}, {{5.3, 7.0, 1.0}, 0.5}, {{5.3, 7.4, 0.8}, 1.0}};
    bst_node_list list = {0};
    bst_assert_ok(&ctx, bst_nodes_from_path(&ctx, path, 3, sigma_px, 0.03, true, &list));
    double weight, mean[3], cov[3][3];
    moments_of(&list, &weight, mean, cov);
    /* midpoints (5.15, 7) and (5.3, 7.2): mean (5.225, 7.1, 0.95) */
    bst_assert_close(weight, 1.0, 1e-14); /* rounding */
    bst_assert_close(mean[0], 5.225, 1e-13);
    bst_assert_close(mean[1], 7.1, 1e-13);
    bst_assert_close(mean[2], 0.95, 1e-13);
    /* var x: within (0.3^2 / 12) / 2, between 0.075^2; var y: (0.4^2 / 12) / 2 + 0.1^2; the axes
     * left out carry less than tolerance * sigma^2 / 2 = 0.011 each */
    bst_assert_close(cov[0][0], 0.00375 + 0.005625, 0.0109);
    bst_assert_close(cov[1][1], 0.4 * 0.4 / 24.0 + 0.01, 0.0109);
    list.count = 0;
    /* a finer tolerance keeps every axis, so all moments are exact to rounding */
    const bst_path_point small[] = {
        {{0, 0, 0}, 0.0}, {{0.1, 0.0, 0.0}, 0.3}, {{0.1, 0.1, 0.0}, 0.6}, {{0, 0.1, 0.1}, 1.0}};
    bst_assert_ok(&ctx, bst_nodes_from_path(&ctx, small, 4, sigma_px, 1e-4, true, &list));
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
            /* axes below tolerance * sigma^2 / 2 = 3.6e-5 are left out */
            bst_assert_close(cov[i][j], s[i][j] - m[i] * m[j], 4e-5);
        }
    }
    free(list.items);
}

/* Two-point Gauss-Legendre on one straight stretch. */
static void a_straight_group_is_gauss_legendre(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_path_point path[] = {{{0, 0, 0}, 0.0}, {{1.2, 0, 0}, 1.0}};
    bst_node_list list = {0};
    bst_assert_ok(&ctx, bst_nodes_from_path(&ctx, path, 2, sigma_px, 0.03, true, &list));
    assert_int_equal(list.count, 2);
    double a = 0.6 - 0.6 / sqrt(3.0), b = 0.6 + 0.6 / sqrt(3.0);
    bst_assert_close(fmin(list.items[0].p[0], list.items[1].p[0]), a, 1e-12); /* rounding */
    bst_assert_close(fmax(list.items[0].p[0], list.items[1].p[0]), b, 1e-12);
    bst_assert_close(list.items[0].weight, 0.5, 1e-14);
    free(list.items);
}

static void long_segments_are_cut_and_finer_levels_have_more(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_path_point path[] = {{{0, 0, 0}, 0.0}, {{300, 40, 0}, 1.0}};
    int previous = 0;
    for (double tolerance = 0.03; tolerance > 1e-6; tolerance *= 0.1) {
        bst_node_list list = {0};
        bst_assert_ok(&ctx, bst_nodes_from_path(&ctx, path, 2, sigma_px, tolerance, true, &list));
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

static void no_duration_is_one_node(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_path_point path[] = {{{3, 4, 5}, 0.5}, {{3, 4, 5}, 0.5}};
    bst_node_list list = {0};
    bst_assert_ok(&ctx, bst_nodes_from_path(&ctx, path, 2, sigma_px, 0.03, true, &list));
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
    bst_node point = {{0, 0, 0}, 1.0};
    double line = erf(0.5 / (sigma_px * sqrt(2.0)));
    bst_assert_close(bst_nodes_peak_share(&point, 1, sigma_px), line * line, 1e-15);
    const bst_path_point path[] = {{{0, 0, 0}, 0.0}, {{50, 0, 0}, 1.0}};
    bst_node_list list = {0};
    bst_assert_ok(&ctx, bst_nodes_from_path(&ctx, path, 2, sigma_px, 1e-3, true, &list));
    double expected = line * line * sigma_px * sqrt(2.0 * 3.14159265358979) / 50.0;
    /* the sum over nodes stands for the integral: 1 % at this spacing */
    bst_assert_close(bst_nodes_peak_share(list.items, list.count, sigma_px), expected,
                     0.01 * expected);
    free(list.items);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_group_keeps_its_moments),
        cmocka_unit_test(a_straight_group_is_gauss_legendre),
        cmocka_unit_test(long_segments_are_cut_and_finer_levels_have_more),
        cmocka_unit_test(no_duration_is_one_node),
        cmocka_unit_test(peak_shares),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
