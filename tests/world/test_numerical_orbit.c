/* Numerical orbits out of scenarios, and the rendezvous. */
#include "tests/world/world_support.h"

#define NUMERICAL "{\"name\": \"n\", \"orbit\": {\"source\": \"numerical\", "
#define KEPLERIAN                                                                             \
    "\"state\": {\"source\": \"keplerian\", \"at_s\": 100, \"perigee_radius_m\": 7e6, "       \
    "\"eccentricity\": 0.1, \"inclination_deg\": 60, \"raan_deg\": 30, \"arg_perigee_deg\": " \
    "40, \"true_anomaly_deg\": 50}"

static bst_world_state object_at(bst_world_view *view, int object, double seconds) {
    bst_ctx ctx = {0};
    bst_world_state s;
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, object, seconds, &s));
    return s;
}

static bst_world_view *view_of(const bst_world *world) {
    bst_ctx ctx = {0};
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    return view;
}

static void keplerian_elements_give_the_orbit(void **state) {
    (void)state;
    bst_world *world = test_world_with(NUMERICAL KEPLERIAN
                                       ", \"forces\": {\"gravity\": "
                                       "\"two_body\"}}}",
                                       "");
    bst_world_view *view = view_of(world);
    bst_world_state s = object_at(view, 0, 100);
    bst_vec3 h = bst_vec3_cross(s.position_m, s.velocity_mps), n = bst_vec3_unit(h);
    double r = bst_vec3_norm(s.position_m), gm = BST_EARTH_MU_M3PS2;
    bst_vec3 e = bst_vec3_axpy(bst_vec3_scale(bst_vec3_cross(s.velocity_mps, h), 1 / gm), -1 / r,
                               s.position_m);
    const double deg = BST_DEG_RAD;
    /* rounding of 7e6 m and angles */
    bst_assert_close(bst_vec3_norm(e), 0.1, 1e-13);
    bst_assert_close(n.z, cos(60 * deg), 1e-13);
    bst_assert_close(atan2(n.x, -n.y), 30 * deg, 1e-13);
    bst_vec3 node = {cos(30 * deg), sin(30 * deg), 0};
    bst_assert_close(bst_vec3_angle(node, e), 40 * deg, 1e-12);
    bst_assert_close(bst_vec3_angle(e, s.position_m), 50 * deg, 1e-12);
    bst_assert_close(r * (1 + 0.1 * cos(50 * deg)), 7e6 * 1.1, 1e-6);
    bst_world_view_free(view);
    bst_world_free(world);
}

