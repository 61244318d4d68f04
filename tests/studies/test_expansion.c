/* From a study to its runs: settings, designs, dispersions, documents. */
#include <cjson/cJSON.h>

#include "sim/studies/sensitivity.h"
#include "tests/studies/study_fixture.h"

static char folder[BST_TEST_PATH];

static int set_up(void **state) {
    (void)state;
    fixture_folder(folder);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    fixture_remove(folder);
    return 0;
}

static void open_study(const char *body, bst_study *out) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, fixture_open(&ctx, folder, body, out));
}

static void values_of(const bst_study *s, int64_t run, bst_study_value *out) {
    bst_study_place place = bst_study_place_of(s, run);
    bst_study_values(s, &place, out);
}

/* Grids combine, the last axis fastest; replicates are neighbours. */
static void test_grid(void **state) {
    (void)state;
    bst_study s;
    bst_study_value v[8];
    open_study(
        "\"replicates\": 2, \"sweeps\": [{\"axes\": [{\"path\": \"/a\", "
        "\"values\": [1, 5]}, {\"path\": \"/b/c\", \"from\": 2, \"to\": "
        "200, \"count\": 3, \"spacing\": \"log\"}]}]",
        &s);
    assert_int_equal(s.settings, 6);
    assert_int_equal(s.runs, 12);
    assert_string_equal(s.axes[0].name, "a");
    assert_string_equal(s.axes[1].name, "c");
    const double a[] = {1, 1, 1, 5, 5, 5}, c[] = {2, 20, 200, 2, 20, 200};
    for (int64_t run = 0; run < s.runs; run++) {
        bst_study_place place = bst_study_place_of(&s, run);
        assert_int_equal(place.setting, run / 2);
        assert_int_equal(place.replicate, run % 2);
        assert_int_equal(place.run_number, run);
        values_of(&s, run, v);
        assert_true(v[0].number == a[run / 2]);
        /* exp and log of 100 to a few units of the last place; the ends are exact */
        bst_assert_close(v[1].number, c[run / 2], 1e-13 * c[run / 2]);
    }
    values_of(&s, 5, v);
    assert_true(v[1].number == 200.0);
    bst_study_close(&s);
}

/* Axes of a list go side by side, with values of any type. */
static void test_list(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study s;
    bst_study_value v[8];
    const char *body =
        "\"sweeps\": [{\"design\": \"list\", \"axes\": [{\"path\": \"/word\", \"values\": [\"p\", "
        "\"q\"]}, {\"path\": \"/a\", \"linked_paths\": [\"/b/list/1\"], \"values\": [7, 8]}]}]";
    open_study(body, &s);
    assert_int_equal(s.runs, 2);
    bst_study_place place = bst_study_place_of(&s, 1);
    bst_study_values(&s, &place, v);
    bst_json *json;
    cJSON *settings;
    bst_assert_ok(&ctx, bst_study_document(&ctx, &s, &place, v, &json, &settings));
    const cJSON *root = bst_json_root(json);
    assert_string_equal(cJSON_GetObjectItem(root, "word")->valuestring, "q");
    assert_int_equal(cJSON_GetObjectItem(root, "a")->valueint, 8);
    const cJSON *b = cJSON_GetObjectItem(root, "b");
    assert_int_equal(cJSON_GetArrayItem(cJSON_GetObjectItem(b, "list"), 1)->valueint, 8);
    /* untouched to the last bit */
    assert_true(cJSON_GetObjectItem(b, "c")->valuedouble == 0.1);
    assert_string_equal(cJSON_GetObjectItem(root, "seed")->valuestring, "0x1");
    assert_int_equal(cJSON_GetObjectItem(root, "run")->valueint, 1);
    assert_null(settings);
    bst_json_free(json);
    bst_study_close(&s);
}

