/* Fast objects in frames at the end of a slew: points that are fitted again as streaks. */
#include "obsgen/generator_internal.h"
#include "tests/obsgen/generator_scene.h"

enum { STEPS = 101 };

/* An object crosses the stars' streaks, which have most of their light at one end. No place of its
 * path is as bright as a star: the point that is found is elongated, and its own streak has the
 * light of the whole path, not the twentieth under the point where it was slowest. */
static void objects_across_the_stars_are_streaks(void **state) {
    (void)state;
    const double length = 14.0, across = 60.0;
    double x[STEPS], y[STEPS] = {0.0}, mean = 0.0;
    for (int k = 0; k < STEPS; k++) {
        double t = (double)k / (STEPS - 1);
        x[k] = length * (1.0 - pow(1.0 - t, 2.5));
        mean += (k == 0 || k == STEPS - 1 ? 0.5 : 1.0) / (STEPS - 1) * x[k];
    }
    for (int k = 0; k < STEPS; k++) {
        x[k] -= mean;
    }
    scene s;
    open_scene(&s);
    start(&s);
    s.frame.path_x_px = x;
    s.frame.path_y_px = y;
    s.frame.path_count = STEPS;
    s.frame.streak_dx_px = length;
    bst_truth_item *t = add_source(&s, 1, 500.3, 400.6, electrons_of(&s, 2000.0));
    t->kind = BST_SOURCE_OBJECT;
    t->x_start_px += x[0];
    t->x_end_px += x[STEPS - 1];
    t->y_start_px -= 0.5 * across;
    t->y_end_px += 0.5 * across;
    bst_generator_result r = run(&s, 0);
    assert_true(s.generator->uneven);
    assert_int_equal(r.count, 1);
    const bst_detection *d = &r.items[0].detection;
    printf("%.2f %.2f px off, %.2f of the light, %.1f px long\n", d->x_px - t->x_centroid_px,
           d->y_px - t->y_centroid_px, d->flux_e / t->electrons, d->length_px);
    assert_true((d->flags & BST_DETECTION_STREAK) != 0);
    /* its light is even along y; the line through a bent path is up to 4 px beside it */
    bst_assert_close(d->y_px, t->y_centroid_px, 2.0);
    bst_assert_close(d->x_px, t->x_centroid_px, 2.0);
    assert_true(d->flux_e > 0.6 * t->electrons && d->flux_e < 1.05 * t->electrons);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(objects_across_the_stars_are_streaks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
