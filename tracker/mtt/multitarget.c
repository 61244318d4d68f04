#include "tracker/mtt/multitarget.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"

/* Two tracks are of one object if their states agree to the 99 % quantile of chi-square with 4
 * degrees of freedom, 13.277. NEAR_COSINE, 4.5 mrad, only spares the comparison: a pair at that
 * distance agrees only with a standard deviation of 4.5 mrad / sqrt(2 SAME_CHI2) = 180 arcsec,
 * three times the default max_sigma_arcsec, at which a track is deleted. */
static const double SAME_CHI2 = 13.3, NEAR_COSINE = 0.99999;
/* Gain of the exponential mean of the clutter: memory of 1 / gain = 10 frames, variance of a
 * frame's count times gain / (2 - gain) = 1 / 19. */
static const double CLUTTER_GAIN = 0.1;
/* A tentative track is deleted after so many windows of N frames in which it was not confirmed. In
 * the first it needs M hits (M of N) unless its existence probability decides; its score and
 * chi-square have the second and the third. */
enum { TENTATIVE_WINDOWS = 3 };

/* Checks the parameters of the multi-target tracker. */
static bst_status check(bst_ctx *ctx, const bst_mtt_params *p) {
    if (p->max_tracks < 1 || p->max_detections < 1 || p->confirm_hits < 2 ||
        p->confirm_frames < p->confirm_hits || p->max_stationary_tracks < 0 ||
        !(p->field_sr > 0.0) ||
        !(p->detection_probability > 0.0 && p->detection_probability < 1.0) ||
        !(p->false_alarms_per_frame > 0.0) || !(p->gate_chi2 > 0.0) || !(p->noise_rad2ps3 >= 0.0) ||
        p->max_dormant_tracks < 0 || p->event_window < 0 ||
        p->event_window > BST_MTT_EVENT_WINDOW) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "tracker: parameters out of range (need at least one track and detection, "
                        "2 <= confirm_hits <= confirm_frames, detection_probability in (0, 1), "
                        "positive field, false alarms and gate, event_window 0 to %d)",
                        BST_MTT_EVENT_WINDOW);
    }
    if (p->filter == BST_FILTER_IMM && p->orbits) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "tracker: motion \"orbit\" does not go with type \"imm\"; use \"ekf\"");
    }
    if (p->filter == BST_FILTER_IMM &&
        !(p->manoeuvre_noise_rad2ps3 >= 0.0 && p->quiescent_sojourn_s > 0.0 &&
          p->manoeuvre_sojourn_s > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "tracker: imm needs manoeuvre noise >= 0, quiescent_sojourn_s > 0 and "
                        "manoeuvre_sojourn_s > 0");
    }
    return BST_OK;
}

/* The tracker's arrays. */
static void lay_out(bst_mtt *m) {
    const bst_mtt_params *p = &m->params;
    size_t nt = (size_t)p->max_tracks + (size_t)p->max_stationary_tracks + 1,
           ne = nt * BST_MTT_CANDIDATES;
    bst_arena *a = &m->arena;
    BST_ARENA_TAKE(a, m->tracks, nt);
    BST_ARENA_TAKE(a, m->memory, (size_t)p->max_dormant_tracks + 1);
    BST_ARENA_TAKE(a, m->events, 4 * nt);
    BST_ARENA_TAKE(a, m->edge_order, ne);
    BST_ARENA_TAKE(a, m->edge_row, ne);
    BST_ARENA_TAKE(a, m->edge_key, ne);
    BST_ARENA_TAKE(a, m->owner, (size_t)p->max_detections);
    BST_ARENA_TAKE(a, m->rows, nt);
    BST_ARENA_TAKE(a, m->first, nt);
    BST_ARENA_TAKE(a, m->column_of_row, nt);
    BST_ARENA_TAKE(a, m->miss_costs, nt);
    BST_ARENA_TAKE(a, m->edge_columns, ne);
    BST_ARENA_TAKE(a, m->edge_costs, ne);
    BST_ARENA_TAKE(a, m->detection_of_track, nt);
    BST_ARENA_TAKE(a, m->extra, nt);
    BST_ARENA_TAKE(a, m->shared, nt);
    BST_ARENA_TAKE(a, m->observable, nt);
    BST_ARENA_TAKE(a, m->departed_chi2, nt);
    BST_ARENA_TAKE(a, m->priors, p->keep_priors ? nt : 0);
    if (p->association == BST_MTT_PMB) {
        bst_mtt_joint_lay_out(&m->joint, (int)nt, p->max_detections, a);
    }
    bst_mtt_pool_lay_out(&m->now, p->max_detections, a);
    for (int h = 0; h < BST_MTT_HISTORY; h++) {
        bst_mtt_pool_lay_out(&m->history[h], p->max_detections, a);
    }
}

