/* Images of a point from the OTF, against closed forms. */
#include "sim/optics/psf_image.h"

#include <math.h>
#include <stdlib.h>

#include "tests/test_support.h"

enum { PER_PX = 4, REACH_PX = 6, SIDE = 2 * PER_PX * REACH_PX + 1 };

static bst_psf *psf_of(const bst_camera *camera) {
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, camera, &psf));
    return psf;
}

static double axis(double d, double sigma) {
    double root = sigma * sqrt(2.0);
    return 0.5 * (erf((d + 0.5) / root) - erf((d - 0.5) / root));
}

static void a_gaussian_is_its_closed_form(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 64,
                         .height_px = 64,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.1,
                         .psf_fwhm_px = 2.0,
                         .optics = {.diffusion_px = 0.3}};
    bst_psf *psf = psf_of(&camera);
    double image[SIDE * SIDE], blur = 0.4;
    double sigma = sqrt(pow(2.0 / 2.3548200450309493, 2.0) + 0.3 * 0.3 + blur * blur);
    bst_assert_ok(&ctx, bst_psf_image(&ctx, psf, 0, blur, PER_PX, REACH_PX, image));
    for (int j = 0; j < SIDE; j++) {
        for (int i = 0; i < SIDE; i++) {
            double dx = (double)i / PER_PX - REACH_PX, dy = (double)j / PER_PX - REACH_PX;
            double want = axis(dx, sigma) * axis(dy, sigma);
            /* the OTF is cut where it is 1e-9, over a few square cycles */
            bst_assert_close(image[j * SIDE + i], want, 1e-8);
        }
    }
    bst_psf_free(psf);
}

/* Samples a whole pixel apart are the pixels of one frame: their light is all there is, wherever
 * in the pixel the source stands, and their centroid is the place of a symmetric PSF. */
static void pixels_hold_the_light_and_its_place(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 64,
                         .height_px = 64,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.1,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION, .q = 1.5, .wavelengths = 1}};
    enum { REACH = 30, WIDE = 2 * PER_PX * REACH + 1 };
    bst_psf *psf = psf_of(&camera);
    double *image = malloc(sizeof *image * WIDE * WIDE);
    assert_non_null(image);
    bst_assert_ok(&ctx, bst_psf_image(&ctx, psf, 0, 0.0, PER_PX, REACH, image));
    for (int phase = 0; phase < PER_PX; phase++) {
        double sum = 0.0, least = 1.0;
        for (int j = phase; j < WIDE; j += PER_PX) {
            for (int i = 0; i < WIDE; i += PER_PX) {
                sum += image[j * WIDE + i];
                least = fmin(least, image[j * WIDE + i]);
            }
        }
        /* beyond r the light of an aperture is about 2 q / (pi^2 r) of all: 1 % here */
        bst_assert_close(sum, 1.0, 0.015);
        assert_true(sum < 1.0 + 1e-3);
        assert_true(least > -1e-6);
    }
    for (int j = 0; j < WIDE; j++) {
        for (int i = 0; i < WIDE; i++) {
            /* rounding of sums of numbers below 1 */
            bst_assert_close(image[j * WIDE + i], image[i * WIDE + j], 1e-12);
            bst_assert_close(image[j * WIDE + i], image[(WIDE - 1 - j) * WIDE + WIDE - 1 - i],
                             1e-12);
        }
    }
    free(image);
    bst_psf_free(psf);
}

/* A PSF with coma and astigmatism is its own mirror image in no way. Its image against the sum over
 * the frequencies that a period of 64 px distinguishes, written out. */
static void an_aberrated_image_is_the_transform_of_its_otf(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 64,
                         .height_px = 64,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.1,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION, .q = 1.5, .wavelengths = 1}};
    /* Noll's 5 to 8: astigmatism and coma along both axes */
    const double waves[] = {0.03, 0.05, 0.12, 0.07};
    memcpy(camera.optics.zernike_waves.waves + 5 - 2, waves, sizeof waves);
    bst_psf *psf = psf_of(&camera);
    static double image[SIDE * SIDE];
    bst_assert_ok(&ctx, bst_psf_image(&ctx, psf, 0, 0.0, PER_PX, REACH_PX, image));
    const int places[][2] = {{24, 24}, {27, 24}, {21, 24}, {24, 27}, {24, 21}, {28, 19}, {19, 28}};
    for (int n = 0; n < 7; n++) {
        double dx = (double)places[n][0] / PER_PX - REACH_PX;
        double dy = (double)places[n][1] / PER_PX - REACH_PX, sum = 0.0;
        for (int ky = -64; ky <= 64; ky++) {
            for (int kx = -64; kx <= 64; kx++) {
                double fx = kx / 64.0, fy = ky / 64.0, h[2];
                bst_psf_otf(psf, 0, fx, fy, h);
                double a = 2.0 * BST_PI * (fx * dx + fy * dy);
                sum += (h[0] * cos(a) - h[1] * sin(a)) / (64.0 * 64.0);
            }
        }
        /* light of 4e-9 lies beyond the cut-off in the table of the OTF */
        bst_assert_close(image[places[n][1] * SIDE + places[n][0]], sum, 1e-8);
    }
    /* no mirror images: coma distinguishes left from right and up from down */
    assert_true(fabs(image[24 * SIDE + 28] - image[24 * SIDE + 20]) > 1e-3);
    assert_true(fabs(image[28 * SIDE + 24] - image[20 * SIDE + 24]) > 1e-3);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_aberrated_image_is_the_transform_of_its_otf),
        cmocka_unit_test(a_gaussian_is_its_closed_form),
        cmocka_unit_test(pixels_hold_the_light_and_its_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
