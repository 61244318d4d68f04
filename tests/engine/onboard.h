/* What tests of onboard modules in the real engine share: a world with one sensor that looks at the
 * Pleiades, its onboard knowledge, and fake writers of telemetry. */
#ifndef BST_TESTS_ENGINE_ONBOARD_H
#define BST_TESTS_ENGINE_ONBOARD_H

#include "sim/onboard/knowledge.h"
#include "sim/world/world_config.h"
#include "tests/engine/fake_module.h"

enum { ONBOARD_RATE = 1000, ONBOARD_SIDE = 512, ONBOARD_STARS = 400 };

typedef struct onboard_star {
    uint32_t id;
    double x_px, y_px, v_mag;
} onboard_star;

typedef struct onboard {
    bst_ctx ctx;
    bst_world *world;
    bst_knowledge *knowledge;
    bst_quat q_true, q_telemetry; /* camera from GCRF; constant */
    bst_nav_telemetry nav;
    onboard_star stars[ONBOARD_STARS]; /* on the frame at q_true */
    int star_count;
    bst_engine *engine;
    fake pointing, navigation;
    fake *pointing_p, *navigation_p;
} onboard;

static inline void onboard_make_world(onboard *o) {
    bst_ctx *ctx = &o->ctx;
    bst_observer_config observer = {.name = "o"};
    bst_sensor_config sensor = {0};
    bst_world_config world = {0};
    bst_json *json;
    const char text[] =
        "{\"name\": \"s\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
        "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 1e6},"
        "\"cue\": {\"direction_radec_deg\": [56.75, 24.12]}}";
    bst_assert_ok(ctx, bst_json_parse(ctx, "test", text, sizeof text - 1, &json));
    bst_assert_ok(
        ctx, bst_config_read(ctx, json, bst_json_root(json), "", bst_sensor_config_table, &sensor));
    bst_json_free(json);
    bst_assert_ok(ctx, bst_config_defaults(ctx, bst_world_config_table, &world));
    snprintf(world.star_catalogue, sizeof world.star_catalogue, "embedded");
    snprintf(observer.orbit.elements_file, sizeof observer.orbit.elements_file, "observer.tle");
    observer.orbit.norad = 39089;
    observer.sensors = (bst_config_list){&sensor, 1};
    bst_config_list observers = {&observer, 1};
    bst_time epoch;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &epoch));
    bst_assert_ok(ctx, bst_world_create(ctx, "test", &world, &observers, "tests/scenegen/data",
                                        epoch, &o->world));
    bst_config_free(bst_world_config_table, &world);
    bst_config_free(bst_sensor_config_table, &sensor);
    bst_assert_ok(ctx, bst_knowledge_create(ctx, o->world, 0, 0, &o->knowledge));
}

/* Apparent places of the onboard catalogue's stars.
 */
static inline void onboard_find_stars(onboard *o) {
    static bst_star found[4096];
    const bst_camera *camera = bst_knowledge_camera(o->knowledge);
    bst_vec3 boresight = bst_quat_rotate(bst_quat_conj(o->q_true), (bst_vec3){0, 0, 1});
    int count = 0;
    bst_assert_ok(
        &o->ctx,
        bst_stars_query(&o->ctx, bst_knowledge_stars(o->knowledge), boresight, 2.0 * BST_DEG_RAD,
                        INFINITY, bst_knowledge_julian_year(o->knowledge), found, 4096, &count));
    assert_true(count <= 4096);
    bst_light light = {o->nav.velocity_bary_mps, o->nav.sun_m};
    o->star_count = 0;
    for (int i = 0; i < count; i++) {
        onboard_star star = {.id = found[i].id, .v_mag = (double)found[i].v_mag};
        bst_vec3 apparent = bst_light_apparent_star(&light, found[i].icrs);
        if (bst_camera_project(camera, bst_quat_rotate(o->q_true, apparent), &star.x_px,
                               &star.y_px) &&
            star.x_px > 10 && star.y_px > 10 && star.x_px < ONBOARD_SIDE - 11 &&
            star.y_px < ONBOARD_SIDE - 11) {
            assert_true(o->star_count < ONBOARD_STARS);
            o->stars[o->star_count++] = star;
        }
    }
}

