#include "control/control_internal.h"
#include "sim/core/invariant.h"

#include <assert.h>

/* Half the interval of the differences that give a command's rate: long against rounding, short
 * against changes of the line-of-sight rate. */
#define RATE_HALF_S 0.25
#define BODY_RATE_SMOOTH_S 2.0
/* The held direction of mode lost is given up when the boresight is farther from it. */
#define LOST_LAG_RAD (1.0 * BST_DEG_RAD)

/* Direction of the aim for guidance (callback). */
static bst_status guidance_aim(void *user, bst_ctx *ctx, int64_t tick, bool *valid,
                               bst_vec3 *direction) {
    return bst_control_boresight_at(ctx, user, tick, valid, direction);
}

/* Range of the aim for guidance, m (callback). */
static bst_status guidance_range(void *user, bst_ctx *ctx, int64_t tick, double *range_m) {
    const bst_control *c = user;
    *range_m = 0.0;
    return c->env.cue_range_at
               ? c->env.cue_range_at(c->env.cue_user, ctx, bst_control_seconds(c, tick), range_m)
               : BST_OK;
}

/* True if a compensator on the image error corrects the pointing, not the observer. */
static bool on_image_error(const bst_control *c) {
    return c->config.compensate_attitude &&
           (c->config.compensator.plug.desc || c->config.compensator.type != BST_CONTROL_OBSERVER);
}

static bst_status start_compensator(bst_ctx *ctx, bst_control *c) {
    const bst_control_config *config = &c->config;
    bst_image_loop_env env = {.tick_rate_hz = c->env.tick_rate_hz,
                              .frame_period_s = c->env.frame_period_s,
                              .frame_exposure_s = c->env.frame_exposure_s,
                              .frame_latency_s = c->env.frame_latency_s,
                              .command_latency_s = config->command_latency_s,
                              .servo_lag_s = config->servo_lag_s,
                              .jump_rad = config->arrival_tolerance_px * c->env.pixel_rad};
    bst_status status = BST_OK;
    if (on_image_error(c)) {
        status = bst_image_loop_init(ctx, &c->image_loop, &config->compensator, &env);
    } else if (config->compensate_attitude) {
        status = bst_control_observer_density(ctx, config, &env, c->env.pixel_rad, c->env.memo,
                                              &c->pointing_error.density);
        const bst_model_error_env model = {.gain = config->compensator.gain_scale,
                                           .late_s = config->compensator.delay_s,
                                           .exposure_s = env.frame_exposure_s,
                                           .latency_s = env.frame_latency_s,
                                           .tick_rate_hz = env.tick_rate_hz,
                                           .jump_rad = env.jump_rad};
        bst_model_error_init(&c->model_error, &model);
    }
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "compensator");
}

bst_status bst_control_init(bst_ctx *ctx, bst_control *control, const bst_control_config *config,
                            const bst_control_env *env) {
    assert(control && config && env && env->tick_rate_hz > 0.0 && bst_is_positive(env->pixel_rad));
    if (config->period_s > 0.0 && config->exposure_s > config->period_s) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "exposure_s: %g s is longer than period_s of %g s; lower one or raise the "
                        "other",
                        config->exposure_s, config->period_s);
    }
    const bst_control_exposure *next = config->exposure_schedule.items;
    for (int i = 1; i < config->exposure_schedule.count; i++) {
        if (!(next[i].time_s > next[i - 1].time_s)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "exposure_schedule/%d/time_s: %g s is not after %g s; put the times in "
                            "order",
                            i, next[i].time_s, next[i - 1].time_s);
        }
    }
    const double *f = config->fixed_direction;
    if (config->strategy == BST_CONTROL_FIXED && f[0] == 0.0 && f[1] == 0.0 && f[2] == 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "fixed_direction: strategy fixed needs a direction of a length other than "
                        "zero");
    }
    bool has_region = env->region.kind != BST_REGION_NONE;
    if (!has_region && config->strategy == BST_CONTROL_SCAN) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "strategy: \"scan\" goes along the cue's region; give the cue a region");
    }
    if (!has_region && config->search_pattern == BST_SEARCH_BELT) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "search_pattern: \"belt\" goes along the cue's region; give the cue a "
                        "region, or choose nearest_first, raster or spiral");
    }
    *control = (bst_control){.config = *config,
                             .env = *env,
                             .mode = BST_MODE_IDLE,
                             .frame_tick = INT64_MIN,
                             .watch = {.jump_tick = INT64_MIN}};
    int64_t half = bst_control_ticks(control, RATE_HALF_S);
    control->rate_half_ticks = half > 0 ? half : 1;
    control->latency_ticks = bst_control_ticks(control, config->command_latency_s);
    bst_pointing_error_init(&control->pointing_error, config->disturbance_px_rms * env->pixel_rad,
                            config->disturbance_cutoff_hz,
                            config->fix_sigma_floor_px * env->pixel_rad,
                            config->attitude_sigma_arcsec * BST_ARCSEC_RAD,
                            config->drift_sigma_arcsec_per_s * BST_ARCSEC_RAD);
    const bst_guidance_env guidance = {.tick_rate_hz = env->tick_rate_hz,
                                       .pixel_rad = env->pixel_rad,
                                       .aim = guidance_aim,
                                       .range = guidance_range,
                                       .user = control};
    bst_guidance_init(&control->guidance, &config->guidance, &guidance);
    return start_compensator(ctx, control);
}

