/* A geostationary object seen from an orbit of 800 km, for tests of tracks on orbits. */
#ifndef BST_TESTS_GEO_LOOK_H
#define BST_TESTS_GEO_LOOK_H

#include "sim/astro/kepler.h"
#include "tests/tracker/orbit_scene.h"

static const bst_vec3 earth_mps = {-12e3, 25e3, 11e3};

/* Where a body of two-body motion, so far ahead of the object on its orbit, is seen at a time,
 * light time by plain iteration. */
static inline void look(double t, double ahead_m, bst_od_observer *eye, bst_vec3 *direction,
                        double *range_m) {
    bst_ctx ctx = {0};
    bst_od_state body =
        from_elements(42164e3, 1e-3, 3.0, 40.0, 10.0, 20.0 + ahead_m / 42164e3 / BST_DEG_RAD);
    bst_od_state from = from_elements(7160e3, 1e-3, 98.5, 120.0, 30.0, -40.0);
    bst_vec3 r, v, line = {0};
    double tau = 0.0;
    *eye = (bst_od_observer){.time_s = t, .earth_bary_mps = earth_mps};
    bst_assert_ok(
        &ctx, bst_kepler_propagate(&ctx, BST_EARTH_MU_M3PS2, from.position_m, from.velocity_mps, t,
                                   &eye->position_m, &eye->velocity_mps));
    for (int k = 0; k < 5; k++) {
        bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, BST_EARTH_MU_M3PS2, body.position_m,
                                                 body.velocity_mps, t - tau, &r, &v));
        line = bst_vec3_axpy(bst_vec3_sub(r, eye->position_m), -tau, earth_mps);
        tau = bst_vec3_norm(line) / BST_LIGHT_SPEED_MPS;
    }
    *direction = bst_vec3_unit(line);
    *range_m = bst_vec3_norm(line);
}

#endif
