/* The scenario's objects as the onboard side knows them: apsides, first places, sights from where
 * the spacecraft believes to be; and what a world says of their orbits. */
#include "sim/onboard/knowledge.h"
#include "tests/world/world_support.h"
#include "tracker/catalogue.h"
#include "tracker/identity.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"
#define KEPLER(name, at, e, more)                                                        \
    "{\"name\": \"" name                                                                 \
    "\", \"orbit\": {\"source\": \"numerical\", \"state\": {\"source\": \"keplerian\", " \
    "\"at_s\": " at ", \"perigee_radius_m\": 7.2e6, \"eccentricity\": " e                \
    ", \"inclination_deg\": 60, \"raan_deg\": 30, \"arg_perigee_deg\": 40, "             \
    "\"true_anomaly_deg\": 50}, \"forces\": {\"gravity\": \"two_body\"}}" more "}"
#define BESIDE                                                                              \
    "{\"name\": \"beside\", \"orbit\": {\"source\": \"relative\", \"reference\": \"GX5\", " \
    "\"offset_rtn_m\": [0, 5000, 0]}}"

enum { OBJECT_GX5, ELLIPSE, HYPERBOLA, BURNING, BESIDE_GX5, SELF, OBJECTS };

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_world_view *view;
    bst_knowledge *knowledge;
    bst_knowledge_view *onboard;
} scene;

static scene make(const char *sensor) {
    scene s = {.world = test_world_with(
                   GX5 ", " KEPLER("ellipse", "0", "0.25", "") ", " KEPLER(
                       "hyperbola", "0", "1.5",
                       "") ", " KEPLER("burning", "0", "0.1",
                                       ", \"burns\": [{\"time_s\": 30, \"dv_rtn_mps\": [0, 50, "
                                       "0]}]") ", " BESIDE ", {\"name\": \"self\", " TEST_NEOSSAT
                                               "}",
                   sensor)};
    bst_assert_ok(&s.ctx, bst_world_view_create(&s.ctx, s.world, &s.view));
    bst_assert_ok(&s.ctx, bst_knowledge_create(&s.ctx, s.world, 0, 0, &s.knowledge));
    bst_assert_ok(&s.ctx, bst_knowledge_view_create(&s.ctx, s.knowledge, &s.onboard));
    return s;
}

static void drop(scene *s) {
    bst_knowledge_view_free(s->onboard);
    bst_knowledge_free(s->knowledge);
    bst_world_view_free(s->view);
    bst_world_free(s->world);
}

static void orbits_by_their_apsides(void **state) {
    (void)state;
    scene s = make("");
    double perigee, apogee;
    assert_int_equal(bst_knowledge_object_count(s.knowledge), OBJECTS);
    assert_string_equal(bst_knowledge_object(s.knowledge, ELLIPSE)->name, "ellipse");
    assert_int_equal(bst_knowledge_find_object(s.knowledge, "burning"), BURNING);
    assert_int_equal(bst_knowledge_find_object(s.knowledge, "nobody"), -1);
    assert_true(bst_knowledge_apsides(s.onboard, ELLIPSE, &perigee, &apogee));
    bst_assert_close(perigee, 7.2e6, 0.01);
    bst_assert_close(apogee, 7.2e6 * 1.25 / 0.75, 0.01);
    assert_true(bst_knowledge_apsides(s.onboard, HYPERBOLA, &perigee, &apogee));
    bst_assert_close(perigee, 7.2e6, 0.01);
    assert_true(isinf(apogee));
    /* a geostationary satellite, to its eccentricity of 3e-4 */
    assert_true(bst_knowledge_apsides(s.onboard, OBJECT_GX5, &perigee, &apogee));
    bst_assert_close(perigee, 42.164e6, 4e4);
    bst_assert_close(apogee, 42.164e6, 4e4);
    for (int i = 0; i < OBJECTS; i++) {
        assert_true(bst_knowledge_is_itself(s.knowledge, i) == (i == SELF));
    }
    drop(&s);
}

