/* Files of 200 MB: refused by size, or read within 10 s and 2 GiB. */
#include "sim/astro/frames.h"
#include "sim/astro/tle.h"
#include "sim/core/config.h"
#include "sim/io/fits_image.h"
#include "sim/world/stars.h"
#include "tests/bad_input/faults.h"

static bst_status read_json(bst_ctx *ctx, const char *path) {
    bst_json *json = NULL;
    bst_status status = bst_json_load(ctx, path, &json);
    bst_json_free(json);
    return status;
}

static bst_status read_tle(bst_ctx *ctx, const char *path) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_status status = bst_tle_load(ctx, path, NULL, &sets, &count);
    assert_true(status != BST_OK || count > 1000000);
    free(sets);
    return status;
}

static bst_status read_eop(bst_ctx *ctx, const char *path) {
    bst_eop *eop = NULL;
    bst_status status = bst_eop_load(ctx, path, &eop);
    bst_eop_free(eop);
    return status;
}

static bst_status read_stars(bst_ctx *ctx, const char *path) {
    bst_stars *stars = NULL;
    bst_status status = bst_stars_open(ctx, path, &stars);
    bst_stars_close(stars);
    return status;
}

static bst_status read_fits(bst_ctx *ctx, const char *path) {
    int width, height;
    float *pixels;
    bst_status status = bst_fits_read_image(ctx, path, &width, &height, &pixels);
    free(pixels);
    return status;
}

static const bad_reader json = {.read = read_json}, tle = {.read = read_tle},
                        eop = {.read = read_eop}, stars = {.read = read_stars},
                        fits = {.read = read_fits};

/* 200 MB after `head`, cut to `bytes` when that is not 0. */
static void expect(const bad_reader *r, const char *head, const char *text, off_t bytes,
                   bst_status status) {
    scratch place;
    bst_ctx ctx = {0};
    bad_make_large(&place, head, text);
    if (bytes) {
        assert_int_equal(truncate(scratch_path(&place, "large"), bytes), 0);
    }
    assert_int_equal(bad_read_large(r, &ctx, &place), status);
    assert_true((status == BST_OK) == (ctx.message[0] == '\0'));
    scratch_remove(&place);
}

/* By size; and, just below that, what makes most work or takes most memory. */
static void large_json(void **state) {
    (void)state;
    const off_t most = 64 << 20;
    expect(&json, "[", "1,", 0, BST_ERR_FORMAT);
    expect(&json, "[", "1,", most, BST_ERR_FORMAT);
    expect(&json, "[", "[],", most, BST_ERR_FORMAT);
    expect(&json, "[", "{\"a\":{}},", most, BST_ERR_FORMAT);
    expect(&json, "[", "[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]],", most, BST_ERR_FORMAT);
    expect(&json, "{\"a\": \"", "b", most, BST_ERR_FORMAT);
    expect(&json, "[", "\"\\u00e9\",", most, BST_ERR_FORMAT);
    expect(&json, "", "\n", most, BST_ERR_FORMAT);
}

/* As many keys and values as a document may have: five million that differ. */
static void many_keys(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    FILE *file = fopen(scratch_path(&place, "large"), "w");
    assert_non_null(file);
    for (int i = 0; i < 5000000; i++) {
        fprintf(file, "%c\"%x\":1", i ? ',' : '{', i);
    }
    fputc('}', file);
    assert_int_equal(fclose(file), 0);
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bad_read_large(&json, &ctx, &place));
    scratch_remove(&place);
}

static void large_tle(void **state) {
    (void)state;
    expect(&tle, "",
           "1 10061U 77048A   22166.94040701  .00000081  00000+0  00000+0 0  9993\n"
           "2 10061   9.8539 307.1213 0011382  31.5637 332.0402  0.99393421 31740\n",
           0, BST_OK);
    expect(&tle, "", "\n", 0, BST_ERR_FORMAT);
    expect(&tle, "", "x", 0, BST_ERR_FORMAT);
    expect(&tle, "", "x\n", 0, BST_ERR_FORMAT);
}

static void large_eop(void **state) {
    (void)state;
    const off_t most = 64 << 20;
    expect(&eop, "", "# comment\n", 0, BST_ERR_FORMAT);
    expect(&eop, "", "\n", most, BST_ERR_FORMAT);
    expect(&eop, "", "# comment\n", most, BST_ERR_FORMAT);
    expect(&eop, "", "x", most, BST_ERR_FORMAT);
}

static void large_stars(void **state) {
    (void)state;
    expect(&stars, "", "x", 0, BST_ERR_FORMAT);
}

static void large_fits(void **state) {
    (void)state;
    char header[2881] = "";
    for (int i = 0; i < 2880; i++) {
        header[i] = ' ';
    }
    static const char *const cards[] = {
        "SIMPLE  =                    T", "BITPIX  =                   16",
        "NAXIS   =                    2", "NAXIS1  =                10000",
        "NAXIS2  =                10000", "END"};
    for (size_t i = 0; i < sizeof cards / sizeof *cards; i++) {
        memcpy(header + 80 * i, cards[i], strlen(cards[i]));
    }
    expect(&fits, header, "\1\2", 0, BST_OK);
    memcpy(header + 80 * 5, "   ", 3); /* a header without an end */
    expect(&fits, header,
           "COMMENT                                                              "
           "           ",
           0, BST_ERR_IO);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(large_json), cmocka_unit_test(many_keys),   cmocka_unit_test(large_tle),
        cmocka_unit_test(large_eop),  cmocka_unit_test(large_stars), cmocka_unit_test(large_fits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
