/* How a run ends, and what it tells on the way: events, counters, hooks, interruption. */
#include "tests/engine/fake_module.h"

static const bst_port out_exposure[] = {{.channel = "exposure", .direction = BST_PORT_OUT}};
static const bst_port out_command[] = {{.channel = "los_command", .direction = BST_PORT_OUT}};
static const bst_module_desc exposure_writer = FAKE_DESC(out_exposure),
                             command_writer = FAKE_DESC(out_command);

static bst_status write_command(fake *self, struct bst_step *step) {
    (void)self;
    bst_los_command *c = bst_step_write(step, 0, NULL);
    c->tick = bst_step_tick(step);
    return BST_OK;
}

static bst_status burst(fake *self, struct bst_step *step) {
    for (int i = 0; i < 50; i++) {
        bst_exposure *e = bst_step_write(step, 0, NULL);
        e->id = self->value++;
    }
    return BST_OK;
}

static bst_status talk(fake *self, struct bst_step *step) {
    (void)self;
    bst_step_event(step, "mode", "to %d", (int)bst_step_tick(step));
    bst_step_count(step, "saturated");
    if (bst_step_tick(step) == 30) {
        return bst_fail(bst_step_ctx(step), BST_ERR_NUMERIC, "matrix is not positive definite");
    }
    return BST_OK;
}

static bst_status hear(void *user, int64_t tick, const char *instance, const char *kind,
                       const char *text) {
    char expected[16];
    snprintf(expected, sizeof expected, "to %d", (int)tick);
    assert_string_equal(instance, "o/s/talker");
    assert_string_equal(kind, "mode");
    assert_string_equal(text, expected);
    ++*(int64_t *)user;
    return BST_OK;
}

static void events_counters_and_errors_come_out(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake f = {.on_step = talk};
    fake *p = &f;
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "o/s/talker", p, 10));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    int64_t heard = 0;
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = &heard, .event = hear});
    assert_int_equal(bst_engine_run(&ctx, engine, 1000), BST_ERR_NUMERIC);
    assert_string_equal(ctx.message, "o/s/talker at 0.030000 s: matrix is not positive definite");
    assert_int_equal(heard, 4);
    assert_int_equal(fake_counter(engine, "saturated"), 4);
    assert_int_equal(bst_engine_tick(engine), 30);
    bst_engine_free(engine);
}

static bst_status full_disk(void *user, const char *scope, const char *channel, const void *payload,
                            int64_t tick) {
    (void)scope;
    (void)channel;
    (void)payload;
    return tick < 50 ? BST_OK : bst_fail(user, BST_ERR_IO, "disk full");
}

static void a_hook_that_fails_ends_the_run(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake f = {.on_step = write_command}, g = {.on_step = burst};
    fake *p = &f, *q = &g;
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "w", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_writer, "x", q, 60)); /* several in one step */
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = &ctx, .message = full_disk});
    assert_int_equal(bst_engine_run(&ctx, engine, 1000), BST_ERR_IO);
    assert_string_equal(ctx.message, "w at 0.050000 s: disk full");
    assert_int_equal(bst_engine_run(&ctx, engine, 1000), BST_ERR_IO);
    bst_engine_free(engine);
}

static bool stop_at(void *user, int64_t tick) {
    return tick > *(int64_t *)user;
}

/* The clock is asked every 20 ms of wall time, so the run ends some time after the wish. */
static void a_run_can_be_interrupted_and_resumed(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake f = {0};
    fake *p = &f;
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "a", p, 1));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    int64_t limit = 1000;
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = &limit, .interrupted = stop_at});
    assert_int_equal(bst_engine_run(&ctx, engine, INT64_MAX), BST_ERR_INTERRUPTED);
    int64_t at = bst_engine_tick(engine);
    assert_true(at > limit);
    char expected[64];
    snprintf(expected, sizeof expected, "interrupted at %.3f s", (double)at / 1000.0);
    assert_string_equal(ctx.message, expected);
    limit = INT64_MAX;
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, at + 101));
    assert_int_equal(f.steps, at + 101); /* each tick once */
    bst_engine_free(engine);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(events_counters_and_errors_come_out),
        cmocka_unit_test(a_hook_that_fails_ends_the_run),
        cmocka_unit_test(a_run_can_be_interrupted_and_resumed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
