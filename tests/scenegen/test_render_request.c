/* Requests of the renderer: every window and binning of a small sensor, maps that cover a window or
 * miss it on one side, and the parameters of the kernels of a window off the corner. */
#include "scenegen/render_request.h"
#include "sim/world/scene/skylight.h"
#include "tests/test_support.h"

static const double times[2] = {0.0, 0.5};
static const bst_quat attitudes[2] = {{0, 0, 0, 1}, {0, 0, 0, 1}};

static bst_camera camera_of(int width, int height) {
    bst_camera c = {.width_px = width,
                    .height_px = height,
                    .pixel_scale_arcsec = 3.0,
                    .psf_fwhm_px = 2.0,
                    .gain_e_per_dn = 4.0,
                    .read_noise_e = 6.0,
                    .full_well_e = 50000.0,
                    .offset_dn = 90.0,
                    .bits = 12};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    return c;
}

static void windows_lie_inside_and_hold_a_binned_pixel(void **state) {
    (void)state;
    enum { WIDTH = 7, HEIGHT = 5 };
    const bst_camera camera = camera_of(WIDTH, HEIGHT);
    const bst_los_track track = {.count = 2, .time_s = times, .q_cam_from_gcrf = attitudes};
    int good = 0;
    for (int i = 0; i < 4 * 9 * 9 * 11 * 11; i++) {
        int k = i, binning = k % 4, x0 = (k /= 4) % 9 - 1, y0 = (k /= 9) % 9 - 1;
        int width = (k /= 9) % 11 - 1, height = k / 11 - 1, side = binning > 1 ? binning : 1;
        const bst_render_request q = {
            .window = {x0, y0, width, height}, .track = &track, .binning = binning};
        bst_ctx ctx = {0};
        bool inside = x0 >= 0 && y0 >= 0 && width >= 1 && height >= 1 && x0 + width <= WIDTH &&
                      y0 + height <= HEIGHT && side <= width && side <= height;
        assert_int_equal(bst_render_request_check(&ctx, &camera, &q) == BST_OK, inside);
        good += inside;
    }
    /* 28 by 15 windows twice, 21 by 10 with two pixels, 15 by 6 with three */
    assert_int_equal(good, 2 * 28 * 15 + 21 * 10 + 15 * 6);
}

/* A map of 4 x 3 nodes, 2 px apart, from (2, 1) on: it covers windows from x 2 to 8 and from y 1
 * to 5. */
static void maps_cover_their_windows(void **state) {
    (void)state;
    bst_camera camera = camera_of(12, 9);
    camera.background.stray_e_per_s = 1.0;
    static const float e[3 * 4];
    const bst_skylight_map map = {
        .step_px = 2, .x0_px = 2, .y0_px = 1, .columns = 4, .rows = 3, .e = e};
    const bst_los_track track = {.count = 2, .time_s = times, .q_cam_from_gcrf = attitudes};
    int good = 0;
    for (int x0 = 0; x0 < 12; x0++) {
        for (int y0 = 0; y0 < 9; y0++) {
            for (int width = 1; x0 + width <= 12; width++) {
                for (int height = 1; y0 + height <= 9; height++) {
                    const bst_render_request q = {
                        .window = {x0, y0, width, height}, .track = &track, .background = &map};
                    bst_ctx ctx = {0};
                    bool covered =
                        x0 >= 2 && x0 + width - 1 <= 8 && y0 >= 1 && y0 + height - 1 <= 5;
                    assert_int_equal(bst_render_request_check(&ctx, &camera, &q) == BST_OK,
                                     covered);
                    good += covered;
                }
            }
        }
    }
    assert_int_equal(good, 28 * 15);
}

static void kernels_get_the_window(void **state) {
    (void)state;
    const bst_camera camera = camera_of(700, 500);
    const bst_los_track track = {.count = 2, .time_s = times, .q_cam_from_gcrf = attitudes};
    static const float e[5 * 7];
    const bst_skylight_map map = {
        .step_px = 16, .x0_px = 144, .y0_px = 96, .columns = 7, .rows = 5, .e = e};
    const bst_render_request q = {.window = {150, 101, 106, 64},
                                  .track = &track,
                                  .background_e = 12.0,
                                  .dark_e = 3.0,
                                  .background = &map,
                                  .key = {{5, 6}},
                                  .exposure_id = 0x300000007};
    const bst_renderer_options options = {.tile_width = 32, .tile_height = 8};
    const bst_kernel_frame_params fixed = {0};
    bst_kernel_frame_params p = bst_render_params(&fixed, &camera, &options, &q, 2 * BST_BLOCK + 1);
    const struct {
        const char *name;
        double found, expected;
    } list[] = {{"x0", p.window_x0, 150},
                {"y0", p.window_y0, 101},
                {"width", p.window_width, 106},
                {"height", p.window_height, 64},
                {"sensor", p.sensor_width, 700},
                /* tiles begin at a multiple of 64: 128 to 256 are 4 tiles of 32 */
                {"tiles from", p.tiles_x0, 128},
                {"tiles across", p.tiles_x, 4},
                {"tiles down", p.tiles_y, 8},
                {"sources", p.sources, 2 * BST_BLOCK + 1},
                {"groups of sources", p.source_groups, 3},
                {"key", p.key0, 5},
                {"key 1", p.key1, 6},
                {"exposure", p.exposure_low, 7},
                {"exposure, high", p.exposure_high, 3},
                {"background", (double)p.background_e, 12},
                {"dark", (double)p.dark_e, 3},
                {"time", (double)p.exposure_s, 0.5},
                {"read noise", (double)p.read_noise_e, 6},
                {"full well", (double)p.full_well_e, 50000},
                {"per full well", (double)p.per_full_well * 50000, 1},
                {"gain", (double)p.dn_per_e, 0.25},
                {"offset", (double)p.offset_dn, 90},
                {"most", (double)p.max_dn, 4095},
                {"stride", p.image_stride, 106},
                {"map's step", p.map_step, 16},
                {"map's x0", p.map_x0, 144},
                {"map's y0", p.map_y0, 96},
                {"map's columns", p.map_columns, 7},
                {"map's rows", p.map_rows, 5}};
    for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
        if (!(fabs(list[i].found - list[i].expected) <= 1e-6 * list[i].expected)) {
            fail_msg("%s = %.9g, expected %.9g", list[i].name, list[i].found, list[i].expected);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(windows_lie_inside_and_hold_a_binned_pixel),
                                       cmocka_unit_test(maps_cover_their_windows),
                                       cmocka_unit_test(kernels_get_the_window)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
