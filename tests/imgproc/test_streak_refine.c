/* Refinement of a streak's path on maps that are written here: ends, SNR with outliers, points on
 * the path and its evenness, in both planes of a map that is no square. */
#include "imgproc/streak/streak_refine.h"
#include "tests/test_support.h"

enum { WIDTH = 120, HEIGHT = 90 };

static bst_streak_map map;

static void begin(void) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_streak_map_create(&ctx, WIDTH, HEIGHT, true, &map));
    map.width = WIDTH;
    map.height = HEIGHT;
    map.stride[0] = WIDTH + 2 * BST_STREAK_PAD;
    map.stride[1] = HEIGHT + 2 * BST_STREAK_PAD;
    map.radius = 3;
    map.sigma_px = 1.0;
    memset(map.correlation, 0, sizeof map.correlation);
    map.correlation[0] = 1.0; /* independent pixels */
}

/* Adds light at column s, which may lie between two, of row t of a plane. */
static void put(int plane, double s, int t, double sigmas) {
    int16_t *at = map.memory[plane] + (long)(t + BST_STREAK_PAD) * map.stride[plane] +
                  BST_STREAK_PAD + (int)floor(s);
    at[0] = (int16_t)lround(16.0 * sigmas);
    if (s > floor(s)) {
        at[1] = (int16_t)lround(16.0 * sigmas);
    }
}

/* Hit of the bank: ends on the plane's axes. */
static bst_streak_hit hit_of(int plane, double s0, double s1, double top, int rows) {
    bst_streak_hit h = {.plane = (int16_t)plane, .rows = (int16_t)rows};
    h.x0 = (float)(plane ? top : s0);
    h.y0 = (float)(plane ? s0 : top);
    h.x1 = (float)(plane ? top + rows : s1);
    h.y1 = (float)(plane ? s1 : top + rows);
    return h;
}

static void expect_ends(int plane, const bst_streak_line *l, double s0, double t0, double s1,
                        double t1, double tolerance) {
    bst_assert_close(plane ? l->y0 : l->x0, s0, tolerance);
    bst_assert_close(plane ? l->x0 : l->y0, t0, 1e-9);
    bst_assert_close(plane ? l->y1 : l->x1, s1, tolerance);
    bst_assert_close(plane ? l->x1 : l->y1, t1, 1e-9);
}

static void straight_rows(void **state) {
    (void)state;
    for (int plane = 0; plane < 2; plane++) {
        begin();
        for (int t = 20; t < 50; t++) { /* four rows are dark, two are points */
            put(plane, 40.0, t,
                t == 30                          ? 20.0
                : t == 44                        ? 12.0
                : t % 5 == 3 && abs(t - 35) < 10 ? 0.5
                                                 : 3.0);
        }
        put(plane, 60.0, 33, 90.0); /* beside the path */
        const bst_streak_hit h = hit_of(plane, 40.5, 40.5, 17.5, 30);
        bst_streak_line l;
        bst_streak_refine(&map, &h, 100.0, &l);
        /* points weigh more than the rows beside them: a step to either side */
        expect_ends(plane, &l, 40.0, 19.5, 40.0, 49.5, 0.3);
        double sum = 24 * 3.0 + 4 * 0.5 + 32.0, top = sum / 30.0 + 2.5;
        bst_assert_close(l.snr, (24 * 3.0 + 4 * 0.5 + 2.0 * top) / sqrt(30.0), 0.04 * l.snr);
        bst_assert_close(l.point_snr[0], 20.0, 1e-9);
        bst_assert_close(l.point_snr[1], 12.0, 1e-9);
        bst_assert_close(l.filled, 26.0 / 30.0, 1e-9); /* above 0.35 of the mean */
        bst_streak_map_free(&map);
    }
}

static void slanted_rows(void **state) {
    (void)state;
    for (int plane = 0; plane < 2; plane++) {
        for (int side = -1; side <= 1; side += 2) {
            begin();
            for (int t = 30; t < 70; t++) {
                put(plane, 45.0 + side * 0.5 * (t - 50), t, 4.0);
            }
            const bst_streak_hit h =
                hit_of(plane, 45.5 - side * 11.25, 45.5 + side * 8.75, 27.5, 40);
            bst_streak_line l;
            bst_streak_refine(&map, &h, 100.0, &l);
            expect_ends(plane, &l, 45.0 - side * 10.25, 29.5, 45.0 + side * 9.75, 69.5, 1e-6);
            /* half of the rows lie between two columns: half of the variance */
            bst_assert_close(l.snr, 40 * 4.0 / sqrt(40 * 0.75), 1e-3);
            bst_assert_close(l.filled, 1.0, 1e-9);
            /* neighbours within the PSF are correlated, along and across */
            map.correlation[1] = 0.5;
            bst_streak_refine(&map, &h, 100.0, &l);
            double variance = 0.0;
            for (int i = 0; i < 40; i++) {
                for (int k = 0; k < 40; k++) {
                    double a[2] = {0.5 * i, 0.5 * k}, sum = 0.0;
                    for (int n = 0; n < 4; n++) { /* pixels of both interpolations */
                        double fa = a[0] - floor(a[0]), fb = a[1] - floor(a[1]);
                        int ca = (int)floor(a[0]) + n % 2, cb = (int)floor(a[1]) + n / 2;
                        int lag = abs(ca - cb);
                        double w = (n % 2 ? fa : 1.0 - fa) * (n / 2 ? fb : 1.0 - fb);
                        sum += w * (lag == 0 ? 1.0 : lag == 1 ? 0.5 : 0.0);
                    }
                    variance += abs(i - k) == 0 ? sum : abs(i - k) == 1 ? 0.5 * sum : 0.0;
                }
            }
            bst_assert_close(l.snr, 160.0 / sqrt(variance), 0.02 * l.snr);
            bst_streak_map_free(&map);
        }
    }
}

/* No path is longer than it may be. */
static void longest_path(void **state) {
    (void)state;
    begin();
    for (int t = 10; t < 60; t++) {
        put(0, 40.0, t, 3.0);
    }
    const bst_streak_hit h = hit_of(0, 40.0, 40.0, 14.5, 30);
    bst_streak_line l;
    bst_streak_refine(&map, &h, 34.0, &l);
    bst_assert_close(l.y1 - l.y0, 34.0, 1e-9);
    bst_assert_close(l.snr, 3.0 * sqrt(34.0), 1e-3);
    bst_streak_map_free(&map);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(straight_rows),
        cmocka_unit_test(slanted_rows),
        cmocka_unit_test(longest_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