bst_status bst_mtt_create(bst_ctx *ctx, const bst_mtt_params *params, bst_mtt **out) {
    assert(params && out);
    *out = NULL;
    BST_TRY(check(ctx, params));
    bst_mtt *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
    }
    m->params = *params;
    m->filter = (bst_filter_params){.kind = params->filter,
                                    .noise_rad2ps3 = params->noise_rad2ps3,
                                    .steady_noise_rad2ps3 = params->steady_noise_rad2ps3,
                                    .manoeuvre_noise_rad2ps3 = params->manoeuvre_noise_rad2ps3,
                                    .quiescent_sojourn_s = params->quiescent_sojourn_s,
                                    .manoeuvre_sojourn_s = params->manoeuvre_sojourn_s};
    m->next_id = 1;
    m->clutter = params->false_alarms_per_frame;
    m->clutter_density = params->false_alarms_per_frame / params->field_sr;
    char what[80];
    snprintf(what, sizeof what, "%d tracks, %d detections of the tracker", params->max_tracks,
             params->max_detections);
    lay_out(m);
    bst_status status = bst_arena_alloc(ctx, &m->arena, what);
    if (status == BST_OK) {
        lay_out(m);
        status = bst_assignment_create(ctx, params->max_tracks + params->max_stationary_tracks,
                                       params->max_detections, &m->assignment);
    }
    if (status != BST_OK) {
        bst_mtt_free(m);
        return status;
    }
    *out = m;
    return BST_OK;
}

void bst_mtt_free(bst_mtt *m) {
    if (!m) {
        return;
    }
    bst_arena_free(&m->arena);
    bst_assignment_free(m->assignment);
    free(m);
}

/* Appends a track event of this frame. */
static void record_event(bst_mtt *m, bst_mtt_event_kind kind, const bst_mtt_track *track,
                         double statistic) {
    assert(m->event_count < 4 * (m->params.max_tracks + m->params.max_stationary_tracks + 1));
    m->events[m->event_count++] =
        (bst_mtt_event){.kind = kind, .statistic = statistic, .track = *track};
}

/* Shifts a track by the cue's acceleration, transported from the cue's direction. */
static void shift_track(bst_mtt_track *track, const bst_mtt_frame *frame, bst_vec3 step,
                        bst_vec3 rate) {
    bst_vec3 d = track->state.direction;
    bst_filter_shift(&track->state, &track->models,
                     bst_tangent_carry(frame->cue_direction, d, step),
                     bst_tangent_carry(frame->cue_direction, d, rate));
}

/* Filter parameters of a track. A filter other than IMM uses the manoeuvre process noise while the
 * innovations show a manoeuvre (adjustable process noise: Bar-Shalom, Li and Kirubarajan,
 * Estimation with Applications to Tracking and Navigation, 2001, section 11.2). Confirmed tracks
 * adapt their noise. */
