/* Zodiacal light and the Moon's phases against published numbers. */
#include "sim/world/scene/zodiacal.h"

#include "sim/world/scene/stray.h"
#include "tests/world/world_support.h"

/* Leinert et al. 1998, table 16, and section 8.3 for the pole. */
static void zodiacal_light_is_the_published_table(void **state) {
    (void)state;
    static const double rows[][3] = {{15, 0, 9000}, {90, 0, 202},  {60, 30, 143}, {0, 20, 1260},
                                     {180, 0, 180}, {135, 5, 139}, {120, 60, 60}, {45, 45, 130},
                                     {0, 90, 60},   {77, 90, 60},  {0, 15, 2450}, {165, 75, 56}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        for (int s = 0; s < 4; s++) { /* both hemispheres, both sides of the Sun */
            double l = (s & 1 ? -1 : 1) * rows[i][0] * BST_DEG_RAD;
            double b = (s & 2 ? -1 : 1) * rows[i][1] * BST_DEG_RAD;
            /* log and exp of a double */
            bst_assert_close(bst_zodiacal_s10(l, b), rows[i][2], 1e-9 * rows[i][2]);
            bst_assert_close(bst_zodiacal_s10(l + 2 * BST_PI, b), rows[i][2], 1e-9 * rows[i][2]);
        }
    }
    /* the pole in magnitudes per square arcsecond; 23.33 is often rounded to 23.3 */
    bst_assert_close(10 - 2.5 * log10(60.0) + 5 * log10(3600.0), 23.336, 1e-3);
    /* continued inwards it meets the table's own value in the empty corner */
    bst_assert_close(bst_zodiacal_s10(10 * BST_DEG_RAD, 10 * BST_DEG_RAD), 3700, 20);
    /* no jump on the border, brighter towards the Sun, finite at its centre */
    double before = 0;
    for (double d = 40; d >= 0.5; d -= 0.01) {
        double now = bst_zodiacal_s10(0.7 * d * BST_DEG_RAD, 0.6 * d * BST_DEG_RAD);
        assert_true(now >= before && (d > 39.99 || now < (1 + 0.03 / d) * before));
        before = now;
    }
    assert_true(isfinite(bst_zodiacal_s10(0, 0)) && bst_zodiacal_s10(0, 0) > before);
}

static void the_ecliptic_is_where_it_is(void **state) {
    (void)state;
    double e = 84381.406 * BST_ARCSEC_RAD;
    bst_vec3 pole = {0, -sin(e), cos(e)}, sun = {-3e10, cos(e) * 1e11, sin(e) * 1e11};
    bst_assert_close(bst_zodiacal_towards(pole, sun), 60, 1e-6);
    bst_assert_close(bst_zodiacal_towards(bst_vec3_unit(bst_vec3_scale(sun, -1)), sun), 180, 1e-6);
    bst_vec3 quarter = bst_vec3_unit(bst_vec3_cross(pole, sun));
    bst_assert_close(bst_zodiacal_towards(quarter, sun), 202, 1e-6);
    bst_assert_close(bst_zodiacal_towards(bst_vec3_scale(quarter, -1), sun), 202, 1e-6);
}

/* Krisciunas and Schaefer 1991. */
static void the_moon_has_its_phases(void **state) {
    (void)state;
    bst_vec3 moon = {3.844e8, 0, 0};
    /* phase angles of 0, 90 and 180 degrees: 0.026 * 90 + 4e-9 * 90^4 = 2.6024 */
    bst_assert_close(bst_scene_moon_v_mag(moon, (bst_vec3){-BST_AU_M, 0, 0}), -12.73, 1e-9);
    bst_assert_close(bst_scene_moon_v_mag(moon, (bst_vec3){0, BST_AU_M, 0}), -12.73 + 2.60244,
                     1e-9);
    bst_assert_close(bst_scene_moon_v_mag(moon, (bst_vec3){BST_AU_M, 0, 0}), -12.73 + 8.87904,
                     1e-9);
    /* twice as far: 5 log10 2 */
    bst_assert_close(bst_scene_moon_v_mag(bst_vec3_scale(moon, 2), (bst_vec3){-BST_AU_M, 0, 0}),
                     -12.73 + 1.50515, 1e-5);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(zodiacal_light_is_the_published_table),
        cmocka_unit_test(the_ecliptic_is_where_it_is),
        cmocka_unit_test(the_moon_has_its_phases),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
