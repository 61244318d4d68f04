/* The bound against closed forms of the finely sampled Gaussian and 25-digit sums over pixels. */
#include "sim/eval/location_bound.h"

#include "boresight/vec.h"
#include "tests/test_support.h"

static bst_location_bound bound_of(const bst_eval_bound_source *source, double noise, bool shot,
                                   double margin) {
    bst_ctx ctx = {0};
    bst_location_bound bound;
    bst_eval_bound_noise n = {noise, shot};
    bst_assert_ok(&ctx, bst_location_bound_gaussian(&ctx, source, &n, margin, &bound));
    return bound;
}

/* White noise, pixels much smaller than the PSF: integrals of the Gaussian s of variance S^2 =
 * sigma^2
 * + 1/12 give var x = 2 S^2 / SNR^2 (integral s_x^2 over integral s^2 is 1 / (2 S^2)), and
 * SNR = F / (noise sqrt(4 pi S^2)) (King 1983). Tolerance: the pixel is a Gaussian of variance 1/12
 * up to fourth order, 1 / (120 * 8 sigma^4). */
static void white_noise_limit(void **state) {
    (void)state;
    for (double sigma = 3.0; sigma <= 6.0; sigma *= 2.0) {
        bst_eval_bound_source s = {.x_px = 0.3, .y_px = -0.2, .sigma_px = sigma, .flux_e = 1000};
        bst_location_bound b = bound_of(&s, 5.0, false, 7 * sigma);
        double width2 = sigma * sigma + 1.0 / 12, tolerance = 1.0 / (960 * pow(sigma, 4));
        bst_assert_close(b.snr * 5.0 * sqrt(4 * BST_PI * width2) / 1000, 1, tolerance);
        bst_assert_close(b.covariance[0][0] * b.snr * b.snr / (2 * width2), 1, 4 * tolerance);
        bst_assert_close(b.covariance[1][1] / b.covariance[0][0], 1, 1e-9); /* round */
        bst_assert_close(b.covariance[0][1] / b.covariance[0][0], 0, 1e-9);
        /* integrals of s^2 and s^3; the pixel's kurtosis counts three times as much in the latter
         */
        bst_ctx ctx = {0};
        double powers[2], peak = 1.0 / (2 * BST_PI * width2);
        bst_assert_ok(&ctx, bst_eval_gaussian_powers(&ctx, &s, powers));
        bst_assert_close(powers[0] / (0.5 * peak), 1, 2 * tolerance);
        bst_assert_close(powers[1] / (peak * peak / 3), 1, 6 * tolerance);
    }
}

/* Photon noise alone: var x = S^2 / F, var F = F (Winick 1986); the background's noise is made
 * small, not zero. Tolerances: that noise, and the unknown background under few pixels. */
static void photon_limit(void **state) {
    (void)state;
    bst_eval_bound_source s = {.x_px = 0.1, .y_px = 0.4, .sigma_px = 3, .flux_e = 1e6};
    bst_location_bound b = bound_of(&s, 1e-3, true, 24);
    bst_assert_close(b.covariance[0][0] * 1e6 / (9 + 1.0 / 12), 1, 2e-3);
    bst_assert_close(b.covariance[BST_BOUND_FLUX][BST_BOUND_FLUX] / 1e6, 1, 2e-3);
}

/* White noise is linear in flux and background: var F = noise^2 / (sum p^2 - (sum p)^2 / n), and
 * the place is another matter for an image centred on a pixel, by symmetry. */
static void flux_bound_is_the_linear_one(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_eval_bound_source s = {.x_px = 7, .y_px = 3, .sigma_px = 0.85, .flux_e = 400};
    for (double margin = 3; margin <= 30; margin += 9) {
        double powers[2], side = 2 * margin + 1;
        bst_assert_ok(&ctx, bst_eval_gaussian_powers(&ctx, &s, powers));
        double sum2 = powers[0];
        bst_location_bound b = bound_of(&s, 8.0, false, margin);
        double want = 64 / (sum2 - 1 / (side * side));
        /* light beyond 3.5 px: 4e-5 of it lost */
        bst_assert_close(b.covariance[BST_BOUND_FLUX][BST_BOUND_FLUX] / want, 1,
                         margin < 4 ? 1e-4 : 1e-12);
        bst_assert_close(b.snr, 50 * sqrt(sum2), margin < 4 ? 1e-4 : 1e-10);
        bst_assert_close(b.covariance[BST_BOUND_X][BST_BOUND_FLUX], 0, 1e-9);
    }
}

/* A streak in white noise, pixels small: across, 2 S^2 / SNR^2 as for a point; along, only the ends
 * tell: with the profile [Phi(x + L/2) - Phi(x - L/2)] / L, integral of its square
 * (L erf(L / 2S) - 2 S (1 - e) / sqrt pi) / L^2 and of its slope's square (1 - e) / (L^2 S sqrt
 * pi), e = exp(-L^2 / 4 S^2). */
