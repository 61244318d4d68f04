#include "sim/astro/time.h"
#include "tests/astro/astropy_reference.h"
#include "tests/test_support.h"

static bst_time utc(const char *text) {
    bst_ctx ctx = {0};
    bst_time t = {0};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, text, &t));
    return t;
}

static void assert_utc(bst_time t, int digits, const char *expected) {
    char text[40];
    bst_time_to_utc(t, digits, text, sizeof text);
    assert_string_equal(text, expected);
}

static void utc_agrees_with_astropy(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof reference_times / sizeof *reference_times; i++) {
        bst_time t = utc(reference_times[i].utc);
        bst_time expected = {reference_times[i].tai_jd1, reference_times[i].tai_s / 86400.0};
        /* resolution of the type and the nine decimals of the table */
        bst_assert_close(bst_time_diff(t, expected), 0.0, 6e-10);
        assert_true(t.jd2 >= 0.0 && t.jd2 < 1.0 && t.jd1 == floor(t.jd1) + 0.5);
    }
}

static void text_survives_the_round_trip(void **state) {
    (void)state;
    static const char *const texts[] = {
        "2016-12-31T23:59:59.000000000Z", "2016-12-31T23:59:60.000000000Z",
        "2016-12-31T23:59:60.999999999Z", "2017-01-01T00:00:00.000000000Z",
        "2022-06-16T22:10:00.123456789Z", "2020-02-29T23:59:59.999999999Z",
        "1972-06-30T23:59:60.500000000Z", "2025-12-31T00:00:00.000000001Z",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        assert_utc(utc(texts[i]), 9, texts[i]);
    }
    assert_utc(utc("2022-06-16T22:10:00"), 0, "2022-06-16T22:10:00Z"); /* Z may be left out */
    assert_utc(utc("2022-06-16T22:10:00.12345678901234567890Z"), 6, "2022-06-16T22:10:00.123457Z");
    assert_utc(utc("2022-06-16T22:10:00.5Z"), -3, "2022-06-16T22:10:01Z"); /* digits held to 0 */
    assert_utc(utc("2022-06-16T22:10:00.5Z"), 12, "2022-06-16T22:10:00.500000000Z"); /* and 9 */
}

static void rounding_carries(void **state) {
    (void)state;
    assert_utc(utc("2022-06-16T22:10:59.9999Z"), 3, "2022-06-16T22:11:00.000Z");
    assert_utc(utc("2022-06-16T22:59:59.9999Z"), 3, "2022-06-16T23:00:00.000Z");
    assert_utc(utc("2022-12-31T23:59:59.9999Z"), 3, "2023-01-01T00:00:00.000Z");
    assert_utc(utc("2022-06-16T22:10:59.9994Z"), 3, "2022-06-16T22:10:59.999Z");
    assert_utc(utc("2016-12-31T23:59:59.9999Z"), 3, "2016-12-31T23:59:60.000Z");
    assert_utc(utc("2016-12-31T23:59:60.9999Z"), 3, "2017-01-01T00:00:00.000Z");
    assert_utc(utc("2016-12-31T23:59:60.9994Z"), 3, "2016-12-31T23:59:60.999Z");
    assert_utc(utc("2016-12-31T23:59:60.9994Z"), 0, "2017-01-01T00:00:00Z");
}

static void a_leap_second_is_a_second(void **state) {
    (void)state;
    bst_time before = utc("2016-12-31T23:59:59Z"), after = utc("2017-01-01T00:00:01Z");
    /* three ticks of the clock, 23:59:60 among them; resolution of the type */
    bst_assert_close(bst_time_diff(after, before), 3.0, 1e-10);
    assert_utc(bst_time_add(before, 1.0), 3, "2016-12-31T23:59:60.000Z");
    assert_utc(bst_time_add(before, 1.5), 3, "2016-12-31T23:59:60.500Z");
    assert_utc(bst_time_add(before, 2.0), 3, "2017-01-01T00:00:00.000Z");
    assert_utc(bst_time_add(after, -2.0), 3, "2016-12-31T23:59:60.000Z");
}