/* A state by its numbers, at a time of its own; each of them another. */
static void a_cartesian_state_gives_the_orbit(void **state) {
    (void)state;
    bst_world *world =
        test_world_with(NUMERICAL
                        "\"state\": {\"source\": \"cartesian\", \"at_s\": 40, \"position_gcrf_m\": "
                        "[6.1e6, -3.2e6, 2.3e6], \"velocity_gcrf_mps\": [2500, 6100, 1700]}, "
                        "\"forces\": {\"gravity\": \"two_body\"}}}",
                        "");
    bst_world_view *view = view_of(world);
    const bst_world_state s = object_at(view, 0, 40);
    const double want[6] = {6.1e6, -3.2e6, 2.3e6, 2500, 6100, 1700};
    const double found[6] = {s.position_m.x,   s.position_m.y,   s.position_m.z,
                             s.velocity_mps.x, s.velocity_mps.y, s.velocity_mps.z};
    for (int i = 0; i < 6; i++) {
        bst_assert_close(found[i], want[i], 1e-12 * fabs(want[i])); /* rounding */
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

static bst_initial_state_config open_state(double e) {
    return (bst_initial_state_config){.semi_major_axis_m = NAN,
                                      .perigee_radius_m = NAN,
                                      .eccentricity = e,
                                      .true_anomaly_deg = NAN,
                                      .mean_anomaly_deg = NAN};
}

/* Semi-major axis and mean anomaly against closed forms, by way of the eccentric anomaly. */
static void axis_and_mean_anomaly(void **state) {
    (void)state;
    const double deg = BST_DEG_RAD;
    bst_ctx ctx = {0};
    for (int k = 0; k < 4; k++) {
        const double e = (const double[]){0.0, 0.1, 0.7, 0.99}[k];
        for (int i = -700; i <= 700; i += 50) {
            double u = i * deg; /* the eccentric anomaly, so that Kepler's equation is explicit */
            bst_initial_state_config s = open_state(e);
            s.semi_major_axis_m = 2e7;
            s.mean_anomaly_deg = (u - e * sin(u)) / deg;
            bst_assert_ok(&ctx, bst_keplerian_resolve(&ctx, &s));
            /* 1e-15 of rounding over 1 - e */
            bst_assert_close(s.perigee_radius_m, 2e7 * (1.0 - e), 1e-7);
            double off = s.true_anomaly_deg * deg - atan2(sqrt(1.0 - e * e) * sin(u), cos(u) - e);
            bst_assert_close(remainder(off, 2.0 * BST_PI), 0.0, 1e-12);
            /* what is resolved is accepted, and stays */
            bst_initial_state_config again = s;
            bst_assert_ok(&ctx, bst_keplerian_resolve(&ctx, &again));
            assert_memory_equal(&again, &s, sizeof s);
        }
    }
    bst_initial_state_config s = open_state(2.0); /* hyperbola: M = e sinh H - H */
    s.semi_major_axis_m = -1e7;
    s.mean_anomaly_deg = (2.0 * sinh(0.8) - 0.8) / deg;
    bst_assert_ok(&ctx, bst_keplerian_resolve(&ctx, &s));
    bst_assert_close(s.perigee_radius_m, 1e7, 1e-6);
    bst_assert_close(tan(0.5 * s.true_anomaly_deg * deg), sqrt(3.0) * tanh(0.4), 1e-12);
    s = open_state(0.2);
    s.perigee_radius_m = 8e6;
    bst_assert_ok(&ctx, bst_keplerian_resolve(&ctx, &s));
    bst_assert_close(s.semi_major_axis_m, 1e7, 1e-6);
    assert_true(s.true_anomaly_deg == 0.0 && s.mean_anomaly_deg == 0.0);
}

static void element_sets_and_other_objects_start_one_too(void **state) {
    (void)state;
    bst_world *world = test_world_with(
        "{\"name\": \"GX5\", " TEST_GX5 "}, " NUMERICAL
        "\"elements_file\": \"scenarios/catalogue_2022-06.tle\", \"norad\": 44801, \"state\": "
        "{\"source\": \"element_set\", \"at_s\": 500}}}, {\"name\": \"m\", \"orbit\": {\"source\": "
        "\"numerical\", \"reference\": \"GX5\", \"offset_rtn_m\": [10, -200, 30], "
        "\"rate_rtn_mps\": [0.1, 0, 0], \"state\": {\"source\": \"relative\", \"at_s\": -50}}}",
        "");
    assert_int_equal(bst_world_object(world, 1)->norad, 44801);
    bst_world_view *view = view_of(world);
    bst_world_state a = object_at(view, 0, 500), b = object_at(view, 1, 500);
    /* the first is interpolated, to 20 um */
    bst_assert_close(test_distance(a.position_m, b.position_m), 0, 1e-4);
    /* SGP4's own error of velocity (0.1 m/s) and what it leaves out, over an hour */
    bst_assert_close(
        test_distance(object_at(view, 0, 4100).position_m, object_at(view, 1, 4100).position_m), 0,
        1000);
    a = object_at(view, 0, -50);
    b = object_at(view, 2, -50);
    bst_vec3 r = bst_vec3_unit(a.position_m), d = bst_vec3_sub(b.position_m, a.position_m);
    bst_vec3 n = bst_vec3_unit(bst_vec3_cross(a.position_m, a.velocity_mps));
    /* the reference is interpolated, to 20 um */
    bst_assert_close(bst_vec3_dot(d, r), 10, 1e-4);
    bst_assert_close(bst_vec3_dot(d, bst_vec3_cross(n, r)), -200, 1e-4);
    bst_assert_close(bst_vec3_dot(d, n), 30, 1e-4);
    bst_world_view_free(view);
    bst_world_free(world);
}

static void the_cue_leaves_burns_out(void **state) {
    (void)state;
    bst_world *world =
        test_world_with(NUMERICAL KEPLERIAN
                        "}, \"burns\": [{\"time_s\": 200, \"dv_rtn_mps\": [0, 1, 0]}, "
                        "{\"time_s\": 300, \"duration_s\": 60, \"dv_rtn_mps\": [0, 1, 0]}]}",
                        "");
    const bst_world_orbit *orbit = &world->objects[0].orbit;
    bst_ctx ctx = {0};
    for (double t = 0; t < 600; t += 50) {
        bst_world_state with, without;
        bst_assert_ok(&ctx, bst_world_orbit_state(&ctx, orbit, NULL, world->epoch, t, true, &with));
        bst_assert_ok(&ctx,
                      bst_world_orbit_state(&ctx, orbit, NULL, world->epoch, t, false, &without));
        double dv = test_distance(with.velocity_mps, without.velocity_mps);
        double spent = t < 200 ? 0 : 1 + fmin(fmax((t - 300) / 60, 0), 1);
        /* tides of the burnt orbit: n t of it */
        bst_assert_close(dv, spent, t < 200 ? 1e-9 : 0.3);
        assert_true(t < 200 || dv > 0.5 * spent);
    }
    bst_world_free(world);
}

static void refuse(const char *objects, const char *message) {
    bst_ctx ctx = {0};
    bst_world *world;
    char text[4000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [%s]}, \"observers\": "
             "[{\"name\": \"o\", " TEST_NEOSSAT ", \"sensors\": [{" TEST_CAMERA "}]}]}",
             objects);
    assert_int_equal(test_world_try(&ctx, TEST_EPOCH, text, &world), BST_ERR_CONFIG);
    assert_null(world);
    assert_string_equal(ctx.message, message);
}

static void wrong_ones_are_refused(void **state) {
    (void)state;
    refuse(NUMERICAL "\"state\": {}}}",
           "test: /world/objects/0/orbit: the initial state lies at a height of -6378.1 km, orbits "
           "end below 80 km");
    refuse(NUMERICAL "\"state\": {\"source\": \"keplerian\"}}}",
           "test: /world/objects/0/orbit/state: keplerian elements need semi_major_axis_m or "
           "perigee_radius_m");
    refuse(NUMERICAL
           "\"state\": {\"source\": \"keplerian\", \"perigee_radius_m\": 7e6, "
           "\"eccentricity\": 2, \"true_anomaly_deg\": 150}}}",
           "test: /world/objects/0/orbit/state: true_anomaly_deg 150: the hyperbola does not reach "
           "it");
    refuse(NUMERICAL
           "\"state\": {\"source\": \"keplerian\", \"perigee_radius_m\": 7e6, "
           "\"semi_major_axis_m\": 8e6, \"eccentricity\": 0.1}}}",
           "test: /world/objects/0/orbit/state: semi_major_axis_m and eccentricity give a perigee "
           "of 7200000 m, but perigee_radius_m gives 7000000 m; give one of the two");
    refuse(NUMERICAL
           "\"state\": {\"source\": \"keplerian\", \"semi_major_axis_m\": 8e6, "
           "\"true_anomaly_deg\": 0, \"mean_anomaly_deg\": 90}}}",
           "test: /world/objects/0/orbit/state: true_anomaly_deg 0 is a mean anomaly of 0 degrees, "
           "but mean_anomaly_deg gives 90; give one of the two");
    refuse(
        NUMERICAL
        "\"state\": {\"source\": \"keplerian\", \"semi_major_axis_m\": 8e6, "
        "\"true_anomaly_deg\": 30, \"mean_anomaly_deg\": -150}}}",
        "test: /world/objects/0/orbit/state: true_anomaly_deg 30 is a mean anomaly of 30 degrees, "
        "but mean_anomaly_deg gives -150; give one of the two");
    refuse(NUMERICAL
           "\"state\": {\"source\": \"keplerian\", \"semi_major_axis_m\": 8e6, "
           "\"eccentricity\": 1.5}}}",
           "test: /world/objects/0/orbit/state: semi_major_axis_m 8000000 and eccentricity 1.5: no "
           "orbit has them; an ellipse (eccentricity below 1) has an axis above 0, a hyperbola one "
           "below 0, a parabola needs perigee_radius_m");
    refuse(NUMERICAL KEPLERIAN ", \"forces\": {\"degree\": 4, \"order\": 5}}}",
           "test: /world/objects/0/orbit/forces/order: at most the degree, 4 (found 5)");
    refuse(NUMERICAL KEPLERIAN ", \"forces\": {\"degree\": 30, \"order\": 5}}}",
           "test: /world/objects/0/orbit/forces/gravity: built-in gravity field of degree 30, "
           "order 5 (allowed: degree 0 to 20, order 0 to the degree)");
    refuse(NUMERICAL KEPLERIAN ", \"forces\": {\"gravity\": \"nowhere.gfc\"}}}",
           "test: /world/objects/0/orbit/forces/gravity: nowhere.gfc: cannot be opened: No such "
           "file or directory; give a gravity field in the ICGEM format");
    refuse("{\"name\": \"GX5\", " TEST_GX5
           ", \"burns\": [{\"time_s\": 0, \"duration_s\": 5, \"dv_rtn_mps\": [0, 1, 0]}]}",
           "test: /world/objects/0/burns/0/duration_s: a burn that lasts needs an orbit of source "
           "\"numerical\" (found 5; allowed: 0)");
}

/* What the description of the scenario says: the range at its way points. */
static void the_rendezvous_closes_to_200_m(void **state) {
    (void)state;
    static const bst_config_desc table[] = {
        BST_OBJECT(test_scene, world, bst_world_config_table, "{}", "The world."),
        BST_LIST(test_scene, observers, bst_observer_config, bst_observer_config_table, 1, 10, NULL,
                 "Observers."),
        {.key = "boresight", .type = BST_CONFIG_RAW},
        {.key = "name", .type = BST_CONFIG_RAW},
        {.key = "epoch_utc", .type = BST_CONFIG_RAW},
        {.key = "duration_s", .type = BST_CONFIG_RAW},
        {.key = "tick_rate_hz", .type = BST_CONFIG_RAW},
        {.key = "seed", .type = BST_CONFIG_RAW},
        {.key = "record", .type = BST_CONFIG_RAW},
        BST_CONFIG_END};
    bst_ctx ctx = {0};
    bst_json *json;
    test_scene scene;
    bst_time epoch;
    bst_world *world;
    bst_assert_ok(&ctx, bst_json_load(&ctx, "scenarios/rendezvous.json", &json));
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "", table, &scene));
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-10-15T00:00:00Z", &epoch));
    strcpy(scene.world.star_catalogue, "embedded");
    bst_assert_ok(&ctx, bst_world_create(&ctx, "rendezvous.json", &scene.world, &scene.observers,
                                         "scenarios", epoch, &world));
    bst_world_view *view = view_of(world);
    /* time, range and how far off the aim is allowed: linear theory about a circular orbit misses
     * by range^2 / radius and eccentricity times range */
    static const double way[][3] = {
        {0, 50000, 1}, {3660, 5000, 600}, {5160, 1000, 10}, {6090, 200, 2}, {6300, 200, 2}};
    for (size_t i = 0; i < sizeof way / sizeof *way; i++) {
        bst_world_sight sight;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, way[i][0], &sight));
        bst_assert_close(sight.range_m, way[i][1], way[i][2]);
    }
    double last = 5.01e4;
    for (double t = 100; t < 6300; t += 10) {
        bst_world_sight sight;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, t, &sight));
        assert_true(sight.range_m < 1.01 * last); /* it closes all the way, and then stays */
        last = fmin(last, sight.range_m);
        assert_true(sight.range_m > 195);
        assert_false(sight.occulted);
        assert_true(sight.sunlit_fraction == 1);
        bst_assert_close(sight.phase_rad, 90 * BST_DEG_RAD, 2 * BST_DEG_RAD);
    }
    bst_world_view_free(view);
    bst_world_free(world);
    bst_config_free(table, &scene);
    bst_json_free(json);
}

