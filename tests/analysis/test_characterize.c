/* Parts of the characterization of a sensor against numbers that are drawn or worked out here. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/characterize/hot_pixels.h"
#include "sim/analysis/characterize/pick_up_line.h"
#include "sim/analysis/characterize/simplex_search.h"
#include "tests/test_support.h"

/* Normal quartile: deviations from the mean per standard deviation. */
static const double QUARTILE = 0.6744897501960817;

static void spread_of_whole_and_broken_numbers(void **state) {
    (void)state;
    float even[100], mixed[8] = {2, 2, 2, 2, 5.25F, 5.25F, 5.25F, 5.25F};
    for (int i = 0; i < 100; i++) {
        even[i] = (float)(i % 10); /* evenly from -0.5 to 9.5: quartiles 2 and 7 */
    }
    bst_assert_close(bst_robust_sigma(even, 100), 2.5 / QUARTILE, 1e-6); /* floats */
    /* the lower quartile is the middle of 1.5 to 2.5, the upper one no whole number */
    bst_assert_close(bst_robust_sigma(mixed, 8), 0.5 * 3.25 / QUARTILE, 1e-6);
    const double values[4] = {1.0, NAN, 2.0, 4.0};
    bst_sensor_estimate mean = bst_mean_estimate(values, 4);
    bst_assert_close(mean.value, 7.0 / 3.0, 1e-15);
    bst_assert_close(mean.sigma, sqrt(7.0) / 3.0, 1e-15); /* squares 16, 1 and 25 ninths */
    bst_sensor_estimate root = bst_root_estimate((bst_sensor_estimate){4.0, 0.4});
    bst_assert_close(root.value, 2.0, 1e-15);
    bst_assert_close(root.sigma, 0.1, 1e-15); /* d sqrt(v) = dv / (2 sqrt(v)) */
}

static void outliers_are_left_out(void **state) {
    (void)state;
    enum { GOOD = 2000, ALL = GOOD + 60 };
    float values[ALL];
    double sum = 0.0, sum2 = 0.0;
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "clipped");
    for (int i = 0; i < ALL; i++) {
        values[i] = (float)(300.0 + 4.0 * bst_rng_normal(key, (uint64_t)i, 0));
        if (i >= GOOD) {
            values[i] = i % 3 ? 5000.0F : NAN;
            continue;
        }
        sum += (double)values[i];
    }
    for (int i = 0; i < GOOD; i++) {
        sum2 += pow((double)values[i] - sum / GOOD, 2.0);
    }
    bst_clipped_moments m = bst_clipped_moments_of(values, ALL, 5.0);
    assert_int_equal(m.count, GOOD);
    bst_assert_close(m.mean, sum / GOOD, 1e-9);
    bst_assert_close(m.variance, sum2 / (GOOD - 1), 1e-9);
    bst_assert_close(m.low, m.mean - 5.0 * sqrt(m.variance), 1e-9);
    bst_assert_close(m.high, m.mean + 5.0 * sqrt(m.variance), 1e-9);
}

/* A sine in noise of 1, of another phase in each row. */
static void sine_along_the_rows(void **state) {
    (void)state;
    enum { WIDTH = 400, HEIGHT = 64 };
    bst_ctx ctx = {0};
    float *rows = test_calloc((size_t)WIDTH * HEIGHT, sizeof *rows);
    const double frequency[3] = {0.1703, 0.0412, 0.3}, amplitude[3] = {2.0, 0.8, 0.0};
    for (int k = 0; k < 3; k++) {
        bst_rng_key key = bst_rng_make_key(2, (uint64_t)k, "test", "line");
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            double turns =
                frequency[k] * (i % WIDTH) + bst_rng_uniform(key, (uint64_t)(i / WIDTH), 1);
            rows[i] = (float)(amplitude[k] * cos(2.0 * BST_PI * turns) +
                              bst_rng_normal(key, (uint64_t)i, 0));
        }
        bst_pick_up_line line;
        bst_assert_ok(&ctx, bst_pick_up_line_find(&ctx, rows, WIDTH, HEIGHT, &line));
        assert_int_equal(line.found, amplitude[k] > 0.0);
        if (line.found) {
            /* five standard errors of the best estimates in white noise (Rife and Boorstyn 1974) */
            bst_assert_close(line.amplitude.value, amplitude[k],
                             5.0 * sqrt(2.0 / WIDTH / (double)HEIGHT));
            bst_assert_close(line.frequency.value, frequency[k],
                             5.0 * sqrt(6.0 / HEIGHT / pow(WIDTH, 3.0)) / (BST_PI * amplitude[k]) +
                                 1e-3 / WIDTH);
        }
        free(line.power);
    }
    test_free(rows);
}

