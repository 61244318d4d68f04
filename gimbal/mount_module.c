#include <stdlib.h>

#include "gimbal/modules.h"
#include "gimbal/mount.h"
#include "gimbal/nav.h"

enum { PORT_COMMAND, PORT_HISTORY, PORT_POINTING, PORT_NAV, PORT_MOUNT, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    [PORT_COMMAND] = {.channel = BST_CHANNEL_LOS_COMMAND,
                      .direction = BST_PORT_IN,
                      .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
    [PORT_HISTORY] = {.channel = BST_CHANNEL_LOS_HISTORY,
                      .direction = BST_PORT_OUT,
                      .capacity = 4000},
    [PORT_POINTING] = {.channel = BST_CHANNEL_POINTING_TELEMETRY,
                       .direction = BST_PORT_OUT,
                       .capacity = 800},
    [PORT_NAV] = {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_OUT},
    [PORT_MOUNT] = {.channel = BST_CHANNEL_MOUNT_STATUS, .direction = BST_PORT_OUT},
};

typedef struct module {
    bst_mount mount;
    bst_platform platform;
    bst_view *view;
    int observer, sensor;
    double dt_s, tick_rate_hz;
    int64_t telemetry_steps, nav_steps;
} module;

static void destroy(void *self) {
    module *m = self;
    if (m) {
        bst_platform_free(&m->platform);
        bst_view_free(m->view);
        free(m);
    }
}

static bst_status prepare(const bst_module_env *env, int type, const bst_mount_config *c,
                          module *m) {
    const bst_platform_config *platform = &c->platform;
    bst_quat nominal = bst_world_body_attitude(env->world, env->observer, env->sensor);
    double pixel = bst_camera_scale_rad(bst_world_camera(env->world, env->observer, env->sensor));
    BST_TRY(bst_platform_init(env->ctx, &m->platform, platform, nominal, pixel, m->dt_s,
                              bst_env_rng(env, "jitter"), bst_env_rng(env, "attitude")));
    BST_TRY(bst_mount_init(env->ctx, &m->mount, type, c, m->dt_s, bst_env_rng(env, "encoder")));
    BST_TRY(bst_platform_equip(env, &m->platform, platform, m->dt_s));
    m->mount.want_reaction = m->platform.spacecraft != NULL;
    double inertia[6], zero[BST_MOUNT_MOST] = {0.0};
    bst_chain_locked_inertia(&m->mount.joints.chain, zero, inertia);
    BST_TRY(bst_platform_check_mount(env->ctx, &m->platform, inertia));
    BST_TRY(bst_platform_check_history(env->ctx, platform, env->exposure_s));
    BST_TRY(bst_platform_divider(env->ctx, "telemetry_rate_hz", 1.0 / m->dt_s,
                                 platform->telemetry_rate_hz, &m->telemetry_steps));
    BST_TRY(bst_platform_divider(env->ctx, "nav_rate_hz", 1.0 / m->dt_s, platform->nav_rate_hz,
                                 &m->nav_steps));
    BST_TRY(bst_view_create(env->ctx, env->world, &m->view));
    bst_env_set_capacity(env, PORT_HISTORY, bst_platform_ring(platform->history_s, 1.0 / m->dt_s));
    bst_env_set_capacity(
        env, PORT_POINTING,
        bst_platform_ring(platform->telemetry_history_s, platform->telemetry_rate_hz));
    return BST_OK;
}

static bst_status create(const bst_module_env *env, int type, const bst_mount_config *config,
                         void **self) {
    if (env->period_ticks <= 0) {
        return bst_fail(env->ctx, BST_ERR_CONFIG, "a gimbal needs a rate: give rate_hz above zero");
    }
    module *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for a gimbal");
    }
    m->observer = env->observer;
    m->sensor = env->sensor;
    m->tick_rate_hz = (double)env->tick_rate_hz;
    m->dt_s = (double)env->period_ticks / m->tick_rate_hz;
    bst_status status = prepare(env, type, config, m);
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    *self = m;
    return BST_OK;
}

