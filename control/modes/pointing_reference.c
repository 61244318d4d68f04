/* Pointing reference: direction of the aim over time. */
#include "control/control_internal.h"

/* Lifetime of a cached aim, in half intervals of rate differences: 1 s. */
#define KEPT_OVER_HALF 4
/* Interval about the navigation telemetry in which the observer's acceleration is taken as
 * constant. */
#define FALL_S 2.0
/* Largest fifth difference at which aims are interpolated: the error for smooth motion is 200 times
 * less, and aims computed with different telemetry differ by 1e-10. */
#define SMOOTH_RAD 1e-9

bst_status bst_control_cue_at(bst_ctx *ctx, const bst_control *c, int64_t tick,
                              bst_onboard_cue *out) {
    return c->env.cue_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), out);
}

static bst_status cue_direction_at(bst_ctx *ctx, const bst_control *c, int64_t tick, bool *valid,
                                   bst_vec3 *out) {
    return c->env.cue_direction_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), valid, out);
}

/* Direction of a held track at a tick; its rate changes along the arc as the cue's does. */
static bst_status held_at(bst_ctx *ctx, const bst_control *c, const bst_control_held *held,
                          int64_t tick, bst_vec3 *direction) {
    double dt = (double)(tick - held->tick) / c->env.tick_rate_hz;
    bst_vec3 d = bst_vec3_axpy(held->direction_gcrf, dt, held->rate_gcrf_radps);
    const bst_onboard_cue *then = &held->cue;
    bool valid;
    bst_vec3 now;
    BST_TRY(cue_direction_at(ctx, c, tick, &valid, &now));
    /* an arc across a jump of the cue is not the target's motion */
    if (then->valid && valid && held->tick > c->watch.jump_tick) {
        bst_vec3 straight = bst_vec3_axpy(then->direction_gcrf, dt, then->rate_gcrf_radps);
        d = bst_vec3_add(d, bst_vec3_sub(now, straight));
    }
    *direction = bst_vec3_unit(d);
    return BST_OK;
}

/* Direction at a search tile's offset. */
static bst_vec3 offset_by(bst_vec3 d, bst_vec3 x_axis, bst_search_tile tile) {
    bst_vec3 e1 = bst_vec3_axpy(x_axis, -bst_vec3_dot(x_axis, d), d);
    e1 = bst_vec3_norm(e1) > 1e-6 ? bst_vec3_unit(e1) : bst_vec3_perpendicular(d);
    bst_vec3 e2 = bst_vec3_cross(d, e1);
    return bst_vec3_unit(bst_vec3_axpy(bst_vec3_axpy(d, tile.x_rad, e1), tile.y_rad, e2));
}

bool bst_control_moves_with_region(const bst_control *c) {
    return (c->env.region.kind == BST_REGION_GEOSTATIONARY) ==
           (c->config.search_rate == BST_CONTROL_RATE_BELT);
}

bst_status bst_control_expected_rate(bst_ctx *ctx, const bst_control *c, int64_t tick,
                                     bst_vec3 direction, bool *known, bst_vec3 *rate_radps) {
    if (c->env.region.kind == BST_REGION_NONE) {
        bst_onboard_cue cue;
        BST_TRY(bst_control_cue_at(ctx, c, tick, &cue));
        *known = cue.valid;
        *rate_radps = cue.rate_gcrf_radps;
        return BST_OK;
    }
    bst_belt_eye eye;
    double range_m, range_rate_mps;
    BST_TRY(c->env.belt_eye_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), known, &eye));
    *known = *known && bst_belt_motion(&eye, direction, rate_radps, &range_m, &range_rate_mps);
    return BST_OK;
}

/* Direction of the current search tile of a region. */
static bst_status tile_at(bst_ctx *ctx, const bst_control *c, int64_t tick, bst_vec3 *direction) {
    bst_search_tile tile = c->search.tile[c->search_step];
    if (bst_control_moves_with_region(c)) {
        return c->env.region_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), tile.x_rad,
                                tile.y_rad, direction);
    }
    double dt = bst_control_seconds(c, tick - c->tile_tick);
    *direction = bst_vec3_unit(bst_vec3_axpy(c->tile_gcrf, dt, c->tile_rate_radps));
    return BST_OK;
}

/* Angle along the region's centre line of a scan to and fro at a constant rate. */
static double scanned_rad(const bst_control *c, int64_t tick) {
    double rate = c->config.scan_rate_arcsec_per_s * BST_ARCSEC_RAD;
    double length = 2.0 * c->env.region.half_length_rad;
    double gone = fabs(rate) * bst_control_seconds(c, tick - c->mode_tick);
    double on = gone - 2.0 * length * floor(gone / (2.0 * length));
    double from_end = on <= length ? on : 2.0 * length - on;
    return rate < 0.0 ? 0.5 * length - from_end : from_end - 0.5 * length;
}

