/* FITS images that are wrong: calibration maps and other files that cfitsio reads for us. */
#include "sim/io/fits_image.h"
#include "tests/bad_input/faults.h"

enum { BLOCK = 2880, CARD = 80 };

static bst_status read_fits(bst_ctx *ctx, const char *path) {
    int width, height;
    float *pixels;
    bst_status status = bst_fits_read_image(ctx, path, &width, &height, &pixels);
    assert_true((status == BST_OK) == (pixels != NULL));
    free(pixels);
    return status;
}

static const bad_reader reader = {read_fits, "a FITS file", "", 4ull << 30};

static void paths(void **state) {
    (void)state;
    bad_paths(&reader);
}

/* cfitsio's extended file names must not be understood: brackets and pipes are part of the name. */
static void names_are_names(void **state) {
    (void)state;
    static const char *const names[] = {
        "x.fits[1:2,1:2]",           "x.fits(y.fits)", "mem://x", "-",
        "http://localhost:1/x.fits", "| cat x",        "x.fits+1"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        bad_expect_kind(&reader, names[i], BST_ERR_NOT_FOUND,
                        "cannot be opened: No such file or directory");
    }
}

/* One block of cards, padded, and `data_bytes` zero bytes after it. */
static char *make(const char *const *cards, size_t data_bytes, size_t *bytes) {
    char *file = calloc(1, BLOCK + data_bytes + 1);
    assert_non_null(file);
    memset(file, ' ', BLOCK);
    for (int i = 0; cards[i]; i++) {
        memcpy(file + i * CARD, cards[i], strlen(cards[i]));
    }
    *bytes = BLOCK + data_bytes;
    return file;
}

#define SIMPLE "SIMPLE  =                    T"
#define TWO_AXES "NAXIS   =                    2"
#define START ": does not begin as a FITS file does (allowed: FITS, not compressed as a whole)"

