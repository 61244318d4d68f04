/* Reading of one image: files are written here byte by byte after the FITS Standard, so that what
 * is expected does not come from the library that reads. */
#include <stdlib.h>

#include "sim/io/fits_image.h"
#include "tests/io/scratch.h"

typedef struct fixture {
    bst_ctx ctx;
    scratch place;
    char path[600];
    FILE *file;
    long written;
} fixture;

static fixture begin(void) {
    fixture f = {.written = 0};
    scratch_make(&f.place);
    snprintf(f.path, sizeof f.path, "%s/map[1].fits", f.place.folder);
    f.file = fopen(f.path, "wb");
    assert_non_null(f.file);
    return f;
}

static void put(fixture *f, const void *bytes, size_t count) {
    assert_int_equal(fwrite(bytes, 1, count, f->file), count);
    f->written += (long)count;
}

static void card(fixture *f, const char *text) {
    char line[81];
    snprintf(line, sizeof line, "%-80s", text);
    put(f, line, 80);
}

static void pad(fixture *f, char with) {
    while (f->written % 2880 != 0) {
        put(f, &with, 1);
    }
}

static void integer(fixture *f, const char *key, int value) {
    char text[81];
    snprintf(text, sizeof text, "%-8s= %20d", key, value);
    card(f, text);
}

static void header(fixture *f, bool primary, int bitpix, int axes, int nx, int ny) {
    card(f, primary ? "SIMPLE  =                    T" : "XTENSION= 'IMAGE   '");
    integer(f, "BITPIX", bitpix);
    integer(f, "NAXIS", axes);
    for (int i = 0; i < axes; i++) {
        char key[16];
        snprintf(key, sizeof key, "NAXIS%d", i + 1);
        integer(f, key, i == 0 ? nx : i == 1 ? ny : 2);
    }
    if (!primary) {
        integer(f, "PCOUNT", 0);
        integer(f, "GCOUNT", 1);
    }
}

static void end_header(fixture *f) {
    card(f, "END");
    pad(f, ' ');
}

static void big_endian(fixture *f, uint64_t bits, int bytes) {
    for (int i = bytes - 1; i >= 0; i--) {
        unsigned char b = (unsigned char)(bits >> (8 * i) & 0xFF);
        put(f, &b, 1);
    }
}

static bst_status read_back(fixture *f, int *nx, int *ny, float **pixels) {
    if (f->file) {
        assert_int_equal(fclose(f->file), 0);
        f->file = NULL;
    }
    return bst_fits_read_image(&f->ctx, f->path, nx, ny, pixels);
}

static void expect_error(fixture *f, bst_status status, const char *reason) {
    int nx, ny;
    float *pixels;
    assert_int_equal(read_back(f, &nx, &ny, &pixels), status);
    assert_null(pixels);
    char message[1200];
    snprintf(message, sizeof message, "%s: %s", f->path, reason);
    assert_string_equal(f->ctx.message, message);
    scratch_remove(&f->place);
}

/* Three axes of different lengths: the fastest first; only two are an image. */
static void planes_of_three_axes(void **state) {
    (void)state;
    fixture f = begin();
    header(&f, true, 16, 3, 3, 4);
    end_header(&f);
    for (int i = 0; i < 24; i++) {
        big_endian(&f, (uint64_t)(7 * i - 20), 2);
    }
    pad(&f, 0);
    assert_int_equal(fclose(f.file), 0);
    f.file = NULL;
    int nx = 0, ny = 0, planes = 0;
    float *pixels;
    bst_assert_ok(&f.ctx, bst_fits_read_planes(&f.ctx, f.path, &nx, &ny, &planes, &pixels));
    assert_true(nx == 3 && ny == 4 && planes == 2);
    for (int i = 0; i < 24; i++) {
        bst_assert_close(pixels[i], 7.0 * i - 20.0, 0.0);
    }
    free(pixels);
    expect_error(&f, BST_ERR_FORMAT, "has no image of two axes");
}

/* A column of 20,000 pixels is long, but not many. */
static void a_long_column(void **state) {
    (void)state;
    fixture f = begin();
    header(&f, true, 8, 2, 1, 20000);
    end_header(&f);
    for (int i = 0; i < 2500; i++) {
        big_endian(&f, 0x0102030405060708, 8);
    }
    pad(&f, 0);
    int nx = 0, ny = 0;
    float *pixels;
    bst_assert_ok(&f.ctx, read_back(&f, &nx, &ny, &pixels));
    assert_true(nx == 1 && ny == 20000);
    bst_assert_close(pixels[19998], 7.0, 0.0);
    free(pixels);
    scratch_remove(&f.place);
}

/* Every BITPIX, row y = 0 first, and brackets in the name are a name. */
static void all_types(void **state) {
    (void)state;
    static const int types[] = {8, 16, 32, 64, -32, -64};
    for (int t = 0; t < 6; t++) {
        fixture f = begin();
        header(&f, true, types[t], 2, 3, 2);
        end_header(&f);
        for (int i = 0; i < 6; i++) {
            int64_t value = types[t] == 8 ? 10 + i : -3 + 1000 * i;
            float single = (float)value + 0.25f;
            double twofold = (double)value + 0.25;
            uint64_t bits = (uint64_t)value;
            if (types[t] == -32) {
                uint32_t word;
                memcpy(&word, &single, 4);
                bits = word;
            } else if (types[t] == -64) {
                memcpy(&bits, &twofold, 8);
            }
            big_endian(&f, bits, abs(types[t]) / 8);
        }
        pad(&f, 0);
        int nx, ny;
        float *pixels;
        bst_assert_ok(&f.ctx, read_back(&f, &nx, &ny, &pixels));
        assert_int_equal(nx, 3);
        assert_int_equal(ny, 2);
        for (int i = 0; i < 6; i++) {
            double expected = types[t] == 8 ? 10 + i : -3 + 1000 * i;
            /* exact: all values are floats */
            bst_assert_close(pixels[i], types[t] < 0 ? expected + 0.25 : expected, 0.0);
        }
        free(pixels);
        scratch_remove(&f.place);
    }
}

