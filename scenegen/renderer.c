#include "scenegen/renderer.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/detector/detector.h"
#include "scenegen/detector/readout.h"
#include "scenegen/detector/vignetting.h"
#include "scenegen/device_array.h"
#include "scenegen/fourier/fourier_render.h"
#include "scenegen/frame_pool.h"
#include "scenegen/ramp_intervals.h"
#include "scenegen/reference.h"
#include "scenegen/render_request.h"
#include "scenegen/renderer_internal.h"
#include "scenegen/saturation_count.h"
#include "scenegen/scene_boxes.h"
#include "scenegen/scene_kernels.h"
#include "scenegen/scene_options.h"
#include "scenegen/scene_plan.h"
#include "scenegen/smear/rolling_shutter.h"
#include "scenegen/smear/smear.h"
#include "scenegen/stamp/fixed_point_px.h"
#include "scenegen/stamp/profile_law.h"
#include "scenegen/tiles.h"
#include "scenegen/upload_ring.h"
#include "sim/world/scene/skylight.h"

enum { MAX_TAPS = BST_PLACE_TAPS };
typedef bst_device_array growing;

bst_renderer_options bst_renderer_default_options(void) {
    return (bst_renderer_options){.tolerance_sigma = 0.05, .pool_frames = 4};
}

/* Taps for stamps up to 8 sigma on each side: less than 1e-15 of the light is beyond. */
static int taps_for(double sigma_px) {
    int taps = 16 * (int)ceil((2.0 * 8.0 * sigma_px + 2.0) / 16.0);
    return taps > MAX_TAPS ? MAX_TAPS : taps;
}

/* Builds the kernel of noise-free images at its first use. */
static bst_status build_expected(bst_ctx *ctx, bst_renderer *r) {
    return r->expected_kernel ? BST_OK
                              : bst_scene_expected_kernel(ctx, r->device, r->form, r->tile_options,
                                                          &r->expected_kernel);
}

/* Builds the kernel of frames at its first use. */
static bst_status build_frame(bst_ctx *ctx, bst_renderer *r) {
    if (r->frame_kernel) {
        return BST_OK;
    }
    char options[320], detector[64];
    bst_detector_options(r->detector, r->options.shared_program, detector, sizeof detector);
    snprintf(options, sizeof options, "%s%s", r->tile_options, detector);
    return bst_scene_frame_kernel(ctx, r->device, r->form, options, &r->frame_kernel);
}

/* Sets the parameters that are the camera's.
 *
 * Given:     camera  with the noise of a single read */
static bst_status build(bst_ctx *ctx, bst_renderer *r, const bst_camera *camera) {
    r->form = (bst_scene_form){.lanes = r->options.group == 0, .fourier = r->fourier != NULL};
    r->boxes = bst_scene_boxes_init(r->device, r->form, r->most_bytes);
    bst_scene_tile_options(&r->options, r->taps, r->law_degree, r->fourier != NULL, r->tile_options,
                           sizeof r->tile_options);
    r->fixed.nodes = bst_scene_node_params(&r->camera, r->options.spatial_oversample);
    r->fixed.vignetting = bst_vignetting_params(&r->camera);
    bst_detector_params(r->detector, &r->fixed);
    return bst_readout_create(ctx, r->device, camera, &r->readout);
}

bst_status bst_renderer_prepare(bst_ctx *ctx, bst_renderer *r) {
    const bool staged = bst_detector_is_staged(r->detector);
    BST_TRY(staged ? build_expected(ctx, r) : build_frame(ctx, r));
    BST_TRY(bst_scene_boxes_prepare(ctx, &r->boxes, staged ? r->expected_kernel : r->frame_kernel));
    return staged ? bst_readout_prepare(ctx, r->readout) : BST_OK;
}

static bst_status grow(bst_ctx *ctx, bst_renderer *r, bst_device_array *g, size_t bytes) {
    return bst_device_array_reserve(ctx, r->context, r->most_bytes, g, bytes);
}

