/* Fragments of a trail that is longer than is filtered for, against the maxima of simulated
 * pixels: a trail's light with its shot noise on an even sky, behind the filter for points. */
#include "boresight/rng.h"
#include "tests/obsgen/generator_scene.h"

enum { WIDE = 300, HIGH = 130, KERNEL = 5 };

typedef struct tally {
    double count, snr, snr2, across2;
} tally;

/* Ends of the trail, 240 px along a slope, in the strip. */
static const double ends[2][2] = {{28.3, 35.2}, {262.6, 87.3}};

static double off_trail(double x, double y) {
    double dx = ends[1][0] - ends[0][0], dy = ends[1][1] - ends[0][1], length = hypot(dx, dy);
    return ((y - ends[0][1]) * dx - (x - ends[0][0]) * dy) / length;
}

static void note(tally *t, double x, double y, double snr) {
    double off = off_trail(x, y);
    t->count += 1.0;
    t->snr += snr;
    t->snr2 += snr * snr;
    t->across2 += off * off;
}

/* A Gaussian line over pixels, its width with that of a pixel. */
static double line_e(double x, double y, double e_per_px, double sigma) {
    double dx = ends[1][0] - ends[0][0], dy = ends[1][1] - ends[0][1], length = hypot(dx, dy);
    double along = ((x - ends[0][0]) * dx + (y - ends[0][1]) * dy) / length;
    double off = off_trail(x, y), root = sigma * sqrt(2.0);
    return e_per_px * exp(-0.5 * off * off / (sigma * sigma)) / sigma / sqrt(2.0 * BST_PI) * 0.5 *
           (erf(along / root) - erf((along - length) / root));
}

static float output[WIDE * HIGH];
static double light[WIDE * HIGH]; /* over the sky's noise */

/* The filter's output in units of the sky's noise. */
static void filter(bst_rng_key key, uint64_t run, double noise_e, double sigma) {
    static float pixel[WIDE * HIGH], rows[WIDE * HIGH];
    double kernel[2 * KERNEL + 1], sum = 0.0;
    for (int k = -KERNEL; k <= KERNEL; k++) {
        kernel[k + KERNEL] = exp(-0.5 * k * k / (sigma * sigma));
        sum += kernel[k + KERNEL] * kernel[k + KERNEL];
    }
    for (int i = 0; i < WIDE * HIGH; i += 2) {
        double z[2];
        bst_rng_normal2(key, run, (uint64_t)i, z);
        for (int k = 0; k < 2; k++) {
            pixel[i + k] = (float)(light[i + k] + z[k] * sqrt(1.0 + light[i + k] / noise_e));
        }
    }
    memset(rows, 0, sizeof rows);
    memset(output, 0, sizeof output);
    for (int y = 0; y < HIGH; y++) {
        for (int x = KERNEL; x < WIDE - KERNEL; x++) {
            for (int k = -KERNEL; k <= KERNEL; k++) {
                rows[y * WIDE + x] += (float)kernel[k + KERNEL] * pixel[y * WIDE + x + k];
            }
        }
    }
    for (int y = KERNEL; y < HIGH - KERNEL; y++) {
        for (int k = -KERNEL; k <= KERNEL; k++) {
            float share = (float)(kernel[k + KERNEL] / sum);
            for (int x = 0; x < WIDE; x++) {
                output[y * WIDE + x] += share * rows[(y + k) * WIDE + x];
            }
        }
    }
}

/* Whether the output stays above a level on the straight way between two pixels. */
static bool is_joined(int a, int b, float level) {
    int dx = b % WIDE - a % WIDE, dy = b / WIDE - a / WIDE;
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    for (int i = 1; i < steps; i++) {
        long x = a % WIDE + lround((double)i * dx / steps),
             y = a / WIDE + lround((double)i * dy / steps);
        if (output[y * WIDE + x] <= level) {
            return false;
        }
    }
    return true;
}

/* Maxima without a higher one near that is joined by a ridge; a saddle must fall by 3 and by 15 %.
 */
static void fragments(double threshold, int reach, tally *t) {
    static int maxima[4000];
    int count = 0;
    for (int y = KERNEL + 1; y < HIGH - KERNEL - 1; y++) {
        for (int x = KERNEL + 1; x < WIDE - KERNEL - 1; x++) {
            float v = output[y * WIDE + x];
            bool top = (double)v > threshold;
            for (int k = 0; k < 9 && top; k++) {
                top = k == 4 || v > output[(y + k / 3 - 1) * WIDE + x + k % 3 - 1];
            }
            if (top && fabs(off_trail(x, y)) < 12.0) {
                maxima[count++] = y * WIDE + x;
            }
        }
    }
    for (int i = 0; i < count; i++) {
        double v = (double)output[maxima[i]];
        float level = (float)fmax(v - fmax(3.0, 0.15 * v), threshold);
        bool kept = true;
        for (int k = 0; k < count && kept; k++) {
            kept = output[maxima[k]] <= output[maxima[i]] ||
                   abs(maxima[k] % WIDE - maxima[i] % WIDE) > reach ||
                   abs(maxima[k] / WIDE - maxima[i] / WIDE) > reach ||
                   !is_joined(maxima[i], maxima[k], level);
        }
        if (kept) {
            note(t, maxima[i] % WIDE, maxima[i] / WIDE, v);
        }
    }
}

/* The same numbers of fragments, of the same mean, spread and distance from the trail, from light
 * below the threshold, at it and above it; down the image and up. */
