/* Search mode: planning of the search, next tile, and choice of a candidate track. */
#include <assert.h>
#include "control/control_internal.h"

/* Sampling of a region's angular size on the sky: positions along and across it, times. */
enum { ALONG = 5, ACROSS = 3, TIMES = 41 };
/* Step of the differences that measure it. */
#define STRETCH_STEP_RAD 1e-3
/* Assumed overhead of a tile besides its frames, for the look-ahead. */
#define OVERHEAD_S 5.0

void bst_control_enter(bst_control *c, int mode, int64_t tick, const char *reason) {
    assert(c && mode >= 0 && mode < BST_MODE_COUNT && reason);
    if (c->transition_count < BST_CONTROL_TRANSITIONS) {
        c->transitions[c->transition_count++] =
            (bst_control_transition){.from = c->mode, .to = mode, .reason = reason};
    }
    if (mode == BST_MODE_SLEW || mode == BST_MODE_TRACK) {
        c->search_mode = BST_MODE_SEARCH; /* what was lost before is no longer looked for */
    }
    c->mode = mode;
    c->mode_tick = tick;
    bst_control_forget_aims(c);
}

/* Stores the direction of a region's tile at its command, and the boresight's rate from there, if
 * it does not follow the region. */
static bst_status freeze_tile(bst_ctx *ctx, bst_control *c, int64_t tick) {
    if (!c->search_in_region || bst_control_moves_with_region(c)) {
        return BST_OK;
    }
    bst_search_tile tile = c->search.tile[c->search_step];
    BST_TRY(c->env.region_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), tile.x_rad,
                             tile.y_rad, &c->tile_gcrf));
    c->tile_rate_radps = (bst_vec3){0, 0, 0};
    if (c->config.search_rate == BST_CONTROL_RATE_BELT) {
        bool known;
        BST_TRY(bst_control_expected_rate(ctx, c, tick, c->tile_gcrf, &known, &c->tile_rate_radps));
    }
    return BST_OK;
}

static bst_status go_to_tile(bst_ctx *ctx, bst_control *c, int32_t step, int64_t tick) {
    c->search_step = step;
    c->tile_tick = tick;
    c->arrival_tick = -1;
    c->frames = 0;
    bst_control_forget_aims(c);
    return freeze_tile(ctx, c, tick);
}

static double frame_period_s(const bst_control *c) {
    return c->config.period_s > 0.0      ? c->config.period_s
           : c->frame_interval_ticks > 0 ? bst_control_seconds(c, c->frame_interval_ticks)
                                         : 1.0;
}

/* Largest angular size on the sky of a radian along and across the region until the search ends,
 * and the current directions of both at its centre. */
static void measure_region(bst_control *c, int64_t tick, double ahead_s, double stretch[2],
                           bst_vec3 axes[2]) {
    bst_ctx quiet = {0}; /* beyond the end of an orbit there is no region to measure */
    const bst_control_env *e = &c->env;
    double now_s = bst_control_seconds(c, tick), h = STRETCH_STEP_RAD;
    stretch[0] = stretch[1] = 0.0;
    for (int k = 0; k < TIMES; k++) {
        double t = now_s + ahead_s * k / (TIMES - 1);
        for (int i = 0; i < ALONG * ACROSS; i++) {
            double u = e->region.half_length_rad * (2.0 * (i % ALONG) / (ALONG - 1) - 1.0);
            double v = e->region.half_width_rad * (2.0 * (i / ALONG) / (ACROSS - 1) - 1.0);
            bst_vec3 d, du, dv;
            if (e->region_at(e->cue_user, &quiet, t, u, v, &d) != BST_OK ||
                e->region_at(e->cue_user, &quiet, t, u + h, v, &du) != BST_OK ||
                e->region_at(e->cue_user, &quiet, t, u, v + h, &dv) != BST_OK) {
                continue;
            }
            stretch[0] = fmax(stretch[0], bst_vec3_angle(d, du) / h);
            stretch[1] = fmax(stretch[1], bst_vec3_angle(d, dv) / h);
            if (k == 0 && i == ALONG * ACROSS / 2) {
                axes[0] = bst_vec3_sub(du, d);
                axes[1] = bst_vec3_sub(dv, d);
            }
        }
    }
}

