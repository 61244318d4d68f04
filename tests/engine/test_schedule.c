/* When modules are stepped and in which order; what is refused at load. */
#include "tests/engine/fake_module.h"

static const bst_port out_exposure[] = {{.channel = "exposure", .direction = BST_PORT_OUT}};
static const bst_port out_command[] = {{.channel = "los_command", .direction = BST_PORT_OUT}};
static const bst_port in_command[] = {{.channel = "los_command", .direction = BST_PORT_IN}};
static const bst_port trigger_exposure[] = {
    {.channel = "exposure", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER}};
static const bst_module_desc exposure_writer = FAKE_DESC(out_exposure);
static const bst_module_desc command_writer = FAKE_DESC(out_command);
static const bst_module_desc command_reader = FAKE_DESC(in_command);
static const bst_module_desc exposure_triggered = FAKE_DESC(trigger_exposure);

static bst_status check_period(fake *self, struct bst_step *step) {
    /* value: period, value2: offset */
    assert_int_equal(bst_step_tick(step), self->value2 + (self->steps - 1) * self->value);
    return BST_OK;
}

/* 21600 s at 6000 Hz: 129,600,000 ticks. The number of steps of period p and offset o before the
 * end is ceil((ticks - o) / p). */
static void hours_of_many_rates_are_exact(void **state) {
    (void)state;
    const int64_t hours = 21600LL * 6000;
    /* 50 Hz, 20 Hz, 24 Hz, 1 Hz, 0.1 Hz, once a day; offsets 0, 7, 249, 5999, 1 */
    const int64_t periods[] = {120, 300, 250, 6000, 60000, 518400000};
    const int64_t offsets[] = {0, 7, 249, 5999, 1, 0};
    const char *const names[] = {"f", "e", "d", "c", "b", "a"};
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 6000);
    fake fakes[6] = {{0}};
    fake *pointers[6];
    for (int i = 0; i < 6; i++) {
        fakes[i].on_step = check_period;
        fakes[i].value = periods[i];
        fakes[i].value2 = offsets[i];
        pointers[i] = &fakes[i];
        bst_instance_spec spec = FAKE_SPEC(fake_alone, names[i], pointers[i], periods[i]);
        spec.offset_ticks = offsets[i];
        fake_add(&ctx, engine, spec);
    }
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    assert_int_equal(bst_engine_tick(engine), -1);
    /* in uneven pieces: where a run is cut must not matter */
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 1));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 123456789));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, hours));
    for (int i = 0; i < 6; i++) {
        assert_int_equal(fakes[i].steps, (hours - offsets[i] + periods[i] - 1) / periods[i]);
    }
    assert_int_equal(bst_engine_tick(engine), hours - 1); /* 5999 + n 6000 */
    assert_string_equal(bst_engine_instance_name(engine, 0), "a");
    assert_int_equal(bst_engine_instance_count(engine), 6);
    assert_int_equal(bst_engine_instance_steps(engine, 5), fakes[0].steps);
    bst_engine_free(engine);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(fakes[i].destroyed, 1);
    }
}

/* Many modules that come due in the same and in different ticks, against a plain list. */
static void heap_steps_like_a_list(void **state) {
    (void)state;
    enum { N = 37 };
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    static char log[20000];
    log[0] = '\0';
    fake fakes[N] = {{0}};
    fake *pointers[N];
    char names[N][8];
    for (int i = 0; i < N; i++) {
        fakes[i].label = (char)('0' + i);
        fakes[i].log = log;
        pointers[i] = &fakes[i];
        snprintf(names[i], sizeof names[i], "m%02d", i);
        bst_instance_spec spec = FAKE_SPEC(fake_alone, names[i], pointers[i], 1 + (i * 7) % 11);
        spec.offset_ticks = (i * 5) % 13;
        fake_add(&ctx, engine, spec);
    }
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 300));
    static char expected[20000];
    size_t n = 0;
    for (int t = 0; t < 300; t++) {
        for (int i = 0; i < N; i++) {
            int since = t - (i * 5) % 13;
            if (since >= 0 && since % (1 + (i * 7) % 11) == 0) {
                expected[n++] = (char)('0' + i);
            }
        }
    }
    expected[n] = '\0';
    assert_string_equal(log, expected);
    bst_engine_free(engine);
}

static bst_status write_one(fake *self, struct bst_step *step) {
    (void)self;
    (void)bst_step_write(step, 0, NULL);
    return BST_OK;
}