/* Saves or restores the search and its current tile. */
static void archive_search(bst_control *c, bst_archive *archive) {
    bst_search_archive(&c->search, archive);
    c->search_step =
        (int32_t)bst_archive_integer(archive, c->search_step, 0, BST_SEARCH_MAX_TILES - 1);
    c->search_mode = (int)bst_archive_integer(archive, c->search_mode, 0, BST_MODE_COUNT - 1);
    bst_archive_bool(archive, &c->search_in_region);
    BST_ARCHIVE(archive, c->tile_gcrf);
    BST_ARCHIVE(archive, c->tile_rate_radps);
    BST_ARCHIVE(archive, c->search_x_gcrf);
    BST_ARCHIVE(archive, c->tile_tick);
    BST_ARCHIVE(archive, c->arrival_tick);
    BST_ARCHIVE(archive, c->frames);
    BST_ARCHIVE(archive, c->search_since_tick);
}

/* Saves or restores the mode and the tracks on which it acts. */
static void archive_mode(bst_control *c, bst_archive *archive) {
    c->mode = (int)bst_archive_integer(archive, c->mode, 0, BST_MODE_COUNT - 1);
    BST_ARCHIVE(archive, c->mode_tick);
    if (bst_control_may_be_lost(c)) {
        bst_archive_bool(archive, &c->attitude_found);
        BST_ARCHIVE(archive, c->frames_without_attitude);
    }
    BST_ARCHIVE(archive, c->env.region); /* bst_control_retarget changes it */
    BST_ARCHIVE(archive, c->held);
    BST_ARCHIVE(archive, c->lost);
    BST_ARCHIVE(archive, c->lost_tick);
    BST_ARCHIVE(archive, c->watch);
    bst_archive_bool(archive, &c->gave_up);
    BST_ARCHIVE(archive, c->target_id);
    BST_ARCHIVE(archive, c->rejected_id);
    BST_ARCHIVE(archive, c->newest_id);
    BST_ARCHIVE(archive, c->frame_tick);
    BST_ARCHIVE(archive, c->frame_interval_ticks);
    if (bst_control_may_be_lost(c)) {
        BST_ARCHIVE(archive, c->rest_gcrf);
        bst_archive_bool(archive, &c->rest_valid);
    }
    BST_ARCHIVE(archive, c->stare_gcrf);
    bst_archive_bool(archive, &c->stare_valid);
}

/* Saves or restores the newest telemetry. */
static void archive_telemetry(bst_control *c, bst_archive *archive) {
    BST_ARCHIVE(archive, c->nav);
    BST_ARCHIVE(archive, c->aberration);
    bst_archive_bool(archive, &c->nav_valid);
    BST_ARCHIVE(archive, c->pointing);
    bst_archive_bool(archive, &c->pointing_valid);
    bst_archive_bool(archive, &c->settled);
    BST_ARCHIVE(archive, c->q_body_from_gcrf);
    BST_ARCHIVE(archive, c->body_tick);
    BST_ARCHIVE(archive, c->body_rate_radps);
}

/* The caches are saved, because a cached aim depends on the navigation message at its first use. */
bst_status bst_control_archive(bst_control *c, bst_archive *archive) {
    archive_mode(c, archive);
    archive_search(c, archive);
    archive_telemetry(c, archive);
    bst_pointing_error_archive(&c->pointing_error, archive);
    bst_model_error_archive(&c->model_error, archive);
    BST_ARCHIVE(archive, c->aimed);
    BST_ARCHIVE(archive, c->pieces);
    if (bst_archive_is_restoring(archive)) {
        c->transition_count = 0;
    }
    if (on_image_error(c)) {
        BST_TRY(bst_image_loop_archive(&c->image_loop, archive));
    }
    return bst_guidance_archive(&c->guidance, archive);
}

