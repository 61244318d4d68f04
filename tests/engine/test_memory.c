/* What channels hold: frames go back to their makers, and stepping allocates nothing. */
#include "tests/engine/fake_module.h"

static const bst_port out_exposure[] = {{.channel = "exposure", .direction = BST_PORT_OUT}};
static const bst_port trigger_exposure[] = {
    {.channel = "exposure", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER}};
static const bst_port out_command[] = {{.channel = "los_command", .direction = BST_PORT_OUT}};
static const bst_port in_command[] = {{.channel = "los_command", .direction = BST_PORT_IN}};
static const bst_port out_frame[] = {{.channel = "frame", .direction = BST_PORT_OUT}};
static const bst_port in_frame[] = {
    {.channel = "frame", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER}};
static const bst_module_desc exposure_writer = FAKE_DESC(out_exposure),
                             exposure_triggered = FAKE_DESC(trigger_exposure),
                             command_writer = FAKE_DESC(out_command),
                             command_reader = FAKE_DESC(in_command),
                             frame_writer = FAKE_DESC(out_frame),
                             frame_reader = FAKE_DESC(in_frame);

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

static bst_status read_latest(fake *self, struct bst_step *step) {
    self->value += bst_step_latest(step, 0).payload != NULL;
    return BST_OK;
}

static bst_status read_all(fake *self, struct bst_step *step) {
    while (bst_step_next(step, 0).payload) {
        self->value++;
    }
    return BST_OK;
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

    /* no reader: returned at once */
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
         c = {.on_step = write_command}, d = {.on_step = read_latest},
         e = {.on_step = write_exposure}, g = {.on_step = read_all};
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
    assert_int_equal(d.value, 100000);
    assert_int_equal(g.value, e.value);
    bst_engine_free(engine);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_go_back_after_the_last_reader),
        cmocka_unit_test(a_reader_that_does_not_read_blocks_nothing),
        cmocka_unit_test(stepping_allocates_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