/* Rows whose phase grows by half a cycle alternate; the parabola needs the place on the other side
 * of the end of the range, and with it the phase at the first pixel is found. */
static void phase_of_a_locked_line(void **state) {
    (void)state;
    enum { WIDTH = 256, HEIGHT = 64, LAGS = 16 };
    bst_ctx ctx = {0};
    float *rows = test_calloc((size_t)WIDTH * HEIGHT, sizeof *rows);
    const double growth[3] = {-0.5 + 0.0009, 0.5 - 0.0009, -0.31};
    for (int k = 0; k < 3; k++) {
        bst_rng_key key = bst_rng_make_key(3, (uint64_t)k, "test", "phase");
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            double turns = 0.1703 * (i % WIDTH) + growth[k] * (i / WIDTH) + 130.0 / 360.0;
            rows[i] = (float)(5.0 * sin(2.0 * BST_PI * turns) +
                              0.1 * bst_rng_normal(key, (uint64_t)i, 0));
        }
        bst_pick_up_line line;
        bst_assert_ok(&ctx, bst_pick_up_line_find(&ctx, rows, WIDTH, HEIGHT, &line));
        /* a parabola through steps of a quarter of a cycle per frame: 2 % of a step */
        bst_assert_close(remainder(line.phase.value - growth[k], 1.0), 0.0, 0.02 / (4 * HEIGHT));
        assert_true(line.phase.value >= -0.5 && line.phase.value < 0.5);
        /* the above from the middle to the corner 0.9 deg; as much by the frequency */
        bst_assert_close(bst_pick_up_line_phase_deg(rows, WIDTH, HEIGHT, &line), 130.0, 1.8);
        free(line.power);
    }
    double covariance[LAGS];
    for (int k = 1; k <= LAGS; k++) {
        covariance[k - 1] = 3.0 * cos(2.0 * BST_PI * 0.1703 * k);
    }
    bst_assert_close(bst_pick_up_line_power(covariance, LAGS, 0.1703), 3.0, 1e-12);
    test_free(rows);
}

/* Distance z below which a share of the normal distribution lies, by bisection. */
static double normal_quantile(double share) {
    double low = -9.0, high = 9.0;
    for (int i = 0; i < 60; i++) {
        double z = 0.5 * (low + high);
        *(0.5 * erfc(-z / sqrt(2.0)) < share ? &low : &high) = z;
    }
    return low;
}

/* Fisher's information of mean and deviation of a normal law that is cut off below z, for one
 * value and a deviation of 1: covariance of the scores z and z^2, by sums. */
static void cut_information(double cut, double out[3]) {
    double sum[5] = {0.0};
    for (double z = cut + 5e-5; z < 9.0; z += 1e-4) {
        for (int k = 0; k < 5; k++) {
            sum[k] += pow(z, k) * exp(-0.5 * z * z);
        }
    }
    double m1 = sum[1] / sum[0], m2 = sum[2] / sum[0];
    out[0] = m2 - m1 * m1;
    out[1] = sum[3] / sum[0] - m1 * m2;
    out[2] = sum[4] / sum[0] - m2 * m2;
}

/* Rates whose logarithms are evenly spaced quantiles of the law: the fit gives it back, with the
 * errors of Fisher's information. */
