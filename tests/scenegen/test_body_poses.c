/* The poses of a turning body: the image of an edge that moves is that of its integral. */
#include <math.h>

#include "scenegen/smear/body_poses.h"
#include "tests/test_support.h"

/* Image of an edge at x, PSF sigmas. */
static double edge(double x) {
    return 0.5 * erfc(-x / sqrt(2.0));
}

/* Integral of that. */
static double edge_integral(double x) {
    return x * edge(x) + exp(-0.5 * x * x) / sqrt(2.0 * BST_PI);
}

static void test_moving_edge(void **state) {
    (void)state;
    const double sigmas[] = {0.5, 6.0, 25.0, 27.0, 60.0, 84.0, 300.0};
    static bst_body_times t;
    for (int n = 0; n < 7; n++) {
        double length = sigmas[n], sum = 0.0, worst = 0.0;
        bst_body_times_choose(length, 0.1, &t);
        for (int k = 0; k < t.count; k++) {
            sum += t.weight[k];
        }
        bst_assert_close(sum, 1.0, 1e-12);
        for (double x = -4.0; x < length + 4.0; x += 0.1) {
            double image = 0.0;
            for (int k = 0; k < t.count; k++) {
                image += t.weight[k] * edge(x - t.u[k] * length);
            }
            double right = (edge_integral(x) - edge_integral(x - length)) / length;
            worst = fmax(worst, fabs(image - right));
        }
        /* composite Gauss-Legendre: 1e-4 */
        bst_assert_close(worst, 0.0, t.error + 1e-4);
        if (length > 80.0) {
            assert_true(t.count < length / 1.7);
        }
    }
    /* a lower tolerance takes shorter steps */
    bst_body_times_choose(84.0, 0.1, &t);
    int count = t.count;
    bst_body_times_choose(84.0, 0.01, &t);
    assert_true(t.count > 1.7 * count);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_moving_edge)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