/* Creates the PSF and, if it is not Gaussian, the Fourier render path. */
static bst_status open_psf(bst_ctx *ctx, bst_device *device, bst_renderer *r,
                           bst_smear_options *smear) {
    double sigma_px;
    BST_TRY(bst_psf_create(ctx, &r->camera, &r->psf));
    if (bst_psf_gaussian(r->psf, &sigma_px)) {
        return BST_OK;
    }
    /* worst case: a point that fills the well next to dark pixels */
    bst_fourier_render_options light = bst_fourier_render_default_options();
    double dark = fmax(r->camera.read_noise_e, 3.0);
    light.tolerance = 10.0 * r->options.tolerance_sigma * dark / fmax(r->camera.full_well_e, 1.0);
    light.tolerance = fmin(fmax(light.tolerance, 2e-6), 1e-3);
    light.taps = r->options.fft_taps > 0 ? r->options.fft_taps : light.taps;
    light.spatial_oversample = r->options.spatial_oversample;
    BST_TRY(bst_fourier_render_create(ctx, device, &r->camera, r->psf, &light, &r->fourier));
    smear->widest = bst_fourier_render_widest(r->fourier);
    smear->node_sigma_px = bst_fourier_render_band(r->fourier)->node_sigma_px;
    smear->smoothed_variance_px2 = bst_fourier_render_band(r->fourier)->smoothed_variance_px2;
    smear->share_sigma_px = bst_fourier_render_band(r->fourier)->share_sigma_px;
    smear->grid_per_px = bst_fourier_render_density(r->fourier, false);
    smear->sensitivity = &bst_fourier_render_band(r->fourier)->sensitivity;
    memcpy(smear->pixel_part, bst_fourier_render_band(r->fourier)->pixel_part,
           sizeof smear->pixel_part);
    return BST_OK;
}

/* Pixels of a sensor above which more threads draw its maps, some 0.1 us a pixel. */
enum { PIXELS_FOR_THREADS = 1 << 18 };

/* Starts the threads of the planning, if the device leaves the processor idle, and creates the
 * detector, whose maps have threads of their own with a device that is the processor. */
static bst_status open_detector(bst_ctx *ctx, bst_device *device, bst_renderer *r) {
    int threads = r->options.planning_threads;
    if (threads > 1 || (threads == 0 && !bst_device_is_cpu(device))) {
        BST_TRY(bst_parallel_create(ctx, threads, &r->planners));
    }
    bst_parallel *maps = NULL;
    if (threads == 0 && !r->planners &&
        r->camera.width_px * r->camera.height_px >= PIXELS_FOR_THREADS) {
        BST_TRY(bst_parallel_create(ctx, bst_device_processors(device), &maps));
    }
    bst_status status = bst_detector_create(ctx, device, &r->camera, r->options.pattern,
                                            r->planners, maps ? maps : r->planners, &r->detector);
    bst_parallel_free(maps);
    BST_TRY(status);
    return r->options.saturation_flags ? bst_detector_keep_flags(ctx, r->detector) : BST_OK;
}

/* Share of the tolerance for the light of an image: half of it is for the bands of a rolling
 * shutter, and the errors of a ramp's intervals add up. */
static double tolerance_share(const bst_detector_config *d) {
    int64_t intervals = d->ramp.reads - 1;
    return d->row_time_s != 0.0 ? 0.5 : intervals > 1 ? 1.0 / (double)intervals : 1.0;
}

/* Creates the read intervals of a ramp, or the bands of a rolling shutter. */
static bst_status open_parts(bst_ctx *ctx, const bst_camera *camera, bst_renderer *r) {
    if (camera->detector.ramp.reads > 0) {
        return bst_ramp_intervals_create(ctx, &r->intervals);
    }
    if (camera->detector.row_time_s == 0.0) {
        return BST_OK;
    }
    double peak_px = r->fourier ? bst_fourier_render_band(r->fourier)->share_sigma_px
                                : bst_camera_psf_sigma_px(camera);
    return bst_rolling_create(ctx, camera, r->tolerance_sigma, peak_px, !r->fourier, &r->rolling);
}

