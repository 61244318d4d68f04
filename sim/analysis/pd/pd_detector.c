/* Detectors for `boresight pd`: built-in image processing by function call, and any "imgproc"
 * module in an engine of its own with a source of frames. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/calibrate/calibration.h"
#include "sim/analysis/pd/pd.h"
#include "sim/astro/bodies.h"
#include "sim/engine/kernel/engine.h"
#include "sim/onboard/knowledge.h"

enum { ROOM_PER_TARGET = 4, MOST_DETECTIONS = 65536, SAMPLES = 5, RING = 64 };

/* Messages that the source publishes in its next step. */
typedef struct feed {
    bst_frame *frame;
    const bst_pd_frame *targets;
    int64_t exposure_ticks;
    int64_t exposures;
    int bits;
} feed;

struct bst_pd_detector {
    /* by function */
    bst_imgproc_config config;
    bst_imgproc_maps maps;
    bst_imgproc *ip;
    bst_stack *stack; /* NULL: single frames */
    int64_t taken;    /* number of frames */
    /* by module */
    bst_engine *engine;
    feed feed, *feed_config;
    int64_t period_ticks, steps;
    bst_detections *out; /* detections of the current frame */
    int capacity;
    bool published; /* the module has published them */
};

enum { PORT_EXPOSURE, PORT_FRAME, PORT_POINTING, PORT_NAV, PORT_COUNT };

static const bst_port feed_ports[PORT_COUNT] = {
    [PORT_EXPOSURE] = {BST_CHANNEL_EXPOSURE, BST_PORT_OUT, 0, 0.0, 0},
    [PORT_FRAME] = {BST_CHANNEL_FRAME, BST_PORT_OUT, 0, 0.0, 0},
    [PORT_POINTING] = {BST_CHANNEL_POINTING_TELEMETRY, BST_PORT_OUT, 0, 0.0, RING},
    [PORT_NAV] = {BST_CHANNEL_NAV_TELEMETRY, BST_PORT_OUT, 0, 0.0, 0},
};

/* Creates the module that feeds rendered frames to an image processing module. */
static bst_status create_feed(const bst_module_env *env, const void *config, void **self) {
    (void)env;
    *self = *(feed *const *)config;
    return BST_OK;
}

static void destroy_feed(void *self) {
    (void)self;
}

/* Fills the pointing telemetry with equidistant attitudes of the exposure that ends now. */
static void tell_pointing(const feed *f, bst_pointing_telemetry *t, int capacity, int64_t start) {
    t->capacity = capacity;
    t->settled = true;
    t->q_body_from_gcrf = BST_QUAT_IDENTITY;
    for (int k = 0; k < SAMPLES; k++) {
        double u = (double)k / (SAMPLES - 1) - 0.5;
        bst_quat turn = bst_quat_from_rotvec(bst_vec3_scale(f->targets->motion.turn_cam_rad, u));
        t->items[t->written++ % capacity] = (bst_pointing_sample){
            .tick = start + k * f->exposure_ticks / (SAMPLES - 1),
            .q_cam_from_gcrf = bst_quat_mul(turn, f->targets->motion.q_cam_from_gcrf)};
    }
}

/* Publishes one frame with its exposure, pointing and navigation telemetry. */
static bst_status step_feed(void *self, struct bst_step *step) {
    feed *f = self;
    if (!f->frame) {
        return BST_OK;
    }
    int capacity;
    int64_t end = bst_step_tick(step), start = end - f->exposure_ticks;
    bst_window window = f->targets->request.window;
    *(bst_exposure *)bst_step_write(step, PORT_EXPOSURE, NULL) = (bst_exposure){
        .id = f->exposures, .start_tick = start, .end_tick = end, .window = window, .binning = 1};
    bst_pointing_telemetry *telemetry = bst_step_write(step, PORT_POINTING, &capacity);
    tell_pointing(f, telemetry, capacity, start);
    *(bst_nav_telemetry *)bst_step_write(step, PORT_NAV, NULL) =
        (bst_nav_telemetry){.tick = end, .sun_m = {BST_AU_M, 0.0, 0.0}};
    *(bst_frame_message *)bst_step_write(step, PORT_FRAME, NULL) =
        (bst_frame_message){.frame = f->frame,
                            .exposure_id = f->exposures++,
                            .start_tick = start,
                            .end_tick = end,
                            .window = window,
                            .binning = 1,
                            .bits = f->bits};
    f->frame = NULL; /* owned by the channel now */
    return BST_OK;
}

