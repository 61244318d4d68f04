/* A source's own spectrum as a mix of four: against PSFs made of the spectrum itself. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/band.h"
#include "sim/optics/psf.h"
#include "tests/test_support.h"

enum { WAVELENGTHS = 16 };

/* A broad band, 400 to 900 nm, at Q = 2 in its middle. */
static bst_camera camera_of(double rms_waves) {
    static const double sign[6] = {1, -1, 1, 1, -1, 1};
    bst_camera c = {.width_px = 101,
                    .height_px = 51,
                    .pixel_scale_arcsec = 2.0,
                    .aperture_m = 0.1,
                    .psf_fwhm_px = 2.0,
                    .optics = {.psf = BST_PSF_DIFFRACTION,
                               .q = 2.0,
                               .band_nm = {400.0, 900.0},
                               .spectrum = BST_SPECTRUM_SOURCES,
                               .wavelengths = WAVELENGTHS,
                               .central_obstruction = 0.35}};
    for (int j = 0; j < 6; j++) { /* Noll 4 to 9 */
        c.optics.zernike_waves.waves[j + 2] = sign[j] * rms_waves / sqrt(6.0);
    }
    return c;
}

/* Gauss-Legendre on [-1, 1] (numpy's leggauss). */
static const double legendre_16[WAVELENGTHS] = {
    -0.9894009349916499, -0.9445750230732326, -0.8656312023878318, -0.755404408355003,
    -0.6178762444026438, -0.4580167776572274, -0.2816035507792589, -0.09501250983763745,
    0.09501250983763745, 0.2816035507792589,  0.4580167776572274,  0.6178762444026438,
    0.755404408355003,   0.8656312023878318,  0.9445750230732326,  0.9894009349916499};
static const double legendre_16_weight[WAVELENGTHS] = {
    0.02715245941175404, 0.06225352393864771, 0.09515851168249259, 0.124628971255534,
    0.1495959888165768,  0.1691565193950026,  0.1826034150449236,  0.1894506104550686,
    0.1894506104550686,  0.1826034150449236,  0.1691565193950026,  0.1495959888165768,
    0.124628971255534,   0.09515851168249259, 0.06225352393864771, 0.02715245941175404};

/* Of a black body in the camera's band, by a rule of its own: the means of 8 parts each of `count`
 * equal pieces of the band. q is taken for the middle of those. */
static bst_psf *exact_psf(bst_camera camera, double temperature_k, int count, double *mean_m) {
    enum { PARTS = 8 };
    double wavelength_m[64], weight[64], sum = 0.0, first = 0.0;
    double from = 1e-9 * camera.optics.band_nm[0], to = 1e-9 * camera.optics.band_nm[1];
    for (int k = 0; k < count; k++) {
        weight[k] = wavelength_m[k] = 0.0;
        for (int p = 0; p < PARTS; p++) {
            double at = from + (to - from) * (PARTS * k + p + 0.5) / (count * PARTS);
            double photons = bst_optics_planck_photons(at, temperature_k);
            weight[k] += photons;
            wavelength_m[k] += photons * at;
        }
        sum += weight[k];
        first += wavelength_m[k];
        wavelength_m[k] /= weight[k];
    }
    if (mean_m) {
        *mean_m = first / sum;
    }
    camera.optics.q *= (wavelength_m[0] + wavelength_m[count - 1]) / (from + to);
    const bst_psf_spectrum spectrum = {wavelength_m, weight, count};
    const bst_psf_inputs inputs = {.spectrum = &spectrum};
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_assert_ok(&ctx, bst_psf_create_from(&ctx, &camera, &inputs, &psf));
    return psf;
}

static void mixed_otf(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double fx, double fy,
                      double out[2]) {
    int spectra = bst_psf_spectra(psf), fields = bst_psf_nodes(psf) / spectra;
    out[0] = out[1] = 0.0;
    for (int s = 0; s < spectra; s++) {
        double h[2], share = bst_psf_share(colour, s);
        bst_psf_otf(psf, s * fields, fx, fy, h);
        out[0] += share * h[0];
        out[1] += share * h[1];
    }
}

/* Errors of a mix: largest of the OTF; of the pixel on the place, over that pixel; and the bound of
 * all pixels, integral of the OTF's error over that of the OTF. */
