/* The calibration finds the factors that observations were made with: the generator's own. */
#include "obsgen/generator.h"
#include "sim/analysis/calibration/calibrate.h"
#include "sim/analysis/calibration/calibrate_internal.h"
#include "sim/analysis/calibration/pairing.h"
#include "tests/test_support.h"

enum { SIDE = 1024, SOURCES = 700, FRAMES = 60 };

static const bst_camera camera = {.width_px = SIDE,
                                  .height_px = SIDE,
                                  .pixel_scale_arcsec = 3.0,
                                  .aperture_m = 0.15,
                                  .throughput = 0.7,
                                  .quantum_efficiency = 0.7,
                                  .photon_flux_v0_per_s_m2 = 3.6e10,
                                  .psf_fwhm_px = 2.0,
                                  .read_noise_e = 8.0,
                                  .full_well_e = 1e5,
                                  .gain_e_per_dn = 1.6,
                                  .bits = 16};

static const double SIGMA = 2.0 / 2.3548200450309493;

/* Points of SNR 3 to 9, a few brighter, on a grid with random places in the pixel. */
static void fill(bst_truth *truth, const bst_crlb_table *bound, int64_t exposure) {
    bst_rng_key key = bst_rng_make_key(5, 0, "sky", "places");
    double noise = sqrt(truth->background_e + 64.0);
    truth->exposure_id = exposure;
    truth->end_tick = 3000;
    truth->count = SOURCES;
    for (int i = 0; i < SOURCES; i++) {
        double u[3];
        for (int k = 0; k < 3; k++) {
            u[k] = bst_rng_uniform(key, (uint64_t)exposure, (uint64_t)(3 * i + k));
        }
        double x = 25.0 + 36.0 * (i % 27) + u[0], y = 25.0 + 36.0 * (double)(i / 27) + u[1];
        double snr = i % 10 == 0 ? 30.0 : 3.0 + 6.0 * u[2];
        truth->items[i] =
            (bst_truth_item){.kind = BST_SOURCE_STAR,
                             .id = (uint32_t)(i + 1),
                             .flags = BST_TRUTH_IN_FIELD,
                             .x_start_px = x,
                             .x_centroid_px = x,
                             .x_end_px = x,
                             .y_start_px = y,
                             .y_centroid_px = y,
                             .y_end_px = y,
                             .snr = snr,
                             .electrons = snr * noise / bst_crlb_table_norm(bound, 0.0)};
    }
}

/* Gives three of four clear detections the star on whose place in the grid they lie, and all others
 * another one; counts the clear ones and those that are right. */
static void identify(const bst_truth *truth, double threshold_snr, int number, bst_detection *d,
                     int counts[2]) {
    int i = (int)lround((d->x_px - 25.5) / 36.0) + 27 * (int)lround((d->y_px - 25.5) / 36.0);
    d->star_id = 1;
    if (i >= 0 && i < SOURCES) {
        const bst_truth_item *t = &truth->items[i];
        bool near = hypot(d->x_px - t->x_centroid_px, d->y_px - t->y_centroid_px) < 2.0;
        bool clear = t->snr > threshold_snr + 2.0, right = clear && number % 4 > 0;
        d->star_id = right ? t->id : t->id + 1;
        counts[0] += near && clear;
        counts[1] += near && right;
    }
}

