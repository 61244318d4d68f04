#include <stdlib.h>
#include <string.h>

#include "gimbal/ideal.h"
#include "gimbal/modules.h"
#include "gimbal/nav.h"
#include "gimbal/platform.h"

enum { PORT_HISTORY, PORT_POINTING, PORT_NAV, PORT_MOUNT, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    [PORT_HISTORY] = {.channel = BST_CHANNEL_LOS_HISTORY,
                      .direction = BST_PORT_OUT,
                      .capacity = 4000},
    [PORT_POINTING] = {.channel = BST_CHANNEL_POINTING_TELEMETRY,
                       .direction = BST_PORT_OUT,
                       .capacity = 800},
    [PORT_NAV] = {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_OUT},
    [PORT_MOUNT] = {.channel = BST_CHANNEL_MOUNT_STATUS, .direction = BST_PORT_OUT},
};

enum { TARGET_OBJECT, TARGET_DIRECTION, TARGET_STAR };
static const char *const target_names[] = {"object", "direction", "star", NULL};

typedef struct config {
    int32_t target;
    char object[64];
    double ra_deg, dec_deg;
    double star_tyc[3];
    bst_platform_config platform;
} config;

static const bst_config_desc config_table[] = {
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
    bst_platform platform;
    bst_ideal ideal;
    bst_view *view;
    int target, observer, sensor, object;
    bst_vec3 icrs;
    bst_vec3 x_hint_gcrf; /* body x: the camera's x stays as near to it as can be */
    double dt_s;
    int64_t steps, telemetry_steps, nav_steps;
} module;

/* Apparent direction of the target at a grid node. */
static bst_status apparent(void *user, bst_ctx *ctx, double seconds, bst_vec3 *direction) {
    module *m = user;
    if (m->target == TARGET_OBJECT) {
        bst_sight sight;
        BST_TRY(bst_view_sight(ctx, m->view, m->observer, m->object, seconds, &sight));
        *direction = sight.apparent;
        return BST_OK;
    }
    bst_state state;
    bst_bodies bodies;
    BST_TRY(bst_view_observer_state(ctx, m->view, m->observer, seconds, &state));
    BST_TRY(bst_view_bodies(ctx, m->view, seconds, &bodies));
    bst_light light = bst_light_at(&bodies, state.position_m, state.velocity_mps);
    *direction = bst_light_apparent_star(&light, m->icrs);
    return BST_OK;
}

static bst_status find_target(const bst_module_env *env, const config *c, module *m) {
    m->target = c->target;
    if (c->target == TARGET_OBJECT) {
        m->object = bst_world_find_object(env->world, c->object);
        if (m->object < 0) {
            return bst_fail(env->ctx, BST_ERR_CONFIG,
                            "object: \"%s\" is no object of this scenario; give the name of one",
                            c->object);
        }
        return BST_OK;
    }
    if (c->target == TARGET_DIRECTION) {
        m->icrs = bst_vec3_from_radec(c->ra_deg * BST_DEG_RAD, c->dec_deg * BST_DEG_RAD);
        return BST_OK;
    }
    bst_star star;
    uint32_t id = bst_star_id_make((unsigned)c->star_tyc[0], (unsigned)c->star_tyc[1],
                                   (unsigned)c->star_tyc[2]);
    bst_time epoch = bst_world_time(env->world, 0.0);
    double year = 2000.0 + (epoch.jd1 - 2451545.0 + epoch.jd2) / 365.25;
    bst_status status = bst_stars_find(env->ctx, bst_world_stars(env->world), id, year, &star);
    if (status != BST_OK) {
        return bst_fail_prefix(env->ctx, status, "star_tyc");
    }
    m->icrs = star.icrs;
    return BST_OK;
}

static void destroy(void *self) {
    module *m = self;
    if (m) {
        bst_platform_free(&m->platform);
        bst_view_free(m->view);
        free(m);
    }
}

