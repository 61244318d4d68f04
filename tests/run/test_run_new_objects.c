/* Tracks without an object in a run: candidates, new objects, matches with the catalogue. */
#include "sim/run/run_candidates.h"
#include "sim/run/run_new_objects.h"
#include "tests/archive_support.h"
#include "tests/run/custody_support.h"

/* Tracks of an object that the catalogue lacks become a candidate: two of one object are linked,
 * also after a saved state, and a third confirms it. Those of a known object do not. */
static void unknown_objects_become_candidates(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    const int unknown[6] = {0, 0, 0, 0, 0, 0}, known[6] = {1, 1, 1, 1, 1, 1};
    bst_custody_figures f;
    bst_run_custody *c = without_a(&ctx, world, NULL);
    take_detected(&ctx, c, world, unknown, 1, 100.0);
    take_detected(&ctx, c, world, known, 2, 300.0);
    bst_archive *saved;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &saved));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, saved, "it"));
    bst_assert_ok(&ctx, bst_run_custody_archive(c, saved));
    bst_assert_ok(&ctx, bst_archive_end(&ctx, saved));
    size_t size;
    const void *bytes = bst_archive_data(saved, &size);
    bst_run_custody *again = without_a(&ctx, world, NULL);
    bst_archive *read;
    bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &read));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, read, "it"));
    bst_assert_ok(&ctx, bst_run_custody_archive(again, read));
    bst_archive_free(read);
    bst_archive_free(saved);
    take_detected(&ctx, again, world, unknown, 3, 7000.0);
    take_detected(&ctx, again, world, unknown, 4, 13000.0);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, again, 14000.0));
    assert_true(bst_run_custody_figures(again, &f));
    assert_true(f.unknown == 1 && f.uncorrelated == 3 && f.cross_tags == 0);
    assert_true(f.candidates == 1 && f.candidates_confirmed == 1 && f.candidates_wrong == 0);
    bst_run_custody_free(c);
    bst_run_custody_free(again);
    bst_world_free(world);
}

/* A confirmed candidate with an orbit becomes an object: a later track updates it, it is in the
 * table `custody` with the error against the truth, also after a saved state. */
static void candidates_become_objects(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_reader *run;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    const int unknown[6] = {0, 0, 0, 0, 0, 0};
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_run_custody *before = without_a(&ctx, world, NULL), *c = without_a(&ctx, world, store);
    for (int k = 0; k < 3; k++) {
        take_detected(&ctx, before, world, unknown, k + 1, 100.0 + 6900.0 * k);
    }
    copy_state(&ctx, before, c);
    take_detected(&ctx, c, world, unknown, 4, 20000.0);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 25000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.new_objects == 1 && f.new_tracks == 1 && f.new_wrong == 0 && f.new_matched == 0);
    assert_true(f.uncorrelated == 3 && f.correlated == 1 && f.cross_tags == 0);
    assert_true(f.unknown == 1 && f.candidates == 1);
    assert_true(f.new_sigma_median_m > 10.0 && f.new_sigma_median_m < 1000.0);
    /* the directions have no errors here; consistency is shown in test_custody_start.c */
    assert_true(f.new_nees_mean > 0.0 && f.new_nees_mean < 6.0);
    bst_run_custody_free(before);
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody WHERE name = 'new 1' AND "
                                        "object IS NULL AND true_object = 0 AND updates = 4 AND "
                                        "cross_tags = 0 AND error_m < 4 * sigma_m AND nees > 0",
                                        0, 0),
                     1);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_tracks WHERE new_object = 1 "
                                        "AND object IS NULL AND true_object = 0",
                                        0, 0),
                     1);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A new object's orbit that is that of a catalogued object, whose filter had lost it, starts that
 * filter anew. */
