#include "scenegen/detector/persistence.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/detector/saved_floats.h"

double bst_persistence_fill(double x) {
    assert(x >= 0.0);
    /* the closed form loses digits as 1e-16 / x, the series' first neglected term is x^4 / 120 */
    return x < 1e-3 ? x * (0.5 - x * (1.0 / 6.0 - x / 24.0)) : 1.0 + expm1(-x) / x;
}

static int kinds_of(const bst_detector_config *d) {
    int kinds = 0;
    for (int i = 0; i < BST_PERSISTENCE_SPECIES; i++) {
        kinds += d->persistence.trapped_share[i] > 0.0;
    }
    return kinds;
}

bst_status bst_persistence_prepare(bst_ctx *ctx, bst_persistence *p, bst_device *device,
                                   const bst_detector_config *d, size_t pixels) {
    assert(p && device && d);
    if (p->trapped) {
        return BST_OK;
    }
    size_t bytes = (size_t)kinds_of(d) * pixels * sizeof(float);
    float *none = calloc(1, bytes);
    if (!none) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the trapped charge of the pixels");
    }
    bst_status status =
        bst_device_buffer(ctx, bst_device_context(device), bytes, none,
                          "allocating the trapped charge of the pixels", &p->trapped);
    free(none);
    p->bytes = status == BST_OK ? bytes : 0;
    return status;
}

bst_kernel_persistence_params bst_persistence_begin(bst_persistence *p,
                                                    const bst_detector_config *d,
                                                    const bst_kernel_frame_params *frame,
                                                    double start_s) {
    assert(p && d && frame && isfinite(start_s));
    bst_kernel_persistence_params t = {.frame = *frame};
    double exposure_s = (double)frame->exposure_s, gap_s = fmax(start_s - p->end_s, 0.0);
    for (int i = 0; i < BST_PERSISTENCE_SPECIES; i++) {
        double tau_s = d->persistence.time_constant_s[i];
        if (d->persistence.trapped_share[i] > 0.0) {
            t.share[t.kinds] = (float)d->persistence.trapped_share[i];
            t.gap[t.kinds] = (float)exp(-gap_s / tau_s);
            t.stay[t.kinds] = (float)exp(-exposure_s / tau_s);
            t.fill[t.kinds] = (float)bst_persistence_fill(exposure_s / tau_s);
            t.duration[t.kinds++] = (float)(exposure_s / tau_s);
        }
    }
    p->end_s = fmax(start_s, p->end_s) + exposure_s;
    return t;
}

bst_status bst_persistence_archive(bst_persistence *p, bst_device *device,
                                   const bst_detector_config *d, size_t pixels,
                                   bst_archive *archive) {
    assert(p && device && d && archive);
    bst_ctx *ctx = bst_archive_ctx(archive);
    bool some = p->trapped != NULL, restoring = bst_archive_is_restoring(archive);
    bst_archive_bool(archive, &some);
    BST_ARCHIVE(archive, p->end_s);
    if (restoring) {
        bst_persistence_clear(p);
        if (!isfinite(p->end_s)) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "the saved state has an exposure that ended at %g s (allowed: finite)",
                            p->end_s);
        }
    }
    if (!some) {
        return BST_OK;
    }
    BST_TRY(bst_persistence_prepare(ctx, p, device, d, pixels));
    return bst_saved_floats(archive, device, p->trapped, p->bytes, 0.0, 1e9,
                            "trapped charge of the pixels");
}

void bst_persistence_clear(bst_persistence *p) {
    if (p->trapped) {
        clReleaseMemObject(p->trapped);
    }
    p->trapped = NULL;
    p->bytes = 0;
}
