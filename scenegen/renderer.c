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
#include "scenegen/place.h"
#include "scenegen/profile_table.h"
#include "scenegen/readout.h"
#include "scenegen/reference.h"
#include "scenegen/smear.h"
#include "scenegen/tiles.h"
#include "scenegen/vignetting.h"

enum { MAX_TAPS = BST_PLACE_TAPS, BOX_FLOATS = 4 };
/* Of a block of nodes: place and weight. */
enum { NODE_BYTES = BST_BLOCK * BST_NODE_ROWS * (int)sizeof(float) };

/* A device buffer that grows. */
typedef struct growing {
    cl_mem buffer;
    size_t bytes;
} growing;

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
    bst_crowd *crowd;
    bst_detector *detector;
    bst_readout *readout;
    bst_frame_pool *pool;
    cl_mem profiles;
    growing table, sources, nodes, block_box, source_box, saturated, expected;
    bst_scene_source *list; /* drawn sources */
    double *peak_e;         /* of all sources of the request */
    int list_capacity, tiles;
    bool uncounted; /* saturated pixels of the latest frame */
    long long saturated_pixels, saturated_frames;
    uint64_t most_bytes; /* of one buffer on the device */
    bst_render_stats stats;
};

bst_renderer_options bst_renderer_default_options(void) {
    return (bst_renderer_options){.tolerance_sigma = 0.05, .pool_frames = 4};
}

static bst_status check_camera(bst_ctx *ctx, const bst_camera *c) {
    if (c->width_px < 1 || c->height_px < 1 || c->width_px > 65536 || c->height_px > 65536 ||
        c->bits < 8 || c->bits > 16) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render %lld x %lld pixels of %lld bits: allowed are 1 to 65536 "
                        "pixels and 8 to 16 bits",
                        (long long)c->width_px, (long long)c->height_px, (long long)c->bits);
    }
    double fwhm_px = 2.3548200450309493 * bst_camera_psf_sigma_px(c);
    if (!(c->psf_fwhm_px > 0.0) || fwhm_px > 70.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render a PSF of psf_fwhm_px %g, with charge diffusion and fast "
                        "jitter %g: allowed are 0 to 70 pixels",
                        c->psf_fwhm_px, fwhm_px);
    }
    return BST_OK;
}

/* Stamps up to 8 standard deviations on each side: beyond, less than 1e-15 of the light is left. */
static int taps_for(double sigma_px) {
    int taps = 16 * (int)ceil((2.0 * 8.0 * sigma_px + 2.0) / 16.0);
    return taps > MAX_TAPS ? MAX_TAPS : taps;
}

static bst_status build(bst_ctx *ctx, bst_renderer *r, bst_device *device) {
    const bst_kernel_source *sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_nodes,    &bst_kernel_splat,
        &bst_kernel_random,       &bst_kernel_detector, &bst_kernel_light,
        &bst_kernel_vignetting,   &bst_kernel_tile,     &bst_kernel_readout};
    char options[2048];
    int length =
        snprintf(options, sizeof options,
                 "-cl-std=CL1.2 -DTILE_W=%d -DTILE_H=%d -DGROUP=%d -DTAPS=%d "
                 "-DPHASES=%d -DPLACE_BITS=%d%s",
                 r->options.tile_width, r->options.tile_height, r->options.group, r->taps,
                 r->phases, bst_place_bits(&r->camera), r->fft_light ? " -DFFT_LIGHT" : "");
    length += bst_vignetting_options(&r->camera, options + length, sizeof options - (size_t)length);
    length += bst_detector_options(r->detector, options + length, sizeof options - (size_t)length);
    if (r->options.spatial_oversample > 0) {
        length += snprintf(options + length, sizeof options - (size_t)length,
                           " -DSPATIAL_OVERSAMPLE=%d", r->options.spatial_oversample);
    }
    const bst_distortion *d = &r->camera.distortion;
    if (bst_camera_distorted(&r->camera)) {
        double a = bst_camera_scale_rad(&r->camera), a2 = a * a,
               out = r->camera.geometry.domain / a;
        snprintf(
            options + length, sizeof options - (size_t)length,
            " -DDISTORTED -DK1=%.9ef -DK2=%.9ef -DK3=%.9ef -DP1=%.9ef -DP2=%.9ef -DFOLD2=%.9ef",
            d->k1 * a2, d->k2 * a2 * a2, d->k3 * a2 * a2 * a2, d->p1 * a, d->p2 * a, out * out);
    }
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

