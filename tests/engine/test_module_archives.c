/* Modules of whole scenarios, each of which is replaced, between two of its steps, by a new
 * instance that is restored from its saved state: every message and event stays the same to the
 * bit. The old instance is freed first, so that nothing can refer to it. */
#include <stdlib.h>

#include "sim/engine/simulation.h"
#include "sim/registry/registry.h"
#include "tests/archive_support.h"

enum { MOST_MODULES = 32, MOST_CHANNELS = 64, SLOTS = 4096 };

/* ---- modules that are replaced ---- */

typedef struct replaced {
    const bst_module_desc *desc;
    bst_module_env env;
    const void *config;
    void *self;
    int64_t steps;
} replaced;

/* True: modules are replaced. Number of replacements so far. */
static bool replaces;
static int replacements;

static const bst_module_desc *shipped[MOST_MODULES];
static bst_module_desc wrapped[MOST_MODULES];
static const bst_module_desc *wrapped_list[MOST_MODULES];

static bst_status create_wrapped(int k, const bst_module_env *env, const void *config,
                                 void **self) {
    replaced *r = calloc(1, sizeof *r);
    assert_non_null(r);
    *r = (replaced){.desc = shipped[k], .env = *env, .config = config};
    bst_status status = r->desc->create(env, config, &r->self);
    if (status != BST_OK) {
        free(r);
        return status;
    }
    *self = r;
    return BST_OK;
}

static void replace(replaced *r, bst_ctx *ctx) {
    test_saved saved = test_save(r->desc->archive, r->self);
    r->desc->destroy(r->self);
    bst_module_env env = r->env;
    env.ctx = ctx;
    bst_assert_ok(ctx, r->desc->create(&env, r->config, &r->self));
    bst_assert_ok(ctx, test_restore(ctx, r->desc->archive, r->self, saved));
    free(saved.bytes);
    replacements++;
}

static bst_status step_wrapped(void *self, struct bst_step *step) {
    replaced *r = self;
    /* gimbals step a thousand times a second */
    int64_t every = strcmp(r->desc->role, "gimbal") == 0 ? 211 : 3;
    if (replaces && r->steps++ % every == every - 1) {
        replace(r, bst_step_ctx(step));
    }
    return r->desc->step(r->self, step);
}

static bst_status finish_wrapped(void *self, struct bst_step *step) {
    replaced *r = self;
    return r->desc->finish(r->self, step);
}

static void destroy_wrapped(void *self) {
    replaced *r = self;
    r->desc->destroy(r->self);
    free(r);
}

/* create has no argument that names its descriptor */
#define CREATE(k)                                                                           \
    static bst_status create_##k(const bst_module_env *env, const void *config, void **s) { \
        return create_wrapped(k, env, config, s);                                           \
    }
CREATE(0)
CREATE(1)
CREATE(2)
CREATE(3)
CREATE(4)
CREATE(5)
CREATE(6)
CREATE(7)
CREATE(8)
CREATE(9)
CREATE(10)
CREATE(11)
CREATE(12)
CREATE(13)
CREATE(14)
CREATE(15)
CREATE(16)
CREATE(17)
CREATE(18)
CREATE(19)
typedef bst_status (*create_fn)(const bst_module_env *env, const void *config, void **self);
static const create_fn creates[] = {create_0,  create_1,  create_2,  create_3,  create_4,
                                    create_5,  create_6,  create_7,  create_8,  create_9,
                                    create_10, create_11, create_12, create_13, create_14,
                                    create_15, create_16, create_17, create_18, create_19};

static bst_scenario_registry wrap(void) {
    const bst_scenario_registry *all = bst_registry_shipped();
    assert_true(all->count <= (int)(sizeof creates / sizeof *creates));
    for (int k = 0; k < (int)all->count; k++) {
        shipped[k] = all->modules[k];
        wrapped[k] = *shipped[k];
        wrapped_list[k] = shipped[k];
        if (shipped[k]->archive && !shipped[k]->ahead) {
            wrapped[k].create = creates[k];
            wrapped[k].step = step_wrapped;
            wrapped[k].finish = shipped[k]->finish ? finish_wrapped : NULL;
            wrapped[k].destroy = destroy_wrapped;
            wrapped_list[k] = &wrapped[k];
        }
    }
    return (bst_scenario_registry){.modules = wrapped_list, .count = all->count};
}

/* ---- what a run publishes ---- */

typedef struct published {
    uint64_t hash;
    int64_t messages;
    char events[1 << 18];
    size_t used;
} published;

static uint64_t mix(uint64_t hash, const void *bytes, size_t count) {
    const unsigned char *b = bytes;
    for (size_t i = 0; i < count; i++) {
        hash = (hash ^ b[i]) * UINT64_C(0x100000001B3); /* FNV-1a */
    }
    return hash;
}

