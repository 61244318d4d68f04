#include "scenegen/detector/readout.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "bst_scenegen_kernels.h"
#include "scenegen/detector/multiplication.h"
#include "scenegen/detector/persistence.h"
#include "scenegen/detector/pixel_noise.h"
#include "scenegen/scene_kernels.h"
#include "sim/optics/ramp_fit.h"

enum {
    TRANSFER,
    CHARGE,
    BLOOM,
    MARK,
    READ,
    FLICKER,
    PERSISTENCE,
    RAMP,
    RAMP_FIT,
    NEIGHBOURS,
    PARALLEL,
    SERIAL,
    CROSSTALK,
    KERNELS
};

struct bst_readout {
    bst_camera camera;
    bst_device *device;
    cl_context context;
    cl_command_queue queue;
    cl_kernel kernels[KERNELS];
    cl_mem image, over, full;
    cl_mem multiplication; /* table of the register, NULL without one */
    size_t bytes;
    bst_persistence persistence;
    bst_pixel_noise pixel_noise;
    cl_mem planes, held;         /* of a ramp: kernels/ramp.cl, persistence.cl */
    bst_kernel_ramp_params ramp; /* of the latest interval */
};

static bool wanted(const bst_readout *r, int kernel);

/* True if charge may change after it was limited to the full well and before it is read. */
static bool moves_charge(const bst_readout *r) {
    return bst_detector_has_traps(&r->camera.detector.parallel_traps) || wanted(r, RAMP) ||
           wanted(r, NEIGHBOURS) || wanted(r, SERIAL);
}

/* True if the camera needs a kernel of the staged read-out. */
static bool wanted(const bst_readout *r, int kernel) {
    const bst_detector_config *d = &r->camera.detector;
    switch (kernel) {
        case TRANSFER:
            return d->frame_transfer_s > 0.0;
        case BLOOM:
            return d->saturation == BST_WELL_BLOOM;
        case FLICKER:
            return bst_detector_has_pixel_flicker(d);
        case PERSISTENCE:
            return bst_detector_has_persistence(d);
        case RAMP:
        case RAMP_FIT:
            return d->ramp.reads > 0;
        case NEIGHBOURS:
            return d->interpixel_coupling > 0.0 || d->brighter_fatter_per_e > 0.0;
        case PARALLEL:
            return bst_detector_has_traps(&d->parallel_traps);
        case SERIAL:
            return bst_detector_has_traps(&d->serial_traps);
        case CROSSTALK:
            return d->crosstalk.outputs > 1 && d->crosstalk.coupling != 0.0;
        case MARK:
            return moves_charge(r) || wanted(r, CROSSTALK);
        default:
            return true;
    }
}

/* True if crosstalk is added while charge is read; binned pixels have it before they are summed. */
static bool reads_crosstalk(const bst_readout *r, const bst_kernel_frame_params *p) {
    return wanted(r, CROSSTALK) && p->binning == 1;
}

/* True if a step needs a second image. */
static bool needs_over(const bst_readout *r) {
    return wanted(r, BLOOM) || wanted(r, NEIGHBOURS);
}

bst_status bst_readout_prepare(bst_ctx *ctx, bst_readout *r) {
    static const char *const names[KERNELS] = {
        "bst_detector_transfer",    "bst_detector_charge",   "bst_detector_bloom",
        "bst_detector_mark",        "bst_detector_read",     "bst_detector_flicker",
        "bst_detector_persistence", "bst_detector_ramp",     "bst_detector_ramp_fit",
        "bst_detector_neighbours",  "bst_detector_parallel", "bst_detector_serial",
        "bst_detector_crosstalk"};
    static const bst_device_kernel_source *const staged[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes,     &bst_kernel_random,
        &bst_kernel_chunk,        &bst_kernel_read_tail, &bst_kernel_detector,
        &bst_kernel_store_dn,     &bst_kernel_readout,   &bst_kernel_pixel_flicker,
        &bst_kernel_persistence,  &bst_kernel_ramp};
    static const bst_device_kernel_source *const moving[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes, &bst_kernel_charge_transfer,
        &bst_kernel_charge_coupling};
    if (r->camera.detector.em_gain > 1.0 && !r->multiplication) {
        float table[BST_MULTIPLICATION_FLOATS];
        bst_multiplication_table(table);
        BST_TRY(bst_device_buffer(ctx, r->context, sizeof table, table,
                                  "allocating the table of the multiplication register",
                                  &r->multiplication));
    }
    char options[64];
    snprintf(options, sizeof options, "-cl-std=CL1.2%s%s", bst_detector_tail_options(&r->camera),
             wanted(r, RAMP) ? " -DRAMP" : "");
    for (int i = 0; i < KERNELS; i++) {
        if (wanted(r, i) && !r->kernels[i]) {
            int sources = (int)(sizeof staged / sizeof *staged) - (i <= READ ? 3 : 0);
            BST_TRY(i <= RAMP_FIT
                        ? bst_scene_kernel(ctx, r->device, staged, sources, options, names[i],
                                           &r->kernels[i])
                        : bst_scene_kernel(ctx, r->device, moving, sizeof moving / sizeof *moving,
                                           "-cl-std=CL1.2", names[i], &r->kernels[i]));
        }
    }
    return BST_OK;
}

