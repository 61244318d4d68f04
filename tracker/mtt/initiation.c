/* Track initiation from pairs of detections (two-point initiation). */
#include <assert.h>
#include <string.h>

#include "tracker/mtt/multitarget_internal.h"
#include "tracker/mtt/resolution.h"

/* Number of unassociated detections in a frame up to which `confirm_score` alone keeps false tracks
 * rare: 100 exp(-12) per frame. With more, a track's prior odds are reduced in proportion, so that
 * the rate of false tracks stays the same. */
static const double FEW_ALARMS = 100.0;

/* Most tracks that one detection starts. */
enum { MOST_PARTNERS = 16 };

/* Rate gate of a pair: its rate must lie within `gate_radps` of `rate_radps`. */
typedef struct rate_gate {
    bst_vec3 rate_radps; /* in the tangent plane at the newer detection */
    double gate_radps;
    int reserve;  /* number of track slots to keep free */
    int history;  /* number of earlier frames to search */
    bool rest;    /* the new tracks are stationary */
    int partners; /* most tracks that one detection starts */
    bool shared;  /* a detection may start tracks with more than one partner */
} rate_gate;

/* Trace of a detection's covariance, rad^2. */
static double spread(const bst_mtt_detection *d) {
    return d->sky.cov_11 + d->sky.cov_22;
}

/* Finds the unused detection of an earlier frame whose pair rate with `detection` is nearest to the
 * gate's centre but farther than `beyond` (rad; negative: no limit); negative: none. Writes the
 * distance to *beyond. */
static int find_partner(const bst_mtt *mtt, const bst_mtt_pool *pool,
                        const bst_mtt_detection *detection, const rate_gate *gate, double *beyond) {
    double dt = mtt->now.seconds - pool->seconds;
    if (!(dt > 0.0) || dt > mtt->params.initiation_gap_s) {
        return -1;
    }
    bst_vec3 d = detection->sky.direction;
    bst_vec3 back = bst_tangent_exp(d, bst_vec3_scale(gate->rate_radps, -dt));
    /* the trace bounds the largest axis of the error ellipse */
    double reach = gate->gate_radps * dt + 3.0 * sqrt(2.0 * spread(detection));
    int begin, end, partner = -1;
    double best = INFINITY;
    bst_mtt_pool_range(pool, back, reach, &begin, &end);
    for (int i = begin; i < end; i++) {
        int k = pool->order[i];
        const bst_mtt_detection *earlier = &pool->items[k];
        double off = bst_vec3_norm(bst_vec3_sub(earlier->sky.direction, back));
        double noise = 3.0 * sqrt(spread(detection) + spread(earlier));
        double dim = fabs(earlier->v_mag - detection->v_mag);
        double dim_limit = 1.0 + 3.0 * hypot(earlier->v_mag_sigma, detection->v_mag_sigma);
        if (pool->used[k] || off > gate->gate_radps * dt + noise || dim > dim_limit ||
            off >= best || off <= *beyond) {
            continue;
        }
        best = off;
        partner = k;
    }
    *beyond = best;
    return partner;
}

/* Nearest other unused detection of a frame within merge_rad of one of them; NULL: none. */
static const bst_mtt_detection *find_neighbour(const bst_mtt *mtt, const bst_mtt_pool *pool,
                                               const bst_mtt_detection *of) {
    const bst_mtt_detection *best = NULL;
    double nearest = mtt->params.merge_rad;
    int begin, end;
    bst_mtt_pool_range(pool, of->sky.direction, nearest, &begin, &end);
    for (int i = begin; i < end; i++) {
        const bst_mtt_detection *other = &pool->items[pool->order[i]];
        double off = bst_vec3_norm(bst_vec3_sub(other->sky.direction, of->sky.direction));
        if (other != of && !pool->used[pool->order[i]] && off < nearest) {
            nearest = off;
            best = other;
        }
    }
    return best;
}

/* Measurements of a pair of detections. If one of the frames resolves two objects where the other
 * has a single detection, that one may be merged. */
static void measure_pair(const bst_mtt *mtt, const bst_mtt_detection *earlier,
                         const bst_mtt_pool *pool, const bst_mtt_detection *later,
                         bst_mtt_doubtful out[2]) {
    out[0] = (bst_mtt_doubtful){earlier->sky, 0.0};
    out[1] = (bst_mtt_doubtful){later->sky, 0.0};
    if (mtt->params.association != BST_MTT_PMB || !(mtt->params.merge_rad > 0.0)) {
        return;
    }
    const bst_mtt_detection *before = find_neighbour(mtt, pool, earlier),
                            *after = find_neighbour(mtt, &mtt->now, later);
    double pd = mtt->params.detection_probability;
    if (after && !before) {
        out[0] = bst_mtt_doubt_of_pair(mtt->params.merge_rad, pd, earlier, later, after);
    } else if (before && !after) {
        out[1] = bst_mtt_doubt_of_pair(mtt->params.merge_rad, pd, later, earlier, before);
    }
}

