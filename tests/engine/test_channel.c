/* What readers see of channels, and when. */
#include "tests/engine/fake_module.h"

static const bst_port out_exposure[] = {{.channel = "exposure", .direction = BST_PORT_OUT}};
static const bst_port in_exposure[] = {{.channel = "exposure", .direction = BST_PORT_IN}};
static const bst_port trigger_exposure[] = {
    {.channel = "exposure", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER}};
static const bst_port out_command[] = {{.channel = "los_command", .direction = BST_PORT_OUT}};
static const bst_port in_command[] = {{.channel = "los_command", .direction = BST_PORT_IN}};
static const bst_port fresh_command[] = {
    {.channel = "los_command", .direction = BST_PORT_IN, .max_age_s = 0.025}};
static const bst_port feedback_command[] = {
    {.channel = "los_command", .direction = BST_PORT_IN, .flags = BST_PORT_FEEDBACK}};
static const bst_port modify_command[] = {{.channel = "los_command", .direction = BST_PORT_MODIFY}};
static const bst_port optional_command[] = {
    {.channel = "los_command", .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL}};
static const bst_port out_tracks[] = {
    {.channel = "tracks", .direction = BST_PORT_OUT, .capacity = 5}};
static const bst_port in_tracks[] = {{.channel = "tracks", .direction = BST_PORT_IN}};
static const bst_module_desc exposure_writer = FAKE_DESC(out_exposure),
                             exposure_reader = FAKE_DESC(in_exposure),
                             exposure_triggered = FAKE_DESC(trigger_exposure),
                             command_writer = FAKE_DESC(out_command),
                             command_reader = FAKE_DESC(in_command),
                             command_fresh = FAKE_DESC(fresh_command),
                             command_feedback = FAKE_DESC(feedback_command),
                             command_modifier = FAKE_DESC(modify_command),
                             command_optional = FAKE_DESC(optional_command),
                             tracks_writer = FAKE_DESC(out_tracks),
                             tracks_reader = FAKE_DESC(in_tracks);

static bst_status write_exposure(fake *self, struct bst_step *step) {
    bst_exposure *e = bst_step_write(step, 0, NULL);
    *e = (bst_exposure){.id = self->value++, .start_tick = bst_step_tick(step)};
    return BST_OK;
}

static bst_status write_command(fake *self, struct bst_step *step) {
    (void)self;
    bst_los_command *c = bst_step_write(step, 0, NULL);
    c->tick = bst_step_tick(step);
    return BST_OK;
}

/* value2: delay. The newest message not younger than the delay, of those written every 10 ticks. */
static bst_status check_latest(fake *self, struct bst_step *step) {
    int64_t tick = bst_step_tick(step), seen = tick - self->value2;
    bst_sample s = bst_step_latest(step, 0);
    if (seen < 0) {
        assert_null(s.payload);
        assert_true(s.stale);
        return BST_OK;
    }
    int64_t expected = seen / 10 * 10;
    assert_non_null(s.payload);
    assert_int_equal(s.written_tick, expected);
    assert_int_equal(((const bst_los_command *)s.payload)->tick, expected);
    assert_int_equal(s.sequence, expected / 10);
    assert_false(s.stale);
    return BST_OK;
}

static void delays_are_exact_to_the_tick(void **state) {
    (void)state;
    const int64_t delays[] = {0, 1, 9, 10, 11, 25, 1000};
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake writer = {.on_step = write_command}, readers[7] = {{0}};
    fake *pw = &writer, *pr[7];
    char names[7][4];
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "w", pw, 10));
    for (int i = 0; i < 7; i++) {
        readers[i].on_step = check_latest;
        readers[i].value2 = delays[i];
        pr[i] = &readers[i];
        snprintf(names[i], sizeof names[i], "r%d", i);
        bst_instance_spec spec = FAKE_SPEC(command_reader, names[i], pr[i], 1);
        spec.delays[0] = (bst_input_delay){0, delays[i]};
        spec.delay_count = 1;
        fake_add(&ctx, engine, spec);
    }
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 5000));
    assert_int_equal(readers[6].steps, 5000);
    bst_engine_free(engine);
}

/* Reads all there is; messages must come in order, none twice. value: next expected id. */
static bst_status drain(fake *self, struct bst_step *step) {
    for (;;) {
        bst_sample s = bst_step_next(step, 0);
        if (!s.payload) {
            return BST_OK;
        }
        const bst_exposure *e = s.payload;
        assert_int_equal(e->id, self->value);
        assert_int_equal(s.sequence, self->value);
        self->value++;
        self->value2 = bst_step_tick(step) - s.written_tick;
    }
}