static void first_places_of_all(void **state) {
    (void)state;
    scene s = make("");
    double x[OBJECTS], y[OBJECTS], z[OBJECTS];
    bst_assert_ok(&s.ctx, bst_world_prepare(&s.ctx, s.world, 1));
    for (double t = 10; t < 400; t += 130) {
        double at = bst_knowledge_places(s.knowledge, t, x, y, z);
        bst_assert_close(at, 8 * round(t / 8), 0);
        for (int i = 0; i < OBJECTS; i++) {
            bst_world_state true_state;
            bst_assert_ok(&s.ctx, bst_world_view_object_state(&s.ctx, s.view, i, at, &true_state));
            if (i == BURNING) { /* its burn is not to be known */
                assert_true(isnan(x[i]) && isnan(y[i]) && isnan(z[i]));
            } else if (!isnan(x[i])) {
                bst_vec3 place = {x[i], y[i], z[i]};
                bst_assert_close(test_distance(place, true_state.position_m), 0, 1000);
            }
        }
        assert_false(isnan(x[OBJECT_GX5]) || isnan(x[SELF]));
    }
    drop(&s);
}

/* The objects in a cone are among those that are found; the cue's object is the task's, if any. */
static void objects_near_a_direction(void **state) {
    (void)state;
    scene s = make("");
    bst_assert_ok(&s.ctx, bst_world_prepare(&s.ctx, s.world, 1));
    int indices[OBJECTS], count, in_cone = 0, found = 0;
    const double t = 37.0, half = 0.3;
    bst_world_sight at;
    bst_assert_ok(&s.ctx, bst_knowledge_sight_at(&s.ctx, s.onboard, OBJECT_GX5, t, &at));
    bst_assert_ok(&s.ctx,
                  bst_knowledge_near(&s.ctx, s.onboard, t, at.apparent, half, indices, &count));
    for (int i = 0; i < OBJECTS; i++) {
        bst_world_sight other;
        bool listed = false;
        for (int k = 0; k < count; k++) {
            assert_true(k == 0 || indices[k] > indices[k - 1]);
            listed = listed || indices[k] == i;
        }
        bst_ctx quiet = {0};
        bst_vec3 direction;
        bst_status status = bst_knowledge_sight_at(&quiet, s.onboard, i, t, &other);
        assert_int_equal(bst_knowledge_direction_at(&quiet, s.onboard, i, t, &direction), status);
        assert_true(status != BST_OK ||
                    memcmp(&direction, &other.geometric, sizeof direction) == 0);
        if (i != SELF && status == BST_OK && bst_vec3_angle(other.apparent, at.apparent) <= half) {
            in_cone++;
            found += listed;
        }
    }
    assert_true(in_cone >= 1);
    assert_int_equal(found, in_cone);
    int own = bst_knowledge_cue_object(s.onboard);
    const bst_task task = {.id = 3, .object = ELLIPSE};
    assert_true(bst_knowledge_view_task(s.onboard, &task));
    assert_int_equal(bst_knowledge_cue_object(s.onboard), ELLIPSE);
    const bst_task no_object = {.id = 4, .object = -1};
    assert_true(bst_knowledge_view_task(s.onboard, &no_object));
    assert_int_equal(bst_knowledge_cue_object(s.onboard), own);
    drop(&s);
}

/* With room for one object the tracker gets the one nearest to a track, and the number of those
 * that are left out. */
