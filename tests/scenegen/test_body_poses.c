/* The poses of a turning body: the image of an edge that moves is that of its integral. */
#include <math.h>

#include "scenegen/smear/body_poses.h"
#include "tests/test_support.h"

#define DARK_E2 74.0

/* Image of an edge at x, PSF sigmas. */
static double edge(double x) {
    return 0.5 * erfc(-x / sqrt(2.0));
}

/* Integral of that. */
static double edge_integral(double x) {
    return x * edge(x) + exp(-0.5 * x * x) / sqrt(2.0 * BST_PI);
}

/* Largest difference of the image of an edge from its integral, and of that over the noise of a
 * pixel with `light_e` electrons where the edge has passed, in sigma. */
static void find_error(const bst_body_times *t, double length, double light_e, double *error,
                       double *sigma) {
    *error = *sigma = 0.0;
    for (double x = -4.0; x < length + 4.0; x += 0.1) {
        double image = 0.0;
        for (int k = 0; k < t->count; k++) {
            image += t->weight[k] * edge(x - t->u[k] * length);
        }
        double right = (edge_integral(x) - edge_integral(x - length)) / length;
        double off = fabs(image - right);
        *error = fmax(*error, off);
        *sigma = fmax(*sigma, off * light_e / sqrt(fmax(right, 0.0) * light_e + DARK_E2));
    }
}

static void test_moving_edge(void **state) {
    (void)state;
    const double sigmas[] = {0.5, 6.0, 11.0, 25.0, 27.0, 60.0, 84.0, 300.0};
    const double allowed[] = {1e-3, 1e-4, 1e-5};
    static bst_body_times t;
    for (int n = 0; n < 24; n++) {
        double length = sigmas[n / 3], sum = 0.0, error, sigma, light_e = 1e4;
        bst_body_times_choose(length, allowed[n % 3], &t);
        for (int k = 0; k < t.count; k++) {
            sum += t.weight[k];
        }
        bst_assert_close(sum, 1.0, 1e-12);
        find_error(&t, length, light_e, &error, &sigma);
        if (t.error > 0.0) { /* graded: the error is a bound, also where there is little light */
            assert_true(error < t.error);
            assert_true(t.error <= allowed[n % 3]);
            assert_true(sigma < t.error * light_e / sqrt(t.light * light_e + DARK_E2));
        } else { /* composite Gauss-Legendre: 1e-4 */
            bst_assert_close(error, 0.0, 1e-4);
        }
    }
    /* equal steps with weights corrected at the ends took 47 for 7e-4 */
    bst_body_times_choose(84.0, 2.5e-4, &t);
    assert_true(t.count < 42);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_moving_edge)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