static void new_objects_match_the_catalogue(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    scratch place;
    bst_run *store;
    bst_run_reader *run;
    bst_run_custody *c;
    bst_custody_figures f;
    const int own[6] = {0, 0, 0, 0, 0, 0};
    const bst_custody_prediction far = {.innovation = {1.0, 1.0}, .chi2 = 1e3};
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), store, &c));
    predicted = &far;
    lost_norad = 44801;
    for (int k = 0; k < 3; k++) {
        take_detected(&ctx, c, world, own, k + 1, 100.0 + 6900.0 * k);
    }
    predicted = NULL;
    lost_norad = 44802;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 25000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.uncorrelated == 3 && f.new_objects == 0 && f.new_matched == 1);
    assert_true(f.updated == 1 && f.cross_tags == 0);
    assert_true(f.nees_mean > 0.0 && f.nees_mean < 6.0); /* directions without errors */
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    /* none of the three tracks has a chi-square of this filter */
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody WHERE object = 0 AND updates "
                                        "= 3 AND chi2_mean IS NULL",
                                        0, 0),
                     1);
    /* six directions of each track, of two angles each, and six elements */
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_candidates WHERE candidate = "
                                        "1 AND track_id = tracks AND true_object = 0 AND wrong = 0 "
                                        "AND abs(time_s - 6900 * tracks + 6750) < 0.01 AND CASE "
                                        "tracks WHEN 1 THEN chi2 IS NULL AND degrees IS NULL ELSE "
                                        "degrees = 12 * tracks - 6 AND chi2 < degrees END",
                                        0, 0),
                     3);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A filter that is carried to another object's elements predicts what it did: places, and their
 * standard deviation, at the time of the change and a day before and after it. */
static void carried_filters_predict_the_same(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double time_s = 1.5 * BST_DAY_S, sigma[BST_CUSTODY_STATE] = {150, 400, 90, 60, 250, 700};
    bst_elements set = {.norad = 7,
                        .epoch_utc_jd1 = 2459746.5,
                        .eccentricity = 0.1,
                        .inclination_rad = 0.9,
                        .raan_rad = 1.0,
                        .arg_perigee_rad = 2.0,
                        .mean_anomaly_rad = 0.5,
                        .mean_motion_radpmin = 0.02};
    bst_custody_orbit from, to;
    bst_custody_filter own = {.x = {600, -300, 200, 150, -250, 900}, .noise_until_s = 77.0}, anew;
    for (int i = 0; i < BST_CUSTODY_STATE; i++) {
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            own.p[i][k] = sigma[i] * sigma[k] * (i == k ? 1.0 : (i + k) % 2 ? 0.15 : -0.1);
        }
    }
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &from));
    set.mean_anomaly_rad += 4e-5;
    set.mean_motion_radpmin += 1e-9; /* 0.5 km in a day */
    set.inclination_rad += 2e-5;
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &to));
    assert_true(bst_run_new_object_carry(&from, &own, &to, time_s, &anew));
    bst_assert_close(anew.noise_until_s, 77.0, 0.0);
    for (int day = -1; day <= 1; day++) {
        bst_vec3 place[2], unused;
        double sd[2];
        const double at_s = time_s + day * BST_DAY_S;
        assert_true(bst_custody_state(&from, own.x, at_s, &place[0], &unused));
        assert_true(bst_custody_state(&to, anew.x, at_s, &place[1], &unused));
        /* of 0.9 km to 1.6 km between the elements; osculating differences are no mean ones */
        assert_true(bst_vec3_norm(bst_vec3_sub(place[1], place[0])) < 30.0);
        assert_true(bst_custody_predict_position(&from, &own, at_s, &unused, &sd[0]));
        assert_true(bst_custody_predict_position(&to, &anew, at_s, &unused, &sd[1]));
        bst_assert_close(sd[1], sd[0], 0.01 * sd[0]);
    }
}

/* A filter whose errors are independent, each of `sigma`. */
static bst_custody_filter even_filter(double sigma) {
    bst_custody_filter f = {.noise_until_s = 0.0};
    for (int i = 0; i < BST_CUSTODY_STATE; i++) {
        f.p[i][i] = sigma * sigma;
    }
    return f;
}

