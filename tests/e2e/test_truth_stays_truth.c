/* Overwriting the truth that modules could read changes nothing that the onboard side says
 * or does: detections, tracks and commands stay the same to the byte. The same saboteur on the
 * detections changes tracks and commands, so the comparison can see a difference. */
#include <stdlib.h>

#include "sim/app/app.h"
#include "sim/engine/simulation.h"
#include "tests/test_support.h"

#define SCENARIO "scenarios/neossat_geo_track.json"
#define DURATION_S "45"

static bst_status saboteur_create(const bst_module_env *env, const void *config, void **self) {
    (void)config;
    int64_t *overwritten = calloc(1, sizeof *overwritten);
    if (!overwritten) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory");
    }
    *self = overwritten;
    return BST_OK;
}

/* Another number for every byte and message; items are overwritten in place, their number stays
 * within the room there is. */
static void fill_with_garbage(void *bytes, size_t count, uint32_t seed) {
    unsigned char *p = bytes;
    for (size_t i = 0; i < count; i++) {
        seed = seed * 1664525u + 1013904223u; /* Numerical Recipes' generator */
        p[i] = (unsigned char)(seed >> 24);
    }
}

static bst_status spoil_truth(void *self, struct bst_step *step) {
    int64_t *overwritten = self;
    bst_truth *truth = bst_step_modify(step, 0);
    if (truth) {
        int32_t count = truth->count;
        fill_with_garbage(truth, sizeof *truth + (size_t)count * sizeof truth->items[0],
                          (uint32_t)++ * overwritten);
        truth->count = count;
        bst_step_count(step, "sabotage");
    }
    return BST_OK;
}

/* Moves everything that was found by 30 px. */
static bst_status spoil_detections(void *self, struct bst_step *step) {
    (void)self;
    bst_detections *detections = bst_step_modify(step, 0);
    if (detections) {
        for (int32_t i = 0; i < detections->count; i++) {
            detections->items[i].x_px += 30.0;
        }
        bst_step_count(step, "sabotage");
    }
    return BST_OK;
}

static const bst_config_desc no_config[] = {BST_CONFIG_END};
static const bst_port truth_port[] = {
    {BST_CHANNEL_TRUTH, BST_PORT_MODIFY, BST_PORT_TRIGGER, 0.0, 0}};
static const bst_port detections_port[] = {
    {BST_CHANNEL_DETECTIONS, BST_PORT_MODIFY, BST_PORT_TRIGGER, 0.0, 0}};

static const bst_module_desc spoils_truth = {.abi = BST_MODULE_ABI,
                                             .role = "saboteur",
                                             .type = "truth",
                                             .doc = "Overwrites the truth.",
                                             .config = no_config,
                                             .ports = truth_port,
                                             .port_count = 1,
                                             .create = saboteur_create,
                                             .step = spoil_truth,
                                             .destroy = free};
static const bst_module_desc spoils_detections = {.abi = BST_MODULE_ABI,
                                                  .role = "saboteur",
                                                  .type = "detections",
                                                  .doc = "Moves the detections.",
                                                  .config = no_config,
                                                  .ports = detections_port,
                                                  .port_count = 1,
                                                  .create = saboteur_create,
                                                  .step = spoil_detections,
                                                  .destroy = free};

/* What went over the onboard channels: number of messages and a hash of their bytes, without the
 * padding of the structs. */
typedef struct traffic {
    int64_t messages;
    uint64_t hash;
} traffic;

enum { DETECTIONS, TRACKS, LOS_COMMAND, SENSOR_COMMAND, WATCHED };

typedef struct record {
    traffic channels[WATCHED];
    int64_t items; /* detections and tracks in all */
    int final_mode;
    int64_t sabotages;
} record;

/* FNV-1a, 64 bit. */
static void hash_bytes(traffic *t, const void *bytes, size_t count) {
    const unsigned char *p = bytes;
    for (size_t i = 0; i < count; i++) {
        t->hash = (t->hash ^ p[i]) * 0x100000001B3u;
    }
}

/* The members from `first` to `last`, between which the struct has no padding. */
#define HASH_SPAN(t, s, first, last)         \
    hash_bytes(t, (const char *)&(s)->first, \
               (size_t)((const char *)&(s)->last - (const char *)&(s)->first) + sizeof(s)->last)

static void hash_detections(record *r, const bst_detections *d) {
    traffic *t = &r->channels[DETECTIONS];
    HASH_SPAN(t, d, exposure_id, lost);
    for (int32_t i = 0; i < d->count; i++) {
        HASH_SPAN(t, &d->items[i], x_px, label);
    }
    r->items += d->count;
}

