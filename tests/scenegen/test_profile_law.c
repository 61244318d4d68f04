/* The profile law against the error function that it stands for. No device. */
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/stamp/profile_law.h"
#include "tests/test_support.h"

enum { REACH = 6 };

/* Light of a Gaussian in the pixel d beyond the one that holds its centre, f from that one's
 * middle. */
static double share(double sigma, double f, int d) {
    double root = sigma * sqrt(2.0);
    return 0.5 * (erf((d - f + 0.5) / root) - erf((d - f - 0.5) / root));
}

static double polynomial(const float *power, int count, double g) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        sum += (double)power[i] * pow(g, i);
    }
    return sum;
}

/* Largest error of a law over pixels 1 to 4 and all places, over the light of the central pixel of
 * a centred Gaussian, for an image widened by `widening` variances. */
static double worst_error(double sigma, int degree, double widening) {
    float law[4 * (BST_LAW_MOST_DEGREE + 1 + BST_LAW_FIRST + BST_LAW_SECOND)];
    int row = degree + 1 + BST_LAW_FIRST + BST_LAW_SECOND;
    bst_profile_law(sigma, degree, 4, law);
    double worst = 0.0;
    for (int d = 1; d <= 4; d++) {
        const float *p = law + (d - 1) * row;
        for (int k = 0; k <= 200; k++) {
            double f = k / 200.0, g = 2.0 * f - 1.0;
            double value =
                polynomial(p, degree + 1, g) +
                widening * polynomial(p + degree + 1, BST_LAW_FIRST, g) +
                widening * widening * polynomial(p + degree + 1 + BST_LAW_FIRST, BST_LAW_SECOND, g);
            worst = fmax(worst, fabs(value - share(sigma * sqrt(1.0 + widening), f, d)));
        }
    }
    return worst / share(sigma, 0.0, 0);
}

/* The share, its derivative by the widening and half the second one, by differences, in pixels up
 * to the sixth. */
static void powers_give_the_share_and_its_derivatives(void **state) {
    (void)state;
    const double sigmas[] = {0.7, 1.1, 2.0};
    for (int n = 0; n < 3; n++) {
        double sigma = sigmas[n], centre = share(sigma, 0.0, 0), h = 0.01;
        int degree = bst_profile_law_degree(sigma);
        int row = degree + 1 + BST_LAW_FIRST + BST_LAW_SECOND;
        assert_int_equal(bst_profile_law_floats(degree, REACH), REACH * row);
        float *law = calloc((size_t)REACH * (size_t)row, sizeof *law);
        assert_non_null(law);
        bst_profile_law(sigma, degree, REACH, law);
        for (int d = 1; d <= REACH; d++) {
            const float *p = law + (d - 1) * row;
            double first = 0.0, second = 0.0;
            for (int k = 0; k <= 20; k++) {
                double f = k / 20.0, g = 2.0 * f - 1.0, at = share(sigma, f, d);
                double more = share(sigma * sqrt(1.0 + h), f, d);
                double less = share(sigma * sqrt(1.0 - h), f, d);
                bst_assert_close(polynomial(p, degree + 1, g), at, BST_LAW_ERROR * centre);
                double slope = polynomial(p + degree + 1, BST_LAW_FIRST, g);
                double bow = polynomial(p + degree + 1 + BST_LAW_FIRST, BST_LAW_SECOND, g);
                first = fmax(first, fabs(slope - (more - less) / (2.0 * h)));
                second = fmax(second, fabs(bow - 0.5 * (more - 2.0 * at + less) / (h * h)));
            }
            /* polynomials of six and four powers through Gaussians times u and u (u^2 - 3), and
             * differences over 1 % */
            assert_true(first < 1e-4 * centre);
            assert_true(second < 5e-3 * centre);
        }
        free(law);
    }
}

/* The smallest odd degree that stays below a tenth of the allowed error. */
static void degrees_are_as_small_as_they_may_be(void **state) {
    (void)state;
    for (double sigma = 0.5; sigma < 3.0; sigma *= 1.3) {
        int degree = bst_profile_law_degree(sigma);
        assert_true(degree >= 5 && degree <= BST_LAW_MOST_DEGREE && degree % 2 == 1);
        /* 65 places against 201, and powers of float */
        double error = bst_profile_law_error(sigma, degree);
        bst_assert_close(error, worst_error(sigma, degree, 0.0), 0.02 * error + 3e-7);
        assert_true(error < 0.1 * BST_LAW_ERROR);
        if (degree > 5) {
            double coarse = bst_profile_law_error(sigma, degree - 2);
            assert_true(coarse >= 0.1 * BST_LAW_ERROR);
            bst_assert_close(coarse, worst_error(sigma, degree - 2, 0.0), 0.02 * coarse + 3e-7);
        }
    }
    assert_int_equal(bst_profile_law_degree(0.1), 0); /* a step: no polynomial */
}

/* The stated widening meets the allowed error, a quarter more does not. */
static void widest_is_as_wide_as_it_may_be(void **state) {
    (void)state;
    int limited = 0;
    for (double sigma = 0.5; sigma < 3.0; sigma *= 1.3) {
        int degree = bst_profile_law_degree(sigma);
        double widest = bst_profile_law_widest(sigma, degree);
        assert_true(widest > 1e-3 && widest <= 0.1);
        assert_true(worst_error(sigma, degree, widest) < 1.05 * BST_LAW_ERROR + 3e-7);
        if (widest < 0.1) {
            assert_true(worst_error(sigma, degree, widest / 0.8) > 0.95 * BST_LAW_ERROR - 3e-7);
            limited++;
        }
    }
    assert_true(limited >= 3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(powers_give_the_share_and_its_derivatives),
        cmocka_unit_test(degrees_are_as_small_as_they_may_be),
        cmocka_unit_test(widest_is_as_wide_as_it_may_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
