/* The tabulated bound of a PSF against that of a Gaussian and against sums over its OTF. */
#include "boresight/vec.h"
#include "obsgen/model/psf_bound.h"
#include "tests/test_support.h"

static void a_gaussian_has_its_own_bound(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    const double sigma = 0.9;
    const bst_response_side side = {NULL, sigma};
    bst_crlb_table made, gaussian;
    bst_crlb_table_init(&gaussian, sigma);
    bst_assert_ok(&ctx, bst_psf_bound_init(&ctx, &side, 1, 0.0, 0.0, sigma, &made));
    const double lengths[] = {0.0, 0.5, 2.0, 7.0, 30.0, 200.0}, fluxes[] = {100.0, 5e3, 1e6};
    for (int l = 0; l < 6; l++) {
        for (int f = 0; f < 3; f++) {
            bst_crlb_table_at a = bst_crlb_table_of(&made, fluxes[f], 8.0, lengths[l]);
            bst_crlb_table_at b = bst_crlb_table_of(&gaussian, fluxes[f], 8.0, lengths[l]);
            /* the other one takes 3 x 3 places in the pixel, this one all of them; the wings of
             * bright ones end at 11 px */
            bst_assert_close(a.var_along_px2 / b.var_along_px2, 1.0, 0.03);
            bst_assert_close(a.var_across_px2 / b.var_across_px2, 1.0, 0.03);
            bst_assert_close(a.flux_variance / b.flux_variance, 1.0, 0.03);
            bst_assert_close(a.norm / b.norm, 1.0, 0.01);
        }
    }
    /* binned by two with twice the width it is the same but for the pixel's part */
    const bst_response_side twice = {NULL, 2.0 * sigma};
    bst_assert_ok(&ctx, bst_psf_bound_init(&ctx, &twice, 2, 0.0, 0.0, sigma, &made));
    bst_assert_close(bst_crlb_table_norm(&made, 0.0) / bst_crlb_table_norm(&gaussian, 0.0), 1.0,
                     0.01);
}

/* On white noise the information is a sum over frequencies (Parseval): (2 pi f)^2 |OTF|^2 sinc^2.
 */
static void check_pattern(const double waves[9], bool round) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_camera camera = {
        .width_px = 512,
        .height_px = 512,
        .pixel_scale_arcsec = 3.0,
        .aperture_m = 0.15,
        .psf_fwhm_px = 2.0,
        .optics = {
            .psf = BST_PSF_DIFFRACTION, .q = 2.0, .band_nm = {500.0, 800.0}, .wavelengths = 6}};
    camera.optics.zernike_nm = 550.0;
    for (int k = 0; k < 9; k++) {
        camera.optics.zernike_waves.waves[k] = waves[k];
    }
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    const bst_response_side side = {psf, 0.0};
    double sigma = bst_psf_equivalent_fwhm_px(psf, 255.5, 255.5) / 2.3548200450309493;
    bst_crlb_table made;
    bst_assert_ok(&ctx, bst_psf_bound_init(&ctx, &side, 1, 255.5, 255.5, sigma, &made));
    double share[3];
    const double flux = 10.0, noise = 20.0; /* light of 0.003 of the noise's variance */
    for (int k = 0; k < 3; k++) {
        double length = k == 0 ? 0.0 : ldexp(sigma, k); /* nodes of the table */
        double df = 0.005, along = 0.0, across = 0.0, square = 0.0;
        int count = (int)(bst_psf_cutoff(psf) / df) + 1;
        for (int j = -count; j <= count; j++) {
            for (int i = -count; i <= count; i++) {
                double fx = i * df, fy = j * df, at[2], drawn = BST_PI * fx * length;
                bst_psf_otf(psf, 0, fx, fy, at);
                double sinc = fabs(drawn) < 1e-9 ? 1.0 : sin(drawn) / drawn;
                double power = (at[0] * at[0] + at[1] * at[1]) * sinc * sinc * df * df;
                along += power * 4.0 * BST_PI * BST_PI * fx * fx;
                across += power * 4.0 * BST_PI * BST_PI * fy * fy;
                square += power;
            }
        }
        bst_crlb_table_at at = bst_crlb_table_of(&made, flux, noise, length);
        double scale = flux * flux / (noise * noise);
        /* the table begins at light of 0.1 of the variance; light beyond 11 px */
        bst_assert_close(at.var_along_px2 * along * scale, 1.0, 0.03);
        bst_assert_close(at.var_across_px2 * across * scale, 1.0, 0.03);
        bst_assert_close(at.norm / sqrt(square), 1.0, 0.01);
        /* a factor on the Gaussian of its area would do for no two lengths: a place at rest is in
         * the steep flank of the disc, one along a streak in its ends */
        bst_crlb_table gaussian;
        bst_crlb_table_init(&gaussian, sigma);
        bst_crlb_table_at g = bst_crlb_table_of(&gaussian, flux, noise, length);
        share[k] = at.var_along_px2 / g.var_along_px2;
    }
    assert_true(!round || share[2] > 1.3 * share[0]);
    bst_psf_free(psf);
}

static void a_diffraction_pattern_has_that_of_its_otf(void **state) {
    (void)state;
    check_pattern((const double[9]){0}, true);
    /* coma along both axes and slanting astigmatism: the OTF is not real, the image not symmetric
     */
    check_pattern((const double[9]){0, 0, 0, 0, 0.05, 0, 0.12, 0.2, 0.04}, false);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_gaussian_has_its_own_bound),
        cmocka_unit_test(a_diffraction_pattern_has_that_of_its_otf),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
