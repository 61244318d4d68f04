#include "gimbal/platform_step.h"
#include "sim/messages/message_invariants.h"

#include <assert.h>
#include <stdlib.h>

bst_status bst_gimbal_create(const bst_module_env *env, size_t bytes, bst_gimbal_prepare_fn prepare,
                             void (*destroy)(void *self), const void *config, void **self) {
    assert(env && env->world && env->tick_rate_hz > 0 && prepare && destroy && config && self);
    if (env->period_ticks <= 0) {
        return bst_fail(env->ctx, BST_ERR_CONFIG, "a gimbal needs a rate: give rate_hz above zero");
    }
    bst_gimbal_base *base = calloc(1, bytes);
    if (!base) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for a gimbal");
    }
    base->observer = env->observer;
    base->sensor = env->sensor;
    base->tick_rate_hz = (double)env->tick_rate_hz;
    base->dt_s = (double)env->period_ticks / base->tick_rate_hz;
    bst_status status = prepare(env, config, base);
    if (status != BST_OK) {
        destroy(base);
        return status;
    }
    *self = base;
    return BST_OK;
}

bst_status bst_gimbal_platform_init(const bst_module_env *env, const bst_platform_config *config,
                                    bst_gimbal_base *base, bst_platform *platform) {
    const bst_platform_setup setup = {.q_nominal_from_gcrf = bst_gimbal_nominal(env),
                                      .pixel_rad = bst_gimbal_pixel_rad(env),
                                      .dt_s = base->dt_s,
                                      .jitter_key = bst_env_rng(env, "jitter"),
                                      .attitude_key = bst_env_rng(env, "attitude")};
    base->platform = platform;
    return bst_platform_init(env->ctx, platform, config, &setup);
}

bst_quat bst_gimbal_nominal(const bst_module_env *env) {
    return bst_world_body_attitude(env->world, env->observer, env->sensor);
}

double bst_gimbal_pixel_rad(const bst_module_env *env) {
    return bst_camera_scale_rad(bst_world_camera(env->world, env->observer, env->sensor));
}

/* Samples of a ring that covers history_s at rate_hz, both ends included. */
static int ring(double history_s, double rate_hz) {
    double samples = ceil(history_s * rate_hz) + 1.0;
    return samples < 2.0 ? 2 : samples > 1e8 ? 100000000 : (int)samples;
}

bst_status bst_gimbal_base_init(const bst_module_env *env, const bst_platform_config *config,
                                double exposure_s, int history_more, bst_gimbal_base *base) {
    double rate_hz = 1.0 / base->dt_s;
    BST_TRY(bst_platform_check_history(env->ctx, config, exposure_s));
    BST_TRY(bst_platform_divider(env->ctx, "telemetry_rate_hz", rate_hz, config->telemetry_rate_hz,
                                 &base->telemetry_steps));
    BST_TRY(bst_platform_divider(env->ctx, "nav_rate_hz", rate_hz, config->nav_rate_hz,
                                 &base->nav_steps));
    BST_TRY(bst_world_view_create(env->ctx, env->world, &base->view));
    bst_env_set_capacity(env, BST_GIMBAL_HISTORY, ring(config->history_s, rate_hz) + history_more);
    /* the tracker needs the attitude at mid-exposure of a late frame */
    double late_s = exposure_s + env->frame_latency_s + 2.0 / config->telemetry_rate_hz;
    bst_env_set_capacity(
        env, BST_GIMBAL_POINTING,
        ring(fmax(config->telemetry_history_s, late_s), config->telemetry_rate_hz));
    if (base->platform && base->platform->spacecraft) {
        bst_env_set_capacity(env, BST_GIMBAL_WHEELS,
                             bst_spacecraft_wheel_count(base->platform->spacecraft));
    }
    return BST_OK;
}

void bst_gimbal_destroy(void *self) {
    bst_gimbal_base *base = self;
    if (base) {
        if (base->platform) {
            bst_platform_free(base->platform);
        }
        bst_world_view_free(base->view);
        free(base);
    }
}

bst_status bst_platform_step(struct bst_step *step, bst_platform *platform, int64_t n,
                             bst_vec3 reaction_nm, const bst_los_command *command) {
    if (command && command->roll_given) {
        bst_spacecraft_command_roll(platform->spacecraft, command->roll_rad);
    }
    bool saturated = platform->wheels_saturated, blind = platform->trackers_blind;
    BST_TRY(
        bst_platform_advance(bst_step_ctx(step), platform, n, bst_step_seconds(step), reaction_nm));
    if (platform->wheels_saturated != saturated) {
        if (saturated) {
            bst_step_event(step, "wheels", "reaction wheels within their limits again");
        } else {
            bst_step_event(step, "wheels", "reaction wheels at their limit");
            bst_step_count(step, "wheels_saturated");
        }
    }
    if (platform->trackers_blind != blind) {
        if (blind) {
            bst_step_event(step, "star_trackers", "stars in sight again");
        } else {
            bst_step_event(step, "star_trackers", "no star tracker sees stars");
            bst_step_count(step, "star_trackers_blind");
        }
    }
    return BST_OK;
}