bst_status bst_readout_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                              bst_readout **out) {
    assert(device && camera && out);
    *out = NULL;
    bst_readout *r = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the read-out");
    }
    r->camera = *camera;
    r->device = device;
    r->context = bst_device_context(device);
    r->queue = bst_device_queue(device);
    clRetainContext(r->context);
    clRetainCommandQueue(r->queue);
    *out = r;
    return BST_OK;
}

void bst_readout_free(bst_readout *r) {
    if (!r) {
        return;
    }
    for (int i = 0; i < KERNELS; i++) {
        if (r->kernels[i]) {
            clReleaseKernel(r->kernels[i]);
        }
    }
    if (r->image) {
        clReleaseMemObject(r->image);
    }
    if (r->over) {
        clReleaseMemObject(r->over);
    }
    if (r->full) {
        clReleaseMemObject(r->full);
    }
    if (r->multiplication) {
        clReleaseMemObject(r->multiplication);
    }
    if (r->planes) {
        clReleaseMemObject(r->planes);
    }
    if (r->held) {
        clReleaseMemObject(r->held);
    }
    bst_persistence_clear(&r->persistence);
    bst_pixel_noise_clear(&r->pixel_noise);
    clReleaseCommandQueue(r->queue);
    clReleaseContext(r->context);
    free(r);
}

bst_window bst_readout_light_window(const bst_readout *r, bst_window window) {
    bst_window light = bst_detector_light_window(&r->camera, window);
    int beyond = light.x0 % 64; /* images start at whole chunks */
    light.x0 -= beyond;
    light.width += beyond;
    return light;
}

enum {
    RAMP_PLANES = 3, /* of kernels/ramp.cl */
    /* images of intervals that are read at once: all of the ramp if those of the whole sensor take
     * at most this, bytes, and else eight, so that a pixel's values are loaded and stored less
     * often */
    RAMP_BYTES = 256 << 20,
    RAMP_IMAGES = 8,
    /* reads of a ramp from which on the possible signals of a pixel lie close together: six give
     * multiples of a seventh of an electron */
    RAMP_LINE_READS = 6
};
/* Signals from here on, e-, are drawn by an expansion whose first neglected term is 1e-4 of their
 * standard deviation at three of these in steady light (skewness 0.06). Uneven light has a skewness
 * of up to 0.06 (6 reads) to 0.10 (64), and five times that term. */
static const float RAMP_LINE_FROM = 400.0F;

/* Row stride of an image, floats. */
static int stride_of(int width) {
    return (width + 63) / 64 * 64;
}

/* Images that hold the light of intervals of a ramp until they are read. */
int bst_readout_images(const bst_readout *r) {
    assert(r);
    const bst_camera *c = &r->camera;
    if (!wanted(r, RAMP) || c->detector.cosmic_rays.rate_per_cm2_s > 0.0) {
        return 1; /* hits of an interval lie in a map for all */
    }
    size_t intervals = (size_t)c->detector.ramp.reads - 1;
    size_t bytes = (size_t)stride_of((int)c->width_px) * (size_t)c->height_px * sizeof(float);
    return intervals * bytes <= RAMP_BYTES || intervals < RAMP_IMAGES ? (int)intervals
                                                                      : RAMP_IMAGES;
}

