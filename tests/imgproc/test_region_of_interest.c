/* Windows of a frame: where they lie, and that what is found in them is what the whole frame shows.
 */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/detect/region_of_interest.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

static bool overlap(const bst_window *a, const bst_window *b) {
    return a->x0 < b->x0 + b->width && b->x0 < a->x0 + a->width && a->y0 < b->y0 + b->height &&
           b->y0 < a->y0 + a->height;
}

/* Whatever is asked for, the windows are apart, inside the frame, along its binned pixels, and hold
 * every place that was asked for. */
static void windows_are_apart_and_hold_all(void **state) {
    (void)state;
    for (uint64_t trial = 0; trial < 500; trial++) {
        bst_rng_key key = bst_rng_make_key(trial, 0, "test", "windows");
        uint64_t u = 0;
        int binning = 1 + (int)(3.0 * bst_rng_uniform(key, 0, u++));
        bst_window frame = {17, 40, 900 + (int)(100 * bst_rng_uniform(key, 0, u++)), 700};
        bst_region_of_interest w = {0};
        double place[40][2];
        int count = 0;
        int64_t tracks = 0;
        for (int i = 0; i < 40; i++) {
            double x = -50 + 1100 * bst_rng_uniform(key, 0, u++);
            double y = -50 + 900 * bst_rng_uniform(key, 0, u++);
            bool inside = x >= frame.x0 && x <= frame.x0 + frame.width - binning && y >= frame.y0 &&
                          y <= frame.y0 + frame.height - binning;
            double half_x = 5 + 30 * bst_rng_uniform(key, 0, u++);
            double half_y = 5 + 30 * bst_rng_uniform(key, 0, u++);
            const bst_searched_window why = {.reason = BST_REGION_TRACK,
                                             .track_id = inside ? ++tracks : 1000,
                                             .x_px = x,
                                             .y_px = y};
            bool added = bst_region_of_interest_add(&w, &frame, &why, half_x, half_y);
            assert_true(added || !inside);
            if (inside) {
                place[count][0] = x;
                place[count++][1] = y;
            }
        }
        assert_true(bst_region_of_interest_settle(&w, &frame, binning, 1.0));
        double area = 0.0;
        for (int i = 0; i < w.count; i++) {
            const bst_window *a = &w.items[i];
            assert_true(a->x0 >= frame.x0 && a->y0 >= frame.y0 && a->width > 0 && a->height > 0);
            assert_true(a->x0 + a->width <= frame.x0 + frame.width);
            assert_true(a->y0 + a->height <= frame.y0 + frame.height);
            assert_int_equal((a->x0 - frame.x0) % binning, 0);
            assert_int_equal((a->y0 - frame.y0) % binning, 0);
            assert_int_equal(a->width % binning, 0);
            assert_int_equal(a->height % binning, 0);
            area += a->width * a->height;
            for (int j = 0; j < i; j++) {
                assert_false(overlap(a, &w.items[j]));
            }
        }
        for (int i = 0; i < count; i++) {
            assert_true(bst_region_of_interest_hold(&w, place[i][0], place[i][1], 0.5));
        }
        /* each place that was asked for is the reason of the window that has it */
        int reasons = 0;
        for (int i = 0; i < w.planned_count; i++) {
            const bst_searched_window *r = &w.planned[i];
            assert_in_range(r->number, 0, w.count - 1);
            assert_memory_equal(&r->window, &w.items[r->number], sizeof r->window);
            if (r->track_id < 1000) {
                assert_true(r->x_px == place[r->track_id - 1][0]);
                assert_true(r->x_px >= r->window.x0 - 0.5 &&
                            r->x_px <= r->window.x0 + r->window.width - 0.5);
                assert_true(r->y_px >= r->window.y0 - 0.5 &&
                            r->y_px <= r->window.y0 + r->window.height - 0.5);
                reasons++;
            }
        }
        assert_int_equal(reasons, count);
        double share = area / ((double)frame.width * frame.height);
        assert_false(bst_region_of_interest_settle(&w, &frame, binning, 0.9 * share));
    }
    bst_region_of_interest none = {0};
    bst_window frame = {0, 0, 100, 100};
    const bst_searched_window outside = {.x_px = 150, .y_px = 50};
    assert_false(bst_region_of_interest_add(&none, &frame, &outside, 20, 20));
    assert_int_equal(none.planned_count, 0);
    assert_false(bst_region_of_interest_settle(&none, &frame, 1, 1.0));
}

