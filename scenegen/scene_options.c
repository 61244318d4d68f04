#include "scenegen/scene_options.h"

#include <stdio.h>

#include "scenegen/vignetting.h"
#include "sim/world/skylight.h"

void bst_scene_build_options(const bst_camera *camera, const bst_renderer_options *settings,
                             int taps, int phases, bool fft_light, const bst_detector *detector,
                             char *text, size_t bytes) {
    int length = snprintf(text, bytes,
                          "-cl-std=CL1.2 -DTILE_W=%d -DTILE_H=%d -DGROUP=%d -DTAPS=%d "
                          "-DPHASES=%d%s%s",
                          settings->tile_width, settings->tile_height, settings->group, taps,
                          phases, fft_light ? " -DFFT_LIGHT" : "",
                          bst_skylight_varies(camera) ? " -DBACKGROUND" : "");
    length += bst_vignetting_options(camera, text + length, bytes - (size_t)length);
    length += bst_detector_options(detector, text + length, bytes - (size_t)length);
    if (settings->spatial_oversample > 0) {
        length += snprintf(text + length, bytes - (size_t)length, " -DSPATIAL_OVERSAMPLE=%d",
                           settings->spatial_oversample);
    }
    const bst_distortion *d = &camera->distortion;
    if (bst_camera_distorted(camera)) {
        double a = bst_camera_scale_rad(camera), a2 = a * a, out = camera->geometry.domain / a;
        snprintf(
            text + length, bytes - (size_t)length,
            " -DDISTORTED -DK1=%.9ef -DK2=%.9ef -DK3=%.9ef -DP1=%.9ef -DP2=%.9ef -DFOLD2=%.9ef",
            d->k1 * a2, d->k2 * a2 * a2, d->k3 * a2 * a2 * a2, d->p1 * a, d->p2 * a, out * out);
    }
}
