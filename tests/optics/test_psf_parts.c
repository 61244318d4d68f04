/* Sampled PSFs, bands, fields, widths, and who owns a PSF. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/band.h"
#include "sim/optics/psf.h"
#include "tests/test_support.h"

static bst_camera camera_of(int32_t model) {
    return (bst_camera){.width_px = 101,
                        .height_px = 51,
                        .pixel_scale_arcsec = 2.0,
                        .aperture_m = 0.1,
                        .psf_fwhm_px = 2.0,
                        .optics = {.psf = model, .q = 2.0}};
}

static double sinc(double x) {
    return x == 0.0 ? 1.0 : sin(BST_PI * x) / (BST_PI * x);
}

/* Samples of a Gaussian and a smaller one beside it, off the middle of the array. */
enum { WIDE = 120, HIGH = 100 };
static void sample_pair(double sigma_px, double oversampling, double x, double y, float *out) {
    double s = sigma_px * oversampling;
    for (int i = 0; i < WIDE * HIGH; i++) {
        double dx = i % WIDE - x, dy = (double)(i / WIDE) - y, ex = dx - 2.0 * s;
        out[i] = (float)(5.0 * exp(-0.5 * (dx * dx + dy * dy) / (s * s)) +
                         1.0 * exp(-0.5 * (ex * ex + dy * dy) / (s * s)));
    }
}

static void a_sampled_psf_has_its_own_otf(void **state) {
    (void)state;
    static float samples[WIDE * HIGH];
    const double sigma = 0.8, o = 5.0;
    sample_pair(sigma, o, 55.3, 44.1, samples);
    for (int centre = 0; centre < 2; centre++) {
        bst_camera camera = camera_of(BST_PSF_FILE);
        camera.optics.file_centre = centre ? BST_PSF_ARRAY : BST_PSF_CENTROID;
        const bst_psf_samples given = {samples, WIDE, HIGH, 1, o};
        const bst_psf_inputs inputs = {.samples = &given};
        bst_ctx ctx = {0};
        bst_psf *psf;
        bst_assert_ok(&ctx, bst_psf_create_from(&ctx, &camera, &inputs, &psf));
        /* the pair is 2 sigma apart, 5 to 1: its centroid is a sixth of that from the first */
        double x0 = centre ? (55.3 - 59.5) / o : -2.0 * sigma / 6.0;
        double y0 = centre ? (44.1 - 49.5) / o : 0.0;
        for (int k = 0; k < 200; k++) {
            double fx = 0.017 * k - 1.4, fy = 0.9 - 0.011 * k, h[2];
            bst_psf_otf(psf, 0, fx, fy, h);
            double g = exp(-2.0 * BST_PI * BST_PI * sigma * sigma * (fx * fx + fy * fy)) *
                       sinc(fx) * sinc(fy) / 6.0;
            double a = -2.0 * BST_PI * (fx * x0 + fy * y0), b = a - 4.0 * BST_PI * fx * sigma;
            /* floats of 6e-8, and what is cut at 1e-6 */
            bst_assert_close(h[0], g * (5.0 * cos(a) + cos(b)), 2e-6);
            bst_assert_close(h[1], g * (5.0 * sin(a) + sin(b)), 2e-6);
        }
        /* Gaussian of 0.8 px: 1e-6 at 1.05 cycles/px */
        assert_true(bst_psf_cutoff(psf) > 1.0 && bst_psf_cutoff(psf) < 1.7);
        bst_psf_free(psf);
    }
}

