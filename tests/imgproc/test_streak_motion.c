/* Motion that the telemetry gets wrong, measured on the stars' own streaks. */
#include "boresight/rng.h"
#include "synthetic.h"
#include "tests/test_support.h"

enum { MOST_FRAMES = 24, FEW = 8, STARS = 12, SIDE = 256, PIECES = 60 };

typedef struct figures {
    double shift2; /* mean square, over frames, of the stars' mean error along the path */
    double along, across, xy; /* mean squares of errors over stated sigma, and of their product */
    double stated_xy;         /* mean stated correlation of along and across */
    double length, angle;     /* mean streak; px of the frame */
    double shared;            /* mean shared variance, both axes together; px^2 of the frame */
} figures;

/* Stars that move by (dx, dy) with a bend of `bend_px` (1 sigma, drawn for each frame) along it,
 * while the telemetry says (said_x, said_y) and no bend. Lengths are in pixels of the frame, each
 * of which is `binning` x `binning` pixels of the sensor. */
static figures measure(double dx, double dy, double said_x, double said_y, double bend_px,
                       int binning, int frames) {
    const double b = binning;
    figures out = {0};
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    synthetic finer = s;
    finer.camera.width_px *= binning;
    finer.camera.height_px *= binning;
    finer.camera.pixel_scale_arcsec /= b;
    finer.camera.psf_fwhm_px *= b;
    finer.camera.full_well_e /= b * b;
    bst_imgproc *ip = synthetic_processor(&ctx, &finer);
    bst_detections *d = synthetic_detections(200);
    bst_camera_motion motion = synthetic_motion(&finer, b * said_x, b * said_y);
    motion.bend_sigma_rad = b * bend_px * bst_camera_scale_rad(&finer.camera);
    double length = hypot(dx, dy), ex = dx / length, ey = dy / length;
    int n = 0;
    for (uint64_t frame = 0; frame < (uint64_t)frames; frame++) {
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
        f.binning = binning;
        f.window = (bst_window){0, 0, binning * SIDE, binning * SIDE};
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, &motion, d, 200));
        for (int i = 0; i < STARS; i++) {
            double at_x = b * place[i][0] + 0.5 * (b - 1.0);
            double at_y = b * place[i][1] + 0.5 * (b - 1.0);
            int k = synthetic_nearest(d, at_x, at_y, 2.0 * b);
            assert_true(k >= 0);
            const bst_detection *item = &d->items[k];
            double x = item->x_px - at_x, y = item->y_px - at_y;
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
            mean += al / b / STARS;
            out.length += item->length_px / b;
            out.angle += item->angle_rad;
            n++;
        }
        out.shift2 += mean * mean / frames;
        out.shared += (d->shared_xx + d->shared_yy) / (b * b * frames);
    }
    out.length /= n;
    out.angle /= n;
    out.along /= n;
    out.across /= n;
    out.xy /= n;
    out.stated_xy /= n;
    print_message(
        "length %.4f, angle %.4f, shared %.6f, shift %.4f px, along %.3f, across %.3f, product "
        "%.3f, stated %.3f\n",
        out.length, out.angle, out.shared, sqrt(out.shift2), out.along, out.across, out.xy,
        out.stated_xy);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
    return out;
}

/* Platform drift of 1 px an exposure across the path that the telemetry reports: the error ellipses
 * lie along the path that is, and are right. 288 errors: variances to 8 %, correlations to 0.06. */
static void drift_is_seen(void **state) {
    (void)state;
    figures f = measure(-3.3, 7.8, -4.2, 7.4, 0.0, 1, MOST_FRAMES);
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
    figures f = measure(-3.3, 7.8, -3.3, 7.8, 0.15, 1, MOST_FRAMES);
    assert_true(sqrt(f.shift2) < 0.012);
    bst_assert_close(f.across, 1.0, 0.2);
}

/* Both in pixels of 3 x 3: a drift of 1 px of the sensor, by which the telemetry's path lies 0.04
 * rad off, and a bend of 0.15 px of the frame. In pixels of the frame all is as in a frame that is
 * not binned, in which the drift is as many of its pixels. 96 errors: variances to 14 %. */
static void binned_frames(void **state) {
    (void)state;
    static const double path[2][2] = {{-3.3, 7.8}, {7.8, 3.3}}, drift[2] = {-0.3, 0.13};
    for (int k = 0; k < 2; k++) {
        double dx = path[k][0], dy = path[k][1];
        double x = dx + drift[k], y = dy - drift[1 - k];
        figures f = measure(dx, dy, x, y, 0.15, 3, FEW), one = measure(dx, dy, x, y, 0.15, 1, FEW);
        assert_true(sqrt(f.shift2) < 0.012);
        bst_assert_close(f.along, 1.0, 0.45);
        bst_assert_close(f.across, 1.0, 0.45);
        /* the same pixels: they differ by the weight of the prior drift, 1 px of the sensor. The
         * telemetry's path is off by 0.33 px in length or 0.04 rad in angle */
        bst_assert_close(f.length, one.length, 0.003);
        bst_assert_close(f.angle, one.angle, 0.0005);
        bst_assert_close(f.shared / one.shared, 1.0, 1e-3);
    }
}

/* On streaks of 3.05 px, shorter than 4 sigma of the PSF, no motion is measured, and the bend is
 * not known better than before. */
static void short_streaks_are_left(void **state) {
    (void)state;
    figures one = measure(-1.2, 2.8, -1.2, 2.8, 0.15, 1, 1);
    figures f = measure(-1.2, 2.8, -1.2, 2.8, 0.15, 3, 1);
    figures longer = measure(-1.5, 3.5, -1.5, 3.5, 0.15, 3, 1);
    bst_assert_close(f.shared / one.shared, 1.0, 1e-6);
    assert_true(longer.shared < 0.2 * f.shared); /* 0.13 */
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
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(drift_is_seen), cmocka_unit_test(bend_is_seen),
        cmocka_unit_test(binned_frames), cmocka_unit_test(short_streaks_are_left),
        cmocka_unit_test(bend_of_its_own_is_shared)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
