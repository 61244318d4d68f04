#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/stages.h"
#include "scenegen/detector/detector.h"
#include "scenegen/frame_pool.h"
#include "scenegen/module.h"
#include "scenegen/planes.h"
#include "scenegen/renderer.h"
#include "sim/messages/message_invariants.h"
#include "sim/optics/psf.h"
#include "sim/world/frame_updates.h"
#include "sim/world/scene/truth_list.h"

typedef struct fidelity_config {
    double tolerance_sigma;
    bool penumbrae;
    int64_t max_nodes, temporal_oversample, spatial_oversample, stamp_radius_px, psf_degree,
        fft_taps;
} fidelity_config;

typedef struct scenegen_config {
    int renderer;
    double star_limit_v_mag, margin_px;
    fidelity_config fidelity;
    int64_t truth_capacity, pool_frames;
    bst_stage_use frame_stage;
} scenegen_config;

static const char *const stage_kinds[] = {BST_STAGE_FRAME, NULL};

static const bst_config_desc stage_table[] = {
    BST_STAGE_ALONE(stage_kinds,
                    "A shared library with a frame stage, relative to the folder of the file that "
                    "says so; the other keys are then that one's. Left out: none."),
    BST_CONFIG_END};

static const bst_config_desc fidelity_table[] = {
    BST_REAL(fidelity_config, tolerance_sigma, "sigma", 1e-4, 1.0, "0.05",
             "Error of the image that is allowed in any pixel, in that pixel's noise. "
             "Nodes and stamps follow from it."),
    BST_BOOL(
        fidelity_config, penumbrae, "false",
        "Shadows of parts of a satellite on its parts have the penumbra of the Sun's disc where "
        "the tolerance asks for it, which draws the satellite up to 142 times as often, and "
        "counts in the predicted error; false: they are those of the Sun's centre."),
    BST_INT(fidelity_config, max_nodes, "", 0, 67108864, "0",
            "Nodes (weighted points along the smear) that a frame may have beyond 16 for each "
            "source, 4 times as many where the paths of a slew need them; 0: 16777216. Where the "
            "tolerance asks for more, sources are drawn coarser (counter nodes_bounded)."),
    BST_FORMER("most_nodes", "max_nodes"),
    BST_INT(fidelity_config, temporal_oversample, "", 0, 100000, "0",
            "Equal parts of the exposure whose middles stand for it, for comparison with other "
            "renderers; 0: as the tolerance needs. The error is not predicted then."),
    BST_INT(fidelity_config, spatial_oversample, "", 0, 4096, "0",
            "Parts of a pixel per axis to whose centres light is moved; 0: none. The error is not "
            "predicted then."),
    BST_INT(fidelity_config, stamp_radius_px, "px", 0, 255, "0",
            "Reach of all stamps beyond the two nearest pixels; 0: as the tolerance needs."),
    BST_INT(
        fidelity_config, psf_degree, "", 0, 15, "0",
        "Odd degree of the polynomials that give a Gaussian PSF's light on a pixel by the place "
        "within it; 0: as exact as floats are."),
    BST_INT(
        fidelity_config, fft_taps, "", 0, 8, "0",
        "Taps per axis with which light is spread on the grid of a PSF that is no Gaussian: 4 (the "
        "error is not predicted then), 6 or 8; 0: 8."),
    BST_CONFIG_END,
};

static const char *const renderers[] = {"auto", "single_kernel", "multi_kernel", NULL};