static void adding_is_exact(void **state) {
    (void)state;
    bst_time t = utc("2022-06-16T22:10:00.25Z");
    static const double seconds[] = {1e-9,   -1e-9,     0.1,      86399.999, 86400.0, -86400.0,
                                     -0.001, 1234567.8, 9.9999e9, -9.9999e9, 1e-300,  -1e-300};
    for (size_t i = 0; i < sizeof seconds / sizeof *seconds; i++) {
        bst_time moved = bst_time_add(t, seconds[i]);
        assert_true(moved.jd2 >= 0.0 && moved.jd2 < 1.0 && moved.jd1 == floor(moved.jd1) + 0.5);
        /* the header's bound for the inverse, which holds no large numbers */
        bst_assert_close(bst_time_diff(bst_time_add(moved, -seconds[i]), t), 0.0, 1e-10);
    }
    /* 10^9 s are 11574 days and 6400 s: the calendar agrees */
    bst_time far = bst_time_add((bst_time){2459746.5, 0.0}, 1e9);
    assert_true(far.jd1 == 2459746.5 + 11574.0);
    bst_assert_close(far.jd2 * 86400.0, 6400.0, 1e-10);
    /* just before midnight stays a valid fraction */
    bst_time midnight = {2459746.5, 0.0};
    bst_time just_before = bst_time_add(midnight, -1e-13);
    assert_true(just_before.jd2 < 1.0);
    bst_assert_close(bst_time_diff(just_before, midnight), 0.0, 1e-11);
}

static void ticks_do_not_drift_over_a_year(void **state) {
    (void)state;
    const int64_t rate = 6000, day = 86400 * rate;
    bst_time epoch = {2459746.5, 0.25};
    bst_time last = {0};
    for (int64_t k = 0; k < 40000; k++) {
        int64_t tick = k * 4733809 - 6 * day; /* a year and more, before and after the epoch */
        bst_time t = bst_time_at_tick(epoch, tick, rate);
        int64_t total = tick + day / 4 + 1000 * day;
        assert_true(t.jd1 == 2459746.5 - 1000.0 + (double)(total / day));
        /* two roundings of a number below one: 2e-16 of a day */
        bst_assert_close(t.jd2, (double)(total % day) / (double)day, 2.3e-16);
        if (k > 0) {
            bst_assert_close(bst_time_diff(t, last), 4733809.0 / 6000.0, 1e-10);
        }
        last = t;
    }
    /* a year of 365 days later, to the bit */
    bst_time year = bst_time_at_tick(epoch, 365 * day, rate);
    assert_true(year.jd1 == epoch.jd1 + 365.0 && year.jd2 == epoch.jd2);
    bst_time before = bst_time_at_tick(epoch, -1, rate);
    bst_assert_close(bst_time_diff(before, epoch), -1.0 / 6000.0, 2e-11);
}

static void scales_are_offset_as_defined(void **state) {
    (void)state;
    bst_time t = utc("2022-06-16T23:59:30Z");
    double jd1, jd2;
    bst_time_tt(t, &jd1, &jd2); /* TT = UTC + 37 s + 32.184 s */
    assert_true(jd1 == 2459747.5);
    bst_assert_close(jd2 * 86400.0, 39.184, 1e-10);
    /* 8202.5 days and 39.184 s after J2000 */
    bst_assert_close(bst_time_julian_year(t), 2000.0 + (8202.5 + 39.184 / 86400.0) / 365.25, 1e-12);
    bst_time_utc(t, &jd1, &jd2);
    assert_true(jd1 == 2459746.5);
    bst_assert_close(jd2 * 86400.0, 86370.0, 2e-11 * 2);

    bst_ctx ctx = {0};
    bst_time back;
    bst_assert_ok(&ctx, bst_time_from_utc_jd(&ctx, jd1, jd2, &back));
    bst_assert_close(bst_time_diff(back, t), 0.0, 1e-10);
    bst_assert_ok(&ctx, bst_time_from_utc_jd(&ctx, 2459746.0, 0.5, &back)); /* any split */
    bst_assert_close(bst_time_diff(back, utc("2022-06-16T00:00:00Z")), 0.0, 1e-10);
}