/* Makes room for `bytes`; the content is lost when the buffer grows. */
static bst_status grow(bst_ctx *ctx, bst_renderer *r, growing *g, size_t bytes) {
    if (g->bytes >= bytes && g->buffer) {
        return BST_OK;
    }
    if (g->buffer) {
        clReleaseMemObject(g->buffer);
        g->buffer = NULL;
    }
    size_t room = bytes > 2 * g->bytes ? bytes : 2 * g->bytes;
    room = room > r->most_bytes ? bytes : room;
    room = room < 4096 ? 4096 : room;
    cl_int code;
    g->buffer =
        clCreateBuffer(r->context, CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR, room, NULL, &code);
    g->bytes = room;
    return bst_device_check(ctx, code, "allocating scene memory");
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
    BST_TRY(check_camera(ctx, camera));
    bst_renderer *r = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the renderer");
    }
    r->camera = *camera;
    r->options = options ? *options : bst_renderer_default_options();
    r->taps = taps_for(bst_camera_psf_sigma_px(camera));
    double sigma_px = bst_camera_psf_sigma_px(camera);
    r->phases = r->options.psf_phases > 0
                    ? r->options.psf_phases
                    : bst_profile_phases(sigma_px, r->options.tolerance_sigma, camera->full_well_e);
    r->context = bst_device_context(device);
    r->queue = bst_device_queue(device);
    clRetainContext(r->context);
    clRetainCommandQueue(r->queue);
    bst_smear_options smear = {.tolerance_sigma = r->options.tolerance_sigma,
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
    if (status == BST_OK) {
        status = bst_crowd_create(ctx, &r->crowd);
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
                        r->saturated.buffer, r->expected.buffer};
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
    bst_crowd_free(r->crowd);
    bst_fft_light_free(r->fft_light);
    bst_psf_free(r->psf);
    bst_readout_free(r->readout);
    bst_detector_free(r->detector);
    clReleaseCommandQueue(r->queue);
    clReleaseContext(r->context);
    free(r->list);
    free(r->peak_e);
    free(r);
}

static bst_status check_request(bst_ctx *ctx, const bst_renderer *r, const bst_render_request *q) {
    bst_window w = q->window;
    if (w.x0 < 0 || w.y0 < 0 || w.width < 1 || w.height < 1 ||
        w.x0 + (int64_t)w.width > r->camera.width_px ||
        w.y0 + (int64_t)w.height > r->camera.height_px) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the window of %d x %d pixels at (%d, %d) is not inside the sensor of "
                        "%lld x %lld",
                        w.width, w.height, w.x0, w.y0, (long long)r->camera.width_px,
                        (long long)r->camera.height_px);
    }
    int binning = q->binning > 1 ? q->binning : 1;
    if (binning > w.width || binning > w.height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "binning %d does not fit a window of %d x %d pixels",
                        binning, w.width, w.height);
    }
    if (!(q->background_e >= 0.0) || !isfinite(q->background_e) || q->track->count < 2) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request needs a background that is finite and not negative (it is %g) "
                        "and two samples of the line of sight (there are %d)",
                        q->background_e, q->track->count);
    }
    return BST_OK;
}

