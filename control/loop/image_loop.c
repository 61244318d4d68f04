#include "control/loop/image_loop.h"

#include <assert.h>

#include "control/loop/tracking_loop.h"

const char *const bst_control_compensators[] = {"pi", "pid", "lead_lag", "observer", NULL};

static int64_t ticks_of(const bst_image_loop *loop, double seconds) {
    return (int64_t)llround(seconds * loop->env.tick_rate_hz);
}

/* Frame periods without a frame after which the latest image error is discarded. */
#define PATIENCE 1.5

/* The same, from mid-exposure, s. */
static double longest_wait_s(const bst_image_loop_env *env) {
    return env->frame_latency_s + 0.5 * env->frame_exposure_s + PATIENCE * env->frame_period_s;
}

bst_status bst_image_loop_init(bst_ctx *ctx, bst_image_loop *loop,
                               const bst_compensator_config *config,
                               const bst_image_loop_env *env) {
    assert(loop && config && env);
    *loop = (bst_image_loop){.env = *env, .frame_tick = INT64_MIN, .rest_tick = INT64_MIN};
    bst_aim_history_init(&loop->aims, env->tick_rate_hz,
                         longest_wait_s(env) + env->command_latency_s);
    if (!(env->frame_period_s > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "a compensator on the image error needs frames at a known period");
    }
    double arrival = 0.5 * env->frame_exposure_s + env->frame_latency_s;
    bst_tracking_timing timing = {.period_s = env->frame_period_s,
                                  .exposure_s = env->frame_exposure_s,
                                  .arrival_s = arrival,
                                  .effect_s = arrival + env->command_latency_s,
                                  .switch_s = arrival + env->command_latency_s};
    bst_control_servo_response servo = {.delay_s = env->servo_lag_s};
    const bst_tracking_observer none = {.motion_gain = 1.0};
    bst_tracking_loop *plant;
    BST_TRY(bst_tracking_loop_create(ctx, &timing, &servo, NULL, &none, &plant));
    bst_status status = bst_compensator_init(ctx, &loop->axis[0], config, env->frame_period_s,
                                             bst_tracking_plant, plant);
    bst_tracking_loop_free(plant);
    BST_TRY(status);
    loop->axis[1] = loop->axis[2] = loop->axis[0];
    return BST_OK;
}

bst_status bst_image_loop_archive(bst_image_loop *loop, bst_archive *archive) {
    for (int a = 0; a < 3; a++) {
        BST_TRY(bst_compensator_archive(&loop->axis[a], archive));
    }
    bst_aim_history_archive(&loop->aims, archive);
    BST_ARCHIVE(archive, loop->slew_tick);
    bst_archive_bool(archive, &loop->slewing);
    BST_ARCHIVE(archive, loop->rest_tick);
    BST_ARCHIVE(archive, loop->frame_tick);
    bst_archive_bool(archive, &loop->coasting);
    return BST_OK;
}

/* Sets error and rate of the correction at a tick. */
static void set_correction(bst_image_loop *loop, bst_pointing_error *correction,
                           int64_t effect_tick, const double u[3]) {
    correction->error =
        bst_quat_unit(bst_pointing_error_at(correction, effect_tick, loop->env.tick_rate_hz));
    correction->started = true;
    correction->tick = effect_tick;
    correction->rate_gcrf_radps = (bst_vec3){u[0], u[1], u[2]};
}

/* Sets the rate that an image error of zero would give (integrators only). */
static void coast(bst_image_loop *loop, bst_pointing_error *correction, int64_t effect_tick) {
    double u[3];
    for (int a = 0; a < 3; a++) {
        bst_compensator c = loop->axis[a];
        u[a] = bst_compensator_step(&c, 0.0, 0.0);
    }
    set_correction(loop, correction, effect_tick, u);
    loop->coasting = true;
}

bool bst_image_loop_commanded(bst_image_loop *loop, bst_pointing_error *correction,
                              int64_t effect_tick, int64_t half_ticks, const bst_vec3 corrected[3],
                              bool arrived, int64_t arrived_tick) {
    const double hz = loop->env.tick_rate_hz;
    const bst_quat taken[3] = {bst_pointing_error_at(correction, effect_tick, hz),
                               bst_pointing_error_at(correction, effect_tick + half_ticks, hz),
                               bst_pointing_error_at(correction, effect_tick - half_ticks, hz)};
    bst_vec3 direction, rate;
    bst_pointing_error_uncorrect(taken, corrected, (double)half_ticks / hz, &direction, &rate);
    if (loop->slewing && arrived && arrived_tick > loop->slew_tick) {
        loop->slewing = false;
        loop->rest_tick = arrived_tick;
    }
    bst_vec3 expected;
    bool jumped = !bst_aim_history_predict(&loop->aims, effect_tick, &expected) ||
                  bst_vec3_angle(expected, direction) > loop->env.jump_rad;
    if (jumped) {
        loop->slewing = true;
        loop->slew_tick = effect_tick;
    }
    bst_aim_history_add(&loop->aims, effect_tick, direction, rate, jumped);

    int64_t now = effect_tick - ticks_of(loop, loop->env.command_latency_s);
    bool overdue =
        correction->started && now - loop->frame_tick > ticks_of(loop, longest_wait_s(&loop->env));
    if (correction->started && !loop->coasting && (loop->slewing || overdue)) {
        coast(loop, correction, effect_tick);
        return true;
    }
    return false;
}

bool bst_image_loop_update(bst_image_loop *loop, bst_pointing_error *correction, int64_t tick,
                           const bst_attitude_fix *fix) {
    assert(loop && correction && fix);
    bst_vec3 aim;
    int64_t half = ticks_of(loop, 0.5 * loop->env.frame_exposure_s);
    if (!fix->valid || loop->slewing || fix->tick <= loop->frame_tick ||
        fix->tick - half < loop->rest_tick || !bst_aim_history_at(&loop->aims, fix->tick, &aim)) {
        return false;
    }
    loop->frame_tick = fix->tick;
    bst_vec3 boresight = bst_quat_rotate(bst_quat_conj(fix->q_cam_from_gcrf), (bst_vec3){0, 0, 1});
    /* rotation from the boresight to the aim, about an axis perpendicular to both */
    bst_vec3 across = bst_vec3_cross(boresight, aim);
    double sine = bst_vec3_norm(across), angle = bst_vec3_angle(boresight, aim);
    bst_vec3 error = sine > 0.0 ? bst_vec3_scale(across, angle / sine) : across;
    const double e[3] = {error.x, error.y, error.z};
    double u[3];
    for (int a = 0; a < 3; a++) {
        u[a] = bst_compensator_step(&loop->axis[a], e[a], 0.0);
    }
    set_correction(loop, correction, tick + ticks_of(loop, loop->env.command_latency_s), u);
    loop->coasting = false;
    return true;
}
