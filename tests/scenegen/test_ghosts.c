/* Ghosts on their way through the renderer, against closed forms in double precision. */
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/optics/ghosts.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { W = 160, H = 128 };
#define RATE 4e5 /* electrons per second of a star */

static bst_ghost opposite(const bst_camera *camera) {
    return (bst_ghost){.intensity = 1.0,
                       .factor = -1.0,
                       .centre_x_px = bst_camera_centre_x(camera),
                       .centre_y_px = bst_camera_centre_y(camera)};
}

/* A star's ghost of `electrons` in 1 s, from a star at (x, y) in the identity attitude. */
static bst_scene_source ghost_of(const bst_camera *camera, const bst_ghost *ghost, double x,
                                 double y, double electrons) {
    bst_scene_source s = scene_star(camera, x, y, electrons);
    s.kind = BST_SOURCE_STAR_GHOST;
    s.ghost = ghost;
    return s;
}

/* Renders one source without noise; *predicted: expected error, sigma. */
static void draw(fixture *f, const bst_camera *camera, const scene_motion *motion,
                 const bst_scene_source *source, bst_window w, float *image, double *predicted) {
    scene_track track = scene_track_make(camera, motion);
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, camera, NULL, &r));
    bst_render_request q = {
        .window = w, .track = &track.track, .sources = source, .count = 1, .background_e = 20.0};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    *predicted = stats.predicted_sigma;
    bst_renderer_free(r);
    scene_track_free(&track);
}

static const scene_motion still = {.duration_s = 1.0, .samples = 2, .seed = 1};

/* Light of a Gaussian about `at` in pixel i, on one axis. */
static double pixel_share(double at, int i, double sigma) {
    double a = (i - 0.5 - at) / (sigma * sqrt(2.0)), b = (i + 0.5 - at) / (sigma * sqrt(2.0));
    return 0.5 * (erf(b) - erf(a));
}

/* Compares an image with `want`, electrons without the background of 20 e. Tolerance: 0.05 sigma of
 * each pixel, the renderer's own; the prediction is no less than the measured error. */
static void expect_image(const float *image, const double *want, bst_window w, double predicted) {
    double worst = 0.0, sum = 0.0, wanted = 0.0;
    for (int i = 0; i < w.width * w.height; i++) {
        double sigma = sqrt(20.0 + want[i] + 64.0);
        worst = fmax(worst, fabs((double)image[i] - 20.0 - want[i]) / sigma);
        sum += (double)image[i] - 20.0;
        wanted += want[i];
    }
    assert_true(worst <= 0.05);
    assert_true(worst <= predicted);
    /* all light: rounding of floats in the sum of W x H pixels of 20 e, and what a stamp cuts */
    bst_assert_close(sum, wanted, 1e-4 * wanted + 0.5);
}

/* A point: the image of a star at the opposite place. A Gaussian: one of the sum of variances. */
static void points_and_gaussians_are_gaussians(void **state) {
    fixture *f = *state;
    static float image[W * H];
    static double want[W * H];
    bst_camera camera = scene_camera(W, H);
    const bst_window all = {0, 0, W, H};
    const double blurs[] = {0.0, 0.5, 3.0, 9.0};
    for (int k = 0; k < 4; k++) {
        bst_ghost ghost = opposite(&camera);
        ghost.sigma_px = blurs[k];
        bst_scene_source s = ghost_of(&camera, &ghost, 60.3, 71.6, RATE);
        double predicted, sigma = hypot(bst_camera_psf_sigma_px(&camera), blurs[k]);
        draw(f, &camera, &still, &s, all, image, &predicted);
        double x = W - 1 - 60.3, y = H - 1 - 71.6;
        for (int i = 0; i < W * H; i++) {
            want[i] = RATE * pixel_share(x, i % W, sigma) * pixel_share(y, i / W, sigma);
        }
        expect_image(image, want, all, predicted);
    }
}

/* Adds a ring of light about (x, y) that the PSF blurs: Gaussians of equal light at the middles of
 * RINGS x SPOKES parts of equal area. */
static void add_ring(double x, double y, double r, double hole, double sigma, double light,
                     double *want) {
    enum { RINGS = 200, SPOKES = 160, REACH = 6, SIDE = 2 * REACH + 1 };
    for (int n = 0; n < RINGS * SPOKES; n++) {
        double u = (n / SPOKES + 0.5) / RINGS, a = 2.0 * BST_PI * (n % SPOKES + 0.5 * u) / SPOKES;
        double d = sqrt(hole * hole + u * (r * r - hole * hole)), sx[SIDE], sy[SIDE];
        double gx = x + d * cos(a), gy = y + d * sin(a);
        int ix = (int)lrint(gx) - REACH, iy = (int)lrint(gy) - REACH;
        for (int k = 0; k < SIDE; k++) {
            sx[k] = pixel_share(gx, ix + k, sigma);
            sy[k] = pixel_share(gy, iy + k, sigma) * light / (RINGS * SPOKES);
        }
        for (int b = 0; b < SIDE; b++) {
            for (int c = 0; c < SIDE; c++) { /* far from the sensor's edges */
                want[(iy + b) * W + ix + c] += sx[c] * sy[b];
            }
        }
    }
}

