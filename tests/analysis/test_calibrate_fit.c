/* The fit of a calibration to data of known laws: detection, errors cut at 2.5 of their bounds,
 * noise with the light of faint stars, false alarms. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/calibration/calibrate_internal.h"
#include "tests/test_support.h"

enum { TRIALS = 1200, ALARMS = 40 };

static calibrate_trial trials[2 * TRIALS];
static double energies[ALARMS];

/* Detected if a normal output is above the threshold. */
static calibrate_trial draw_trial(bst_rng_key key, uint64_t n, double length, double gain) {
    calibrate_trial t = {.amplitude = (float)(3.0 + 4.0 * bst_rng_uniform(key, n, 0)),
                         .threshold = 5.0f,
                         .length = (float)length,
                         .variance = 1.1f,
                         .shot = 0.05f};
    double snr = bst_obsgen_peak((double)t.amplitude, gain);
    double noise = sqrt(1.1 + 0.05 * snr);
    t.detected = 1.1 * (snr - 5.0) + noise * bst_rng_normal(key, n, 1) > 0.0;
    return t;
}

/* The gain with the largest log-likelihood of a slope's trials, tried one by one; no trial counts
 * for less than 1e-4. */
static double best_of_all(const calibrate_trial *t, int count, double slope) {
    double best = -INFINITY, gain = 0.0;
    for (double g = 0.8; g < 1.2; g += 0.001) {
        double sum = 0.0;
        for (int i = 0; i < count; i++) {
            double snr = bst_obsgen_peak((double)t[i].amplitude, g);
            double z = slope * (snr - 5.0) / sqrt(1.1 + 0.05 * snr);
            sum += log(fmax(0.5 * erfc((t[i].detected ? -z : z) / sqrt(2.0)), 1e-4));
        }
        gain = sum > best ? g : gain;
        best = fmax(best, sum);
    }
    return gain;
}

static void laws_come_back(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_rng_key key = bst_rng_make_key(6, 0, "test", "calibration");
    for (uint64_t n = 0; n < 2 * TRIALS; n++) {
        trials[n] = draw_trial(key, n, n < TRIALS ? 0.0 : bst_obsgen_lengths_px[2],
                               n < TRIALS ? 0.92 : 1.04);
    }
    double energy = 0.0;
    for (int i = 0; i < ALARMS; i++) {
        energies[i] = 0.3 + 0.05 * i;
        energy += energies[i];
    }
    energies[0] += 1000.0; /* one is counted as 10 */
    energy += 10.0 - 0.3;
    struct bst_calibration_fitter c = {.trials = trials,
                                       .trial_count = 2 * TRIALS,
                                       .alarm_energy = energies,
                                       .alarm_count = ALARMS,
                                       .alarms_expected = 32.0,
                                       .bias_sum = 0.6,
                                       .bias_weight = 20.0,
                                       .threshold_offset = 3.0,
                                       .frames = 12,
                                       .detected = 77,
                                       .light_square = 8.0,
                                       .light_bias = 2.0,
                                       .identified = 45,
                                       .identifiable = 60,
                                       .hits = 400,
                                       .hits_told = 340};
    /* of a normal error f times its bound, what stays below 2.5 bounds: by its density */
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        double f = 0.8 + 0.15 * i, sum = 0.0, square = 0.0;
        for (int k = -5000; k < 5000; k++) {
            double x = 2.5 * (k + 0.5) / 5000.0, p = exp(-0.5 * x * x / (f * f));
            sum += p;
            square += p * x * x;
        }
        c.across[i] = (calibrate_mean){1000.0 * square / sum, 1000};
        c.along[i] = (calibrate_mean){10.0 * square / sum, i == 2 ? 10 : 10000};
        if (i != 2) {
            c.along[i].sum *= 1000.0;
        }
    }
    /* noise^2 = 1.3^2 theory^2 + 0.4 light */
    for (int i = 0; i < 12; i++) {
        double theory2 = 20.0 + i, light = 3.0 * (i % 4);
        double noise2 = 1.69 * theory2 + 0.4 * light;
        c.nn += theory2 * theory2;
        c.nq += theory2 * light;
        c.qq += light * light;
        c.ny += theory2 * noise2;
        c.qy += light * noise2;
    }
    bst_obsgen_calibration out;
    bst_calibration_counts counts;
    bst_assert_ok(&ctx, bst_calibration_fitter_fit(&ctx, &c, &out, &counts));
    /* 1200 trials tell the gain to 0.01 and the slope to 0.03 */
    bst_assert_close(out.slope, 1.1, 0.1);
    bst_assert_close(out.gain[0], 0.92, 0.035);
    bst_assert_close(out.gain[2], 1.04, 0.035);
    /* a step of the trial, and a flat summit */
    bst_assert_close(out.gain[0], best_of_all(trials, TRIALS, out.slope), 0.002);
    bst_assert_close(out.gain[2], best_of_all(trials + TRIALS, TRIALS, out.slope), 0.002);
    /* lengths without data: as the nearest with data, the shorter one first */
    bst_assert_close(out.gain[1], out.gain[0], 0.0);
    for (int n = 3; n < BST_OBSGEN_LENGTHS; n++) {
        bst_assert_close(out.gain[n], out.gain[2], 0.0);
    }
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        bst_assert_close(out.across_factor[i], 0.8 + 0.15 * i, 2e-3);
        /* ten places are too few: as the SNR before */
        bst_assert_close(out.along_factor[i], 0.8 + 0.15 * (i == 2 ? 1 : i), 2e-3);
    }
    bst_assert_close(out.noise_factor, 1.3, 1e-9);
    bst_assert_close(out.crowding, 0.4, 1e-9);
    bst_assert_close(out.background_fraction, 0.25, 1e-12);
    bst_assert_close(out.false_alarm_factor, ALARMS / 32.0, 1e-12);
    bst_assert_close(out.false_alarm_steepness, ALARMS / energy, 1e-9);
    bst_assert_close(out.phase_bias_px, 0.03, 1e-12);
    bst_assert_close(out.threshold_offset, 0.25, 1e-12);
    bst_assert_close(out.star_id_probability, 0.75, 1e-12);
    bst_assert_close(out.cosmic_ray_flag_probability, 0.85, 1e-12);
    assert_int_equal(counts.places, 1000 * BST_OBSGEN_SNRS);
    assert_int_equal(counts.frames, 12);
    assert_int_equal(counts.sources, 2 * TRIALS);
    assert_int_equal(counts.detected, 77);
    assert_int_equal(counts.false_alarms, ALARMS);
    c.alarm_count = 9;
    assert_int_equal(bst_calibration_fitter_fit(&ctx, &c, &out, &counts), BST_ERR_STATE);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(laws_come_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