/* Streaks and points in windows of 64 px: found where and as the whole frame shows them. */
static void windows_show_what_the_frame_shows(void **state) {
    (void)state;
    enum { SIDE = 512, STARS = 9 };
    for (int streaks = 0; streaks < 2; streaks++) {
        bst_ctx ctx = {0};
        synthetic s;
        synthetic_init(&s, SIDE, SIDE);
        synthetic_clear(&s);
        bst_rng_key key = bst_rng_make_key(5, 0, "test", "windows");
        double dx = streaks ? 7.0 : 0.0, dy = streaks ? -4.0 : 0.0, place[STARS][2];
        bst_window windows[STARS];
        for (int i = 0; i < STARS; i++) {
            place[i][0] = 70.0 + 160.0 * (i % 3) + 10.0 * bst_rng_uniform(key, 1, 2 * (uint64_t)i);
            place[i][1] =
                80.0 + 150.0 * (i / 3) + 10.0 * bst_rng_uniform(key, 1, 2 * (uint64_t)i + 1);
            synthetic_add(&s, place[i][0], place[i][1], 2000.0 * pow(1.7, i), dx, dy);
            windows[i] = (bst_window){(int)place[i][0] - 32, (int)place[i][1] - 32, 64, 64};
        }
        /* pixels that are not read */
        synthetic_add(&s, 160.0, 160.0, 3e4, dx, dy);
        synthetic_expose(&s, key, 1);
        bst_camera_motion motion = synthetic_motion(&s, dx, dy);
        bst_imgproc *ip = synthetic_processor(&ctx, &s);
        bst_detections *all = synthetic_detections(500), *some = synthetic_detections(500);
        bst_imgproc_frame frame = synthetic_frame(&s);
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, all, 500));
        bst_assert_ok(&ctx, bst_imgproc_detect_windows(&ctx, ip, &frame,
                                                       &(bst_imgproc_windows){windows, STARS},
                                                       &motion, some, 500));
        assert_true(synthetic_sound(some));
        assert_int_equal(synthetic_nearest(some, 160.0, 160.0, 20.0), -1);
        assert_true(synthetic_nearest(all, 160.0, 160.0, 1.0) >= 0);
        bst_assert_close(some->threshold_snr, all->threshold_snr, 1e-9);
        bst_assert_close(some->noise_e / all->noise_e, 1.0, 0.03); /* 4096 px a window: 1 % */
        for (int i = 0; i < STARS; i++) {
            int a = synthetic_nearest(all, place[i][0], place[i][1], 1.0);
            int b = synthetic_nearest(some, place[i][0], place[i][1], 1.0);
            assert_true(a >= 0 && b >= 0);
            const bst_detection *p = &all->items[a], *q = &some->items[b];
            /* the same pixels with another estimate of the background, and of the motion from one
             * star less */
            double sigma = sqrt(p->cov_xx + p->cov_yy);
            assert_true(hypot(p->x_px - q->x_px, p->y_px - q->y_px) < 0.3 * sigma);
            bst_assert_close(q->cov_xx / p->cov_xx, 1.0, 0.1);
            bst_assert_close(q->flux_e / p->flux_e, 1.0, 0.05);
        }
        free(all);
        free(some);
        bst_imgproc_free(ip);
        synthetic_free(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(windows_are_apart_and_hold_all),
                                       cmocka_unit_test(windows_show_what_the_frame_shows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