/* True if the signal of a pixel may be drawn at once instead of read by read. */
static bool draws_lines(const bst_readout *r) {
    const bst_detector_config *d = &r->camera.detector;
    const double *n = d->nonlinearity;
    return d->ramp.fit == BST_RAMP_SLOPE && d->ramp.reads >= RAMP_LINE_READS && n[0] == 0.0 &&
           n[1] == 0.0 && n[2] == 0.0 && bst_readout_images(r) == (int)d->ramp.reads - 1;
}

bst_status bst_readout_image(bst_ctx *ctx, bst_readout *r, bst_window light, cl_mem *image,
                             int *stride) {
    *stride = stride_of(light.width);
    size_t bytes = (size_t)*stride * (size_t)light.height * sizeof(float);
    if (bytes > r->bytes) {
        enum { BUFFERS = 5 };
        cl_mem *buffers[BUFFERS] = {&r->image, &r->over, &r->full, &r->planes, &r->held};
        bool ramp = wanted(r, RAMP);
        const size_t images = (size_t)bst_readout_images(r) * bytes;
        const size_t room[BUFFERS] = {
            images, needs_over(r) ? images : 0,
            /* they change places */ wanted(r, MARK) ? bytes / sizeof(float) : 0,
            ramp ? RAMP_PLANES * bytes : 0, ramp && wanted(r, PERSISTENCE) ? bytes : 0};
        for (int i = 0; i < BUFFERS; i++) {
            if (*buffers[i]) {
                clReleaseMemObject(*buffers[i]);
            }
            *buffers[i] = NULL;
            if (room[i] > 0) {
                BST_TRY(bst_device_buffer(ctx, r->context, room[i], NULL,
                                          "allocating an image of charge", buffers[i]));
            }
        }
        r->bytes = bytes;
    }
    *image = r->image;
    return BST_OK;
}

/* Arguments of a kernel: parameters, and then buffers. */
typedef struct arguments {
    const void *params;
    size_t bytes;
    const cl_mem *buffers;
    cl_uint count;
} arguments;

/* Enqueues a kernel with a number of work-items. */
static bst_status enqueue_kernel(bst_ctx *ctx, bst_readout *r, int kernel, arguments a,
                                 size_t items) {
    cl_kernel k = r->kernels[kernel];
    const size_t local = BST_READOUT_GROUP, global = (items + local - 1) / local * local;
    BST_TRY(bst_device_check(ctx, clSetKernelArg(k, 0, a.bytes, a.params),
                             "setting a kernel argument"));
    for (cl_uint i = 0; i < a.count; i++) {
        BST_TRY(bst_device_check(ctx, clSetKernelArg(k, i + 1, sizeof(cl_mem), &a.buffers[i]),
                                 "setting a kernel argument"));
    }
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(r->queue, k, 1, NULL, &global, &local, 0, NULL, NULL),
        "reading a frame out");
}

/* Traps of one direction, for an image of `p`. */
static bst_status enqueue_traps(bst_ctx *ctx, bst_readout *r, int kernel,
                                const bst_kernel_frame_params *p) {
    const bst_detector_config *d = &r->camera.detector;
    const bst_detector_traps_config *t = kernel == PARALLEL ? &d->parallel_traps : &d->serial_traps;
    bst_kernel_trap_params q = {.width = kernel == PARALLEL ? p->light_stride : p->sensor_width,
                                .height = p->light_height,
                                .stride = p->light_stride,
                                .backwards = kernel == PARALLEL ? d->output.top : d->output.right};
    q.exponent = (float)t->fill_exponent;
    for (int i = 0; i < BST_TRAP_SPECIES; i++) {
        if (t->traps_per_px[i] > 0.0) {
            double reference = pow(t->reference_e, t->fill_exponent);
            q.density[q.kinds] = (float)(t->traps_per_px[i] / reference);
            q.release[q.kinds++] = (float)-expm1(-1.0 / t->release_px[i]);
        }
    }
    size_t items = kernel == PARALLEL ? (size_t)q.stride / 64 : ((size_t)q.height + 31) / 32;
    return enqueue_kernel(ctx, r, kernel, (arguments){&q, sizeof q, &r->image, 1}, items);
}

