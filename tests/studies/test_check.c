/* Messages about a study before its first run: which settings are tried, and to which a fault is
 * put down to. The kind's check keeps a list of what it is asked about. */
#include "tests/studies/fake_kind.h"

typedef struct asked {
    double a, c;
    bool deep;
    int64_t run;
} asked;

static asked seen[3000];
static int seen_count;
/* beyond which values of /a and /b/c a run is refused; a run that is refused by its number */
static double most_a, most_c;
static int64_t refused_run;

static bst_status note(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep) {
    (void)user;
    const cJSON *root = bst_json_root(run->scenario);
    double a = cJSON_GetObjectItem(root, "a")->valuedouble;
    double c = cJSON_GetObjectItem(cJSON_GetObjectItem(root, "b"), "c")->valuedouble;
    assert_true(seen_count < 3000);
    seen[seen_count++] = (asked){a, c, deep, run->place.run};
    if (a > most_a || c > most_c || (!deep && run->place.run == refused_run)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "not with %g and %g", a, c);
    }
    return BST_OK;
}

static bst_status check(bst_ctx *ctx, const char *body) {
    char folder[BST_TEST_PATH];
    bst_study study;
    bst_study_kind kind = fake_kind;
    kind.check = note;
    seen_count = 0;
    *ctx = (bst_ctx){0};
    fixture_folder(folder);
    bst_assert_ok(ctx, fixture_open(ctx, folder, body, &study));
    bst_status status = bst_study_check(ctx, &study, &kind);
    bst_study_close(&study);
    fixture_remove(folder);
    return status;
}

static void allow_all(void) {
    most_a = most_c = 1e9;
    refused_run = -1;
}

/* How often values were tried in other checks than the deep one. */
static int tried(double a, double c) {
    int n = 0;
    for (int i = 0; i < seen_count; i++) {
        n += !seen[i].deep && fabs(seen[i].a - a) < 1e-12 && fabs(seen[i].c - c) < 1e-12;
    }
    return n;
}

static void expect_words(const bst_ctx *ctx, const char *words) {
    if (!strstr(ctx->message, words)) {
        fail_msg("\"%s\" does not say \"%s\"", ctx->message, words);
    }
}

static void metrics_have_names(void **state) {
    (void)state;
    bst_ctx ctx;
    allow_all();
    bst_assert_ok(&ctx, check(&ctx, "\"metrics\": [\"gaps\", \"flag\"]"));
    assert_int_equal(bst_kind_metric(&fake_kind, "third"), 0);
    assert_int_equal(bst_kind_metric(&fake_kind, "gaps"), 2);
    assert_int_equal(bst_kind_metric(&fake_kind, "Third"), -1);
    assert_int_equal(check(&ctx, "\"metrics\": [\"gaps\", \"thrid\"]"), BST_ERR_CONFIG);
    expect_words(&ctx, "/metrics/1: kind loop has no metric \"thrid\"; did you mean \"third\"?");
    assert_int_equal(check(&ctx, "\"metrics\": [\"pointing_rms_of_another_kind\"]"),
                     BST_ERR_CONFIG);
    expect_words(&ctx,
                 "/metrics/0: kind loop has no metric \"pointing_rms_of_another_kind\" "
                 "(allowed: third, flag, gaps)");
    assert_int_equal(seen_count, 0); /* nothing is tried before */
}

/* A grid: each value of each axis by itself, with the others as in the first setting; then the
 * runs. */
static void axes_of_a_grid(void **state) {
    (void)state;
    static const char grid[] =
        "\"replicates\": 2, \"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"values\": [1, 2, 3]}, "
        "{\"path\": \"/b/c\", \"from\": 0.5, \"to\": 0.9, \"count\": 3}]}]";
    bst_ctx ctx;
    allow_all();
    bst_assert_ok(&ctx, check(&ctx, grid));
    /* one deep check, three values, two ends, 18 runs */
    assert_int_equal(seen_count, 1 + 3 + 2 + 18);
    assert_true(seen[0].deep && seen[0].a == 1 && seen[0].c == 0.5);
    for (int i = 1; i < seen_count; i++) {
        assert_false(seen[i].deep);
    }
    for (int a = 1; a <= 3; a++) {
        for (int k = 0; k < 3; k++) {
            double c = 0.5 + 0.2 * k;
            int alone = (k == 0) + (a == 1 && k != 1);
            assert_int_equal(tried(a, c), 2 + alone);
        }
    }
    most_a = 2.5;
    assert_int_equal(check(&ctx, grid), BST_ERR_CONFIG);
    expect_words(&ctx, "/sweeps/0/axes/0: value 3 of a: not with 3 and 0.5");
    allow_all();
    most_c = 0.8;
    assert_int_equal(check(&ctx, grid), BST_ERR_CONFIG);
    expect_words(&ctx, "/sweeps/0/axes/1: value 0.9 of c: not with 1 and 0.9");
    /* a fault of the first setting is put down to the axis that brings it */
    most_c = 0.4;
    assert_int_equal(check(&ctx, grid), BST_ERR_CONFIG);
    expect_words(&ctx, "/sweeps/0/axes/1: value 0.5 of c: not with 1 and 0.5");
    /* or to the first setting, where the scenario is wrong without it: /a is 2 */
    allow_all();
    most_a = 0.5;
    assert_int_equal(check(&ctx, grid), BST_ERR_CONFIG);
    expect_words(&ctx, "the first setting: not with 1 and 0.5");
    /* a run that is wrong though each of its values is right */
    allow_all();
    refused_run = 7;
    assert_int_equal(check(&ctx, grid), BST_ERR_CONFIG);
    expect_words(&ctx, "run 7: not with ");
}

