#include "tracker/target.h"

/* Adds x^T P^-1 x and ln det P of a 2-vector to a target misfit; INFINITY for an invalid P or a
 * misfit beyond `limit`. */
#include <assert.h>
static void add2(bst_target_fit *fit, const double x[2], double p11, double p12, double p22,
                 double limit) {
    double det = p11 * p22 - p12 * p12;
    double chi2 = (p22 * x[0] * x[0] - 2.0 * p12 * x[0] * x[1] + p11 * x[1] * x[1]) / det;
    if (det > 0.0 && chi2 <= limit) {
        fit->chi2 += chi2;
        fit->log_det += log(det);
    } else {
        fit->chi2 = INFINITY;
    }
}

bst_vec3 bst_target_expected_rate(const bst_target_cue *cue, bst_vec3 direction) {
    bst_vec3 rate;
    double range_m, range_rate_mps;
    if (cue->in_region &&
        bst_belt_motion(&cue->belt_eye, direction, &rate, &range_m, &range_rate_mps)) {
        return rate;
    }
    return bst_tangent_carry(cue->direction, direction,
                             bst_tangent_project(cue->direction, cue->rate_radps));
}

/* Rate of the track minus that of the cue, rad/s. */
static bst_vec3 rate_departure(const bst_target_cue *cue, const bst_mtt_track *track) {
    const bst_sky_state *s = &track->state;
    return bst_vec3_sub(s->rate_radps, bst_target_expected_rate(cue, s->direction));
}

/* Components of a rate in the track's tangent axes, and its covariance (11, 12, 22) increased by
 * `more`. */
static void in_axes(const bst_mtt_track *track, bst_vec3 rate, double more, double x[2],
                    double p[3]) {
    const bst_sky_state *s = &track->state;
    bst_tangent axes = bst_tangent_at(s->direction);
    x[0] = bst_vec3_dot(rate, axes.e1);
    x[1] = bst_vec3_dot(rate, axes.e2);
    p[0] = s->covariance[2][2] + more;
    p[1] = s->covariance[2][3];
    p[2] = s->covariance[3][3] + more;
}

/* Variance per axis of the cue's rate, (rad/s)^2. */
static double cue_variance(const bst_target_params *params, const bst_target_cue *cue) {
    return cue->rate_sigma_radps * cue->rate_sigma_radps +
           params->rate_floor_radps * params->rate_floor_radps;
}

/* Chi-square of a track's rate against a given rate. */
static double rate_chi2(const bst_mtt_track *track, bst_vec3 rate, double more) {
    double x[2], p[3];
    in_axes(track, rate, more, x, p);
    double det = p[0] * p[2] - p[1] * p[1];
    return (p[2] * x[0] * x[0] - 2.0 * p[1] * x[0] * x[1] + p[0] * x[1] * x[1]) / det;
}

/* Misfit of a track to a valid cue. */
static bst_target_fit misfit(const bst_target_params *params, const bst_target_cue *cue,
                             const bst_mtt_track *track) {
    const bst_sky_state *s = &track->state;
    bst_target_fit fit = {.chi2 = 0.0};
    double x[2], p[3];
    in_axes(track, rate_departure(cue, track), cue_variance(params, cue), x, p);
    add2(&fit, x, p[0], p[1], p[2], params->rate_chi2);
    bst_tangent axes = bst_tangent_at(s->direction);
    bst_vec3 to = bst_tangent_log(s->direction, cue->direction);
    double d[2] = {bst_vec3_dot(to, axes.e1), bst_vec3_dot(to, axes.e2)};
    double variance = cue->sigma_rad * cue->sigma_rad;
    add2(&fit, d, s->covariance[0][0] + variance, s->covariance[0][1],
         s->covariance[1][1] + variance, params->direction_chi2);
    if (isfinite(cue->v_mag) && isfinite(cue->v_mag_sigma) && isfinite(track->v_mag)) {
        /* 0.1 mag: a track is never better known than its photometric zero point */
        double v = cue->v_mag_sigma * cue->v_mag_sigma + track->v_mag_variance + 0.01;
        double m = track->v_mag - cue->v_mag;
        fit.chi2 += m * m / v <= params->magnitude_chi2 ? m * m / v : INFINITY;
        fit.log_det += log(v);
    }
    return fit;
}

/* True if a track's rate is accurate enough to compare it with the cue. */
static bool rate_is_known(const bst_target_params *params, const bst_mtt_track *track) {
    const bst_sky_state *s = &track->state;
    double limit2 = params->max_rate_sigma_radps * params->max_rate_sigma_radps;
    return s->covariance[2][2] <= limit2 && s->covariance[3][3] <= limit2;
}