static bst_status fixed_at(const bst_control *c, int64_t tick, bool *valid, bst_vec3 *direction) {
    const double *f = c->config.fixed_direction;
    bst_vec3 held = bst_vec3_unit((bst_vec3){f[0], f[1], f[2]});
    if (c->config.fixed_frame == BST_CONTROL_FIXED_INERTIAL) {
        *direction = held;
        return BST_OK;
    }
    *valid = c->pointing_valid;
    if (*valid) {
        bst_vec3 turn =
            bst_vec3_scale(c->body_rate_radps, bst_control_seconds(c, c->body_tick - tick));
        bst_vec3 then = bst_quat_rotate(bst_quat_from_rotvec(turn), held);
        *direction = bst_quat_rotate(bst_quat_conj(c->q_body_from_gcrf), then);
    }
    return BST_OK;
}

bst_status bst_control_aim(bst_ctx *ctx, const bst_control *c, int64_t tick, bool *valid,
                           bst_vec3 *direction) {
    *valid = true;
    switch (c->mode) {
        case BST_MODE_SLEW:
        case BST_MODE_RATE:
        case BST_MODE_SEARCH:
            if (c->search_in_region && c->mode == BST_MODE_SEARCH) {
                return tile_at(ctx, c, tick, direction);
            }
            BST_TRY(cue_direction_at(ctx, c, tick, valid, direction));
            if (c->mode == BST_MODE_SEARCH && *valid) {
                *direction =
                    offset_by(*direction, c->search_x_gcrf, c->search.tile[c->search_step]);
            }
            return BST_OK;
        case BST_MODE_ACQUIRE:
        case BST_MODE_TRACK:
        case BST_MODE_COAST:
            return held_at(ctx, c, &c->held, tick, direction);
        case BST_MODE_REACQUIRE: {
            bst_vec3 d;
            BST_TRY(held_at(ctx, c, &c->lost, tick, &d));
            *direction = offset_by(d, c->search_x_gcrf, c->search.tile[c->search_step]);
            return BST_OK;
        }
        case BST_MODE_LOST:
            *valid = c->rest_valid;
            *direction = c->rest_gcrf;
            return BST_OK;
        case BST_MODE_STARE:
            *valid = c->stare_valid;
            *direction = c->stare_gcrf;
            return BST_OK;
        case BST_MODE_FIXED:
            return fixed_at(c, tick, valid, direction);
        case BST_MODE_SCAN:
            return c->env.region_at(c->env.cue_user, ctx, bst_control_seconds(c, tick),
                                    scanned_rad(c, tick), 0.0, direction);
        default:
            *valid = false;
            return BST_OK;
    }
}

bst_vec3 bst_control_apparent(const bst_control *c, bst_vec3 geometric) {
    return bst_light_aberration_apply(&c->aberration, geometric);
}

void bst_control_forget_aims(bst_control *c) {
    for (int i = 0; i < BST_CONTROL_AIMED; i++) {
        c->aimed[i].known = false;
    }
    for (int i = 0; i < BST_CONTROL_PIECES; i++) {
        c->pieces[i].made = false;
    }
}

static bool is_fresh(const bst_control *c, int64_t nav_tick) {
    return c->nav.tick - nav_tick <= KEPT_OVER_HALF * c->rate_half_ticks;
}

static bool held_in_body(const bst_control *c) {
    return c->mode == BST_MODE_FIXED && c->config.fixed_frame == BST_CONTROL_FIXED_BODY;
}

/* Aberration at a tick other than that of the navigation telemetry: the observer is in free fall.
 */
static bst_light_aberration aberration_at(const bst_control *c, int64_t tick) {
    const bst_nav_telemetry *nav = &c->nav;
    double dt = fmax(fmin(bst_control_seconds(c, tick - nav->tick), FALL_S), -FALL_S);
    double r = bst_vec3_norm(nav->position_gcrf_m);
    double fall = r > 0.0 ? -BST_EARTH_MU_M3PS2 / (r * r * r) : 0.0;
    return bst_light_aberration_of(&(bst_light){
        .velocity_mps = bst_vec3_axpy(nav->velocity_bary_mps, dt * fall, nav->position_gcrf_m),
        .sun_m = nav->sun_m});
}

