#include "sim/astro/elements.h"

#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/astro/sgp4.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

/* A public element set of the US space catalogue, June 2022, in each form. */
#define MOLNIYA_1 "1 10455U 77105A   22165.63152102  .00000878  00000+0  50222-3 0  9997"
#define MOLNIYA_2 "2 10455  63.3122 358.3838 7380933 282.1442  10.5443  2.00780055327082"
#define MEAN                                                                               \
    "\"MEAN_MOTION\":2.00780055,\"ECCENTRICITY\":0.7380933,\"INCLINATION\":63.3122,"       \
    "\"RA_OF_ASC_NODE\":358.3838,\"ARG_OF_PERICENTER\":282.1442,\"MEAN_ANOMALY\":10.5443," \
    "\"BSTAR\":0.50222E-3"
#define EPOCH "\"EPOCH\":\"2022-06-14T15:09:23.416128\""
#define ID "\"NORAD_CAT_ID\":10455"
#define HEADER                                                                         \
    "OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE," \
    "ARG_OF_PERICENTER,MEAN_ANOMALY,EPHEMERIS_TYPE,CLASSIFICATION_TYPE,NORAD_CAT_ID,"  \
    "ELEMENT_SET_NO,REV_AT_EPOCH,BSTAR,MEAN_MOTION_DOT,MEAN_MOTION_DDOT\n"
#define ROW                                                                                  \
    "MOLNIYA 3-8,1977-105A,2022-06-14T15:09:23.416128,2.00780055,.7380933,63.3122,358.3838," \
    "282.1442,10.5443,0,U,10455,999,32708,.50222E-3,.878E-5,0\n"

static bst_status read_text(bst_ctx *ctx, const char *text, const bst_elements_options *options,
                            bst_elements **sets, int *count) {
    return bst_elements_read_buffer(ctx, "sets", text, strlen(text), options, sets, count);
}

static void assert_same(const bst_elements *a, const bst_elements *b) {
    assert_int_equal(a->norad, b->norad);
    assert_string_equal(a->name, b->name);
    assert_string_equal(a->designator, b->designator);
    assert_int_equal(a->element_set, b->element_set);
    assert_int_equal(a->revolution, b->revolution);
    assert_true(a->epoch_utc_jd1 == b->epoch_utc_jd1);
    /* 15:09:23.416128 is 0.63152102 d exactly; one rounding of each */
    bst_assert_close(a->epoch_utc_jd2, b->epoch_utc_jd2, 1.2e-16);
    /* decimal digits read right are the same double */
    assert_true(a->bstar == b->bstar && a->ndot_rev_day2 == b->ndot_rev_day2 &&
                a->nddot_rev_day3 == b->nddot_rev_day3);
    assert_true(a->inclination_rad == b->inclination_rad && a->raan_rad == b->raan_rad &&
                a->eccentricity == b->eccentricity && a->arg_perigee_rad == b->arg_perigee_rad &&
                a->mean_anomaly_rad == b->mean_anomaly_rad &&
                a->mean_motion_radpmin == b->mean_motion_radpmin);
}

/* What python3-sgp4 makes of the CSV row (sgp4.omm), TEME, km and km/s. */
static void assert_reference(const bst_elements *set) {
    static const struct {
        double minutes, r[3], v[3];
    } rows[] = {{0.0,
                 {10449.579558127542, -287.93425223785334, -0.013352286133378074},
                 {4.230520795912791, 2.866430160746021, 5.92785891871024}},
                {720.0,
                 {11108.419047109808, 177.79289208719464, 992.4818663695359},
                 {3.662072841119181, 2.8644577517727488, 5.903064273901379}},
                {1440.5,
                 {11772.983245761334, 725.9337835220143, 2152.822026402329},
                 {3.082457428002904, 2.8373474120604656, 5.824456326888148}}};
    bst_ctx ctx = {0};
    bst_sgp4 *sgp4;
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        double r[3], v[3];
        assert_int_equal(bst_sgp4_propagate(sgp4, rows[i].minutes, r, v), BST_SGP4_OK);
        for (int k = 0; k < 3; k++) {
            /* the two implementations agree to 1.2e-7 km over the published cases */
            bst_assert_close(r[k], rows[i].r[k], 2e-7);
            bst_assert_close(v[k], rows[i].v[k], 1e-9);
        }
    }
    bst_sgp4_free(sgp4);
}

