#include "scenegen/recorded_module.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/host_frames.h"
#include "sim/io/recorded_frames.h"
#include "sim/messages/message_invariants.h"
#include "sim/world/frame_updates.h"
#include "sim/world/scene/truth_list.h"

typedef struct recorded_config {
    char frames[512], keyword_map[512];
    int64_t first_frame;
    bool flip_rows;
    double time_tolerance_s, star_limit_v_mag;
    int64_t truth_capacity, pool_frames;
} recorded_config;

static const bst_config_desc config_table[] = {
    BST_PATH(
        recorded_config, frames, NULL,
        "A FITS file of frames; a side table *.csv of PNG or TIFF files; a folder of files, in "
        "the order of their names; the folder of a run or of a SatNet set; or a text file "
        "*.txt with a path a line."),
    BST_PATH(recorded_config, keyword_map, "\"\"",
             "Keyword map (JSON) that gives time, exposure, sections and scaling of the frames; "
             "empty: frames are taken in their order as they are."),
    BST_INT(recorded_config, first_frame, "", 0, 1e9, "0",
            "Frame of the first exposure, where the map gives no exposure_id."),
    BST_BOOL(recorded_config, flip_rows, "false",
             "Reverses the order of rows that the map's first_row gives."),
    BST_REAL(recorded_config, time_tolerance_s, "s", 0, 1e9, "0.01",
             "Largest difference of a header's time and exposure to those of the scenario."),
    BST_REAL(recorded_config, star_limit_v_mag, "mag", -30.0, 30.0, "-30",
             "Catalogue stars down to this are listed in the truth."),
    BST_INT(recorded_config, truth_capacity, "", 1, 1048576, "4096",
            "Sources that the truth of one exposure has room for."),
    BST_INT(recorded_config, pool_frames, "", 2, 256, "8",
            "Frames that may be alive at a time: in queues, being read."),
    BST_CONFIG_END};

enum { PORT_EXPOSURE, PORT_LOS, PORT_FRAME, PORT_TRUTH, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    [PORT_EXPOSURE] = {BST_CHANNEL_EXPOSURE, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    [PORT_LOS] = {BST_CHANNEL_LOS_HISTORY, BST_PORT_IN, 0, 0.0, 0},
    [PORT_FRAME] = {BST_CHANNEL_FRAME, BST_PORT_OUT, 0, 0.0, 0},
    [PORT_TRUTH] = {BST_CHANNEL_TRUTH, BST_PORT_OUT, 0, 0.0, 4096},
};

typedef struct recorded {
    const recorded_config *config;
    const bst_world *world;
    const bst_camera *camera;
    int64_t tick_rate_hz;
    bst_keyword_map map;
    bst_recorded_options options;
    bst_recorded_frames *frames;
    bst_host_frames *pool;
    bst_field *field;
    bst_truth_list list;
    int64_t next; /* frame after the latest one, where frames have an exposure_id */
} recorded;

static void destroy(void *self) {
    recorded *r = self;
    if (r) {
        bst_recorded_frames_close(r->frames);
        bst_host_frames_free(r->pool);
        bst_field_free(r->field);
        bst_truth_list_free(&r->list);
        free(r);
    }
}

static bst_status open_all(const bst_module_env *env, recorded *r) {
    const recorded_config *c = r->config;
    r->options.flip_rows = c->flip_rows;
    if (*c->keyword_map) {
        BST_TRY(bst_keyword_map_load(env->ctx, c->keyword_map, &r->map));
        r->options.map = &r->map;
    }
    const char *const paths[] = {c->frames};
    BST_TRY(bst_recorded_frames_open(env->ctx, paths, 1, r->options.map, &r->frames));
    if (c->first_frame >= bst_recorded_frames_count(r->frames)) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "first_frame: %lld (allowed: 0 to %lld, the last frame of %s)",
                        (long long)c->first_frame,
                        (long long)bst_recorded_frames_count(r->frames) - 1, c->frames);
    }
    size_t pixels = (size_t)r->camera->width_px * (size_t)r->camera->height_px;
    BST_TRY(bst_host_frames_create(env->ctx, pixels, (int)c->pool_frames + BST_OVERLAP_FRAMES,
                                   &r->pool));
    return bst_field_create(env->ctx, env->world, env->observer, env->sensor, &r->field);
}

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    assert(env && env->world && env->tick_rate_hz > 0 && config && self);
    recorded *r = calloc(1, sizeof *r);
    *self = NULL;
    if (!r) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "no memory for %s", env->instance);
    }
    r->config = config;
    r->world = env->world;
    r->camera = bst_world_camera(env->world, env->observer, env->sensor);
    r->tick_rate_hz = env->tick_rate_hz;
    bst_status status = open_all(env, r);
    if (status != BST_OK) {
        destroy(r);
        return status;
    }
    bst_env_set_capacity(env, PORT_TRUTH, (int)r->config->truth_capacity);
    *self = r;
    return BST_OK;
}

