/* The gimbals of types "azimuth_elevation" and "cross_elevation" in a simulation: where they point
 * by closed forms, what the telemetry says of it, and what an axis that is stuck leaves. */
#include "gimbal/modules.h"
#include "sim/engine/simulation.h"
#include "sim/world/world.h"
#include "tests/test_support.h"

enum { RATE = 6000 };

/* What the fake control asks for once, at tick 0; a tick below 0: nothing. */
static bst_los_command given;

typedef struct commander {
    bool written;
} commander;

static bst_status commander_create(const bst_module_env *env, const void *config, void **self) {
    (void)env;
    (void)config;
    *self = calloc(1, sizeof(commander));
    return *self ? BST_OK : BST_ERR_MEMORY;
}

static bst_status commander_step(void *self, struct bst_step *step) {
    commander *c = self;
    if (!c->written && given.tick >= 0) {
        c->written = true;
        *(bst_los_command *)bst_step_write(step, 0, NULL) = given;
    }
    return BST_OK;
}

static void commander_destroy(void *self) {
    free(self);
}

static const bst_config_desc commander_table[] = {BST_CONFIG_END};
static const bst_port commander_ports[] = {
    {.channel = BST_CHANNEL_LOS_COMMAND, .direction = BST_PORT_OUT}};
static const bst_module_desc commander_module = {.abi = BST_MODULE_ABI,
                                                 .role = "control",
                                                 .type = "commander",
                                                 .doc = "Writes one command.",
                                                 .config = commander_table,
                                                 .config_bytes = sizeof(commander),
                                                 .default_rate_hz = 10.0,
                                                 .ports = commander_ports,
                                                 .port_count = 1,
                                                 .create = commander_create,
                                                 .step = commander_step,
                                                 .destroy = commander_destroy};
static const bst_module_desc *const modules[] = {
    &bst_gimbal_azimuth_elevation_module, &bst_gimbal_cross_elevation_module, &commander_module,
    &bst_gimbal_second_order_module};
static const bst_scenario_registry registry = {.modules = modules, .count = 4};

typedef struct fixture {
    bst_ctx ctx;
    bst_scenario scenario;
    bst_simulation *simulation;
    bst_quat nominal; /* body from GCRF */
    bst_quat q_true, q_seen, q_body_seen;
    double axis_rad[2];
    bool settled;
    int sights, readings, statuses, navs;
    bst_mount_status status;
    bst_nav_telemetry nav;
    int stuck_events;
    int64_t stuck_tick;
    char text[200];
} fixture;

static bst_status look(void *user, const char *scope, const char *channel, const void *payload,
                       int64_t tick) {
    fixture *f = user;
    assert_string_equal(scope, "sat/cam");
    if (strcmp(channel, BST_CHANNEL_LOS_HISTORY) == 0) {
        const bst_los_history *h = payload;
        const bst_los_sample *sample = &h->items[(h->written - 1) % h->capacity];
        assert_int_equal(sample->tick, tick);
        f->q_true = sample->q_cam_from_gcrf;
        f->sights++;
    } else if (strcmp(channel, BST_CHANNEL_POINTING_TELEMETRY) == 0) {
        const bst_pointing_telemetry *t = payload;
        const bst_pointing_sample *sample = &t->items[(t->written - 1) % t->capacity];
        assert_int_equal(sample->tick, tick);
        f->q_seen = sample->q_cam_from_gcrf;
        f->q_body_seen = t->q_body_from_gcrf;
        memcpy(f->axis_rad, sample->axis_rad, sizeof f->axis_rad);
        f->settled = t->settled;
        f->readings++;
    } else if (strcmp(channel, BST_CHANNEL_MOUNT_STATUS) == 0) {
        f->status = *(const bst_mount_status *)payload;
        f->statuses++;
    } else if (strcmp(channel, BST_CHANNEL_NAV_TELEMETRY) == 0) {
        f->nav = *(const bst_nav_telemetry *)payload;
        f->navs++;
    }
    return BST_OK;
}

static bst_status hear(void *user, int64_t tick, const char *instance, const char *kind,
                       const char *text) {
    fixture *f = user;
    (void)instance;
    if (strcmp(kind, "axis") == 0) {
        f->stuck_events++;
        f->stuck_tick = tick;
        snprintf(f->text, sizeof f->text, "%s", text);
    }
    return BST_OK;
}