typedef struct errors {
    double otf, peak, any;
} errors;

static errors compare(const bst_psf *psf, const float colour[BST_PSF_COLOURS],
                      const bst_psf *exact) {
    enum { STEPS = 40 };
    double step = bst_psf_cutoff(exact) / STEPS, peak = 0.0, miss = 0.0, any = 0.0;
    errors e = {0};
    for (int j = -STEPS; j < STEPS; j++) {
        for (int i = 0; i < STEPS; i++) {
            double a[2], b[2], fx = (i + 0.5) * step, fy = (j + 0.5) * step;
            mixed_otf(psf, colour, fx, fy, a);
            bst_psf_otf(exact, 0, fx, fy, b);
            e.otf = fmax(e.otf, hypot(a[0] - b[0], a[1] - b[1]));
            any += hypot(a[0] - b[0], a[1] - b[1]);
            miss += a[0] - b[0];
            peak += b[0];
        }
    }
    e.peak = fabs(miss / peak);
    e.any = any / peak;
    return e;
}

/* Worst over temperatures. */
static errors worst_of(const bst_psf *psf, const bst_camera *camera, const double *temperature_k,
                       int temperatures, int wavelengths) {
    errors worst = {0};
    for (int t = 0; t < temperatures; t++) {
        float colour[BST_PSF_COLOURS];
        bst_psf *exact = exact_psf(*camera, temperature_k[t], wavelengths, NULL);
        bst_psf_colour(psf, temperature_k[t], colour);
        errors e = compare(psf, colour, exact);
        worst.otf = fmax(worst.otf, e.otf);
        worst.peak = fmax(worst.peak, e.peak);
        worst.any = fmax(worst.any, e.any);
        bst_psf_free(exact);
    }
    print_message("         OTF %.1e, middle pixel %.1e, any pixel below %.1e; predicted %.1e\n",
                  worst.otf, worst.peak, worst.any, bst_psf_mixing_error(psf));
    return worst;
}

/* Cases of the tests below; all in the slow form. */
static int temperatures = 4, aberrations = 1;

/* Against an average over 64 wavelengths by another rule. Each wavelength's OTF ends at a frequency
 * of its own, which leaves 7e-5 between the rules near those, at the Sun's temperature too, where
 * nothing is mixed; mixing itself misses 4e-5 of the OTF at most. */
static void a_mix_is_the_psf_of_the_spectrum(void **state) {
    (void)state;
    static const double temperature_k[] = {2500, 3300, 7000, 30000, 2725, 4300, 10e3, 21700};
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_camera camera = camera_of(0.0);
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    assert_int_equal(bst_psf_spectra(psf), BST_PSF_SPECTRA);
    assert_int_equal(bst_psf_nodes(psf), BST_PSF_SPECTRA);
    errors e = worst_of(psf, &camera, temperature_k, temperatures, 64);
    assert_true(e.otf < 1.2e-4);
    assert_true(e.peak < 6e-5);
    bst_psf_free(psf);
}

/* The camera's own 16 wavelengths leave mixing alone. Aberrations bend the OTF more strongly with
 * the wavelength. */
static void aberrations_mix_too(void **state) {
    (void)state;
    static const double temperature_k[] = {2500, 30000};
    const struct { double waves, otf, peak; } cases[2] = {{0.15, 1.5e-4, 6e-5}, {0.07, 1e-4, 6e-5}};
    for (int w = 0; w < aberrations; w++) {
        bst_ctx ctx = {0};
        bst_psf *psf;
        bst_camera camera = camera_of(cases[w].waves);
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        double place[WAVELENGTHS], weight[WAVELENGTHS];
        errors worst = {0};
        for (int t = 0; t < 2; t++) {
            float colour[BST_PSF_COLOURS];
            for (int k = 0; k < WAVELENGTHS; k++) {
                place[k] = 1e-9 * (650.0 + 250.0 * legendre_16[k]);
                weight[k] =
                    legendre_16_weight[k] * bst_optics_planck_photons(place[k], temperature_k[t]);
            }
            const bst_psf_spectrum spectrum = {place, weight, WAVELENGTHS};
            const bst_psf_inputs inputs = {.spectrum = &spectrum};
            bst_psf *exact;
            bst_assert_ok(&ctx, bst_psf_create_from(&ctx, &camera, &inputs, &exact));
            bst_psf_colour(psf, temperature_k[t], colour);
            errors e = compare(psf, colour, exact);
            worst =
                (errors){fmax(worst.otf, e.otf), fmax(worst.peak, e.peak), fmax(worst.any, e.any)};
            bst_psf_free(exact);
        }
        print_message("         %.2f waves: OTF %.1e, middle pixel %.1e, any below %.1e; %.1e\n",
                      cases[w].waves, worst.otf, worst.peak, worst.any, bst_psf_mixing_error(psf));
        assert_true(worst.otf < cases[w].otf);
        assert_true(worst.peak < cases[w].peak);
        bst_psf_free(psf);
    }
}

