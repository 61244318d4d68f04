#include <pthread.h>

#include "scenegen/fourier/fourier_render.h"
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/core/fft.h"
#include "sim/optics/psf.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

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
    bst_fft_complex_f64 *folded = bst_fft_array(sizeof *folded * (size_t)period * (size_t)period);
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
        for (int j = last; j < n; j++) { /* the other half is its conjugate */
            double *row = sum + 2 * (size_t)j * (size_t)n, a = py[2 * j], b = py[2 * j + 1];
            for (int i = 0; i < n; i++) {
                row[2 * i] += a * px[2 * i] - b * px[2 * i + 1];
                row[2 * i + 1] += a * px[2 * i + 1] + b * px[2 * i];
            }
        }
    }
    for (int j = last; j < n; j++) {
        for (int i = 0; i < n; i++) {
            double twice = j > last ? 2.0 : 1.0, otf[2], fx = (double)(i - last) / period,
                   fy = (double)(j - last) / period;
            bst_psf_otf(psf, 0, fx, fy, otf);
            const double *v = sum + 2 * ((size_t)j * (size_t)n + (size_t)i);
            int x = ((i - last) % period + period) % period;
            int y = ((j - last) % period + period) % period;
            double *to = folded[(size_t)y * (size_t)period + (size_t)x];
            to[0] += twice * (v[0] * otf[0] - v[1] * otf[1]);
            to[1] += twice * (v[0] * otf[1] + v[1] * otf[0]);
        }
    }
    bst_fft *inverse;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_fft_create_f64(&ctx, BST_FFT_INVERSE, period, period, *folded, *folded,
                                           &inverse));
    bst_fft_run(inverse);
    bst_fft_free(inverse);
    for (int y = 0; y < w.height; y++) {
        for (int x = 0; x < w.width; x++) {
            image[y * w.width + x] =
                folded[(size_t)y * (size_t)period + (size_t)x][0] / ((double)period * period);
        }
    }
    bst_fft_array_free(folded);
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
    c.optics.wavelengths = 1;
    aberrate(&c);
    return c;
}

static bst_camera moffat(int width, int height, double fwhm) {
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
static errors run(fixture *f, const bst_camera *c, bst_window w, const bst_scene_source *stars,
                  int count, double travel_px, int period) {
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
        bst_scene_source stars[5];
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
    static const double qs[2] = {1.0, 2.0};
    for (int k = 0; k < 2; k++) {
        bst_camera c = diffraction(128, 96, qs[k]);
        bst_scene_source stars[2] = {scene_star(&c, 60.3, 40.2, 1e6),
                                     scene_star(&c, 70.8, 60.1, 1e4)};
        errors e = run(f, &c, whole(&c), stars, 2, 14.0, 512);
        assert_true(e.sigma < 0.1);
        assert_true(e.flux < 1e-4);
    }
}

/* The fewest nodes and no stamp: all of the light is there. */
static void faint_streaks_keep_their_light(void **state) {
    fixture *f = *state;
    bst_camera c = moffat(96, 80, 2.0);
    bst_scene_source star = scene_star(&c, 47.3, 40.1, 1e3);
    errors e = run(f, &c, whole(&c), &star, 1, 20.0, 256);
    assert_true(e.sigma < 0.05);
    assert_true(e.flux < 1e-4);
}

/* A Moffat PSF, whose wings are the widest; stars on the corner's edge and outside the frame. */
static void stars_at_and_beyond_the_border(void **state) {
    fixture *f = *state;
    bst_camera c = moffat(96, 80, 2.2);
    bst_scene_source stars[4] = {scene_star(&c, -0.3, -0.4, 5e4), scene_star(&c, 110.2, 40.3, 1e5),
                                 scene_star(&c, 50.1, -6.2, 2e4), scene_star(&c, 95.5, 79.5, 3e4)};
    errors e = run(f, &c, whole(&c), stars, 4, 0.0, 320);
    assert_true(e.sigma < 0.05);
    assert_true(e.flux < 1e-4);
}

/* A seeing disc of 40 px, whose OTF ends long before the pixels' band does. */
static void wide_seeing(void **state) {
    fixture *f = *state;
    bst_camera c = moffat(128, 96, 40.0);
    bst_scene_source star = scene_star(&c, 60.2, 44.7, 1e7);
    assert_true(run(f, &c, whole(&c), &star, 1, 0.0, 1024).sigma < 0.05);
}

static void render(fixture *f, bst_renderer *r, bst_window w, const bst_los_track *track,
                   const bst_scene_source *stars, int count, float *image) {
    bst_render_request q = {
        .window = w, .track = track, .sources = stars, .count = count, .background_e = 7.0};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
}

enum { WIDTH = 96, HEIGHT = 80, STARS = 6 };

static void some_stars(const bst_camera *c, bst_scene_source *stars) {
    for (int i = 0; i < STARS; i++) {
        stars[i] = scene_star(c, 8.3 + 15.7 * i, 70.1 - 11.3 * i, 4e4 / (1 + i));
    }
}

/* Windows have grids of their own, so their images differ by the grids' errors: below 3e-5 of the
 * brightest star's peak, itself below half of its light. */
static void windows_show_the_same_light(void **state) {
    fixture *f = *state;
    bst_camera c = moffat(WIDTH, HEIGHT, 1.5);
    bst_renderer *r;
    bst_scene_source stars[STARS];
    float image[WIDTH * HEIGHT], part[WIDTH * HEIGHT];
    some_stars(&c, stars);
    scene_track track = straight(&c, 9.0);
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c, NULL, &r));
    render(f, r, whole(&c), &track.track, stars, STARS, image);
    /* more sizes than are kept ready; the last ones share one side with the one before */
    const bst_window windows[9] = {{8, 70, 1, 1},    {95, 0, 1, 1},    {0, 0, 17, 9},
                                   {60, 11, 33, 40}, {5, 3, 91, 77},   {0, 79, 96, 1},
                                   {40, 30, 24, 24}, {40, 30, 24, 41}, {40, 30, 11, 24}};
    for (int k = 0; k < 9; k++) {
        bst_window w = windows[k];
        render(f, r, w, &track.track, stars, STARS, part);
        for (int y = 0; y < w.height; y++) {
            for (int x = 0; x < w.width; x++) {
                float full = image[(w.y0 + y) * WIDTH + w.x0 + x];
                bst_assert_close(part[y * w.width + x], full, 3e-5 * 2e4 + 1e-6 * full);
            }
        }
    }
    scene_track_free(&track);
    bst_renderer_free(r);
}

