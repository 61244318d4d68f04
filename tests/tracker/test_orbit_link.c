/* Arcs of unknown objects become orbits: those of one object are linked, those of others not. */
#include "tests/archive_support.h"
#include "tests/tracker/orbit_scene.h"
#include "tracker/orbit/orbit_link.h"

enum { BODIES = 3, DIRECTIONS = 10 };
#define DAY_S 86400.0

/* Two GEO objects 1 degree apart, and a low one. */
static bst_od_state body(int k) {
    static const double elements[BODIES][6] = {{4.2164e7, 0.0003, 0.05, 20, 30, 100},
                                               {4.2164e7, 0.0002, 0.04, 60, 30, 61},
                                               {7.5e6, 0.001, 70, 200, 20, 30}};
    const double *e = elements[k];
    return from_elements(e[0], e[1], e[2], e[3], e[4], e[5]);
}

/* Eighteen seconds of 0.3 arcsec, as seen from a low orbit. */
static void arc_of(int k, double from_s, int run, bst_od_observation out[DIRECTIONS]) {
    const scene s = {.body = body(k),
                     .eye = from_elements(7.16e6, 0.001, 98.6, 40, 10, 0),
                     .from_s = from_s,
                     .to_s = from_s + 18.0,
                     .count = DIRECTIONS,
                     .sigma_rad = 0.3 * BST_ARCSEC_RAD};
    observe(&s, run, out);
}

static void arcs_of_an_object_are_linked(void **state) {
    (void)state;
    static bst_od_linker l;
    const bst_od_motion motion = {.forces = NULL};
    static const double times_s[] = {600.0, 8000.0, 14000.0};
    int item[BODIES];
    l = (bst_od_linker){.count = 0};
    for (int pass = 0; pass < 3; pass++) {
        for (int k = 0; k < BODIES; k++) {
            bst_od_observation z[DIRECTIONS];
            /* the low one within a revolution */
            const double at_s = k < 2 ? times_s[pass] : 600.0 + 1500.0 * pass;
            arc_of(k, at_s + 30.0 * k, 10 * pass + k, z);
            const int at = bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S);
            if (pass == 0) {
                item[k] = at;
            }
            assert_int_equal(at, item[k]);
            assert_int_equal(l.items[at].arcs, pass + 1);
            assert_int_equal(l.items[at].id, k + 1);
        }
    }
    assert_int_equal(l.count, BODIES);
    for (int k = 0; k < BODIES; k++) {
        const bst_od_linked *o = &l.items[item[k]];
        assert_int_equal(o->count, 3 * DIRECTIONS);
        for (int i = 1; i < o->count; i++) {
            assert_true(o->directions[i].observer.time_s >= o->directions[i - 1].observer.time_s);
        }
        /* 0.3 arcsec at 4e7 m are 58 m; the range is known 400 times worse by such arcs */
        const scene s = {.body = body(k)};
        const bst_od_state truth = truth_at(&s, o->state.time_s);
        assert_true(bst_vec3_norm(bst_vec3_sub(truth.position_m, o->state.position_m)) < 3e4);
    }
}

/* An arc after within_s is no longer linked; a full store gives up the arc that waits longest. */
static void old_arcs_are_given_up(void **state) {
    (void)state;
    static bst_od_linker l;
    const bst_od_motion motion = {.forces = NULL};
    bst_od_observation z[DIRECTIONS];
    l = (bst_od_linker){.count = 0};
    arc_of(0, 600.0, 1, z);
    assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S), 0);
    arc_of(0, 8000.0, 2, z);
    assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, 7000.0), 1); /* 7382 s later */
    assert_int_equal(l.items[0].arcs, 1);
    arc_of(0, 14000.0, 3, z);
    assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, 7000.0), 1);
    assert_int_equal(l.items[1].arcs, 2);
    for (int i = 2; i < BST_OD_LINK_ORBITS; i++) {
        arc_of(1, 40000.0 + 10000.0 * i, i, z);
        assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, 0.0), i);
    }
    arc_of(1, 40000.0 + 10000.0 * BST_OD_LINK_ORBITS, 99, z);
    assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, 0.0), 0);
    arc_of(1, 60000.0 + 10000.0 * BST_OD_LINK_ORBITS, 99, z);
    assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, 0.0), 2); /* 1 is an orbit */
}

/* Older directions make room: never more than the store has, in order of time. */
static void directions_are_thinned_out(void **state) {
    (void)state;
    static bst_od_linker l;
    const bst_od_motion motion = {.forces = NULL};
    bst_od_observation z[DIRECTIONS];
    l = (bst_od_linker){.count = 0};
    for (int pass = 0; pass < 5; pass++) {
        arc_of(0, 600.0 + 6000.0 * pass, pass, z);
        for (int i = 1; i < DIRECTIONS; i++) {
            z[i].shared_change = 0.125;
        }
        assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S), 0);
        assert_int_equal(l.items[0].arcs, pass + 1);
        assert_true(l.items[0].count <= BST_OD_LINK_DIRECTIONS);
        bst_assert_close(l.items[0].directions[l.items[0].count - 1].observer.time_s,
                         618.0 + 6000.0 * pass, 0.0);
    }
    assert_true(l.items[0].count >= BST_OD_LINK_DIRECTIONS / 2);
    /* every second one of the first four arcs is left: shared errors change twice as much between
     * them, and arcs share none */
    for (int i = 1; i < l.items[0].count; i++) {
        const double change = l.items[0].directions[i].shared_change;
        const double own = i < 2 * DIRECTIONS ? 0.25 : 0.125;
        const int arc = i < 2 * DIRECTIONS ? DIRECTIONS / 2 : DIRECTIONS;
        if (i % arc == 0) {
            assert_true(isinf(change));
        } else {
            bst_assert_close(change, own, 0.0);
        }
    }
}

