/* Ghosts in the observation generator: their images in the filters, and how often and where they
 * are detected. */
#include "obsgen/generator_internal.h"
#include "tests/obsgen/generator_scene.h"

static bst_generator generator;

static bst_generator *make(void) {
    generator = (bst_generator){.binning = 1, .total_sigma = 0.9};
    generator.cross_sigma = 1.3 / sqrt(2.0); /* the output about a point is 1.3 wide */
    generator.key = bst_rng_make_key(5, 0, "test", "ghosts");
    return &generator;
}

/* Images count as Gaussians of their variance; a ring is found on its ring. */
static void images_in_the_filters(void **state) {
    (void)state;
    bst_generator *g = make();
    const bst_ghost ghosts[] = {{.sigma_px = 0.0},
                                {.sigma_px = 1.7},
                                {.radius_px = 4.0},
                                {.radius_px = 9.0, .inner_radius_px = 5.0}};
    const double variances[] = {0.0, 1.7 * 1.7, 4.0, 0.25 * (81.0 + 25.0)};
    for (int i = 0; i < 4; i++) {
        for (int binning = 1; binning <= 2; binning++) {
            generator_source s = {.x = 40.0, .y = 30.0, .snr_ratio = 1.0, .filter_ratio = 1.0};
            double variance = variances[i] / (binning * binning);
            g->binning = binning;
            s.curvature = 1.0;
            bst_generator_set_ghost_image(g, &ghosts[i], &s);
            bst_assert_close(s.blur, variance, 1e-12);
            bst_assert_close(s.shape_xx, variance, 1e-12);
            bst_assert_close(s.shape_yy, variance, 1e-12);
            bst_assert_close(s.curvature, 1.69 / (1.69 + variance), 1e-12);
            /* 1 %: accuracy of bst_matched_product */
            double ratio = sqrt(0.81 / (0.81 + variance));
            bst_assert_close(s.snr_ratio, ratio, 0.01 * ratio);
            bst_assert_close(s.filter_ratio, s.snr_ratio, 1e-12);
            bst_assert_close(hypot(s.x - 40.0, s.y - 30.0), i == 3 ? 7.0 / binning : 0.0, 1e-9);
        }
    }
}

/* A streak across which the blur widens: the SNR of a long one falls with the width's root. */
static void streaks_of_ghosts(void **state) {
    (void)state;
    bst_generator *g = make();
    const bst_ghost blur = {.sigma_px = 2.0};
    generator_source s = {.path = {300.0, 400.0}, .snr_ratio = 1.0, .filter_ratio = 1.0};
    bst_generator_set_ghost_image(g, &blur, &s);
    double ratio = sqrt(sqrt(0.81 / (0.81 + 4.0)));
    bst_assert_close(s.snr_ratio, ratio, 0.02 * ratio); /* 1 % twice */
}

enum { SOURCES = 900, FRAMES = 4 };

/* Sources of one SNR on a grid; how many are detected within 3 px, of all frames. */
static double share_found(scene *s, int kind, const int32_t *ghost, double electrons) {
    int found = 0;
    s->truth->count = 0;
    for (int i = 0; i < SOURCES; i++) {
        add_source(s, (uint32_t)i + 1, 30.0 + 33.0 * (i % 30) + 0.037 * i, 30.0 + 33.0 * (i / 30),
                   electrons)
            ->kind = kind;
    }
    s->frame.ghost = ghost;
    for (int k = 0; k < FRAMES; k++) {
        bst_generator_result out;
        s->truth->exposure_id = k;
        bst_assert_ok(&s->ctx, bst_generator_run(&s->ctx, s->generator, &s->frame, &out));
        for (int i = 0; i < out.count; i++) {
            const bst_obsgen_generated *d = &out.items[i];
            assert_true(d->item >= 0 && d->item < SOURCES);
            const bst_truth_item *item = &s->truth->items[d->item];
            found += hypot(d->detection.x_px - item->x_centroid_px,
                           d->detection.y_px - item->y_centroid_px) < 3.0;
        }
    }
    return found / (double)(SOURCES * FRAMES);
}

static void ghosts_are_detected_as_faint_sources(void **state) {
    (void)state;
    scene s;
    open_scene(&s);
    bst_ghosts *two = calloc(1, sizeof *two + 2 * sizeof two->items[0]);
    int32_t *first = calloc(SOURCES, sizeof *first), *second = calloc(SOURCES, sizeof *second);
    assert_true(two && first && second);
    two->count = 2;
    two->items[0] = (bst_ghost){.intensity = 0.01, .factor = -1.0};
    two->items[1] = (bst_ghost){.intensity = 0.01, .factor = 0.5, .sigma_px = 1.0};
    s.camera.ghost_images = two;
    s.settings.false_alarms_per_frame = 1e-3;
    start(&s);
    for (int i = 0; i < SOURCES; i++) {
        second[i] = 1;
    }
    double electrons = electrons_of(&s, 6.5);
    double stars = share_found(&s, BST_SOURCE_STAR, NULL, electrons);
    double points = share_found(&s, BST_SOURCE_STAR_GHOST, first, electrons);
    double objects = share_found(&s, BST_SOURCE_OBJECT_GHOST, first, electrons);
    assert_true(stars > 0.2 && stars < 0.8);
    double error = sqrt(2.0 * stars * (1.0 - stars) / (SOURCES * FRAMES));
    bst_assert_close(points, stars, 4.0 * error);
    bst_assert_close(objects, stars, 4.0 * error);
    assert_true(points != objects); /* draws of their own */
    double blurred = share_found(&s, BST_SOURCE_STAR_GHOST, second, electrons);
    assert_true(blurred < 0.2 * stars);
    /* light that gives the same output; noise moves a flat maximum to more places: 0.1 */
    double sigma2 = s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0;
    double brighter = (2.0 * sigma2 + 1.0) / (2.0 * sigma2);
    blurred = share_found(&s, BST_SOURCE_STAR_GHOST, second, brighter * electrons);
    bst_assert_close(blurred, stars, 0.1);
    close_scene(&s);
    free(two);
    free(first);
    free(second);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(images_in_the_filters),
        cmocka_unit_test(streaks_of_ghosts),
        cmocka_unit_test(ghosts_are_detected_as_faint_sources),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
