/* What the search for streaks leaves out of its map: tracks of charge in all directions from one
 * end to the other and not more, and discs about points. Linked with a wrap that keeps the
 * segments. */
#include <stdlib.h>

#include "imgproc/streak/streak_map.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 256, ACROSS = 4, SPACING = 60, FIRST = 38, MOST = 200 };

static double kept[MOST][5];
static int kept_count;

void __wrap_bst_streak_map_blank(bst_streak_map *map, double x0, double y0, double x1, double y1,
                                 double radius_px);
void __wrap_bst_streak_map_blank(bst_streak_map *map, double x0, double y0, double x1, double y1,
                                 double radius_px) {
    (void)map;
    assert_true(kept_count < MOST);
    const double segment[5] = {x0, y0, x1, y1, radius_px};
    memcpy(kept[kept_count++], segment, sizeof segment);
}

/* Adds the same charge to each of the pixels that a straight track crosses. */
static void add_track(synthetic *s, double x, double y, double dx, double dy) {
    int last = -1, steps = (int)(20.0 * hypot(dx, dy));
    for (int k = 0; k <= steps; k++) {
        double t = (double)k / steps - 0.5;
        int u = (int)floor(x + t * dx + 0.5), v = (int)floor(y + t * dy + 0.5);
        if (v * s->width + u != last) {
            last = v * s->width + u;
            s->mean_e[last] += 600.0;
        }
    }
}

static void tracks_of_charge(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.config.streak_search_px = 64.0;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    double track[ACROSS * ACROSS][4];
    for (int k = 0; k < ACROSS * ACROSS; k++) {
        double angle = BST_PI * (k + 0.3) / (ACROSS * ACROSS), length = 10.0 + k;
        double *t = track[k];
        t[0] = FIRST + SPACING * (k % ACROSS) + 0.3;
        t[1] = FIRST + SPACING * (double)(k / ACROSS) - 0.2;
        t[2] = length * cos(angle);
        t[3] = length * sin(angle);
        add_track(&s, t[0], t[1], t[2], t[3]);
    }
    synthetic_expose(&s, bst_rng_make_key(9, 0, "test", "masks"), 1);
    bst_imgproc_frame frame = synthetic_frame(&s);
    kept_count = 0;
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, NULL, d, 2048));
    for (int k = 0; k < ACROSS * ACROSS; k++) {
        const double *t = track[k];
        int seen = 0;
        for (int n = 0; n < kept_count; n++) {
            const double *m = kept[n], x = 0.5 * (m[0] + m[2]), y = 0.5 * (m[1] + m[3]);
            if (hypot(x - t[0], y - t[1]) > 3.0) {
                continue;
            }
            seen++;
            /* the length of a uniform track, in whole pixels: one at either end */
            double sign = (m[2] - m[0]) * t[2] + (m[3] - m[1]) * t[3] < 0.0 ? -1.0 : 1.0;
            bst_assert_close(x, t[0], 0.7);
            bst_assert_close(y, t[1], 0.7);
            bst_assert_close(sign * (m[2] - m[0]), t[2], 2.0);
            bst_assert_close(sign * (m[3] - m[1]), t[3], 2.0);
            assert_true(m[4] > 2.0 && m[4] < 6.0);
        }
        assert_true(seen > 0);
    }
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

/* Points are left out to where a matched-filtered Gaussian, SNR exp(-r^2 / (4 sigma^2)), has fallen
 * to half a standard deviation, with a margin of up to a quarter and a pixel. */
static void points_of_all_brightnesses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.config.streak_search_px = 64.0;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    const double noise = synthetic_noise(&s), sigma = 2.0 / BST_FWHM_PER_SIGMA;
    double place[ACROSS * ACROSS][2], snr[ACROSS * ACROSS];
    for (int k = 0; k < ACROSS * ACROSS; k++) {
        place[k][0] = FIRST + SPACING * (k % ACROSS) + 0.07 * k;
        place[k][1] = FIRST + SPACING * (double)(k / ACROSS) - 0.03 * k;
        snr[k] = 12.0 * pow(1.3, k);
        double norm = synthetic_norm(&s, place[k][0], place[k][1], 0.0, 0.0);
        synthetic_add(&s, place[k][0], place[k][1], snr[k] * noise / norm, 0.0, 0.0);
    }
    synthetic_expose(&s, bst_rng_make_key(5, 0, "test", "masks"), 1);
    bst_imgproc_frame frame = synthetic_frame(&s);
    kept_count = 0;
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, NULL, d, 2048));
    for (int k = 0; k < ACROSS * ACROSS; k++) {
        int seen = 0;
        for (int n = 0; n < kept_count; n++) {
            const double *m = kept[n];
            if (hypot(m[0] - place[k][0], m[1] - place[k][1]) > 2.0) {
                continue;
            }
            seen++;
            bst_assert_close(m[2], m[0], 0.0);
            bst_assert_close(m[3], m[1], 0.0);
            bst_assert_close(m[0], place[k][0], 0.5);
            bst_assert_close(m[1], place[k][1], 0.5);
            /* SNR differ by noise and by the pixel's share in the width: an eighth */
            double least = 2.0 * sigma * sqrt(log(2.0 * 0.85 * snr[k]));
            double most = 2.0 * sigma * sqrt(log(2.0 * 1.15 * snr[k]));
            assert_true(m[4] > least && m[4] < 1.25 * most + 1.0);
        }
        assert_true(seen > 0);
    }
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tracks_of_charge),
                                       cmocka_unit_test(points_of_all_brightnesses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
