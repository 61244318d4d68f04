#include <assert.h>
#include <stdlib.h>

#include "control/control.h"
#include "control/modules.h"
#include "sim/core/pages.h"
#include "sim/messages/message_invariants.h"

enum {
    PORT_TRACKS,
    PORT_POINTING,
    PORT_NAV,
    PORT_MOUNT,
    PORT_TASK,
    PORT_COMMAND,
    PORT_SENSOR,
    PORT_STATUS,
    PORT_COUNT
};

static const bst_port ports[PORT_COUNT] = {
    [PORT_TRACKS] = {.channel = BST_CHANNEL_TRACKS,
                     .direction = BST_PORT_IN,
                     .flags = BST_PORT_TRIGGER | BST_PORT_OPTIONAL},
    [PORT_POINTING] = {.channel = BST_CHANNEL_POINTING_TELEMETRY, .direction = BST_PORT_IN},
    [PORT_NAV] = {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_IN},
    [PORT_MOUNT] = {.channel = BST_CHANNEL_MOUNT_STATUS,
                    .direction = BST_PORT_IN,
                    .flags = BST_PORT_OPTIONAL},
    [PORT_TASK] = {.channel = BST_CHANNEL_TASK,
                   .direction = BST_PORT_IN,
                   .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
    [PORT_COMMAND] = {.channel = BST_CHANNEL_LOS_COMMAND, .direction = BST_PORT_OUT},
    [PORT_SENSOR] = {.channel = BST_CHANNEL_SENSOR_COMMAND, .direction = BST_PORT_OUT},
    [PORT_STATUS] = {.channel = BST_CHANNEL_CONTROL_STATUS, .direction = BST_PORT_OUT},
};

typedef struct module {
    bst_control control;
    bst_knowledge_view *view;
    bool sensor_told;
    int exposures_told; /* entries of exposure_schedule that are in effect */
} module;

static bst_status cue_at(void *user, bst_ctx *ctx, double seconds, bst_onboard_cue *out) {
    return bst_knowledge_cue_at(ctx, user, seconds, out);
}

static bst_status cue_direction_at(void *user, bst_ctx *ctx, double seconds, bool *valid,
                                   bst_vec3 *direction) {
    return bst_knowledge_cue_direction_at(ctx, user, seconds, valid, direction);
}

static bst_status cue_range_at(void *user, bst_ctx *ctx, double seconds, double *range_m) {
    bool known;
    double rate;
    BST_TRY(bst_knowledge_cue_range_at(ctx, user, seconds, &known, range_m, &rate));
    *range_m = known ? *range_m : 0.0;
    return BST_OK;
}

static bst_status region_at(void *user, bst_ctx *ctx, double seconds, double along_rad,
                            double across_rad, bst_vec3 *direction) {
    return bst_knowledge_region_direction_at(ctx, user, seconds, along_rad, across_rad, direction);
}

static bst_status belt_eye_at(void *user, bst_ctx *ctx, double seconds, bool *known,
                              bst_belt_eye *eye) {
    return bst_knowledge_belt_eye_at(ctx, user, seconds, known, eye);
}

static void destroy(void *self) {
    module *m = self;
    if (m) {
        bst_knowledge_view_free(m->view);
        bst_pages_free(m);
    }
}

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    assert(env && env->knowledge && env->tick_rate_hz > 0 && config && self);
    module *m = bst_pages_zero(1, sizeof *m);
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for a controller");
    }
    bst_status status = bst_knowledge_view_create(env->ctx, env->knowledge, &m->view);
    if (status == BST_OK) {
        const bst_camera *camera = bst_knowledge_camera(env->knowledge);
        double width_px, height_px;
        bst_camera_field_px(camera, &width_px, &height_px);
        bst_control_env control_env = {.tick_rate_hz = (double)env->tick_rate_hz,
                                       .pixel_rad = bst_camera_scale_rad(camera),
                                       .rotation_rad = camera->rotation_deg * BST_DEG_RAD,
                                       .width_px = (int)width_px,
                                       .height_px = (int)height_px,
                                       .frame_exposure_s = env->frame_exposure_s,
                                       .frame_period_s = env->frame_period_s,
                                       .frame_latency_s = env->frame_latency_s,
                                       .cue_at = cue_at,
                                       .cue_direction_at = cue_direction_at,
                                       .cue_range_at = cue_range_at,
                                       .region_at = region_at,
                                       .belt_eye_at = belt_eye_at,
                                       .cue_user = m->view,
                                       .memo = bst_knowledge_memo(env->knowledge)};
        bst_knowledge_region(env->knowledge, &control_env.region);
        status = bst_control_init(env->ctx, &m->control, config, &control_env);
    }
    const bst_control_config *c = config;
    if (c->strategy != BST_CONTROL_TRACK && !c->compensate_attitude) {
        bst_env_ignore(env, PORT_TRACKS); /* open loop */
    }
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    *self = m;
    return BST_OK;
}