/* A disc and a ring: even light inside, edges as wide as the PSF. */
static void pupils_out_of_focus_are_rings(void **state) {
    fixture *f = *state;
    static float image[W * H];
    static double want[W * H];
    bst_camera camera = scene_camera(W, H);
    const bst_window all = {0, 0, W, H};
    const double shapes[][2] = {{1.5, 0.0}, {6.0, 0.0}, {14.0, 5.0}};
    for (int k = 0; k < 3; k++) {
        double r = shapes[k][0], hole = shapes[k][1], predicted;
        bst_ghost ghost = opposite(&camera);
        ghost.radius_px = r;
        ghost.inner_radius_px = hole;
        bst_scene_source s = ghost_of(&camera, &ghost, 60.3, 71.6, 0.25 * RATE);
        draw(f, &camera, &still, &s, all, image, &predicted);
        memset(want, 0, sizeof want);
        add_ring(W - 1 - 60.3, H - 1 - 71.6, r, hole, bst_camera_psf_sigma_px(&camera), 0.25 * RATE,
                 want);
        expect_image(image, want, all, predicted);
        if (k ==
            2) { /* the inside: the light over the area, 1e-3 by the PSF's wings and the cells */
            double middle = (double)image[56 * W + 99 + 9] - 20.0;
            double even = 0.25 * RATE / (BST_PI * (r * r - hole * hole));
            bst_assert_close(middle, even, 2e-3 * even);
        }
    }
}

/* A ghost moves by its factor times the motion of its star, jitter included: the reference image,
 * which places the source at each instant. */
static void streaks_are_mapped(void **state) {
    fixture *f = *state;
    static float image[W * H], part[W * H];
    static double want[W * H];
    const scene_motion slew = {.x_px = 22.0,
                               .y_px = -9.0,
                               .bend_px = 2.0,
                               .roll_rad = 0.01,
                               .jitter_px = 0.3,
                               .duration_s = 1.0,
                               .samples = 101,
                               .seed = 5};
    for (int lens = 0; lens < 2; lens++) {
        bst_camera camera = scene_camera(W, H);
        if (lens) { /* rotated and distorted: the map is one of pixels all the same */
            camera.rotation_deg = 30.0;
            camera.distortion.k1 = -40.0;
            bst_assert_ok(&f->ctx, bst_camera_prepare(&f->ctx, &camera));
        }
        scene_track track = scene_track_make(&camera, &slew);
        const double factors[] = {-1.0, 0.6, 1.7};
        for (int k = 0; k < 3; k++) {
            bst_ghost ghost = opposite(&camera);
            ghost.factor = factors[k];
            bst_scene_source s = ghost_of(&camera, &ghost, 66.0, 75.0, RATE);
            double predicted;
            const bst_window all = {0, 0, W, H}, w = {40, 37, 71, 50};
            draw(f, &camera, &slew, &s, all, image, &predicted);
            memset(want, 0, sizeof want);
            bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, &camera, all, &track.track, &s, 1,
                                                        1e-7, want));
            expect_image(image, want, all, predicted);
            draw(f, &camera, &slew, &s, w, part, &predicted);
            for (int i = 0; i < w.width * w.height; i++) { /* any window: the same bytes */
                int at = (w.y0 + i / w.width) * W + w.x0 + i % w.width;
                assert_true(part[i] == image[at]);
            }
        }
        scene_track_free(&track);
    }
}

/* Binned frames hold the same light, and noise is drawn about it. */
static void binned_frames_hold_it(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(W, H);
    camera.read_noise_e = 2.0;
    bst_ghost ghost = opposite(&camera);
    ghost.radius_px = 8.0;
    bst_scene_source s = ghost_of(&camera, &ghost, 60.0, 70.0, 1e5);
    scene_track track = scene_track_make(&camera, &still);
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r));
    for (int b = 1; b <= 2; b++) {
        bst_render_request q = {.window = {10, 20, 140, 100},
                                .track = &track.track,
                                .sources = &s,
                                .count = 1,
                                .background_e = 3.0,
                                .binning = b,
                                .key = {{17, 23}},
                                .exposure_id = 5};
        bst_frame *frame;
        const uint16_t *pixels;
        bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frame));
        bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
        int width = 140 / b, height = 100 / b;
        double sum = 0.0, x = 0.0, y = 0.0;
        for (int i = 0; i < width * height; i++) {
            double e = (pixels[i] - camera.offset_dn) * camera.gain_e_per_dn - 3.0 * b * b;
            sum += e;
            x += e * (i % width);
            y += e * (i / width);
        }
        bst_frame_unmap(frame);
        bst_frame_release(frame);
        double noise = sqrt(1e5 + 14000.0 * (3.0 + 4.0 / (b * b) + 1.0 / (12.0 * b * b)));
        bst_assert_close(sum, 1e5, 4.5 * noise);
        /* its place: reflected; the noise of each pixel has a lever of up to 70 px */
        bst_assert_close(b * (x / sum + 0.5) - 0.5 + 10.0, W - 1 - 60.0, 4.5 * 45.0 * noise / 1e5);
        bst_assert_close(b * (y / sum + 0.5) - 0.5 + 20.0, H - 1 - 70.0, 4.5 * 35.0 * noise / 1e5);
    }
    bst_renderer_free(r);
    scene_track_free(&track);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_and_gaussians_are_gaussians),
        cmocka_unit_test(pupils_out_of_focus_are_rings),
        cmocka_unit_test(streaks_are_mapped),
        cmocka_unit_test(binned_frames_hold_it),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
