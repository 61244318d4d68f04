/* Files of 200 MB: refused by size, or read within 10 s and 2 GiB. */
#include "boresight/config.h"
#include "sim/astro/elements.h"
#include "sim/astro/frames.h"
#include "sim/astro/oem.h"
#include "sim/astro/state_table.h"
#include "sim/astro/tle.h"
#include "sim/catalogue/stars.h"
#include "sim/io/fits_image.h"
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
    bst_astro_eop *eop = NULL;
    bst_status status = bst_astro_eop_load(ctx, path, &eop);
    bst_astro_eop_free(eop);
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

static bst_status read_elements(bst_ctx *ctx, const char *path) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_status status = bst_elements_load(ctx, path, NULL, &sets, &count);
    free(sets);
    return status;
}

static bst_status read_oem(bst_ctx *ctx, const char *path) {
    bst_oem *oem = NULL;
    bst_status status = bst_oem_load(ctx, path, &oem);
    bst_oem_free(oem);
    return status;
}

static bst_status read_injected(bst_ctx *ctx, const char *path) {
    bst_time epoch;
    bst_state_table *states = NULL;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &epoch));
    bst_status status = bst_state_table_load(ctx, path, epoch, &states);
    bst_state_table_free(states);
    return status;
}

static const bad_reader elements = {.read = read_elements}, oem = {.read = read_oem},
                        injected = {.read = read_injected};
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

#define OMM_CSV                                                                                 \
    "EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY," \
    "NORAD_CAT_ID,BSTAR\n"
#define OEM_HEAD                                                                  \
    "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = X\n" \
    "META_START\nOBJECT_NAME = A\nOBJECT_ID = 2022-001A\nCENTER_NAME = EARTH\n"   \
    "REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2022-06-16T00:00:00\n"     \
    "STOP_TIME = 2022-06-17T00:00:00\nMETA_STOP\n"

static void large_orbits(void **state) {
    (void)state;
    expect(&elements, OMM_CSV,
           "2022-06-15T22:34:10,0.99393421,.0011382,9.85,307.1,31.5,332.0,7,0\n", 0, BST_OK);
    expect(&elements, "[", "{\"NORAD_CAT_ID\": 1},", 0, BST_ERR_FORMAT);
    expect(&oem, OEM_HEAD, "COMMENT nothing\n", 0, BST_ERR_FORMAT);
    expect(&oem, OEM_HEAD, "x", 0, BST_ERR_FORMAT);
    expect(&injected, "", "x\n", 0, BST_ERR_FORMAT);
    expect(&injected, "", "# comment\n", 128 << 20, BST_ERR_FORMAT);
}

/* One object after the other, each with a segment or a frame of its own: no quadratic search. */
static void many_objects(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    bst_ctx ctx = {0};
    FILE *file = fopen(scratch_path(&place, "large"), "w");
    assert_non_null(file);
    fputs("CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = X\n", file);
    for (int i = 0; i < 200000; i++) {
        fprintf(file,
                "META_START\nOBJECT_NAME = A%d\nOBJECT_ID = 2022-001A\nCENTER_NAME = EARTH\n"
                "REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2022-06-16T00:00:00\n"
                "STOP_TIME = 2022-06-16T00:01:00\nMETA_STOP\n"
                "2022-06-16T00:00:00 7000 0 0 0 7.5 0\n2022-06-16T00:01:00 6985 450 0 -.5 7.5 0\n",
                i);
    }
    assert_int_equal(fclose(file), 0);
    bst_assert_ok(&ctx, bad_read_large(&oem, &ctx, &place));
    file = fopen(scratch_path(&place, "large"), "w");
    assert_non_null(file);
    fputs(
        "object,start_s,end_s,start_x_m,start_y_m,start_z_m,start_vx_mps,start_vy_mps,"
        "start_vz_mps,end_x_m,end_y_m,end_z_m,end_vx_mps,end_vy_mps,end_vz_mps\n",
        file);
    for (int i = 0; i < 1000000; i++) {
        fprintf(file, "A%d,0,0.5,7e6,0,0,0,7500,0,7e6,3750,0,-4,7500,0\n", i);
    }
    assert_int_equal(fclose(file), 0);
    bst_assert_ok(&ctx, bad_read_large(&injected, &ctx, &place));
    scratch_remove(&place);
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
           0, BST_ERR_FORMAT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(large_json),   cmocka_unit_test(many_keys),
        cmocka_unit_test(large_tle),    cmocka_unit_test(large_eop),
        cmocka_unit_test(large_orbits), cmocka_unit_test(many_objects),
        cmocka_unit_test(large_stars),  cmocka_unit_test(large_fits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