/* Every slice of every axis has one point. */
static void test_latin_hypercube(void **state) {
    (void)state;
    bst_study s;
    bst_study_value v[8];
    open_study(
        "\"sweeps\": [{\"design\": \"latin_hypercube\", \"points\": "
        "40, \"axes\": [{\"path\": \"/a\", \"from\": -1, \"to\": 3}, "
        "{\"path\": \"/b/c\", \"from\": 10, \"to\": 0}]}]",
        &s);
    assert_int_equal(s.runs, 40);
    int seen[2][40] = {{0}}, ordered = 0;
    double before = -10.0;
    for (int64_t run = 0; run < 40; run++) {
        values_of(&s, run, v);
        double u[2] = {(v[0].number + 1.0) / 4.0, (10.0 - v[1].number) / 10.0};
        for (int a = 0; a < 2; a++) {
            assert_true(u[a] > 0.0 && u[a] < 1.0);
            seen[a][(int)(u[a] * 40.0)]++;
        }
        ordered += u[0] > before;
        before = u[0];
    }
    for (int i = 0; i < 40; i++) {
        assert_int_equal(seen[0][i], 1);
        assert_int_equal(seen[1][i], 1);
    }
    assert_in_range(ordered, 10, 30); /* a random order rises half the time, 20 +- 2 */
    bst_study_close(&s);
}

/* The scenario itself, then one axis at a time. */
static void test_one_at_a_time(void **state) {
    (void)state;
    bst_study s;
    bst_study_value v[8];
    open_study(
        "\"sweeps\": [{\"design\": \"one_at_a_time\", \"axes\": "
        "[{\"path\": \"/a\", \"values\": [1, 3]}, {\"path\": "
        "\"/b/c\", \"from\": 0, \"to\": 1, \"count\": 3}]}]",
        &s);
    assert_int_equal(s.runs, 6);
    const double a[] = {NAN, 1, 3, NAN, NAN, NAN}, c[] = {NAN, NAN, NAN, 0, 0.5, 1};
    for (int64_t run = 0; run < 6; run++) {
        values_of(&s, run, v);
        assert_int_equal(v[0].given, !isnan(a[run]));
        assert_int_equal(v[1].given, !isnan(c[run]));
        assert_true(!v[0].given || v[0].number == a[run]);
        assert_true(!v[1].given || v[1].number == c[run]);
    }
    bst_study_close(&s);
}

/* Along each path every axis moves once, by delta = 2/3 of its range at 4 levels, among the places
 * 0, 1/3, 2/3, 1, and both up and down happen. */
static void test_morris(void **state) {
    (void)state;
    bst_study s;
    bst_study_value v[8], before[8] = {{0}};
    open_study(
        "\"sweeps\": [{\"design\": \"morris\", \"trajectories\": 20, "
        "\"axes\": [{\"path\": \"/a\", \"from\": 0, \"to\": 1}, "
        "{\"path\": \"/b/c\", \"from\": 0, \"to\": 1}, {\"path\": "
        "\"/d\", \"from\": 0, \"to\": 1}]}]",
        &s);
    assert_int_equal(s.runs, 80);
    int up = 0, places[4] = {0};
    for (int64_t t = 0; t < 20; t++) {
        int moves[3] = {0};
        for (int64_t step = 0; step < 4; step++) {
            values_of(&s, 4 * t + step, v);
            for (int a = 0; a < 3; a++) {
                double place = 3.0 * v[a].number;
                /* thirds, to rounding */
                bst_assert_close(place, round(place), 1e-12);
                places[(int)round(place)]++;
                double by = step > 0 ? v[a].number - before[a].number : 0.0;
                if (by != 0.0) {
                    bst_assert_close(fabs(by), 2.0 / 3.0, 1e-12);
                    moves[a]++;
                    up += by > 0.0;
                }
            }
            memcpy(before, v, sizeof v);
        }
        for (int a = 0; a < 3; a++) {
            assert_int_equal(moves[a], 1);
        }
    }
    assert_in_range(up, 15, 45); /* 60 moves, half of them up, sigma 4 */
    for (int i = 0; i < 4; i++) {
        assert_in_range(places[i], 30, 90); /* of 240, a quarter each */
    }
    bst_study_close(&s);
}

