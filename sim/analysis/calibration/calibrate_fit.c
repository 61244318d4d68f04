#include <math.h>

#include "boresight/vec.h"
#include "sim/analysis/calibration/calibrate_internal.h"

/* minimum numbers of data for a fit */
enum { LEAST_SOURCES = 200, LEAST_ALARMS = 10, LEAST_PLACES = 30 };

/* Probability that a source of this SNR is detected, in either filter of its frame. */
static double detection_probability(const calibrate_trial *t, double snr, double slope) {
    double z =
        slope * (snr - (double)t->threshold) / sqrt((double)t->variance + (double)t->shot * snr);
    double seen = (double)t->other * snr;
    if (!(seen > 0.0)) {
        return bst_matched_normal_below(z);
    }
    double other = slope * (seen - (double)t->other_threshold) /
                   sqrt((double)t->other_variance + (double)t->other_shot * seen);
    return bst_matched_either_above(z, other, (double)t->shared_noise);
}

/* Log-likelihood of the detection trials of one streak length. */
static double likelihood(const bst_calibration_fitter *c, int node, double gain, double slope) {
    double sum = 0.0;
    for (long i = 0; i < c->trial_count; i++) {
        const calibrate_trial *t = &c->trials[i];
        int own = 0;
        for (int n = 1; n < BST_OBSGEN_LENGTHS; n++) {
            bool nearer = fabs(sqrt((double)t->length) - sqrt(bst_obsgen_lengths_px[n])) <
                          fabs(sqrt((double)t->length) - sqrt(bst_obsgen_lengths_px[own]));
            own = nearer ? n : own;
        }
        if (own != node) {
            continue;
        }
        double p = detection_probability(t, bst_obsgen_peak((double)t->amplitude, gain), slope);
        sum +=
            log(fmax(t->detected ? p : 1.0 - p, 1e-4)); /* limits the effect of a few wrong pairs */
    }
    return sum;
}

/* Best gain of one streak length at a slope, by golden section search. */
static double best_gain(const bst_calibration_fitter *c, int node, double slope, double *value) {
    const double part = 0.38196601125010515;
    double low = 0.5, high = 1.3, a = low + part * (high - low), b = high - part * (high - low);
    double at_a = likelihood(c, node, a, slope), at_b = likelihood(c, node, b, slope);
    for (int i = 0; i < 22; i++) {
        if (at_a > at_b) {
            high = b;
            b = a;
            at_b = at_a;
            a = low + part * (high - low);
            at_a = likelihood(c, node, a, slope);
        } else {
            low = a;
            a = b;
            at_a = at_b;
            b = high - part * (high - low);
            at_b = likelihood(c, node, b, slope);
        }
    }
    *value = fmax(at_a, at_b);
    return 0.5 * (low + high);
}

/* Fits the gains of the detection probability per streak length. */
static void fit_detection(const bst_calibration_fitter *c, bst_obsgen_calibration *out) {
    long count[BST_OBSGEN_LENGTHS] = {0};
    for (long i = 0; i < c->trial_count; i++) {
        int own = 0;
        for (int n = 1; n < BST_OBSGEN_LENGTHS; n++) {
            bool nearer =
                fabs(sqrt((double)c->trials[i].length) - sqrt(bst_obsgen_lengths_px[n])) <
                fabs(sqrt((double)c->trials[i].length) - sqrt(bst_obsgen_lengths_px[own]));
            own = nearer ? n : own;
        }
        count[own]++;
    }
    double best = -INFINITY;
    for (double slope = 0.7; slope <= 1.301; slope += 0.02) {
        double total = 0.0, gain[BST_OBSGEN_LENGTHS] = {0};
        for (int n = 0; n < BST_OBSGEN_LENGTHS; n++) {
            double value = 0.0;
            /* a length with few frames would be dominated by their peculiarities */
            if (count[n] >= LEAST_SOURCES && count[n] >= c->trial_count / 50) {
                gain[n] = best_gain(c, n, slope, &value);
            }
            total += value;
        }
        if (total > best) {
            best = total;
            out->slope = slope;
            for (int n = 0; n < BST_OBSGEN_LENGTHS; n++) {
                out->gain[n] = gain[n];
            }
        }
    }
    /* a length without data gets the gain of the nearest length with data */
    double seen[BST_OBSGEN_LENGTHS];
    for (int n = 0; n < BST_OBSGEN_LENGTHS; n++) {
        seen[n] = out->gain[n];
    }
    for (int n = 0; n < BST_OBSGEN_LENGTHS; n++) {
        for (int away = 1; away < BST_OBSGEN_LENGTHS && out->gain[n] <= 0.0; away++) {
            int low = n - away, high = n + away;
            out->gain[n] = low >= 0 && seen[low] > 0.0 ? seen[low]
                           : high < BST_OBSGEN_LENGTHS ? seen[high]
                                                       : 0.0;
        }
    }
}

