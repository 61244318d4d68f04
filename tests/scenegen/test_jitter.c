/* Jitter faster than the line of sight is sampled is in the image's width: the same jitter gives
 * the same mean width at every rate of the plant. */
#include <stdlib.h>

#include "gimbal/platform.h"
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/optics/psf.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 40 };

typedef struct width {
    double fast, reference; /* mean of both axes' variances, px^2, without PSF and pixel */
} width;

static double variance_of(const double *image) {
    double sum = 0.0, x = 0.0, y = 0.0, square = 0.0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        sum += image[k];
        x += image[k] * (k % SIDE);
        y += image[k] * (k / SIDE);
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        double dx = k % SIDE - x / sum, dy = k / SIDE - y / sum;
        square += image[k] * (dx * dx + dy * dy);
    }
    return 0.5 * square / sum;
}

/* Mean over exposures of a star on a platform that shakes by 0.7 px (radial) in the band. */
static width measure(bst_ctx *ctx, bst_device *device, double top_hz, double rate_hz) {
    enum { EXPOSURES = 4 };
    const double exposure_s = 0.5;
    bst_camera camera = scene_camera(SIDE, SIDE), blurred;
    camera.psf_fwhm_px = 4.0; /* test_fidelity.c has its kernel compiled too */
    bst_platform_config config = {.jitter_high_px_rms = 0.7, .jitter_high_band_hz = {20.0, top_hz}};
    bst_platform platform;
    bst_quat level = {0, 0, 0, 1};
    const bst_platform_setup setup = {.q_nominal_from_gcrf = level,
                                      .pixel_rad = bst_camera_scale_rad(&camera),
                                      .dt_s = 1.0 / rate_hz,
                                      .jitter_key = bst_rng_make_key(3, 0, "a", "jitter"),
                                      .attitude_key = bst_rng_make_key(3, 0, "a", "attitude")};
    bst_assert_ok(ctx, bst_platform_init(ctx, &platform, &config, &setup));
    double lack_px = sqrt(platform.unresolved_rad2) / bst_camera_scale_rad(&camera);
    bst_assert_ok(ctx, bst_psf_camera_blurred(ctx, &camera, lack_px, &blurred));
    bst_renderer *r;
    bst_assert_ok(ctx, bst_renderer_create(ctx, device, &blurred, NULL, &r));
    bst_scene_source star = scene_star(&camera, 19.3, 20.2, 1e6);
    int steps = (int)(exposure_s * rate_hz);
    scene_track t = {{steps + 1, NULL, NULL},
                     malloc((size_t)(steps + 1) * sizeof(double)),
                     malloc((size_t)(steps + 1) * sizeof(bst_quat))};
    t.track.time_s = t.time_s;
    t.track.q_cam_from_gcrf = t.q;
    width sum = {0.0, 0.0};
    for (int e = 0; e < EXPOSURES; e++) {
        for (int k = 0; k <= steps; k++) {
            t.time_s[k] = k / rate_hz;
            t.q[k] = bst_platform_true_camera(&platform, e * steps + k, t.time_s[k], level);
        }
        bst_render_request q = {
            .window = {0, 0, SIDE, SIDE}, .track = &t.track, .sources = &star, .count = 1};
        static float image[SIDE * SIDE];
        static double fast[SIDE * SIDE], reference[SIDE * SIDE];
        bst_assert_ok(ctx, bst_renderer_render_noise_free(ctx, r, &q, image));
        for (int k = 0; k < SIDE * SIDE; k++) {
            fast[k] = image[k];
            reference[k] = 0.0;
        }
        sum.fast += variance_of(fast) / EXPOSURES;
        if (rate_hz < 2000.0) { /* the reference takes each sample */
            bst_assert_ok(ctx, bst_reference_render(ctx, &blurred, q.window, &t.track, &star, 1,
                                                    1e-8, reference));
            sum.reference += variance_of(reference) / EXPOSURES;
        }
    }
    double sigma_px = bst_camera_psf_sigma_px(&camera), own = sigma_px * sigma_px + 1.0 / 12.0;
    sum.fast -= own;
    sum.reference -= own;
    scene_track_free(&t);
    bst_renderer_free(r);
    bst_psf_free((bst_psf *)blurred.psf);
    return sum;
}

static void the_plants_rate_does_not_matter(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    /* 0.7 px radial: 0.245 px^2 per axis. Of 32 lines per axis, over 2 s, cross terms are some 1 to
     * 3 %; where lines are drawn in another band at another rate they differ by as much again. */
    const double expected = 0.245, some = 0.05 * expected;
    const double tops_hz[] = {300.0, 2000.0};
    for (int i = 0; i < 2; i++) {
        width slow = measure(&ctx, device, tops_hz[i], 1000.0);
        width fast = measure(&ctx, device, tops_hz[i], 10000.0);
        print_message("20 to %.0f Hz: variance at 1 kHz %.5f (reference %.5f), at 10 kHz %.5f\n",
                      tops_hz[i], slow.fast, slow.reference, fast.fast);
        bst_assert_close(slow.fast, expected, some);
        bst_assert_close(fast.fast, expected, some);
        /* the renderer's own error of the width at its default tolerance */
        bst_assert_close(slow.fast, slow.reference, 1e-3);
        if (i == 0) { /* the same lines at both rates */
            bst_assert_close(slow.fast, fast.fast, 0.01 * expected);
        }
    }
    bst_device_close(device);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_plants_rate_does_not_matter)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
