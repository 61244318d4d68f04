#include "scenegen/renderer.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bst_device_kernels.h"
#include "bst_scenegen_kernels.h"
#include "scenegen/detector.h"
#include "scenegen/fft_light.h"
#include "scenegen/frame_pool.h"
#include "scenegen/growing.h"
#include "scenegen/profile_table.h"
#include "scenegen/readout.h"
#include "scenegen/reference.h"
#include "scenegen/render_request.h"
#include "scenegen/rolling.h"
#include "scenegen/scene_options.h"
#include "scenegen/smear.h"
#include "scenegen/tiles.h"
#include "sim/world/skylight.h"

enum { MAX_TAPS = 512, BOX_FLOATS = 4 };
typedef bst_growing growing;
/* Of a block of nodes: place and weight. */
enum { NODE_BYTES = BST_BLOCK * BST_NODE_ROWS * (int)sizeof(float) };

struct bst_renderer {
    bst_camera camera;
    bst_renderer_options options;
    int taps, phases;
    cl_context context;
    cl_command_queue queue;
    cl_program program;
    cl_kernel nodes_kernel, frame_kernel, expected_kernel;
    bst_psf *psf;
    bst_fft_light *fft_light; /* NULL: the PSF is a Gaussian, light comes from stamps */
    bst_smear *smear;
    bst_detector *detector;
    bst_readout *readout;
    bst_rolling *rolling; /* NULL: all rows are exposed at once */
    bst_frame_pool *pool;
    cl_mem profiles;
    growing table, sources, nodes, block_box, source_box, saturated, expected, background;
    bst_scene_source *list; /* drawn sources */
    double *peak_e;         /* of all sources of the request, or of its latest band */
    double *rolled_peak_e;  /* of all, while the bands of a rolling shutter are drawn */
    int list_capacity, tiles;
    bool map;       /* the background differs from pixel to pixel */
    bool uncounted; /* saturated pixels of the latest frame */
    long long saturated_pixels, saturated_frames;
    uint64_t most_bytes; /* of one buffer on the device */
    bst_render_stats stats;
};

bst_renderer_options bst_renderer_default_options(void) {
    return (bst_renderer_options){.tolerance_sigma = 0.05, .pool_frames = 4};
}

/* Stamps up to 8 standard deviations on each side: beyond, less than 1e-15 of the light is left. */
static int taps_for(double sigma_px) {
    int taps = 16 * (int)ceil((2.0 * 8.0 * sigma_px + 2.0) / 16.0);
    return taps > MAX_TAPS ? MAX_TAPS : taps;
}

static bst_status build(bst_ctx *ctx, bst_renderer *r, bst_device *device) {
    const bst_kernel_source *sources[] = {&bst_kernel_scene_shared, &bst_kernel_nodes,
                                          &bst_kernel_splat,        &bst_kernel_random,
                                          &bst_kernel_detector,     &bst_kernel_light,
                                          &bst_kernel_vignetting,   &bst_kernel_background,
                                          &bst_kernel_tile,         &bst_kernel_readout};
    char options[2048];
    bst_scene_build_options(&r->camera, &r->options, r->taps, r->phases, r->fft_light != NULL,
                            r->detector, options, sizeof options);
    BST_TRY(bst_device_build(ctx, device, sources, sizeof sources / sizeof *sources, options,
                             &r->program));
    static const char *const names[3] = {"bst_scene_nodes", "bst_scene_frame",
                                         "bst_scene_expected"};
    cl_kernel *kernels[3] = {&r->nodes_kernel, &r->frame_kernel, &r->expected_kernel};
    for (int i = 0; i < 3; i++) {
        cl_int code;
        *kernels[i] = clCreateKernel(r->program, names[i], &code);
        BST_TRY(bst_device_check(ctx, code, names[i]));
    }
    BST_TRY(bst_detector_set_program(ctx, r->detector, r->program));
    return bst_readout_create(ctx, device, &r->camera, r->program, &r->readout);
}

static bst_status grow(bst_ctx *ctx, bst_renderer *r, growing *g, size_t bytes) {
    return bst_growing_reserve(ctx, r->context, r->most_bytes, g, bytes);
}