static const bst_module_desc feed_module = {.abi = BST_MODULE_ABI,
                                            .role = "scenegen",
                                            .type = "pd",
                                            .doc = "Hands frames to the detector in measurement.",
                                            .config_bytes = sizeof(feed *),
                                            .ports = feed_ports,
                                            .port_count = PORT_COUNT,
                                            .create = create_feed,
                                            .step = step_feed,
                                            .destroy = destroy_feed};

static bst_status keep_detections(void *user, const char *scope, const char *channel,
                                  const void *payload, int64_t tick) {
    bst_pd_detector *d = user;
    (void)scope;
    (void)tick;
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) != 0) {
        return BST_OK;
    }
    const bst_detections *found = payload;
    int kept = found->count < d->capacity ? found->count : d->capacity;
    *d->out = *found;
    d->out->count = kept;
    d->out->lost += found->count - kept;
    memcpy(d->out->items, found->items, (size_t)kept * sizeof found->items[0]);
    d->published = true;
    return BST_OK;
}

/* Creates an engine with the scenario's module and the source, without input delays: the detections
 * of a frame come at once. */
static bst_status open_engine(bst_ctx *ctx, bst_pd_scene *s, bst_pd_detector *d) {
    const bst_scenario *scenario = s->scenario;
    char feeder[256], module[256];
    snprintf(feeder, sizeof feeder, "%s/frames of pd", s->name);
    snprintf(module, sizeof module, "%s/%s", s->name, s->imgproc->name);
    d->feed.exposure_ticks = (int64_t)llround(s->exposure_s * (double)scenario->tick_rate_hz);
    d->feed.bits = (int)s->camera.bits;
    d->feed_config = &d->feed;
    d->period_ticks = d->feed.exposure_ticks + scenario->tick_rate_hz / 10 + 1;
    bst_instance_spec spec = {.scope = s->name,
                              .world = s->world,
                              .knowledge = s->knowledge,
                              .device = s->device,
                              .observer = s->observer,
                              .sensor = s->sensor,
                              .exposure_s = s->exposure_s,
                              .seed = scenario->seed,
                              .run = (uint64_t)scenario->run};
    BST_TRY(bst_engine_create(ctx, scenario->tick_rate_hz, &d->engine));
    spec.desc = &feed_module;
    spec.instance = feeder;
    spec.config = &d->feed_config;
    spec.period_ticks = d->period_ticks;
    spec.offset_ticks = d->period_ticks;
    BST_TRY(bst_engine_add(ctx, d->engine, &spec));
    spec.desc = s->imgproc->desc;
    spec.instance = module;
    spec.config = s->imgproc->config;
    spec.period_ticks = spec.offset_ticks = 0;
    BST_TRY(bst_engine_add(ctx, d->engine, &spec));
    bst_status status = bst_engine_load(ctx, d->engine);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status,
                               "%s: pd feeds a detector exposures, frames, pointing and navigation",
                               s->name);
    }
    bst_engine_set_hooks(d->engine,
                         &(bst_engine_hooks){.user = d, .message = keep_detections, .ctx = ctx});
    return BST_OK;
}

/* Opens the built-in image processing with a capacity for all artificial targets. */
static bst_status open_function(bst_ctx *ctx, bst_pd_scene *s, bst_pd_detector *d) {
    d->config = *(const bst_imgproc_config *)s->imgproc->config;
    if (s->options.false_alarms > 0.0) {
        d->config.false_alarms_per_frame = s->options.false_alarms;
    }
    s->options.false_alarms = d->config.false_alarms_per_frame;
    if (s->options.pairs) {
        d->config.false_splits =
            s->options.false_splits < 0.0 ? d->config.false_splits : s->options.false_splits;
        s->options.false_splits = d->config.false_splits;
    }
    double room = ROOM_PER_TARGET * (double)bst_pd_scene_room(s) +
                  20.0 * d->config.false_alarms_per_frame + 1000.0;
    room = s->options.stars ? MOST_DETECTIONS : fmin(room, MOST_DETECTIONS);
    if ((double)d->config.capacity < room) {
        d->config.capacity = (int64_t)room;
    }
    bst_camera camera = *bst_knowledge_camera(s->knowledge);
    BST_TRY(bst_calibration_load(ctx, &d->config, &camera, &d->maps));
    BST_TRY(bst_calibration_psf(ctx, s->knowledge, &camera, &d->maps));
    BST_TRY(bst_imgproc_create(ctx, &camera, bst_camera_electrons_per_s(&camera, 0.0), &d->config,
                               &d->maps, &d->ip));
    if (s->options.stack == 0) {
        return BST_OK;
    }
    bst_stack_config stack = {s->options.stack, s->options.rates_px, s->options.false_alarms};
    return bst_stack_create(ctx, &camera, &stack, (int)d->config.threads, &d->stack);
}

