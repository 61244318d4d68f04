/* Levels of reference pixels are taken off the frame. */
#include "imgproc/calibrate/reference_pixels.h"

#include <stdlib.h>
#include <string.h>

#include "tests/test_support.h"

enum { W = 90, H = 70, TOP = 4095 };

static const bst_reference_pixels_config settings = {true, true, 0};
static const bst_camera camera = {
    .width_px = W, .height_px = H, .offset_dn = 100.0, .detector.overscan = {4, 6, 5, 3}};

static bool is_lit(int x, int y) {
    return x >= 4 && x < W - 6 && y >= 5 && y < H - 3;
}

/* A scene of `light` DN on the lit pixels, with columns that alternate by -8 and +8 DN, and rows of
 * a level that changes with the row. */
static int light_of(int x, int y) {
    return is_lit(x, y) ? 40 + (x * 5 + y * 3) % 17 : 0;
}

static int row_level(int y) {
    return (y * 7) % 23 - 11;
}

static void fill(uint16_t *raw, bst_window w) {
    for (int i = 0; i < w.width * w.height; i++) {
        int x = w.x0 + i % w.width, y = w.y0 + i / w.width;
        raw[i] = (uint16_t)(100 + light_of(x, y) + row_level(y) + (x & 1 ? 8 : -8));
    }
}

/* The mean of the reference rows contains that of their own row levels, equal in both columns: the
 * reference columns of each row take it off again. What is left is rounding. */
static void levels_are_taken_off(void **state) {
    (void)state;
    static uint16_t raw[W * H];
    bst_ctx ctx = {0};
    bst_reference_pixels r = {0};
    /* whole, and parts with some sides only; the second has all of a reference row's columns */
    const bst_window windows[] = {{0, 0, W, H}, {0, 0, 61, 66}, {9, 3, W - 9, H - 3}};
    for (int k = 0; k < 3; k++) {
        const bst_window w = windows[k];
        fill(raw, w);
        const bst_imgproc_frame frame = {.pixels = raw, .window = w, .binning = 1, .bits = 12};
        bst_imgproc_frame out;
        bst_assert_ok(&ctx,
                      bst_reference_pixels_subtract(&ctx, &r, &settings, &camera, &frame, &out));
        assert_ptr_not_equal(out.pixels, raw);
        for (int i = 0; i < w.width * w.height; i++) {
            int x = w.x0 + i % w.width, y = w.y0 + i / w.width;
            bst_assert_close(out.pixels[i], 100 + light_of(x, y), 1.0); /* rounding of the levels */
        }
    }
    bst_reference_pixels_free(&r);
}

/* Rows are smoothed: the mean of the levels of 2 n + 1 rows, fewer at the ends. */
static void rows_are_smoothed(void **state) {
    (void)state;
    static uint16_t raw[W * H];
    bst_ctx ctx = {0};
    bst_reference_pixels r = {0};
    const bst_window w = {0, 0, W, H};
    fill(raw, w);
    const bst_imgproc_frame frame = {.pixels = raw, .window = w, .binning = 1, .bits = 12};
    bst_imgproc_frame out;
    const bst_reference_pixels_config smooth = {true, true, 3};
    bst_assert_ok(&ctx, bst_reference_pixels_subtract(&ctx, &r, &smooth, &camera, &frame, &out));
    for (int y = 5; y < H - 3; y++) {
        int from = y < 3 ? 0 : y - 3, to = y + 4 > H ? H : y + 4;
        double mean = 0.0;
        for (int n = from; n < to; n++) {
            mean += row_level(n);
        }
        double want = 100 + light_of(40, y) + row_level(y) - mean / (to - from);
        bst_assert_close(out.pixels[y * W + 40], want, 1.0);
    }
    bst_reference_pixels_free(&r);
}

/* Binned frames, windows without reference pixels, and frames without the setting stay; saturated
 * pixels stay saturated, and nothing falls below 0. */
static void frames_that_cannot_stay(void **state) {
    (void)state;
    static uint16_t raw[W * H];
    bst_ctx ctx = {0};
    bst_reference_pixels r = {0};
    bst_imgproc_frame out,
        frame = {.pixels = raw, .window = {10, 10, 30, 30}, .binning = 1, .bits = 12};
    fill(raw, frame.window);
    bst_assert_ok(&ctx, bst_reference_pixels_subtract(&ctx, &r, &settings, &camera, &frame, &out));
    assert_ptr_equal(out.pixels, raw);
    frame = (bst_imgproc_frame){.pixels = raw, .window = {0, 0, W, H}, .binning = 2, .bits = 12};
    bst_assert_ok(&ctx, bst_reference_pixels_subtract(&ctx, &r, &settings, &camera, &frame, &out));
    assert_ptr_equal(out.pixels, raw);
    frame.binning = 1;
    const bst_reference_pixels_config off = {false, true, 0};
    bst_assert_ok(&ctx, bst_reference_pixels_subtract(&ctx, &r, &off, &camera, &frame, &out));
    assert_ptr_equal(out.pixels, raw);
    fill(raw, frame.window);
    for (int i = 0; i < W * H; i++) { /* a level of 130 DN above the offset */
        raw[i] = (uint16_t)(raw[i] + 130);
    }
    raw[20 * W + 20] = TOP;
    raw[20 * W + 21] = 3;
    bst_assert_ok(&ctx, bst_reference_pixels_subtract(&ctx, &r, &settings, &camera, &frame, &out));
    assert_int_equal(out.pixels[20 * W + 20], TOP);
    assert_int_equal(out.pixels[20 * W + 21], 0);
    bst_reference_pixels_free(&r);
}

static void reference_pixels_are_bad(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    uint8_t *bad = NULL;
    const bst_reference_pixels_config off = {false, true, 0};
    bst_assert_ok(&ctx, bst_reference_pixels_mask(&ctx, &off, &camera, &bad));
    assert_null(bad);
    bst_assert_ok(&ctx, bst_reference_pixels_mask(&ctx, &settings, &camera, &bad));
    assert_non_null(bad);
    for (int i = 0; i < W * H; i++) {
        assert_int_equal(bad[i], !is_lit(i % W, i / W));
    }
    free(bad);
    bad = NULL;
    bst_camera without = camera; /* no silent nothing */
    without.detector.overscan = (bst_detector_edges_config){0};
    assert_int_equal(bst_reference_pixels_mask(&ctx, &settings, &without, &bad), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "reference_pixels/enabled: is true, but"));
    assert_null(bad);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_are_taken_off),
        cmocka_unit_test(rows_are_smoothed),
        cmocka_unit_test(frames_that_cannot_stay),
        cmocka_unit_test(reference_pixels_are_bad),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