static void all_forms_give_the_same_set(void **state) {
    (void)state;
    const char *tle = "0 MOLNIYA 3-8\n" MOLNIYA_1 "\n" MOLNIYA_2 "\n";
    const char *texts[] = {
        /* celestrak.org: numbers; space-track.org: strings, nulls and keys of its own */
        "[{\"OBJECT_NAME\":\"MOLNIYA 3-8\",\"OBJECT_ID\":\"1977-105A\"," EPOCH "," MEAN
        ",\"EPHEMERIS_TYPE\":0,\"CLASSIFICATION_TYPE\":\"U\"," ID
        ",\"ELEMENT_SET_NO\":999,\"REV_AT_EPOCH\":32708,\"MEAN_MOTION_DOT\":8.78e-6,"
        "\"MEAN_MOTION_DDOT\":0}]",
        "\xEF\xBB\xBF\r\n[ {\"CCSDS_OMM_VERS\":\"3.0\",\"COMMENT\":\"x\",\"RCS_SIZE\":null,"
        "\"MEAN_ELEMENT_THEORY\":\"SGP4\",\"REF_FRAME\":\"TEME\",\"TIME_SYSTEM\":\"UTC\","
        "\"CENTER_NAME\":\"EARTH\",\"OBJECT_NAME\":\" MOLNIYA 3-8 \",\"OBJECT_ID\":\"1977-105A\","
        "\"EPOCH\":\"2022-165T15:09:23.416128000Z\",\"MEAN_MOTION\":\"2.00780055\","
        "\"ECCENTRICITY\":\"0.73809330\",\"INCLINATION\":\"63.3122\",\"RA_OF_ASC_NODE\":"
        "\"358.3838\",\"ARG_OF_PERICENTER\":\"282.1442\",\"MEAN_ANOMALY\":\"10.5443\","
        "\"EPHEMERIS_TYPE\":\"0\",\"NORAD_CAT_ID\":\"10455\",\"ELEMENT_SET_NO\":\"999\","
        "\"REV_AT_EPOCH\":\"32708\",\"BSTAR\":\"0.00050222000000\",\"MEAN_MOTION_DOT\":"
        "\"0.00000878\",\"MEAN_MOTION_DDOT\":\"0.0000000000000\",\"DECAY_DATE\":null,"
        "\"EXTRA\":{\"a\":[1,2,{}]}} ]\r\n",
        "{\"OBJECT_NAME\":\"MOLNIYA 3-8\",\"OBJECT_ID\":\"1977-105A\"," EPOCH "," MEAN "," ID
        ",\"ELEMENT_SET_NO\":999,\"REV_AT_EPOCH\":32708,\"MEAN_MOTION_DOT\":0.878E-05}",
        HEADER ROW,
        "\xEF\xBB\xBF# comment\r\n\r\n\"NORAD_CAT_ID\" , \"EPOCH\",OBJECT_NAME,OBJECT_ID,"
        "MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,"
        "ELEMENT_SET_NO,REV_AT_EPOCH,BSTAR,MEAN_MOTION_DOT,TLE_LINE0\r\n"
        "\"10455\",2022-06-14T15:09:23.416128,\"MOLNIYA 3-8\", 1977-105A ,2.00780055,"
        "0.7380933,63.3122,358.3838,282.1442,10.5443,999,32708,5.0222e-4,+8.78e-06,"
        "\"0 \"\"MOLNIYA\"\", 3-8\"",
    };
    bst_ctx ctx = {0};
    bst_elements *reference, *sets;
    int count;
    bst_assert_ok(&ctx, read_text(&ctx, tle, NULL, &reference, &count));
    assert_int_equal(count, 1);
    assert_reference(reference);
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        bst_assert_ok(&ctx, read_text(&ctx, texts[i], NULL, &sets, &count));
        assert_int_equal(count, 1);
        assert_same(sets, reference);
        assert_reference(sets);
        free(sets);
    }
    free(reference);
}

