#include "scenegen/detector/detector.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bst_scenegen_kernels.h"
#include "scenegen/detector/fixed_pattern_noise.h"
#include "scenegen/detector/readout_charge.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/scene_kernels.h"

struct bst_detector {
    bst_camera camera;
    bst_rng_key pattern;
    bst_parallel *pool; /* lent */
    int stride;         /* of the maps: sensor width rounded up to chunks of 64 */
    cl_context context;
    cl_command_queue queue;
    cl_mem gain, dark, overlay, offsets, codes, flags, readout;
    cl_mem deposits; /* of the current frame; lent */
    cl_kernel deposit_kernel;
    bst_cosmic_rays *hits;
    bst_cosmic_rays_summary summary;
    /* DN: fixed row offsets; those of the frame, and its pick-up by row: amplitudes of the cosines
     * and sines of the columns: [4][height] */
    float *rows;
};

double bst_detector_near_full_e(double full_well_e) {
    return full_well_e - 8.0 * sqrt(full_well_e) - 20.0;
}

bst_rng_key bst_detector_pattern_key(const bst_camera *camera, const char *name) {
    return bst_rng_make_key(camera->detector.fixed_pattern_seed, 0, name, "pattern");
}

/* True if the camera multiplies charge before it is read. */
static bool multiplies(const bst_camera *c) {
    return c->detector.em_gain > 1.0;
}

bst_window bst_detector_light_window(const bst_camera *camera, bst_window window) {
    if (bst_detector_config_whole_columns(&camera->detector)) {
        window.y0 = 0;
        window.height = (int)camera->height_px;
    }
    if (bst_detector_config_whole_sensor(&camera->detector)) {
        window.x0 = 0;
        window.width = (int)camera->width_px;
    }
    return window;
}

bool bst_detector_is_staged(const bst_detector *detector) {
    return bst_detector_config_whole_columns(&detector->camera.detector) ||
           detector->camera.detector.ramp.reads > 0 || multiplies(&detector->camera) ||
           bst_detector_has_pixel_flicker(&detector->camera.detector);
}

/* True if offsets are new in every frame. */
static bool has_frame_offsets(const bst_detector_config *d) {
    return d->row_noise_e > 0.0 || d->flicker_noise_e > 0.0 || d->offset_noise_e > 0.0 ||
           d->offset_drift_dn_per_frame != 0.0 || d->pick_up.amplitude_e > 0.0;
}

static bool has_offsets(const bst_detector_config *d) {
    return d->column_offset_rms_e > 0.0 || d->row_offset_rms_e > 0.0 || has_frame_offsets(d);
}

/* True if the amplifier's nonlinearity changes the read noise's share of the variance by more than
 * 3e-5, so that read noise must be added after it. */
static bool charge_first(const bst_camera *c) {
    const double *n = c->detector.nonlinearity;
    double bend = 2.0 * fabs(n[0]) + 3.0 * fabs(n[1]) + 4.0 * fabs(n[2]);
    return 2.0 * bend * c->read_noise_e * c->read_noise_e / c->full_well_e > 3e-5;
}

bool bst_detector_has_tail(const bst_camera *c) {
    return c->detector.telegraph_noise_fraction > 0.0 && c->detector.telegraph_noise_rms_e > 0.0;
}

const char *bst_detector_tail_options(const bst_camera *camera) {
    static const char *const options[2][2] = {{"", " -DMULTIPLY"},
                                              {" -DTAIL", " -DTAIL -DMULTIPLY"}};
    return options[bst_detector_has_tail(camera)][multiplies(camera)];
}

/* BST_EFFECT_... of the camera. */
static int effects_of(const bst_detector *detector) {
    const bst_camera *c = &detector->camera;
    const bst_detector_config *d = &c->detector;
    const double *n = d->nonlinearity;
    bool nonlinear = n[0] != 0.0 || n[1] != 0.0 || n[2] != 0.0;
    return (detector->gain ? BST_EFFECT_GAIN : 0) | (detector->dark ? BST_EFFECT_DARK : 0) |
           (detector->overlay ? BST_EFFECT_OVERLAY : 0) | (nonlinear ? BST_EFFECT_NONLINEAR : 0) |
           (detector->offsets ? BST_EFFECT_OFFSETS : 0) | (detector->codes ? BST_EFFECT_CODES : 0) |
           (d->saturation == BST_WELL_BLOOM ? BST_EFFECT_BLOOM : 0) |
           (d->frame_transfer_s > 0.0 ? BST_EFFECT_TRANSFER : 0) |
           (detector->flags ? BST_EFFECT_FLAGS : 0) | (detector->readout ? BST_EFFECT_READOUT : 0) |
           (d->pick_up.amplitude_e > 0.0 ? BST_EFFECT_PICK_UP : 0);
}