static void what_cannot_be_is_said(void **state) {
    (void)state;
    static float samples[WIDE * HIGH];
    bst_psf_samples given = {samples, WIDE, HIGH, 1, 5.0};
    const bst_psf_inputs inputs = {.samples = &given};
    bst_psf_field_node nodes[3] = {{0}};
    bst_ctx ctx = {0};
    bst_psf *psf;
    struct {
        bst_camera camera;
        const char *message;
    } cases[8];
    for (int k = 0; k < 8; k++) {
        cases[k].camera = camera_of(k < 2 ? BST_PSF_FILE : BST_PSF_DIFFRACTION);
    }
    cases[0].message = "plane 0 of the PSF has no light";
    cases[1].camera.optics.field_columns = 2;
    cases[1].message = "the PSF has 1 planes where the field grid has 2 nodes";
    cases[2].camera.optics.defocus_um = 10.0;
    cases[2].message = "optics/defocus_um needs optics/f_number";
    cases[3].camera.optics.field = (bst_config_list){nodes, 3};
    cases[3].message = "optics/field has 3 nodes where field_columns times field_rows are 1";
    cases[4].camera.optics.zernike_waves.waves[2] = 30.0;
    cases[4].message = "waves per aperture diameter";
    cases[5].camera.optics.central_obstruction = 1.0;
    cases[5].message = "optics/central_obstruction must be below 1";
    cases[6].camera.optics.spiders = (bst_optics_spiders){.count = 4, .width_m = 0.05};
    cases[6].message = "optics/spiders of 4 vanes and 0.05 m cover an aperture of 0.1 m";
    cases[7].camera.optics.band_nm[1] = 500.0;
    cases[7].camera.optics.band_nm[0] = 600.0;
    cases[7].message = "optics/band_nm must grow (found 600 and 500)";
    for (int k = 0; k < 8; k++) {
        assert_int_equal(bst_psf_create_from(&ctx, &cases[k].camera, &inputs, &psf),
                         BST_ERR_CONFIG);
        assert_null(psf);
        assert_non_null(strstr(ctx.message, cases[k].message));
    }
    bst_camera file = camera_of(BST_PSF_FILE);
    assert_int_equal(bst_psf_create(&ctx, &file, &psf), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "hand its samples over"));
}

/* The band's PSF is the mean of those of its wavelengths, with the aberrations' waves scaled. */
static void a_band_is_the_mean_of_its_wavelengths(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    camera.optics.q = 0.0; /* from the aperture: wavelength / (0.1 m x 2 arcsec) */
    camera.obscuration = 0.1;
    camera.optics.zernike_nm = 500.0;
    camera.optics.zernike_waves.waves[4 - 2] = 0.1;
    camera.optics.zernike_waves.waves[8 - 2] = 0.1;
    const double wavelength_m[2] = {450e-9, 700e-9}, weight[2] = {3.0, 1.0};
    bst_ctx ctx = {0};
    bst_psf *psf[3];
    for (int k = 0; k < 3; k++) {
        const bst_psf_spectrum spectrum = {k < 2 ? &wavelength_m[k] : wavelength_m,
                                           k < 2 ? &weight[k] : weight, k < 2 ? 1 : 2};
        const bst_psf_inputs inputs = {.spectrum = &spectrum};
        bst_assert_ok(&ctx, bst_psf_create_from(&ctx, &camera, &inputs, &psf[k]));
    }
    bst_assert_close(bst_psf_cutoff(psf[0]), 0.1 * 2.0 * BST_ARCSEC_RAD / 450e-9, 1e-12);
    for (int k = 0; k < 60; k++) {
        double fx = 0.037 * k - 1.1, fy = 0.4 + 0.01 * k, h[3][2];
        for (int n = 0; n < 3; n++) {
            bst_psf_otf(psf[n], 0, fx, fy, h[n]);
        }
        for (int c = 0; c < 2; c++) {
            /* cells of different sizes: 1e-5 each */
            bst_assert_close(h[2][c], 0.75 * h[0][c] + 0.25 * h[1][c], 4e-5);
        }
    }
    for (int k = 0; k < 3; k++) {
        bst_psf_free(psf[k]);
    }
}

/* Without band_nm the response of the camera's own band counts. */
static void the_cameras_band_is_the_psfs(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    camera.optics.q = 0.0;
    bst_optics_response_point points[4] = {{0.7, 0.0}, {0.701, 1.0}, {0.799, 1.0}, {0.8, 0.0}};
    camera.band.response = (bst_config_list){points, 4};
    bst_band *band;
    bst_assert_ok(&ctx, bst_band_create(&ctx, &camera.band, "", &band));
    camera.spectrum = band;
    bst_psf *own, *same;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &own));
    camera.spectrum = NULL;
    camera.optics.band_nm[0] = 700.0;
    camera.optics.band_nm[1] = 800.0;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &same));
    for (double f = 0.0; f < 1.4; f += 0.01) {
        double a[2], b[2];
        bst_psf_otf(own, 0, 0.0, f, a);
        bst_psf_otf(same, 0, 0.0, f, b);
        bst_assert_close(a[0], b[0], 2e-3); /* the search for the ends takes steps of 0.3 % */
    }
    bst_psf_free(own);
    bst_psf_free(same);
    bst_band_free(band);
}

