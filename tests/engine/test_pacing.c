/* Simulated time by the wall clock, on a wall clock of the test's own: its readings and sleeps are
 * exact, and every figure follows by hand. */
#include <time.h>

#include "sim/engine/kernel/engine_internal.h"
#include "tests/engine/fake_module.h"

/* Seconds of the clock. A binary fraction, so that times add up without rounding. */
static double wall_s;
static int sleeps;

int __wrap_clock_gettime(clockid_t id, struct timespec *out);
int __wrap_clock_nanosleep(clockid_t id, int flags, const struct timespec *until,
                           struct timespec *left);

int __wrap_clock_gettime(clockid_t id, struct timespec *out) {
    (void)id;
    out->tv_sec = (time_t)wall_s;
    out->tv_nsec = (long)((wall_s - (double)out->tv_sec) * 1e9);
    return 0;
}

int __wrap_clock_nanosleep(clockid_t id, int flags, const struct timespec *until,
                           struct timespec *left) {
    (void)left;
    assert_int_equal(id, CLOCK_MONOTONIC);
    assert_int_equal(flags, TIMER_ABSTIME);
    double at = (double)until->tv_sec + 1e-9 * (double)until->tv_nsec;
    assert_true(at - wall_s < 0.0500001); /* a signal is answered within 50 ms */
    /* the kernel wakes after the time asked for, never before */
    wall_s = fmax(wall_s, at) + 2e-9;
    sleeps++;
    return 0;
}

/* A camera that makes a frame every 100 ticks of a millisecond, and one that finds detections in it
 * 20 ticks later and takes a time of its own for each. Speed 2: a frame every 0.05 s of the clock,
 * detections due 0.01 s after it. */
enum { RATE = 1000, PERIOD = 100, DELAY = 20, FRAMES = 10 };
#define EPS 1e-6 /* s: nanoseconds of the clock and of each sleep */

typedef struct scene {
    const double *work_s; /* [FRAMES] of the finder */
    bool dropped[FRAMES];
    double made_s[FRAMES], heard_s[FRAMES]; /* wall times */
    char event[200];
    int events;
    int asked, stop_at; /* the hook `interrupted` */
} scene;

static const bst_port camera_ports[] = {
    {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_OUT}};
static const bst_port finder_ports[] = {
    {.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_IN, .flags = BST_PORT_TRIGGER},
    {.channel = BST_CHANNEL_DETECTIONS, .direction = BST_PORT_OUT}};
static const bst_module_desc camera_module = {.abi = BST_MODULE_ABI,
                                              .role = "exposure",
                                              .type = "fake",
                                              .doc = "Makes frames.",
                                              .config_bytes = sizeof(fake *),
                                              .ports = camera_ports,
                                              .port_count = 1,
                                              .create = fake_create,
                                              .step = fake_step,
                                              .destroy = fake_destroy};
static const bst_module_desc finder_module = FAKE_DESC(finder_ports);

static bst_status make_frame(fake *self, struct bst_step *step) {
    scene *s = self->other;
    int64_t id = bst_step_tick(step) / PERIOD;
    s->dropped[id] = bst_pacing_frame(step, id);
    s->made_s[id] = wall_s;
    if (!s->dropped[id]) {
        *(bst_exposure *)bst_step_write(step, 0, NULL) = (bst_exposure){.id = id};
    }
    return BST_OK;
}

static bst_status find(fake *self, struct bst_step *step) {
    scene *s = self->other;
    int64_t id = ((const bst_exposure *)bst_step_next(step, 0).payload)->id;
    wall_s += s->work_s[id];
    s->heard_s[id] = wall_s;
    *(bst_detections *)bst_step_write(step, 1, NULL) = (bst_detections){.exposure_id = id};
    return BST_OK;
}

static bst_status keep_event(void *user, int64_t tick, const char *name, const char *kind,
                             const char *text) {
    scene *s = user;
    (void)tick;
    assert_string_equal(name, "camera");
    assert_string_equal(kind, "overrun");
    snprintf(s->event, sizeof s->event, "%s", text);
    s->events++;
    return BST_OK;
}

static bool stop(void *user, int64_t tick) {
    scene *s = user;
    (void)tick;
    return ++s->asked == s->stop_at;
}