/* z writes what a reads: z first although its name is last; free modules by name. */
static void order_is_topological_then_by_name(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    char log[32] = "";
    fake z = {.on_step = write_one, .label = 'z', .log = log};
    fake a = {.label = 'a', .log = log}, m = {.label = 'm', .log = log};
    fake b = {.label = 'b', .log = log};
    fake *pz = &z, *pa = &a, *pm = &m, *pb = &b;
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "m", pm, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_reader, "a", pa, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "z", pz, 10));
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "b", pb, 10));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 20));
    assert_string_equal(log, "bmzabmza");
    bst_engine_free(engine);
}

/* Triggered in the writer's own tick, and `delay` ticks later where one is declared; only then. */
static void triggers_come_at_the_tick_of_visibility(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake w = {.on_step = write_one}, now = {0}, later = {0};
    fake *pw = &w, *pn = &now, *pl = &later;
    fake_add(&ctx, engine, FAKE_SPEC(exposure_writer, "w", pw, 10));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_triggered, "now", pn, 0));
    bst_instance_spec spec = FAKE_SPEC(exposure_triggered, "later", pl, 0);
    spec.delays[0] = (bst_input_delay){0, 1234}; /* 124 messages on their way at once */
    spec.delay_count = 1;
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 5000));
    assert_int_equal(now.steps, 500);
    assert_int_equal(later.steps, (5000 - 1234 + 9) / 10);
    for (int i = 0; i < 64; i++) {
        assert_int_equal(now.ticks[i], 10 * i);
        assert_int_equal(later.ticks[i], 1234 + 10 * i);
    }
    bst_engine_free(engine);
}

static bst_status wake_later(fake *self, struct bst_step *step) {
    int64_t tick = bst_step_tick(step);
    bst_step_wake_at(step, tick);      /* not later than now: nothing */
    bst_step_wake_at(step, tick - 5);  /* nor this */
    bst_step_wake_at(step, tick + 90); /* the earlier of two wins */
    bst_step_wake_at(step, tick + self->value);
    return BST_OK;
}

static void modules_can_ask_to_be_woken(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake alone = {.on_step = wake_later, .value = 17}, mixed = {.on_step = wake_later, .value = 7};
    fake *pa = &alone, *pm = &mixed;
    bst_instance_spec spec = FAKE_SPEC(fake_alone, "a", pa, 0);
    spec.offset_ticks = 3;
    fake_add(&ctx, engine, spec);
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "m", pm, 10));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 40));
    assert_int_equal(alone.steps, 3);
    assert_int_equal(alone.ticks[0], 3);
    assert_int_equal(alone.ticks[1], 20);
    assert_int_equal(alone.ticks[2], 37);
    /* period 10 and a wake 7 after each step whose wish was free: 0, 7, 10, 14, 20, 21, 28, 30, 35
     */
    const int64_t expected[] = {0, 7, 10, 14, 20, 21, 28, 30, 35};
    assert_int_equal(mixed.steps, 9);
    for (int i = 0; i < 9; i++) {
        assert_int_equal(mixed.ticks[i], expected[i]);
    }
    bst_engine_free(engine);
}

static void expect_refusal(bst_engine *engine, bst_ctx *ctx, const char *message) {
    assert_int_equal(bst_engine_load(ctx, engine), BST_ERR_CONFIG);
    assert_string_equal(ctx->message, message);
    bst_engine_free(engine);
}

static const bst_port cycle_a[] = {{.channel = "los_command", .direction = BST_PORT_OUT},
                                   {.channel = "tracks", .direction = BST_PORT_IN}};
static const bst_port cycle_b[] = {{.channel = "exposure", .direction = BST_PORT_OUT},
                                   {.channel = "los_command", .direction = BST_PORT_IN}};
static const bst_port cycle_c[] = {{.channel = "tracks", .direction = BST_PORT_OUT},
                                   {.channel = "exposure", .direction = BST_PORT_IN}};
static const bst_port feedback_c[] = {
    {.channel = "tracks", .direction = BST_PORT_OUT},
    {.channel = "exposure", .direction = BST_PORT_IN, .flags = BST_PORT_FEEDBACK}};
static const bst_port downstream[] = {{.channel = "tracks", .direction = BST_PORT_IN}};
static const bst_module_desc desc_a = FAKE_DESC(cycle_a), desc_b = FAKE_DESC(cycle_b),
                             desc_c = FAKE_DESC(cycle_c), desc_fc = FAKE_DESC(feedback_c),
                             desc_d = FAKE_DESC(downstream);

