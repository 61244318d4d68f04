#include "scenegen/fourier/fourier_render.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bst_scenegen_kernels.h"
#include "scenegen/fourier/fourier_error.h"
#include "scenegen/fourier/otf_convolve.h"
#include "scenegen/kernels/deposit_shared.h"
#include "scenegen/scene_kernels.h"
#include "scenegen/scene_options.h"

enum { SETUPS = 4, FIELD_STEP_PX = 16, WRAP_PX = 96, DENSITY_PX = 100000 };

/* Allowed error of a widened node's image, relative to its peak. */
static const double WIDEN_ERROR = 1e-3;

/* Grid qualities: for the tolerance, and finer for frames with brighter points. */
enum { PLAIN, FINE, QUALITIES };

/* Error ratio of the fine to the plain grid. */
static const double FINER = 1.0 / 64.0;

/* Shares of a quality's tolerance: for frequencies beyond the cut-off, and for aliases along each
 * axis. */
static const double CUTOFF_SHARE = 0.1, ALIAS_SHARE = 0.45;

/* Grid, tables and buffers for windows of one size. */
typedef struct setup {
    int width, height, quality;
    long long used; /* number of the call that last used it */
    bst_otf_convolve *fft;
    cl_mem table; /* [2][BST_SPREAD_TABLE] */
    cl_mem grid;
} setup;

struct bst_fourier_render {
    bst_camera camera;
    const bst_psf *psf;
    bst_fourier_render_options options;
    bst_fourier_band band[QUALITIES]; /* nodes are those of the plain one */
    double density[QUALITIES][2];
    /* for any window, and for the whole sensor, whose grid is denser; by binning - 1, of those used
     * so far */
    bst_fourier_error error[BST_PIXEL_PARTS][QUALITIES][2];
    bool measured[BST_PIXEL_PARTS];
    int binning;   /* of the frame, at most BST_PIXEL_PARTS */
    double widest; /* largest node widening that the spreading kernel supports, in node variances */
    int margin;
    bst_parallel *pool;
    cl_context context;
    cl_kernel kernel;
    bst_kernel_node_params node_params;
    int tile_width, tile_height, group;
    setup setups[SETUPS];
    long long calls;
    int nodes, field_nodes, field_x, field_y; /* of the PSF; of its field; grid of field weights */
    cl_mem *fields;                           /* [field_nodes] */
};

bst_fourier_render_options bst_fourier_render_default_options(void) {
    return (bst_fourier_render_options){.taps = 8, .tolerance = 3e-5};
}

/* Chooses deposit tiles and FFT threads: all of the device's cores if it is the host processor. */
static bst_status choose_tiles(bst_ctx *ctx, bst_device *device, bst_fourier_render *l,
                               int *threads) {
    cl_device_type type = 0;
    cl_ulong local_bytes = 0;
    cl_uint units = 0;
    cl_device_id id = bst_device_id(device);
    BST_TRY(bst_device_check(ctx, clGetDeviceInfo(id, CL_DEVICE_TYPE, sizeof type, &type, NULL),
                             "asking for the device's type"));
    BST_TRY(bst_device_check(
        ctx, clGetDeviceInfo(id, CL_DEVICE_LOCAL_MEM_SIZE, sizeof local_bytes, &local_bytes, NULL),
        "asking for the device's local memory"));
    BST_TRY(bst_device_check(
        ctx, clGetDeviceInfo(id, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL),
        "asking for the device's compute units"));
    bool cpu = (type & CL_DEVICE_TYPE_CPU) != 0, large = cpu && local_bytes >= 128 * 1024;
    /* sized for the second-level cache: fewer node blocks lie on two tiles */
    l->tile_width = large ? local_bytes >= 512 * 1024 ? 256 : 64 : 16;
    l->tile_height = large ? 256 : 32;
    l->group = large ? 1 : 4;
    *threads = cpu ? (int)units : 0;
    return BST_OK;
}

