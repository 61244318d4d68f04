/* The observer after its navigation telemetry against a circular orbit. */
#include "sim/onboard/nav_motion.h"

#include "tests/test_support.h"

#define R 7.0e6

static const bst_vec3 earth = {-21000, 19000, 11000};

static bst_nav_telemetry on_circle(double angle) {
    double v = sqrt(3.986004418e14 / R);
    bst_nav_telemetry nav = {.position_gcrf_m = {R * cos(angle), 0, R * sin(angle)},
                             .velocity_gcrf_mps = {-v * sin(angle), 0, v * cos(angle)},
                             .sun_m = {-0.2e11, 1.4e11, 0.3e11}};
    nav.velocity_bary_mps = bst_vec3_add(earth, nav.velocity_gcrf_mps);
    return nav;
}

static void assert_near(bst_vec3 a, bst_vec3 b, double tolerance) {
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(a, b)), 0.0, tolerance);
}

static void circular_orbit(void **state) {
    (void)state;
    double rate = sqrt(3.986004418e14 / R) / R;
    const double after_s[] = {-60.0, -2.5, 0.0, 0.25, 600.0};
    for (int i = 0; i < 5; i++) {
        bst_nav_telemetry now = on_circle(0.4), then = on_circle(0.4 + rate * after_s[i]);
        bst_vec3 position, velocity;
        bst_nav_state_after(&now, after_s[i], &position, &velocity);
        assert_near(position, then.position_gcrf_m, 1e-5); /* m: rounding of 7e6 m */
        assert_near(velocity, then.velocity_gcrf_mps, 1e-8);
        bst_light light = bst_nav_light_after(&now, after_s[i]);
        assert_near(light.velocity_mps, then.velocity_bary_mps, 1e-8);
        assert_near(light.sun_m, now.sun_m, 0.0);
    }
}

/* An observer without an orbit keeps its velocity. */
static void no_orbit(void **state) {
    (void)state;
    const bst_nav_telemetry rest = {.position_gcrf_m = {R, 0, 0}, .velocity_bary_mps = earth};
    bst_vec3 position, velocity;
    bst_nav_state_after(&rest, 5.0, &position, &velocity);
    assert_near(position, rest.position_gcrf_m, 0.0);
    assert_near(velocity, (bst_vec3){0, 0, 0}, 0.0);
    assert_near(bst_nav_light_after(&rest, 5.0).velocity_mps, earth, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(circular_orbit),
                                       cmocka_unit_test(no_orbit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
