/* Sims in a pool of threads go the same way as alone; columns are the messages of each. */
#include "boresight/sim_pool.h"

#include "tests/test_support.h"

enum { SIMS = 5, LEFT_OUT = 3 };

typedef struct group {
    bst_ctx ctx;
    bst_model *model;
    bst_sim_pool *pool;
    bst_sim *alone[SIMS], *pooled[SIMS];
} group;

/* Sims of the observation generator, whose control is the program; one is left out of the pool. */
static void begin(group *g) {
    static const char *const assignments[] = {
        "/observers/0/sensors/0/observation_source=generator",
        "/observers/0/sensors/0/modules/control={\"type\": \"external\"}"};
    const bst_model_options how = {.assignments = assignments, .assignment_count = 2};
    bst_ctx_init(&g->ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(&g->ctx,
                  bst_model_load(&g->ctx, "scenarios/neossat_geo_track.json", &how, &g->model));
    bst_assert_ok(&g->ctx, bst_sim_pool_create(&g->ctx, 2, &g->pool));
    for (int i = 0; i < SIMS; i++) {
        const bst_sim_options run = {.other_run = true, .run = (uint64_t)i};
        bst_assert_ok(&g->ctx, bst_sim_create(&g->ctx, g->model, &run, &g->alone[i]));
        g->pooled[i] = NULL;
        if (i != LEFT_OUT) {
            bst_assert_ok(&g->ctx, bst_sim_create(&g->ctx, g->model, &run, &g->pooled[i]));
        }
    }
}

static void end(group *g) {
    for (int i = 0; i < SIMS; i++) {
        bst_sim_free(g->alone[i]);
        bst_sim_free(g->pooled[i]);
    }
    bst_sim_pool_free(g->pool);
    bst_model_free(g->model);
}

/* Memory of columns of a channel. */
static bst_sim_columns columns_of(const char *channel, int capacity) {
    const bst_channel_type *type = bst_channel_type_find(channel);
    return (bst_sim_columns){.headers = calloc(SIMS, type->header_bytes),
                             .items = calloc(SIMS * (size_t)capacity + 1, type->item_bytes),
                             .item_capacity = capacity,
                             .item_counts = calloc(SIMS, sizeof(int)),
                             .written_at = calloc(SIMS, sizeof(int64_t))};
}

static void free_columns(bst_sim_columns *c) {
    free(c->headers);
    free(c->items);
    free(c->item_counts);
    free(c->written_at);
}

/* Asserts that the columns of detections are the newest ones of the sims that stepped alone. */
static void assert_same_detections(group *g) {
    const int capacity = 7; /* less than most frames have */
    bst_sim_columns c = columns_of("detections", capacity);
    bst_assert_ok(&g->ctx, bst_sim_pool_view(&g->ctx, g->pooled, SIMS, NULL, "detections", &c));
    const bst_detections *headers = c.headers;
    const bst_detection *items = c.items;
    for (int i = 0; i < SIMS; i++) {
        bst_sim_message view;
        bst_assert_ok(&g->ctx, bst_sim_view(&g->ctx, g->alone[i], NULL, "detections", &view));
        const bst_detections *d = view.payload;
        if (i == LEFT_OUT) {
            assert_int_equal(c.item_counts[i], 0);
            continue;
        }
        assert_int_equal(bst_sim_tick(g->pooled[i]), bst_sim_tick(g->alone[i]));
        assert_int_equal(c.written_at[i], view.written_tick);
        assert_int_equal(headers[i].exposure_id, d->exposure_id);
        assert_int_equal(c.item_counts[i], d->count);
        assert_true(d->count > 0);
        for (int k = 0; k < capacity && k < d->count; k++) {
            const bst_detection *item = &items[i * capacity + k];
            assert_true(item->x_px == d->items[k].x_px && item->snr == d->items[k].snr);
        }
    }
    free_columns(&c);
}

static void steps_as_alone(void **state) {
    (void)state;
    group g;
    const int messages[SIMS] = {1, 2, 3, 2, 4};
    int arrived[SIMS] = {-1, -1, -1, -1, -1};
    begin(&g);
    bst_assert_ok(&g.ctx, bst_sim_pool_step(&g.ctx, g.pool, g.pooled, SIMS, "detections", messages,
                                            100.0, arrived));
    for (int i = 0; i < SIMS; i++) {
        assert_int_equal(arrived[i], i == LEFT_OUT ? -1 : messages[i]);
        for (int k = 0; k < messages[i]; k++) {
            bool came;
            bst_assert_ok(&g.ctx,
                          bst_sim_step(&g.ctx, g.alone[i], NULL, "detections", 100.0, &came));
            assert_true(came);
        }
    }
    assert_same_detections(&g);
    /* to a time; then all have reached it, and nothing comes */
    bst_assert_ok(&g.ctx, bst_sim_pool_step(&g.ctx, g.pool, g.pooled, SIMS, NULL, NULL, 6.0, NULL));
    bst_assert_ok(&g.ctx, bst_sim_pool_step(&g.ctx, g.pool, g.pooled, SIMS, "detections", NULL, 6.0,
                                            arrived));
    for (int i = 0; i < SIMS; i++) {
        bst_assert_ok(&g.ctx, bst_sim_run_until(&g.ctx, g.alone[i], 6.0));
        assert_int_equal(arrived[i], i == LEFT_OUT ? -1 : 0);
    }
    assert_same_detections(&g);
    end(&g);
}

/* The newest samples of a ring, oldest first, also across its end. */
static void views_rings(void **state) {
    (void)state;
    enum { SAMPLES = 9 };
    group g;
    begin(&g);
    bst_sim_columns c = columns_of("pointing_telemetry", SAMPLES);
    bst_assert_ok(&g.ctx,
                  bst_sim_pool_view(&g.ctx, g.pooled, SIMS, NULL, "pointing_telemetry", &c));
    assert_int_equal(c.written_at[0], -1); /* none yet */
    assert_int_equal(c.item_counts[0], 0);
    bool wrapped = false;
    for (double until_s = 0.01; until_s < 40.0 && !wrapped; until_s += 0.05) {
        bst_assert_ok(&g.ctx, bst_sim_run_until(&g.ctx, g.pooled[0], until_s));
        bst_assert_ok(&g.ctx,
                      bst_sim_pool_view(&g.ctx, g.pooled, SIMS, NULL, "pointing_telemetry", &c));
        bst_sim_message view;
        bst_assert_ok(&g.ctx, bst_sim_view(&g.ctx, g.pooled[0], NULL, "pointing_telemetry", &view));
        const bst_pointing_telemetry *ring = view.payload;
        const bst_pointing_sample *items = c.items;
        int held = ring->written < ring->capacity ? (int)ring->written : ring->capacity;
        assert_int_equal(c.item_counts[0], held);
        int kept = held < SAMPLES ? held : SAMPLES;
        for (int k = 0; k < kept; k++) {
            int64_t number = ring->written - kept + k;
            assert_int_equal(items[k].tick, ring->items[number % ring->capacity].tick);
        }
        wrapped = ring->written > ring->capacity && ring->written % ring->capacity < SAMPLES;
    }
    assert_true(wrapped);
    free_columns(&c);
    end(&g);
}

static void commands_and_errors(void **state) {
    (void)state;
    group g;
    begin(&g);
    bst_assert_ok(&g.ctx, bst_sim_pool_step(&g.ctx, g.pool, g.pooled, SIMS, NULL, NULL, 0.5, NULL));
    bst_los_command commands[SIMS] = {{.tick = 0}};
    for (int i = 0; i < SIMS; i++) {
        commands[i].direction_gcrf = (bst_vec3){i == 1 ? 0.6 : 0.0, i == 1 ? 0.8 : 1.0, 0.0};
        commands[i].tick = 3000;
    }
    bst_assert_ok(&g.ctx,
                  bst_sim_pool_command(&g.ctx, g.pooled, SIMS, NULL, "los_command", commands));
    bst_assert_ok(
        &g.ctx, bst_sim_pool_step(&g.ctx, g.pool, g.pooled, SIMS, "los_command", NULL, 2.0, NULL));
    bst_sim_columns c = columns_of("los_command", 0);
    bst_assert_ok(&g.ctx, bst_sim_pool_view(&g.ctx, g.pooled, SIMS, NULL, "los_command", &c));
    const bst_los_command *given = c.headers;
    assert_true(given[1].direction_gcrf.x == 0.6 && given[2].direction_gcrf.x == 0.0);
    free_columns(&c);
    commands[2].direction_gcrf = (bst_vec3){2.0, 0.0, 0.0}; /* no unit vector */
    assert_int_equal(bst_sim_pool_command(&g.ctx, g.pooled, SIMS, NULL, "los_command", commands),
                     BST_ERR_ARGUMENT);
    assert_non_null(strstr(g.ctx.message, "sim 2"));
    assert_int_equal(bst_sim_pool_command(&g.ctx, g.pooled, SIMS, NULL, "nonsense", commands),
                     BST_ERR_NOT_FOUND);
    assert_int_equal(bst_sim_pool_step(&g.ctx, g.pool, g.pooled, SIMS, "nonsense", NULL, 3.0, NULL),
                     BST_ERR_NOT_FOUND);
    assert_non_null(strstr(g.ctx.message, "sim 0"));
    end(&g);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(steps_as_alone),
                                       cmocka_unit_test(views_rings),
                                       cmocka_unit_test(commands_and_errors)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
