/* Sensitivity of a PSF to nodes: against the closed form of Gaussians. */
#include <math.h>

#include "boresight/vec.h"
#include "scenegen/fourier/psf_sensitivity.h"
#include "scenegen/smear/gaussian_flank.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SAMPLES = 121, PER_PX = 5 };
static const double LONG_PX = 1.6, SHORT_PX = 0.9;

/* A Gaussian of LONG_PX along x and SHORT_PX along y. */
static bst_psf *make_psf(bst_ctx *ctx, bst_camera *camera) {
    static float image[SAMPLES * SAMPLES];
    for (int k = 0; k < SAMPLES * SAMPLES; k++) {
        double x = (double)(k % SAMPLES - SAMPLES / 2) / PER_PX / LONG_PX;
        double y = (double)(k / SAMPLES - SAMPLES / 2) / PER_PX / SHORT_PX;
        image[k] = (float)exp(-0.5 * (x * x + y * y));
    }
    bst_psf *psf;
    bst_psf_samples samples = {image, SAMPLES, SAMPLES, 1, (double)PER_PX};
    bst_psf_inputs inputs = {.samples = &samples};
    *camera = scene_camera(64, 64);
    camera->optics.psf = BST_PSF_FILE;
    bst_assert_ok(ctx, bst_psf_create_from(ctx, camera, &inputs, &psf));
    return psf;
}

static void derivatives_are_those_of_each_direction(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera;
    bst_psf_sensitivity s;
    bst_psf *psf = make_psf(&ctx, &camera);
    bst_assert_ok(&ctx, bst_psf_sensitivity_measure(&ctx, psf, 0.9, SHORT_PX, 1, &s));
    /* pixels add a twelfth to either variance */
    double wide = LONG_PX * LONG_PX + 1.0 / 12.0, narrow = SHORT_PX * SHORT_PX + 1.0 / 12.0;
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        double angle = d * BST_PI / BST_NODE_DIRECTIONS, c = cos(angle), n = sin(angle);
        double inverse = c * c / wide + n * n / narrow, power = 1.0;
        for (int k = 0; k < 3; k++) {
            power *= SHORT_PX * SHORT_PX * inverse;
            /* the variance of a pixel is not all of its shape: 2 % in the sixth order */
            bst_assert_close(s.part[d][k], power, 0.04 * power);
        }
        /* orders 4 and 6 smoothed by v variances along the direction: (1 + v)^(-5/2), (-7/2) */
        for (int k = 0; k < 2 * BST_SMOOTH_STEPS; k++) {
            int step = k / 2, order = 4 + k % 2 * 2;
            double v = SHORT_PX * SHORT_PX * inverse * step / BST_SMOOTH_PER;
            double want = s.part[d][order / 2 - 1] * pow(1.0 + v, -0.5 * (order + 1));
            bst_assert_close(s.smooth[d][step][k % 2], want, 0.02 * want); /* the pixel, as above */
        }
    }
    /* the derivative is greatest where the light is, and no pixel without light has much of it: in
     * pixels of less than 2^-19 of the light the samples' border and the cut-off leave 2.2e-4 */
    for (int k = 0; k < BST_FLANK_STEPS; k++) {
        double any = (double)s.any_flank[BST_FLANK_STREAK].at[k];
        double light = ldexp(1.0 + (double)(k % BST_FLANK_PARTS) / BST_FLANK_PARTS,
                             BST_FLANK_FIRST + k / BST_FLANK_PARTS);
        assert_true(any > 0.98 && any < fmax(1.01, 2.2e-4 * sqrt(light + 1.0)));
        assert_true((double)s.any_flank[BST_FLANK_POINT].at[k] > any - 0.01);
        assert_true((double)s.flank[BST_FLANK_STREAK][3][2].at[k] <= any);
    }
    bst_psf_free(psf);
}

/* A bright point much wider than its pixels: the greatest |He_n(u)| exp(-u^2 / 4) over the greatest
 * |He_n(u)| exp(-u^2 / 2), He_n the Hermite polynomials of order 2, 3, 4 and 6. */