static const bst_config_desc config[] = {
    BST_REAL(scenegen_config, star_limit_v_mag, "mag", -30.0, 30.0, "16",
             "Stars fainter than this are not drawn."),
    BST_FORMER("v_limit", "star_limit_v_mag"),
    BST_REAL(scenegen_config, margin_px, "px", 0.0, 1e4, "0",
             "Sources this far outside the window are drawn too; at least what the PSF needs."),
    BST_ENUM(scenegen_config, renderer, renderers, "\"auto\"",
             "Whose track the stars follow: single_kernel (all that of the star at the boresight, "
             "as a shift), multi_kernel (each its own) or auto (single_kernel where it meets the "
             "tolerance)."),
    BST_OBJECT(scenegen_config, fidelity, fidelity_table, "{}", "How exact the image is."),
    BST_INT(
        scenegen_config, truth_capacity, "", 1, 1048576, "4096",
        "Sources that the truth of one exposure has room for: objects, then the brightest stars."),
    BST_INT(scenegen_config, pool_frames, "", 2, 256, "8",
            "Frames that may be alive at a time: in queues, being rendered, being read."),
    BST_OBJECT(scenegen_config, frame_stage, stage_table, "{}",
               "A stage of one's own that changes rendered frames before anyone sees them."),
    BST_CONFIG_END,
};

enum { PORT_EXPOSURE, PORT_LOS, PORT_FRAME, PORT_TRUTH, PORT_PLANES, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    [PORT_EXPOSURE] = {BST_CHANNEL_EXPOSURE, BST_PORT_IN, BST_PORT_TRIGGER, 0.0, 0},
    [PORT_LOS] = {BST_CHANNEL_LOS_HISTORY, BST_PORT_IN, 0, 0.0, 0},
    [PORT_FRAME] = {BST_CHANNEL_FRAME, BST_PORT_OUT, 0, 0.0, 0},
    [PORT_TRUTH] = {BST_CHANNEL_TRUTH, BST_PORT_OUT, 0, 0.0, 4096},
    [PORT_PLANES] = {BST_CHANNEL_PLANES, BST_PORT_OUT, 0, 0.0, 0},
};

typedef struct scenegen {
    const bst_camera *camera, *world_camera;
    bst_camera changed; /* at the plate scale and jitter of the latest exposure */
    bst_psf *psf;       /* PSF of `changed`, if wider than the world's */
    double jitter_rad2;
    struct bst_device *device;
    bst_renderer_options renderer_options;
    double margin_px; /* requested by the scenario */
    bst_field_options options;
    int64_t tick_rate_hz;
    bst_rng_key key;
    bst_field *field;
    bst_renderer *renderer;
    bst_truth_list list;
    /* frames reported so far; frames of earlier renderers */
    long long saturated_told, saturated_before;
    bst_plane_maker *planes; /* NULL: not requested */
    int *item_source;        /* source of each truth item, for the planes */
    const bst_stage_use *stage_use;
    void *stage; /* plug-in stage; NULL: none */
} scenegen;

static void destroy(void *self) {
    scenegen *s = self;
    if (s) {
        if (s->stage) {
            ((const bst_frame_stage *)s->stage_use->desc->functions)->destroy(s->stage);
        }
        bst_renderer_free(s->renderer);
        bst_field_free(s->field);
        bst_plane_maker_free(s->planes);
        bst_psf_free(s->psf);
        free(s->item_source);
        bst_truth_list_free(&s->list);
        free(s);
    }
}

static bst_status open_stage(const bst_module_env *env, const bst_stage_use *use, scenegen *s) {
    const bst_frame_stage *functions = use->desc ? use->desc->functions : NULL;
    s->stage_use = use;
    if (!functions) {
        return BST_OK;
    }
    if (!functions->create || !functions->apply || !functions->destroy) {
        return bst_fail(env->ctx, BST_ERR_CONFIG,
                        "plug-in %s: its frame stage \"%s\" lacks one of create, apply and destroy",
                        use->plugin, use->desc->type);
    }
    const bst_frame_stage_env given = {
        .camera = s->world_camera, .instance = env->instance, .seed = env->seed, .run = env->run};
    bst_status status = functions->create(env->ctx, use->config, &given, &s->stage);
    return status == BST_OK ? BST_OK : bst_fail_prefix(env->ctx, status, "plug-in %s", use->plugin);
}