static void hash_tracks(record *r, const bst_tracks *k) {
    traffic *t = &r->channels[TRACKS];
    HASH_SPAN(t, k, exposure_id, tick);
    HASH_SPAN(t, k, attitude.valid, attitude.valid);
    HASH_SPAN(t, k, attitude.stars, attitude.stars);
    HASH_SPAN(t, k, attitude.tick, attitude.rms_px);
    HASH_SPAN(t, k, target_id, lost);
    for (int32_t i = 0; i < k->count; i++) {
        HASH_SPAN(t, &k->items[i], id, target_of_interest);
        HASH_SPAN(t, &k->items[i], direction_gcrf, y_px);
    }
    r->items += k->count;
}

static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    (void)scope;
    record *r = user;
    int which = -1;
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        which = DETECTIONS;
        hash_detections(r, payload);
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        which = TRACKS;
        hash_tracks(r, payload);
    } else if (strcmp(channel, BST_CHANNEL_LOS_COMMAND) == 0) {
        which = LOS_COMMAND;
        const bst_los_command *c = payload;
        HASH_SPAN(&r->channels[which], c, tick, rate_gcrf_radps);
    } else if (strcmp(channel, BST_CHANNEL_SENSOR_COMMAND) == 0) {
        which = SENSOR_COMMAND;
        const bst_sensor_command *c = payload;
        HASH_SPAN(&r->channels[which], c, exposure_s, binning);
    } else if (strcmp(channel, BST_CHANNEL_CONTROL_STATUS) == 0) {
        r->final_mode = ((const bst_control_status *)payload)->mode;
    }
    if (which >= 0) {
        r->channels[which].messages++;
        hash_bytes(&r->channels[which], &tick, sizeof tick);
    }
    return BST_OK;
}

/* Runs the main scenario with the saboteur of that type, or without one (NULL). */
static record run_with(const char *saboteur) {
    enum { MOST = 64 };
    const bst_module_desc *modules[MOST];
    const bst_scenario_registry *shipped = bst_registry_shipped();
    assert_true(shipped->count + 2 <= MOST);
    memcpy(modules, shipped->modules, (size_t)shipped->count * sizeof *modules);
    modules[shipped->count] = &spoils_truth;
    modules[shipped->count + 1] = &spoils_detections;
    const bst_scenario_registry registry = {.modules = modules, .count = shipped->count + 2};

    record r = {0};
    for (int i = 0; i < WATCHED; i++) {
        r.channels[i].hash = 0xCBF29CE484222325u;
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_simulation *sim = NULL;
    bst_assert_ok(&ctx, bst_json_load(&ctx, SCENARIO, &json));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/world/star_catalogue=embedded"));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/duration_s=" DURATION_S));
    if (saboteur) {
        char set[128];
        snprintf(set, sizeof set, "/observers/0/sensors/0/modules/saboteur={\"type\": \"%s\"}",
                 saboteur);
        bst_assert_ok(&ctx, bst_json_set(&ctx, json, set));
    }
    bst_assert_ok(&ctx, bst_scenario_read(&ctx, json, &registry, &scenario));
    const bst_simulation_options options = {.threads = 1};
    bst_assert_ok(&ctx, bst_simulation_create(&ctx, &scenario, &options, &sim));
    bst_engine *engine = bst_simulation_engine(sim);
    const bst_engine_hooks hooks = {.user = &r, .message = on_message};
    bst_engine_set_hooks(engine, &hooks);
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, scenario.duration_ticks));
    const char *name;
    int64_t count;
    for (int i = 0; bst_engine_counter(engine, i, &name, &count); i++) {
        if (strcmp(name, "sabotage") == 0) {
            r.sabotages = count;
        }
    }
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return r;
}

static void test_truth_is_not_read_onboard(void **state) {
    (void)state;
    record plain = run_with(NULL), spoiled = run_with("truth");
    assert_int_equal(spoiled.sabotages, 45); /* one frame a second */
    assert_int_equal(plain.final_mode, BST_MODE_TRACK);
    assert_int_equal(spoiled.final_mode, BST_MODE_TRACK);
    assert_true(plain.items > 45);
    for (int i = 0; i < WATCHED; i++) {
        assert_true(plain.channels[i].messages > 0);
        assert_int_equal(plain.channels[i].messages, spoiled.channels[i].messages);
        assert_true(plain.channels[i].hash == spoiled.channels[i].hash);
    }
}

static void test_the_comparison_sees_a_difference(void **state) {
    (void)state;
    record plain = run_with(NULL), spoiled = run_with("detections");
    assert_int_equal(spoiled.sabotages, 45);
    assert_true(plain.channels[TRACKS].hash != spoiled.channels[TRACKS].hash);
    assert_true(plain.channels[LOS_COMMAND].hash != spoiled.channels[LOS_COMMAND].hash);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_truth_is_not_read_onboard),
        cmocka_unit_test(test_the_comparison_sees_a_difference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
