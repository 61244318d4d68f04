/* Where one source fitted to two lands, against the fit on pixels. */
#include "boresight/vec.h"
#include "obsgen/model/blend_weight.h"
#include "tests/test_support.h"

/* Half side of the fitted stamp, as bst_deblend_reach of imgproc/measure/deblend.c. */
static int reach_of(double sigma) {
    return (int)fmax(3.0, ceil(3.6 * sigma));
}

static double share_of(double x, double y, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.25 * (erf((x + 0.5) / s) - erf((x - 0.5) / s)) *
           (erf((y + 0.5) / s) - erf((y - 0.5) / s));
}

/* Least squares with the weights 1 / (noise + model): place along x of the fit of one source to one
 * of flux 1 at 0 and another one of flux `ratio` at `distance`, mean over places in the pixel. */
static double fitted_place(double sigma, double ratio, double distance, double noise) {
    enum { PHASES = 4, ROUNDS = 60 };
    const int reach = reach_of(sigma);
    double mean = 0.0;
    for (int phase = 0; phase < PHASES; phase++) {
        double at = (phase + 0.5) / PHASES - 0.5, x = 0.0, flux = 1.0;
        for (int round = 0; round < ROUNDS; round++) {
            double a[3] = {0.0}, g[2] = {0.0};
            for (int v = -reach; v <= reach; v++) {
                for (int u = -reach; u <= reach; u++) {
                    double data =
                        share_of(u - at, v, sigma) + ratio * share_of(u - at - distance, v, sigma);
                    double p = share_of(u - at - x, v, sigma), h = 1e-4;
                    double slope =
                        (share_of(u - at - x - h, v, sigma) - share_of(u - at - x + h, v, sigma)) /
                        (2.0 * h);
                    double weight = 1.0 / (noise + flux * p), left = data - flux * p;
                    a[0] += weight * flux * flux * slope * slope;
                    a[1] += weight * flux * slope * p;
                    a[2] += weight * p * p;
                    g[0] += weight * flux * slope * left;
                    g[1] += weight * p * left;
                }
            }
            double det = a[0] * a[2] - a[1] * a[1];
            x += 0.5 * (a[2] * g[0] - a[1] * g[1]) / det;
            flux += 0.5 * (a[0] * g[1] - a[1] * g[0]) / det;
        }
        mean += x / PHASES;
    }
    return mean;
}

static double weighted_place(const bst_blend_weights *w, double sigma, double ratio,
                             double distance, double noise) {
    double s2 = sigma * sigma + 1.0 / 12.0, x = 0.0, flux = 1.0;
    for (int round = 0; round < 200; round++) {
        double light = flux / (2.0 * BST_PI * s2) / noise, away = distance - x;
        double own = bst_blend_weight(w, light, exp(-x * x / (4.0 * s2)));
        double other = ratio * bst_blend_weight(w, light, exp(-away * away / (4.0 * s2)));
        flux = own + other;
        x = other * distance / flux;
    }
    return x;
}

/* The smallest RMS of the relative differences is at FITTED_SIGMAS = 4.6 (obsgen/model/
 * blend_weight.c); with 3.8 a bright blend errs by 10 %. */
static void a_fit_of_one_lands_between_top_and_centroid(void **state) {
    (void)state;
    static bst_blend_weights w;
    bst_blend_weights_init(&w);
    const double sigmas[] = {0.64, 0.85, 1.27}, ratios[] = {0.1, 0.4}, distances[] = {1.2, 2.4};
    double square = 0.0;
    for (int i = 0; i < 12; i++) {
        double sigma = sigmas[i / 4], ratio = ratios[i / 2 % 2], before = 0.0;
        double distance = distances[i % 2] * sigma;
        /* light on the brightest pixel of 0.02, 2, 200 and 2e4 times the noise's variance */
        for (double noise = 10.0; noise > 1e-6; noise *= 0.01) {
            double place = weighted_place(&w, sigma, ratio, distance, noise);
            double fit = fitted_place(sigma, ratio, distance, noise);
            square += (place / fit - 1.0) * (place / fit - 1.0) / 48.0;
            /* interpolation in the table errs by 0.004 of the largest weight; a circle in the place
             * of the square */
            bst_assert_close(place, fit, 0.004 * ratio * distance + 0.04 * fit);
            assert_true(place > before);
            before = place;
        }
    }
    print_message("RMS of the relative differences: %.4f\n", sqrt(square));
    assert_true(sqrt(square) < 0.015);
    /* no light: the filter's own output; much of it: all that is on the fitted pixels */
    bst_assert_close(bst_blend_weight(&w, 1e-6, exp(-1.0)), exp(-1.0), 0.03);
    assert_true(bst_blend_weight(&w, 1e6, exp(-1.0)) > 0.8);
    bst_assert_close(bst_blend_weight(&w, 1.0, 1.0), 1.0, 1e-6);
    bst_assert_close(bst_blend_weight(&w, 1.0, 0.0), 0.0, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fit_of_one_lands_between_top_and_centroid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