/* Plans the grid of tiles in the region's two angles. */
static bst_status plan_region(bst_ctx *ctx, bst_control *c, int64_t tick, bst_search_area *area) {
    double width = area->field_x_rad, height = area->field_y_rad;
    double dwell_s = (double)c->config.dwell_frames * frame_period_s(c);
    area->half_x_rad = c->env.region.half_length_rad;
    area->half_y_rad = c->env.region.half_width_rad;
    double places =
        4.0 * area->half_x_rad * area->half_y_rad / (area->step * area->step * width * height);
    double stretch[2];
    bst_vec3 axes[2] = {{1, 0, 0}, {0, 1, 0}};
    measure_region(c, tick, fmin(places * (dwell_s + OVERHEAD_S), 6000.0), stretch, axes);
    if (!(stretch[0] > 0.0 && stretch[1] > 0.0)) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "control: the cue's region cannot be seen from here");
    }
    /* objects that move neither with the region nor with the boresight drift across the field */
    if (!bst_control_moves_with_region(c)) {
        bool known;
        bst_vec3 middle, rate = {0, 0, 0};
        BST_TRY(c->env.region_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), 0.0, 0.0,
                                 &middle));
        BST_TRY(bst_control_expected_rate(ctx, c, tick, middle, &known, &rate));
        double drift = fmin(bst_vec3_norm(rate) * dwell_s, 0.5 * fmin(width, height));
        width -= drift;
        height -= drift;
    }
    double along = bst_vec3_dot(axes[0], c->search_x_gcrf);
    double across = bst_vec3_dot(axes[1], c->search_x_gcrf);
    bst_search_inscribe(width, height,
                        atan2(across / bst_vec3_norm(axes[1]), along / bst_vec3_norm(axes[0])),
                        &area->field_x_rad, &area->field_y_rad);
    area->field_x_rad /= stretch[0];
    area->field_y_rad /= stretch[1];
    return BST_OK;
}

bst_status bst_control_start_search(bst_ctx *ctx, bst_control *c, int mode, int64_t tick,
                                    const char *reason) {
    bst_vec3 image_x = {cos(c->env.rotation_rad), sin(c->env.rotation_rad), 0.0};
    bst_quat q = c->pointing.q_cam_from_gcrf;
    if (bst_control_may_be_lost(c)) { /* else the telemetry's roll is right within the overlap */
        q = bst_quat_mul(q, bst_control_correction_at(c, tick));
    }
    c->search_x_gcrf =
        c->pointing_valid ? bst_quat_rotate(bst_quat_conj(q), image_x) : (bst_vec3){1, 0, 0};
    bst_search_pattern pattern = (bst_search_pattern)c->config.search_pattern;
    bst_search_area area = {.field_x_rad = 2.0 * atan(0.5 * c->env.width_px * c->env.pixel_rad),
                            .field_y_rad = 2.0 * atan(0.5 * c->env.height_px * c->env.pixel_rad),
                            .step = c->config.search_step};
    c->search_in_region = mode == BST_MODE_SEARCH && c->env.region.kind != BST_REGION_NONE;
    if (c->search_in_region) {
        BST_TRY(plan_region(ctx, c, tick, &area));
    } else {
        double extent = c->config.reacquire_extent_deg * BST_DEG_RAD;
        if (mode == BST_MODE_SEARCH) {
            bst_onboard_cue cue;
            BST_TRY(bst_control_cue_at(ctx, c, tick, &cue));
            extent = fmin(c->config.search_sigmas * (cue.valid ? cue.sigma_rad : 0.0),
                          c->config.search_max_deg * BST_DEG_RAD);
        } else if (pattern == BST_SEARCH_BELT) {
            pattern = BST_SEARCH_NEAREST_FIRST;
        }
        area.half_x_rad = area.half_y_rad = extent;
    }
    bst_search_plan(&c->search, pattern, &area);
    c->search_mode = mode;
    BST_TRY(go_to_tile(ctx, c, 0, tick));
    bst_control_enter(c, mode, tick, reason);
    return BST_OK;
}

bst_status bst_control_resume_search(bst_ctx *ctx, bst_control *c, int64_t tick,
                                     const char *reason) {
    if (c->held.id > c->rejected_id) {
        c->rejected_id = c->held.id;
    }
    BST_TRY(go_to_tile(ctx, c, c->search_step, tick));
    bst_control_enter(c, c->search_mode, tick, reason);
    return BST_OK;
}