static void the_objects_nearest_to_tracks(void **state) {
    (void)state;
    scene s = make("");
    bst_tracker_config config;
    bst_tracker_catalogue *catalogue;
    bst_assert_ok(&s.ctx, bst_config_defaults(&s.ctx, bst_tracker_config_table, &config));
    bst_assert_ok(&s.ctx, bst_world_prepare(&s.ctx, s.world, 1));
    bst_assert_ok(
        &s.ctx, bst_tracker_catalogue_create(&s.ctx, &config, s.knowledge, s.onboard, &catalogue));
    const double t = 37.0;
    assert_int_equal(bst_tracker_catalogue_set(catalogue, t, 0.0), -1);
    static const int both[2] = {OBJECT_GX5, BESIDE_GX5};
    bst_world_sight at[2];
    for (int i = 0; i < 2; i++) {
        bst_assert_ok(&s.ctx, bst_knowledge_sight_at(&s.ctx, s.onboard, both[i], t, &at[i]));
    }
    for (int i = 0; i < 3; i++) {
        int left_out;
        bst_identity_object found[2];
        const bst_tracker_search search = {.axis = at[0].geometric,
                                           .half_angle_rad = 1e-3,
                                           .tracks = &at[i % 2].geometric,
                                           .track_count = i < 2};
        assert_int_equal(bst_tracker_catalogue_near(catalogue, &search, found, 2, &left_out), 2);
        assert_int_equal(left_out, 0);
        assert_int_equal(bst_tracker_catalogue_near(catalogue, &search, found, 1, &left_out), 1);
        assert_int_equal(left_out, 1);
        assert_int_equal(found[0].object, both[i % 2]);
    }
    assert_false(bst_tracker_catalogue_failed(catalogue));
    /* a clock known to 50 s: the rate times that, and the change of the rate, are added */
    int left_out;
    bst_identity_object right, wide;
    const bst_tracker_search search = {.axis = at[0].geometric,
                                       .half_angle_rad = 1e-3,
                                       .tracks = &at[0].geometric,
                                       .track_count = 1};
    bst_tracker_catalogue_near(catalogue, &search, &right, 1, &left_out);
    bst_assert_close(right.sigma_rad, config.catalogue_sigma_m / at[0].range_m, 1e-12);
    bst_tracker_catalogue_set(catalogue, t, 50.0);
    bst_tracker_catalogue_near(catalogue, &search, &wide, 1, &left_out);
    bst_assert_close(wide.sigma_rad, hypot(right.sigma_rad, 50.0 * bst_vec3_norm(right.rate_radps)),
                     1e-12);
    bst_vec3 rate[2];
    for (int i = 0; i < 2; i++) {
        bst_tracker_catalogue_set(catalogue, t - 1.0 + 2.0 * i, 0.0);
        bst_identity_object o;
        bst_tracker_catalogue_near(catalogue, &search, &o, 1, &left_out);
        rate[i] = o.rate_radps;
    }
    double turn = 0.5 * test_distance(rate[0], rate[1]);
    bst_assert_close(wide.rate_sigma_radps, hypot(right.rate_sigma_radps, 50.0 * turn),
                     0.02 * wide.rate_sigma_radps); /* places are interpolated */
    assert_true(wide.rate_sigma_radps > 2.0 * right.rate_sigma_radps);
    bst_clock_sight sight;
    bst_tracker_catalogue_set(catalogue, t, 0.0);
    assert_true(bst_tracker_catalogue_sight(catalogue, OBJECT_GX5, &sight));
    bst_assert_close(test_distance(sight.direction, at[0].geometric), 0, 1e-15);
    bst_assert_close(sight.corrected_s, 0.0, 0.0);
    bst_tracker_catalogue_free(catalogue);
    drop(&s);
}

static void expect_same(const bst_world_sight *a, const bst_world_sight *b) {
    /* the truth's ephemeris is right to millimetres, of thousands of kilometres */
    bst_assert_close(test_distance(a->geometric, b->geometric), 0, 2e-9);
    bst_assert_close(test_distance(a->apparent, b->apparent), 0, 2e-9);
    bst_assert_close(a->range_m, b->range_m, 0.05);
    bst_assert_close(a->light_time_s, b->light_time_s, 1e-9);
    bst_assert_close(a->phase_rad, b->phase_rad, 1e-8);
    bst_assert_close(a->sunlit_fraction, b->sunlit_fraction, 1e-6);
    assert_true(a->occulted == b->occulted);
    if (isfinite(b->v_mag)) {
        bst_assert_close(a->v_mag, b->v_mag, 1e-6);
    } else {
        assert_true(isinf(a->v_mag));
    }
}

