/* The squared image of a widened and smeared PSF against its integral over the frequencies. */
#include <math.h>
#include <stdio.h>

#include "sim/optics/psf.h"
#include "tests/test_support.h"

static double sinc(double x) {
    return x == 0.0 ? 1.0 : sin(BST_PI * x) / (BST_PI * x);
}

/* Integral of |OTF|^2 exp(-4 pi^2 (along fx^2 + across fy^2)) sinc^2(fx length) (Parseval). */
static double integral(const bst_psf *psf, double along_px2, double across_px2, double length_px) {
    enum { N = 300 };
    double limit = bst_psf_cutoff(psf), step = limit / N, sum = 0.0;
    for (int j = -N; j < N; j++) {
        for (int i = 0; i < N; i++) {
            double fx = (i + 0.5) * step, fy = (j + 0.5) * step, h[2], s = sinc(fx * length_px);
            bst_psf_otf(psf, 0, fx, fy, h);
            sum += (h[0] * h[0] + h[1] * h[1]) * s * s *
                   exp(-4.0 * BST_PI * BST_PI * (along_px2 * fx * fx + across_px2 * fy * fy));
        }
    }
    return 2.0 * sum * step * step;
}

static void agrees_with_the_integral_over_frequencies(void **state) {
    (void)state;
    const bst_camera cameras[] = {
        {.optics = {.psf = BST_PSF_DIFFRACTION, .q = 1.5, .wavelengths = 6}},
        {.optics = {.psf = BST_PSF_DIFFRACTION, .q = 2.4, .wavelengths = 6}, .obscuration = 0.16},
        {.optics = {.psf = BST_PSF_MOFFAT, .moffat_beta = 2.5}},
        {.optics = {.psf = BST_PSF_DIFFRACTION, .q = 2.35, .wavelengths = 6, .diffusion_px = 0.13},
         .obscuration = 0.088}};
    const double motion[][3] = {
        {0.0, 0.0, 0.0}, {0.16, 0.16, 0.0}, {0.0, 0.0, 3.0}, {0.16, 0.16, 6.0}, {0.0, 0.0, 30.0}};
    const float sun[BST_PSF_COLOURS] = {0.0F};
    for (size_t c = 0; c < sizeof cameras / sizeof *cameras; c++) {
        bst_camera camera = cameras[c];
        bst_ctx ctx = {0};
        bst_psf *psf;
        camera.width_px = camera.height_px = 256;
        camera.pixel_scale_arcsec = 2.0;
        camera.aperture_m = 0.1;
        camera.psf_fwhm_px = 2.0;
        camera.optics.band_nm[0] = 500.0;
        camera.optics.band_nm[1] = 800.0;
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        for (size_t m = 0; m < sizeof motion / sizeof *motion; m++) {
            const double *v = motion[m];
            double want = integral(psf, v[0], v[1], v[2]);
            double got = bst_psf_squared_image(psf, sun, 128.0, 128.0, v[0], v[1], v[2]);
            printf("camera %zu, variance %g px^2, length %g px: %.5f, integral %.5f (%+.2f %%)\n",
                   c, v[0], v[2], got, want, 100.0 * (got / want - 1.0));
            /* of the square; the SNR goes with its root. The equivalent Gaussian is up to 10 % off
             */
            bst_assert_close(got, want, 0.03 * want);
        }
        bst_psf_free(psf);
    }
}

/* Between the nodes of a field of unequal Gaussians: the square of their mixed image, pairs of
 * which have the closed form 1 / (2 pi (s^2 + t^2)). */
static void nodes_of_a_field_mix(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double fwhm_px[6] = {3.0, 5.0, 4.0, 8.0, 6.0, 3.5};
    bst_psf_field_node nodes[6] = {{.psf_fwhm_px = 0.0}};
    for (int i = 0; i < 6; i++) {
        nodes[i].psf_fwhm_px = fwhm_px[i];
    }
    bst_camera camera = {
        .width_px = 201, .height_px = 101, .pixel_scale_arcsec = 2.0, .aperture_m = 0.1};
    camera.psf_fwhm_px = 4.0;
    camera.optics.field_columns = 3;
    camera.optics.field_rows = 2;
    camera.optics.field = (bst_config_list){nodes, 6};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    const float sun[BST_PSF_COLOURS] = {0.0F};
    /* at a quarter of the right cells and 0.3 of the rows: nodes 1, 2, 4, 5 */
    const int at[4] = {1, 2, 4, 5};
    const double share[4] = {0.75 * 0.7, 0.25 * 0.7, 0.75 * 0.3, 0.25 * 0.3};
    double want = 0.0;
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) {
            double s = fwhm_px[at[i]] / BST_FWHM_PER_SIGMA, t = fwhm_px[at[k]] / BST_FWHM_PER_SIGMA;
            want += share[i] * share[k] / (2.0 * BST_PI * (s * s + t * t));
        }
    }
    double got = bst_psf_squared_image(psf, sun, 125.0, 30.0, 0.0, 0.0, 0.0);
    bst_assert_close(got, want, 0.03 * want); /* as above; pixels add 1 / 12 px^2 */
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_the_integral_over_frequencies),
        cmocka_unit_test(nodes_of_a_field_mix),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