/* Two orbits are of one object if their difference is within its error, of both, and that error is
 * less than 5 km; whichever is the first. */
static void orbits_of_one_object(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double time_s = 0.4 * BST_DAY_S;
    const bst_elements set = {.norad = 7,
                              .epoch_utc_jd1 = 2459746.5,
                              .eccentricity = 0.02,
                              .inclination_rad = 0.9,
                              .raan_rad = 1.0,
                              .arg_perigee_rad = 2.0,
                              .mean_anomaly_rad = 0.5,
                              .mean_motion_radpmin = 0.02};
    bst_custody_orbit orbit;
    bst_vec3 place;
    double unit;
    bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &orbit));
    bst_custody_filter a = even_filter(1.0);
    assert_true(bst_custody_predict_position(&orbit, &a, time_s, &place, &unit));
    for (int swap = 0; swap < 2; swap++) {
        for (int above = 0; above < 2; above++) { /* hypot(1.2, 4.8) km is 4.95 km */
            const bst_custody_filter two[2] = {even_filter(1200.0 / unit),
                                               even_filter((above ? 4950.0 : 4750.0) / unit)};
            assert_int_equal(bst_run_new_object_is(&orbit, &two[swap], &orbit, &two[!swap], time_s),
                             !above);
            /* chi-square 284.4 of 30 m and 60 m */
            bst_custody_filter own = even_filter(30.0), other = even_filter(60.0);
            const double most_m = sqrt(9.0 * 31.6 * (30.0 * 30.0 + 60.0 * 60.0));
            own.x[BST_CUSTODY_ALONG] = (above ? 1.05 : 0.95) * most_m;
            assert_int_equal(swap ? bst_run_new_object_is(&orbit, &other, &orbit, &own, time_s)
                                  : bst_run_new_object_is(&orbit, &own, &orbit, &other, time_s),
                             !above);
        }
    }
}

/* An object of tracks that the filters do not explain, though the first new one has its orbit
 * already: that one keeps it, and what it was updated by. */
static void earlier_new_objects_keep_their_orbit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_reader *run;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    const int unknown[6] = {0, 0, 0, 0, 0, 0};
    const bst_custody_prediction far = {.innovation = {1.0, 1.0}, .chi2 = 1e3};
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_run_custody *c = without_a(&ctx, world, store);
    predicted = &far;
    lost_norad = -1;
    for (int k = 0; k < 6; k++) { /* soon: the place must be known within 5 km */
        take_detected(&ctx, c, world, unknown, k + 1,
                      k < 3 ? 100.0 + 9900.0 * k : 6000.0 * k + 2500.0);
    }
    predicted = NULL;
    lost_norad = 44802;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 40000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.uncorrelated == 6 && f.new_objects == 1 && f.new_matched == 1);
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody WHERE name = 'new 1' AND "
                                        "updates = 3 AND last_s < 20000",
                                        0, 0),
                     1);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A new object is wrong once, whatever makes it so: of none, of a catalogued one, a second one. */
static void wrong_objects_are_counted_once(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_new_objects n = {.count = 0};
    bst_run_new_figures f;
    const bst_custody_orbit catalogue[3] = {{.a_m = 4.2e7}, {.a_m = 0.0}, {.a_m = 0.0}};
    const int objects[] = {0, 0, 1, 2, 2, -1}, wrong[] = {1, 2, 2, 2, 3, 4};
    for (int i = 0; i < 6; i++) {
        const bst_run_new_object o = {.true_object = objects[i]};
        bst_assert_ok(&ctx, bst_run_new_objects_add(&ctx, &n, &o));
        bst_assert_ok(&ctx, bst_run_new_objects_finish(&ctx, &n, world, catalogue, NULL, 10.0, &f));
        assert_int_equal(f.wrong, wrong[i]);
    }
    bst_run_new_objects_clear(&n);
    bst_world_free(world);
}

/* Candidates or new objects of a world with so many objects. */
typedef struct saved {
    bst_run_candidates *candidates;
    bst_run_new_objects *objects;
    int world_objects;
} saved;

