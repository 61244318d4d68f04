/* Radiation hits against their closed forms, and frames with every effect at once. */
#include "scenegen/detector/cosmic_rays.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SIDE = 512 };

static const bst_detector_cosmic_ray_config example = {.rate_per_cm2_s = 5.0,
                                                       .pixel_pitch_um = 13.0,
                                                       .depth_um = 15.0,
                                                       .e_per_um = 75.0,
                                                       .straggling = 0.15};

/* Number: Poisson of rate, area and time. Charge: e_per_um times the mean path 2 depth (the density
 * 2 mu of the cosine and the length depth / mu) times the mean 1 + straggling (gamma + ln 2) of a
 * Moyal law. */
static void hits_have_their_rate_and_charge(void **state) {
    (void)state;
    enum { EXPOSURES = 4000 };
    bst_ctx ctx = {0};
    bst_cosmic_rays *hits;
    bst_detector_cosmic_ray_config c = example;
    c.straggling = 0.02; /* so that nothing is cut at 0 */
    bst_assert_ok(&ctx, bst_cosmic_rays_create(&ctx, &c, SIDE, SIDE, SIDE, &hits));
    double tracks = 0.0, tracks2 = 0.0, sum = 0.0;
    for (int k = 0; k < EXPOSURES; k++) {
        const bst_cosmic_rays_pixel *pixels;
        bst_cosmic_rays_summary s;
        bst_assert_ok(&ctx,
                      bst_cosmic_rays_draw(&ctx, hits, (bst_rng_key){{1, 2}}, k, 2.0, &pixels, &s));
        double total = 0.0;
        for (int i = 0; i < s.pixels; i++) {
            assert_in_range(pixels[i].index, 0, SIDE * SIDE - 1);
            assert_true(i == 0 || pixels[i].index > pixels[i - 1].index);
            assert_true(pixels[i].electrons > 0.0f);
            total += (double)pixels[i].electrons;
        }
        bst_assert_close(total, s.electrons, 1e-5 * (s.electrons + 1.0)); /* float sums */
        tracks += s.tracks;
        tracks2 += (double)s.tracks * s.tracks;
        sum += s.electrons;
    }
    double area = SIDE * SIDE * 13.0e-4 * 13.0e-4, entered = EXPOSURES * 5.0 * 2.0 * area;
    /* what comes in beside the sensor replaces what leaves it: mean charge per track that enters.
     * The path's mean square diverges logarithmically and is cut by the sensor: at most 40 depths^2
     */
    double mean = 75.0 * 2.0 * 15.0 * (1.0 + 0.02 * (0.5772 + log(2.0)));
    bst_assert_close(sum / entered, mean, 4.0 * 75.0 * 15.0 * sqrt(40.0 / entered) + 0.005 * mean);
    /* tracks that touch the sensor: those that enter, and a rim about as wide as a mean track */
    assert_true(tracks > entered - 4.0 * sqrt(entered));
    assert_true(tracks < entered * (1.0 + 4.0 * 4.0 / SIDE) + 4.0 * sqrt(entered));
    /* variance over mean of a Poisson number, of n exposures: standard deviation sqrt(2 / n) */
    double m = tracks / EXPOSURES, var = tracks2 / EXPOSURES - m * m;
    bst_assert_close(var / m, 1.0, 4.0 * sqrt(2.0 / EXPOSURES) + 4.0 / sqrt(tracks));
    bst_cosmic_rays_free(hits);
}

static void too_many_hits_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_cosmic_rays *hits;
    const bst_cosmic_rays_pixel *pixels;
    bst_cosmic_rays_summary s;
    bst_assert_ok(&ctx, bst_cosmic_rays_create(&ctx, &example, SIDE, SIDE, SIDE, &hits));
    assert_int_equal(bst_cosmic_rays_draw(&ctx, hits, (bst_rng_key){{1, 2}}, 0, 1e7, &pixels, &s),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "rate_per_cm2_s"));
    bst_cosmic_rays_free(hits);
}

