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
#include "scenegen/reference.h"
#include "scenegen/smear.h"
#include "scenegen/vignetting.h"
#include "sim/world/skylight.h"

enum { MAX_TAPS = 512, BOX_FLOATS = 4 };
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
    bst_frame_pool *pool;
    cl_mem profiles;
    growing table, sources, nodes, block_box, source_box, saturated, expected, background;
    bst_scene_source *list; /* drawn sources */
    double *peak_e;         /* of all sources of the request */
    int list_capacity, tiles;
    bool map;            /* the background differs from pixel to pixel */
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
    if (!(c->psf_fwhm_px > 0.0) || c->psf_fwhm_px > 70.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render a PSF of psf_fwhm_px %g: allowed are 0 to 70 pixels",
                        c->psf_fwhm_px);
    }
    return BST_OK;
}

/* Stamps up to 8 standard deviations on each side: beyond, less than 1e-15 of the light is left. */
static int taps_for(double sigma_px) {
    int taps = 16 * (int)ceil((2.0 * 8.0 * sigma_px + 2.0) / 16.0);
    return taps > MAX_TAPS ? MAX_TAPS : taps;
}

static bst_status choose_tiles(bst_ctx *ctx, const bst_device *device,
                               bst_renderer_options *options, uint64_t *most_bytes) {
    cl_device_type type = 0;
    cl_ulong local_bytes = 0, most = 0;
    BST_TRY(bst_device_check(
        ctx, clGetDeviceInfo(bst_device_id(device), CL_DEVICE_TYPE, sizeof type, &type, NULL),
        "asking for the device's type"));
    BST_TRY(bst_device_check(ctx,
                             clGetDeviceInfo(bst_device_id(device), CL_DEVICE_LOCAL_MEM_SIZE,
                                             sizeof local_bytes, &local_bytes, NULL),
                             "asking for the device's local memory"));
    BST_TRY(bst_device_check(ctx,
                             clGetDeviceInfo(bst_device_id(device), CL_DEVICE_MAX_MEM_ALLOC_SIZE,
                                             sizeof most, &most, NULL),
                             "asking for the device's largest buffer"));
    *most_bytes = most;
    if (options->tile_width == 0) {
        bool large = (type & CL_DEVICE_TYPE_CPU) && local_bytes >= 128 * 1024;
        options->tile_width = large ? 256 : 64;
        options->tile_height = large ? 64 : 2;
        options->group = large ? 1 : 16;
    }
    size_t need = (size_t)(options->tile_width + 16) * (size_t)options->tile_height *
                  sizeof(float) * (size_t)options->group;
    if (options->tile_width < 64 || options->tile_width % 64 != 0 || options->tile_height < 1 ||
        options->group < 1 || need > local_bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "tiles of %d x %d pixels in groups of %d need %zu bytes of local memory "
                        "(the device has %llu) and a width that is a multiple of 64",
                        options->tile_width, options->tile_height, options->group, need,
                        (unsigned long long)local_bytes);
    }
    return BST_OK;
}

static bst_status build(bst_ctx *ctx, bst_renderer *r, bst_device *device) {
    const bst_kernel_source *sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_nodes,      &bst_kernel_splat,
        &bst_kernel_random,       &bst_kernel_detector,   &bst_kernel_light,
        &bst_kernel_vignetting,   &bst_kernel_background, &bst_kernel_tile};
    char options[1024];
    int length =
        snprintf(options, sizeof options,
                 "-cl-std=CL1.2 -DTILE_W=%d -DTILE_H=%d -DGROUP=%d -DTAPS=%d "
                 "-DPHASES=%d%s%s",
                 r->options.tile_width, r->options.tile_height, r->options.group, r->taps,
                 r->phases, r->fft_light ? " -DFFT_LIGHT" : "", r->map ? " -DBACKGROUND" : "");
    length += bst_detector_options(&r->camera, options + length, sizeof options - (size_t)length);
    length += bst_vignetting_options(&r->camera, options + length, sizeof options - (size_t)length);
    const bst_distortion *d = &r->camera.distortion;
    if (bst_camera_distorted(&r->camera)) {
        double a = bst_camera_scale_rad(&r->camera), a2 = a * a,
               out = r->camera.geometry.domain / a;
        snprintf(
            options + length, sizeof options - (size_t)length,
            " -DDISTORTED -DK1=%.9ef -DK2=%.9ef -DK3=%.9ef -DP1=%.9ef -DP2=%.9ef -DFOLD2=%.9ef",
            d->k1 * a2, d->k2 * a2 * a2, d->k3 * a2 * a2 * a2, d->p1 * a, d->p2 * a, out * out);
    }
    BST_TRY(bst_device_build(ctx, device, sources, 9, options, &r->program));
    static const char *const names[3] = {"bst_scene_nodes", "bst_scene_frame",
                                         "bst_scene_expected"};
    cl_kernel *kernels[3] = {&r->nodes_kernel, &r->frame_kernel, &r->expected_kernel};
    for (int i = 0; i < 3; i++) {
        cl_int code;
        *kernels[i] = clCreateKernel(r->program, names[i], &code);
        BST_TRY(bst_device_check(ctx, code, names[i]));
    }
    return BST_OK;
}

