/* What a Gaussian PSF asks of stamps and of the Fourier path: closed forms by the error function,
 * and sums over a fine grid of frequencies by numpy. No device. */
#include "scenegen/fourier/fourier_grid.h"
#include "scenegen/smear/gaussian_flank.h"
#include "scenegen/smear/smear_internal.h"
#include "scenegen/stamp/stamp.h"
#include "tests/test_support.h"

static const double SIGMA = 1.019186160345623; /* of a FWHM of 2.4 px */

static double share(double from, double to, double sigma) {
    double scale = 1.0 / (sigma * sqrt(2.0));
    return 0.5 * (erf(to * scale) - erf(from * scale));
}

/* Light of a line within x of its middle, integrated over x. */
static double primitive(double x, double sigma) {
    double u = x / (sigma * sqrt(2.0));
    return x * erf(u) + sigma * sqrt(2.0 / BST_PI) * exp(-u * u);
}

static void stamps_of_a_gaussian(void **state) {
    (void)state;
    const double sigmas[] = {0.6, SIGMA, 2.5};
    for (int k = 0; k < 3; k++) {
        double sigma = sigmas[k];
        bst_stamp stamp;
        bst_stamp_init(&stamp, sigma, false);
        for (int r = 0; r < 9; r++) {
            double tail = share(r - 0.5, r + 0.5, sigma) / share(-0.5, 0.5, sigma);
            bst_assert_close(stamp.tail[r], tail, 1e-12 + 1e-9 * tail); /* rounding */
            /* mean over the places of a source between two pixels; 16 places for the integral:
             * second derivative of at most 0.5 / sigma^2 over 24 * 16^2 */
            double kept = primitive(r + 1.5, sigma) - primitive(r + 0.5, sigma);
            bst_assert_close(stamp.kept[r], kept, 1e-4 / (sigma * sigma));
            bst_assert_close(bst_stamp_excess(&stamp, r), 1.0 / (kept * kept) - 1.0,
                             4e-4 / (sigma * sigma) / pow(kept, 3));
        }
    }
    bst_stamp whole;
    bst_stamp_init(&whole, SIGMA, true);
    assert_true(whole.tail[3] == 0.0 && whole.kept[0] == 1.0);
    assert_true(bst_stamp_excess(&whole, 2) == 0.0);
    assert_int_equal(bst_stamp_radius(&whole, 1e9, 1e-9, 20), 1);
}

/* Errors of a point at rest in a frame of 9 electrons of noise squared, without a tolerance of its
 * nodes: what the stamp adds and cuts off, in electrons of the peak. */