bst_status bst_renderer_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               const bst_renderer_options *options, bst_renderer **out) {
    assert(device && camera && out);
    *out = NULL;
    BST_TRY(bst_render_camera_check(ctx, camera));
    bst_renderer *r = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the renderer");
    }
    r->camera = *camera;
    r->camera.read_noise_e = bst_camera_read_noise_e(camera); /* of a frame */
    r->options = options ? *options : bst_renderer_default_options();
    r->taps = taps_for(bst_camera_psf_sigma_px(camera));
    r->map = bst_skylight_may_vary(camera);
    double sigma_px = bst_camera_psf_sigma_px(camera);
    r->law_degree = r->options.psf_degree;
    r->device = device;
    r->context = bst_device_context(device);
    r->queue = bst_device_queue(device);
    clRetainContext(r->context);
    clRetainCommandQueue(r->queue);
    bst_smear_options smear = {
        .tolerance_sigma = r->options.tolerance_sigma * tolerance_share(&camera->detector),
        .taps = r->taps,
        .motion = r->options.motion,
        .temporal_oversample = r->options.temporal_oversample,
        .penumbrae = r->options.penumbrae,
        .stamp_radius_px = r->options.stamp_radius_px};
    r->tolerance_sigma = smear.tolerance_sigma;
    bst_saturation_count_init(&r->saturation);
    bst_status status = bst_tiles_choose(ctx, device, &r->options, &r->most_bytes);
    if (status == BST_OK) {
        status = open_psf(ctx, device, r, &smear);
    }
    if (status == BST_OK) {
        status = open_detector(ctx, device, r);
        smear.pool = r->planners;
        int threads = r->options.planning_threads;
        smear.body_threads = threads > 0 ? threads : bst_device_processors(device);
    }
    if (status == BST_OK) {
        r->law_degree = r->fourier          ? 0
                        : r->law_degree > 0 ? r->law_degree
                                            : bst_profile_law_degree(sigma_px);
        status =
            bst_profile_law_buffer(ctx, r->context, sigma_px, r->law_degree, r->taps / 2, &r->law);
    }
    if (status == BST_OK && r->law_degree > 0) {
        smear.law_error = bst_profile_law_error(sigma_px, r->law_degree);
        smear.law_widest = bst_profile_law_widest(sigma_px, r->law_degree);
    }
    if (status == BST_OK) {
        status = build(ctx, r, camera);
    }
    if (status == BST_OK) {
        status = bst_smear_create(ctx, camera, &smear, &r->smear);
    }
    if (status == BST_OK) {
        status = bst_error_budget_create(ctx, &r->budget);
    }
    if (status == BST_OK) {
        status = bst_upload_ring_create(ctx, device, &r->stage);
    }
    if (status == BST_OK) {
        status = open_parts(ctx, camera, r);
    }
    if (status == BST_OK) {
        status = bst_frame_pool_create(ctx, device, (int)camera->width_px, (int)camera->height_px,
                                       r->options.pool_frames, &r->pool);
    }
    if (status != BST_OK) {
        bst_renderer_free(r);
        return status;
    }
    *out = r;
    return BST_OK;
}

void bst_renderer_free(bst_renderer *r) {
    if (!r) {
        return;
    }
    clFinish(r->queue);
    cl_mem buffers[] = {r->law, r->expected.buffer};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        if (buffers[i]) {
            clReleaseMemObject(buffers[i]);
        }
    }
    cl_kernel kernels[] = {r->frame_kernel, r->expected_kernel};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++) {
        if (kernels[i]) {
            clReleaseKernel(kernels[i]);
        }
    }
    bst_scene_boxes_clear(&r->boxes);
    bst_upload_ring_free(r->stage);
    bst_frame_pool_free(r->pool);
    bst_smear_free(r->smear);
    bst_error_budget_free(r->budget);
    bst_fourier_render_free(r->fourier);
    bst_psf_free(r->psf);
    bst_readout_free(r->readout);
    bst_rolling_free(r->rolling);
    bst_ramp_intervals_free(r->intervals);
    bst_detector_free(r->detector);
    bst_parallel_free(r->planners);
    clReleaseCommandQueue(r->queue);
    clReleaseContext(r->context);
    bst_scene_plan_clear(&r->plan);
    free(r->rolled_peak_e);
    free(r);
}

