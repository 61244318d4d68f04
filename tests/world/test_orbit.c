/* Where things are: catalogued orbits, relative orbits, burns. */
#include "sim/astro/sgp4.h"
#include "sim/astro/tle.h"
#include "tests/world/world_support.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"

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

/* Velocity by five-point differences of the position, step h. */
static bst_vec3 velocity_by_difference(bst_world_view *view, int object, double t, double h) {
    bst_vec3 d1 = bst_vec3_sub(object_at(view, object, t + h).position_m,
                               object_at(view, object, t - h).position_m);
    bst_vec3 d2 = bst_vec3_sub(object_at(view, object, t + 2 * h).position_m,
                               object_at(view, object, t - 2 * h).position_m);
    return bst_vec3_scale(bst_vec3_axpy(bst_vec3_scale(d1, 8.0), -1.0, d2), 1.0 / (12.0 * h));
}

static void rtn_of(bst_world_state s, bst_vec3 *r, bst_vec3 *t, bst_vec3 *n) {
    *r = bst_vec3_unit(s.position_m);
    *n = bst_vec3_unit(bst_vec3_cross(s.position_m, s.velocity_mps));
    *t = bst_vec3_cross(*n, *r);
}

static void a_relative_orbit_keeps_its_offset(void **state) {
    (void)state;
    bst_world *world = test_world_with(
        GX5
        ", {\"name\": \"near\", \"orbit\": {\"source\": \"relative\", \"reference\": \"GX5\", "
        "\"at_s\": 100, \"offset_rtn_m\": [1000, -2000, 3000], \"rate_rtn_mps\": [1, 2, -3]}}"
        ", {\"name\": \"nearer\", \"orbit\": {\"source\": \"relative\", \"reference\": "
        "\"near\", \"offset_rtn_m\": [0, 50, 0]}}",
        "");
    bst_world_view *view = view_of(world);
    for (double t = -500; t <= 5000; t += 500) {
        bst_world_state ref = object_at(view, 0, t), near = object_at(view, 1, t);
        bst_vec3 r, s, n, d = bst_vec3_sub(near.position_m, ref.position_m);
        rtn_of(ref, &r, &s, &n);
        /* 1e-5: the reference is interpolated, the other is not */
        bst_assert_close(bst_vec3_dot(d, r), 1000 + (t - 100), 1e-5);
        bst_assert_close(bst_vec3_dot(d, s), -2000 + 2 * (t - 100), 1e-5);
        bst_assert_close(bst_vec3_dot(d, n), 3000 - 3 * (t - 100), 1e-5);
        /* SGP4's velocity is not the derivative of its position to better than some 10 mm/s; the
         * difference of the two orbits' is */
        bst_vec3 v = bst_vec3_sub(velocity_by_difference(view, 1, t, 2.0),
                                  velocity_by_difference(view, 0, t, 2.0));
        bst_vec3 dv = bst_vec3_sub(near.velocity_mps, ref.velocity_mps);
        /* that same inconsistency turns the axes by 2.5e-10 rad/s, at 2e4 m */
        bst_assert_close(test_distance(v, dv), 0, 3e-5);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

/* Elements from before a leap second: as SGP4 is run elsewhere, days of UTC count as uniform. */
static void leap_seconds_since_the_elements_do_not_count(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const char file[] = "tests/world/data/before_leap.tle";
    bst_world *world = test_world_with(
        "{\"name\": \"old\", \"orbit\": {\"elements_file\": "
        "\"tests/world/data/before_leap.tle\", \"norad\": 39089}}",
        "");
    bst_world_view *view = view_of(world);
    bst_elements *sets;
    int count;
    bst_sgp4 *sgp4;
    bst_astro_eop *eop;
    bst_astro_earth_frames frames;
    bst_time epoch;
    double jd1, jd2, r[3], v[3];
    bst_assert_ok(&ctx, bst_elements_load(&ctx, file, NULL, &sets, &count));
    bst_assert_ok(&ctx, bst_sgp4_create(&ctx, sets, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, TEST_EPOCH, &epoch));
    bst_time_utc(epoch, &jd1, &jd2);
    double minutes = (jd1 - sets->epoch_utc_jd1) * 1440.0 + (jd2 - sets->epoch_utc_jd2) * 1440.0;
    assert_int_equal(bst_sgp4_propagate(sgp4, minutes, r, v), BST_SGP4_OK);
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, epoch, &frames));
    bst_vec3 place =
        bst_mat3_mul_vec(&frames.gcrf_from_teme, (bst_vec3){1e3 * r[0], 1e3 * r[1], 1e3 * r[2]});
    /* a second is 7.5 km; the world interpolates to 1e-5 m, of minutes in double 1e-6 s is left */
    bst_assert_close(test_distance(object_at(view, 0, 0.0).position_m, place), 0.0, 0.05);
    bst_astro_eop_free(eop);
    bst_sgp4_free(sgp4);
    free(sets);
    bst_world_view_free(view);
    bst_world_free(world);
}