static void light_beside_a_stamp(void **state) {
    (void)state;
    bst_smear s = {.sigma_px = SIGMA, .place_parts = 0x1p22, .binning = 2};
    s.dark_variance_e2 = 9.0;
    s.last_read_e = 400.0;
    s.last_peak_e = 120.0;
    bst_stamp_init(&s.stamp, SIGMA, false);
    bst_flank_curve curves[BST_FLANKS];
    bst_light_flank beside;
    for (int f = 0; f < BST_FLANKS; f++) {
        double streak = f == BST_FLANK_STREAK ? SIGMA * BST_STREAK_SIGMAS : 0.0;
        bst_gaussian_flank_measure(SIGMA, 2, streak * streak / 12.0, &beside);
        bst_flank_curve_make(&beside, &curves[f]);
    }
    s.flanks = curves;
    /* noise at 0.76 of the peak's light, and beside the peak */
    double flank = sqrt((400.0 + 9.0) / (0.76 * 400.0 + 9.0));
    double point = fmax(bst_flank_curve_at(&curves[BST_FLANK_POINT], 400.0 / 9.0), flank);
    double along = fmax(bst_flank_curve_at(&curves[BST_FLANK_STREAK], 400.0 / 9.0), flank);
    assert_true(along < point);
    for (int n = 0; n < 9; n++) {
        int r = 1 + n % 3; /* at rest, along a path, along one that rests */
        const bst_smear_level level = {.rests = n >= 6};
        const bst_smear_drawn d = {.radius = r,
                                   .error = 0.01,
                                   .predicted = 0.004,
                                   .level = &level,
                                   .high = {n < 3 ? 0.0 : 3.0 * SIGMA, 0.0}};
        bst_smear_set_error(&s, &d);
        double kept = primitive(r + 1.5, SIGMA) - primitive(r + 0.5, SIGMA);
        double tail = share(r + 0.5, r + 1.5, SIGMA) / share(-0.5, 0.5, SIGMA);
        const bst_error_budget_source *e = &s.last_error;
        bst_assert_close((double)e->peak_e, 400.0, 0.0);
        bst_assert_close((double)e->excess_e, 400.0 * (1.0 / (kept * kept) - 1.0),
                         0.16 / (SIGMA * SIGMA) / pow(kept, 3));
        bst_assert_close((double)e->border_e, 120.0 * 2.0 * tail, 1e-4);
        /* positions in steps of 2^-22 px and sums in float */
        bst_assert_close((double)e->nodes_e, 400.0 * flank * 0.01, 1e-3);
        double there = n >= 3 && n < 6 ? along : point;
        bst_assert_close((double)e->predicted_e, 400.0 * there * 0.004, 1e-3);
    }
}

/* The least radius at which neither a pixel beyond nor what the stamp takes from there is over the
 * limit. */
static void radii_keep_the_limit(void **state) {
    (void)state;
    const struct {
        double sigma, peak_e, limit_e;
        int most;
    } cases[] = {{SIGMA, 1e4, 0.1, 40}, {SIGMA, 1e4, 10.0, 40}, {2.5, 1e5, 1.0, 40},
                 {0.6, 1e3, 5.0, 40},   {2.5, 1e5, 1.0, 6},     {SIGMA, 0.1, 1.0, 40}};
    for (int k = 0; k < 6; k++) {
        double sigma = cases[k].sigma, limit = cases[k].limit_e / cases[k].peak_e;
        bst_stamp stamp;
        bst_stamp_init(&stamp, sigma, false);
        int r = 1;
        for (; r < cases[k].most; r++) {
            double kept = primitive(r + 1.5, sigma) - primitive(r + 0.5, sigma);
            double tail = share(r + 0.5, r + 1.5, sigma) / share(-0.5, 0.5, sigma);
            if (tail <= limit && 1.0 / (kept * kept) - 1.0 <= limit) {
                break;
            }
        }
        assert_int_equal(bst_stamp_radius(&stamp, cases[k].peak_e, cases[k].limit_e, cases[k].most),
                         r);
    }
}

/* Largest 5 D4 / D6 and 7 D6 / D8 along an axis and a diagonal, of the sums D of moduli. */
static double smoothed_variance(void) {
    enum { STEPS = 240 };
    double sum[2][3] = {{0.0}}, worst = 0.0;
    for (int n = 0; n < STEPS * STEPS; n++) {
        double fx = ((n % STEPS) + 0.5) / STEPS, fy = ((n / STEPS) + 0.5) / STEPS;
        double m = exp(-2.0 * BST_PI * BST_PI * SIGMA * SIGMA * (fx * fx + fy * fy)) *
                   sin(BST_PI * fx) * sin(BST_PI * fy) / (fx * fy);
        /* both diagonals are alike: so is the mean of their powers */
        double w[3] = {fx, (fx + fy) * sqrt(0.5), (fx - fy) * sqrt(0.5)};
        for (int k = 0; k < 3; k++) {
            for (int o = 0; o < 3; o++) {
                sum[k > 0][o] += m * pow(2.0 * BST_PI * w[k], 4.0 + 2.0 * o);
            }
        }
    }
    for (int d = 0; d < 2; d++) {
        worst = fmax(worst, fmax(5.0 * sum[d][0] / sum[d][1], 7.0 * sum[d][1] / sum[d][2]));
    }
    return worst;
}