/* Elementary effects of y = 3 u0 - u1 + 4 u1 u2 over unit ranges: axis 0 has 3 on every path; axes
 * 1 and 2 have 4 u - 1 and 4 u at the other's place u, whose spread shows. One at a time from 0: y
 * changes by 3, 1 and 0. */
static void test_sensitivity(void **state) {
    (void)state;
    static const bst_study_metric metrics[] = {{"y", "", "y", BST_METRIC_VALUE}};
    const bst_study_kind kind = {.name = "loop", .metrics = metrics, .metric_count = 1};
    const char *axes =
        "[{\"path\": \"/a\", \"from\": 0, \"to\": 1%s}, {\"path\": \"/b/c\", "
        "\"from\": 0, \"to\": 1%s}, {\"path\": \"/d\", \"from\": 0, \"to\": "
        "1%s}]";
    for (int morris = 0; morris < 2; morris++) {
        bst_ctx ctx = {0};
        bst_study s;
        bst_results r;
        char body[1024], list[512];
        const char *count = morris ? "" : ", \"count\": 3";
        snprintf(list, sizeof list, axes, count, count, count);
        snprintf(body, sizeof body,
                 "\"replicates\": 2, \"sweeps\": [{\"axes\": [{\"path\": \"/word\", "
                 "\"values\": [\"p\", \"q\"]}]}, {\"design\": \"%s\"%s, \"axes\": %s}]",
                 morris ? "morris" : "one_at_a_time", morris ? ", \"trajectories\": 30" : "", list);
        open_study(body, &s);
        bst_assert_ok(&ctx, bst_results_create(&ctx, &s, &kind, &r));
        for (int64_t run = 0; run < s.runs; run++) {
            bst_study_value v[8];
            values_of(&s, run, v);
            double u[3];
            for (int a = 0; a < 3; a++) {
                u[a] = v[a + 1].given ? v[a + 1].number : 0.0;
            }
            r.state[run] = run % 7 == 3 ? BST_ROW_MISSING : BST_ROW_DONE;
            r.metrics[run] = 3.0 * u[0] - u[1] + 4.0 * u[1] * u[2];
        }
        bst_sensitivity e[3];
        bst_sensitivity_of(&r, 2, 0, e);
        if (morris) {
            const bst_sensitivity *of[4] = {NULL};
            for (int i = 0; i < 3; i++) {
                of[e[i].axis] = &e[i];
                assert_int_equal(e[i].count, 60);
                assert_true(i == 0 || e[i].effect <= e[i - 1].effect);
            }
            /* exact but for rounding */
            bst_assert_close(of[1]->effect, 3.0, 1e-12);
            bst_assert_close(of[1]->mean_effect, 3.0, 1e-12);
            bst_assert_close(of[1]->spread, 0.0, 1e-6);
            /* u is 0, 1/3, 2/3, 1 alike: means 1 and 2, deviation 4 sqrt(5) / 6 = 1.49, of
             * which 1.4 is five standard errors of 30 paths */
            bst_assert_close(of[2]->mean_effect, 1.0, 1.4);
            bst_assert_close(of[3]->mean_effect, 2.0, 1.4);
            bst_assert_close(of[3]->spread, 1.49, 0.5);
            assert_true(of[3]->effect >= of[3]->mean_effect - 1e-12);
            /* axis 3 has no effect below 0: sizes spread as the effects do, over 60 of them */
            bst_assert_close(of[3]->error, of[3]->spread / sqrt(60.0), 1e-12);
            bst_assert_close(of[1]->error, 0.0, 1e-6);
        } else {
            assert_int_equal(e[0].axis, 1);
            assert_int_equal(e[1].axis, 2);
            assert_int_equal(e[2].axis, 3);
            assert_true(e[0].effect == 3.0 && e[1].effect == 1.0 && e[2].effect == 0.0);
            assert_true(e[1].mean_effect == -1.0 && e[0].count == 2);
        }
        bst_results_free(&r);
        bst_study_close(&s);
    }
}