static void more_wavelengths_change_little(void **state) {
    (void)state;
    bst_camera camera = camera_of(BST_PSF_DIFFRACTION);
    camera.optics.band_nm[0] = 450.0;
    camera.optics.band_nm[1] = 850.0;
    camera.optics.spectrum = BST_SPECTRUM_SOLAR;
    bst_ctx ctx = {0};
    bst_psf *few, *many;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &few));
    camera.optics.wavelengths = 64;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &many));
    double worst = 0.0;
    for (double f = 0.0; f < 0.75; f += 0.003) {
        double a[2], b[2];
        bst_psf_otf(few, 0, f, 0.0, a);
        bst_psf_otf(many, 0, f, 0.0, b);
        worst = fmax(worst, fabs(a[0] - b[0]));
    }
    assert_true(worst < 2e-4); /* where the wavelengths' cut-offs follow one another */
    bst_psf_free(few);
    bst_psf_free(many);
}

static void field_nodes_mix_bilinearly(void **state) {
    (void)state;
    bst_psf_field_node nodes[6] = {{0}};
    for (int k = 0; k < 6; k++) {
        nodes[k].psf_fwhm_px = 2.0 + k;
    }
    bst_camera camera = camera_of(BST_PSF_GAUSSIAN);
    camera.optics.field_columns = 3;
    camera.optics.field_rows = 2;
    camera.optics.field = (bst_config_list){nodes, 6};
    bst_ctx ctx = {0};
    bst_psf *psf;
    double sigma, weight[4];
    int node[4];
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    assert_false(bst_psf_gaussian(psf, &sigma));
    assert_int_equal(bst_psf_nodes(psf), 6);
    assert_int_equal(bst_psf_weights(psf, 50.0, 50.0, node, weight), 1);
    assert_int_equal(node[0], 4);
    assert_int_equal(bst_psf_weights(psf, -7.0, 60.0, node, weight), 1); /* beyond the corner */
    assert_int_equal(node[0], 3);
    assert_int_equal(bst_psf_weights(psf, 60.0, 10.0, node, weight), 4);
    const double want[4] = {0.8 * 0.8, 0.2 * 0.8, 0.8 * 0.2, 0.2 * 0.2};
    const int of[4] = {1, 2, 4, 5};
    for (int k = 0; k < 4; k++) {
        assert_int_equal(node[k], of[k]);
        bst_assert_close(weight[k], want[k], 1e-15); /* rounding */
    }
    /* 3 + 0.2 at the top row, 6 + 0.2 at the bottom row */
    bst_assert_close(bst_psf_equivalent_fwhm_px(psf, 60.0, 10.0), 0.8 * 3.2 + 0.2 * 6.2, 2e-3);
    bst_psf_free(psf);
}

/* Integral of the squared profile: (b - 1)^2 / (pi a^2 (2 b - 1)) for Moffat's, 1 / (4 pi s^2) for
 * Gauss's. */
static void noise_areas_have_closed_forms(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_camera camera = camera_of(BST_PSF_MOFFAT);
    camera.psf_fwhm_px = 12.0;
    camera.optics.moffat_beta = 3.0;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    double alpha = 6.0 / sqrt(cbrt(2.0) - 1.0), area = BST_PI * alpha * alpha * 5.0 / 4.0;
    /* the pixel adds a seventh of a px^2 per axis; midpoint rule */
    bst_assert_close(bst_psf_noise_area_px2(psf, 0) / area, 1.0, 0.01);
    bst_assert_close(bst_psf_equivalent_fwhm_px(psf, 0.0, 0.0),
                     2.3548200450309493 * sqrt(area / (4.0 * BST_PI)), 0.01);
    bst_psf_free(psf);
    camera = camera_of(BST_PSF_GAUSSIAN);
    camera.psf_fwhm_px = 1.0;
    camera.optics.diffusion_px = 0.3;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    double s = hypot(1.0 / 2.3548200450309493, 0.3);
    bst_assert_close(bst_psf_equivalent_fwhm_px(psf, 0.0, 0.0), 2.3548200450309493 * s, 1e-12);
    /* mean over the place in the pixel of the sum of squared shares, by brute force */
    double line = 0.0;
    for (int p = 0; p < 64; p++) {
        for (int i = -8; i <= 8; i++) {
            double x = i - (p + 0.5) / 64.0, r = sqrt(2.0) * s;
            double share = 0.5 * (erf((x + 0.5) / r) - erf((x - 0.5) / r));
            line += share * share / 64.0;
        }
    }
    bst_assert_close(bst_psf_noise_area_px2(psf, 0), 1.0 / (line * line), 2e-3); /* of 4 px^2 */
    bst_psf_free(psf);
}

