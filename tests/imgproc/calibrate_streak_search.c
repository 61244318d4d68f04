/* Measures the constants of imgproc/streak/streak_search.c: the false alarms of white noise against
 * the threshold law (RATE, SIGMA_POWER, LENGTH_PX), and the SNR that the filter bank's steps lose
 * before refinement (MARGIN_SNR). Prints the results. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "imgproc/streak/streak_search.h"
#include "tests/test_support.h"

enum { SIDE = 512, PIXELS = SIDE * SIDE, STREAKS = 200 };

typedef struct bench {
    bst_ctx ctx;
    bst_streak_search search;
    bst_background background;
    float *image;
    double sigma_px;
} bench;

static void open_bench(bench *b, double sigma_px, double max_px) {
    *b = (bench){.sigma_px = sigma_px, .image = calloc(PIXELS, sizeof *b->image)};
    assert_non_null(b->image);
    bst_assert_ok(&b->ctx, bst_streak_search_create(&b->ctx, NULL, SIDE, SIDE, max_px, &b->search));
    bst_assert_ok(&b->ctx, bst_background_create(&b->ctx, 64, SIDE, SIDE, 1, &b->background));
    b->image[0] = 1.0f;
    bst_background_estimate(&b->background, b->image, SIDE, SIDE, 0.1f);
    for (int k = 0; k < b->background.columns * b->background.rows; k++) {
        b->background.level[k] = 0.0f;
        b->background.noise[k] = 1.0f;
    }
}

static void close_bench(bench *b) {
    bst_streak_search_free(&b->search);
    bst_background_free(&b->background);
    free(b->image);
}

/* Fills the search's map with white noise of 1 e- (`noise`) or with zeros. */
static void fill(bench *b, bool noise, uint64_t frame) {
    bst_rng_key key = bst_rng_make_key(7, frame, "test", "calibrate streak search");
    for (int i = 0; noise && i < PIXELS; i++) {
        b->image[i] = (float)bst_rng_normal(key, 0, (uint64_t)i);
    }
    bst_streak_search_fill(&b->search, b->image, SIDE, SIDE, &b->background, b->sigma_px);
}

/* False alarms of noise frames over those asked for, for several PSFs and lengths. */
static void the_threshold_law_holds_on_noise(void **state) {
    (void)state;
    static const double sigma[] = {0.43, 0.85, 1.4, 2.2}, longest[] = {24.0, 64.0, 120.0};
    enum { FRAMES = 60 };
    double asked = 0.5, most = 0.0, sum = 0.0;
    int cases = 0;
    for (int s = 0; s < 4; s++) {
        for (int l = 0; l < 3; l++) {
            bench b;
            open_bench(&b, sigma[s], longest[l]);
            int found = 0;
            for (uint64_t frame = 0; frame < FRAMES; frame++) {
                fill(&b, true, frame + FRAMES * (uint64_t)(3 * s + l));
                found += bst_streak_search_faint(&b.search, asked, 0);
            }
            double ratio = found / (asked * FRAMES);
            print_message(
                "sigma %.2f px, to %3.0f px: %.2f of the false alarms asked for (± %.2f)\n",
                sigma[s], longest[l], ratio, 1.0 / sqrt(asked * FRAMES));
            most = fmax(most, ratio);
            sum += ratio;
            cases++;
            close_bench(&b);
        }
    }
    print_message("mean %.2f\n", sum / cases);
    /* Poisson of mean 30 a case: 0.18 each, 0.05 of the mean. Never many more than asked for; fewer
     * where the longest streak is not much longer than the PSF. */
    assert_true(most < 1.6);
    bst_assert_close(sum / cases, 0.9, 0.2);
}

/* SNR of a streak's best line in the bank, and after refinement, without noise. */
static void the_margin_covers_the_steps_of_the_bank(void **state) {
    (void)state;
    bench b;
    open_bench(&b, 0.9, 64.0);
    double loss[STREAKS], largest = 0.0, mean = 0.0;
    bst_rng_key key = bst_rng_make_key(8, 0, "test", "calibrate streak search");
    for (int k = 0; k < STREAKS; k++) {
        double length = 8.0 + 50.0 * bst_rng_uniform(key, 0, (uint64_t)k);
        double angle = BST_PI * bst_rng_uniform(key, 1, (uint64_t)k);
        double x = 200.0 + bst_rng_uniform(key, 2, (uint64_t)k),
               y = 200.0 + bst_rng_uniform(key, 3, (uint64_t)k);
        memset(b.image, 0, PIXELS * sizeof *b.image);
        double square = 0.0;
        for (int n = 0; n < 400; n++) {
            double px = x + length * cos(angle) * (n / 399.0 - 0.5),
                   py = y + length * sin(angle) * (n / 399.0 - 0.5);
            for (int j = (int)py - 5; j <= (int)py + 6; j++) {
                for (int i = (int)px - 5; i <= (int)px + 6; i++) {
                    b.image[j * SIDE + i] += (float)exp(
                        -0.5 * ((i - px) * (i - px) + (j - py) * (j - py)) / (0.9 * 0.9));
                }
            }
        }
        for (int i = 0; i < PIXELS; i++) {
            square += (double)b.image[i] * (double)b.image[i];
        }
        for (int i = 0; i < PIXELS; i++) { /* SNR 7: near the threshold */
            b.image[i] *= (float)(7.0 / sqrt(square));
        }
        fill(&b, false, 0);
        int hits = bst_streak_bank_run(&b.search.bank, NULL, &b.search.map, 0, 3.5);
        assert_true(hits > 0);
        int best = 0;
        for (int n = 1; n < hits; n++) {
            best = b.search.bank.hits[n].snr > b.search.bank.hits[best].snr ? n : best;
        }
        bst_streak_line line;
        bst_streak_refine(&b.search.map, &b.search.bank.hits[best], 64.0, &line);
        loss[k] = line.snr - (double)b.search.bank.hits[best].snr;
        largest = fmax(largest, loss[k]);
        mean += loss[k] / STREAKS;
    }
    print_message("refinement adds %.2f to the SNR of the bank's best line, at most %.2f\n", mean,
                  largest);
    assert_true(largest < 0.8); /* MARGIN_SNR */
    assert_true(largest > 0.3); /* a much smaller margin would do otherwise */
    close_bench(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_threshold_law_holds_on_noise),
        cmocka_unit_test(the_margin_covers_the_steps_of_the_bank),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