static void a_cycle_is_shown(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    fake f = {0};
    fake *p = &f;
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(desc_a, "o/s/aim", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(desc_b, "o/s/clock", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(desc_c, "o/s/track", p, 10));
    /* named first and not part of the cycle */
    fake_add(&ctx, engine, FAKE_SPEC(desc_d, "o/s/aaa", p, 10));
    expect_refusal(engine, &ctx,
                   "modules wait for each other within one tick: o/s/track -> o/s/aim -> "
                   "o/s/clock -> o/s/track; give one of these inputs a delay_s");
    assert_int_equal(f.destroyed, 0); /* nothing was created */

    /* a feedback port, or a declared delay, breaks it */
    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(desc_a, "o/s/aim", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(desc_b, "o/s/clock", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(desc_fc, "o/s/track", p, 10));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    assert_string_equal(bst_engine_instance_name(engine, 0), "o/s/track");
    assert_string_equal(bst_engine_instance_name(engine, 2), "o/s/clock");
    bst_engine_free(engine);
    assert_int_equal(f.destroyed, 3);

    /* two inputs, one of them delayed: one way still has none */
    engine = fake_engine(&ctx, 1000);
    bst_instance_spec spec = FAKE_SPEC(desc_c, "o/s/track", p, 10);
    spec.delays[0] = (bst_input_delay){1, 1};
    spec.delay_count = 1;
    fake_add(&ctx, engine, FAKE_SPEC(desc_a, "o/s/aim", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(desc_b, "o/s/clock", p, 10));
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_engine_free(engine);
}

static const bst_port self_loop[] = {{.channel = "tracks", .direction = BST_PORT_OUT},
                                     {.channel = "tracks", .direction = BST_PORT_IN}};
static const bst_port in_history[] = {{.channel = "los_history", .direction = BST_PORT_IN}};
static const bst_port out_history[] = {{.channel = "los_history", .direction = BST_PORT_OUT}};
static const bst_port unknown_channel[] = {{.channel = "nonsense", .direction = BST_PORT_OUT}};
static const bst_port modify_command[] = {{.channel = "los_command", .direction = BST_PORT_MODIFY}};
static const bst_module_desc self_desc = FAKE_DESC(self_loop),
                             history_reader = FAKE_DESC(in_history),
                             history_writer = FAKE_DESC(out_history),
                             unknown_writer = FAKE_DESC(unknown_channel),
                             command_modifier = FAKE_DESC(modify_command);

static void wrong_wiring_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    fake f = {0};
    fake *p = &f;
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(command_reader, "o/s/gimbal", p, 10));
    expect_refusal(engine, &ctx,
                   "o/s/gimbal: reads the channel o/s/los_command, which no module writes; add "
                   "the module that makes it: control");

    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "o/s/two", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "o/s/one", p, 10));
    expect_refusal(engine, &ctx, "o/s/one and o/s/two both write the channel o/s/los_command");

    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "o/s/same", p, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "o/s/same", p, 10));
    expect_refusal(engine, &ctx, "two modules are named o/s/same");

    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(unknown_writer, "o/s/x", p, 10));
    expect_refusal(engine, &ctx, "o/s/x: writes the channel \"nonsense\", which does not exist");

    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(self_desc, "o/s/x", p, 10));
    expect_refusal(engine, &ctx,
                   "modules wait for each other within one tick: o/s/x -> o/s/x; give one of "
                   "these inputs a delay_s");

    engine = fake_engine(&ctx, 1000);
    bst_instance_spec spec = FAKE_SPEC(history_reader, "o/s/render", p, 10);
    spec.delays[0] = (bst_input_delay){0, 1};
    spec.delay_count = 1;
    fake_add(&ctx, engine, spec);
    fake_add(&ctx, engine, FAKE_SPEC(history_writer, "o/s/gimbal", p, 10));
    expect_refusal(engine, &ctx,
                   "o/s/render: los_history is extended in place and cannot be read with a delay");

    engine = fake_engine(&ctx, 1000);
    spec = FAKE_SPEC(command_modifier, "o/s/spoil", p, 10);
    spec.delays[0] = (bst_input_delay){0, 1};
    spec.delay_count = 1;
    fake_add(&ctx, engine, spec);
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "o/s/w", p, 10));
    expect_refusal(engine, &ctx, "o/s/spoil: los_command is changed in place and takes no delay");

    /* 1000 s of delay at 1 kHz */
    engine = fake_engine(&ctx, 1000);
    spec = FAKE_SPEC(command_reader, "o/s/r", p, 1);
    spec.delays[0] = (bst_input_delay){0, 1000000};
    spec.delay_count = 1;
    fake_add(&ctx, engine, spec);
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "o/s/w", p, 1));
    expect_refusal(engine, &ctx,
                   "o/s/los_command: 1000000 messages would wait for a reader (allowed: 100000); "
                   "shorten the delay or the rates' ratio");
}

static bst_status refuse_create(fake *self, const bst_module_env *env) {
    (void)self;
    return bst_fail(env->ctx, BST_ERR_NUMERIC, "no");
}