/* Jitter in rad at another pixel scale: so many of its pixels, as a Gaussian of that width. */
static void jitter_in_angles_is_of_the_new_pixels(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = camera_of(BST_PSF_GAUSSIAN), out;
    bst_psf *psf;
    double sigma_rad = 1.2 * BST_ARCSEC_RAD;
    bst_assert_ok(&ctx,
                  bst_psf_camera_trembling(&ctx, &camera, 3.0, sigma_rad * sigma_rad, &out, &psf));
    double h[2], own = 2.0 / BST_FWHM_PER_SIGMA, variance = own * own + 0.4 * 0.4;
    bst_assert_close(out.pixel_scale_arcsec, 3.0, 0.0);
    bst_assert_close(out.optics.diffusion_px, 0.4, 1e-12);
    bst_psf_otf(psf, 0, 0.11, -0.07, h);
    double f2 = 0.11 * 0.11 + 0.07 * 0.07;
    bst_assert_close(h[0], sinc(0.11) * sinc(0.07) * exp(-2.0 * BST_PI * BST_PI * variance * f2),
                     1e-6);
    bst_psf_free(psf);
    bst_assert_ok(&ctx, bst_psf_camera_trembling(&ctx, &camera, 3.0, 0.0, &out, &psf));
    assert_null(psf);
}

static void a_camera_lends_its_psf(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = camera_of(BST_PSF_MOFFAT);
    bst_psf *first, *second;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &first));
    camera.psf = first;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &second));
    assert_ptr_equal(first, second);
    bst_psf_free(first);
    double h[2];
    bst_psf_otf(second, 0, 0.0, 0.0, h); /* still there */
    bst_assert_close(h[0], 1.0, 1e-12);
    bst_psf_free(second);
}

/* A point of light 100 % in its pixels: the OTF at 0, with all that is mixed in. */
static void no_light_is_lost(void **state) {
    (void)state;
    for (int32_t model = BST_PSF_GAUSSIAN; model <= BST_PSF_DIFFRACTION; model++) {
        bst_camera camera = camera_of(model);
        camera.optics.zernike_waves.waves[5] = 0.3;
        camera.optics.spiders = (bst_optics_spiders){.count = 4, .width_m = 0.003};
        camera.optics.diffusion_px = 0.2;
        camera.optics.fill_factor[0] = 0.7;
        bst_ctx ctx = {0};
        bst_psf *psf;
        double h[2];
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        bst_psf_otf(psf, 0, 0.0, 0.0, h);
        bst_assert_close(h[0], 1.0, 1e-12);
        bst_assert_close(h[1], 0.0, 1e-12);
        bst_psf_free(psf);
    }
}

/* Fast motion multiplies every OTF by its own, and the widened PSF outlives nothing but its base.
 */
