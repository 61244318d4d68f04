/* Detection and location against their bounds, on random frames with fixed seeds. */
#include <stdlib.h>

#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

typedef struct tally {
    int sources, found;
    double bias_along, bias_across;       /* px */
    double ratio_along, ratio_across;     /* RMS over the Cramer-Rao bound */
    double claimed_along, claimed_across; /* RMS over the reported sigma */
    double flux_bias, flux_scatter_ratio;
} tally;

static double em_gain; /* of the sensor; 0: no multiplication */

/* Frames of 36 equal sources at random sub-pixel phases, `spacing` px apart. */
static tally measure_apart(double dx, double dy, double snr, int frames, int spacing) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, 6 * spacing + 28, 6 * spacing + 28);
    s.camera.detector.em_gain = em_gain;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    bst_camera_motion motion = synthetic_motion(&s, dx, dy);
    bst_imgproc_frame frame = synthetic_frame(&s);
    bst_rng_key key = bst_rng_make_key(9, 0, "test", "sources");
    double flux = snr * synthetic_noise(&s) / synthetic_norm(&s, 100.3, 100.7, dx, dy);
    double length = hypot(dx, dy), ux = length > 0 ? dx / length : 1,
           uy = length > 0 ? dy / length : 0;
    double sum[2] = {0}, square[2] = {0}, bound[2] = {0}, claim[2] = {0};
    double flux_sum = 0, flux_square = 0, flux_claim = 0;
    tally t = {0};
    int bounds = 0;
    for (int i = 0; i < frames; i++) {
        double x[36], y[36];
        synthetic_clear(&s);
        for (int k = 0; k < 36; k++) {
            x[k] = 11 + spacing / 2 + k % 6 * spacing +
                   bst_rng_uniform(key, (uint64_t)i, (uint64_t)(2 * k));
            y[k] = 11 + spacing / 2 + k / 6 * spacing +
                   bst_rng_uniform(key, (uint64_t)i, (uint64_t)(2 * k + 1));
            synthetic_add(&s, x[k], y[k], flux, dx, dy);
        }
        synthetic_expose(&s, key, (uint64_t)(1000 + i));
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, d, 2048));
        assert_true(synthetic_sound(d));
        for (int k = 0; k < 36; k++) {
            t.sources++;
            int n = synthetic_nearest(d, x[k], y[k], fmax(2.0, 0.5 * length));
            if (n < 0) {
                continue;
            }
            const bst_detection *p = &d->items[n];
            double ex = p->x_px - x[k], ey = p->y_px - y[k];
            double e[2] = {ex * ux + ey * uy, ey * ux - ex * uy};
            for (int a = 0; a < 2; a++) {
                sum[a] += e[a];
                square[a] += e[a] * e[a];
            }
            claim[0] += p->cov_xx * ux * ux + 2 * p->cov_xy * ux * uy + p->cov_yy * uy * uy;
            claim[1] += p->cov_xx * uy * uy - 2 * p->cov_xy * ux * uy + p->cov_yy * ux * ux;
            flux_sum += p->flux_e / flux - 1;
            flux_square += (p->flux_e / flux - 1) * (p->flux_e / flux - 1);
            flux_claim += p->flux_sigma_e * p->flux_sigma_e / (flux * flux);
            t.found++;
            if (k == 0) {
                double c[3];
                synthetic_bound(&s, x[k], y[k], flux, dx, dy, c);
                bound[0] += c[0] * ux * ux + 2 * c[1] * ux * uy + c[2] * uy * uy;
                bound[1] += c[0] * uy * uy - 2 * c[1] * ux * uy + c[2] * ux * ux;
                bounds++;
            }
        }
    }
    double n = t.found;
    t.bias_along = sum[0] / n;
    t.bias_across = sum[1] / n;
    t.ratio_along = sqrt(square[0] / n / (bound[0] / bounds));
    t.ratio_across = sqrt(square[1] / n / (bound[1] / bounds));
    t.claimed_along = sqrt(square[0] / claim[0]);
    t.claimed_across = sqrt(square[1] / claim[1]);
    t.flux_bias = flux_sum / n;
    t.flux_scatter_ratio = sqrt(flux_square / flux_claim);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
    return t;
}

static tally measure(double dx, double dy, double snr, int frames) {
    return measure_apart(dx, dy, snr, frames, 38);
}

static bool long_run;

/* The required Pd; theory at 1 false alarm per frame of 256^2 gives about 0.96. */
static void finds_snr_six(void **state) {
    (void)state;
    tally point = measure(0, 0, 6, 8), streak = measure(8.3, 0, 6, 8);
    assert_true(point.found >= 0.85 * point.sources);
    assert_true(streak.found >= 0.85 * streak.sources);
}

/* 1.15 is what is required; 360 sources give the RMS to 4 %. The claimed sigma is held to 12 %,
 * three of those. */