static bst_status run(bst_ctx *ctx, scene *s, const bst_pacing_config *config, int64_t until,
                      bst_pacing_figures *out) {
    bst_engine *engine = fake_engine(ctx, RATE);
    fake camera = {.on_step = make_frame, .other = s}, finder = {.on_step = find, .other = s};
    fake *pc = &camera, *pf = &finder;
    bst_instance_spec spec = FAKE_SPEC(camera_module, "camera", pc, PERIOD);
    spec.frame_period_s = PERIOD / (double)RATE;
    fake_add(ctx, engine, spec);
    spec = FAKE_SPEC(finder_module, "finder", pf, 0);
    spec.frame_period_s = PERIOD / (double)RATE;
    spec.delays[0] = (bst_input_delay){0, DELAY};
    spec.delay_count = 1;
    fake_add(ctx, engine, spec);
    bst_assert_ok(ctx, bst_engine_load(ctx, engine));
    bst_engine_set_hooks(
        engine, &(bst_engine_hooks){
                    .user = s, .event = keep_event, .interrupted = s->stop_at ? stop : NULL});
    assert_false(bst_engine_pacing(engine, out));
    wall_s = 1000.25;
    sleeps = 0;
    bst_assert_ok(ctx, bst_engine_pace(ctx, engine, config));
    assert_int_equal(bst_engine_pace(ctx, engine, config), BST_ERR_STATE); /* once only */
    bst_status status = bst_engine_run(ctx, engine, until);
    assert_true(bst_engine_pacing(engine, out) == !config->replay);
    bst_engine_free(engine);
    return status;
}

static void check_histogram(const bst_pacing_figures *f, const int counts[BST_PACING_BINS]) {
    for (int i = 0; i < BST_PACING_BINS; i++) {
        assert_int_equal(f->histogram[i], counts[i]);
    }
}

/* Work as long as there is time for it, and once longer than the deadline of a frame period. */
static void frames_come_at_their_time(void **state) {
    (void)state;
    static const double work[FRAMES] = {0.004, 0.0005, 0.0575, 0.001, 0.012};
    bst_ctx ctx = {0};
    scene s = {.work_s = work};
    bst_pacing_figures f;
    bst_pacing_config c = {.mode = BST_PACING_REALTIME, .speed = 2, .cpu = -1};
    bst_assert_ok(&ctx, run(&ctx, &s, &c, 5 * PERIOD, &f));
    for (int i = 0; i < 5; i++) {
        /* the third one's detections come 0.0175 s into the next frame's period */
        double made = i == 3 ? 0.1675 : 0.05 * i;
        bst_assert_close(s.made_s[i] - 1000.25, made, EPS);
        double due = i == 3 ? 0.1675 : 0.05 * i + 0.01;
        bst_assert_close(s.heard_s[i] - 1000.25, due + work[i], EPS);
        assert_false(s.dropped[i]);
    }
    assert_int_equal(sleeps, 7); /* before each tick that is due later: seven of ten */
    assert_int_equal(f.frames, 5);
    assert_int_equal(f.done, 5);
    assert_int_equal(f.late, 1);
    assert_int_equal(f.overruns, 0); /* 0.0175 s behind, within the deadline */
    assert_int_equal(f.dropped, 0);
    assert_true(f.slipped_s == 0.0);
    bst_assert_close(f.deadline_s, 0.05, 1e-12);
    bst_assert_close(f.longest_s, 0.0575, EPS);
    /* the fourth was due at 0.16 and found at 0.1685 */
    bst_assert_close(f.sum_s, 0.004 + 0.0005 + 0.0575 + 0.0085 + 0.012, 5 * EPS);
    check_histogram(&f, (int[BST_PACING_BINS]){[0] = 1, [2] = 1, [3] = 1, [4] = 1, [10] = 1});
    assert_int_equal(s.events, 0);
    assert_false(f.priority || f.cpu);
}

/* The second frame's detections take 0.25 s: the third is due at 0.10 and made at 0.31. */
static const double hiccup[FRAMES] = {0.003, 0.25, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003};

