/* Options of boresight propagate: grid of times, catalogue numbers, frames. */
#include "sim/export/propagate_request.h"
#include "tests/test_support.h"

static bst_propagate_request request(const char *start, const char *stop, double step_s) {
    bst_propagate_request q = BST_PROPAGATE_REQUEST_DEFAULTS;
    q.states.elements = "x.tle";
    q.start_text = start;
    q.stop_text = stop;
    q.step_s = step_s;
    return q;
}

static void test_rows(void **state) {
    (void)state;
    static const struct {
        const char *start, *stop;
        double step_s;
        int64_t rows;
        int digits;
    } cases[] = {
        {"2022-06-16T22:10:00Z", "2022-06-16T22:15:00Z", 60.0, 6, 3},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:14:59Z", 60.0, 5, 3},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:10:00Z", 60.0, 1, 3},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:10:01Z", 0.1, 11, 3},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:10:01Z", 0.0001, 10001, 9},
        {"2022-06-16T22:10:00.0001Z", "2022-06-16T22:10:01.0001Z", 0.5, 3, 9},
        /* the minute has 61 seconds: 23:59:58, :59, :60, 00:00:00, :01, :02 */
        {"2016-12-31T23:59:58Z", "2017-01-01T00:00:02Z", 1.0, 6, 3},
        {"2015-12-31T23:59:58Z", "2016-01-01T00:00:02Z", 1.0, 5, 3},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_propagate_request q = request(cases[i].start, cases[i].stop, cases[i].step_s);
        bst_assert_ok(&ctx, bst_propagate_request_settle(&ctx, &q));
        if (q.states.rows != cases[i].rows || q.states.time_digits != cases[i].digits) {
            fail_msg("case %zu: %lld rows, %d digits", i, (long long)q.states.rows,
                     q.states.time_digits);
        }
    }
}

static void test_times_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *start, *stop;
        double step_s;
        const char *message;
    } cases[] = {
        {"yesterday", "2022-06-16T22:15:00Z", 1.0, "--start"},
        {"2022-06-16T22:10:00Z", "tomorrow", 1.0, "--stop"},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:09:59Z", 1.0, "is before --start"},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:10:01Z", 1.0 / 3.0, "whole microseconds"},
        {"2022-06-16T22:10:00Z", "2022-06-16T22:11:41Z", 1e-6, "give a longer step"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_propagate_request q = request(cases[i].start, cases[i].stop, cases[i].step_s);
        if (bst_propagate_request_settle(&ctx, &q) == BST_OK ||
            !strstr(ctx.message, cases[i].message)) {
            fail_msg("case %zu: %s", i, ctx.message);
        }
    }
}

static void test_catalogue_numbers(void **state) {
    (void)state;
    /* Alpha-5: A is 10, I and O are left out, Z is 33 */
    static const struct {
        const char *text;
        int number; /* 0: refused */
    } cases[] = {{"5", 5},          {"39089", 39089},  {"123456789", 123456789},
                 {"A0000", 100000}, {"J2345", 182345}, {"Z9999", 339999},
                 {"0", 0},          {"I0001", 0},      {"O0001", 0},
                 {"1234567890", 0}, {"12x", 0},        {"A12", 0},
                 {"", 0},           {"-5", 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_propagate_request q = request("2022-06-16T22:10:00Z", "2022-06-16T22:15:00Z", 60.0);
        q.norad_text = cases[i].text;
        bst_status status = bst_propagate_request_settle(&ctx, &q);
        if ((status == BST_OK) != (cases[i].number > 0) ||
            (status == BST_OK && q.states.norad != cases[i].number)) {
            fail_msg("\"%s\": %d, %s", cases[i].text, q.states.norad, ctx.message);
        }
    }
}

static void test_frames(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_propagate_request q = request("2022-06-16T22:10:00Z", "2022-06-16T22:15:00Z", 60.0);
    bst_assert_ok(&ctx, bst_propagate_request_settle(&ctx, &q));
    assert_int_equal(q.states.frame, BST_EXPORT_STATES_TEME);
    q.states.eop_path = "eop.txt";
    assert_int_equal(bst_propagate_request_settle(&ctx, &q), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "--eop has no effect in TEME"));
    q.states.format = BST_EXPORT_STATES_CZML;
    assert_int_equal(bst_propagate_request_settle(&ctx, &q), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "leave --frame teme out"));
    q.states.frame = BST_PROPAGATE_FRAME_DEFAULT;
    bst_assert_ok(&ctx, bst_propagate_request_settle(&ctx, &q));
    assert_int_equal(q.states.frame, BST_EXPORT_STATES_GCRF);
    q.states.elements = NULL;
    assert_int_equal(bst_propagate_request_settle(&ctx, &q), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "--elements is missing"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rows),
        cmocka_unit_test(test_times_are_refused),
        cmocka_unit_test(test_catalogue_numbers),
        cmocka_unit_test(test_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
