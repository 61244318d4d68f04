/* A background that differs from pixel to pixel, on its way through the kernels. */
#include "scenegen/renderer.h"
#include "sim/world/scene/skylight.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { W = 300, H = 200 };

static const scene_motion demo = {
    .x_px = 7.5, .y_px = 2.5, .jitter_px = 0.2, .duration_s = 0.5, .samples = 101, .seed = 3};

static bst_camera uneven_camera(void) {
    bst_camera camera = scene_camera(W, H);
    camera.background.stray_e_per_s = 1.0; /* makes the renderer take a map */
    return camera;
}

/* Nodes over the whole sensor, a rough function of place. */
static bst_skylight_map make_map(int step, float *nodes) {
    bst_skylight_map map = {.step_px = step, .e = nodes, .least_e = 1};
    map.columns = step == 1 ? W : (W - 1) / step + 2;
    map.rows = step == 1 ? H : (H - 1) / step + 2;
    for (int j = 0; j < map.rows; j++) {
        for (int i = 0; i < map.columns; i++) {
            nodes[j * map.columns + i] = (float)(1 + (i * 7 + j * 13) % 29 + 0.25 * i);
        }
    }
    return map;
}

/* The part of a map that a window needs, as the field query makes it. */
static bst_skylight_map cut_map(const bst_skylight_map *whole, bst_window w, float *nodes) {
    bst_skylight_map map = *whole;
    int step = whole->step_px;
    int i0 = w.x0 / step, j0 = w.y0 / step;
    map.x0_px = i0 * step;
    map.y0_px = j0 * step;
    map.columns = step == 1 ? w.width : (w.x0 + w.width - 1) / step - i0 + 2;
    map.rows = step == 1 ? w.height : (w.y0 + w.height - 1) / step - j0 + 2;
    map.e = nodes;
    for (int j = 0; j < map.rows; j++) {
        for (int i = 0; i < map.columns; i++) {
            nodes[j * map.columns + i] = whole->e[(j + j0) * whole->columns + i + i0];
        }
    }
    return map;
}

/* Every pixel gets what the host's interpolation says, whatever the step. */
static void maps_are_interpolated(void **state) {
    fixture *f = *state;
    static float nodes[W * H], image[W * H];
    bst_camera camera = uneven_camera();
    scene_track track = scene_track_make(&camera, &demo);
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r));
    const int steps[] = {32, 16, 8, 4, 2, 1};
    for (int s = 0; s < 6; s++) {
        bst_skylight_map map = make_map(steps[s], nodes);
        bst_render_request q = {
            .window = {0, 0, W, H}, .track = &track.track, .background_e = 2.0, .background = &map};
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                /* a few roundings of a float near 100 */
                bst_assert_close((double)image[y * W + x], 2.0 + bst_skylight_at(&map, x, y), 3e-5);
            }
        }
    }
    bst_renderer_free(r);
    scene_track_free(&track);
}

/* The same digital numbers in any window, with stars, noise and saturation. */
static void windows_have_the_same_bytes(void **state) {
    fixture *f = *state;
    static float nodes[W * H], part[W * H];
    static uint16_t full[W * H];
    bst_camera camera = uneven_camera();
    bst_scene_source *stars = scene_stars(&camera, 100, 2e6, 6.0, 4);
    scene_track track = scene_track_make(&camera, &demo);
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r));
    const bst_window windows[] = {{0, 0, W, H},        {0, 0, 1, 1},     {299, 199, 1, 1},
                                  {37, 51, 101, 67},   {13, 0, 16, 200}, {5, 190, 290, 3},
                                  {130, 100, 110, 40}, {63, 64, 2, 2}};
    const int steps[] = {32, 4, 1};
    for (int s = 0; s < 3; s++) {
        bst_skylight_map map = make_map(steps[s], nodes);
        map.least_e = 0;
        for (int k = 0; k < 100; k++) { /* some of it fills the well */
            nodes[map.columns + k % map.columns] = 2e5f;
        }
        for (size_t i = 0; i < sizeof windows / sizeof *windows; i++) {
            bst_window w = windows[i];
            bst_skylight_map cut = cut_map(&map, w, part);
            bst_render_request q = {.window = w,
                                    .track = &track.track,
                                    .sources = stars,
                                    .count = 100,
                                    .background_e = 1.0,
                                    .background = &cut,
                                    .key = {{17, 23}},
                                    .exposure_id = 5};
            bst_frame *frame;
            const uint16_t *pixels;
            bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frame));
            bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
            if (i == 0) {
                long long saturated;
                bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
                assert_true(saturated > 0);
                memcpy(full, pixels, sizeof full);
            }
            for (int y = 0; y < w.height; y++) {
                assert_memory_equal(&pixels[y * w.width], &full[(y + w.y0) * W + w.x0],
                                    (size_t)w.width * sizeof *full);
            }
            bst_frame_unmap(frame);
            bst_frame_release(frame);
        }
    }
    bst_renderer_free(r);
    scene_track_free(&track);
    free(stars);
}