static void an_overrun_sets_the_clock_back(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scene s = {.work_s = hiccup};
    bst_pacing_figures f;
    bst_pacing_config c = {
        .mode = BST_PACING_REALTIME, .overrun = BST_OVERRUN_SLIP, .speed = 2, .cpu = -1};
    bst_assert_ok(&ctx, run(&ctx, &s, &c, 8 * PERIOD, &f));
    assert_int_equal(f.overruns, 1);
    bst_assert_close(f.slipped_s, 0.21, EPS);
    for (int i = 2; i < 8; i++) {
        bst_assert_close(s.made_s[i] - 1000.25, 0.05 * i + 0.21, 2 * EPS);
        bst_assert_close(s.heard_s[i] - s.made_s[i], 0.013, EPS);
    }
    assert_int_equal(f.late, 1);
    assert_int_equal(f.done, 8);
    check_histogram(&f, (int[BST_PACING_BINS]){[2] = 7, [13] = 1});
    assert_string_equal(s.event, "0.210 s behind the clock: the clock is set back");
    assert_int_equal(s.events, 1);
}

static void an_overrun_drops_frames(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scene s = {.work_s = hiccup};
    bst_pacing_figures f;
    bst_pacing_config c = {
        .mode = BST_PACING_REALTIME, .overrun = BST_OVERRUN_DROP, .speed = 2, .cpu = -1};
    bst_assert_ok(&ctx, run(&ctx, &s, &c, 8 * PERIOD, &f));
    /* behind by 0.21, 0.16, 0.11, 0.06 s and then by 0.01 */
    for (int i = 0; i < 8; i++) {
        assert_true(s.dropped[i] == (i >= 2 && i < 6));
    }
    assert_int_equal(f.frames, 8);
    assert_int_equal(f.dropped, 4);
    assert_int_equal(f.overruns, 4);
    assert_int_equal(f.done, 4);
    assert_true(f.slipped_s == 0.0);
    bst_assert_close(s.made_s[7] - 1000.25, 0.35, EPS);
    assert_string_equal(s.event, "0.060 s behind the clock: the frame is dropped");
    assert_int_equal(s.events, 4);
}

static void an_overrun_hurries(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scene s = {.work_s = hiccup};
    bst_pacing_figures f;
    /* a deadline of its own; 0.31, 0.313, 0.316 s: behind by 0.21, 0.163, 0.116 s and so on */
    bst_pacing_config c = {.mode = BST_PACING_REALTIME,
                           .overrun = BST_OVERRUN_HOLD,
                           .speed = 2,
                           .deadline_s = 0.12,
                           .cpu = -1};
    bst_assert_ok(&ctx, run(&ctx, &s, &c, 8 * PERIOD, &f));
    assert_int_equal(f.overruns, 2);
    assert_int_equal(f.dropped, 0);
    assert_int_equal(f.done, 8);
    bst_assert_close(f.deadline_s, 0.12, 1e-12);
    /* responses of 0.25, 0.313 - 0.11 = 0.203, 0.156, 0.109 s ... */
    assert_int_equal(f.late, 3);
    bst_assert_close(s.heard_s[4] - 1000.25, 0.319, EPS);
    assert_string_equal(s.event, "0.163 s behind the clock: the run hurries");
}

/* Without a clock nothing is late, however long the machine has been up. */
static void fast_runs_lose_nothing(void **state) {
    (void)state;
    static const double work[FRAMES] = {0.25, 0.004, 0.3, 0.0175, 0.012};
    bst_ctx ctx = {0};
    scene s = {.work_s = work};
    bst_pacing_figures f;
    bst_pacing_config c = {
        .mode = BST_PACING_FAST, .overrun = BST_OVERRUN_DROP, .speed = 2, .cpu = -1};
    bst_assert_ok(&ctx, run(&ctx, &s, &c, 5 * PERIOD, &f));
    assert_int_equal(sleeps, 0);
    assert_int_equal(f.frames, 5);
    assert_int_equal(f.done, 5);
    assert_int_equal(f.dropped + f.overruns + s.events, 0);
    assert_true(f.slipped_s == 0.0);
    bst_assert_close(f.longest_s, 0.3, EPS);
    bst_assert_close(f.sum_s, 0.25 + 0.004 + 0.3 + 0.0175 + 0.012, 5 * EPS);
    /* a run that is repeated from a recording has no clock at all */
    c = (bst_pacing_config){.mode = BST_PACING_REALTIME, .speed = 2, .cpu = -1, .replay = true};
    s = (scene){.work_s = work};
    bst_assert_ok(&ctx, run(&ctx, &s, &c, 5 * PERIOD, &f));
    assert_int_equal(sleeps, 0);
    for (int i = 0; i < 5; i++) {
        assert_false(s.dropped[i]);
    }
}

