/* Columns with levels of their own, as a frame transfer under light leaves them. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/calibrate/columns.h"
#include "sim/optics/column_level.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { WIDTH = 320, HEIGHT = 512, SMEARED = 24 };

/* Smear of a column in electrons: some of the columns, from a tenth of the noise to 40 times. */
static double smear(bst_rng_key key, int x) {
    double u = bst_rng_uniform(key, 1, (uint64_t)x);
    return x % (WIDTH / SMEARED) == 3 ? exp(6.0 * u) : 0.0;
}

static void expose(synthetic *s, bst_rng_key key, uint64_t frame) {
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        s->mean_e[i] += smear(key, i % WIDTH);
    }
    synthetic_expose(s, key, frame);
}

/* Each column's level is measured to what counting and reading allow, stars or not. */
static void levels(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, WIDTH, HEIGHT);
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "columns");
    bst_columns columns;
    bst_assert_ok(&ctx, bst_columns_create(&ctx, WIDTH, &columns));
    for (int i = 0; i < 30; i++) {
        synthetic_add(&s, WIDTH * bst_rng_uniform(key, 2, (uint64_t)i),
                      HEIGHT * bst_rng_uniform(key, 3, (uint64_t)i), 3e4, 0, 0);
    }
    expose(&s, key, 7);
    bst_imgproc_frame frame = synthetic_frame(&s);
    s.camera.detector.frame_transfer_s = 0.3;
    bst_columns_measure(&columns, NULL, &s.camera, &frame);
    for (int x = 0; x < WIDTH; x++) {
        double noise2 = synthetic_noise(&s) * synthetic_noise(&s), over = smear(key, x);
        /* 5 sigma of a clipped mean of 512 rows, which five stars' wings add a tenth to, and of the
         * median of the columns */
        double tolerance = 6.0 * sqrt((noise2 + over) / HEIGHT) + 0.02 * sqrt(noise2);
        bst_assert_close(columns.level_e[x], over, tolerance);
        bst_assert_close(columns.noise[x], sqrt(1.0 + over / noise2), 0.05);
    }
    /* without a frame transfer the same levels are electronic offsets, which bring no noise */
    s.camera.detector.frame_transfer_s = 0.0;
    bst_columns_measure(&columns, NULL, &s.camera, &frame);
    for (int x = 0; x < WIDTH; x++) {
        bst_assert_close(columns.noise[x], 1.0, 0.0);
    }
    bst_columns_free(&columns);
    synthetic_free(&s);
}

/* With the levels taken off there is a false alarm a frame, as asked for, and a source on a smeared
 * column has its flux and an error that its covariance states; in a window of the frame too. */
static void false_alarms_and_sources(void **state) {
    (void)state;
    enum { FRAMES = 30 };
    const bst_window window = {64, 96, 128, 128};
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, WIDTH, HEIGHT);
    s.camera.detector.frame_transfer_s = 0.3;
    bst_rng_key key = bst_rng_make_key(2, 0, "test", "columns");
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    int alarms = 0, column = 3;
    double chi2 = 0.0, flux2 = 0.0;
    while (column < 90 || smear(key, column) < 100.0) {
        column += WIDTH / SMEARED;
    }
    for (uint64_t t = 0; t < FRAMES; t++) {
        double x = column - 0.5 + bst_rng_uniform(key, 4, t), y = 150 + bst_rng_uniform(key, 5, t);
        synthetic_clear(&s);
        synthetic_add(&s, x, y, 3000, 0, 0);
        expose(&s, key, 10 + t);
        bst_imgproc_frame frame = synthetic_frame(&s);
        bst_assert_ok(&ctx, t % 2 == 0 ? bst_imgproc_detect(&ctx, ip, &frame, NULL, d, 2048)
                                       : bst_imgproc_detect_windows(
                                             &ctx, ip, &frame, &(bst_imgproc_windows){&window, 1},
                                             NULL, d, 2048));
        int n = synthetic_nearest(d, x, y, 1.0);
        assert_true(n >= 0);
        const bst_detection *found = &d->items[n];
        double dx = found->x_px - x, dy = found->y_px - y,
               df = (found->flux_e - 3000) / found->flux_sigma_e;
        chi2 += dx * dx / found->cov_xx + dy * dy / found->cov_yy;
        flux2 += df * df;
        alarms += d->count - 1;
    }
    /* 15 frames and 15 tenths of one, one a frame: 16.5 and 4 sigma */
    assert_true(alarms <= 33);
    /* 60 and 30 degrees of freedom, 4 sigma */
    assert_true(chi2 / (2 * FRAMES) < 1.0 + 4.0 * sqrt(2.0 / (2 * FRAMES)));
    assert_true(flux2 / FRAMES < 1.0 + 4.0 * sqrt(2.0 / FRAMES));
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

/* Left to the camera, levels are taken off a frame transfer's and uneven columns', and of no
 * other; the configuration's word comes first. */
static void wanted(void **state) {
    (void)state;
    synthetic s;
    synthetic_init(&s, 64, 64);
    for (int k = 0; k < 4; k++) {
        s.camera.detector.frame_transfer_s = k == 1 ? 0.01 : 0.0;
        /* of 8 e- of read noise: an eighth, and a quarter */
        s.camera.detector.column_offset_rms_e = k == 2 ? 1.0 : k == 3 ? 2.0 : 0.0;
        s.config.column_correction = BST_COLUMN_LEVEL_AUTO;
        assert_int_equal(bst_column_level_wanted(s.config.column_correction, &s.camera),
                         k == 1 || k == 3);
        s.config.column_correction = BST_COLUMN_LEVEL_ON;
        assert_true(bst_column_level_wanted(s.config.column_correction, &s.camera));
        s.config.column_correction = BST_COLUMN_LEVEL_OFF;
        assert_false(bst_column_level_wanted(s.config.column_correction, &s.camera));
    }
    synthetic_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels),
        cmocka_unit_test(wanted),
        cmocka_unit_test(false_alarms_and_sources),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
