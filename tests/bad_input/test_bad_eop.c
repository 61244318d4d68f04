/* Earth-orientation files that are wrong. */
#include "sim/astro/frames.h"
#include "tests/bad_input/faults.h"

static bst_status read_eop(bst_ctx *ctx, const char *path) {
    bst_astro_eop *eop = NULL;
    bst_status status = bst_astro_eop_load(ctx, path, &eop);
    assert_true((status == BST_OK) == (eop != NULL));
    bst_astro_eop_free(eop);
    return status;
}

static const bad_reader reader = {read_eop, "an IERS EOP C04 file", "", 64 << 20};

static void paths(void **state) {
    (void)state;
    bad_paths(&reader);
}

/* Rows in the form of the 20 C04 series, without the columns that are not read. */
#define HEAD "# EARTH ORIENTATION PARAMETERS\n"
#define ROW_1 "2022 6 15 0 59745.00 0.3790 0.4545 -0.0792381 0.0\n"
#define ROW_2 "2022 6 16 0 59746.00 0.3806 0.4541 -0.0794612 0.0\n"
#define FORM "expected year month day [hour] MJD x y UT1-UTC of an IERS EOP C04 file, "

static void exact_messages(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"",
         ": 0 rows of Earth orientation found, at least 2 are needed; expected an IERS EOP C04 "
         "file"},
        {HEAD ROW_1,
         ": 1 rows of Earth orientation found, at least 2 are needed; expected an IERS EOP C04 "
         "file"},
        {HEAD ROW_1 "garbage\n" ROW_2, ":3: " FORM "found 0 numbers in \"garbage\""},
        {HEAD ROW_1 ROW_2 "2022 6 17\n", ":4: " FORM "found 3 numbers in \"2022 6 17\""},
        {HEAD ROW_1 "2022 6 16 0 59746.00 0.3806 0.4541 -0.07\n",
         ":3: 8 columns where the rows before have 9 in \"2022 6 16 0 59746.00 0.3806 0.4541 "
         "-0.07\""},
        {"2022 6 10 6 59740.25 0.1 0.4 -0.08 0 0\n",
         ":1: date and MJD are not one and the same midnight in \"2022 6 10 6 59740.25 0.1 0.4 "
         "-0.08 0 0\""},
        {"2022 6 11 59740 0.1 0.4 -0.08\n",
         ":1: date and MJD are not one and the same midnight in \"2022 6 11 59740 0.1 0.4 -0.08\""},
        {"2022 6 15 0\n", ":1: " FORM "found 4 numbers in \"2022 6 15 0\""},
        {"2022 6 15 0 59745 0.379 0.4545x -0.079 0\n",
         ":1: " FORM "found 6 numbers in \"2022 6 15 0 59745 0.379 0.4545x -0.079 0\""},
        {"2022 6 15 0 59745 0.379 0x1p-2 -0.079 0\n",
         ":1: " FORM "found 6 numbers in \"2022 6 15 0 59745 0.379 0x1p-2 -0.079 0\""},
        {"2022 6 15 0 59745 nan 0.45 -0.079 0\n",
         ":1: pole of 2 arcsec or more, or UT1-UTC of 1.5 s or more, in \"2022 6 15 0 59745 nan "
         "0.45 -0.079 0\""},
        {"2022 6 15 0 59745 0.37 1e400 -0.079 0\n",
         ":1: pole of 2 arcsec or more, or UT1-UTC of 1.5 s or more, in \"2022 6 15 0 59745 0.37 "
         "1e400 -0.079 0\""},
        {"2022 6 15 0 59745 0.37 0.45 37.0 0\n",
         ":1: pole of 2 arcsec or more, or UT1-UTC of 1.5 s or more, in \"2022 6 15 0 59745 0.37 "
         "0.45 37.0 0\""},
        {"2022 6 31 0 59761 0.37 0.45 -0.079 0\n",
         ":1: date and MJD are not one and the same midnight in \"2022 6 31 0 59761 0.37 0.45 "
         "-0.079 0\""},
        {"2022.5 6 15 0 59745 0.37 0.45 -0.079 0\n",
         ":1: date and MJD are not one and the same midnight in \"2022.5 6 15 0 59745 0.37 0.45 "
         "-0.079 0\""},
        {"1e9 6 15 0 59745 0.37 0.45 -0.079 0\n",
         ":1: date and MJD are not one and the same midnight in \"1e9 6 15 0 59745 0.37 0.45 "
         "-0.079 0\""},
        {HEAD ROW_1 ROW_1, ":3: MJD 59745 does not follow MJD 59745: rows must be daily"},
        {HEAD ROW_2 ROW_1, ":3: MJD 59745 does not follow MJD 59746: rows must be daily"},
        {"\xFF\xFE#", ":1: the file is UTF-16 text (allowed: ASCII or UTF-8)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bad_text(&reader, cases[i].text, BST_ERR_FORMAT, cases[i].message);
    }
    char wide[400];
    size_t bytes = bad_utf16(HEAD ROW_1 ROW_2, false, true, wide);
    bad_bytes(&reader, wide, bytes, BST_ERR_FORMAT,
              ":1: a zero byte: the file is not text (allowed: ASCII or UTF-8)");
    char line[600];
    memset(line, ' ', sizeof line);
    bad_bytes(&reader, line, sizeof line, BST_ERR_FORMAT,
              ":1: a line of 600 bytes (allowed: at most 511); expected an IERS EOP C04 file");
}

/* Cut within a row: refused, but in the last column, which is not read. */
static void every_truncation(void **state) {
    (void)state;
    static const char text[] = HEAD ROW_1 ROW_2;
    const size_t last_column = sizeof text - 1 - 3;
    for (size_t n = 0; n < sizeof text; n++) {
        char *copy = malloc(n + 1);
        assert_non_null(copy);
        memcpy(copy, text, n);
        bst_ctx ctx = {0};
        bst_astro_eop *eop = NULL;
        bst_status status = bst_astro_eop_read_buffer(&ctx, "x", copy, n, &eop);
        assert_int_equal(status, n > last_column - 1 ? BST_OK : BST_ERR_FORMAT);
        bst_astro_eop_free(eop);
        free(copy);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),
        cmocka_unit_test(exact_messages),
        cmocka_unit_test(every_truncation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