/* Moments of what is drawn, limits, weights; what is drawn does not depend on its neighbours. */
static void test_dispersions(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study s, other;
    bst_study_value v[8], w[8];
    const char *normal =
        "{\"path\": \"/a\", \"distribution\": \"normal\", \"mean\": 5, \"sigma\": "
        "2, \"truncate_sigma\": 1.5}";
    const char *table =
        "{\"path\": \"/word\", \"distribution\": \"table\", \"values\": [\"u\", "
        "\"v\"], \"weights\": [0.2, 0.6]}";
    const char *even =
        "{\"path\": \"/b/c\", \"distribution\": \"log_uniform\", \"from\": 0.01, "
        "\"to\": 100}";
    const char *uniform =
        "{\"path\": \"/b/list/0\", \"distribution\": \"uniform\", \"from\": 3, \"to\": 9}";
    char body[1024];
    snprintf(body, sizeof body, "\"replicates\": 4000, \"dispersions\": [%s, %s, %s, %s]", normal,
             table, even, uniform);
    open_study(body, &s);
    snprintf(body, sizeof body, "\"replicates\": 4000, \"dispersions\": [%s, %s]", even, normal);
    bst_assert_ok(&ctx, fixture_open(&ctx, folder, body, &other));
    double sum = 0.0, logs = 0.0, plain = 0.0, square = 0.0, logs2 = 0.0, plain2 = 0.0;
    int second = 0;
    for (int64_t run = 0; run < 4000; run++) {
        values_of(&s, run, v);
        values_of(&other, run, w);
        assert_true(v[0].number == w[1].number && v[2].number == w[0].number);
        assert_true(v[0].number >= 2.0 && v[0].number <= 8.0);
        assert_true(v[2].number >= 0.01 && v[2].number <= 100.0);
        sum += v[0].number;
        logs += log10(v[2].number);
        plain += v[3].number;
        square += pow(v[0].number - 5.0, 2.0);
        logs2 += pow(log10(v[2].number), 2.0);
        plain2 += pow(v[3].number - 6.0, 2.0);
        second += strcmp(v[1].json->valuestring, "v") == 0;
    }
    bst_assert_close(sum / 4000.0, 5.0, 0.15);   /* sigma 1.54 / 63: 6 of them */
    bst_assert_close(logs / 4000.0, 0.0, 0.11);  /* sigma 1.155 / 63: 6 of them */
    bst_assert_close(plain / 4000.0, 6.0, 0.17); /* sigma 1.73 / 63: 6 of them */
    /* variances: of a normal law cut at c = 1.5 sigma, sigma^2 (1 - 2 c phi(c) / (2 Phi(c) - 1));
     * of even ones, width^2 / 12; 10 %: 6 sigma or more */
    bst_assert_close(square / 4000.0, 4.0 * 0.5515, 0.22);
    bst_assert_close(logs2 / 4000.0, 16.0 / 12.0, 0.13);
    bst_assert_close(plain2 / 4000.0, 36.0 / 12.0, 0.3);
    bst_assert_close(second / 4000.0, 0.75, 0.041); /* 6 sigma of a rate */
    bst_study_close(&s);
    bst_study_close(&other);
}

