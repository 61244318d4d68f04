/* Reading frame files back: whole, cut off, damaged. cfitsio compresses what is read here, so that
 * it is the judge of our decoder. */
#include <sys/stat.h>

#include "sim/io/fits_frames.h"
#include "sim/io/fits_reader.h"
#include "sim/io/fits_rice.h"
#include "tests/io/scratch.h"
#include "tests/io/sky_fixture.h"

enum { WIDTH = 67, HEIGHT = 8, FRAMES = 4 }; /* rows of two blocks of Rice and a piece */

typedef enum file_kind { EXTENSIONS, RICE, CUBE, KINDS } file_kind;

/* Rows of every kind that the code knows: one value, small and large differences, wrapping ones,
 * noise that does not compress. */
static uint16_t pixel(int frame, int x, int y) {
    uint32_t noise = (uint32_t)(x * 7919 + y * 104729 + frame * 1299709) * 2654435761u;
    switch (y % 8) {
        case 0:
            return (uint16_t)(frame * 1000);
        case 1:
            return (uint16_t)(500 + (noise >> 29));
        case 2:
            return (uint16_t)(500 + (noise >> 25));
        case 3:
            return x % 2 ? 65535 : 0;
        case 4:
            return (uint16_t)(noise >> 16);
        case 5:
            return x == 33 ? 65535 : 100;
        case 6:
            return (uint16_t)(x * 977);
        default:
            return (uint16_t)(32768 - (int)(noise >> 31));
    }
}

static void write_file(bst_ctx *ctx, const char *path, file_kind kind, bool checksums) {
    bst_camera camera = fixture_camera();
    camera.width_px = WIDTH;
    camera.height_px = HEIGHT;
    bst_fits_info info = {.observer = "a",
                          .instrument = "b",
                          .camera = &camera,
                          .compression = kind == RICE ? BST_FITS_RICE : BST_FITS_RAW,
                          .checksums = checksums};
    bst_fits *fits;
    bst_assert_ok(
        ctx, bst_fits_create(ctx, path, kind == CUBE ? BST_FITS_CUBE : BST_FITS_EXTENSIONS, &info,
                             &fits));
    for (int i = 0; i < FRAMES; i++) {
        uint16_t pixels[WIDTH * HEIGHT];
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            pixels[k] = pixel(i, k % WIDTH, k / WIDTH);
        }
        bst_fits_frame frame = {.id = 10 + 3 * i,
                                .exposure_s = 0.5,
                                .window = {0, 0, WIDTH, HEIGHT},
                                .binning = 1,
                                .bits = 16};
        bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T23:59:58.25Z", &frame.start));
        bst_assert_ok(ctx, bst_fits_write(ctx, fits, &frame, pixels, WIDTH, HEIGHT, NULL));
    }
    bst_assert_ok(ctx, bst_fits_close(ctx, fits));
}

static uint8_t *load(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    struct stat info;
    assert_int_equal(fstat(fileno(file), &info), 0);
    *bytes = (size_t)info.st_size;
    uint8_t *data = malloc(*bytes);
    assert_non_null(data);
    assert_int_equal(fread(data, 1, *bytes, file), *bytes);
    fclose(file);
    return data;
}

static void check_frame(bst_ctx *ctx, bst_fits_reader *reader, int index) {
    bst_fits_read_frame frame;
    bst_assert_ok(ctx, bst_fits_reader_frame(ctx, reader, index, &frame));
    assert_int_equal(frame.width, WIDTH);
    assert_int_equal(frame.height, HEIGHT);
    /* the cube of a killed run has no table yet */
    bool no_table = bst_fits_reader_info(reader)->cube && frame.exposure_id == -1;
    assert_true(no_table || frame.exposure_id == 10 + 3 * index);
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        assert_int_equal(frame.pixels[k], pixel(index, k % WIDTH, k / WIDTH));
    }
    /* a band of rows, one that reaches over the edge, and none */
    const int bands[][3] = {{1, 2, 2}, {HEIGHT - 1, 5, 1}, {0, 0, 0}, {HEIGHT, 3, 0}, {2, -1, 0}};
    for (size_t b = 0; b < sizeof bands / sizeof *bands; b++) {
        const int first = bands[b][0], found = bands[b][2];
        bst_assert_ok(ctx, bst_fits_reader_rows(ctx, reader, index, first, bands[b][1], &frame));
        assert_int_equal(frame.width, WIDTH);
        assert_int_equal(frame.height, HEIGHT);
        assert_int_equal(frame.pixels != NULL, found > 0);
        for (int k = 0; k < WIDTH * found; k++) {
            assert_int_equal(frame.pixels[k], pixel(index, k % WIDTH, first + k / WIDTH));
        }
    }
    assert_int_equal(bst_fits_reader_rows(ctx, reader, index, HEIGHT + 1, 1, &frame),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_fits_reader_rows(ctx, reader, index, -1, 1, &frame), BST_ERR_ARGUMENT);
}