/* Without a value: a sample of telemetry at every step; value > 0: until that tick. */
static inline bst_status onboard_write_pointing(fake *self, struct bst_step *step) {
    const onboard *o = self->other;
    int64_t tick = bst_step_tick(step);
    if (self->value > 0 && tick > self->value) {
        return BST_OK;
    }
    int capacity;
    bst_pointing_telemetry *t = bst_step_write(step, 0, &capacity);
    t->capacity = capacity;
    t->settled = true;
    t->q_body_from_gcrf = o->q_telemetry;
    t->items[t->written++ % capacity] =
        (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = o->q_telemetry};
    return BST_OK;
}

static inline bst_status onboard_write_nav(fake *self, struct bst_step *step) {
    const onboard *o = self->other;
    int64_t tick = bst_step_tick(step);
    if (self->value > 0 && tick > self->value) {
        return BST_OK;
    }
    bst_nav_telemetry *nav = bst_step_write(step, 0, NULL);
    *nav = o->nav;
    nav->tick = tick;
    return BST_OK;
}

static const bst_port onboard_pointing_ports[] = {
    {.channel = BST_CHANNEL_POINTING_TELEMETRY, .direction = BST_PORT_OUT, .capacity = 64}};
static const bst_port onboard_nav_ports[] = {
    {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_OUT}};
static const bst_module_desc onboard_pointing_desc = FAKE_DESC(onboard_pointing_ports);
static const bst_module_desc onboard_nav_desc = FAKE_DESC(onboard_nav_ports);

/* The world and an engine with both writers of telemetry at 10 Hz; first_* is the tick of their
 * first message. */
static inline void onboard_init(onboard *o) {
    memset(o, 0, sizeof *o);
    onboard_make_world(o);
    o->q_true = o->q_telemetry = bst_knowledge_body_attitude(o->knowledge);
    o->nav = (bst_nav_telemetry){.velocity_bary_mps = {-21000, 19000, 11000},
                                 .sun_m = {-0.2e11, 1.4e11, 0.3e11}};
    onboard_find_stars(o);
    assert_true(o->star_count >= 20);
    o->engine = fake_engine(&o->ctx, ONBOARD_RATE);
    o->pointing = (fake){.on_step = onboard_write_pointing, .other = o};
    o->navigation = (fake){.on_step = onboard_write_nav, .other = o};
    o->pointing_p = &o->pointing;
    o->navigation_p = &o->navigation;
}

static inline void onboard_add_telemetry(onboard *o, int64_t first_pointing, int64_t first_nav) {
    bst_instance_spec spec = FAKE_SPEC(onboard_pointing_desc, "pointing", o->pointing_p, 100);
    spec.offset_ticks = first_pointing;
    fake_add(&o->ctx, o->engine, spec);
    spec = FAKE_SPEC(onboard_nav_desc, "nav", o->navigation_p, 100);
    spec.offset_ticks = first_nav;
    fake_add(&o->ctx, o->engine, spec);
}

/* The telemetry's error e: q_true = rotvec(e) q_telemetry. */
static inline void onboard_set_error(onboard *o, bst_vec3 error_cam_rad) {
    bst_quat back = bst_quat_from_rotvec(bst_vec3_scale(error_cam_rad, -1.0));
    o->q_telemetry = bst_quat_unit(bst_quat_mul(back, o->q_true));
}

static inline void onboard_free(onboard *o) {
    bst_engine_free(o->engine);
    bst_knowledge_free(o->knowledge);
    bst_world_free(o->world);
}

#endif