void bst_detector_options(const bst_detector *detector, bool shared, char *text, size_t bytes) {
    double read = detector->camera.read_noise_e;
    char effects[32] = "";
    if (!shared) {
        snprintf(effects, sizeof effects, " -DEFFECTS=%d", effects_of(detector));
    }
    snprintf(text, bytes, " -DCF_ORDER=%d%s%s",
             read >= 5.0   ? 2
             : read >= 3.0 ? 3
                           : 4,
             effects, bst_detector_tail_options(&detector->camera));
}

void bst_detector_params(const bst_detector *detector, bst_kernel_frame_params *p) {
    const bst_camera *c = &detector->camera;
    const bst_detector_config *d = &c->detector;
    const double *n = d->nonlinearity, read = c->read_noise_e;
    bool alone = charge_first(c) || read < 0.75;
    p->effects = effects_of(detector);
    p->maps_stride = detector->stride;
    p->maps_rows = (int)c->height_px;
    p->single_from = alone ? INFINITY : read >= 2.0 ? -1.0f : 30.0f;
    p->bend1 = (float)n[0];
    p->bend2 = (float)n[1];
    p->bend3 = (float)n[2];
    if (bst_detector_has_tail(c)) {
        p->tail_gap = (float)(-0.5 / log1p(-d->telegraph_noise_fraction));
        p->tail_rms_e = (float)d->telegraph_noise_rms_e;
    }
    p->transfer_row_s = (float)(d->frame_transfer_s / (double)c->height_px);
    p->offsets_rows = detector->stride * (d->pick_up.amplitude_e > 0.0 ? 3 : 1);
    p->multiply_rms = multiplies(c) ? (float)sqrt(1.0 - 1.0 / d->em_gain) : 0.0f;
}

static bst_status make_buffer(bst_ctx *ctx, bst_detector *d, size_t bytes, const void *data,
                              cl_mem *out) {
    return bst_device_buffer(ctx, d->context, bytes, data, "allocating a map of the detector", out);
}

static bst_status make_map(bst_ctx *ctx, bst_detector *d,
                           bst_status (*make)(bst_ctx *, const bst_camera *, bst_rng_key,
                                              bst_parallel *, int, float *),
                           bst_parallel *maps, cl_mem *out) {
    size_t count = (size_t)d->stride * (size_t)d->camera.height_px;
    count += make ? 0 : count / 64; /* marks of the overlay's chunks */
    float *map = calloc(count, sizeof *map);
    if (!map) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a map of the detector");
    }
    bst_status status = make ? make(ctx, &d->camera, d->pattern, maps, d->stride, map) : BST_OK;
    if (status == BST_OK) {
        status = make_buffer(ctx, d, count * sizeof *map, map, out);
    }
    free(map);
    return status;
}

/* Fixed column and row offsets on the device, and the waves of the pick-up by column. */
static bst_status make_offsets(bst_ctx *ctx, bst_detector *d) {
    bool pick_up = d->camera.detector.pick_up.amplitude_e > 0.0;
    size_t height = (size_t)d->camera.height_px, stride = (size_t)d->stride;
    size_t first = stride * (pick_up ? 3 : 1), count = first + height * (pick_up ? 3 : 1);
    float *offsets = calloc(count, sizeof *offsets);
    d->rows = calloc(4 * height, sizeof *d->rows);
    bst_status status = BST_ERR_MEMORY;
    if (offsets && d->rows) {
        for (size_t x = 0; pick_up && x < stride; x++) {
            double turns = d->camera.detector.pick_up.cycles_per_px * (double)x;
            offsets[stride + x] = (float)cos(2.0 * BST_PI * turns);
            offsets[2 * stride + x] = (float)sin(2.0 * BST_PI * turns);
        }
        bst_fixed_pattern_noise_offsets(&d->camera, d->pattern, "columns", (int)d->camera.width_px,
                                        offsets);
        bst_fixed_pattern_noise_offsets(&d->camera, d->pattern, "rows", (int)height, d->rows);
        memcpy(offsets + first, d->rows, height * sizeof *offsets);
        status = make_buffer(ctx, d, count * sizeof *offsets, offsets, &d->offsets);
    } else {
        status = bst_fail(ctx, status, "no memory for the offsets of columns and rows");
    }
    free(offsets);
    return status;
}

