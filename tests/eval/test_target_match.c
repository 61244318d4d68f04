/* Which detection counts for which target. */
#include "sim/eval/target_match.h"

#include "tests/test_support.h"

enum { MOST = 8 };

static int of_target[MOST], of_detection[MOST];

static int match(const bst_eval_match_target *targets, int count, double reach, int n,
                 const double (*places)[2]) {
    bst_detections *d = calloc(1, sizeof *d + MOST * sizeof d->items[0]);
    assert_non_null(d);
    d->count = n;
    for (int i = 0; i < n; i++) {
        d->items[i].x_px = places[i][0];
        d->items[i].y_px = places[i][1];
    }
    int matched = bst_eval_match_targets(targets, count, reach, d, of_target, of_detection);
    free(d);
    return matched;
}

static void a_point_is_matched_within_one_width(void **state) {
    (void)state;
    const bst_eval_match_target t[] = {{100, 50, 0, 0}};
    const double inside[][2] = {{101.4, 51.4}}, outside[][2] = {{101.5, 51.5}};
    assert_int_equal(match(t, 1, 2.0, 1, inside), 1);
    assert_int_equal(of_target[0], 0);
    assert_int_equal(of_detection[0], 0);
    assert_int_equal(match(t, 1, 2.0, 1, outside), 0);
    assert_int_equal(of_target[0], -1);
    assert_int_equal(of_detection[0], -1);
    assert_int_equal(match(t, 1, 2.0, 0, NULL), 0);
    assert_int_equal(of_target[0], -1);
}

static void a_streak_is_matched_within_its_half_length(void **state) {
    (void)state;
    /* 30 px along (0.6, 0.8) */
    const bst_eval_match_target t[] = {{100, 100, 18, 24}};
    const double along[][2] = {{100 + 0.6 * 14.9, 100 + 0.8 * 14.9}},
                 beyond[][2] = {{100 + 0.6 * 15.1, 100 + 0.8 * 15.1}},
                 across[][2] = {{100 + 0.8 * 1.9, 100 - 0.6 * 1.9}},
                 off[][2] = {{100 + 0.8 * 2.1, 100 - 0.6 * 2.1}};
    assert_int_equal(match(t, 1, 2.0, 1, along), 1);
    assert_int_equal(match(t, 1, 2.0, 1, beyond), 0);
    assert_int_equal(match(t, 1, 2.0, 1, across), 1);
    assert_int_equal(match(t, 1, 2.0, 1, off), 0);
    /* shorter than the PSF: as a point */
    const bst_eval_match_target brief[] = {{100, 100, 1, 0}};
    const double near[][2] = {{101.5, 101}};
    assert_int_equal(match(brief, 1, 2.0, 1, near), 1);
}

static void one_detection_counts_once(void **state) {
    (void)state;
    const bst_eval_match_target t[] = {{10, 10, 0, 0}, {13, 10, 0, 0}};
    const double between[][2] = {{11.4, 10}};
    assert_int_equal(match(t, 2, 2.0, 1, between), 1);
    assert_int_equal(of_target[0], 0);
    assert_int_equal(of_target[1], -1);
    /* 2 from the first target and 1 from the second: the nearer one has it */
    const double nearer[][2] = {{12.0, 10}};
    assert_int_equal(match(t, 2, 2.0, 1, nearer), 1);
    assert_int_equal(of_detection[0], 1);
    assert_int_equal(of_target[0], -1);
    assert_int_equal(of_target[1], 0);
    /* the nearest of several, whatever their order; the other is the target's too */
    const double several[][2] = {{11.5, 10}, {10.2, 10}, {9, 10}, {13.1, 10}, {40, 40}};
    assert_int_equal(match(t, 2, 2.0, 5, several), 2);
    assert_int_equal(of_target[0], 1);
    assert_int_equal(of_target[1], 3);
    assert_int_equal(of_detection[2], 0);
    assert_int_equal(of_detection[4], -1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_matched_within_one_width),
        cmocka_unit_test(a_streak_is_matched_within_its_half_length),
        cmocka_unit_test(one_detection_counts_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