/* Phases between which the profile may be interpolated linearly: that misses
 * 1 / (8 phases^2 sigma^2) of the peak, below 1.3e-5. */
static int phases_for(double sigma_px) {
    int phases = 8;
    while (phases < 2048 && phases * sigma_px < 100.0) {
        phases *= 2;
    }
    return phases;
}

/* [BST_WIDTHS + 1][phases + 1][taps]: shares of a profile centred phase / phases right of a pixel.
 */
static bst_status make_profiles(bst_ctx *ctx, bst_renderer *r) {
    size_t rows = (size_t)(BST_WIDTHS + 1) * (size_t)(r->phases + 1),
           row_floats = (size_t)r->taps + 2 * BST_PROFILE_PAD;
    size_t bytes = rows * row_floats * sizeof(float);
    float *table = calloc(rows, row_floats * sizeof(float));
    if (!table) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the PSF table");
    }
    double psf = bst_camera_psf_sigma_px(&r->camera);
    for (size_t row = 0; row < rows; row++) {
        size_t width = row / (size_t)(r->phases + 1), phase = row % (size_t)(r->phases + 1);
        double share = (double)width / BST_WIDTHS;
        double sigma = psf * sqrt(1.0 + BST_WIDEST * share * share);
        for (int j = 0; j < r->taps; j++) {
            table[row * row_floats + BST_PROFILE_PAD + (size_t)j] =
                (float)bst_reference_pixel_share((double)phase / r->phases, sigma,
                                                 j - (r->taps / 2 - 1));
        }
    }
    cl_int code;
    r->profiles =
        clCreateBuffer(r->context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, bytes, table, &code);
    free(table);
    return bst_device_check(ctx, code, "allocating the PSF table");
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
    BST_TRY(bst_fft_light_create(ctx, device, &r->camera, r->psf, NULL, &r->fft_light));
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
    r->map = bst_skylight_varies(camera);
    r->phases = phases_for(bst_camera_psf_sigma_px(camera));
    r->context = bst_device_context(device);
    r->queue = bst_device_queue(device);
    clRetainContext(r->context);
    clRetainCommandQueue(r->queue);
    bst_smear_options smear = {.tolerance_sigma = r->options.tolerance_sigma, .taps = r->taps};
    bst_status status = choose_tiles(ctx, device, &r->options, &r->most_bytes);
    if (status == BST_OK) {
        status = open_psf(ctx, device, r, &smear);
    }
    if (status == BST_OK) {
        status = build(ctx, r, device);
    }
    if (status == BST_OK) {
        status = make_profiles(ctx, r);
    }
    if (status == BST_OK) {
        status = bst_smear_create(ctx, camera, &smear, &r->smear);
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
    if (!(q->background_e >= 0.0) || !isfinite(q->background_e) || q->track->count < 2) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request needs a background that is finite and not negative (it is %g) "
                        "and two samples of the line of sight (there are %d)",
                        q->background_e, q->track->count);
    }
    if (q->background && !r->map) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request has a map of the background, but the camera's background is the "
                        "same all over the sensor (bst_skylight_varies)");
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
    double read = r->camera.read_noise_e;
    double least_e = q->background_e + (q->background ? q->background->least_e : 0.0);
    BST_TRY(bst_smear_begin(ctx, r->smear, q->track, least_e + read * read));
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
            r->stats.predicted_sigma =
                fmax(r->stats.predicted_sigma, bst_smear_last_error_sigma(r->smear));
        }
    }
    r->stats.nodes = (long long)*blocks * BST_BLOCK;
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

/* What a request without a map adds where the kernels expect one. */
static const float nothing[4];
static const bst_skylight_map no_background = {1 << 16, 0, 0, 2, 2, nothing, 0.0};

static const bst_skylight_map *background_of(const bst_render_request *q) {
    return q->background ? q->background : &no_background;
}

static bst_scene_params make_params(const bst_renderer *r, const bst_render_request *q,
                                    int groups) {
    const bst_camera *c = &r->camera;
    const bst_skylight_map *map = background_of(q);
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
        .read_noise_e = (float)c->read_noise_e,
        .full_well_e = (float)c->full_well_e,
        .near_full_e = (float)bst_detector_near_full_e(c->full_well_e),
        .dn_per_e = (float)(1.0 / c->gain_e_per_dn),
        .offset_dn = (float)c->offset_dn,
        .max_dn = (float)((1 << c->bits) - 1),
        .map_step = map->step_px,
        .map_x0 = map->x0_px,
        .map_y0 = map->y0_px,
        .map_columns = map->columns,
        .map_rows = map->rows,
    };
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

