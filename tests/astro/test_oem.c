#include "sim/astro/oem.h"

#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/astro/interpolate.h"
#include "tests/astro/damaged_file.h"
#include "tests/test_support.h"

#define VERSION "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-06-16T00:00:00\nORIGINATOR = TEST\n"
#define NAMES "OBJECT_NAME = SAT\nOBJECT_ID = 2022-001A\nCENTER_NAME = EARTH\n"
#define UTC "TIME_SYSTEM = UTC\n"
#define SPAN "START_TIME = 2022-06-16T00:00:00\nSTOP_TIME = 2022-06-16T00:02:00\n"
#define META NAMES "REF_FRAME = GCRF\n" UTC SPAN
#define ROWS                                      \
    "2022-06-16T00:00:00.0 7000 0 0 0 7.5 1\n"    \
    "2022-06-16T00:01:00.0 7001 450 60 0 7.5 1\n" \
    "2022-06-16T00:02:00.0 7000 900 120 0 7.5 1\n"
#define GOOD VERSION "META_START\n" META "META_STOP\n" ROWS

static bst_status read_text(bst_ctx *ctx, const char *text, bst_oem **out) {
    return bst_oem_read_buffer(ctx, "x.oem", text, strlen(text), out);
}

static bst_oem *read_good(const char *text) {
    bst_ctx ctx = {0};
    bst_oem *oem = NULL;
    bst_assert_ok(&ctx, read_text(&ctx, text, &oem));
    return oem;
}

static bst_time utc(const char *text) {
    bst_ctx ctx = {0};
    bst_time t = {0};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, text, &t));
    return t;
}

static void assert_vec(bst_vec3 v, double x, double y, double z, double tolerance) {
    bst_assert_close(v.x, x, tolerance);
    bst_assert_close(v.y, y, tolerance);
    bst_assert_close(v.z, z, tolerance);
}

static void state_at(const bst_oem *oem, bst_sky_clock *clock, bst_time t, bst_vec3 *r,
                     bst_vec3 *v) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_oem_state(&ctx, oem, 0, clock, t, r, v));
}

/* A polynomial of degree `degree` with its derivative. */
static double power(double t, int degree, double *slope) {
    *slope = degree * pow(t, degree - 1);
    return pow(t, degree);
}

/* Interpolants of a degree give polynomials of that degree back; of the next degree they do not. */
static void polynomials_are_exact(void **state) {
    (void)state;
    bst_astro_table_state rows[24];
    for (int degree = 1; degree <= 13; degree++) {
        for (int i = 0; i < 24; i++) {
            /* uneven steps */
            double t = -1.0 + i / 12.0 + 0.02 * sin(2.0 * i), d[3];
            rows[i].t_s = t;
            rows[i].position_m = (bst_vec3){power(t, degree, &d[0]), power(t, 1, &d[1]),
                                            power(t, degree + 1, &d[2])};
            rows[i].velocity_mps = (bst_vec3){d[0], d[1], d[2]};
        }
        for (int hermite = 0; hermite < 2; hermite++) {
            int points = hermite ? (degree + 2) / 2 : degree + 1;
            int reached = hermite ? 2 * points - 1 : degree;
            double worst = 0.0;
            for (double t = -0.99; t < 0.95; t += 0.0137) {
                bst_vec3 r, v;
                double d[3];
                double x = power(t, degree, &d[0]), y = power(t, 1, &d[1]),
                       z = power(t, degree + 1, &d[2]);
                bst_interpolate(rows, 24, t, points, hermite, &r, &v);
                /* rounding of differences over steps of 1/12, more for the derivative */
                bst_assert_close(r.x, x, 1e-13);
                bst_assert_close(r.y, y, 1e-14);
                bst_assert_close(v.x, d[0], 3e-11);
                bst_assert_close(v.y, d[1], 1e-12);
                worst = fmax(worst, fabs(r.z - z));
            }
            if (reached == degree) {
                assert_true(worst > 1e-18);
            } else {
                assert_true(worst < 1e-13);
            }
        }
    }
}

/* What a table of sin t at t = 0, 1, .. 5 gives at 2.3: by exact rational arithmetic on the
 * doubles of the table (Lagrange degree 3 and 5, Hermite degree 3), and the same of its slope. */