/* Cache slot of the aim at a tick. */
static bst_control_aimed *aimed_at(bst_control *c, int64_t tick) {
    /* commands have a fixed period; Fibonacci hashing spreads its multiples evenly */
    uint64_t spread = (uint64_t)tick * UINT64_C(0x9E3779B97F4A7C15);
    bst_control_aimed *aimed = &c->aimed[spread >> 57];
    _Static_assert(BST_CONTROL_AIMED == 1 << (64 - 57), "the hash's greatest value");
    aimed->known = aimed->known && aimed->tick == tick && is_fresh(c, aimed->nav_tick);
    return aimed;
}

static void keep(const bst_control *c, bst_control_aimed *aimed, int64_t tick, bool valid,
                 bst_vec3 boresight) {
    *aimed = (bst_control_aimed){.known = true,
                                 .valid = valid,
                                 .tick = tick,
                                 .nav_tick = c->nav.tick,
                                 .boresight_gcrf = boresight};
}

static bst_status work_out(bst_ctx *ctx, const bst_control *c, int64_t tick,
                           bst_control_aimed *aimed) {
    bool valid;
    bst_vec3 d = {0.0, 0.0, 0.0};
    BST_TRY(bst_control_aim(ctx, c, tick, &valid, &d));
    /* otherwise the star directions do not matter */
    if (valid && !held_in_body(c) && c->mode != BST_MODE_LOST) {
        bst_light_aberration aberration = aberration_at(c, tick);
        bst_quat error = bst_control_correction_at(c, tick);
        d = bst_quat_rotate(error, bst_light_aberration_apply(&aberration, d));
    }
    keep(c, aimed, tick, valid, d);
    return BST_OK;
}

/* True if the aim is smooth until the cache is cleared, and will be requested again nearby. */
static bool goes_smoothly(const bst_control *c, int64_t tick) {
    int64_t ahead = tick - c->nav.tick, near = KEPT_OVER_HALF * c->rate_half_ticks;
    if (ahead > near || ahead < -near) {
        return false;
    }
    switch (c->mode) {
        case BST_MODE_SEARCH:
            return !c->search_in_region;
        case BST_MODE_SLEW:
        case BST_MODE_RATE:
        case BST_MODE_ACQUIRE:
        case BST_MODE_TRACK:
        case BST_MODE_COAST:
        case BST_MODE_REACQUIRE:
            return true;
        default:
            return false;
    }
}

/* Quintic piece that contains a tick; NULL if the path is not smooth there. */
static bst_status piece_at(bst_ctx *ctx, bst_control *c, int64_t tick,
                           const bst_control_piece **out) {
    int64_t step = c->rate_half_ticks;
    int64_t index = tick / step - (tick % step < 0);
    bst_control_piece *piece = &c->pieces[(uint64_t)index % BST_CONTROL_PIECES];
    _Static_assert((BST_CONTROL_PIECES & (BST_CONTROL_PIECES - 1)) == 0, "divides 2^64");
    *out = NULL;
    if (!piece->made || piece->index != index || !is_fresh(c, piece->nav_tick)) {
        bool valid = true;
        for (int i = 0; i < BST_QUINTIC_POINTS && valid; i++) {
            int64_t at = (index - BST_QUINTIC_BEFORE + i) * step;
            bst_control_aimed *aimed = aimed_at(c, at);
            if (!aimed->known) {
                BST_TRY(work_out(ctx, c, at, aimed));
            }
            valid = aimed->valid;
            piece->way[i] = aimed->boresight_gcrf;
        }
        piece->made = true;
        piece->index = index;
        piece->nav_tick = c->nav.tick;
        piece->smooth = valid && bst_quintic_make(piece->way) <= SMOOTH_RAD;
    }
    *out = piece->smooth ? piece : NULL;
    return BST_OK;
}

bst_status bst_control_boresight_at(bst_ctx *ctx, bst_control *c, int64_t tick, bool *valid,
                                    bst_vec3 *direction) {
    bst_control_aimed *aimed = aimed_at(c, tick);
    if (!aimed->known) {
        const bst_control_piece *piece = NULL;
        if (goes_smoothly(c, tick)) {
            BST_TRY(piece_at(ctx, c, tick, &piece));
        }
        if (piece) {
            double u =
                (double)(tick - piece->index * c->rate_half_ticks) / (double)c->rate_half_ticks;
            keep(c, aimed, tick, true, bst_quintic_at(piece->way, u));
        } else {
            BST_TRY(work_out(ctx, c, tick, aimed));
        }
    }
    *valid = aimed->valid;
    if (*valid) {
        *direction = aimed->boresight_gcrf;
    }
    return BST_OK;
}
