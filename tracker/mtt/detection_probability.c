/* Detection probability of faint objects: a discrete Bayesian filter over the SNR of a track's
 * object, fed by its detections and its misses (the idea of an unknown detection profile: Mahler,
 * Vo and Vo, IEEE Trans. SP 59, 2011, section V, here with the measured SNR). */
#include <assert.h>

#include "tracker/mtt/multitarget_internal.h"

/* SNR above the threshold of the lowest level. */
#define LOWEST (-1.0)
#define HIGHEST (LOWEST + BST_MTT_SNR_LEVELS - 1)
/* Share of the frames in which noise of 1 sigma leaves each level above the threshold: the normal
 * distribution function at -1, 0 ... 5. */
static const double ABOVE[BST_MTT_SNR_LEVELS] = {0.158655, 0.5,      0.841345, 0.977250,
                                                 0.998650, 0.999968, 1.0};

double bst_mtt_detection_probability(const bst_mtt *m, const bst_mtt_track *track) {
    double share = m->threshold_snr > 0.0 ? 0.0 : 1.0;
    for (int i = 0; i < BST_MTT_SNR_LEVELS && m->threshold_snr > 0.0; i++) {
        share += track->snr_level[i] * ABOVE[i];
    }
    return m->params.detection_probability * share;
}

void bst_mtt_start_snr(bst_mtt_track *track) {
    for (int i = 0; i < BST_MTT_SNR_LEVELS; i++) {
        track->snr_level[i] = 1.0 / BST_MTT_SNR_LEVELS;
    }
}

/* Multiplies the probabilities by the likelihoods, after the brightness's random walk. */
static void update_levels(const bst_mtt *m, const double likelihood[BST_MTT_SNR_LEVELS],
                          bst_mtt_track *track) {
    double step = 0.4 * log(10.0) * m->params.brightness_random_walk_mag * m->threshold_snr;
    double share = fmin(0.5 * step * step, 0.25); /* to each neighbour: variance step^2 */
    double *level = track->snr_level, before = level[0], sum = 0.0;
    for (int i = 0; i < BST_MTT_SNR_LEVELS; i++) {
        double own = level[i], after = i + 1 < BST_MTT_SNR_LEVELS ? level[i + 1] : own;
        level[i] = (own + share * (before - 2.0 * own + after)) * likelihood[i];
        before = own;
        sum += level[i];
    }
    assert(sum > 0.0);
    for (int i = 0; i < BST_MTT_SNR_LEVELS; i++) {
        level[i] /= sum;
    }
}

void bst_mtt_note_snr(const bst_mtt *m, double snr, bst_mtt_track *track) {
    if (!(m->threshold_snr > 0.0) || !isfinite(snr)) {
        return;
    }
    /* limited so that no likelihood is zero */
    double over = fmin(fmax(snr - m->threshold_snr, LOWEST - 3.0), HIGHEST + 3.0);
    double likelihood[BST_MTT_SNR_LEVELS];
    for (int i = 0; i < BST_MTT_SNR_LEVELS; i++) {
        double off = over - (LOWEST + i);
        off = i == BST_MTT_SNR_LEVELS - 1 ? fmin(off, 0.0) : off;
        likelihood[i] = exp(-0.5 * off * off);
    }
    update_levels(m, likelihood, track);
}

void bst_mtt_note_missed(const bst_mtt *m, bst_mtt_track *track) {
    if (!(m->threshold_snr > 0.0)) {
        return;
    }
    double pd = m->params.detection_probability * (1.0 - track->dark);
    double likelihood[BST_MTT_SNR_LEVELS];
    for (int i = 0; i < BST_MTT_SNR_LEVELS; i++) {
        likelihood[i] = 1.0 - pd * ABOVE[i];
    }
    update_levels(m, likelihood, track);
}