static void known_values(void **state) {
    (void)state;
    bst_astro_table_state rows[6];
    for (int i = 0; i < 6; i++) {
        rows[i] = (bst_astro_table_state){i, {sin(i), 0, 0}, {cos(i), 0, 0}};
    }
    static const struct {
        int points, hermite;
        double value, slope;
    } cases[] = {
#include "interpolation_reference.h"
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_vec3 r, v;
        bst_interpolate(rows, 6, 2.3, cases[i].points, cases[i].hermite, &r, &v);
        bst_assert_close(r.x, cases[i].value, 1e-15); /* rounding */
        bst_assert_close(v.x, cases[i].slope, 4e-15);
    }
}

static void path_is_continuous(void **state) {
    (void)state;
    bst_astro_table_state rows[12];
    for (int i = 0; i < 12; i++) {
        rows[i] = (bst_astro_table_state){i, {sin(0.9 * i), 0, 0}, {0.9 * cos(0.9 * i), 0, 0}};
    }
    for (int points = 1; points <= 9; points++) {
        for (int hermite = 0; hermite < 2; hermite++) {
            for (int i = 1; i < 11 && points > 1; i++) {
                bst_vec3 before, after, v;
                bst_interpolate(rows, 12, i - 1e-13, points, hermite, &before, &v);
                bst_interpolate(rows, 12, i, points, hermite, &after, &v);
                bst_assert_close(before.x, after.x, 1e-12); /* 1e-13 of slope 1, rounding */
                assert_true(after.x == rows[i].position_m.x);
            }
        }
    }
}

static void few_rows_lower_the_degree(void **state) {
    (void)state;
    bst_oem *oem = read_good(GOOD);
    bst_vec3 r, v;
    state_at(oem, NULL, utc("2022-06-16T00:00:00Z"), &r, &v);
    assert_vec(r, 7e6, 0, 0, 1e-8); /* exact decimals times 1000 */
    state_at(oem, NULL, utc("2022-06-16T00:00:30Z"), &r, &v);
    /* y and z are linear; a quintic through three rows, computed by hand for x: even about 60 s,
     * x = 1000 (1 - u^2)^2 with u = (t - 60) / 60 */
    assert_vec(r, 7e6 + 1000.0 * 0.5625, 225e3, 30e3, 1e-8);
    bst_assert_close(v.x, 1000.0 * 2 * 0.75 * 2 * 0.5 / 60.0, 1e-9);
    bst_oem_free(oem);
    /* one row: there only, with its velocity whatever the method */
    oem = read_good(VERSION "META_START\n" NAMES "REF_FRAME = ICRF\n" UTC
                            "START_TIME = 2022-06-16T00:00:00\nSTOP_TIME = 2022-06-16T00:00:00\n"
                            "INTERPOLATION = LAGRANGE\nMETA_STOP\n"
                            "2022-06-16T00:00:00 7000 1 2 3 4 5\n");
    state_at(oem, NULL, utc("2022-06-16T00:00:00Z"), &r, &v);
    assert_vec(r, 7e6, 1e3, 2e3, 1e-8);
    assert_vec(v, 3e3, 4e3, 5e3, 1e-11);
    bst_time later = utc("2022-06-16T00:00:00.1Z");
    assert_int_equal(bst_oem_state(NULL, oem, 0, NULL, later, &r, &v), BST_ERR_NUMERIC);
    bst_oem_free(oem);
}

static void methods_are_the_files_own(void **state) {
    (void)state;
    static const struct {
        const char *keys;
        double x_m; /* at 30 s */
    } cases[] = {
        {"INTERPOLATION = LINEAR\n", 7000500.0},
        {"INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 1\n", 7000500.0},
        {"INTERPOLATION = lagrange\nINTERPOLATION_DEGREE = 2\n", 7000750.0},
        {"INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 31\n", 7000750.0},
        {"INTERPOLATION = LAGRANGE\n", 7000750.0},
        {"INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 3\n", 7000500.0},
        {"INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 5\n", 7000562.5},
        {"INTERPOLATION = HERMITE\n", 7000562.5},
        {"", 7000562.5},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1200];
        snprintf(text, sizeof text, "%sMETA_START\n%s%sMETA_STOP\n%s", VERSION, META, cases[i].keys,
                 ROWS);
        bst_oem *oem = read_good(text);
        bst_vec3 r, v;
        state_at(oem, NULL, utc("2022-06-16T00:00:30Z"), &r, &v);
        bst_assert_close(r.x, cases[i].x_m, 1e-8); /* rounding at 7e6 */
        bst_oem_free(oem);
    }
}

