#include "sim/analysis/check/check_reach.h"

#include <stdio.h>
#include <string.h>

#include "control/control.h"
#include "gimbal/mount/mount.h"
#include "gimbal/mount/second_order.h"
#include "sim/analysis/check/check_moves.h"
#include "sim/analysis/check/check_spans.h"
#include "sim/engine/scenario/loop_timing.h"
#include "sim/onboard/knowledge.h"
#include "sim/world/world_config.h"

/* steps of the prediction: a thousandth of the run within these limits */
#define LEAST_STEP_S 0.5
#define MOST_STEP_S 10.0
/* margin before and after the time in which limits are exceeded */
#define RUN_UP_S 5.0
#define RUN_OUT_S 120.0
enum { MOST_SPANS = 10000, MOST_LOSSES = 4 };

typedef struct seeing {
    int observer, sensor;
    const bst_guidance_config *guidance;
    bst_knowledge *knowledge;
    bst_knowledge_view *cue;
    bst_world_view *view;
    bool turns; /* the body follows a pointing law */
    bst_pointing_law law;
    bst_mount_status mount;
} seeing;

/* Direction of the cue, attitude of the body and position of the observer at a time. */
static bst_status look(void *user, bst_ctx *ctx, double seconds,
                       bst_pointing_feasibility_look *out) {
    seeing *s = user;
    *out = (bst_pointing_feasibility_look){.valid = false};
    bst_vec3 direction;
    bst_world_state state;
    bst_bodies bodies;
    bool known;
    double rate;
    BST_TRY(bst_knowledge_cue_direction_at(ctx, s->cue, seconds, &out->valid, &direction));
    if (!out->valid) {
        return BST_OK;
    }
    BST_TRY(bst_knowledge_cue_range_at(ctx, s->cue, seconds, &known, &out->range_m, &rate));
    out->range_m = known ? out->range_m : 0.0;
    BST_TRY(bst_world_view_nav(ctx, s->view, s->observer, s->sensor, seconds, &state, &bodies));
    bst_light light = bst_light_at(&bodies, state.position_m, state.velocity_mps);
    out->direction_gcrf = bst_light_aberrate(&light, direction);
    out->position_m = state.position_m;
    bst_spacecraft_law_inputs inputs = {.position_m = state.position_m,
                                        .velocity_mps = state.velocity_mps,
                                        .sun_m = light.sun_m,
                                        .target = out->direction_gcrf};
    out->q_body_from_gcrf =
        s->turns ? bst_pointing_law_attitude(&s->law, &inputs) : s->law.q_nominal;
    bst_nav_telemetry nav = {.position_gcrf_m = state.position_m,
                             .sun_m = light.sun_m,
                             .moon_m = bst_vec3_sub(bodies.moon_m, state.position_m)};
    bst_guidance guidance = {.config = *s->guidance};
    out->zone_count = bst_guidance_zones(&guidance, &nav, out->zones);
    return BST_OK;
}

/* ---- what was found ---- */

typedef struct found {
    double duration_s; /* examined duration */
    bst_check_spans spans[BST_REACH_COUNT];
} found;

/* Warns of the spans in which the mount cannot point at the cue, by reason. */
static void warn(bst_ctx *ctx, const char *name, const found *f, double examined_s,
                 double duration_s, bool rolls) {
    for (int reason = BST_REACH_BEHIND_EARTH; reason < BST_REACH_COUNT; reason++) {
        if (f->spans[reason].count > 0) {
            bst_check_span_words words =
                bst_check_spans_word(&f->spans[reason], examined_s, duration_s);
            bst_log(ctx, BST_LOG_WARNING, "%s: the cue is out of reach %s: %s%s%s", name,
                    words.from, bst_pointing_feasibility_reason(reason),
                    rolls && reason == BST_REACH_KEYHOLE ? ", unless the body rolls in time" : "",
                    words.more);
        }
    }
}

/* Finds losses by the mount's limits around [from_s, until_s]; *until_s: end of the last loss. */
static bst_status chase(bst_ctx *ctx, const bst_pointing_feasibility_problem *problem,
                        double tolerance_rad, int reason, double from_s, double *until_s,
                        found *f) {
    bst_pointing_feasibility_loss losses[MOST_LOSSES];
    bst_pointing_feasibility middle;
    int count;
    double end_s = fmin(*until_s + RUN_OUT_S, f->duration_s);
    /* approaching the pole, the acceleration limit is exceeded first */
    BST_TRY(bst_pointing_feasibility_at(ctx, problem, 0.5 * (from_s + *until_s), &middle));
    reason = middle == BST_REACH_KEYHOLE ? (int)middle : reason;
    const bst_pointing_feasibility_span span = {fmax(from_s - RUN_UP_S, 0.0), end_s, tolerance_rad};
    BST_TRY(bst_pointing_feasibility_chase(ctx, problem, &span, losses, MOST_LOSSES, &count));
    for (int i = 0; i < count; i++) {
        double until = fmin(losses[i].until_s, end_s);
        bst_check_spans_add(&f->spans[reason], losses[i].from_s, until);
        *until_s = fmax(*until_s, until);
    }
    return BST_OK;
}