bst_target_fit bst_target_misfit(const bst_target_params *params, const bst_target_cue *cue,
                                 const bst_mtt_track *track) {
    int dof = 2 * (track->hits - 2);
    if (!cue->valid || track->at_rest || track->status == BST_TRACK_TENTATIVE ||
        !rate_is_known(params, track) || (dof > 0 && track->chi2 > params->max_chi2 * dof)) {
        return (bst_target_fit){.chi2 = INFINITY};
    }
    return misfit(params, cue, track);
}

static const bst_mtt_track *find(const bst_mtt_track *tracks, int count, int64_t id) {
    for (int i = 0; i < count; i++) {
        if (tracks[i].id == id) {
            return &tracks[i];
        }
    }
    return NULL;
}

/* True if the target is released: its rate has become that of a star, or that of another object
 * over frames in which it was not resolved. */
static bool is_released(const bst_target *target, const bst_target_params *params,
                        const bst_target_cue *cue, const bst_mtt_track *track) {
    if (!cue->valid) {
        return false;
    }
    bst_vec3 departure = rate_departure(cue, track);
    double variance = cue_variance(params, cue);
    if (rate_chi2(track, departure, variance) <= params->release_chi2) {
        return false;
    }
    double floor = params->rate_floor_radps * params->rate_floor_radps;
    if (!target->departed ||
        (rate_is_known(params, track) &&
         rate_chi2(track, track->state.rate_radps, floor) <= params->rate_chi2)) {
        return true;
    }
    return rate_chi2(track, bst_vec3_sub(departure, target->departure_radps), variance) >
           params->release_chi2;
}

bool bst_target_is_expected(const bst_target_params *params, const bst_target_cue *cue,
                            const bst_mtt_track *track, const bst_target *target) {
    if (!cue->valid) {
        return false;
    }
    return target ? !is_released(target, params, cue, track)
                  : misfit(params, cue, track).chi2 < INFINITY;
}

/* Stores the target's state for a later re-selection. */
static void store_target(bst_target *target, const bst_target_cue *cue, double seconds,
                         const bst_mtt_track *track) {
    target->memory = track->state;
    target->memory_seconds = seconds;
    if (cue->valid && track->misses_in_row == 0 && track->merged_in_row == 0) {
        target->departed = true;
        target->departure_radps = rate_departure(cue, track);
    }
}

void bst_target_step(bst_target *target, const bst_target_params *params, const bst_target_cue *cue,
                     double seconds, const bst_mtt_track *tracks, int count) {
    assert(target && params && cue && count >= 0 && (tracks || count == 0));
    if (target->id != 0) {
        const bst_mtt_track *kept = find(tracks, count, target->id);
        if (kept && !kept->at_rest && !is_released(target, params, cue, kept)) {
            store_target(target, cue, seconds, kept);
            return;
        }
        /* a track mistaken for the target gives no prediction of where the target is */
        target->remembered = kept == NULL;
        target->lost_seconds = seconds;
        target->id = 0;
    }
    bst_sky_state memory = target->memory;
    bool bound = target->remembered && seconds - target->lost_seconds <= params->max_dormant_s;
    if (bound) {
        bst_sky_predict(&memory, seconds - target->memory_seconds, params->memory_noise_rad2ps3);
    }
    const bst_mtt_track *best = NULL;
    double lowest = INFINITY, lowest_chi2 = INFINITY, second = INFINITY;
    for (int i = 0; i < count; i++) {
        bst_target_fit fit = bst_target_misfit(params, cue, &tracks[i]);
        if (bound && fit.chi2 < INFINITY) {
            double distance2 = bst_sky_distance2(&memory, &tracks[i].state);
            fit.chi2 = distance2 <= params->dormant_gate_chi2 ? fit.chi2 + distance2 : INFINITY;
        }
        double misfit = fit.chi2 + fit.log_det;
        if (misfit < lowest) {
            second = lowest;
            lowest = misfit;
            lowest_chi2 = fit.chi2;
            best = &tracks[i];
        } else if (misfit < second) {
            second = misfit;
        }
    }
    if (best && best->hits < params->min_hits + (int)(0.5 * lowest_chi2)) {
        return;
    }
    if (best && (0.5 * (second - lowest) >= params->margin || best->hits >= params->margin_hits)) {
        target->id = best->id;
        target->remembered = false;
        target->departed = false;
        store_target(target, cue, seconds, best);
    }
}
