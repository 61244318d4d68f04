/* Mean elements from places, and osculating elements from a state. */
#include <stdlib.h>

#include "sim/astro/sgp4_fit.h"
#include "tests/test_support.h"

/* Places that SGP4 itself makes of real element sets give those elements back. */
static void elements_come_back(void **state) {
    (void)state;
    static const int numbers[] = {39089, 44801}; /* NEOSSat; a geostationary one */
    for (int n = 0; n < 2; n++) {
        bst_ctx ctx = {0};
        const bst_elements_options only = {.norad = numbers[n]};
        bst_elements *set, got;
        int count;
        bst_assert_ok(
            &ctx, bst_elements_load(&ctx, "scenarios/catalogue_2022-06.tle", &only, &set, &count));
        bst_sgp4 *sgp4;
        bst_assert_ok(&ctx, bst_sgp4_create(&ctx, set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
        enum { PLACES = 60 };
        bst_sgp4_place places[PLACES];
        double r[3], v[3];
        for (int i = 0; i < PLACES; i++) {
            places[i].minutes = (n ? 24.0 : 2.0) * (i - PLACES / 2);
            assert_int_equal(bst_sgp4_propagate(sgp4, places[i].minutes, r, v), BST_SGP4_OK);
            places[i].position_teme_m = (bst_vec3){1e3 * r[0], 1e3 * r[1], 1e3 * r[2]};
        }
        assert_int_equal(bst_sgp4_propagate(sgp4, 0.0, r, v), BST_SGP4_OK);
        got = *set;
        got.mean_motion_radpmin = got.eccentricity = got.mean_anomaly_rad = NAN;
        got.inclination_rad = got.raan_rad = got.arg_perigee_rad = NAN;
        double rms_m;
        bst_assert_ok(
            &ctx, bst_sgp4_fit(&ctx, places, PLACES, (bst_vec3){1e3 * r[0], 1e3 * r[1], 1e3 * r[2]},
                               (bst_vec3){1e3 * v[0], 1e3 * v[1], 1e3 * v[2]}, &got, &rms_m));
        print_message("%d: %.3g m rms\n", numbers[n], rms_m);
        /* the iteration ends at a gain of 1e-10 of the sum; SGP4's own rounding is 1e-6 m */
        assert_true(rms_m < 0.01);
        /* 0.01 m of 7,000 km and of 42,000 km over the span */
        bst_assert_close(got.mean_motion_radpmin, set->mean_motion_radpmin, 1e-11);
        bst_assert_close(got.eccentricity, set->eccentricity, 1e-8);
        bst_assert_close(got.inclination_rad, set->inclination_rad, 1e-8);
        double longitude = got.raan_rad + got.arg_perigee_rad + got.mean_anomaly_rad -
                           set->raan_rad - set->arg_perigee_rad - set->mean_anomaly_rad;
        bst_assert_close(remainder(longitude, 2.0 * BST_PI), 0.0, 1e-8);
        bst_sgp4_free(sgp4);
        /* places that jump by 50 m: what they miss the fitted orbit by, in space */
        for (int i = 0; i < PLACES; i++) {
            places[i].position_teme_m.x += i % 2 ? 30.0 : -30.0;
            places[i].position_teme_m.z += i % 2 ? -40.0 : 40.0;
        }
        bst_assert_ok(
            &ctx, bst_sgp4_fit(&ctx, places, PLACES, (bst_vec3){1e3 * r[0], 1e3 * r[1], 1e3 * r[2]},
                               (bst_vec3){1e3 * v[0], 1e3 * v[1], 1e3 * v[2]}, &got, &rms_m));
        bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &got, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4));
        double square = 0.0;
        for (int i = 0; i < PLACES; i++) {
            assert_int_equal(bst_sgp4_propagate(sgp4, places[i].minutes, r, v), BST_SGP4_OK);
            const bst_vec3 *p = &places[i].position_teme_m;
            square += pow(1e3 * r[0] - p->x, 2.0) + pow(1e3 * r[1] - p->y, 2.0) +
                      pow(1e3 * r[2] - p->z, 2.0);
        }
        bst_assert_close(rms_m, sqrt(square / PLACES), 1e-3);
        bst_assert_close(rms_m, 50.0, 2.0);
        bst_sgp4_free(sgp4);
        free(set);
    }
}

/* Through the state of each of some hundreds of real objects goes an SGP4 orbit, which is theirs:
 * places half a revolution later agree. Only within 0.1 degree of the equator in deep space, where
 * the theory has two orbits through some states, it may be the other one. */
