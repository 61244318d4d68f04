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
    bst_filter_params filter = m->filter;
    filter.steady_noise_rad2ps3 = 0.0; /* no detections show which level of noise is right */
    int kept = 0;
    for (int i = 0; i < m->memory_count; i++) {
        bst_mtt_track *track = &m->memory[i];
        if (!bst_mtt_predict_orbit(m, track, frame)) {
            bst_filter_predict(&filter, dt_s, &track->state, &track->models);
        }
        double variance = fmax(track->state.covariance[0][0], track->state.covariance[1][1]);
        if (variance <= limit2 &&
            m->seconds + dt_s - track->last_update_s <= m->params.max_dormant_s) {
            if (kept < i) {
                m->memory[kept] = *track;
            }
            kept++;
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
    bst_mtt_track *stored = &m->memory[m->memory_count++];
    *stored = *track;
    if (m->params.filter != BST_FILTER_IMM) { /* the state is the mean of the components */
        stored->models.count = stored->models.levels = 0;
    }
}

/* The best-fitting earlier track of an object and the second misfit. */
typedef struct resume_choice {
    bst_mtt_track *best;
    double lowest, second;
} resume_choice;

/* Compares one more earlier track with the best so far. */
static void note_choice(resume_choice *choice, bst_mtt_track *before, double misfit) {
    if (misfit < choice->lowest) {
        choice->second = choice->lowest;
        choice->lowest = misfit;
        choice->best = before;
    } else if (misfit < choice->second) {
        choice->second = misfit;
    }
}

/* True if a newly confirmed track may be the object of another one that was not in its gate since
 * the new one began. */
static bool may_have_burned(const bst_mtt *m, int t, const bst_mtt_track *track) {
    const bst_mtt_track *before = &m->tracks[t];
    return before != track && before->status != BST_TRACK_TENTATIVE && !before->star &&
           !before->at_rest && !before->asleep && !before->replaced && before->may_miss &&
           before->merged_in_row == 0 && track->first_tick > before->gate_tick;
}

/* Compares a newly confirmed track with one that may have left its path by a burn, short against
 * the time since its latest detection: at some time s ago both were at one place. The density of
 * the difference (d, w) in direction and rate is q^-1 p(w) times the integral of N(d - w s; R) over
 * s, with burns of rate q^-1 and changes of rate w as likely as any rate of an object. */
static void compare_with_burned(bst_mtt *m, int t, const bst_mtt_track *track,
                                resume_choice *choice) {
    const bst_mtt_params *p = &m->params;
    bst_mtt_track *before = &m->tracks[t];
    double x[4], c[4][4], r[2], v[2][2];
    double dim = track->v_mag - before->v_mag;
    double limit2 = before->v_mag_variance + track->v_mag_variance + DIMMING_MAG * DIMMING_MAG;
    if (!(bst_vec3_dot(before->state.direction, track->state.direction) > 0.98) ||
        !(dim * dim <= p->gate_chi2 * limit2)) {
        return;
    }
    bst_sky_difference(&before->state, &track->state, x);
    bst_sky_turn_covariance(&track->state, before->state.direction, c);
    double span = m->now.seconds - before->last_update_s, w2 = x[2] * x[2] + x[3] * x[3];
    double s = w2 > 0.0 ? fmin(fmax((x[0] * x[2] + x[1] * x[3]) / w2, 0.0), span) : 0.0;
    for (int i = 0; i < 2; i++) {
        r[i] = x[i] - s * x[i + 2];
        for (int j = 0; j < 2; j++) {
            double(*b)[4] = before->state.covariance;
            v[i][j] = c[i][j] + b[i][j] - s * (c[i][j + 2] + b[i][j + 2]) -
                      s * (c[i + 2][j] + b[i + 2][j]) + s * s * (c[i + 2][j + 2] + b[i + 2][j + 2]);
        }
    }
    double det = v[0][0] * v[1][1] - v[0][1] * v[1][0];
    double chi2 =
        (v[1][1] * r[0] * r[0] - 2.0 * v[0][1] * r[0] * r[1] + v[0][0] * r[1] * r[1]) / det;
    /* the detection of both decides by itself: the wider gate has judged it */
    bool listed = track >= m->tracks && track < m->tracks + m->track_count;
    int column = listed ? m->detection_of_track[track - m->tracks] : -1;
    bool same = column >= 0 && m->detection_of_track[t] == column;
    if (!same && !(chi2 <= p->gate_chi2)) {
        return;
    }
    double w = fmax(sqrt(w2), 1e-12), fastest = fmax(p->max_rate_radps, w);
    double across =
        (v[0][0] * x[3] * x[3] - 2.0 * v[0][1] * x[2] * x[3] + v[1][1] * x[2] * x[2]) / (w * w);
    double misfit = (same ? 0.0 : chi2) + log(fmax(across, 1e-24)) + 2.0 * log(w) +
                    2.0 * log(p->quiescent_sojourn_s) + 2.0 * log(BST_PI * fastest * fastest) -
                    3.0 * log(2.0 * BST_PI);
    note_choice(choice, before, misfit);
}

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
    note_choice(choice, before, misfit);
}

bool bst_mtt_resume(bst_mtt *m, bst_mtt_track *track, bool anew) {
    resume_choice choice = {.lowest = INFINITY, .second = INFINITY};
    for (int i = 0; anew && i < m->memory_count; i++) {
        compare_with_earlier(m, track, &m->memory[i], &choice);
    }
    for (int t = 0; t < m->track_count; t++) {
        if (anew && may_have_burned(m, t, track)) {
            compare_with_burned(m, t, track, &choice);
        }
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
    bool stored = before >= m->memory && before < m->memory + m->memory_count;
    track->burned = !stored && !before->asleep;
    if (track->burned) {
        track->manoeuvre_end_s = before->manoeuvre_end_s;
    } else if (before->orbit.valid) {
        /* fuse: the stored orbit is more accurate than the few new detections */
        bst_orbit_track orbit = before->orbit;
        bst_sky_state state = orbit.sky;
        if (bst_sky_fuse(&state, &track->state) && bst_orbit_track_update(&orbit, &state)) {
            track->orbit = orbit;
            track->state = state;
            track->models.count = 0;
        }
    }
    if (!stored) {
        before->replaced = true;
    } else {
        remove_stored(m, (int)(before - m->memory));
    }
    return true;
}