static void bad_times_are_explained(void **state) {
    (void)state;
    static const struct {
        const char *text;
        bst_status status;
        const char *says;
    } cases[] = {
        {"", BST_ERR_FORMAT, "is not a UTC time; write YYYY-MM-DDThh:mm:ss"},
        {"yesterday", BST_ERR_FORMAT, "\"yesterday\" is not a UTC time"},
        {"2022-06-16", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-06-16 22:10:00Z", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-6-16T22:10:00Z", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-06-16T22:10:00.Z", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-06-16T22:10:00+02:00", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-06-16T22:10:00Z ", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-06-16T22:10:-1Z", BST_ERR_FORMAT, "is not a UTC time"},
        {"2022-13-16T22:10:00Z", BST_ERR_FORMAT, "month 13 is not in 01..12"},
        {"2022-00-16T22:10:00Z", BST_ERR_FORMAT, "month 00 is not in 01..12"},
        {"2022-02-29T22:10:00Z", BST_ERR_FORMAT, "month 02 of 2022 has no day 29"},
        {"2022-02-00T22:10:00Z", BST_ERR_FORMAT, "has no day 00"},
        {"2022-06-16T24:00:00Z", BST_ERR_FORMAT, "hour 24 is not in 00..23"},
        {"2022-06-16T22:60:00Z", BST_ERR_FORMAT, "minute 60 is not in 00..59"},
        {"2022-06-16T23:59:60Z", BST_ERR_FORMAT, "60 is allowed only where a leap second"},
        {"2016-12-31T22:59:60Z", BST_ERR_FORMAT, "60 is allowed only where a leap second"},
        {"2016-12-31T23:59:61Z", BST_ERR_FORMAT, "second 61 is not in 00..59"},
        {"1959-12-31T23:59:59Z", BST_ERR_RANGE, "1959-12-31T23:59:59Z lies outside the years"},
        {"2100-01-01T00:00:00Z", BST_ERR_RANGE,
         "outside the years for which UTC is accepted, 1960 to 2099"},
        {"2022-06-16T22:10:00Zzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzz",
         BST_ERR_FORMAT, "is not a UTC time"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_time t = {1.0, 2.0};
        bst_status status = bst_time_from_utc(&ctx, cases[i].text, &t);
        if (status != cases[i].status || !strstr(ctx.message, cases[i].says)) {
            fail_msg("\"%s\": status %d, \"%s\"", cases[i].text, (int)status, ctx.message);
        }
        assert_true(t.jd1 == 1.0 && t.jd2 == 2.0); /* untouched */
    }
    bst_ctx ctx = {0};
    bst_time t;
    assert_int_equal(bst_time_from_utc_jd(&ctx, NAN, 0.0, &t), BST_ERR_RANGE);
    assert_int_equal(bst_time_from_utc_jd(&ctx, 2400000.5, 0.0, &t), BST_ERR_RANGE);
    assert_non_null(strstr(ctx.message, "JD 2400000.500000000 (UTC)"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(utc_agrees_with_astropy),
        cmocka_unit_test(text_survives_the_round_trip),
        cmocka_unit_test(rounding_carries),
        cmocka_unit_test(a_leap_second_is_a_second),
        cmocka_unit_test(adding_is_exact),
        cmocka_unit_test(ticks_do_not_drift_over_a_year),
        cmocka_unit_test(scales_are_offset_as_defined),
        cmocka_unit_test(bad_times_are_explained),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
