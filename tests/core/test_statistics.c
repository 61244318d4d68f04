/* Tails of chi-square and of thresholds in noise, against other forms of the same distributions:
 * mixtures, integrals by Simpson's rule, a normal and a uniform variable added. */
#include "boresight/vec.h"
#include "sim/core/chi_square.h"
#include "sim/core/threshold_statistics.h"
#include "tests/test_support.h"

static double upper_tail(double u) {
    return 0.5 * erfc(u / sqrt(2.0));
}

/* P(chi-square with an odd number of degrees of freedom > x): Abramowitz and Stegun 26.4.4. */
static double central_tail(double x, int freedom) {
    double term = sqrt(2.0 * x / BST_PI) * exp(-0.5 * x), sum = 0.0;
    for (int n = 3; n <= freedom; n += 2) {
        sum += term;
        term *= x / n;
    }
    return 2.0 * upper_tail(sqrt(x)) + sum;
}

/* A non-central chi-square is a mixture of central ones by the Poisson distribution of d^2 / 2. */
static void tail_of_three(void **state) {
    (void)state;
    const double ds[] = {0.0, 1e-5, 0.9e-4, 1.1e-4, 0.01, 0.7, 2.5, 5.0};
    const double xs[] = {0.0, 0.3, 2.4, 11.0, 40.0};
    for (size_t i = 0; i < sizeof ds / sizeof *ds; i++) {
        for (size_t k = 0; k < sizeof xs / sizeof *xs; k++) {
            double expected = 0.0, weight = exp(-0.5 * ds[i] * ds[i]);
            for (int n = 0; n < 120; n++) {
                expected += weight * central_tail(xs[k], 3 + 2 * n);
                weight *= 0.5 * ds[i] * ds[i] / (n + 1);
            }
            /* differences of nearly equal exponentials over d lose digits above d = 1e-4 */
            bst_assert_close(bst_chi_square3_tail(xs[k], ds[i]), expected, 1e-8);
        }
    }
    for (double tail = 1e-12; tail < 0.99; tail *= 7.0) {
        bst_assert_close(central_tail(bst_chi_square3_quantile(tail), 3) / tail, 1.0, 1e-9);
    }
}

/* P(Y > v | X > u) by Simpson's rule. */
static double exceeds_by_simpson(double u, double v, double rho) {
    enum { STEPS = 4000 };
    double sum = 0.0, width = 9.0 / STEPS;
    for (int i = 0; i <= STEPS; i++) {
        double z = u + i * width, weight = i == 0 || i == STEPS ? 1.0 : i % 2 ? 4.0 : 2.0;
        sum += weight * exp(-0.5 * z * z) * upper_tail((v - rho * z) / sqrt(1.0 - rho * rho));
    }
    return sum * width / 3.0 / sqrt(2.0 * BST_PI) / upper_tail(u);
}

static void one_exceeds_as_the_other(void **state) {
    (void)state;
    const double cases[][3] = {{3.0, 3.0, 0.5}, {4.5, 3.5, 0.9},  {2.5, 2.5, 0.7},
                               {5.0, 5.0, 0.0}, {4.0, 3.0, -0.3}, {6.0, 4.5, 0.98}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const double *c = cases[i], expected = exceeds_by_simpson(c[0], c[1], c[2]);
        /* 48 midpoints: 3.2e-3 */
        bst_assert_close(bst_threshold_exceeds_too(c[0], c[1], c[2]) / expected, 1.0, 4e-3);
    }
    /* the same variable */
    bst_assert_close(bst_threshold_exceeds_too(3.0, 4.0, 1.0), upper_tail(4.0) / upper_tail(3.0),
                     1e-12);
    bst_assert_close(bst_threshold_exceeds_too(3.0, 2.0, 1.0), 1.0, 1e-12);
}

/* Adler 1981, theorem 6.3.1: det^(1/2) u exp(-u^2 / 2) / (2 pi)^(3/2); by hand for u = 5. */
static void maxima_of_a_field(void **state) {
    (void)state;
    bst_assert_close(bst_threshold_maxima(5.0, 2.0), 2.366188e-6, 1e-12);
}

static bst_threshold_weights equal_weights(int pixels) {
    bst_threshold_weights w;
    for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
        w.power[i] = pixels * pow(1.0 / sqrt(pixels), i + 3);
    }
    return w;
}

/* Where a decreasing function of the threshold reaches a tail. */
static double solve(double (*tail)(double v, const double *about), const double *about,
                    double wanted) {
    double low = -10.0, high = 40.0;
    for (int step = 0; step < 80; step++) {
        double middle = 0.5 * (low + high);
        *(tail(middle, about) > wanted ? &low : &high) = middle;
    }
    return low;
}

/* A normal variable of sigma about[0] and one that is even over about[1]: the mean of the normal
 * tail over the step. */
static double even_and_normal(double v, const double *about) {
    enum { STEPS = 400 };
    double sum = 0.0;
    for (int i = 0; i < STEPS; i++) {
        sum += upper_tail((v - about[1] * ((i + 0.5) / STEPS - 0.5)) / about[0]);
    }
    return sum / STEPS;
}

/* A Poisson variable of mean about[1] less its mean, with a normal one of sigma about[2], over
 * about[0]. */
static double counts_and_normal(double v, const double *about) {
    double sum = 0.0, chance = exp(-about[1]);
    for (int n = 0; n < 400; n++) {
        sum += chance * upper_tail((v * about[0] - (n - about[1])) / about[2]);
        chance *= about[1] / (n + 1);
    }
    return sum;
}

static void quantile_of_steps(void **state) {
    (void)state;
    const bst_threshold_weights one = equal_weights(1);
    const double steps[] = {0.6, 0.9, 1.2}, within[] = {3e-5, 3e-4, 2e-3}; /* eighth cumulant */
    for (int i = 0; i < 3; i++) {
        const double about[2] = {sqrt(1.0 - steps[i] * steps[i] / 12.0), steps[i]};
        const bst_threshold_noise noise = {.noise_e = 7.0, .step_e = 7.0 * steps[i]};
        double exact = solve(even_and_normal, about, upper_tail(3.0));
        bst_assert_close(bst_threshold_quantile(3.0, &one, &noise), exact, within[i]);
    }
}

static void quantile_of_counts(void **state) {
    (void)state;
    for (int pixels = 1; pixels <= 9; pixels += 4) {
        const bst_threshold_weights w = equal_weights(pixels);
        const double mean = 6.0, read = 2.0, total = sqrt(mean + read * read);
        const bst_threshold_noise noise = {.noise_e = total, .counted_e2 = mean};
        /* the sum over equal pixels has the mean and the variance of all of them */
        const double about[3] = {total * sqrt(pixels), mean * pixels, read * sqrt(pixels)};
        for (double u = 2.0; u <= 6.0; u += 2.0) {
            double exact = solve(counts_and_normal, about, upper_tail(u));
            bst_assert_close(bst_threshold_quantile(u, &w, &noise) / exact, 1.0, 2e-3);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tail_of_three), cmocka_unit_test(one_exceeds_as_the_other),
        cmocka_unit_test(maxima_of_a_field), cmocka_unit_test(quantile_of_steps),
        cmocka_unit_test(quantile_of_counts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