/* Table of output codes on the device. */
static bst_status make_codes(bst_ctx *ctx, bst_detector *d) {
    uint16_t *codes = malloc(65536 * sizeof *codes);
    if (!codes) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a table of codes");
    }
    bst_status status = bst_fixed_pattern_noise_codes(ctx, &d->camera, codes);
    if (status == BST_OK) {
        status = make_buffer(ctx, d, sizeof *codes << d->camera.bits, codes, &d->codes);
    }
    free(codes);
    return status;
}

static bst_status make_all(bst_ctx *ctx, bst_device *device, bst_parallel *maps, bst_detector *d) {
    const bst_detector_config *c = &d->camera.detector;
    if (bst_fixed_pattern_noise_has_gain(&d->camera)) {
        BST_TRY(make_map(ctx, d, bst_fixed_pattern_noise_gain, maps, &d->gain));
    }
    if (bst_fixed_pattern_noise_has_dark(&d->camera)) {
        BST_TRY(make_map(ctx, d, bst_fixed_pattern_noise_dark, maps, &d->dark));
    }
    if (bst_readout_charge_is_on(c)) {
        BST_TRY(make_map(ctx, d, bst_readout_charge_map, maps, &d->readout));
    }
    if (has_offsets(c)) {
        BST_TRY(make_offsets(ctx, d));
    }
    if (c->quantisation.model != BST_QUANTISE_UNIFORM) {
        BST_TRY(make_codes(ctx, d));
    }
    if (c->cosmic_rays.rate_per_cm2_s > 0.0) {
        BST_TRY(make_map(ctx, d, NULL, maps, &d->overlay));
        BST_TRY(bst_cosmic_rays_create(ctx, &c->cosmic_rays, (int)d->camera.width_px,
                                       (int)d->camera.height_px, d->stride, &d->hits));
        bst_cosmic_rays_set_overscan(d->hits, &c->overscan);
        static const bst_device_kernel_source *const sources[] = {&bst_kernel_scene_shared,
                                                                  &bst_kernel_cosmic_rays};
        BST_TRY(bst_scene_kernel(ctx, device, sources, 2, "-cl-std=CL1.2", "bst_detector_deposit",
                                 &d->deposit_kernel));
    }
    return BST_OK;
}

bst_status bst_detector_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                               bst_rng_key pattern, bst_parallel *pool, bst_parallel *maps,
                               bst_detector **out) {
    assert(device && camera && out);
    *out = NULL;
    bst_detector *d = calloc(1, sizeof *d);
    if (!d) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the detector");
    }
    d->camera = *camera;
    d->pattern = pattern;
    d->pool = pool;
    d->stride = (int)((camera->width_px + 63) / 64 * 64);
    d->context = bst_device_context(device);
    d->queue = bst_device_queue(device);
    clRetainContext(d->context);
    clRetainCommandQueue(d->queue);
    bst_status status = make_all(ctx, device, maps, d);
    if (status != BST_OK) {
        bst_detector_free(d);
        return status;
    }
    *out = d;
    return BST_OK;
}

void bst_detector_free(bst_detector *d) {
    if (!d) {
        return;
    }
    cl_mem buffers[] = {d->gain, d->dark, d->overlay, d->offsets, d->codes, d->flags, d->readout};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        if (buffers[i]) {
            clReleaseMemObject(buffers[i]);
        }
    }
    if (d->deposit_kernel) {
        clReleaseKernel(d->deposit_kernel);
    }
    bst_cosmic_rays_free(d->hits);
    clReleaseCommandQueue(d->queue);
    clReleaseContext(d->context);
    free(d->rows);
    free(d);
}

bst_status bst_detector_keep_flags(bst_ctx *ctx, bst_detector *d) {
    return make_buffer(ctx, d, (size_t)d->camera.width_px * (size_t)d->camera.height_px, NULL,
                       &d->flags);
}

bst_status bst_detector_flags(bst_ctx *ctx, const bst_detector *d, size_t count, uint8_t *out) {
    return bst_device_check(
        ctx, clEnqueueReadBuffer(d->queue, d->flags, CL_TRUE, 0, count, out, 0, NULL, NULL),
        "reading the flags of saturated pixels");
}

void bst_detector_buffers(const bst_detector *d, cl_mem out[BST_DETECTOR_BUFFERS]) {
    out[0] = d->gain;
    out[1] = d->dark;
    out[2] = d->overlay;
    out[3] = d->offsets;
    out[4] = d->codes;
    out[5] = d->flags;
    out[6] = d->readout;
}

