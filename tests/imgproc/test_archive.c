/* Image processing that is saved between any two frames and restored elsewhere goes on to the bit,
 * on one thread and on several. */
#include "boresight/stages.h"
#include "imgproc/detect/plugin_detector.h"
#include "tests/archive_support.h"
#include "tests/imgproc/module_support.h"

enum { FRAMES = 12, PERIOD = 1000, HOT = 40, NEW_STARS = 5, LAST = (FRAMES + 1) * PERIOD };

/* Pixels of the sequence: stars that a dithered pointing moves, one object, hot pixels, charge. */
typedef struct sequence {
    bst_quat q[FRAMES];
    double object_px[FRAMES][2];
    uint16_t *pixels[FRAMES];
} sequence;

/* One run over a part of the sequence. */
typedef struct run {
    bench b;
    const sequence *shown;
    int first; /* frame */
    bst_frame frames[FRAMES];
} run;

static void *module_self;

static bst_status create_and_tell(const bst_module_env *env, const void *config, void **self) {
    bst_status status = bst_imgproc_module.create(env, config, self);
    module_self = *self;
    return status;
}

static bst_quat attitude(const sequence *s, int64_t tick) {
    int64_t frame = (tick + 7 * PERIOD / 10) / PERIOD - 1; /* slews between the exposures */
    return s->q[frame < 0 ? 0 : frame < FRAMES ? frame : FRAMES - 1];
}

static bst_status write_pointing(fake *self, struct bst_step *step) {
    const run *r = self->other;
    int capacity;
    bst_pointing_telemetry *t = bst_step_write(step, 0, &capacity);
    int64_t tick = bst_step_tick(step);
    bst_quat q = attitude(r->shown, tick);
    t->capacity = capacity;
    t->settled = true;
    t->q_body_from_gcrf = q;
    t->items[t->written++ % capacity] = (bst_pointing_sample){.tick = tick, .q_cam_from_gcrf = q};
    return BST_OK;
}

/* The tracker's prediction of the object, where it is in the next frame. */
static bst_status write_predictions(fake *self, struct bst_step *step) {
    const run *r = self->other;
    int64_t tick = bst_step_tick(step), frame = tick / PERIOD;
    frame = frame < FRAMES ? frame : FRAMES - 1;
    bst_predictions *out = bst_step_write(step, 0, NULL);
    bst_vec3 seen = bst_camera_unproject(&r->b.s.camera, r->shown->object_px[frame][0],
                                         r->shown->object_px[frame][1]);
    bst_vec3 apparent = bst_quat_rotate(bst_quat_conj(r->shown->q[frame]), seen);
    const bst_light light = {r->b.o.nav.velocity_bary_mps, r->b.o.nav.sun_m};
    *out = (bst_predictions){.tick = tick, .attitude_valid = true, .count = 1};
    out->items[0] = (bst_prediction){.track_id = 1,
                                     .direction_gcrf = bst_light_catalogue_star(&light, apparent),
                                     .sigma_rad = 1e-5,
                                     .target_of_interest = true};
    return BST_OK;
}

static bst_status write_frame(fake *self, struct bst_step *step) {
    run *r = self->other;
    int64_t end = bst_step_tick(step), frame = end / PERIOD - 1;
    if (frame < r->first || frame >= FRAMES) {
        return BST_OK;
    }
    bst_frame_message *message = bst_step_write(step, 0, NULL);
    bst_frame_retain(&r->frames[frame]);
    *message = (bst_frame_message){.frame = &r->frames[frame],
                                   .exposure_id = frame,
                                   .start_tick = end - BENCH_EXPOSURE,
                                   .end_tick = end,
                                   .window = {0, 0, ONBOARD_SIDE, ONBOARD_SIDE},
                                   .binning = 1,
                                   .bits = 16};
    return BST_OK;
}

static bst_status map_pixels(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)ctx;
    *pixels = owner;
    return BST_OK;
}
static void no_change(void *owner) {
    (void)owner;
}
/* host memory, without a buffer on the device: as a restored frame */
static const bst_frame_ops host_frame = {
    .map = map_pixels, .unmap = no_change, .recycle = no_change};

