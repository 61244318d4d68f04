#include <assert.h>
#include <string.h>

#include "gimbal/ideal.h"
#include "gimbal/modules.h"
#include "gimbal/platform_step.h"
#include "sim/messages/message_invariants.h"

static const bst_port ports[BST_GIMBAL_PORTS] = {BST_GIMBAL_PORTS_ALL};

static const char *const target_names[] = {"object", "direction", "star", NULL};

typedef bst_ideal_config config;

const bst_config_desc bst_ideal_config_table[] = {
    BST_ENUM(config, target, target_names, "\"object\"", "What the boresight is kept on."),
    BST_STRING(config, object, "\"\"", "target object: its name in the scenario."),
    BST_REAL(config, ra_deg, "deg", -360, 360, "0", "target direction: ICRS right ascension."),
    BST_REAL(config, dec_deg, "deg", -90, 90, "0", "target direction: ICRS declination."),
    BST_REALS(config, star_tyc, "", 0, 12121, "[0, 0, 0]",
              "target star: the three numbers of its Tycho-2 identity."),
    BST_OBJECT(config, platform, bst_platform_config_table, "{}",
               "The spacecraft: drift and jitter on top of the ideal pointing, telemetry."),
    BST_CONFIG_END};

typedef struct module {
    bst_gimbal_base base;
    bst_platform platform;
    bst_ideal ideal;
    int target, object;
    bst_vec3 icrs;
    bst_vec3 x_hint_gcrf; /* body x in GCRF: the camera's x is kept as close to it as possible */
    int64_t steps;
} module;

/* Apparent direction of the target at a grid node. */
static bst_status apparent(void *user, bst_ctx *ctx, double seconds, bst_vec3 *direction) {
    module *m = user;
    bst_world_view *view = m->base.view;
    if (m->target == BST_IDEAL_OBJECT) {
        bst_world_sight sight;
        BST_TRY(bst_world_view_sight(ctx, view, m->base.observer, m->object, seconds, &sight));
        *direction = sight.apparent;
        return BST_OK;
    }
    bst_world_state state;
    bst_bodies bodies;
    BST_TRY(bst_world_view_observer_state(ctx, view, m->base.observer, seconds, &state));
    BST_TRY(bst_world_view_bodies(ctx, view, seconds, &bodies));
    bst_light light = bst_light_at(&bodies, state.position_m, state.velocity_mps);
    *direction = bst_light_apparent_star(&light, m->icrs);
    return BST_OK;
}

/* Resolves the target of the configuration: object, direction or star. */
static bst_status find_target(const bst_module_env *env, const config *c, module *m) {
    m->target = c->target;
    if (c->target == BST_IDEAL_OBJECT) {
        m->object = bst_world_find_object(env->world, c->object);
        if (m->object < 0) {
            return bst_fail(env->ctx, BST_ERR_CONFIG,
                            "object: \"%s\" is no object of this scenario; give the name of one",
                            c->object);
        }
        return BST_OK;
    }
    if (c->target == BST_IDEAL_DIRECTION) {
        m->icrs = bst_vec3_from_radec(c->ra_deg * BST_DEG_RAD, c->dec_deg * BST_DEG_RAD);
        return BST_OK;
    }
    bst_star star;
    uint32_t id = bst_star_id_make((unsigned)c->star_tyc[0], (unsigned)c->star_tyc[1],
                                   (unsigned)c->star_tyc[2]);
    bst_time epoch = bst_world_time(env->world, 0.0);
    double year = 2000.0 + (epoch.jd1 - 2451545.0 + epoch.jd2) / 365.25;
    bst_bodies bodies;
    bst_bodies_at(epoch, &bodies);
    const bst_star_epoch seen = {year, bodies.sun_m};
    bst_status status =
        bst_stars_find_seen(env->ctx, bst_world_stars(env->world), id, &seen, &star);
    if (status != BST_OK) {
        return bst_fail_prefix(env->ctx, status, "star_tyc");
    }
    m->icrs = star.icrs;
    return BST_OK;
}

static bst_status prepare_ideal(const bst_module_env *env, const void *config_in, void *self) {
    const config *c = config_in;
    module *m = self;
    m->ideal = (bst_ideal){.direction_at = apparent, .user = m};
    m->x_hint_gcrf = bst_quat_rotate(bst_quat_conj(bst_gimbal_nominal(env)), (bst_vec3){1, 0, 0});
    BST_TRY(bst_gimbal_platform_init(env, &c->platform, &m->base, &m->platform));
    BST_TRY(bst_platform_equip(env, &m->platform, &c->platform, m->base.dt_s));
    BST_TRY(find_target(env, c, m));
    return bst_gimbal_base_init(env, &c->platform, env->exposure_s, 0, &m->base);
}

static bst_status create_ideal(const bst_module_env *env, const void *config_in, void **self) {
    return bst_gimbal_create(env, sizeof(module), prepare_ideal, bst_gimbal_destroy, config_in,
                             self);
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    int64_t n = m->steps++;
    double seconds = bst_step_seconds(s);
    bst_vec3 direction;
    BST_TRY(bst_ideal_at(&m->ideal, bst_step_ctx(s), seconds, &direction));
    /* ideal pointing relative to the nominal body, so that drift and jitter act as on a real mount
     */
    bst_quat ideal = bst_quat_look(direction, m->x_hint_gcrf);
    bst_quat body = m->platform.q_nominal_from_gcrf;
    if (m->platform.spacecraft) { /* uses the estimated body attitude */
        BST_TRY(bst_platform_step(s, &m->platform, n, (bst_vec3){0, 0, 0}, NULL));
        body = m->platform.q_believed_from_gcrf;
    }
    bst_quat q_cam_from_body = bst_quat_mul(ideal, bst_quat_conj(body));
    bst_gimbal_publish_sight(s, &m->platform,
                             bst_platform_true_camera(&m->platform, n, seconds, q_cam_from_body));
    if (n % m->base.telemetry_steps == 0) {
        bst_gimbal_reading reading = bst_gimbal_exact(&m->platform, n, q_cam_from_body);
        bst_mount_status *status = bst_step_write(s, BST_GIMBAL_MOUNT, NULL);
        *status = (bst_mount_status){.tick = bst_step_tick(s),
                                     .q_body_from_cam_at_zero = BST_QUAT_IDENTITY};
        bst_gimbal_publish_reading(s, &m->platform, &reading, status);
        assert(bst_mount_status_is_valid(status));
    }
    return bst_gimbal_publish_nav(s, &m->base, n);
}

static bst_status archive_module(void *self, bst_archive *archive) {
    module *m = self;
    m->steps = bst_archive_integer(archive, m->steps, 0, BST_PLANT_STEPS_MOST);
    bst_ideal_archive(&m->ideal, archive);
    bst_platform_archive(&m->platform, archive);
    return BST_OK;
}

const bst_module_desc bst_gimbal_ideal_module = {
    .abi = BST_MODULE_ABI,
    .role = "gimbal",
    .type = "ideal",
    .doc =
        "Keeps the boresight exactly on the true apparent place of an object, a direction or a "
        "star; drift and jitter, where configured, come on top.",
    .flags = BST_MODULE_READS_TRUTH,
    .config = bst_ideal_config_table,
    .config_bytes = sizeof(config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = BST_GIMBAL_PORTS,
    .create = create_ideal,
    .step = step,
    .destroy = bst_gimbal_destroy,
    .archive = archive_module,
};