static void take(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q, uint16_t *out) {
    bst_frame *frame;
    const uint16_t *pixels;
    bst_assert_ok(ctx, bst_renderer_render(ctx, r, q, &frame));
    bst_assert_ok(ctx, bst_frame_map(frame, ctx, &pixels));
    memcpy(out, pixels, (size_t)(frame->width * frame->height) * sizeof *out);
    bst_frame_unmap(frame);
    bst_frame_release(frame);
}

/* The charge of the hits is in the frame, and gone from the next one. */
static void frames_hold_the_hits_of_their_exposure(void **state) {
    (void)state;
    enum { W = 200, H = 300 };
    static uint16_t dn[W * H];
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    bst_camera camera = scene_camera(W, H);
    camera.detector.cosmic_rays = example;
    camera.detector.cosmic_rays.rate_per_cm2_s = 2000.0;
    bst_renderer_options options = bst_renderer_default_options();
    options.shared_program = true; /* compiled for test_detector.c too */
    bst_renderer *r;
    bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, &options, &r));
    double time_s[2] = {0.0, 1.0};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    for (int k = 0; k < 6; k++) {
        bst_render_request request = {
            .window = {0, 0, W, H}, .track = &track, .key = {{5, 6}}, .exposure_id = k};
        take(&ctx, r, &request, dn);
        double sum = 0.0;
        for (int i = 0; i < W * H; i++) {
            sum += dn[i] - 100.0;
        }
        bst_render_stats stats;
        bst_renderer_get_stats(r, &stats);
        assert_in_range(stats.hits, 100, 500); /* 203 expected */
        bst_assert_close(sum, stats.hits_e, 4.0 * sqrt(W * H * (64.0 + 1.0 / 12.0)));
    }
    bst_renderer_free(r);
    bst_device_close(device);
}

/* With every effect on, a window has the bytes that the whole frame has there. */
static void windows_agree_with_every_effect(void **state) {
    (void)state;
    enum { W = 300, H = 200 };
    static uint16_t full[W * H], other[W * H];
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    bst_scene_source *stars = NULL;
    double time_s[2] = {0.0, 0.5};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    for (int stage = 0; stage < 2; stage++) { /* in the tile, and in stages */
        bst_camera camera = scene_camera(W, H);
        camera.dark_current_e_per_s = 20.0;
        camera.detector = (bst_detector_config){.prnu_rms = 0.02,
                                                .dsnu_rms = 0.2,
                                                .dark_doubling_k = 6.5,
                                                .hot_fraction = 0.01,
                                                .hot_median_e_per_s = 5000.0,
                                                .hot_spread_dex = 0.5,
                                                .dead_fraction = 0.001,
                                                .bad_columns = 2,
                                                .column_offset_rms_e = 3.0,
                                                .row_offset_rms_e = 3.0,
                                                .row_noise_e = 2.0,
                                                .telegraph_noise_fraction = 0.02,
                                                .telegraph_noise_rms_e = 20.0,
                                                .nonlinearity = {-0.02, 0.0, 0.0},
                                                .cosmic_rays = example};
        camera.detector.cosmic_rays.rate_per_cm2_s = 50.0;
        if (stage == 1) {
            camera.full_well_e = 20000.0;
            camera.detector.saturation = BST_WELL_BLOOM;
            camera.detector.frame_transfer_s = 0.01;
        }
        stars = scene_stars(&camera, 100, 2e6, 6.0, 4);
        bst_render_request request = {.window = {0, 0, W, H},
                                      .track = &track,
                                      .sources = stars,
                                      .count = 100,
                                      .background_e = 25.0,
                                      .dark_e = 10.0,
                                      .key = {{17, 23}},
                                      .exposure_id = 9};
        bst_renderer *r;
        bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, NULL, &r));
        take(&ctx, r, &request, full);
        const bst_window windows[] = {{37, 51, 101, 67}, {13, 0, 16, 200}, {299, 199, 1, 1}};
        for (size_t i = 0; i < sizeof windows / sizeof *windows; i++) {
            bst_window w = windows[i];
            request.window = w;
            take(&ctx, r, &request, other);
            for (int y = 0; y < w.height; y++) {
                assert_memory_equal(&other[y * w.width], &full[(y + w.y0) * W + w.x0],
                                    (size_t)w.width * sizeof *full);
            }
        }
        bst_renderer_free(r);
        if (stage ==
            0) { /* the program of all detectors gives the same bytes as the camera's own */
            bst_renderer_options shared = bst_renderer_default_options();
            shared.shared_program = true;
            bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, &shared, &r));
            request.window = (bst_window){0, 0, W, H};
            take(&ctx, r, &request, other);
            assert_memory_equal(other, full, sizeof full);
            bst_renderer_free(r);
        }
        free(stars);
    }
    bst_device_close(device);
}