/* An orbit under sunlight and air; `object`: more keys of the object; `forces`: of its forces. */
#define FORCED(name, semi_axis, object, forces)                                              \
    "{\"name\": \"" name "\", " object                                                       \
    "\"orbit\": {\"source\": \"numerical\", \"state\": {"                                    \
    "\"source\": \"keplerian\", \"semi_major_axis_m\": " semi_axis                           \
    ", \"inclination_deg\": 30}, "                                                           \
    "\"forces\": {\"gravity\": \"two_body\", \"sun\": false, \"moon\": false, " forces       \
    "}, \"spacecraft\": {\"mass_kg\": 10, \"drag_area_m2\": 3.14159265358979, \"cd\": 2.2, " \
    "\"srp_area_m2\": 3.14159265358979, \"cr\": 1.2222222222222222}}}"
#define BALL                                                                                    \
    "\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": \"w\", "    \
    "\"diffuse\": 0.5}], \"parts\": [{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 1, " \
    "\"segments\": 48, \"material\": \"w\"}]}, "

/* A Lambertian sphere moves as the sphere of the same area with the coefficient 1 + 4/9 of its
 * reflectance, in sunlight with the Earth's shadow and in air. */
static void a_round_shape_moves_as_a_sphere(void **state) {
    (void)state;
    static const char objects[] = FORCED("free", "2e7", "", "\"solar_pressure\": false, "
                                                            "\"drag\": false") ", "
        FORCED("ball", "2e7", BALL, "\"shape\": true, \"drag\": false") ", "
        FORCED("sphere", "2e7", "", "\"drag\": false") ", "
        FORCED("low", "6.68e6", "", "\"solar_pressure\": false, \"drag\": false") ", "
        FORCED("low ball", "6.68e6", BALL, "\"shape\": true, \"solar_pressure\": false") ", "
        FORCED("low sphere", "6.68e6", "", "\"solar_pressure\": false");
    bst_world *world = test_world_with(objects, "");
    bst_world_view *view = view_of(world);
    static const double span[] = {86400, 6000};
    for (int k = 0; k < 2; k++) {
        bst_vec3 none = object_at(view, 3 * k, span[k]).position_m;
        bst_vec3 ball = object_at(view, 3 * k + 1, span[k]).position_m;
        bst_vec3 sphere = object_at(view, 3 * k + 2, span[k]).position_m;
        double moved = test_distance(none, sphere);
        assert_true(moved > 100);
        /* facets of 7.5 degrees: 0.6 % of the area */
        bst_assert_close(test_distance(ball, sphere), 0, 1e-2 * moved);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

#define PANEL(phases)                                                                          \
    "\"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": [{\"name\": \"b\"}], " \
    "\"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [3, 3, 1], \"material\": " \
    "\"b\"}]}, \"attitude\": [" phases "], "

/* The states of an orbit whose plate loses its attitude do not depend on the order of requests; the
 * plate drags by its area: edge-on not at all. */
static void a_plate_moves_by_its_attitude(void **state) {
    (void)state;
    static const char objects[] = FORCED(
        "turns", "6.68e6", PANEL("{\"law\": \"velocity\", \"rotation_deg\": [0, 90, 0]}, {\"from_s\": "
                                 "900, \"law\": \"spin\", \"rate_body_deg_per_s\": [0.3, 0.1, 0]}"),
        "\"shape\": true, \"solar_pressure\": false") ", "
        FORCED("edge", "6.68e6", PANEL("{\"law\": \"velocity\"}"),
               "\"shape\": true, \"solar_pressure\": false") ", "
        FORCED("none", "6.68e6", "", "\"solar_pressure\": false, \"drag\": false");
    bst_world *world = test_world_with(objects, ""), *other = test_world_with(objects, "");
    bst_world_view *view = view_of(world), *back = view_of(other);
    bst_world_state forth[6];
    for (int i = 0; i < 6; i++) {
        forth[i] = object_at(view, 0, 500.0 * i);
    }
    for (int i = 5; i >= 0; i--) {
        bst_world_state s = object_at(back, 0, 500.0 * i);
        assert_memory_equal(&s, &forth[i], sizeof s);
    }
    bst_vec3 none = object_at(view, 2, 2500).position_m;
    /* the axis x is along the orbit in GCRF, the air turns with the Earth: an angle of 3 degrees */
    double edge = test_distance(object_at(view, 1, 2500).position_m, none);
    double turned = test_distance(forth[5].position_m, none);
    assert_true(turned > 200);
    assert_true(edge < 0.07 * turned);
    bst_world_view_free(view);
    bst_world_view_free(back);
    bst_world_free(world);
    bst_world_free(other);
}

static void forces_without_a_shape_are_refused(void **state) {
    (void)state;
    static const char *const wrong[][2] = {
        {FORCED("n", "7e6", "", "\"shape\": true"), "/world/objects/0/orbit/forces/shape"},
        {FORCED("n", "7e6", "\"external_states\": true, " BALL, "\"shape\": true"),
         "/world/objects/0/orbit/forces/shape"},
        {FORCED("n", "7e6", PANEL("{\"from_s\": -5}, {\"from_s\": 0, \"law\": \"spin\"}"),
                "\"shape\": true"),
         "/world/objects/0/attitude: 1/quaternion: missing"}};
    for (int i = 0; i < 3; i++) {
        bst_ctx ctx = {0};
        bst_world *world;
        char text[2500];
        snprintf(
            text, sizeof text,
            "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [%s]}, \"observers\": "
            "[{\"name\": \"a\", " TEST_NEOSSAT ", \"sensors\": [{\"name\": \"x\", " TEST_CAMERA
            "}]}]}",
            wrong[i][0]);
        assert_int_equal(test_world_try(&ctx, TEST_EPOCH, text, &world), BST_ERR_CONFIG);
        if (!strstr(ctx.message, wrong[i][1])) {
            fail_msg("%s: no \"%s\"", ctx.message, wrong[i][1]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_round_shape_moves_as_a_sphere),
        cmocka_unit_test(a_plate_moves_by_its_attitude),
        cmocka_unit_test(forces_without_a_shape_are_refused),
        cmocka_unit_test(keplerian_elements_give_the_orbit),
        cmocka_unit_test(a_cartesian_state_gives_the_orbit),
        cmocka_unit_test(axis_and_mean_anomaly),
        cmocka_unit_test(element_sets_and_other_objects_start_one_too),
        cmocka_unit_test(the_cue_leaves_burns_out),
        cmocka_unit_test(wrong_ones_are_refused),
        cmocka_unit_test(the_rendezvous_closes_to_200_m),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