static bst_filter_params filter_of(const bst_mtt *m, const bst_mtt_track *track) {
    bst_filter_params filter = m->filter;
    if (filter.kind != BST_FILTER_IMM && m->seconds < track->manoeuvre_end_s) {
        filter.noise_rad2ps3 = fmax(filter.noise_rad2ps3, filter.manoeuvre_noise_rad2ps3);
        filter.steady_noise_rad2ps3 = 0.0;
    }
    if (track->status == BST_TRACK_TENTATIVE) {
        filter.steady_noise_rad2ps3 = 0.0;
    }
    return filter;
}

/* Predicts all tracks and stored tracks to the frame's time. */
static void predict_tracks(bst_mtt *m, const bst_mtt_frame *frame) {
    double dt = frame->seconds - m->seconds;
    bst_vec3 step = {0}, rate = {0};
    m->sleepers = 0;
    bst_mtt_predict_undetected(m, frame);
    bool forward = m->started && bst_mtt_cue_acceleration(frame, dt, &step, &rate);
    m->cue_lag_valid = forward && dt > 0.0;
    if (m->cue_lag_valid) {
        bst_vec3 behind = bst_vec3_sub(rate, bst_vec3_scale(step, 1.0 / dt));
        m->cue_lag_radps2 = bst_vec3_scale(behind, 1.0 / dt);
    }
    for (int t = 0; t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        if (track->star) {
            bst_mtt_predict_star(m, dt, track);
            m->observable[t] = true;
            continue;
        }
        if (!bst_mtt_predict_orbit(m, track, frame)) {
            const bst_filter_params filter = filter_of(m, track);
            bst_filter_predict(&filter, dt, &track->state, &track->models);
            if (forward && bst_mtt_shares_acceleration(m, track, frame)) {
                shift_track(track, frame, step, rate);
            }
        }
        m->observable[t] =
            !(frame->partial && track->status == BST_TRACK_TENTATIVE) &&
            (!frame->in_field || frame->in_field(frame->user, track->state.direction));
        bst_mtt_look(m, t, frame);
    }
    bst_mtt_predict_memory(m, frame);
    for (int i = 0; forward && i < m->memory_count; i++) {
        if (!m->memory[i].orbit.valid && bst_mtt_shares_acceleration(m, &m->memory[i], frame)) {
            shift_track(&m->memory[i], frame, step, rate);
        }
    }
    m->seconds = frame->seconds;
    m->started = true;
    m->event_count = 0;
    m->lost = 0;
}

/* Loads the frame's detections into the pool. */
static void load_detections(bst_mtt *m, const bst_mtt_frame *frame) {
    bst_mtt_pool *now = &m->now;
    now->seconds = frame->seconds;
    now->tick = frame->tick;
    now->count = frame->count < m->params.max_detections ? frame->count : m->params.max_detections;
    m->lost += frame->count - now->count;
    if (now->count > 0) {
        memcpy(now->items, frame->detections, (size_t)now->count * sizeof *now->items);
    }
    memset(now->used, 0, (size_t)now->count * sizeof *now->used);
    bst_mtt_pool_index(now);
}

/* Kalman update of a track's magnitude, and test for a change of brightness. */
static void update_brightness(bst_mtt *m, bst_mtt_track *track, const bst_mtt_detection *detection,
                              double dt_s) {
    double floor = m->params.brightness_systematic_mag, walk = m->params.brightness_random_walk_mag;
    double r = floor * floor + detection->v_mag_sigma * detection->v_mag_sigma;
    if (!isfinite(r) || !isfinite(detection->v_mag)) {
        return;
    }
    double p = track->v_mag_variance + walk * walk;
    double off = detection->v_mag - track->v_mag, gain = p / (p + r), statistic;
    track->v_mag += gain * off;
    track->v_mag_variance = (1.0 - gain) * p;
    if (track->status != BST_TRACK_TENTATIVE && !track->star &&
        bst_mtt_note_brightness(&m->params, track, off / sqrt(p + r), dt_s, &statistic)) {
        record_event(m, BST_MTT_BRIGHTNESS, track, statistic);
    }
}