/* One instant and place in each frame and time system. */
static void frames_and_time_systems(void **state) {
    (void)state;
    static const struct {
        const char *frame, *system, *epoch;
    } cases[] = {
        {"GCRF", "UTC", "2022-06-16T00:00:00"},
        {"gcrf", "TAI", "2022-06-16T00:00:37"},
        {"ICRF", "TT", "2022-06-16T00:01:09.184"},
        {"GCRF", "GPS", "2022-167T00:00:18.000Z"},
        /* TDB - TT by ERFA's eraDtdb at that time: 0.000558 s */
        {"GCRF", "TDB", "2022-06-16T00:01:09.184558"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1200];
        snprintf(text, sizeof text,
                 "%sMETA_START\n%sREF_FRAME = %s\nTIME_SYSTEM = %s\nSTART_TIME = %s\nSTOP_TIME = "
                 "%s\nMETA_STOP\n%s 7000 1 2 3 4 5 0.1 0.2 0.3\n",
                 VERSION, NAMES, cases[i].frame, cases[i].system, cases[i].epoch, cases[i].epoch,
                 cases[i].epoch);
        bst_oem *oem = read_good(text);
        bst_time start, stop;
        bst_oem_span(oem, 0, &start, &stop);
        /* the formula of TDB is good to 10 us, the text to 1 us; else rounding */
        bst_assert_close(bst_time_diff(start, utc("2022-06-16T00:00:00Z")), 0.0,
                         i == 4 ? 2e-5 : 1e-10);
        bst_oem_free(oem);
    }
    bst_oem *oem = read_good(VERSION "META_START\n" NAMES "REF_FRAME = EME2000\n" UTC SPAN
                                     "META_STOP\n2022-06-16T00:00:00 42164 -7000 1234.5 1 2 3\n"
                                     "2022-06-16T00:02:00 42164 -7000 1234.5 1 2 3\n");
    bst_vec3 r, v;
    state_at(oem, NULL, utc("2022-06-16T00:00:00Z"), &r, &v);
    /* the transpose of ERFA's frame bias (erfa.bp06) times that vector, by Python */
    assert_vec(r, 42163999.40505998, -7000003.025335335, 1234503.1654059956, 2e-8);
    bst_oem_free(oem);
}

static void turning_frames(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_astro_eop *eop = NULL;
    bst_sky_clock *clock = NULL;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_sky_clock_create(&ctx, eop, &clock));
    /* a place at rest on the Earth, and one at rest in TEME */
    static const char *const frames[] = {"ITRF2014", "ITRF-97", "itrf", "TEME"};
    for (int i = 0; i < 4; i++) {
        char text[1200];
        snprintf(text, sizeof text,
                 "%sMETA_START\n%sREF_FRAME = %s\n%s%sMETA_STOP\n2022-06-16T00:00:00 6378.137 100 "
                 "200 0 0 0\n2022-06-16T00:02:00 6378.137 100 200 0 0 0\n",
                 VERSION, NAMES, frames[i], UTC, SPAN);
        bst_oem *oem = read_good(text);
        bst_time t = utc("2022-06-16T00:01:10Z");
        bst_astro_earth_frames exact;
        bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, t, &exact));
        const bst_vec3 place = {6378137.0, 100e3, 200e3};
        bst_vec3 r, v, later, earlier, expected = bst_mat3_mul_vec(&exact.gcrf_from_teme, place);
        if (i < 3) {
            expected = bst_mat3_transpose_mul_vec(&exact.itrf_from_gcrf, place);
        }
        state_at(oem, clock, t, &r, &v);
        assert_vec(r, expected.x, expected.y, expected.z, 1e-3); /* the clock's own tolerance */
        state_at(oem, clock, bst_time_add(t, 0.5), &later, &v);
        state_at(oem, clock, bst_time_add(t, -0.5), &earlier, &v);
        state_at(oem, clock, t, &r, &v);
        /* the derivative: the third one over 24 is 1e-7 m/s; precession is left out, 6e-5 m/s */
        assert_vec(v, later.x - earlier.x, later.y - earlier.y, later.z - earlier.z, 1e-4);
        assert_int_equal(bst_oem_state(&ctx, oem, 0, NULL, t, &r, &v), BST_ERR_ARGUMENT);
        bst_oem_free(oem);
    }
    bst_sky_clock_free(clock);
    bst_astro_eop_free(eop);
}

