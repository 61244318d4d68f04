/* Steps of one gimbal module without an engine, for tests of its archive function: the messages
 * that it has published, its events and the step that it requests. */
#ifndef BST_TESTS_GIMBAL_FAKE_STEPS_H
#define BST_TESTS_GIMBAL_FAKE_STEPS_H

#include <stdarg.h>

#include "gimbal/platform_step.h"
#include "sim/onboard/knowledge.h"
#include "tests/archive_support.h"
#include "tests/world/world_support.h"

enum { STEPS_RATE = 6000, STEPS_PERIOD = 6 };

/* One instance with what surrounds it; the functions below stand in for the engine's. */
typedef struct bst_step {
    bst_ctx ctx;
    const bst_module_desc *desc;
    void *self;
    int64_t tick, wake;      /* wake: of the requested step, 0: none */
    bst_los_command command; /* of this step; without one its tick is below 0 */
    int capacity[BST_GIMBAL_PORTS];
    unsigned char *message[BST_GIMBAL_PORTS]; /* [bytes] */
    size_t bytes[BST_GIMBAL_PORTS];
    char log[4000]; /* events and counts, one a line */
} bst_step;

bst_ctx *bst_step_ctx(bst_step *step) {
    return &step->ctx;
}

int64_t bst_step_tick(const bst_step *step) {
    return step->tick;
}

double bst_step_seconds(const bst_step *step) {
    return (double)step->tick / STEPS_RATE;
}

bst_sample bst_step_latest(bst_step *step, int port) {
    assert_true(port >= BST_GIMBAL_PORTS);
    return (bst_sample){.payload = step->command.tick >= 0 ? &step->command : NULL};
}

bst_sample bst_step_next(bst_step *step, int port) {
    return bst_step_latest(step, port);
}

void *bst_step_write(bst_step *step, int port, int *capacity) {
    assert_in_range(port, 0, BST_GIMBAL_PORTS - 1);
    if (capacity) {
        *capacity = step->capacity[port];
    }
    return step->message[port];
}

void bst_step_wake_at(bst_step *step, int64_t tick) {
    step->wake = tick > step->tick ? tick : 0;
}

static void write_log(bst_step *step, const char *kind, const char *text) {
    size_t used = strlen(step->log);
    snprintf(step->log + used, sizeof step->log - used, "%lld %s %s\n", (long long)step->tick, kind,
             text);
}

void bst_step_event(bst_step *step, const char *kind, const char *format, ...) {
    char text[400];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    write_log(step, kind, text);
}

void bst_step_count(bst_step *step, const char *what) {
    write_log(step, "count", what);
}

void bst_env_set_capacity(const bst_module_env *env, int port, int items) {
    assert_in_range(port, 0, BST_GIMBAL_PORTS - 1);
    ((bst_step *)env->engine_private)->capacity[port] = items;
}

bool bst_env_writes(const bst_module_env *env, int port) {
    (void)env;
    (void)port;
    return true;
}

void bst_env_ignore(const bst_module_env *env, int port) {
    (void)env;
    (void)port;
}

static void allocate_messages(bst_step *s) {
    s->bytes[BST_GIMBAL_HISTORY] =
        sizeof(bst_los_history) + (size_t)s->capacity[BST_GIMBAL_HISTORY] * sizeof(bst_los_sample);
    s->bytes[BST_GIMBAL_POINTING] =
        sizeof(bst_pointing_telemetry) +
        (size_t)s->capacity[BST_GIMBAL_POINTING] * sizeof(bst_pointing_sample);
    s->bytes[BST_GIMBAL_NAV] = sizeof(bst_nav_telemetry);
    s->bytes[BST_GIMBAL_MOUNT] = sizeof(bst_mount_status);
    s->bytes[BST_GIMBAL_WHEELS] =
        sizeof(bst_wheel_status) + (size_t)s->capacity[BST_GIMBAL_WHEELS] * sizeof(bst_wheel_state);
    for (int port = 0; port < BST_GIMBAL_PORTS; port++) {
        s->message[port] = calloc(1, s->bytes[port]);
        assert_non_null(s->message[port]);
    }
}

/* What instances are made of; config: filled, as long as they live. */
typedef struct fake_scene {
    const bst_module_desc *desc;
    const void *config;
    const bst_world *world;
    const bst_knowledge *knowledge;
} fake_scene;

static bst_step *fake_create(const fake_scene *scene) {
    bst_step *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->desc = scene->desc;
    bst_module_env env = {.ctx = &s->ctx,
                          .instance = "sat/cam/gimbal",
                          .tick_rate_hz = STEPS_RATE,
                          .period_ticks = STEPS_PERIOD,
                          .seed = 11,
                          .run = 2,
                          .world = scene->world,
                          .knowledge = scene->knowledge,
                          .engine_private = s};
    bst_assert_ok(&s->ctx, scene->desc->create(&env, scene->config, &s->self));
    allocate_messages(s);
    return s;
}

static void fake_free(bst_step *s) {
    s->desc->destroy(s->self);
    for (int port = 0; port < BST_GIMBAL_PORTS; port++) {
        free(s->message[port]);
    }
    free(s);
}

#endif
