#include "tracker/target.h"

#include <assert.h>

#include "tracker/identity.h"

/* Log-likelihood ratio from which a track beyond a limit is no rival. */
static const double NO_RIVAL = 6.9; /* ln 1000: no decision depends on less */

/* Adds x^T P^-1 x and ln det P of a 2-vector to a target misfit; INFINITY for an invalid P. */
static void add2(bst_target_fit *fit, const double x[2], double p11, double p12, double p22,
                 double limit) {
    double det = p11 * p22 - p12 * p12;
    double chi2 = (p22 * x[0] * x[0] - 2.0 * p12 * x[0] * x[1] + p11 * x[1] * x[1]) / det;
    if (det > 0.0) {
        fit->fits = fit->fits && chi2 <= limit;
        fit->chi2 += chi2;
        fit->log_det += log(det);
    } else {
        *fit = (bst_target_fit){.chi2 = INFINITY};
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
    bst_target_fit fit = {.fits = true};
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
        fit.fits = fit.fits && m * m / v <= params->magnitude_chi2;
        fit.chi2 += m * m / v;
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

/* True if the filter assumes that the track manoeuvres: its process noise then keeps the rate from
 * becoming as well known, and the misfit counts that by the rate's covariance. */
static bool manoeuvres(const bst_mtt_track *track) {
    return track->manoeuvre_end_s > track->last_update_s;
}

bst_target_fit bst_target_misfit(const bst_target_params *params, const bst_target_cue *cue,
                                 const bst_mtt_track *track) {
    int dof = 2 * (track->hits - 2);
    bool known = rate_is_known(params, track) || manoeuvres(track);
    if (!cue->valid || track->at_rest || track->status == BST_TRACK_TENTATIVE || !known ||
        (dof > 0 && track->chi2 > params->max_chi2 * dof)) {
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
    return !track->burned && rate_chi2(track, bst_vec3_sub(departure, target->departure_radps),
                                       variance) > params->release_chi2;
}

bool bst_target_is_expected(const bst_target_params *params, const bst_target_cue *cue,
                            const bst_mtt_track *track, const bst_target *target) {
    if (!cue->valid) {
        return false;
    }
    return target ? !is_released(target, params, cue, track) : misfit(params, cue, track).fits;
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

/* Comparison of the tracks with the cue. */
typedef struct candidates {
    const bst_mtt_track *best;   /* the likeliest of those that fit the cue; NULL: none */
    const bst_mtt_track *second; /* the likeliest other one that is a rival; NULL: none */
    double lowest, lowest_chi2;  /* chi2 + log_det of the best; its chi2 */
    double next;                 /* chi2 + log_det of the second */
    double sum;                  /* of all likelihoods over that of the best */
    bool seen;                   /* the best is likelier than that the cue's object has no track */
    bool compared;               /* the target was */
} candidates;

/* Misfit of a track to the cue and, if not NULL, to the predicted state of a lost target, which
 * must be near; the catalogue's other objects add to chi2 + log_det in log_det. The target itself
 * is compared even if a merge disturbed its motion: else any other track would be certain. */
static bst_target_fit misfit_of_all(const bst_target_params *params, const bst_target_cue *cue,
                                    const bst_sky_state *memory, const bst_mtt_track *track,
                                    int64_t target_id) {
    bst_target_fit fit = bst_target_misfit(params, cue, track);
    if (track->id == target_id && cue->valid && rate_is_known(params, track)) {
        fit = misfit(params, cue, track);
    }
    if (memory && fit.chi2 < INFINITY) {
        double distance2 = bst_sky_distance2(memory, &track->state);
        if (!(distance2 <= params->dormant_gate_chi2)) {
            return (bst_target_fit){.chi2 = INFINITY};
        }
        fit.chi2 += distance2;
    }
    if (cue->identity && fit.chi2 < INFINITY) {
        fit.log_det -= 2.0 * bst_identity_log_unexplained(cue->identity, track->id, cue->object);
    }
    return fit;
}

/* True if a track is a rival of one with chi2 + log_det `other`: it fits, or nearly as well. */
static bool is_rival(bst_target_fit fit, double other) {
    return fit.fits || fit.chi2 + fit.log_det < other + 2.0 * NO_RIVAL;
}

/* Compares all tracks with the cue.
 *
 * Given:     memory     predicted state of a lost target, which binds the choice; NULL: none
 *            target_id  0: none */
static candidates compare(const bst_target_params *params, const bst_target_cue *cue,
                          const bst_sky_state *memory, int64_t target_id,
                          const bst_mtt_track *tracks, int count) {
    candidates c = {.lowest = INFINITY, .lowest_chi2 = INFINITY, .next = INFINITY, .seen = true};
    for (int i = 0; i < count; i++) {
        bst_target_fit fit = misfit_of_all(params, cue, memory, &tracks[i], target_id);
        c.compared = c.compared || (tracks[i].id == target_id && fit.chi2 < INFINITY);
        if (fit.fits && fit.chi2 + fit.log_det < c.lowest) {
            c.best = &tracks[i];
            c.lowest = fit.chi2 + fit.log_det;
            c.lowest_chi2 = fit.chi2;
        }
    }
    if (!c.best) {
        return c;
    }
    c.sum = 1.0;
    for (int i = 0; i < count; i++) {
        bst_target_fit fit = misfit_of_all(params, cue, memory, &tracks[i], target_id);
        double misfit = fit.chi2 + fit.log_det;
        if (&tracks[i] == c.best || !(misfit < INFINITY)) {
            continue;
        }
        c.sum += exp(-0.5 * (misfit - c.lowest));
        if (misfit < c.next && is_rival(fit, c.lowest)) {
            c.second = &tracks[i];
            c.next = misfit;
        }
    }
    if (cue->identity && !memory) { /* the memory says that it has a track */
        double unseen = cue->unseen_density / bst_identity_scale(cue, c.best) * exp(0.5 * c.lowest);
        c.seen = unseen <= 1.0;
        c.sum += unseen;
    }
    return c;
}

/* True if the best candidate has been detected often enough for its misfit. */
static bool is_mature(const bst_target_params *params, const candidates *c) {
    return c->best && c->best->hits >= params->min_hits + (int)(0.5 * c->lowest_chi2);
}

/* Sets the probabilities of target and rival. If an ambiguous target has lost its rival, they
 * stay: the rival may be unresolved from it. */
static void set_probability(bst_target *target, const bst_target_params *params, double seconds,
                            const candidates *c) {
    bool is_best = c->best && c->best->id == target->id;
    const bst_mtt_track *rival = is_best ? c->second : c->best;
    if (!rival && target->ambiguous && seconds - target->rival_seconds <= params->max_dormant_s) {
        return;
    }
    target->rival_seconds = rival ? seconds : target->rival_seconds;
    double best = c->best ? 1.0 / c->sum : 0.0;
    double second = c->second ? exp(-0.5 * (c->next - c->lowest)) / c->sum : 0.0;
    target->rival_id = rival ? rival->id : 0;
    target->rival_probability = is_best ? second : best;
    target->probability = is_best ? best
                          : c->second && c->second->id == target->id
                              ? second
                              : fmax(0.0, 1.0 - best - second);
    target->ambiguous =
        target->probability < (target->ambiguous ? BST_TARGET_CERTAIN : BST_TARGET_AMBIGUOUS);
}

/* Makes a track the target. */
static void take_target(bst_target *target, const bst_target_params *params,
                        const bst_target_cue *cue, double seconds, const candidates *c) {
    target->id = c->best->id;
    target->remembered = false;
    target->departed = false;
    target->ambiguous = target->merged = false;
    set_probability(target, params, seconds, c);
    store_target(target, cue, seconds, c->best);
}

/* Compares an ambiguous target with the other tracks; a certain one replaces it. Returns true if
 * one did. */
static bool replace(bst_target *target, const bst_target_params *params, const bst_target_cue *cue,
                    double seconds, const bst_mtt_track *tracks, int count) {
    candidates c = compare(params, cue, NULL, target->id, tracks, count);
    if (!c.best || !c.compared) {
        return false; /* without a cue, no track fits, or the target's rate is not known */
    }
    bool replaced =
        c.best->id != target->id && 1.0 / c.sum > BST_TARGET_CERTAIN && is_mature(params, &c);
    if (replaced) {
        take_target(target, params, cue, seconds, &c);
    } else {
        set_probability(target, params, seconds, &c);
    }
    return replaced;
}

/* Opens the identity of a target that is resolved again after it shared detections: another object
 * may have taken over its track. The cue says nothing on a target that left it by manoeuvres. */
static void reopen(bst_target *target, const bst_target_params *params, const bst_target_cue *cue,
                   const bst_mtt_track *kept) {
    if (kept->merged_in_row > 0) {
        target->merged = true;
    } else if (target->merged && kept->misses_in_row == 0) {
        target->merged = false;
        target->ambiguous = target->ambiguous ||
                            (cue->valid && target->departed &&
                             rate_chi2(kept, target->departure_radps, cue_variance(params, cue)) <=
                                 params->rate_chi2);
    }
}

/* True if a new track may be the cue's object, too. It counts as new until it has twice the hits at
 * which it would be chosen; and not once the target has left the cue by a manoeuvre. */
static bool has_new_rival(const bst_target_params *params, const bst_target_cue *cue,
                          const bst_mtt_track *kept, const bst_mtt_track *tracks, int count) {
    bst_target_fit own = bst_target_misfit(params, cue, kept);
    bool rival = false;
    for (int i = 0; own.fits && i < count && !rival; i++) {
        if (tracks[i].id != kept->id && tracks[i].hits < 2 * params->margin_hits) {
            rival = is_rival(bst_target_misfit(params, cue, &tracks[i]), own.chi2 + own.log_det);
        }
    }
    return rival;
}

void bst_target_step(bst_target *target, const bst_target_params *params, const bst_target_cue *cue,
                     double seconds, const bst_mtt_track *tracks, int count) {
    assert(target && params && cue && count >= 0 && (tracks || count == 0));
    if (target->id != 0) {
        const bst_mtt_track *kept = find(tracks, count, target->id);
        if (kept && !kept->at_rest && !is_released(target, params, cue, kept)) {
            reopen(target, params, cue, kept);
            bool open = target->ambiguous || has_new_rival(params, cue, kept, tracks, count);
            if (!open || !replace(target, params, cue, seconds, tracks, count)) {
                store_target(target, cue, seconds, kept);
            }
            return;
        }
        /* a track mistaken for the target gives no prediction of where the target is */
        target->remembered = kept == NULL;
        target->lost_seconds = seconds;
        target->ambiguous = target->ambiguous && target->remembered;
        target->merged = false;
        target->id = 0;
    }
    bst_sky_state memory = target->memory;
    bool bound = target->remembered && seconds - target->lost_seconds <= params->max_dormant_s;
    if (bound) {
        bst_sky_predict(&memory, seconds - target->memory_seconds, params->memory_noise_rad2ps3);
    }
    candidates c = compare(params, cue, bound ? &memory : NULL, 0, tracks, count);
    if (is_mature(params, &c) && c.seen &&
        (0.5 * (c.next - c.lowest) >= params->margin || c.best->hits >= params->margin_hits)) {
        const bst_target before = *target;
        take_target(target, params, cue, seconds, &c);
        if (before.ambiguous && bound) {
            /* the memory says which track goes on, not which object it is */
            bool rival = target->id == before.rival_id;
            target->ambiguous = true;
            target->probability = rival ? before.rival_probability : before.probability;
            target->rival_probability = rival ? before.probability : before.rival_probability;
            target->rival_seconds = before.rival_seconds;
            c = compare(params, cue, NULL, target->id, tracks, count);
            set_probability(target, params, seconds, &c);
        }
    }
}
