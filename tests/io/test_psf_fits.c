/* The onboard PSF from a FITS image: widths by closed forms, refusals by message. */
#include "sim/io/psf_fits.h"

#include <fitsio.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "boresight/vec.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static float image[256 * 256];

/* Writes the image; oversampling 0: no keyword, text: as a string. */
static const char *put(scratch *s, const char *name, int axes, long width, long height,
                       double oversampling, const char *text) {
    const char *path = scratch_path(s, name);
    long size[3] = {width, height, 2};
    fitsfile *file;
    int code = 0;
    fits_create_diskfile(&file, path, &code);
    fits_create_img(file, FLOAT_IMG, axes, size, &code);
    if (oversampling > 0.0) {
        fits_write_key_dbl(file, "OVERSAMP", oversampling, 10, "samples per pixel", &code);
    }
    if (text) {
        fits_write_key_str(file, "OVERSAMP", text, "", &code);
    }
    fits_write_img(file, TFLOAT, 1, width * height, image, &code);
    fits_close_file(file, &code);
    assert_int_equal(code, 0);
    return path;
}

static void gaussian(int width, int height, double sigma_x, double sigma_y) {
    for (int i = 0; i < width * height; i++) {
        double x = (i % width - 0.5 * width + 1.3) / sigma_x;
        double y = ((double)(i / width) - 0.5 * height) / sigma_y;
        image[i] = (float)(7.5 * exp(-0.5 * (x * x + y * y)));
    }
}

static void widths_by_closed_forms(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch s;
    scratch_make(&s);
    bst_psf_summary psf;
    /* a Gaussian of FWHM 2.4 px sampled 8 times per pixel: sums of samples this dense are integrals
     * to rounding of float, 6e-8 */
    gaussian(200, 160, 8 * 2.4 / 2.3548200450309493, 8 * 2.4 / 2.3548200450309493);
    bst_assert_ok(&ctx, bst_psf_fits_read(&ctx, put(&s, "a.fits", 2, 200, 160, 8, NULL), 0, &psf));
    bst_assert_close(psf.fwhm_px, 2.4, 1e-6);
    bst_assert_close(psf.noise_equivalent_px, 4 * BST_PI * pow(2.4 / 2.3548200450309493, 2), 1e-5);
    assert_true(psf.width == 200 && psf.height == 160);
    bst_assert_close(psf.oversampling, 8, 0);
    /* the key has precedence over the keyword */
    bst_assert_ok(&ctx, bst_psf_fits_read(&ctx, scratch_path(&s, "a.fits"), 4, &psf));
    bst_assert_close(psf.fwhm_px, 4.8, 1e-6);
    /* an ellipse has the area of the circle of its geometric mean */
    gaussian(256, 256, 12, 3);
    bst_assert_ok(&ctx, bst_psf_fits_read(&ctx, put(&s, "b.fits", 2, 256, 256, 5, NULL), 0, &psf));
    bst_assert_close(psf.fwhm_px, 2.3548200450309493 * 6 / 5, 1e-6);
    /* a top hat of 10 x 20 samples: its own area */
    for (int i = 0; i < 64 * 64; i++) {
        image[i] = i % 64 < 10 && i / 64 < 20 ? 3.0f : 0.0f;
    }
    bst_assert_ok(&ctx, bst_psf_fits_read(&ctx, put(&s, "c.fits", 2, 64, 64, 10, NULL), 0, &psf));
    bst_assert_close(psf.noise_equivalent_px, 2.0, 1e-12);
    scratch_remove(&s);
}