/* physical = BZERO + BSCALE * stored (FITS Standard 4.0, equation 3); BLANK is no value. */
static void scaling_and_blank(void **state) {
    (void)state;
    fixture f = begin();
    header(&f, true, 16, 2, 2, 2);
    card(&f, "BSCALE  =                  0.5");
    card(&f, "BZERO   =                100.0");
    integer(&f, "BLANK", -7);
    end_header(&f);
    static const int stored[] = {-32768, 32767, -7, 4};
    for (int i = 0; i < 4; i++) {
        big_endian(&f, (uint64_t)stored[i], 2);
    }
    pad(&f, 0);
    int nx, ny;
    float *pixels;
    bst_assert_ok(&f.ctx, read_back(&f, &nx, &ny, &pixels));
    bst_assert_close(pixels[0], 100.0 - 16384.0, 0.0); /* exact in float */
    bst_assert_close(pixels[1], 100.0 + 16383.5, 0.0);
    assert_true(isnan(pixels[2]));
    bst_assert_close(pixels[3], 102.0, 0.0);
    free(pixels);
    scratch_remove(&f.place);
}

/* An empty primary array and a cube are passed over. */
static void image_in_an_extension(void **state) {
    (void)state;
    fixture f = begin();
    header(&f, true, 8, 0, 0, 0);
    end_header(&f);
    header(&f, false, 8, 3, 2, 2);
    end_header(&f);
    big_endian(&f, 0, 8);
    pad(&f, 0);
    header(&f, false, 8, 2, 1, 2);
    end_header(&f);
    big_endian(&f, 0x2A2B, 2);
    pad(&f, 0);
    int nx, ny;
    float *pixels;
    bst_assert_ok(&f.ctx, read_back(&f, &nx, &ny, &pixels));
    assert_int_equal(nx, 1);
    assert_int_equal(ny, 2);
    bst_assert_close(pixels[0], 42, 0.0);
    bst_assert_close(pixels[1], 43, 0.0);
    free(pixels);
    scratch_remove(&f.place);
}

static void what_is_wrong_is_said(void **state) {
    (void)state;
    fixture f = begin();
    unlink(f.path);
    expect_error(&f, BST_ERR_NOT_FOUND,
                 "cannot be opened: No such file or directory; give a FITS file");

    f = begin();
    put(&f, "This is no FITS file.", 21);
    expect_error(&f, BST_ERR_FORMAT,
                 "does not begin as a FITS file does (allowed: FITS, not compressed as a whole)");

    /* gzip, which cfitsio would unpack */
    f = begin();
    put(&f, "\x1F\x8B\x08\0\0\0\0\0\0\3\3\0\0\0\0\0\0\0\0\0", 20);
    expect_error(&f, BST_ERR_FORMAT,
                 "does not begin as a FITS file does (allowed: FITS, not compressed as a whole)");

    f = begin();
    put(&f, "SIMPLE  = ", 10);
    expect_error(&f, BST_ERR_FORMAT, "HDU 1: the header has no END");

    f = begin();
    header(&f, true, 8, 0, 0, 0);
    end_header(&f);
    expect_error(&f, BST_ERR_FORMAT, "has no image of two axes");

    f = begin();
    header(&f, true, 8, 2, 40000, 1);
    end_header(&f);
    for (int i = 0; i < 5000; i++) {
        big_endian(&f, 0, 8);
    }
    expect_error(
        &f, BST_ERR_FORMAT,
        "an image of 40000 x 1 pixels (allowed: sides of 1 to 32768, at most 268435456 pixels)");

    /* one row more than 2^28 pixels; nothing of the file but its header is on the disk */
    f = begin();
    header(&f, true, 8, 2, 16384, 16385);
    end_header(&f);
    assert_int_equal(fflush(f.file), 0);
    assert_int_equal(ftruncate(fileno(f.file), 2880 + 93213 * 2880L), 0);
    expect_error(&f, BST_ERR_FORMAT,
                 "an image of 16384 x 16385 pixels (allowed: sides of 1 to 32768, at most "
                 "268435456 pixels)");

    /* the data stop after the first of 100 rows */
    f = begin();
    header(&f, true, -32, 2, 720, 100);
    end_header(&f);
    for (int i = 0; i < 720; i++) {
        big_endian(&f, 0, 4);
    }
    expect_error(&f, BST_ERR_FORMAT, "HDU 1: is cut short: 288000 bytes of data, 2880 in the file");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_types),
        cmocka_unit_test(a_long_column),
        cmocka_unit_test(planes_of_three_axes),
        cmocka_unit_test(scaling_and_blank),
        cmocka_unit_test(image_in_an_extension),
        cmocka_unit_test(what_is_wrong_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