static void test_whole(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    for (int k = 0; k < KINDS * 2; k++) {
        file_kind kind = (file_kind)(k / 2);
        char name[] = "a0.fits";
        name[1] = (char)('0' + k);
        const char *path = scratch_path(&s, name);
        write_file(&ctx, path, kind, k % 2);
        bst_fits_reader *reader;
        bst_assert_ok(&ctx, bst_fits_reader_open(&ctx, path, &reader));
        const bst_fits_file_info *info = bst_fits_reader_info(reader);
        assert_int_equal(info->frames, FRAMES);
        assert_int_equal(info->cube, kind == CUBE);
        assert_int_equal(info->compressed, kind == RICE);
        assert_false(info->cut_off);
        assert_int_equal(info->width, WIDTH);
        assert_int_equal(info->height, HEIGHT);
        for (int i = FRAMES - 1; i >= 0; i--) {
            int64_t id;
            bst_assert_ok(&ctx, bst_fits_reader_id(&ctx, reader, i, &id));
            assert_int_equal(id, 10 + 3 * i);
            check_frame(&ctx, reader, i);
        }
        int64_t id;
        assert_int_equal(bst_fits_reader_id(&ctx, reader, FRAMES, &id), BST_ERR_ARGUMENT);
        assert_non_null(strstr(ctx.message, "has no frame 4; it has 4"));
        bst_fits_reader_close(reader);
    }
    scratch_remove(&s);
}

/* The table of a cube that has fewer rows than the cube has planes: the others have no number. */
static void test_short_table(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    write_file(&ctx, scratch_path(&s, "cube.fits"), CUBE, false);
    size_t bytes, at = 2880;
    uint8_t *data = load(scratch_path(&s, "cube.fits"), &bytes);
    while (at + 2880 < bytes && memcmp(data + at, "XTENSION", 8) != 0) {
        at += 2880;
    }
    while (memcmp(data + at, "NAXIS2  =", 9) != 0) {
        at += 80;
    }
    memcpy(data + at + 10, "                   2", 20);
    bst_fits_reader *reader;
    bst_assert_ok(&ctx, bst_fits_reader_open_buffer(&ctx, "input", data, bytes, &reader));
    for (int i = 0; i < FRAMES; i++) {
        int64_t id;
        bst_assert_ok(&ctx, bst_fits_reader_id(&ctx, reader, i, &id));
        assert_int_equal(id, i < 2 ? 10 + 3 * i : -1);
    }
    bst_fits_reader_close(reader);
    free(data);
    scratch_remove(&s);
}

/* Frames of several windows: the file is as wide as its widest frame and as high as its highest. */
static void test_windows(void **state) {
    (void)state;
    static const int sizes[3][2] = {{5, 9}, {12, 4}, {3, 6}};
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_camera camera = fixture_camera();
    const bst_fits_info about = {.observer = "a", .instrument = "b", .camera = &camera};
    const char *path = scratch_path(&s, "windows.fits");
    bst_fits *fits;
    bst_assert_ok(&ctx, bst_fits_create(&ctx, path, BST_FITS_EXTENSIONS, &about, &fits));
    uint16_t pixels[64];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 64; k++) {
            pixels[k] = (uint16_t)(1000 * i + k);
        }
        bst_fits_frame frame = {.id = i,
                                .exposure_s = 0.5,
                                .window = {20, 30, sizes[i][0], sizes[i][1]},
                                .binning = 1,
                                .bits = 16};
        bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T23:59:58.25Z", &frame.start));
        bst_assert_ok(&ctx,
                      bst_fits_write(&ctx, fits, &frame, pixels, sizes[i][0], sizes[i][1], NULL));
    }
    bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));
    bst_fits_reader *reader;
    bst_assert_ok(&ctx, bst_fits_reader_open(&ctx, path, &reader));
    assert_int_equal(bst_fits_reader_info(reader)->width, 12);
    assert_int_equal(bst_fits_reader_info(reader)->height, 9);
    for (int i = 0; i < 3; i++) {
        bst_fits_read_frame frame;
        bst_assert_ok(&ctx, bst_fits_reader_frame(&ctx, reader, i, &frame));
        assert_int_equal(frame.width, sizes[i][0]);
        assert_int_equal(frame.height, sizes[i][1]);
        for (int k = 0; k < sizes[i][0] * sizes[i][1]; k++) {
            assert_int_equal(frame.pixels[k], 1000 * i + k);
        }
    }
    bst_fits_reader_close(reader);
    /* blocks of 2880 bytes, the last one filled with zeros after 18 pixels */
    size_t bytes;
    uint8_t *data = load(path, &bytes);
    assert_int_equal(bytes % 2880, 0);
    for (size_t k = 2 * 18; k < 2880; k++) {
        assert_int_equal(data[bytes - 2880 + k], 0);
    }
    free(data);
    scratch_remove(&s);
}