/* Parameters of the effects between pixels, without any. */
static bst_kernel_coupling_params coupling_params(const bst_readout *r,
                                                  const bst_kernel_frame_params *p) {
    const bst_detector_edges_config *edges = &r->camera.detector.overscan;
    return (bst_kernel_coupling_params){.width = p->sensor_width,
                                        .x0 = (int)edges->left,
                                        .x1 = p->sensor_width - (int)edges->right,
                                        .y0 = p->real_y0,
                                        .y1 = p->real_y1,
                                        .height = p->light_height,
                                        .stride = p->light_stride,
                                        .outputs = 1};
}

/* Borders that charge moves, or coupling of neighbours; afterwards r->image has the result. */
static bst_status enqueue_neighbours(bst_ctx *ctx, bst_readout *r, const bst_kernel_frame_params *p,
                                     double shift, double coupling) {
    if (!(shift > 0.0) && !(coupling > 0.0)) {
        return BST_OK;
    }
    bst_kernel_coupling_params q = coupling_params(r, p);
    q.shift = (float)shift;
    q.coupling = (float)coupling;
    cl_mem b[] = {r->image, r->over};
    BST_TRY(enqueue_kernel(ctx, r, NEIGHBOURS, (arguments){&q, sizeof q, b, 2}, (size_t)q.height));
    r->image = b[1];
    r->over = b[0];
    return BST_OK;
}

/* From collected charge to the charge at the output. */
static bst_status move_charge(bst_ctx *ctx, bst_readout *r, const bst_kernel_frame_params *p) {
    const bst_detector_config *d = &r->camera.detector;
    BST_TRY(enqueue_neighbours(ctx, r, p, d->brighter_fatter_per_e, 0.0));
    if (wanted(r, BLOOM)) {
        cl_mem b[] = {r->image, r->over};
        BST_TRY(enqueue_kernel(ctx, r, BLOOM, (arguments){p, sizeof *p, b, 2},
                               (size_t)p->light_stride / 16));
    }
    if (p->effects & BST_EFFECT_MARKS && !wanted(r, RAMP)) {
        cl_mem b[] = {r->image, r->full};
        BST_TRY(
            enqueue_kernel(ctx, r, MARK, (arguments){p, sizeof *p, b, 2}, (size_t)p->light_height));
    }
    for (int kernel = PARALLEL; kernel <= SERIAL; kernel++) {
        if (wanted(r, kernel)) {
            BST_TRY(enqueue_traps(ctx, r, kernel, p));
        }
    }
    BST_TRY(enqueue_neighbours(ctx, r, p, 0.0, d->interpixel_coupling));
    if (wanted(r, CROSSTALK) && !reads_crosstalk(r, p)) {
        bst_kernel_coupling_params q = coupling_params(r, p);
        q.outputs = (int)d->crosstalk.outputs;
        q.mirrored = d->crosstalk.mirrored;
        q.crosstalk = (float)d->crosstalk.coupling;
        BST_TRY(enqueue_kernel(ctx, r, CROSSTALK, (arguments){&q, sizeof q, &r->image, 1},
                               (size_t)q.height));
    }
    return BST_OK;
}

/* Pixels whose traps or 1/f noise are followed. */
static size_t persistent_pixels(const bst_readout *r) {
    return (size_t)stride_of((int)r->camera.width_px) * (size_t)r->camera.height_px;
}

/* Expected charge in place of light, and the traps after the exposure, or after an interval of a
 * ramp. maps: of the detector. */
static bst_status enqueue_persistence(bst_ctx *ctx, bst_readout *r, const cl_mem *maps,
                                      double start_s, int interval, bst_kernel_frame_params *p) {
    const bst_detector_config *d = &r->camera.detector;
    BST_TRY(bst_persistence_prepare(ctx, &r->persistence, r->device, d, persistent_pixels(r)));
    assert((size_t)p->light_stride * (size_t)p->light_height == persistent_pixels(r));
    bst_kernel_persistence_params t = bst_persistence_begin(&r->persistence, d, p, start_s);
    t.in_ramp = wanted(r, RAMP);
    t.continues = interval > 0;
    t.image = interval % bst_readout_images(r);
    cl_mem b[] = {r->image, maps[0], maps[1], maps[2], maps[6], r->persistence.trapped, r->held};
    BST_TRY(enqueue_kernel(ctx, r, PERSISTENCE, (arguments){&t, sizeof t, b, 7},
                           (size_t)p->light_height));
    p->effects |= BST_EFFECT_MEANS;
    return BST_OK;
}