static void calls_in_the_wrong_order_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = NULL;
    assert_int_equal(bst_engine_create(&ctx, 0, &engine), BST_ERR_CONFIG);
    assert_null(engine);
    assert_string_equal(ctx.message, "tick rate 0 Hz: allowed are 1 to 1000000");
    engine = fake_engine(&ctx, 1000);
    assert_int_equal(bst_engine_run(&ctx, engine, 1), BST_ERR_STATE);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    assert_int_equal(bst_engine_load(&ctx, engine), BST_ERR_STATE);
    fake f = {.on_create = refuse_create}, g = {0};
    fake *p = &f, *q = &g;
    bst_instance_spec spec = FAKE_SPEC(fake_alone, "late", p, 1);
    assert_int_equal(bst_engine_add(&ctx, engine, &spec), BST_ERR_STATE);
    assert_string_equal(ctx.message, "late: modules are added before loading");
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 10)); /* an empty engine runs */
    bst_engine_free(engine);
    bst_engine_free(NULL);

    /* a module that cannot be made: its name, and those made before are destroyed */
    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "a", q, 1));
    fake_add(&ctx, engine, FAKE_SPEC(fake_alone, "b", p, 1));
    assert_int_equal(bst_engine_load(&ctx, engine), BST_ERR_NUMERIC);
    assert_string_equal(ctx.message, "b: no");
    bst_engine_free(engine);
    assert_int_equal(g.destroyed, 1);
    assert_int_equal(f.destroyed, 0);

    bst_module_desc old = fake_alone;
    old.abi = 0;
    engine = fake_engine(&ctx, 1000);
    spec = FAKE_SPEC(old, "x", p, 1);
    assert_int_equal(bst_engine_add(&ctx, engine, &spec), BST_ERR_CONFIG);
    assert_string_equal(ctx.message, "x: module fake/alone was built for interface 0, this is 7");
    bst_engine_free(engine);
}

static void rates_and_times_that_do_not_divide(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    int64_t ticks = -1;
    bst_assert_ok(&ctx, bst_period_ticks(&ctx, 6000, 1000.0, &ticks));
    assert_int_equal(ticks, 6);
    bst_assert_ok(&ctx, bst_period_ticks(&ctx, 6000, 0.1, &ticks));
    assert_int_equal(ticks, 60000);
    bst_assert_ok(&ctx, bst_period_ticks(&ctx, 6000, 6000.0, &ticks));
    assert_int_equal(ticks, 1);
    assert_int_equal(bst_period_ticks(&ctx, 6000, 700.0, &ticks), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "a rate of 700 Hz does not divide the tick rate of 6000 Hz; the nearest "
                        "that do are 666.666667 and 750 Hz");
    assert_int_equal(bst_period_ticks(&ctx, 6000, 8000.0, &ticks), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "a rate of 8000 Hz is not between 0 and the tick rate of 6000 Hz");
    assert_int_equal(bst_period_ticks(&ctx, 6000, 0.0, &ticks), BST_ERR_CONFIG);
    assert_int_equal(bst_period_ticks(&ctx, 6000, -1.0, &ticks), BST_ERR_CONFIG);
    assert_int_equal(bst_period_ticks(&ctx, 6000, (double)NAN, &ticks), BST_ERR_CONFIG);

    bst_assert_ok(&ctx, bst_seconds_to_ticks(&ctx, 6000, 31557600.0, &ticks)); /* a year */
    assert_int_equal(ticks, 189345600000);
    bst_assert_ok(&ctx, bst_seconds_to_ticks(&ctx, 6000, 0.15, &ticks));
    assert_int_equal(ticks, 900);
    assert_int_equal(bst_seconds_to_ticks(&ctx, 6000, 0.0001, &ticks), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "a time of 0.0001 s is no whole number of ticks at 6000 Hz; the nearest "
                        "that are 0 and 0.000166666666667 s");
    assert_int_equal(bst_seconds_to_ticks(&ctx, 6000, 1e13, &ticks), BST_ERR_CONFIG);
    assert_string_equal(ctx.message, "a time of 1e+13 s is out of range");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hours_of_many_rates_are_exact),
        cmocka_unit_test(heap_steps_like_a_list),
        cmocka_unit_test(order_is_topological_then_by_name),
        cmocka_unit_test(triggers_come_at_the_tick_of_visibility),
        cmocka_unit_test(modules_can_ask_to_be_woken),
        cmocka_unit_test(a_cycle_is_shown),
        cmocka_unit_test(wrong_wiring_is_refused),
        cmocka_unit_test(calls_in_the_wrong_order_are_refused),
        cmocka_unit_test(rates_and_times_that_do_not_divide),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