/* Opens bytes and reads all that is there; returns the number of frames that were right. Memory of
 * exact size shows a read beyond it to the address sanitizer. */
static int read_all(const uint8_t *data, size_t bytes, bool exact) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    uint8_t *copy = malloc(bytes + (bytes == 0));
    assert_non_null(copy);
    memcpy(copy, data, bytes);
    bst_fits_reader *reader;
    int right = 0;
    bst_status status = bst_fits_reader_open_buffer(&ctx, "input", copy, bytes, &reader);
    assert_true((status == BST_OK) == (reader != NULL) && (status == BST_OK) == !ctx.message[0]);
    for (int64_t i = 0; reader && i < bst_fits_reader_info(reader)->frames && i < 8; i++) {
        bst_fits_read_frame frame;
        status = bst_fits_reader_frame(&ctx, reader, i, &frame);
        assert_true(status == BST_OK || strncmp(ctx.message, "input: ", 7) == 0);
        right += status == BST_OK;
        if (exact) {
            check_frame(&ctx, reader, (int)i);
        }
    }
    bst_fits_reader_close(reader);
    free(copy);
    return right;
}

/* Whole planes in the first bytes of a cube: FITS 4.0, section 3.3.2. */
static int whole_planes(const uint8_t *data, size_t bytes) {
    size_t end = 0, plane = 2 * WIDTH * HEIGHT;
    while (memcmp(data + end, "END     ", 8) != 0) {
        end += 80;
    }
    size_t start = (end / 2880 + 1) * 2880;
    size_t planes = bytes > start ? (bytes - start) / plane : 0;
    return planes < FRAMES ? (int)planes : FRAMES;
}

static void test_cut_off(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    for (int kind = 0; kind < KINDS; kind++) {
        char name[] = "a0.fits";
        name[1] = (char)('0' + kind);
        const char *path = scratch_path(&s, name);
        write_file(&ctx, path, (file_kind)kind, true);
        size_t bytes;
        uint8_t *data = load(path, &bytes);
        int most = 0;
        for (size_t n = 0; n <= bytes; n++) {
            if (n % 37 != 0 && n % 2880 > 2 && n % 2880 < 2878) {
                continue;
            }
            int right = read_all(data, n, true);
            assert_true(right >= most && right <= FRAMES);
            assert_true(kind != CUBE || right == whole_planes(data, n));
            most = right;
        }
        assert_int_equal(most, FRAMES);
        free(data);
    }
    scratch_remove(&s);
}

static void test_damaged(void **state) {
    (void)state;
    enum { DAMAGES = 800 }; /* the fuzzer of this reader tries millions */
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    uint64_t random = 1;
    for (int kind = 0; kind < KINDS; kind++) {
        char name[] = "a0.fits";
        name[1] = (char)('0' + kind);
        const char *path = scratch_path(&s, name);
        write_file(&ctx, path, (file_kind)kind, true);
        size_t bytes;
        uint8_t *data = load(path, &bytes);
        int refused = 0;
        for (int i = 0; i < DAMAGES; i++) {
            random = random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            size_t at = (size_t)(random >> 20) % bytes;
            uint8_t before = data[at];
            data[at] = i % 2 ? (uint8_t)(random >> 56) : (uint8_t)('0' + (random >> 56) % 10);
            refused += read_all(data, bytes, false) < FRAMES;
            data[at] = before;
        }
        /* headers are most of these files, and few of their bytes matter */
        assert_true(refused > 0 && refused < DAMAGES);
        assert_int_equal(read_all(data, bytes, true), FRAMES);
        free(data);
    }
    scratch_remove(&s);
}

