/* Measures constants about charge in one pixel (hot pixels, cosmic rays): how far its detections
 * lie from the pixel (SCATTER_FWHM of tracker/mtt/fixed_pixel.c), how often a star within
 * DISPLACED_FWHM displaces them, and from which charge images label it (deviation_of_charge of
 * obsgen/model/false_alarms.c). Prints the results. */
#include <math.h>
#include <stdlib.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 512, PITCH = 16, ACROSS = SIDE / PITCH - 1, STARS = 200, FRAMES = 4, LEVELS = 12 };

/* Charge of level k over the noise of a pixel. */
static double level_of(int k) {
    return 4.0 + k;
}

typedef struct outcome {
    int placed, found, labelled;
    double square; /* of the distance of unlabelled detections in one axis, px^2 */
    int displaced; /* beyond three scatters of the tracker */
} outcome;

static void measure(double fwhm_px, int stars, outcome out[LEVELS]) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.camera.psf_fwhm_px = fwhm_px;
    double noise = synthetic_noise(&s);
    double norm = synthetic_norm(&s, 200.0, 200.0, 0.0, 0.0);
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(4096);
    for (uint64_t frame = 0; frame < FRAMES; frame++) {
        bst_rng_key key = bst_rng_make_key(7, frame, "test", "charge");
        synthetic_clear(&s);
        for (int i = 0; i < stars; i++) {
            double snr = 4.0 * pow(25.0, bst_rng_uniform(key, 2, (uint64_t)i));
            synthetic_add(&s, SIDE * bst_rng_uniform(key, 0, (uint64_t)i),
                          SIDE * bst_rng_uniform(key, 1, (uint64_t)i), snr * noise / norm, 0.0,
                          0.0);
        }
        for (int i = 0; i < ACROSS * ACROSS; i++) {
            int x = PITCH * (i % ACROSS + 1), y = PITCH * (i / ACROSS + 1);
            s.mean_e[y * SIDE + x] += level_of(i % LEVELS) * noise;
        }
        synthetic_expose(&s, bst_rng_make_key(8, frame, "test", "noise"), frame);
        bst_imgproc_frame f = synthetic_frame(&s);
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &f, NULL, d, 4096));
        for (int i = 0; i < ACROSS * ACROSS; i++) {
            int x = PITCH * (i % ACROSS + 1), y = PITCH * (i / ACROSS + 1);
            outcome *o = &out[i % LEVELS];
            o->placed++;
            int n = synthetic_nearest(d, x, y, 1.5 * fwhm_px);
            if (n < 0) {
                continue;
            }
            const bst_detection *item = &d->items[n];
            double dx = item->x_px - x, dy = item->y_px - y;
            bool labelled = item->label == BST_LABEL_HIT || item->label == BST_LABEL_HOT_PIXEL;
            o->found++;
            o->labelled += labelled;
            if (!labelled) {
                double scatter = 0.25 * fwhm_px;
                double r = 0.5 * (item->cov_xx + item->cov_yy) + scatter * scatter;
                o->square += 0.5 * (dx * dx + dy * dy);
                o->displaced += dx * dx + dy * dy > 9.0 * r;
            }
        }
    }
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

/* Charge over noise at which half of the found pixels are labelled, by interpolation. */
static double half_labelled(const outcome out[LEVELS]) {
    double before = 0.0;
    for (int k = 0; k < LEVELS; k++) {
        double share = out[k].found ? (double)out[k].labelled / out[k].found : 0.0;
        if (share >= 0.5) {
            return level_of(k) - (k > 0 ? (share - 0.5) / (share - before) : 0.0);
        }
        before = share;
    }
    return INFINITY;
}

/* What the generator expects: the root of charge^2 = 4^2 variance, in units of the noise, with the
 * variance of deviation_of_charge in obsgen/model/false_alarms.c. */
static double half_labelled_expected(double fwhm_px, double noise_e) {
    double sigma = fwhm_px / BST_FWHM_PER_SIGMA, side = exp(-0.5 / (sigma * sigma + 1.0 / 12.0));
    double corner = side * side, square = 4.0 * (side * side + corner * corner);
    double cube = 4.0 * (pow(side, 3.0) + pow(corner, 3.0)), low = 1.0, high = 100.0;
    for (int i = 0; i < 60; i++) {
        double q = 0.5 * (low + high), model = 0.09 * q;
        double variance = 1.0 + 1.0 / square + (1.0 + cube / (square * square)) * q / noise_e;
        *(q * q > 16.0 * (variance + model * model) ? &high : &low) = q;
    }
    return low;
}

static void charge_is_placed_and_labelled(void **state) {
    (void)state;
    static const double fwhm[] = {1.5, 2.0, 3.0};
    synthetic s;
    synthetic_init(&s, 64, 64);
    double noise = synthetic_noise(&s);
    synthetic_free(&s);
    for (int crowded = 0; crowded < 2; crowded++) {
        for (size_t w = 0; w < sizeof fwhm / sizeof *fwhm; w++) {
            outcome out[LEVELS] = {{0}};
            measure(fwhm[w], crowded ? STARS : 0, out);
            int plain = 0, displaced = 0;
            double square = 0.0;
            for (int k = 0; k < LEVELS; k++) {
                plain += out[k].found - out[k].labelled;
                displaced += out[k].displaced;
                square += out[k].square;
            }
            double half = half_labelled(out), expected = half_labelled_expected(fwhm[w], noise);
            double scatter = sqrt(square / plain) / fwhm[w], beyond = (double)displaced / plain;
            print_message(
                "FWHM %.1f px, %3d stars: %4d detections without label, RMS %.3f FWHM, "
                "beyond three scatters %.3f; half labelled from %.2f, expected %.2f\n",
                fwhm[w], crowded ? STARS : 0, plain, scatter, beyond, half, expected);
            /* interpolation of shares of 320 pixels, +- 0.03: +- 0.2; best of five groups of
             * neighbours, of which the closed form has one */
            bst_assert_close(half, expected, crowded ? 1.0 : 0.5);
            /* without stars the tracker's scatter covers all; few are labelled at 3 px with stars,
             * most detections are the stars' own */
            assert_true(crowded || (displaced == 0 && scatter < 0.25));
            assert_true(!crowded || w == 2 || (beyond < 0.2 && scatter < 0.4));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(charge_is_placed_and_labelled)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
