/* Commanded directions by time, against the motion that they were taken from. */
#include "control/modes/aim_history.h"

#include <math.h>

#include "tests/test_support.h"

#define HZ 1000.0

/* A pass: a great circle at a rate that changes. */
static bst_vec3 way(double t, bst_vec3 *rate) {
    double angle = 1e-3 * t + 0.05 * sin(0.02 * t), speed = 1e-3 + 1e-3 * cos(0.02 * t);
    *rate = (bst_vec3){-speed * sin(angle), speed * cos(angle), 0.0};
    return (bst_vec3){cos(angle), sin(angle), 0.0};
}

static double error_at(const bst_aim_history *history, double t) {
    bst_vec3 found, rate;
    assert_true(bst_aim_history_at(history, (int64_t)llround(t * HZ), &found));
    return bst_vec3_angle(found, way(t, &rate));
}

/* A command every `step` seconds until `until`. */
static void fill(bst_aim_history *history, double step, double until) {
    for (int n = 0; n * step <= until; n++) {
        bst_vec3 rate, d = way(n * step, &rate);
        bst_aim_history_add(history, (int64_t)llround(n * step * HZ), d, rate, n == 0);
    }
}

static void test_reach(void **state) {
    (void)state;
    static bst_aim_history history;
    /* 20 commands a second and frames that come 60 s late */
    bst_aim_history_init(&history, HZ, 60.0);
    fill(&history, 0.05, 200.0);
    /* a cubic over 0.3 s: its fourth derivative is 1e-8 rad/s^4, 1e-8 * 0.3^4 / 384 */
    for (double t = 140.0; t <= 200.0; t += 0.37) {
        assert_true(error_at(&history, t) < 1e-10);
    }
    /* between control's steps and beyond the last command the rate carries on */
    assert_true(error_at(&history, 200.02) < 1e-7);
    bst_vec3 found;
    assert_false(bst_aim_history_at(&history, 0, &found)); /* forgotten */
    /* dense commands leave every sample */
    bst_aim_history_init(&history, HZ, 2.0);
    fill(&history, 0.05, 20.0);
    assert_true(error_at(&history, 10.0) < 1e-12);
}

static void test_jump(void **state) {
    (void)state;
    static bst_aim_history history;
    bst_aim_history_init(&history, HZ, 100.0);
    fill(&history, 0.05, 50.02);
    bst_vec3 rate, before = way(50.0, &rate), elsewhere = {0.0, 0.0, 1.0}, none = {0.0, 0.0, 0.0};
    bst_aim_history_add(&history, 50050, elsewhere, none, true);
    for (int n = 1; n < 400; n++) {
        bst_aim_history_add(&history, 50050 + 50 * n, elsewhere, none, false);
    }
    bst_vec3 found;
    assert_true(bst_aim_history_at(&history, 50000, &found));
    assert_true(bst_vec3_angle(found, before) < 1e-10);
    assert_true(bst_aim_history_at(&history, 50040, &found)); /* no way between the two */
    assert_true(bst_vec3_angle(found, before) < 1e-4);
    assert_true(bst_aim_history_at(&history, 50060, &found));
    assert_true(bst_vec3_angle(found, elsewhere) < 1e-12);
    /* said anew for the same time */
    bst_aim_history_add(&history, 50050 + 50 * 399, before, none, true);
    assert_true(bst_aim_history_at(&history, 50050 + 50 * 399, &found));
    assert_true(bst_vec3_angle(found, before) < 1e-12);
    assert_true(bst_aim_history_predict(&history, 80000, &found));
    assert_true(bst_vec3_angle(found, before) < 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reach),
        cmocka_unit_test(test_jump),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
