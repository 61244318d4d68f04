/* Figures of `boresight score` against numbers by hand, brute force and the binomial law. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "sim/analysis/score/score.h"
#include "sim/analysis/score/score_figures.h"
#include "tests/test_support.h"

static bst_ctx ctx;

static void read_csv(const char *text, bst_score_points *out) {
    char copy[65536];
    snprintf(copy, sizeof copy, "%s", text);
    *out = (bst_score_points){0};
    bst_assert_ok(&ctx, bst_score_points_add_csv(&ctx, "test.csv", copy, out));
}

static bst_score_result score(const char *truth, const char *found, double radius_px) {
    bst_score_points t, f;
    bst_score_result result;
    const bst_score_options options = {radius_px, 100, 1};
    read_csv(truth, &t);
    read_csv(found, &f);
    bst_assert_ok(&ctx, bst_score_compute(&ctx, &t, &f, &options, &result));
    bst_score_points_free(&t);
    bst_score_points_free(&f);
    return result;
}

/* Three frames: a pair 0 px and one 5 px apart and a false point; a missed object; a false point.
 */
static void figures_are_those_by_hand(void **state) {
    (void)state;
    bst_score_result r = score("frame,x,y\n1,10,10\n1,20,10\n2,30,30\n3,,\n",
                               "x,y,frame\n10,10,1\n23,14,1\n50,50,1\n7,7,3\n", 5.0);
    const bst_score_value *v = r.figures;
    assert_int_equal(r.frames, 3);
    assert_int_equal(r.true_positives, 2);
    assert_int_equal(r.false_positives, 2);
    assert_int_equal(r.false_negatives, 1);
    assert_int_equal(r.identity_changes, -1);
    const double exact = 1e-12; /* rounding */
    bst_assert_close(v[BST_SCORE_PRECISION].value, 0.5, exact);
    bst_assert_close(v[BST_SCORE_RECALL].value, 2.0 / 3.0, exact);
    bst_assert_close(v[BST_SCORE_F1].value, 4.0 / 7.0, exact);
    bst_assert_close(v[BST_SCORE_RMS_PX].value, sqrt(12.5), exact);
    /* the pair at the cutoff costs 5^2; a missed or false point 5^2 / 2 */
    bst_assert_close(v[BST_SCORE_GOSPA_PX].value, (sqrt(37.5) + 2.0 * sqrt(12.5)) / 3.0, exact);
    bst_assert_close(v[BST_SCORE_SPOTGEO_1_F1].value, 3.0 / 7.0, exact);
    bst_assert_close(v[BST_SCORE_SPOTGEO_MSE].value, (25.0 + 300.0) / 5.0, exact);
    bst_assert_close(v[BST_SCORE_SPOTGEO_COMPETITION].value, (5.0 + 300.0) / 5.0, exact);
}

/* Distances below 3 px count as 0 in spotGEO's error; its total adds the errors of sequences. */
static void spotgeo_is_as_defined(void **state) {
    (void)state;
    bst_score_result r = score("sequence,frame,x,y\n1,1,0,0\n1,2,0,0\n2,1,0,0\n2,2,40,0\n",
                               "sequence,frame,x,y\n1,1,2.9,0\n1,2,4,0\n2,1,0,9.5\n", 5.0);
    assert_true(r.by_sequence);
    /* sequence 1: 0 and 4 over two points; sequence 2: 9.5 and a missed one over two */
    bst_assert_close(r.figures[BST_SCORE_SPOTGEO_COMPETITION].value, 4.0 / 2 + 109.5 / 2, 1e-12);
    bst_assert_close(r.figures[BST_SCORE_SPOTGEO_MSE].value, (16.0 + 90.25 + 100.0) / 4, 1e-12);
    bst_assert_close(r.figures[BST_SCORE_SPOTGEO_1_F1].value, 1.0 - 6.0 / 7.0, 1e-12);
}

/* Two pairs of 8 and 7 px rather than one of 0 px. */
static void most_pairs_come_first(void **state) {
    (void)state;
    bst_score_result r = score("frame,x,y\n1,0,0\n1,8,0\n", "frame,x,y\n1,8,0\n1,15,0\n", 10.0);
    assert_int_equal(r.true_positives, 2);
    bst_assert_close(r.figures[BST_SCORE_RMS_PX].value, sqrt((64.0 + 49.0) / 2.0), 1e-12);
}

