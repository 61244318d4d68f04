/* Motion that the telemetry gets wrong, measured on the stars' own streaks. */
#include "boresight/rng.h"
#include "synthetic.h"
#include "tests/test_support.h"

enum { FRAMES = 24, STARS = 12, SIDE = 256, PIECES = 60 };

typedef struct figures {
    double shift2; /* mean square, over frames, of the stars' mean error along the path */
    double along, across, xy; /* mean squares of errors over stated sigma, and of their product */
    double stated_xy;         /* mean stated correlation of along and across */
} figures;

/* Stars that move by (dx, dy) with a bend of `bend_px` (1 sigma, drawn for each frame) along it,
 * while the telemetry says (said_x, said_y) and no bend. */
static figures measure(double dx, double dy, double said_x, double said_y, double bend_px) {
    figures out = {0};
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(200);
    bst_camera_motion motion = synthetic_motion(&s, said_x, said_y);
    motion.bend_sigma_rad = bend_px * bst_camera_scale_rad(&s.camera);
    double length = hypot(dx, dy), ex = dx / length, ey = dy / length;
    int n = 0;
    for (uint64_t frame = 0; frame < FRAMES; frame++) {
        bst_rng_key key = bst_rng_make_key(frame, 0, "test", "streak_motion");
        double draw[2], place[STARS][2], mean = 0.0;
        bst_rng_normal2(key, 0, 0, draw);
        double bend = bend_px * draw[0];
        synthetic_clear(&s);
        for (int i = 0; i < STARS; i++) {
            place[i][0] = 40.0 + 58.0 * (i % 4) + bst_rng_uniform(key, 1, 2 * (uint64_t)i);
            place[i][1] = 50.0 + 70.0 * (i / 4) + bst_rng_uniform(key, 1, 2 * (uint64_t)i + 1);
            for (int k = 0; k < PIECES; k++) {
                double u = (2.0 * k + 1.0) / PIECES - 1.0;
                double way = 0.5 * length * u + bend * (1.5 * u * u - 0.5);
                synthetic_add(&s, place[i][0] + way * ex, place[i][1] + way * ey, 3e4 / PIECES, 0,
                              0);
            }
        }
        synthetic_expose(&s, key, frame);
        bst_imgproc_frame f = synthetic_frame(&s);
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, &motion, d, 200));
        for (int i = 0; i < STARS; i++) {
            int k = synthetic_nearest(d, place[i][0], place[i][1], 2.0);
            assert_true(k >= 0);
            const bst_detection *item = &d->items[k];
            double x = item->x_px - place[i][0], y = item->y_px - place[i][1];
            double al = x * ex + y * ey, ac = y * ex - x * ey;
            double saa =
                ex * ex * item->cov_xx + 2 * ex * ey * item->cov_xy + ey * ey * item->cov_yy;
            double scc =
                ey * ey * item->cov_xx - 2 * ex * ey * item->cov_xy + ex * ex * item->cov_yy;
            double sac =
                ex * ey * (item->cov_yy - item->cov_xx) + (ex * ex - ey * ey) * item->cov_xy;
            out.along += al * al / saa;
            out.across += ac * ac / scc;
            out.xy += al * ac / sqrt(saa * scc);
            out.stated_xy += sac / sqrt(saa * scc);
            mean += al / STARS;
            n++;
        }
        out.shift2 += mean * mean / FRAMES;
    }
    out.along /= n;
    out.across /= n;
    out.xy /= n;
    out.stated_xy /= n;
    print_message("shift %.4f px, along %.3f, across %.3f, product %.3f, stated %.3f\n",
                  sqrt(out.shift2), out.along, out.across, out.xy, out.stated_xy);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
    return out;
}

/* Platform drift of 1 px an exposure across the path that the telemetry reports: the error ellipses
 * lie along the path that is, and are right. 288 errors: variances to 8 %, correlations to 0.06. */
static void drift_is_seen(void **state) {
    (void)state;
    figures f = measure(-3.3, 7.8, -4.2, 7.4, 0.0);
    bst_assert_close(f.along, 1.0, 0.2);
    bst_assert_close(f.across, 1.0, 0.2);
    bst_assert_close(f.xy, 0.0, 0.15);
    /* the telemetry's path lies 0.11 rad off: 0.2 with that */
    assert_true(fabs(f.stated_xy) < 0.02);
}

/* A bend within what the telemetry's noise hides, 0.15 px: uncorrected it would shift all stars by
 * 0.38 of that, 0.06 px; the stars' own error of the mean is 0.017 / sqrt(12) = 0.005 px, and the
 * bend's error adds as much again. */
static void bend_is_seen(void **state) {
    (void)state;
    figures f = measure(-3.3, 7.8, -3.3, 7.8, 0.15);
    assert_true(sqrt(f.shift2) < 0.012);
    bst_assert_close(f.across, 1.0, 0.2);
}

/* Shared variance along streaks of 12 px in a frame without stars, of which nothing is measured. */
static double shared_along(double own_px, double jitter_px, double telemetry_px) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, 128, 128);
    s.config.motion_bend_px = own_px;
    s.config.jitter_px = jitter_px;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(200);
    bst_camera_motion motion = synthetic_motion(&s, 0.0, 12.0);
    motion.bend_sigma_rad = telemetry_px * bst_camera_scale_rad(&s.camera);
    synthetic_expose(&s, bst_rng_make_key(1, 0, "test", "streak_motion"), 0);
    bst_imgproc_frame f = synthetic_frame(&s);
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, &motion, d, 200));
    double along = d->shared_yy;
    assert_true(d->shared_xx < 0.1 * along + 1e-12);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
    return along;
}

/* `motion_bend_px` is a bend as the telemetry's is: its square adds to that and to the square of
 * 0.075 of the jitter. */
static void bend_of_its_own_is_shared(void **state) {
    (void)state;
    const double one = shared_along(0.1, 0.0, 0.0);
    assert_true(one > 1e-4 && one < 0.01);
    bst_assert_close(shared_along(0.0, 0.0, 0.0), 0.0, 1e-12);
    bst_assert_close(shared_along(0.5, 0.0, 0.0) / one, 25.0, 1e-6);
    bst_assert_close(shared_along(0.0, 0.0, 0.1) / one, 1.0, 1e-6);
    bst_assert_close(shared_along(0.3, 0.0, 0.4) / one, 25.0, 1e-6);
    /* the jitter also widens the PSF, so that streaks of 12 px show a little less of a bend */
    bst_assert_close(shared_along(0.3, 4.0, 0.0) / shared_along(0.0, 4.0, 0.0), 2.0, 1e-6);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(drift_is_seen),
                                       cmocka_unit_test(bend_is_seen),
                                       cmocka_unit_test(bend_of_its_own_is_shared)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