/* Copies through a mapping, which PoCL serves without a copy of its own. */
static bst_status upload(bst_ctx *ctx, bst_renderer *r, growing *g, const void *data,
                         size_t bytes) {
    BST_TRY(grow(ctx, r, g, bytes));
    if (bytes == 0) {
        return BST_OK;
    }
    cl_int code;
    void *p = clEnqueueMapBuffer(r->queue, g->buffer, CL_TRUE, CL_MAP_WRITE_INVALIDATE_REGION, 0,
                                 bytes, 0, NULL, NULL, &code);
    BST_TRY(bst_device_check(ctx, code, "mapping scene memory"));
    memcpy(p, data, bytes);
    return bst_device_check(ctx, clEnqueueUnmapMemObject(r->queue, g->buffer, p, 0, NULL, NULL),
                            "unmapping scene memory");
}

/* The PSF, and the Fourier path where it is no Gaussian. */
static bst_status open_psf(bst_ctx *ctx, bst_device *device, bst_renderer *r,
                           bst_smear_options *smear) {
    double sigma_px;
    BST_TRY(bst_psf_create(ctx, &r->camera, &r->psf));
    if (bst_psf_gaussian(r->psf, &sigma_px)) {
        return BST_OK;
    }
    /* a point that fills the well, next to dark pixels */
    bst_fft_light_options light = bst_fft_light_default_options();
    double dark = fmax(r->camera.read_noise_e, 3.0);
    light.tolerance = 10.0 * r->options.tolerance_sigma * dark / fmax(r->camera.full_well_e, 1.0);
    light.tolerance = fmin(fmax(light.tolerance, 2e-6), 1e-3);
    light.taps = r->options.fft_taps > 0 ? r->options.fft_taps : light.taps;
    BST_TRY(bst_fft_light_create(ctx, device, &r->camera, r->psf, &light, &r->fft_light));
    smear->widest = bst_fft_light_widest(r->fft_light);
    smear->table_error = 0.0;
    smear->node_sigma_px = bst_fft_light_band(r->fft_light)->node_sigma_px;
    smear->share_sigma_px = bst_fft_light_band(r->fft_light)->share_sigma_px;
    return BST_OK;
}

bst_status bst_renderer_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               const bst_renderer_options *options, bst_renderer **out) {
    *out = NULL;
    BST_TRY(bst_render_camera_check(ctx, camera));
    bst_renderer *r = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the renderer");
    }
    r->camera = *camera;
    r->options = options ? *options : bst_renderer_default_options();
    r->taps = taps_for(bst_camera_psf_sigma_px(camera));
    r->map = bst_skylight_varies(camera);
    double sigma_px = bst_camera_psf_sigma_px(camera);
    r->phases = r->options.psf_phases > 0
                    ? r->options.psf_phases
                    : bst_profile_phases(sigma_px, r->options.tolerance_sigma, camera->full_well_e);
    r->context = bst_device_context(device);
    r->queue = bst_device_queue(device);
    clRetainContext(r->context);
    clRetainCommandQueue(r->queue);
    bool rolling = camera->detector.row_time_s != 0.0;
    /* half of it is for a rolling shutter's bands */
    bst_smear_options smear = {
        .tolerance_sigma = r->options.tolerance_sigma * (rolling ? 0.5 : 1.0),
        .taps = r->taps,
        .table_error = bst_profile_error(sigma_px, r->phases),
        .motion = r->options.motion,
        .temporal_oversample = r->options.temporal_oversample,
        .stamp_radius_px = r->options.stamp_radius_px};
    bst_status status = bst_tiles_choose(ctx, device, &r->options, &r->most_bytes);
    if (status == BST_OK) {
        status = open_psf(ctx, device, r, &smear);
    }
    if (status == BST_OK) {
        status = bst_detector_create(ctx, device, camera, r->options.pattern, &r->detector);
    }
    if (status == BST_OK && r->options.saturation_flags) {
        status = bst_detector_keep_flags(ctx, r->detector);
    }
    if (status == BST_OK) {
        status = build(ctx, r, device);
    }
    if (status == BST_OK) {
        status = bst_profile_table(ctx, r->context, bst_camera_psf_sigma_px(camera), r->taps,
                                   r->phases, &r->profiles);
    }
    if (status == BST_OK) {
        status = bst_smear_create(ctx, camera, &smear, &r->smear);
    }
    if (status == BST_OK && rolling) {
        double peak_px = r->fft_light ? bst_fft_light_band(r->fft_light)->share_sigma_px : sigma_px;
        status = bst_rolling_create(ctx, camera, smear.tolerance_sigma, peak_px, !r->fft_light,
                                    &r->rolling);
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
    cl_mem buffers[] = {r->profiles,         r->table.buffer,     r->sources.buffer,
                        r->nodes.buffer,     r->block_box.buffer, r->source_box.buffer,
                        r->saturated.buffer, r->expected.buffer,  r->background.buffer};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        if (buffers[i]) {
            clReleaseMemObject(buffers[i]);
        }
    }
    cl_kernel kernels[] = {r->nodes_kernel, r->frame_kernel, r->expected_kernel};
    for (size_t i = 0; i < 3; i++) {
        if (kernels[i]) {
            clReleaseKernel(kernels[i]);
        }
    }
    if (r->program) {
        clReleaseProgram(r->program);
    }
    bst_frame_pool_free(r->pool);
    bst_smear_free(r->smear);
    bst_fft_light_free(r->fft_light);
    bst_psf_free(r->psf);
    bst_readout_free(r->readout);
    bst_rolling_free(r->rolling);
    bst_detector_free(r->detector);
    clReleaseCommandQueue(r->queue);
    clReleaseContext(r->context);
    free(r->list);
    free(r->peak_e);
    free(r->rolled_peak_e);
    free(r);
}

