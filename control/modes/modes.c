/* Mode logic of the controller: transitions between search, acquisition and tracking. */
#include "control/control_internal.h"

/* Largest angular acceleration of a cue: a pass at 100 km and 15 km/s has 1.5e-2 rad/s^2. */
#define CUE_ACCEL_RADPS2 2e-2
/* Least interval between tests for jumps of the cue. */
#define WATCH_S 0.05

/* Holds a track as the aim. */
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

/* Distance of a track from the true boresight of its frame, px; without a frame attitude, of its
 * current position from the estimated boresight. */
static double off_boresight_px(const bst_control *c, const bst_tracks *tracks,
                               const bst_track *track) {
    bst_quat q;
    double dt = 0.0;
    if (tracks->attitude.valid) {
        q = tracks->attitude.q_cam_from_gcrf;
    } else if (c->pointing_valid) {
        q = bst_quat_mul(c->pointing.q_cam_from_gcrf,
                         bst_control_correction_at(c, c->pointing.tick));
        dt = (double)(c->pointing.tick - tracks->tick) / c->env.tick_rate_hz;
    } else {
        return INFINITY;
    }
    bst_vec3 d = bst_vec3_unit(bst_vec3_axpy(track->direction_gcrf, dt, track->rate_gcrf_radps));
    bst_vec3 v = bst_quat_rotate(q, bst_control_apparent(c, d));
    return bst_vec3_angle(v, (bst_vec3){0, 0, 1}) / c->env.pixel_rad;
}

/* Records the loss of the held target. */
static void lose(bst_control *c, int64_t tick) {
    c->lost = c->held;
    c->lost_tick = tick;
}

/* Handles a target that is occulted or undetected: only its prediction is available. */
static bst_status observe_hidden(bst_ctx *ctx, bst_control *c, int64_t tick,
                                 const bst_tracks *tracks, const bst_track *target) {
    BST_TRY(hold(ctx, c, target, tracks->tick));
    if (target->hidden == BST_HIDDEN_AWAITED) {
        /* the search centre follows the prediction */
        lose(c, c->mode == BST_MODE_REACQUIRE ? c->lost_tick : tick);
        bst_control_forget_aims(c);
        if (c->mode != BST_MODE_REACQUIRE) {
            return bst_control_start_search(ctx, c, BST_MODE_REACQUIRE, tick,
                                            "the target should be seen again");
        }
        return bst_control_count_frame(ctx, c, tick, tracks);
    }
    if (c->mode != BST_MODE_COAST) {
        bst_control_enter(c, BST_MODE_COAST, tick,
                          target->hidden == BST_HIDDEN_EARTH ? "the target is behind the Earth"
                          : target->hidden == BST_HIDDEN_DIM
                              ? "the target is too dim"
                              : "the target is in the Earth's shadow");
    }
    return BST_OK;
}

/* Handles a frame while no track is held: takes the target or a candidate, or counts the frame. */
static bst_status observe_searching(bst_ctx *ctx, bst_control *c, int64_t tick,
                                    const bst_tracks *tracks, const bst_track *target) {
    if (target) {
        BST_TRY(hold(ctx, c, target, tracks->tick));
        bst_control_enter(c, BST_MODE_ACQUIRE, tick, "the tracker names a target");
        return BST_OK;
    }
    if (c->mode == BST_MODE_SLEW) {
        return BST_OK;
    }
    const bst_track *candidate;
    BST_TRY(bst_control_best_candidate(ctx, c, tracks, &candidate));
    if (candidate) {
        BST_TRY(hold(ctx, c, candidate, tracks->tick));
        bst_control_enter(c, BST_MODE_ACQUIRE, tick, "a candidate moves as the target should");
        return BST_OK;
    }
    return bst_control_count_frame(ctx, c, tick, tracks);
}

