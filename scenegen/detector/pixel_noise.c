#include "scenegen/detector/pixel_noise.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/detector/saved_floats.h"

_Static_assert(BST_FLICKER_KINDS == BST_FLICKER_TERMS, "the kernel has room for all processes");

bst_status bst_pixel_noise_prepare(bst_ctx *ctx, bst_pixel_noise *n, bst_device *device,
                                   const bst_detector_config *detector, size_t pixels) {
    assert(n && device && detector);
    if (n->state) {
        return BST_OK;
    }
    cl_context context = bst_device_context(device);
    bst_pixel_flicker_begin(detector, &n->flicker);
    n->bytes = (size_t)n->flicker.terms * pixels * sizeof(float);
    float *none = calloc(1, n->bytes);
    if (!none) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the 1/f noise of the pixels");
    }
    bst_status status = bst_device_buffer(ctx, context, n->bytes, none,
                                          "allocating the 1/f noise of the pixels", &n->state);
    free(none);
    BST_TRY(status);
    return bst_device_buffer(ctx, context, pixels * sizeof(float), NULL,
                             "allocating the read noise of a frame", &n->noise);
}

bst_kernel_flicker_params bst_pixel_noise_begin(bst_pixel_noise *n, const bst_camera *camera,
                                                const bst_kernel_frame_params *frame,
                                                double read_s) {
    assert(n && camera && frame && isfinite(read_s));
    bst_pixel_flicker_step step;
    bst_pixel_flicker_advance(&n->flicker, read_s, camera->detector.double_sampling_s,
                              bst_camera_white_noise_e(camera), &step);
    bst_kernel_flicker_params t = {
        .frame = *frame, .terms = step.terms, .spread = (float)step.spread};
    for (int k = 0; k < step.terms; k++) {
        t.weight[k] = (float)step.weight[k];
        t.decay[k] = (float)step.decay[k];
        t.gain[k] = (float)step.gain[k];
    }
    return t;
}

bst_status bst_pixel_noise_archive(bst_pixel_noise *n, bst_device *device,
                                   const bst_detector_config *detector, size_t pixels,
                                   bst_archive *archive) {
    assert(n && device && detector && archive);
    bst_ctx *ctx = bst_archive_ctx(archive);
    bool some = n->state != NULL;
    bst_archive_bool(archive, &some);
    if (bst_archive_is_restoring(archive)) {
        bst_pixel_noise_clear(n);
    }
    if (!some) {
        return BST_OK;
    }
    BST_TRY(bst_pixel_noise_prepare(ctx, n, device, detector, pixels));
    bst_pixel_flicker *f = &n->flicker;
    bool good = true;
    BST_ARCHIVE(archive, f->time_s);
    BST_ARCHIVE(archive, f->covariance);
    for (int i = 0; i < f->terms; i++) {
        for (int j = 0; j < f->terms; j++) {
            good = good && fabs(f->covariance[i][j]) <= 2.0 * f->variance_e2;
        }
    }
    if (!good || !isfinite(f->time_s)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the saved state has an impossible 1/f noise of the pixels (allowed: "
                        "finite times, covariances up to that of the noise)");
    }
    return bst_saved_floats(archive, device, n->state, n->bytes, -1e9, 1e9,
                            "1/f noise of the pixels");
}

void bst_pixel_noise_clear(bst_pixel_noise *n) {
    if (n->state) {
        clReleaseMemObject(n->state);
    }
    if (n->noise) {
        clReleaseMemObject(n->noise);
    }
    *n = (bst_pixel_noise){0};
}