static bst_status reserve_sources(bst_ctx *ctx, bst_renderer *r, int count) {
    if (count > r->list_capacity) {
        int capacity = count > 2 * r->list_capacity ? count : 2 * r->list_capacity;
        free(r->list);
        free(r->peak_e);
        free(r->rolled_peak_e);
        r->list = malloc((size_t)capacity * sizeof *r->list);
        r->peak_e = malloc((size_t)capacity * sizeof *r->peak_e);
        r->rolled_peak_e = malloc((size_t)capacity * sizeof *r->rolled_peak_e);
        r->list_capacity = r->list && r->peak_e && r->rolled_peak_e ? capacity : 0;
        if (r->list_capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", count);
        }
    }
    return BST_OK;
}

/* Chooses nodes and stamps of all sources: fills list and stats. */
static bst_status plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q, int *blocks) {
    BST_TRY(reserve_sources(ctx, r, q->count));
    double read = r->camera.read_noise_e, brightest = 0.0;
    for (int i = 0; i < q->count; i++) {
        brightest = q->sources[i].path ? brightest : fmax(brightest, q->sources[i].electrons_per_s);
    }
    double least_e = q->background_e + (q->background ? q->background->least_e : 0.0);
    BST_TRY(bst_smear_begin(ctx, r->smear, q->track, least_e + read * read, brightest));
    r->stats = (bst_render_stats){0};
    *blocks = 0;
    const uint64_t counted = (uint64_t)INT32_MAX * sizeof(float); /* by the kernels, in int */
    uint64_t most = r->most_bytes < counted ? r->most_bytes : counted;
    int most_blocks = (int)(most / NODE_BYTES);
    for (int i = 0; i < q->count; i++) {
        bst_scene_source *s = &r->list[r->stats.sources];
        bool visible;
        BST_TRY(bst_smear_source(ctx, r->smear, &q->sources[i], s, &visible));
        r->peak_e[i] = bst_smear_last_peak_e(r->smear);
        if (visible && s->blocks > most_blocks - *blocks) {
            return bst_fail(ctx, BST_ERR_RANGE,
                            "the sources move too far in one exposure to be drawn: %d of %d need "
                            "%.0f million points already; expose for a shorter time, turn more "
                            "slowly, or draw fewer stars (v_limit)",
                            r->stats.sources, q->count, 1e-6 * BST_BLOCK * *blocks);
        }
        if (visible) {
            if (r->fft_light) {
                bst_fft_light_stamp(r->fft_light, s);
            }
            s->first_block = *blocks;
            *blocks += s->blocks;
            r->stats.sources++;
            double grid = 0.0; /* error of the Fourier path's grid, on dark pixels */
            if (r->fft_light) {
                grid = bst_fft_light_error(r->fft_light) * r->peak_e[i] /
                       sqrt(q->background_e + read * read);
            }
            r->stats.predicted_sigma =
                fmax(r->stats.predicted_sigma, bst_smear_last_error_sigma(r->smear) + grid);
        }
    }
    r->stats.nodes = (long long)*blocks * BST_BLOCK;
    r->stats.single_kernel = bst_smear_single(r->smear);
    if (r->options.temporal_oversample > 0 || r->options.spatial_oversample > 0) {
        r->stats.predicted_sigma = NAN;
    }
    return BST_OK;
}