enum { MOST = 5 };

/* Best assignment by trying all. */
typedef struct search {
    double d[MOST][MOST], radius, least, least2;
    int most;
} search;

static void try_all(search *s, int row, unsigned used, int pairs, double sum, double sum2) {
    if (row == MOST) {
        if (pairs > s->most || (pairs == s->most && sum < s->least)) {
            s->most = pairs;
            s->least = sum;
            s->least2 = sum2;
        }
        return;
    }
    try_all(s, row + 1, used, pairs, sum, sum2);
    for (int j = 0; j < MOST; j++) {
        double d = s->d[row][j];
        if (!(used & 1U << j) && d <= s->radius) {
            try_all(s, row + 1, used | 1U << j, pairs + 1, sum + d, sum2 + d * d);
        }
    }
}

static void assignment_is_the_best_of_all(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(7, 0, "test", "score");
    for (int trial = 0; trial < 40; trial++) {
        char truth[512] = "frame,x,y\n", found[512] = "frame,x,y\n";
        double p[2][MOST][2];
        search s = {.radius = 6.0};
        for (int i = 0; i < 2 * MOST; i++) {
            double *at = p[i / MOST][i % MOST];
            char *text = i < MOST ? truth : found;
            size_t length = strlen(text);
            for (int k = 0; k < 2; k++) {
                at[k] = 0.001 * floor(15000.0 *
                                      bst_rng_uniform(key, (uint64_t)trial, (uint64_t)(2 * i + k)));
            }
            snprintf(text + length, 512 - length, "1,%.3f,%.3f\n", at[0], at[1]);
        }
        for (int i = 0; i < MOST * MOST; i++) {
            const double *a = p[0][i / MOST], *b = p[1][i % MOST];
            s.d[i / MOST][i % MOST] = hypot(a[0] - b[0], a[1] - b[1]);
        }
        try_all(&s, 0, 0, 0, 0.0, 0.0);
        bst_score_result r = score(truth, found, s.radius);
        assert_int_equal(r.true_positives, s.most);
        /* 17 digits of text are not kept: rounding of 1e-3 px is exact to 1e-15 */
        bst_assert_close(r.figures[BST_SCORE_RMS_PX].value, sqrt(s.least2 / s.most), 1e-9);
    }
}

/* One object a frame, found in 160 of 200: the interval of the recall is the binomial law's. */
static void interval_is_the_binomial_one(void **state) {
    (void)state;
    static char truth[8192] = "frame,x,y\n", found[8192] = "frame,x,y\n";
    for (int i = 0; i < 200; i++) {
        snprintf(truth + strlen(truth), 64, "%d,5,5\n", i);
        snprintf(found + strlen(found), 64, i % 5 ? "%d,5,5\n" : "%d,,\n", i);
    }
    bst_score_points t, f;
    bst_score_result r;
    read_csv(truth, &t);
    read_csv(found, &f);
    const bst_score_options options = {5.0, 2000, 3};
    bst_assert_ok(&ctx, bst_score_compute(&ctx, &t, &f, &options, &r));
    bst_score_points_free(&t);
    bst_score_points_free(&f);
    double sigma = sqrt(0.8 * 0.2 / 200);
    /* the ends are quantiles of 2000 resamples: 0.06 sigma each, and steps of 1/200 */
    bst_assert_close(r.figures[BST_SCORE_RECALL].low, 0.8 - 1.96 * sigma, 0.25 * sigma + 0.0025);
    bst_assert_close(r.figures[BST_SCORE_RECALL].high, 0.8 + 1.96 * sigma, 0.25 * sigma + 0.0025);
    bst_assert_close(r.figures[BST_SCORE_PRECISION].low, 1.0, 0.0);
}

