/* A controller that keeps the boresight on one catalogue direction: a whole module of one's own.
 *
 *   cc -shared -fPIC stare_at.c $(pkg-config --cflags --libs boresight) -o stare_at.so
 *
 * and in a scenario, beside it:
 *
 *   "control": {"plugin": "stare_at.so", "ra_deg": 252.36, "dec_deg": -8.82}
 */
#include <stdlib.h>

#include <boresight/light.h>
#include <boresight/module.h>

/* 1. The configuration: a struct and a table that fills it from the scenario. */
typedef struct stare_at_config {
    double ra_deg, dec_deg;
    double command_latency_s;
} stare_at_config;

static const bst_config_desc config_table[] = {
    BST_REAL(stare_at_config, ra_deg, "deg", -360, 360, NULL, "Right ascension (ICRS)."),
    BST_REAL(stare_at_config, dec_deg, "deg", -90, 90, NULL, "Declination (ICRS)."),
    BST_REAL(stare_at_config, command_latency_s, "s", 0, 60, "0",
             "Time from a command's publication to its effect."),
    BST_CONFIG_END};

/* 2. The ports: what is read and written. Their numbers are used in step. */
enum { PORT_NAV, PORT_COMMAND, PORT_STATUS, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    [PORT_NAV] = {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_IN, .max_age_s = 1.0},
    [PORT_COMMAND] = {.channel = BST_CHANNEL_LOS_COMMAND, .direction = BST_PORT_OUT},
    [PORT_STATUS] = {.channel = BST_CHANNEL_CONTROL_STATUS, .direction = BST_PORT_OUT},
};

/* 3. The state: everything that the module remembers. */
typedef struct stare_at {
    bst_vec3 icrs;
    int64_t latency_ticks;
} stare_at;

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    const stare_at_config *c = config;
    stare_at *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for a controller");
    }
    m->icrs = bst_vec3_from_radec(c->ra_deg * BST_DEG_RAD, c->dec_deg * BST_DEG_RAD);
    m->latency_ticks = (int64_t)(c->command_latency_s * (double)env->tick_rate_hz + 0.5);
    *self = m;
    return BST_OK;
}

static bst_status step(void *self, struct bst_step *s) {
    const stare_at *m = self;
    bst_sample sample = bst_step_latest(s, PORT_NAV);
    if (!sample.payload || sample.stale) {
        bst_step_count(s, "stare_at_no_navigation"); /* appears in the manifest */
        return BST_OK;
    }
    const bst_nav_telemetry *nav = sample.payload;
    bst_light light = {.velocity_mps = nav->velocity_bary_mps, .sun_m = nav->sun_m};
    bst_los_command *command = bst_step_write(s, PORT_COMMAND, NULL);
    *command = (bst_los_command){.tick = bst_step_tick(s) + m->latency_ticks,
                                 .direction_gcrf = bst_light_apparent_star(&light, m->icrs)};
    bst_control_status *status = bst_step_write(s, PORT_STATUS, NULL);
    *status = (bst_control_status){.tick = bst_step_tick(s), .mode = BST_MODE_STARE};
    return BST_OK;
}

/* What a saved simulation contains of it: nothing, as no step changes the state. */
static bst_status archive(void *self, bst_archive *saved) {
    return (void)self, (void)saved, BST_OK;
}

static void destroy(void *self) {
    free(self);
}

/* 4. The descriptor. */
static const bst_module_desc stare_at_module = {
    .abi = BST_MODULE_ABI,
    .role = "control",
    .type = "stare_at",
    .doc = "Keeps the boresight on one catalogue direction.",
    .config = config_table,
    .config_bytes = sizeof(stare_at_config),
    .default_rate_hz = 10.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step,
    .destroy = destroy,
    .archive = archive,
};

/* 5. What the program looks for in a plug-in. */
extern const bst_module_desc *const bst_plugin_modules[];
const bst_module_desc *const bst_plugin_modules[] = {&stare_at_module, NULL};