static void errors_beside_a_gaussian_are_those_of_hermite_functions(void **state) {
    (void)state;
    double peak[4] = {0.0}, beside[4] = {0.0}, expected = 0.0, along = 0.0;
    for (double u = 0.0; u < 6.0; u += 1e-3) {
        double v = u * u, light = exp(-0.5 * v);
        const double he[4] = {v - 1.0, u * (v - 3.0), (v - 6.0) * v + 3.0,
                              ((v - 15.0) * v + 45.0) * v - 15.0};
        for (int k = 0; k < 4; k++) {
            peak[k] = fmax(peak[k], fabs(he[k]) * light);
            beside[k] = fmax(beside[k], fabs(he[k]) * sqrt(light));
        }
        expected = fmax(expected, v * sqrt(light));
    }
    for (int k = 0; k < 4; k++) {
        along = fmax(along, beside[k] / peak[k]);
    }
    assert_true(expected > 1.05 * along);
    bst_light_flank flank;
    bst_flank_curve curve;
    bst_gaussian_flank_measure(50.0, 1, 0.0, &flank);
    bst_flank_curve_make(&flank, &curve);
    /* places are 0.14 sigma apart */
    bst_assert_close(bst_flank_curve_at(&curve, 1e5), expected, 0.03 * expected);
    bst_assert_close(bst_flank_curve_at(&curve, 1e-3), 1.0, 0.02); /* dark: that of the peak */
    /* a long path along the rows has errors along it only, and its light is as wide */
    bst_gaussian_flank_measure(50.0, 1, 1e3 * 2500.0, &flank);
    bst_flank_curve_make(&flank, &curve);
    assert_true(bst_flank_curve_at(&curve, 1e5) < 1.03);
    /* in a pixel of 2.8 sigma, the next one has a fifth of the light and as much error */
    bst_gaussian_flank_measure(0.36, 1, 0.0, &flank);
    bst_flank_curve_make(&flank, &curve);
    assert_true(bst_flank_curve_at(&curve, 1e4) > 1.5);
}

/* Between its steps and beyond its end a curve is no less than the error itself, and between them
 * no more than 6 % above: from one to the next it grows by 1.25^(1/2) at most, in any place
 * between. */
static void curves_are_bounds_between_steps(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(4, 0, "flank", "curve");
    uint64_t drawn = 0;
    for (int n = 0; n < 200; n++) {
        bst_light_flank flank;
        bst_flank_curve curve;
        for (int k = 0; k < BST_LIGHT_CLASSES; k++) {
            flank.error[k] = pow(0.5, (0.2 + bst_rng_uniform(key, 0, drawn++)) * k);
            flank.noisy[k] =
                flank.error[k] * pow(2.0, 0.5 * (k + bst_rng_uniform(key, 0, drawn++)));
        }
        bst_flank_curve_make(&flank, &curve);
        for (int i = 0; i < 50; i++) {
            double peak = pow(2.0, -6.0 + 40.0 * bst_rng_uniform(key, 0, drawn++)), worst = 0.0;
            for (int k = 0; k < BST_LIGHT_CLASSES; k++) {
                bool last = k + 1 == BST_LIGHT_CLASSES;
                double least = last ? 0.0 : peak * pow(0.5, k + 1), most = peak * pow(0.5, k);
                double dim = flank.error[k] / sqrt(least + 1.0);
                double lit = last ? INFINITY : flank.noisy[k] / sqrt(peak + peak / most);
                worst = fmax(worst, fmin(dim, lit) * sqrt(peak + 1.0));
            }
            double at = bst_flank_curve_at(&curve, peak);
            assert_true(at >= worst * (1.0 - 1e-6)); /* kept as float */
            assert_true(at <= worst * 1.06 || peak > 0x1p26);
        }
    }
}

/* A comb of period L: 2 exp(-w^2 variance / 2) with w = 2 pi / L, and the same profile across as
 * the streak's light. */
static void rows_have_the_frequencies_of_a_comb(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera;
    bst_psf_sensitivity s;
    bst_psf *psf = make_psf(&ctx, &camera);
    bst_assert_ok(&ctx, bst_psf_sensitivity_measure(&ctx, psf, 0.9, SHORT_PX, 1, &s));
    double variance = LONG_PX * LONG_PX + 1.0 / 12.0;
    for (int b = 2; b <= 8; b++) { /* along x, the direction 0 */
        double w = 2.0 * BST_PI * b * s.most_per_px / BST_ROW_STEPS;
        double expected = 2.0 * exp(-0.5 * w * w * variance);
        /* the lattice's steps are wide: chords of a steep flank lie above it */
        bst_assert_close(s.row[0][b], expected * 1.08, 0.12 * expected + 0.002);
    }
    /* less than 2^-16 of the light is below the samples' border */
    int length = bst_row_length(3.0), k = 10 * BST_FLANK_PARTS;
    bst_assert_close((double)s.row_flank[0][length].at[k], 1.0, 0.03);
    bst_psf_free(psf);
}

