#include "sim/astro/bodies.h"
#include "tests/astro/astropy_reference.h"
#include "tests/test_support.h"

static void bodies_agree_with_astropy(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof reference_bodies / sizeof *reference_bodies; i++) {
        bst_ctx ctx = {0};
        bst_time t;
        bst_bodies b;
        bst_assert_ok(&ctx, bst_time_from_utc(&ctx, reference_bodies[i].utc, &t));
        bst_bodies_at(t, &b);
        const struct {
            bst_vec3 ours;
            const double *theirs;
            double tolerance;
        } pairs[] = {
            /* We take TT for TDB, which astropy distinguishes: 1.7 ms at most, in which the Earth
             * goes 50 m, the Moon 2 m and the Earth's velocity changes by 1e-5 m/s. */
            {b.sun_m, reference_bodies[i].sun_m, 55.0},
            {b.earth_bary_m, reference_bodies[i].earth_m, 55.0},
            {b.moon_m, reference_bodies[i].moon_m, 2.0},
            {b.earth_bary_mps, reference_bodies[i].earth_mps, 1.2e-5},
        };
        for (size_t k = 0; k < sizeof pairs / sizeof *pairs; k++) {
            const double *p = pairs[k].theirs;
            bst_vec3 miss = bst_vec3_sub(pairs[k].ours, bst_vec3_make(p[0], p[1], p[2]));
            bst_assert_close(bst_vec3_norm(miss), 0.0, pairs[k].tolerance);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bodies_agree_with_astropy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