static void known_factors_are_found(void **state) {
    (void)state;
    int identified[2] = {0, 0};
    bst_ctx ctx = {0};
    bst_crlb_table bound;
    bst_crlb_table_init(&bound, SIGMA);
    /* images of SIGMA, of which a part is jitter: in quadrature, 0.6 and 0.8 of it */
    bst_camera sharp = camera;
    sharp.psf_fwhm_px *= 0.8;
    bst_obsgen_calibration made, found;
    bst_obsgen_calibration_theory(&made);
    made.gain[0] = 0.95;
    made.slope = 0.9;
    made.threshold_offset = 0.1;
    made.noise_factor = 1.05;
    made.crowding = made.background_fraction = 0.0;
    made.false_alarm_factor = 0.8;
    made.false_alarm_steepness = 0.7;
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        made.across_factor[i] = 1.15;
    }
    const bst_generator_settings settings = {.capacity = 2048,
                                             .false_alarms_per_frame = 8.0,
                                             .jitter_px = 0.6 * SIGMA,
                                             .streak_min_px = 1.5,
                                             .streak_max_px = 64.0};
    bst_generator *generator;
    bst_assert_ok(&ctx,
                  bst_generator_create(&ctx, &sharp, &sharp, &settings, &made,
                                       bst_rng_make_key(3, 0, "x", "observations"), &generator));
    bst_calibration_fitter *calibrator;
    bst_assert_ok(&ctx, bst_calibration_fitter_create(&ctx, &calibrator));
    const bst_calibration_path path = {.camera = &sharp,
                                       .jitter_px = 0.6 * SIGMA,
                                       .false_alarms_per_frame = 8.0,
                                       .streak_min_px = 1.5,
                                       .streak_max_px = 64.0};
    bst_assert_ok(&ctx, bst_calibration_fitter_begin(&ctx, calibrator, &path));
    bst_truth *truth = calloc(1, sizeof *truth + SOURCES * sizeof truth->items[0]);
    bst_detections *detections = calloc(1, sizeof *detections + 2048 * sizeof(bst_detection));
    assert_true(truth && detections);
    truth->background_e = 36.0;
    for (int f = 0; f < FRAMES; f++) {
        fill(truth, &bound, f);
        const bst_generator_frame frame = {.truth = truth,
                                           .window = {0, 0, SIDE, SIDE},
                                           .binning = 1,
                                           .exposure_s = 0.5,
                                           .sigma_px = SIGMA};
        bst_generator_result r;
        bst_assert_ok(&ctx, bst_generator_run(&ctx, generator, &frame, &r));
        detections->exposure_id = f;
        detections->background_e = r.background_e;
        detections->noise_e = r.noise_e;
        detections->threshold_snr = r.threshold_snr;
        detections->count = r.count;
        detections->stars_identified = 1;
        for (int i = 0; i < r.count; i++) {
            detections->items[i] = r.items[i].detection;
            identify(truth, r.threshold_snr, i, &detections->items[i], identified);
        }
        bst_assert_ok(&ctx, bst_calibration_fitter_add(&ctx, calibrator, truth, detections, 0.5));
    }
    bst_calibration_counts counts;
    bst_assert_ok(&ctx, bst_calibration_fitter_fit(&ctx, calibrator, &found, &counts));
    assert_int_equal(counts.frames, FRAMES);
    /* exact but for rounding: both are what each frame stated */
    bst_assert_close(found.threshold_offset, 0.1, 1e-9);
    bst_assert_close(found.noise_factor, 1.05, 1e-6);
    /* about 30,000 trials: a gain to 0.3 %, a slope to 2 %; the fit's steps of 0.02 on top */
    bst_assert_close(found.gain[0], 0.95, 0.012);
    bst_assert_close(found.slope, 0.9, 0.06);
    /* 200 false alarms where nothing is near: four standard deviations */
    bst_assert_close(found.false_alarm_factor, 0.8, 0.25);
    bst_assert_close(found.false_alarm_steepness, 0.7, 0.25);
    /* thousands of places in each; at the limit the pairing cuts the tails off */
    bst_assert_close(found.across_factor[1], 1.15, 0.06);
    bst_assert_close(found.across_factor[3], 1.15, 0.04);
    bst_assert_close(found.phase_bias_px, 0.0, 0.005);
    /* all but a few that lie beside their star */
    assert_true(identified[0] > 5000);
    bst_assert_close(found.star_id_probability, (double)identified[1] / identified[0], 0.005);
    free(truth);
    free(detections);
    bst_calibration_fitter_free(calibrator);
    bst_generator_free(generator);
}