static bst_status fail_frame(bst_ctx *ctx, const bst_recorded_frame *f, bst_status status) {
    return bst_recorded_frame_fail(ctx, f->path, &f->place, status);
}

/* Compares the header with the exposure of the scenario. */
static bst_status check_frame(bst_ctx *ctx, const recorded *r, const bst_exposure *e,
                              const bst_recorded_frame *f) {
    int binning = e->binning > 1 ? e->binning : 1;
    if (f->width != e->window.width / binning || f->height != e->window.height / binning) {
        bst_status status = bst_fail(
            ctx, BST_ERR_CONFIG,
            "%s %d x %d pixels, the exposure's window %d x %d; give the camera, window_px and "
            "binning of the frames, or a map with image_section",
            f->place.hdu > 0 ? "NAXIS1 and NAXIS2 give" : "the picture has", f->width, f->height,
            e->window.width / binning, e->window.height / binning);
        return fail_frame(ctx, f, status);
    }
    if (!r->options.map) {
        return BST_OK;
    }
    double rate = (double)r->tick_rate_hz, allowed = r->config->time_tolerance_s + 1.0 / rate;
    bst_time start = bst_world_time(r->world, (double)e->start_tick / rate);
    double late = bst_time_diff(f->values.start, start);
    double longer = f->values.exposure_s - (double)(e->end_tick - e->start_tick) / rate;
    if (!(fabs(late) <= allowed) || !(fabs(longer) <= allowed)) {
        bool time = !(fabs(late) <= allowed);
        char keyword[BST_KEYWORD_TEXT];
        bst_status status = bst_fail(
            ctx, BST_ERR_CONFIG,
            "%s%s gives %s %.6g s %s than exposure %lld of the scenario has (allowed: "
            "time_tolerance_s, %.6g s)",
            f->place.line > 0 ? "column " : "",
            bst_keyword_name(bst_recorded_frames_source(r->frames),
                             time ? r->map.time.keyword : r->map.exposure_s.keyword, keyword),
            time ? "a start" : "an exposure", fabs(time ? late : longer),
            time ? (late > 0.0 ? "later" : "earlier") : (longer > 0.0 ? "longer" : "shorter"),
            (long long)e->id, r->config->time_tolerance_s);
        return fail_frame(ctx, f, status);
    }
    return BST_OK;
}

/* Finds the frame of an exposure; *found false: the files have none. */
static bst_status find_frame(bst_ctx *ctx, recorded *r, const bst_exposure *e, bool *found,
                             bst_recorded_frame *f) {
    int64_t count = bst_recorded_frames_count(r->frames);
    bool numbered = r->options.map && *r->map.exposure_id.keyword;
    *found = false;
    if (!numbered) {
        int64_t index = r->config->first_frame + e->id;
        *found = index < count;
        return *found ? bst_recorded_frames_select(ctx, r->frames, index, &r->options, f) : BST_OK;
    }
    while (r->next < count) {
        BST_TRY(bst_recorded_frames_select(ctx, r->frames, r->next, &r->options, f));
        if (f->values.exposure_id >= e->id) {
            *found = f->values.exposure_id == e->id;
            r->next += *found;
            return BST_OK;
        }
        r->next++;
    }
    return BST_OK;
}

