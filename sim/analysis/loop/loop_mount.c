/* Analysis of the servo loops of full mounts. */
#include <stdlib.h>

#include "gimbal/mount/axis.h"
#include "sim/analysis/loop/loop_model.h"

/* Open-loop response of a mount axis: compensator times plant. */
static double complex servo_open(const void *user, double omega) {
    const bst_loop_servo *servo = user;
    return bst_compensator_response(&servo->mount.compensator, omega) *
           bst_mount_linear_encoder(&servo->mount.linear, omega);
}

/* Builds the servo loop model of mount axis k. */
static bst_status build_servo(bst_ctx *ctx, int type, const bst_mount_config *config, int k,
                              double dt_s, bst_loop_servo *servo) {
    double angle[BST_CHAIN_MOST] = {0.0};
    for (int i = 0; i < BST_LOOP_AXES; i++) {
        angle[i] = config->start_deg[i] * BST_DEG_RAD;
    }
    BST_TRY(bst_mount_axis_model_init(ctx, type, config, angle, dt_s, k, &servo->mount));
    servo->there = true;
    double mode = config->flexible.frequency_hz[k];
    double share = config->flexible.inertia_fraction[k];
    /* flexible mode with locked and free joint */
    servo->hint_hz[0] = mode;
    servo->hint_hz[1] = mode / sqrt(1.0 - share);
    servo->loop = (bst_loop){.open = servo_open,
                             .user = servo,
                             .dt_s = dt_s,
                             .hint_hz = servo->hint_hz,
                             .hints = mode > 0.0 ? 2 : 0};
    return bst_loop_analyse(ctx, &servo->loop, &servo->margins);
}

/* Simulation of one axis with its servo: the linear model with the reference shaper. */
typedef struct axis_run {
    const bst_mount_axis_model *model;
    bst_axis shaper;
    bst_compensator compensator;
    double state[4], torque[32], reference[32]; /* ring buffers by step */
} axis_run;

static double step_axis(axis_run *run, int n, double target_rad, double target_radps) {
    const bst_mount_linear *linear = &run->model->linear;
    double dt = linear->dt_s, next[4], u = run->torque[n % 32];
    bst_axis *shaper = &run->shaper;
    double accel = bst_axis_shape(shaper, target_rad, target_radps);
    double rate = shaper->reference_radps + 0.5 * dt * accel;
    double angle = shaper->reference_rad + 0.5 * dt * rate;
    shaper->reference_rad += dt * rate;
    shaper->reference_radps += dt * accel;
    run->reference[(n + linear->delay_steps + 1) % 32] = shaper->reference_rad;
    double sight = run->state[0] + linear->line_of_sight_fraction * run->state[2];
    double error = run->reference[n % 32] - run->state[0];
    /* torque from this measurement: acts delay_steps later for one step */
    double asked = bst_compensator_step(&run->compensator, error, accel) +
                   run->model->model_feed_forward *
                       (run->model->viscous_nms * rate + run->model->spring_nm * angle) /
                       linear->inertia_kgm2;
    run->torque[(n + linear->delay_steps) % 32] = asked;
    if (linear->delay_steps == 0) {
        u = asked;
    }
    for (int i = 0; i < 4; i++) {
        next[i] = linear->drive[i] * u;
        for (int k = 0; k < 4; k++) {
            next[i] += linear->step[i][k] * run->state[k];
        }
    }
    for (int i = 0; i < 4; i++) {
        run->state[i] = next[i];
    }
    return sight;
}

/* Simulates a mount axis after a step or ramp of the command, as axis_response for the second-order
 * mount. */
static int mount_response(const bst_mount_axis_model *model, const bst_axis_spec *spec, bool ramp,
                          int most, double *out) {
    axis_run run = {.model = model, .compensator = model->compensator};
    bst_axis_init(&run.shaper, spec);
    double dt = spec->dt_s, ahead = dt * (model->linear.delay_steps + 1);
    int n = 0, still = 0;
    for (; n < most && still < 200; n++) {
        double now = ramp ? BST_LOOP_TINY * n * dt : BST_LOOP_TINY;
        double target = ramp ? now + BST_LOOP_TINY * ahead : now;
        double sight = step_axis(&run, n, target, ramp ? BST_LOOP_TINY : 0.0);
        double missing = (now - sight) / BST_LOOP_TINY;
        out[n] = ramp ? missing : 1.0 - missing;
        still = fabs(missing) < BST_LOOP_AT_REST ? still + 1 : 0;
    }
    return n;
}

/* Computes step response and ramp lag of a mount axis at the control rate. */
static bst_status respond(bst_ctx *ctx, const bst_mount_config *config,
                          const bst_mount_axis_model *model, int k, double dt_s,
                          bst_control_servo_response *out) {
    bst_axis_spec spec = {.rate_limit_radps = config->rate_limit_degps[k] * BST_DEG_RAD,
                          .accel_limit_radps2 = 1e6, /* far above a tiny command */
                          .natural_frequency_radps = 1.0,
                          .damping = 1.0,
                          .dt_s = dt_s};
    int most = (int)fmin(fmax(ceil(BST_LOOP_LONGEST_S / dt_s), 2.0), 1e6);
    double *step = calloc((size_t)most, 2 * sizeof *step);
    if (!step) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a mount's response");
    }
    double *lag = step + most;
    int a = mount_response(model, &spec, false, most, step);
    int b = mount_response(model, &spec, true, most, lag);
    for (int n = a; n < b; n++) {
        step[n] = 1.0;
    }
    *out = (bst_control_servo_response){
        .dt_s = dt_s, .count = a > b ? a : b, .step = step, .ramp_lag = lag};
    return BST_OK;
}

bst_status bst_loop_build_mount(bst_ctx *ctx, int type, const bst_mount_config *config,
                                const bst_control_config *control, const bst_loop_options *options,
                                bst_loop_model *model) {
    static const char *const names[BST_LOOP_AXES] = {"outer", "inner", "third"};
    double dt = model->timing.gimbal_period_s, arcsec_px = model->pixel_rad / BST_ARCSEC_RAD;
    model->axes = config->third_axis ? 3 : 2;
    for (int k = 0; k < model->axes; k++) {
        bst_loop_axis *axis = &model->axis[k];
        axis->name = names[k];
        BST_TRY(build_servo(ctx, type, config, k, dt, &axis->servo));
        if (k == 2 || !axis->servo.margins.stable) {
            continue; /* a third axis takes over from the outer one */
        }
        /* rotation axis at zero angles */
        bst_vec3 about = bst_mount_axis_body(type, k);
        int camera_axis = fabs(about.x) > fabs(about.y) ? 0 : 1;
        const double *d = config->platform.drift_arcsec_per_s;
        double drift = (about.x * d[0] + about.y * d[1] + about.z * d[2]) / arcsec_px;
        bst_control_servo_response servo = {0};
        BST_TRY(respond(ctx, config, &axis->servo.mount, k, dt, &servo));
        const bst_loop_tracked tracked = {control,     &servo, &config->platform,
                                          camera_axis, drift,  options};
        bst_status status = bst_loop_close_tracking(ctx, &tracked, model, axis);
        free((double *)(uintptr_t)servo.step);
        BST_TRY(status);
    }
    return BST_OK;
}