/* Filter update of a track: with its assigned detection, or with all detections in its gate for
 * probabilistic data association. */
static void update_filter(bst_mtt *m, int t) {
    bst_mtt_track *track = &m->tracks[t];
    int given = m->detection_of_track[t];
    bool weighs = m->params.association == BST_MTT_PDA || m->params.association == BST_MTT_MIXTURE;
    bool apart = m->params.association >= BST_MTT_MIXTURE && m->params.filter != BST_FILTER_IMM;
    int components = apart && !track->star ? BST_FILTER_COMPONENTS : 1;
    bst_filter_candidate candidates[BST_MTT_CANDIDATES];
    if (m->params.association == BST_MTT_PMB && bst_mtt_joint_update(m, t, components)) {
        return;
    }
    if (!weighs || track->status == BST_TRACK_TENTATIVE || track->star || m->shared[t]) {
        if (given >= 0) {
            candidates[0] = (bst_filter_candidate){.measurement = &m->now.items[given].sky,
                                                   .extra = m->shared[t] ? m->extra[t] : NULL};
            const bst_filter_evidence own = {candidates, 1, 0.0, 1.0};
            bst_filter_update(&m->filter, &track->state, &track->models, &own, components);
        }
        return;
    }
    int columns[BST_MTT_CANDIDATES];
    int count = m->observable[t] ? bst_mtt_gated(m, t, columns) : 0;
    for (int i = 0; i < count; i++) {
        candidates[i] = (bst_filter_candidate){.measurement = &m->now.items[columns[i]].sky};
    }
    if (count > 0) {
        double pd = m->params.detection_probability, pg = -expm1(-0.5 * m->params.gate_chi2);
        const bst_filter_evidence gated = {candidates, count, 1.0 - pd * pg, pd / m->alarm_density};
        bst_filter_update(&m->filter, &track->state, &track->models, &gated, components);
    }
}

/* Updates a track with its detection: filter, score, brightness and event tests. */
static void update_track(bst_mtt *m, int t) {
    bst_mtt_track *track = &m->tracks[t];
    int given = m->detection_of_track[t];
    const bst_mtt_detection *detection = given >= 0 ? &m->now.items[given] : NULL;
    bst_mtt_sharing shared = m->shared[t];
    bool hidden = shared == BST_MTT_HIDDEN, outshines = shared == BST_MTT_OUTSHINING;
    bst_filter_candidate candidate = {.extra = shared ? m->extra[t] : NULL};
    bst_filter_fit fit;
    const bst_joint_hypothesis *decision = bst_mtt_joint_decision(m, t);
    bool doubtful = decision && decision->merged > 0.0, merged = doubtful && decision->merged > 0.5;
    if (detection) {
        candidate.measurement = doubtful ? &decision->sky : &detection->sky;
    }
    bool taken = hidden || (detection && bst_filter_evaluate(&m->filter, &track->state,
                                                             &track->models, &candidate, &fit));
    if (!hidden && (taken || !detection)) {
        update_filter(m, t);
    }
    if (!taken) {
        return;
    }
    track->x_px = detection->x_px;
    track->y_px = detection->y_px;
    track->snr = detection->snr;
    if (shared && !outshines) {
        track->merged_in_row++;
        return;
    }
    double dt = m->now.seconds - track->last_update_s, statistic;
    track->merged_in_row = 0;
    track->misses_in_row = 0;
    track->hits++;
    double chi2 = track->models.levels > 0 ? fit.innovation.chi2 : fit.chi2;
    track->chi2 += chi2;
    track->last_chi2 = chi2;
    track->score +=
        log(bst_mtt_detection_probability(m, track) / m->clutter_density) + fit.log_likelihood;
    bst_mtt_note_place(track, detection);
    bst_mtt_note_fixed(m, detection, fit.log_likelihood, track);
    track->last_update_tick = m->now.tick;
    track->last_update_s = m->now.seconds;
    if (m->departed_chi2[t] > 0.0) {
        record_event(m, BST_MTT_MANOEUVRE, track, m->departed_chi2[t]);
        track->innovation_count = 0;
    } else if (track->status != BST_TRACK_TENTATIVE && !track->star &&
               bst_mtt_note_innovation(&m->params, track, &fit.innovation, dt, &statistic)) {
        record_event(m, BST_MTT_MANOEUVRE, track, statistic);
        track->manoeuvre_end_s = m->now.seconds + m->params.manoeuvre_sojourn_s;
        /* the manoeuvre explains this innovation: it says nothing on whether the track is of one
         * object */
        track->chi2 -= fmax(chi2 - 2.0, 0.0);
    }
    if (!outshines && !merged) { /* otherwise the brightness contains another object's light */
        update_brightness(m, track, detection, dt);
        bst_mtt_note_light(track);
        bst_mtt_note_snr(m, detection->snr, track);
    }
}

