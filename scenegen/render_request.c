#include "scenegen/render_request.h"

#include <math.h>

#include "sim/world/skylight.h"

bst_status bst_render_camera_check(bst_ctx *ctx, const bst_camera *c) {
    if (c->width_px < 1 || c->height_px < 1 || c->width_px > 65536 || c->height_px > 65536 ||
        c->bits < 8 || c->bits > 16) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render %lld x %lld pixels of %lld bits: allowed are 1 to 65536 "
                        "pixels and 8 to 16 bits",
                        (long long)c->width_px, (long long)c->height_px, (long long)c->bits);
    }
    if (!(c->psf_fwhm_px > 0.0) || c->psf_fwhm_px > 70.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "cannot render a PSF of psf_fwhm_px %g: allowed are 0 to 70 pixels",
                        c->psf_fwhm_px);
    }
    return BST_OK;
}

/* The pixels whose light a frame of a window takes. */
static bst_window columns_of(const bst_camera *camera, bst_window w) {
    if (bst_detector_config_whole_columns(&camera->detector)) {
        w.y0 = 0;
        w.height = (int)camera->height_px;
    }
    return w;
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
    if (!(q->background_e >= 0.0) || !isfinite(q->background_e) || q->track->count < 2) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request needs a background that is finite and not negative (it is %g) "
                        "and two samples of the line of sight (there are %d)",
                        q->background_e, q->track->count);
    }
    if (q->background && !bst_skylight_varies(camera)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request has a map of the background, but the camera's background is the "
                        "same all over the sensor (bst_skylight_varies)");
    }
    if (q->background && !covers(q->background, columns_of(camera, w))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a request's map of the background does not cover its window, or that "
                        "window's whole columns where charge runs along them");
    }
    return BST_OK;
}
