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

/* Uniform paths among streaks of stars along (20, -9): those that images would tell from a star's
 * by 5 sigma. The SNR is that of the object's own path; the light that the stars' path leaves of it
 * is (1 - r^2) of it, r the correlation of both images: 0.7 of half a path, 0.13 of 0.8 of it. */
static void streaks_of_another_path(void **state) {
    (void)state;
    static const struct {
        double share, turn, snr;
        bool star, streak, other;
    } cases[] = {{1.0, 0.0, 800, false, true, false}, {1.0, 0.0, 800, true, true, false},
                 {0.5, 0.0, 800, true, true, false},  {0.5, 0.0, 800, false, true, true},
                 {0.5, 0.0, 25, false, true, false},  {0.8, 0.0, 800, false, true, true},
                 {0.8, 0.0, 40, false, true, false},  {1.0, 0.5, 800, false, true, true},
                 {1.0, -0.5, 800, false, true, true}, {-1.0, 0.0, 800, false, true, false},
                 {0.0, 0.0, 800, false, false, false}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const double dx = 20.0, dy = -9.0, c = cases[k].share * cos(cases[k].turn);
        const double n = cases[k].share * sin(cases[k].turn);
        scene s;
        open_scene(&s);
        start(&s);
        s.frame.streak_dx_px = dx;
        s.frame.streak_dy_px = dy;
        bst_truth_item *t = add_source(&s, 1, 500.3, 400.6, electrons_of(&s, cases[k].snr));
        t->kind = cases[k].star ? BST_SOURCE_STAR : BST_SOURCE_OBJECT;
        t->x_start_px -= 0.5 * (c * dx - n * dy);
        t->x_end_px += 0.5 * (c * dx - n * dy);
        t->y_start_px -= 0.5 * (n * dx + c * dy);
        t->y_end_px += 0.5 * (n * dx + c * dy);
        bst_generator_result r = run(&s, 0);
        assert_int_equal(r.count, 1);
        const unsigned flags = r.items[0].detection.flags;
        printf("%zu: SNR %.1f, flags %u\n", k, r.items[0].detection.snr, flags);
        assert_int_equal((flags & BST_DETECTION_STREAK) != 0, cases[k].streak);
        assert_int_equal((flags & BST_DETECTION_OTHER_PATH) != 0, cases[k].other);
        close_scene(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(objects_across_the_stars_are_streaks),
                                       cmocka_unit_test(streaks_of_another_path)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
