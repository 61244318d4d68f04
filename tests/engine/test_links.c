/* A module that links sensors: its ports are there once for each, in their scopes. */
#include "tests/engine/fake_module.h"

static const bst_port sensor_ports[] = {
    {.channel = "control_status", .direction = BST_PORT_OUT},
    {.channel = "task", .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
};
static const bst_port link_ports[] = {
    {.channel = "control_status", .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL},
    {.channel = "task", .direction = BST_PORT_OUT},
};
enum { STATUS, TASK, PORTS, SENSORS = 40 };
static const bst_module_desc sensor_module = FAKE_DESC(sensor_ports),
                             link_module = {.abi = BST_MODULE_ABI,
                                            .role = "fake",
                                            .type = "link",
                                            .doc = "Links.",
                                            .flags = BST_MODULE_MULTI_SENSOR,
                                            .config_bytes = sizeof(fake *),
                                            .ports = link_ports,
                                            .port_count = PORTS,
                                            .create = fake_create,
                                            .step = fake_step,
                                            .destroy = fake_destroy};

/* value: its number; value2: the last task's object. A task is seen a tick after it was written. */
static bst_status sensor_step(fake *self, struct bst_step *step) {
    bst_control_status *status = bst_step_write(step, STATUS, NULL);
    status->target_id = 100 * self->value + bst_step_tick(step);
    bst_sample task = bst_step_latest(step, TASK);
    if (bst_step_tick(step) == 0) {
        assert_null(task.payload);
    } else {
        const bst_task *t = task.payload;
        assert_int_equal(t->object, self->value);
        assert_int_equal(t->id, 100 * self->value + (bst_step_tick(step) - 1) / 10 * 10);
    }
    return BST_OK;
}

static bst_status link_create(fake *self, const bst_module_env *env) {
    (void)self;
    assert_int_equal(env->member_count, SENSORS);
    assert_null(env->knowledge);
    assert_null(env->world); /* it does not say that it reads the truth */
    for (int i = 0; i < SENSORS; i++) {
        assert_int_equal(env->members[i].observer, i);
    }
    return BST_OK;
}

static bst_status link_step(fake *self, struct bst_step *step) {
    (void)self;
    for (int i = 0; i < SENSORS; i++) {
        const bst_control_status *status =
            bst_step_latest(step, bst_member_port(PORTS, i, STATUS)).payload;
        /* writers step before it within a tick */
        assert_int_equal(status->target_id, 100 * i + bst_step_tick(step));
        bst_task *task = bst_step_write(step, bst_member_port(PORTS, i, TASK), NULL);
        *task = (bst_task){.id = status->target_id, .object = i};
    }
    return BST_OK;
}

static bst_status count_tasks(void *user, const char *scope, const char *channel,
                              const void *payload, int64_t tick) {
    int *counts = user;
    (void)tick;
    if (strcmp(channel, "task") == 0) {
        int sensor = atoi(scope + 1);
        assert_int_equal(((const bst_task *)payload)->object, sensor);
        counts[sensor]++;
    }
    return BST_OK;
}

static void every_sensor_has_its_own(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 10);
    static fake sensors[SENSORS];
    static char scopes[SENSORS][16], names[SENSORS][24];
    static bst_fleet_member members[SENSORS];
    fake *pointers[SENSORS], link = {.on_step = link_step, .on_create = link_create};
    fake *link_pointer = &link;
    int counts[SENSORS] = {0};
    for (int i = 0; i < SENSORS; i++) {
        sensors[i] = (fake){.on_step = sensor_step, .value = i};
        pointers[i] = &sensors[i];
        snprintf(scopes[i], sizeof scopes[i], "o%d/s", i);
        snprintf(names[i], sizeof names[i], "o%d/s/fake", i);
        members[i] = (bst_fleet_member){.scope = scopes[i], .observer = i};
        bst_instance_spec spec = FAKE_SPEC(sensor_module, names[i], pointers[i], 1);
        spec.scope = scopes[i];
        fake_add(&ctx, engine, spec);
    }
    bst_instance_spec spec = FAKE_SPEC(link_module, "a_link", link_pointer, 10);
    spec.scope = "";
    spec.members = members;
    spec.member_count = SENSORS;
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    const bst_engine_hooks hooks = {.user = counts, .message = count_tasks};
    bst_engine_set_hooks(engine, &hooks);
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 95));
    assert_int_equal(link.steps, 10);
    for (int i = 0; i < SENSORS; i++) {
        assert_int_equal(sensors[i].steps, 95);
        assert_int_equal(counts[i], 10);
    }
    bst_engine_free(engine);
    assert_int_equal(link.destroyed, 1);
}