/* Found points on optional objects count neither way; others keep their pairs. */
static void optional_objects_need_not_be_found(void **state) {
    (void)state;
    bst_score_points t, f;
    bst_score_result r;
    read_csv("frame,x,y,id\n1,10,10,1\n1,13,10,2\n1,50,50,3\n2,10,10,1\n", &t);
    t.items[1].optional = t.items[2].optional = true;
    read_csv("frame,x,y,track\n1,10,10,7\n1,14,10,8\n1,90,90,9\n2,11,10,8\n", &f);
    const bst_score_options options = {5.0, 0, 1};
    bst_assert_ok(&ctx, bst_score_compute(&ctx, &t, &f, &options, &r));
    bst_score_points_free(&t);
    bst_score_points_free(&f);
    assert_int_equal(r.truths, 2);
    assert_int_equal(r.true_positives, 2);
    assert_int_equal(r.false_positives, 1);
    assert_int_equal(r.optional_truths, 2);
    assert_int_equal(r.optional_found, 1);
    assert_int_equal(r.identity_changes, 1);         /* object 1 has track 7, then 8 */
    assert_true(isnan(r.figures[BST_SCORE_F1].low)); /* no resamples */
}

static void points_come_from_json(void **state) {
    (void)state;
    bst_score_points p = {0};
    cJSON *root = cJSON_Parse(
        "[{\"sequence_id\": 2, \"frame\": 1, \"num_objects\": 1, "
        "\"object_coords\": [[502.4, 237.1]]}, {\"sequence_id\": 2, "
        "\"frame\": 2, \"num_objects\": 0, \"object_coords\": []}]");
    bst_assert_ok(&ctx, bst_score_points_add_json(&ctx, "a.json", root, 0, &p));
    cJSON_Delete(root);
    assert_int_equal(p.count, 1);
    assert_int_equal(p.frame_count, 2);
    bst_assert_close(p.items[0].x_px, 502.4, 0.0);
    bst_score_points_free(&p);
    root = cJSON_Parse(
        "{\"data\": {\"file\": {\"sequence\": 3, \"sequence_id\": 9}, \"sensor\": {\"width\": 512, "
        "\"height\": 256}, \"objects\": [{\"class_id\": 1, \"x_center\": 0.5, \"y_center\": 0.25, "
        "\"object_id\": \"44801\"}, {\"class_id\": 2, \"x_center\": 0.1, \"y_center\": 0.1}]}}");
    bst_assert_ok(&ctx, bst_score_points_add_json(&ctx, "b.json", root, 0, &p));
    cJSON_Delete(root);
    assert_int_equal(p.count, 1); /* the star does not count */
    assert_int_equal(p.items[0].key.sequence, 3);
    assert_int_equal(p.items[0].key.frame, 9);
    assert_int_equal(p.items[0].id, 44801);
    bst_assert_close(p.items[0].x_px, 255.5, 1e-12); /* the middle of the image */
    bst_assert_close(p.items[0].y_px, 63.5, 1e-12);
    bst_score_points_free(&p);
}

static void errors_say_where(void **state) {
    (void)state;
    const struct {
        const char *text, *message;
    } csv[] = {
        {"a,b\n", "x.csv:1: the first line must name the columns x, y and frame"},
        {"", "x.csv: is empty"},
        {"x,y,frame\n1,2,3\n1,z,3\n", "x.csv:3: a finite number is expected (found \"z\")"},
        {"x,y,frame\n1,2,1.5\n", "x.csv:2: an integer is expected (found \"1.5\")"},
        {"x,y,frame\n1,,1\n", "x.csv:2: x and y are expected, or neither"},
        {"x,y,frame\n1,2,\n", "x.csv:2: the frame is missing"},
        {"x,y,frame\n1,inf,1\n", "x.csv:2: a finite number is expected (found \"inf\")"},
    };
    const struct {
        const char *text, *message;
    } json[] = {
        {"{}", "x.json: /: is no list of points"},
        {"[3]", "x.json: /0: is no frame (allowed: an object with the integers sequence_id"},
        {"[{\"sequence_id\": 1, \"frame\": 1, \"object_coords\": [[1]]}]",
         "x.json: /0/object_coords/0: is no position"},
        {"{\"data\": {\"sensor\": {\"width\": 5}, \"objects\": []}}", "x.json: /data: is no frame"},
        {"{\"data\": {\"sensor\": {\"width\": 5, \"height\": 5}, \"objects\": [{\"class_id\": "
         "1}]}}",
         "x.json: /data/objects/0: has no position"},
    };
    for (size_t i = 0; i < sizeof csv / sizeof *csv; i++) {
        bst_score_points p = {0};
        char copy[256];
        snprintf(copy, sizeof copy, "%s", csv[i].text);
        assert_int_equal(bst_score_points_add_csv(&ctx, "x.csv", copy, &p), BST_ERR_FORMAT);
        assert_non_null(strstr(ctx.message, csv[i].message));
        bst_score_points_free(&p);
    }
    for (size_t i = 0; i < sizeof json / sizeof *json; i++) {
        bst_score_points p = {0};
        cJSON *root = cJSON_Parse(json[i].text);
        assert_non_null(root);
        assert_int_equal(bst_score_points_add_json(&ctx, "x.json", root, 0, &p), BST_ERR_FORMAT);
        assert_non_null(strstr(ctx.message, json[i].message));
        cJSON_Delete(root);
        bst_score_points_free(&p);
    }
}