/* Draws stars that no catalogue has and that appear one after the other; the last one drifts. */
static void draw_new_stars(bench *b, const sequence *s, int frame) {
    for (int k = 0; k < NEW_STARS; k++) {
        double x, y;
        double drift_px = k == NEW_STARS - 1 ? 0.4 * frame : 0.0;
        bst_vec3 seen =
            bst_camera_unproject(&b->s.camera, 70.0 + 90.0 * k + drift_px, 455.0 - 7.0 * k);
        bst_vec3 at = bst_quat_rotate(bst_quat_conj(s->q[0]), seen);
        if (frame >= (2 + 2 * k) % 9 &&
            bst_camera_project(&b->s.camera, bst_quat_rotate(s->q[frame], at), &x, &y)) {
            synthetic_add(&b->s, x, y, 3000.0, 0, 0);
        }
    }
}

/* Draws the frames of the sequence. */
static void draw(sequence *s) {
    bench b;
    bench_init(&b);
    for (int i = 0; i < FRAMES; i++) {
        const double scale = 12.0 * BST_ARCSEC_RAD;
        int at = i == 6 ? 5 : i; /* once the sky rests, and nothing is learned */
        bst_vec3 turn = {(at % 3 - 1) * 7.3 * scale, (at % 4 - 1.5) * 5.7 * scale, 0.0};
        s->q[i] = bst_quat_mul(bst_quat_from_rotvec(turn), b.o.q_telemetry);
        b.o.q_true = s->q[i];
        onboard_find_stars(&b.o);
        synthetic_clear(&b.s);
        bench_draw_stars(&b);
        draw_new_stars(&b, s, i);
        s->object_px[i][0] = 150.0 + 11.0 * i;
        s->object_px[i][1] = 200.0 + 6.0 * i;
        synthetic_add(&b.s, s->object_px[i][0], s->object_px[i][1], 4000.0, 0, 0);
        synthetic_add(&b.s, 300.0 + 9.0 * i, 380.0 - 4.0 * i, 2500.0, 14.0, 6.0);
        for (int k = 0; k < (i < 5 ? HOT - 8 : HOT);
             k++) { /* the same pixels of the sensor in all frames */
            b.s.mean_e[(37 + 11 * k) * ONBOARD_SIDE + (53 + 131 * k) % ONBOARD_SIDE] += 900.0;
        }
        /* charge that does not return */
        b.s.mean_e[(61 + 29 * i) * ONBOARD_SIDE + (97 + 53 * i) % ONBOARD_SIDE] += 3000.0;
        synthetic_expose(&b.s, bst_rng_make_key(5, 0, "test", "archive"), (uint64_t)i + 1);
        size_t bytes = (size_t)ONBOARD_SIDE * ONBOARD_SIDE * sizeof *s->pixels[i];
        s->pixels[i] = malloc(bytes);
        memcpy(s->pixels[i], b.s.pixels, bytes);
    }
    bench_free(&b);
}

/* An engine whose camera shows the frames from `first` on. */
static void begin(run *r, const sequence *s, const char *block, int first, int threads) {
    static bst_module_desc desc;
    static const bst_port ports[] = {
        {.channel = BST_CHANNEL_PREDICTIONS, .direction = BST_PORT_OUT, .capacity = 1}};
    static const bst_module_desc tracker = FAKE_DESC(ports);
    desc = bst_imgproc_module;
    desc.create = create_and_tell;
    memset(r, 0, sizeof *r);
    bench *b = &r->b;
    bench_init(b);
    r->shown = s;
    r->first = first;
    for (int i = 0; i < FRAMES; i++) {
        r->frames[i] = (bst_frame){.ops = &host_frame,
                                   .owner = s->pixels[i],
                                   .width = ONBOARD_SIDE,
                                   .height = ONBOARD_SIDE,
                                   .references = 1};
    }
    bst_ctx *ctx = &b->o.ctx;
    if (block) {
        bst_assert_ok(ctx, bench_configure(b, block));
    }
    b->camera = (fake){.on_step = write_frame, .other = r};
    b->tracker = (fake){.on_step = write_predictions, .other = r};
    b->o.pointing = (fake){.on_step = write_pointing, .other = r};
    onboard_add_telemetry(&b->o, 0, 0);
    bst_instance_spec camera = FAKE_SPEC(bench_camera_desc, "camera", b->camera_p, PERIOD);
    camera.offset_ticks = PERIOD;
    fake_add(ctx, b->o.engine, camera);
    fake_add(ctx, b->o.engine, FAKE_SPEC(tracker, "tracker", b->tracker_p, PERIOD));
    fake_add(ctx, b->o.engine,
             (bst_instance_spec){.desc = &desc,
                                 .scope = "o/s",
                                 .instance = "imgproc",
                                 .config = &b->config,
                                 .knowledge = b->o.knowledge});
    bst_engine_hooks hooks = {.user = b, .message = bench_keep};
    static bst_ctx hook_ctx;
    hooks.ctx = &hook_ctx;
    bst_engine_set_hooks(b->o.engine, &hooks);
    bst_assert_ok(ctx, bst_engine_load(ctx, b->o.engine));
    if (threads > 1) {
        bst_assert_ok(ctx, bst_engine_parallel(ctx, b->o.engine, threads));
    }
}