static void streak_limit(void **state) {
    (void)state;
    const double sigma = 3, width2 = sigma * sigma + 1.0 / 12, width = sqrt(width2);
    for (double length = 5; length < 100; length *= 3) {
        for (double angle = 0; angle < 1.6; angle += BST_PI / 4) {
            double dx = length * cos(angle), dy = length * sin(angle), out[2];
            bst_eval_bound_source s = {0.2, 0.7, dx, dy, sigma, 1000};
            bst_location_bound b = bound_of(&s, 5.0, false, 7 * sigma);
            bst_location_bound_along(&b, dx, dy, out);
            double e = exp(-length * length / (4 * width2));
            double square = length * erf(length / (2 * width)) - 2 * width * (1 - e) / sqrt(BST_PI);
            double slope = (1 - e) / (width * sqrt(BST_PI));
            double snr2 = b.snr * b.snr;
            bst_assert_close(out[1] * snr2 / (2 * width2), 1, 1e-3); /* the pixel's shape */
            bst_assert_close(out[0] * snr2 / (square / slope), 1, 1e-3);
            /* without a direction: along x and y */
            bst_location_bound_along(&b, 0.0, 0.0, out);
            assert_true(out[0] == b.covariance[0][0] && out[1] == b.covariance[1][1]);
        }
    }
}

/* Sums over pixels by mpmath with 25 digits (points) and numpy with a 40-node rule along the
 * streak, derivatives by differences. Tolerance: the digits given, and the streak's quadrature. */
static void undersampled_images_agree_with_many_digits(void **state) {
    (void)state;
    const struct {
        bst_eval_bound_source source;
        bool shot;
        double margin, snr, lower[10];
    } truth[] = {
        {{10.3, 9.8, 0, 0, 0.85, 500},
         true,
         4,
         19.6239851301,
         {0.00676423418028, 5.76867670854e-8, 0.0067456448446, -0.00261384406926, 0.00255483791957,
          1442.26313397, 3.98308383737e-5, -3.80873765851e-5, -14.7226076377, 1.23003814802}},
        {{10.45, 9.8, 0, 0, 0.45, 500},
         false,
         3,
         31.6902849936,
         {0.000364890850978, -9.29238520048e-7, 0.000758720164331, 0.0207547879316, -0.116503843036,
          298.144240934, -0.000576521888193, 0.00323621800106, -8.28178448386, 2.00782734715}},
        {{10.3, 9.8, 3.1, -1.7, 0.85, 500},
         true,
         3.5,
         15.7387459982,
         {0.0194564815759, -0.00568376043978, 0.012219007001, -0.000431726689923, -0.00125613572664,
          1897.27210895, 3.21226244635e-06, 1.36710354719e-05, -15.5250814578, 0.88361067239}},
    };
    for (int t = 0; t < 3; t++) {
        bst_location_bound b = bound_of(&truth[t].source, 8.0, truth[t].shot, truth[t].margin);
        bst_assert_close(b.snr / truth[t].snr, 1, 1e-8);
        for (int i = 0, n = 0; i < BST_BOUND_COUNT; i++) {
            for (int j = 0; j <= i; j++, n++) {
                double scale = sqrt(b.covariance[i][i] * b.covariance[j][j]);
                bst_assert_close(b.covariance[i][j] / scale, truth[t].lower[n] / scale, 1e-8);
                assert_true(b.covariance[i][j] == b.covariance[j][i] ||
                            fabs(b.covariance[i][j] - b.covariance[j][i]) < 1e-12 * scale);
            }
        }
    }
}

static void bounds_that_cannot_be_are_errors(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_location_bound b;
    bst_eval_bound_noise noise = {8, true}, none = {0, true};
    bst_eval_bound_source s = {.sigma_px = 0.85, .flux_e = 100}, dark = {.sigma_px = 0.85},
                          wide = {.sigma_px = 2000, .flux_e = 1},
                          vast = {.dx_px = 1e6, .sigma_px = 1, .flux_e = 1};
    /* one pixel, four numbers */
    assert_int_equal(bst_location_bound_gaussian(&ctx, &s, &noise, 0.4, &b), BST_ERR_NUMERIC);
    assert_int_equal(bst_location_bound_gaussian(&ctx, &s, &none, 5, &b), BST_ERR_ARGUMENT);
    assert_int_equal(bst_location_bound_gaussian(&ctx, &dark, &noise, 5, &b), BST_ERR_ARGUMENT);
    assert_int_equal(bst_location_bound_gaussian(&ctx, &wide, &noise, 5, &b), BST_ERR_ARGUMENT);
    assert_int_equal(bst_location_bound_gaussian(&ctx, &vast, &noise, 50, &b), BST_ERR_ARGUMENT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(white_noise_limit),
        cmocka_unit_test(photon_limit),
        cmocka_unit_test(flux_bound_is_the_linear_one),
        cmocka_unit_test(streak_limit),
        cmocka_unit_test(undersampled_images_agree_with_many_digits),
        cmocka_unit_test(bounds_that_cannot_be_are_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