/* With a clock that is 50 s fast everything is as it will truly be 50 s later. */
static void sights_by_a_fast_clock(void **state) {
    (void)state;
    scene s = make(", \"knowledge\": {\"clock_offset_s\": 50}");
    int hidden = 0, seen = 0;
    for (double t = 0; t < 9000; t += 300) {
        for (int i = OBJECT_GX5; i <= ELLIPSE; i++) {
            bst_world_sight truth, believed;
            bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, s.view, 0, i, t + 50, &truth));
            bst_assert_ok(&s.ctx, bst_knowledge_sight_at(&s.ctx, s.onboard, i, t, &believed));
            expect_same(&believed, &truth);
            hidden += believed.occulted;
            seen += !believed.occulted;
        }
        bst_world_state eye, own;
        bst_bodies bodies, now;
        bst_assert_ok(&s.ctx, bst_knowledge_eye_at(&s.ctx, s.onboard, t, &eye, &bodies));
        bst_assert_ok(&s.ctx, bst_world_view_observer_state(&s.ctx, s.view, 0, t + 50, &own));
        bst_assert_ok(&s.ctx, bst_world_view_bodies(&s.ctx, s.view, t + 50, &now));
        bst_assert_close(test_distance(eye.position_m, own.position_m), 0, 0.01);
        bst_assert_close(test_distance(eye.velocity_mps, own.velocity_mps), 0, 1e-5);
        bst_assert_close(test_distance(bodies.sun_m, now.sun_m), 0, 1);
        bst_assert_close(test_distance(bodies.moon_m, now.moon_m), 0, 1e-3);
    }
    assert_true(hidden > 3 && seen > 3);
    drop(&s);
}

/* From a place that is believed: the direction changes by the error across it over the range. */
static void sights_from_where_it_believes_to_be(void **state) {
    (void)state;
    scene right = make(""),
          wrong = make(
              ", \"knowledge\": {\"orbit\": {\"position_rtn_m\": [300, -200, 500], "
              "\"velocity_rtn_mps\": [0.5, 0.2, -0.4], \"along_track_drift_mps\": 2}}");
    const double t = 40;
    bst_world_state truth, eye;
    bst_bodies bodies;
    bst_assert_ok(&right.ctx, bst_world_view_observer_state(&right.ctx, right.view, 0, t, &truth));
    bst_assert_ok(&wrong.ctx, bst_knowledge_eye_at(&wrong.ctx, wrong.onboard, t, &eye, &bodies));
    bst_vec3 r = bst_vec3_unit(truth.position_m);
    bst_vec3 n = bst_vec3_unit(bst_vec3_cross(truth.position_m, truth.velocity_mps));
    bst_vec3 along = bst_vec3_cross(n, r);
    bst_vec3 off = bst_vec3_sub(eye.position_m, truth.position_m),
             drift = bst_vec3_sub(eye.velocity_mps, truth.velocity_mps);
    bst_assert_close(bst_vec3_dot(off, r), 300, 0.01);
    bst_assert_close(bst_vec3_dot(off, along), -200 + 2 * t, 0.01);
    bst_assert_close(bst_vec3_dot(off, n), 500, 0.01);
    bst_assert_close(bst_vec3_dot(drift, r), 0.5, 1e-5);
    bst_assert_close(bst_vec3_dot(drift, along), 0.2, 1e-5);
    bst_assert_close(bst_vec3_dot(drift, n), -0.4, 1e-5);
    bst_world_sight a, b;
    bst_assert_ok(&right.ctx, bst_world_view_sight(&right.ctx, right.view, 0, ELLIPSE, t, &a));
    bst_assert_ok(&wrong.ctx, bst_knowledge_sight_at(&wrong.ctx, wrong.onboard, ELLIPSE, t, &b));
    bst_vec3 line = bst_vec3_axpy(bst_vec3_scale(off, -1), a.range_m, a.geometric);
    /* light time of 600 m, and the Earth's motion in it: 1e-4 of them */
    bst_assert_close(test_distance(b.geometric, bst_vec3_unit(line)), 0, 0.2 / a.range_m);
    bst_assert_close(b.range_m, bst_vec3_norm(line), 0.3);
    drop(&right);
    drop(&wrong);
}

