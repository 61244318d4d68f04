#include "scenegen/scene_options.h"

#include <stdio.h>

#include "scenegen/stamp/fixed_point_px.h"

void bst_scene_tile_options(const bst_renderer_options *settings, int taps, int law_degree,
                            bool fourier, char *text, size_t bytes) {
    /* the Fourier path draws no stamps: one program for all of its PSFs */
    int length = snprintf(text, bytes, "-cl-std=CL1.2 -DTILE_W=%d -DTILE_H=%d -DTAPS=%d%s%s",
                          settings->tile_width, settings->tile_height, fourier ? 16 : taps,
                          fourier ? " -DFOURIER" : "",
                          settings->group == 0   ? " -DONE_LANE"
                          : settings->group == 1 ? " -DNEAR_CACHE"
                                                 : "");
    if (settings->group > 0) {
        length += snprintf(text + length, bytes - (size_t)length, " -DGROUP=%d", settings->group);
    }
    if (law_degree > 0) {
        snprintf(text + length, bytes - (size_t)length, " -DDEGREE=%d", law_degree);
    }
}

bst_kernel_node_params bst_scene_node_params(const bst_camera *camera, int spatial_oversample) {
    int bits = bst_fixed_point_px_bits(camera);
    float parts = (float)(1 << bits), subpixels = (float)spatial_oversample;
    bst_kernel_node_params p = {.place_bits = bits, .parts = parts, .per_parts = 1.0f / parts};
    if (spatial_oversample > 0) {
        p.subpixels = subpixels;
        p.per_subpixels = 1.0f / subpixels;
    }
    if (bst_camera_distorted(camera)) {
        const bst_camera_distortion *d = &camera->distortion;
        double a = bst_camera_scale_rad(camera), a2 = a * a, out = camera->geometry.domain / a;
        p.distorted = 1;
        p.k1 = (float)(d->k1 * a2);
        p.k2 = (float)(d->k2 * a2 * a2);
        p.k3 = (float)(d->k3 * a2 * a2 * a2);
        p.p1 = (float)(d->p1 * a);
        p.p2 = (float)(d->p2 * a);
        p.fold2 = (float)(out * out);
    }
    return p;
}