/* A sensor without detections has dealt with a frame when it is made; one with neither is not
 * waited for. */
static const bst_port frame_ports[] = {{.channel = BST_CHANNEL_EXPOSURE, .direction = BST_PORT_OUT},
                                       {.channel = BST_CHANNEL_FRAME, .direction = BST_PORT_OUT}};
static const bst_module_desc frame_module = FAKE_DESC(frame_ports),
                             bare_module = FAKE_DESC(camera_ports);

static bst_status make_whole_frame(fake *self, struct bst_step *step) {
    int64_t id = bst_step_tick(step) / PERIOD;
    (void)bst_pacing_frame(step, id);
    *(bst_exposure *)bst_step_write(step, 0, NULL) = (bst_exposure){.id = id};
    if (self->value) {
        wall_s += 0.006;
        *(bst_frame_message *)bst_step_write(step, 1, NULL) =
            (bst_frame_message){.exposure_id = id};
    }
    return BST_OK;
}

static void frames_stand_for_detections(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_engine *engine = fake_engine(&ctx, RATE);
    fake whole = {.on_step = make_whole_frame, .value = 1}, bare = {.on_step = make_whole_frame};
    fake *pw = &whole, *pb = &bare;
    bst_instance_spec spec = FAKE_SPEC(frame_module, "whole", pw, PERIOD);
    spec.scope = "o/t";
    spec.frame_period_s = PERIOD / (double)RATE;
    fake_add(&ctx, engine, spec);
    spec = FAKE_SPEC(bare_module, "bare", pb, PERIOD);
    spec.scope = "o/u";
    spec.frame_period_s = 3 * PERIOD / (double)RATE;
    fake_add(&ctx, engine, spec);
    bst_assert_ok(&ctx, bst_engine_load(&ctx, engine));
    wall_s = 1000.25;
    bst_pacing_config c = {.mode = BST_PACING_REALTIME, .speed = 2, .cpu = -1};
    bst_pacing_figures f;
    bst_assert_ok(&ctx, bst_engine_pace(&ctx, engine, &c));
    bst_assert_ok(&ctx, bst_engine_run(&ctx, engine, 4 * PERIOD));
    assert_true(bst_engine_pacing(engine, &f));
    assert_int_equal(f.frames, 8);
    assert_int_equal(f.done, 4);
    bst_assert_close(f.sum_s, 4 * 0.006, 4 * EPS);
    bst_assert_close(f.deadline_s, 0.15, 1e-12); /* the longest: of the slower sensor */
    bst_engine_free(engine);
}

/* Asked about every 20 ms of wall time while it sleeps. */
static void a_sleep_is_interrupted(void **state) {
    (void)state;
    static const double work[FRAMES] = {0};
    bst_ctx ctx = {0};
    scene s = {.work_s = work, .stop_at = 5};
    bst_pacing_figures f;
    /* 50 s of the clock for a frame: the sleeps are the longest there are */
    bst_pacing_config c = {.mode = BST_PACING_REALTIME, .speed = 0.002, .cpu = -1};
    assert_int_equal(run(&ctx, &s, &c, 5 * PERIOD, &f), BST_ERR_INTERRUPTED);
    assert_int_equal(s.asked, 5);
    bst_assert_close(wall_s - 1000.25, 5 * 0.05, 1e-5);
    assert_string_equal(ctx.message, "interrupted at 0.020 s"); /* of simulated time */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_come_at_their_time),
        cmocka_unit_test(an_overrun_sets_the_clock_back),
        cmocka_unit_test(an_overrun_drops_frames),
        cmocka_unit_test(an_overrun_hurries),
        cmocka_unit_test(fast_runs_lose_nothing),
        cmocka_unit_test(a_sleep_is_interrupted),
        cmocka_unit_test(frames_stand_for_detections),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