/* Lists go side by side: a value is never tried without its neighbours. */
static void levels_of_a_list(void **state) {
    (void)state;
    static const char list[] =
        "\"sweeps\": [{\"design\": \"list\", \"axes\": [{\"path\": \"/a\", "
        "\"values\": [1, 2, 3]}, {\"path\": \"/b/c\", \"values\": [10, 20, "
        "30]}]}]";
    bst_ctx ctx;
    allow_all();
    bst_assert_ok(&ctx, check(&ctx, list));
    assert_int_equal(seen_count, 1 + 3 + 3);
    for (int k = 1; k <= 3; k++) {
        assert_int_equal(tried(k, 10 * k), 2);
    }
    most_c = 25;
    assert_int_equal(check(&ctx, list), BST_ERR_CONFIG);
    expect_words(&ctx, "/sweeps/0/axes/0: value 3 of a: not with 3 and 30");
}

/* The ends of what is drawn: of a normal distribution where it is cut off. */
static void ends_of_dispersions(void **state) {
    (void)state;
    static const char drawn[] =
        "\"replicates\": 3, \"dispersions\": [{\"path\": \"/a\", \"from\": -1, \"to\": 4}, "
        "{\"path\": "
        "\"/b/c\", \"distribution\": \"normal\", \"mean\": 5, \"sigma\": 0.5, "
        "\"truncate_sigma\": 3}]";
    bst_ctx ctx;
    allow_all();
    bst_assert_ok(&ctx, check(&ctx, drawn));
    /* deep, two ends of each, three runs */
    assert_int_equal(seen_count, 1 + 4 + 3);
    /* those that are not tried stay as the scenario has them: 2 and 0.1 */
    assert_int_equal(tried(-1, 0.1), 1);
    assert_int_equal(tried(4, 0.1), 1);
    assert_int_equal(tried(2, 3.5), 1);
    assert_int_equal(tried(2, 6.5), 1);
    most_c = 6.4;
    assert_int_equal(check(&ctx, drawn), BST_ERR_CONFIG);
    expect_words(&ctx, "/dispersions/1: value 6.5 of c: not with 2 and 6.5");
    /* whole numbers between; a table is tried value by value */
    allow_all();
    bst_assert_ok(&ctx, check(&ctx,
                              "\"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"from\": 1.4, \"to\": "
                              "6.6, \"count\": 4, \"integer\": true}]}], \"dispersions\": "
                              "[{\"path\": \"/b/c\", \"distribution\": \"table\", \"values\": "
                              "[70, 80]}]"));
    assert_int_equal(seen_count, 1 + 2 + 2 + 4);
    assert_int_equal(tried(7, 0.1), 1);
    assert_int_equal(tried(1, 0.1), 1);
    assert_int_equal(tried(1, 70) + tried(1, 80), 3); /* each by itself, and the run of that */
}

/* Many runs: a thousand of them, evenly spread. */
static void a_thousand_of_many_runs(void **state) {
    (void)state;
    bst_ctx ctx;
    allow_all();
    bst_assert_ok(&ctx, check(&ctx,
                              "\"replicates\": 4000, \"dispersions\": [{\"path\": \"/a\", "
                              "\"from\": 0, \"to\": 1}]"));
    assert_int_equal(seen_count, 1 + 2 + 1000);
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(seen[3 + i].run, 4 * i);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(metrics_have_names),      cmocka_unit_test(axes_of_a_grid),
        cmocka_unit_test(levels_of_a_list),        cmocka_unit_test(ends_of_dispersions),
        cmocka_unit_test(a_thousand_of_many_runs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