/* What the hooks see, as text. */
typedef struct heard {
    char *text;
    size_t used;
} heard;

static void hear(heard *h, int64_t tick, const char *who, const char *what) {
    h->used += (size_t)snprintf(h->text + h->used, 200, "%lld %s %s\n", (long long)tick, who, what);
}

static bst_status hear_message(void *user, const char *scope, const char *channel,
                               const void *payload, int64_t tick) {
    (void)payload;
    hear(user, tick, scope, channel);
    return BST_OK;
}

static bst_status hear_event(void *user, int64_t tick, const char *instance, const char *kind,
                             const char *text) {
    (void)kind;
    hear(user, tick, instance, text);
    return BST_OK;
}

/* Fails at tick value2; reports every fifth tick. */
static bst_status busy_step(fake *self, struct bst_step *step) {
    if (bst_step_tick(step) == self->value2) {
        bst_step_event(step, "end", "of %d", (int)self->value);
        return bst_fail(bst_step_ctx(step), BST_ERR_NUMERIC, "number %d", (int)self->value);
    }
    if (bst_step_tick(step) % 5 == 0) {
        bst_step_event(step, "tell", "tick of %d", (int)self->value);
    }
    bst_control_status *status = bst_step_write(step, STATUS, NULL);
    status->target_id = self->value;
    return BST_OK;
}

static bst_status quiet_link_step(fake *self, struct bst_step *step) {
    (void)self;
    bst_step_event(step, "tell", "link");
    for (int i = 0; i < 4; i++) {
        bst_task *task = bst_step_write(step, bst_member_port(PORTS, i, TASK), NULL);
        task->object = i;
    }
    return BST_OK;
}

static const bst_port ahead_sensor_ports[] = {
    {.channel = "control_status", .direction = BST_PORT_OUT},
    {.channel = "exposure", .direction = BST_PORT_OUT},
    {.channel = "task", .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK},
};
static const bst_port ahead_link_ports[] = {
    {.channel = "control_status", .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL},
    {.channel = "exposure", .direction = BST_PORT_IN, .flags = BST_PORT_OPTIONAL},
    {.channel = "task", .direction = BST_PORT_OUT},
};
enum { AHEAD_EXPOSURE = 1, AHEAD_TASK, AHEAD_PORTS };
static const bst_module_desc ahead_sensor_module = FAKE_DESC(ahead_sensor_ports),
                             ahead_link_module = {
                                 .abi = BST_MODULE_ABI,
                                 .role = "fake",
                                 .type = "ahead",
                                 .doc = "Links, and lookahead.",
                                 .flags = BST_MODULE_MULTI_SENSOR | BST_MODULE_HAS_LOOKAHEAD,
                                 .config_bytes = sizeof(fake *),
                                 .ports = ahead_link_ports,
                                 .port_count = AHEAD_PORTS,
                                 .create = fake_create,
                                 .step = fake_step,
                                 .destroy = fake_destroy};

/* value2: as in busy_step. Publishes its task, and writes two exposures every third step. */
static bst_status ahead_sensor_step(fake *self, struct bst_step *step) {
    const bst_task *task = bst_step_latest(step, AHEAD_TASK).payload;
    bst_step_event(step, "tell", "task %d", task ? (int)task->id : -1);
    for (int i = 0; i < 2 && self->steps % 3 == 0; i++) {
        bst_exposure *exposure = bst_step_write(step, AHEAD_EXPOSURE, NULL);
        exposure->id = 2 * self->steps + i;
    }
    return busy_step(self, step);
}

/* Reports what it reads; gives each sensor a task for a while and declares a part of it as
 * lookahead. With value set it violates its lookahead at that tick. */
