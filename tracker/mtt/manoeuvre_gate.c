/* Second, wider gate for tracks without a detection in their own: the object may have begun to
 * manoeuvre (two-level gating: Blackman and Popoli, Design and Analysis of Modern Tracking Systems,
 * 1999, section 6.4). Filter imm does not use it, because its second model always provides such a
 * gate. */
#include "tracker/mtt/multitarget_internal.h"

/* Predicted track under the hypothesis of a manoeuvre since its latest detection. */
typedef struct hypothesis {
    bst_sky_state state;
    bst_filter_models models;
    double log_prior; /* ln of the probability that a manoeuvre began since then */
} hypothesis;

/* Detection chosen for a manoeuvring track. */
typedef struct choice {
    int column;        /* index of the detection; -1: none */
    double cost;       /* -ln of its likelihood ratio against clutter */
    double quiet_chi2; /* its misfit to the quiet model */
    double alarms;     /* expected number of false alarms at least as near */
    bool steady;       /* outside of the gate, but likelier of the quiet model */
} choice;

/* True if a track without a detection is tested for a manoeuvre. */
static bool may_manoeuvre(const bst_mtt *m, int t) {
    const bst_mtt_track *track = &m->tracks[t];
    return m->detection_of_track[t] < 0 && m->shared[t] == BST_MTT_ALONE && m->observable[t] &&
           track->status != BST_TRACK_TENTATIVE && !track->star && !track->asleep &&
           track->may_miss && m->seconds >= track->manoeuvre_end_s;
}

/* Increases the covariance of a track by the process noise of a manoeuvre since its latest
 * detection. */
static void inflate_for_manoeuvre(const bst_mtt *m, const bst_mtt_track *track, hypothesis *h) {
    double dt = m->now.seconds - track->last_update_s;
    double more = m->params.manoeuvre_noise_rad2ps3 - m->params.noise_rad2ps3;
    h->state = track->state;
    h->models = track->models;
    h->log_prior = log(-expm1(-dt / m->params.quiescent_sojourn_s));
    bst_sky_add_noise(&h->state, dt, more);
    for (int i = 0; i < h->models.count; i++) {
        bst_sky_add_noise(&h->models.state[i], dt, more);
    }
}

/* True if a detection is of another track, which must be a confirmed one with BST_MTT_PMB: tracks
 * that begin with the detections of a manoeuvring object must not take it from its own. */
static bool is_taken(const bst_mtt *m, int column) {
    bool begun = m->params.association == BST_MTT_PMB && m->joint.claimed[column] > 0.5 &&
                 m->joint.claimed_firm[column] <= 0.5 && m->owner[column] == BST_MTT_NOBODY;
    return m->now.used[column] && !begun;
}

/* True if no other confirmed track is so near that they may share detections. */
static bool is_alone(const bst_mtt *m, int t) {
    bool alone = m->tracks[t].merged_in_row == 0;
    double reach = 3.0 * m->params.merge_rad;
    for (int u = 0; u < m->track_count && alone; u++) {
        bst_vec3 off = bst_vec3_sub(m->tracks[u].state.direction, m->tracks[t].state.direction);
        alone = u == t || m->tracks[u].status == BST_TRACK_TENTATIVE || bst_vec3_norm(off) > reach;
    }
    return alone;
}

/* Likeliest unused detection that a manoeuvre explains better than the quiet model, or that neither
 * clutter nor the gate's edge explains: between the gate and the place where a manoeuvre is
 * likelier there is no detection that a held track should leave to a new one. */
static choice choose_detection(const bst_mtt *m, int t, const hypothesis *h) {
    const bst_mtt_params *p = &m->params;
    const bst_mtt_track *track = &m->tracks[t];
    const double pd = bst_mtt_detection_probability(m, track);
    choice best = {.column = -1, .cost = -log(1.0 - pd)};
    double spread = h->state.covariance[0][0] + h->state.covariance[1][1];
    double radius = sqrt(p->gate_chi2 * (spread + m->largest_sigma * m->largest_sigma));
    int begin, end;
    bst_mtt_pool_range(&m->now, h->state.direction, radius, &begin, &end);
    for (int i = begin; i < end; i++) {
        int column = m->now.order[i];
        bst_filter_candidate candidate = {.measurement = &m->now.items[column].sky};
        bst_filter_fit quiet, fit;
        if (is_taken(m, column) ||
            bst_vec3_norm(bst_vec3_sub(candidate.measurement->direction, h->state.direction)) >
                radius ||
            !bst_filter_evaluate(&m->filter, &track->state, &track->models, &candidate, &quiet) ||
            !bst_filter_evaluate(&m->filter, &h->state, &h->models, &candidate, &fit) ||
            fit.chi2 > p->gate_chi2) {
            continue;
        }
        double manoeuvre = h->log_prior + fit.log_likelihood;
        bool steady = quiet.log_likelihood > manoeuvre;
        if (steady && (quiet.chi2 <= p->gate_chi2 || !is_alone(m, t))) {
            continue; /* the association has judged it, or it may be a neighbour's */
        }
        double cost = -fmax(manoeuvre, quiet.log_likelihood) + log(m->clutter_density) - log(pd) +
                      bst_mtt_brightness_cost(track, &m->now.items[column]);
        if (cost < best.cost) {
            double area = BST_PI * fit.innovation.chi2 * exp(0.5 * fit.innovation.log_det_s);
            best = (choice){column, cost, quiet.chi2, area * m->clutter_density, steady};
        }
    }
    return best;
}

void bst_mtt_gate_manoeuvres(bst_mtt *m) {
    const bst_mtt_params *p = &m->params;
    double before = m->history_count > 0 ? m->history[0].seconds : m->now.seconds;
    double allowed = bst_mtt_event_probability(p, m->now.seconds - before);
    bool asked = p->filter != BST_FILTER_IMM && allowed > 0.0 && p->quiescent_sojourn_s > 0.0 &&
                 p->manoeuvre_noise_rad2ps3 > p->noise_rad2ps3;
    for (int t = 0; t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        m->departed_chi2[t] = 0.0;
        track->gate_tick = m->detection_of_track[t] >= 0 ? m->now.tick : track->gate_tick;
        if (!asked || !may_manoeuvre(m, t)) {
            continue;
        }
        hypothesis h;
        inflate_for_manoeuvre(m, track, &h);
        choice best = choose_detection(m, t, &h);
        if (best.column < 0) {
            continue;
        }
        if (!best.steady) {
            track->state = h.state;
            track->models = h.models;
            track->manoeuvre_end_s = m->now.seconds + p->manoeuvre_sojourn_s;
        }
        m->detection_of_track[t] = best.column;
        m->now.used[best.column] = true;
        m->owner[best.column] = t;
        if (!best.steady && exp(-0.5 * best.quiet_chi2) < allowed &&
            (1.0 - bst_mtt_detection_probability(m, track)) * best.alarms < allowed) {
            m->departed_chi2[t] = best.quiet_chi2;
        }
    }
}
