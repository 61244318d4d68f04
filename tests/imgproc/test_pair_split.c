/* Close pairs in all directions: places, light and errors of both sources; and moving sources,
 * which are no pairs. */
#include "boresight/rng.h"
#include "synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 240, CELL = 30, COLUMNS = SIDE / CELL, SOURCES = COLUMNS * COLUMNS };
enum { DIRECTIONS = 16, FRAMES = 3 };

typedef struct truth {
    double x[2], y[2], flux[2];
} truth;

/* Every fourth source is a pair with `faint` of the light in the second one, at DIRECTIONS angles
 * of the whole circle; the others have no partner. */
static void scene(synthetic *s, uint64_t frame, double faint, double separation, double flux,
                  truth out[SOURCES]) {
    bst_rng_key key = bst_rng_make_key(frame, 0, "test", "pair split");
    synthetic_clear(s);
    for (int k = 0; k < SOURCES; k++) {
        truth *t = &out[k];
        double x = (k % COLUMNS + 0.5) * CELL + bst_rng_uniform(key, 0, (uint64_t)k);
        double y = (double)(k / COLUMNS) * CELL + 0.5 * CELL + bst_rng_uniform(key, 1, (uint64_t)k);
        double angle = 2.0 * BST_PI * (k / 4) / DIRECTIONS;
        double apart = k % 4 ? 0.0 : separation;
        double dx = apart * cos(angle), dy = apart * sin(angle);
        *t = (truth){.x = {x - faint * dx, x + (1.0 - faint) * dx},
                     .y = {y - faint * dy, y + (1.0 - faint) * dy},
                     .flux = {(1.0 - faint) * flux, faint * flux}};
        synthetic_add(s, t->x[0], t->y[0], t->flux[0], 0.0, 0.0);
        synthetic_add(s, t->x[1], t->y[1], t->flux[1], 0.0, 0.0);
    }
    synthetic_expose(s, key, frame);
}

static double chi_square(const bst_detection *d, double x, double y) {
    double dx = d->x_px - x, dy = d->y_px - y;
    double det = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
    return (d->cov_yy * dx * dx - 2.0 * d->cov_xy * dx * dy + d->cov_xx * dy * dy) / det;
}

/* Pairs at 0.7 of the FWHM. Chi-square of the places of 96 sources has 192 degrees of freedom: its
 * mean is 2 to 0.2, 1 sigma; that of their light 1 to 0.14. A separation of 1.4 px is far above the
 * errors, so that the fit is nearly linear. */
static void measure(double faint) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.config.false_splits = 0.01;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2 * SOURCES);
    truth all[SOURCES];
    double chi = 0.0, light = 0.0;
    int count = 0;
    for (uint64_t frame = 0; frame < FRAMES; frame++) {
        scene(&s, frame, faint, 1.4, 2e5, all);
        bst_imgproc_frame f = synthetic_frame(&s);
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, NULL, d, 2 * SOURCES));
        for (int k = 0; k < SOURCES; k += 4) {
            const truth *t = &all[k];
            int first = synthetic_nearest(d, t->x[0], t->y[0], 0.5);
            int second = synthetic_nearest(d, t->x[1], t->y[1], 0.5);
            assert_true(first >= 0 && second >= 0 && first != second);
            for (int j = 0; j < 2; j++) {
                const bst_detection *item = &d->items[j ? second : first];
                assert_true(item->flags & BST_DETECTION_BLEND);
                double e = (item->flux_e - t->flux[j]) / item->flux_sigma_e;
                chi += chi_square(item, t->x[j], t->y[j]);
                light += e * e;
                count++;
            }
        }
    }
    print_message("faint %.2f: chi-square %.3f of places, %.3f of light\n", faint, chi / count,
                  light / count);
    bst_assert_close(chi / count, 2.0, 0.8);
    bst_assert_close(light / count, 1.0, 0.6);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

static void equal_pairs(void **state) {
    (void)state;
    measure(0.5);
}

static void one_to_four(void **state) {
    (void)state;
    measure(0.2);
}

/* Sources that moved by 2.5 px in any direction, by a motion that is not known, are explained
 * better by a streak than by a pair. */
static void moving_sources(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.config.false_splits = 0.01;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2 * SOURCES);
    bst_rng_key key = bst_rng_make_key(9, 0, "test", "pair split");
    for (int k = 0; k < SOURCES; k++) {
        double angle = 2.0 * BST_PI * (k / 4) / DIRECTIONS, length = k % 4 ? 0.0 : 2.5;
        synthetic_add(&s, (k % COLUMNS + 0.5) * CELL + bst_rng_uniform(key, 0, (uint64_t)k),
                      (int)(k / COLUMNS) * CELL + 15.0 + bst_rng_uniform(key, 1, (uint64_t)k), 2e5,
                      length * cos(angle), length * sin(angle));
    }
    synthetic_expose(&s, key, 0);
    bst_imgproc_frame f = synthetic_frame(&s);
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, NULL, d, 2 * SOURCES));
    assert_true(d->count >= SOURCES);
    for (int i = 0; i < d->count; i++) {
        assert_false(d->items[i].flags & BST_DETECTION_BLEND);
    }
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(equal_pairs), cmocka_unit_test(one_to_four),
                                       cmocka_unit_test(moving_sources)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
