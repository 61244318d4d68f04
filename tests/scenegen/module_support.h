/* The module stepped by hand in a real world with the embedded stars: this header stands in for the
 * engine's side of the step interface. */
#ifndef BST_TESTS_SCENEGEN_MODULE_SUPPORT_H
#define BST_TESTS_SCENEGEN_MODULE_SUPPORT_H

#include <stdlib.h>

#include "scenegen/module.h"
#include "sim/device/device.h"
#include "sim/world/world.h"
#include "sim/world/world_config.h"
#include "tests/test_support.h"

enum { RATE = 1000, CAPACITY = 4096, SAMPLES = 600, SIDE = 512 };

struct bst_step {
    bst_ctx *ctx;
    bst_exposure *exposure; /* NULL once read */
    bst_los_history *history;
    bst_frame_message frame;
    bst_truth *truth;
    bool frame_written, truth_written;
    int saturated, overflow, capacity;
};

void bst_env_set_capacity(const bst_module_env *env, int port, int items) {
    struct bst_step *step = env->engine_private;
    assert_int_equal(port, 3);
    step->capacity = items;
    free(step->truth);
    step->truth = calloc(1, sizeof *step->truth + (size_t)items * sizeof *step->truth->items);
}
bst_ctx *bst_step_ctx(struct bst_step *step) {
    return step->ctx;
}
bst_sample bst_step_next(struct bst_step *step, int port) {
    assert_int_equal(port, 0);
    bst_sample sample = {.payload = step->exposure};
    step->exposure = NULL;
    return sample;
}
bst_sample bst_step_latest(struct bst_step *step, int port) {
    assert_int_equal(port, 1);
    return (bst_sample){.payload = step->history};
}
void *bst_step_write(struct bst_step *step, int port, int *capacity) {
    if (port == 2) {
        step->frame_written = true;
        return &step->frame;
    }
    step->truth_written = true;
    *capacity = step->capacity;
    return step->truth;
}
void bst_step_count(struct bst_step *step, const char *what) {
    step->saturated += strcmp(what, "saturated") == 0;
    step->overflow += strcmp(what, "truth_overflow") == 0;
}

/* A world with one observer in an orbit like NEOSSat's and a sensor by its block. */
static inline bst_world *make_world(bst_ctx *ctx, const char *text) {
    bst_observer_config observer = {.name = "obs"};
    bst_sensor_config sensor = {0};
    bst_world_config world = {0};
    bst_json *json;
    bst_assert_ok(ctx, bst_json_parse(ctx, "test", text, strlen(text), &json));
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
    bst_world *out;
    bst_assert_ok(
        ctx, bst_world_create(ctx, "test", &world, &observers, "tests/scenegen/data", epoch, &out));
    bst_config_free(bst_world_config_table, &world);
    bst_config_free(bst_sensor_config_table, &sensor);
    return out;
}

static inline bst_los_history *make_history(void) {
    bst_los_history *h = calloc(1, sizeof *h + SAMPLES * sizeof *h->items);
    double ra = 56.75 * BST_DEG_RAD, dec = 24.12 * BST_DEG_RAD; /* the Pleiades */
    bst_vec3 boresight = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)};
    bst_quat q0 = bst_quat_look(boresight, (bst_vec3){0, 0, 1});
    h->capacity = SAMPLES;
    h->written = SAMPLES;
    for (int k = 0; k < SAMPLES; k++) {
        /* 10 px in half a second */
        bst_vec3 turn = {0.0, 20.0 * 12.0 * BST_ARCSEC_RAD * k / RATE, 0.0};
        h->items[k] = (bst_los_sample){k, bst_quat_mul(bst_quat_from_rotvec(turn), q0)};
    }
    return h;
}

#endif