/* Updates the body attitude and its rate, low-pass filtered against noise of the attitude estimate.
 */
static void update_body_attitude(bst_control *c, int64_t tick, bst_quat q) {
    if (c->config.strategy != BST_CONTROL_FIXED ||
        c->config.fixed_frame != BST_CONTROL_FIXED_BODY) {
        return;
    }
    if (c->pointing_valid && tick > c->body_tick) {
        double dt = bst_control_seconds(c, tick - c->body_tick);
        bst_vec3 turn = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(c->q_body_from_gcrf)));
        bst_vec3 rate = bst_vec3_scale(turn, 1.0 / dt);
        double gain = -expm1(-dt / BODY_RATE_SMOOTH_S);
        c->body_rate_radps =
            bst_vec3_axpy(c->body_rate_radps, gain, bst_vec3_sub(rate, c->body_rate_radps));
    }
    c->q_body_from_gcrf = q;
    c->body_tick = tick;
    bst_control_forget_aims(c);
}

void bst_control_telemetry(bst_control *c, const bst_pointing_telemetry *pointing,
                           const bst_nav_telemetry *nav) {
    if (pointing && pointing->written > 0) {
        c->pointing = pointing->items[(pointing->written - 1) % pointing->capacity];
        update_body_attitude(c, c->pointing.tick, pointing->q_body_from_gcrf);
        c->pointing_valid = true;
        c->settled = pointing->settled;
        bst_model_error_telemetry(&c->model_error, pointing);
    }
    if (nav && (!c->nav_valid || nav->tick != c->nav.tick)) {
        c->nav = *nav;
        c->nav_valid = true;
        c->aberration = bst_light_aberration_of(
            &(bst_light){.velocity_mps = nav->velocity_bary_mps, .sun_m = nav->sun_m});
    }
}

bst_status bst_control_observe(bst_ctx *ctx, bst_control *c, int64_t tick,
                               const bst_tracks *tracks) {
    assert(c && tracks && tracks->count >= 0 && tracks->tick <= tick);
    /* a new attitude fix changes the aim, and the held track may change */
    bst_control_forget_aims(c);
    bst_control_watch_attitude(c, tick, &tracks->attitude);
    if (on_image_error(c)) {
        bst_image_loop_update(&c->image_loop, &c->pointing_error, tick, &tracks->attitude);
        for (int a = 0; a < 3; a++) {
            BST_TRY(bst_compensator_plug_status(ctx, &c->image_loop.axis[a]));
        }
    } else if (c->config.compensate_attitude) {
        bst_attitude_fix fix =
            bst_model_error_apply(&c->model_error, &c->pointing_error, &tracks->attitude);
        bst_pointing_error_update(&c->pointing_error, &fix, c->env.tick_rate_hz);
    }
    if (c->frame_tick != INT64_MIN && tracks->tick > c->frame_tick) {
        int64_t interval = tracks->tick - c->frame_tick;
        if (c->frame_interval_ticks == 0 || interval < c->frame_interval_ticks) {
            c->frame_interval_ticks = interval;
        }
    }
    c->frame_tick = tracks->tick;
    c->target_id = tracks->target_id;
    for (int i = 0; i < tracks->count; i++) {
        c->newest_id = tracks->items[i].id > c->newest_id ? tracks->items[i].id : c->newest_id;
    }
    return bst_control_take_frame(ctx, c, tick, tracks);
}

void bst_control_retarget(bst_control *c, int64_t tick, const bst_region *region) {
    assert(c && region);
    c->env.region = *region;
    c->held = c->lost = (bst_control_held){.id = 0};
    c->watch = (bst_control_watch){.jump_tick = tick};
    c->gave_up = false;
    c->rejected_id = c->newest_id;
    c->search_in_region = false;
    bst_control_enter(c, BST_MODE_IDLE, tick, "a new task");
}

/* Tests whether the servo has settled on the current aim, with no command pending that will replace
 * it. Also gives the offset of the aim from the estimated boresight, px. */