/* Each angle in its own member, retrograde orbits too. */
static void angles_are_those_that_are_written(void **state) {
    (void)state;
    static const double inclination[] = {0.0, 51.6416, 90.0, 90.0001, 98.7, 179.99, 180.0};
    for (size_t i = 0; i < sizeof inclination / sizeof *inclination; i++) {
        char text[500];
        bst_ctx ctx = {0};
        bst_elements *set;
        int count;
        snprintf(text, sizeof text,
                 "{" ID "," EPOCH
                 ",\"MEAN_MOTION\":14.5,\"ECCENTRICITY\":0.0011,"
                 "\"INCLINATION\":%.4f,\"RA_OF_ASC_NODE\":201.5,\"ARG_OF_PERICENTER\":73.25,"
                 "\"MEAN_ANOMALY\":-11.75,\"BSTAR\":1e-4}",
                 inclination[i]);
        bst_assert_ok(&ctx, read_text(&ctx, text, NULL, &set, &count));
        assert_int_equal(count, 1);
        bst_assert_close(set->inclination_rad / BST_DEG_RAD, inclination[i], 1e-13); /* rounding */
        bst_assert_close(set->raan_rad / BST_DEG_RAD, 201.5, 1e-13);
        bst_assert_close(set->arg_perigee_rad / BST_DEG_RAD, 73.25, 1e-13);
        bst_assert_close(set->mean_anomaly_rad / BST_DEG_RAD, -11.75, 1e-13);
        bst_assert_close(set->mean_motion_radpmin * 1440.0 / (2.0 * BST_PI), 14.5, 1e-13);
        free(set);
    }
}

static void numbers_have_nine_digits(void **state) {
    (void)state;
    const char *numbers[] = {"0", "1", "99999", "100000", "340000", "799501234", "999999999"};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        char text[3][800];
        snprintf(text[0], sizeof *text, "[{\"NORAD_CAT_ID\":%s," EPOCH "," MEAN "}]", numbers[i]);
        snprintf(text[1], sizeof *text, "[{\"NORAD_CAT_ID\":\"%s\"," EPOCH "," MEAN "}]",
                 numbers[i]);
        snprintf(text[2], sizeof *text,
                 HEADER
                 "A,B,2022-06-14T00:00:00,2,.7,63,358,282,10,0,U,"
                 "%s,1,1,0,0,0\n",
                 numbers[i]);
        for (int form = 0; form < 3; form++) {
            bst_ctx ctx = {0};
            bst_elements *sets;
            int count;
            bst_assert_ok(&ctx, read_text(&ctx, text[form], NULL, &sets, &count));
            assert_int_equal(sets->norad, atoi(numbers[i]));
            free(sets);
        }
    }
}

static void one_satellite_is_picked(void **state) {
    (void)state;
    /* the others are not checked */
    const char *text = "[{\"NORAD_CAT_ID\":1},{\"NORAD_CAT_ID\":\"799501234\"," EPOCH "," MEAN
                       ",\"OBJECT_NAME\":\"A NAME OF MORE THAN THIRTY-ONE CHARACTERS\","
                       "\"OBJECT_ID\":\"2027-001ABCDEF\"},{\"NORAD_CAT_ID\":3}]";
    bst_ctx ctx = {0};
    bst_elements *sets;
    int count;
    const bst_elements_options one = {.norad = 799501234}, none = {.norad = 2};
    bst_assert_ok(&ctx, read_text(&ctx, text, &one, &sets, &count));
    assert_int_equal(count, 1);
    assert_string_equal(sets->name, "A NAME OF MORE THAN THIRTY-ONE ");
    assert_string_equal(sets->designator, "27001ABCDEF");
    free(sets);
    assert_int_equal(read_text(&ctx, text, &none, &sets, &count), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message, "sets: no element set of satellite 2, only 3 of others");
    assert_null(sets);
}