static bst_status build(bst_ctx *ctx, bst_device *device, bst_fourier_render *l) {
    static const bst_device_kernel_source *const sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes,          &bst_kernel_nodes,
        &bst_kernel_block_search, &bst_kernel_deposit_shared, &bst_kernel_deposit};
    char options[128];
    snprintf(options, sizeof options,
             "-cl-std=CL1.2 -DFOURIER -DDEPOSIT_W=%d -DDEPOSIT_H=%d -DDEPOSIT_GROUP=%d%s",
             l->tile_width, l->tile_height, l->group, l->group == 1 ? " -DNEAR_CACHE" : "");
    return bst_scene_kernel(ctx, device, sources, sizeof sources / sizeof *sources, options,
                            "bst_light_deposit", &l->kernel);
}

/* Uploads the field nodes' weights on a grid that the kernel interpolates. */
static bst_status make_fields(bst_ctx *ctx, bst_fourier_render *l) {
    l->field_x = (int)l->camera.width_px / FIELD_STEP_PX + 2;
    l->field_y = (int)l->camera.height_px / FIELD_STEP_PX + 2;
    size_t places = (size_t)l->field_x * (size_t)l->field_y;
    float *weights = calloc(places * (size_t)l->field_nodes, sizeof *weights);
    l->fields = calloc((size_t)l->field_nodes, sizeof *l->fields);
    if (!weights || !l->fields) {
        free(weights);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the weights of the PSF's field");
    }
    for (int j = 0; j < l->field_y; j++) {
        for (int i = 0; i < l->field_x; i++) {
            int node[4];
            double weight[4];
            int count = bst_psf_weights(
                l->psf, (double)i * (double)(l->camera.width_px - 1) / (l->field_x - 1),
                (double)j * (double)(l->camera.height_px - 1) / (l->field_y - 1), node, weight);
            for (int k = 0; k < count; k++) {
                weights[(size_t)node[k] * places + (size_t)(j * l->field_x + i)] +=
                    (float)weight[k];
            }
        }
    }
    bst_status status = BST_OK;
    for (int n = 0; n < l->field_nodes && status == BST_OK; n++) {
        cl_int code;
        l->fields[n] =
            clCreateBuffer(l->context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR,
                           places * sizeof *weights, weights + (size_t)n * places, &code);
        status = bst_device_check(ctx, code, "allocating the weights of the PSF's field");
    }
    free(weights);
    return status;
}

/* Pixels between the image and its repetition: at least the margin. */
static int pad_px(const bst_fourier_render *l) {
    return l->margin + (l->margin < WRAP_PX ? l->margin : WRAP_PX);
}

/* Chooses the grid axes for a window of this size. */
static void choose_axes(const bst_fourier_render *l, int quality, int width, int height,
                        bst_fourier_axis axis[2]) {
    /* smallest wrap-around distance of wings; nearer ones are not smooth */
    int taps = l->options.taps, pad = pad_px(l);
    axis[0] =
        bst_fourier_axis_choose(&l->band[quality], 0, taps, width + pad, l->density[quality][0]);
    axis[1] =
        bst_fourier_axis_choose(&l->band[quality], 1, taps, height + pad, l->density[quality][1]);
}

/* Grid axes as sparse as any window's. */
static void sparsest_axes(const bst_fourier_render *l, int quality, bst_fourier_axis axis[2]) {
    for (int a = 0; a < 2; a++) {
        bst_nufft_kernel spread = {.taps = l->options.taps};
        double density = l->density[quality][a];
        (void)bst_nufft_kernel_choose(&spread, &l->band[quality].axis[a], density);
        axis[a] = (bst_fourier_axis){DENSITY_PX, (int)floor(DENSITY_PX * density), spread, 0.0};
    }
}

