/* States that come while a run goes: which one counts when, and Kepler's motion from it. */
#include "sim/world/external_states.h"

#include "sim/world/scene/field_objects.h"
#include "tests/archive_support.h"
#include "tests/world/world_support.h"

static const double radius = 7.5e6;

/* A circle in a tilted plane: at `seconds`, of a phase of its own. */
static bst_world_state circle(double phase, double seconds) {
    double w = sqrt(BST_EARTH_MU_M3PS2 / (radius * radius * radius)), a = phase + w * seconds;
    bst_vec3 u = {0.8, 0.0, 0.6}, v = {0.0, 1.0, 0.0};
    return (bst_world_state){
        bst_vec3_axpy(bst_vec3_scale(u, radius * cos(a)), radius * sin(a), v),
        bst_vec3_axpy(bst_vec3_scale(u, -w * radius * sin(a)), w * radius * cos(a), v)};
}

static void check(bst_external_states *s, double seconds, double phase) {
    bst_ctx ctx = {0};
    bst_world_state got, want = circle(phase, seconds);
    bool steered = false;
    bst_assert_ok(&ctx, bst_external_states_state(&ctx, s, seconds, &steered, &got));
    assert_true(steered);
    /* rounding of Kepler's equation over minutes */
    bst_assert_close(test_distance(got.position_m, want.position_m), 0, 1e-5);
    bst_assert_close(test_distance(got.velocity_mps, want.velocity_mps), 0, 1e-8);
}

static void the_last_state_counts(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_external_states *s;
    bst_world_state out = {{1, 2, 3}, {4, 5, 6}};
    bool steered = true;
    bst_assert_ok(&ctx, bst_external_states_create(&ctx, &s));
    bst_assert_ok(&ctx, bst_external_states_state(&ctx, s, 0, &steered, &out));
    assert_false(steered);
    for (int i = 0; i < 7; i++) {
        bst_world_state at = circle(0.1 * i, 100.0 + 60 * i);
        bst_assert_ok(&ctx, bst_external_states_add(&ctx, s, 100.0 + 60 * i, &at));
    }
    bst_assert_ok(&ctx, bst_external_states_state(&ctx, s, 99.999, &steered, &out));
    assert_false(steered);
    assert_true(out.position_m.x == 1 && out.velocity_mps.z == 6); /* untouched */
    for (int i = 0; i < 7; i++) {
        check(s, 100.0 + 60 * i, 0.1 * i);
        check(s, 100.0 + 60 * i + 59.9, 0.1 * i);
    }
    check(s, 2000, 0.6);
    bst_world_state again = circle(0, 460);
    assert_int_equal(bst_external_states_add(&ctx, s, 460, &again), BST_ERR_ARGUMENT);
    assert_string_equal(ctx.message,
                        "a state at 460 s after one at 460 s: they come in the order of time");
    check(s, 2000, 0.6);
    bst_external_states_free(s);
}

/* After more states than are kept, the earliest that is known goes for all before it. */
static void the_oldest_are_forgotten(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_external_states *s;
    bst_assert_ok(&ctx, bst_external_states_create(&ctx, &s));
    const int count = 4096 + 100;
    for (int i = 0; i < count; i++) {
        bst_world_state at = circle(1e-4 * i, i);
        bst_assert_ok(&ctx, bst_external_states_add(&ctx, s, i, &at));
    }
    check(s, 99.5, 1e-4 * 100);
    check(s, 100.5, 1e-4 * 100);
    check(s, 101.5, 1e-4 * 101);
    check(s, 3000.25, 1e-4 * 3000);
    check(s, count - 0.5, 1e-4 * (count - 1));
    bst_external_states_free(s);
}

static void an_object_is_steered_by_name(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world =
        test_world_with("{\"name\": \"GX5\", " TEST_GX5
                        "}, {\"name\": \"mine\", \"external_states\": true, " TEST_GX5 "}",
                        "");
    bst_world_view *view;
    bst_world_state before, at = circle(0.3, 50), now;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_world_steer(&ctx, world, "mine", 50, &at));
    assert_int_equal(bst_world_steer(&ctx, world, "GX5", 50, &at), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_world_steer(&ctx, world, "nobody", 50, &at), BST_ERR_NOT_FOUND);
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, 40, &before));
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 1, 40, &now));
    bst_assert_close(test_distance(now.position_m, before.position_m), 0, 0.01); /* by its orbit */
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 1, 80, &now));
    bst_world_state want = circle(0.3, 80);
    bst_assert_close(test_distance(now.position_m, want.position_m), 0, 1e-3);
    bst_assert_close(test_distance(now.velocity_mps, want.velocity_mps), 0, 1e-6);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* An observer beside a commanded object: a state that comes later changes what the view sees at a
 * time that was requested before. */