/* Bright stars 50 px apart, each of which hides 29 px on each side, over half of the columns and a
 * third of the rows: a sixth of the frame. What is found elsewhere is a false alarm. */
static void false_alarms_are_those_of_the_free_sky(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera wide = camera;
    wide.height_px = 768;
    bst_calibration_fitter *c;
    bst_assert_ok(&ctx, bst_calibration_fitter_create(&ctx, &c));
    const bst_calibration_path path = {.camera = &wide,
                                       .false_alarms_per_frame = 8.0,
                                       .streak_min_px = 1.5,
                                       .streak_max_px = 64.0};
    bst_assert_ok(&ctx, bst_calibration_fitter_begin(&ctx, c, &path));
    bst_truth *truth = calloc(1, sizeof *truth + 50 * sizeof truth->items[0]);
    bst_detections *found = calloc(1, sizeof *found + 4 * sizeof(bst_detection));
    assert_true(truth && found);
    truth->background_e = 36.0;
    truth->count = 50;
    for (int i = 0; i < 50; i++) {
        double x = 25.0 + 50.0 * (i % 10), y = 25.0 + 50.0 * (double)(i / 10);
        truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_STAR,
                                           .id = (uint32_t)(i + 1),
                                           .flags = BST_TRUTH_IN_FIELD,
                                           .x_start_px = x,
                                           .x_centroid_px = x,
                                           .x_end_px = x,
                                           .y_start_px = y,
                                           .y_centroid_px = y,
                                           .y_end_px = y,
                                           .snr = 5000.0,
                                           .electrons = 1e5};
    }
    found->background_e = 36.0;
    found->noise_e = 10.2;
    found->threshold_snr = 5.0;
    /* in the corner that the stars hide, and in the three others */
    const double places[4][2] = {{300.3, 148.0}, {700.0, 90.0}, {200.0, 600.0}, {900.0, 700.0}};
    found->count = 4;
    for (int i = 0; i < 4; i++) {
        found->items[i] = (bst_detection){
            .x_px = places[i][0], .y_px = places[i][1], .snr = 6.0 + i, .flux_e = 400.0};
    }
    bst_assert_ok(&ctx, bst_calibration_fitter_add(&ctx, c, truth, found, 0.5));
    bst_assert_close(c->alarms_expected, 8.0 * 5.0 / 6.0, 1e-9);
    assert_int_equal(c->alarm_count, 3);
    /* excess over the threshold: half the squared SNR */
    bst_assert_close(c->alarm_energy[2] - c->alarm_energy[0], 0.5 * (81.0 - 49.0), 1e-9);
    /* 0.1 sigma of a source too much in the background: SNR is lower by that, and alarms rarer by
     * the tail at 5.1 */
    double norm = bst_crlb_table_norm(&c->bound, 0.0);
    found->background_e += 0.1 * 10.2 * norm;
    double before = c->alarms_expected;
    bst_assert_ok(&ctx, bst_calibration_fitter_add(&ctx, c, truth, found, 0.5));
    bst_assert_close((c->alarms_expected - before) / before, exp(0.5 * (25.0 - 5.1 * 5.1)), 1e-9);
    free(truth);
    free(found);
    bst_calibration_fitter_free(c);
}

/* Streaks of (8, -6) px whose places are off by a common error and their own: squares along and
 * across them, in units of the bound, each less its own part of the mean. */