/* Sets densities of a grid quality, and the supported widening. */
static bst_status prepare_quality(bst_ctx *ctx, bst_fourier_render *l, int quality) {
    double tolerance = l->options.tolerance * (quality == FINE ? FINER : 1.0);
    bst_fourier_band *band = &l->band[quality];
    BST_TRY(bst_fourier_band_measure(ctx, l->psf, CUTOFF_SHARE * tolerance, band));
    l->margin = (l->band[PLAIN].reach_px + 15) / 16 * 16;
    bst_fourier_axis axis[2];
    for (int a = 0; a < 2; a++) {
        l->density[quality][a] =
            bst_fourier_density(band, a, l->options.taps, ALIAS_SHARE * tolerance);
    }
    sparsest_axes(l, quality, axis);
    for (int a = 0; a < 2; a++) {
        bst_nufft_kernel_shape shape;
        double density = l->density[quality][a], sigma = l->band[PLAIN].node_sigma_px * density;
        while (bst_nufft_kernel_widen(&axis[a].spread, &band->axis[a], density,
                                      l->widest * sigma * sigma, &shape) > WIDEN_ERROR) {
            l->widest *= 0.8; /* step of the search: at most a fifth too narrow */
        }
    }
    return BST_OK;
}

bst_status bst_fourier_render_begin(bst_ctx *ctx, bst_fourier_render *l, int binning) {
    int n = (binning < BST_PIXEL_PARTS ? binning : BST_PIXEL_PARTS) - 1;
    double sigma_px = l->band[PLAIN].node_sigma_px, widest_px2 = l->widest * sigma_px * sigma_px;
    assert(binning > 0);
    l->binning = n + 1;
    for (int q = 0; q < QUALITIES && !l->measured[n]; q++) {
        for (int whole = 0; whole < 2; whole++) {
            bst_fourier_axis axis[2];
            sparsest_axes(l, q, axis);
            if (whole) {
                choose_axes(l, q, (int)l->camera.width_px, (int)l->camera.height_px, axis);
            }
            BST_TRY(bst_fourier_error_measure(ctx, l->psf, &l->band[q], axis, n + 1, widest_px2,
                                              &l->error[n][q][whole]));
        }
    }
    l->measured[n] = true;
    return BST_OK;
}

static bst_status prepare(bst_ctx *ctx, bst_device *device, bst_fourier_render *l) {
    int threads;
    BST_TRY(choose_tiles(ctx, device, l, &threads));
    BST_TRY(bst_parallel_create(ctx, threads, &l->pool));
    BST_TRY(build(ctx, device, l));
    l->node_params = bst_scene_node_params(&l->camera, l->options.spatial_oversample);
    l->widest = BST_WIDEST;
    for (int q = 0; q < QUALITIES; q++) {
        BST_TRY(prepare_quality(ctx, l, q));
    }
    BST_TRY(bst_fourier_render_begin(ctx, l, 1));
    return make_fields(ctx, l);
}

bst_status bst_fourier_render_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                                     const bst_psf *psf, const bst_fourier_render_options *options,
                                     bst_fourier_render **out) {
    assert(device && camera && psf && out);
    *out = NULL;
    bst_fourier_render_options o = options ? *options : bst_fourier_render_default_options();
    if ((o.taps != 4 && o.taps != 6 && o.taps != 8) || !(o.tolerance > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a spreading kernel of %d taps for a tolerance of %g: allowed are 4, 6 and "
                        "8 taps and tolerances above 0",
                        o.taps, o.tolerance);
    }
    bst_fourier_render *l = calloc(1, sizeof *l);
    if (!l) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for light through a general PSF");
    }
    l->camera = *camera;
    l->psf = psf;
    l->options = o;
    l->nodes = bst_psf_nodes(psf);
    l->field_nodes = l->nodes / bst_psf_spectra(psf);
    l->context = bst_device_context(device);
    clRetainContext(l->context);
    bst_status status = prepare(ctx, device, l);
    if (status != BST_OK) {
        bst_fourier_render_free(l);
        return status;
    }
    *out = l;
    return BST_OK;
}

static void release(cl_mem *buffer) {
    if (*buffer) {
        clReleaseMemObject(*buffer);
        *buffer = NULL;
    }
}