static bst_status create_azimuth(const bst_module_env *env, const void *config, void **self) {
    return create(env, BST_MOUNT_AZIMUTH_ELEVATION, config, self);
}

static bst_status create_cross(const bst_module_env *env, const void *config, void **self) {
    return create(env, BST_MOUNT_CROSS_ELEVATION, config, self);
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    bst_mount *mount = &m->mount;
    int64_t tick = bst_step_tick(s), n = mount->steps;
    bst_sample sample = bst_step_latest(s, PORT_COMMAND);
    const bst_los_command *command = sample.payload;
    double age = command ? (double)(tick - command->tick) / m->tick_rate_hz : 0.0;
    bool measure = n % m->telemetry_steps == 0;
    if (m->platform.spacecraft) {
        BST_TRY(bst_platform_step(s, &m->platform, n, mount->reaction_nm));
    }
    bst_mount_body body = {.rate_radps = m->platform.body.rate_radps,
                           .q_believed_from_gcrf = m->platform.q_believed_from_gcrf,
                           .believed_rate_radps = m->platform.rate_believed_radps};
    bst_mount_step(mount, &body, command, age, measure);

    int capacity;
    bst_los_history *history = bst_step_write(s, PORT_HISTORY, &capacity);
    history->jitter_rad2 = m->platform.unresolved_rad2;
    bst_platform_append_los(
        history, capacity, tick,
        bst_platform_true_camera(&m->platform, n, (double)n * m->dt_s, mount->q_cam_from_body));
    if (measure) {
        bst_pointing_telemetry *telemetry = bst_step_write(s, PORT_POINTING, &capacity);
        bst_quat seen = bst_platform_measured_body(&m->platform, n);
        double axis_rad[2] = {mount->servo[0].reading_rad, mount->servo[1].reading_rad};
        bst_platform_append_pointing(telemetry, capacity, tick,
                                     bst_quat_unit(bst_quat_mul(mount->q_seen_from_body, seen)),
                                     axis_rad, seen, mount->settled, mount->limited);
        bst_mount_status *status = bst_step_write(s, PORT_MOUNT, NULL);
        bst_mount_status_of(mount, tick, status);
        status->q_body_from_gcrf = seen;
        status->rate_body_radps = m->platform.rate_believed_radps;
        status->wheels_saturated = m->platform.wheels_saturated;
    }
    if (n % m->nav_steps == 0) {
        bst_nav_telemetry *nav = bst_step_write(s, PORT_NAV, NULL);
        BST_TRY(bst_gimbal_nav(bst_step_ctx(s), m->view, m->observer, m->sensor, tick,
                               bst_step_seconds(s), nav));
    }
    return BST_OK;
}

const bst_module_desc bst_gimbal_azimuth_elevation_module = {
    .abi = BST_MODULE_ABI,
    .role = "gimbal",
    .type = "azimuth_elevation",
    .doc =
        "Azimuth axis along body +x, elevation on it, perhaps a third axis: dynamics with "
        "friction, cables, stops and flexible modes, encoders and servos.",
    .flags = BST_MODULE_READS_TRUTH,
    .config = bst_mount_config_table,
    .config_bytes = sizeof(bst_mount_config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create_azimuth,
    .step = step,
    .destroy = destroy,
};

const bst_module_desc bst_gimbal_cross_elevation_module = {
    .abi = BST_MODULE_ABI,
    .role = "gimbal",
    .type = "cross_elevation",
    .doc =
        "Outer axis along body y, cross-elevation on it, perhaps a third axis; otherwise as "
        "azimuth_elevation.",
    .flags = BST_MODULE_READS_TRUTH,
    .config = bst_mount_config_table,
    .config_bytes = sizeof(bst_mount_config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create_cross,
    .step = step,
    .destroy = destroy,
};