/* An item that is removed gives its place to the last one. */
static void items_are_dropped(void **state) {
    (void)state;
    static bst_od_linker l;
    const bst_od_motion motion = {.forces = NULL};
    bst_od_observation z[DIRECTIONS];
    l = (bst_od_linker){.count = 0};
    for (int k = 0; k < BODIES; k++) {
        arc_of(k, 600.0, k, z);
        assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S), k);
    }
    bst_od_linker_drop(&l, 0);
    assert_true(l.count == 2 && l.items[0].id == 3 && l.items[1].id == 2);
    bst_od_linker_drop(&l, 1);
    assert_true(l.count == 1 && l.items[0].id == 3);
}

/* Long arcs that overlap in time: one sensor would have one track of an object, two sensors of a
 * spacecraft have two of it. */
static void two_sensors_may_see_one_object(void **state) {
    (void)state;
    static bst_od_linker l;
    const bst_od_motion motion = {.forces = NULL};
    bst_od_observation z[2][DIRECTIONS];
    for (int k = 0; k < 2; k++) {
        const scene s = {.body = body(1),
                         .eye = from_elements(7.16e6, 0.001, 98.6, 40, 10, 0),
                         .from_s = 600.0 + 700.0 * k,
                         .to_s = 3000.0 + 700.0 * k,
                         .count = DIRECTIONS,
                         .sigma_rad = 0.3 * BST_ARCSEC_RAD};
        observe(&s, k, z[k]);
    }
    for (int other = 0; other < 2; other++) {
        l = (bst_od_linker){.count = 0};
        assert_int_equal(bst_od_link_arc(&l, &motion, 4, z[0], DIRECTIONS, DAY_S), 0);
        const int at = bst_od_link_arc(&l, &motion, 4 + other, z[1], DIRECTIONS, DAY_S);
        assert_int_equal(at, other ? 0 : 1);
        assert_int_equal(l.items[at].arcs, other ? 2 : 1);
    }
}

static bst_status archive_linker(void *self, bst_archive *archive) {
    return bst_od_linker_archive(self, archive);
}

static void a_linker_is_saved_and_restored(void **state) {
    (void)state;
    static bst_od_linker l, back;
    const bst_od_motion motion = {.forces = NULL};
    bst_od_observation z[DIRECTIONS];
    bst_ctx ctx = {0};
    l = back = (bst_od_linker){.count = 0};
    for (int k = 0; k < 2; k++) {
        arc_of(k, 600.0, k, z);
        (void)bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S);
    }
    test_saved saved = test_save(archive_linker, &l);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_linker, &back, saved));
    free(saved.bytes);
    assert_memory_equal(&back, &l, sizeof l);
    l.items[1].count = BST_OD_LINK_DIRECTIONS + 1;
    bst_archive *damaged;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &damaged));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, damaged, "it"));
    assert_int_equal(bst_od_linker_archive(&l, damaged), BST_ERR_FORMAT);
    bst_archive_free(damaged);
    /* times that a propagator would step to for ever */
    l.items[1].count = DIRECTIONS;
    double *const times[] = {&l.items[1].directions[DIRECTIONS - 1].observer.time_s,
                             &l.items[1].state.time_s};
    const double hostile[] = {1e300, -1e300, NAN};
    for (int i = 0; i < 6; i++) {
        const double before = *times[i / 3];
        *times[i / 3] = hostile[i % 3];
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &damaged));
        bst_assert_ok(&ctx, bst_archive_begin(&ctx, damaged, "it"));
        assert_int_equal(bst_od_linker_archive(&l, damaged), BST_ERR_FORMAT);
        bst_archive_free(damaged);
        *times[i / 3] = before;
    }
}

/* Two tracks that an observer has at a time are of two objects, however well one orbit fits them; a
 * later one of either is linked. */
static void tracks_at_one_time_are_not_linked(void **state) {
    (void)state;
    static bst_od_linker l;
    const bst_od_motion motion = {.forces = NULL};
    bst_od_observation z[DIRECTIONS];
    l = (bst_od_linker){.count = 0};
    for (int k = 0; k < 2; k++) {
        arc_of(0, 600.0 + k, k, z);
        assert_int_equal(bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S), k);
        assert_int_equal(l.items[k].arcs, 1);
    }
    arc_of(0, 8000.0, 2, z);
    const int at = bst_od_link_arc(&l, &motion, 0, z, DIRECTIONS, DAY_S);
    assert_int_equal(l.items[at].arcs, 2);
    assert_int_equal(l.count, 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tracks_at_one_time_are_not_linked),
                                       cmocka_unit_test(arcs_of_an_object_are_linked),
                                       cmocka_unit_test(old_arcs_are_given_up),
                                       cmocka_unit_test(directions_are_thinned_out),
                                       cmocka_unit_test(items_are_dropped),
                                       cmocka_unit_test(two_sensors_may_see_one_object),
                                       cmocka_unit_test(a_linker_is_saved_and_restored)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
