/* The mode logic: what brings one mode after another. */
#include "control/control_internal.h"

static void enter(bst_control *c, int mode, int64_t tick, const char *reason) {
    if (c->transition_count < BST_CONTROL_TRANSITIONS) {
        c->transitions[c->transition_count++] =
            (bst_control_transition){.from = c->mode, .to = mode, .reason = reason};
    }
    c->mode = mode;
    c->mode_tick = tick;
    bst_control_forget_aims(c);
}

static void go_to_tile(bst_control *c, int32_t step, int64_t tick) {
    c->search_step = step;
    c->tile_tick = tick;
    c->arrival_tick = -1;
    c->frames = 0;
    bst_control_forget_aims(c);
}

static bst_status start_search(bst_ctx *ctx, bst_control *c, int mode, int64_t tick,
                               const char *reason) {
    double extent = c->config.reacquire_extent_deg * BST_DEG_RAD;
    if (mode == BST_MODE_SEARCH) {
        bst_cue cue;
        BST_TRY(bst_control_cue_at(ctx, c, tick, &cue));
        extent = fmin(c->config.search_sigmas * (cue.valid ? cue.sigma_rad : 0.0),
                      c->config.search_max_deg * BST_DEG_RAD);
    }
    bst_search_plan(&c->search, extent, 2.0 * atan(0.5 * c->env.width_px * c->env.pixel_rad),
                    2.0 * atan(0.5 * c->env.height_px * c->env.pixel_rad), c->config.search_step);
    bst_vec3 image_x = {cos(c->env.rotation_rad), sin(c->env.rotation_rad), 0.0};
    c->search_x_gcrf = c->pointing_valid
                           ? bst_quat_rotate(bst_quat_conj(c->pointing.q_cam_from_gcrf), image_x)
                           : (bst_vec3){1, 0, 0};
    c->search_mode = mode;
    go_to_tile(c, 0, tick);
    enter(c, mode, tick, reason);
    return BST_OK;
}

/* Back to the place of the search that a failed candidate interrupted. */
static void resume_search(bst_control *c, int64_t tick, const char *reason) {
    if (c->held.id > c->rejected_id) {
        c->rejected_id = c->held.id;
    }
    go_to_tile(c, c->search_step, tick);
    enter(c, c->search_mode, tick, reason);
}

static bst_status next_tile(bst_ctx *ctx, bst_control *c, int64_t tick) {
    /* the predicted place is the best one for as long as the prediction is good */
    if (c->mode == BST_MODE_REACQUIRE && c->search_step == 0 &&
        tick - c->lost.tick < bst_control_ticks(c, c->config.reacquire_coast_s)) {
        return BST_OK;
    }
    if (c->search_step + 1 < c->search.count) {
        go_to_tile(c, c->search_step + 1, tick);
        return BST_OK;
    }
    return start_search(ctx, c, BST_MODE_SEARCH, tick,
                        c->mode == BST_MODE_SEARCH ? "searched all, again from the cue"
                                                   : "not near its predicted place");
}

static bst_status hold(bst_ctx *ctx, bst_control *c, const bst_track *track, int64_t tick) {
    c->held.id = track->id;
    c->held.tick = tick;
    c->held.direction_gcrf = track->direction_gcrf;
    c->held.rate_gcrf_radps = track->rate_gcrf_radps;
    return bst_control_cue_at(ctx, c, tick, &c->held.cue);
}

static const bst_track *find_track(const bst_tracks *tracks, int64_t id) {
    for (int i = 0; id != 0 && i < tracks->count; i++) {
        if (tracks->items[i].id == id) {
            return &tracks->items[i];
        }
    }
    return NULL;
}

/* Distance of a track's place from the true boresight of its frame, px; when the frame gave no
 * attitude, of its place now from where the boresight is believed to be now. */
static double off_boresight_px(const bst_control *c, const bst_tracks *tracks,
                               const bst_track *track) {
    bst_quat q;
    double dt = 0.0;
    if (tracks->attitude.valid) {
        q = tracks->attitude.q_cam_from_gcrf;
    } else if (c->pointing_valid) {
        q = bst_quat_mul(
            c->pointing.q_cam_from_gcrf,
            bst_pointing_error_at(&c->pointing_error, c->pointing.tick, c->env.tick_rate_hz));
        dt = (double)(c->pointing.tick - tracks->tick) / c->env.tick_rate_hz;
    } else {
        return INFINITY;
    }
    bst_vec3 d = bst_vec3_unit(bst_vec3_axpy(track->direction_gcrf, dt, track->rate_gcrf_radps));
    bst_vec3 v = bst_quat_rotate(q, bst_control_apparent(c, d));
    return bst_vec3_angle(v, (bst_vec3){0, 0, 1}) / c->env.pixel_rad;
}

