/* PNG and TIFF files of other programs: their pixels, and what is wrong with them. */
#include "sim/io/image_file.h"
#include "tests/io/written_pictures.h"

/* Reads page `page` of the file. */
static bst_status read_page(fixture *f, bst_image_colour colour, int64_t page, int size[2],
                            float *pixels) {
    bst_image_file *file;
    bst_status status = bst_image_file_open(&f->ctx, f->path, colour, &file);
    if (status == BST_OK) {
        status = bst_image_file_select(&f->ctx, file, page, &size[0], &size[1]);
    }
    if (status == BST_OK && size[0] * size[1] <= 64) {
        status = bst_image_file_pixels(&f->ctx, file, pixels);
    }
    bst_image_file_close(file);
    return status;
}

/* The file must give these pixels. */
static void expect(fixture *f, bst_image_colour colour, int64_t page, int width, int height,
                   const double *values) {
    int size[2];
    float pixels[64];
    bst_assert_ok(&f->ctx, read_page(f, colour, page, size, pixels));
    assert_int_equal(size[0], width);
    assert_int_equal(size[1], height);
    for (int i = 0; i < width * height; i++) {
        bst_assert_close(pixels[i], values[i], 0.0); /* as stored */
    }
}

/* The file must be refused with words. */
static void refuse(fixture *f, bst_image_colour colour, const char *words) {
    int size[2];
    float pixels[64];
    bst_status status = read_page(f, colour, 0, size, pixels);
    if (status != BST_ERR_FORMAT || !strstr(f->ctx.message, f->path) ||
        !strstr(f->ctx.message, words)) {
        fail_msg("\"%s\" does not say \"%s\"", f->ctx.message, words);
    }
}

static void test_png(void **state) {
    (void)state;
    fixture f = begin("frame.bin"); /* recognised by its bytes */
    write_png16(&f, 3, 2, 65530);
    expect(&f, 0, 0, 3, 2, (const double[]){65530, 65531, 65532, 65533, 65534, 65535});
    write_png(&f, 2, 2, 8, 0, 0, "\0\1\2\0\3\xff", 6);
    expect(&f, 0, 0, 2, 2, (const double[]){1, 2, 3, 255});
    write_png(&f, 2, 1, 4, 0, 0, "\0\x5f", 2); /* values of 4 bits are not stretched */
    expect(&f, 0, 0, 2, 1, (const double[]){5, 15});
    write_png(&f, 2, 2, 8, 0, 0, "\2\1\2\2\3\4", 6); /* filter "up" */
    expect(&f, 0, 0, 2, 2, (const double[]){1, 2, 4, 6});
    /* a black picture of 1 bit, 1024 bytes a row that unpack to 8192 values */
    uint8_t black[64 * 1025] = {0};
    write_png(&f, 8192, 64, 1, 0, 0, black, sizeof black);
    int width, height;
    bst_image_file *file;
    bst_assert_ok(&f.ctx, bst_image_file_open(&f.ctx, f.path, BST_IMAGE_COLOUR_REFUSE, &file));
    bst_assert_ok(&f.ctx, bst_image_file_select(&f.ctx, file, 0, &width, &height));
    assert_int_equal(width, 8192);
    bst_image_file_close(file);
    /* Adam7: the first pixel is of pass 1, the second one of pass 6 */
    write_png(&f, 2, 1, 8, 0, 1, "\0\7\0\x9", 4);
    expect(&f, 0, 0, 2, 1, (const double[]){7, 9});
    end(&f);
}

static void test_png_colour(void **state) {
    (void)state;
    fixture f = begin("colour.png");
    write_png(&f, 1, 1, 8, 2, 0, "\0\1\2\x9", 4);
    refuse(&f, BST_IMAGE_COLOUR_REFUSE, "has colours (allowed: grey");
    expect(&f, BST_IMAGE_COLOUR_MEAN, 0, 1, 1, (const double[]){4});
    expect(&f, BST_IMAGE_COLOUR_RED, 0, 1, 1, (const double[]){1});
    expect(&f, BST_IMAGE_COLOUR_GREEN, 0, 1, 1, (const double[]){2});
    expect(&f, BST_IMAGE_COLOUR_BLUE, 0, 1, 1, (const double[]){9});
    write_png(&f, 1, 1, 8, 4, 0, "\0\6\x80", 3);
    refuse(&f, BST_IMAGE_COLOUR_REFUSE, "has transparency");
    expect(&f, BST_IMAGE_COLOUR_MEAN, 0, 1, 1, (const double[]){6});
    write_png(&f, 2, 1, 8, 3, 0, "\0\1\0", 3);
    refuse(&f, BST_IMAGE_COLOUR_REFUSE, "a palette");
    expect(&f, BST_IMAGE_COLOUR_MEAN, 0, 2, 1, (const double[]){5, 2});
    end(&f);
}