#define BURNT(burns_) GX5 ", {\"name\": \"B\", " TEST_GX5 ", \"burns\": [" burns_ "]}"

/* A burn dv seen from the unburnt orbit, soon after: Hill's equations (Clohessy and Wiltshire
 * 1960), n: mean motion. */
static bst_vec3 hill(bst_vec3 dv, double n, double t) {
    double s = sin(n * t), c = cos(n * t);
    return (bst_vec3){dv.x * s / n + dv.y * 2 / n * (1 - c),
                      -dv.x * 2 / n * (1 - c) + dv.y * (4 * s / n - 3 * t), dv.z * s / n};
}

static void a_burn_moves_the_object_as_theory_says(void **state) {
    (void)state;
    const char *burns[3] = {"10, 0, 0", "0, 10, 0", "0, 0, 10"};
    const bst_vec3 dv[3] = {{10, 0, 0}, {0, 10, 0}, {0, 0, 10}};
    for (int axis = 0; axis < 3; axis++) {
        char text[600];
        snprintf(text, sizeof text, BURNT("{\"time_s\": 100, \"dv_rtn_mps\": [%s]}"), burns[axis]);
        bst_world *world = test_world_with(text, "");
        bst_world_view *view = view_of(world);
        /* before: the catalogued orbit, of which one is interpolated */
        for (double t = -100; t < 100; t += 49.99) {
            assert_true(test_distance(object_at(view, 0, t).position_m,
                                      object_at(view, 1, t).position_m) < 1e-5);
        }
        /* at the burn: same place, velocity changed by 10 m/s along that axis of the orbit */
        bst_world_state base = object_at(view, 0, 100), after = object_at(view, 1, 100);
        bst_vec3 rtn[3];
        rtn_of(base, &rtn[0], &rtn[1], &rtn[2]);
        bst_assert_close(test_distance(base.position_m, after.position_m), 0, 1e-5);
        bst_vec3 change = bst_vec3_sub(after.velocity_mps, base.velocity_mps);
        bst_assert_close(test_distance(change, bst_vec3_scale(rtn[axis], 10)), 0, 1e-10);
        const double n = sqrt(BST_EARTH_MU_M3PS2 / pow(bst_vec3_norm(base.position_m), 3));
        for (double t = 1; t < 3000; t *= 3) {
            bst_world_state a = object_at(view, 0, 100 + t), b = object_at(view, 1, 100 + t);
            bst_vec3 r, s, w, d = bst_vec3_sub(b.position_m, a.position_m);
            rtn_of(a, &r, &s, &w);
            bst_vec3 h = hill(dv[axis], n, t);
            /* linear theory of a circular orbit (e = 2e-4): off by that share, and by the
             * separation over the radius; rounding 1e-7 */
            double tolerance = 1e-6 + 10 * t * (1e-3 + 10 * t / 4.2e7);
            bst_assert_close(bst_vec3_dot(d, r), h.x, tolerance);
            bst_assert_close(bst_vec3_dot(d, s), h.y, tolerance);
            bst_assert_close(bst_vec3_dot(d, w), h.z, tolerance);
        }
        /* velocity is the position's derivative, but for what SGP4 itself leaves */
        bst_vec3 dv_difference = bst_vec3_sub(velocity_by_difference(view, 1, 3000, 5),
                                              velocity_by_difference(view, 0, 3000, 5));
        bst_vec3 dv_state = bst_vec3_sub(object_at(view, 1, 3000).velocity_mps,
                                         object_at(view, 0, 3000).velocity_mps);
        /* rounding: 1.5 x 1e-8 m / 5 s, from positions of 4e7 m */
        bst_assert_close(test_distance(dv_difference, dv_state), 0, 1e-7);
        bst_world_view_free(view);
        bst_world_free(world);
    }
}