static void maps_go_with_cameras_that_have_them(void **state) {
    fixture *f = *state;
    static float nodes[W * H], image[W * H];
    bst_skylight_map map = make_map(32, nodes);
    for (int uneven = 0; uneven < 2; uneven++) {
        bst_camera camera = uneven ? uneven_camera() : scene_camera(W, H);
        scene_track track = scene_track_make(&camera, &demo);
        bst_renderer *r;
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r));
        bst_render_request q = {.window = {0, 0, W, H},
                                .track = &track.track,
                                .background_e = 2.0,
                                .background = uneven ? NULL : &map};
        bst_status status = bst_renderer_render_noise_free(&f->ctx, r, &q, image);
        assert_int_equal(status, uneven ? BST_OK : BST_ERR_ARGUMENT);
        for (int i = 0; uneven && i < W * H; i++) {
            assert_true(image[i] == 2.0f); /* without a map there is the number alone */
        }
        bst_renderer_free(r);
        scene_track_free(&track);
    }
}

/* Sums over the quarters of a frame are those of the map's place for place, whatever way the
 * detector takes: pixel by pixel, with blooming, frame transfer or binning, under a response of
 * its own in each pixel. */
static void all_detectors_add_it_once(void **state) {
    fixture *f = *state;
    static float nodes[W * H], part[W * H], light[W * H];
    const bst_window w = {37, 51, 202, 104};
    for (int way = 0; way < 8; way++) {
        int kind = way % 4, step = way < 4 ? 16 : 1, b = kind == 3 ? 2 : 1;
        bst_camera camera = uneven_camera();
        camera.detector.prnu_rms = 0.02;
        camera.detector.saturation = kind == 1 ? BST_WELL_BLOOM : BST_WELL_CLIP;
        camera.detector.frame_transfer_s = kind == 2 ? 1e-9 : 0.0; /* no light falls in it */
        scene_track track = scene_track_make(&camera, &demo);
        bst_renderer_options options = bst_renderer_default_options();
        options.shared_program = true; /* compiled for test_detector.c too */
        bst_renderer *r;
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, &options, &r));
        bst_skylight_map map = make_map(step, nodes);
        bst_window lit = {w.x0, 0, w.width, H};
        bst_skylight_map cut = cut_map(&map, kind == 1 || kind == 2 ? lit : w, part);
        bst_render_request q = {.window = w,
                                .track = &track.track,
                                .background_e = 5.0,
                                .dark_e = 3.0,
                                .background = &cut,
                                .binning = b,
                                .key = {{17, 23}},
                                .exposure_id = 5};
        bst_frame *frame;
        const uint16_t *pixels;
        bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frame));
        bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
        int width = w.width / b, height = w.height / b;
        double got[4] = {0}, want[4] = {0}, squares[4] = {0};
        for (int i = 0; i < width * height; i++) {
            int quarter = (i % width >= width / 2) + 2 * (i / width >= height / 2);
            got[quarter] += (pixels[i] - camera.offset_dn) * camera.gain_e_per_dn;
        }
        bst_frame_unmap(frame);
        bst_frame_release(frame);
        for (int y = 0; y < height * b; y++) {
            for (int x = 0; x < width * b; x++) {
                int quarter = (x >= width / 2 * b) + 2 * (y >= height / 2 * b);
                double e = bst_skylight_at(&map, w.x0 + x, w.y0 + y);
                want[quarter] += 5.0 + e;
                squares[quarter] += (2.0 + e) * (2.0 + e);
            }
        }
        for (int k = 0; k < 4; k++) { /* shot, read noise and rounding, response */
            double reads = 0.25 * width * height;
            double read = camera.read_noise_e * camera.read_noise_e +
                          camera.gain_e_per_dn * camera.gain_e_per_dn / 12.0;
            double variance = want[k] + reads * read + 0.02 * 0.02 * squares[k];
            bst_assert_close(got[k], want[k], 4.5 * sqrt(variance));
        }
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, light));
        for (int i = 0; i < w.width * w.height; i++) { /* a few roundings of a float near 100 */
            double e = bst_skylight_at(&map, w.x0 + i % w.width, w.y0 + i / w.width);
            bst_assert_close((double)light[i], 5.0 + e, 3e-5);
        }
        if (kind == 1) { /* a map of the window alone does not do here */
            cut = cut_map(&map, w, part);
            assert_int_equal(bst_renderer_render(&f->ctx, r, &q, &frame), BST_ERR_ARGUMENT);
        }
        bst_renderer_free(r);
        scene_track_free(&track);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(maps_are_interpolated),
        cmocka_unit_test(windows_have_the_same_bytes),
        cmocka_unit_test(all_detectors_add_it_once),
        cmocka_unit_test(maps_go_with_cameras_that_have_them),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
