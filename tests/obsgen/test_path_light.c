/* Light of a star rendered once for several fits. */
#include "obsgen/streak/path_fit.h"
#include "tests/test_support.h"

enum { STEPS = 101, LIGHTS = 3 };

/* It serves fits of any light and model as one that is rendered for each of them. */
static void light_of_a_star_serves_all_fits(void **state) {
    (void)state;
    const double lights[LIGHTS] = {0.1, 10.0, 1000.0};
    const bst_streak_model model = {.path = {8.0, 6.0}, .sigma_px = 1.1}, point = {.sigma_px = 1.1};
    double x[STEPS], y[STEPS], places[LIGHTS][2];
    for (int k = 0; k < STEPS; k++) { /* slower and slower, 10 px */
        double u = (double)k / (STEPS - 1);
        x[k] = 8.0 * (1.5 * u - 0.5 * u * u - 0.5);
        y[k] = 0.75 * x[k];
    }
    const bst_star_trail_path path = {x, y, STEPS};
    bst_path_light star;
    bst_path_light_make(&path, 1.1, &model, &star);
    for (int i = 0; i < LIGHTS; i++) {
        double at[2] = {0.0, 0.0}, alone[2] = {0.0, 0.0}, beside[2] = {0.0, 0.0};
        bst_path_fit_squares squares = bst_path_fit_light(&star, &model, lights[i], at);
        bst_path_fit_squares of_point = bst_path_fit_light(&star, &point, lights[i], beside);
        bst_path_fit_squares same = bst_path_fit(&path, &model, lights[i], alone);
        assert_memory_equal(at, alone, sizeof at); /* the same operations */
        assert_memory_equal(&squares, &same, sizeof same);
        assert_true(of_point.left > squares.left);
        memcpy(places[i], at, sizeof at);
    }
    assert_true(memcmp(places[0], places[2], sizeof places[0]) != 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(light_of_a_star_serves_all_fits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