/* Chooses nodes and stamps of all sources: sets plan and stats. */
static bst_status make_plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q) {
    const bst_scene_plan_limits limits = {
        .tolerance_sigma = bst_renderer_is_predictable(r) ? r->tolerance_sigma : INFINITY,
        .margin_px = bst_renderer_margin_px(r),
        .bytes = r->most_bytes,
        .nodes = r->options.max_nodes};
    BST_TRY(bst_scene_plan_make(ctx, &r->plan, &r->camera, r->smear, r->budget, r->fourier, &limits,
                                q));
    r->stats = (bst_render_stats){.sources = r->plan.count,
                                  .nodes = (long long)r->plan.blocks * BST_BLOCK,
                                  .nodes_bounded = r->plan.bounded,
                                  .single_kernel = bst_smear_single(r->smear)};
    return BST_OK;
}

/* Uploads sources and tables and enqueues the kernel of their boxes. */
static bst_status enqueue_nodes(bst_ctx *ctx, bst_renderer *r, cl_kernel tile_kernel) {
    const bst_scene_plan *plan = &r->plan;
    int table_blocks;
    const float *table = bst_smear_table(r->smear, &table_blocks);
    BST_TRY(bst_upload_ring_put(ctx, r->stage, BST_STAGE_TABLE, table,
                                (size_t)table_blocks * BST_TABLE_ROWS * BST_BLOCK * sizeof(float),
                                &r->table));
    BST_TRY(bst_upload_ring_put(ctx, r->stage, BST_STAGE_SOURCES, plan->sources,
                                (size_t)plan->count * sizeof *plan->sources, &r->sources));
    if (plan->shares) {
        BST_TRY(bst_upload_ring_put(ctx, r->stage, BST_STAGE_SHARES, plan->shares,
                                    (size_t)plan->count * sizeof *plan->shares, &r->shares));
    }
    const bst_scene_boxes_input input = {.nodes = &r->fixed.nodes,
                                         .count = plan->count,
                                         .blocks = plan->blocks,
                                         .boxes = plan->boxes,
                                         .sources = r->sources,
                                         .table = r->table,
                                         .tile_kernel = tile_kernel};
    return bst_scene_boxes_enqueue(ctx, &r->boxes, r->queue, &input);
}

/* Buffer for the frame's saturation counts. */
static bst_status saturated_room(bst_ctx *ctx, bst_renderer *r, size_t tiles, cl_mem *out) {
    return bst_upload_ring_room(ctx, r->stage, BST_STAGE_SATURATED, tiles * sizeof(cl_int), out);
}

/* Starts the next upload set; another frame may be in progress. */
static bst_status begin_set(bst_ctx *ctx, bst_renderer *r) {
    r->set = bst_upload_ring_begin(r->stage);
    return bst_saturation_count_frame(ctx, &r->saturation, r->stage, r->set);
}

/* Renders the light image for the tile kernel if the PSF is not Gaussian. */
static bst_status make_light(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                             bst_kernel_frame_params *p, cl_mem *light) {
    bst_fourier_render_nodes nodes = {
        r->sources, r->table,         r->boxes.block.buffer, r->boxes.source.buffer,
        r->shares,  p->source_groups, r->plan.fine};
    bst_fourier_render_image image;
    BST_TRY(bst_fourier_render_frame(ctx, r->fourier, r->queue, q->window, &nodes, &image));
    p->light_first = image.first;
    p->light_pitch = image.pitch;
    *light = image.buffer;
    return BST_OK;
}