static void epochs_are_exact(void **state) {
    (void)state;
    static const struct {
        const char *text;
        double jd1, jd2;
    } cases[] = {
        {"2022-06-14T00:00:00", 2459744.5, 0.0},
        {"2022-06-14T00:00:00.000001", 2459744.5, 1e-6 / 86400.0},
        {"2022-06-14T23:59:59.999999", 2459744.5, 86399.999999 / 86400.0},
        {"2022-165T12:00:00.25Z", 2459744.5, 43200.25 / 86400.0},
        {"2024-366T00:00:00.0", 2460675.5, 0.0},
        /* a leap second: the day has 86401 */
        {"2016-12-31T23:59:60.5", 2457753.5, 86400.5 / 86401.0},
        {"2016-12-31T12:00:00.123456789", 2457753.5, 43200.123456789 / 86401.0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[600];
        snprintf(text, sizeof text, "{" ID "," MEAN ",\"EPOCH\":\"%s\"}", cases[i].text);
        bst_ctx ctx = {0};
        bst_elements *sets;
        int count;
        bst_assert_ok(&ctx, read_text(&ctx, text, NULL, &sets, &count));
        assert_true(sets->epoch_utc_jd1 == cases[i].jd1);
        bst_assert_close(sets->epoch_utc_jd2, cases[i].jd2, 2.3e-16); /* two roundings, 20 ps */
        free(sets);
    }
}

static void errors_say_where_and_what(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", "sets:1: the file is empty (expected two-line element sets)"},
        {"[]",
         "sets:1: the file holds no element set ("
         "expected orbit mean-elements messages)"},
        {"[1]", "sets: /0: is not an object (expected an orbit mean-elements message)"},
        {"{}", "sets: /NORAD_CAT_ID: is missing"},
        {"[{" ID "," EPOCH "," MEAN "},{" ID "}]", "sets: /1/EPOCH: is missing"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":\"\"}", "sets: /MEAN_MOTION: is missing"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":true}",
         "sets: /MEAN_MOTION: is neither a number nor a string"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":[1]}",
         "sets: /MEAN_MOTION: is neither a number nor a string"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":\"nan\"}",
         "sets: /MEAN_MOTION: is not a number (found \"nan\", expected above 0, to 10000 "
         "revolutions per day)"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":0}",
         "sets: /MEAN_MOTION: is out of range (found \"0\", expected above 0, to 10000 "
         "revolutions per day)"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":1,\"ECCENTRICITY\":1}",
         "sets: /ECCENTRICITY: is out of range (found \"1\", expected 0 to below 1)"},
        {"{" ID "," EPOCH ",\"MEAN_MOTION\":1,\"ECCENTRICITY\":0,\"INCLINATION\":\"180.1\"}",
         "sets: /INCLINATION: is out of range (found \"180.1\", expected 0 to 180 degrees)"},
        {"{\"NORAD_CAT_ID\":1000000000}",
         "sets: /NORAD_CAT_ID: is not a whole number in the range (found \"1000000000\", expected "
         "0 to 999999999)"},
        {"{\"NORAD_CAT_ID\":\"T0001\"}",
         "sets: /NORAD_CAT_ID: is not a whole number in the range (found \"T0001\", expected 0 to "
         "999999999)"},
        {"{\"NORAD_CAT_ID\":1.5}",
         "sets: /NORAD_CAT_ID: is not a whole number in the range "
         "(found \"1.5\", expected 0 to 999999999)"},
        {"{" ID ",\"EPOCH\":\"2022-02-30T00:00:00\"}",
         "sets: /EPOCH: \"2022-02-30T00:00:00\" has no day that this month has"},
        {"{" ID ",\"EPOCH\":\"yesterday\"}",
         "sets: /EPOCH: \"yesterday\" is not a date (expected YYYY-MM-DDThh:mm:ss or "
         "YYYY-DDDThh:mm:ss, then if wanted decimals, as in 2022-06-16T22:10:00.5)"},
        {"{" ID "," EPOCH "," MEAN ",\"MEAN_ELEMENT_THEORY\":\"DSST\"}",
         "sets: /MEAN_ELEMENT_THEORY: is not what SGP4 element sets have (found \"DSST\", expected "
         "SGP4)"},
        {"{" ID "," EPOCH "," MEAN ",\"REF_FRAME\":\"GCRF\"}",
         "sets: /REF_FRAME: is not what SGP4 element sets have (found \"GCRF\", expected TEME)"},
        {"{" ID "," EPOCH "," MEAN ",\"TIME_SYSTEM\":\"TAI\"}",
         "sets: /TIME_SYSTEM: is not what SGP4 element sets have (found \"TAI\", expected UTC)"},
        {"{" ID "," EPOCH "," MEAN ",\"CENTER_NAME\":\"MARS\"}",
         "sets: /CENTER_NAME: is not what SGP4 element sets have (found \"MARS\", expected EARTH)"},
        {"{" ID "," EPOCH "," MEAN ",\"EPHEMERIS_TYPE\":4}",
         "sets: /EPHEMERIS_TYPE: is that of SGP4-XP, which is not modelled (found \"4\", expected "
         "0 or 2, which are SGP4's)"},
        {"{" ID "," EPOCH "," MEAN ",\"OBJECT_NAME\":\"caf\xC3\xA9\"}",
         "sets: /OBJECT_NAME: is not plain text (found \"caf\\xC3\\xA9\", expected printable "
         "ASCII)"},
        {"{" ID "," ID "}", "sets: /NORAD_CAT_ID: the key is given twice"},
        {"NORAD_CAT_ID,EPOCH,EPOCH\n",
         "sets:1: a column comes twice (found \"EPOCH\", expected each column once)"},
        {"EPOCH\n2022-06-14T00:00:00\n", "sets:2: NORAD_CAT_ID: is missing"},
        {"\n" HEADER "A,B\n",
         "sets:3: 2 fields, where the header row has 17 (found \"A,B\", expected one field for "
         "each column)"},
        {HEADER ROW "A,B,,2,.7,63,358,282,10,0,U,5,1,1,0,0,0\n", "sets:3: EPOCH: is missing"},
        {HEADER "A,B,2022-06-14T00:00:00,2,.7,63,358,282,1e400,0,U,5,1,1,0,0,0\n",
         "sets:2: MEAN_ANOMALY: is not a number (found \"1e400\", expected -360 to 360 degrees)"},
        {HEADER "\"A,B,2022-06-14T00:00:00\n",
         "sets:2: a quoted field does not end (found \"\"A,B,2022-06-14T00:00:00\", expected "
         "\"field\", with \"\" for a quote within)"},
        {HEADER,
         "sets:1: the file holds no element set ("
         "expected rows of orbit mean-elements messages)"},
        {"<?xml version=\"1.0\"?>",
         "sets:1: the file is in a form that is not read here (found "
         "\"<?xml version=\"1.0\"?>\", expected two-line element sets, "
         "or OMM as JSON or CSV)"},
        {"CCSDS_OMM_VERS = 2.0\n",
         "sets:1: the file is in a form that is not read here (found "
         "\"CCSDS_OMM_VERS = 2.0\", expected two-line element sets, or "
         "OMM as JSON or CSV)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_elements *sets = (bst_elements *)&ctx;
        int count = 7;
        assert_int_equal(read_text(&ctx, cases[i].text, NULL, &sets, &count), BST_ERR_FORMAT);
        assert_string_equal(ctx.message, cases[i].message);
        assert_null(sets);
        assert_int_equal(count, 0);
    }
}

static void bad_sets_can_be_skipped(void **state) {
    (void)state;
    const bst_elements_options options = {.skip_bad_sets = true};
    const char *texts[] = {"[{" ID "},{" ID "," EPOCH "," MEAN "},7]",
                           HEADER "A,B\n" ROW "A,B,,2,.7,63,358,282,10,0,U,5,1,1,0,0,0\n"};
    for (int i = 0; i < 2; i++) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_WARNING);
        bst_elements *sets;
        int count;
        bst_assert_ok(&ctx, read_text(&ctx, texts[i], &options, &sets, &count));
        assert_int_equal(count, 1);
        assert_int_equal(ctx.warnings, 2);
        free(sets);
    }
}