/* The best tentative track that moves as the target should, NULL when there is none. */
static bst_status best_candidate(bst_ctx *ctx, const bst_control *c, const bst_tracks *tracks,
                                 const bst_track **out) {
    bst_cue cue;
    BST_TRY(bst_control_cue_at(ctx, c, tracks->tick, &cue));
    *out = NULL;
    bst_vec3 rate = c->mode == BST_MODE_REACQUIRE ? c->lost.rate_gcrf_radps : cue.rate_gcrf_radps;
    double rate_sigma = cue.valid ? cue.rate_sigma_radps : 0.0, best = 0.0;
    if (!cue.valid && c->mode != BST_MODE_REACQUIRE) {
        return BST_OK;
    }
    double own = c->config.candidate_rate_sigmas * rate_sigma;
    double widest = fmax(2.0 * own, bst_vec3_norm(rate));
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (t->hits < c->config.candidate_hits || t->score < c->config.candidate_score ||
            t->id <= c->rejected_id) {
            continue;
        }
        double off = bst_vec3_norm(bst_vec3_sub(t->rate_gcrf_radps, rate));
        double variance = rate_sigma * rate_sigma + fmax(t->covariance[2][2], t->covariance[3][3]);
        double gate = c->config.candidate_rate_sigmas * sqrt(variance);
        /* a rate so uncertain that the track might as well stand still says nothing */
        if (off > gate || gate > widest) {
            continue;
        }
        double score = t->hits + 1.0 - off / gate; /* more hits first, then the nearer rate */
        if (score > best) {
            best = score;
            *out = t;
        }
    }
    return BST_OK;
}

/* Whether a frame with this mid-exposure was exposed wholly after the arrival. An exposure of
 * unknown length is taken to fill its frame period. */
static bool at_rest(const bst_control *c, int64_t mid_tick) {
    int64_t half = c->config.exposure_s > 0.0 ? bst_control_ticks(c, 0.5 * c->config.exposure_s)
                                              : c->frame_interval_ticks / 2;
    return c->arrival_tick >= 0 && half > 0 && mid_tick - half >= c->arrival_tick;
}

/* A frame that shows nothing new counts for the dwell. */
static bst_status count_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                              const bst_tracks *tracks) {
    /* stars that give no valid attitude: the frame could show nothing */
    bool wasted = tracks->attitude.stars > 0 && !tracks->attitude.valid;
    if (!wasted && at_rest(c, tracks->tick) && ++c->frames >= c->config.dwell_frames) {
        return next_tile(ctx, c, tick);
    }
    return BST_OK;
}

/* A target that its orbit hides, or that has not been seen since: the prediction is all there is.
 */
static bst_status observe_hidden(bst_ctx *ctx, bst_control *c, int64_t tick,
                                 const bst_tracks *tracks, const bst_track *target) {
    BST_TRY(hold(ctx, c, target, tracks->tick));
    if (target->hidden == BST_HIDDEN_AWAITED) {
        c->lost = c->held; /* what is searched about moves on with it */
        if (c->mode != BST_MODE_REACQUIRE) {
            return start_search(ctx, c, BST_MODE_REACQUIRE, tick,
                                "the target should be seen again");
        }
        return count_frame(ctx, c, tick, tracks);
    }
    if (c->mode != BST_MODE_COAST) {
        enter(c, BST_MODE_COAST, tick,
              target->hidden == BST_HIDDEN_EARTH ? "the target is behind the Earth"
                                                 : "the target is in the Earth's shadow");
    }
    return BST_OK;
}

/* A frame while nothing is held: take the target, or a candidate, or count the frame. */
static bst_status observe_searching(bst_ctx *ctx, bst_control *c, int64_t tick,
                                    const bst_tracks *tracks, const bst_track *target) {
    if (target) {
        BST_TRY(hold(ctx, c, target, tracks->tick));
        enter(c, BST_MODE_ACQUIRE, tick, "the tracker names a target");
        return BST_OK;
    }
    if (c->mode == BST_MODE_SLEW) {
        return BST_OK;
    }
    const bst_track *candidate;
    BST_TRY(best_candidate(ctx, c, tracks, &candidate));
    if (candidate) {
        BST_TRY(hold(ctx, c, candidate, tracks->tick));
        enter(c, BST_MODE_ACQUIRE, tick, "a candidate moves as the target should");
        return BST_OK;
    }
    return count_frame(ctx, c, tick, tracks);
}

