/* Search of a cone in a table of positions: objects that are placed at known distances from the
 * cone, against what their speeds and velocities allow. */
#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/astro/kepler.h"
#include "sim/world/orbit/ephemeris_search.h"
#include "tests/test_support.h"

enum { OBJECTS = 700 };

static const bst_vec3 apex = {-3.1e6, 5.2e6, 3.4e6};

static double noise(unsigned *seed) {
    *seed = *seed * 1664525u + 1013904223u;
    return (double)(*seed >> 8) / 16777216.0;
}

/* A place at this distance from the surface of a cone, outside of it, `along` its axis from the
 * apex and at an angle about it. */
static bst_vec3 beside(bst_vec3 axis, double half, double along, double angle, double outside) {
    const bst_vec3 x = bst_vec3_unit(bst_vec3_perpendicular(axis)), y = bst_vec3_cross(axis, x);
    const double across = (outside + along * sin(half)) / cos(half);
    bst_vec3 p = bst_vec3_axpy(apex, along, axis);
    p = bst_vec3_axpy(p, across * cos(angle), x);
    return bst_vec3_axpy(p, across * sin(angle), y);
}

static bool found_in(const int *indices, int count, int object) {
    for (int i = 0; i < count; i++) {
        if (indices[i] == object) {
            return true;
        }
    }
    return false;
}

static void objects_are_found_by_how_far_they_may_come(void **state) {
    (void)state;
    void *memory = calloc(1, bst_ephemeris_rows_bytes(OBJECTS));
    assert_non_null(memory);
    const bst_ephemeris_rows rows = bst_ephemeris_rows_in(memory, OBJECTS);
    bst_ctx ctx = {0};
    bst_ephemeris_search s = {.cone = {.apex_m = apex,
                                       .axis = bst_vec3_unit((bst_vec3){2, -1, 3}),
                                       .half_angle_rad = 0.11,
                                       .half_span_s = 1.5,
                                       .apex_span_m = 700},
                              .error_m = 400,
                              .shift_rad = 0.004};
    const double half = 0.11 + 0.004;
    /* single precision in the first pass, of places that are not known better: rad, m */
    const double rounding_rad = 1.5e-3, rounding_m = 100;
    bool wanted[OBJECTS];
    unsigned seed = 5;
    for (int after = -3; after <= 3; after += 3) {
        s.after_s = after;
        for (int i = 0; i < OBJECTS; i++) {
            const double along = 3e6 + 2.5e7 * noise(&seed), angle = 6.28 * noise(&seed);
            const bool in = i % 2 == 0;
            double place[3], velocity[3];
            wanted[i] = in;
            if (i % 4 < 2) { /* its velocity is unknown: a sphere about its place */
                const double speed = 6e4 + 9e4 * noise(&seed);
                const double reach = speed * (fabs(s.after_s) + 1.5) + 400 + 700;
                const double wide = rounding_rad * 1.2 * along + rounding_m;
                const bst_vec3 p = beside(s.cone.axis, half, along, angle,
                                          in ? 0.95 * reach : 1.02 * reach + wide);
                memcpy(place, (double[3]){p.x, p.y, p.z}, sizeof place);
                bst_ephemeris_rows_set(&rows, i, place, NULL, speed);
            } else { /* two bodies: where it is then, and its speed for the time of the search */
                const double speed = 8e3 + 3e3 * noise(&seed);
                const double reach = speed * 1.5 + 400 + 1000 + 700;
                const bst_vec3 then =
                    beside(s.cone.axis, half, along, angle, in ? 0.98 * reach : reach + 3);
                const bst_vec3 v =
                    bst_vec3_scale(bst_vec3_unit((bst_vec3){noise(&seed) - 0.5, noise(&seed) - 0.5,
                                                            noise(&seed) - 0.5}),
                                   6e3 * noise(&seed));
                bst_vec3 p, w;
                bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, BST_EARTH_MU_M3PS2, then, v,
                                                         -s.after_s, &p, &w));
                memcpy(place, (double[3]){p.x, p.y, p.z}, sizeof place);
                memcpy(velocity, (double[3]){w.x, w.y, w.z}, sizeof velocity);
                bst_ephemeris_rows_set(&rows, i, place, velocity, speed);
            }
        }
        const double nowhere[3] = {NAN, NAN, NAN};
        bst_ephemeris_rows_set(&rows, 9, nowhere, NULL, 100.0); /* anywhere */
        wanted[9] = true;
        bst_ephemeris_rows_set(&rows, 12, (double[3]){apex.x, apex.y, apex.z}, NULL, -INFINITY);
        wanted[12] = false; /* no orbit */
        int indices[OBJECTS];
        const int count = bst_ephemeris_rows_near(&rows, OBJECTS, &s, indices);
        for (int i = 0; i < OBJECTS; i++) {
            if (found_in(indices, count, i) != wanted[i]) {
                fail_msg("%d s: object %d is %s", after, i, wanted[i] ? "missed" : "found");
            }
        }
    }
    free(memory);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(objects_are_found_by_how_far_they_may_come),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