/* The place of a card's value in the first frame's header; NULL without. */
static char *value_of(uint8_t *data, size_t bytes, const char *key) {
    for (size_t at = 2880; at + 80 <= bytes; at += 80) {
        if (memcmp(data + at, key, strlen(key)) == 0) {
            return (char *)data + at + 10;
        }
    }
    return NULL;
}

static void test_messages(void **state) {
    (void)state;
    static const struct {
        file_kind kind;
        const char *key, *value, *message;
    } cases[] = {
        {EXTENSIONS, "NAXIS1  =", "               40000",
         "input: HDU 2: an image of 40000 x 8 pixels (allowed: sides of 1 to 32768)"},
        {EXTENSIONS, "NAXIS2  =", "                   0",
         "input: HDU 2: an image of 67 x 0 pixels (allowed: sides of 1 to 32768)"},
        {EXTENSIONS, "BITPIX  =", "                   8",
         "input: HDU 2: has pixels of another kind (allowed: 16-bit unsigned images, as they are "
         "or "
         "compressed by RICE_1, a row to a tile)"},
        {EXTENSIONS, "BZERO   =", "                   0",
         "input: HDU 2: has pixels of another kind (allowed: 16-bit unsigned images, as they are "
         "or "
         "compressed by RICE_1, a row to a tile)"},
        {RICE, "ZCMPTYPE=", "'GZIP_1  '          ",
         "input: HDU 2: is compressed in another way (allowed: 16-bit unsigned images, as they are "
         "or compressed by RICE_1, a row to a tile)"},
        {RICE, "ZTILE2  =", "                   8",
         "input: HDU 2: is compressed in another way (allowed: 16-bit unsigned images, as they are "
         "or compressed by RICE_1, a row to a tile)"},
        {RICE, "ZBITPIX =", "                  32",
         "input: HDU 2: has pixels of another kind (allowed: 16-bit unsigned images, as they are "
         "or "
         "compressed by RICE_1, a row to a tile)"},
        {RICE, "ZNAXIS2 =", "                   9",
         "input: HDU 2: its table is not that of the compressed image it claims to be"},
        {RICE, "ZNAXIS2 =", "                   7",
         "input: HDU 2: its table is not that of the compressed image it claims to be"},
        {RICE, "NAXIS1  =", "                   7",
         "input: HDU 2: its table is not that of the compressed image it claims to be"},
        {RICE, "ZVAL1   =", "                   0",
         "input: HDU 2: its table is not that of the compressed image it claims to be"},
        {RICE, "ZNAXIS1 =", "               32769",
         "input: HDU 2: an image of 32769 x 8 pixels (allowed: sides of 1 to 32768)"},
    };
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    uint8_t *files[KINDS];
    size_t bytes[KINDS];
    for (int kind = 0; kind < KINDS; kind++) {
        char name[] = "a0.fits";
        name[1] = (char)('0' + kind);
        write_file(&ctx, scratch_path(&s, name), (file_kind)kind, false);
        files[kind] = load(scratch_path(&s, name), &bytes[kind]);
    }
    bst_fits_reader *reader;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t *data = files[cases[i].kind];
        char *value = value_of(data, bytes[cases[i].kind], cases[i].key), before[20];
        assert_non_null(value);
        memcpy(before, value, sizeof before);
        memcpy(value, cases[i].value, sizeof before);
        /* tiles as wide as the image, so that its width is what is wrong */
        char *tile = value_of(data, bytes[cases[i].kind], "ZTILE1  ="), old_tile[20] = "";
        bool widened = strcmp(cases[i].key, "ZNAXIS1 =") == 0;
        if (widened) {
            memcpy(old_tile, tile, sizeof old_tile);
            memcpy(tile, cases[i].value, sizeof old_tile);
        }
        assert_int_equal(
            bst_fits_reader_open_buffer(&ctx, "input", data, bytes[cases[i].kind], &reader),
            BST_ERR_FORMAT);
        assert_string_equal(ctx.message, cases[i].message);
        memcpy(value, before, sizeof before);
        if (widened) {
            memcpy(tile, old_tile, sizeof old_tile);
        }
    }
    /* a row's place and size, the first bytes behind the header of a compressed frame */
    uint8_t *table = (uint8_t *)strstr(value_of(files[RICE], bytes[RICE], "ZIMAGE  ="), "END     ");
    assert_non_null(table);
    size_t at = ((size_t)(table - files[RICE]) / 2880 + 1) * 2880;
    for (int k = 0; k < 8; k += 2) {
        uint8_t before = files[RICE][at + 8 + (size_t)k];
        bst_fits_read_frame frame;
        files[RICE][at + 8 + (size_t)k] = 0x7f;
        bst_assert_ok(
            &ctx, bst_fits_reader_open_buffer(&ctx, "input", files[RICE], bytes[RICE], &reader));
        assert_int_equal(bst_fits_reader_frame(&ctx, reader, 0, &frame), BST_ERR_FORMAT);
        assert_string_equal(ctx.message, "input: HDU 2: row 1 of the compressed pixels is damaged");
        check_frame(&ctx, reader, 1);
        bst_fits_reader_close(reader);
        files[RICE][at + 8 + (size_t)k] = before;
    }
    for (int kind = 0; kind < KINDS; kind++) {
        free(files[kind]);
    }
    const char *missing = scratch_path(&s, "none.fits");
    assert_int_equal(bst_fits_reader_open(&ctx, missing, &reader), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "none.fits: cannot be opened: No such file or directory"));
    assert_int_equal(bst_fits_reader_open(&ctx, s.folder, &reader), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, ": is not a file"));
    assert_int_equal(bst_fits_reader_open_buffer(&ctx, "input", NULL, 0, &reader), BST_ERR_FORMAT);
    assert_string_equal(ctx.message, "input: HDU 1: the header has no END");
    scratch_remove(&s);
}

