/* Sources through a PSF of their own spectrum: the renderer against reference images with PSFs that
 * are made of each source's spectrum alone. */
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/optics/band.h"
#include "sim/optics/psf.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { WIDTH = 112, HEIGHT = 96, PIXELS = WIDTH * HEIGHT, SOURCES = 2, WAVELENGTHS = 8, FEW = 4 };

/* Gauss-Legendre on [-1, 1] (Abramowitz and Stegun, table 25.4), the camera's rule: of FEW
 * wavelengths and of WAVELENGTHS. */
static const double place[2][4] = {
    {0.3399810435848563, 0.8611363115940526},
    {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363}};
static const double weight[2][4] = {
    {0.6521451548625461, 0.3478548451374538},
    {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763}};

/* An aberrated PSF is of few wavelengths: each takes as long as the next. */
static bst_camera broad_camera(double q, double rms_waves) {
    static const double sign[6] = {1, -1, 1, 1, -1, 1};
    bst_camera c = scene_camera(WIDTH, HEIGHT);
    c.optics.psf = BST_PSF_DIFFRACTION;
    c.optics.q = q;
    c.optics.band_nm[0] = 400.0;
    c.optics.band_nm[1] = 900.0;
    c.optics.wavelengths = rms_waves > 0.0 ? FEW : WAVELENGTHS;
    c.optics.spectrum = BST_SPECTRUM_SOURCES;
    c.optics.central_obstruction = 0.35;
    for (int j = 0; j < 6; j++) { /* Noll 4 to 9 */
        c.optics.zernike_waves.waves[j + 2] = sign[j] * rms_waves / sqrt(6.0);
    }
    return c;
}

/* A red star and a blue one. */
static const double b_minus_v[SOURCES] = {1.7, -0.25};

static void make_sources(const bst_camera *c, const bst_psf *psf, double electrons,
                         bst_scene_source *sources) {
    for (int i = 0; i < SOURCES; i++) {
        sources[i] = scene_star(c, 40.3 + 22.7 * i, 60.2 - 19.37 * i, electrons / (1 + i));
        bst_psf_colour(psf, bst_optics_star_spectrum_k(b_minus_v[i]), sources[i].colour);
    }
}

/* The PSF of the i-th source's spectrum alone. */
static bst_psf *own_psf(bst_ctx *ctx, bst_camera camera, int i) {
    double wavelength_m[WAVELENGTHS], photons[WAVELENGTHS];
    double kelvin = bst_optics_star_temperature_k(b_minus_v[i]);
    int count = (int)camera.optics.wavelengths, half = count / 2, rule = count > FEW;
    for (int k = 0; k < count; k++) {
        int at = k < half ? half - 1 - k : k - half;
        double u = k < half ? -place[rule][at] : place[rule][at];
        wavelength_m[k] = 1e-9 * (650.0 + 250.0 * u);
        photons[k] = weight[rule][at] * bst_optics_planck_photons(wavelength_m[k], kelvin);
    }
    const bst_psf_spectrum spectrum = {wavelength_m, photons, count};
    const bst_psf_inputs inputs = {.spectrum = &spectrum};
    bst_psf *psf;
    bst_assert_ok(ctx, bst_psf_create_from(ctx, &camera, &inputs, &psf));
    return psf;
}

/* Worst pixel in sigma on a background of 7 e-, and the error of the sum. */
typedef struct errors {
    double sigma, flux;
} errors;

static errors compare(const float *fast, const double *exact, const bst_camera *c) {
    errors e = {0};
    double a = 0.0, b = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        double d = fabs((double)fast[i] - 7.0 - exact[i]);
        e.sigma =
            fmax(e.sigma, d / sqrt(fmax(exact[i], 0.0) + 7.0 + c->read_noise_e * c->read_noise_e));
        a += (double)fast[i] - 7.0;
        b += exact[i];
    }
    e.flux = fabs(a / b - 1.0);
    return e;
}

/* Renders the sources; returns the predicted error. */
static double render(fixture *f, bst_renderer *r, const bst_los_track *track,
                     const bst_scene_source *sources, float *image) {
    bst_render_stats stats;
    bst_render_request q = {.window = {0, 0, WIDTH, HEIGHT},
                            .track = track,
                            .sources = sources,
                            .count = SOURCES,
                            .background_e = 7.0};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    bst_renderer_get_stats(r, &stats);
    return stats.predicted_sigma;
}

/* Renders the sources with a renderer of their own. */
static void render_anew(fixture *f, const bst_camera *c, const bst_los_track *track,
                        const bst_scene_source *sources, float *image) {
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, c, NULL, &r));
    (void)render(f, r, track, sources, image);
    bst_renderer_free(r);
}