/* Chooses nodes and stamps of all sources: fills list and stats. */
static bst_status plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q, int *blocks) {
    if (q->count > r->list_capacity) {
        int capacity = q->count > 2 * r->list_capacity ? q->count : 2 * r->list_capacity;
        free(r->list);
        free(r->peak_e);
        r->list = malloc((size_t)capacity * sizeof *r->list);
        r->peak_e = malloc((size_t)capacity * sizeof *r->peak_e);
        r->list_capacity = r->list && r->peak_e ? capacity : 0;
        if (r->list_capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", q->count);
        }
    }
    double read = r->camera.read_noise_e, brightest = 0.0;
    for (int i = 0; i < q->count; i++) {
        brightest = q->sources[i].path ? brightest : fmax(brightest, q->sources[i].electrons_per_s);
    }
    double dark_e2 = fmax(q->background_e + read * read, 1e-2);
    BST_TRY(bst_smear_begin(ctx, r->smear, q->track, dark_e2, brightest));
    bst_crowd_motion motion = bst_smear_motion(r->smear);
    bst_crowd_begin(r->crowd, &motion);
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
            bst_crowd_source error = *bst_smear_last_error(r->smear);
            if (r->fft_light) { /* of its grid, on dark pixels too */
                double grid_e = bst_fft_light_error(r->fft_light) * r->peak_e[i];
                error.excess_e += (float)(grid_e * sqrt(1.0 + r->peak_e[i] / dark_e2));
            }
            BST_TRY(bst_crowd_add(ctx, r->crowd, &error));
        }
    }
    r->stats.nodes = (long long)*blocks * BST_BLOCK;
    r->stats.single_kernel = bst_smear_single(r->smear);
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
    const void *values[] = {&r->sources.buffer,   &count,
                            &r->table.buffer,     &r->nodes.buffer,
                            &r->block_box.buffer, &r->source_box.buffer};
    const size_t m = sizeof(cl_mem), bytes[] = {m, sizeof count, m, m, m, m};
    BST_TRY(set_args(ctx, r->nodes_kernel, values, bytes, 6));
    size_t global = (size_t)*groups * BST_BLOCK, local = BST_BLOCK;
    return bst_device_check(
        ctx,
        clEnqueueNDRangeKernel(r->queue, r->nodes_kernel, 1, NULL, &global, &local, 0, NULL, NULL),
        "placing the scene's nodes");
}

static bst_scene_params make_params(const bst_renderer *r, const bst_render_request *q,
                                    int groups) {
    const bst_camera *c = &r->camera;
    bst_window w = q->window;
    int x0 = w.x0 / 64 * 64;
    return (bst_scene_params){
        .window_x0 = w.x0,
        .window_y0 = w.y0,
        .window_width = w.width,
        .window_height = w.height,
        .sensor_width = (int)c->width_px,
        .tiles_x0 = x0,
        .tiles_x = (w.x0 + w.width - x0 + r->options.tile_width - 1) / r->options.tile_width,
        .tiles_y = (w.height + r->options.tile_height - 1) / r->options.tile_height,
        .source_groups = groups,
        .key0 = q->key.k[0],
        .key1 = q->key.k[1],
        .exposure_low = (unsigned)((uint64_t)q->exposure_id & 0xFFFFFFFFu),
        .exposure_high = (unsigned)((uint64_t)q->exposure_id >> 32),
        .background_e = (float)q->background_e,
        .dark_e = (float)q->dark_e,
        .exposure_s = (float)q->track->time_s[q->track->count - 1],
        .read_noise_e = (float)c->read_noise_e,
        .full_well_e = (float)c->full_well_e,
        .per_full_well = (float)(1.0 / c->full_well_e),
        .near_full_e = (float)bst_detector_near_full_e(c->full_well_e),
        .dn_per_e = (float)(1.0 / c->gain_e_per_dn),
        .offset_dn = (float)c->offset_dn,
        .max_dn = (float)((1 << c->bits) - 1),
        .image_stride = w.width,
    };
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

/* The common way of all kinds of image: the kernels' first six arguments are the same. stride:
 * floats between the rows of `out`, 0: no gaps; light_only: without background. */
static bst_status enqueue_tiles(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                cl_kernel kernel, cl_mem out, int stride, bool light_only) {
    int blocks = 0, groups = 0;
    BST_TRY(plan(ctx, r, q, &blocks));
    BST_TRY(count_saturated(ctx, r)); /* of the frame before, which was rendered meanwhile */
    BST_TRY(enqueue_nodes(ctx, r, blocks, &groups));
    bst_scene_params p = make_params(r, q, groups);
    p.image_stride = stride > 0 ? stride : p.image_stride;
    p.background_e = light_only ? 0.0f : p.background_e;
    r->tiles = p.tiles_x * p.tiles_y;
    size_t tiles = (size_t)r->tiles;
    BST_TRY(grow(ctx, r, &r->saturated, tiles * sizeof(cl_int)));
    cl_mem light = r->profiles;
    if (r->fft_light) {
        BST_TRY(make_light(ctx, r, q, groups, &p, &light));
    }
    cl_mem maps[5];
    bst_detector_buffers(r->detector, maps);
    const void *values[] = {&p,
                            &r->sources.buffer,
                            &r->nodes.buffer,
                            &r->block_box.buffer,
                            &r->source_box.buffer,
                            &light,
                            &out,
                            &r->saturated.buffer,
                            &maps[0],
                            &maps[1],
                            &maps[2],
                            &maps[3],
                            &maps[4]};
    const size_t m = sizeof(cl_mem), bytes[] = {sizeof p, m, m, m, m, m, m, m, m, m, m, m, m};
    BST_TRY(set_args(ctx, kernel, values, bytes, kernel == r->frame_kernel ? 13 : 7));
    size_t group = (size_t)r->options.group, global = (tiles + group - 1) / group * group;
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(r->queue, kernel, 1, NULL, &global, &group, 0, NULL, NULL),
        "rendering a frame");
}