bst_status bst_pd_detector_open(bst_ctx *ctx, bst_pd_scene *s, bst_pd_detector **out) {
    *out = NULL;
    bool by_function = s->imgproc->desc == &bst_imgproc_module && !s->options.by_module &&
                       !((const bst_imgproc_config *)s->imgproc->config)->detector.desc;
    if (!by_function && s->options.false_alarms > 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--false-alarms sets the detector that comes with Boresight, driven by its "
                        "function; set those of %s/%s by --set",
                        s->name, s->imgproc->name);
    }
    if (!by_function && s->options.pairs && s->options.false_splits >= 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--false-splits sets the detector that comes with Boresight, driven by its "
                        "function; set those of %s/%s by --set",
                        s->name, s->imgproc->name);
    }
    if (!by_function && s->options.stack > 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--stack measures the stacks that come with Boresight, not %s/%s", s->name,
                        s->imgproc->name);
    }
    bst_pd_detector *d = calloc(1, sizeof *d);
    if (!d) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the detector");
    }
    bst_status status = by_function ? open_function(ctx, s, d) : open_engine(ctx, s, d);
    if (status != BST_OK) {
        bst_pd_detector_close(d);
        return status;
    }
    *out = d;
    return BST_OK;
}

void bst_pd_detector_close(bst_pd_detector *d) {
    if (d) {
        bst_imgproc_free(d->ip);
        bst_stack_free(d->stack);
        bst_calibration_free(&d->maps);
        bst_engine_free(d->engine);
        free(d);
    }
}

/* Adds a frame to a stack; only detections of a full stack count. */
static void stack_frame(bst_pd_detector *d, const bst_pd_frame *targets) {
    bst_stack_frame frame =
        bst_imgproc_stack_frame(d->ip, (double)d->taken++, targets->motion.q_cam_from_gcrf);
    d->out->count = 0;
    d->out->lost = 0;
    int count;
    bst_stack_add(d->stack, &frame);
    const bst_stack_found *found = bst_stack_search(d->stack, &count);
    d->out->threshold_snr = bst_stack_threshold_snr(d->stack);
    bst_imgproc_append_stack(d->ip, found, count, 0.0, d->out, d->capacity);
}

static bst_status detect_by_function(bst_ctx *ctx, bst_pd_detector *d, const bst_pd_scene *s,
                                     bst_frame *frame, const bst_pd_frame *targets) {
    const uint16_t *pixels;
    BST_TRY(bst_frame_map(frame, ctx, &pixels));
    bst_imgproc_frame view = {.pixels = pixels,
                              .window = targets->request.window,
                              .binning = 1,
                              .bits = (int)s->camera.bits,
                              .exposure_s = s->exposure_s};
    bst_status status =
        bst_imgproc_detect(ctx, d->ip, &view, &targets->motion, d->out, d->capacity);
    bst_frame_unmap(frame);
    if (status == BST_OK && d->stack) {
        stack_frame(d, targets);
    }
    return status;
}

bst_status bst_pd_detect(bst_ctx *ctx, bst_pd_detector *d, const bst_pd_scene *s, bst_frame *frame,
                         const bst_pd_frame *targets, bst_detections *out, int capacity) {
    d->out = out;
    d->capacity = capacity;
    if (d->ip) {
        return detect_by_function(ctx, d, s, frame, targets);
    }
    d->published = false;
    bst_frame_retain(frame);
    d->feed.frame = frame;
    d->feed.targets = targets;
    d->steps++;
    /* the source steps at period * steps; the module must finish before its next step */
    bst_status status = bst_engine_run(ctx, d->engine, (d->steps + 1) * d->period_ticks);
    bst_frame_release(d->feed.frame); /* NULL after publication */
    d->feed.frame = NULL;
    BST_TRY(status);
    if (!d->published) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "%s/%s published no detections within %.3g s of a frame: pd can measure "
                        "only detectors that answer each frame",
                        s->name, s->imgproc->name,
                        (double)d->period_ticks / (double)s->scenario->tick_rate_hz);
    }
    return BST_OK;
}