/* Two images on grids of their own, each right to 3e-5 of the peak. */
static void assert_alike(const float *image, const float *expected) {
    float peak = 0.0F;
    for (int i = 0; i < PIXELS; i++) {
        peak = fmaxf(peak, expected[i]);
    }
    for (int i = 0; i < PIXELS; i++) {
        bst_assert_close(image[i], expected[i], 6e-5 * peak);
    }
}

static scene_track straight(const bst_camera *c, double travel_px) {
    scene_motion m = {.x_px = travel_px, .y_px = 0.4 * travel_px, .duration_s = 1.0, .samples = 2};
    return scene_track_make(c, &m);
}

/* The reference mixes as the renderer does: its image of both sources is the sum of those with
 * their own PSFs, `exact`. */
static void the_reference_mixes_too(fixture *f, const bst_camera *c, const bst_psf *psf,
                                    const bst_los_track *track, const bst_scene_source *sources,
                                    const double *exact) {
    static double mixed[PIXELS];
    memset(mixed, 0, sizeof mixed);
    bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, c, (bst_window){0, 0, WIDTH, HEIGHT},
                                                track, sources, SOURCES, 3e-8, mixed));
    double peak = 0.0, worst = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        peak = fmax(peak, exact[i]);
        worst = fmax(worst, fabs(mixed[i] - exact[i]));
    }
    print_message("         the reference is off by %.1e of the peak\n", worst / peak);
    assert_true(worst < bst_psf_mixing_error(psf) * peak);
}

/* The first case is the short form: each PSF of a field takes a quarter of a second. The last
 * one's optics exceed the pixels' resolution, and its reference image takes longest. */
enum { CASES = 4 };
static int most_cases = 1;

/* Stars that fill the well and more, at rest and as streaks: no more wrong than others are, and by
 * less than is predicted, with the error of mixing in both. As sunlight they would be wrong by many
 * sigma. A field of two like nodes is the same PSF all over, in each spectrum. */
static void stars_have_the_psf_of_their_spectrum(void **state) {
    fixture *f = *state;
    static float image[PIXELS], sunlight[PIXELS];
    static double exact[PIXELS];
    const struct {
        double q, waves, electrons, travel_px;
        int columns;
    } cases[CASES] = {{3.4, 0.07, 3e5, 5.0, 2},
                      {3.4, 0.07, 3e5, 0.0, 1},
                      {3.4, 0.0, 3e6, 17.0, 1},
                      {1.7, 0.07, 3e5, 0.0, 1}};
    for (size_t k = 0; k < (size_t)most_cases; k++) {
        bst_camera c = broad_camera(cases[k].q, cases[k].waves);
        scene_track track = straight(&c, cases[k].travel_px);
        bst_scene_source sources[SOURCES];
        bst_renderer *r;
        bst_psf *psf;
        c.optics.field_columns = cases[k].columns;
        bst_assert_ok(&f->ctx, bst_psf_create(&f->ctx, &c, &psf));
        make_sources(&c, psf, cases[k].electrons, sources);
        c.optics.field_columns = 1;
        memset(exact, 0, sizeof exact);
        for (int i = 0; i < SOURCES; i++) {
            bst_psf *own = own_psf(&f->ctx, c, i);
            bst_assert_ok(&f->ctx, bst_reference_render_psf(
                                       &f->ctx, &c, own, (bst_window){0, 0, WIDTH, HEIGHT},
                                       &track.track, &sources[i], 1, 3e-8, exact));
            bst_psf_free(own);
        }
        c.psf = psf;
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c, NULL, &r));
        double predicted = render(f, r, &track.track, sources, image);
        errors mixed = compare(image, exact, &c);
        if (k == 2) {
            the_reference_mixes_too(f, &c, psf, &track.track, sources, exact);
        }
        for (int i = 0; i < SOURCES; i++) {
            memset(sources[i].colour, 0, sizeof sources[i].colour);
        }
        (void)render(f, r, &track.track, sources, image);
        errors solar = compare(image, exact, &c);
        bst_renderer_free(r);
        print_message("         %.4f sigma, predicted %.4f, flux %.1e; as sunlight %.1f sigma\n",
                      mixed.sigma, predicted, mixed.flux, solar.sigma);
        assert_true(mixed.sigma < 0.05); /* the renderer's tolerance */
        assert_true(mixed.sigma < predicted);
        assert_true(mixed.flux < 1e-5); /* far wings too: float sums and the grid's error */
        assert_true(solar.sigma > 5.0);
        /* light of the Sun's colour is what it is with the solar spectrum */
        c.psf = NULL;
        c.optics.spectrum = BST_SPECTRUM_SOLAR;
        render_anew(f, &c, &track.track, sources, sunlight);
        assert_alike(image, sunlight);
        bst_psf_free(psf);
        scene_track_free(&track);
    }
}

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "slow") == 0) {
        most_cases = CASES;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_have_the_psf_of_their_spectrum),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