/* Finds the spans in which the mount cannot point at the cue. */
static bst_status spans(bst_ctx *ctx, seeing *s, double duration_s, double tolerance_rad,
                        found *f) {
    f->duration_s = duration_s;
    const bst_pointing_feasibility_problem problem = {
        .look = look,
        .user = s,
        .mount = s->mount.axes > 0 ? &s->mount : NULL,
        .limit_fraction = s->guidance->limit_fraction};
    double step = fmin(fmax(1e-3 * duration_s, LEAST_STEP_S), MOST_STEP_S);
    double at = 0.0;
    for (int i = 0; i < MOST_SPANS && at < duration_s; i++) {
        bst_pointing_feasibility_change lost, back;
        const bst_pointing_feasibility_search unreached = {at, duration_s - at, step, false};
        BST_TRY(bst_pointing_feasibility_next(ctx, &problem, &unreached, &lost));
        if (!lost.found) {
            break;
        }
        double from = lost.when_s;
        const bst_pointing_feasibility why = lost.why;
        const bst_pointing_feasibility_search reached = {from, duration_s - from, step, true};
        BST_TRY(bst_pointing_feasibility_next(ctx, &problem, &reached, &back));
        double until = back.found ? back.when_s : duration_s;
        if (why == BST_REACH_KEYHOLE || why == BST_REACH_RATE || why == BST_REACH_ACCEL) {
            BST_TRY(chase(ctx, &problem, tolerance_rad, (int)why, from, &until, f));
        } else {
            bst_check_spans_add(&f->spans[why], from, until);
        }
        at = fmax(until, at + step);
    }
    return BST_OK;
}

/* ---- a sensor ---- */

/* Sets the mount's axes and limits and the attitude law of its platform. */
static bst_status set_mount(bst_ctx *ctx, const bst_scenario_module_config *gimbal, double dt_s,
                            bst_quat nominal, seeing *s) {
    const bst_platform_config *platform;
    if (gimbal->desc->config == bst_two_axis_config_table) {
        const bst_mount_two_axis_config *config = gimbal->config;
        const bst_mount_two_axis_keys keys = {{{0, 0}}, {{0, 0}}, {{0, 0}}};
        bst_mount_two_axis plant;
        platform = &config->platform;
        BST_TRY(bst_mount_two_axis_init(ctx, &plant, config, nominal, 1e-5, dt_s, &keys));
        bst_mount_two_axis_status(&plant, 0, &s->mount);
        bst_platform_free(&plant.platform);
    } else {
        const bst_mount_config *config = gimbal->config;
        bool azimuth = strcmp(gimbal->desc->type, "azimuth_elevation") == 0;
        bst_mount mount;
        platform = &config->platform;
        BST_TRY(bst_mount_init(ctx, &mount,
                               azimuth ? BST_MOUNT_AZIMUTH_ELEVATION : BST_MOUNT_CROSS_ELEVATION,
                               config, dt_s, (bst_rng_key){{0, 0}}));
        bst_mount_status_of(&mount, 0, &s->mount);
    }
    const bst_spacecraft_attitude_config *a = &platform->spacecraft.attitude;
    s->turns = platform->spacecraft.type == BST_CRAFT_RIGID_BODY;
    s->law = (bst_pointing_law){
        .law = (bst_spacecraft_law)a->law,
        .q_nominal = nominal,
        .axis = bst_vec3_unit((bst_vec3){a->axis[0], a->axis[1], a->axis[2]}),
        .second_axis =
            bst_vec3_unit((bst_vec3){a->second_axis[0], a->second_axis[1], a->second_axis[2]}),
        .roll_rad = a->roll_deg * BST_DEG_RAD};
    if (s->turns && a->law == BST_LAW_FREE) {
        s->mount.axes = 0; /* the motion is unknown */
    }
    return BST_OK;
}

/* Initial boresight in body axes. */
static bst_vec3 start_boresight(const bst_mount_status *mount) {
    bst_quat q = BST_QUAT_IDENTITY;
    for (int a = 0; a < mount->axes; a++) {
        const bst_mount_axis *axis = &mount->axis[a];
        q = bst_quat_mul(q, bst_quat_from_rotvec(bst_vec3_scale(axis->axis_body, axis->angle_rad)));
    }
    return bst_quat_rotate(bst_quat_mul(q, mount->q_body_from_cam_at_zero), (bst_vec3){0, 0, 1});
}

