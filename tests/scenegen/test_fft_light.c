#include <fftw3.h>

#include "scenegen/renderer.h"
#include "sim/world/psf.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
} fixture;

static int open_device(void **state) {
    static fixture f;
    *state = &f;
    return bst_device_open(&f.ctx, "", 0, &f.device) == BST_OK ? 0 : -1;
}

static int close_device(void **state) {
    bst_device_close(((fixture *)*state)->device);
    return 0;
}

/* ------------------------------------------------------------------ truth */

/* Light at a place: electrons at full-sensor px. */
typedef struct spot {
    double x, y, e;
} spot;

/* image[height][width] of spots through a PSF, in double precision: the Fourier series of a period
 * of `period` px, term by term, with nothing left out below the cut-off. What wraps around is the
 * light beyond period - width. */
static void exact_image(const bst_psf *psf, bst_window w, const spot *spots, int count, int period,
                        double *image) {
    int last = (int)ceil(bst_psf_cutoff(psf) * period), n = 2 * last + 1;
    fftw_complex *folded = fftw_malloc(sizeof *folded * (size_t)period * (size_t)period);
    double *sum = calloc((size_t)n * (size_t)n * 2, sizeof *sum);
    double *px = malloc((size_t)n * 2 * sizeof *px), *py = malloc((size_t)n * 2 * sizeof *py);
    memset(folded, 0, sizeof *folded * (size_t)period * (size_t)period);
    for (int s = 0; s < count; s++) {
        for (int k = 0; k < n; k++) {
            double a = -2.0 * BST_PI * (k - last) / period;
            px[2 * k] = cos(a * (spots[s].x - w.x0));
            px[2 * k + 1] = sin(a * (spots[s].x - w.x0));
            py[2 * k] = spots[s].e * cos(a * (spots[s].y - w.y0));
            py[2 * k + 1] = spots[s].e * sin(a * (spots[s].y - w.y0));
        }
        for (int j = 0; j < n; j++) {
            double *row = sum + 2 * (size_t)j * (size_t)n, a = py[2 * j], b = py[2 * j + 1];
            for (int i = 0; i < n; i++) {
                row[2 * i] += a * px[2 * i] - b * px[2 * i + 1];
                row[2 * i + 1] += a * px[2 * i + 1] + b * px[2 * i];
            }
        }
    }
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            double otf[2], fx = (double)(i - last) / period, fy = (double)(j - last) / period;
            bst_psf_otf(psf, 0, fx, fy, otf);
            const double *v = sum + 2 * ((size_t)j * (size_t)n + (size_t)i);
            int x = ((i - last) % period + period) % period;
            int y = ((j - last) % period + period) % period;
            fftw_complex *to = &folded[(size_t)y * (size_t)period + (size_t)x];
            (*to)[0] += v[0] * otf[0] - v[1] * otf[1];
            (*to)[1] += v[0] * otf[1] + v[1] * otf[0];
        }
    }
    fftw_plan plan = fftw_plan_dft_2d(period, period, folded, folded, FFTW_BACKWARD, FFTW_ESTIMATE);
    fftw_execute(plan);
    fftw_destroy_plan(plan);
    for (int y = 0; y < w.height; y++) {
        for (int x = 0; x < w.width; x++) {
            image[y * w.width + x] =
                folded[(size_t)y * (size_t)period + (size_t)x][0] / ((double)period * period);
        }
    }
    fftw_free(folded);
    free(sum);
    free(px);
    free(py);
}

/* ------------------------------------------------------------------ scenes */

static void aberrate(bst_camera *c) {
    static const double sign[6] = {1, -1, 1, 1, -1, 1};
    for (int j = 0; j < 6; j++) { /* Noll 4 to 9, together 0.07 waves RMS */
        c->optics.zernike_waves.waves[j + 2] = sign[j] * 0.07 / sqrt(6.0);
    }
}

static bst_camera diffraction(int width, int height, double q) {
    bst_camera c = scene_camera(width, height);
    c.optics.psf = BST_PSF_DIFFRACTION;
    c.optics.q = q;
    c.optics.central_obstruction = 0.35;
    aberrate(&c);
    return c;
}

__attribute__((unused)) static bst_camera moffat(int width, int height, double fwhm) {
    bst_camera c = scene_camera(width, height);
    c.optics.psf = BST_PSF_MOFFAT;
    c.optics.moffat_beta = 2.5;
    c.psf_fwhm_px = fwhm;
    return c;
}

static bst_window whole(const bst_camera *c) {
    return (bst_window){0, 0, (int)c->width_px, (int)c->height_px};
}

/* Worst error over the pixels in sigma (background 40 e-), and that of the sum. */
typedef struct errors {
    double sigma, peak, flux;
} errors;