static void samples_of_images_and_cubes(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch s;
    scratch_make(&s);
    bst_psf_samples samples;
    for (int i = 0; i < 2 * 30 * 20; i++) {
        image[i] = (float)i - 3.0f;
    }
    for (int axes = 2; axes <= 3; axes++) {
        const char *path = scratch_path(&s, axes == 2 ? "a.fits" : "b.fits");
        long size[3] = {30, 20, 2};
        fitsfile *file;
        int code = 0;
        fits_create_diskfile(&file, path, &code);
        fits_create_img(file, FLOAT_IMG, axes, size, &code);
        fits_write_key_dbl(file, "OVERSAMP", 4.0, 10, "", &code);
        fits_write_img(file, TFLOAT, 1, 30 * 20 * (axes - 1), image, &code);
        fits_close_file(file, &code);
        assert_int_equal(code, 0);
        bst_assert_ok(&ctx, bst_psf_fits_samples(&ctx, path, axes == 2 ? 0.0 : 7.0, &samples));
        assert_int_equal(samples.width, 30);
        assert_int_equal(samples.height, 20);
        assert_int_equal(samples.planes, axes - 1);
        bst_assert_close(samples.oversampling, axes == 2 ? 4.0 : 7.0, 0); /* as given */
        assert_memory_equal(samples.samples, image, (size_t)(30 * 20 * (axes - 1)) * sizeof *image);
        free((float *)samples.samples);
    }
    const char *path = put(&s, "no.fits", 2, 16, 16, 0, NULL);
    assert_int_equal(bst_psf_fits_samples(&ctx, path, 0, &samples), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "has no keyword OVERSAMP"));
    scratch_remove(&s);
}

static void expect_refusal(const char *path, double oversampling, const char *tail) {
    bst_ctx ctx = {0};
    bst_psf_summary psf;
    char expected[1200];
    assert_true(bst_psf_fits_read(&ctx, path, oversampling, &psf) != BST_OK);
    snprintf(expected, sizeof expected, "%s: %s", path, tail);
    assert_string_equal(ctx.message, expected);
}

static void bad_files_are_explained(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    gaussian(16, 16, 2, 2);
    expect_refusal(put(&s, "no.fits", 2, 16, 16, 0, NULL), 0,
                   "has no keyword OVERSAMP (samples per detector pixel); add it, or give "
                   "psf_oversampling");
    expect_refusal(put(&s, "text.fits", 2, 16, 16, 0, "many"), 0, "OVERSAMP is not a number");
    expect_refusal(put(&s, "wide.fits", 2, 16, 16, 1e6, NULL), 0,
                   "OVERSAMP is 1e+06 (allowed: 0.1 to 1000)");
    expect_refusal(put(&s, "cube.fits", 3, 16, 16, 4, NULL), 0, "has no image of two axes");
    image[18] = -1.0f;
    expect_refusal(put(&s, "negative.fits", 2, 16, 16, 4, NULL), 0,
                   "sample (2, 1) is -1 (allowed: finite, not negative)");
    image[18] = (float)NAN;
    expect_refusal(put(&s, "nan.fits", 2, 16, 16, 4, NULL), 0,
                   "sample (2, 1) is nan (allowed: finite, not negative)");
    image[18] = (float)INFINITY; /* the library gives it as blank */
    expect_refusal(put(&s, "inf.fits", 2, 16, 16, 4, NULL), 0,
                   "sample (2, 1) is nan (allowed: finite, not negative)");
    memset(image, 0, sizeof image);
    expect_refusal(put(&s, "dark.fits", 2, 16, 16, 4, NULL), 0,
                   "all samples are 0; there must be some light");
    const char *path = put(&s, "long.fits", 2, 8192, 2, 4, NULL);
    expect_refusal(path, 0, "a PSF of 8192 x 2 samples (allowed: sides of 1 to 4096)");
    /* cut short, empty, and no FITS at all: the reader of maps explains them */
    path = put(&s, "short.fits", 2, 64, 64, 4, NULL);
    assert_int_equal(truncate(path, 2880 + 1000), 0);
    expect_refusal(path, 0, "HDU 1: is cut short: 16384 bytes of data, 1000 in the file");
    assert_int_equal(truncate(path, 0), 0);
    expect_refusal(path, 0,
                   "does not begin as a FITS file does (allowed: FITS, not compressed as a whole)");
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(widths_by_closed_forms),
        cmocka_unit_test(samples_of_images_and_cubes),
        cmocka_unit_test(bad_files_are_explained),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