static void a_view_forgets_what_a_state_changes(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"mine\", "
        "\"external_states\": true, " TEST_GX5 "}, {\"name\": \"GX5\", " TEST_GX5
        "}]}, \"observers\": [{\"name\": \"beside\", \"orbit\": {\"source\": \"relative\", "
        "\"reference\": \"mine\", \"offset_rtn_m\": [0, 20000, 0]}, \"sensors\": "
        "[{" TEST_CAMERA "}]}]}");
    const bst_world_view_span span = {0, 100.0, 110.0};
    bst_world_view *used, *fresh;
    bst_scene_source_path path[3];
    bst_scene_path_light light[3];
    bst_world_sight mid[3];
    memset(path, 0, sizeof path);
    memset(mid, 0, sizeof mid);
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &used));
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &fresh));
    bst_assert_ok(&ctx, bst_world_view_path(&ctx, used, &span, 1, &path[0], &light[0], &mid[0]));
    bst_world_state at = circle(0.3, 50);
    bst_assert_ok(&ctx, bst_world_steer(&ctx, world, "mine", 50, &at));
    bst_assert_ok(&ctx, bst_world_view_path(&ctx, used, &span, 1, &path[1], &light[1], &mid[1]));
    bst_assert_ok(&ctx, bst_world_view_path(&ctx, fresh, &span, 1, &path[2], &light[2], &mid[2]));
    assert_memory_not_equal(&path[0], &path[1], sizeof *path);
    assert_memory_equal(&path[1], &path[2], sizeof *path);
    assert_memory_equal(&mid[1], &mid[2], sizeof *mid);
    bst_world_view_free(used);
    bst_world_view_free(fresh);
    bst_world_free(world);
}

static bst_world *two_commanded(void) {
    return test_world_with("{\"name\": \"a\", \"external_states\": true, " TEST_GX5
                           "}, {\"name\": \"GX5\", " TEST_GX5
                           "}, {\"name\": \"b\", \"external_states\": true, " TEST_GX5 "}",
                           "");
}

static bst_status archive_world(void *world, bst_archive *archive) {
    bst_world_archive(world, archive);
    return BST_OK;
}

/* The restored states are those that were saved, also when the ring has forgotten some. */
static void states_are_saved_and_restored(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const int counts[] = {0, 1, 3, 4096, 4096 + 100};
    for (int c = 0; c < 5; c++) {
        bst_world *from = two_commanded(), *to = two_commanded();
        bst_world_view *was, *is;
        for (int i = 0; i < counts[c]; i++) {
            bst_world_state a = circle(1e-4 * i, i), b = circle(1e-3 * i, 2 * i);
            bst_assert_ok(&ctx, bst_world_steer(&ctx, from, "a", i, &a));
            bst_assert_ok(&ctx, bst_world_steer(&ctx, from, "b", 2 * i, &b));
        }
        /* a state that the restored ones replace */
        bst_world_state other = circle(2.0, 1e4);
        bst_assert_ok(&ctx, bst_world_steer(&ctx, to, "a", 1e4, &other));
        test_saved saved = test_save(archive_world, from);
        bst_assert_ok(&ctx, test_restore(&ctx, archive_world, to, saved));
        free(saved.bytes);
        bst_assert_ok(&ctx, bst_world_view_create(&ctx, from, &was));
        bst_assert_ok(&ctx, bst_world_view_create(&ctx, to, &is));
        for (int k = 0; k < 300; k++) {
            for (int object = 0; object < 3; object += 2) {
                bst_world_state before, after;
                double t = 17.3 * k;
                bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, was, object, t, &before));
                bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, is, object, t, &after));
                assert_memory_equal(&before, &after, sizeof before);
            }
        }
        /* the next state must be later than the last that was saved */
        bst_world_state next = circle(0.0, counts[c] - 1);
        assert_int_equal(bst_world_steer(&ctx, to, "a", counts[c] - 1, &next),
                         counts[c] > 0 ? BST_ERR_ARGUMENT : BST_OK);
        bst_assert_ok(&ctx, bst_world_steer(&ctx, to, "a", counts[c], &next));
        bst_world_view_free(was);
        bst_world_view_free(is);
        bst_world_free(from);
        bst_world_free(to);
    }
}

static void damaged_states_do_no_harm(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *from = two_commanded(), *to = two_commanded();
    for (int i = 0; i < 3; i++) {
        bst_world_state a = circle(1e-4 * i, i);
        bst_assert_ok(&ctx, bst_world_steer(&ctx, from, "a", i, &a));
    }
    test_saved saved = test_save(archive_world, from);
    test_restore_damaged(archive_world, to, saved, 1);
    /* a number of states below zero is refused */
    memset(saved.bytes + 16 + 2, 0xff, sizeof(int64_t)); /* after the head and the name "it" */
    assert_int_equal(test_restore(&ctx, archive_world, to, saved), BST_ERR_FORMAT);
    free(saved.bytes);
    bst_world_free(from);
    bst_world_free(to);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_state_counts),
        cmocka_unit_test(the_oldest_are_forgotten),
        cmocka_unit_test(an_object_is_steered_by_name),
        cmocka_unit_test(a_view_forgets_what_a_state_changes),
        cmocka_unit_test(states_are_saved_and_restored),
        cmocka_unit_test(damaged_states_do_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
