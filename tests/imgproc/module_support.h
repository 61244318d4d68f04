/* The image-processing module in the real engine: a fake camera writes frames of the stars that
 * the onboard catalogue has, and what the module publishes is kept. */
#ifndef BST_TESTS_IMGPROC_MODULE_SUPPORT_H
#define BST_TESTS_IMGPROC_MODULE_SUPPORT_H

#include <stdlib.h>

#include "tests/engine/onboard.h"
#include "tests/imgproc/synthetic.h"

enum { BENCH_KEPT = 16, BENCH_ITEMS = 2048, BENCH_EXPOSURE = 500 };

typedef struct bench {
    onboard o;
    synthetic s;
    bst_imgproc_config config;
    fake camera, tracker;
    fake *camera_p, *tracker_p;
    bst_frame frame; /* every message lends the same pixels */
    int recycled;
    bst_predictions predictions; /* without items */
    bst_detections *kept[BENCH_KEPT];
    int64_t kept_at[BENCH_KEPT];
    int count;
} bench;

static inline bst_status bench_map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)ctx;
    *pixels = ((bench *)owner)->s.pixels;
    return BST_OK;
}
static inline void bench_unmap(void *owner) {
    (void)owner;
}
static inline void bench_recycle(void *owner) {
    ((bench *)owner)->recycled++;
}
static const bst_frame_ops bench_frame_ops = {
    .map = bench_map, .unmap = bench_unmap, .recycle = bench_recycle};

/* `value` frames at once, exposed one after the other up to now. */
static inline bst_status bench_write_frames(fake *self, struct bst_step *step) {
    bench *b = self->other;
    for (int64_t i = 0; i < self->value; i++) {
        bst_frame_message *message = bst_step_write(step, 0, NULL);
        bst_frame_retain(&b->frame);
        int64_t end = bst_step_tick(step) - (self->value - 1 - i) * BENCH_EXPOSURE;
        *message = (bst_frame_message){.frame = &b->frame,
                                       .exposure_id = self->value2++,
                                       .start_tick = end - BENCH_EXPOSURE,
                                       .end_tick = end,
                                       .window = {0, 0, ONBOARD_SIDE, ONBOARD_SIDE},
                                       .binning = 1,
                                       .bits = 16};
    }
    return BST_OK;
}

static inline bst_status bench_write_predictions(fake *self, struct bst_step *step) {
    const bench *b = self->other;
    bst_predictions *out = bst_step_write(step, 0, NULL);
    *out = b->predictions;
    return BST_OK;
}

static inline bst_status bench_keep(void *user, const char *scope, const char *channel,
                                    const void *payload, int64_t tick) {
    bench *b = user;
    (void)scope;
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        const bst_detections *d = payload;
        assert_true(b->count < BENCH_KEPT);
        size_t bytes = sizeof *d + (size_t)d->count * sizeof d->items[0];
        b->kept[b->count] = malloc(bytes);
        assert_non_null(b->kept[b->count]);
        memcpy(b->kept[b->count], d, bytes);
        b->kept_at[b->count++] = tick;
    }
    return BST_OK;
}

static const bst_port bench_camera_ports[] = {
    {.channel = BST_CHANNEL_FRAME, .direction = BST_PORT_OUT}};
static const bst_port bench_tracker_ports[] = {
    {.channel = BST_CHANNEL_PREDICTIONS, .direction = BST_PORT_OUT, .capacity = 1}};
static const bst_module_desc bench_camera_desc = FAKE_DESC(bench_camera_ports);
static const bst_module_desc bench_tracker_desc = FAKE_DESC(bench_tracker_ports);

/* World and an empty scene of the knowledge's camera. */
static inline void bench_init(bench *b) {
    memset(b, 0, sizeof *b);
    onboard_init(&b->o);
    synthetic_init(&b->s, ONBOARD_SIDE, ONBOARD_SIDE);
    b->s.camera = *bst_knowledge_camera(b->o.knowledge);
    b->s.read_e = b->s.camera.read_noise_e;
    b->frame = (bst_frame){.ops = &bench_frame_ops,
                           .owner = b,
                           .width = ONBOARD_SIDE,
                           .height = ONBOARD_SIDE,
                           .references = 1};
    b->camera = (fake){.on_step = bench_write_frames, .other = b, .value = 1};
    b->tracker = (fake){.on_step = bench_write_predictions, .other = b};
    b->camera_p = &b->camera;
    b->tracker_p = &b->tracker;
}

/* Expected electrons of a catalogue star in one exposure. */
static inline double bench_star_e(const bench *b, int i) {
    return bst_camera_electrons_per_s(&b->s.camera, b->o.stars[i].v_mag) * BENCH_EXPOSURE /
           ONBOARD_RATE;
}

static inline void bench_draw_stars(bench *b) {
    for (int i = 0; i < b->o.star_count; i++) {
        synthetic_add(&b->s, b->o.stars[i].x_px, b->o.stars[i].y_px, bench_star_e(b, i), 0, 0);
    }
}

/* Reads the module's block as a scenario would have it. */
static inline bst_status bench_configure(bench *b, const char *text) {
    bst_json *json;
    bst_assert_ok(&b->o.ctx, bst_json_parse(&b->o.ctx, "block", text, strlen(text), &json));
    bst_status status = bst_config_read(&b->o.ctx, json, bst_json_root(json), "",
                                        bst_imgproc_config_table, &b->config);
    bst_json_free(json);
    return status;
}

/* Adds camera (frames every `period` ticks from `first` on), the module and, if wanted, the source
 * of predictions (once, at tick 0), and loads. Telemetry is the test's. */
static inline bst_status bench_load(bench *b, int64_t first, int64_t period, bool predictions) {
    bst_ctx *ctx = &b->o.ctx;
    bst_instance_spec spec = FAKE_SPEC(bench_camera_desc, "camera", b->camera_p, period);
    spec.offset_ticks = first;
    fake_add(ctx, b->o.engine, spec);
    if (predictions) {
        fake_add(ctx, b->o.engine, FAKE_SPEC(bench_tracker_desc, "tracker", b->tracker_p, 0));
    }
    fake_add(ctx, b->o.engine,
             (bst_instance_spec){.desc = &bst_imgproc_module,
                                 .scope = "o/s",
                                 .instance = "imgproc",
                                 .config = &b->config,
                                 .knowledge = b->o.knowledge});
    bst_engine_hooks hooks = {.user = b, .message = bench_keep};
    bst_engine_set_hooks(b->o.engine, &hooks);
    return bst_engine_load(ctx, b->o.engine);
}

static inline void bench_free(bench *b) {
    onboard_free(&b->o);
    synthetic_free(&b->s);
    bst_config_free(bst_imgproc_config_table, &b->config);
    for (int i = 0; i < b->count; i++) {
        free(b->kept[i]);
    }
}

#endif