/* Read noise of all pixels of the sensor, with 1/f noise. */
static bst_status enqueue_flicker(bst_ctx *ctx, bst_readout *r, double read_s,
                                  bst_kernel_frame_params *p) {
    if (!wanted(r, FLICKER)) {
        return BST_OK;
    }
    assert(p->binning == 1);
    bst_pixel_noise *n = &r->pixel_noise;
    BST_TRY(bst_pixel_noise_prepare(ctx, n, r->device, &r->camera.detector, persistent_pixels(r)));
    bst_kernel_flicker_params t = bst_pixel_noise_begin(n, &r->camera, p, read_s);
    cl_mem b[] = {n->state, n->noise};
    p->effects |= BST_EFFECT_FLICKER;
    return enqueue_kernel(ctx, r, FLICKER, (arguments){&t, sizeof t, b, 2},
                          (size_t)r->camera.height_px);
}

/* Parameters of a frame whose light covers a window. */
static bst_kernel_frame_params light_params(const bst_readout *r,
                                            const bst_kernel_frame_params *params,
                                            bst_window light) {
    bst_kernel_frame_params p = *params;
    p.tiles_x0 = light.x0;
    p.light_y0 = light.y0;
    p.light_height = light.height;
    p.light_stride = stride_of(light.width);
    p.real_y0 = (int)r->camera.detector.overscan.bottom;
    p.real_y1 = (int)(r->camera.height_px - r->camera.detector.overscan.top);
    if (reads_crosstalk(r, &p)) {
        p.effects |= BST_EFFECT_CROSSTALK;
        p.outputs = (int)r->camera.detector.crosstalk.outputs;
        p.mirrored = r->camera.detector.crosstalk.mirrored;
        p.crosstalk = (float)r->camera.detector.crosstalk.coupling;
    }
    bool marked = moves_charge(r) || (wanted(r, CROSSTALK) && !reads_crosstalk(r, &p));
    p.effects |= marked ? BST_EFFECT_MARKS : 0;
    return p;
}

bst_status bst_readout_interval(bst_ctx *ctx, bst_readout *r, const bst_detector *detector,
                                const bst_kernel_frame_params *params, bst_window window,
                                int interval, double start_s) {
    assert(r && detector && params && wanted(r, RAMP) && interval >= 0);
    BST_TRY(bst_readout_prepare(ctx, r));
    const bst_detector_ramp_config *ramp = &r->camera.detector.ramp;
    bst_kernel_frame_params p = light_params(r, params, bst_readout_light_window(r, window));
    cl_mem maps[BST_DETECTOR_BUFFERS];
    bst_detector_buffers(detector, maps);
    if (wanted(r, PERSISTENCE)) {
        BST_TRY(enqueue_persistence(ctx, r, maps, start_s, interval, &p));
    }
    int images = bst_readout_images(r), image = interval % images;
    r->ramp.frame = p;
    r->ramp.interval = interval - image;
    r->ramp.intervals = image + 1;
    r->ramp.reads = (int)ramp->reads;
    r->ramp.last_minus_first = ramp->fit == BST_RAMP_LAST_MINUS_FIRST;
    r->ramp.line_from = draws_lines(r) ? RAMP_LINE_FROM : -1.0F;
    double weight[BST_RAMP_READS], later = 0.0;
    bst_ramp_weights(ramp, r->ramp.reads, weight);
    for (int i = r->ramp.reads - 1; i > 0; i--) { /* an interval's charge is in all later reads */
        later += weight[i];
        r->ramp.weight[i - 1] = (float)later;
    }
    for (int used = 2; interval == 0 && used <= r->ramp.reads; used++) {
        double noise_e = bst_ramp_noise_e(ramp, r->camera.read_noise_e, used);
        r->ramp.variance[used] = (float)(noise_e * noise_e);
    }
    if (image + 1 < images && interval + 2 < r->ramp.reads) {
        return BST_OK; /* waits for the next intervals */
    }
    cl_mem b[] = {r->image, maps[0], maps[1], maps[2], r->planes};
    return enqueue_kernel(ctx, r, RAMP, (arguments){&r->ramp, sizeof r->ramp, b, 5},
                          (size_t)p.light_height);
}