/* A transverse burn of 10 m/s raises the semi-major axis by 2 a dv / v: the object is back, one
 * period of its new orbit later, where the burn was. */
static void a_burnt_orbit_has_the_period_of_its_energy(void **state) {
    (void)state;
    bst_world *world = test_world_with(BURNT("{\"time_s\": 0, \"dv_rtn_mps\": [0, 10, 0]}"), "");
    bst_world_view *view = view_of(world);
    bst_world_state before = object_at(view, 0, 0), s = object_at(view, 1, 0);
    double alpha0 = 2 / bst_vec3_norm(before.position_m) -
                    bst_vec3_dot(before.velocity_mps, before.velocity_mps) / BST_EARTH_MU_M3PS2;
    double alpha = 2 / bst_vec3_norm(s.position_m) -
                   bst_vec3_dot(s.velocity_mps, s.velocity_mps) / BST_EARTH_MU_M3PS2;
    double period0 = 2 * BST_PI / sqrt(BST_EARTH_MU_M3PS2 * pow(alpha0, 3));
    double period = 2 * BST_PI / sqrt(BST_EARTH_MU_M3PS2 * pow(alpha, 3));
    assert_true(period - period0 > 800 && period - period0 < 860); /* 3 x 10 / 3075 x 86164 = 841 */
    /* the deviation after one new period: two-body motion of the burnt orbit is back, that of the
     * unburnt one is period - period0 ahead */
    bst_world_state a = object_at(view, 0, period), b = object_at(view, 1, period);
    double lag = test_distance(a.position_m, b.position_m);
    double ahead =
        2 * bst_vec3_norm(before.position_m) * sin(0.5 * (period - period0) * 2 * BST_PI / period0);
    bst_assert_close(lag / ahead, 1, 1e-3); /* eccentricity 2e-4 of the unburnt orbit */
    bst_world_view_free(view);
    bst_world_free(world);
}

/* Two burns: the second acts on the orbit that the first made; with opposite burns close together
 * little remains. */
static void burns_add_up(void **state) {
    (void)state;
    bst_world *world =
        test_world_with(BURNT("{\"time_s\": 100, \"dv_rtn_mps\": [0, 10, 0]}, {\"time_s\": 101, "
                              "\"dv_rtn_mps\": [0, -10, 0]}"),
                        "");
    bst_world_view *view = view_of(world);
    bst_assert_close(
        test_distance(object_at(view, 0, 100.5).position_m, object_at(view, 1, 100.5).position_m),
        5, 1e-3);
    bst_assert_close(
        test_distance(object_at(view, 0, 101).position_m, object_at(view, 1, 101).position_m), 10,
        2e-3);
    /* continuous through the second burn */
    bst_assert_close(test_distance(object_at(view, 1, 101 - 1e-6).position_m,
                                   object_at(view, 1, 101 + 1e-6).position_m),
                     2e-6 * 3075, 1e-5);
    /* afterwards 10 m away, drifting by little */
    bst_assert_close(
        test_distance(object_at(view, 0, 400).position_m, object_at(view, 1, 400).position_m), 10,
        0.5);
    bst_world_view_free(view);
    bst_world_free(world);
    bst_ctx ctx = {0};
    assert_int_equal(
        test_world_try(
            &ctx, TEST_EPOCH,
            "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" BURNT(
                "{\"time_s\": 100, \"dv_rtn_mps\": [0, 1, 0]}, {\"time_s\": 99, "
                "\"dv_rtn_mps\": [0, 1, 0]}") "]}, \"observers\": [{\"name\": \"n\", " TEST_NEOSSAT
                                              ", \"sensors\": [{" TEST_CAMERA "}]}]}",
            &world),
        BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "test: /world/objects/1/burns/1/time_s: burns must be in the order of time "
                        "(found 99 after 100)");
}

#define GX5_1 "1 44801U 19080B   22167.00079919  .00000075  00000+0  00000+0 0  9998"
#define GX5_2 "2 44801   0.0366 343.6423 0001933 100.2390 191.6441  1.00270919  9442"