bst_status bst_renderer_plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request) {
    int blocks;
    BST_TRY(check_request(ctx, r, request));
    return plan(ctx, r, request, &blocks);
}

/* Light first, then what columns and binned pixels make of it. */
static bst_status render_in_stages(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                   int binning, cl_mem frame) {
    bst_render_request light = *q;
    cl_mem image;
    int stride;
    light.window = bst_readout_light_window(r->readout, q->window);
    BST_TRY(bst_readout_image(ctx, r->readout, light.window, &image, &stride));
    BST_TRY(enqueue_tiles(ctx, r, &light, r->expected_kernel, image, stride, true));
    r->tiles = q->window.height / binning;
    BST_TRY(grow(ctx, r, &r->saturated, (size_t)r->tiles * sizeof(cl_int)));
    bst_scene_params p = make_params(r, q, 0);
    return bst_readout_run(ctx, r->readout, r->detector, &p, q->window, binning, frame,
                           r->saturated.buffer);
}

bst_status bst_renderer_render(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request,
                               bst_frame **out) {
    *out = NULL;
    BST_TRY(check_request(ctx, r, request));
    bst_frame *frame;
    cl_mem buffer;
    int binning = request->binning > 1 ? request->binning : 1;
    BST_TRY(bst_frame_pool_take(ctx, r->pool, request->window.width / binning,
                                request->window.height / binning, &frame, &buffer));
    double exposure_s = request->track->time_s[request->track->count - 1];
    bst_status status =
        bst_detector_begin(ctx, r->detector, request->key, request->exposure_id, exposure_s);
    if (status == BST_OK) {
        status = binning > 1 || bst_detector_whole_columns(r->detector)
                     ? render_in_stages(ctx, r, request, binning, buffer)
                     : enqueue_tiles(ctx, r, request, r->frame_kernel, buffer, 0, false);
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
    BST_TRY(check_request(ctx, r, request));
    size_t bytes = (size_t)request->window.width * (size_t)request->window.height * sizeof(float);
    BST_TRY(grow(ctx, r, &r->expected, bytes));
    BST_TRY(enqueue_tiles(ctx, r, request, r->expected_kernel, r->expected.buffer, 0, false));
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

long long bst_renderer_saturated_frames(const bst_renderer *r) {
    return r->saturated_frames;
}

void bst_renderer_get_stats(const bst_renderer *r, bst_render_stats *out) {
    bool foreseen = r->options.temporal_oversample <= 0 && r->options.spatial_oversample <= 0;
    *out = r->stats;
    out->predicted_sigma = foreseen ? bst_crowd_error_sigma(r->crowd) : NAN;
}

double bst_renderer_peak_e(const bst_renderer *r, int index) {
    return r->peak_e[index];
}

int bst_renderer_margin_px(const bst_renderer *r) {
    return r->fft_light ? bst_fft_light_margin_px(r->fft_light) : r->taps / 2 + 1;
}