static void jitter_widens_any_psf(void **state) {
    (void)state;
    bst_ctx ctx;
    const int32_t models[] = {BST_PSF_GAUSSIAN, BST_PSF_MOFFAT, BST_PSF_DIFFRACTION};
    for (int i = 0; i < 3; i++) {
        bst_camera camera = camera_of(models[i]), blurred;
        bst_psf *psf;
        camera.optics.diffusion_px = 0.3;
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        camera.psf = psf;
        bst_assert_ok(&ctx, bst_psf_camera_blurred(&ctx, &camera, 0.4, &blurred));
        bst_psf_free(psf); /* the copy holds what it needs */
        bst_psf *wide = (bst_psf *)blurred.psf, *again;
        /* rounding of a sum of squares */
        bst_assert_close(blurred.optics.diffusion_px, 0.5, 1e-15);
        camera.psf = NULL;
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        for (double f = 0.0; f < 0.6; f += 0.07) {
            double a[2], b[2], factor = exp(-2.0 * BST_PI * BST_PI * 0.16 * f * f);
            bst_psf_otf(psf, 0, f, -0.5 * f, a);
            bst_psf_otf(wide, 0, f, -0.5 * f, b);
            factor *= exp(-2.0 * BST_PI * BST_PI * 0.16 * 0.25 * f * f);
            bst_assert_close(b[0], a[0] * factor, 1e-14);
            bst_assert_close(b[1], a[1] * factor, 1e-14);
        }
        assert_true(bst_psf_cutoff(wide) <= bst_psf_cutoff(psf));
        assert_true(bst_psf_reach_px(wide, 1e-9) > bst_psf_reach_px(psf, 1e-9));
        assert_true(bst_psf_equivalent_fwhm_px(wide, 50, 25) >
                    bst_psf_equivalent_fwhm_px(psf, 50, 25));
        double sigma_px, before_px;
        assert_int_equal(bst_psf_gaussian(wide, &sigma_px), i == 0);
        if (i == 0) {
            assert_true(bst_psf_gaussian(psf, &before_px));
            bst_assert_close(sigma_px, hypot(before_px, 0.4), 1e-15);
            bst_assert_close(bst_camera_psf_sigma_px(&blurred), sigma_px, 1e-15);
        }
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &blurred, &again));
        assert_ptr_equal(again, wide);
        bst_psf_free(wide);
        bst_psf_free(again);
        bst_psf_free(psf);
    }
}

/* Two single samples beside each other slantwise: the OTF of samples repeats at the sampling
 * frequency, and its table goes beyond the half of it. Up to half a cycle per pixel. */
static void the_table_goes_on_beyond_half_the_sampling(void **state) {
    (void)state;
    enum { N = 32 };
    static float samples[N * N];
    memset(samples, 0, sizeof samples);
    samples[16 * N + 16] = 3.0f;
    samples[17 * N + 15] = 1.0f;
    bst_camera camera = camera_of(BST_PSF_FILE);
    camera.optics.file_centre = BST_PSF_CENTROID;
    const bst_psf_samples given = {samples, N, N, 1, 1.0};
    const bst_psf_inputs inputs = {.samples = &given};
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create_from(&ctx, &camera, &inputs, &psf));
    for (int k = 0; k <= 20; k++) {
        double fx = 0.49 - 0.002 * (k % 5), fy = -0.48 + 0.048 * k, h[2];
        bst_psf_otf(psf, 0, fx, fy, h);
        double a = -2.0 * BST_PI * (0.25 * fx - 0.25 * fy), b = a + 2.0 * BST_PI * (fx - fy);
        double pixel = sinc(fx) * sinc(fy) / 4.0;
        /* six nodes of a table of at least 32 per period: 1e-6, and floats */
        bst_assert_close(h[0], pixel * (3.0 * cos(a) + cos(b)), 1e-5);
        bst_assert_close(h[1], pixel * (3.0 * sin(a) + sin(b)), 1e-5);
    }
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_table_goes_on_beyond_half_the_sampling),
        cmocka_unit_test(a_sampled_psf_has_its_own_otf),
        cmocka_unit_test(what_cannot_be_is_said),
        cmocka_unit_test(a_band_is_the_mean_of_its_wavelengths),
        cmocka_unit_test(the_cameras_band_is_the_psfs),
        cmocka_unit_test(more_wavelengths_change_little),
        cmocka_unit_test(field_nodes_mix_bilinearly),
        cmocka_unit_test(noise_areas_have_closed_forms),
        cmocka_unit_test(a_camera_lends_its_psf),
        cmocka_unit_test(jitter_in_angles_is_of_the_new_pixels),
        cmocka_unit_test(no_light_is_lost),
        cmocka_unit_test(jitter_widens_any_psf),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