static void places_along_and_across_the_streak(void **state) {
    (void)state;
    enum { STARS = 12 };
    bst_ctx ctx = {0};
    bst_calibration_fitter *c;
    bst_assert_ok(&ctx, bst_calibration_fitter_create(&ctx, &c));
    const bst_calibration_path path = {.camera = &camera,
                                       .false_alarms_per_frame = 1.0,
                                       .streak_min_px = 1.5,
                                       .streak_max_px = 64.0};
    bst_assert_ok(&ctx, bst_calibration_fitter_begin(&ctx, c, &path));
    bst_truth *truth = calloc(1, sizeof *truth + STARS * sizeof truth->items[0]);
    bst_detections *found = calloc(1, sizeof *found + STARS * sizeof(bst_detection));
    assert_true(truth && found);
    truth->background_e = 36.0;
    truth->dark_e = 8.0;
    truth->count = found->count = STARS;
    double own[STARS][2], mean[2] = {0.0, 0.0};
    for (int i = 0; i < STARS; i++) {
        double x = 120.0 + 200.0 * (i % 4), y = 150.0 + 250.0 * (double)(i / 4);
        own[i][0] = 0.04 * sin(2.0 * i) + 0.2;
        own[i][1] = 0.03 * cos(3.0 * i) - 0.1;
        mean[0] += own[i][0] / STARS;
        mean[1] += own[i][1] / STARS;
        truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_STAR,
                                           .id = (uint32_t)(i + 1),
                                           .flags = BST_TRUTH_IN_FIELD,
                                           .x_start_px = x - 4.0,
                                           .x_centroid_px = x,
                                           .x_end_px = x + 4.0,
                                           .y_start_px = y + 3.0,
                                           .y_centroid_px = y,
                                           .y_end_px = y - 3.0,
                                           .snr = 7.0,
                                           .electrons = 600.0};
        found->items[i] = (bst_detection){
            .x_px = x + own[i][0], .y_px = y + own[i][1], .snr = 7.0, .flux_e = 600.0};
    }
    found->background_e = 44.0;
    found->noise_e = 12.0;
    found->threshold_snr = 5.0;
    bst_assert_ok(&ctx, bst_calibration_fitter_add(&ctx, c, truth, found, 0.5));
    bst_crlb_table_at at = bst_crlb_table_of(&c->bound, 600.0, 12.0, 10.0);
    double squares[2] = {0.0, 0.0};
    for (int i = 0; i < STARS; i++) {
        double dx = own[i][0] - mean[0], dy = own[i][1] - mean[1], n = (STARS - 1.0) / STARS;
        squares[0] += pow(0.8 * dx - 0.6 * dy, 2.0) / n / at.var_along_px2;
        squares[1] += pow(0.6 * dx + 0.8 * dy, 2.0) / n / at.var_across_px2;
    }
    double sums[2] = {0.0, 0.0};
    long counts[2] = {0, 0};
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        sums[0] += c->along[i].sum;
        sums[1] += c->across[i].sum;
        counts[0] += c->along[i].count;
        counts[1] += c->across[i].count;
    }
    assert_int_equal(counts[0], STARS);
    assert_int_equal(counts[1], STARS);
    bst_assert_close(sums[0], squares[0], 1e-9);
    bst_assert_close(sums[1], squares[1], 1e-9);
    assert_int_equal(c->trial_count, STARS);
    for (int i = 0; i < STARS; i++) { /* SNR in the noise that was measured */
        bst_assert_close(c->trials[i].amplitude, 7.0 * sqrt(36.0 + 8.0 + 64.0) / 12.0, 1e-6);
        bst_assert_close(c->trials[i].length, 10.0, 1e-6);
        assert_true(c->trials[i].detected && c->trials[i].other > 0.0f);
    }
    free(truth);
    free(found);
    bst_calibration_fitter_free(c);
}

static void too_little_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_calibration_fitter *calibrator;
    bst_obsgen_calibration found;
    bst_calibration_counts counts;
    bst_assert_ok(&ctx, bst_calibration_fitter_create(&ctx, &calibrator));
    assert_int_equal(bst_calibration_fitter_fit(&ctx, calibrator, &found, &counts), BST_ERR_STATE);
    assert_non_null(strstr(ctx.message, "--seeds"));
    bst_calibration_fitter_free(calibrator);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(known_factors_are_found),
                                       cmocka_unit_test(false_alarms_are_those_of_the_free_sky),
                                       cmocka_unit_test(places_along_and_across_the_streak),
                                       cmocka_unit_test(too_little_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