static void wrong_contents(void **state) {
    (void)state;
    static const struct {
        const char *cards[8];
        size_t data_bytes;
        bst_status status;
        const char *message;
    } cases[] = {
        {{SIMPLE}, 0, BST_ERR_FORMAT, ": HDU 1: the header has no END"},
        {{SIMPLE, "END"}, 0, BST_ERR_FORMAT, ": HDU 1: BITPIX, NAXIS or one of NAXISn is missing"},
        {{SIMPLE, "BITPIX  =                    8", "NAXIS   =                    0", "END"},
         0,
         BST_ERR_FORMAT,
         ": has no image of two axes"},
        {{"SIMPLE  =                    F", "BITPIX  =                    8",
          "NAXIS   =                    0", "END"},
         0,
         BST_ERR_FORMAT,
         ": has no image of two axes"},
        {{SIMPLE, "BITPIX  =                    7", TWO_AXES, "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is wrong (found 7; allowed: 8, 16, 32, 64, -32, -64)"},
        {{SIMPLE, "BITPIX  =                    0", TWO_AXES, "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is wrong (found 0; allowed: 8, 16, 32, 64, -32, -64)"},
        {{SIMPLE, "BITPIX  =                   -8", TWO_AXES, "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is wrong (found -8; allowed: 8, 16, 32, 64, -32, -64)"},
        {{SIMPLE, "BITPIX  =                  8.0", TWO_AXES, "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is wrong (found 8.0; allowed: 8, 16, 32, 64, -32, -64)"},
        {{SIMPLE, "BITPIX  =                1e400", TWO_AXES, "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is wrong (found 1e400; allowed: 8, 16, 32, 64, -32, -64)"},
        {{SIMPLE, "BITPIX  =                  NaN", TWO_AXES, "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is wrong (found NaN; allowed: 8, 16, 32, 64, -32, -64)"},
        {{SIMPLE, "BITPIX  =                    8", "NAXIS   =", "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS is wrong (found nothing; allowed: an integer from 0 to 9)"},
        {{SIMPLE, "BITPIX  =                    8", "NAXIS   =                   10", "END"},
         0,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS is wrong (found 10; allowed: an integer from 0 to 9)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                   -1",
          "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS1 is wrong (found -1; allowed: an integer from 0 to 1000000000000)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =  9223372036854775807",
          "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS1 is wrong (found 9223372036854775807; allowed: an integer from 0 to "
         "1000000000000)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                  1.5",
          "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS1 is wrong (found 1.5; allowed: an integer from 0 to 1000000000000)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                1e400",
          "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS1 is wrong (found 1e400; allowed: an integer from 0 to 1000000000000)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    T",
          "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS1 is wrong (found T; allowed: an integer from 0 to 1000000000000)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    1", "NAXIS1  =                    6", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: NAXIS1 is given twice"},
        {{SIMPLE, "BITPIX  =                    8", "BITPIX  =                   16", TWO_AXES,
          "NAXIS1  =                    5", "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX is given twice"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: BITPIX, NAXIS or one of NAXISn is missing"},
        {{SIMPLE, TWO_AXES, "BITPIX  =                    8", "NAXIS1  =                    5",
          "NAXIS2  =                    1", "END"},
         BLOCK,
         BST_ERR_IO,
         ": cannot be read: second keyword not BITPIX"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    0",
          "NAXIS2  =                    1", "END"},
         0,
         BST_ERR_FORMAT,
         ": an image of 0 x 1 pixels (allowed: sides of 1 to 32768, at most 268435456 pixels)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                30000",
          "NAXIS2  =                    0", "END"},
         0,
         BST_ERR_FORMAT,
         ": an image of 30000 x 0 pixels (allowed: sides of 1 to 32768, at most 268435456 pixels)"},
        {{SIMPLE, "BITPIX  =                  -64", TWO_AXES, "NAXIS1  =                16384",
          "NAXIS2  =                16384", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: is cut short: 2147483648 bytes of data, 2880 in the file"},
        {{SIMPLE, "BITPIX  =                  -64", TWO_AXES, "NAXIS1  =        1000000000000",
          "NAXIS2  =        1000000000000", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: is cut short: 576460752303423480 bytes of data, 2880 in the file"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    5", "ZIMAGE  =                    T", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: is a compressed image (allowed: images that are not compressed); unpack the "
         "file with funpack"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    5", "PCOUNT  =                   -1", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: PCOUNT is wrong (found -1; allowed: an integer from 0 to 1000000000000)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    5", "GCOUNT  =                    2", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: GCOUNT is wrong (found 2; allowed: 1)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    5", "TFIELDS =                 1000", "END"},
         BLOCK,
         BST_ERR_FORMAT,
         ": HDU 1: TFIELDS is wrong (found 1000; allowed: an integer from 0 to 999)"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    5", "END"},
         BLOCK + 1,
         BST_ERR_FORMAT,
         ": HDU 2: the header has no END"},
        {{SIMPLE, "BITPIX  =                    8", TWO_AXES, "NAXIS1  =                    5",
          "NAXIS2  =                    5", "END"},
         3 * BLOCK,
         BST_ERR_FORMAT,
         ": HDU 2: does not begin with XTENSION"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t bytes;
        char *file = make(cases[i].cards, cases[i].data_bytes, &bytes);
        bad_bytes(&reader, file, bytes, cases[i].status, cases[i].message);
        free(file);
    }
    bad_text(&reader, "", BST_ERR_FORMAT, START);
    bad_text(&reader, "SIMPLE", BST_ERR_FORMAT, START);
    bad_text(&reader, "\xFF\xFES", BST_ERR_FORMAT, START);
    bad_bytes(&reader, "\x1F\x8B\x08\0\0\0\0\0\0\3", 10, BST_ERR_FORMAT, START); /* gzip */
    bad_text(&reader, "PK\3\4", BST_ERR_FORMAT, START);                          /* zip */
}

/* Tables about which cfitsio 4.2 believes what is not there; the fuzzer found them. */
static void wrong_tables(void **state) {
    (void)state;
    static const struct {
        const char *card, *message;
    } cases[] = {
        {"TFIELDS =                    0", ": HDU 2: PCOUNT, GCOUNT or TFIELDS is missing"},
        {"HIERARCH ZIMAGE .= T",
         ": HDU 2: is a compressed image (allowed: images that are not compressed); unpack the "
         "file with funpack"},
        {"ZIMAGE  =                    T ? no comment",
         ": HDU 2: is a compressed image (allowed: images that are not compressed); unpack the "
         "file with funpack"},
    };
    static const char *const primary[] = {SIMPLE, "BITPIX  =                    8",
                                          "NAXIS   =                    0", "END", NULL};
    for (int i = 0; i < 3; i++) {
        const char *const table[] = {"XTENSION= 'BINTABLE'",
                                     "BITPIX  =                    8",
                                     TWO_AXES,
                                     "NAXIS1  =                    8",
                                     "NAXIS2  =                    0",
                                     cases[i].card,
                                     i == 0 ? "" : "PCOUNT  =                    0",
                                     i == 0 ? "" : "GCOUNT  =                    1",
                                     i == 0 ? "" : "TFIELDS =                    0",
                                     "END"};
        size_t bytes;
        char *file = make(primary, BLOCK, &bytes);
        memset(file + BLOCK, ' ', BLOCK);
        for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
            memcpy(file + BLOCK + k * CARD, table[k], strlen(table[k]));
        }
        bad_bytes(&reader, file, bytes, BST_ERR_FORMAT, cases[i].message);
        free(file);
    }
}

static void every_truncation(void **state) {
    (void)state;
    static const char *const cards[] = {SIMPLE,
                                        "BITPIX  =                   16",
                                        TWO_AXES,
                                        "NAXIS1  =                   10",
                                        "NAXIS2  =                    8",
                                        "END",
                                        NULL};
    size_t bytes;
    char *file = make(cards, BLOCK, &bytes);
    const size_t needed = BLOCK + 10 * 8 * 2;
    for (size_t n = 0; n <= bytes; n++) {
        bst_ctx ctx = {0};
        int width, height;
        float *pixels;
        bst_status status =
            bst_fits_read_image_buffer(&ctx, "x", file, n, &width, &height, &pixels);
        if (n < needed) {
            assert_int_not_equal(status, BST_OK);
            assert_memory_equal(ctx.message, "x: ", 3);
        }
        assert_true((status == BST_OK) == (pixels != NULL));
        free(pixels);
    }
    free(file);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),
        cmocka_unit_test(names_are_names),
        cmocka_unit_test(wrong_contents),
        cmocka_unit_test(wrong_tables),
        cmocka_unit_test(every_truncation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