/* Charge of a frame in place of its light. */
static bst_status collect_charge(bst_ctx *ctx, bst_readout *r, const cl_mem *maps, double start_s,
                                 bst_kernel_frame_params *p) {
    size_t columns = (size_t)p->light_stride, rows = (size_t)p->light_height;
    if (wanted(r, RAMP)) {
        cl_mem b[] = {r->image, r->planes, r->full};
        return enqueue_kernel(ctx, r, RAMP_FIT, (arguments){&r->ramp, sizeof r->ramp, b, 3}, rows);
    }
    if (wanted(r, TRANSFER)) {
        cl_mem b[] = {r->image, maps[0]};
        BST_TRY(enqueue_kernel(ctx, r, TRANSFER, (arguments){p, sizeof *p, b, 2}, columns / 64));
    }
    if (wanted(r, PERSISTENCE)) {
        BST_TRY(enqueue_persistence(ctx, r, maps, start_s, 0, p));
    }
    cl_mem charge[] = {r->image, maps[0], maps[1], maps[2], maps[6]};
    return enqueue_kernel(ctx, r, CHARGE, (arguments){p, sizeof *p, charge, 5}, rows);
}

int bst_readout_parts(const bst_readout *r, bst_window window, int binning) {
    assert(r && binning >= 1);
    int height = window.height / binning, width = window.width / binning;
    if (!bst_detector_has_tail(&r->camera)) {
        return height;
    }
    int top = window.y0 / binning, left = window.x0 / binning;
    int blocks = (top + height - 1) / BST_TAIL_ROWS - top / BST_TAIL_ROWS + 1;
    return blocks * ((left % 64 + width + 63) / 64);
}

bst_status bst_readout_archive(bst_readout *r, bst_archive *archive) {
    assert(r && archive);
    const bst_detector_config *d = &r->camera.detector;
    if (wanted(r, PERSISTENCE)) {
        BST_TRY(
            bst_persistence_archive(&r->persistence, r->device, d, persistent_pixels(r), archive));
    }
    return wanted(r, FLICKER) ? bst_pixel_noise_archive(&r->pixel_noise, r->device, d,
                                                        persistent_pixels(r), archive)
                              : BST_OK;
}

void bst_readout_inherit(bst_readout *r, bst_readout *before) {
    assert(r && before && persistent_pixels(r) == persistent_pixels(before));
    bst_persistence_clear(&r->persistence);
    r->persistence = before->persistence;
    before->persistence = (bst_persistence){0};
    bst_pixel_noise_clear(&r->pixel_noise);
    r->pixel_noise = before->pixel_noise;
    before->pixel_noise = (bst_pixel_noise){0};
}

bst_status bst_readout_run(bst_ctx *ctx, bst_readout *r, const bst_detector *detector,
                           const bst_kernel_frame_params *params, bst_window window, int binning,
                           double start_s, cl_mem frame, cl_mem saturated) {
    assert(r && detector && params && window.width > 0 && window.height > 0);
    BST_TRY(bst_readout_prepare(ctx, r));
    bst_kernel_frame_params p = *params;
    p.binning = binning;
    p = light_params(r, &p, bst_readout_light_window(r, window));
    cl_mem maps[BST_DETECTOR_BUFFERS];
    bst_detector_buffers(detector, maps);
    p.window_width = window.width / binning;
    p.window_height = window.height / binning;
    BST_TRY(collect_charge(ctx, r, maps, start_s, &p));
    BST_TRY(move_charge(ctx, r, &p));
    BST_TRY(enqueue_flicker(ctx, r, start_s + (double)p.exposure_s, &p));
    p.per_full_well /= (float)(binning * binning);
    cl_mem table = wanted(r, RAMP) ? r->planes : r->multiplication;
    cl_mem read[] = {r->image, frame, saturated,           maps[3], maps[4], maps[5],
                     r->full,  table, r->pixel_noise.noise};
    return enqueue_kernel(ctx, r, READ, (arguments){&p, sizeof p, read, 9},
                          (size_t)bst_readout_parts(r, window, binning));
}
