#include "sim/astro/tle.h"

#include <stdlib.h>
#include <unistd.h>

#include "boresight/vec.h"
#include "tests/test_support.h"

/* Public element sets of the US space catalogue, June 2022. */
#define GOES_1 "1 10061U 77048A   22166.94040701  .00000081  00000+0  00000+0 0  9993"
#define GOES_2 "2 10061   9.8539 307.1213 0011382  31.5637 332.0402  0.99393421 31740"
#define MOLNIYA_1 "1 10455U 77105A   22165.63152102  .00000878  00000+0  50222-3 0  9997"
#define MOLNIYA_2 "2 10455  63.3122 358.3838 7380933 282.1442  10.5443  2.00780055327082"

static void collect(void *user, bst_log_level level, const char *message) {
    (void)level;
    snprintf((char *)user, 1024, "%s", message);
}

static bst_ctx quiet(void) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    return ctx;
}

/* Puts the checksum of a line right after a change. */
static void mend(char *line) {
    int sum = 0;
    for (int i = 0; i < 68; i++) {
        sum += line[i] >= '0' && line[i] <= '9' ? line[i] - '0' : line[i] == '-';
    }
    line[68] = (char)('0' + sum % 10);
}

/* GOES_1 or GOES_2 (which: 1 or 2) with `text` put at a column (from 1). */
static bst_status parse_changed(bst_ctx *ctx, int which, int column, const char *text,
                                bst_elements *out) {
    char lines[2][80] = {GOES_1, GOES_2};
    memcpy(lines[which - 1] + column - 1, text, strlen(text));
    mend(lines[which - 1]);
    return bst_tle_parse(ctx, lines[0], lines[1], out);
}

static void assert_message(const bst_ctx *ctx, const char *part) {
    if (!strstr(ctx->message, part)) {
        fail_msg("\"%s\" is not in \"%s\"", part, ctx->message);
    }
}

static void reads_every_field(void **state) {
    (void)state;
    bst_ctx ctx = quiet();
    bst_elements el;
    bst_assert_ok(&ctx, bst_tle_parse(&ctx, MOLNIYA_1 "\r\n", MOLNIYA_2 "  \n", &el));
    assert_string_equal(el.name, "");
    assert_int_equal(el.norad, 10455);
    assert_string_equal(el.designator, "77105A");
    /* Decimal fields: one rounding of the printed digits, so exact against the compiler's. */
    bst_assert_close(el.epoch_utc_jd1, 2459744.5, 0.0); /* 2022-06-14, day 165 */
    bst_assert_close(el.epoch_utc_jd2, 0.63152102, 0.0);
    bst_assert_close(el.ndot_rev_day2, 0.00000878, 0.0);
    bst_assert_close(el.nddot_rev_day3, 0.0, 0.0);
    bst_assert_close(el.bstar, 0.50222e-3, 0.0);
    bst_assert_close(el.eccentricity, 0.7380933, 0.0);
    bst_assert_close(el.inclination_rad, 63.3122 * BST_DEG_RAD, 0.0);
    bst_assert_close(el.raan_rad, 358.3838 * BST_DEG_RAD, 0.0);
    bst_assert_close(el.arg_perigee_rad, 282.1442 * BST_DEG_RAD, 0.0);
    bst_assert_close(el.mean_anomaly_rad, 10.5443 * BST_DEG_RAD, 0.0);
    /* one more rounding in the order of the factors */
    bst_assert_close(el.mean_motion_radpmin, 2.00780055 * BST_PI / 720.0, 4e-18);
    assert_int_equal(el.element_set, 999);
    assert_int_equal(el.revolution, 32708);
}

static void epoch_years_turn_at_57(void **state) {
    (void)state;
    /* Julian dates of calendar days after Meeus, Astronomical Algorithms, chapter 7. */
    const struct {
        const char *text;
        double jd1, jd2;
    } cases[] = {
        {"57001.00000000", 2435839.5, 0.0},        /* 1957-01-01 */
        {"56366.99999999", 2472363.5, 0.99999999}, /* 2056-12-31 */
        {"00060.50000000", 2451603.5, 0.5},        /* 2000-02-29 */
        {"99365.25000000", 2451543.5, 0.25},       /* 1999-12-31 */
        {" 5365.25      ", 2453735.5, 0.25},       /* 2005-12-31, blanks for zeros */
    };
    bst_ctx ctx = quiet();
    bst_elements el;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_assert_ok(&ctx, parse_changed(&ctx, 1, 19, cases[i].text, &el));
        bst_assert_close(el.epoch_utc_jd1, cases[i].jd1, 0.0);
        bst_assert_close(el.epoch_utc_jd2, cases[i].jd2, 0.0);
    }
}