static void advance(run *r, int64_t tick) {
    bst_assert_ok(&r->b.o.ctx, bst_engine_run(&r->b.o.ctx, r->b.o.engine, tick));
}

static void expect_same(const bst_detections *a, const bst_detections *b) {
    assert_int_equal(a->exposure_id, b->exposure_id);
    assert_int_equal(a->count, b->count);
    assert_memory_equal(a, b, sizeof *a + (size_t)a->count * sizeof a->items[0]);
}

/* Runs the sequence and saves the state after each frame; then goes on from some of them in new
 * modules, on `threads` threads. Returns the run for a look at what it exercised. */
static void play_and_restore(const sequence *s, const char *block, int saving_threads, int threads,
                             run *first) {
    test_saved saved[FRAMES];
    begin(first, s, block, 0, saving_threads);
    void *self = module_self;
    for (int k = 0; k < FRAMES; k++) {
        advance(first, (k + 1) * PERIOD + 1);
        saved[k] = test_save(bst_imgproc_module.archive, self);
    }
    advance(first, LAST);
    assert_int_equal(first->b.count, FRAMES);
    const test_saved last = test_save(bst_imgproc_module.archive, self);
    for (int k = 0; k < FRAMES; k += k < 6 ? 1 : 2) {
        run other;
        begin(&other, s, block, k + 1, threads);
        advance(&other, (k + 1) * PERIOD + 1);
        bst_assert_ok(&other.b.o.ctx, test_restore(&other.b.o.ctx, bst_imgproc_module.archive,
                                                   module_self, saved[k]));
        advance(&other, LAST);
        assert_int_equal(other.b.count, FRAMES - 1 - k);
        for (int i = 0; i < other.b.count; i++) {
            expect_same(other.b.kept[i], first->b.kept[k + 1 + i]);
        }
        const test_saved end = test_save(bst_imgproc_module.archive, module_self);
        assert_int_equal(end.size, last.size);
        assert_memory_equal(end.bytes, last.bytes, last.size);
        free(end.bytes);
        bench_free(&other.b);
    }
    free(last.bytes);
    for (int k = 0; k < FRAMES; k++) {
        free(saved[k].bytes);
    }
}

static const char rich[] =
    "{\"streak_search_px\": 24, \"stack\": {\"frames\": 4}, "
    "\"bad_pixel_learning\": {\"capacity\": 4096}}";

/* What each frame shows is remembered; on one thread, and saved on one to go on on two. */
static void any_frame(void **state) {
    const sequence *s = *state;
    run r;
    play_and_restore(s, rich, 1, 2, &r);
    /* it did learn, remember and stack */
    int stacked = 0, hot = 0;
    for (int k = 0; k < FRAMES; k++) {
        for (int i = 0; i < r.b.kept[k]->count; i++) {
            stacked += (r.b.kept[k]->items[i].flags & BST_DETECTION_STACK) != 0;
            hot += r.b.kept[k]->items[i].label == BST_LABEL_HOT_PIXEL;
        }
    }
    assert_true(r.b.kept[FRAMES - 1]->bad_pixels > HOT / 4);
    assert_true(hot > 0);
    assert_true(stacked > 0);
    bench_free(&r.b);
}

/* Saved on two threads: the lanes are anywhere. */
static void on_several_threads(void **state) {
    const sequence *s = *state;
    run r;
    play_and_restore(s, rich, 2, 1, &r);
    bench_free(&r.b);
}

/* Windows about predicted places: how faint their stars are follows from the frame before, on any
 * number of threads. */
static void windows(void **state) {
    const sequence *s = *state;
    static const char block[] =
        "{\"track_windows\": true, \"full_frame_period\": 6, "
        "\"full_frame_count\": 1, \"window_stars\": 12}";
    run one, two;
    play_and_restore(s, block, 1, 1, &one);
    play_and_restore(s, block, 2, 2, &two);
    int windowed = 0;
    for (int k = 0; k < FRAMES; k++) {
        expect_same(one.b.kept[k], two.b.kept[k]);
        windowed += one.b.kept[k]->windows > 1;
    }
    assert_true(windowed > FRAMES / 2);
    bench_free(&one.b);
    bench_free(&two.b);
}