static void no_source_leaves_the_background(void **state) {
    fixture *f = *state;
    bst_camera c = moffat(33, 17, 2.0);
    bst_renderer *r;
    float image[33 * 17];
    scene_track track = straight(&c, 0.0);
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c, NULL, &r));
    render(f, r, whole(&c), &track.track, NULL, 0, image);
    for (int i = 0; i < 33 * 17; i++) {
        assert_true(image[i] == 7.0f); /* not even rounding */
    }
    scene_track_free(&track);
    bst_renderer_free(r);
}

/* What one simulation of several does. */
typedef struct job {
    int threads;
    float image[WIDTH * HEIGHT];
} job;

static void *simulate(void *user) {
    job *j = user;
    fixture f = {0};
    bst_renderer *r;
    bst_camera c = moffat(WIDTH, HEIGHT, 1.5);
    bst_scene_source stars[STARS];
    some_stars(&c, stars);
    scene_track track = straight(&c, 9.0);
    bst_assert_ok(&f.ctx, bst_device_open(&f.ctx, "", j->threads, &f.device));
    bst_assert_ok(&f.ctx, bst_renderer_create(&f.ctx, f.device, &c, NULL, &r));
    render(&f, r, whole(&c), &track.track, stars, STARS, j->image);
    scene_track_free(&track);
    bst_renderer_free(r);
    bst_device_close(f.device);
    return NULL;
}

static void same_bytes_with_any_number_of_threads(void **state) {
    (void)state;
    static job jobs[2] = {{.threads = 1}, {.threads = 2}};
    simulate(&jobs[0]);
    simulate(&jobs[1]);
    assert_memory_equal(jobs[0].image, jobs[1].image, sizeof jobs[0].image);
}

static void simulations_side_by_side_agree(void **state) {
    (void)state;
    static job jobs[3] = {{.threads = 1}, {.threads = 1}, {.threads = 1}};
    simulate(&jobs[2]);
    pthread_t threads[2];
    for (int k = 0; k < 2; k++) {
        assert_int_equal(pthread_create(&threads[k], NULL, simulate, &jobs[k]), 0);
    }
    for (int k = 0; k < 2; k++) {
        pthread_join(threads[k], NULL);
        assert_memory_equal(jobs[k].image, jobs[2].image, sizeof jobs[k].image);
    }
}

/* Share of a Gaussian's light on pixel (x, y), centred at (x0, y0). */
static double gaussian(double fwhm, double x0, double y0, int x, int y) {
    double sigma = fwhm / 2.3548200450309493;
    return bst_reference_pixel_share(x0, sigma, x) * bst_reference_pixel_share(y0, sigma, y);
}

/* Two Gaussians at the left and right ends of the field: a star at either end has that one, a star
 * between them the mean. */