static void open_simulation(fixture *f, const char *type, const char *keys) {
    static const char format[] =
        "{\"boresight\": 1, \"epoch_utc\": \"2022-06-16T22:10:00Z\", \"duration_s\": 60, "
        "\"world\": {\"star_catalogue\": \"embedded\"}, \"observers\": [{\"name\": \"sat\", "
        "\"orbit\": {\"elements_file\": \"catalogue_2022-06.tle\", \"norad\": 39089}, \"sensors\": "
        "[{\"name\": \"cam\", \"camera\": {\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15}, "
        "\"cue\": {\"direction_radec_deg\": [123.4, -56.7]}, \"modules\": {\"control\": {\"type\": "
        "\"commander\"}, \"gimbal\": {\"type\": \"%s\", \"rate_hz\": 1000, %s}}}]}]}";
    char text[3000];
    snprintf(text, sizeof text, format, type, keys);
    memset(f, 0, sizeof *f);
    bst_json *json;
    bst_assert_ok(&f->ctx,
                  bst_json_parse(&f->ctx, "scenarios/test.json", text, strlen(text), &json));
    bst_assert_ok(&f->ctx, bst_scenario_read(&f->ctx, json, &registry, &f->scenario));
    bst_json_free(json);
    static const bst_simulation_options options = {0};
    bst_assert_ok(&f->ctx, bst_simulation_create(&f->ctx, &f->scenario, &options, &f->simulation));
    f->nominal = bst_world_body_attitude(bst_simulation_world(f->simulation), 0, 0);
    bst_engine_set_hooks(bst_simulation_engine(f->simulation),
                         &(bst_engine_hooks){.user = f, .message = look, .event = hear});
}

static void run(fixture *f, double seconds) {
    bst_assert_ok(&f->ctx, bst_engine_run(&f->ctx, bst_simulation_engine(f->simulation),
                                          (int64_t)(seconds * RATE)));
}

static void end(fixture *f) {
    bst_simulation_free(f->simulation);
    bst_scenario_free(&f->scenario);
}

static bst_vec3 boresight(bst_quat q_cam_from_gcrf) {
    return bst_quat_rotate(bst_quat_conj(q_cam_from_gcrf), (bst_vec3){0, 0, 1});
}

/* Boresight of the two geometries in body axes, by the definitions in mount_geometry.h. */
static bst_vec3 pointed(int type, double outer, double inner) {
    double so = sin(outer), co = cos(outer), si = sin(inner), ci = cos(inner);
    return type == 0 ? (bst_vec3){si, -ci * so, ci * co} : (bst_vec3){ci * so, -si, ci * co};
}

static const char *const types[] = {"azimuth_elevation", "cross_elevation", "second_order"};

#define BELIEFS                                                      \
    "\"platform\": {\"telemetry_rate_hz\": 50, \"nav_rate_hz\": 4, " \
    "\"attitude_bias_arcsec\": [40, -30, 20], \"drift_arcsec_per_s\": [1800, 3000, -2400]}"

/* The target stands at (25, -40) degrees in the frame of the body and moves along the outer axis'
 * circle at 0.2 deg/s; the spacecraft believes itself turned, and turns without knowing it. */