static bst_status prepare(const bst_module_env *env, const config *c, module *m) {
    const bst_platform_config *platform = &c->platform;
    bst_quat nominal = bst_world_body_attitude(env->world, env->observer, env->sensor);
    double pixel = bst_camera_scale_rad(bst_world_camera(env->world, env->observer, env->sensor));
    m->x_hint_gcrf = bst_quat_rotate(bst_quat_conj(nominal), (bst_vec3){1, 0, 0});
    BST_TRY(bst_platform_init(env->ctx, &m->platform, platform, nominal, pixel, m->dt_s,
                              bst_env_rng(env, "jitter"), bst_env_rng(env, "attitude")));
    BST_TRY(bst_platform_equip(env, &m->platform, platform, m->dt_s));
    BST_TRY(bst_platform_check_history(env->ctx, platform, env->exposure_s));
    BST_TRY(bst_platform_divider(env->ctx, "telemetry_rate_hz", 1.0 / m->dt_s,
                                 platform->telemetry_rate_hz, &m->telemetry_steps));
    BST_TRY(bst_platform_divider(env->ctx, "nav_rate_hz", 1.0 / m->dt_s, platform->nav_rate_hz,
                                 &m->nav_steps));
    BST_TRY(find_target(env, c, m));
    BST_TRY(bst_view_create(env->ctx, env->world, &m->view));
    bst_env_set_capacity(env, PORT_HISTORY, bst_platform_ring(platform->history_s, 1.0 / m->dt_s));
    bst_env_set_capacity(
        env, PORT_POINTING,
        bst_platform_ring(platform->telemetry_history_s, platform->telemetry_rate_hz));
    return BST_OK;
}

static bst_status create(const bst_module_env *env, const void *config_in, void **self) {
    if (env->period_ticks <= 0) {
        return bst_fail(env->ctx, BST_ERR_CONFIG, "a gimbal needs a rate: give rate_hz above zero");
    }
    module *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for a gimbal");
    }
    m->observer = env->observer;
    m->sensor = env->sensor;
    m->dt_s = (double)env->period_ticks / (double)env->tick_rate_hz;
    m->ideal = (bst_ideal){.direction_at = apparent, .user = m};
    bst_status status = prepare(env, config_in, m);
    if (status != BST_OK) {
        destroy(m);
        return status;
    }
    *self = m;
    return BST_OK;
}

static bst_status step(void *self, struct bst_step *s) {
    module *m = self;
    bst_ctx *ctx = bst_step_ctx(s);
    int64_t tick = bst_step_tick(s), n = m->steps++;
    double seconds = bst_step_seconds(s);
    bst_vec3 direction;
    BST_TRY(bst_ideal_at(&m->ideal, ctx, seconds, &direction));
    /* the ideal mount as seen from the nominal body, so that drift and jitter act as on a real one
     */
    bst_quat ideal = bst_quat_look(direction, m->x_hint_gcrf);
    bst_quat body = m->platform.q_nominal_from_gcrf;
    if (m->platform.spacecraft) { /* follows what is believed of the body */
        BST_TRY(bst_platform_step(s, &m->platform, n, (bst_vec3){0, 0, 0}));
        body = m->platform.q_believed_from_gcrf;
    }
    bst_quat q_cam_from_body = bst_quat_mul(ideal, bst_quat_conj(body));

    int capacity;
    bst_los_history *history = bst_step_write(s, PORT_HISTORY, &capacity);
    history->jitter_rad2 = m->platform.unresolved_rad2;
    bst_platform_append_los(history, capacity, tick,
                            bst_platform_true_camera(&m->platform, n, seconds, q_cam_from_body));
    if (n % m->telemetry_steps == 0) {
        bst_pointing_telemetry *telemetry = bst_step_write(s, PORT_POINTING, &capacity);
        bst_platform_append_exact(&m->platform, n, telemetry, capacity, tick, q_cam_from_body);
        bst_mount_status *mount = bst_step_write(s, PORT_MOUNT, NULL);
        *mount = (bst_mount_status){.tick = tick,
                                    .wheels_saturated = m->platform.wheels_saturated,
                                    .rate_body_radps = m->platform.rate_believed_radps,
                                    .q_body_from_cam_at_zero = BST_QUAT_IDENTITY,
                                    .q_body_from_gcrf = telemetry->q_body_from_gcrf};
    }
    if (n % m->nav_steps == 0) {
        bst_nav_telemetry *nav = bst_step_write(s, PORT_NAV, NULL);
        BST_TRY(bst_gimbal_nav(ctx, m->view, m->observer, m->sensor, tick, seconds, nav));
    }
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
    .config = config_table,
    .config_bytes = sizeof(config),
    .default_rate_hz = 1000.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step,
    .destroy = destroy,
};
