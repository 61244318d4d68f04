#include <math.h>
#include <stdlib.h>

#include "gimbal/modules.h"
#include "gimbal/platform_step.h"
#include "gimbal/scripted.h"

enum { PORT_COUNT = BST_GIMBAL_MOUNT }; /* no mount, and so no mount status */
static const bst_port ports[PORT_COUNT] = {BST_GIMBAL_PORTS_SEEN};

static const char *const missing_names[] = {"error", "hold", NULL};

typedef struct config {
    int32_t missing_frames; /* bst_scripted_missing */
    bst_platform_config platform;
} config;

static const bst_config_desc config_table[] = {
    BST_ENUM(config, missing_frames, missing_names, "\"error\"",
             "What frames without a pointing before the file's last one mean: an error, or that "
             "the line of sight stays where the frame before ended."),
    BST_OBJECT(config, platform, bst_platform_config_table, "{}",
               "The spacecraft: drift and jitter on top of the file's pointing, telemetry."),
    BST_CONFIG_END};

typedef struct module {
    bst_gimbal_base base;
    bst_platform platform;
    bst_scripted *scripted;
    bst_frame_cursor frame, first_frame; /* frame: the first that has not ended */
    int64_t period_ticks;
    int64_t origin_tick; /* of the first step; -1: not started */
} module;

static void destroy(void *self) {
    module *m = self;
    if (m) {
        bst_scripted_free(m->scripted);
    }
    bst_gimbal_destroy(m);
}

static bst_status prepare_scripted(const bst_module_env *env, const void *config_in, void *self) {
    const config *c = config_in;
    module *m = self;
    const bst_platform_config *platform = &c->platform;
    const bst_camera *camera = bst_world_camera(env->world, env->observer, env->sensor);
    const bst_exposure_config *exposure =
        bst_world_exposure(env->world, env->observer, env->sensor);
    const bst_frame_updates *updates =
        bst_world_frame_updates(env->world, env->observer, env->sensor);
    if (!updates) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "the gimbal \"scripted\" needs its sensor's frame_updates_file");
    }
    m->period_ticks = env->period_ticks;
    m->origin_tick = -1;
    double longest_s, cycle_s;
    bst_frame_updates_limits(updates, camera, exposure, &longest_s, &cycle_s);
    BST_TRY(bst_gimbal_platform_init(env, platform, &m->base, &m->platform));
    if (bst_platform_check_history(env->ctx, platform, longest_s) != BST_OK) {
        return bst_fail_prefix(env->ctx, BST_ERR_CONFIG, "with the exposures of %s",
                               bst_frame_updates_name(updates));
    }
    if (platform->spacecraft.type != BST_CRAFT_INERTIAL) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "platform/spacecraft/type: the file of a scripted line of sight says where "
                        "the camera points, whatever the body does; leave it \"inertial\"");
    }
    BST_TRY(bst_scripted_create(env->ctx, updates, camera, exposure, env->tick_rate_hz,
                                (bst_scripted_missing)c->missing_frames, &m->scripted));
    m->frame = m->first_frame =
        bst_frame_cursor_begin(updates, camera, exposure, m->base.tick_rate_hz);
    /* besides the plant steps: two samples per frame, and up to two per attitude of the file */
    int crowd = bst_scripted_crowd(m->scripted, platform->history_s * m->base.tick_rate_hz);
    double frames = 2.0 * platform->history_s / cycle_s + 4.0;
    return bst_gimbal_base_init(env, platform, longest_s, 2 * crowd + (int)fmin(frames, 1e7),
                                &m->base);
}

static bst_status create_scripted(const bst_module_env *env, const void *config_in, void **self) {
    return bst_gimbal_create(env, sizeof(module), prepare_scripted, destroy, config_in, self);
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    int64_t tick = bst_step_tick(s);
    m->origin_tick = m->origin_tick < 0 ? tick : m->origin_tick;
    int64_t since = tick > m->origin_tick ? tick - m->origin_tick : 0;
    int64_t n = since / m->period_ticks, past = since % m->period_ticks;
    bst_quat q_cam_from_body = bst_quat_mul(bst_scripted_at(m->scripted, tick),
                                            bst_quat_conj(m->platform.q_nominal_from_gcrf));
    bst_gimbal_publish_sight(
        s, &m->platform,
        bst_platform_true_camera_between(&m->platform, n, (double)past / (double)m->period_ticks,
                                         bst_step_seconds(s), q_cam_from_body));
    /* an additional sample at rate changes and at the ends of each exposure, so that interpolation
     * between samples reproduces the file */
    int64_t next = bst_scripted_next(m->scripted, tick);
    while (m->frame.start_tick + m->frame.exposure_ticks <= tick) {
        bst_frame_cursor_next(&m->frame);
    }
    int64_t edge = m->frame.start_tick > tick ? m->frame.start_tick
                                              : m->frame.start_tick + m->frame.exposure_ticks;
    bst_step_wake_at(s, next < edge ? next : edge);
    if (past != 0) {
        return BST_OK;
    }
    return bst_gimbal_publish_exact(s, &m->platform, &m->base, n, q_cam_from_body);
}

/* The look-up positions in the file are not archived: the next step finds them from its tick. */
static bst_status archive_module(void *self, bst_archive *archive) {
    module *m = self;
    m->frame = bst_archive_is_restoring(archive) ? m->first_frame : m->frame;
    m->origin_tick = bst_archive_integer(archive, m->origin_tick, -1, INT64_MAX / 4);
    bst_platform_archive(&m->platform, archive);
    return BST_OK;
}

const bst_module_desc bst_gimbal_scripted_module = {
    .abi = BST_MODULE_ABI,
    .role = "gimbal",
    .type = "scripted",
    .doc =
        "Keeps the camera in the attitudes that the sensor's frame_updates_file gives frame by "
        "frame; drift and jitter, where configured, come on top.",
    .flags = BST_MODULE_READS_TRUTH,
    .config = config_table,
    .config_bytes = sizeof(config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create_scripted,
    .step = step,
    .destroy = destroy,
    .archive = archive_module,
};
