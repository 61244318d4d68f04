#include <stdlib.h>

#include "gimbal/modules.h"
#include "gimbal/nav.h"
#include "gimbal/two_axis.h"

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
    bst_two_axis plant;
    bst_view *view;
    int observer, sensor;
    double tick_rate_hz;
    int64_t telemetry_steps, nav_steps;
} module;

static void destroy(void *self) {
    module *m = self;
    if (m) {
        bst_platform_free(&m->plant.platform);
        bst_view_free(m->view);
        free(m);
    }
}

static bst_status create(const bst_module_env *env, const void *config_in, void **self) {
    const bst_two_axis_config *config = config_in;
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
    double dt = (double)env->period_ticks / m->tick_rate_hz;
    const bst_platform_config *platform = &config->platform;
    bst_two_axis_keys keys = {bst_env_rng(env, "jitter"), bst_env_rng(env, "attitude"),
                              bst_env_rng(env, "encoder")};
    bst_quat nominal = bst_world_body_attitude(env->world, env->observer, env->sensor);
    double pixel = bst_camera_scale_rad(bst_world_camera(env->world, env->observer, env->sensor));
    bst_status status = bst_two_axis_init(env->ctx, &m->plant, config, nominal, pixel, dt, &keys);
    if (status == BST_OK) {
        status = bst_platform_equip(env, &m->plant.platform, platform, dt);
    }
    if (status == BST_OK) {
        status = bst_platform_check_history(env->ctx, platform, env->exposure_s);
    }
    if (status == BST_OK) {
        status = bst_platform_divider(env->ctx, "telemetry_rate_hz", 1.0 / dt,
                                      platform->telemetry_rate_hz, &m->telemetry_steps);
    }
    if (status == BST_OK) {
        status = bst_platform_divider(env->ctx, "nav_rate_hz", 1.0 / dt, platform->nav_rate_hz,
                                      &m->nav_steps);
    }
    if (status == BST_OK) {
        status = bst_view_create(env->ctx, env->world, &m->view);
    }
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    bst_env_set_capacity(env, PORT_HISTORY, bst_platform_ring(platform->history_s, 1.0 / dt));
    bst_env_set_capacity(
        env, PORT_POINTING,
        bst_platform_ring(platform->telemetry_history_s, platform->telemetry_rate_hz));
    *self = m;
    return BST_OK;
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    int64_t tick = bst_step_tick(s), n = m->plant.steps;
    bst_sample sample = bst_step_latest(s, PORT_COMMAND);
    const bst_los_command *command = sample.payload;
    double age = command ? (double)(tick - command->tick) / m->tick_rate_hz : 0.0;
    bool measure = n % m->telemetry_steps == 0;
    if (m->plant.platform.spacecraft) { /* without reaction: a mount of this type has no inertia */
        BST_TRY(bst_platform_step(s, &m->plant.platform, n, (bst_vec3){0, 0, 0}));
    }
    bst_two_axis_step(&m->plant, command, age, measure);

    int capacity;
    bst_los_history *history = bst_step_write(s, PORT_HISTORY, &capacity);
    history->jitter_rad2 = m->plant.platform.unresolved_rad2;
    bst_platform_append_los(history, capacity, tick, m->plant.q_cam_from_gcrf);
    if (measure) {
        bst_pointing_telemetry *telemetry = bst_step_write(s, PORT_POINTING, &capacity);
        bst_platform_append_pointing(telemetry, capacity, tick, m->plant.q_measured_from_gcrf,
                                     m->plant.encoder_rad, m->plant.q_measured_body_from_gcrf,
                                     m->plant.settled, m->plant.limited);
        bst_two_axis_status(&m->plant, tick, bst_step_write(s, PORT_MOUNT, NULL));
    }
    if (n % m->nav_steps == 0) {
        bst_nav_telemetry *nav = bst_step_write(s, PORT_NAV, NULL);
        BST_TRY(bst_gimbal_nav(bst_step_ctx(s), m->view, m->observer, m->sensor, tick,
                               bst_step_seconds(s), nav));
    }
    return BST_OK;
}

const bst_module_desc bst_gimbal_second_order_module = {
    .abi = BST_MODULE_ABI,
    .role = "gimbal",
    .type = "second_order",
    .also = "two_axis",
    .doc =
        "Two-axis gimbal with rate and acceleration limits and a second-order servo, on a "
        "drifting, jittering spacecraft.",
    .flags = BST_MODULE_READS_TRUTH,
    .config = bst_two_axis_config_table,
    .config_bytes = sizeof(bst_two_axis_config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step,
    .destroy = destroy,
};
