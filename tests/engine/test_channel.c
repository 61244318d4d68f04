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
static const bst_port out_frame[] = {{.channel = "frame", .direction = BST_PORT_OUT}};
static const bst_port in_frame[] = {
    {.channel = "frame", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER}};
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
                             frame_writer = FAKE_DESC(out_frame),
                             frame_reader = FAKE_DESC(in_frame),
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
    assert_int_equal(s.payload ? s.written_tick : -1,
                     (tick + 9) / 10 * 10 - 10 < 0 ? -1 : (tick + 9) / 10 * 10 - 10);
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

/* A maker of frames that counts what is out. */
typedef struct pool {
    bst_frame frames[4];
    int out, most, recycled;
} pool;

static void recycle(void *owner) {
    pool *p = owner;
    p->out--;
    p->recycled++;
}
static const bst_frame_ops pool_ops = {.recycle = recycle};

static bst_status write_frame(fake *self, struct bst_step *step) {
    pool *p = self->other;
    bst_frame *free_frame = NULL;
    for (int i = 0; i < 4; i++) {
        if (p->frames[i].references == 0) {
            free_frame = &p->frames[i];
        }
    }
    assert_non_null(free_frame);
    *free_frame = (bst_frame){.ops = &pool_ops, .owner = p, .references = 1};
    p->out++;
    p->most = p->out > p->most ? p->out : p->most;
    bst_frame_message *m = bst_step_write(step, 0, NULL);
    *m = (bst_frame_message){.frame = free_frame, .exposure_id = self->value++};
    return BST_OK;
}

static bst_status read_frame(fake *self, struct bst_step *step) {
    for (bst_sample s = bst_step_next(step, 0); s.payload; s = bst_step_next(step, 0)) {
        const bst_frame_message *m = s.payload;
        assert_non_null(m->frame);
        assert_true(m->frame->references > 0);
        assert_int_equal(m->exposure_id, self->value);
        self->value++;
    }
    return BST_OK;
}

/* Frames of a period of 100 ticks, read at once and 250 ticks later: three are out at most, and all
 * come back, the last ones when the engine is freed. */
static void frames_go_back_after_the_last_reader(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    pool p = {0};
    fake w = {.on_step = write_frame, .other = &p}, now = {.on_step = read_frame},
         late = {.on_step = read_frame};
    fake *pw = &w, *pn = &now, *pl = &late;
    fake_add(&ctx, engine, FAKE_SPEC(frame_writer, "w", pw, 100));
    fake_add(&ctx, engine, FAKE_SPEC(frame_reader, "now", pn, 0));
    bst_instance_spec spec = FAKE_SPEC(frame_reader, "late", pl, 0);
    spec.delays[0] = (bst_input_delay){0, 250};
    spec.delay_count = 1;
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 250));
    assert_int_equal(p.out, 3);
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 251));
    assert_int_equal(p.out, 2); /* in the very tick of the last reading */
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 10000));
    assert_int_equal(w.value, 100);
    assert_int_equal(now.value, 100);
    assert_int_equal(late.value, (9999 - 250) / 100 + 1);
    assert_int_equal(p.most, 3);
    bst_engine_free(engine);
    assert_int_equal(p.out, 0);
    assert_int_equal(p.recycled, 100);

    /* nobody reads: back at once */
    p = (pool){0};
    w = (fake){.on_step = write_frame, .other = &p};
    engine = fake_engine(&ctx, 1000);
    fake_add(&ctx, engine, FAKE_SPEC(frame_writer, "w", pw, 100));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 1000));
    assert_int_equal(p.out, 0);
    assert_int_equal(p.most, 1);
    bst_engine_free(engine);
}

static bst_status ignore_frame(fake *self, struct bst_step *step) {
    (void)self;
    (void)bst_step_latest(step, 0); /* never takes what is queued */
    return BST_OK;
}

/* A reader that never takes frames holds no more than the queue's depth, and loses none for good.
 */
static void a_reader_that_does_not_read_blocks_nothing(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 1000);
    pool p = {0};
    fake w = {.on_step = write_frame, .other = &p}, lazy = {.on_step = ignore_frame};
    fake *pw = &w, *pl = &lazy;
    fake_add(&ctx, engine, FAKE_SPEC(frame_writer, "w", pw, 100));
    fake_add(&ctx, engine, FAKE_SPEC(frame_reader, "lazy", pl, 0));
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 10000));
    assert_true(p.out <= 3); /* depth without delay */
    bst_engine_free(engine);
    assert_int_equal(p.recycled, 100);
}

/* Allocations by the code under test, which is linked with these in place of the C library's. */
static int64_t allocations;
void *__real_malloc(size_t bytes);
void *__real_calloc(size_t n, size_t bytes);
void *__real_realloc(void *old, size_t bytes);
void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t n, size_t bytes);
void *__wrap_realloc(void *old, size_t bytes);
void *__wrap_malloc(size_t bytes) {
    allocations++;
    return __real_malloc(bytes);
}
void *__wrap_calloc(size_t n, size_t bytes) {
    allocations++;
    return __real_calloc(n, bytes);
}
void *__wrap_realloc(void *old, size_t bytes) {
    allocations++;
    return __real_realloc(old, bytes);
}

static bst_status busy_hook(void *user, const char *scope, const char *channel, const void *payload,
                            int64_t tick) {
    (void)user;
    (void)scope;
    (void)channel;
    (void)payload;
    (void)tick;
    return BST_OK;
}

static void stepping_allocates_nothing(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 6000);
    pool p = {0};
    fake w = {.on_step = write_frame, .other = &p}, r = {.on_step = read_frame},
         c = {.on_step = write_command}, d = {.on_step = check_latest},
         e = {.on_step = write_exposure}, g = {.on_step = drain};
    fake *q[6] = {&w, &r, &c, &d, &e, &g};
    fake_add(&ctx, engine, FAKE_SPEC(frame_writer, "w", q[0], 60));
    fake_add(&ctx, engine, FAKE_SPEC(frame_reader, "r", q[1], 0));
    fake_add(&ctx, engine, FAKE_SPEC(command_writer, "c", q[2], 10));
    fake_add(&ctx, engine, FAKE_SPEC(command_reader, "d", q[3], 1));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_writer, "e", q[4], 6));
    fake_add(&ctx, engine, FAKE_SPEC(exposure_triggered, "g", q[5], 0));
    int64_t before = allocations;
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    assert_true(allocations > before); /* the wrapper works */
    bst_engine_set_hooks(engine, &(bst_engine_hooks){.message = busy_hook});
    before = allocations;
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 100000));
    assert_int_equal(allocations, before);
    assert_int_equal(d.steps, 100000);
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
        cmocka_unit_test(frames_go_back_after_the_last_reader),
        cmocka_unit_test(a_reader_that_does_not_read_blocks_nothing),
        cmocka_unit_test(stepping_allocates_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