static bst_status change_frame(bst_ctx *ctx, const scenegen *s, const bst_frame_message *message) {
    const bst_frame_stage *functions = s->stage_use->desc->functions;
    const bst_frame_stage_frame given = {
        .exposure_id = message->exposure_id,
        .start_s = (double)message->start_tick / (double)s->tick_rate_hz,
        .end_s = (double)message->end_tick / (double)s->tick_rate_hz,
        .window = message->window,
        .width = message->frame->width,
        .height = message->frame->height,
        .binning = message->binning,
        .bits = message->bits};
    uint16_t *pixels;
    BST_TRY(bst_frame_pool_pixels(ctx, message->frame, &pixels));
    bst_status status = functions->apply(s->stage, ctx, &given, pixels);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(ctx, status, "plug-in %s", s->stage_use->plugin);
}

/* Random key of this sensor's fixed patterns; the sensor's name is the instance's without the
 * module's. */
static bst_rng_key pattern_key(const bst_module_env *env, const bst_camera *camera) {
    char name[256];
    snprintf(name, sizeof name, "%s", env->instance);
    char *module = strrchr(name, '/');
    if (module) {
        *module = '\0';
    }
    return bst_detector_pattern_key(camera, name);
}

static bst_status create(const bst_module_env *env, const void *config_object, void **self) {
    assert(env && env->world && env->device && env->tick_rate_hz > 0 && config_object && self);
    const scenegen_config *c = config_object;
    scenegen *s = calloc(1, sizeof *s);
    *self = NULL;
    if (!s) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "no memory for %s", env->instance);
    }
    s->camera = s->world_camera = bst_world_camera(env->world, env->observer, env->sensor);
    s->tick_rate_hz = env->tick_rate_hz;
    s->key = bst_env_rng(env, "detector");
    bst_renderer_options options = bst_renderer_default_options();
    options.tolerance_sigma = c->fidelity.tolerance_sigma;
    options.penumbrae = c->fidelity.penumbrae;
    options.motion = (bst_smear_star_motion)c->renderer;
    options.max_nodes = c->fidelity.max_nodes;
    options.temporal_oversample = (int)c->fidelity.temporal_oversample;
    options.spatial_oversample = (int)c->fidelity.spatial_oversample;
    options.stamp_radius_px = (int)c->fidelity.stamp_radius_px;
    options.psf_degree = (int)c->fidelity.psf_degree;
    options.fft_taps = (int)c->fidelity.fft_taps;
    options.pool_frames = (int)c->pool_frames + BST_OVERLAP_FRAMES;
    options.saturation_flags = env->planes & UINT32_C(1) << BST_PLANE_SATURATION;
    options.pattern = pattern_key(env, s->camera);
    s->device = env->device;
    s->renderer_options = options;
    s->margin_px = c->margin_px;
    bst_status status =
        bst_renderer_create(env->ctx, env->device, s->camera, &options, &s->renderer);
    if (status == BST_OK && !env->never_steps) {
        status = bst_renderer_prepare(env->ctx, s->renderer);
    }
    if (status == BST_OK) {
        status = bst_field_create(env->ctx, env->world, env->observer, env->sensor, &s->field);
    }
    if (status == BST_OK) {
        status = open_stage(env, &c->frame_stage, s);
    }
    if (status == BST_OK && env->planes) {
        status = bst_plane_maker_create(env->ctx, env->planes, (int)s->camera->width_px,
                                        (int)s->camera->height_px, env->mask_threshold_sigma,
                                        &s->planes);
        s->item_source = malloc((size_t)c->truth_capacity * sizeof *s->item_source);
        if (status == BST_OK && !s->item_source) {
            status = bst_fail(env->ctx, BST_ERR_MEMORY, "no memory for %s", env->instance);
        }
    }
    if (status != BST_OK) {
        destroy(s);
        return status;
    }
    s->options.v_limit = c->star_limit_v_mag;
    s->options.margin_px = fmax(c->margin_px, bst_renderer_margin_px(s->renderer));
    bst_env_set_capacity(env, PORT_TRUTH, (int)c->truth_capacity);
    *self = s;
    return BST_OK;
}

