/* Stars whose streaks are longer than is filtered for: found by the path of a known motion. */
#include <stdlib.h>

#include "imgproc/streak/star_path.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 224, NODES = 11, STARS = 9, POINTS = 3 };

/* A bent motion of 120 px that slows down. */
static void bent_motion(bst_star_path_node nodes[NODES]) {
    for (int k = 0; k < NODES; k++) {
        double t = (double)k / (NODES - 1), u = 2.0 * (1.3 * t - 0.3 * t * t) - 1.0;
        nodes[k] = (bst_star_path_node){t, 58.0 * u, 20.0 * u + 14.0 * u * u};
    }
}

/* Its mean place. */
static void mean_of(const bst_star_path_node nodes[NODES], double mean[2]) {
    mean[0] = mean[1] = 0.0;
    for (int k = 1; k < NODES; k++) {
        mean[0] += 0.5 * (nodes[k].x_px + nodes[k - 1].x_px) / (NODES - 1);
        mean[1] += 0.5 * (nodes[k].y_px + nodes[k - 1].y_px) / (NODES - 1);
    }
}

static void test_path_of_a_motion(void **state) {
    (void)state;
    bst_star_path_node nodes[NODES];
    bst_star_path path = {.centre = {100.0, 100.0}};
    double mean[2], light = 0.0, place[2] = {0.0, 0.0};
    bent_motion(nodes);
    mean_of(nodes, mean);
    assert_true(bst_star_path_of_motion(&path, nodes, NODES));
    for (int k = 0; k < path.count; k++) {
        light += path.light[k];
        place[0] += path.light[k] * path.place[k][0];
        place[1] += path.light[k] * path.place[k][1];
        double step = k == 0 ? BST_STAR_PATH_STEP_PX
                             : hypot(path.place[k][0] - path.place[k - 1][0],
                                     path.place[k][1] - path.place[k - 1][1]);
        /* the path is divided evenly; corners between nodes cut the chords */
        bst_assert_close(step, BST_STAR_PATH_STEP_PX, 0.05);
    }
    bst_assert_close(light, path.count, 1e-9);          /* sum of shares */
    bst_assert_close(place[0] / path.count, 0.0, 0.05); /* samples of 2 px */
    bst_assert_close(place[1] / path.count, 0.0, 0.05);
    bst_assert_close(path.ends[0][0], nodes[0].x_px - mean[0], 1e-9);
    bst_assert_close(path.ends[1][1], nodes[NODES - 1].y_px - mean[1], 1e-9);
    /* it slows down: light grows with the time spent */
    assert_true(path.light[path.count - 2] > 1.3 * path.light[1]);
    const bst_star_path_node rest[2] = {{0.0, 1.0, 1.0}, {1.0, 1.0, 1.0}};
    const bst_star_path_node far[2] = {{0.0, 0.0, 0.0}, {1.0, 5000.0, 0.0}};
    assert_false(bst_star_path_of_motion(&path, rest, 2));
    assert_false(bst_star_path_of_motion(&path, far, 2));
}

/* Draws a star along the motion about its mean place. */
static void add_star(synthetic *s, const bst_star_path_node nodes[NODES], const double mean[2],
                     double x, double y, double flux_e) {
    for (int k = 1; k < NODES; k++) {
        double dx = nodes[k].x_px - nodes[k - 1].x_px, dy = nodes[k].y_px - nodes[k - 1].y_px;
        synthetic_add(s, x + nodes[k - 1].x_px + 0.5 * dx - mean[0],
                      y + nodes[k - 1].y_px + 0.5 * dy - mean[1], flux_e / (NODES - 1), dx, dy);
    }
}

