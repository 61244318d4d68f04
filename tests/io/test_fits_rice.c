/* The Rice code of pixels: the bytes of cfitsio's encoder, for tiles and for whole files. */
#include <fitsio.h>

#include "sim/io/fits_frames.h"
#include "sim/io/fits_rice.h"
#include "tests/io/scratch.h"
#include "tests/io/sky_fixture.h"

/* cfitsio's own, which its headers for users do not declare */
int fits_rcomp_short(short a[], int nx, unsigned char *c, int clen, int nblock);

enum { TILE_MOST = 4000, TILES = 4000, BYTES = 4 * TILE_MOST };

/* Numbers of a linear congruential generator (Knuth's MMIX constants). */
static uint32_t draw(void) {
    static uint64_t state = 281128;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 33);
}

typedef enum tile_kind { NOISE, EQUAL, OUTLIERS, JUMPS, STEPS, TILE_KINDS } tile_kind;

/* One pixel. `bits`: size of the noise */
static uint16_t make_pixel(tile_kind kind, uint16_t base, int bits) {
    const uint32_t noise = draw() & ((1u << bits) - 1);
    switch (kind) {
        case EQUAL:
            return base;
        case OUTLIERS:
            return draw() % 50 == 0 ? (uint16_t)draw() : (uint16_t)(base + noise);
        case JUMPS:
            return draw() % 2 ? UINT16_MAX : 0; /* differences of +-1 after wrapping */
        case STEPS:
            return draw() % 40 == 0 ? 0x8000 : 0;
        default:
            return (uint16_t)(base + noise);
    }
}

/* Tiles of all kinds, lengths and sizes of noise have cfitsio's bytes, fit the space of
 * bst_fits_rice_bytes, and decode to what they were. */
static void test_tiles(void **state) {
    (void)state;
    static uint16_t pixels[TILE_MOST], decoded[TILE_MOST];
    static short stored[TILE_MOST];
    static uint8_t ours[BYTES], theirs[BYTES];
    for (int t = 0; t < TILES; t++) {
        const int count = 1 + (int)(draw() % (t % 10 == 0 ? TILE_MOST : 140));
        const uint16_t base = (uint16_t)draw();
        const int bits = t % 17;
        const tile_kind kind = (tile_kind)((t + t / 10) % TILE_KINDS); /* long tiles of each kind */
        for (int i = 0; i < count; i++) {
            pixels[i] = make_pixel(kind, base, bits);
            stored[i] = (short)(pixels[i] ^ 0x8000);
        }
        const int expected = fits_rcomp_short(stored, count, theirs, BYTES, BST_FITS_RICE_BLOCK);
        const size_t bytes = bst_fits_rice_encode(pixels, (size_t)count, ours);
        assert_int_equal(bytes, expected);
        assert_memory_equal(ours, theirs, bytes);
        assert_true(bytes + 8 <= bst_fits_rice_bytes((size_t)count));
        assert_true(bst_fits_rice_decode(ours, bytes, BST_FITS_RICE_BLOCK, decoded, (size_t)count));
        for (int i = 0; i < count; i++) {
            assert_int_equal(decoded[i] ^ 0x8000, pixels[i]);
        }
    }
}

/* By hand, as the decoder's test: differences 0, +1, -1, +2 are 0, 2, 1, 4 with sum 7; half of
 * (7 - 3) / 4 is 0: no low bits, code 1: 1 001 01 00001. */
static void test_by_hand(void **state) {
    (void)state;
    const uint16_t pixels[] = {0x8005, 0x8006, 0x8005, 0x8007};
    uint8_t out[64];
    assert_int_equal(bst_fits_rice_encode(pixels, 4, out), 4);
    /* 0001 1 001 01 00001 */
    const uint8_t expected[] = {0x00, 0x05, 0x19, 0x42};
    assert_memory_equal(out, expected, sizeof expected);
}

/* Table and heap of a compressed image: from its header's end to its own.
 *
 * Returned:  largest  format of the table's column, with the bytes of the largest tile */
static char *read_data(const char *path, size_t *bytes, char largest[FLEN_VALUE]) {
    fitsfile *file = NULL;
    int code = 0;
    LONGLONG head, data, end;
    fits_open_file(&file, path, READONLY, &code);
    fits_movabs_hdu(file, 2, NULL, &code);
    fits_get_hduaddrll(file, &head, &data, &end, &code);
    fits_read_key(file, TSTRING, "TFORM1", largest, NULL, &code);
    fits_close_file(file, &code);
    assert_int_equal(code, 0);
    *bytes = (size_t)(end - data);
    char *found = malloc(*bytes);
    FILE *stream = fopen(path, "rb");
    assert_true(stream && fseek(stream, (long)data, SEEK_SET) == 0);
    assert_int_equal(fread(found, 1, *bytes, stream), *bytes);
    fclose(stream);
    return found;
}

/* A frame's tiles, their descriptors and the bytes of its largest tile are those of cfitsio. */
static void test_file(void **state) {
    (void)state;
    static const int sizes[][2] = {{61, 37}, {1, 1}, {1, 9}, {300, 2}, {32, 64}};
    scratch s;
    scratch_make(&s);
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        const int width = sizes[k][0], height = sizes[k][1];
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
        bst_camera camera = fixture_camera();
        const bst_fits_info info = {.observer = "o",
                                    .instrument = "i",
                                    .program = "p",
                                    .camera = &camera,
                                    .compression = BST_FITS_RICE};
        const bst_fits_frame frame = {
            .exposure_s = 1.0, .window = {0, 0, width, height}, .binning = 1, .bits = 16};
        uint16_t pixels[61 * 37];
        for (int i = 0; i < width * height; i++) {
            pixels[i] = make_pixel(OUTLIERS, 1000, 5);
        }
        char ours[1024], theirs[1024];
        snprintf(ours, sizeof ours, "%s", scratch_path(&s, "ours.fits"));
        snprintf(theirs, sizeof theirs, "%s", scratch_path(&s, "theirs.fits"));
        bst_fits *fits;
        bst_assert_ok(&ctx, bst_fits_create(&ctx, ours, BST_FITS_EXTENSIONS, &info, &fits));
        bst_assert_ok(&ctx, bst_fits_write(&ctx, fits, &frame, pixels, width, height, NULL));
        bst_assert_ok(&ctx, bst_fits_close(&ctx, fits));

        fitsfile *file = NULL;
        int code = 0;
        long size[2] = {width, height};
        fits_create_file(&file, theirs, &code);
        fits_create_img(file, BYTE_IMG, 0, NULL, &code);
        fits_set_compression_type(file, RICE_1, &code);
        fits_create_img(file, USHORT_IMG, 2, size, &code);
        fits_write_img(file, TUSHORT, 1, (LONGLONG)width * height, pixels, &code);
        fits_close_file(file, &code);
        assert_int_equal(code, 0);

        size_t bytes, expected;
        char largest[FLEN_VALUE], largest_expected[FLEN_VALUE];
        char *found = read_data(ours, &bytes, largest);
        char *wanted = read_data(theirs, &expected, largest_expected);
        assert_string_equal(largest, largest_expected);
        assert_int_equal(bytes, expected);
        assert_memory_equal(found, wanted, bytes);
        free(found);
        free(wanted);
        remove(ours);
        remove(theirs);
    }
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tiles),
        cmocka_unit_test(test_by_hand),
        cmocka_unit_test(test_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