/* Starts a tentative track from a pair of detections. */
static void start_track(bst_mtt *mtt, const bst_mtt_detection *earlier, const bst_mtt_pool *pool,
                        const bst_mtt_detection *later, const rate_gate *gate,
                        const bst_mtt_frame *frame) {
    double dt = mtt->now.seconds - pool->seconds;
    double reach = gate->gate_radps * dt + 3.0 * sqrt(spread(earlier) + spread(later));
    double floor = mtt->params.brightness_systematic_mag;
    /* prior odds: besides clutter, undetected charge may be as frequent as the charge recognised */
    double alarms = mtt->clutter_density * mtt->params.field_sr + (double)mtt->charged;
    bst_mtt_doubtful pair[2] = {{earlier->sky, 0.0}, {later->sky, 0.0}};
    if (!gate->rest) {
        measure_pair(mtt, earlier, pool, later, pair);
    }
    /* a merged detection has the light of two objects */
    double own = pair[0].merged > 0.5 ? 0.0 : pair[1].merged > 0.5 ? 1.0 : 0.5;
    double sigma_mag = own == 0.0 ? later->v_mag_sigma : earlier->v_mag_sigma;
    /* of the mean of two, or of one alone */
    double variance = (own == 0.5 ? 0.5 : 1.0) * (floor * floor + sigma_mag * sigma_mag);
    double brightness = bst_mtt_pair_brightness(mtt, earlier->snr, later->snr);
    assert(dt > 0.0 &&
           mtt->track_count < mtt->params.max_tracks + mtt->params.max_stationary_tracks);
    bst_mtt_track *track = &mtt->tracks[mtt->track_count++];
    *track = (bst_mtt_track){
        .id = mtt->next_id++,
        .status = BST_TRACK_TENTATIVE,
        .v_mag = own * earlier->v_mag + (1.0 - own) * later->v_mag,
        .v_mag_variance = isfinite(variance) ? variance : 25.0,
        .snr = later->snr,
        .x_px = later->x_px,
        .y_px = later->y_px,
        .hits = 2,
        .frames = 2,
        .score = fmax(0.0, log(mtt->params.detection_probability /
                               (mtt->clutter_density * BST_PI * reach * reach))) -
                 log(fmax(1.0, alarms / FEW_ALARMS)) + brightness,
        .last_chi2 = -1.0,
        .first_tick = pool->tick,
        .last_update_tick = mtt->now.tick,
        .last_update_s = mtt->now.seconds,
        .first_direction = earlier->sky.direction,
        .first_length_rad = earlier->length_rad,
        .at_rest = gate->rest,
    };
    /* odds of the first detection of an undetected object, of misses after it, and of a second
     * detection */
    double pd = mtt->params.detection_probability;
    double odds = pool->undetected * pd / fmax(1.0, alarms) *
                  pow(1.0 - pd, (double)(pool - mtt->history)) * pd /
                  (mtt->clutter_density * BST_PI * reach * reach) * exp(brightness);
    track->existence = odds / (1.0 + odds);
    bst_mtt_start_snr(track);
    bst_mtt_note_snr(mtt, earlier->snr, track);
    bst_mtt_note_snr(mtt, later->snr, track);
    bst_mtt_note_place(track, later);
    bst_mtt_start_fixed(mtt, earlier, track);
    bst_mtt_note_fixed(mtt, later, -log(BST_PI * reach * reach), track);
    mtt->rest_count += gate->rest;
    bst_sky_from_pair(&pair[0].sky, &pair[1].sky, dt, mtt->params.noise_rad2ps3, &track->state);
    if (mtt->cue_lag_valid && bst_mtt_shares_acceleration(mtt, track, frame)) {
        /* the pair's rate is the mean over the interval; correct it to the newer detection by the
         * cue's acceleration */
        bst_vec3 lag = bst_vec3_scale(mtt->cue_lag_radps2, dt);
        track->state.rate_radps =
            bst_vec3_add(track->state.rate_radps,
                         bst_tangent_carry(frame->cue_direction, track->state.direction, lag));
    }
    bst_filter_start(&mtt->filter, &track->state, &track->models);
    bst_mtt_set_rest(mtt, track, bst_mtt_is_at_rest(mtt, frame, track));
}