/* A file that is cut anywhere or has a wrong byte is refused, with a message that names it. */
static void test_png_damaged(void **state) {
    (void)state;
    fixture f = begin("cut.png");
    int size[2];
    float pixels[64];
    write_png16(&f, 3, 2, 100);
    for (size_t count = 0; count < f.count; count++) {
        save(&f, count);
        refuse(&f, 0, "");
    }
    save(&f, f.count - 20);
    refuse(&f, 0, "is cut short; copy or download the file again");
    for (size_t i = 0; i < f.count; i++) {
        f.bytes[i] ^= 0x10;
        save(&f, f.count);
        bst_status status = read_page(&f, 0, 0, size, pixels);
        assert_true(status == BST_ERR_FORMAT || i >= f.count - 12); /* lengths after the pixels */
        f.bytes[i] ^= 0x10;
    }
    write_png(&f, 30000, 30000, 16, 0, 0, "\0\1\2", 3);
    refuse(&f, 0, "30000 x 30000 pixels cannot be in");
    write_png(&f, 40000, 1, 8, 0, 0, "\0\1\2", 3);
    refuse(&f, 0, "is 40000 x 1 pixels (allowed: sides of 1 to 32768)");
    f.count = 0;
    put(&f, "GIF89a..", 8);
    save(&f, f.count);
    refuse(&f, 0, "does not begin as a PNG or TIFF file does");
    end(&f);
}

static void test_tiff(void **state) {
    (void)state;
    fixture f = begin("frames.tif");
    const tiff_page little[] = {
        {.width = 2, .height = 2, .bits = 16, .data = "\1\2\3\4\5\6\7\x8", .bytes = 8},
        {.width = 3, .height = 1, .bits = 8, .data = "\1\2\xff", .bytes = 3},
        {.width = 1, .height = 1, .bits = 16, .format = 2, .data = "\xfe\xff", .bytes = 2},
        {.width = 1, .height = 1, .bits = 32, .format = 3, .data = "\0\0\xc0\xbf", .bytes = 4}};
    write_tiff(&f, false, little, 4);
    for (int pass = 0; pass < 2; pass++) { /* in any order */
        expect(&f, 0, 0, 2, 2, (const double[]){513, 1027, 1541, 2055});
        expect(&f, 0, 3, 1, 1, (const double[]){-1.5});
        expect(&f, 0, 1, 3, 1, (const double[]){1, 2, 255});
        expect(&f, 0, 2, 1, 1, (const double[]){-2});
    }
    const tiff_page big[] = {
        {.width = 1, .height = 2, .bits = 16, .data = "\1\2\3\4", .bytes = 4},
        {.width = 1, .height = 2, .bits = 16, .orientation = 4, .data = "\1\2\3\4", .bytes = 4}};
    write_tiff(&f, true, big, 2);
    expect(&f, 0, 0, 1, 2, (const double[]){258, 772});
    expect(&f, 0, 1, 1, 2, (const double[]){772, 258}); /* its first row is at the bottom */
    const tiff_page colours = {.width = 1,
                               .height = 1,
                               .bits = 8,
                               .samples = 3,
                               .photometric = 2,
                               .data = "\1\2\x9",
                               .bytes = 3};
    write_tiff(&f, false, &colours, 1);
    refuse(&f, BST_IMAGE_COLOUR_REFUSE, "PhotometricInterpretation is 2");
    expect(&f, BST_IMAGE_COLOUR_MEAN, 0, 1, 1, (const double[]){4});
    expect(&f, BST_IMAGE_COLOUR_BLUE, 0, 1, 1, (const double[]){9});
    /* PackBits: two equal bytes, then two others */
    const tiff_page packed = {.width = 4,
                              .height = 1,
                              .bits = 8,
                              .compression = 32773,
                              .data = "\xff\7\1\3\4",
                              .bytes = 5};
    write_tiff(&f, false, &packed, 1);
    expect(&f, 0, 0, 4, 1, (const double[]){7, 7, 3, 4});
    end(&f);
}