static void it_points_by_what_it_believes(void **state) {
    (void)state;
    for (int type = 0; type < 3; type++) { /* the last one has the second one's axes */
        fixture f;
        open_simulation(&f, types[type],
                        type < 2
                            ? BELIEFS
                            : "\"rate_limit_degps\": 8, \"encoder_noise_arcsec\": 0.05, " BELIEFS);
        const double outer = 25.0 * BST_DEG_RAD, inner = -40.0 * BST_DEG_RAD;
        const double rate = 0.2 * BST_DEG_RAD, seconds = 20.0;
        bst_vec3 d = pointed(type, outer, inner);
        bst_vec3 axis = type == 0 ? (bst_vec3){1, 0, 0} : (bst_vec3){0, 1, 0};
        bst_vec3 r = bst_vec3_scale(bst_vec3_cross(axis, d), rate);
        bst_quat back = bst_quat_conj(f.nominal);
        given = (bst_los_command){.direction_gcrf = bst_quat_rotate(back, d),
                                  .rate_gcrf_radps = bst_quat_rotate(back, r),
                                  .accel_gcrf_radps2 = bst_quat_rotate(
                                      back, bst_vec3_scale(bst_vec3_cross(axis, r), rate))};
        run(&f, seconds);
        assert_int_equal(f.sights, 20000);
        assert_int_equal(f.readings, 1000);
        assert_int_equal(f.statuses, 1000);
        assert_int_equal(f.navs, 80);
        assert_true(f.settled);
        /* the last telemetry at 19.98 s; a circle to second order is off by (0.0698 rad)^3 / 6 */
        double t = seconds - 1.0 / 50.0;
        bst_vec3 c = bst_vec3_unit(
            bst_vec3_axpy(bst_vec3_axpy(given.direction_gcrf, t, given.rate_gcrf_radps),
                          0.5 * t * t, given.accel_gcrf_radps2));
        /* encoders of 0.05 arcsec, and what the loop leaves of friction */
        assert_true(bst_vec3_angle(boresight(f.q_seen), c) < 2.0 * BST_ARCSEC_RAD);
        /* the angles are those by which the camera is turned in the body that telemetry believes */
        bst_vec3 by_axes = pointed(type, f.axis_rad[0], f.axis_rad[1]);
        bst_vec3 by_camera = bst_quat_rotate(f.q_body_seen, boresight(f.q_seen));
        assert_true(bst_vec3_angle(by_axes, by_camera) < 1e-12);
        bst_assert_close(f.status.axis[0].angle_rad, f.axis_rad[0], 1e-12);
        bst_assert_close(f.status.axis[1].angle_rad, f.axis_rad[1], 1e-12);
        assert_int_equal(f.status.tick, (int64_t)(t * RATE));
        /* about 29 and -40 degrees, but for 6 arcminutes by the cubic term and the bias */
        bst_assert_close(f.axis_rad[0], outer + rate * t, 0.1 * BST_DEG_RAD);
        bst_assert_close(f.axis_rad[1], inner, 0.1 * BST_DEG_RAD);
        bst_assert_close(f.status.axis[0].rate_radps, rate, 0.02 * rate);
        /* telemetry's body is turned from the nominal one by the bias: rounding */
        bst_vec3 off = bst_quat_to_rotvec(bst_quat_mul(f.q_body_seen, bst_quat_conj(f.nominal)));
        bst_assert_close(off.x / BST_ARCSEC_RAD, -40.0, 1e-6);
        bst_assert_close(off.y / BST_ARCSEC_RAD, 30.0, 1e-6);
        bst_assert_close(off.z / BST_ARCSEC_RAD, -20.0, 1e-6);
        /* the true one drifts instead, by 4 arcsec a step; the last sight is of 19.999 s */
        const bst_vec3 drift = {1800.0, 3000.0, -2400.0};
        bst_quat body = bst_quat_mul(
            bst_quat_from_rotvec(bst_vec3_scale(drift, -19.999 * BST_ARCSEC_RAD)), f.nominal);
        bst_vec3 by_mount = pointed(type, f.axis_rad[0] + 0.019 * rate, f.axis_rad[1]);
        bst_vec3 by_sight = bst_quat_rotate(body, boresight(f.q_true));
        assert_true(bst_vec3_angle(by_mount, by_sight) < 1.0 * BST_ARCSEC_RAD); /* encoders */
        end(&f);
    }
}

static void without_a_command_it_stays_at_its_start(void **state) {
    (void)state;
    for (int type = 0; type < 2; type++) {
        fixture f;
        open_simulation(&f, types[type], "\"start_deg\": [20, -35, 0]");
        given = (bst_los_command){.tick = -1}; /* none */
        run(&f, 3.0);
        bst_vec3 want = pointed(type, 20.0 * BST_DEG_RAD, -35.0 * BST_DEG_RAD);
        /* what friction and cables leave */
        assert_true(bst_vec3_angle(bst_quat_rotate(f.nominal, boresight(f.q_true)), want) <
                    2.0 * BST_ARCSEC_RAD);
        assert_false(f.settled);
        assert_int_equal(f.stuck_events, 0);
        assert_int_equal(f.navs, 30);
        assert_int_equal(f.readings, 300);
        end(&f);
    }
}

static void a_stuck_axis_is_told_once(void **state) {
    (void)state;
    static const char *const names[] = {"outer", "inner", "third"};
    for (int k = 0; k < 3; k++) {
        fixture f;
        char keys[200];
        snprintf(keys, sizeof keys,
                 "\"third_axis\": true, \"fault\": {\"stuck_axis\": \"%s\", \"stuck_from_s\": 1.5}",
                 names[k]);
        open_simulation(&f, types[k % 2], keys);
        /* all three have to move: with the outer one asked for elsewhere the third makes up */
        bst_vec3 d = pointed(k % 2, 20.0 * BST_DEG_RAD, 30.0 * BST_DEG_RAD);
        given = (bst_los_command){.direction_gcrf = bst_quat_rotate(bst_quat_conj(f.nominal), d),
                                  .near_given = true,
                                  .near_rad = {15.0 * BST_DEG_RAD, 30.0 * BST_DEG_RAD, 0.0}};
        run(&f, 8.0);
        char want[100];
        snprintf(want, sizeof want, "the %s axis is stuck: its motor pushes in vain", names[k]);
        assert_int_equal(f.stuck_events, 1);
        assert_string_equal(f.text, want);
        for (int a = 0; a < 3; a++) {
            assert_int_equal((f.status.axis[a].flags & BST_AXIS_STUCK) != 0, a == k);
        }
        end(&f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_points_by_what_it_believes),
        cmocka_unit_test(without_a_command_it_stays_at_its_start),
        cmocka_unit_test(a_stuck_axis_is_told_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