static void locates_to_the_bound(void **state) {
    (void)state;
    static const double cases[][3] = {{0, 0, 15},    {0, 0, 500}, {5, 6.5, 15},
                                      {5, 6.5, 200}, {0, 0, 60},  {8, 0, 15}};
    enum { SHORT_FORM = 4 };
    for (size_t c = 0; c < (long_run ? sizeof cases / sizeof *cases : SHORT_FORM); c++) {
        tally t = measure(cases[c][0], cases[c][1], cases[c][2], 10);
        assert_int_equal(t.found, t.sources);
        assert_true(t.ratio_along < 1.15);
        assert_true(t.ratio_across < 1.15);
        bst_assert_close(t.claimed_along, 1.0, 0.12);
        bst_assert_close(t.claimed_across, 1.0, 0.12);
        /* five standard errors of the mean, plus 1e-3 for what fixed-width fits of faint sources
         * inherit */
        bst_assert_close(t.flux_scatter_ratio, 1.0, 0.2);
        bst_assert_close(t.flux_bias, 0.0, 5.0 * 1.3 / (cases[c][2] * sqrt(360.0)) + 0.01);
    }
}

/* The light of a source that a register multiplies by much has twice the shot noise. 360 sources:
 * as above; with plain shot noise in the fit, scatter is 1.24 to 1.27 of what is stated at SNR 60.
 */
static void multiplied_light_is_as_good_as_it_says(void **state) {
    (void)state;
    static const double cases[][3] = {{0, 0, 60}, {0, 0, 500}, {5, 6.5, 200}};
    em_gain = 200.0;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        tally t = measure(cases[c][0], cases[c][1], cases[c][2], 10);
        print_message("         RMS / stated %.3f along, %.3f across, flux %.3f\n", t.claimed_along,
                      t.claimed_across, t.flux_scatter_ratio);
        assert_int_equal(t.found, t.sources);
        bst_assert_close(t.claimed_along, 1.0, 0.12);
        bst_assert_close(t.claimed_across, 1.0, 0.12);
        bst_assert_close(t.flux_scatter_ratio, 1.0, 0.12);
    }
    em_gain = 0.0;
}

/* 1.05 of the bound is what is asked; 720 points, 360 or (long ones) 252 streaks know the RMS to
 * 2.6, 3.7 or 4.5 % (1 sigma; two of them are allowed for). The longer run,
 * `test_imgproc_statistics long`, holds 7,200 each to 1.07, two of its standard deviations, and has
 * the other cases. */
static void within_five_percent_of_the_bound(void **state) {
    (void)state;
    static const double cases[][4] = {/* path, SNR, spacing */
                                      {0, 0, 10, 38},   {0, 0, 100, 38},  {5, 0, 10, 38},
                                      {14, 14, 20, 60}, {42, 42, 50, 80}, {60, 0, 50, 90},
                                      {0, 0, 30, 38},   {20, 0, 20, 60}};
    enum { SHORT_FORM = 5 };
    for (size_t c = 0; c < (long_run ? sizeof cases / sizeof *cases : SHORT_FORM); c++) {
        const double *p = cases[c];
        int frames = long_run ? 200 : p[3] > 60 ? 7 : p[3] > 40 ? 10 : 20;
        double limit = 1.05 + 2.0 / sqrt(2.0 * 36 * frames);
        tally t = measure_apart(p[0], p[1], p[2], frames, (int)p[3]);
        print_message(
            "path (%g, %g) px, SNR %g: RMS / bound %.3f along, %.3f across; RMS / stated "
            "%.3f, %.3f\n",
            p[0], p[1], p[2], t.ratio_along, t.ratio_across, t.claimed_along, t.claimed_across);
        assert_true(t.found >= 0.99 * t.sources);
        assert_true(t.ratio_along < limit && t.ratio_across < limit);
        bst_assert_close(t.claimed_along, 1.0, 0.1);
        bst_assert_close(t.claimed_across, 1.0, 0.1);
    }
}

/* Noise-free but for read noise far below the light: the error is the model's bias. 0.005 px is
 * what is required. */
static void no_bias_over_pixel_phase(void **state) {
    (void)state;
    static const double paths[][2] = {{0, 0}, {8.3, 0}, {3.1, -5.7}};
    bst_ctx ctx = {0};
    for (size_t c = 0; c < sizeof paths / sizeof *paths; c++) {
        synthetic s;
        synthetic_init(&s, 128, 128);
        s.read_e = 0.5;
        s.sky_e = 0.5;
        s.camera.gain_e_per_dn = 1.0;
        bst_imgproc *ip = synthetic_processor(&ctx, &s);
        bst_detections *d = synthetic_detections(64);
        bst_camera_motion motion = synthetic_motion(&s, paths[c][0], paths[c][1]);
        bst_imgproc_frame frame = synthetic_frame(&s);
        bst_rng_key key = bst_rng_make_key(3, 0, "test", "phase");
        for (int k = 0; k < 49; k++) {
            double x = 60 + k % 7 / 7.0, y = 61 + k / 7 / 7.0, bright = 1e5;
            synthetic_clear(&s);
            synthetic_add(&s, x, y, bright, paths[c][0], paths[c][1]);
            /* expected values, without shot noise */
            for (int i = 0; i < s.width * s.height; i++) {
                double dn = s.camera.offset_dn + s.mean_e[i] +
                            s.read_e * bst_rng_normal(key, (uint64_t)k, (uint64_t)i);
                s.pixels[i] = (uint16_t)floor(fmax(dn, 0.0) + 0.5);
            }
            bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, d, 64));
            int n = synthetic_nearest(d, x, y, 2.0);
            assert_true(n >= 0);
            bst_assert_close(d->items[n].x_px, x, 0.005);
            bst_assert_close(d->items[n].y_px, y, 0.005);
        }
        free(d);
        bst_imgproc_free(ip);
        synthetic_free(&s);
    }
}