static bst_status check_arrival(bst_ctx *ctx, bst_control *c, bool *arrived, double off_px[2]) {
    off_px[0] = off_px[1] = 0.0;
    *arrived = false;
    if (!c->pointing_valid || !c->nav_valid) {
        return BST_OK;
    }
    bool valid;
    bst_vec3 wanted;
    BST_TRY(bst_control_boresight_at(ctx, c, c->pointing.tick, &valid, &wanted));
    if (!valid) {
        return BST_OK;
    }
    bst_vec3 v = bst_quat_rotate(c->pointing.q_cam_from_gcrf, wanted);
    off_px[0] = bst_atan2(v.x, v.z) / c->env.pixel_rad;
    off_px[1] = bst_atan2(v.y, v.z) / c->env.pixel_rad;
    double tolerance = c->config.arrival_tolerance_px;
    *arrived = c->settled && off_px[0] * off_px[0] + off_px[1] * off_px[1] <= tolerance * tolerance;
    return BST_OK;
}

/* Sets the direction that is held in mode lost: that of the boresight by telemetry, and a new one
 * where the mount does not reach the old one or is slower than the body. */
static void choose_rest(bst_control *c) {
    if (c->mode != BST_MODE_LOST || !c->config.lost_hold) {
        c->rest_valid = false;
        return;
    }
    if (!c->pointing_valid || !c->nav_valid) {
        return;
    }
    bst_vec3 boresight =
        bst_quat_rotate(bst_quat_conj(c->pointing.q_cam_from_gcrf), (bst_vec3){0.0, 0.0, 1.0});
    if (c->rest_valid && bst_vec3_angle(boresight, c->rest_gcrf) <= LOST_LAG_RAD) {
        return;
    }
    c->rest_gcrf = boresight;
    c->rest_valid = true;
    bst_control_forget_aims(c);
}

bst_status bst_control_update(bst_ctx *ctx, bst_control *c, int64_t tick, bool *commanded,
                              bst_los_command *command, bst_control_status *status) {
    assert(c && commanded && command && status && tick >= 0);
    if (c->mode == BST_MODE_IDLE) {
        BST_TRY(bst_control_start(ctx, c, tick));
    }
    choose_rest(c);
    bool arrived;
    BST_TRY(check_arrival(ctx, c, &arrived, status->aim_error_px));
    BST_TRY(bst_control_advance(ctx, c, tick, arrived));
    status->tick = tick;
    status->mode = c->mode;
    status->target_id = c->target_id;
    status->search_step = c->search_step;

    *commanded = false;
    if (!c->nav_valid) {
        return BST_OK;
    }
    int64_t effect = tick + c->latency_ticks, half = c->rate_half_ticks;
    bool valid;
    bst_vec3 d, ahead, behind;
    BST_TRY(bst_control_boresight_at(ctx, c, effect, &valid, &d));
    if (!valid) {
        return BST_OK;
    }
    BST_TRY(bst_control_boresight_at(ctx, c, effect + half, &valid, &ahead));
    BST_TRY(bst_control_boresight_at(ctx, c, effect - half, &valid, &behind));
    bst_vec3 rate =
        bst_vec3_scale(bst_vec3_sub(ahead, behind), 0.5 * c->env.tick_rate_hz / (double)half);
    *command = (bst_los_command){.tick = effect,
                                 .direction_gcrf = bst_vec3_unit(d),
                                 .rate_gcrf_radps = bst_vec3_axpy(rate, -bst_vec3_dot(rate, d), d)};
    if (c->config.guidance.acceleration_feed_forward) {
        double per_s2 = c->env.tick_rate_hz / (double)half;
        bst_vec3 bend = bst_vec3_axpy(bst_vec3_add(ahead, behind), -2.0, d);
        command->accel_gcrf_radps2 = bst_vec3_scale(bend, per_s2 * per_s2);
    }
    const bst_vec3 corrected[3] = {d, ahead, behind};
    bst_model_error_commanded(&c->model_error, &c->pointing_error, effect, half, corrected);
    if (on_image_error(c) && bst_image_loop_commanded(&c->image_loop, &c->pointing_error, effect,
                                                      half, corrected, arrived, c->pointing.tick)) {
        bst_control_forget_aims(c);
    }
    bst_vec3 boresight = {0.0, 0.0, 0.0};
    if (!c->guidance.commanded && c->pointing_valid) { /* start of the first slew */
        boresight =
            bst_quat_rotate(bst_quat_conj(c->pointing.q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    }
    if (!c->guidance.nav_known || c->guidance.nav.tick != c->nav.tick) {
        bst_guidance_see_sky(&c->guidance, &c->nav, bst_control_correction_at(c, effect));
    }
    return bst_guidance_command(ctx, &c->guidance, c->pointing_valid ? &boresight : NULL, command,
                                commanded);
}
