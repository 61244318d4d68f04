/* Pixels reduced to the means or peaks of squares, against sums over all pixels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "view/pixel_bins.h"

enum { WIDTH = 37, HEIGHT = 23 };

/* Mean of the pixels of bin (bx, by), halves up. */
static uint16_t expected(const uint16_t *all, int bx, int by, int n) {
    unsigned long sum = 0, count = 0;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            if (x / n == bx && y / n == by) {
                sum += all[y * WIDTH + x];
                count++;
            }
        }
    }
    return (uint16_t)((2 * sum + count) / (2 * count));
}

static void test_means(void **state) {
    (void)state;
    for (int n = 1; n <= 40; n++) {
        uint16_t all[WIDTH * HEIGHT], data[WIDTH * HEIGHT];
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            all[i] =
                (uint16_t)(65535u - (unsigned)i * 2654435761u % 65536u * (unsigned)(i % 3 != 0));
        }
        memcpy(data, all, sizeof all);
        bst_view_bytes pixels = {
            .data = data, .bytes = sizeof data, .width = WIDTH, .height = HEIGHT};
        bst_view_bin_pixels(&pixels, n);
        assert_int_equal(pixels.width, (WIDTH + n - 1) / n);
        assert_int_equal(pixels.height, (HEIGHT + n - 1) / n);
        assert_int_equal(pixels.bytes, 2 * pixels.width * pixels.height);
        if (n > 1) {
            assert_int_equal(pixels.binning, n);
            assert_int_equal(pixels.frame_width, WIDTH);
            assert_int_equal(pixels.frame_height, HEIGHT);
        }
        for (int y = 0; y < pixels.height; y++) {
            for (int x = 0; x < pixels.width; x++) {
                assert_int_equal(data[y * pixels.width + x], expected(all, x, y, n));
            }
        }
    }
}

static void test_peaks(void **state) {
    (void)state;
    for (int n = 1; n <= 40; n++) {
        uint16_t all[WIDTH * HEIGHT], row[WIDTH], found[WIDTH * HEIGHT],
            largest[WIDTH * HEIGHT] = {0};
        const int across = (WIDTH + n - 1) / n, down = (HEIGHT + n - 1) / n;
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            all[i] = (uint16_t)((unsigned)i * 2654435761u >> 16);
            uint16_t *bin = &largest[i / WIDTH / n * across + i % WIDTH / n];
            *bin = all[i] > *bin ? all[i] : *bin;
        }
        bst_view_peak_pixels(all, WIDTH, HEIGHT, n, row, found);
        assert_memory_equal(found, largest, sizeof *found * (size_t)(across * down));
    }
}

/* What is no image stays as it is. */
static void test_other_data(void **state) {
    (void)state;
    uint16_t data[] = {1, 2, 3};
    bst_view_bytes bytes = {.data = data, .bytes = sizeof data};
    bst_view_bin_pixels(&bytes, 2);
    assert_int_equal(bytes.bytes, sizeof data);
    assert_int_equal(data[1], 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_means), cmocka_unit_test(test_peaks),
                                       cmocka_unit_test(test_other_data)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