/* 99.9 % quantile of chi-square (Wilson and Hilferty 1931). */
static double chi2_limit(int dof) {
    const double quantile = 3.0902; /* 99.9 % of the normal distribution */
    double v = 2.0 / (9.0 * dof), c = 1.0 - v + quantile * sqrt(v);
    return dof * c * c * c;
}

/* True if a tentative track meets the confirmation criteria. */
static bool may_confirm(const bst_mtt *m, const bst_mtt_track *track) {
    int dof = 2 * (track->hits - 2);
    if (track->at_rest || track->hits < m->params.confirm_hits ||
        track->score < m->params.confirm_score || !bst_mtt_joint_exists(m, track) ||
        (dof > 0 && track->chi2 > chi2_limit(dof)) || bst_mtt_may_be_fixed(m, track)) {
        return false;
    }
    /* a second track of an object that is already tracked is not confirmed */
    for (int u = 0; u < m->track_count; u++) {
        const bst_mtt_track *other = &m->tracks[u];
        if (other != track && !other->asleep && other->status != BST_TRACK_TENTATIVE &&
            bst_vec3_dot(other->state.direction, track->state.direction) > NEAR_COSINE &&
            bst_sky_distance2(&other->state, &track->state) < SAME_CHI2) {
            return false;
        }
    }
    return true;
}

/* True if a track is to be deleted. */
static bool must_delete(const bst_mtt *m, const bst_mtt_track *track, bool observed) {
    const bst_mtt_params *p = &m->params;
    double variance = fmax(track->state.covariance[0][0], track->state.covariance[1][1]);
    if (bst_mtt_joint_is_gone(m, track)) {
        return true;
    }
    if (track->asleep) {
        return m->seconds - track->last_update_s > p->max_dormant_s ||
               !(variance < p->max_dormant_sigma_rad * p->max_dormant_sigma_rad) ||
               track->misses_in_row > p->max_misses;
    }
    /* a tentative track is not worth coasting */
    double patience_s =
        track->status == BST_TRACK_TENTATIVE
            ? fmin(p->max_coast_s, p->initiation_gap_s * (p->confirm_frames - p->confirm_hits + 1))
            : p->max_coast_s;
    if (track->at_rest && track->hits >= p->confirm_hits) {
        return m->seconds - track->last_update_s > p->max_coast_s ||
               !(variance < p->max_sigma_rad * p->max_sigma_rad) ||
               (!track->star && track->misses_in_row > p->max_misses);
    }
    if (!(variance < p->max_sigma_rad * p->max_sigma_rad) ||
        m->seconds - track->last_update_s > patience_s) {
        return true;
    }
    if (track->status != BST_TRACK_TENTATIVE) {
        /* one that the cue expects is rather dark or too faint than lost */
        bool waits =
            track->dark > 0.0 && bst_mtt_detectable(m, track) < 0.5 * p->detection_probability;
        return track->may_miss && track->misses_in_row > p->max_misses && !waits;
    }
    if (p->association == BST_MTT_PMB && (!track->at_rest || track->hits < p->confirm_hits)) {
        return track->frames >= TENTATIVE_WINDOWS * p->confirm_frames;
    }
    int allowed = p->confirm_frames - p->confirm_hits;
    return (observed && track->misses_in_row > allowed) ||
           (track->frames >= p->confirm_frames && track->hits < p->confirm_hits) ||
           track->frames >= TENTATIVE_WINDOWS * p->confirm_frames;
}