/* Expected brightest-pixel electrons of a truth item (callback). */
static double peak_e(const void *user, int index, const bst_truth_item *item) {
    (void)item;
    return bst_renderer_peak_e(user, index);
}

/* Adds the saturated frames among the finished ones to the summary. */
static void report_saturated(scenegen *s, struct bst_step *step) {
    long long frames = s->saturated_before + bst_renderer_saturated_frames(s->renderer);
    for (; s->saturated_told < frames; s->saturated_told++) {
        bst_step_count(step, "saturated");
    }
}

static bst_status finish(void *self, struct bst_step *step) {
    scenegen *s = self;
    long long pixels;
    BST_TRY(bst_renderer_saturated(bst_step_ctx(step), s->renderer, &pixels));
    report_saturated(s, step);
    return BST_OK;
}

/* Replaces the renderer by one for `camera`, and the PSF of a changed camera by `psf`. */
static bst_status replace_renderer(bst_ctx *ctx, scenegen *s, const bst_camera *camera,
                                   bst_psf *psf) {
    bst_renderer *renderer;
    bst_status status =
        bst_renderer_create(ctx, s->device, camera, &s->renderer_options, &renderer);
    if (status == BST_OK && (status = bst_renderer_prepare(ctx, renderer)) != BST_OK) {
        bst_renderer_free(renderer);
    }
    if (status != BST_OK) {
        bst_psf_free(psf);
        return status;
    }
    bst_renderer_inherit(renderer, s->renderer);
    bst_renderer_free(s->renderer);
    bst_psf_free(s->psf);
    s->renderer = renderer;
    s->psf = psf;
    s->options.margin_px = fmax(s->margin_px, bst_renderer_margin_px(renderer));
    return BST_OK;
}

/* Sets another plate scale or jitter: recreates everything that depends on the camera. Frames
 * rendered before are unchanged. */
static bst_status set_camera(bst_ctx *ctx, scenegen *s, double scale_arcsec, double jitter_rad2) {
    bst_camera camera;
    bst_psf *psf;
    BST_TRY(
        bst_psf_camera_trembling(ctx, s->world_camera, scale_arcsec, jitter_rad2, &camera, &psf));
    BST_TRY(replace_renderer(ctx, s, &camera, psf));
    s->jitter_rad2 = jitter_rad2;
    s->changed = camera;
    s->camera = &s->changed;
    bst_field_set_camera(s->field, s->camera);
    return BST_OK;
}

/* Sets the world's camera again. */
static bst_status reset_camera(bst_ctx *ctx, scenegen *s) {
    if (s->camera == s->world_camera) {
        return BST_OK;
    }
    BST_TRY(replace_renderer(ctx, s, s->world_camera, NULL));
    s->jitter_rad2 = 0.0;
    s->camera = s->world_camera;
    bst_field_set_camera(s->field, s->camera);
    return BST_OK;
}

/* Switches to another plate scale or jitter between two exposures. */
static bst_status change_camera(bst_ctx *ctx, scenegen *s, double scale_arcsec,
                                double jitter_rad2) {
    long long pixels;
    BST_TRY(bst_renderer_saturated(ctx, s->renderer, &pixels));
    long long frames = bst_renderer_saturated_frames(s->renderer);
    BST_TRY(set_camera(ctx, s, scale_arcsec, jitter_rad2));
    s->saturated_before += frames;
    return BST_OK;
}