/* The code itself, by hand: FITS 4.0, section 10.4.1. First pixel 0x0102, then a block of code 0
 * (all equal), cut short, and what the code does not allow. */
static void test_rice(void **state) {
    (void)state;
    uint16_t out[64];
    const uint8_t equal[] = {0x01, 0x02, 0x00};
    assert_true(bst_fits_rice_decode(equal, 3, 32, out, 32));
    assert_int_equal(out[0], 0x0102);
    assert_int_equal(out[31], 0x0102);
    assert_false(bst_fits_rice_decode(equal, 2, 32, out, 32));
    assert_false(bst_fits_rice_decode(equal, 0, 32, out, 1));
    assert_true(bst_fits_rice_decode(equal, 3, 32, out, 64)); /* two codes in eight bits */
    assert_false(bst_fits_rice_decode(equal, 3, 21, out, 64));
    /* code 2: one low bit. Differences 0, +1, -1, +2 are 0, 2, 1, 4: 1|0 01|0 1|1 001|0 */
    /* 0010 10 010 11 0010 = 0010 1001 0110 010 */
    const uint8_t bits[] = {0x00, 0x05, 0x29, 0x64};
    assert_true(bst_fits_rice_decode(bits, 4, 32, out, 4));
    assert_int_equal(out[0], 5);
    assert_int_equal(out[1], 6);
    assert_int_equal(out[2], 5);
    assert_int_equal(out[3], 7);
    /* code 14: 13 low bits; at most 7 zeros before the one, the eighth is refused */
    const uint8_t high[] = {0x00, 0x00, 0xe0, 0x00, 0xff, 0xff, 0xff};
    assert_false(bst_fits_rice_decode(high, 7, 32, out, 1));
    /* code 15: 16 bits as they are; 65535 is -32768 */
    const uint8_t verbatim[] = {0x00, 0x01, 0xff, 0xff, 0xf0};
    assert_true(bst_fits_rice_decode(verbatim, 5, 32, out, 1));
    assert_int_equal(out[0], 32769);
}

/* 32-bit pixels of code 1, whose number of zeros the code does not limit: +2 as 0 0001 | 0000 1,
 * and data that end before the one. */
static void test_rice_of_32_bits(void **state) {
    (void)state;
    int32_t out[64];
    const uint8_t whole[] = {0x00, 0x00, 0x00, 0x07, 0x08, 0x40};
    assert_true(bst_fits_rice_decode_wide(whole, 6, 32, 4, out, 1));
    assert_int_equal(out[0], 9);
    uint8_t endless[40] = {0x00, 0x00, 0x00, 0x07, 0x08};
    assert_false(bst_fits_rice_decode_wide(endless, 5, 32, 4, out, 1));
    assert_false(bst_fits_rice_decode_wide(endless, sizeof endless, 32, 4, out, 64));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_whole),           cmocka_unit_test(test_short_table),
        cmocka_unit_test(test_cut_off),         cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_messages),        cmocka_unit_test(test_rice),
        cmocka_unit_test(test_rice_of_32_bits), cmocka_unit_test(test_windows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
