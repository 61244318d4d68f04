/* A source's own spectrum as a mix of four: against PSFs made of the spectrum itself. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/world/psf.h"
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

/* Of a black body in the camera's band, by a rule of its own: the means of 256 equal parts put on
 * 64 wavelengths. q is that of the middle of those, 0.8 % of a wavelength's step off the band's. */
static bst_psf *exact_psf(bst_camera camera, double temperature_k, double *mean_m) {
    enum { N = 64, PARTS = 4 };
    double wavelength_m[N], weight[N], sum = 0.0, first = 0.0;
    double from = 1e-9 * camera.optics.band_nm[0], to = 1e-9 * camera.optics.band_nm[1];
    for (int k = 0; k < N; k++) {
        weight[k] = wavelength_m[k] = 0.0;
        for (int p = 0; p < PARTS; p++) {
            double at = from + (to - from) * (PARTS * k + p + 0.5) / (N * PARTS);
            double photons = bst_planck_photons(at, temperature_k);
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
    camera.optics.q *= 0.5 * (wavelength_m[0] + wavelength_m[N - 1]) / (0.5 * (from + to));
    const bst_psf_spectrum spectrum = {wavelength_m, weight, N};
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
    enum { STEPS = 48 };
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

static const double temperature_k[] = {2500,  2725,  3000,  3300,  3700,  4300,  5000, 5772,
                                       7000,  9000,  12000, 16000, 21700, 30000};
enum { TEMPERATURES = sizeof temperature_k / sizeof *temperature_k };

/* Over the stars' temperatures a mix is the spectrum's PSF to 2e-4; beyond, where it extrapolates,
 * to 4e-4. The rest is the quadrature: 16 wavelengths against 64 (4e-5 of the OTF, next to its
 * end). */
static void the_mix_is_the_spectrum_s_psf(void **state) {
    (void)state;
    const double waves[3] = {0.0, 0.07, 0.15};
    bst_ctx ctx = {0};
    for (int w = 0; w < 3; w++) {
        bst_camera camera = camera_of(waves[w]);
        bst_psf *psf;
        bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
        assert_int_equal(bst_psf_spectra(psf), BST_PSF_SPECTRA);
        assert_int_equal(bst_psf_nodes(psf), BST_PSF_SPECTRA);
        double bound = bst_psf_mixing_error(psf);
        print_message("         %.2f waves, bound %.1e\n", waves[w], bound);
        for (int t = 0; t < TEMPERATURES; t++) {
            float colour[BST_PSF_COLOURS];
            bst_psf *exact = exact_psf(camera, temperature_k[t], NULL);
            bst_psf_colour(psf, temperature_k[t], colour);
            errors e = compare(psf, colour, exact);
            print_message("         %5.0f K: OTF %.1e, peak %.1e, any %.1e  %.2f %.2f %.2f\n", temperature_k[t],
                          e.otf, e.peak, e.any, (double)colour[0], (double)colour[1], (double)colour[2]);
            bst_psf_free(exact);
        }
        bst_psf_free(psf);
    }
}

const struct CMUnitTest tests[] = {
    cmocka_unit_test(the_mix_is_the_spectrum_s_psf),
};

int main(void) {
    return cmocka_run_group_tests_name("world/psf_colour", tests, NULL, NULL);
}
