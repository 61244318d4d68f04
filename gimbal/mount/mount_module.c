#include <assert.h>

#include "gimbal/modules.h"
#include "gimbal/mount/mount.h"
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
    bst_mount mount;
    bst_platform platform;
    bool stuck[BST_MOUNT_MOST]; /* as last reported */
} module;

static bst_status prepare(const bst_module_env *env, int type, const bst_mount_config *c,
                          module *m) {
    double dt = m->base.dt_s, inertia[6], zero[BST_MOUNT_MOST] = {0.0};
    BST_TRY(bst_gimbal_platform_init(env, &c->platform, &m->base, &m->platform));
    BST_TRY(bst_mount_init(env->ctx, &m->mount, type, c, dt, bst_env_rng(env, "encoder")));
    BST_TRY(bst_platform_equip(env, &m->platform, &c->platform, dt));
    m->mount.want_reaction = m->platform.spacecraft != NULL;
    bst_mount_chain_locked_inertia(&m->mount.joints.chain, zero, inertia);
    BST_TRY(bst_platform_check_mount(env->ctx, &m->platform, inertia));
    return bst_gimbal_base_init(env, &c->platform, env->exposure_s, 0, &m->base);
}

static bst_status prepare_azimuth(const bst_module_env *env, const void *config, void *self) {
    return prepare(env, BST_MOUNT_AZIMUTH_ELEVATION, config, self);
}

static bst_status prepare_cross(const bst_module_env *env, const void *config, void *self) {
    return prepare(env, BST_MOUNT_CROSS_ELEVATION, config, self);
}

static bst_status create_azimuth(const bst_module_env *env, const void *config, void **self) {
    return bst_gimbal_create(env, sizeof(module), prepare_azimuth, bst_gimbal_destroy, config,
                             self);
}

static bst_status create_cross(const bst_module_env *env, const void *config, void **self) {
    return bst_gimbal_create(env, sizeof(module), prepare_cross, bst_gimbal_destroy, config, self);
}

/* Reports axes that have become stuck, or free again. */
static void report_stuck(module *m, struct bst_step *s) {
    static const char *const names[] = {"outer", "inner", "third"};
    for (int k = 0; k < BST_MOUNT_MOST; k++) {
        bool stuck = m->mount.servo[k].stuck;
        if (stuck != m->stuck[k]) {
            m->stuck[k] = stuck;
            bst_step_event(s, "axis",
                           stuck ? "the %s axis is stuck: its motor pushes in vain"
                                 : "the %s axis moves again",
                           names[k]);
            if (stuck) {
                bst_step_count(s, "axis_stuck");
            }
        }
    }
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    bst_mount *mount = &m->mount;
    int64_t n = mount->steps;
    double age;
    const bst_los_command *command = bst_gimbal_command(s, PORT_COMMAND, &m->base, &age);
    bool measure = n % m->base.telemetry_steps == 0;
    if (m->platform.spacecraft) {
        BST_TRY(bst_platform_step(s, &m->platform, n, mount->reaction_nm, command));
    }
    bst_mount_body body = {.rate_radps = m->platform.body.rate_radps,
                           .q_believed_from_gcrf = m->platform.q_believed_from_gcrf,
                           .believed_rate_radps = m->platform.rate_believed_radps};
    bst_mount_step(mount, &body, command, age, measure);
    for (int k = 0; k < mount->axes; k++) {
        BST_TRY(bst_compensator_plug_status(bst_step_ctx(s), &mount->servo[k].compensator));
    }
    report_stuck(m, s);
    bst_gimbal_publish_sight(s, &m->platform,
                             bst_platform_true_camera(&m->platform, n, (double)n * m->base.dt_s,
                                                      mount->q_cam_from_body));
    if (measure) {
        bst_quat seen = bst_platform_measured_body(&m->platform, n);
        const bst_gimbal_reading reading = {
            .q_cam_from_gcrf = bst_quat_unit(bst_quat_mul(mount->q_seen_from_body, seen)),
            .q_body_from_gcrf = seen,
            .axis_rad = {mount->servo[0].reading_rad, mount->servo[1].reading_rad},
            .settled = mount->settled,
            .limited = mount->limited};
        bst_mount_status *status = bst_step_write(s, BST_GIMBAL_MOUNT, NULL);
        bst_mount_status_of(mount, bst_step_tick(s), status);
        bst_gimbal_publish_reading(s, &m->platform, &reading, status);
        assert(bst_mount_status_is_valid(status));
    }
    return bst_gimbal_publish_nav(s, &m->base, n);
}

static bst_status archive_module(void *self, bst_archive *archive) {
    module *m = self;
    bst_platform_archive(&m->platform, archive);
    BST_TRY(bst_mount_archive(&m->mount, archive));
    for (int k = 0; k < BST_MOUNT_MOST; k++) {
        bst_archive_bool(archive, &m->stuck[k]);
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
    .destroy = bst_gimbal_destroy,
    .archive = archive_module,
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
    .destroy = bst_gimbal_destroy,
    .archive = archive_module,
};