const bst_los_command *bst_gimbal_command(struct bst_step *step, int port,
                                          const bst_gimbal_base *base, double *age_s) {
    const bst_los_command *command = bst_step_latest(step, port).payload;
    *age_s = command ? (double)(bst_step_tick(step) - command->tick) / base->tick_rate_hz : 0.0;
    return command;
}

void bst_gimbal_publish_sight(struct bst_step *step, const bst_platform *platform,
                              bst_quat q_cam_from_gcrf) {
    int capacity;
    bst_los_history *history = bst_step_write(step, BST_GIMBAL_HISTORY, &capacity);
    history->jitter_rad2 = platform->unresolved_rad2;
    bst_platform_append_los(history, capacity, bst_step_tick(step), q_cam_from_gcrf);
    assert(bst_los_history_is_valid(history));
}

bst_gimbal_reading bst_gimbal_exact(const bst_platform *platform, int64_t n,
                                    bst_quat q_cam_from_body) {
    bst_quat body = bst_platform_measured_body(platform, n);
    return (bst_gimbal_reading){
        .q_cam_from_gcrf = bst_quat_unit(bst_quat_mul(q_cam_from_body, body)),
        .q_body_from_gcrf = body,
        .settled = true};
}

/* Publishes the state of the spacecraft's wheels, if it has any. */
static void publish_wheels(struct bst_step *step, const bst_platform *platform) {
    if (!platform->spacecraft || bst_spacecraft_wheel_count(platform->spacecraft) == 0) {
        return;
    }
    int capacity;
    bst_wheel_status *out = bst_step_write(step, BST_GIMBAL_WHEELS, &capacity);
    out->tick = bst_step_tick(step);
    out->count = bst_spacecraft_wheel_count(platform->spacecraft);
    assert(out->count <= capacity);
    for (int i = 0; i < out->count; i++) {
        out->items[i] = bst_spacecraft_wheel_state(platform->spacecraft, i);
    }
    assert(bst_wheel_status_is_valid(out, capacity));
}

void bst_gimbal_publish_reading(struct bst_step *step, const bst_platform *platform,
                                const bst_gimbal_reading *reading, bst_mount_status *status) {
    int capacity;
    bst_pointing_telemetry *telemetry = bst_step_write(step, BST_GIMBAL_POINTING, &capacity);
    telemetry->capacity = capacity;
    telemetry->q_body_from_gcrf = reading->q_body_from_gcrf;
    telemetry->settled = reading->settled;
    telemetry->limited = reading->limited;
    telemetry->items[telemetry->written % capacity] =
        (bst_pointing_sample){.tick = bst_step_tick(step),
                              .q_cam_from_gcrf = reading->q_cam_from_gcrf,
                              .axis_rad = {reading->axis_rad[0], reading->axis_rad[1]}};
    telemetry->written++;
    assert(bst_pointing_telemetry_is_valid(telemetry));
    if (status) {
        bst_platform_add_status(platform, reading->q_body_from_gcrf, status);
        publish_wheels(step, platform);
    }
}

bst_status bst_gimbal_publish_nav(struct bst_step *step, const bst_gimbal_base *base, int64_t n) {
    if (n % base->nav_steps != 0) {
        return BST_OK;
    }
    bst_nav_telemetry *out = bst_step_write(step, BST_GIMBAL_NAV, NULL);
    bst_ctx *ctx = bst_step_ctx(step);
    bst_world_state state;
    bst_bodies bodies;
    BST_TRY(bst_world_view_nav(ctx, base->view, base->observer, base->sensor,
                               bst_step_seconds(step), &state, &bodies));
    bst_light light = bst_light_at(&bodies, state.position_m, state.velocity_mps);
    *out = (bst_nav_telemetry){.tick = bst_step_tick(step),
                               .position_gcrf_m = state.position_m,
                               .velocity_gcrf_mps = state.velocity_mps,
                               .velocity_bary_mps = light.velocity_mps,
                               .sun_m = light.sun_m,
                               .moon_m = bst_vec3_sub(bodies.moon_m, state.position_m)};
    assert(bst_nav_telemetry_is_valid(out));
    return BST_OK;
}

bst_status bst_gimbal_publish_exact(struct bst_step *step, const bst_platform *platform,
                                    const bst_gimbal_base *base, int64_t n,
                                    bst_quat q_cam_from_body) {
    if (n % base->telemetry_steps == 0) {
        bst_gimbal_reading reading = bst_gimbal_exact(platform, n, q_cam_from_body);
        bst_gimbal_publish_reading(step, platform, &reading, NULL);
    }
    return bst_gimbal_publish_nav(step, base, n);
}
