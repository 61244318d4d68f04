/* The predicates that assertions use tell a valid value from each kind of invalid one. */
#include <stdlib.h>

#include "sim/core/invariant.h"
#include "sim/messages/message_invariants.h"
#include "tests/test_support.h"

#ifdef NDEBUG
#error "assertions are on in every build: take -DNDEBUG from the compiler's flags"
#endif

static void unit_vectors_and_quaternions(void **state) {
    (void)state;
    bst_vec3 v = {0.6, 0.0, 0.8};
    assert_true(bst_is_unit_vec3(v, BST_UNIT_TOLERANCE));
    /* 1e-9 of the norm is 2e-9 of its square */
    assert_true(bst_is_unit_vec3(bst_vec3_scale(v, 1.0 + 0.9e-9), BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_vec3(bst_vec3_scale(v, 1.0 + 1.1e-9), BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_vec3(bst_vec3_scale(v, 1.0 - 1.1e-9), BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_vec3((bst_vec3){NAN, 0.0, 0.0}, BST_UNIT_TOLERANCE));
    assert_true(bst_is_unit_quat((bst_quat){0.5, -0.5, 0.5, -0.5}, BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_quat((bst_quat){0.5, 0.5, 0.5, 0.6}, BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_quat((bst_quat){0.0, 0.0, 0.0, INFINITY}, BST_UNIT_TOLERANCE));
    assert_true(bst_is_finite_vec3(v));
    assert_false(bst_is_finite_vec3((bst_vec3){0.0, -INFINITY, 0.0}));
}

static void numbers(void **state) {
    (void)state;
    assert_true(bst_is_variance(0.0) && !bst_is_variance(-1e-300) && !bst_is_variance(INFINITY));
    assert_true(bst_is_positive(1e-300) && !bst_is_positive(0.0) && !bst_is_positive(NAN));
    assert_true(bst_is_share(0.0) && bst_is_share(1.0));
    assert_true(!bst_is_share(-0.1) && !bst_is_share(1.1) && !bst_is_share(NAN));
    const double rising[] = {1.0, 1.0, 2.0}, falling[] = {1.0, 2.0, 1.5}, broken[] = {1.0, NAN};
    assert_true(bst_is_ascending(rising, 3) && bst_is_ascending(falling, 2));
    assert_false(bst_is_ascending(falling, 3));
    assert_false(bst_is_ascending(broken, 2));
    double p[4] = {1.0, -2.0, -2.0, 0.0};
    assert_true(bst_is_covariance(p, 2));
    p[3] = -1e-12;
    assert_false(bst_is_covariance(p, 2));
    p[3] = 1.0;
    p[1] = NAN;
    assert_false(bst_is_covariance(p, 2));
}

static void detections(void **state) {
    (void)state;
    bst_detections *d = calloc(1, sizeof *d + 2 * sizeof d->items[0]);
    d->q_cam_from_gcrf = d->q_telemetry_from_gcrf = BST_QUAT_IDENTITY;
    d->count = 2;
    assert_true(bst_detections_are_valid(d, 2));
    assert_false(bst_detections_are_valid(d, 1));
    d->items[1].cov_yy = -1e-9;
    assert_false(bst_detections_are_valid(d, 2));
    d->items[1].cov_yy = 0.0;
    d->items[1].label = BST_LABEL_HIT + 1;
    assert_false(bst_detections_are_valid(d, 2));
    d->items[1].label = BST_LABEL_HIT;
    d->items[1].x_px = NAN;
    assert_false(bst_detections_are_valid(d, 2));
    d->items[1].x_px = 0.0;
    d->start_tick = 1;
    assert_false(bst_detections_are_valid(d, 2));
    d->end_tick = 1;
    assert_true(bst_detections_are_valid(d, 2));
    free(d);
}

static void tracks(void **state) {
    (void)state;
    bst_tracks *t = calloc(1, sizeof *t + sizeof t->items[0]);
    t->count = 1;
    t->items[0] = (bst_track){.id = 1, .direction_gcrf = {0.0, 0.0, 1.0}};
    assert_true(bst_tracks_are_valid(t, 1));
    t->items[0].covariance[2][2] = -1e-20;
    assert_false(bst_tracks_are_valid(t, 1));
    t->items[0].covariance[2][2] = 0.0;
    t->items[0].status = BST_TRACK_COASTING + 1;
    assert_false(bst_tracks_are_valid(t, 1));
    t->items[0].status = BST_TRACK_COASTING;
    t->items[0].direction_gcrf.z = 0.9;
    assert_false(bst_tracks_are_valid(t, 1));
    t->count = 0;
    t->attitude = (bst_attitude_fix){.valid = true, .q_cam_from_gcrf = BST_QUAT_IDENTITY};
    assert_true(bst_tracks_are_valid(t, 1));
    t->attitude.sigma_rad[1] = NAN;
    assert_false(bst_tracks_are_valid(t, 1));
    free(t);
}

static void rings_of_attitudes(void **state) {
    (void)state;
    bst_los_history *h = calloc(1, sizeof *h + 2 * sizeof h->items[0]);
    h->capacity = 2;
    assert_false(bst_los_history_is_valid(h)); /* nothing was written */
    for (int i = 0; i < 2; i++) {
        h->items[i] = (bst_los_sample){.tick = i, .q_cam_from_gcrf = BST_QUAT_IDENTITY};
    }
    h->written = 2;
    assert_true(bst_los_history_is_valid(h));
    h->written = 3; /* tick 0 after tick 1 */
    assert_false(bst_los_history_is_valid(h));
    h->items[0].tick = 2;
    assert_true(bst_los_history_is_valid(h));
    h->items[0].q_cam_from_gcrf.w = 1.001;
    assert_false(bst_los_history_is_valid(h));
    free(h);
}

static void commands_and_windows(void **state) {
    (void)state;
    bst_los_command c = {.direction_gcrf = {1.0, 0.0, 0.0}};
    assert_true(bst_los_command_is_valid(&c));
    c.rate_gcrf_radps.y = NAN;
    assert_false(bst_los_command_is_valid(&c));
    bst_exposure e = {.window = {0, 0, 4, 4}, .binning = 1, .end_tick = 5};
    assert_true(bst_exposure_is_valid(&e));
    e.start_tick = 6;
    assert_false(bst_exposure_is_valid(&e));
    e.start_tick = 0;
    e.window.x0 = -1;
    assert_false(bst_exposure_is_valid(&e));
    bst_task task = {.object = -1};
    assert_true(bst_task_is_valid(&task));
    task.before = BST_TASK_END_COUNT;
    assert_false(bst_task_is_valid(&task));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unit_vectors_and_quaternions),
        cmocka_unit_test(numbers),
        cmocka_unit_test(detections),
        cmocka_unit_test(tracks),
        cmocka_unit_test(rings_of_attitudes),
        cmocka_unit_test(commands_and_windows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