static void byte_order_mark_is_no_name(void **state) {
    (void)state;
    bst_score_points p;
    read_csv("\xEF\xBB\xBFx,y,frame\n1,2,3\n", &p);
    assert_int_equal(p.count, 1);
    bst_score_points_free(&p);
}

/* The product of the points would need 2.5 GB. */
static void frame_with_too_many_points_is_refused(void **state) {
    (void)state;
    bst_score_points p = {0};
    bst_score_result result;
    const bst_score_options options = {5.0, 0, 1};
    for (int i = 0; i < 12500; i++) {
        const bst_score_point point = {.key = {0, 7}, .x_px = 50.0 * i, .id = -1};
        bst_assert_ok(&ctx, bst_score_points_add(&ctx, &p, &point));
    }
    assert_int_equal(bst_score_compute(&ctx, &p, &p, &options, &result), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "frame 7 has 12500 true and 12500 found points"));
    bst_score_points_free(&p);
}

static void write_csv(char path[BST_TEST_PATH], const char *name, const char *text) {
    bst_test_template(path, name);
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (int)strlen(text));
    close(fd);
}

/* What the command prints, of files: limits of SNR and score, of which one side is left out. */
static void limits_of_the_command(void **state) {
    (void)state;
    char truth[BST_TEST_PATH], found[BST_TEST_PATH], *text = NULL;
    size_t bytes = 0;
    write_csv(truth, "truth",
              "frame,x,y,snr\n1,10,10,5\n1,30,10,4.99\n1,50,20,\n2,10,11,9\n2,60,70,2\n");
    write_csv(found, "found",
              "frame,x,y,score\n1,10,12,3\n1,31,10,3\n1,50,23,2.5\n2,10,11,2.49\n2,80,8,\n");
    bst_score_request q = BST_SCORE_REQUEST_DEFAULTS;
    q.truth = truth;
    q.resamples = 0;
    q.least_snr = 5.0;
    q.least_score = 2.5;
    FILE *out = open_memstream(&text, &bytes);
    bst_assert_ok(&ctx, bst_score_run(&ctx, &q, found, out));
    fclose(out);
    /* in: true (10, 10), (50, 20) without SNR and (10, 11); found 2 px and 3 px off, and one on an
     * object that is too faint; false: the last, without a score */
    assert_non_null(strstr(text, "frames          2 in 1 sequence\n"));
    assert_non_null(strstr(text, "true points     3, found 2, missed 1\n"));
    assert_non_null(strstr(text, "found points    3, false 1\n"));
    assert_non_null(strstr(text, "left out        2 fainter than SNR 5, and 1 found there\n"));
    assert_non_null(strstr(text, "distance, RMS       2.5495   px\n")); /* sqrt(13 / 2) */
    free(text);
    q.least_snr = -(double)INFINITY;
    q.least_score = -(double)INFINITY;
    out = open_memstream(&text, &bytes);
    bst_assert_ok(&ctx, bst_score_run(&ctx, &q, found, out));
    fclose(out);
    assert_non_null(strstr(text, "true points     5, found 4, missed 1\n"));
    assert_null(strstr(text, "left out"));
    free(text);
    unlink(truth);
    unlink(found);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_are_those_by_hand),
        cmocka_unit_test(spotgeo_is_as_defined),
        cmocka_unit_test(most_pairs_come_first),
        cmocka_unit_test(assignment_is_the_best_of_all),
        cmocka_unit_test(interval_is_the_binomial_one),
        cmocka_unit_test(optional_objects_need_not_be_found),
        cmocka_unit_test(points_come_from_json),
        cmocka_unit_test(errors_say_where),
        cmocka_unit_test(byte_order_mark_is_no_name),
        cmocka_unit_test(frame_with_too_many_points_is_refused),
        cmocka_unit_test(limits_of_the_command),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
