/* The same detections, to the last bit, with vectors of every width that this processor has. */
#include <stdlib.h>
#include <string.h>

#include "sim/core/simd.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 256, MOST = 512 };

/* Points or streaks of an SNR of 5 to 60, some of them two or three together. */
static void draw(synthetic *s, bst_rng_key key, double dx, double dy) {
    double unit = synthetic_noise(s) / synthetic_norm(s, 50, 50, dx, dy);
    for (int i = 0; i < 60; i++) {
        uint64_t draw = 3 * (uint64_t)i;
        double x = 6.0 + (SIDE - 12.0) * bst_rng_uniform(key, draw, 0);
        double y = 6.0 + (SIDE - 12.0) * bst_rng_uniform(key, draw + 1, 0);
        double flux = unit * (5.0 + 55.0 * bst_rng_uniform(key, draw + 2, 0));
        synthetic_add(s, x, y, flux, dx, dy);
        for (int k = 1; k <= i % 3; k++) {
            synthetic_add(s, x + 3.1 * k, y - 2.3 * k, 0.8 * flux, dx, dy);
        }
    }
}

static void detect(const synthetic *s, const bst_camera_motion *motion, int width,
                   bst_detections *out) {
    bst_ctx ctx = {0};
    bst_simd_limit(width);
    bst_imgproc *ip = synthetic_processor(&ctx, s);
    bst_imgproc_frame frame = synthetic_frame(s);
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, motion, out, MOST));
    bst_imgproc_free(ip);
    bst_simd_limit(16);
}

static void all_widths_agree(double dx, double dy) {
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "widths");
    draw(&s, key, dx, dy);
    synthetic_expose(&s, key, 1);
    bst_camera_motion moving = synthetic_motion(&s, dx, dy);
    const bst_camera_motion *motion = dx != 0.0 || dy != 0.0 ? &moving : NULL;
    bst_detections *first = synthetic_detections(MOST), *other = synthetic_detections(MOST);
    detect(&s, motion, 4, first);
    assert_true(first->count > 40);
    for (int width = 8; width <= 16; width *= 2) {
        detect(&s, motion, width, other);
        assert_int_equal(other->count, first->count);
        for (int i = 0; i < first->count; i++) {
            const bst_detection *a = &first->items[i], *b = &other->items[i];
            const double one[] = {a->x_px,   a->y_px,   a->flux_e, a->flux_sigma_e,
                                  a->cov_xx, a->cov_xy, a->cov_yy};
            const double two[] = {b->x_px,   b->y_px,   b->flux_e, b->flux_sigma_e,
                                  b->cov_xx, b->cov_xy, b->cov_yy};
            assert_memory_equal(one, two, sizeof one);
        }
    }
    free(first);
    free(other);
    synthetic_free(&s);
}

static void of_points(void **state) {
    (void)state;
    all_widths_agree(0.0, 0.0);
}

static void of_streaks(void **state) {
    (void)state;
    all_widths_agree(11.3, -6.2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_points),
        cmocka_unit_test(of_streaks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