static void free_setup(setup *s) {
    bst_otf_convolve_free(s->fft);
    release(&s->table);
    release(&s->grid);
    *s = (setup){0};
}

void bst_fourier_render_free(bst_fourier_render *l) {
    if (!l) {
        return;
    }
    for (int i = 0; i < SETUPS; i++) {
        free_setup(&l->setups[i]);
    }
    for (int n = 0; l->fields && n < l->field_nodes; n++) {
        release(&l->fields[n]);
    }
    if (l->kernel) {
        clReleaseKernel(l->kernel);
    }
    bst_parallel_free(l->pool);
    clReleaseContext(l->context);
    free(l->fields);
    free(l);
}

const bst_fourier_band *bst_fourier_render_band(const bst_fourier_render *l) {
    return &l->band[PLAIN];
}

int bst_fourier_render_margin_px(const bst_fourier_render *l) {
    return l->margin;
}

double bst_fourier_render_density(const bst_fourier_render *l, bool fine) {
    const double *density = l->density[fine ? FINE : PLAIN];
    return fmin(density[0], density[1]);
}

void bst_fourier_render_stamp(const bst_fourier_render *l, bst_kernel_source_record *source) {
    double least = bst_fourier_render_density(l, false);
    source->radius = (int)ceil(0.5 * l->options.taps / least) + 1;
}

double bst_fourier_render_widest(const bst_fourier_render *l) {
    return l->widest;
}

int bst_fourier_render_spectra(const bst_fourier_render *l) {
    return l->nodes / l->field_nodes;
}

/* Errors of an OTF between its tabulated frequencies and of rounding, per electron and times the
 * root of the pixels of the grid's period: noise in any pixel, of which this is the largest value.
 * Measured: tests/scenegen/test_tolerance_sweep.c, very bright stars. */
#define NOISE_OF_OTF 2.5e-6

/* Error in any pixel of the frame of the image of a point: that noise, which goes with the root of
 * the sum of squares of the image (Parseval), and far wings that re-enter the image. Those are
 * corrected with light at the centres of cells of 16 samples, up to half a cell from its place;
 * wings decrease as the third power of the distance. A binned pixel is a sum of b^2 pixels: smooth
 * wings add up to b^2, independent noise to b; that of an OTF between its frequencies is taken for
 * independent. */
static double everywhere_e(const bst_fourier_render *l, bool fine, bst_window window,
                           const bst_fourier_point *point) {
    static const double CELL = 16.0, AXES = 2.0, POWER = 3.0;
    if (!(point->electrons > 0.0)) {
        return 0.0;
    }
    const double *density = l->density[fine ? FINE : PLAIN];
    int pad = pad_px(l);
    double pixels = (double)(window.width + pad) * (window.height + pad);
    double spread = fmin(point->peak_e / (l->band[PLAIN].peak * point->electrons), 1.0);
    double near = (double)l->margin / pad, cell_px = CELL / fmin(density[0], density[1]);
    double wings = l->band[PLAIN].beyond * near * near * near;
    double b = (double)l->binning;
    return point->electrons * (b * NOISE_OF_OTF * sqrt(spread / pixels) +
                               b * b * wings * AXES * POWER * 0.5 * cell_px / pad);
}

double bst_fourier_render_error_sigma(const bst_fourier_render *l, bool fine, bst_window window,
                                      const bst_fourier_point *point) {
    bool whole = window.width == l->camera.width_px && window.height == l->camera.height_px;
    const bst_fourier_error *error = &l->error[l->binning - 1][fine ? FINE : PLAIN][whole];
    return bst_fourier_error_sigma(error, point) +
           everywhere_e(l, fine, window, point) / sqrt(point->dark_variance_e2);
}

double bst_fourier_render_mixing_error(const bst_fourier_render *l) {
    return bst_psf_mixing_error(l->psf);
}

