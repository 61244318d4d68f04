/* How many pictures of a live run are taken: as many as were asked for at frames of any rate, few
 * while the processors are busy, more while they are idle. */
#include "tests/test_support.h"
#include "view/live_pace.h"

/* Pictures of 20 s of frames, a second. */
static double count(bst_view_pace pace, double frames_hz) {
    int taken = 0;
    for (int k = 0; k < (int)(20.0 * frames_hz); k++) {
        taken += bst_view_pace_take(&pace, 1000.0 + k / frames_hz);
    }
    return taken / 20.0;
}

static void pictures_are_as_many_as_asked_for(void **state) {
    (void)state;
    const bst_view_pace least = {.pictures_hz = 0.0}, most = {.pictures_hz = 50.0};
    /* frames come at their own times: on average nothing is lost to that; 0.15: the first ones */
    bst_assert_close(count(least, 51.0), BST_VIEW_PICTURES_LEAST, 0.15);
    bst_assert_close(count(least, 23.0), BST_VIEW_PICTURES_LEAST, 0.15);
    bst_assert_close(count(least, 19.0), BST_VIEW_PICTURES_LEAST, 0.15);
    bst_assert_close(count(least, 400.0), BST_VIEW_PICTURES_LEAST, 0.15);
    bst_assert_close(count(most, 400.0), 50.0, 0.15);
    /* all of a slower run */
    bst_assert_close(count(least, 15.0), 15.0, 0.0);
    bst_assert_close(count(least, 1.0), 1.0, 0.0);
}

static void a_gap_is_not_made_up_for(void **state) {
    (void)state;
    bst_view_pace pace = {.pictures_hz = 0.0};
    int taken = 0;
    assert_true(bst_view_pace_take(&pace, 10.0));
    for (int k = 0; k < 100; k++) { /* a second after ten */
        taken += bst_view_pace_take(&pace, 20.0 + 0.01 * k);
    }
    assert_in_range(taken, 15, 18);
}

static bst_view_processor_time processors;
static bool known;

static bool read(bst_view_processor_time *out) {
    *out = processors;
    return known;
}

/* Seconds of a machine of two processors with a share of idle time. */
static void pass(bst_view_pace *pace, double *now, double idle_share, int seconds) {
    for (int k = 0; k < seconds; k++) {
        *now += 1.0;
        processors.all += 2.0;
        processors.idle += 2.0 * idle_share;
        bst_view_pace_adapt(pace, *now, read);
        bst_view_pace_adapt(pace, *now + 0.5, read); /* too early */
    }
}

static void busy_processors_have_few_pictures(void **state) {
    (void)state;
    bst_view_pace pace = {.pictures_hz = 0.0};
    double now = 100.0;
    processors = (bst_view_processor_time){1e6, 2e6};
    known = true;
    pass(&pace, &now, 0.2, 5);
    bst_assert_close(pace.pictures_hz, BST_VIEW_PICTURES_LEAST, 0.0);
    pass(&pace, &now, 0.5, 2);
    bst_assert_close(pace.pictures_hz, BST_VIEW_PICTURES_LEAST * 1.25 * 1.25, 1e-9);
    pass(&pace, &now, 0.3, 5); /* neither idle nor busy */
    bst_assert_close(pace.pictures_hz, BST_VIEW_PICTURES_LEAST * 1.25 * 1.25, 1e-9);
    pass(&pace, &now, 0.9, 20);
    bst_assert_close(pace.pictures_hz, BST_VIEW_PICTURES_MOST, 0.0);
    pass(&pace, &now, 0.0, 1);
    bst_assert_close(pace.pictures_hz, 35.0, 1e-9);
    known = false;
    pass(&pace, &now, 0.0, 5);
    bst_assert_close(pace.pictures_hz, 35.0, 1e-9);
    known = true;
    pass(&pace, &now, 0.0, 9);
    bst_assert_close(pace.pictures_hz, BST_VIEW_PICTURES_LEAST, 0.0);
}

static void this_machine_is_read(void **state) {
    (void)state;
    bst_view_processor_time now;
    if (bst_view_read_processors(&now)) { /* there is a /proc */
        assert_true(now.all > 0.0 && now.idle >= 0.0 && now.idle <= now.all);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_are_as_many_as_asked_for),
        cmocka_unit_test(a_gap_is_not_made_up_for),
        cmocka_unit_test(busy_processors_have_few_pictures),
        cmocka_unit_test(this_machine_is_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