/* Commands the sensor: at the first step, and when an entry of the exposure schedule begins. */
static void command_sensor(module *m, struct bst_step *s) {
    const bst_control_config *config = &m->control.config;
    const bst_control_exposure *schedule = config->exposure_schedule.items;
    double seconds = (double)bst_step_tick(s) / m->control.env.tick_rate_hz;
    int before = m->exposures_told;
    while (m->exposures_told < config->exposure_schedule.count &&
           schedule[m->exposures_told].time_s <= seconds) {
        m->exposures_told++;
    }
    if (m->sensor_told && m->exposures_told == before) {
        return;
    }
    bst_sensor_command *sensor = bst_step_write(s, PORT_SENSOR, NULL);
    *sensor = (bst_sensor_command){.exposure_s = m->exposures_told > 0
                                                     ? schedule[m->exposures_told - 1].exposure_s
                                                     : config->exposure_s,
                                   .period_s = config->period_s};
    assert(bst_sensor_command_is_valid(sensor));
    m->sensor_told = true;
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    bst_control *c = &m->control;
    bst_ctx *ctx = bst_step_ctx(s);
    int64_t tick = bst_step_tick(s);
    bst_control_telemetry(c, bst_step_latest(s, PORT_POINTING).payload,
                          bst_step_latest(s, PORT_NAV).payload);
    bst_guidance_telemetry(&c->guidance, bst_step_latest(s, PORT_MOUNT).payload);
    if (bst_knowledge_view_task(m->view, bst_step_latest(s, PORT_TASK).payload)) {
        bst_region region;
        bst_knowledge_view_region(m->view, &region);
        bst_control_retarget(c, tick, &region);
    }
    for (bst_sample next = bst_step_next(s, PORT_TRACKS); next.payload;
         next = bst_step_next(s, PORT_TRACKS)) {
        const bst_tracks *tracks = next.payload;
        bst_knowledge_view_set_clock(m->view, tracks->clock_offset_s, tracks->clock_sigma_s);
        BST_TRY(bst_control_observe(ctx, c, tick, tracks));
    }
    bool commanded;
    bst_los_command command;
    bst_control_status *status = bst_step_write(s, PORT_STATUS, NULL);
    BST_TRY(bst_control_update(ctx, c, tick, &commanded, &command, status));
    if (commanded) {
        bst_los_command *out = bst_step_write(s, PORT_COMMAND, NULL);
        *out = command;
        assert(bst_los_command_is_valid(out));
    }
    assert(bst_control_status_is_valid(status));
    command_sensor(m, s);
    for (int i = 0; i < c->transition_count; i++) {
        const bst_control_transition *t = &c->transitions[i];
        bst_step_event(s, "mode", "%s -> %s: %s", bst_mode_name(t->from), bst_mode_name(t->to),
                       t->reason);
    }
    c->transition_count = 0;
    for (int i = 0; i < c->guidance.event_count; i++) {
        char text[160];
        bst_guidance_describe(&c->guidance.events[i], text, sizeof text);
        bst_step_event(s, "guidance", "%s", text);
    }
    c->guidance.event_count = 0;
    return BST_OK;
}

static bst_status archive_control(void *self, bst_archive *archive) {
    module *m = self;
    const bst_control_config *config = &m->control.config;
    double set[2] = {config->exposure_s, config->period_s}; /* by the saved state's scenario */
    bst_knowledge_view_archive(m->view, archive);
    BST_ARCHIVE(archive, set);
    bst_archive_bool(archive, &m->sensor_told);
    const bool same = set[0] == config->exposure_s && set[1] == config->period_s;
    m->sensor_told = m->sensor_told && same;
    m->exposures_told = (int)bst_archive_integer(archive, m->exposures_told, 0,
                                                 m->control.config.exposure_schedule.count);
    return bst_control_archive(&m->control, archive);
}

const bst_module_desc bst_control_standard_module = {
    .abi = BST_MODULE_ABI,
    .role = "control",
    .type = "standard",
    .doc =
        "Slew to the cue, search, acquire, track, reacquire; or stare, or follow the cue open "
        "loop. Corrects the pointing by what the stars say.",
    .config = bst_control_config_table,
    .config_bytes = sizeof(bst_control_config),
    .default_rate_hz = 20.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step,
    .destroy = destroy,
    .archive = archive_control,
};
