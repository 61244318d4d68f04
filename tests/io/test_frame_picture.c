/* Pictures of frames: where pixels and marks are in them, in pictures of other shapes than the
 * frame's. */
#include <stdlib.h>
#include <string.h>

#include "sim/io/frame_picture.h"
#include "tests/test_support.h"

enum { COLUMNS = 40, ROWS = 20 };

/* Blue, green, red of a picture; the caller frees it. */
static uint8_t *drawn(const uint16_t *pixels, const bst_io_overlay *overlay, int width,
                      int height) {
    bst_ctx ctx = {0};
    bst_picture *picture;
    const bst_io_counts counts = {pixels, COLUMNS, ROWS};
    uint8_t *bgr = malloc((size_t)(3 * width * height));
    assert_non_null(bgr);
    bst_io_stretch stretch = bst_io_stretch_of(pixels, COLUMNS, ROWS);
    bst_assert_ok(&ctx,
                  bst_frame_picture(&ctx, &counts, stretch, overlay, width, height, &picture));
    bst_assert_ok(&ctx, bst_picture_copy(&ctx, picture, bgr));
    bst_picture_free(picture);
    return bgr;
}

/* Centre of what differs between two pictures; false: nothing does. */
static bool centre_of_change(const uint8_t *a, const uint8_t *b, int width, int height, double *x,
                             double *y) {
    double sum = 0.0, at[2] = {0.0};
    for (int j = 0; j < height; j++) {
        for (int i = 0; i < width; i++) {
            const uint8_t *p = a + 3 * (j * width + i), *q = b + 3 * (j * width + i);
            double change = abs(p[0] - q[0]) + abs(p[1] - q[1]) + abs(p[2] - q[2]);
            sum += change;
            at[0] += change * i;
            at[1] += change * j;
        }
    }
    *x = at[0] / sum;
    *y = at[1] / sum;
    return sum > 0.0;
}

/* The frame is as large as the picture allows and in its middle: pixel k is centred (k + 1/2) scale
 * - 1/2 from its corner. */
static void places_in_the_picture(void **state) {
    (void)state;
    static const int sizes[][2] = {{400, 300}, {320, 160}, {300, 300}, {600, 120}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        int width = sizes[k][0], height = sizes[k][1];
        double scale = fmin(width / 40.0, height / 20.0);
        double left = (width - (int)(40 * scale)) / 2, top = (height - (int)(20 * scale)) / 2;
        uint16_t pixels[COLUMNS * ROWS];
        for (int i = 0; i < COLUMNS * ROWS; i++) {
            pixels[i] = (uint16_t)(100 + i % 7);
        }
        uint8_t *plain = drawn(pixels, NULL, width, height);
        double x, y;
        pixels[6 * COLUMNS + 29] = 107;
        uint8_t *lit = drawn(pixels, NULL, width, height);
        assert_true(centre_of_change(plain, lit, width, height, &x, &y));
        bst_assert_close(x, left + 29.5 * scale - 0.5, 0.75); /* edges are drawn in whole pixels */
        bst_assert_close(y, top + 6.5 * scale - 0.5, 1.2);
        const bst_io_overlay none = {.count = 0};
        bst_io_overlay_mark mark = {
            .kind = BST_OVERLAY_DETECTION, .x_px = 12.3, .y_px = 8.6, .radius_px = 2.0};
        const bst_io_overlay one = {.marks = &mark, .count = 1};
        uint8_t *without = drawn(pixels, &none, width, height),
                *with = drawn(pixels, &one, width, height);
        assert_true(centre_of_change(without, with, width, height, &x, &y));
        bst_assert_close(x, left + 12.8 * scale - 0.5, 1.2);
        bst_assert_close(y, top + 9.1 * scale - 0.5, 1.2);
        /* beside the frame all is black but for a line round it */
        for (int i = 0; i < width * height; i++) {
            int u = i % width - (int)left, v = i / width - (int)top;
            int w = (int)(40 * scale), h = (int)(20 * scale);
            const uint8_t *p = plain + 3 * i;
            if (u < 0 || v < 0 || u >= w || v >= h) {
                bool on = u >= -1 && v >= -1 && u <= w && v <= h; /* the line; its edges are soft */
                bool beyond = u < -2 || v < -2 || u > w + 1 || v > h + 1;
                int light = p[0] + p[1] + p[2];
                assert_true(on ? light > 0 : !beyond || light == 0);
            }
        }
        free(plain);
        free(lit);
        /* a streak's line goes from one end to the other, downwards to the right */
        mark = (bst_io_overlay_mark){.kind = BST_OVERLAY_DETECTION,
                                     .x_px = 18.0,
                                     .y_px = 9.0,
                                     .half_x_px = 6.0,
                                     .half_y_px = 3.0};
        uint8_t *streak = drawn(pixels, &one, width, height);
        for (int end = -1; end <= 1; end += 2) {
            for (int side = -1; side <= 1; side += 2) {
                double u = left + (18.5 + 5.0 * end) * scale - 0.5;
                double v = top + (9.5 + 2.5 * end * side) * scale - 0.5;
                int at = 3 * ((int)lround(v) * width + (int)lround(u)), change = 0;
                for (int c = 0; c < 3; c++) {
                    change += abs(streak[at + c] - without[at + c]);
                }
                assert_int_equal(change > 0, side == 1);
            }
        }
        free(streak);
        free(without);
        free(with);
    }
}

/* A track's label is above the middle of its mark and that of an object below, both to the right of
 * it: marks at one place leave both legible. */
static void labels_do_not_meet(void **state) {
    (void)state;
    enum { WIDTH = 400, HEIGHT = 200 };
    static const bst_io_overlay_kind kinds[3] = {BST_OVERLAY_TRACK, BST_OVERLAY_OBJECT,
                                                 BST_OVERLAY_TARGET};
    uint16_t pixels[COLUMNS * ROWS] = {0};
    const double x = 12.5 * 10.0 - 0.5, y = 8.5 * 10.0 - 0.5;
    for (int k = 0; k < 3; k++) {
        bst_io_overlay_mark mark = {.kind = kinds[k], .x_px = 12.0, .y_px = 8.0, .radius_px = 1.0};
        const bst_io_overlay one = {.marks = &mark, .count = 1};
        uint8_t *without = drawn(pixels, &one, WIDTH, HEIGHT);
        snprintf(mark.label, sizeof mark.label, "HHH"); /* letters without descenders */
        uint8_t *with = drawn(pixels, &one, WIDTH, HEIGHT);
        int low = HEIGHT, high = 0, left = WIDTH;
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            if (memcmp(without + 3 * i, with + 3 * i, 3) != 0) {
                low = i / WIDTH < low ? i / WIDTH : low;
                high = i / WIDTH > high ? i / WIDTH : high;
                left = i % WIDTH < left ? i % WIDTH : left;
            }
        }
        assert_true(left > x + 18.0 && left < x + 30.0);
        assert_true(high - low >= 4 && high - low <= 10); /* 0.8 of 7 px, and soft edges */
        assert_true(kinds[k] == BST_OVERLAY_TRACK ? high < y - 5.0 && low > y - 25.0
                                                  : low > y + 3.0 && high < y + 25.0);
        free(without);
        free(with);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(places_in_the_picture),
                                       cmocka_unit_test(labels_do_not_meet)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