static bst_status set_args(bst_ctx *ctx, cl_kernel kernel, const void *const *values,
                           const size_t *bytes, int count) {
    for (int i = 0; i < count; i++) {
        BST_TRY(bst_device_check(ctx, clSetKernelArg(kernel, (cl_uint)i, bytes[i], values[i]),
                                 "setting a kernel argument"));
    }
    return BST_OK;
}

/* Uploads sources and tables and enqueues the nodes kernel. *groups: groups of 16 sources. */
static bst_status enqueue_nodes(bst_ctx *ctx, bst_renderer *r, int blocks, int *groups) {
    int table_blocks, count = r->stats.sources;
    const float *table = bst_smear_table(r->smear, &table_blocks);
    *groups = (count + BST_BLOCK - 1) / BST_BLOCK;
    size_t block_bytes = BST_BLOCK * sizeof(float);
    BST_TRY(upload(ctx, r, &r->table, table, (size_t)table_blocks * BST_TABLE_ROWS * block_bytes));
    BST_TRY(upload(ctx, r, &r->sources, r->list, (size_t)count * sizeof *r->list));
    BST_TRY(grow(ctx, r, &r->nodes, (size_t)blocks * NODE_BYTES));
    BST_TRY(grow(ctx, r, &r->block_box, (size_t)blocks * BOX_FLOATS * sizeof(float)));
    BST_TRY(grow(ctx, r, &r->source_box, (size_t)*groups * BOX_FLOATS * block_bytes));
    if (count == 0) {
        return BST_OK;
    }
    float centre_x = (float)bst_camera_centre_x(&r->camera);
    float centre_y = (float)bst_camera_centre_y(&r->camera);
    const void *values[] = {
        &r->sources.buffer, &count,           &r->table.buffer,     &centre_x,
        &centre_y,          &r->nodes.buffer, &r->block_box.buffer, &r->source_box.buffer};
    const size_t m = sizeof(cl_mem), f = sizeof(float);
    const size_t bytes[] = {m, sizeof count, m, f, f, m, m, m};
    BST_TRY(set_args(ctx, r->nodes_kernel, values, bytes, 8));
    size_t global = (size_t)*groups * BST_BLOCK, local = BST_BLOCK;
    return bst_device_check(
        ctx,
        clEnqueueNDRangeKernel(r->queue, r->nodes_kernel, 1, NULL, &global, &local, 0, NULL, NULL),
        "placing the scene's nodes");
}

/* Counts the saturated pixels of the latest frame, once. Waits for it. */
static bst_status count_saturated(bst_ctx *ctx, bst_renderer *r) {
    if (!r->uncounted) {
        return BST_OK;
    }
    r->uncounted = false;
    r->saturated_pixels = 0;
    cl_int code;
    size_t bytes = (size_t)r->tiles * sizeof(cl_int);
    cl_int *p = clEnqueueMapBuffer(r->queue, r->saturated.buffer, CL_TRUE, CL_MAP_READ, 0, bytes, 0,
                                   NULL, NULL, &code);
    BST_TRY(bst_device_check(ctx, code, "mapping the count of saturated pixels"));
    for (int i = 0; i < r->tiles; i++) {
        r->saturated_pixels += p[i];
    }
    r->saturated_frames += r->saturated_pixels > 0;
    return bst_device_check(
        ctx, clEnqueueUnmapMemObject(r->queue, r->saturated.buffer, p, 0, NULL, NULL),
        "unmapping the count of saturated pixels");
}

/* The image that the tile kernel takes its light from, where the PSF is no Gaussian. */
static bst_status make_light(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q, int groups,
                             bst_scene_params *p, cl_mem *light) {
    bst_fft_light_nodes nodes = {r->sources.buffer, r->nodes.buffer, r->block_box.buffer,
                                 r->source_box.buffer, groups};
    bst_fft_light_image image;
    BST_TRY(bst_fft_light_render(ctx, r->fft_light, r->queue, q->window, &nodes, &image));
    p->light_first = image.first;
    p->light_pitch = image.pitch;
    *light = image.buffer;
    return BST_OK;
}

/* Where an image goes. */
typedef struct target {
    cl_kernel kernel; /* NULL: sources are only planned */
    cl_mem out;
    int stride;                /* floats between the rows of `out`, 0: no gaps */
    bool light_only;           /* without background */
    int first_row, first_tile; /* of a band */
} target;