/* Three-sigma of the Poisson count of about 320 events is 17 %; 20 % is what is asked. */
static void false_alarms_are_as_requested(void **state) {
    (void)state;
    static const double paths[][2] = {{0, 0}, {8.3, 0}, {5.5, -6}};
    bst_ctx ctx = {0};
    for (size_t c = 0; c < sizeof paths / sizeof *paths; c++) {
        synthetic s;
        synthetic_init(&s, 128, 128);
        s.config.false_alarms_per_frame = 4.0;
        s.sky_e = 0.0;
        synthetic_clear(&s);
        bst_imgproc *ip = synthetic_processor(&ctx, &s);
        bst_detections *d = synthetic_detections(2048);
        bst_camera_motion motion = synthetic_motion(&s, paths[c][0], paths[c][1]);
        bst_imgproc_frame frame = synthetic_frame(&s);
        bst_rng_key key = bst_rng_make_key(7, 0, "test", "noise");
        int alarms = 0, frames = 80;
        for (int i = 0; i < frames; i++) {
            synthetic_expose(&s, key, (uint64_t)i);
            bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, d, 2048));
            alarms += d->count;
        }
        bst_assert_close((double)alarms / frames, 4.0, 0.8);
        free(d);
        bst_imgproc_free(ip);
        synthetic_free(&s);
    }
}

/* One source per frame of 128 x 128, at (x, y); every frame must find it within `near` px, and the
 * mean squared error over the stated variance, both axes, stays below `limit`. 30 frames know 1 to
 * 0.18 (1 sigma). */
static void hard_case(double fwhm, double x, double y, double snr, double dx, double dy,
                      double second_px, double near, double limit) {
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, 128, 128);
    s.camera.psf_fwhm_px = fwhm;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(64);
    bst_camera_motion motion = synthetic_motion(&s, dx, dy);
    bst_imgproc_frame frame = synthetic_frame(&s);
    bst_rng_key key = bst_rng_make_key(11, 0, "test", "hard");
    double flux = snr * synthetic_noise(&s) / synthetic_norm(&s, 60.3, 60.7, dx, dy), sum = 0;
    int frames = 30;
    for (int i = 0; i < frames; i++) {
        double u = x + bst_rng_uniform(key, (uint64_t)i, 1),
               v = y + bst_rng_uniform(key, (uint64_t)i, 2);
        synthetic_clear(&s);
        synthetic_add(&s, u, v, flux, dx, dy);
        if (second_px > 0) {
            synthetic_add(&s, u + second_px, v, 0.8 * flux, dx, dy);
        }
        synthetic_expose(&s, key, (uint64_t)(100 + i));
        bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, &motion, d, 64));
        assert_true(synthetic_sound(d));
        int n = synthetic_nearest(d, u, v, near);
        assert_true(n >= 0);
        const bst_detection *p = &d->items[n];
        sum +=
            (p->x_px - u) * (p->x_px - u) / p->cov_xx + (p->y_px - v) * (p->y_px - v) / p->cov_yy;
    }
    print_message("FWHM %g px at (%g, %g), SNR %g, path (%g, %g): %.2f\n", fwhm, x, y, snr, dx, dy,
                  sum / (2 * frames));
    assert_true(sum / (2 * frames) < limit);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

static void hard_cases(void **state) {
    (void)state;
    /* narrower than a pixel: the bound differs over the pixel by more than the error is small */
    hard_case(0.8, 60, 60, 30, 0, 0, 0, 1, 2);
    hard_case(8, 60, 60, 30, 0, 0, 0, 2, 1.5);
    hard_case(2, -0.5, 60, 50, 0, 0, 0, 1.5, 2); /* on the frame's edge */
    hard_case(2, 60, 60, 60, 0, 0, 4, 1, 1.6);   /* a pair at 2 FWHM */
    hard_case(2, 60, 60, 20000, 0, 0, 0, 1, 4);  /* core beyond the full well */
    hard_case(2, 10, 60, 60, 60, 0, 0, 3, 2);    /* a streak cut by the edge */
}

int main(int argc, char **argv) {
    long_run = argc > 1 && strcmp(argv[1], "long") == 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(within_five_percent_of_the_bound),
        cmocka_unit_test(hard_cases),
        cmocka_unit_test(finds_snr_six),
        cmocka_unit_test(locates_to_the_bound),
        cmocka_unit_test(multiplied_light_is_as_good_as_it_says),
        cmocka_unit_test(no_bias_over_pixel_phase),
        cmocka_unit_test(false_alarms_are_as_requested),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