/* In thermal bands: emission from 180 K on, and stars. */
static void thermal_bands(void **state) {
    (void)state;
    static const double temperature_k[] = {180, 350, 20000};
    static const double band_nm[2][2] = {{3300, 5100}, {7800, 12200}};
    for (int k = 0; k < 2; k++) {
        bst_ctx ctx = {0};
        bst_psf *psf;
        bst_camera camera = camera_of(0.0);
        camera.optics.band_nm[0] = band_nm[k][0];
        camera.optics.band_nm[1] = band_nm[k][1];
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        errors e = worst_of(psf, &camera, temperature_k, 3, 64);
        assert_true(e.otf < 1.2e-4);
        bst_psf_free(psf);
    }
}

/* An aperture's OTF begins as 1 - s times a constant of its shape (O'Neill 1956), s going as the
 * wavelength: what it lacks at low frequencies, and with it the light far out, is as the photons'
 * mean wavelength. */
static void wings_go_as_the_mean_wavelength(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_camera camera = camera_of(0.0);
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    double lack[2], mean_m[2];
    for (int k = 0; k < 2; k++) { /* red and blue */
        float colour[BST_PSF_COLOURS];
        double h[2], f = 1e-3, pixel = 1.0 - BST_PI * BST_PI * f * f / 6.0;
        double b_minus_v = k == 0 ? 1.6 : -0.2;
        bst_psf_colour(psf, bst_optics_star_spectrum_k(b_minus_v), colour);
        mixed_otf(psf, colour, f, 0.0, h);
        lack[k] = 1.0 - h[0] / pixel;
        bst_psf_free(exact_psf(camera, bst_optics_star_temperature_k(b_minus_v), 64, &mean_m[k]));
    }
    assert_true(mean_m[0] / mean_m[1] > 1.15); /* they do differ */
    /* colours are floats between 1024 entries (3e-6); the next power of s: 1e-6 */
    bst_assert_close(lack[0] / lack[1], mean_m[0] / mean_m[1], 2e-5);
    bst_psf_free(psf);
}

/* The width that the truth's SNR goes by, against that of the spectrum's own PSF: it is no linear
 * function of the spectrum, but nearly. */
static void widths_mix(void **state) {
    (void)state;
    static const double temperature_k[3] = {2725, 4500, 21700};
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_camera camera = camera_of(0.0);
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    double sun = bst_psf_equivalent_fwhm_px(psf, 50.0, 25.0), width[3];
    for (int t = 0; t < 3; t++) {
        float colour[BST_PSF_COLOURS];
        bst_psf *exact = exact_psf(camera, temperature_k[t], 32, NULL);
        bst_psf_colour(psf, temperature_k[t], colour);
        width[t] = bst_psf_coloured_fwhm_px(psf, colour, 50.0, 25.0);
        double own = bst_psf_equivalent_fwhm_px(exact, 50.0, 25.0);
        print_message("         %.0f K: %.4f px, exact %.4f\n", temperature_k[t], width[t], own);
        bst_assert_close(width[t] / own, 1.0, 2e-4); /* the rules differ by 7e-5 of the OTF */
        bst_psf_free(exact);
    }
    assert_true(width[0] > 1.1 * sun && width[2] < 0.95 * sun);
    bst_psf_free(psf);
}

/* The Sun is the first of the spectra, in one PSF as in the other; where nothing has a spectrum of
 * its own, colours change nothing. */
