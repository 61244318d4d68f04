/* Pixels reduced to the means or peaks of squares, against sums over all pixels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
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

/* Pixels of all 16 bits. */
static void fill(uint16_t all[WIDTH * HEIGHT]) {
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        all[i] = (uint16_t)(65535u - (unsigned)i * 2654435761u % 65536u * (unsigned)(i % 3 != 0));
    }
}

static void test_means(void **state) {
    (void)state;
    uint16_t all[WIDTH * HEIGHT], out[WIDTH * HEIGHT];
    fill(all);
    for (int n = 1; n <= 40; n++) {
        bst_view_part part = {.binning = n};
        assert_true(bst_view_fit_part(&part, WIDTH, HEIGHT));
        assert_true(bst_view_bin_part(all, WIDTH, &part, out));
        const int across = bst_view_bins(part.width, n), down = bst_view_bins(part.height, n);
        assert_int_equal(across, (WIDTH + n - 1) / n);
        assert_int_equal(down, (HEIGHT + n - 1) / n);
        for (int y = 0; y < down; y++) {
            for (int x = 0; x < across; x++) {
                assert_int_equal(out[y * across + x], expected(all, x, y, n));
            }
        }
    }
}

/* A part from a corner of bins has the bins of the whole frame; without bins its pixels. */
static void test_parts(void **state) {
    (void)state;
    uint16_t all[WIDTH * HEIGHT], out[WIDTH * HEIGHT];
    fill(all);
    for (int n = 1; n <= 7; n++) {
        bst_view_part part = {.x = 2 * n, .y = n, .width = 1000, .height = 2 * n, .binning = n};
        assert_true(bst_view_fit_part(&part, WIDTH, HEIGHT));
        assert_int_equal(part.width, WIDTH - 2 * n);
        assert_true(bst_view_bin_part(all, WIDTH, &part, out));
        const int across = bst_view_bins(part.width, n);
        for (int y = 0; y < 2; y++) {
            for (int x = 0; x < across; x++) {
                assert_int_equal(out[y * across + x], expected(all, x + 2, y + 1, n));
            }
        }
    }
}

/* The largest sum: bins of 256 x 256 of the largest number. An even width: pairs. */
static void test_largest(void **state) {
    (void)state;
    enum { SIDE = BST_VIEW_BINNING_MOST };
    uint16_t *all = malloc(SIDE * SIDE * sizeof *all), out[2 * 4];
    assert_non_null(all);
    memset(all, 0xff, SIDE * SIDE * sizeof *all);
    bst_view_part part = {.binning = SIDE};
    assert_true(bst_view_fit_part(&part, SIDE, SIDE));
    assert_true(bst_view_bin_part(all, SIDE, &part, out));
    assert_int_equal(out[0], 65535);
    const uint16_t pairs[5 * 8] = {0, 1,  1, 1, 65535, 65535, 7, 8, 0, 1, 1, 1, 65535, 65534,
                                   9, 10, 1, 1, 0,     0,     3, 4, 5, 6, 2, 2, 0,     1,
                                   3, 4,  5, 6, 1,     2,     3, 4, 5, 6, 7, 8};
    const uint16_t means[3 * 4] = {1, 1, 65535, 9, 2, 0, 4, 6, 2, 4, 6, 8};
    uint16_t found[3 * 4];
    part = (bst_view_part){.binning = 2};
    assert_true(bst_view_fit_part(&part, 8, 5));
    assert_true(bst_view_bin_part(pairs, 8, &part, found));
    assert_memory_equal(found, means, sizeof means);
    free(all);
}

/* Which parts there are, and the binning that makes them fit. */
static void test_fit(void **state) {
    (void)state;
    bst_view_part part = {.longest = 10};
    assert_true(bst_view_fit_part(&part, WIDTH, HEIGHT));
    assert_int_equal(part.binning, 4);
    part = (bst_view_part){.longest = 10, .binning = 6};
    assert_true(bst_view_fit_part(&part, WIDTH, HEIGHT));
    assert_int_equal(part.binning, 6);
    part = (bst_view_part){.x = WIDTH - 1, .y = HEIGHT - 1, .longest = 1};
    assert_true(bst_view_fit_part(&part, WIDTH, HEIGHT));
    assert_int_equal(part.width * part.height * part.binning, 1);
    const bst_view_part wrong[] = {
        {.x = WIDTH},         {.y = HEIGHT},   {.x = -1},
        {.width = -1},        {.longest = -5}, {.binning = BST_VIEW_BINNING_MOST + 1},
        {.height = INT64_MAX}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        part = wrong[i];
        assert_false(bst_view_fit_part(&part, WIDTH, HEIGHT));
    }
    part = (bst_view_part){.longest = 1}; /* more than the largest bins */
    assert_false(bst_view_fit_part(&part, 32768, 4));
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

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_means), cmocka_unit_test(test_parts),
                                       cmocka_unit_test(test_largest), cmocka_unit_test(test_fit),
                                       cmocka_unit_test(test_peaks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