static void a_queue_gives_every_message_once(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake writer = {.on_step = write_exposure}, slow = {.on_step = drain}, late = {.on_step = drain},
         pushed = {.on_step = drain};
    fake *pw = &writer, *ps = &slow, *pl = &late, *pp = &pushed;
    fake_add(&ctx, engine, FAKE_SPEC(exposure_writer, "w", pw, 7));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_reader, "slow", ps, 500)); /* 71 or 72 at a time */
    bst_instance_spec spec = FAKE_SPEC(exposure_triggered, "late", pl, 0);
    spec.delays[0] = (bst_input_delay){0, 333};
    spec.delay_count = 1;
    fake_add(&ctx, engine, spec);
    fake_add(&ctx, engine, FAKE_SPEC(exposure_triggered, "pushed", pp, 0));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 7001));
    assert_int_equal(writer.value, 1001);
    assert_int_equal(slow.value,
                     7000 / 7 + 1); /* tick 7000 is one of its steps, and of the writer's */
    assert_int_equal(pushed.value, 1001);
    assert_int_equal(pushed.steps, 1001);
    assert_int_equal(pushed.value2, 0);
    assert_int_equal(late.value, (7000 - 333) / 7 + 1);
    assert_int_equal(late.value2, 333);
    assert_int_equal(fake_counter(engine, "queue_overflow"), 0);
    bst_engine_free(engine);
}

static bst_status burst(fake *self, struct bst_step *step) {
    for (int i = 0; i < 50; i++) {
        bst_exposure *e = bst_step_write(step, 0, NULL);
        e->id = self->value++;
    }
    return BST_OK;
}

static bst_status drain_gaps(fake *self, struct bst_step *step) {
    for (bst_sample s = bst_step_next(step, 0); s.payload; s = bst_step_next(step, 0)) {
        const bst_exposure *e = s.payload;
        assert_int_equal(e->id, s.sequence); /* what is read is what was written, never a slot
                                                that has been used again */
        assert_true(e->id >= self->value);
        self->value = e->id + 1;
        self->value2++;
    }
    return BST_OK;
}

/* 50 messages in one step where one is expected: the newest are kept, the lost ones counted. */
static void overflow_is_counted(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake writer = {.on_step = burst}, reader = {.on_step = drain_gaps};
    fake *pw = &writer, *pr = &reader;
    fake_add(&ctx, engine, FAKE_SPEC(exposure_writer, "w", pw, 10));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_triggered, "r", pr, 0));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 100));
    assert_int_equal(reader.steps, 10);
    assert_int_equal(reader.value, 500); /* the newest came through */
    assert_true(reader.value2 < 500);
    assert_int_equal(reader.value2 + fake_counter(engine, "queue_overflow"), 500);
    bst_engine_free(engine);
}

static bst_status write_until_50(fake *self, struct bst_step *step) {
    return bst_step_tick(step) <= 50 ? write_command(self, step) : BST_OK;
}

static bst_status count_stale(fake *self, struct bst_step *step) {
    bst_sample s = bst_step_latest(step, 0);
    assert_non_null(s.payload);
    int64_t age = bst_step_tick(step) - s.written_tick;
    assert_true(s.stale == (age > 25));
    self->value += s.stale;
    return BST_OK;
}

/* max_age_s 0.025 at 1 kHz: 25 ticks old is fresh, 26 is stale. The last message is of tick 50. */
static void old_messages_are_stale(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake writer = {.on_step = write_until_50}, reader = {.on_step = count_stale};
    fake *pw = &writer, *pr = &reader;
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "w", pw, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_fresh, "r", pr, 1));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 100));
    assert_int_equal(reader.value, 100 - 76);
    assert_int_equal(fake_counter(engine, "stale_input"), 100 - 76);
    bst_engine_free(engine);
}

static bst_status spoil(fake *self, struct bst_step *step) {
    bst_los_command *c = bst_step_modify(step, 0);
    /* steps every 5 ticks: there is a message of this tick every other time */
    assert_true((c != NULL) == (bst_step_tick(step) % 10 == 0));
    if (c) {
        c->tick += 1000000;
        self->value++;
    }
    return BST_OK;
}

static bst_status expect_spoiled(fake *self, struct bst_step *step) {
    bst_sample s = bst_step_latest(step, 0);
    const bst_los_command *c = s.payload;
    assert_non_null(c);
    assert_int_equal(c->tick, s.written_tick + 1000000);
    assert_int_equal(s.written_tick, bst_step_tick(step) / 10 * 10);
    self->value++;
    return BST_OK;
}

static bst_status see_message(void *user, const char *scope, const char *channel,
                              const void *payload, int64_t tick) {
    int64_t *seen = user;
    assert_string_equal(scope, "o/s");
    assert_string_equal(channel, "los_command");
    assert_int_equal(((const bst_los_command *)payload)->tick, tick); /* before it is modified */
    ++*seen;
    return BST_OK;
}

/* Names put the modifier last and the reader first: order follows from the ports alone. */
static void modified_messages_are_seen_by_all_readers(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake writer = {.on_step = write_command}, modifier = {.on_step = spoil},
         reader = {.on_step = expect_spoiled};
    fake *pw = &writer, *pm = &modifier, *pr = &reader;
    fake_add(&ctx, engine, FAKE_SPEC(command_reader, "a", pr, 1));
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "m", pw, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_modifier, "z", pm, 5));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    int64_t seen = 0;
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.user = &seen, .message = see_message});
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 100));
    assert_int_equal(modifier.value, 10);
    assert_int_equal(reader.value, 100);
    assert_int_equal(seen, 10);
    bst_engine_free(engine);
}