static errors compare(const float *fast, const double *exact, size_t pixels) {
    errors e = {0};
    double a = 0.0, b = 0.0, top = 0.0;
    for (size_t i = 0; i < pixels; i++) {
        double d = fabs((double)fast[i] - exact[i]);
        e.sigma = fmax(e.sigma, d / sqrt(fmax(exact[i], 0.0) + 40.0 + 64.0));
        e.peak = fmax(e.peak, d);
        top = fmax(top, exact[i]);
        a += (double)fast[i];
        b += exact[i];
    }
    e.peak /= top;
    e.flux = fabs(a / b - 1.0);
    return e;
}

/* A straight, uniform streak of `travel_px` along (1, 0.4) for every star. */
static scene_track straight(const bst_camera *c, double travel_px) {
    scene_motion m = {.x_px = travel_px, .y_px = 0.4 * travel_px, .duration_s = 1.0, .samples = 2};
    return scene_track_make(c, &m);
}

/* Renders stars and the truth of them; spots along the track at Gauss-Legendre places. */
static errors run(fixture *f, const bst_camera *c, bst_window w, const bst_source *stars, int count,
                  double travel_px, int period) {
    static const double node[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813,
                                   0.93056815579702629};
    static const double weight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                     0.17392742256872693};
    bst_renderer *r;
    bst_psf *psf;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, c, NULL, &r));
    bst_assert_ok(&f->ctx, bst_psf_create(&f->ctx, c, &psf));
    scene_track track = straight(c, travel_px);
    bst_render_request q = {.window = w, .track = &track.track, .sources = stars, .count = count};
    size_t pixels = (size_t)w.width * (size_t)w.height;
    float *fast = malloc(pixels * sizeof *fast);
    double *exact = calloc(pixels, sizeof *exact);
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, fast));
    /* a place a px apart: four of Gauss' are exact to 1e-9 for a band of 1.5 cycles/px */
    int parts = travel_px > 0.0 ? (int)ceil(travel_px) : 1, n = 0;
    spot *spots = malloc((size_t)(4 * parts * count) * sizeof *spots);
    for (int s = 0; s < count; s++) {
        for (int k = 0; k < 4 * parts; k++) {
            double u = (k / 4 + node[k % 4]) / parts;
            bst_quat at = bst_quat_slerp(track.q[0], track.q[1], u);
            spots[n] = (spot){.e = stars[s].electrons_per_s * weight[k % 4] / parts};
            bst_camera_project(c, bst_quat_rotate(at, stars[s].apparent_mid), &spots[n].x,
                               &spots[n].y);
            n += travel_px > 0.0 || k == 3;
        }
        if (!(travel_px > 0.0)) {
            spots[n - 1].e = stars[s].electrons_per_s;
        }
    }
    exact_image(psf, w, spots, n, period, exact);
    errors e = compare(fast, exact, pixels);
    print_message("         %.4f sigma, %.1e of the peak, flux %.1e\n", e.sigma, e.peak, e.flux);
    free(spots);
    free(fast);
    free(exact);
    scene_track_free(&track);
    bst_psf_free(psf);
    bst_renderer_free(r);
    return e;
}

/* Stars at all sub-pixel phases, up to the full well: the worst pixel is right to 0.1 sigma. */
static void static_stars_of_aberrated_optics(void **state) {
    fixture *f = *state;
    static const double qs[5] = {0.7, 1.0, 1.5, 2.0, 3.0};
    for (int k = 0; k < 5; k++) {
        bst_camera c = diffraction(128, 96, qs[k]);
        bst_source stars[5];
        for (int i = 0; i < 5; i++) {
            stars[i] = scene_star(&c, 20.0 + 20.3 * i, 30.0 + 9.71 * i, 1e5 / (1 + i));
        }
        errors e = run(f, &c, whole(&c), stars, 5, 0.0, 640);
        assert_true(e.sigma < 0.1);
        assert_true(e.flux < 1e-4);
    }
}

static void streaks_of_aberrated_optics(void **state) {
    fixture *f = *state;
    static const double qs[3] = {0.7, 1.0, 2.0};
    for (int k = 0; k < 3; k++) {
        bst_camera c = diffraction(128, 96, qs[k]);
        bst_source stars[2] = {scene_star(&c, 60.3, 40.2, 1e6), scene_star(&c, 70.8, 60.1, 1e4)};
        errors e = run(f, &c, whole(&c), stars, 2, 40.0, 512);
        assert_true(e.sigma < 0.1);
        assert_true(e.flux < 1e-4);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(static_stars_of_aberrated_optics),
        cmocka_unit_test(streaks_of_aberrated_optics),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