static void fields_mix_their_nodes(void **state) {
    fixture *f = *state;
    bst_psf_field_node nodes[2] = {{.psf_fwhm_px = 2.0}, {.psf_fwhm_px = 3.0}};
    bst_camera c = scene_camera(81, 40);
    c.optics.field_columns = 2;
    c.optics.field_rows = 1;
    c.optics.field = (bst_config_list){.items = nodes, .count = 2};
    bst_renderer *r;
    float image[81 * 40];
    bst_scene_source stars[3] = {scene_star(&c, 0.0, 20.3, 3e4), scene_star(&c, 40.0, 20.0, 3e4),
                                 scene_star(&c, 80.0, 19.6, 3e4)};
    scene_track track = straight(&c, 0.0);
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c, NULL, &r));
    render(f, r, whole(&c), &track.track, stars, 3, image);
    for (int y = 0; y < 40; y++) {
        for (int x = 0; x < 81; x++) {
            double exact =
                gaussian(2.0, 0.0, 20.3, x, y) + gaussian(3.0, 80.0, 19.6, x, y) +
                0.5 * (gaussian(2.0, 40.0, 20.0, x, y) + gaussian(3.0, 40.0, 20.0, x, y));
            /* 0.05 sigma of a dark pixel */
            bst_assert_close(image[y * 81 + x], 7.0 + 3e4 * exact, 0.4);
        }
    }
    scene_track_free(&track);
    bst_renderer_free(r);
}

/* Jitter of 0.4 px that nodes do not follow but are widened for. */
static void jitter_widens_nodes(void **state) {
    fixture *f = *state;
    bst_camera c = moffat(64, 48, 2.0);
    scene_motion motion = {
        .x_px = 12.0, .y_px = 5.0, .jitter_px = 0.4, .duration_s = 0.5, .samples = 201, .seed = 5};
    scene_track track = scene_track_make(&c, &motion);
    bst_renderer *r;
    bst_scene_source star = scene_star(&c, 31.3, 22.8, 4e5);
    float image[64 * 48];
    static double exact[64 * 48];
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c, NULL, &r));
    render(f, r, whole(&c), &track.track, &star, 1, image);
    bst_assert_ok(
        &f->ctx, bst_reference_render(&f->ctx, &c, whole(&c), &track.track, &star, 1, 1e-7, exact));
    for (int i = 0; i < 64 * 48; i++) {
        image[i] -= 7.0f;
    }
    errors e = compare(image, exact, 64 * 48);
    print_message("         %.4f sigma\n", e.sigma);
    assert_true(e.sigma < 0.05);
    scene_track_free(&track);
    bst_renderer_free(r);
}

/* The finer grid is 64 times as accurate in all its parts, aliases and frequencies beyond the
 * cut-off; less is asked for, because the sizes of grids go by steps of 16. */
static void the_finer_grid_is_finer(void **state) {
    fixture *f = *state;
    bst_camera cameras[3] = {diffraction(128, 96, 1.0), diffraction(128, 96, 2.0),
                             moffat(128, 96, 2.0)};
    for (int k = 0; k < 3; k++) {
        const bst_camera *c = &cameras[k];
        bst_psf *psf;
        bst_fourier_render *l;
        bst_fourier_render_options options = bst_fourier_render_default_options();
        options.tolerance = 1e-4;
        bst_assert_ok(&f->ctx, bst_psf_create(&f->ctx, c, &psf));
        bst_assert_ok(&f->ctx, bst_fourier_render_create(&f->ctx, f->device, c, psf, &options, &l));
        double sigma[2];
        const bst_fourier_point point = {.peak_e = 1e5, .dark_variance_e2 = 100.0};
        for (int fine = 0; fine < 2; fine++) {
            sigma[fine] =
                bst_fourier_render_error_sigma(l, fine != 0, (bst_window){0, 0, 48, 40}, &point);
        }
        assert_true(bst_fourier_render_density(l, true) > bst_fourier_render_density(l, false));
        print_message("         plain %.4f sigma, fine %.4f sigma\n", sigma[0], sigma[1]);
        assert_true(sigma[0] > 0.0 && sigma[1] < sigma[0] / 40.0);
        bst_fourier_render_free(l);
        bst_psf_free(psf);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_finer_grid_is_finer),
        cmocka_unit_test(static_stars_of_aberrated_optics),
        cmocka_unit_test(streaks_of_aberrated_optics),
        cmocka_unit_test(faint_streaks_keep_their_light),
        cmocka_unit_test(stars_at_and_beyond_the_border),
        cmocka_unit_test(wide_seeing),
        cmocka_unit_test(windows_show_the_same_light),
        cmocka_unit_test(no_source_leaves_the_background),
        cmocka_unit_test(same_bytes_with_any_number_of_threads),
        cmocka_unit_test(simulations_side_by_side_agree),
        cmocka_unit_test(fields_mix_their_nodes),
        cmocka_unit_test(jitter_widens_nodes),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