/* Destination of an image. */
typedef struct target {
    cl_kernel kernel;          /* NULL: sources are only planned */
    cl_mem out, saturated;     /* saturated NULL: image of expected electrons */
    int stride;                /* floats between rows of `out`, 0: contiguous */
    bool light_only;           /* without background */
    int first_row, first_tile; /* of a band */
} target;

/* Enqueues the tile kernel for any kind of image; the kernels share their first nine arguments. */
static bst_status enqueue_tiles(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                const target *to) {
    BST_TRY(make_plan(ctx, r, q));
    if (!to->kernel) {
        return BST_OK;
    }
    bst_kernel_frame_params p =
        bst_render_params(&r->fixed, &r->camera, &r->options, q, r->plan.count);
    BST_TRY(enqueue_nodes(ctx, r, to->kernel));
    p.blocks = r->plan.blocks;
    p.image_stride = to->stride > 0 ? to->stride : p.image_stride;
    p.background_e = to->light_only ? 0.0f : p.background_e;
    p.first_row = to->first_row;
    p.first_tile = to->first_tile;
    size_t tiles = (size_t)p.tiles_x * (size_t)p.tiles_y;
    if (to->saturated) {
        r->saturation.tiles[r->set] = to->first_tile + (int)tiles;
    }
    cl_mem light = r->law;
    if (r->fourier) {
        BST_TRY(make_light(ctx, r, q, &p, &light));
    }
    cl_mem maps[BST_DETECTOR_BUFFERS], background = NULL;
    bst_detector_buffers(r->detector, maps);
    if (r->map) {
        const bst_skylight_map *map = bst_render_background(q);
        size_t size = (size_t)map->columns * (size_t)map->rows * sizeof *map->e;
        BST_TRY(
            bst_upload_ring_put(ctx, r->stage, BST_STAGE_BACKGROUND, map->e, size, &background));
    }
    cl_kernel kernel = to->kernel;
    enum { COMMON = 9, ALL = COMMON + 1 + BST_DETECTOR_BUFFERS };
    const void *values[ALL] = {&p,
                               &r->sources,
                               &r->table,
                               &r->boxes.block.buffer,
                               &r->boxes.source.buffer,
                               &r->boxes.group.buffer,
                               &light,
                               &background,
                               &to->out,
                               &to->saturated};
    const size_t m = sizeof(cl_mem);
    size_t bytes[ALL] = {sizeof p, m, m, m, m, m, m, m, m, m};
    for (int i = 0; i < BST_DETECTOR_BUFFERS; i++) {
        values[COMMON + 1 + i] = &maps[i];
        bytes[COMMON + 1 + i] = m;
    }
    BST_TRY(bst_scene_kernel_arguments(ctx, kernel, values, bytes,
                                       kernel == r->frame_kernel ? ALL : COMMON));
    size_t group = (size_t)r->options.group, global = 0;
    if (r->form.lanes) {
        group = (size_t)BST_ROW_LANES * (size_t)r->options.tile_height;
        global = tiles * group;
    } else {
        global = (tiles + group - 1) / group * group;
    }
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(r->queue, kernel, 1, NULL, &global, &group, 0, NULL, NULL),
        "rendering a frame");
}

