/* Modules for tests of the engine: what they do in a step is a function of the test. */
#ifndef BST_TESTS_ENGINE_FAKE_MODULE_H
#define BST_TESTS_ENGINE_FAKE_MODULE_H

#include <stdlib.h>

#include "sim/engine/kernel/engine.h"
#include "tests/test_support.h"

typedef struct fake {
    bst_status (*on_step)(struct fake *self, struct bst_step *step);
    bst_status (*on_create)(struct fake *self, const bst_module_env *env);
    int64_t steps, last_tick, first_tick;
    int64_t ticks[64]; /* of the first steps */
    int destroyed;
    char label;  /* appended to *log at each step */
    char *log;   /* may be NULL */
    void *other; /* the test's */
    int64_t value, value2;
} fake;

static inline bst_status fake_create(const bst_module_env *env, const void *config, void **self) {
    fake *f = *(fake *const *)config;
    *self = f;
    return f->on_create ? f->on_create(f, env) : BST_OK;
}

static inline bst_status fake_step(void *self, struct bst_step *step) {
    fake *f = self;
    f->last_tick = bst_step_tick(step);
    if (f->steps == 0) {
        f->first_tick = f->last_tick;
    }
    if (f->steps < 64) {
        f->ticks[f->steps] = f->last_tick;
    }
    f->steps++;
    if (f->log) {
        size_t used = strlen(f->log);
        f->log[used] = f->label;
        f->log[used + 1] = '\0';
    }
    return f->on_step ? f->on_step(f, step) : BST_OK;
}

static inline void fake_destroy(void *self) {
    ((fake *)self)->destroyed++;
}

/* A descriptor over an array of ports. */
#define FAKE_DESC(ports_)                                                                          \
    {                                                                                              \
        .abi = BST_MODULE_ABI, .role = "fake", .type = "fake", .doc = "A fake.",                   \
        .config_bytes = sizeof(fake *), .ports = ports_,                                           \
        .port_count = sizeof(ports_) / sizeof *(ports_), .create = fake_create, .step = fake_step, \
        .destroy = fake_destroy                                                                    \
    }

/* A module without ports. */
static const bst_module_desc fake_alone = {.abi = BST_MODULE_ABI,
                                           .role = "fake",
                                           .type = "alone",
                                           .doc = "A fake without ports.",
                                           .config_bytes = sizeof(fake *),
                                           .create = fake_create,
                                           .step = fake_step,
                                           .destroy = fake_destroy};

/* `f` must be an lvalue that outlives the engine: its address is the configuration. */
#define FAKE_SPEC(desc_, name_, f_, period_) \
    ((bst_instance_spec){.desc = &(desc_),   \
                         .scope = "o/s",     \
                         .instance = name_,  \
                         .config = &(f_),    \
                         .period_ticks = period_})

static inline bst_engine *fake_engine(bst_ctx *ctx, int64_t rate) {
    bst_engine *engine = NULL;
    bst_assert_ok(ctx, bst_engine_create(ctx, rate, &engine));
    return engine;
}

static inline void fake_add(bst_ctx *ctx, bst_engine *engine, bst_instance_spec spec) {
    bst_assert_ok(ctx, bst_engine_add(ctx, engine, &spec));
}

static inline int64_t fake_counter(const bst_engine *engine, const char *wanted) {
    const char *name;
    int64_t count;
    for (int i = 0; bst_engine_counter(engine, i, &name, &count); i++) {
        if (strcmp(name, wanted) == 0) {
            return count;
        }
    }
    return 0;
}

#endif