/* Any bytes: every cut and many changed bytes, in a buffer of exactly that size so that a sanitizer
 * sees a read beyond it. */
static void survives_damaged_files(void **state) {
    (void)state;
    const char *good[] = {"[{" ID "," EPOCH "," MEAN ",\"OBJECT_NAME\":\"A\\u0041\"}]", HEADER ROW};
    const unsigned char bytes[] = {0x00, 0x0a, '"', ',', '}', '9', 0xff};
    for (int form = 0; form < 2; form++) {
        size_t length = strlen(good[form]);
        for (size_t i = 0; i < length; i++) {
            for (size_t k = 0; k <= sizeof bytes; k++) {
                bool cut = k == sizeof bytes;
                size_t size = cut ? i : length;
                char *data = malloc(size ? size : 1);
                assert_non_null(data);
                memcpy(data, good[form], size);
                if (!cut) {
                    data[i] = (char)bytes[k];
                }
                bst_ctx ctx = {0};
                bst_elements *sets;
                int count;
                bst_status status =
                    bst_elements_read_buffer(&ctx, "x", data, size, NULL, &sets, &count);
                assert_true((status == BST_OK) == (count > 0) && (count > 0) == (sets != NULL) &&
                            (status == BST_OK) == (ctx.message[0] == '\0'));
                free(sets);
                free(data);
            }
        }
    }
}