/* OTF exp(-2 pi^2 sigma^2 f^2) sinc(fx) sinc(fy). numpy, sums over 2401^2 frequencies up to 1.2
 * cycles/px; ours over 64^2 to 128^2 of the band kept. */
static void the_band_of_a_gaussian(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_camera camera = {.width_px = 512,
                               .height_px = 512,
                               .pixel_scale_arcsec = 3.0,
                               .aperture_m = 0.15,
                               .psf_fwhm_px = 2.4};
    bst_psf *psf;
    bst_fourier_band band;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    bst_assert_ok(&ctx, bst_fourier_band_measure(&ctx, psf, 1e-6, &band));
    double centre = share(-0.5, 0.5, SIGMA);
    bst_assert_close(band.peak, centre * centre, 1e-6); /* single precision, and what is cut */
    bst_assert_close(band.share_sigma_px, SIGMA, 1e-5);
    bst_assert_close(band.node_sigma_px, 1.06123829452949, 1e-4);
    /* what is cut, and steps of frequency */
    bst_assert_close(band.smoothed_variance_px2, smoothed_variance(), 0.01);
    assert_true(band.smoothed_variance_px2 >= band.node_sigma_px * band.node_sigma_px);
    static const double parts[3][3] = {
        {0.7821934705182304, 0.6014843512709983, 0.4564959040425649},
        {0.5841551428286976, 0.36630446596772875, 0.29895622228584806},
        {0.5709978908335512, 0.40865417355644496, 0.35677388793894677}};
    static const int binnings[3] = {2, 3, 8};
    for (int k = 0; k < 3; k++) {
        bst_assert_close(band.pixel_part[0][k], 1.0, 1e-12); /* what it is measured by */
        for (int b = 0; b < 3; b++) {
            /* kinks of the moduli, on steps of 0.03 cycles/px */
            bst_assert_close(band.pixel_part[binnings[b] - 1][k], parts[b][k], 0.02 * parts[b][k]);
        }
    }
    /* what is cut is under the tolerance of the moduli's sum, 1 / (2 pi sigma^2) at most, and the
     * next ring would not be: beyond f lies exp(-2 pi^2 sigma^2 f^2) of a Gaussian, sincs left out
     */
    assert_true(band.lost > 0.0 && band.lost <= 1e-6 / (2.0 * BST_PI * SIGMA * SIGMA) / band.peak);
    double alone = sqrt(log(1e6) / 2.0) / (BST_PI * SIGMA);
    assert_true(band.cutoff < alone && band.cutoff > 0.85 * alone);
    /* a pixel gets 3e-7 at 5.2 px; 16 px are the least, 160 the most */
    assert_true(band.reach_px >= 16 && band.reach_px <= 160);
    assert_true(band.beyond >= 0.0 && band.beyond < 1e-6); /* the ring at the reach is part of it */
    /* strengths along both axes are those of the same Gaussian and sum to that of all moduli */
    double sum[2] = {0.0, 0.0};
    for (int i = 0; i < BST_SPREAD_BINS; i++) {
        sum[0] += band.axis[0].weight[i];
        sum[1] += band.axis[1].weight[i];
        bst_assert_close(band.axis[0].weight[i], band.axis[1].weight[i], 1e-9);
    }
    bst_assert_close(sum[0], 1.0, 0.02); /* the OTF is nearly positive: moduli sum to the peak */
    bst_assert_close(sum[1], sum[0], 1e-9);
    bst_assert_close(band.axis[1].step, band.cutoff / BST_SPREAD_BINS, 1e-12);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stamps_of_a_gaussian),
        cmocka_unit_test(light_beside_a_stamp),
        cmocka_unit_test(radii_keep_the_limit),
        cmocka_unit_test(the_band_of_a_gaussian),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
