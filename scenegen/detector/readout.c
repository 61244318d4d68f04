#include "scenegen/detector/readout.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>

#include "bst_scenegen_kernels.h"
#include "scenegen/scene_kernels.h"

enum { TRANSFER, CHARGE, BLOOM, READ, KERNELS };

struct bst_readout {
    bst_camera camera;
    bst_device *device;
    cl_context context;
    cl_command_queue queue;
    cl_kernel kernels[KERNELS];
    cl_mem image, over;
    size_t bytes;
};

/* True if the camera needs a kernel of the staged read-out. */
static bool wanted(const bst_readout *r, int kernel) {
    const bst_detector_config *d = &r->camera.detector;
    return kernel == TRANSFER ? d->frame_transfer_s > 0.0
                              : kernel != BLOOM || d->saturation == BST_WELL_BLOOM;
}

bst_status bst_readout_prepare(bst_ctx *ctx, bst_readout *r) {
    static const char *const names[KERNELS] = {"bst_detector_transfer", "bst_detector_charge",
                                               "bst_detector_bloom", "bst_detector_read"};
    static const bst_device_kernel_source *const sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes,    &bst_kernel_random,   &bst_kernel_chunk,
        &bst_kernel_read_tail,    &bst_kernel_detector, &bst_kernel_store_dn, &bst_kernel_readout};
    char options[64];
    snprintf(options, sizeof options, "-cl-std=CL1.2%s", bst_detector_tail_options(&r->camera));
    for (int i = 0; i < KERNELS; i++) {
        if (wanted(r, i) && !r->kernels[i]) {
            BST_TRY(bst_scene_kernel(ctx, r->device, sources, sizeof sources / sizeof *sources,
                                     options, names[i], &r->kernels[i]));
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
    clReleaseCommandQueue(r->queue);
    clReleaseContext(r->context);
    free(r);
}

bst_window bst_readout_light_window(const bst_readout *r, bst_window window) {
    bst_window light = window;
    light.x0 = window.x0 / 64 * 64;
    light.width = window.x0 + window.width - light.x0;
    if (wanted(r, TRANSFER) || wanted(r, BLOOM)) {
        light.y0 = 0;
        light.height = (int)r->camera.height_px;
    }
    return light;
}

/* Row stride of an image, floats. */
static int stride_of(int width) {
    return (width + 63) / 64 * 64;
}

bst_status bst_readout_image(bst_ctx *ctx, bst_readout *r, bst_window light, cl_mem *image,
                             int *stride) {
    *stride = stride_of(light.width);
    size_t bytes = (size_t)*stride * (size_t)light.height * sizeof(float);
    if (bytes > r->bytes) {
        cl_mem *buffers[2] = {&r->image, &r->over};
        for (int i = 0; i < (wanted(r, BLOOM) ? 2 : 1); i++) {
            if (*buffers[i]) {
                clReleaseMemObject(*buffers[i]);
            }
            *buffers[i] = NULL;
            BST_TRY(bst_device_buffer(ctx, r->context, bytes, NULL, "allocating an image of charge",
                                      buffers[i]));
        }
        r->bytes = bytes;
    }
    *image = r->image;
    return BST_OK;
}

/* Enqueues a kernel whose arguments are the frame parameters and buffers. */
static bst_status enqueue_kernel(bst_ctx *ctx, bst_readout *r, int kernel,
                                 const bst_kernel_frame_params *p, const cl_mem *buffers,
                                 cl_uint count, size_t items) {
    cl_kernel k = r->kernels[kernel];
    const size_t local = BST_READOUT_GROUP, global = (items + local - 1) / local * local;
    BST_TRY(bst_device_check(ctx, clSetKernelArg(k, 0, sizeof *p, p), "setting a kernel argument"));
    for (cl_uint i = 0; i < count; i++) {
        BST_TRY(bst_device_check(ctx, clSetKernelArg(k, i + 1, sizeof(cl_mem), &buffers[i]),
                                 "setting a kernel argument"));
    }
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(r->queue, k, 1, NULL, &global, &local, 0, NULL, NULL),
        "reading a frame out");
}

bst_status bst_readout_run(bst_ctx *ctx, bst_readout *r, const bst_detector *detector,
                           const bst_kernel_frame_params *params, bst_window window, int binning,
                           cl_mem frame, cl_mem saturated) {
    assert(r && detector && params && window.width > 0 && window.height > 0);
    BST_TRY(bst_readout_prepare(ctx, r));
    bst_window light = bst_readout_light_window(r, window);
    bst_kernel_frame_params p = *params;
    cl_mem maps[BST_DETECTOR_BUFFERS];
    bst_detector_buffers(detector, maps);
    p.tiles_x0 = light.x0;
    p.light_y0 = light.y0;
    p.light_height = light.height;
    p.light_stride = stride_of(light.width);
    p.binning = binning;
    p.window_width = window.width / binning;
    p.window_height = window.height / binning;
    size_t columns = (size_t)p.light_stride, rows = (size_t)p.light_height;
    if (wanted(r, TRANSFER)) {
        cl_mem b[] = {r->image, maps[0]};
        BST_TRY(enqueue_kernel(ctx, r, TRANSFER, &p, b, 2, columns / 64));
    }
    cl_mem charge[] = {r->image, maps[0], maps[1], maps[2]};
    BST_TRY(enqueue_kernel(ctx, r, CHARGE, &p, charge, 4, rows));
    if (wanted(r, BLOOM)) {
        cl_mem b[] = {r->image, r->over};
        BST_TRY(enqueue_kernel(ctx, r, BLOOM, &p, b, 2, columns / 16));
    }
    p.per_full_well /= (float)(binning * binning);
    cl_mem read[] = {r->image, frame, saturated, maps[3], maps[4], maps[5]};
    return enqueue_kernel(ctx, r, READ, &p, read, 6, (size_t)p.window_height);
}
