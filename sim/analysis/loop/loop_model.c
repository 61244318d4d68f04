#include "sim/analysis/loop/loop_model.h"

#include <stdlib.h>
#include <string.h>

#include "gimbal/mount/second_order.h"

static const double two_pi = 2.0 * BST_PI;

static const bst_scenario_module_config *find_module(const bst_scenario *scenario, int observer,
                                                     int sensor, const char *role) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        if (module->observer == observer && module->sensor == sensor && !module->off &&
            strcmp(module->desc->role, role) == 0) {
            return module;
        }
    }
    return NULL;
}

/* ---- the mount ---- */

/* Open loop of the second-order mount, continuous: accelerations from angle and rate errors, 2 d w
 * s + w^2 over s^2. */
static double complex second_order_open(const void *user, double omega) {
    const bst_loop_servo *servo = user;
    double complex s = I * omega;
    double w = servo->natural_radps;
    return (2.0 * servo->damping * w * s + w * w) / (s * s);
}

static bst_status second_order_servo(bst_ctx *ctx, const bst_mount_two_axis_config *config,
                                     bst_loop_servo *servo) {
    servo->there = true;
    servo->continuous = true;
    servo->natural_radps = two_pi * config->natural_frequency_hz;
    servo->damping = config->damping;
    /* frequencies up to a thousand times the natural frequency */
    servo->loop = (bst_loop){
        .open = second_order_open, .user = servo, .dt_s = 0.5e-3 / config->natural_frequency_hz};
    return bst_loop_analyse(ctx, &servo->loop, &servo->margins);
}

/* Simulates the axis after a tiny step, or (rate 1) ramp, of the command. Returns the number of
 * samples until it is at rest. */
static int axis_response(const bst_axis_spec *spec, double rate, int most, double *out) {
    bst_axis axis;
    bst_axis_init(&axis, spec);
    int n = 0, still = 0;
    for (; n < most && still < 100; n++) {
        double wanted = rate > 0.0 ? BST_LOOP_TINY * n * spec->dt_s : BST_LOOP_TINY;
        bst_axis_step(&axis, wanted, BST_LOOP_TINY * rate, 0.0);
        double missing = (wanted - axis.angle_rad) / BST_LOOP_TINY;
        out[n] = rate > 0.0 ? missing : 1.0 - missing;
        still = fabs(missing) < BST_LOOP_AT_REST ? still + 1 : 0;
    }
    return n;
}

static bst_status second_order_response(bst_ctx *ctx, const bst_mount_two_axis_config *config,
                                        double dt_s, bst_control_servo_response *out) {
    bst_axis_spec spec = {.rate_limit_radps = config->rate_limit_degps * BST_DEG_RAD,
                          .accel_limit_radps2 = config->accel_limit_degps2 * BST_DEG_RAD,
                          .natural_frequency_radps = two_pi * config->natural_frequency_hz,
                          .damping = config->damping,
                          .dt_s = dt_s};
    int most = (int)fmin(fmax(ceil(BST_LOOP_LONGEST_S / dt_s), 2.0), 1e6);
    double *step = calloc((size_t)most, 2 * sizeof *step);
    if (!step) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a mount's response");
    }
    double *lag = step + most;
    int a = axis_response(&spec, 0.0, most, step), b = axis_response(&spec, 1.0, most, lag);
    for (int n = a; n < b; n++) {
        step[n] = 1.0;
    }
    *out = (bst_control_servo_response){
        .dt_s = dt_s, .count = a > b ? a : b, .step = step, .ramp_lag = lag};
    return BST_OK;
}

/* ---- the gains of the tracking loop ---- */

