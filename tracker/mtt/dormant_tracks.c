/* Deleted tracks kept for re-identification: an eclipse or an occultation ends a track, not an
 * object. */
#include <assert.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

/* Log-likelihood margin of the best stored track over the second. */
#define LEAD 2.0
/* 1 sigma of the brightness of a reappearing object about its prediction in penumbra, mag. */
#define DIMMING_MAG 0.5

/* Removes stored track i. */
static void remove_stored(bst_mtt *m, int i) {
    m->memory_count--;
    memmove(m->memory + i, m->memory + i + 1, (size_t)(m->memory_count - i) * sizeof *m->memory);
}

void bst_mtt_predict_memory(bst_mtt *m, const bst_mtt_frame *frame) {
    double dt_s = frame->seconds - m->seconds;
    double limit2 = m->params.max_dormant_sigma_rad * m->params.max_dormant_sigma_rad;
    int kept = 0;
    for (int i = 0; i < m->memory_count; i++) {
        bst_mtt_track *track = &m->memory[i];
        if (!bst_mtt_predict_orbit(m, track, frame)) {
            bst_filter_predict(&m->filter, dt_s, &track->state, &track->models);
        }
        double variance = fmax(track->state.covariance[0][0], track->state.covariance[1][1]);
        if (variance <= limit2 &&
            m->seconds + dt_s - track->last_update_s <= m->params.max_dormant_s) {
            m->memory[kept++] = *track;
        }
    }
    m->memory_count = kept;
}

void bst_mtt_remember(bst_mtt *m, const bst_mtt_track *track) {
    assert(m && track && track->status != BST_TRACK_TENTATIVE);
    if (m->params.max_dormant_tracks == 0) {
        return;
    }
    if (m->memory_count == m->params.max_dormant_tracks) {
        remove_stored(m, 0);
    }
    assert(m->memory_count < m->params.max_dormant_tracks);
    m->memory[m->memory_count++] = *track;
}

/* The best-fitting earlier track of an object and the second misfit. */
typedef struct resume_choice {
    bst_mtt_track *best;
    double lowest, second;
} resume_choice;

/* Compares a confirmed track with an earlier one: misfit in direction, rate and brightness. */
static void compare_with_earlier(const bst_mtt *m, const bst_mtt_track *track,
                                 bst_mtt_track *before, resume_choice *choice) {
    double chi2 = bst_sky_distance2(&before->state, &track->state);
    if (before->asleep && before->full_snr > 0.0 && before->light.snr > 0.0) {
        double dimmed = before->full_v_mag - 2.5 * log10(before->light.snr / before->full_snr);
        double variance =
            before->v_mag_variance + track->v_mag_variance + DIMMING_MAG * DIMMING_MAG;
        chi2 += (track->v_mag - dimmed) * (track->v_mag - dimmed) / variance;
    }
    if (!(chi2 <= m->params.dormant_gate_chi2)) {
        return;
    }
    double misfit = chi2 + bst_mixture_log_det4(before->state.covariance);
    if (misfit < choice->lowest) {
        choice->second = choice->lowest;
        choice->lowest = misfit;
        choice->best = before;
    } else if (misfit < choice->second) {
        choice->second = misfit;
    }
}

bool bst_mtt_resume(bst_mtt *m, bst_mtt_track *track, bool anew) {
    resume_choice choice = {.lowest = INFINITY, .second = INFINITY};
    for (int i = 0; anew && i < m->memory_count; i++) {
        compare_with_earlier(m, track, &m->memory[i], &choice);
    }
    for (int t = 0; t < m->track_count; t++) {
        const bst_mtt_track *sleeper = &m->tracks[t];
        if (sleeper->asleep && !sleeper->replaced && sleeper->sight < BST_MTT_DARK &&
            track->first_tick > sleeper->last_update_tick) {
            compare_with_earlier(m, track, &m->tracks[t], &choice);
        }
    }
    bst_mtt_track *before = choice.best;
    if (!before || 0.5 * (choice.second - choice.lowest) < LEAD) {
        return false;
    }
    track->id = before->id;
    track->hits += before->hits;
    track->apart += before->apart;
    track->first_tick = before->first_tick;
    track->full_snr = before->full_snr;
    track->full_v_mag = before->full_v_mag;
    track->full_glow = before->full_glow;
    track->was_bright = before->was_bright;
    track->lit = before->lit;
    if (before->orbit.valid) {
        /* fuse: the stored orbit is more accurate than the few new detections */
        bst_orbit_track orbit = before->orbit;
        bst_sky_state state = orbit.sky;
        if (bst_sky_fuse(&state, &track->state) && bst_orbit_track_update(&orbit, &state)) {
            track->orbit = orbit;
            track->state = state;
            track->models.count = 0;
        }
    }
    if (before->asleep && before >= m->tracks && before < m->tracks + m->track_count) {
        before->replaced = true;
    } else {
        remove_stored(m, (int)(before - m->memory));
    }
    return true;
}
