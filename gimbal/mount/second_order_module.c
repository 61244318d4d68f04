#include <assert.h>
#include <stdlib.h>

#include "gimbal/modules.h"
#include "gimbal/mount/second_order.h"
#include "gimbal/platform_step.h"
#include "sim/messages/message_invariants.h"

enum { PORT_COMMAND = BST_GIMBAL_PORTS, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    BST_GIMBAL_PORTS_ALL,
    [PORT_COMMAND] = {.channel = BST_CHANNEL_LOS_COMMAND,
                      .direction = BST_PORT_IN,
                      .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
};

typedef struct module {
    bst_gimbal_base base;
    bst_mount_two_axis plant;
} module;

static bst_status prepare(const bst_module_env *env, const void *config, void *self) {
    const bst_mount_two_axis_config *c = config;
    module *m = self;
    const bst_mount_two_axis_keys keys = {bst_env_rng(env, "jitter"), bst_env_rng(env, "attitude"),
                                          bst_env_rng(env, "encoder")};
    m->base.platform = &m->plant.platform;
    BST_TRY(bst_mount_two_axis_init(env->ctx, &m->plant, c, bst_gimbal_nominal(env),
                                    bst_gimbal_pixel_rad(env), m->base.dt_s, &keys));
    BST_TRY(bst_platform_equip(env, &m->plant.platform, &c->platform, m->base.dt_s));
    return bst_gimbal_base_init(env, &c->platform, env->exposure_s, 0, &m->base);
}

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    return bst_gimbal_create(env, sizeof(module), prepare, bst_gimbal_destroy, config, self);
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    bst_mount_two_axis *plant = &m->plant;
    int64_t n = plant->steps;
    double age;
    const bst_los_command *command = bst_gimbal_command(s, PORT_COMMAND, &m->base, &age);
    bool measure = n % m->base.telemetry_steps == 0;
    if (plant->platform.spacecraft) { /* without reaction torque: this mount type has no inertia */
        BST_TRY(bst_platform_step(s, &plant->platform, n, (bst_vec3){0, 0, 0}, command));
    }
    bst_mount_two_axis_step(plant, command, age, measure);
    bst_gimbal_publish_sight(s, &plant->platform, plant->q_cam_from_gcrf);
    if (measure) {
        const bst_gimbal_reading reading = {
            .q_cam_from_gcrf = plant->q_measured_from_gcrf,
            .q_body_from_gcrf = plant->q_measured_body_from_gcrf,
            .axis_rad = {plant->encoder_rad[0], plant->encoder_rad[1]},
            .settled = plant->settled,
            .limited = plant->limited};
        bst_mount_status *status = bst_step_write(s, BST_GIMBAL_MOUNT, NULL);
        bst_mount_two_axis_status(plant, bst_step_tick(s), status);
        bst_gimbal_publish_reading(s, &plant->platform, &reading, NULL);
        assert(bst_mount_status_is_valid(status));
    }
    return bst_gimbal_publish_nav(s, &m->base, n);
}

static bst_status archive_module(void *self, bst_archive *archive) {
    module *m = self;
    bst_mount_two_axis_archive(&m->plant, archive);
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
    .config_bytes = sizeof(bst_mount_two_axis_config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step,
    .destroy = bst_gimbal_destroy,
    .archive = archive_module,
};
