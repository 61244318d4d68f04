/* Two spacecraft and a catalogue of five objects, for tests of the tasking. */
#ifndef BST_TESTS_CONTROL_TASKING_FIXTURE_H
#define BST_TESTS_CONTROL_TASKING_FIXTURE_H

#include "control/tasking/tasking_internal.h"
#include "sim/onboard/knowledge.h"
#include "tests/world/world_support.h"

#define FILE_ "\"elements_file\": \"scenarios/catalogue_2022-06.tle\""
#define SENSORS_ "\"sensors\": [{" TEST_CAMERA "}]"

enum { NEOSSAT_OBJECT, GX5, ISS, MOLNIYA, GPS };

/* Two spacecraft: NEOSSat, and one 300 km from GX5; the five objects of the catalogue. */
static const char world_text[] =
    "{\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": [{" FILE_
    "}], \"objects\": []}, \"observers\": [{\"name\": \"low\", \"orbit\": {" FILE_
    ", \"norad\": 39089}, " SENSORS_
    "}, {\"name\": \"high\", \"orbit\": {\"source\": \"relative\", \"reference\": \"INMARSAT "
    "GX5\", "
    "\"offset_rtn_m\": [%s]}, " SENSORS_ "}]}";

typedef struct fixture {
    bst_ctx ctx;
    bst_world *world;
    bst_knowledge *knowledge[2];
    bst_fleet_member members[2];
    bst_tasking_config config;
    bst_tasking tasking;
} fixture;

static inline void set_up_in(fixture *f, bst_world *world, const char *config) {
    *f = (fixture){.world = world};
    bst_json *json;
    bst_assert_ok(&f->ctx, bst_json_parse(&f->ctx, "test", config, strlen(config), &json));
    bst_assert_ok(&f->ctx, bst_config_read(&f->ctx, json, bst_json_root(json), "",
                                           bst_tasking_config_table, &f->config));
    bst_json_free(json);
    for (int i = 0; i < 2; i++) {
        bst_assert_ok(&f->ctx, bst_knowledge_create(&f->ctx, f->world, i, 0, &f->knowledge[i]));
        f->members[i] = (bst_fleet_member){.scope = i ? "high/camera" : "low/camera",
                                           .observer = i,
                                           .knowledge = f->knowledge[i],
                                           .frame_exposure_s = 0.5,
                                           .frame_period_s = 2.0};
    }
}

static inline void set_up(fixture *f, const char *config) {
    char text[2048];
    snprintf(text, sizeof text, world_text, "-200000, -300000, 50000");
    set_up_in(f, test_world(text), config);
}

static inline void tear_down(fixture *f) {
    bst_tasking_free(&f->tasking);
    bst_config_free(bst_tasking_config_table, &f->config);
    bst_knowledge_free(f->knowledge[0]);
    bst_knowledge_free(f->knowledge[1]);
    bst_world_free(f->world);
}

static inline void start(fixture *f, const char *config) {
    set_up(f, config);
    bst_assert_ok(&f->ctx, bst_tasking_init(&f->ctx, &f->tasking, &f->config, f->members, 2, 10.0));
}

/* Publishes a sensor's position. */
static inline void tell_place(fixture *f, int sensor, double seconds) {
    bst_world_state eye;
    bst_bodies bodies;
    bst_assert_ok(&f->ctx, bst_knowledge_eye_at(&f->ctx, f->tasking.sensors[sensor].view, seconds,
                                                &eye, &bodies));
    bst_nav_telemetry nav = {.tick = (int64_t)(10.0 * seconds),
                             .position_gcrf_m = eye.position_m,
                             .velocity_gcrf_mps = eye.velocity_mps,
                             .sun_m = bst_vec3_sub(bodies.sun_m, eye.position_m),
                             .moon_m = bst_vec3_sub(bodies.moon_m, eye.position_m)};
    bst_tasking_telemetry(&f->tasking, sensor, &nav, NULL);
}

static inline bool plan(fixture *f, int sensor, int64_t tick) {
    bool given;
    tell_place(f, sensor, (double)tick / 10.0);
    bst_assert_ok(&f->ctx, bst_tasking_plan(&f->ctx, &f->tasking, sensor, tick, &given));
    return given;
}

#endif
