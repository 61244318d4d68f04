/* The geostationary belt against astropy: ITRS at 27 deg east, 1.5 deg north, 42164172 m
 * transformed to GCRS at 2022-06-16T22:10:00 UTC, and differences over a few seconds of the same.
 */
#include "sim/astro/belt.h"
#include "tests/test_support.h"

static const bst_vec3 place = {-4132827.36, -41946362.43, 1113470.97};

static void close3(bst_vec3 a, bst_vec3 b, double tolerance) {
    assert_true(bst_vec3_norm(bst_vec3_sub(a, b)) <= tolerance);
}

static void earth_at(bst_astro_earth_frames *out) {
    bst_ctx ctx = {0};
    bst_astro_eop *eop;
    bst_time t;
    bst_assert_ok(&ctx, bst_astro_eop_builtin(&ctx, &eop));
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &t));
    bst_assert_ok(&ctx, bst_astro_earth_frames_at(&ctx, eop, t, out));
    bst_astro_eop_free(eop);
}

static void a_place_is_where_astropy_has_it(void **state) {
    (void)state;
    bst_astro_earth_frames earth;
    earth_at(&earth);
    /* 0.2 ms of UT1 between two tables of it are 0.6 m at the belt; the pole's offsets 0.1 m */
    close3(bst_belt_place(27.0 * BST_DEG_RAD, 1.5 * BST_DEG_RAD, &earth.itrf_from_gcrf), place,
           2.0);
}

static void what_stands_still_over_the_earth_moves_so(void **state) {
    (void)state;
    bst_astro_earth_frames earth;
    earth_at(&earth);
    bst_belt_eye eye = {.position_m = {1.2e6, -6.9e6, 8e5},
                        .velocity_mps = {-1000.0, 200.0, 7400.0},
                        .earth_radps = bst_astro_earth_rate_gcrf(&earth)};
    bst_vec3 direction = bst_vec3_unit(bst_vec3_sub(place, eye.position_m)), rate;
    double range_m, range_rate_mps;
    assert_true(bst_belt_motion(&eye, direction, &rate, &range_m, &range_rate_mps));
    /* differences over 2 s of a direction that turns at w = 2.4e-4 rad/s: w (w t)^2 / 3 = 5e-12 */
    close3(rate, (bst_vec3){1.13724366e-4, -1.91731698e-5, -2.08878848e-4}, 1e-11);
    bst_assert_close(range_m, 35451161.209, 2.0); /* the place's own metre */
    bst_assert_close(range_rate_mps, -180.224, 1e-2);
}

static void other_directions(void **state) {
    (void)state;
    bst_belt_eye eye = {.position_m = {7e6, 0, 0}, .earth_radps = {0, 0, 7.2921e-5}};
    bst_vec3 rate;
    double range_m, range_rate_mps;
    /* through the Earth's centre, the belt's other side: the sum of both distances */
    assert_true(bst_belt_motion(&eye, (bst_vec3){-1, 0, 0}, &rate, &range_m, &range_rate_mps));
    bst_assert_close(range_m, BST_BELT_RADIUS_M + 7e6, 1e-6);
    /* from outside, away from it: never */
    eye.position_m.x = 5e7;
    assert_false(bst_belt_motion(&eye, (bst_vec3){1, 0, 0}, &rate, &range_m, &range_rate_mps));
    assert_false(bst_belt_motion(&eye, (bst_vec3){0, 1, 0}, &rate, &range_m, &range_rate_mps));
    /* towards it: the farther of two places */
    assert_true(bst_belt_motion(&eye, (bst_vec3){-1, 0, 0}, &rate, &range_m, &range_rate_mps));
    bst_assert_close(range_m, BST_BELT_RADIUS_M + 5e7, 1e-6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_place_is_where_astropy_has_it),
        cmocka_unit_test(what_stands_still_over_the_earth_moves_so),
        cmocka_unit_test(other_directions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