/* Saves or restores the camera of the latest exposure; the renderer and the PSF follow from it. */
static bst_status archive_camera(scenegen *s, bst_archive *archive) {
    bst_ctx *ctx = bst_archive_ctx(archive);
    bool changed = s->camera != s->world_camera;
    double scale_arcsec = s->camera->pixel_scale_arcsec, jitter_rad2 = s->jitter_rad2;
    bst_archive_bool(archive, &changed);
    BST_ARCHIVE(archive, scale_arcsec);
    BST_ARCHIVE(archive, jitter_rad2);
    if (!bst_archive_is_restoring(archive)) {
        return BST_OK;
    }
    if (!changed) {
        return reset_camera(ctx, s);
    }
    if (!(scale_arcsec > 0.0 && isfinite(scale_arcsec) && jitter_rad2 >= 0.0 &&
          isfinite(jitter_rad2))) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved state has a pixel scale of %g arcsec and a jitter of %g rad^2 "
                        "(allowed: finite, above 0 and not negative)",
                        scale_arcsec, jitter_rad2);
    }
    return set_camera(ctx, s, scale_arcsec, jitter_rad2);
}

static bst_status archive_module(void *self, bst_archive *archive) {
    scenegen *s = self;
    BST_TRY(archive_camera(s, archive));
    BST_TRY(bst_renderer_archive(s->renderer, archive));
    /* between steps all counted frames are reported */
    s->saturated_told = bst_archive_integer(archive, s->saturated_told, 0, INT64_MAX / 2);
    s->saturated_before = s->saturated_told - bst_renderer_saturated_frames(s->renderer);
    return s->stage
               ? bst_stage_archive(
                     archive, s->stage_use->plugin,
                     ((const bst_frame_stage *)s->stage_use->desc->functions)->archive, s->stage)
               : BST_OK;
}

/* Renders and publishes the frame; a frame to be dropped is only planned, or only rendered where
 * its light changes later frames. */
static bst_status render_frame(scenegen *s, struct bst_step *step, const bst_exposure *e,
                               const bst_render_request *request) {
    bst_ctx *ctx = bst_step_ctx(step);
    if (e->dropped && !bst_detector_has_persistence(&s->camera->detector)) {
        return bst_renderer_plan(ctx, s->renderer, request);
    }
    bst_frame *frame;
    BST_TRY(bst_renderer_render(ctx, s->renderer, request, &frame));
    if (e->dropped) {
        bst_frame_release(frame);
        return BST_OK;
    }
    bst_frame_message *message = bst_step_write(step, PORT_FRAME, NULL);
    *message = (bst_frame_message){.frame = frame,
                                   .exposure_id = e->id,
                                   .start_tick = e->start_tick,
                                   .end_tick = e->end_tick,
                                   .window = e->window,
                                   .binning = e->binning > 1 ? e->binning : 1,
                                   .bits = (int)s->camera->bits};
    assert(bst_frame_message_is_valid(message));
    return s->stage ? change_frame(ctx, s, message) : BST_OK;
}

/* Adds image properties to the truth: cosmic rays, predicted error, number of nodes. */
static void describe_image(scenegen *s, struct bst_step *step, const bst_exposure *e,
                           bst_truth *truth) {
    bst_render_stats stats;
    bst_renderer_get_stats(s->renderer, &stats);
    truth->hits = stats.hits;
    truth->hits_e = stats.hits_e;
    truth->error_sigma = stats.predicted_sigma;
    truth->nodes = stats.nodes;
    if (stats.tolerance_missed && !e->dropped) {
        bst_step_count(step, "tolerance_missed");
    }
    if (stats.nodes_bounded && !e->dropped) {
        bst_step_count(step, "nodes_bounded");
    }
    truth->one_track = stats.single_kernel;
}

