#include "scenegen/render_request.h"

#include <math.h>

#include "scenegen/detector/detector.h"
#include "sim/world/scene/skylight.h"

bst_status bst_render_camera_check(bst_ctx *ctx, const bst_camera *c) {
    if (c->width_px < 1 || c->height_px < 1 || c->width_px > 65536 || c->height_px > 65536 ||
        c->bits < 8 || c->bits > 16) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render %lld x %lld pixels of %lld bits: allowed are 1 to 65536 "
                        "pixels and 8 to 16 bits",
                        (long long)c->width_px, (long long)c->height_px, (long long)c->bits);
    }
    double fwhm_px = BST_FWHM_PER_SIGMA * bst_camera_psf_sigma_px(c);
    if (!(c->psf_fwhm_px > 0.0) || fwhm_px > 70.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render a PSF of psf_fwhm_px %g, with charge diffusion and fast "
                        "jitter %g: allowed are 0 to 70 pixels",
                        c->psf_fwhm_px, fwhm_px);
    }
    return BST_OK;
}

static bool covers(const bst_skylight_map *map, bst_window w) {
    return w.x0 >= map->x0_px && w.y0 >= map->y0_px &&
           w.x0 + w.width - 1 <= map->x0_px + (map->columns - 1) * map->step_px &&
           w.y0 + w.height - 1 <= map->y0_px + (map->rows - 1) * map->step_px;
}

bst_status bst_render_request_check(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_render_request *q) {
    bst_window w = q->window;
    if (w.x0 < 0 || w.y0 < 0 || w.width < 1 || w.height < 1 ||
        w.x0 + (int64_t)w.width > camera->width_px ||
        w.y0 + (int64_t)w.height > camera->height_px) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the window of %d x %d pixels at (%d, %d) is not inside the sensor of "
                        "%lld x %lld",
                        w.width, w.height, w.x0, w.y0, (long long)camera->width_px,
                        (long long)camera->height_px);
    }
    int binning = q->binning > 1 ? q->binning : 1;
    if (binning > w.width || binning > w.height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "binning %d does not fit a window of %d x %d pixels",
                        binning, w.width, w.height);
    }
    if (binning > 1 && bst_detector_has_pixel_flicker(&camera->detector)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "binning is %d, but the camera's detector/pixel_flicker_noise is that of "
                        "single pixels (allowed: 1)",
                        binning);
    }
    if (!(q->background_e >= 0.0) || !isfinite(q->background_e) || q->track->count < 2) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request needs a background that is finite and not negative (it is %g) "
                        "and two samples of the line of sight (there are %d)",
                        q->background_e, q->track->count);
    }
    if (q->row_time_s != 0.0 && camera->detector.row_time_s == 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request has row_time_s %g, but the camera's rows are exposed at once",
                        q->row_time_s);
    }
    if (q->background && !bst_skylight_may_vary(camera)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request has a map of the background, but the camera's background is the "
                        "same all over the sensor (bst_skylight_may_vary)");
    }
    if (q->background && !covers(q->background, bst_detector_light_window(camera, w))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request's map of the background does not cover its window, or that "
                        "window's whole columns where charge runs along them");
    }
    return BST_OK;
}

/* A zero background map, for requests without one. */
static const float nothing[4];
static const bst_skylight_map no_background = {
    .step_px = 1 << 16, .columns = 2, .rows = 2, .e = nothing};

const bst_skylight_map *bst_render_background(const bst_render_request *q) {
    return q->background ? q->background : &no_background;
}

double bst_render_exposure_s(const bst_render_request *q) {
    return q->row_time_s != 0.0 ? q->exposure_s : q->track->time_s[q->track->count - 1];
}

bst_kernel_frame_params bst_render_params(const bst_kernel_frame_params *fixed, const bst_camera *c,
                                          const bst_renderer_options *options,
                                          const bst_render_request *q, int sources) {
    const bst_skylight_map *map = bst_render_background(q);
    bst_window w = q->window;
    int x0 = w.x0 / 64 * 64;
    bst_kernel_frame_params p = *fixed;
    p.window_x0 = w.x0;
    p.window_y0 = w.y0;
    p.window_width = w.width;
    p.window_height = w.height;
    p.sensor_width = (int)c->width_px;
    p.tiles_x0 = x0;
    p.tiles_x = (w.x0 + w.width - x0 + options->tile_width - 1) / options->tile_width;
    p.tiles_y = (w.height + options->tile_height - 1) / options->tile_height;
    p.source_groups = (sources + BST_BLOCK - 1) / BST_BLOCK;
    p.sources = sources;
    p.key0 = q->key.k[0];
    p.key1 = q->key.k[1];
    p.exposure_low = (unsigned)((uint64_t)q->exposure_id & 0xFFFFFFFFu);
    p.exposure_high = (unsigned)((uint64_t)q->exposure_id >> 32);
    p.background_e = (float)q->background_e;
    p.dark_e = (float)q->dark_e;
    p.exposure_s = (float)bst_render_exposure_s(q);
    p.read_noise_e = (float)c->read_noise_e;
    p.full_well_e = (float)c->full_well_e;
    p.per_full_well = (float)(1.0 / c->full_well_e);
    p.near_full_e = (float)bst_detector_near_full_e(c->full_well_e);
    p.dn_per_e = (float)(1.0 / c->gain_e_per_dn);
    p.offset_dn = (float)c->offset_dn;
    p.max_dn = (float)((1 << c->bits) - 1);
    p.image_stride = w.width;
    p.map_step = map->step_px;
    p.map_x0 = map->x0_px;
    p.map_y0 = map->y0_px;
    p.map_columns = map->columns;
    p.map_rows = map->rows;
    return p;
}