static void test_stars_points_and_edges(void **state) {
    (void)state;
    static const struct {
        double x, y, flux_e;
        bool cut;
    } stars[STARS] = {
        {110, 40, 60000, false},  {130, 90, 12000, false}, {100, 130, 8000, false},
        {118, 170, 30000, false}, {125, 97, 9000, false}, /* crosses the second one closely */
        {20, 150, 20000, true},   {-25, 60, 60000, true}, /* mean places outside: */
        {235, 190, 40000, true},  {215, 60, 25000, true},
    };
    double points[POINTS][2] = {{60.3, 200.6}, {170.7, 20.2}, {0.0, 0.0}};
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    bst_star_path_node nodes[NODES];
    double mean[2];
    bent_motion(nodes);
    mean_of(nodes, mean);
    for (int i = 0; i < STARS; i++) {
        add_star(&s, nodes, mean, stars[i].x, stars[i].y, stars[i].flux_e);
    }
    /* the last one on the streak of a faint star */
    points[2][0] = stars[2].x + nodes[7].x_px - mean[0];
    points[2][1] = stars[2].y + nodes[7].y_px - mean[1];
    for (int i = 0; i < POINTS; i++) {
        synthetic_add(&s, points[i][0], points[i][1], 1200.0, 0.0, 0.0);
    }
    synthetic_expose(&s, bst_rng_make_key(26, 0, "test", "long_streaks"), 1);
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    bst_imgproc_frame frame = synthetic_frame(&s);
    bst_camera_motion motion = synthetic_motion(&s, 116.0, 40.0);
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, d, 2048));
    assert_true(bst_imgproc_smeared(ip));
    int fragments = d->count;
    bool followed;
    const bst_star_path_node rest[2] = {{0.0, 1.0, 1.0}, {1.0, 1.0, 1.0}};
    bst_assert_ok(&ctx, bst_imgproc_follow_streaks(&ctx, ip, rest, 2, d, 2048, &followed));
    assert_false(followed);
    assert_int_equal(d->count, fragments);
    bst_assert_ok(&ctx, bst_imgproc_follow_streaks(&ctx, ip, nodes, NODES, d, 2048, &followed));
    assert_true(followed);
    assert_true(synthetic_sound(d));
    for (int i = 0; i < STARS; i++) {
        /* SNR of 20 and more: 0.1 px of noise, and the filter's samples at whole pixels */
        int k = synthetic_nearest(d, stars[i].x, stars[i].y, 1.0);
        assert_true(k >= 0);
        const bst_detection *p = &d->items[k];
        assert_true(bst_imgproc_is_followed(ip, p));
        assert_int_equal((p->flags & BST_DETECTION_EDGE) != 0, stars[i].cut);
        /* Hogbom's subtraction of crossing stars, and the PSF over the filter's pixels: 10 % */
        bst_assert_close(p->flux_e, stars[i].flux_e, 0.1 * stars[i].flux_e + 4.0 * p->flux_sigma_e);
        bst_assert_close(p->length_px, bst_imgproc_streak_px(ip), 0.0);
    }
    for (int i = 0; i < POINTS; i++) {
        int k = synthetic_nearest(d, points[i][0], points[i][1], 1.0);
        assert_true(k >= 0);
        assert_false(bst_imgproc_is_followed(ip, &d->items[k]));
    }
    /* nothing else: neither ghosts of bright streaks nor fragments, but for one false alarm */
    assert_true(d->count <= STARS + POINTS + 1);
    assert_true(fragments > d->count);
    /* a star of the limit at SNR 6 has six times the noise of a streak's flux */
    double v6 = bst_imgproc_v_limit(ip, 6.0), v60 = bst_imgproc_v_limit(ip, 60.0);
    bst_assert_close(v6 - v60, 2.5, 1e-9);
    bst_imgproc_free(ip);
    free(d);
    synthetic_free(&s);
}

/* Detections of a frame whose signal is not kept are the same, also after a frame with a signal. */
static void test_detections_only(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    bst_star_path_node nodes[NODES];
    double mean[2];
    bent_motion(nodes);
    mean_of(nodes, mean);
    add_star(&s, nodes, mean, 110.0, 45.0, 60000.0);
    add_star(&s, nodes, mean, 95.0, 140.0, 30000.0);
    synthetic_add(&s, 170.7, 20.2, 1200.0, 0.0, 0.0);
    synthetic_expose(&s, bst_rng_make_key(28, 0, "test", "long_streaks"), 1);
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *kept = synthetic_detections(2048), *only = synthetic_detections(2048);
    bst_imgproc_frame frame = synthetic_frame(&s);
    bst_camera_motion motion = synthetic_motion(&s, 116.0, 40.0);
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, kept, 2048));
    assert_true(bst_imgproc_smeared(ip) && kept->count > 3);
    bst_stack_frame signal = bst_imgproc_stack_frame(ip, 0.0, BST_QUAT_IDENTITY);
    /* values that no frame has: neither read nor written again */
    float *pixels = (float *)signal.signal;
    for (int i = 0; i < SIDE * SIDE; i++) {
        pixels[i] = 1e9f;
    }
    frame.detections_only = true;
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, only, 2048));
    for (int i = 0; i < SIDE * SIDE; i++) {
        assert_true(pixels[i] == 1e9f);
    }
    assert_int_equal(only->count, kept->count);
    assert_memory_equal(only->items, kept->items, (size_t)only->count * sizeof only->items[0]);
    bst_imgproc_free(ip);
    free(kept);
    free(only);
    synthetic_free(&s);
}

