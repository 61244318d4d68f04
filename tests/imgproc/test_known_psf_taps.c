/* A known PSF by its profiles: weights that interpolate polynomials with their derivatives, and
 * shares of a Gaussian in pixels that are binned or not. */
#include "boresight/vec.h"
#include "imgproc/detect/known_psf.h"
#include "tests/test_support.h"

enum { SIDE = 200 };
#define FWHM_PER_SIGMA 2.3548200450309493

static bst_known_psf *make(bst_psf **psf, double fwhm_px, double blur_px) {
    bst_ctx ctx = {0};
    bst_known_psf *known;
    const bst_camera camera = {.width_px = SIDE,
                               .height_px = 150,
                               .pixel_scale_arcsec = 2.0,
                               .aperture_m = 0.1,
                               .psf_fwhm_px = fwhm_px};
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, psf));
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, *psf, SIDE, 150.0, blur_px, &known));
    return known;
}

static void weights_interpolate_polynomials(void **state) {
    (void)state;
    bst_psf *psf;
    bst_known_psf *k = make(&psf, 2.2, 0.0);
    bst_known_psf_taps taps;
    for (double d = -k->reach_px; d <= k->reach_px; d += 0.37) {
        int first = bst_known_psf_taps_at(k, d, taps);
        assert_true(first >= 0 && first + BST_KNOWN_PSF_POINTS <= k->side);
        for (int n = 0; n < BST_KNOWN_PSF_POINTS; n++) {
            double sum[3] = {0.0, 0.0, 0.0};
            for (int p = 0; p < BST_KNOWN_PSF_POINTS; p++) {
                /* place of a sample, px, from the place that is asked for and a pixel beside it */
                double at = (double)(first + p) / k->per_px - k->reach_px - 2.0 - d + 0.3;
                for (int m = 0; m < 3; m++) {
                    sum[m] += taps[m][p] * pow(at, n);
                }
            }
            bst_assert_close(sum[0], pow(0.3, n), 1e-9);
            bst_assert_close(sum[1], n > 0 ? n * pow(0.3, n - 1) : 0.0, 1e-8);
            bst_assert_close(sum[2], n > 1 ? n * (n - 1) * pow(0.3, n - 2) : 0.0, 1e-6);
        }
    }
    assert_int_equal(bst_known_psf_taps_at(k, k->reach_px + 0.51, taps), -1);
    assert_true(bst_known_psf_taps_at(k, -k->reach_px - 0.49, taps) >= 0);
    bst_known_psf_free(k);
    bst_psf_free(psf);
}

static double part(double from, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((from + 0.5) / s) - erf((from - 0.5) / s));
}

static void shares_are_those_of_a_gaussian(void **state) {
    (void)state;
    bst_psf *psf;
    bst_known_psf *k = make(&psf, 2.2, 0.5);
    double sigma = hypot(2.2 / FWHM_PER_SIGMA, 0.5);
    for (int b = 1; b <= 3; b++) {
        for (double x = -2.3; x < 2.5; x += 0.71) {
            for (double y = -1.9; y < 2.5; y += 0.83) {
                double want = part(x, sigma / b) * part(y, sigma / b);
                /* 1e-4 of the energy is left out */
                bst_assert_close(bst_known_psf_share(k, k->nodes, b, x, y), want, 4e-4);
                bst_assert_close(bst_known_psf_share(k, 0, b, x, y), want, 4e-4);
            }
        }
    }
    /* the nearest Gaussian is itself, within the step of its search */
    bst_assert_close(k->sigma_px, sigma, 0.012 * sigma);
    bst_assert_close(k->like_flux, 1.0, 0.012);
    bst_known_psf_free(k);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_interpolate_polynomials),
        cmocka_unit_test(shares_are_those_of_a_gaussian),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