/* Enqueues an image at once, or band by band for a rolling shutter. */
static bst_status enqueue_image(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                target to) {
    r->rolled = r->summed = q->row_time_s != 0.0;
    if (to.kernel && to.kernel == r->frame_kernel) { /* room for the tiles of all bands */
        size_t across = (size_t)q->window.width / (size_t)r->options.tile_width + 2;
        size_t rows = (size_t)(r->rolled ? 1 : r->options.tile_height);
        size_t down = ((size_t)q->window.height + rows - 1) / rows;
        BST_TRY(saturated_room(ctx, r, across * down, &to.saturated));
    }
    if (!r->rolled) {
        return enqueue_tiles(ctx, r, q, &to);
    }
    if (q->count > r->rolled_capacity) {
        free(r->rolled_peak_e);
        r->rolled_peak_e = malloc((size_t)q->count * sizeof *r->rolled_peak_e);
        r->rolled_capacity = r->rolled_peak_e ? q->count : 0;
        if (!r->rolled_peak_e) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", q->count);
        }
    }
    for (int i = 0; i < q->count; i++) {
        r->rolled_peak_e[i] = 0.0;
    }
    bst_render_stats all = {.single_kernel = true};
    bool more;
    BST_TRY(bst_rolling_begin(ctx, r->rolling, q, bst_renderer_margin_px(r)));
    for (bst_render_request band;; all.nodes += r->stats.nodes) {
        BST_TRY(bst_rolling_next(ctx, r->rolling, &band, &more));
        if (!more) {
            break;
        }
        to.first_row = band.window.y0 - q->window.y0;
        BST_TRY(enqueue_tiles(ctx, r, &band, &to));
        to.first_tile = to.saturated ? r->saturation.tiles[r->set] : 0;
        all.nodes_bounded = all.nodes_bounded || r->stats.nodes_bounded;
        all.single_kernel = all.single_kernel && r->stats.single_kernel;
        double predicted = bst_scene_plan_error_sigma(&r->plan, r->smear, r->budget);
        all.predicted_sigma =
            fmax(all.predicted_sigma, predicted + bst_rolling_error_sigma(r->rolling));
        for (int i = 0; i < band.count; i++) {
            double *peak_e = &r->rolled_peak_e[bst_rolling_source(r->rolling, i)];
            all.sources += *peak_e == 0.0 && r->plan.peak_e[i] > 0.0;
            *peak_e = fmax(*peak_e, r->plan.peak_e[i]);
        }
    }
    r->stats = all;
    return BST_OK;
}

bst_status bst_renderer_plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request) {
    BST_TRY(bst_render_request_check(ctx, &r->camera, request));
    return enqueue_image(ctx, r, request, (target){.kernel = NULL});
}

/* Renders the light that the staged read-out of a request needs; interval: of a ramp, else 0. */
static bst_status render_light(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                               int interval) {
    bst_render_request light = *q;
    cl_mem image;
    int stride;
    light.window = bst_readout_light_window(r->readout, q->window);
    BST_TRY(bst_readout_image(ctx, r->readout, light.window, &image, &stride));
    int number = interval % bst_readout_images(r->readout);
    return enqueue_image(ctx, r, &light,
                         (target){.kernel = r->expected_kernel,
                                  .out = image,
                                  .stride = stride,
                                  .light_only = true,
                                  .first_row = number * light.window.height});
}

/* Renders the intervals of a ramp, and sets the statistics of the whole exposure. */
static bst_status render_ramp(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q) {
    int intervals = (int)r->camera.detector.ramp.reads - 1;
    bst_render_stats all = {.single_kernel = true};
    for (int i = 0; i < intervals; i++) {
        bst_render_request part;
        BST_TRY(bst_ramp_interval(ctx, r->intervals, q, i, intervals, &part));
        BST_TRY(bst_detector_interval(ctx, r->detector, r->stage, q->key, q->exposure_id, i,
                                      bst_render_exposure_s(&part)));
        BST_TRY(render_light(ctx, r, &part, i));
        all.nodes += r->stats.nodes;
        all.nodes_bounded = all.nodes_bounded || r->stats.nodes_bounded;
        all.single_kernel = all.single_kernel && r->stats.single_kernel;
        all.predicted_sigma += bst_scene_plan_error_sigma(&r->plan, r->smear, r->budget);
        bst_kernel_frame_params p = bst_render_params(&r->fixed, &r->camera, &r->options, &part, 0);
        BST_TRY(bst_readout_interval(ctx, r->readout, r->detector, &p, q->window, i, part.start_s));
    }
    BST_TRY(make_plan(ctx, r, q)); /* for bst_renderer_peak_e */
    all.sources = r->stats.sources;
    r->stats = all;
    r->summed = true;
    return BST_OK;
}