/* Ages of the element sets (2022, days 166.78481540 and 167.00079919) at 2022-06-16T22:10, day
 * 167 + 79800 / 86400; the laws that objects move by. */
static void what_a_world_says_of_orbits(void **state) {
    (void)state;
    scene s = make("");
    double age;
    assert_true(bst_world_element_age(s.world, OBJECT_GX5, &age));
    bst_assert_close(age, (167 - 167.00079919) * 86400 + 79800, 0.01); /* 1e-8 of a day */
    assert_true(bst_world_element_age(s.world, OBJECTS, &age));        /* the observer */
    bst_assert_close(age, (167 - 166.78481540) * 86400 + 79800, 0.01);
    assert_false(bst_world_element_age(s.world, ELLIPSE, &age));
    bst_world_motion_law m = bst_world_object_motion(s.world, SELF);
    assert_true(m.sgp4 && !m.forces);
    bst_assert_close(m.bstar, 6.8433e-5, 1e-12);
    m = bst_world_object_motion(s.world, ELLIPSE);
    assert_true(!m.sgp4 && m.forces);
    m = bst_world_object_motion(s.world, BESIDE_GX5); /* by the law of its reference */
    assert_true(m.sgp4 && !m.forces);
    assert_int_equal(bst_world_observer_count(s.world), 1);
    assert_int_equal(bst_world_sensor_count(s.world, 0), 1);
    assert_string_equal(bst_world_observer_name(s.world, 0), "neossat");
    char text[40];
    bst_time_to_utc(bst_world_time(s.world, 3601.5), 1, text, sizeof text);
    assert_string_equal(text, "2022-06-16T23:10:01.5Z");
    drop(&s);
}

/* Of several observers each believes to be where it is itself. */
static void each_observer_is_itself(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"a\", " TEST_NEOSSAT ", \"sensors\": [{" TEST_CAMERA
        "}]}, {\"name\": \"b\", \"orbit\": {\"elements_file\": "
        "\"scenarios/catalogue_2022-06.tle\", \"norad\": 25544}, \"sensors\": [{\"knowledge\": "
        "{\"clock_offset_s\": 7}, " TEST_CAMERA "}]}]}");
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (int o = 0; o < 2; o++) {
        for (double t = 100.2; t < 101; t += 0.1) { /* often within a second */
            bst_world_state own, believed;
            bst_bodies bodies;
            bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, o, t + 7 * o, &own));
            bst_assert_ok(&ctx, bst_world_view_nav(&ctx, view, o, 0, t, &believed, &bodies));
            bst_assert_close(test_distance(believed.position_m, own.position_m), 0, 1e-3);
            bst_assert_close(test_distance(believed.velocity_mps, own.velocity_mps), 0, 1e-6);
        }
    }
    double ages[2];
    assert_true(bst_world_element_age(world, 1, &ages[0]));
    assert_true(bst_world_element_age(world, 2, &ages[1]));
    assert_true(fabs(ages[0] - ages[1]) > 1);
    assert_string_equal(bst_world_observer_name(world, 1), "b");
    bst_world_view_free(view);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(orbits_by_their_apsides),
        cmocka_unit_test(objects_near_a_direction),
        cmocka_unit_test(the_objects_nearest_to_tracks),
        cmocka_unit_test(first_places_of_all),
        cmocka_unit_test(sights_by_a_fast_clock),
        cmocka_unit_test(sights_from_where_it_believes_to_be),
        cmocka_unit_test(what_a_world_says_of_orbits),
        cmocka_unit_test(each_observer_is_itself),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
