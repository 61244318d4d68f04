/* The streak filter's output between the pixels. */
#include "imgproc/detect/filter.h"
#include "tests/test_support.h"

enum { SIDE = 64, MIDDLE = SIDE / 2 };

/* A filter for streaks of 20 px along x on outputs of the point filter that are
 * 4 + slope x - bend x^2 / 2 along and fall off across as a source's do, about y = `across` px. */
static void open_filter(bst_ctx *ctx, double slope, double bend, double across, bst_filter *f) {
    bst_assert_ok(ctx, bst_filter_create(ctx, NULL, SIDE, SIDE, 30.0, 1, f));
    bst_filter_set(f, 0.85, 1, 20.0, 0.0);
    f->width = f->height = SIDE;
    f->stride = SIDE + 2 * f->pad;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double u = x - MIDDLE, v = y - MIDDLE - across;
            double along = 4.0 + slope * u - 0.5 * bend * u * u;
            f->point[(y + f->pad) * f->stride + x + f->pad] =
                (float)(along * exp(-v * v / (4.0 * 0.8)));
        }
    }
}

/* Where noise leaves the output along a streak nearly straight, a quadratic's top is far off. */
static void tops_are_not_sought_far_away(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_filter f;
    open_filter(&ctx, 0.1, 0.003, 0.3, &f);
    double peak = bst_filter_peak(&f, NULL, 1.0, true, MIDDLE, MIDDLE);
    double here = (double)bst_filter_streak_at(&f, MIDDLE, MIDDLE);
    double beside = (double)bst_filter_streak_at(&f, MIDDLE + 1, MIDDLE);
    double between = exp(0.3 * 0.3 / (4.0 * 0.8)); /* what the top across is above its pixel */
    assert_true(beside > 1.01 * here);
    assert_true(peak >= here);
    assert_true(peak < 1.001 * between * beside);
    bst_filter_free(&f);
}

/* A top within the pixel is found wherever it is. */
static void tops_nearby_are_found(void **state) {
    (void)state;
    static const double offs[] = {-0.5, -0.2, 0.0, 0.35, 0.5};
    for (size_t i = 0; i < sizeof offs / sizeof *offs; i++) {
        bst_ctx ctx = {0};
        bst_filter f;
        open_filter(&ctx, 0.06 * offs[i], 0.06, offs[i], &f);
        double peak = bst_filter_peak(&f, NULL, 1.0, true, MIDDLE, MIDDLE);
        /* of the 20 px the mean of u^2 is 100 / 3, about the place that is the top's */
        double spread = 100.0 / 3.0, at = offs[i];
        double here = (double)bst_filter_streak_at(&f, MIDDLE, MIDDLE);
        double share = exp(-at * at / (4.0 * 0.8)) * (4.0 - 0.03 * spread) /
                       (4.0 + 0.03 * at * at - 0.03 * spread);
        bst_assert_close(peak, here / share, 0.005 * peak);
        bst_filter_free(&f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tops_are_not_sought_far_away),
                                       cmocka_unit_test(tops_nearby_are_found)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