/* Renders an exposure and publishes its truth. */
static bst_status process_exposure(scenegen *s, struct bst_step *step, const bst_exposure *e,
                                   const bst_los_history *history) {
    bst_ctx *ctx = bst_step_ctx(step);
    double scale_arcsec =
        e->pixel_scale_arcsec > 0.0 ? e->pixel_scale_arcsec : s->camera->pixel_scale_arcsec;
    if (scale_arcsec != s->camera->pixel_scale_arcsec || history->jitter_rad2 != s->jitter_rad2) {
        BST_TRY(change_camera(ctx, s, scale_arcsec, history->jitter_rad2));
    }
    bst_los_track track;
    int64_t lead =
        bst_detector_lead_ticks(&s->camera->detector, e->window.height, (double)s->tick_rate_hz);
    s->options.lead_s = (double)lead / (double)s->tick_rate_hz;
    s->options.read_charge = true;
    s->options.ghost_sigma = s->renderer_options.tolerance_sigma;
    s->options.binning = e->binning;
    bst_status status = bst_field_track(ctx, s->field, history, e->start_tick - lead,
                                        e->end_tick + lead, s->tick_rate_hz, &track);
    if (status != BST_OK) {
        return lead == 0 ? status
                         : bst_fail_prefix(ctx, status,
                                           "from the start of the first row to the end of the last "
                                           "one (the detector's row_time_s)");
    }
    int capacity, count;
    const bst_scene_source *sources;
    bst_truth *truth = bst_step_write(step, PORT_TRUTH, &capacity);
    truth->exposure_id = e->id;
    truth->dropped = e->dropped;
    BST_TRY(bst_field_query(ctx, s->field, &track, e->start_tick, e->end_tick, s->tick_rate_hz,
                            e->window, &s->options, truth, &sources, &count));
    const struct bst_skylight_map *map = bst_field_background(s->field);
    double dark_e = truth->dark_e - bst_camera_readout_e(s->camera); /* the detector adds that */
    bst_render_request request = {
        .window = e->window,
        .track = &track,
        .sources = sources,
        .count = count,
        .background_e = (map ? 0.0 : truth->background_e) + dark_e,
        .background = map,
        .dark_e = dark_e,
        .row_time_s = s->camera->detector.row_time_s,
        .exposure_s = (double)(e->end_tick - e->start_tick) / (double)s->tick_rate_hz,
        .binning = e->binning,
        .key = s->key,
        .exposure_id = e->id,
        .start_s = (double)e->start_tick / (double)s->tick_rate_hz};
    BST_TRY(render_frame(s, step, e, &request));
    describe_image(s, step, e, truth);
    /* while the device renders */
    const bst_truth_request items = {.field = s->field,
                                     .camera = s->camera,
                                     .track = &track,
                                     .sources = sources,
                                     .count = count,
                                     .window = e->window,
                                     .binning = e->binning,
                                     .peak_e = peak_e,
                                     .user = s->renderer};
    BST_TRY(bst_truth_list_fill(ctx, &s->list, &items, truth, capacity, s->item_source));
    if (truth->lost > 0) {
        bst_step_count(step, "truth_overflow");
    }
    assert(bst_truth_is_valid(truth, capacity));
    if (!e->dropped && s->planes) {
        bst_planes *planes = bst_step_write(step, PORT_PLANES, NULL);
        BST_TRY(bst_plane_maker_render(ctx, s->planes, s->renderer, s->camera, &request,
                                       s->item_source, truth->count, planes));
    }
    report_saturated(s, step);
    return BST_OK;
}

static bst_status step_module(void *self, struct bst_step *step) {
    bst_sample exposure;
    while ((exposure = bst_step_next(step, PORT_EXPOSURE)).payload) {
        bst_sample history = bst_step_latest(step, PORT_LOS);
        if (!history.payload) {
            return bst_fail(bst_step_ctx(step), BST_ERR_STATE,
                            "an exposure ended before any line of sight was published");
        }
        BST_TRY(process_exposure(self, step, exposure.payload, history.payload));
    }
    return BST_OK;
}

const bst_module_desc bst_scenegen_module = {
    .abi = BST_MODULE_ABI,
    .role = "scenegen",
    .type = "opencl",
    .doc = "Renders frames of the true sky on an OpenCL device, with a full detector.",
    .flags = BST_MODULE_READS_TRUTH | BST_MODULE_NEEDS_DEVICE | BST_MODULE_INPUTS_ONLY,
    .config = config,
    .config_bytes = sizeof(scenegen_config),
    .default_rate_hz = 0.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step_module,
    .destroy = destroy,
    .finish = finish,
    .archive = archive_module,
};