static void loads_from_disk(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    const char *path = scratch_path(&place, "sets.csv");
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    enum { SETS = 3000 };
    fputs(HEADER, file);
    for (int i = 0; i < SETS; i++) {
        fputs(ROW, file);
    }
    fclose(file);
    bst_ctx ctx = {0};
    bst_elements *sets;
    int count;
    bst_assert_ok(&ctx, bst_elements_load(&ctx, path, NULL, &sets, &count));
    assert_int_equal(count, SETS);
    free(sets);
    assert_int_equal(bst_elements_load(&ctx, place.folder, NULL, &sets, &count), BST_ERR_IO);
    assert_int_equal(bst_elements_load(&ctx, "no/such", NULL, &sets, &count), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message,
                        "no/such: cannot be opened: No such file or directory; give a "
                        "file of element sets (TLE, or OMM as JSON or CSV)");
    scratch_remove(&place);
}

/* 20 MB in one line: time in proportion to bytes, and no more of it in the message than fits. */
static void a_long_line_is_refused(void **state) {
    (void)state;
    const size_t bytes = (size_t)20 << 20;
    char *data = malloc(bytes);
    assert_non_null(data);
    memset(data, ',', bytes);
    memcpy(data, HEADER, strlen(HEADER));
    bst_ctx ctx = {0};
    bst_elements *sets;
    int count;
    assert_int_equal(bst_elements_read_buffer(&ctx, "sets", data, bytes, NULL, &sets, &count),
                     BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "sets:2: the line is too long (found \",,,"));
    memset(data, '1', bytes);
    assert_int_equal(bst_elements_read_buffer(&ctx, "sets", data, bytes, NULL, &sets, &count),
                     BST_ERR_FORMAT);
    free(data);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_forms_give_the_same_set),
        cmocka_unit_test(angles_are_those_that_are_written),
        cmocka_unit_test(numbers_have_nine_digits),
        cmocka_unit_test(one_satellite_is_picked),
        cmocka_unit_test(epochs_are_exact),
        cmocka_unit_test(errors_say_where_and_what),
        cmocka_unit_test(bad_sets_can_be_skipped),
        cmocka_unit_test(survives_damaged_files),
        cmocka_unit_test(loads_from_disk),
        cmocka_unit_test(a_long_line_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