/* On a sensor that is no square, with rows longer than it is wide in memory: hits lie evenly, and a
 * track crosses depth / pitch columns and as many rows on average (2 mu of the cosine law times the
 * tangent is pi / 2, times 2 / pi of an axis), so that it touches 1 + 2 depth / pitch pixels. */
static void tracks_cross_columns_and_rows(void **state) {
    (void)state;
    enum { WIDTH = 300, HEIGHT = 500, STRIDE = 320, EXPOSURES = 1500 };
    bst_ctx ctx = {0};
    bst_cosmic_rays *hits;
    bst_assert_ok(&ctx, bst_cosmic_rays_create(&ctx, &example, WIDTH, HEIGHT, STRIDE, &hits));
    double n = 0.0, sum[2] = {0.0}, across = 0.0, down = 0.0;
    for (int k = 0; k < EXPOSURES; k++) {
        const bst_cosmic_rays_pixel *pixels;
        bst_cosmic_rays_summary s;
        bst_assert_ok(&ctx,
                      bst_cosmic_rays_draw(&ctx, hits, (bst_rng_key){{3, 4}}, k, 2.0, &pixels, &s));
        n += s.pixels;
        for (int i = 0; i < s.pixels; i++) {
            int x = pixels[i].index % STRIDE, y = pixels[i].index / STRIDE;
            assert_true(x < WIDTH && y < HEIGHT);
            sum[0] += (x + 0.5) / WIDTH - 0.5;
            sum[1] += (y + 0.5) / HEIGHT - 0.5;
            for (int j = i + 1; j < s.pixels && pixels[j].index <= pixels[i].index + STRIDE; j++) {
                across += pixels[j].index == pixels[i].index + 1 && x + 1 < WIDTH;
                down += pixels[j].index == pixels[i].index + STRIDE;
            }
        }
    }
    double entered = EXPOSURES * 5.0 * 2.0 * WIDTH * HEIGHT * 13e-4 * 13e-4;
    double ratio = 15.0 / 13.0;
    /* beyond 20 depths beside the sensor no track is drawn: 1 / 20 of the rows and columns that
     * they would cross, part of which lie there; the scatter is of long tracks */
    bst_assert_close(n / entered, 1.0 + 2.0 * ratio, 0.15);
    bst_assert_close(across / entered, ratio, 0.09);
    bst_assert_close(down / entered, ratio, 0.09);
    /* tracks are the independent ones: some 3 pixels each, long ones more */
    bst_assert_close(sum[0] / n, 0.0, 4.0 * 3.0 * sqrt(1.0 / 12.0 / n));
    bst_assert_close(sum[1] / n, 0.0, 4.0 * 3.0 * sqrt(1.0 / 12.0 / n));
    bst_cosmic_rays_free(hits);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tracks_cross_columns_and_rows),
        cmocka_unit_test(hits_have_their_rate_and_charge),
        cmocka_unit_test(too_many_hits_are_refused),
        cmocka_unit_test(frames_hold_the_hits_of_their_exposure),
        cmocka_unit_test(windows_agree_with_every_effect),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