bst_status bst_control_next_tile(bst_ctx *ctx, bst_control *c, int64_t tick) {
    /* the predicted position is the best tile while the prediction is accurate */
    if (c->mode == BST_MODE_REACQUIRE && c->search_step == 0 &&
        tick - c->lost_tick < bst_control_ticks(c, c->config.reacquire_coast_s)) {
        return BST_OK;
    }
    if (c->search_step + 1 < c->search.count) {
        return go_to_tile(ctx, c, c->search_step + 1, tick);
    }
    return bst_control_start_search(ctx, c, BST_MODE_SEARCH, tick,
                                    c->mode == BST_MODE_SEARCH ? "searched all, again from the cue"
                                                               : "not near its predicted place");
}

/* True if a track's brightness is consistent with the cue. */
static bool is_brightness_consistent(const bst_onboard_cue *cue, const bst_track *track) {
    return !isfinite(cue->v_mag_sigma) ||
           fabs(track->v_mag - cue->v_mag) <= 4.0 * hypot(cue->v_mag_sigma, 0.3);
}

bst_status bst_control_best_candidate(bst_ctx *ctx, const bst_control *c, const bst_tracks *tracks,
                                      const bst_track **out) {
    bst_onboard_cue cue;
    BST_TRY(bst_control_cue_at(ctx, c, tracks->tick, &cue));
    *out = NULL;
    /* a candidate for the lost target may have been seen, and be seen no more */
    bool lost = c->mode == BST_MODE_REACQUIRE ||
                (c->mode == BST_MODE_ACQUIRE && c->search_mode == BST_MODE_REACQUIRE);
    bst_vec3 rate = lost ? c->lost.rate_gcrf_radps : cue.rate_gcrf_radps;
    double rate_sigma = cue.valid ? cue.rate_sigma_radps : 0.0, best = 0.0;
    if (!cue.valid && !lost) {
        return BST_OK;
    }
    double own = c->config.candidate_rate_sigmas * rate_sigma;
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (t->hits < c->config.candidate_hits || t->score < c->config.candidate_score ||
            t->id <= c->rejected_id || t->hidden != BST_HIDDEN_NOT) {
            continue;
        }
        if (c->search_in_region) {
            bool known;
            BST_TRY(
                bst_control_expected_rate(ctx, c, tracks->tick, t->direction_gcrf, &known, &rate));
            if (!known || t->uncorrelated || !is_brightness_consistent(&cue, t)) {
                continue;
            }
        }
        double widest = fmax(2.0 * own, bst_vec3_norm(rate));
        double off = bst_vec3_norm(bst_vec3_sub(t->rate_gcrf_radps, rate));
        double variance = rate_sigma * rate_sigma + fmax(t->covariance[2][2], t->covariance[3][3]);
        double gate = c->config.candidate_rate_sigmas * sqrt(variance);
        /* a rate compatible with zero carries no information */
        if (off > gate || gate > widest) {
            continue;
        }
        /* more hits first, then the smaller rate difference */
        double score = t->hits + 1.0 - off / gate;
        if (score > best) {
            best = score;
            *out = t;
        }
    }
    return BST_OK;
}

/* True if a frame was exposed entirely after the arrival. An exposure of unknown length is assumed
 * to fill its frame period. */
static bool at_rest(const bst_control *c, int64_t mid_tick) {
    int64_t half = c->config.exposure_s > 0.0 ? bst_control_ticks(c, 0.5 * c->config.exposure_s)
                                              : c->frame_interval_ticks / 2;
    return c->arrival_tick >= 0 && half > 0 && mid_tick - half >= c->arrival_tick;
}

bst_status bst_control_count_frame(bst_ctx *ctx, bst_control *c, int64_t tick,
                                   const bst_tracks *tracks) {
    /* stars without a valid attitude: the frame is unusable */
    bool wasted = tracks->attitude.stars > 0 && !tracks->attitude.valid;
    if (!wasted && at_rest(c, tracks->tick) && ++c->frames >= c->config.dwell_frames) {
        return bst_control_next_tile(ctx, c, tick);
    }
    return BST_OK;
}