static void the_sun_s_light_needs_no_mix(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *sources, *solar, *gaussian;
    bst_camera camera = camera_of(0.07);
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &sources));
    camera.optics.spectrum = BST_SPECTRUM_SOLAR;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &solar));
    camera.optics.psf = BST_PSF_GAUSSIAN;
    camera.optics.spectrum = BST_SPECTRUM_SOURCES;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &gaussian));
    for (double f = 0.0; f < 0.7; f += 0.013) {
        double a[2], b[2];
        bst_psf_otf(sources, 0, f, 0.2 * f, a);
        bst_psf_otf(solar, 0, f, 0.2 * f, b);
        assert_true(a[0] == b[0] && a[1] == b[1]); /* the same sums */
    }
    /* the centroid of a mix is that of its parts */
    const float mixes[BST_PSF_SPECTRA + 1][BST_PSF_COLOURS] = {
        {0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.3F, 0.2F, 0.1F}};
    double place[BST_PSF_SPECTRA + 1][2], alone[2];
    bst_psf_centroid_px(solar, mixes[0], 50, 25, alone);
    assert_true(hypot(alone[0], alone[1]) > 0.01); /* coma */
    for (int s = 0; s <= BST_PSF_SPECTRA; s++) {
        bst_psf_centroid_px(sources, mixes[s], 50, 25, place[s]);
    }
    for (int a = 0; a < 2; a++) {
        bst_assert_close(place[0][a], alone[a], 1e-12);
        bst_assert_close(
            place[4][a],
            0.4 * place[0][a] + 0.3 * place[1][a] + 0.2 * place[2][a] + 0.1 * place[3][a], 1e-7);
    }
    float colour[BST_PSF_COLOURS];
    bst_psf_colour(sources, 5772.0, colour);
    for (int s = 0; s < BST_PSF_COLOURS; s++) {
        bst_assert_close((double)colour[s], 0.0, 2e-5); /* between entries of the table */
    }
    const bst_psf *plain[2] = {solar, gaussian};
    for (int k = 0; k < 2; k++) {
        assert_int_equal(bst_psf_spectra(plain[k]), 1);
        bst_psf_colour(plain[k], 3000.0, colour);
        assert_true(colour[0] == 0.0F && colour[1] == 0.0F && colour[2] == 0.0F);
        assert_true(bst_psf_mixing_error(plain[k]) == 0.0);
    }
    bst_psf_free(sources);
    bst_psf_free(solar);
    bst_psf_free(gaussian);
}

/* With one wavelength there is no colour, with few or in a narrow band little: shares stay small
 * numbers. Temperatures that are none are held. */
static void bands_without_colour(void **state) {
    (void)state;
    const struct {
        double band_nm[2];
        int64_t wavelengths;
    } cases[4] = {{{400, 900}, 1}, {{400, 900}, 2}, {{600, 600.001}, 8}, {{507, 595}, 8}};
    const double temperature_k[6] = {0.0, -1.0, (double)INFINITY, (double)NAN, 2700.0, 22000.0};
    for (int k = 0; k < 4; k++) {
        bst_ctx ctx = {0};
        bst_psf *psf;
        bst_camera camera = camera_of(0.0);
        camera.optics.band_nm[0] = cases[k].band_nm[0];
        camera.optics.band_nm[1] = cases[k].band_nm[1];
        camera.optics.wavelengths = cases[k].wavelengths;
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        for (int t = 0; t < 6; t++) {
            float colour[BST_PSF_COLOURS];
            bst_psf_colour(psf, temperature_k[t], colour);
            for (int s = 0; s < BST_PSF_COLOURS; s++) {
                assert_true(fabs((double)colour[s]) < (k == 0 ? 1e-9 : 8.0));
            }
        }
        assert_true(bst_psf_mixing_error(psf) < 1e-6);
        bst_psf_free(psf);
    }
}

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "slow") == 0) {
        temperatures = 8;
        aberrations = 2;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mix_is_the_psf_of_the_spectrum),
        cmocka_unit_test(aberrations_mix_too),
        cmocka_unit_test(thermal_bands),
        cmocka_unit_test(wings_go_as_the_mean_wavelength),
        cmocka_unit_test(widths_mix),
        cmocka_unit_test(the_sun_s_light_needs_no_mix),
        cmocka_unit_test(bands_without_colour),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