/* True if a pair of detections has started a track in this frame already, in another rate gate. */
static bool has_started(const bst_mtt *mtt, const bst_mtt_detection *earlier,
                        const bst_mtt_detection *later) {
    for (int t = mtt->track_count - 1; t >= 0; t--) {
        const bst_mtt_track *track = &mtt->tracks[t];
        if (track->hits != 2 || track->frames != 2 || track->last_update_tick != mtt->now.tick) {
            return false; /* tracks of this frame are the latest */
        }
        bst_vec3 off = bst_vec3_sub(track->first_direction, earlier->sky.direction);
        if (track->x_px == later->x_px && track->y_px == later->y_px &&
            bst_vec3_dot(off, off) == 0.0) {
            return true;
        }
    }
    return false;
}

/* Starts tracks from one detection and its partners in the rate gate, newest frame first. */
static void start_from(bst_mtt *mtt, int detection, const rate_gate *gate,
                       const bst_mtt_frame *frame) {
    const bst_mtt_detection *later = &mtt->now.items[detection];
    int started = 0;
    for (int h = 0; h < mtt->history_count && h < gate->history; h++) {
        bst_mtt_pool *pool = &mtt->history[h];
        double beyond = -1.0;
        while (started < gate->partners) {
            int partner = find_partner(mtt, pool, later, gate, &beyond);
            if (partner < 0) {
                break;
            }
            started++;
            if (gate->shared && has_started(mtt, &pool->items[partner], later)) {
                continue;
            }
            if (!bst_mtt_has_room(mtt, gate->rest, gate->reserve)) {
                mtt->lost += gate->partners == 1; /* not even with its nearest partner */
                return;
            }
            start_track(mtt, &pool->items[partner], pool, later, gate, frame);
            if (!gate->shared) {
                pool->used[partner] = true;
                mtt->now.used[detection] = true;
            }
        }
    }
}

/* Starts tracks from all pairs of detections in the rate gate. */
static void start_pairs(bst_mtt *mtt, rate_gate gate, const bst_mtt_frame *frame, bool from_cue) {
    for (int i = 0; i < mtt->now.count; i++) {
        if (mtt->now.used[i]) {
            continue;
        }
        bst_vec3 direction = mtt->now.items[i].sky.direction;
        if (from_cue && frame->expected_rate) {
            if (!frame->expected_rate(frame->user, direction, &gate.rate_radps)) {
                continue;
            }
        } else if (from_cue) {
            gate.rate_radps =
                bst_tangent_carry(frame->cue_direction, direction,
                                  bst_tangent_project(frame->cue_direction, frame->cue_rate_radps));
        }
        start_from(mtt, i, &gate, frame);
    }
}

/* Starts tracks from pairs in a rate gate. With existence probabilities every pair starts one, and
 * later detections decide; first those of each detection and its nearest partner in the newest
 * frame, so that the slots are enough in a crowd. */
static void start_all(bst_mtt *mtt, rate_gate gate, const bst_mtt_frame *frame, bool from_cue) {
    if (mtt->params.association == BST_MTT_PMB) {
        rate_gate nearest = gate;
        nearest.shared = gate.shared = true;
        nearest.history = 1;
        start_pairs(mtt, nearest, frame, from_cue);
        gate.partners = MOST_PARTNERS;
    }
    start_pairs(mtt, gate, frame, from_cue);
}

void bst_mtt_initiate(bst_mtt *mtt, const bst_mtt_frame *frame) {
    const bst_mtt_params *params = &mtt->params;
    /* In a field of many uncatalogued stars, two detections at one position are one star, while two
     * at the cue's rate may be two stars: pair stationary ones first. */
    if (params->star_rate_radps > 0.0) {
        rate_gate rest = {.history = BST_MTT_HISTORY, .rest = true, .partners = 1};
        start_pairs(mtt, rest, frame, false);
    }
    if (frame->cue_valid) {
        rate_gate gate = {
            .gate_radps = 4.0 * frame->cue_rate_sigma_radps + params->cue_rate_margin_radps,
            .history = BST_MTT_HISTORY,
            .partners = 1};
        start_all(mtt, gate, frame, true);
    }
    /* without the cue the gate is wide: search only the newest frame, and the one before it where
     * every pair may start a track; keep a quarter of the slots free for pairs at the cue's rate */
    rate_gate gate = {.gate_radps = params->max_rate_radps,
                      .reserve = params->max_tracks / 4,
                      .history = params->association == BST_MTT_PMB ? 2 : 1,
                      .partners = 1};
    start_all(mtt, gate, frame, false);
}