/* Reads and publishes the frame of an exposure. */
static bst_status publish_frame(recorded *r, struct bst_step *step, const bst_exposure *e) {
    bst_ctx *ctx = bst_step_ctx(step);
    bst_recorded_frame f;
    bool found;
    BST_TRY(find_frame(ctx, r, e, &found, &f));
    if (!found) {
        bst_step_count(step, "frame_not_recorded");
        return BST_OK;
    }
    BST_TRY(check_frame(ctx, r, e, &f));
    const float *pixels;
    uint16_t *dn;
    bst_frame *frame;
    int64_t clipped, blank;
    BST_TRY(bst_recorded_frames_pixels(ctx, r->frames, &r->options, &f, &pixels));
    BST_TRY(bst_host_frames_take(ctx, r->pool, f.width, f.height, &frame, &dn));
    bst_status status = bst_recorded_counts(ctx, pixels, (size_t)f.width * (size_t)f.height,
                                            r->options.map, dn, &clipped, &blank);
    if (status != BST_OK) {
        bst_frame_release(frame);
        return status;
    }
    if (clipped > 0) {
        bst_step_count(step, "pixels_clipped");
    }
    if (blank > 0) {
        bst_step_count(step, "pixels_blank");
    }
    bst_frame_message *message = bst_step_write(step, PORT_FRAME, NULL);
    *message = (bst_frame_message){.frame = frame,
                                   .exposure_id = e->id,
                                   .start_tick = e->start_tick,
                                   .end_tick = e->end_tick,
                                   .window = e->window,
                                   .binning = e->binning > 1 ? e->binning : 1,
                                   .bits = (int)r->camera->bits};
    assert(bst_frame_message_is_valid(message));
    return BST_OK;
}

/* No source is known to saturate: its frame was not rendered. */
static double peak_e(const void *user, int index, const bst_truth_item *item) {
    (void)user;
    (void)index;
    (void)item;
    return 0.0;
}

/* Publishes what the scenario has in the field. */
static bst_status publish_truth(recorded *r, struct bst_step *step, const bst_exposure *e,
                                const bst_los_history *history) {
    bst_ctx *ctx = bst_step_ctx(step);
    const bst_field_options options = {.v_limit = r->config->star_limit_v_mag};
    const bst_scene_source *sources;
    bst_los_track track;
    int capacity, count;
    bst_truth *truth = bst_step_write(step, PORT_TRUTH, &capacity);
    truth->exposure_id = e->id;
    truth->dropped = e->dropped;
    truth->hits = 0;
    truth->hits_e = 0.0;
    truth->error_sigma = NAN;
    truth->nodes = 0;
    truth->one_track = false;
    BST_TRY(bst_field_track(ctx, r->field, history, e->start_tick, e->end_tick, r->tick_rate_hz,
                            &track));
    BST_TRY(bst_field_query(ctx, r->field, &track, e->start_tick, e->end_tick, r->tick_rate_hz,
                            e->window, &options, truth, &sources, &count));
    const bst_truth_request items = {.field = r->field,
                                     .camera = r->camera,
                                     .track = &track,
                                     .sources = sources,
                                     .count = count,
                                     .window = e->window,
                                     .binning = e->binning,
                                     .peak_e = peak_e};
    BST_TRY(bst_truth_list_fill(ctx, &r->list, &items, truth, capacity, NULL));
    if (truth->lost > 0) {
        bst_step_count(step, "truth_overflow");
    }
    assert(bst_truth_is_valid(truth, capacity));
    return BST_OK;
}

static bst_status step_module(void *self, struct bst_step *step) {
    recorded *r = self;
    bst_sample exposure;
    while ((exposure = bst_step_next(step, PORT_EXPOSURE)).payload) {
        const bst_exposure *e = exposure.payload;
        bst_sample history = bst_step_latest(step, PORT_LOS);
        if (!history.payload) {
            return bst_fail(bst_step_ctx(step), BST_ERR_STATE,
                            "an exposure ended before any line of sight was published");
        }
        BST_TRY(publish_truth(r, step, e, history.payload));
        if (!e->dropped) {
            BST_TRY(publish_frame(r, step, e));
        }
    }
    return BST_OK;
}

static bst_status archive_module(void *self, bst_archive *archive) {
    recorded *r = self;
    r->next = bst_archive_integer(archive, r->next, 0, INT64_MAX / 2);
    return BST_OK;
}

const bst_module_desc bst_scenegen_recorded_module = {
    .abi = BST_MODULE_ABI,
    .role = "scenegen",
    .type = "recorded",
    .doc = "Takes the frames from FITS, PNG or TIFF files instead of rendering them.",
    .flags = BST_MODULE_READS_TRUTH | BST_MODULE_INPUTS_ONLY,
    .config = config_table,
    .config_bytes = sizeof(recorded_config),
    .default_rate_hz = 0.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step_module,
    .destroy = destroy,
    .archive = archive_module,
};