/* The common way of all kinds of image: the kernels' first six arguments are the same. */
static bst_status enqueue_tiles(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                const target *to) {
    int blocks = 0, groups = 0;
    BST_TRY(plan(ctx, r, q, &blocks));
    if (!to->kernel) {
        return BST_OK;
    }
    BST_TRY(count_saturated(ctx, r)); /* of the frame before, which was rendered meanwhile */
    BST_TRY(enqueue_nodes(ctx, r, blocks, &groups));
    bst_scene_params p = bst_render_params(&r->camera, &r->options, q, groups);
    p.image_stride = to->stride > 0 ? to->stride : p.image_stride;
    p.background_e = to->light_only ? 0.0f : p.background_e;
    p.first_row = to->first_row;
    p.first_tile = to->first_tile;
    size_t tiles = (size_t)p.tiles_x * (size_t)p.tiles_y;
    r->tiles = to->first_tile + (int)tiles;
    BST_TRY(grow(ctx, r, &r->saturated, (size_t)r->tiles * sizeof(cl_int)));
    cl_mem light = r->profiles;
    if (r->fft_light) {
        BST_TRY(make_light(ctx, r, q, groups, &p, &light));
    }
    cl_mem maps[BST_DETECTOR_BUFFERS];
    bst_detector_buffers(r->detector, maps);
    cl_kernel kernel = to->kernel;
    enum { COMMON = 7, ALL = COMMON + 1 + BST_DETECTOR_BUFFERS };
    const void *values[ALL] = {&p,
                               &r->sources.buffer,
                               &r->nodes.buffer,
                               &r->block_box.buffer,
                               &r->source_box.buffer,
                               &light,
                               &to->out,
                               &r->saturated.buffer};
    const size_t m = sizeof(cl_mem);
    size_t bytes[ALL] = {sizeof p, m, m, m, m, m, m, m};
    for (int i = 0; i < BST_DETECTOR_BUFFERS; i++) {
        values[COMMON + 1 + i] = &maps[i];
        bytes[COMMON + 1 + i] = m;
    }
    int count = kernel == r->frame_kernel ? ALL : COMMON;
    BST_TRY(set_args(ctx, kernel, values, bytes, count));
    if (r->map) {
        const bst_skylight_map *map = bst_render_background(q);
        size_t size = (size_t)map->columns * (size_t)map->rows * sizeof *map->e;
        BST_TRY(upload(ctx, r, &r->background, map->e, size));
        BST_TRY(bst_device_check(ctx,
                                 clSetKernelArg(kernel, (cl_uint)count, m, &r->background.buffer),
                                 "setting a kernel argument"));
    }
    size_t group = (size_t)r->options.group, global = (tiles + group - 1) / group * group;
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(r->queue, kernel, 1, NULL, &global, &group, 0, NULL, NULL),
        "rendering a frame");
}

/* All rows at once, or band by band. */
static bst_status enqueue_image(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                target to) {
    if (q->row_time_s == 0.0) {
        return enqueue_tiles(ctx, r, q, &to);
    }
    BST_TRY(reserve_sources(ctx, r, q->count));
    for (int i = 0; i < q->count; i++) {
        r->rolled_peak_e[i] = 0.0;
    }
    if (to.kernel) {
        /* room for the tiles of all bands, which must not move while they are written */
        size_t across = (size_t)q->window.width / (size_t)r->options.tile_width + 2;
        BST_TRY(count_saturated(ctx, r));
        BST_TRY(grow(ctx, r, &r->saturated, across * (size_t)q->window.height * sizeof(cl_int)));
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
        to.first_tile = r->tiles;
        all.single_kernel = all.single_kernel && r->stats.single_kernel;
        all.predicted_sigma = fmax(all.predicted_sigma,
                                   r->stats.predicted_sigma + bst_rolling_error_sigma(r->rolling));
        for (int i = 0; i < band.count; i++) {
            double *peak_e = &r->rolled_peak_e[bst_rolling_source(r->rolling, i)];
            all.sources += *peak_e == 0.0 && r->peak_e[i] > 0.0;
            *peak_e = fmax(*peak_e, r->peak_e[i]);
        }
    }
    memcpy(r->peak_e, r->rolled_peak_e, (size_t)q->count * sizeof *r->peak_e);
    if (isnan(r->stats.predicted_sigma)) {
        all.predicted_sigma = NAN;
    }
    r->stats = all;
    return BST_OK;
}