/* Adds the exposure's cosmic-ray deposits to the overlay (sign 1), or sets their pixels to 0 (sign
 * 0). */
static bst_status deposit(bst_ctx *ctx, bst_detector *d, float sign) {
    if (d->summary.pixels == 0) {
        return BST_OK;
    }
    /* a fixed work-group size avoids a new kernel build for each count */
    size_t local = BST_HIT_GROUP, global = ((size_t)d->summary.pixels + local - 1) / local * local;
    cl_int count = d->summary.pixels, stride = d->stride, rows = (cl_int)d->camera.height_px;
    const void *values[] = {&d->deposits, &sign, &d->overlay, &count, &stride, &rows};
    const size_t bytes[] = {sizeof(cl_mem), sizeof sign,   sizeof(cl_mem),
                            sizeof count,   sizeof stride, sizeof rows};
    cl_kernel k = d->deposit_kernel;
    for (cl_uint i = 0; i < 6; i++) {
        BST_TRY(bst_device_check(ctx, clSetKernelArg(k, i, bytes[i], values[i]),
                                 "setting a kernel argument"));
    }
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(d->queue, k, 1, NULL, &global, &local, 0, NULL, NULL),
        "placing radiation hits");
}

/* Draws and uploads the cosmic rays of an exposure. */
static bst_status begin_hits(bst_ctx *ctx, bst_detector *d, bst_upload_ring *stage, bst_rng_key key,
                             int64_t exposure_id, double collect_s) {
    const bst_cosmic_rays_pixel *pixels;
    BST_TRY(bst_cosmic_rays_draw(ctx, d->hits, key, exposure_id, collect_s, &pixels, &d->summary));
    size_t bytes = (size_t)d->summary.pixels * sizeof *pixels;
    BST_TRY(bst_upload_ring_put(ctx, stage, BST_STAGE_HITS, pixels, bytes, &d->deposits));
    return deposit(ctx, d, 1.0f);
}

/* Row offsets of an exposure that threads draw. */
typedef struct rows_to_draw {
    const float *fixed;
    float *sum;                  /* then the pick-up's amplitudes by row */
    int height, first;           /* of all rows, and the first one to draw */
    double rms, level;           /* DN */
    double amplitude;            /* of the pick-up, DN */
    double phase, phase_per_row; /* turns */
    bst_rng_key key;
    uint64_t exposure;
} rows_to_draw;

/* Draws those of some rows (callback). */
static void draw_rows(void *user, int begin, int end) {
    const rows_to_draw *all = user;
    for (int y = all->first + begin; y < all->first + end; y++) {
        double z = all->rms > 0.0 ? bst_rng_normal(all->key, all->exposure, (uint64_t)y) : 0.0;
        all->sum[y] = all->fixed[y] + (float)(all->level + all->rms * z);
        if (all->amplitude > 0.0) {
            double angle = 2.0 * BST_PI * (all->phase + all->phase_per_row * y);
            all->sum[all->height + y] = (float)(all->amplitude * sin(angle));
            all->sum[2 * all->height + y] = (float)(all->amplitude * cos(angle));
        }
    }
}

/* Time constants of the 1/f noise, in rows, each four times the one before: in between their sum
 * falls as 1/f within 6 % (Lorentzians of equal variance; Milotti 2002, arXiv physics/0204033). */
enum { FLICKER_TERMS = 6 };

/* Adds 1/f noise of the level to rows: first-order Markov processes that are stationary from row 0
 * on. */
static void add_flicker(const rows_to_draw *rows, int end, double rms, bst_rng_key key) {
    double state[FLICKER_TERMS] = {0}, decay[FLICKER_TERMS], share = rms / sqrt(FLICKER_TERMS);
    for (int k = 0; k < FLICKER_TERMS; k++) {
        decay[k] = exp(-1.0 / pow(4.0, k));
    }
    for (int y = 0; y < end; y++) {
        double sum = 0.0;
        for (int k = 0; k < FLICKER_TERMS; k++) {
            uint64_t draw = (uint64_t)y * FLICKER_TERMS + (uint64_t)k;
            double z = bst_rng_normal(key, rows->exposure, draw);
            state[k] = y == 0 ? z : decay[k] * state[k] + sqrt(1.0 - decay[k] * decay[k]) * z;
            sum += state[k];
        }
        rows->sum[y] += y < rows->first ? 0.0f : (float)(share * sum);
    }
}

/* Draws and uploads level and row offsets of an exposure, and the pick-up by row; those of other
 * rows than `read` stay as they were. */