/* All pages of a file are read without a search from the first, and can be read again. */
static void test_tiff_cube(void **state) {
    (void)state;
    enum { PAGES = 40 };
    fixture f = begin("cube.tif");
    tiff_page pages[PAGES];
    uint8_t values[PAGES][2];
    for (int i = 0; i < PAGES; i++) {
        values[i][0] = (uint8_t)i;
        values[i][1] = 1;
        pages[i] = (tiff_page){.width = 1, .height = 1, .bits = 16, .data = values[i], .bytes = 2};
    }
    write_tiff(&f, false, pages, PAGES);
    bst_image_file *file;
    bst_assert_ok(&f.ctx, bst_image_file_open(&f.ctx, f.path, 0, &file));
    assert_int_equal(bst_image_file_pages(file), PAGES);
    for (int i = 0; i < 2 * PAGES; i++) {
        int page = i < PAGES ? i : 2 * PAGES - 1 - i, width, height;
        float value;
        bst_assert_ok(&f.ctx, bst_image_file_select(&f.ctx, file, page, &width, &height));
        bst_assert_ok(&f.ctx, bst_image_file_pixels(&f.ctx, file, &value));
        bst_assert_close(value, 256 + page, 0.0);
    }
    int width, height;
    assert_int_equal(bst_image_file_select(&f.ctx, file, PAGES, &width, &height), BST_ERR_ARGUMENT);
    assert_non_null(strstr(f.ctx.message, "cube.tif: has no page 41 (allowed: 1 to 40)"));
    bst_image_file_close(file);
    end(&f);
}

static void test_tiff_refused(void **state) {
    (void)state;
    static const struct {
        tiff_page page;
        const char *says;
    } cases[] = {
        {{.width = 1, .height = 1, .bits = 12}, "BitsPerSample is 12"},
        {{.width = 1, .height = 1, .bits = 64, .format = 3}, "BitsPerSample is 64"},
        {{.width = 1, .height = 1, .bits = 8, .photometric = -1}, "PhotometricInterpretation is 0"},
        {{.width = 1, .height = 1, .bits = 8, .orientation = 3}, "Orientation is 3"},
        {{.width = 1, .height = 1, .bits = 8, .compression = 7},
         "Compression is 7 (allowed: 1 none, 5 LZW"},
        {{.width = 1, .height = 1, .bits = 8, .compression = 34925}, "Compression is 34925"},
        {{.width = 1, .height = 1, .bits = 8, .samples = 2}, "SamplesPerPixel is 2"},
        {{.width = 1, .height = 1, .bits = 32, .format = 5}, "SampleFormat is 5"},
        {{.width = 30000, .height = 30000, .bits = 16}, "cannot be in"},
        {{.width = 0, .height = 1, .bits = 16}, "cannot be read as a TIFF file"},
    };
    fixture f = begin("other.tif");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        tiff_page page = cases[i].page;
        page.data = "\1\2\3\4\5\6\7\x8";
        page.bytes = 8;
        write_tiff(&f, false, &page, 1);
        refuse(&f, 0, cases[i].says);
    }
    end(&f);
}

/* A file that is cut anywhere is refused; one with a wrong byte is refused or read. */
static void test_tiff_damaged(void **state) {
    (void)state;
    fixture f = begin("cut.tif");
    const tiff_page page = {.width = 2, .height = 2, .bits = 16, .data = "12345678", .bytes = 8};
    int size[2];
    float pixels[64];
    write_tiff(&f, false, &page, 1);
    size_t whole = f.count;
    for (size_t count = 0; count < whole; count++) {
        save(&f, count);
        refuse(&f, 0, "");
    }
    for (size_t i = 0; i < whole; i++) {
        f.bytes[i] ^= (uint8_t)(1 << i % 8);
        save(&f, whole);
        bst_status status = read_page(&f, 0, 0, size, pixels);
        assert_true(status == BST_OK || strstr(f.ctx.message, f.path));
        f.bytes[i] ^= (uint8_t)(1 << i % 8);
    }
    end(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_png),          cmocka_unit_test(test_png_colour),
        cmocka_unit_test(test_png_damaged),  cmocka_unit_test(test_tiff),
        cmocka_unit_test(test_tiff_cube),    cmocka_unit_test(test_tiff_refused),
        cmocka_unit_test(test_tiff_damaged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