static void as_in_pixels(void **state) {
    (void)state;
    const double levels[] = {1.9, 3.2, 5.0, 9.0};
    const int runs[] = {170, 40, 30, 30};
    scene s;
    open_scene(&s);
    s.settings.streak_max_px = 40.0;
    s.settings.false_alarms_per_frame = 1.0;
    s.calibration.background_fraction = s.calibration.crowding = 0.0;
    s.frame.streak_dx_px = ends[1][0] - ends[0][0];
    s.frame.streak_dy_px = ends[1][1] - ends[0][1];
    start(&s);
    double sigma = sqrt(s.frame.sigma_px * s.frame.sigma_px + 1.0 / 12.0);
    bst_rng_key key = bst_rng_make_key(9, 0, "test", "fragments");
    for (int k = 0; k < 4; k++) {
        tally drawn = {0}, seen = {0};
        double length = hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
        double noise = 0.0, threshold = 0.0;
        for (int n = 0; n < runs[k]; n++) {
            s.truth->count = 0;
            /* a line's output is its electrons per pixel over the noise of a pixel */
            double e_per_px = levels[k] * (noise > 0.0 ? noise : 10.0);
            bst_truth_item *item = add_source(&s, 5, 0, 0, e_per_px * length);
            double x0 = 500.0, y0 = 400.0;
            item->kind = BST_SOURCE_OBJECT;
            item->x_start_px = x0 + ends[0][0];
            item->y_start_px = y0 + ends[0][1];
            item->x_end_px = x0 + ends[1][0];
            item->y_end_px = y0 + ends[1][1];
            item->x_mid_px = item->x_centroid_px = 0.5 * (item->x_start_px + item->x_end_px);
            item->y_mid_px = item->y_centroid_px = 0.5 * (item->y_start_px + item->y_end_px);
            bst_generator_result r = run(&s, 1000 * k + n);
            noise = r.noise_e;
            threshold = r.filter.threshold;
            for (int i = 0; i < r.count; i++) {
                const bst_detection *d = &r.items[i].detection;
                if (r.items[i].item >= 0 && n > 0) {
                    note(&drawn, d->x_px - x0, d->y_px - y0, d->snr);
                }
            }
        }
        int reach = (int)ceil(6.0 * s.frame.sigma_px) + 2;
        for (int i = 0; i < WIDE * HIGH; i++) {
            light[i] = line_e(i % WIDE, i / WIDE, levels[k], sigma);
        }
        for (uint64_t n = 1; n < (uint64_t)runs[k]; n++) {
            filter(key, 1000 * (uint64_t)k + n, noise, sigma);
            fragments(threshold, reach, &seen);
        }
        double snr[2] = {drawn.snr / drawn.count, seen.snr / seen.count};
        double spread[2] = {sqrt(drawn.snr2 / drawn.count - snr[0] * snr[0]),
                            sqrt(seen.snr2 / seen.count - snr[1] * snr[1])};
        double off[2] = {sqrt(drawn.across2 / drawn.count), sqrt(seen.across2 / seen.count)};
        print_message(
            "%g: %.2f fragments, %.2f in pixels; SNR %.3f, %.3f; spread %.3f, %.3f; off "
            "%.3f, %.3f\n",
            levels[k], drawn.count / (runs[k] - 1), seen.count / (runs[k] - 1), snr[0], snr[1],
            spread[0], spread[1], off[0], off[1]);
        /* some 60, 280, 900 and 480 fragments each; places of faint ones are drawn about the trail
         */
        bst_assert_close(drawn.count / seen.count, 1.0, k == 0 ? 0.6 : k == 1 ? 0.15 : 0.06);
        bst_assert_close(snr[0], snr[1], 0.08);
        bst_assert_close(spread[0], spread[1], k < 2 ? 0.15 : 0.09);
        bst_assert_close(off[0], off[1], 0.05);
    }
    close_scene(&s);
}

/* Trails that come in over an edge, from the middle of a source beyond it, are seen as those of
 * sources within: over each edge, steep and flat, forwards and back. */
static void trails_come_in_over_each_edge(void **state) {
    (void)state;
    for (int way = 0; way < 16; way++) {
        scene s;
        open_scene(&s);
        start(&s);
        s.frame.window.height = 700;
        const bool steep = way & 4;
        const double sign = way & 8 ? -1.0 : 1.0, dx = steep ? 8.0 : 120.0,
                     dy = steep ? 120.0 : 8.0;
        /* middles 25 px beyond the left or upper edge, the right or lower one */
        const double out[2] = {-25.0, (steep ? 700.0 : SIDE) + 24.0};
        const double at = out[way & 1], beside = way & 2 ? 90.0 : 600.0;
        bst_truth_item *item =
            add_source(&s, 1, steep ? beside : at, steep ? at : beside, electrons_of(&s, 8000.0));
        s.frame.streak_dx_px = sign * dx;
        s.frame.streak_dy_px = sign * dy;
        item->x_start_px = item->x_mid_px - 0.5 * sign * dx;
        item->x_end_px = item->x_mid_px + 0.5 * sign * dx;
        item->y_start_px = item->y_mid_px - 0.5 * sign * dy;
        item->y_end_px = item->y_mid_px + 0.5 * sign * dy;
        bst_generator_result r = run(&s, way);
        assert_true(r.smeared && r.count >= 1);
        for (int i = 0; i < r.count; i++) {
            const bst_detection *d = &r.items[i].detection;
            double u = d->x_px - item->x_mid_px, v = d->y_px - item->y_mid_px;
            double length = hypot(dx, dy);
            assert_true(fabs(u * dx + v * dy) / length < 0.5 * length + 4.0);
            assert_true(fabs(v * dx - u * dy) / length < 1.5);
        }
        close_scene(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(trails_come_in_over_each_edge),
                                       cmocka_unit_test(as_in_pixels)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