/* Checks slew, search and scan against the limits of the mount. */
static bst_status moves(bst_ctx *ctx, const bst_scenario *scenario, seeing *s,
                        const bst_control_config *config, const char *name) {
    if (s->mount.axes == 0) {
        return BST_OK;
    }
    bst_loop_timing timing;
    bst_loop_timing_of(scenario, s->observer, s->sensor, &timing);
    const bst_camera *camera = bst_knowledge_camera(s->knowledge);
    double pixel = bst_camera_scale_rad(camera), width_px, height_px;
    bst_camera_field_px(camera, &width_px, &height_px);
    bst_onboard_cue cue;
    BST_TRY(bst_knowledge_cue_at(ctx, s->cue, 0.0, &cue));
    bst_check_mount_moves request = {.control = config,
                                     .mount = &s->mount,
                                     .period_s = timing.period_s,
                                     .exposure_s = timing.exposure_s,
                                     .width_rad = width_px * pixel,
                                     .height_rad = height_px * pixel,
                                     .cue_sigma_rad = cue.valid ? cue.sigma_rad : 0.0,
                                     .duration_s = scenario->duration_s};
    bst_knowledge_region(s->knowledge, &request.region);
    (void)bst_check_moves(ctx, name, &request);
    bst_pointing_feasibility_look first;
    BST_TRY(look(s, ctx, 0.0, &first));
    bool goes = config->strategy == BST_CONTROL_TRACK || config->strategy == BST_CONTROL_RATE;
    if (goes && first.valid) {
        bst_vec3 wanted = bst_quat_rotate(first.q_body_from_gcrf, first.direction_gcrf);
        (void)bst_check_first_slew(ctx, name, &request,
                                   bst_vec3_angle(start_boresight(&s->mount), wanted));
    }
    return BST_OK;
}

static bst_status check_sensor(bst_ctx *ctx, const bst_scenario *scenario, const bst_world *world,
                               seeing *s, const char *name) {
    const bst_scenario_module_config *gimbal =
        bst_scenario_module(scenario, s->observer, s->sensor, "gimbal");
    const bst_scenario_module_config *control =
        bst_scenario_module(scenario, s->observer, s->sensor, "control");
    if (!gimbal || !control || control->desc->config != bst_control_config_table ||
        (gimbal->desc->config != bst_two_axis_config_table &&
         gimbal->desc->config != bst_mount_config_table)) {
        return BST_OK;
    }
    const bst_control_config *config = control->config;
    s->guidance = &config->guidance;
    BST_TRY(bst_knowledge_create(ctx, world, s->observer, s->sensor, &s->knowledge));
    BST_TRY(bst_knowledge_view_create(ctx, s->knowledge, &s->cue));
    BST_TRY(bst_world_view_create(ctx, world, &s->view));
    BST_TRY(set_mount(ctx, gimbal, (double)gimbal->period_ticks / (double)scenario->tick_rate_hz,
                      bst_knowledge_body_attitude(s->knowledge), s));
    BST_TRY(moves(ctx, scenario, s, config, name));
    bst_region region;
    bst_knowledge_region(s->knowledge, &region);
    if ((config->strategy != BST_CONTROL_TRACK && config->strategy != BST_CONTROL_RATE) ||
        region.kind != BST_REGION_NONE) {
        return BST_OK;
    }
    double pixel = bst_camera_scale_rad(bst_knowledge_camera(s->knowledge));
    found f = {.spans = {{0}}};
    double looked_s = fmin(scenario->duration_s, BST_CHECK_LOOKED_S);
    BST_TRY(spans(ctx, s, looked_s, config->guidance.loss_tolerance_px * pixel, &f));
    warn(ctx, name, &f, looked_s, scenario->duration_s,
         s->turns && s->law.law != BST_LAW_FREE && config->guidance.body_roll);
    return BST_OK;
}

bst_status bst_check_reach(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_simulation *simulation) {
    const bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensors = observers[o].sensors.items;
        for (int i = 0; i < observers[o].sensors.count; i++) {
            char name[160];
            snprintf(name, sizeof name, "%s/%s", observers[o].name, sensors[i].name);
            seeing s = {.observer = o, .sensor = i};
            bst_status status =
                check_sensor(ctx, scenario, bst_simulation_world(simulation), &s, name);
            bst_world_view_free(s.view);
            bst_knowledge_view_free(s.cue);
            bst_knowledge_free(s.knowledge);
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s", name);
            }
        }
    }
    return BST_OK;
}