/* Renders the light first, then the staged read-out for column effects and binning. */
static bst_status render_in_stages(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                   int binning, cl_mem frame) {
    BST_TRY(build_expected(ctx, r));
    BST_TRY(r->intervals ? render_ramp(ctx, r, q) : render_light(ctx, r, q, 0));
    int parts = bst_readout_parts(r->readout, q->window, binning);
    cl_mem saturated;
    BST_TRY(saturated_room(ctx, r, (size_t)parts, &saturated));
    r->saturation.tiles[r->set] = parts;
    bst_kernel_frame_params p = bst_render_params(&r->fixed, &r->camera, &r->options, q, 0);
    return bst_readout_run(ctx, r->readout, r->detector, &p, q->window, binning, q->start_s, frame,
                           saturated);
}

bst_status bst_renderer_render(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request,
                               bst_frame **out) {
    assert(r && request && out && request->count >= 0 && (request->sources || request->count == 0));
    *out = NULL;
    BST_TRY(bst_render_request_check(ctx, &r->camera, request));
    bst_frame *frame;
    cl_mem buffer;
    int binning = request->binning > 1 ? request->binning : 1;
    BST_TRY(bst_frame_pool_take(ctx, r->pool, request->window.width / binning,
                                request->window.height / binning, &frame, &buffer));
    double exposure_s = bst_render_exposure_s(request);
    bool staged = binning > 1 || bst_detector_is_staged(r->detector);
    bst_detector_rows rows = {request->window.y0, request->window.height};
    if (staged) { /* charge of rows beside the window may pass through the read-out */
        rows = (bst_detector_rows){0, (int)r->camera.height_px};
    }
    bst_status status = staged ? BST_OK : build_frame(ctx, r);
    if (status == BST_OK) {
        status = begin_set(ctx, r);
    }
    if (status == BST_OK) {
        status = bst_detector_begin(ctx, r->detector, r->stage, request->key, request->exposure_id,
                                    exposure_s, rows);
    }
    if (status == BST_OK) {
        status = staged ? render_in_stages(ctx, r, request, binning, buffer)
                        : enqueue_image(ctx, r, request,
                                        (target){.kernel = r->frame_kernel, .out = buffer});
    }
    if (status == BST_OK) {
        status = bst_frame_pool_enqueued(ctx, frame);
    }
    if (status == BST_OK) {
        status = bst_detector_end(ctx, r->detector);
    }
    if (status == BST_OK) {
        status = bst_upload_ring_end(ctx, r->stage);
    }
    if (status == BST_OK) {
        status = bst_device_check(ctx, clFlush(r->queue), "starting the rendering");
    }
    if (status != BST_OK) {
        r->saturation.tiles[r->set] = 0;
        bst_frame_release(frame);
        return status;
    }
    bst_cosmic_rays_summary hits = bst_detector_hits(r->detector);
    r->stats.hits = hits.tracks;
    r->stats.hits_e = hits.electrons;
    *out = frame;
    return BST_OK;
}

bst_status bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *r,
                                          const bst_render_request *request, float *image) {
    assert(r && request && image);
    BST_TRY(bst_render_request_check(ctx, &r->camera, request));
    size_t bytes = (size_t)request->window.width * (size_t)request->window.height * sizeof(float);
    BST_TRY(build_expected(ctx, r));
    BST_TRY(grow(ctx, r, &r->expected, bytes));
    BST_TRY(begin_set(ctx, r));
    BST_TRY(enqueue_image(ctx, r, request,
                          (target){.kernel = r->expected_kernel, .out = r->expected.buffer}));
    BST_TRY(bst_upload_ring_end(ctx, r->stage));
    return bst_device_check(
        ctx,
        clEnqueueReadBuffer(r->queue, r->expected.buffer, CL_TRUE, 0, bytes, image, 0, NULL, NULL),
        "reading a noise-free image");
}
