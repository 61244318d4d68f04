/* Orbits of new objects: elements and covariance from a state, differences of orbits. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/rng.h"
#include "sim/astro/sgp4_fit.h"
#include "tests/test_support.h"
#include "tracker/orbit/custody.h"

#define CATALOGUE "scenarios/objects_2022-06.tle"

/* Root of a covariance with correlations: 300 m and 0.05 m/s. */
static void make_covariance(double root[6][6], double covariance[6][6]) {
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            const double share = i == k ? 1.0 : 0.3 * (i - k);
            root[i][k] = k <= i ? (i < 3 ? 300.0 : 0.05) * share : 0.0;
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            covariance[i][k] = 0.0;
            for (int m = 0; m < 6; m++) {
                covariance[i][k] += root[i][m] * root[k][m];
            }
        }
    }
}

/* Started on states with errors drawn from their covariance, orbits differ from the true ones as
 * their covariances say, at the state's time and hours later; near the equator too. */
static void errors_agree_with_covariances(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_elements *sets = NULL;
    int count = 0, used = 0, flat = 0;
    const bst_elements_options options = {.skip_bad_sets = true};
    const double none[BST_CUSTODY_STATE] = {0.0}, at_s = 7000.0, later_s = 30000.0;
    bst_assert_ok(&ctx, bst_elements_load(&ctx, CATALOGUE, &options, &sets, &count));
    bst_rng_key key = bst_rng_make_key(11, 0, "test", "custody_start");
    double root[6][6], covariance[6][6], now = 0.0, later = 0.0;
    make_covariance(root, covariance);
    for (int i = 5; i < count; i += 23) {
        bst_elements set = sets[i];
        bst_custody_orbit truth, orbit;
        bst_custody_filter filter, d[2];
        bst_vec3 r, v, r_later, v_later;
        double e[6] = {0.0};
        set.bstar = 0.0; /* a new orbit has no drag */
        bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, 0.0, 0.0, &truth));
        if (!bst_custody_state(&truth, none, at_s, &r, &v) ||
            !bst_custody_state(&truth, none, later_s, &r_later, &v_later)) {
            continue;
        }
        for (int k = 0; k < 6; k++) {
            for (int m = 0; m < 6; m++) {
                e[k] += root[k][m] * bst_rng_normal(key, (uint64_t)i, (uint64_t)m);
            }
        }
        bst_custody_fix fix = {
            .time_s = at_s,
            .epoch_utc_jd = {set.epoch_utc_jd1, set.epoch_utc_jd2 + at_s / BST_DAY_S},
            .position_m = bst_vec3_add(r, (bst_vec3){e[0], e[1], e[2]}),
            .velocity_mps = bst_vec3_add(v, (bst_vec3){e[3], e[4], e[5]})};
        memcpy(fix.covariance, covariance, sizeof covariance);
        if (!bst_custody_start(&fix, 0.5, &orbit, &filter) ||
            !bst_custody_difference(&orbit, &filter, at_s, r, v, &d[0]) ||
            !bst_custody_difference(&orbit, &filter, later_s, r_later, v_later, &d[1])) {
            continue;
        }
        bst_assert_close(orbit.photocentre_m, 0.5, 0.0);
        used++;
        flat += bst_custody_osculates(&set);
        now += bst_custody_nees(&d[0]);
        later += bst_custody_nees(&d[1]);
    }
    free(sets);
    print_message("%d objects, %d by osculating elements: NEES %.2f, later %.2f\n", used, flat,
                  now / used, later / used);
    assert_true(used > 200 && flat > 10);
    /* means of chi-squares of 6 degrees of freedom, within 4 standard deviations */
    const double reach = 4.0 * sqrt(12.0 / used);
    assert_true(fabs(now / used - 6.0) < reach && fabs(later / used - 6.0) < reach);
}

/* Unknown drag makes low orbits uncertain: as B* does in a day; deep-space orbits hardly. */
static void drag_is_noise(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    double noise[2];
    for (int k = 0; k < 2; k++) {
        const bst_elements set = {
            .epoch_utc_jd1 = 2459746.5,
            .inclination_rad = 0.9,
            .eccentricity = 0.001,
            .mean_motion_radpmin = 2.0 * BST_PI / 1440.0 * (k ? 1.0027 : 15.2)};
        bst_custody_orbit orbit;
        bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &set, -5000.0, 0.5, &orbit));
        noise[k] = bst_custody_drag_noise_m_per_day(&orbit);
    }
    print_message("noise at 500 km and near the geostationary ring: %.0f, %.2f m a day\n", noise[0],
                  noise[1]);
    assert_true(noise[0] > 1000.0 && noise[0] < 50000.0);
    assert_true(noise[1] >= 0.0 && noise[1] < 1.0);
}

/* A state as good as 0.1 m says where the photocentre is, not the centre of mass: the filter is no
 * surer of any of its components than that. */
static void the_photocentre_is_no_centre_of_mass(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_elements *sets = NULL;
    int count = 0, used = 0;
    const bst_elements_options options = {.skip_bad_sets = true};
    const double none[BST_CUSTODY_STATE] = {0.0};
    bst_assert_ok(&ctx, bst_elements_load(&ctx, CATALOGUE, &options, &sets, &count));
    for (int i = 5; i < count; i += 23) {
        bst_custody_orbit truth, orbit;
        bst_custody_filter filter;
        bst_custody_fix fix = {
            .time_s = 7000.0,
            .epoch_utc_jd = {sets[i].epoch_utc_jd1, sets[i].epoch_utc_jd2 + 7000.0 / BST_DAY_S}};
        bst_assert_ok(&ctx, bst_custody_orbit_init(&ctx, &sets[i], 0.0, 0.0, &truth));
        if (!bst_custody_state(&truth, none, 7000.0, &fix.position_m, &fix.velocity_mps)) {
            continue;
        }
        for (int k = 0; k < 6; k++) {
            fix.covariance[k][k] = k < 3 ? 1e-2 : 1e-8;
        }
        if (bst_custody_start(&fix, 0.5, &orbit, &filter)) {
            used++;
            for (int k = 0; k < BST_CUSTODY_STATE; k++) {
                assert_true(filter.p[k][k] > 0.2 * 0.2);
            }
        }
    }
    free(sets);
    assert_true(used > 150);
}

static void no_orbit(void **state) {
    (void)state;
    double root[6][6];
    bst_custody_fix fix = {.epoch_utc_jd = {2459746.5, 0.0},
                           .position_m = {7e6, 0.0, 0.0},
                           .velocity_mps = {0.0, 5400.0, 5400.0}};
    bst_custody_orbit orbit;
    bst_custody_filter filter;
    assert_false(bst_custody_start(&fix, 0.5, &orbit, &filter)); /* no covariance */
    make_covariance(root, fix.covariance);
    assert_true(bst_custody_start(&fix, 0.5, &orbit, &filter));
    fix.velocity_mps = (bst_vec3){0.0, 9000.0, 9000.0};
    assert_false(bst_custody_start(&fix, 0.5, &orbit, &filter));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(errors_agree_with_covariances),
                                       cmocka_unit_test(the_photocentre_is_no_centre_of_mass),
                                       cmocka_unit_test(drag_is_noise), cmocka_unit_test(no_orbit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
