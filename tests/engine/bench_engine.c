/* Prints what the engine itself costs per step: one module at 1 kHz with an in-place output and a
 * recorder's hook, alone and beside the slow modules of a closed loop. */
#include <time.h>

#include "tests/engine/fake_module.h"

static const bst_port plant_ports[] = {
    {.channel = "los_history", .direction = BST_PORT_OUT, .capacity = 4000},
    {.channel = "los_command",
     .direction = BST_PORT_IN,
     .flags = BST_PORT_OPTIONAL | BST_PORT_FEEDBACK}};
static const bst_port clock_ports[] = {{.channel = "exposure", .direction = BST_PORT_OUT}};
static const bst_port render_ports[] = {
    {.channel = "exposure", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = "los_history", .direction = BST_PORT_IN},
    {.channel = "frame", .direction = BST_PORT_OUT}};
static const bst_port imgproc_ports[] = {
    {.channel = "frame", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = "detections", .direction = BST_PORT_OUT, .capacity = 10}};
static const bst_port tracker_ports[] = {
    {.channel = "detections", .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = "tracks", .direction = BST_PORT_OUT, .capacity = 10}};
static const bst_port control_ports[] = {{.channel = "tracks", .direction = BST_PORT_IN},
                                         {.channel = "los_command", .direction = BST_PORT_OUT}};
static const bst_module_desc plant = FAKE_DESC(plant_ports), exposure = FAKE_DESC(clock_ports),
                             render = FAKE_DESC(render_ports), imgproc = FAKE_DESC(imgproc_ports),
                             tracker = FAKE_DESC(tracker_ports), control = FAKE_DESC(control_ports);

static bst_status step_plant(fake *self, struct bst_step *step) {
    (void)self;
    bst_los_history *h = bst_step_write(step, 0, NULL);
    h->capacity = 4000;
    h->items[h->written++ % 4000].tick = bst_step_tick(step);
    return BST_OK;
}

static bst_status read_write(fake *self, struct bst_step *step) {
    (void)bst_step_next(step, 0);
    (void)bst_step_write(step, (int)self->value, NULL);
    return BST_OK;
}

static bst_status write_exposure(fake *self, struct bst_step *step) {
    (void)self;
    (void)bst_step_write(step, 0, NULL);
    return BST_OK;
}

static bst_status no_hook(void *user, const char *scope, const char *channel, const void *payload,
                          int64_t tick) {
    (void)scope;
    (void)channel;
    (void)payload;
    *(int64_t *)user = tick;
    return BST_OK;
}

static bool go_on(void *user, int64_t tick) {
    (void)user;
    (void)tick;
    return false;
}

static double measure(bool loop) {
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, 6000);
    fake f[6] = {{.on_step = step_plant},
                 {.on_step = write_exposure},
                 {.on_step = read_write, .value = 2},
                 {.on_step = read_write, .value = 1},
                 {.on_step = read_write, .value = 1},
                 {.on_step = read_write, .value = 1}};
    fake *p[6];
    for (int i = 0; i < 6; i++) {
        p[i] = &f[i];
    }
    bst_instance_spec specs[6] = {
        FAKE_SPEC(plant, "gimbal", p[0], 6),    FAKE_SPEC(exposure, "exposure", p[1], 6000),
        FAKE_SPEC(render, "scenegen", p[2], 0), FAKE_SPEC(imgproc, "imgproc", p[3], 0),
        FAKE_SPEC(tracker, "tracker", p[4], 0), FAKE_SPEC(control, "control", p[5], 300)};
    for (int i = 2; i < 5; i++) {
        specs[i].delays[0] = (bst_input_delay){0, 900};
        specs[i].delay_count = 1;
    }
    for (int i = 0; i < (loop ? 6 : 1); i++) {
        fake_add(&ctx, engine, specs[i]);
    }
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    int64_t last = 0;
    bst_engine_set_hooks(
        engine, &(bst_engine_hooks){.user = &last, .message = no_hook, .interrupted = go_on});
    double best = 1e9;
    for (int round = 1; round <= 10; round++) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, round * 6000000LL)); /* 1000 s */
        clock_gettime(CLOCK_MONOTONIC, &b);
        double ns = 1e9 * (double)(b.tv_sec - a.tv_sec) + (double)(b.tv_nsec - a.tv_nsec);
        best = fmin(best, ns / 1e6);
    }
    bst_engine_free(engine);
    return best;
}

int main(void) {
    printf("one module at 1 kHz: %.1f ns per step\n", measure(false));
    printf("the same in a loop of six: %.1f ns per step\n", measure(true));
    return 0;
}