static bst_status observe_holding(bst_ctx *ctx, bst_control *c, int64_t tick,
                                  const bst_tracks *tracks, const bst_track *target) {
    bool was_target = c->mode == BST_MODE_TRACK || c->mode == BST_MODE_COAST;
    const bst_track *track = target ? target : find_track(tracks, c->held.id);
    if (was_target && !target) {
        lose(c, c->held.tick);
        return bst_control_start_search(ctx, c, BST_MODE_REACQUIRE, tick,
                                        "the tracker has lost the target");
    }
    if (!track) { /* it may flash, and come back as a new track in the time that it was given */
        BST_TRY(bst_control_best_candidate(ctx, c, tracks, &track));
    }
    if (!track) {
        return BST_OK;
    }
    if (c->search_in_region && !target && track->uncorrelated) {
        return bst_control_resume_search(ctx, c, tick, "the candidate is something else");
    }
    bool other = was_target && target->id != c->held.id;
    BST_TRY(hold(ctx, c, track, tracks->tick));
    double off = off_boresight_px(c, tracks, track);
    if (c->mode == BST_MODE_ACQUIRE && target && off <= c->config.track_handover_px) {
        bst_control_enter(c, BST_MODE_TRACK, tick, "the target is centred");
    } else if (c->mode == BST_MODE_COAST) {
        bool centred = off <= c->config.track_handover_px;
        bst_control_enter(c, centred ? BST_MODE_TRACK : BST_MODE_ACQUIRE, tick,
                          "the target is seen again");
    } else if (other && off > c->config.arrival_tolerance_px) {
        bst_control_enter(c, BST_MODE_ACQUIRE, tick, "the tracker names another target");
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
            /* without a cue only a target reported by the tracker can be followed */
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

void bst_control_watch_attitude(bst_control *c, int64_t tick, const bst_attitude_fix *fix) {
    if (!bst_control_may_be_lost(c)) {
        return;
    }
    if (fix->valid) {
        c->frames_without_attitude = 0;
        c->attitude_found = true;
        if (c->mode == BST_MODE_LOST) {
            c->pointing_error.started = false;
            bst_control_enter(c, BST_MODE_IDLE, tick, "the stars give the attitude");
        }
        return;
    }
    c->frames_without_attitude += c->settled;
    if (c->mode != BST_MODE_LOST && c->config.lost_after_frames > 0 &&
        c->frames_without_attitude >= c->config.lost_after_frames) {
        c->frames_without_attitude = 0;
        bst_control_enter(c, BST_MODE_LOST, tick, "no attitude from stars");
    }
}

/* Starts an open-loop strategy as soon as there is an aim. */
static bst_status start_open_loop(bst_ctx *ctx, bst_control *c, int64_t tick) {
    bst_onboard_cue cue;
    switch (c->config.strategy) {
        case BST_CONTROL_STARE:
            BST_TRY(c->env.cue_at(c->env.cue_user, ctx, c->config.stare_time_s, &cue));
            c->stare_valid = cue.valid;
            c->stare_gcrf = cue.direction_gcrf;
            if (cue.valid) {
                bst_control_enter(c, BST_MODE_STARE, tick, "the strategy");
            }
            return BST_OK;
        case BST_CONTROL_RATE:
            BST_TRY(bst_control_cue_at(ctx, c, tick, &cue));
            if (cue.valid) {
                bst_control_enter(c, BST_MODE_RATE, tick, "the strategy");
            }
            return BST_OK;
        case BST_CONTROL_FIXED:
            bst_control_enter(c, BST_MODE_FIXED, tick, "the strategy");
            return BST_OK;
        default:
            bst_control_enter(c, BST_MODE_SCAN, tick, "the strategy");
            return BST_OK;
    }
}

bst_status bst_control_start(bst_ctx *ctx, bst_control *c, int64_t tick) {
    if (c->config.attitude == 1 && !c->attitude_found) {
        bst_control_enter(c, BST_MODE_LOST, tick, "the attitude is unknown");
        return BST_OK;
    }
    if (c->config.strategy != BST_CONTROL_TRACK) {
        return start_open_loop(ctx, c, tick);
    }
    if (c->gave_up) {
        return BST_OK;
    }
    if (c->env.region.kind != BST_REGION_NONE) {
        if (!c->pointing_valid) {
            return BST_OK; /* the region's orientation in the field is not known yet */
        }
        c->search_since_tick = tick;
        return bst_control_start_search(ctx, c, BST_MODE_SEARCH, tick,
                                        "there is a region to search");
    }
    bst_onboard_cue cue;
    BST_TRY(bst_control_cue_at(ctx, c, tick, &cue));
    if (cue.valid) {
        c->search_since_tick = tick;
        bst_control_enter(c, BST_MODE_SLEW, tick, "there is a cue");
    }
    return BST_OK;
}

/* True for modes in which no track is held. */
static bool is_looking(int mode) {
    return mode == BST_MODE_SLEW || mode == BST_MODE_SEARCH || mode == BST_MODE_REACQUIRE;
}

/* Ends a search that has reached its timeout. */
static bool give_up(bst_control *c, int64_t tick) {
    if (!is_looking(c->mode)) {
        c->search_since_tick = tick;
        return false;
    }
    if (!(c->config.search_timeout_s > 0.0) ||
        tick - c->search_since_tick <= bst_control_ticks(c, c->config.search_timeout_s)) {
        return false;
    }
    c->gave_up = true;
    bst_control_enter(c, BST_MODE_IDLE, tick, "nothing found within search_timeout_s: given up");
    return true;
}

/* Detects a jump or the return of the cue. */
static bst_status watch_cue(bst_ctx *ctx, bst_control *c, int64_t tick) {
    bool valid;
    bst_vec3 now;
    bst_control_watch *w = &c->watch;
    if (w->count == 2 && tick - w->tick < bst_control_ticks(c, WATCH_S)) {
        return BST_OK;
    }
    BST_TRY(
        c->env.cue_direction_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), &valid, &now));
    bool jumped = valid && w->ended;
    if (valid && w->count == 2 && tick > w->tick) {
        double dt = bst_control_seconds(c, tick - w->tick);
        double before = bst_control_seconds(c, w->tick - w->tick_before);
        bst_vec3 rate =
            bst_vec3_scale(bst_vec3_sub(w->direction, w->direction_before), 1.0 / before);
        double off = bst_vec3_norm(bst_vec3_sub(now, bst_vec3_axpy(w->direction, dt, rate)));
        jumped = jumped || off > c->config.arrival_tolerance_px * c->env.pixel_rad +
                                     CUE_ACCEL_RADPS2 * dt * (dt + before);
    }
    if (valid) {
        bool first = w->count == 0 || jumped;
        w->tick_before = first ? tick : w->tick;
        w->direction_before = first ? now : w->direction;
        w->tick = tick;
        w->direction = now;
        w->count = first ? 1 : 2;
        w->ended = false;
        if (jumped) {
            w->jump_tick = tick;
            c->gave_up = false;
            bst_control_forget_aims(c);
        }
    } else if (w->count > 0) {
        w->ended = true;
    }
    if (jumped && (c->mode == BST_MODE_SLEW || c->mode == BST_MODE_SEARCH) &&
        !c->search_in_region) {
        c->search_since_tick = tick;
        bst_control_enter(c, BST_MODE_SLEW, tick, "the cue has moved");
    }
    return BST_OK;
}