/* Standard deviation of normal errors after truncation at CALIBRATE_MOST_SIGMAS, from the mean
 * square of the remaining errors: f^2 (1 - 2 c phi(c) / (2 Phi(c) - 1)), c = CALIBRATE_MOST_SIGMAS
 * / f. */
static double untruncated_sigma(double square) {
    double low = 0.1, high = 5.0;
    for (int i = 0; i < 40; i++) {
        double f = 0.5 * (low + high), c = CALIBRATE_MOST_SIGMAS / f;
        double cut = 1.0 - 2.0 * c * exp(-0.5 * c * c) / sqrt(2.0 * BST_PI) / erf(c * sqrt(0.5));
        *(f * f * cut < square ? &low : &high) = f;
    }
    return 0.5 * (low + high);
}

/* Fits the ratio of centroid error to bound at each SNR. */
static void fit_places(const calibrate_mean *seen, double *factors) {
    double before = 1.0;
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        if (seen[i].count >= LEAST_PLACES) {
            before = untruncated_sigma(seen[i].sum / (double)seen[i].count);
        }
        factors[i] = fmin(fmax(before, 0.1), 20.0);
    }
}

bst_status bst_calibration_fitter_fit(bst_ctx *ctx, bst_calibration_fitter *c,
                                      bst_obsgen_calibration *out, bst_calibration_counts *counts) {
    *counts = (bst_calibration_counts){.frames = c->frames,
                                       .sources = c->trial_count,
                                       .detected = c->detected,
                                       .false_alarms = c->alarm_count};
    bst_obsgen_calibration_theory(out);
    if (c->trial_count < LEAST_SOURCES || c->alarm_count < LEAST_ALARMS) {
        return bst_fail(
            ctx, BST_ERR_STATE,
            "%ld stars near the detection limit and %ld false alarms are too few for a "
            "calibration (needed: %d and %d); give --seeds more, or scenarios with "
            "world/faint_stars = \"statistical\" and a scenegen/star_limit_v_mag beyond the "
            "limit of detection",
            c->trial_count, c->alarm_count, LEAST_SOURCES, LEAST_ALARMS);
    }
    fit_detection(c, out);
    fit_places(c->across, out->across_factor);
    fit_places(c->along, out->along_factor);
    for (int i = 0; i < BST_OBSGEN_SNRS; i++) {
        counts->places += c->across[i].count;
    }
    out->phase_bias_px = c->bias_weight > 0.0 ? c->bias_sum / c->bias_weight : 0.0;
    out->threshold_offset = c->threshold_offset / (double)c->frames;
    /* noise^2 = factor^2 theory^2 + light of faint stars */
    double determinant = c->nn * c->qq - c->nq * c->nq;
    double flat = c->ny / c->nn, crowding = out->crowding;
    if (determinant > 1e-9 * c->nn * c->qq) {
        crowding = fmin(fmax((c->nn * c->qy - c->nq * c->ny) / determinant, 0.0), 2.0);
    }
    flat = (c->ny - crowding * c->nq) / c->nn;
    out->crowding = crowding;
    if (c->light_square > 1e-6 * (double)c->frames) {
        out->background_fraction = fmin(fmax(c->light_bias / c->light_square, 0.0), 2.0);
    }
    out->noise_factor = sqrt(fmax(flat, 0.01));
    out->false_alarm_factor = (double)c->alarm_count / c->alarms_expected;
    double energy = 0.0;
    for (long i = 0; i < c->alarm_count; i++) {
        energy += fmin(c->alarm_energy[i], 10.0);
    }
    out->false_alarm_steepness = fmin((double)c->alarm_count / fmax(energy, 1e-3), 10.0);
    if (c->identifiable >= LEAST_PLACES) {
        out->star_id_probability = (double)c->identified / (double)c->identifiable;
    }
    if (c->hits >= LEAST_SOURCES) {
        out->cosmic_ray_flag_probability = (double)c->hits_told / (double)c->hits;
    }
    return BST_OK;
}