static bst_status observer_gains(bst_ctx *ctx, const bst_control_config *control,
                                 const bst_image_loop_env *env, const bst_loop_options *options,
                                 bst_loop_model *model) {
    double density, asked;
    bst_control_config plain = *control;
    plain.robust_observer = false;
    BST_TRY(bst_control_observer_density(ctx, &plain, env, 1.0, NULL, &asked));
    BST_TRY(bst_control_observer_density(ctx, control, env, 1.0, NULL, &density));
    double sigma_px = fmax(options->fix_sigma_px, control->fix_sigma_floor_px);
    model->observes = true;
    model->lowered = density < asked;
    model->alpha_beta.motion_gain = control->compensator.gain_scale;
    model->alpha_beta.motion_late_s = control->compensator.delay_s;
    bst_tracking_observer_gains(density, sigma_px, model->timing.period_s, &model->alpha_beta.alpha,
                                &model->alpha_beta.beta);
    return BST_OK;
}

static bst_status control_gains(bst_ctx *ctx, const bst_control_config *control,
                                const bst_loop_options *options, bst_loop_model *model) {
    const bst_image_loop_env env = {.tick_rate_hz = 1.0,
                                    .frame_period_s = model->timing.period_s,
                                    .frame_exposure_s = model->timing.exposure_s,
                                    .frame_latency_s = model->timing.frame_latency_s,
                                    .command_latency_s = control->command_latency_s,
                                    .servo_lag_s = control->servo_lag_s};
    if (control->compensator.type == BST_CONTROL_OBSERVER && !control->compensator.plug.desc) {
        bst_status status = observer_gains(ctx, control, &env, options, model);
        return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "control/compensator");
    }
    bst_image_loop *loop = malloc(sizeof *loop);
    if (!loop) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a compensator");
    }
    bst_status status = bst_image_loop_init(ctx, loop, &control->compensator, &env);
    if (status == BST_OK) {
        model->gains = loop->axis[0];
    }
    free(loop);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "control/compensator");
}

/* ---- a sensor ---- */

static bst_status build_second_order(bst_ctx *ctx, const bst_scenario_module_config *gimbal,
                                     const bst_control_config *control,
                                     const bst_loop_options *options, bst_loop_model *model) {
    const bst_mount_two_axis_config *config = gimbal->config;
    static const char *const names[] = {"outer", "inner"};
    model->axes = 2;
    double dt = model->timing.gimbal_period_s, arcsec_px = model->pixel_rad / BST_ARCSEC_RAD;
    bst_control_servo_response servo = {0};
    BST_TRY(second_order_response(ctx, config, dt, &servo));
    bst_status status = BST_OK;
    for (int a = 0; status == BST_OK && a < model->axes; a++) {
        bst_loop_axis *axis = &model->axis[a];
        axis->name = names[a];
        status = second_order_servo(ctx, config, &axis->servo);
        /* the outer axis moves the image along x, as a rotation about body y */
        double drift = config->platform.drift_arcsec_per_s[a == 0 ? 1 : 0] / arcsec_px;
        if (status == BST_OK) {
            const bst_loop_tracked tracked = {control,        &servo, &config->platform,
                                              a == 0 ? 1 : 0, drift,  options};
            status = bst_loop_close_tracking(ctx, &tracked, model, axis);
        }
    }
    free((double *)(uintptr_t)servo.step);
    return status;
}

