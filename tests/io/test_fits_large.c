/* Frames with more pixels than the writer's buffer holds, and as many. */
#include "sim/io/fits_frames.h"
#include "sim/io/fits_reader.h"
#include "tests/io/scratch.h"

static void every_pixel(void **state) {
    (void)state;
    /* the buffer: 65536 */
    static const int sizes[][2] = {{256, 256}, {257, 256}, {512, 300}, {640, 333}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        bst_ctx ctx = {0};
        scratch s;
        int width = sizes[k][0], height = sizes[k][1];
        size_t count = (size_t)width * (size_t)height;
        uint16_t *pixels = malloc(count * sizeof *pixels);
        assert_non_null(pixels);
        bst_camera camera = {.width_px = width, .height_px = height, .pixel_scale_arcsec = 3};
        const bst_fits_info info = {.observer = "eye", .instrument = "camera", .camera = &camera};
        bst_fits *fits;
        bst_fits_reader *reader;
        scratch_make(&s);
        bst_assert_ok(&ctx, bst_fits_create(&ctx, scratch_path(&s, "frames.fits"),
                                            BST_FITS_EXTENSIONS, &info, &fits));
        for (int n = 0; n < 2; n++) {
            bst_fits_frame frame = {.id = n,
                                    .exposure_s = 1,
                                    .window = {0, 0, width, height},
                                    .binning = 1,
                                    .bits = 16};
            for (size_t i = 0; i < count; i++) {
                pixels[i] = (uint16_t)(i * 40503u + (i >> 16) + (size_t)n);
            }
            bst_assert_ok(&ctx, bst_fits_write(&ctx, fits, &frame, pixels, width, height, NULL));
        }
        bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
        bst_assert_ok(&ctx, bst_fits_reader_open(&ctx, scratch_path(&s, "frames.fits"), &reader));
        for (int n = 0; n < 2; n++) {
            bst_fits_read_frame frame;
            bst_assert_ok(&ctx, bst_fits_reader_frame(&ctx, reader, n, &frame));
            for (size_t i = 0; i < count; i++) {
                assert_int_equal(frame.pixels[i], (uint16_t)(i * 40503u + (i >> 16) + (size_t)n));
            }
        }
        bst_fits_reader_close(reader);
        free(pixels);
        scratch_remove(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_pixel)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
