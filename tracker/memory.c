/* Tracks that were deleted after they had been confirmed: an eclipse or an occultation ends a
 * track, not an object. */
#include <string.h>

#include "tracker/multitarget_internal.h"

/* Log-likelihood by which the best remembered track must lead the second. */
#define LEAD 2.0

static void forget(bst_mtt *m, int i) {
    m->memory_count--;
    memmove(m->memory + i, m->memory + i + 1, (size_t)(m->memory_count - i) * sizeof *m->memory);
}

void bst_mtt_predict_memory(bst_mtt *m, const bst_mtt_frame *frame) {
    double dt_s = frame->seconds - m->seconds;
    double limit2 = m->params.memory_sigma_rad * m->params.memory_sigma_rad;
    int kept = 0;
    for (int i = 0; i < m->memory_count; i++) {
        bst_mtt_track *track = &m->memory[i];
        if (!bst_mtt_predict_orbit(m, track, frame)) {
            bst_filter_predict(&m->filter, dt_s, &track->state, &track->models);
        }
        double variance = fmax(track->state.covariance[0][0], track->state.covariance[1][1]);
        if (variance <= limit2 && m->seconds + dt_s - track->last_update_s <= m->params.memory_s) {
            m->memory[kept++] = *track;
        }
    }
    m->memory_count = kept;
}

void bst_mtt_remember(bst_mtt *m, const bst_mtt_track *track) {
    if (m->params.max_memory == 0) {
        return;
    }
    if (m->memory_count == m->params.max_memory) {
        forget(m, 0);
    }
    m->memory[m->memory_count++] = *track;
}

bool bst_mtt_resume(bst_mtt *m, bst_mtt_track *track) {
    int best = -1;
    double lowest = INFINITY, second = INFINITY;
    for (int i = 0; i < m->memory_count; i++) {
        double chi2 = bst_sky_distance2(&m->memory[i].state, &track->state);
        if (!(chi2 <= m->params.memory_chi2)) {
            continue;
        }
        double misfit = chi2 + bst_log_det4(m->memory[i].state.covariance);
        if (misfit < lowest) {
            second = lowest;
            lowest = misfit;
            best = i;
        } else if (misfit < second) {
            second = misfit;
        }
    }
    if (best < 0 || 0.5 * (second - lowest) < LEAD) {
        return false;
    }
    const bst_mtt_track *before = &m->memory[best];
    track->id = before->id;
    track->hits += before->hits;
    track->first_tick = before->first_tick;
    if (before->orbit.valid) {
        /* the orbit knows more than the few detections since */
        bst_orbit_track orbit = before->orbit;
        bst_sky_state state = orbit.sky;
        if (bst_sky_fuse(&state, &track->state) && bst_orbit_track_update(&orbit, &state)) {
            track->orbit = orbit;
            track->state = state;
            track->models.count = 0;
        }
    }
    forget(m, best);
    return true;
}