bst_status bst_renderer_plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request) {
    BST_TRY(bst_render_request_check(ctx, &r->camera, request));
    return enqueue_image(ctx, r, request, (target){.kernel = NULL});
}

/* Light first, then what columns and binned pixels make of it. */
static bst_status render_in_stages(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                   int binning, cl_mem frame) {
    bst_render_request light = *q;
    cl_mem image;
    int stride;
    light.window = bst_readout_light_window(r->readout, q->window);
    BST_TRY(bst_readout_image(ctx, r->readout, light.window, &image, &stride));
    BST_TRY(enqueue_image(
        ctx, r, &light,
        (target){
            .kernel = r->expected_kernel, .out = image, .stride = stride, .light_only = true}));
    r->tiles = q->window.height / binning;
    BST_TRY(grow(ctx, r, &r->saturated, (size_t)r->tiles * sizeof(cl_int)));
    bst_scene_params p = bst_render_params(&r->camera, &r->options, q, 0);
    return bst_readout_run(ctx, r->readout, r->detector, &p, q->window, binning, frame,
                           r->saturated.buffer);
}

bst_status bst_renderer_render(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request,
                               bst_frame **out) {
    *out = NULL;
    BST_TRY(bst_render_request_check(ctx, &r->camera, request));
    bst_frame *frame;
    cl_mem buffer;
    int binning = request->binning > 1 ? request->binning : 1;
    BST_TRY(bst_frame_pool_take(ctx, r->pool, request->window.width / binning,
                                request->window.height / binning, &frame, &buffer));
    double exposure_s = bst_render_exposure_s(request);
    bst_status status =
        bst_detector_begin(ctx, r->detector, request->key, request->exposure_id, exposure_s);
    if (status == BST_OK) {
        status = binning > 1 || bst_detector_whole_columns(r->detector)
                     ? render_in_stages(ctx, r, request, binning, buffer)
                     : enqueue_image(ctx, r, request,
                                     (target){.kernel = r->frame_kernel, .out = buffer});
    }
    if (status == BST_OK) {
        r->uncounted = true;
        status = bst_frame_pool_enqueued(ctx, frame);
    }
    if (status == BST_OK) {
        status = bst_detector_end(ctx, r->detector);
    }
    if (status == BST_OK) {
        status = bst_device_check(ctx, clFlush(r->queue), "starting the rendering");
    }
    if (status != BST_OK) {
        bst_frame_release(frame);
        return status;
    }
    bst_hits_summary hits = bst_detector_hits(r->detector);
    r->stats.hits = hits.tracks;
    r->stats.hits_e = hits.electrons;
    *out = frame;
    return BST_OK;
}

bst_status bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *r,
                                          const bst_render_request *request, float *image) {
    BST_TRY(bst_render_request_check(ctx, &r->camera, request));
    size_t bytes = (size_t)request->window.width * (size_t)request->window.height * sizeof(float);
    BST_TRY(grow(ctx, r, &r->expected, bytes));
    BST_TRY(enqueue_image(ctx, r, request,
                          (target){.kernel = r->expected_kernel, .out = r->expected.buffer}));
    return bst_device_check(
        ctx,
        clEnqueueReadBuffer(r->queue, r->expected.buffer, CL_TRUE, 0, bytes, image, 0, NULL, NULL),
        "reading a noise-free image");
}

bst_status bst_renderer_saturated(bst_ctx *ctx, bst_renderer *r, long long *pixels) {
    BST_TRY(count_saturated(ctx, r));
    *pixels = r->saturated_pixels;
    return BST_OK;
}

bst_status bst_renderer_flags(bst_ctx *ctx, bst_renderer *r, size_t pixels, uint8_t *out) {
    return bst_detector_flags(ctx, r->detector, pixels, out);
}

long long bst_renderer_saturated_frames(const bst_renderer *r) {
    return r->saturated_frames;
}

void bst_renderer_get_stats(const bst_renderer *r, bst_render_stats *out) {
    *out = r->stats;
}

double bst_renderer_peak_e(const bst_renderer *r, int index) {
    return r->peak_e[index];
}

int bst_renderer_margin_px(const bst_renderer *r) {
    return r->fft_light ? bst_fft_light_margin_px(r->fft_light) : r->taps / 2 + 1;
}
