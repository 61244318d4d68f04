#include "sim/astro/bodies.h"
#include "tests/test_support.h"

/* Light at 0.40, 0.55 and 1.00 um by rays followed through the air
 * (tests/astro/make_sunlight_reference.py): distance from the Earth's centre, the Sun's middle
 * beyond the limb. */
static const struct {
    double distance_m, off, light[3];
} rays[] = {
    {6778.0e3, 0.02, {0.93961, 0.97228, 0.9849}},
    {6778.0e3, 0.008, {0.21158, 0.18085, 0.6483}},
    {6778.0e3, 0.003, {0.024321, 0.048513, 0.39929}},
    {6778.0e3, -0.001, {0.0019313, 0.02284, 0.29705}},
    {6778.0e3, -0.004, {0.00021009, 0.010638, 0.18226}},
    {6778.0e3, -0.006, {3.6373e-05, 0.0046982, 0.09729}},
    {26560.0e3, 0.02, {1, 1, 1}},
    {26560.0e3, 0.008, {1, 1, 1}},
    {26560.0e3, 0.003, {0.781, 0.77609, 0.79844}},
    {26560.0e3, -0.001, {0.20816, 0.22036, 0.29376}},
    {26560.0e3, -0.004, {0.0075195, 0.009676, 0.064964}},
    {26560.0e3, -0.006, {0.00061581, 0.003154, 0.036578}},
    {42164.0e3, 0.02, {1, 1, 1.0001}},
    {42164.0e3, 0.008, {1, 1, 1}},
    {42164.0e3, 0.003, {0.83418, 0.82694, 0.83419}},
    {42164.0e3, -0.001, {0.25848, 0.26942, 0.31744}},
    {42164.0e3, -0.004, {0.0085529, 0.010257, 0.04882}},
    {42164.0e3, -0.006, {0.00053048, 0.0022035, 0.024597}},
};

/* The Sun `off` beyond the equator's limb, both in the plane of the equator. */
static bst_astro_sunlight light_at(double distance_m, double off, bool atmosphere) {
    bst_vec3 p = {distance_m, 0, 0}, pole = {0, 0, 1};
    double c = asin(BST_EARTH_RADIUS_M / distance_m) + off;
    bst_vec3 sun = bst_vec3_axpy(p, BST_AU_M, bst_vec3_make(-cos(c), sin(c), 0));
    bst_astro_sunlight s;
    bst_astro_sunlight_at(p, sun, pole, atmosphere, &s);
    return s;
}

static void agrees_with_rays_through_the_air(void **state) {
    (void)state;
    static const int colour[3] = {0, 1, 3};
    for (size_t k = 0; k < sizeof rays / sizeof *rays; k++) {
        bst_astro_sunlight s = light_at(rays[k].distance_m, rays[k].off, true);
        for (int i = 0; i < 3; i++) {
            /* rows of the air 2 km apart, one radius of the Earth: 0.7 % of full light */
            bst_assert_close(s.light[colour[i]], rays[k].light[i], 0.008);
        }
    }
}

static void light_reddens_and_never_jumps(void **state) {
    (void)state;
    static const double distances[] = {6.478e6, 6.7e6, 7.5e6, 2e7, 4.2e7, 3.8e8};
    for (size_t d = 0; d < sizeof distances / sizeof *distances; d++) {
        bst_astro_sunlight last = light_at(distances[d], -0.03, true);
        for (int i = 1; i <= 3000; i++) {
            double off = -0.03 + 0.25 * i / 3000;
            bst_astro_sunlight s = light_at(distances[d], off, true);
            for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
                assert_true(s.light[c] >= 0.0 && s.light[c] <= 1.0 + 1e-12);
                assert_true(fabs(s.light[c] - last.light[c]) < 0.03);
            }
            /* red light comes deeper into the shadow than blue; at first the Sun's edge goes, which
             * is redder than its middle */
            assert_true(s.light[3] >= s.light[1] - 0.03 && s.light[3] >= s.light[0] - 0.03);
            assert_true(s.light[3] >= s.light[1] || s.light[1] > 0.5);
            last = s;
        }
        assert_true(last.light[BST_SUNLIGHT_V] == 1.0 || distances[d] < 6.6e6);
    }
}

static void without_air_the_ends_are_those_of_the_geometry(void **state) {
    (void)state;
    for (int i = 0; i <= 40; i++) {
        double off = -0.006 + 0.0003 * i;
        bst_astro_sunlight s = light_at(4.2164e7, off, false);
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            assert_true((s.light[c] == 0.0) == (s.disc == 0.0));
            assert_true((s.light[c] == 1.0) == (s.disc == 1.0));
        }
    }
    /* on the ground, and inside */
    assert_true(light_at(BST_EARTH_RADIUS_M, 0.1, true).light[BST_SUNLIGHT_V] == 1.0);
    assert_true(light_at(6e6, 0.1, true).light[BST_SUNLIGHT_V] == 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_rays_through_the_air),
        cmocka_unit_test(light_reddens_and_never_jumps),
        cmocka_unit_test(without_air_the_ends_are_those_of_the_geometry),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