static bst_status take_message(void *user, const char *scope, const char *channel,
                               const void *payload, int64_t tick) {
    published *p = user;
    const bst_channel_type *type = bst_channel_type_find(channel);
    p->messages++;
    p->hash = mix(p->hash, scope, strlen(scope));
    p->hash = mix(p->hash, channel, strlen(channel));
    p->hash = mix(p->hash, &tick, sizeof tick);
    /* of rings only the header: it has the number of samples, which other messages show */
    size_t items = type->item_bytes && type->count ? (size_t)type->count(payload) : 0;
    p->hash = mix(p->hash, payload, type->header_bytes + items * type->item_bytes);
    return BST_OK;
}

static bst_status take_event(void *user, int64_t tick, const char *instance, const char *kind,
                             const char *text) {
    published *p = user;
    p->used += (size_t)snprintf(p->events + p->used, sizeof p->events - p->used, "%lld %s %s: %s\n",
                                (long long)tick, instance, kind, text);
    assert_true(p->used < sizeof p->events);
    return BST_OK;
}

static void run(const char *path, const char *const *settings, published *out) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    *out = (published){.hash = UINT64_C(0xCBF29CE484222325)};
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_simulation *sim = NULL;
    bst_assert_ok(&ctx, bst_json_load_described(&ctx, path, bst_registry_tables(), &json));
    for (; *settings; settings++) {
        bst_assert_ok(&ctx, bst_json_set(&ctx, json, *settings));
    }
    bst_scenario_registry registry = wrap();
    bst_assert_ok(&ctx, bst_scenario_read(&ctx, json, &registry, &scenario));
    const bst_simulation_options options = {.threads = 1};
    bst_assert_ok(&ctx, bst_simulation_create(&ctx, &scenario, &options, &sim));
    bst_engine *engine = bst_simulation_engine(sim);
    const bst_engine_hooks hooks = {.user = out, .message = take_message, .event = take_event};
    bst_engine_set_hooks(engine, &hooks);
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, scenario.duration_ticks));
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

#define SENSOR "/observers/0/sensors/0/"
#define GENERATOR SENSOR "observation_source=\"generator\""
#define EMBEDDED "/world/star_catalogue=embedded"

static void compare(const char *path, const char *const *settings, int least) {
    static published whole, pieces;
    replaces = false;
    replacements = 0;
    run(path, settings, &whole);
    assert_int_equal(replacements, 0);
    replaces = true;
    run(path, settings, &pieces);
    print_message("%s: %d messages, %d replacements\n%s", path, (int)whole.messages, replacements,
                  whole.events);
    assert_true(replacements >= least);
    assert_string_equal(pieces.events, whole.events);
    assert_int_equal(pieces.messages, whole.messages);
    assert_true(pieces.hash == whole.hash);
}

/* The main scenario until the target is in track; slow jitter widens the PSF. */
static void main_scenario(void **state) {
    (void)state;
    const char *const settings[] = {GENERATOR, EMBEDDED, "/duration_s=26", NULL};
    compare("scenarios/neossat_geo_track.json", settings, 200);
}

/* A compensator on the image error, tracks with two models, all hypotheses weighed. */
static void other_types(void **state) {
    (void)state;
    const char *const settings[] = {
        GENERATOR,
        EMBEDDED,
        "/duration_s=26",
        SENSOR "modules/tracker/type=imm",
        SENSOR "modules/tracker/association=pda",
        SENSOR "modules/control/compensator={\"type\": \"pi\", \"bandwidth_hz\": 0.05}",
        NULL};
    compare("scenarios/neossat_geo_track.json", settings, 200);
}

/* Planned slews, predicted losses, tracks on orbits. */
static void a_pass(void **state) {
    (void)state;
    const char *const settings[] = {GENERATOR, EMBEDDED, "/duration_s=25", NULL};
    compare("scenarios/leo_leo_keyhole.json", settings, 200);
}

/* Tiles of a region. */
static void a_region(void **state) {
    (void)state;
    const char *const settings[] = {GENERATOR, EMBEDDED, "/duration_s=30", NULL};
    compare("scenarios/belt_search.json", settings, 200);
}

/* Objects are handed out to the sensors of a constellation. */
static void a_constellation(void **state) {
    (void)state;
    const char *const settings[] = {EMBEDDED, "/duration_s=12", NULL};
    compare("scenarios/constellation_quick.json", settings, 200);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(main_scenario),   cmocka_unit_test(other_types),
        cmocka_unit_test(a_pass),          cmocka_unit_test(a_region),
        cmocka_unit_test(a_constellation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
