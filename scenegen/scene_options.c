#include "scenegen/scene_options.h"

#include <stdio.h>

#include "scenegen/detector/vignetting.h"
#include "scenegen/stamp/fixed_point_px.h"
#include "sim/world/scene/skylight.h"

void bst_scene_build_options(const bst_camera *camera, const bst_renderer_options *settings,
                             int taps, int law_degree, bool fourier, const bst_detector *detector,
                             char *text, size_t bytes) {
    int length =
        snprintf(text, bytes, "-cl-std=CL1.2 -DTILE_W=%d -DTILE_H=%d -DGROUP=%d -DTAPS=%d%s%s%s",
                 settings->tile_width, settings->tile_height, settings->group, taps,
                 fourier ? " -DFOURIER" : "", settings->group == 1 ? " -DNEAR_CACHE" : "",
                 bst_skylight_may_vary(camera) ? " -DBACKGROUND" : "");
    if (law_degree > 0) {
        length += snprintf(text + length, bytes - (size_t)length, " -DDEGREE=%d", law_degree);
    }
    length += bst_vignetting_options(camera, text + length, bytes - (size_t)length);
    length += bst_detector_options(detector, text + length, bytes - (size_t)length);
    bst_scene_node_options(camera, settings->spatial_oversample, text + length,
                           bytes - (size_t)length);
}

void bst_scene_node_options(const bst_camera *camera, int spatial_oversample, char *text,
                            size_t bytes) {
    int length = snprintf(text, bytes, " -DPLACE_BITS=%d", bst_fixed_point_px_bits(camera));
    if (spatial_oversample > 0) {
        length += snprintf(text + length, bytes - (size_t)length, " -DSPATIAL_OVERSAMPLE=%d",
                           spatial_oversample);
    }
    const bst_camera_distortion *d = &camera->distortion;
    if (bst_camera_distorted(camera)) {
        double a = bst_camera_scale_rad(camera), a2 = a * a, out = camera->geometry.domain / a;
        snprintf(
            text + length, bytes - (size_t)length,
            " -DDISTORTED -DK1=%.9ef -DK2=%.9ef -DK3=%.9ef -DP1=%.9ef -DP2=%.9ef -DFOLD2=%.9ef",
            d->k1 * a2, d->k2 * a2 * a2, d->k3 * a2 * a2 * a2, d->p1 * a, d->p2 * a, out * out);
    }
}