/* Two segments of one object, with a jump in velocity where they meet, and another object. */
static const char two_segments[] = VERSION
    "COMMENT a burn\n\nMETA_START\nCOMMENT first\n" META
    "USEABLE_STOP_TIME = 2022-06-16T00:01:30\nMETA_STOP\n\nCOMMENT data\n" ROWS
    "META_START\nOBJECT_NAME = OTHER\nOBJECT_ID = 1999-001B\nCENTER_NAME = EARTH\n"
    "REF_FRAME = GCRF\n" UTC SPAN "META_STOP\n" ROWS "META_START\n" NAMES "REF_FRAME = GCRF\n" UTC
    "START_TIME = 2022-06-16T00:01:00\nUSEABLE_START_TIME = 2022-06-16T00:01:30\n"
    "STOP_TIME = 2022-06-16T00:03:00\nMETA_STOP\n"
    "2022-06-16T00:01:00 7001 450 60 0 8.5 1\n2022-06-16T00:02:00 7001 960 60 0 8.5 1\n"
    "2022-06-16T00:03:00 7001 1470 60 0 8.5 1\n"
    "COVARIANCE_START\nEPOCH = 2022-06-16T00:01:00\nCOV_REF_FRAME = RTN\n1e-6\n0 1\n"
    "0 0 1\n0 0 0 1\n0 0 0 0 1\n0 0 0 0 0 1\nEPOCH = 2022-06-16T00:02:00\n1\n0 1\n0 0 1\n"
    "0 0 0 1\n0 0 0 0 1\n0 0 0 0 0 1\nCOVARIANCE_STOP\n";

static void segments_are_kept_apart(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_oem *oem = read_good(two_segments);
    assert_int_equal(bst_oem_object_count(oem), 2);
    assert_string_equal(bst_oem_object_name(oem, 0), "SAT");
    assert_string_equal(bst_oem_object_id(oem, 1), "1999-001B");
    int object = -1;
    bst_assert_ok(&ctx, bst_oem_find(&ctx, oem, "1999-001B", &object));
    assert_int_equal(object, 1);
    bst_assert_ok(&ctx, bst_oem_find(&ctx, oem, "SAT", &object));
    assert_int_equal(object, 0);
    assert_int_equal(bst_oem_find(&ctx, oem, "NOBODY", &object), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message,
                        "x.oem: no object \"NOBODY\" by name or identifier among 2 "
                        "(the first: \"SAT\", 2022-001A)");
    assert_int_equal(bst_oem_find(&ctx, oem, "", &object), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message,
                        "x.oem: 2 objects fit \"\" (the last: \"OTHER\", 1999-001B); "
                        "give the name or identifier of one");
    bst_vec3 r, v;
    state_at(oem, NULL, utc("2022-06-16T00:01:29.999Z"), &r, &v);
    bst_assert_close(v.y, 7500.0, 1e-8); /* linear: rounding */
    state_at(oem, NULL, utc("2022-06-16T00:01:30Z"), &r, &v);
    bst_assert_close(v.y, 8500.0, 1e-8);
    bst_assert_close(r.y, 705e3, 1e-8);
    state_at(oem, NULL, utc("2022-06-16T00:03:00Z"), &r, &v);
    bst_assert_close(r.y, 1470e3, 1e-8);
    bst_time start = utc("2022-06-16T00:00:00Z"), stop = utc("2022-06-16T00:03:00Z");
    assert_true(bst_oem_covers(oem, 0, start, stop));
    assert_true(bst_oem_covers(oem, 0, stop, stop));
    assert_false(bst_oem_covers(oem, 0, bst_time_add(start, -0.1), stop));
    assert_false(bst_oem_covers(oem, 0, start, bst_time_add(stop, 0.1)));
    assert_false(bst_oem_covers(oem, 1, start, stop));
    assert_int_equal(bst_oem_state(&ctx, oem, 0, NULL, bst_time_add(stop, 0.001), &r, &v),
                     BST_ERR_NUMERIC);
    assert_string_equal(ctx.message,
                        "x.oem: no state of \"SAT\" at 2022-06-16T00:03:00.001Z: the file covers "
                        "2022-06-16T00:00:00.000Z to 2022-06-16T00:03:00.000Z");
    assert_int_equal(bst_oem_state(&ctx, oem, 0, NULL, (bst_time){NAN, NAN}, &r, &v),
                     BST_ERR_NUMERIC);
    bst_oem_free(oem);
}