/* Offsets and factors act on the scenario's number, after the sweeps. */
static void test_apply(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study s;
    bst_study_value v[8];
    open_study(
        "\"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"values\": [10]}]}], "
        "\"dispersions\": [{\"path\": \"/a\", \"from\": 2, \"to\": 3, "
        "\"apply\": \"multiply\", \"integer\": true}, {\"path\": \"/b/c\", "
        "\"from\": 1, \"to\": 2, \"apply\": \"add\"}]",
        &s);
    assert_string_equal(s.axes[1].name, "a_factor");
    assert_string_equal(s.axes[2].name, "c_offset");
    bst_study_place place = bst_study_place_of(&s, 0);
    bst_study_values(&s, &place, v);
    bst_json *json;
    cJSON *settings;
    bst_assert_ok(&ctx, bst_study_document(&ctx, &s, &place, v, &json, &settings));
    const cJSON *root = bst_json_root(json);
    assert_true(cJSON_GetObjectItem(root, "a")->valuedouble == round(10.0 * v[1].number));
    assert_true(cJSON_GetObjectItem(cJSON_GetObjectItem(root, "b"), "c")->valuedouble ==
                0.1 + v[2].number);
    bst_json_free(json);
    bst_study_close(&s);
}

/* Common random numbers: a replicate has the same draws in every setting. */
static void test_common(void **state) {
    (void)state;
    bst_study s;
    bst_study_value v[8], w[8];
    const char *body =
        "\"random\": \"%s\", \"replicates\": 3, \"sweeps\": [{\"axes\": [{\"path\": "
        "\"/a\", \"values\": [1, 2]}]}], \"dispersions\": [{\"path\": \"/b/c\", "
        "\"from\": 0, \"to\": 1}]";
    char text[512];
    for (int common = 0; common < 2; common++) {
        snprintf(text, sizeof text, body, common ? "common" : "each");
        open_study(text, &s);
        values_of(&s, 1, v);
        values_of(&s, 4, w);
        assert_int_equal(v[1].number == w[1].number, common);
        assert_int_equal(bst_study_place_of(&s, 4).run_number, common ? 1 : 4);
        bst_study_close(&s);
    }
}

/* The digest follows what results follow from, and the resolved study is the study. */
static void test_digest(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study s, again;
    char path[512], digest[20];
    const char *axis = "\"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"values\": [0.1, 2e-17]}]}]";
    open_study(axis, &s);
    strcpy(digest, s.digest);
    cJSON *echo = bst_study_echo(&s);
    char *text = cJSON_Print(echo);
    fixture_write(folder, "resolved.json", text);
    snprintf(path, sizeof path, "%s/resolved.json", folder);
    bst_assert_ok(&ctx, bst_study_open(&ctx, path, NULL, &again));
    assert_string_equal(again.digest, digest);
    free(text);
    cJSON_Delete(echo);
    bst_study_close(&again);
    bst_study_close(&s);
    open_study("\"replicates\": 2", &s);
    assert_string_not_equal(s.digest, digest);
    bst_study_close(&s);
    fixture_write(folder, "scenario.json", "{\"name\": \"base\", \"a\": 3}");
    open_study(axis, &s);
    assert_string_not_equal(s.digest, digest);
    bst_study_close(&s);
}

#define AXIS "{\"path\": \"/a\", \"from\": 0, \"to\": 1}"
#define AXES_4 AXIS ", " AXIS ", " AXIS ", " AXIS
#define AXES_8 AXES_4 ", " AXES_4