static bst_status begin_rows(bst_ctx *ctx, bst_detector *d, bst_upload_ring *stage, uint64_t run,
                             int64_t exposure_id, bst_detector_rows read) {
    const bst_detector_config *c = &d->camera.detector;
    double per_e = 1.0 / d->camera.gain_e_per_dn;
    size_t height = (size_t)d->camera.height_px;
    size_t first = (size_t)d->stride, bytes = height * sizeof(float);
    float *sum = d->rows + height;
    enum { AT_ONCE = 512 };
    rows_to_draw rows = {.fixed = d->rows,
                         .sum = sum,
                         .height = (int)height,
                         .first = read.first,
                         .rms = c->row_noise_e / d->camera.gain_e_per_dn,
                         .level = c->offset_drift_dn_per_frame * (double)exposure_id,
                         .key = bst_rng_make_key(run, 0, "detector", "row_noise"),
                         .exposure = (uint64_t)exposure_id};
    bst_rng_key level = bst_rng_make_key(run, 0, "detector", "level");
    if (c->offset_noise_e > 0.0) {
        rows.level += c->offset_noise_e * per_e * bst_rng_normal(level, rows.exposure, 0);
    }
    if (c->pick_up.amplitude_e > 0.0) {
        first *= 3;
        bytes *= 3;
        rows.amplitude = c->pick_up.amplitude_e * per_e;
        rows.phase_per_row = c->pick_up.cycles_per_row;
        rows.phase = isfinite(c->pick_up.phase_deg) ? c->pick_up.phase_deg / 360.0
                                                    : bst_rng_uniform(level, rows.exposure, 1);
    }
    bst_parallel_for(d->pool, read.count, AT_ONCE, draw_rows, &rows);
    if (c->flicker_noise_e > 0.0) {
        add_flicker(&rows, read.first + read.count, c->flicker_noise_e * per_e,
                    bst_rng_make_key(run, 0, "detector", "flicker"));
    }
    cl_mem sent;
    BST_TRY(bst_upload_ring_put(ctx, stage, BST_STAGE_ROWS, sum, bytes, &sent));
    return bst_device_check(ctx,
                            clEnqueueCopyBuffer(d->queue, sent, d->offsets, 0,
                                                first * sizeof(float), bytes, 0, NULL, NULL),
                            "sending the rows' offsets");
}

bst_status bst_detector_begin(bst_ctx *ctx, bst_detector *d, bst_upload_ring *stage,
                              bst_rng_key key, int64_t exposure_id, double exposure_s,
                              bst_detector_rows read) {
    assert(d && stage && exposure_id >= 0 && exposure_s >= 0.0);
    assert(read.first >= 0 && read.count >= 0 && read.first + read.count <= d->camera.height_px);
    const bst_detector_config *c = &d->camera.detector;
    uint64_t run = ((uint64_t)key.k[1] << 32) | key.k[0];
    d->summary = (bst_cosmic_rays_summary){0};
    if (d->hits && c->ramp.reads == 0) {
        BST_TRY(begin_hits(ctx, d, stage, bst_rng_make_key(run, 0, "detector", "hits"), exposure_id,
                           exposure_s + c->cosmic_rays.readout_s));
    }
    if (has_frame_offsets(c)) {
        BST_TRY(begin_rows(ctx, d, stage, run, exposure_id, read));
    }
    return BST_OK;
}

bst_status bst_detector_interval(bst_ctx *ctx, bst_detector *d, bst_upload_ring *stage,
                                 bst_rng_key key, int64_t exposure_id, int interval,
                                 double interval_s) {
    assert(d && stage && exposure_id >= 0 && interval >= 0 && interval_s >= 0.0);
    if (!d->hits) {
        return BST_OK;
    }
    bst_cosmic_rays_summary before = d->summary;
    if (interval > 0) {
        BST_TRY(deposit(ctx, d, 0.0f));
    }
    uint64_t run = ((uint64_t)key.k[1] << 32) | key.k[0];
    BST_TRY(begin_hits(ctx, d, stage, bst_rng_make_key(run, (uint64_t)interval, "detector", "hits"),
                       exposure_id, interval_s));
    d->summary.tracks += before.tracks;
    d->summary.electrons += before.electrons;
    return BST_OK;
}

bst_status bst_detector_end(bst_ctx *ctx, bst_detector *d) {
    return deposit(ctx, d, 0.0f);
}

bst_cosmic_rays_summary bst_detector_hits(const bst_detector *d) {
    return d->summary;
}