/* The common way of both kinds of image: the kernels' first six arguments are the same. */
static bst_status enqueue_tiles(bst_ctx *ctx, bst_renderer *r, const bst_render_request *q,
                                cl_kernel kernel, cl_mem out) {
    int blocks = 0, groups = 0;
    BST_TRY(plan(ctx, r, q, &blocks));
    BST_TRY(enqueue_nodes(ctx, r, blocks, &groups));
    bst_scene_params p = make_params(r, q, groups);
    r->tiles = p.tiles_x * p.tiles_y;
    size_t tiles = (size_t)r->tiles;
    BST_TRY(grow(ctx, r, &r->saturated, tiles * sizeof(cl_int)));
    cl_mem light = r->profiles;
    if (r->fft_light) {
        BST_TRY(make_light(ctx, r, q, groups, &p, &light));
    }
    const void *values[] = {&p,
                            &r->sources.buffer,
                            &r->nodes.buffer,
                            &r->block_box.buffer,
                            &r->source_box.buffer,
                            &light,
                            &out,
                            &r->saturated.buffer};
    const size_t m = sizeof(cl_mem), bytes[] = {sizeof p, m, m, m, m, m, m, m};
    cl_uint count = kernel == r->frame_kernel ? 8 : 7;
    BST_TRY(set_args(ctx, kernel, values, bytes, (int)count));
    if (r->map) {
        const bst_skylight_map *map = background_of(q);
        size_t size = (size_t)map->columns * (size_t)map->rows * sizeof *map->e;
        BST_TRY(upload(ctx, r, &r->background, map->e, size));
        BST_TRY(bst_device_check(ctx, clSetKernelArg(kernel, count, m, &r->background.buffer),
                                 "setting a kernel argument"));
    }
    size_t group = (size_t)r->options.group, global = (tiles + group - 1) / group * group;
    BST_TRY(bst_device_check(
        ctx, clEnqueueNDRangeKernel(r->queue, kernel, 1, NULL, &global, &group, 0, NULL, NULL),
        "rendering a frame"));
    return bst_device_check(ctx, clFlush(r->queue), "starting the rendering");
}

bst_status bst_renderer_plan(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request) {
    int blocks;
    BST_TRY(check_request(ctx, r, request));
    return plan(ctx, r, request, &blocks);
}

bst_status bst_renderer_render(bst_ctx *ctx, bst_renderer *r, const bst_render_request *request,
                               bst_frame **out) {
    *out = NULL;
    BST_TRY(check_request(ctx, r, request));
    bst_frame *frame;
    cl_mem buffer;
    BST_TRY(bst_frame_pool_take(ctx, r->pool, request->window.width, request->window.height, &frame,
                                &buffer));
    bst_status status = enqueue_tiles(ctx, r, request, r->frame_kernel, buffer);
    if (status != BST_OK) {
        bst_frame_release(frame);
        return status;
    }
    *out = frame;
    return BST_OK;
}

bst_status bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *r,
                                          const bst_render_request *request, float *image) {
    BST_TRY(check_request(ctx, r, request));
    size_t bytes = (size_t)request->window.width * (size_t)request->window.height * sizeof(float);
    BST_TRY(grow(ctx, r, &r->expected, bytes));
    BST_TRY(enqueue_tiles(ctx, r, request, r->expected_kernel, r->expected.buffer));
    return bst_device_check(
        ctx,
        clEnqueueReadBuffer(r->queue, r->expected.buffer, CL_TRUE, 0, bytes, image, 0, NULL, NULL),
        "reading a noise-free image");
}

bst_status bst_renderer_saturated(bst_ctx *ctx, bst_renderer *r, long long *pixels) {
    *pixels = 0;
    if (r->tiles == 0) {
        return BST_OK;
    }
    cl_int code;
    size_t bytes = (size_t)r->tiles * sizeof(cl_int);
    cl_int *p = clEnqueueMapBuffer(r->queue, r->saturated.buffer, CL_TRUE, CL_MAP_READ, 0, bytes, 0,
                                   NULL, NULL, &code);
    BST_TRY(bst_device_check(ctx, code, "mapping the count of saturated pixels"));
    for (int i = 0; i < r->tiles; i++) {
        *pixels += p[i];
    }
    return bst_device_check(
        ctx, clEnqueueUnmapMemObject(r->queue, r->saturated.buffer, p, 0, NULL, NULL),
        "unmapping the count of saturated pixels");
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