static void gaps_have_no_state(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    /* the second segment is usable half a minute later */
    char *text = strdup(two_segments), *at = strstr(text, "USEABLE_START_TIME = 2022-06-16T00:01");
    memcpy(at + strlen("USEABLE_START_TIME = 2022-06-16T00:0"), "2:00", 4);
    bst_oem *oem = read_good(text);
    bst_vec3 r, v;
    bst_time t = utc("2022-06-16T00:01:45Z");
    assert_int_equal(bst_oem_state(&ctx, oem, 0, NULL, t, &r, &v), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, ", with a gap there between two segments"));
    assert_false(bst_oem_covers(oem, 0, bst_time_add(t, -60.0), bst_time_add(t, 60.0)));
    state_at(oem, NULL, bst_time_add(t, 15.0 - 5e-7), &r, &v); /* within the slack */
    bst_oem_free(oem);
    free(text);
}

static void leap_seconds_count(void **state) {
    (void)state;
    bst_oem *oem =
        read_good(VERSION "META_START\n" NAMES "REF_FRAME = GCRF\n" UTC
                          "START_TIME = 2016-12-31T23:59:59.123456789\nSTOP_TIME = "
                          "2017-01-01T00:00:01.123456789\nINTERPOLATION = LINEAR\nMETA_STOP\n"
                          "2016-12-31T23:59:59.123456789 7000 0 0 0 0 0\n"
                          "2016-12-31T23:59:60.123456789 7001 0 0 0 0 0\n"
                          "2017-01-01T00:00:00.123456789 7002 0 0 0 0 0\n"
                          "2017-01-01T00:00:01.123456789 7003 0 0 0 0 0\n");
    bst_vec3 r, v;
    for (int half = 0; half <= 6; half++) {
        bst_time t = bst_time_add(utc("2016-12-31T23:59:59.123456789Z"), 0.5 * half);
        state_at(oem, NULL, t, &r, &v);
        bst_assert_close(r.x, 7e6 + 500.0 * half, 1e-7); /* 1e-11 s of time, 1 km/s */
    }
    bst_oem_free(oem);
}

/* The form of the example of CCSDS 502.0, annex, in words and numbers of our own, with CRLF, a byte
 * order mark, tabs and blanks. */
static void takes_what_others_write(void **state) {
    (void)state;
    bst_oem *oem = read_good(
        "\xEF\xBB\xBF\r\n  CCSDS_OEM_VERS\t=  1.0 \r\nCOMMENT caf\xC3\xA9\r\n"
        "CREATION_DATE = 1996-310T17:22:31\r\nORIGINATOR = ELSEWHERE\r\n\r\n"
        " META_START\r\nOBJECT_NAME          = SOME PROBE OF A LONG NAME, OF MORE THAN SIXTY-THREE "
        "CHARACTERS LONG\r\nOBJECT_ID=1996-062A\r\nCENTER_NAME = Earth\r\nREF_FRAME = EME2000\r\n"
        "TIME_SYSTEM = TDB\r\nSTART_TIME = 1996-12-18T12:00:00.331\r\n"
        "STOP_TIME = 1996-12-18T12:04:00.331\r\nINTERPOLATION = hermite\r\n"
        "INTERPOLATION_DEGREE = 7\r\nMETA_STOP\r\n"
        "1996-12-18T12:00:00.331   +2789.619 -280.045 -1746.755 4.73372 -2.49586 -1.0419499E+00\r\n"
        "\t1996-12-18T12:01:00.331 2783.419  -308.143 -1877.071 5.18604 -2.42124 -1.99608\r\n"
        "1996-12-18T12:02:00.331 2776.033 -336.859 -2008.682 5.63678 -2.33951 -1.94687\r\n"
        "1996-353T12:04:00.331 2.74e3 -.390e3 -2260. 6.5 -2.2 -1.9");
    assert_int_equal((int)strlen(bst_oem_object_name(oem, 0)), 63);
    bst_oem_free(oem);
}

