/* Kernels that widen a PSF on the grid: the Gaussian's transform over the band, light that stays,
 * and coefficients that no others beat; transforms by sums of their own. */
#include "boresight/vec.h"
#include "scenegen/fourier/nufft_kernel.h"
#include "tests/test_support.h"

static double integral(const bst_nufft_kernel *k, const bst_nufft_kernel_shape *shape, double nu) {
    enum { STEPS = 4000 };
    double sum = 0.0;
    for (int i = 0; i < STEPS; i++) {
        double t = k->taps * ((i + 0.5) / STEPS - 0.5);
        double v = shape ? bst_nufft_kernel_shape_value(k, shape, t) : bst_nufft_kernel_value(k, t);
        sum += v * cos(2.0 * BST_PI * nu * t) * k->taps / STEPS;
    }
    return sum;
}

/* Weighted sum of squared misses over the band, and of absolute ones. */
static double misses(const bst_nufft_kernel *k, const bst_nufft_kernel_band *band, double density,
                     double variance, const bst_nufft_kernel_shape *shape, double *absolute) {
    double sum = 0.0;
    *absolute = 0.0;
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        double nu = (i + 0.5) * band->step / density;
        double off = bst_nufft_kernel_shape_transform(k, shape, nu) -
                     exp(-2.0 * BST_PI * BST_PI * variance * nu * nu);
        sum += nu < 0.5 ? band->weight[i] * off * off : 0.0;
        *absolute += band->weight[i] * fabs(off);
    }
    return sum;
}

static void widening_is_a_gaussians(void **state) {
    (void)state;
    static const struct {
        int taps;
        double density, variance;
    } cases[] = {{6, 1.0, 0.08}, {8, 1.5, 0.3}, {5, 1.2, 0.02}};
    bst_nufft_kernel_band band = {.step = 0.5 / BST_SPREAD_BINS};
    double all = 0.0;
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        double f = (i + 0.5) * band.step;
        band.weight[i] = exp(-2.0 * BST_PI * BST_PI * 1.1 * 1.1 * f * f);
        all += band.weight[i];
    }
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        band.weight[i] /= all;
    }
    for (int n = 0; n < 3; n++) {
        bst_nufft_kernel k = {.taps = cases[n].taps};
        bst_nufft_kernel_shape shape;
        double density = cases[n].density, variance = cases[n].variance, absolute, other;
        (void)bst_nufft_kernel_choose(&k, &band, density);
        double error = bst_nufft_kernel_widen(&k, &band, density, variance, &shape);
        for (int j = 0; j <= 6; j++) {
            double nu = 0.05 * j, own = integral(&k, NULL, nu);
            bst_assert_close(bst_nufft_kernel_transform(&k, nu), own, 1e-6 * fabs(own) + 1e-9);
            bst_assert_close(bst_nufft_kernel_shape_transform(&k, &shape, nu),
                             integral(&k, &shape, nu) / own, 1e-5);
        }
        bst_assert_close(bst_nufft_kernel_shape_transform(&k, &shape, 0.0), 1.0, 1e-9); /* light */
        double best = misses(&k, &band, density, variance, &shape, &absolute);
        bst_assert_close(error, absolute, 1e-9);
        assert_true(absolute < 5e-3);
        /* other coefficients that keep the light are worse */
        double zero[3] = {0.0, 0.0, 0.0};
        for (int p = 0; p < 3; p++) {
            bst_nufft_kernel_shape one = {{p == 0, p == 1, p == 2}};
            zero[p] = bst_nufft_kernel_shape_transform(&k, &one, 0.0);
        }
        for (int way = 0; way < 8; way++) {
            double a = 1e-4 * cos(0.25 * BST_PI * way), b = 1e-4 * sin(0.25 * BST_PI * way);
            bst_nufft_kernel_shape changed = shape;
            changed.c[1] += a;
            changed.c[2] += b;
            changed.c[0] -= (a * zero[1] + b * zero[2]) / zero[0];
            assert_true(misses(&k, &band, density, variance, &changed, &other) > best);
        }
    }
    bst_nufft_kernel k = {.taps = 6, .beta = 9.0};
    bst_nufft_kernel_shape none;
    bst_assert_close(bst_nufft_kernel_widen(&k, &band, 1.0, 0.0, &none), 0.0, 0.0);
    assert_true(none.c[0] == 1.0 && none.c[1] == 0.0 && none.c[2] == 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(widening_is_a_gaussians)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