static bst_status observe_holding(bst_ctx *ctx, bst_control *c, int64_t tick,
                                  const bst_tracks *tracks, const bst_track *target) {
    bool was_target = c->mode == BST_MODE_TRACK || c->mode == BST_MODE_COAST;
    const bst_track *track = target ? target : find_track(tracks, c->held.id);
    if (was_target && !target) {
        c->lost = c->held;
        return start_search(ctx, c, BST_MODE_REACQUIRE, tick, "the tracker has lost the target");
    }
    if (!track) {
        resume_search(c, tick, "the candidate is gone");
        return BST_OK;
    }
    bool other = was_target && target->id != c->held.id;
    BST_TRY(hold(ctx, c, track, tracks->tick));
    double off = off_boresight_px(c, tracks, track);
    if (c->mode == BST_MODE_ACQUIRE && target && off <= c->config.track_entry_px) {
        enter(c, BST_MODE_TRACK, tick, "the target is centred");
    } else if (c->mode == BST_MODE_COAST) {
        bool centred = off <= c->config.track_entry_px;
        enter(c, centred ? BST_MODE_TRACK : BST_MODE_ACQUIRE, tick, "the target is seen again");
    } else if (other && off > c->config.arrive_tolerance_px) {
        enter(c, BST_MODE_ACQUIRE, tick, "the tracker names another target");
    }
    return BST_OK;
}

bst_status bst_control_take_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                                  const bst_tracks *tracks) {
    const bst_track *target = find_track(tracks, tracks->target_id);
    if (target && target->hidden != BST_HIDDEN_NOT && c->config.strategy == BST_CONTROL_TRACK) {
        return observe_hidden(ctx, c, tick, tracks, target);
    }
    switch (c->mode) {
        case BST_MODE_IDLE:
            /* without a cue only a target that the tracker names by itself can be followed */
            if (c->config.strategy == BST_CONTROL_TRACK && target) {
                return observe_searching(ctx, c, tick, tracks, target);
            }
            return BST_OK;
        case BST_MODE_SLEW:
        case BST_MODE_SEARCH:
        case BST_MODE_REACQUIRE:
            return observe_searching(ctx, c, tick, tracks, target);
        case BST_MODE_ACQUIRE:
        case BST_MODE_TRACK:
        case BST_MODE_COAST:
            return observe_holding(ctx, c, tick, tracks, target);
        default:
            return BST_OK;
    }
}

bst_status bst_control_start(bst_ctx *ctx, bst_control *c, int64_t tick) {
    bst_cue cue;
    switch (c->config.strategy) {
        case BST_CONTROL_STARE:
            BST_TRY(c->env.cue_at(c->env.cue_user, ctx, c->config.stare_time_s, &cue));
            c->stare_valid = cue.valid;
            c->stare_gcrf = cue.direction_gcrf;
            if (cue.valid) {
                enter(c, BST_MODE_STARE, tick, "the strategy");
            }
            return BST_OK;
        case BST_CONTROL_RATE:
        default:
            BST_TRY(bst_control_cue_at(ctx, c, tick, &cue));
            if (cue.valid) {
                bool rate = c->config.strategy == BST_CONTROL_RATE;
                enter(c, rate ? BST_MODE_RATE : BST_MODE_SLEW, tick,
                      rate ? "the strategy" : "there is a cue");
            }
            return BST_OK;
    }
}

bst_status bst_control_advance(bst_ctx *ctx, bst_control *c, int64_t tick, bool arrived) {
    switch (c->mode) {
        case BST_MODE_SLEW:
            if (arrived) {
                BST_TRY(start_search(ctx, c, BST_MODE_SEARCH, tick, "at the cue"));
                c->arrival_tick = c->pointing.tick;
            }
            return BST_OK;
        case BST_MODE_SEARCH:
        case BST_MODE_REACQUIRE:
            if (arrived && c->arrival_tick < 0) {
                c->arrival_tick = c->pointing.tick;
            }
            if (tick - c->tile_tick > bst_control_ticks(c, c->config.dwell_timeout_s)) {
                return next_tile(ctx, c, tick);
            }
            return BST_OK;
        case BST_MODE_ACQUIRE:
            if (tick - c->mode_tick > bst_control_ticks(c, c->config.acquire_timeout_s) &&
                c->held.id != c->target_id) {
                resume_search(c, tick, "the candidate was not confirmed in time");
            }
            return BST_OK;
        default:
            return BST_OK;
    }
}