static void errors_say_where_and_what(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", "x.oem:1: the file ends before it begins as an OEM (expected CCSDS_OEM_VERS)"},
        {"<?xml version=\"1.0\"?>\n",
         "x.oem:1: the file does not begin as an OEM in KVN does (found "
         "\"<?xml version=\"1.0\"?>\", expected CCSDS_OEM_VERS = 1.0, 2.0 or 3.0)"},
        {"CCSDS_OEM_VERS = 9.0\n",
         "x.oem:1: the version is not one that is read (found \"9.0\", "
         "expected 1.0, 2.0 or 3.0)"},
        {VERSION "ORIGINATOR = X\n",
         "x.oem:4: the keyword is given twice (found \"ORIGINATOR = "
         "X\", expected each keyword once)"},
        {VERSION "ORIGNATOR = X\n",
         "x.oem:4: the keyword is not known here (found \"ORIGNATOR\", "
         "expected ORIGINATOR)"},
        {VERSION "nonsense\n",
         "x.oem:4: is not a line that this message has here (found \"nonsense\", "
         "expected KEYWORD = value)"},
        {VERSION, "x.oem:3: the file ends before any metadata (expected META_START)"},
        {VERSION "META_START\n" META,
         "x.oem:11: the file ends within metadata (expected "
         "META_STOP)"},
        {VERSION "META_START\nMETA_STOP\n", "x.oem:4: OBJECT_NAME is missing from this metadata"},
        {VERSION "META_START\n" NAMES "REF_FRAME = GCRF\n" SPAN "META_STOP\n",
         "x.oem:4: TIME_SYSTEM is missing from this metadata"},
        {VERSION "META_START\n" META "OBJECT_ID = 5\n",
         "x.oem:12: the keyword is given twice (found \"OBJECT_ID = 5\", expected each keyword "
         "once)"},
        {VERSION "META_START\nOBJECT_NAM = 5\n",
         "x.oem:5: the keyword is not known here (found "
         "\"OBJECT_NAM\", expected OBJECT_NAME)"},
        {VERSION "META_START\nOBJECT_NAME =\n",
         "x.oem:5: the keyword has no value (found "
         "\"OBJECT_NAME =\", expected KEYWORD = value)"},
        {VERSION "META_START\nOBJECT_NAME = A\nOBJECT_ID = B\nCENTER_NAME = MARS\nREF_FRAME = "
                 "GCRF\n" UTC SPAN "META_STOP\n",
         "x.oem:7: CENTER_NAME is not the one that is read (found \"MARS\", expected EARTH)"},
        {VERSION "META_START\n" NAMES "REF_FRAME = TOD\n" UTC SPAN "META_STOP\n",
         "x.oem:8: REF_FRAME is not one that is read (found \"TOD\", expected GCRF, ICRF, EME2000, "
         "TEME or ITRF)"},
        {VERSION "META_START\n" NAMES
                 "REF_FRAME = TEME\nREF_FRAME_EPOCH = 2000-01-01T00:00:00\n" UTC SPAN "META_STOP\n",
         "x.oem:9: REF_FRAME_EPOCH fixes a turning frame, which is not read (found "
         "\"2000-01-01T00:00:00\", expected TEME and ITRF of date)"},
        {VERSION "META_START\n" NAMES "REF_FRAME = GCRF\nTIME_SYSTEM = SCLK\n" SPAN "META_STOP\n",
         "x.oem:9: TIME_SYSTEM is not one that is read (found \"SCLK\", expected UTC, TAI, TT, TDB "
         "or GPS)"},
        {VERSION "META_START\n" META "INTERPOLATION = SPLINE\nMETA_STOP\n",
         "x.oem:12: INTERPOLATION is not one that is read (found \"SPLINE\", expected HERMITE, "
         "LAGRANGE or LINEAR)"},
        {VERSION "META_START\n" META "INTERPOLATION_DEGREE = 32\nMETA_STOP\n",
         "x.oem:12: INTERPOLATION_DEGREE is not a whole number in the range (found \"32\", "
         "expected 1 to 31)"},
        {VERSION "META_START\n" META "INTERPOLATION_DEGREE = 0\nMETA_STOP\n",
         "x.oem:12: INTERPOLATION_DEGREE is not a whole number in the range (found \"0\", expected "
         "1 to 31)"},
        {VERSION "META_START\n" NAMES "REF_FRAME = GCRF\n" UTC
                 "START_TIME = 2022-06-16T00:00:00\nSTOP_TIME = 2022-06-15T00:00:00\nMETA_STOP\n",
         "x.oem:11: STOP_TIME is before START_TIME (found \"2022-06-15T00:00:00\", expected a "
         "later date)"},
        {VERSION "META_START\n" META "USEABLE_START_TIME = 2022-06-17T00:00:00\nMETA_STOP\n",
         "x.oem:12: USEABLE_START_TIME makes the usable span end before it starts (found "
         "\"2022-06-17T00:00:00\", expected start and stop in the order of time)"},
        {VERSION "META_START\n" NAMES "REF_FRAME = GCRF\n" UTC
                 "START_TIME = 2022-366T00:00:00\nSTOP_TIME = 2022-06-15T00:00:00\nMETA_STOP\n",
         "x.oem:10: \"2022-366T00:00:00\" has no day of the year in 001..365, as that year does"},
        {VERSION "META_START\n" META "META_STOP\n", "x.oem:4: no states follow this metadata"},
        {GOOD "2022-06-16T00:02:00 1 2 3 4 5 6\n",
         "x.oem:16: the epoch is that of the state before it (found \"2022-06-16T00:02:00 1 2 3 4 "
         "5 6\", expected epochs that rise)"},
        {GOOD "2022-06-16T00:01:59 1 2 3 4 5 6\n",
         "x.oem:16: the epoch is before that of the state before it (found \"2022-06-16T00:01:59 1 "
         "2 3 4 5 6\", expected epochs that rise)"},
        {GOOD "2022-06-16T00:03:00 1 2 3 4 5\n",
         "x.oem:16: fewer numbers than a state has (found \"2022-06-16T00:03:00 1 2 3 4 5\", "
         "expected an epoch and 6 numbers, or 9 with accelerations)"},
        {GOOD "2022-06-16T00:03:00 1 2 3 4 5 6 7\n",
         "x.oem:16: fewer numbers than a state has (found \"2022-06-16T00:03:00 1 2 3 4 5 6 7\", "
         "expected an epoch and 6 numbers, or 9 with accelerations)"},
        {GOOD "2022-06-16T00:03:00 1 2 3 4 5 6 7 8 9 10\n",
         "x.oem:16: more numbers than a state has (found \"2022-06-16T00:03:00 1 2 3 4 5 6 7 8 9 "
         "10\", expected an epoch and 6 numbers, or 9 with accelerations)"},
        {GOOD "2022-06-16T00:03:00 1 2 nan 4 5 6\n",
         "x.oem:16: is not a number (found \"nan\", expected a number in km, km/s or km/s2)"},
        {GOOD "2022-06-16T00:03:00 1 2 1e400 4 5 6\n",
         "x.oem:16: is not a number (found \"1e400\", expected a number in km, km/s or km/s2)"},
        {GOOD "and so on\n",
         "x.oem:16: \"and\" is not a date (expected YYYY-MM-DDThh:mm:ss or YYYY-DDDThh:mm:ss, then "
         "if wanted decimals, as in 2022-06-16T22:10:00.5)"},
        {GOOD "2022-06-16T00:02:60 1 2 3 4 5 6\n",
         "x.oem:16: \"2022-06-16T00:02:60\" has no second in 00..59 (60 only where a leap second "
         "was inserted)"},
        {VERSION
         "META_START\n" NAMES "REF_FRAME = GCRF\n" UTC
         "START_TIME = 2022-06-16T00:00:00\nSTOP_TIME = 2022-06-16T01:00:00\nMETA_STOP\n" ROWS,
         "x.oem:4: the states do not reach from START_TIME to STOP_TIME (the last ends before line "
         "16); is the file cut short?"},
        {VERSION "META_START\n" META "USEABLE_START_TIME = 2022-06-16T00:01:58\nMETA_STOP\n"
                 "2022-06-16T00:00:00 7000 0 0 0 7.5 1\n2022-06-16T00:01:57 7000 0 0 0 7.5 1\n",
         "x.oem:4: no states within the usable span"},
        {GOOD "META_START\n" META "META_STOP\n" ROWS,
         "x.oem:16: the usable span overlaps that of the segment of the same object at line 4; set "
         "USEABLE_START_TIME and USEABLE_STOP_TIME"},
        {GOOD "COVARIANCE_START\n",
         "x.oem:16: the file ends within a covariance (expected COVARIANCE_STOP)"},
        {GOOD "COVARIANCE_START\nCOVARIANCE_STOP\n",
         "x.oem:17: the covariance is not complete (found \"COVARIANCE_STOP\", expected EPOCH and "
         "6 rows of numbers)"},
        {GOOD "COVARIANCE_START\n1\n",
         "x.oem:17: a row of a covariance without an EPOCH (found \"1\", expected EPOCH = date "
         "before it)"},
        {GOOD "COVARIANCE_START\nEPOCH = 2022-06-16T00:00:00\n1 2\n",
         "x.oem:18: the row of the covariance has not as many numbers as its place asks (found "
         "\"1 2\", expected the lower triangle: 1 number, then 2, to 6)"},
        {GOOD "COVARIANCE_START\nEPOCH = 2022-06-16T00:00:00\nx\n",
         "x.oem:18: is not a number (found \"x\", expected an element of a covariance)"},
        {GOOD "COVARIANCE_START\nEPOCH = 2022-06-16T00:00:00\n1\nEPOCH = 2022-06-16T00:00:00\n",
         "x.oem:19: the covariance before it is not complete (found \"EPOCH = "
         "2022-06-16T00:00:00\", expected 6 rows of numbers)"},
        {GOOD "COVARIANCE_START\nEPOCH = 2022-06-16T00:00:00\n1\n0 1\n0 0 1\n0 0 0 1\n0 0 0 0 1\n"
              "COVARIANCE_STOP\n",
         "x.oem:23: the covariance is not complete (found \"COVARIANCE_STOP\", expected EPOCH and "
         "6 rows of numbers)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_oem *oem = (bst_oem *)&ctx;
        bst_status status = read_text(&ctx, cases[i].text, &oem);
        assert_string_equal(ctx.message, cases[i].message);
        assert_int_equal(status, BST_ERR_FORMAT);
        assert_null(oem);
    }
    bst_ctx ctx = {0};
    bst_oem *oem;
    assert_int_equal(bst_oem_load(&ctx, "no/such", &oem), BST_ERR_NOT_FOUND);
    assert_string_equal(ctx.message,
                        "no/such: cannot be opened: No such file or directory; give "
                        "an OEM file (CCSDS 502.0, KVN)");
    assert_int_equal(bst_oem_load(&ctx, "tests", &oem), BST_ERR_IO);
    assert_int_equal(bst_oem_read_buffer(&ctx, "x.oem", "CCSDS\0", 6, &oem), BST_ERR_FORMAT);
}

