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

/* Information of a point of light about its place along x and y, of `ratio` times its light to the
 * variance of the noise: a sum over a grid of a third of a pixel, of the image and its slopes as
 * Fourier sums of the OTF. */
static void information_of(const bst_psf *psf, double ratio, double out[2]) {
    enum { SIDE = 66 };
    const double df = 0.02, step = 1.0 / 3.0;
    const int n = (int)(bst_psf_cutoff(psf) / df) + 1, all = 2 * n + 1;
    /* sums over the frequencies of y, for each of x: of the image and of its slope by y */
    double *rows = calloc((size_t)all * SIDE, 4 * sizeof *rows);
    assert_non_null(rows);
    for (int i = 0; i < all; i++) {
        for (int j = 0; j < all; j++) {
            double fx = (i - n) * df, fy = (j - n) * df, otf[2];
            bst_psf_otf(psf, 0, fx, fy, otf);
            for (int y = 0; y < SIDE; y++) {
                const double a = 2.0 * BST_PI * fy * (y - SIDE / 2) * step;
                const double re = (otf[0] * cos(a) - otf[1] * sin(a)) * df * df;
                const double im = (otf[0] * sin(a) + otf[1] * cos(a)) * df * df;
                double *at = rows + 4 * ((size_t)i * SIDE + (size_t)y);
                at[0] += re;
                at[1] += im;
                at[2] -= 2.0 * BST_PI * fy * im;
                at[3] += 2.0 * BST_PI * fy * re;
            }
        }
    }
    out[0] = out[1] = 0.0;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double p = 0.0, by_x = 0.0, by_y = 0.0;
            for (int i = 0; i < all; i++) {
                const double w = 2.0 * BST_PI * (i - n) * df, a = w * (x - SIDE / 2) * step;
                const double *at = rows + 4 * ((size_t)i * SIDE + (size_t)y);
                p += at[0] * cos(a) - at[1] * sin(a);
                by_x -= w * (at[0] * sin(a) + at[1] * cos(a));
                by_y += at[2] * cos(a) - at[3] * sin(a);
            }
            const double weight = step * step / (1.0 + ratio * fmax(p, 0.0));
            out[0] += weight * by_x * by_x;
            out[1] += weight * by_y * by_y;
        }
    }
    free(rows);
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
    if (!round) { /* so bright that its own light is most of the noise */
        const double bright = 1e5, quiet = 8.0, ratio = bright / (quiet * quiet);
        double information[2];
        information_of(psf, ratio, information);
        const bst_crlb_table_at at = bst_crlb_table_of(&made, bright, quiet, 0.0);
        const double scale = bright * ratio; /* light squared over the variance */
        bst_assert_close(at.var_along_px2 * information[0] * scale, 1.0, 0.03);
        bst_assert_close(at.var_across_px2 * information[1] * scale, 1.0, 0.03);
        assert_true(fabs(information[0] / information[1] - 1.0) > 0.1);
    }
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
