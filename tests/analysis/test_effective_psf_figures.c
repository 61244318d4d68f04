/* Figures of a PSF that is known: moments of a slanted Gaussian off the middle, light within
 * circles, the pixel undone, standard errors. */
#include <stdlib.h>

#include "boresight/vec.h"

#include "sim/analysis/camera/effective_psf.h"
#include "tests/test_support.h"

enum { OVER = BST_EFFECTIVE_PSF_OVERSAMPLING, HALF = 9, SIDE = 2 * HALF * OVER + 1 };
enum { SAMPLES = SIDE * SIDE };

static double plane[SAMPLES], out[SAMPLES];

/* Samples of a Gaussian with a covariance, px^2, about (x, y) px. */
static void gaussian(double x, double y, double xx, double xy, double yy) {
    double determinant = xx * yy - xy * xy;
    for (int k = 0; k < SAMPLES; k++) {
        double u = (k % SIDE - SIDE / 2) / (double)OVER - x,
               v = (k / SIDE - SIDE / 2) / (double)OVER - y;
        plane[k] = 7.0 * exp(-0.5 * (yy * u * u - 2.0 * xy * u * v + xx * v * v) / determinant);
    }
}

static void moments_of_a_slanted_gaussian(void **state) {
    (void)state;
    static const double cases[][5] = {
        {0.0, 0.0, 0.8, 0.3, 0.5}, {0.4, -0.7, 0.5, -0.2, 0.9}, {-0.6, 0.2, 0.45, 0.1, 0.7}};
    for (int i = 0; i < 3; i++) {
        const double *c = cases[i];
        gaussian(c[0], c[1], c[2], c[3], c[4]);
        bst_effective_psf_figures f = bst_effective_psf_measure(plane, SIDE);
        /* 4.5 standard deviations are within the circle of 5 px: 4e-5 of the light is beyond,
         * which has 20 times the mean moment */
        bst_assert_close(f.xx_px2, c[2], 1e-3 * c[2]);
        bst_assert_close(f.xy_px2, c[3], 1e-3 * c[2]);
        bst_assert_close(f.yy_px2, c[4], 1e-3 * c[4]);
    }
}

static void light_within_circles(void **state) {
    (void)state;
    gaussian(0.0, 0.0, 1.21, 0.0, 1.21);
    bst_effective_psf_figures f = bst_effective_psf_measure(plane, SIDE);
    for (int e = 0; e < BST_EFFECTIVE_PSF_RADII; e++) {
        double r = bst_effective_psf_radius_px[e];
        /* samples are squares: their variance (1/4)^2 / 12 spreads the light by 0.4 % */
        bst_assert_close(f.encircled[e], 1.0 - exp(-0.5 * r * r / 1.21), 3e-3);
    }
}

/* The mean of a Gaussian over each pixel, by its integral, gives the Gaussian again. */
static void pixel_is_undone(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double sx = 0.8, sy = 1.1;
    for (int k = 0; k < SAMPLES; k++) {
        double u = (k % SIDE - SIDE / 2) / (double)OVER, v = (k / SIDE - SIDE / 2) / (double)OVER;
        plane[k] = 0.25 * (erf((u + 0.5) / sx / sqrt(2.0)) - erf((u - 0.5) / sx / sqrt(2.0))) *
                   (erf((v + 0.5) / sy / sqrt(2.0)) - erf((v - 0.5) / sy / sqrt(2.0)));
    }
    bst_assert_ok(&ctx, bst_effective_psf_undo_pixel(&ctx, plane, SIDE, out));
    double peak = 1.0 / (2.0 * BST_PI * sx * sy) / OVER / OVER, sum = 0.0;
    for (int k = 0; k < SAMPLES; k++) {
        double u = (k % SIDE - SIDE / 2) / (double)OVER, v = (k / SIDE - SIDE / 2) / (double)OVER;
        /* the noise term is 1e-3 where the pixel's transfer is 1, and more where it is small */
        bst_assert_close(out[k], peak * exp(-0.5 * (u * u / sx / sx + v * v / sy / sy)),
                         4e-3 * peak);
        sum += out[k];
    }
    bst_assert_close(sum, 1.0, 1e-12);
}

/* Of means without one value each, the error is that of the mean of all. */
static void error_of_a_mean(void **state) {
    (void)state;
    enum { N = BST_EFFECTIVE_PSF_PARTS };
    double value[N], without[N], sum = 0.0, square = 0.0;
    for (int i = 0; i < N; i++) {
        value[i] = 3.0 + sin(1.7 * i * i) + 0.4 * i;
        sum += value[i];
    }
    for (int i = 0; i < N; i++) {
        without[i] = (sum - value[i]) / (N - 1);
        square += (value[i] - sum / N) * (value[i] - sum / N);
    }
    bst_assert_close(bst_effective_psf_standard_error(without), sqrt(square / (N - 1) / N), 1e-12);
}

/* The mean logarithm of the root of chi-squared with 7 degrees of freedom over 7 is
 * (digamma(7/2) + ln(2/7)) / 2, digamma(7/2) = 2 (1 + 1/3 + 1/5) - gamma - 2 ln 2. */
static void errors_are_pooled_by_their_logarithms(void **state) {
    (void)state;
    enum { REACH = BST_EFFECTIVE_PSF_POOL, N = 4 * REACH + 7 };
    double sigma[N * N], pooled[N * N];
    double low = 0.5 * (2.0 * (1.0 + 1.0 / 3.0 + 0.2) - 0.5772156649015329 - 2.0 * log(2.0) +
                        log(2.0 / 7.0));
    for (int k = 0; k < N * N; k++) {
        sigma[k] = k % 11 == 3 ? 0.0 : exp(sin(1.3 * k) + 0.1 * (k % N));
    }
    bst_effective_psf_pool_errors(sigma, N, pooled);
    for (int k = 0; k < N * N; k++) {
        double product = 0.0, in = 0.0;
        for (int m = 0; m < N * N; m++) {
            if (abs(m % N - k % N) <= REACH && abs(m / N - k / N) <= REACH && sigma[m] > 0.0) {
                product += log(sigma[m]);
                in++;
            }
        }
        double expected = sigma[k] > 0.0 ? exp(product / in - low) : 0.0;
        bst_assert_close(pooled[k], expected, 1e-4 * expected); /* a constant of three digits */
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(moments_of_a_slanted_gaussian), cmocka_unit_test(light_within_circles),
        cmocka_unit_test(pixel_is_undone), cmocka_unit_test(error_of_a_mean),
        cmocka_unit_test(errors_are_pooled_by_their_logarithms)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