bst_status bst_loop_model_create(bst_ctx *ctx, const bst_scenario *scenario, int observer,
                                 int sensor, const bst_loop_options *options,
                                 bst_loop_model **out) {
    *out = NULL;
    const bst_scenario_module_config *gimbal = find_module(scenario, observer, sensor, "gimbal");
    const bst_scenario_module_config *control = find_module(scenario, observer, sensor, "control");
    bool simple = gimbal && gimbal->desc->config == bst_two_axis_config_table;
    bool full = gimbal && gimbal->desc->config == bst_mount_config_table;
    if (!simple && !full) {
        return BST_OK;
    }
    if (control && control->desc->config != bst_control_config_table) {
        control = NULL; /* of another type */
    }
    bst_loop_model *model = calloc(1, sizeof *model);
    if (!model) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a sensor's loops");
    }
    const bst_observer_config *observers = scenario->observers.items;
    const bst_sensor_config *sensors = observers[observer].sensors.items;
    model->observer = observer;
    model->sensor = sensor;
    model->observer_name = observers[observer].name;
    model->sensor_name = sensors[sensor].name;
    model->gimbal_type = gimbal->desc->type;
    model->pixel_rad = bst_camera_scale_rad(&sensors[sensor].camera);
    bst_loop_timing_of(scenario, observer, sensor, &model->timing);
    bst_status status = BST_OK;
    const bst_control_config *law = control ? control->config : NULL;
    if (law && law->compensate_attitude && bst_compensator_is_linear(&law->compensator)) {
        const bst_stage_desc *plug = law->compensator.plug.desc;
        model->compensator = plug ? plug->type : bst_control_compensators[law->compensator.type];
        model->command_latency_s = law->command_latency_s;
        status = control_gains(ctx, law, options, model);
    }
    if (status == BST_OK && simple) {
        status = build_second_order(ctx, gimbal, law, options, model);
        const bst_mount_two_axis_config *c = gimbal->config;
        status =
            status == BST_OK ? bst_loop_build_body(ctx, &c->platform.spacecraft, model) : status;
    } else if (status == BST_OK) {
        bool azimuth = strcmp(gimbal->desc->type, "azimuth_elevation") == 0;
        status = bst_loop_build_mount(
            ctx, azimuth ? BST_MOUNT_AZIMUTH_ELEVATION : BST_MOUNT_CROSS_ELEVATION, gimbal->config,
            law, options, model);
        const bst_mount_config *c = gimbal->config;
        status =
            status == BST_OK ? bst_loop_build_body(ctx, &c->platform.spacecraft, model) : status;
    }
    if (status != BST_OK) {
        bst_loop_model_free(model);
        return bst_fail_prefix(ctx, status, "%s/%s", observers[observer].name,
                               sensors[sensor].name);
    }
    *out = model;
    return BST_OK;
}

void bst_loop_model_free(bst_loop_model *model) {
    if (model) {
        for (int a = 0; a < BST_LOOP_AXES; a++) {
            bst_tracking_loop_free(model->axis[a].tracking);
        }
        free(model);
    }
}

static void warn_of(bst_ctx *ctx, const bst_loop_model *model, const char *axis, const char *what,
                    const bst_loop_margins *m) {
    const char *verdict = bst_loop_verdict(m);
    if (verdict) {
        bst_log(ctx, BST_LOG_WARNING,
                "%s/%s: the %s of the %s axis %s: gain margin %.3g dB, phase margin %.3g deg, "
                "sensitivity peak %.3g (wanted: 6 dB, 30 deg, 2); see boresight loop",
                model->observer_name, model->sensor_name, what, axis, verdict, m->gain_margin_db,
                m->phase_margin_deg, m->sensitivity_peak);
    }
}

void bst_loop_warn(bst_ctx *ctx, const bst_scenario *scenario) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_loop_options options = BST_LOOP_DEFAULTS;
    bst_ctx quiet = {0};
    for (int o = 0; o < scenario->observers.count; o++) {
        for (int s = 0; s < observers[o].sensors.count; s++) {
            bst_loop_model *model = NULL;
            if (bst_loop_model_create(&quiet, scenario, o, s, &options, &model) != BST_OK ||
                !model) {
                continue;
            }
            for (int a = 0; a < model->axes; a++) {
                const bst_loop_axis *axis = &model->axis[a];
                bool twin = a > 0 && memcmp(&axis->margins, &model->axis[0].margins,
                                            sizeof axis->margins) == 0;
                if (axis->tracked && !twin) {
                    warn_of(ctx, model, axis->name, "tracking loop", &axis->margins);
                }
                if (axis->servo.there) {
                    warn_of(ctx, model, axis->name, "servo", &axis->servo.margins);
                }
            }
            for (int b = 0; b < model->bodies; b++) {
                warn_of(ctx, model, model->body[b].name, "attitude loop", &model->body[b].margins);
            }
            bst_loop_model_free(model);
        }
    }
}