static bst_status expect_previous(fake *self, struct bst_step *step) {
    bst_sample s = bst_step_latest(step, 0);
    int64_t tick = bst_step_tick(step);
    self->value += s.payload != NULL;
    assert_int_equal(s.payload ? s.written_tick : -1, tick > 0 ? (tick - 1) / 10 * 10 : -1);
    return BST_OK;
}

/* A feedback input sees at tick t what was written before t, although its writer steps first. */
static void feedback_is_one_tick_late(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake writer = {.on_step = write_command}, reader = {.on_step = expect_previous};
    fake *pw = &writer, *pr = &reader;
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "a", pw, 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_feedback, "b", pr, 1));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 100));
    assert_int_equal(reader.value, 99); /* all but tick 0 */
    bst_engine_free(engine);
}

static bst_status expect_nothing(fake *self, struct bst_step *step) {
    (void)self;
    bst_sample a = bst_step_latest(step, 0), b = bst_step_next(step, 0);
    assert_true(!a.payload && a.stale && !b.payload && b.stale);
    assert_null(bst_step_modify(step, 0));
    return BST_OK;
}

static void an_optional_input_may_have_no_writer(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake reader = {.on_step = expect_nothing};
    fake *pr = &reader;
    fake_add(&ctx, engine, FAKE_SPEC(command_optional, "b", pr, 1));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 3));
    assert_int_equal(reader.steps, 3);
    bst_engine_free(engine);
}

/* Same channel names in two scopes are two channels. */
static void scopes_do_not_meet(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    fake w1 = {.on_step = write_exposure}, w2 = {.on_step = write_exposure, .value = 100};
    fake r1 = {.on_step = drain_gaps}, r2 = {.on_step = drain_gaps};
    fake *p[4] = {&w1, &w2, &r1, &r2};
    fake_add(&ctx, engine, FAKE_SPEC(exposure_writer, "a/s/w", p[0], 10));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_triggered, "a/s/r", p[2], 0));
    bst_instance_spec spec = FAKE_SPEC(exposure_writer, "b/s/w", p[1], 20);
    spec.scope = "o/other";
    w2.value = 0;
    fake_add(&ctx, engine, spec);
    spec = FAKE_SPEC(exposure_triggered, "b/s/r", p[3], 0);
    spec.scope = "o/other";
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 100));
    assert_int_equal(r1.value, 10);
    assert_int_equal(r2.value, 5);
    bst_engine_free(engine);
}

static bst_status set_capacity(fake *self, const bst_module_env *env) {
    if (self->value > 0) {
        bst_env_set_capacity(env, 0, (int)self->value);
    }
    assert_null(env->world);
    assert_null(env->device);
    return BST_OK;
}

static bst_status fill_tracks(fake *self, struct bst_step *step) {
    int capacity = -1;
    bst_tracks *t = bst_step_write(step, 0, &capacity);
    self->value2 = capacity;
    t->count = capacity;
    for (int i = 0; i < capacity; i++) {
        t->items[i].id = i; /* the sanitizers see whether the room is there */
    }
    return BST_OK;
}

static void capacities_are_those_asked_for(void **state) {
    (void)state;
    for (int64_t asked = 0; asked <= 9; asked += 9) {
        bst_ctx ctx = {0};
        bst_engine *engine = fake_engine(&ctx, 1000);
        fake w = {.on_step = fill_tracks, .on_create = set_capacity, .value = asked}, r = {0};
        fake *pw = &w, *pr = &r;
        fake_add(&ctx, engine, FAKE_SPEC(tracks_writer, "w", pw, 1));
        fake_add(&ctx, engine, FAKE_SPEC(tracks_reader, "r", pr, 1));
        bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
        bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 20));
        assert_int_equal(w.value2, asked ? asked : 5);
        bst_engine_free(engine);
    }
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
    assert_string_equal(ctx.message, "disk full");
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
        cmocka_unit_test(delays_are_exact_to_the_tick),
        cmocka_unit_test(a_queue_gives_every_message_once),
        cmocka_unit_test(overflow_is_counted),
        cmocka_unit_test(old_messages_are_stale),
        cmocka_unit_test(modified_messages_are_seen_by_all_readers),
        cmocka_unit_test(feedback_is_one_tick_late),
        cmocka_unit_test(an_optional_input_may_have_no_writer),
        cmocka_unit_test(scopes_do_not_meet),
        cmocka_unit_test(capacities_are_those_asked_for),
        cmocka_unit_test(events_counters_and_errors_come_out),
        cmocka_unit_test(a_hook_that_fails_ends_the_run),
        cmocka_unit_test(a_run_can_be_interrupted_and_resumed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