/* Turns a stationary track into a star. */
static void become_star(bst_mtt *m, bst_mtt_track *track) {
    bst_mtt_set_rest(m, track, true);
    if (track->at_rest) {
        if (track->status != BST_TRACK_TENTATIVE) {
            record_event(m, BST_MTT_LOST, track, 0.0);
        }
        bst_mtt_make_star(track);
    }
}

/* Track maintenance after the update: misses, confirmation, re-identification, deletion. */
static void maintain_tracks(bst_mtt *m, const bst_mtt_frame *frame) {
    for (int t = 0; t < m->track_count; t++) {
        bst_mtt_track *track = &m->tracks[t];
        if (track->star) {
            continue;
        }
        /* a track hidden by its neighbour's light is not missed */
        bool taken =
            m->detection_of_track[t] >= 0 &&
            (track->merged_in_row <= m->params.max_merged_frames || m->shared[t] == BST_MTT_HIDDEN);
        track->frames += m->observable[t];
        if (track->may_miss && !taken) {
            track->misses_in_row++;
            if (m->detection_of_track[t] >= 0) { /* of another's light: else it is in the score */
                track->score += log(1.0 - bst_mtt_detection_probability(m, track));
            }
        }
        bool at_rest = taken && bst_mtt_is_at_rest(m, frame, track);
        if (at_rest && bst_mtt_is_star(m, frame, track)) {
            become_star(m, track);
        } else if (taken && track->status == BST_TRACK_TENTATIVE) {
            bst_mtt_set_rest(m, track, at_rest);
        }
        if (track->star) {
            continue;
        }
        if (track->status != BST_TRACK_TENTATIVE) {
            track->status = taken ? BST_TRACK_CONFIRMED : BST_TRACK_COASTING;
            if (taken && m->sleepers > 0 && bst_mtt_resume(m, track, false)) {
                record_event(m, BST_MTT_RESUMED, track, 0.0);
            }
        } else if (taken && may_confirm(m, track)) {
            track->status = BST_TRACK_CONFIRMED;
            bst_mtt_recount_alarms(m, track);
            bool resumed = bst_mtt_resume(m, track, true);
            record_event(m, resumed ? BST_MTT_RESUMED : BST_MTT_CONFIRMED, track, 0.0);
        }
    }
    int kept = 0, at_rest = 0; /* rest_count is asked until all have been looked at */
    for (int t = 0; t < m->track_count; t++) {
        const bst_mtt_track *track = &m->tracks[t];
        if (track->replaced) {
            continue;
        }
        if (!must_delete(m, track, m->observable[t])) {
            at_rest += track->at_rest;
            if (kept != t) {
                m->tracks[kept] = *track;
            }
            kept++;
        } else if (track->status != BST_TRACK_TENTATIVE && !track->star) {
            record_event(m, BST_MTT_LOST, track, 0.0);
            bst_mtt_remember(m, track);
        }
    }
    m->track_count = kept;
    m->rest_count = at_rest;
}

/* Stores the frame's unused detections for two-point initiation in later frames. */
static void store_unused(bst_mtt *m) {
    bst_mtt_pool oldest = m->history[BST_MTT_HISTORY - 1];
    for (int h = BST_MTT_HISTORY - 1; h > 0; h--) {
        m->history[h] = m->history[h - 1];
    }
    bst_mtt_pool *now = &m->now;
    int kept = 0;
    for (int i = 0; i < now->count; i++) {
        if (!now->used[i]) {
            now->items[kept] = now->items[i];
            now->used[kept++] = false;
        }
    }
    now->count = kept;
    bst_mtt_pool_index(now);
    m->history[0] = *now;
    m->now = oldest;
    if (m->history_count < BST_MTT_HISTORY) {
        m->history_count++;
    }
}