/* The light beside the peak: exp(-r^2 / 2 variance) along each direction, and not above it. */
static void light_falls_as_the_psf_does(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera;
    bst_psf_sensitivity s;
    bst_psf *psf = make_psf(&ctx, &camera);
    bst_assert_ok(&ctx, bst_psf_sensitivity_measure(&ctx, psf, 0.9, SHORT_PX, 1, &s));
    double wide = LONG_PX * LONG_PX + 1.0 / 12.0, narrow = SHORT_PX * SHORT_PX + 1.0 / 12.0;
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        double angle = d * BST_PI / BST_NODE_DIRECTIONS, c = cos(angle), n = sin(angle);
        double inverse = c * c / wide + n * n / narrow;
        for (int k = 0; k < BST_LIGHT_STEPS; k++) {
            double r = SHORT_PX * k / BST_LIGHT_PER, light = exp(-0.5 * r * r * inverse);
            /* chords of the samples lie below; the pixel is no Gaussian */
            bst_assert_close(s.light[d][k], light - 0.01, 0.02);
        }
    }
    bst_psf_free(psf);
}

/* A PSF of two Gaussians of equal peaks, sigma 1 and 3 px: derivatives are those of the narrow one,
 * the light of a group is that of both. Along a uniform path at rest across, in one dimension. */
static double two_gaussians(double x) {
    return 0.5 * (exp(-0.5 * x * x) + exp(-x * x / 18.0));
}

/* Half the sums of the two Gaussians' derivatives of even order at their peak over that of one. */
static double derivative(int order) {
    return 0.5 * (1.0 + pow(3.0, -order));
}

/* Greatest error of nodes on a uniform path of `length` px, over the greatest light. */
static double true_error(const bst_smear_node_list *nodes, double length) {
    enum { STEPS = 400 };
    double worst = 0.0, brightest = 0.0;
    for (double x = -8.0; x <= 8.0; x += 0.05) {
        double light = 0.0, by_nodes = 0.0;
        for (int k = 0; k < STEPS; k++) {
            light += two_gaussians(x - length * ((k + 0.5) / STEPS - 0.5)) / STEPS;
        }
        for (int n = 0; n < nodes->count; n++) {
            by_nodes += nodes->items[n].weight * two_gaussians(x - nodes->items[n].p[0]);
        }
        worst = fmax(worst, fabs(by_nodes - light));
        brightest = fmax(brightest, light);
    }
    return worst / brightest;
}

static void a_group_has_the_light_of_a_wide_psf(void **state) {
    (void)state;
    static double part[BST_NODE_DIRECTIONS][3], row[BST_NODE_DIRECTIONS][BST_ROW_STEPS];
    static double light[BST_NODE_DIRECTIONS][BST_LIGHT_STEPS];
    bst_ctx ctx = {0};
    double sigma = pow(derivative(6), -1.0 / 6.0);
    double smoothed = fmax(derivative(4) / derivative(6), derivative(6) / derivative(8));
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        for (int k = 0; k < 3; k++) {
            part[d][k] = 1.0;
        }
        for (int k = 0; k < BST_LIGHT_STEPS; k++) {
            light[d][k] = two_gaussians(sigma * k / BST_LIGHT_PER);
        }
    }
    for (double length = 2.5; length < 4.6; length += 0.5) {
        const bst_smear_path_point path[2] = {{{-0.5 * length, 0.0, 0.0}, 0.0},
                                              {{0.5 * length, 0.0, 0.0}, 1.0}};
        bst_smear_node_aim aim = {.psf_sigma_px = sigma,
                                  .tolerance = 0.2,
                                  .further_variance = smoothed - sigma * sigma,
                                  .direction_part = part,
                                  .row_ripple = row,
                                  .most_per_px = 1.0};
        bst_smear_node_list before = {0}, now = {0};
        bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, 2, &aim, &before));
        aim.light_part = light;
        bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, path, 2, &aim, &now));
        double by_peak = before.predicted[BST_NODE_SCALES - 2],
               predicted = now.predicted[BST_NODE_SCALES - 2], error = true_error(&now, length);
        print_message("%.1f px, %d nodes: error %.5f, predicted %.5f, without the light %.5f\n",
                      length, now.count, error, predicted, by_peak);
        assert_int_equal(now.count, before.count);
        assert_true(error <= predicted && predicted <= 0.97 * by_peak);
        free(before.items);
        free(now.items);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(derivatives_are_those_of_each_direction),
        cmocka_unit_test(a_group_has_the_light_of_a_wide_psf),
        cmocka_unit_test(light_falls_as_the_psf_does),
        cmocka_unit_test(errors_beside_a_gaussian_are_those_of_hermite_functions),
        cmocka_unit_test(curves_are_bounds_between_steps),
        cmocka_unit_test(rows_have_the_frequencies_of_a_comb),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