/* The same pixels as those of a finer sensor that are binned, in a window off its corner: the same
 * streaks, in its pixels. */
static void test_binned_pixels_in_a_window(void **state) {
    (void)state;
    enum { LEFT = 12, TOP = 30 };
    bst_ctx ctx = {0};
    bst_star_path_node nodes[NODES];
    double mean[2];
    bst_detections *seen[3];
    bent_motion(nodes);
    mean_of(nodes, mean);
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    add_star(&s, nodes, mean, 110.0, 45.0, 60000.0);
    add_star(&s, nodes, mean, 95.0, 140.0, 30000.0);
    synthetic_expose(&s, bst_rng_make_key(27, 0, "test", "long_streaks"), 1);
    for (int b = 1; b <= 3; b++) {
        synthetic o = s;
        int left = b > 1 ? LEFT : 0, top = b > 1 ? TOP : 0;
        o.camera.width_px = 2 * left + b * SIDE;
        o.camera.height_px = 2 * top + b * SIDE;
        o.camera.pixel_scale_arcsec /= b;
        o.camera.psf_fwhm_px *= b;
        o.camera.full_well_e /= b * b;
        bst_imgproc *ip = synthetic_processor(&ctx, &o);
        bst_detections *d = seen[b - 1] = synthetic_detections(2048);
        const bst_imgproc_frame frame = {.pixels = s.pixels,
                                         .window = {left, top, b * SIDE, b * SIDE},
                                         .binning = b,
                                         .bits = 16,
                                         .exposure_s = 0.5};
        bst_camera_motion motion = synthetic_motion(&o, 116.0 * b, 40.0 * b);
        bst_star_path_node finer[NODES];
        for (int k = 0; k < NODES; k++) {
            finer[k] = (bst_star_path_node){nodes[k].time, b * nodes[k].x_px, b * nodes[k].y_px};
        }
        bool followed;
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, d, 2048));
        bst_assert_ok(&ctx, bst_imgproc_follow_streaks(&ctx, ip, finer, NODES, d, 2048, &followed));
        assert_true(followed);
        for (int i = 0; i < 2; i++) {
            double x = i == 0 ? 110.0 : 95.0, y = i == 0 ? 45.0 : 140.0;
            int one = synthetic_nearest(seen[0], x, y, 1.0);
            int k = synthetic_nearest(d, left + b * x + 0.5 * (b - 1), top + b * y + 0.5 * (b - 1),
                                      1.0 * b);
            assert_true(one >= 0 && k >= 0);
            const bst_detection *p = &seen[0]->items[one], *q = &d->items[k];
            bst_assert_close((q->x_px - left - 0.5 * (b - 1)) / b, p->x_px, 0.02);
            bst_assert_close((q->y_px - top - 0.5 * (b - 1)) / b, p->y_px, 0.02);
            bst_assert_close(q->cov_xx / (b * b * p->cov_xx), 1.0, 0.02);
            bst_assert_close(q->cov_xy / (b * b * p->cov_xy), 1.0, 0.02);
            bst_assert_close(q->cov_yy / (b * b * p->cov_yy), 1.0, 0.02);
            bst_assert_close(q->flux_e / p->flux_e, 1.0, 0.02);
            bst_assert_close(q->snr / p->snr, 1.0, 0.02);
            bst_assert_close(q->length_px / (b * p->length_px), 1.0, 0.02);
            bst_assert_close(q->width_px / (b * p->width_px), 1.0, 0.02);
            bst_assert_close(q->angle_rad, p->angle_rad, 0.01);
            bst_assert_close(q->v_mag, p->v_mag, 0.02);
            /* from upper left to lower right: vague along it */
            assert_true(q->cov_xy > 0.0 && q->cov_xx > q->cov_yy);
            bst_assert_close(q->angle_rad, atan2(40.0, 116.0), 0.01);
        }
        bst_imgproc_free(ip);
    }
    for (int b = 0; b < 3; b++) {
        free(seen[b]);
    }
    synthetic_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_path_of_a_motion),
        cmocka_unit_test(test_stars_points_and_edges),
        cmocka_unit_test(test_detections_only),
        cmocka_unit_test(test_binned_pixels_in_a_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