/* Two lines in the scenario are the same set as in its file, to the last bit. */
static void lines_are_as_good_as_a_file(void **state) {
    (void)state;
    bst_world *world =
        test_world_with(GX5 ", {\"name\": \"lines\", \"orbit\": {\"tle_line1\": \"" GX5_1
                            "\", \"tle_line2\": \"" GX5_2 "\"}}",
                        "");
    bst_world_view *view = view_of(world);
    assert_int_equal(bst_world_object(world, 1)->norad, 44801);
    for (double t = 0.0; t < 3600.0; t += 600.0) {
        bst_world_state file = object_at(view, 0, t), lines = object_at(view, 1, t);
        assert_memory_equal(&file, &lines, sizeof file);
    }
    bst_world_view_free(view);
    bst_world_free(world);
}

static void refuse(const char *epoch, const char *objects, const char *sensor,
                   const char *message) {
    bst_ctx ctx = {0};
    bst_world *world;
    char text[4000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [%s]}, \"observers\": "
             "[{\"name\": \"n\", " TEST_NEOSSAT ", \"sensors\": [{" TEST_CAMERA "%s}]}]}",
             objects, sensor);
    assert_int_not_equal(test_world_try(&ctx, epoch, text, &world), BST_OK);
    assert_null(world);
    if (strncmp(ctx.message, message, strlen(message)) != 0) {
        assert_string_equal(ctx.message, message);
    }
}

static void wrong_worlds_are_refused(void **state) {
    (void)state;
    refuse(TEST_EPOCH, GX5 ", " GX5, "",
           "test: /world/objects/1/name: \"GX5\" is the name of /world/objects/0 too");
    refuse(TEST_EPOCH, "{\"name\": \"a\", \"orbit\": {}}", "",
           "test: /world/objects/0/orbit: source \"sgp4\" needs either \"elements_file\" and "
           "\"norad\", or \"tle_line1\" and \"tle_line2\"");
    refuse(TEST_EPOCH,
           "{\"name\": \"a\", \"orbit\": {\"norad\": 44801, \"tle_line1\": \"" GX5_1
           "\", \"tle_line2\": \"" GX5_2 "\"}}",
           "",
           "test: /world/objects/0/orbit: source \"sgp4\" needs either \"elements_file\" and "
           "\"norad\", or \"tle_line1\" and \"tle_line2\"; both are given");
    refuse(TEST_EPOCH, "{\"name\": \"a\", \"orbit\": {\"tle_line1\": \"" GX5_1 "\"}}", "",
           "test: /world/objects/0/orbit: line 2");
    refuse(TEST_EPOCH,
           "{\"name\": \"a\", \"orbit\": {\"elements_file\": \"nowhere.tle\", \"norad\": 5}}", "",
           "test: /world/objects/0/orbit/elements_file: nowhere.tle");
    refuse(TEST_EPOCH,
           "{\"name\": \"a\", \"orbit\": {\"elements_file\": \"scenarios/catalogue_2022-06.tle\", "
           "\"norad\": 5}}",
           "", "test: /world/objects/0/orbit/elements_file: scenarios/catalogue_2022-06.tle");
    refuse(TEST_EPOCH,
           "{\"name\": \"a\", \"orbit\": {\"source\": \"relative\", \"reference\": \"GX5\"}}, " GX5,
           "",
           "test: /world/objects/0/orbit/reference: no object \"GX5\" before this one in "
           "/world/objects");
    refuse(TEST_EPOCH, GX5, ", \"cue\": {\"object\": \"GX6\"}",
           "test: /observers/0/sensors/0/cue/object: there is no object \"GX6\" in /world/objects");
    refuse("1999-01-01T00:00:00Z", GX5, "", "test: /epoch_utc: ");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_relative_orbit_keeps_its_offset),
        cmocka_unit_test(leap_seconds_since_the_elements_do_not_count),
        cmocka_unit_test(a_burn_moves_the_object_as_theory_says),
        cmocka_unit_test(a_burnt_orbit_has_the_period_of_its_energy),
        cmocka_unit_test(burns_add_up),
        cmocka_unit_test(lines_are_as_good_as_a_file),
        cmocka_unit_test(wrong_worlds_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
