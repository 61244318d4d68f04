/* The sums along a streak that the generator draws its fragments from: noise of the filter's
 * variance and correlation, that belongs to the pixels. */
#include "obsgen/streak/streak_noise.h"

#include <stdlib.h>
#include <string.h>

#include "sim/core/simd.h"
#include "tests/test_support.h"

enum { LENGTH = 64, ROWS = BST_STREAK_ROWS, WIDE = BST_STREAK_WIDE };

/* A way that climbs a row in `per_row` steps (0: level), of an even light. */
static void lay(bst_streak_section *s, int count, int at, int middle, int per_row, float light) {
    for (int k = 0; k < count; k++) {
        s[k] = (bst_streak_section){.at = at + k, .middle = middle + (per_row ? k / per_row : 0)};
        for (int r = 0; r < WIDE; r++) {
            s[k].output[r] = light;
        }
    }
}

static double correlation(double sigma, double distance_px) {
    return exp(-0.25 * distance_px * distance_px / (sigma * sigma));
}

/* Of a Gaussian filter of width sigma over white pixels the outputs at two places correlate as
 * exp(-d^2 / (4 sigma^2)). 64 middles of 2000 exposures with some 64 / (2 sqrt(pi) sigma) = 20
 * independent ones each: 0.5 % of a variance, 3.5e-3 of a product; at five such, with the 1 % that
 * taps cut off at three sigma leave. */
static void noise_has_the_filters_correlation(void **state) {
    (void)state;
    enum { EXPOSURES = 2000 };
    bst_streak_noise *noise = calloc(1, sizeof *noise);
    assert_non_null(noise);
    bst_streak_noise_init(noise);
    const double sigma = 0.9;
    bst_streak_noise_set(noise, sigma);
    bst_rng_key key = bst_rng_make_key(3, 0, "streak", "noise");
    for (int per_row = 0; per_row <= 2; per_row += 2) {
        double mean = 0.0, variance = 0.0, along[3] = {0.0}, across = 0.0;
        for (int e = 0; e < EXPOSURES; e++) {
            bst_streak_section s[LENGTH];
            lay(s, LENGTH, 100, 200, per_row, 0.0f);
            bst_streak_noise_add(noise, key, e, false, 0.0, s, LENGTH);
            for (int k = 8; k < LENGTH - 8; k++) {
                double here = (double)s[k].output[ROWS];
                mean += here;
                variance += here * here;
                across += here * (double)s[k].output[ROWS + 1];
                for (int d = 1; d <= 3; d++) {
                    int row = ROWS + s[k].middle - s[k + d].middle; /* the same row of the frame */
                    along[d - 1] += here * (double)s[k + d].output[row];
                }
            }
        }
        double n = (double)EXPOSURES * (LENGTH - 16);
        bst_assert_close(mean / n, 0.0, 0.02);
        bst_assert_close(variance / n, 1.0, 0.035);
        bst_assert_close(across / n, correlation(sigma, 1.0), 0.03);
        for (int d = 1; d <= 3; d++) {
            bst_assert_close(along[d - 1] / n, correlation(sigma, d), 0.03);
        }
    }
    free(noise);
}

/* Two streaks that meet see the same noise where they do, and other exposures see other noise. */
static void noise_belongs_to_the_pixel(void **state) {
    (void)state;
    bst_streak_noise *noise = calloc(1, sizeof *noise);
    assert_non_null(noise);
    bst_streak_noise_init(noise);
    bst_streak_noise_set(noise, 1.2);
    bst_rng_key key = bst_rng_make_key(3, 0, "streak", "noise");
    bst_streak_section a[LENGTH], b[LENGTH], c[LENGTH];
    lay(a, LENGTH, 100, 200, 0, 0.0f);
    lay(b, LENGTH, 110, 201, 0, 0.0f);
    lay(c, LENGTH, 100, 200, 0, 0.0f);
    bst_streak_noise_add(noise, key, 5, true, 0.0, a, LENGTH);
    bst_streak_noise_add(noise, key, 5, true, 0.0, b, LENGTH);
    bst_streak_noise_add(noise, key, 6, true, 0.0, c, LENGTH);
    double other = 0.0;
    for (int k = 20; k < LENGTH - 10; k++) { /* away from the ends, which lack neighbours */
        for (int r = 1; r < WIDE; r++) {
            /* a float's rounding of sums of a few, in another order */
            bst_assert_close((double)a[k].output[r], (double)b[k - 10].output[r - 1], 1e-5);
            other += fabs((double)(a[k].output[r] - c[k].output[r]));
        }
    }
    /* 136 differences of two independent deviates: 1.13 each in the mean */
    assert_true(other > 75.0);
    free(noise);
}

/* An output of one has twice the variance where shot is one, an output below zero no more. */
static void light_has_shot_noise(void **state) {
    (void)state;
    enum { EXPOSURES = 2000 };
    bst_streak_noise *noise = calloc(1, sizeof *noise);
    assert_non_null(noise);
    bst_streak_noise_init(noise);
    bst_streak_noise_set(noise, 0.9);
    bst_rng_key key = bst_rng_make_key(3, 0, "streak", "noise");
    const float lights[] = {-1.0f, 0.0f, 1.0f, 8.0f};
    const double expected[] = {1.0, 1.0, 2.0, 9.0};
    for (int i = 0; i < 4; i++) {
        double sum = 0.0, square = 0.0, n = (double)EXPOSURES * (LENGTH - 16);
        for (int e = 0; e < EXPOSURES; e++) {
            bst_streak_section s[LENGTH];
            lay(s, LENGTH, 0, 0, 0, lights[i]);
            bst_streak_noise_add(noise, key, e, false, 1.0, s, LENGTH);
            for (int k = 8; k < LENGTH - 8; k++) {
                double off = (double)(s[k].output[ROWS] - lights[i]);
                sum += off;
                square += off * off;
            }
        }
        bst_assert_close(sum / n, 0.0, 0.02 * sqrt(expected[i]));
        bst_assert_close(square / n, expected[i], 0.035 * expected[i]);
    }
    free(noise);
}

/* Vectors of all widths give the same bits, on ways level and steep, of filters narrow and wide. */
static void all_widths_agree(void **state) {
    (void)state;
    bst_streak_noise *noise = calloc(1, sizeof *noise);
    assert_non_null(noise);
    bst_streak_noise_init(noise);
    bst_rng_key key = bst_rng_make_key(3, 0, "streak", "noise");
    const double sigmas[] = {0.6, 1.1, 2.9};
    for (int i = 0; i < 3; i++) {
        bst_streak_noise_set(noise, sigmas[i]);
        for (int per_row = 0; per_row <= 2; per_row++) {
            float first[LENGTH][WIDE];
            for (int width = 4; width <= 16; width *= 2) {
                bst_streak_section s[LENGTH];
                lay(s, LENGTH, -7, 60, per_row, 2.5f);
                bst_simd_limit(width);
                bst_streak_noise_add(noise, key, 9, true, 0.3, s, LENGTH);
                for (int k = 0; k < LENGTH; k++) {
                    if (width == 4) {
                        memcpy(first[k], s[k].output, sizeof first[k]);
                    }
                    assert_memory_equal(first[k], s[k].output, sizeof first[k]);
                }
            }
            bst_simd_limit(16);
        }
    }
    free(noise);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_has_the_filters_correlation),
        cmocka_unit_test(noise_belongs_to_the_pixel),
        cmocka_unit_test(light_has_shot_noise),
        cmocka_unit_test(all_widths_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
