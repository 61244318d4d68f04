#include "scenegen/detector/readout_charge.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "scenegen/detector/fixed_pattern_noise.h"

bool bst_readout_charge_is_on(const bst_detector_config *d) {
    return d->readout_s > 0.0 || d->clock_induced_e > 0.0 || d->glow.peak_e > 0.0;
}

/* Dark current of all pixels, e-/s, uniform if the camera has no map. */
static bst_status dark_currents(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                bst_parallel *pool, int stride, float *dark) {
    if (bst_fixed_pattern_noise_has_dark(camera)) {
        return bst_fixed_pattern_noise_dark(ctx, camera, key, pool, stride, dark);
    }
    size_t count = (size_t)stride * (size_t)camera->height_px;
    for (size_t i = 0; i < count; i++) {
        dark[i] = (float)bst_camera_dark_e_per_s(camera);
    }
    return BST_OK;
}

bst_status bst_readout_charge_map(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                  bst_parallel *pool, int stride, float *map) {
    assert(camera && map && stride >= (int)camera->width_px);
    const bst_detector_config *d = &camera->detector;
    int width = (int)camera->width_px, height = (int)camera->height_px;
    int left = (int)d->overscan.left, right = width - (int)d->overscan.right;
    double row_s = d->readout_s / height;
    double *passed = calloc((size_t)width, sizeof *passed); /* dark current of the rows below */
    bst_status status = passed ? dark_currents(ctx, camera, key, pool, stride, map)
                               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a row of charge");
    for (int n = 0; status == BST_OK && n < height; n++) {
        int y = d->output.top ? height - 1 - n : n;
        bool real = y >= d->overscan.bottom && y < height - d->overscan.top;
        float *row = map + (size_t)y * (size_t)stride;
        for (int x = 0; x < width; x++) {
            double dark = (double)row[x], e = row_s * passed[x] + d->clock_induced_e;
            if (d->glow.peak_e > 0.0 && real) {
                double away_px = hypot(x - d->glow.x_px, y - d->glow.y_px);
                e += d->glow.peak_e * exp(-away_px / d->glow.scale_px);
            }
            row[x] = x >= left && x < right ? (float)e : 0.0f;
            passed[x] += dark;
        }
    }
    free(passed);
    return status;
}