/* Keeps the predicted states, as the update of this frame uses them. */
static void note_priors(bst_mtt *m) {
    m->prior_count = m->params.keep_priors ? m->track_count : 0;
    for (int t = 0; t < m->prior_count; t++) {
        m->priors[t] = (bst_mtt_prior){m->tracks[t].id, m->tracks[t].state};
    }
}

void bst_mtt_step(bst_mtt *m, const bst_mtt_frame *frame) {
    assert(m && frame && frame->count >= 0 && (frame->detections || frame->count == 0));
    assert(!m->started || frame->seconds > m->seconds);
    predict_tracks(m, frame);
    load_detections(m, frame);
    bst_mtt_observe_undetected(m, frame->partial);
    double floor = m->params.false_alarms_per_frame;
    m->bad_pixels = frame->bad_pixels;
    m->charged = frame->charged;
    m->threshold_snr = m->params.association == BST_MTT_PMB ? frame->threshold_snr : 0.0;
    m->clutter_density = fmax(m->clutter, floor) / m->params.field_sr;
    m->alarm_density = fmax(m->alarms, floor) / m->params.field_sr;
    bst_mtt_associate(m, frame->partial);
    note_priors(m);
    int unused = 0;
    for (int t = 0; t < m->track_count; t++) {
        m->tracks[t].last_chi2 = -1.0;
        m->tracks[t].burned = false;
        update_track(m, t);
        bst_mtt_note_darkness(m, t);
    }
    for (int i = 0; i < m->now.count; i++) {
        unused += !m->now.used[i];
    }
    m->clutter += frame->partial ? 0.0 : CLUTTER_GAIN * (unused - m->clutter);
    if (m->params.association == BST_MTT_PMB) {
        bst_mtt_joint_drop_duplicates(m, SAME_CHI2);
    }
    bst_mtt_update_orbits(m, frame);
    maintain_tracks(m, frame);
    bst_mtt_initiate(m, frame);
    store_unused(m);
}

void bst_mtt_skip(bst_mtt *m, const bst_mtt_frame *frame) {
    assert(m && frame && (!m->started || frame->seconds > m->seconds));
    predict_tracks(m, frame);
    note_priors(m);
    m->now.count = 0;
    for (int t = 0; t < m->track_count; t++) {
        m->observable[t] = m->tracks[t].may_miss = false;
        m->detection_of_track[t] = -1;
        m->tracks[t].last_chi2 = -1.0;
        m->tracks[t].burned = false;
    }
    maintain_tracks(m, frame);
}

const bst_mtt_track *bst_mtt_tracks(const bst_mtt *m, int *count) {
    *count = m->track_count;
    return m->tracks;
}

const bst_mtt_track *bst_mtt_find(const bst_mtt *m, int64_t id) {
    for (int t = 0; t < m->track_count; t++) {
        if (m->tracks[t].id == id) {
            return &m->tracks[t];
        }
    }
    return NULL;
}

const bst_mtt_prior *bst_mtt_priors(const bst_mtt *m, int *count) {
    *count = m->prior_count;
    return m->priors;
}

const bst_mtt_event *bst_mtt_events(const bst_mtt *m, int *count) {
    *count = m->event_count;
    return m->events;
}

const bst_mtt_track *bst_mtt_memory(const bst_mtt *m, int *count) {
    *count = m->memory_count;
    return m->memory;
}

double bst_mtt_clutter_density(const bst_mtt *m) {
    return m->alarm_density;
}

int bst_mtt_lost(const bst_mtt *m) {
    return m->lost;
}