/* Tabulates the spreading kernel by sub-sample phase (a point `phase` samples right of sample taps
 * / 2 - 1), also for nodes widened by (n / BST_WIDTHS)^2 BST_WIDEST of the node variance. */
static void tabulate(const bst_fourier_render *l, int quality, int a, const bst_fourier_axis *axis,
                     float *table) {
    double density = (double)axis->samples / axis->pixels;
    int first = BST_SPREAD_TAPS / 2 - axis->spread.taps / 2;
    memset(table, 0, BST_SPREAD_TABLE * sizeof *table);
    for (int n = 0; n <= BST_WIDTHS; n++) {
        double share = (double)n / BST_WIDTHS,
               sigma = share * l->band[PLAIN].node_sigma_px * density;
        double variance = BST_WIDEST * sigma * sigma;
        bst_nufft_kernel_shape shape;
        bst_nufft_kernel_widen(&axis->spread, &l->band[quality].axis[a], density, variance, &shape);
        for (int p = 0; p <= BST_SPREAD_PHASES; p++) {
            float *row = table + (n * (BST_SPREAD_PHASES + 1) + p) * BST_SPREAD_TAPS;
            for (int j = first; j < first + axis->spread.taps; j++) {
                double t = j - (BST_SPREAD_TAPS / 2 - 1) - (double)p / BST_SPREAD_PHASES;
                row[j] = (float)bst_nufft_kernel_shape_value(&axis->spread, &shape, t);
            }
        }
    }
}

static bst_status make_setup(bst_ctx *ctx, bst_fourier_render *l, int quality, bst_window window,
                             setup *s) {
    bst_otf_convolve_layout shape = {
        .width = window.width, .height = window.height, .margin = l->margin};
    bst_fourier_axis axis[2];
    choose_axes(l, quality, window.width, window.height, axis);
    shape.x = axis[0];
    shape.y = axis[1];
    BST_TRY(
        bst_otf_convolve_create(ctx, l->psf, l->band[quality].cutoff, &shape, l->pool, &s->fft));
    s->width = window.width;
    s->height = window.height;
    s->quality = quality;
    size_t table_bytes = 2 * BST_SPREAD_TABLE * sizeof(float);
    float *table = malloc(table_bytes);
    if (!table) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the spreading kernel's table");
    }
    tabulate(l, quality, 0, &shape.x, table);
    tabulate(l, quality, 1, &shape.y, table + BST_SPREAD_TABLE);
    cl_int code;
    s->table = clCreateBuffer(l->context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, table_bytes,
                              table, &code);
    free(table);
    BST_TRY(bst_device_check(ctx, code, "allocating the spreading kernel's table"));
    size_t bytes = bst_otf_convolve_floats(s->fft) * sizeof(float);
    return bst_device_buffer(ctx, l->context, bytes, NULL, "allocating the light's grid", &s->grid);
}

/* Finds or creates the setup for a window's size; replaces the least recently used one. */
static bst_status find_setup(bst_ctx *ctx, bst_fourier_render *l, int quality, bst_window window,
                             setup **out) {
    setup *oldest = &l->setups[0];
    l->calls++;
    for (int i = 0; i < SETUPS; i++) {
        setup *s = &l->setups[i];
        if (s->fft && s->width == window.width && s->height == window.height &&
            s->quality == quality) {
            s->used = l->calls;
            *out = s;
            return BST_OK;
        }
        oldest = s->used < oldest->used ? s : oldest;
    }
    free_setup(oldest);
    bst_status status = make_setup(ctx, l, quality, window, oldest);
    if (status != BST_OK) {
        free_setup(oldest);
        return status;
    }
    oldest->used = l->calls;
    *out = oldest;
    return BST_OK;
}