static void law_of_hot_pixels(void **state) {
    (void)state;
    enum { HOT = 4000, COLD = 46000 };
    float *excess = test_calloc(HOT + COLD, sizeof *excess);
    const double m = 2.4, s = 0.3;
    const double cuts[2] = {-0.6, -1.5};
    for (int i = 0; i < HOT; i++) {
        excess[i] = (float)pow(10.0, m + s * normal_quantile((i + 0.5) / HOT));
    }
    for (int k = 0; k < 2; k++) {
        double limit = pow(10.0, m + s * cuts[k]), f[3];
        bst_hot_pixels hot = bst_hot_pixels_fit(excess, HOT + COLD, limit, INFINITY);
        cut_information(cuts[k], f);
        double share = 0.5 * erfc(cuts[k] / sqrt(2.0)), det = f[0] * f[2] - f[1] * f[1];
        double found = (double)hot.found;
        double sigma_m = s * sqrt(f[2] / det / found), sigma_s = s * sqrt(f[0] / det / found);
        bst_assert_close(found, HOT * share, 1.0);
        /* the quantiles' moments differ from the law's by less than the standard error */
        bst_assert_close(log10(hot.median.value), m, 0.2 * sigma_m);
        bst_assert_close(hot.spread_dex.value, s, 0.2 * sigma_s);
        bst_assert_close(hot.fraction.value, (double)HOT / (HOT + COLD), 0.002);
        /* curvature by differences of 2 % of the deviation */
        bst_assert_close(hot.median.sigma / (hot.median.value * log(10.0)) / sigma_m, 1.0, 0.02);
        bst_assert_close(hot.spread_dex.sigma / sigma_s, 1.0, 0.02);
        /* fraction n / (pixels share): 1 / n by counting, and the slope of ln share by mean and
         * deviation with the covariance of both */
        double slope = exp(-0.5 * cuts[k] * cuts[k]) / sqrt(2.0 * BST_PI) / share;
        double by_fit =
            slope * slope / det * (f[2] - 2.0 * cuts[k] * f[1] + cuts[k] * cuts[k] * f[0]);
        double relative = hot.fraction.sigma / hot.fraction.value;
        bst_assert_close(relative / sqrt((1.0 + by_fit) / found), 1.0, 0.02);
    }
    /* pixels that are full, 16 % of them: the same law, and not one that ends there */
    double limit = pow(10.0, m - 1.5 * s), most = pow(10.0, m + s);
    for (int i = 0; i < HOT; i++) {
        excess[i] = fminf(excess[i], (float)(1.02 * most));
    }
    bst_hot_pixels hot = bst_hot_pixels_fit(excess, HOT + COLD, limit, most);
    bst_assert_close((double)hot.found, HOT * 0.5 * erfc(-1.5 / sqrt(2.0)), 1.0);
    bst_assert_close(log10(hot.median.value), m, 0.2 * s / sqrt(HOT));
    bst_assert_close(hot.spread_dex.value, s, 0.3 * hot.spread_dex.sigma);
    bst_assert_close(hot.fraction.value, (double)HOT / (HOT + COLD), 0.002);
    /* all are full: pixels below the limit are not hot */
    const int64_t found = hot.found;
    hot = bst_hot_pixels_fit(excess, HOT + COLD, limit, -limit);
    assert_int_equal(hot.found, found);
    assert_true(isnan(hot.median.value));
    /* it is not known when pixels are full */
    hot = bst_hot_pixels_fit(excess, HOT + COLD, limit, NAN);
    assert_int_equal(hot.found, found);
    assert_true(isfinite(hot.median.value));
    test_free(excess);
}

/* Hot pixels with light around them as of a PSF, and charge behind them: in rows above, a share
 * that falls with the charge, and in columns to the left. */
