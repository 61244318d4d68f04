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
                                            .flags = BST_MODULE_LINKS,
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

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_sensor_has_its_own)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