static void reads_odd_exponents(void **state) {
    (void)state;
    const struct {
        const char *text;
        double value;
    } cases[] = {
        {" 12345-6", 0.12345e-6}, {"-12345-6", -0.12345e-6}, {"+12345+1", 1.2345},
        {" 00000-0", 0.0},        {" 00000+0", 0.0},         {"00000000", 0.0},
        {"        ", 0.0},        {" 12345 0", 0.12345},     {" 1234-10", 0.1234e-10},
        {" .1234-5", 0.1234e-5},  {"10000-3 ", 0.1e-3},      {"-11606-4", -0.11606e-4},
        {" 28098-4", 0.28098e-4}, {"  1234-5", 0.1234e-5},
    };
    bst_ctx ctx = quiet();
    bst_elements el;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_assert_ok(&ctx, parse_changed(&ctx, 1, 54, cases[i].text, &el));
        bst_assert_close(el.bstar, cases[i].value, 0.0); /* one rounding */
        bst_assert_ok(&ctx, parse_changed(&ctx, 1, 45, cases[i].text, &el));
        bst_assert_close(el.nddot_rev_day3, cases[i].value, 0.0);
    }
    const char *bad[] = {" 12345  ", "12345678", " 1a345-6", " 12345--",
                         " 12345-a", "      -6", "-       ", " 1.345-6"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        if (parse_changed(&ctx, 1, 54, bad[i], &el) != BST_ERR_FORMAT) {
            fail_msg("B* \"%s\" was taken for %g", bad[i], el.bstar);
        }
        assert_message(&ctx, "line 1: columns 54-61: B* is not a number with an exponent");
        assert_message(&ctx, bad[i]);
    }
}

static void decodes_alpha_5(void **state) {
    (void)state;
    /* The table on space-track.org. */
    const struct {
        const char *text;
        int number;
    } cases[] = {{"A0000", 100000}, {"E8493", 148493}, {"H9999", 179999}, {"J2931", 182931},
                 {"N0000", 220000}, {"P4018", 234018}, {"W1928", 301928}, {"Z9999", 339999},
                 {"    5", 5},      {"00005", 5}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char lines[2][80] = {GOES_1, GOES_2};
        bst_ctx ctx = quiet();
        bst_elements el;
        for (int k = 0; k < 2; k++) {
            memcpy(lines[k] + 2, cases[i].text, 5);
            mend(lines[k]);
        }
        bst_assert_ok(&ctx, bst_tle_parse(&ctx, lines[0], lines[1], &el));
        assert_int_equal(el.norad, cases[i].number);
    }
    const char *bad[] = {"I0000", "O0000", "a0000", "AA000", "1000A", "     ", "1 000", "-0001"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bst_ctx ctx = quiet();
        bst_elements el;
        assert_int_equal(parse_changed(&ctx, 1, 3, bad[i], &el), BST_ERR_FORMAT);
        assert_message(&ctx, "line 1: columns 3-7: catalogue number");
        assert_message(&ctx, "Alpha-5");
    }
}