/* Enqueues the deposit of nodes on the grid. */
static bst_status deposit(bst_ctx *ctx, bst_fourier_render *l, cl_command_queue queue,
                          bst_window window, const bst_fourier_render_nodes *nodes, const setup *s,
                          int node) {
    const bst_otf_convolve_layout *shape = bst_otf_convolve_shape(s->fft);
    double density_x = (double)shape->x.samples / shape->x.pixels,
           density_y = (double)shape->y.samples / shape->y.pixels;
    double coarse_x = round(density_x * BST_DENSITY_PARTS) / BST_DENSITY_PARTS,
           coarse_y = round(density_y * BST_DENSITY_PARTS) / BST_DENSITY_PARTS;
    bst_deposit_params p = {
        .x0 = (float)(window.x0 - shape->margin),
        .y0 = (float)(window.y0 - shape->margin),
        .coarse_x = (float)coarse_x,
        .coarse_y = (float)coarse_y,
        .finer_x = (float)(density_x - coarse_x),
        .finer_y = (float)(density_y - coarse_y),
        .samples_x = shape->x.samples,
        .samples_y = shape->y.samples,
        .tiles_x = (shape->x.samples + l->tile_width - 1) / l->tile_width,
        .tiles_y = (shape->y.samples + l->tile_height - 1) / l->tile_height,
        .source_groups = nodes->source_groups,
        .spectrum = node / l->field_nodes,
        .field_x = l->field_x,
        .field_y = l->field_y,
        .field_per_px_x = (float)((l->field_x - 1) / fmax((double)l->camera.width_px - 1.0, 1.0)),
        .field_per_px_y = (float)((l->field_y - 1) / fmax((double)l->camera.height_px - 1.0, 1.0)),
        .by_field = l->field_nodes > 1,
        .by_spectrum = l->nodes > l->field_nodes,
        .nodes = l->node_params,
    };
    const void *values[] = {&p,
                            &nodes->sources,
                            &nodes->table,
                            &nodes->block_box,
                            &nodes->source_box,
                            &s->table,
                            &l->fields[node % l->field_nodes],
                            &s->grid,
                            &nodes->shares};
    cl_uint count = (cl_uint)(sizeof values / sizeof *values);
    for (cl_uint i = 0; i < count; i++) {
        size_t bytes = i == 0 ? sizeof p : sizeof(cl_mem);
        BST_TRY(bst_device_check(ctx, clSetKernelArg(l->kernel, i, bytes, values[i]),
                                 "setting a kernel argument"));
    }
    size_t group = (size_t)l->group, tiles = (size_t)p.tiles_x * (size_t)p.tiles_y;
    size_t global = (tiles + group - 1) / group * group;
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(queue, l->kernel, 1, NULL, &global, &group, 0, NULL, NULL),
        "spreading the light's nodes");
}

bst_status bst_fourier_render_frame(bst_ctx *ctx, bst_fourier_render *l, cl_command_queue queue,
                                    bst_window window, const bst_fourier_render_nodes *nodes,
                                    bst_fourier_render_image *out) {
    assert(l && queue && nodes && out && window.width > 0 && window.height > 0);
    setup *s;
    BST_TRY(find_setup(ctx, l, nodes->fine ? FINE : PLAIN, window, &s));
    size_t bytes = bst_otf_convolve_floats(s->fft) * sizeof(float);
    for (int n = 0; n < l->nodes; n++) {
        BST_TRY(deposit(ctx, l, queue, window, nodes, s, n));
        cl_int code;
        float *grid = clEnqueueMapBuffer(queue, s->grid, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0,
                                         bytes, 0, NULL, NULL, &code);
        BST_TRY(bst_device_check(ctx, code, "mapping the light's grid"));
        bst_otf_convolve_add(s->fft, n, n == 0, n == l->nodes - 1, grid);
        if (n == l->nodes - 1) {
            bst_otf_convolve_finish(s->fft, grid);
        }
        BST_TRY(bst_device_check(ctx, clEnqueueUnmapMemObject(queue, s->grid, grid, 0, NULL, NULL),
                                 "unmapping the light's grid"));
    }
    *out = (bst_fourier_render_image){s->grid, 0, bst_otf_convolve_pitch(s->fft)};
    return BST_OK;
}