/* What is wrong is refused with its place and what is allowed. */
static void test_errors(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"\"sweep\": []", "/sweep: unknown key; did you mean \"sweeps\""},
        {"\"kind\": \"lop\"", "/kind: unknown choice (found \"lop\"; allowed: \"loop\""},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"a\", \"values\": [1]}]}]",
         "/sweeps/0/axes/0/path: no JSON pointer (found \"a\""},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"/seed\", \"values\": [\"0x1\"]}]}]",
         "/sweeps/0/axes/0/path: set by the study itself"},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"/a\"}]}]", "/sweeps/0/axes/0: give either"},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"from\": 1, \"to\": 2}]}]",
         "/sweeps/0/axes/0/count: a range needs at least 2"},
        {"\"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"from\": -1, \"to\": 2, \"count\": 3, "
         "\"spacing\": \"log\"}]}]",
         "/sweeps/0/axes/0: from -1 to 2 has no logarithm"},
        {"\"sweeps\": [{\"design\": \"list\", \"axes\": [{\"path\": \"/a\", \"values\": [1]}, "
         "{\"path\": \"/word\", \"values\": [1, 2]}]}]",
         "/sweeps/0/axes/1: the axes of a list go side by side: 2 values here, 1 on the first"},
        {"\"sweeps\": [{\"design\": \"latin_hypercube\", \"axes\": [{\"path\": \"/a\", \"from\": "
         "1, \"to\": 2}]}]",
         "/sweeps/0/points: a latin_hypercube needs at least 2"},
        {"\"sweeps\": [{\"design\": \"latin_hypercube\", \"points\": 1000000, \"axes\": [" AXES_8
         ", " AXES_8 ", " AXIS "]}]",
         "/sweeps/0/points: the design has 1000000 points of 17 axes, 17000000 values (allowed: "
         "16777216 values in all designs"},
        {"\"sweeps\": [{\"design\": \"morris\", \"trajectories\": 100000, \"axes\": [" AXES_8
         ", " AXES_8 "]}]",
         "/sweeps/0/trajectories: the design has 1700000 points of 16 axes, 27200000 values"},
        {"\"sweeps\": [{\"design\": \"morris\", \"levels\": 3, \"axes\": [{\"path\": \"/a\", "
         "\"from\": 1, \"to\": 2}]}]",
         "/sweeps/0/levels: not even (found 3)"},
        {"\"dispersions\": [{\"path\": \"/a\", \"distribution\": \"normal\"}]",
         "/dispersions/0/sigma: a normal distribution needs one above 0"},
        {"\"dispersions\": [{\"path\": \"/a\", \"from\": 2, \"to\": 1}]",
         "/dispersions/0: from 2 to 1 is no range"},
        {"\"dispersions\": [{\"path\": \"/a\", \"distribution\": \"table\"}]",
         "/dispersions/0/values: missing"},
        {"\"dispersions\": [{\"path\": \"/a\", \"distribution\": \"table\", \"values\": [1, 2], "
         "\"weights\": [1]}]",
         "/dispersions/0/weights: no weights (found [1]"},
        {"\"dispersions\": [{\"path\": \"/a\", \"distribution\": \"table\", \"values\": [1, 2], "
         "\"weights\": [0, 0]}]",
         "/dispersions/0/weights: no weights (found [0,0]"},
        {"\"dispersions\": [{\"path\": \"/a\", \"distribution\": \"table\", \"values\": [1, 2], "
         "\"weights\": [2, -1]}]",
         "/dispersions/0/weights: no weights (found [2,-1]"},
        {"\"dispersions\": [{\"path\": \"/a\", \"from\": 1, \"to\": 2}, {\"path\": \"/a\", "
         "\"from\": 1, \"to\": 2}]",
         "/dispersions/1/path: \"/a\" is dispersed by /dispersions/0 already"},
        {"\"set\": {\"a\": 1}", "/set: \"a\" is no JSON pointer"},
        {"\"replicates\": 10000000, \"sweeps\": [{\"axes\": [{\"path\": \"/a\", \"from\": 1, "
         "\"to\": 2, \"count\": 1000}]}]",
         "more than 1000000000 runs"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_study s;
        assert_int_equal(fixture_open(&ctx, folder, cases[i][0], &s), BST_ERR_CONFIG);
        if (!strstr(ctx.message, cases[i][1]) || !strstr(ctx.message, "/study.json: ")) {
            fail_msg("\"%s\" does not say \"%s\"", ctx.message, cases[i][1]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_grid, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_list, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_latin_hypercube, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_one_at_a_time, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_morris, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_sensitivity, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_dispersions, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_apply, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_common, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_digest, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_errors, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