/* What is accepted must evaluate. */
static void read_damaged(const char *data, size_t size) {
    bst_ctx ctx = {0};
    bst_oem *oem;
    bst_status status = bst_oem_read_buffer(&ctx, "x", data, size, &oem);
    assert_true((status == BST_OK) == (oem != NULL) &&
                (status == BST_OK) == (ctx.message[0] == '\0'));
    for (int o = 0; oem && o < bst_oem_object_count(oem); o++) {
        bst_time start, stop;
        bst_vec3 r, v;
        bst_oem_span(oem, o, &start, &stop);
        bst_assert_ok(&ctx, bst_oem_state(&ctx, oem, o, NULL, start, &r, &v));
        bst_assert_ok(&ctx, bst_oem_state(&ctx, oem, o, NULL, stop, &r, &v));
    }
    bst_oem_free(oem);
}

static void survives_damaged_files(void **state) {
    (void)state;
    const unsigned char bytes[] = {0x00, 0x0a, ' ', '=', '9', 0xff};
    bst_damage(two_segments, bytes, sizeof bytes, read_damaged);
}

/* 20 MB of one line, and 100,000 objects in segments of their own: in proportion to bytes. */
static void large_files_take_little_time(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_oem *oem;
    size_t bytes = (size_t)20 << 20, used = strlen(GOOD);
    char *data = malloc(bytes);
    assert_non_null(data);
    memset(data, '1', bytes);
    memcpy(data, GOOD, used);
    assert_int_equal(bst_oem_read_buffer(&ctx, "x.oem", data, bytes, &oem), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "x.oem:16: \"111"));
    assert_true(strlen(ctx.message) < 400);
    used = (size_t)snprintf(data, bytes, "%s", VERSION);
    enum { OBJECTS = 50000 };
    for (int i = 0; i < OBJECTS; i++) {
        used += (size_t)snprintf(data + used, bytes - used,
                                 "META_START\nOBJECT_NAME = S%d\nOBJECT_ID = %d\nCENTER_NAME = "
                                 "EARTH\nREF_FRAME = GCRF\n" UTC SPAN "META_STOP\n%s",
                                 i, i, ROWS);
    }
    bst_assert_ok(&ctx, bst_oem_read_buffer(&ctx, "x.oem", data, used, &oem));
    assert_int_equal(bst_oem_object_count(oem), OBJECTS);
    assert_string_equal(bst_oem_object_name(oem, 777), "S777");
    bst_oem_free(oem);
    free(data);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(polynomials_are_exact),
        cmocka_unit_test(known_values),
        cmocka_unit_test(path_is_continuous),
        cmocka_unit_test(few_rows_lower_the_degree),
        cmocka_unit_test(methods_are_the_files_own),
        cmocka_unit_test(frames_and_time_systems),
        cmocka_unit_test(turning_frames),
        cmocka_unit_test(segments_are_kept_apart),
        cmocka_unit_test(gaps_have_no_state),
        cmocka_unit_test(leap_seconds_count),
        cmocka_unit_test(takes_what_others_write),
        cmocka_unit_test(errors_say_where_and_what),
        cmocka_unit_test(survives_damaged_files),
        cmocka_unit_test(large_files_take_little_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