static void errors_say_where_and_what(void **state) {
    (void)state;
    const struct {
        int which, column;
        const char *text, *message;
    } cases[] = {
        {1, 19, "2x", "line 1: columns 19-20: epoch year is not a number (found \"2x\""},
        {1, 21, "000.5", "line 1: columns 21-32: epoch day is out of range"},
        {1, 21, "366.00000000", "expected 1 to 365.99999999 in this year)"},
        {1, 21, "abc", "epoch day is not a number"},
        {1, 21, "-12", "epoch day is out of range"},
        {1, 34, " .0000x081", "line 1: columns 34-43: first derivative of mean motion"},
        {1, 63, "x", "line 1: column 63: ephemeris type is not a whole number (found \"x\""},
        {1, 65, "9 93", "line 1: columns 65-68: element set number"},
        {1, 33, "7", "line 1: column 33: separator is not blank"},
        {1, 1, "2", "line 1: column 1: line number is wrong (found \"2\", expected 1)"},
        {2, 1, "1", "line 2: column 1: line number is wrong (found \"1\", expected 2)"},
        {2, 3, "10062",
         "line 2: columns 3-7: catalogue number is of another satellite (found \"10062\", "
         "expected that of line 1, which is 10061)"},
        {2, 9, "180.0001",
         "line 2: columns 9-16: inclination is out of range (found \"180.0001\", "
         "expected 0 to 180 degrees)"},
        {2, 9, " -9.8539", "inclination is out of range"},
        {2, 9, "        ", "inclination is not a number"},
        {2, 9, " 9.85.39", "inclination is not a number"},
        {2, 18, "360.0001", "right ascension of the node is out of range"},
        {2, 27, "0.00113", "line 2: columns 27-33: eccentricity is not a fraction"},
        {2, 27, "-001138", "eccentricity is not a fraction"},
        {2, 35, "400.0000", "argument of perigee is out of range"},
        {2, 44, "-10.0000", "mean anomaly is out of range"},
        {2, 53, " 0.00000000", "line 2: columns 53-63: mean motion is not above 0"},
        {2, 53, "-1.00000000", "mean motion is out of range"},
        {2, 64, " 3a74", "revolution number"},
        {2, 12, "\t", "line 2: column 12: character is not printable ASCII (found \"\\x09\""},
        {1, 11, "\xc3\xa4", "line 1: column 11: character is not printable ASCII (found \"\\xC3\""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = quiet();
        bst_elements el;
        bst_status status =
            parse_changed(&ctx, cases[i].which, cases[i].column, cases[i].text, &el);
        assert_int_equal(status, BST_ERR_FORMAT);
        assert_message(&ctx, cases[i].message);
    }
    bst_ctx ctx = quiet();
    bst_elements el;
    char line[80] = GOES_2;
    line[68] = '7';
    assert_int_equal(bst_tle_parse(&ctx, GOES_1, line, &el), BST_ERR_FORMAT);
    assert_message(&ctx, "line 2: column 69: checksum is wrong");
    assert_message(&ctx, "(found \"7\", expected 0)");
    line[60] = '\0';
    assert_int_equal(bst_tle_parse(&ctx, GOES_1, line, &el), BST_ERR_FORMAT);
    assert_message(&ctx, "line 2 of the set is cut short at 60 characters");
    assert_int_equal(bst_tle_parse(&ctx, GOES_1 " x", GOES_2, &el), BST_ERR_FORMAT);
    assert_message(&ctx, "line 1 of the set goes on after column 69 (found \" x\"");
    assert_int_equal(bst_tle_parse(&ctx, "", "", &el), BST_ERR_FORMAT);
    assert_int_equal(bst_tle_parse(NULL, "", "", &el), BST_ERR_FORMAT);
}

static void ends_of_the_ranges_are_allowed(void **state) {
    (void)state;
    bst_ctx ctx = quiet();
    bst_elements el;
    bst_assert_ok(&ctx, parse_changed(&ctx, 2, 9, "180.0000 360.0000 9999999", &el));
    bst_assert_close(el.inclination_rad, BST_PI, 0.0); /* the propagator's own limit */
    bst_assert_close(el.raan_rad, 2.0 * BST_PI, 1e-15);
    bst_assert_close(el.eccentricity, 0.9999999, 0.0);
    bst_assert_ok(&ctx, parse_changed(&ctx, 2, 9, "  0.0000   0.0000 0000000", &el));
    bst_assert_close(el.inclination_rad, 0.0, 0.0);
    bst_assert_ok(&ctx, parse_changed(&ctx, 2, 27, "  11382", &el));
    bst_assert_close(el.eccentricity, 0.0011382, 0.0);
}

static bst_status read_text(bst_ctx *ctx, const char *text, const bst_tle_options *options,
                            bst_elements **sets, int *count) {
    return bst_tle_read_buffer(ctx, "orbits.tle", text, strlen(text), options, sets, count);
}

static void reads_mixed_files(void **state) {
    (void)state;
    const char *text =
        "\xEF\xBB\xBF# comment \xff\n"
        "\r\n" GOES_1 "\r\n" GOES_2
        "\r\n"
        "  \n"
        "0 MOLNIYA 3-8   \n" MOLNIYA_1 "\n# between\n" MOLNIYA_2
        "\n"
        "GOES 2\r\n" GOES_1 "   \n\n" GOES_2
        "\n"
        "0 A NAME THAT IS LONGER THAN THIRTY-ONE CHARACTERS\n" MOLNIYA_1 "\n" MOLNIYA_2;
    bst_ctx ctx = quiet();
    bst_elements *sets;
    int count;
    bst_assert_ok(&ctx, read_text(&ctx, text, NULL, &sets, &count));
    assert_int_equal(count, 4);
    const char *names[] = {"", "MOLNIYA 3-8", "GOES 2", "A NAME THAT IS LONGER THAN THIR"};
    const int numbers[] = {10061, 10455, 10061, 10455};
    for (int i = 0; i < count; i++) {
        assert_string_equal(sets[i].name, names[i]);
        assert_int_equal(sets[i].norad, numbers[i]);
    }
    free(sets);

    const bst_tle_options one = {.norad = 10455};
    bst_assert_ok(&ctx, read_text(&ctx, text, &one, &sets, &count));
    assert_int_equal(count, 2);
    assert_int_equal(sets[0].norad, 10455);
    free(sets);

    const bst_tle_options none = {.norad = 5};
    assert_int_equal(read_text(&ctx, text, &none, &sets, &count), BST_ERR_NOT_FOUND);
    assert_null(sets);
    assert_int_equal(count, 0);
    assert_string_equal(ctx.message, "orbits.tle: no element set of satellite 5, only 4 of others");
}

static void file_errors_name_the_line(void **state) {
    (void)state;
    const struct {
        const char *text, *message;
    } cases[] = {
        {"", "orbits.tle:1: the file is empty"},
        {"\n# only this\n", "orbits.tle:1: the file holds no element set"},
        {"NAME\n" GOES_1 "\n2 10061   9.8539\n",
         "orbits.tle:3: line 2 of the set is cut short at 16 characters"},
        {GOES_1 "\n" MOLNIYA_2 "\n",
         "orbits.tle:2: columns 3-7: catalogue number is of another satellite"},
        {GOES_1 "\n" GOES_1 "\n" GOES_2 "\n", "orbits.tle:2: element set has no line 2"},
        {GOES_1 "\nNAME\n", "orbits.tle:2: element set has no line 2 (found \"NAME\""},
        {"\n" GOES_2 "\n", "orbits.tle:2: element set has no line 1"},
        {GOES_1 "\n" GOES_2 "\n" GOES_2 "\n", "orbits.tle:3: element set has no line 1"},
        {"<html>\n<body>\n", "orbits.tle:2: no element set follows the name before this line"},
        {"NAME\n", "orbits.tle:1: the file ends within an element set"},
        {"\n" GOES_1, "orbits.tle:2: the file ends within an element set"},
        {"caf\xC3\xA9\n" GOES_1 "\n" GOES_2 "\n", "orbits.tle:1: name has a character"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = quiet();
        bst_elements *sets = (bst_elements *)&ctx;
        int count = 7;
        assert_int_equal(read_text(&ctx, cases[i].text, NULL, &sets, &count), BST_ERR_FORMAT);
        assert_message(&ctx, cases[i].message);
        assert_null(sets);
        assert_int_equal(count, 0);
    }
}

static void skips_bad_sets_with_a_warning(void **state) {
    (void)state;
    char bad[80] = GOES_2, log[1024] = "";
    bad[68] = '3';
    char text[1024];
    snprintf(text, sizeof text, "%s\n%s\nMOLNIYA\n%s\n%s\n%s\n%s\n", GOES_1, bad, MOLNIYA_1,
             MOLNIYA_2, GOES_1, GOES_1);
    bst_ctx ctx;
    bst_ctx_init(&ctx, collect, log, BST_LOG_WARNING);
    const bst_tle_options options = {.skip_bad_sets = true};
    bst_elements *sets;
    int count;
    bst_assert_ok(&ctx, read_text(&ctx, text, &options, &sets, &count));
    assert_int_equal(count, 1);
    assert_string_equal(sets[0].name, "MOLNIYA");
    /* the checksum, a line 1 without line 2, a line 1 at the end */
    assert_int_equal(ctx.warnings, 3);
    assert_non_null(strstr(log, "orbits.tle:7: the file ends within an element set"));
    assert_string_equal(ctx.message, "");
    free(sets);
    snprintf(text, sizeof text, "%s\n%s\n", GOES_1, bad);
    assert_int_equal(read_text(&ctx, text, &options, &sets, &count), BST_ERR_FORMAT);
    assert_message(&ctx, "holds no element set that can be used (1 bad ones left out");
    assert_null(sets);
}

/* Any bytes: every cut and every changed byte of a good file, with and without skipping, in a
 * buffer of exactly that size so that a sanitizer sees a read beyond it. */
static void survives_damaged_files(void **state) {
    (void)state;
    const char *good = "0 GOES\n" GOES_1 "\r\n" GOES_2 "\n";
    const size_t length = strlen(good);
    const unsigned char bytes[] = {0x00, 0x09, 0x0a, 0x20, '-', '.', '9', 'A', 0x7f, 0xff};
    int accepted = 0;
    for (size_t i = 0; i < length; i++) {
        for (size_t k = 0; k <= sizeof bytes; k++) {
            bool cut = k == sizeof bytes;
            size_t size = cut ? i : length;
            char *data = malloc(size ? size : 1);
            assert_non_null(data);
            memcpy(data, good, size);
            if (!cut) {
                data[i] = (char)bytes[k];
            }
            bst_ctx ctx = quiet();
            const bst_tle_options options = {.skip_bad_sets = (i + k) % 2 == 0};
            bst_elements *sets;
            int count;
            bst_status status = bst_tle_read_buffer(&ctx, "x", data, size, &options, &sets, &count);
            if (status == BST_OK) {
                assert_true(count > 0 && sets != NULL);
                accepted++;
            } else {
                assert_true(count == 0 && sets == NULL && ctx.message[0] != '\0');
            }
            free(sets);
            free(data);
        }
    }
    assert_true(accepted > 0); /* a name is free text, and some bytes are the ones there */
}

static void loads_from_disk(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    bst_test_template(path, "bst_tle");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    FILE *file = fdopen(fd, "wb");
    assert_non_null(file);
    enum { SETS = 1000 }; /* 142 kB: more than one read */
    for (int i = 0; i < SETS; i++) {
        fputs(GOES_1 "\n" GOES_2 "\n", file);
    }
    fclose(file);
    bst_ctx ctx = quiet();
    bst_elements *sets;
    int count;
    bst_assert_ok(&ctx, bst_tle_load(&ctx, path, NULL, &sets, &count));
    assert_int_equal(count, SETS);
    assert_int_equal(sets[SETS - 1].norad, 10061);
    free(sets);
    assert_int_equal(unlink(path), 0);

    assert_int_equal(bst_tle_load(&ctx, path, NULL, &sets, &count), BST_ERR_NOT_FOUND);
    assert_message(&ctx, path);
    assert_int_equal(bst_tle_load(&ctx, "tests", NULL, &sets, &count), BST_ERR_IO);
    assert_message(&ctx, "tests: is a folder; give a file of two-line element sets");
    assert_null(sets);
    assert_int_equal(count, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_every_field),
        cmocka_unit_test(epoch_years_turn_at_57),
        cmocka_unit_test(reads_odd_exponents),
        cmocka_unit_test(decodes_alpha_5),
        cmocka_unit_test(errors_say_where_and_what),
        cmocka_unit_test(ends_of_the_ranges_are_allowed),
        cmocka_unit_test(reads_mixed_files),
        cmocka_unit_test(file_errors_name_the_line),
        cmocka_unit_test(skips_bad_sets_with_a_warning),
        cmocka_unit_test(survives_damaged_files),
        cmocka_unit_test(loads_from_disk),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