static void damaged_states(void **state) {
    const sequence *s = *state;
    run r;
    begin(&r, s, rich, 0, 1);
    void *self = module_self;
    advance(&r, 7 * PERIOD + 1);
    test_saved saved = test_save(bst_imgproc_module.archive, self);
    test_restore_damaged(bst_imgproc_module.archive, self, saved, saved.size / 499);
    assert_true(saved.size > 3 * (size_t)ONBOARD_SIDE * ONBOARD_SIDE); /* three stacked frames */
    free(saved.bytes);
    bench_free(&r.b);
}

/* ---- A plug-in's detector that remembers how many frames it has seen */

typedef struct counter {
    int64_t frames;
} counter;

static bst_status counter_create(bst_ctx *ctx, const void *config, const bst_detector_env *env,
                                 void **self) {
    (void)config;
    (void)env;
    *self = calloc(1, sizeof(counter));
    return *self ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a counter");
}

static bst_status counter_detect(void *self, bst_ctx *ctx, const bst_detector_frame *frame,
                                 bst_detections *out) {
    counter *c = self;
    (void)ctx;
    (void)frame;
    out->noise_e = out->threshold_snr = (double)++c->frames;
    return BST_OK;
}

static bst_status counter_archive(void *self, bst_archive *archive) {
    counter *c = self;
    c->frames = bst_archive_integer(archive, c->frames, 0, 1000);
    return BST_OK;
}

static bst_status archive_plugin(void *self, bst_archive *archive) {
    return bst_plugin_detector_archive(self, archive);
}

/* A plug-in's detector for a bench. */
static bst_plugin_detector *plug_in(bench *b, const bst_stage_use *use) {
    static const bst_imgproc_maps none;
    bst_plugin_detector *out;
    bst_assert_ok(&b->o.ctx, bst_plugin_detector_create(&b->o.ctx, use, &b->s.camera, &none,
                                                        BENCH_ITEMS, &out));
    return out;
}

static void stages(void **state) {
    (void)state;
    static const bst_detector_stage with = {counter_create, counter_detect, free, counter_archive};
    static const bst_detector_stage without = {counter_create, counter_detect, free, NULL};
    bst_stage_desc stage = {.abi = BST_STAGE_ABI, .kind = BST_STAGE_DETECTOR, .functions = &with};
    const bst_stage_use use = {.plugin = "/lib/counter.so", .desc = &stage};
    bench b;
    bench_init(&b);
    bst_ctx *ctx = &b.o.ctx;
    bst_detections *out = synthetic_detections(BENCH_ITEMS);
    const bst_imgproc_frame frame = synthetic_frame(&b.s);
    bst_plugin_detector *one = plug_in(&b, &use), *two = plug_in(&b, &use);
    for (int i = 1; i <= 2; i++) {
        bst_assert_ok(ctx, bst_plugin_detector_detect(ctx, one, &frame, i, NULL, out, BENCH_ITEMS));
    }
    test_saved saved = test_save(archive_plugin, one);
    bst_assert_ok(ctx, test_restore(ctx, archive_plugin, two, saved));
    bst_assert_ok(ctx, bst_plugin_detector_detect(ctx, two, &frame, 3, NULL, out, BENCH_ITEMS));
    assert_true(out->noise_e == 3.0);
    bst_plugin_detector_free(two);
    stage.functions = &without;
    two = plug_in(&b, &use);
    bst_archive *archive;
    bst_assert_ok(ctx, bst_archive_create(ctx, &archive));
    assert_int_equal(archive_plugin(two, archive), BST_ERR_STATE);
    assert_non_null(strstr(ctx->message, "/lib/counter.so"));
    bst_archive_free(archive);
    free(saved.bytes);
    free(out);
    bst_plugin_detector_free(one);
    bst_plugin_detector_free(two);
    bench_free(&b);
}

static int set_up(void **state) {
    static sequence s;
    draw(&s);
    *state = &s;
    return 0;
}

static int tear_down(void **state) {
    sequence *s = *state;
    for (int i = 0; i < FRAMES; i++) {
        free(s->pixels[i]);
    }
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_frame), cmocka_unit_test(on_several_threads),
        cmocka_unit_test(windows),   cmocka_unit_test(damaged_states),
        cmocka_unit_test(stages),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