static bst_status archive_saved(void *self, bst_archive *archive) {
    saved *s = self;
    return s->candidates ? bst_run_candidates_archive(s->candidates, s->world_objects, archive)
                         : bst_run_new_objects_archive(s->objects, s->world_objects, archive);
}

/* An object of the truth in a saved state is one of the world. */
static void saved_candidates_are_of_the_world(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_candidates *c;
    bst_run_new_object made;
    const bst_run_arc arc = {.id = 1, .hits = 9, .count = BST_OD_LEAST};
    bst_assert_ok(&ctx, bst_run_candidates_create(&ctx, world, NULL, &c));
    bst_assert_ok(&ctx, bst_run_candidates_take(&ctx, c, 0, &arc, 2, &made));
    saved self = {.candidates = c, .world_objects = 3};
    test_saved bytes = test_save(archive_saved, &self);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_saved, &self, bytes));
    self.world_objects = 2;
    assert_int_equal(test_restore(&ctx, archive_saved, &self, bytes), BST_ERR_FORMAT);
    free(bytes.bytes);
    bst_run_candidates_free(c);
    bst_world_free(world);
}

/* A saved orbit that is no ellipse, or with a time that SGP4 would step to for ever, is an error.
 */
static void saved_orbits_are_possible(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_run_new_object good = {
        .orbit = {.elements = {.mean_motion_radpmin = 0.0044}, .a_m = 4.2e7}, .true_object = -1};
    const double hostile[][5] = {/* epoch, a, e, noise until, last */
                                 {1e300, 4.2e7, 0.0, 0.0, 0.0},  {NAN, 4.2e7, 0.0, 0.0, 0.0},
                                 {0.0, 0.0, 0.0, 0.0, 0.0},      {0.0, NAN, 0.0, 0.0, 0.0},
                                 {0.0, 4.2e7, -0.1, 0.0, 0.0},   {0.0, 4.2e7, 1.0, 0.0, 0.0},
                                 {0.0, 4.2e7, 0.0, 0.0, NAN},    {0.0, 4.2e7, 0.0, NAN, 0.0},
                                 {0.0, 4.2e7, 0.0, -INFINITY, 0}};
    bst_run_new_objects n = {.count = 0};
    saved self = {.objects = &n, .world_objects = 1};
    bst_assert_ok(&ctx, bst_run_new_objects_add(&ctx, &n, &good));
    test_saved bytes = test_save(archive_saved, &self);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_saved, &self, bytes));
    free(bytes.bytes);
    for (size_t i = 0; i < sizeof hostile / sizeof *hostile; i++) {
        bst_run_new_object *o = &n.items[0];
        bst_archive *damaged;
        memcpy(o, &good, sizeof good);
        o->orbit.epoch_offset_s = hostile[i][0];
        o->orbit.a_m = hostile[i][1];
        o->orbit.elements.eccentricity = hostile[i][2];
        o->filter.noise_until_s = hostile[i][3];
        o->score.last_s = hostile[i][4];
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &damaged));
        bst_assert_ok(&ctx, bst_archive_begin(&ctx, damaged, "it"));
        assert_int_equal(archive_saved(&self, damaged), BST_ERR_FORMAT);
        assert_non_null(strstr(ctx.message, "new object 1"));
        bst_archive_free(damaged);
    }
    bst_run_new_objects_clear(&n);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unknown_objects_become_candidates),
        cmocka_unit_test(candidates_become_objects),
        cmocka_unit_test(new_objects_match_the_catalogue),
        cmocka_unit_test(carried_filters_predict_the_same),
        cmocka_unit_test(orbits_of_one_object),
        cmocka_unit_test(earlier_new_objects_keep_their_orbit),
        cmocka_unit_test(wrong_objects_are_counted_once),
        cmocka_unit_test(saved_candidates_are_of_the_world),
        cmocka_unit_test(saved_orbits_are_possible),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