static void an_orbit_through_a_state(void **state) {
    (void)state;
    enum { EVERY = 12 };
    bst_ctx ctx = {0};
    bst_elements *sets;
    int count, tried = 0, others = 0;
    bst_assert_ok(&ctx,
                  bst_elements_load(&ctx, "scenarios/objects_2022-06.tle", NULL, &sets, &count));
    for (int i = 0; i < count; i += EVERY) {
        bst_sgp4 *given, *found;
        bst_vec3 r, v, moved_r, moved_v;
        bst_assert_ok(&ctx,
                      bst_sgp4_create(&ctx, &sets[i], BST_SGP4_WGS72, BST_SGP4_IMPROVED, &given));
        assert_true(bst_sgp4_motion(given, 0.0, &r, &v));
        bst_elements got = sets[i];
        got.mean_motion_radpmin = got.eccentricity = got.mean_anomaly_rad = NAN;
        got.inclination_rad = got.raan_rad = got.arg_perigee_rad = NAN;
        if (bst_sgp4_through(&ctx, r, v, &got) != BST_OK) {
            fail_msg("%s: %s", sets[i].name, ctx.message);
        }
        bst_assert_ok(&ctx, bst_sgp4_create(&ctx, &got, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &found));
        double half = BST_PI / sets[i].mean_motion_radpmin;
        assert_true(bst_sgp4_motion(given, half, &r, &v));
        assert_true(bst_sgp4_motion(found, half, &moved_r, &moved_v));
        /* 1 mm and 1 mm per orbit at the epoch grow with the orbit to some centimetres */
        double away = bst_vec3_norm(bst_vec3_sub(moved_r, r));
        bool twofold = sets[i].inclination_rad < 0.1 * BST_DEG_RAD && half > 600.0;
        /* SGP4 leaves out a term of drag below this */
        twofold = twofold || fabs(sets[i].eccentricity - 1e-4) < 1e-6;
        others += away >= 0.1;
        if (!(away < 0.1) && !twofold) {
            fail_msg("%s: %g m away", sets[i].name, away);
        }
        bst_sgp4_free(given);
        bst_sgp4_free(found);
        tried++;
    }
    print_message("%d objects, another orbit for %d\n", tried, others);
    assert_true(others <= tried / 50);
    free(sets);
}

static void what_is_no_ellipse_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_elements out = {.epoch_utc_jd1 = 2459746.5};
    bst_sgp4_place places[8] = {{0}};
    double rms_m;
    assert_int_equal(
        bst_sgp4_fit(&ctx, places, 8, (bst_vec3){7e6, 0, 0}, (bst_vec3){0, 11e3, 0}, &out, &rms_m),
        BST_ERR_NUMERIC);
    assert_int_equal(
        bst_sgp4_fit(&ctx, places, 5, (bst_vec3){7e6, 0, 0}, (bst_vec3){0, 7e3, 1e3}, &out, &rms_m),
        BST_ERR_ARGUMENT);
    /* exactly backwards along the equator: the inclination vector has no place for it */
    assert_int_equal(
        bst_sgp4_fit(&ctx, places, 8, (bst_vec3){7e6, 0, 0}, (bst_vec3){0, -7e3, 0}, &out, &rms_m),
        BST_ERR_NUMERIC);
}

/* Vallado, Fundamentals of Astrodynamics and Applications, example 2-5. */
static void osculating_elements(void **state) {
    (void)state;
    bst_astro_kepler_elements k =
        bst_astro_kepler_elements_of(3.986004418e14, (bst_vec3){6524.834e3, 6862.875e3, 6448.296e3},
                                     (bst_vec3){4901.327, 5533.756, -1976.341});
    bst_assert_close(k.semi_major_axis_m, 36127.343e3, 20.0); /* from places to 1 m */
    bst_assert_close(k.eccentricity, 0.832853, 1e-6);         /* printed so */
    bst_assert_close(k.inclination_rad / BST_DEG_RAD, 87.870, 1e-3);
    bst_assert_close(k.raan_rad / BST_DEG_RAD, 227.898, 1e-3);
    bst_assert_close(k.arg_perigee_rad / BST_DEG_RAD, 53.38, 1e-2);
    /* true anomaly 92.335: tan(E/2) = sqrt((1-e)/(1+e)) tan(nu/2), M = E - e sin E */
    bst_assert_close(k.mean_anomaly_rad / BST_DEG_RAD, 7.605, 2e-3);
    k = bst_astro_kepler_elements_of(3.986004418e14, (bst_vec3){7e6, 0, 0}, (bst_vec3){0, 12e3, 0});
    assert_true(k.semi_major_axis_m < 0.0 && k.eccentricity > 1.0);
    bst_assert_close(k.mean_anomaly_rad, 0.0, 1e-15); /* at the pericentre */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(elements_come_back),
        cmocka_unit_test(an_orbit_through_a_state),
        cmocka_unit_test(what_is_no_ellipse_is_refused),
        cmocka_unit_test(osculating_elements),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