static bst_status ahead_link_step(fake *self, struct bst_step *step) {
    int64_t tick = bst_step_tick(step);
    for (int i = 0; i < 4; i++) {
        int base = bst_member_port(AHEAD_PORTS, i, 0);
        bst_sample status = bst_step_latest(step, base);
        char text[100] = "";
        bst_sample next = bst_step_next(step, base + AHEAD_EXPOSURE);
        for (; next.payload; next = bst_step_next(step, base + AHEAD_EXPOSURE)) {
            snprintf(text + strlen(text), sizeof text - strlen(text), " %lld at %lld",
                     (long long)((const bst_exposure *)next.payload)->id,
                     (long long)next.written_tick);
        }
        bst_step_event(step, "tell", "%d: %lld at %lld,%s", i, (long long)status.sequence,
                       (long long)status.written_tick, text);
        int64_t holds = 14 * (i + 1); /* ticks */
        if (tick % holds == 0 || tick == self->value) {
            bst_task *task = bst_step_write(step, base + AHEAD_TASK, NULL);
            task->id = tick;
        }
        bst_step_set_lookahead(step, base + AHEAD_TASK,
                               (tick / holds + 1) * holds - (i == 2 ? 7 : 0));
    }
    return BST_OK;
}

static bst_status play(heard *h, int threads, const int64_t fails[4], const fake *ahead,
                       char message[200]) {
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 10);
    static const char *const scopes[] = {"o0/s", "o1/s", "o2/s", "o3/s"};
    static const char *const names[] = {"o0/s/fake", "o1/s/fake", "o2/s/fake", "o3/s/fake"};
    fake sensors[4], *pointers[4], link = {.on_step = quiet_link_step}, *link_pointer = &link;
    link = ahead ? *ahead : link;
    bst_fleet_member members[4];
    for (int i = 0; i < 4; i++) {
        sensors[i] = (fake){
            .on_step = ahead ? ahead_sensor_step : busy_step, .value = i, .value2 = fails[i]};
        pointers[i] = &sensors[i];
        members[i] = (bst_fleet_member){.scope = scopes[i], .observer = i};
        bst_instance_spec spec = FAKE_SPEC(sensor_module, names[i], pointers[i], 1 + i);
        spec.desc = ahead ? &ahead_sensor_module : spec.desc;
        spec.scope = scopes[i];
        fake_add(&ctx, engine, spec);
    }
    bst_instance_spec spec = FAKE_SPEC(link_module, "link", link_pointer, 7);
    spec.desc = ahead ? &ahead_link_module : spec.desc;
    spec.scope = "";
    spec.members = members;
    spec.member_count = 4;
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    if (threads > 1) {
        bst_assert_ok(&ctx, bst_engine_parallel(&ctx, engine, threads));
    }
    const bst_engine_hooks hooks = {.user = h, .message = hear_message, .event = hear_event};
    bst_engine_set_hooks(engine, &hooks);
    bst_status status = bst_engine_run(&ctx, engine, 100);
    if (status == BST_OK) {
        status = bst_engine_run(&ctx, engine, 203);
    }
    snprintf(message, 200, "%.199s", ctx.message);
    bst_engine_free(engine);
    return status;
}

/* Plays with one thread and with several: all is heard alike. */
static void assert_alike(const int64_t fails[4], const fake *ahead, bst_status expected) {
    char message[2][200];
    heard serial = {.text = test_calloc(1, 400000)}, parted = {.text = test_calloc(1, 400000)};
    assert_int_equal(play(&serial, 1, fails, ahead, message[0]), expected);
    assert_true(serial.used > 5000);
    for (int threads = 2; threads <= 5; threads++) {
        parted.used = 0;
        assert_int_equal(play(&parted, threads, fails, ahead, message[1]), expected);
        assert_string_equal(serial.text, parted.text);
        assert_string_equal(message[0], message[1]);
    }
    test_free(serial.text);
    test_free(parted.text);
}

static const int64_t never[4] = {-1, -1, -1, -1}, some[4] = {-1, 180, 174, 180};

static void threads_change_nothing_that_is_heard(void **state) {
    (void)state;
    assert_alike(never, NULL, BST_OK);
    assert_alike(some, NULL, BST_ERR_NUMERIC);
}

static void nor_do_sensors_that_go_ahead(void **state) {
    (void)state;
    fake link = {.on_step = ahead_link_step, .value = -1};
    assert_alike(never, &link, BST_OK);
    assert_alike(some, &link, BST_ERR_NUMERIC);
    link.value = 91; /* the lookahead is violated */
    assert_alike(never, &link, BST_ERR_STATE);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_sensor_has_its_own),
                                       cmocka_unit_test(threads_change_nothing_that_is_heard),
                                       cmocka_unit_test(nor_do_sensors_that_go_ahead)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