static void charge_behind_hot_pixels(void **state) {
    (void)state;
    enum { WIDTH = 230, HEIGHT = 190, APART = 15 };
    float *map = test_calloc((size_t)WIDTH * HEIGHT, sizeof *map);
    int used = 0;
    for (int y = 8; y < HEIGHT - 8; y += APART) {
        for (int x = 8; x < WIDTH - 8; x += APART, used++) {
            float *at = map + (size_t)y * WIDTH + x;
            double charge = 1000.0 + 7.0 * (used * 67 % 180), share = charge < 1630.0 ? 0.05 : 0.03;
            at[0] = (float)charge;
            for (int k = 1; k <= BST_TRAIL_PIXELS; k++) {
                at[k * WIDTH] = (float)(charge * (0.04 / k + share / k));
                at[-k * WIDTH] = at[k] = (float)(charge * 0.04 / k);
                at[-k] = (float)(charge * (0.04 + 0.02) / k);
            }
        }
    }
    map[8 * WIDTH + 13] = NAN; /* beside the first */
    map[8 * WIDTH + 8 + APART] = 9000.0F;
    bst_charge_trail trail = bst_charge_trail_measure(map, WIDTH, HEIGHT, 900.0, 5000.0);
    assert_int_equal(used, 180);
    assert_int_equal(trail.used, used - 2);
    const double harmonic = 1.0 + 1.0 / 2 + 1.0 / 3 + 1.0 / 4 + 1.0 / 5;
    for (int k = 1; k <= BST_TRAIL_PIXELS; k++) { /* above, below, right, left; floats */
        bst_assert_close(trail.profile[1][k - 1], 0.04 / k, 1e-7);
        bst_assert_close(trail.profile[2][k - 1], 0.04 / k, 1e-7);
        bst_assert_close(trail.profile[3][k - 1], 0.06 / k, 1e-7);
        assert_true(trail.profile[0][k - 1] > 0.069 / k && trail.profile[0][k - 1] < 0.091 / k);
    }
    assert_true(trail.parallel_up && !trail.serial_right);
    bst_assert_close(trail.serial.value, 0.02 * harmonic, 1e-6);
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        bst_assert_close(trail.class_charge[c], 1000.0 + 7.0 * 45.0 * (c + 0.5), 14.0);
        bst_assert_close(trail.class_parallel[c], (c < 2 ? 0.05 : 0.03) * harmonic, 1e-6);
        bst_assert_close(trail.class_serial[c], 0.02 * harmonic, 1e-6);
    }
    test_free(map);
}

/* First points of a search and their number. */
typedef struct bowl {
    double first[4][3];
    int count;
} bowl;

static double bowl_cost(const void *user, const double *x) {
    bowl *b = (bowl *)(uintptr_t)user;
    if (b->count < 4) {
        memcpy(b->first[b->count], x, sizeof b->first[0]);
    }
    b->count++;
    double u = x[0] - 3.0, v = (x[1] + 0.02) / 0.01, w = (x[2] - 400.0) / 100.0;
    return 1.0 + u * u + v * v + w * w + 0.5 * u * v - 0.3 * v * w;
}

/* Coordinates of very different size: each begins with its own step, and the least place is found.
 */
static void search_with_a_simplex(void **state) {
    (void)state;
    bowl b = {.count = 0};
    const double start[3] = {0.0, 0.0, 100.0}, step[3] = {0.5, 0.004, 60.0};
    double x[3] = {0.0, 0.0, 100.0};
    double least = bst_simplex_search(bowl_cost, &b, 3, x, step, 2000);
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 3; k++) {
            bst_assert_close(b.first[i][k], start[k] + (k == i - 1 ? step[k] : 0.0), 1e-12);
        }
    }
    /* costs of all corners within 1e-6: places to about their root */
    bst_assert_close(least, 1.0, 2e-6);
    bst_assert_close(x[0], 3.0, 5e-3);
    bst_assert_close(x[1], -0.02, 5e-5);
    bst_assert_close(x[2], 400.0, 0.5);
    assert_true(b.count < 400);
    b.count = 0;
    memcpy(x, start, sizeof x);
    (void)bst_simplex_search(bowl_cost, &b, 3, x, step, 30);
    assert_in_range(b.count, 30, 34); /* it ends in time: a shrink takes three more */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(search_with_a_simplex),
        cmocka_unit_test(spread_of_whole_and_broken_numbers),
        cmocka_unit_test(outliers_are_left_out),
        cmocka_unit_test(sine_along_the_rows),
        cmocka_unit_test(phase_of_a_locked_line),
        cmocka_unit_test(law_of_hot_pixels),
        cmocka_unit_test(charge_behind_hot_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
