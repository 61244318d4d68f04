/* Flags of saturated pixels: those that are, and no others, on every path of the detector. */
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/renderer.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { W = 150, H = 90 };

static const scene_motion still = {
    .x_px = 3, .y_px = 1, .duration_s = 0.5, .samples = 11, .seed = 3};

/* Frame and flags of a window; flags NULL: not kept. Returns what bst_renderer_saturated counts. */
static long long render(fixture *f, const bst_camera *camera, bst_window w, int binning,
                        uint16_t *frame, uint8_t *flags) {
    scene_track track = scene_track_make(camera, &still);
    bst_scene_source stars[3];
    static const double place[3][3] = {{40.2, 30.7, 3e6}, {100.5, 60.1, 4e5}, {120, 20, 2e4}};
    for (int i = 0; i < 3; i++) {
        stars[i] = scene_star(camera, place[i][0], place[i][1], place[i][2]);
    }
    bst_renderer_options options = bst_renderer_default_options();
    options.saturation_flags = flags != NULL;
    options.shared_program = true; /* compiled for test_detector.c too */
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, camera, &options, &r));
    bst_render_request q = {.window = w,
                            .track = &track.track,
                            .sources = stars,
                            .count = 3,
                            .background_e = 20.0,
                            .binning = binning,
                            .key = {{17, 23}},
                            .exposure_id = 5};
    bst_frame *out;
    const uint16_t *pixels;
    size_t count = (size_t)(w.width / binning) * (size_t)(w.height / binning);
    long long saturated;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &out));
    if (flags) {
        bst_assert_ok(&f->ctx, bst_renderer_flags(&f->ctx, r, count, flags));
    }
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
    bst_assert_ok(&f->ctx, bst_frame_map(out, &f->ctx, &pixels));
    memcpy(frame, pixels, count * sizeof *frame);
    bst_frame_unmap(out);
    bst_frame_release(out);
    bst_renderer_free(r);
    scene_track_free(&track);
    return saturated;
}

static void flags_are_the_saturated_pixels(void **state) {
    fixture *f = *state;
    static uint16_t frame[W * H], plain[W * H];
    static uint8_t flags[W * H];
    static const bst_window windows[] = {{0, 0, W, H}, {35, 25, 77, 41}};
    /* clipped, in bloom, binned; windows of both kinds; the well or the converter first */
    for (int way = 0; way < 12; way++) {
        int kind = way % 3, b = kind == 2 ? 2 : 1;
        bool converter = way >= 6;
        bst_window w = windows[way / 3 % 2];
        bst_camera camera = scene_camera(W, H);
        camera.full_well_e = converter ? 1e6 : 20000.0;
        camera.bits = converter ? 14 : 16;
        camera.detector.saturation = kind == 1 ? BST_WELL_BLOOM : BST_WELL_CLIP;
        long long saturated = render(f, &camera, w, b, frame, flags);
        (void)render(f, &camera, w, b, plain, NULL);
        size_t count = (size_t)(w.width / b) * (size_t)(w.height / b), found = 0;
        assert_memory_equal(frame, plain, count * sizeof *frame); /* off or on, the same bytes */
        for (size_t i = 0; i < count; i++) {
            found += flags[i] != 0;
            int top = (1 << camera.bits) - 1;
            assert_int_equal((flags[i] & BST_FLAG_CONVERTER) != 0, frame[i] == top);
            if (b > 1) {
                continue; /* of a binned pixel one full well does not show in the sum */
            }
            double well = camera.offset_dn + camera.full_well_e / camera.gain_e_per_dn;
            /* nothing above the full well but read noise of 8 e-: 6 sigma and rounding */
            if (flags[i] & BST_FLAG_FULL_WELL) {
                assert_true(converter || fabs(frame[i] - well) < 49.0);
            } else {
                assert_true(converter || frame[i] < well + 49.0);
            }
        }
        assert_int_equal(saturated, (long long)found);
        assert_true(found > 5 && found < count / 4);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(flags_are_the_saturated_pixels),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
