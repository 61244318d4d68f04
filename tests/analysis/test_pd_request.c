/* Options of boresight pd: ranges, and what does not go together. */
#include "sim/analysis/pd/pd_request.h"
#include "tests/test_support.h"

static void test_ranges(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pd_options o = {0};
    bst_assert_ok(&ctx, bst_pd_range_read(&ctx, "snr", "2:12:0.5", "2:12.5:0.25", 0.1, 1e4, &o));
    assert_true(o.low == 2.0 && o.high == 12.5 && o.step == 0.25);
    bst_assert_ok(&ctx, bst_pd_range_read(&ctx, "magnitude", "12:18:0.25", "-1.5:-1.5:1e-3", -30.0,
                                          40.0, &o));
    assert_true(o.low == -1.5 && o.high == -1.5);
    static const char *const wrong[] = {"",       "2",        "2:3",     "2:3:4:5",  "a:3:1",
                                        "2:3:1x", "nan:3:1",  "2:inf:1", "3:2:1",    "2:3:0",
                                        "2:3:-1", "0.05:3:1", "2:2e4:1", "2:12:0.05"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        bst_pd_options kept = {.low = 7.0, .high = 8.0, .step = 9.0};
        if (bst_pd_range_read(&ctx, "snr", "2:12:0.5", wrong[i], 0.1, 1e4, &kept) !=
            BST_ERR_ARGUMENT) {
            fail_msg("\"%s\" is taken", wrong[i]);
        }
        assert_non_null(strstr(ctx.message, "--snr"));
        assert_true(kept.low == 7.0 && kept.high == 8.0 && kept.step == 9.0);
    }
    /* 200 points are the most: 199 steps */
    bst_assert_ok(&ctx, bst_pd_range_read(&ctx, "snr", "2:12:0.5", "1:200:1", 0.1, 1e4, &o));
    assert_int_equal(bst_pd_range_read(&ctx, "snr", "2:12:0.5", "1:201:1", 0.1, 1e4, &o),
                     BST_ERR_ARGUMENT);
}

static void test_lists(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double out[3] = {7.0, 7.0, 7.0};
    bst_pd_list list = {"ratio", "1,4", 1.0, 9.0, out, 3, 0};
    bst_assert_ok(&ctx, bst_pd_list_read(&ctx, "1,2.5,4", &list));
    assert_true(list.count == 3 && out[0] == 1.0 && out[1] == 2.5 && out[2] == 4.0);
    bst_assert_ok(&ctx, bst_pd_list_read(&ctx, "9", &list));
    assert_true(list.count == 1 && out[0] == 9.0 && out[1] == 2.5);
    static const char *const wrong[] = {"",      ",",     "1,",   ",1",     "1,,2",    "1;2",
                                        "a",     "1,nan", "inf",  "1e999",  "0.9",     "9.1",
                                        "2,1",   "1,1",   "1 ,2", "1,2x",   "1,2,3,4", "-1",
                                        "1:2:1", "1,2,",  "0x",   "1,2,3,", "1e-400,2"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        if (bst_pd_list_read(&ctx, wrong[i], &list) != BST_ERR_ARGUMENT) {
            fail_msg("\"%s\" is taken", wrong[i]);
        }
        assert_non_null(strstr(ctx.message, "--ratio"));
        assert_true(list.count == 1 && out[0] == 9.0);
    }
}

/* Reads a command line as the command does. */
static bst_status read_line(bst_ctx *ctx, bst_pd_request *r, const char *a, const char *b,
                            const char *c, const char *d) {
    char words[5][64] = {"pd"};
    char *argv[6] = {words[0]};
    const char *const given[] = {a, b, c, d};
    bst_option table[BST_OPTIONS_MAX];
    int argc = 1, arguments = 0;
    for (; argc <= 4 && given[argc - 1]; argc++) {
        snprintf(words[argc], sizeof words[argc], "%s", given[argc - 1]);
        argv[argc] = words[argc];
    }
    *r = (bst_pd_request)BST_PD_REQUEST_DEFAULTS;
    bst_options_bind(bst_pd_option_table, r, table);
    bst_assert_ok(ctx, bst_options_parse(ctx, table, argc, argv, &arguments));
    bst_status status = bst_pd_request_settle(ctx, r, table);
    r->range = r->magnitudes = r->ratios = r->separations = NULL; /* of words */
    r->load.table = NULL;
    return status;
}

static void test_defaults(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pd_request r;
    bst_assert_ok(&ctx, read_line(&ctx, &r, NULL, NULL, NULL, NULL));
    assert_true(r.options.low == 2.0 && r.options.high == 12.0 && r.options.step == 0.5);
    assert_false(r.options.by_magnitude);
    assert_int_equal(r.options.trials, 1000);
    bst_assert_ok(&ctx, read_line(&ctx, &r, "--pair", NULL, NULL, NULL));
    assert_true(r.pairs.snrs == 4 && r.pairs.snr[3] == 200.0 && r.pairs.ratios == 2);
    assert_true(r.pairs.separations == 0 && r.options.trials == 300);
    assert_true(r.options.false_splits == -1.0); /* the scenario's */
    bst_assert_ok(&ctx, read_line(&ctx, &r, "--pair", "--snr=20:60:20", "--separation=1,2", NULL));
    assert_true(r.pairs.snrs == 3 && r.pairs.snr[1] == 40.0 && r.pairs.separation_px[1] == 2.0);
    bst_assert_ok(&ctx, read_line(&ctx, &r, "--stack", "8", "--threads=3", NULL));
    assert_true(r.options.high == 2.4); /* a stack finds what is fainter */
    assert_int_equal(r.options.threads, 3);
    bst_assert_ok(&ctx, read_line(&ctx, &r, "--magnitude", "12:18:0.5", NULL, NULL));
    assert_true(r.options.by_magnitude && r.options.high == 18.0);
}

static void test_what_does_not_go_together(void **state) {
    (void)state;
    static const struct {
        const char *words[4], *message;
    } cases[] = {
        {{"--snr=1:2:1", "--magnitude=1:2:1"}, "--snr or --magnitude"},
        {{"--known-rate"}, "--streak PX"},
        {{"--known-rate", "--streak=3", "--star-streak=3"}, "leave out --star-streak"},
        {{"--stack=6"}, "a multiple of 4"},
        {{"--stack=4", "--streak=3"}, "--stack is of points"},
        {{"--stars", "--background=3"}, "give one"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_pd_request r;
        const char *const *w = cases[i].words;
        if (read_line(&ctx, &r, w[0], w[1], w[2], w[3]) != BST_ERR_ARGUMENT ||
            !strstr(ctx.message, cases[i].message)) {
            fail_msg("%s: %s", w[0], ctx.message);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ranges),
        cmocka_unit_test(test_lists),
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_what_does_not_go_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
