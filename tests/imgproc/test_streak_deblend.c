/* Joint fit of stars on one path: neighbours within the PSF, paths of one sample, no stars, and the
 * measured error of the model. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "imgproc/streak/streak_deblend.h"
#include "tests/test_support.h"

enum { SIDE = 128, PIXELS = SIDE * SIDE, ROOM = 8 };
#define PSF 1.3

static float image[PIXELS];
static bst_star_path path;

/* A level path of `count` samples, and a frame of noise. */
static void start(int count, double noise) {
    const bst_rng_key key = bst_rng_make_key(8, 0, "test", "streak deblend");
    path = (bst_star_path){.count = count, .centre = {0.5 * (SIDE - 1), 0.5 * (SIDE - 1)}};
    for (int k = 0; k < count; k++) {
        path.place[k][0] = BST_STAR_PATH_STEP_PX * (k - count / 2);
        path.light[k] = 1.0;
    }
    for (uint64_t i = 0; i < PIXELS; i++) {
        image[i] = (float)(noise * bst_rng_normal(key, i, 0));
    }
}

static float light_at(double sx, double sy, double flux, int i) {
    double sum = 0.0;
    for (int k = 0; k < path.count; k++) {
        double dx = i % SIDE - sx - path.place[k][0], dy = i / SIDE - sy - path.place[k][1];
        sum += exp(-0.5 * (dx * dx + dy * dy) / (PSF * PSF));
    }
    return (float)(flux * sum / (2.0 * BST_PI * PSF * PSF * path.count));
}

static void put(double sx, double sy, double flux) {
    for (int i = 0; i < PIXELS; i++) {
        image[i] += light_at(sx, sy, flux, i);
    }
}

static bst_streak_deblend fit_of(bst_ctx *ctx) {
    const bst_streak_deblend_config config = {
        .width = SIDE, .height = SIDE, .room = ROOM, .path = &path, .psf_sigma_px = PSF};
    bst_streak_deblend d;
    bst_assert_ok(ctx, bst_streak_deblend_create(ctx, image, &config, &d));
    return d;
}

static void stars_within_the_psf(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    /* 1 px: less than the PSF's sigma; 0: the same star twice */
    const double apart[] = {3.0, 1.0, 0.0};
    for (int n = 0; n < 3; n++) {
        start(20, 1.0);
        put(64.0, 60.0, 3000.0);
        put(64.0, 60.0 + apart[n], 2000.0);
        bst_streak_deblend d = fit_of(&ctx);
        assert_true(bst_streak_deblend_add(&d, 64.3, 59.8, 2500.0));
        assert_true(bst_streak_deblend_add(&d, 63.8, 60.2 + apart[n], 2500.0));
        for (int round = 0; round < 6; round++) {
            bst_streak_deblend_weigh(&d);
            bst_streak_deblend_fit(&d, 3, 0);
        }
        double light = 0.0, left = 0.0;
        for (int i = 0; i < d.count; i++) {
            assert_true(isfinite(d.stars[i].snr) && isfinite(d.stars[i].x_px));
            bst_assert_close(d.stars[i].x_px, 64.0, 2.0);
            bst_assert_close(d.stars[i].y_px, 60.0 + 0.5 * apart[n], 0.5 * apart[n] + 1.5);
            light += d.stars[i].flux;
        }
        /* noise of the sum: some 2 sqrt(pi * PSF * length), 25 */
        bst_assert_close(light, 5000.0, 150.0);
        for (int i = 0; i < PIXELS; i++) {
            left = fmax(left, fabs((double)d.residual[i]));
        }
        assert_true(left < 6.0); /* noise of 16384 pixels alone: 4.1 */
        bst_streak_deblend_finish(&d, 0.1);
        for (int i = 0; i < d.count; i++) {
            assert_true(d.stars[i].cov_xx * d.stars[i].cov_yy >
                        d.stars[i].cov_xy * d.stars[i].cov_xy);
        }
        bst_streak_deblend_free(&d);
    }
}

static void path_of_one_sample_and_no_stars(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    start(1, 1.0);
    bst_streak_deblend d = fit_of(&ctx);
    bst_streak_deblend_weigh(&d);
    bst_streak_deblend_fit(&d, 2, 0);
    assert_int_equal(bst_streak_deblend_drop(&d, 5.0), 0);
    bst_streak_deblend_finish(&d, 0.1);
    bst_assert_close(d.noise2, 1.0, 0.04);
    bst_streak_deblend_free(&d);
    put(40.2, 70.6, 800.0);
    d = fit_of(&ctx);
    assert_true(bst_streak_deblend_add(&d, 40.7, 70.1, 700.0));
    assert_true(bst_streak_deblend_add(&d, 900.0, -500.0, 700.0)); /* no light in the frame */
    bst_streak_deblend_fit(&d, 6, 0);
    assert_int_equal(bst_streak_deblend_drop(&d, 5.0), 1);
    /* noise: 2 sqrt(pi) PSF of the light, sqrt(2) PSF over the SNR of the place */
    bst_assert_close(d.stars[0].flux, 800.0, 5.0 * 4.7);
    bst_assert_close(d.stars[0].x_px, 40.2, 5.0 * 0.011);
    bst_assert_close(d.stars[0].y_px, 70.6, 5.0 * 0.011);
    bst_streak_deblend_finish(&d, 0.0);
    bst_assert_close(sqrt(d.stars[0].cov_xx), 0.011, 0.003);
    bst_streak_deblend_free(&d);
}

/* Each pixel's light differs from the model by a share, beside the noise. */
static void error_of_the_model_is_measured(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_rng_key key = bst_rng_make_key(9, 0, "test", "streak deblend");
    const double shares[] = {0.05, 0.1}, y[] = {20.0, 42.0, 64.0, 86.0, 108.0};
    for (int n = 0; n < 2; n++) {
        start(50, 1.0);
        for (int i = 0; i < PIXELS; i++) {
            for (int s = 0; s < 5; s++) {
                double light = (double)light_at(64.0, y[s], 12000.0, i);
                image[i] +=
                    (float)(light * (1.0 + shares[n] * bst_rng_normal(key, (uint64_t)i, 0)));
            }
        }
        bst_streak_deblend d = fit_of(&ctx);
        for (int s = 0; s < 5; s++) {
            assert_true(bst_streak_deblend_add(&d, 64.0, y[s], 12000.0));
        }
        bst_streak_deblend_weigh(&d);
        /* median of some 1500 pixels: 3 % */
        bst_assert_close(d.error / shares[n], 1.0, 0.12);
        bst_streak_deblend_free(&d);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_within_the_psf),
        cmocka_unit_test(path_of_one_sample_and_no_stars),
        cmocka_unit_test(error_of_the_model_is_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