bst_status bst_control_advance(bst_ctx *ctx, bst_control *c, int64_t tick, bool arrived) {
    if (c->config.strategy == BST_CONTROL_TRACK) {
        BST_TRY(watch_cue(ctx, c, tick));
        if (give_up(c, tick)) {
            return BST_OK;
        }
    }
    switch (c->mode) {
        case BST_MODE_SLEW:
            if (arrived) {
                BST_TRY(bst_control_start_search(ctx, c, BST_MODE_SEARCH, tick, "at the cue"));
                c->arrival_tick = c->pointing.tick;
            }
            return BST_OK;
        case BST_MODE_SEARCH:
        case BST_MODE_REACQUIRE:
            if (arrived && c->arrival_tick < 0) {
                c->arrival_tick = c->pointing.tick;
            }
            if (tick - c->tile_tick > bst_control_ticks(c, c->config.dwell_timeout_s)) {
                return bst_control_next_tile(ctx, c, tick);
            }
            return BST_OK;
        case BST_MODE_ACQUIRE:
            if (tick - c->mode_tick > bst_control_ticks(c, c->config.acquire_timeout_s) &&
                c->held.id != c->target_id) {
                return bst_control_resume_search(ctx, c, tick,
                                                 "the candidate was not confirmed in time");
            }
            return BST_OK;
        default:
            return BST_OK;
    }
}
