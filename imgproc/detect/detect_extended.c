/* Extended targets of a frame: search, and the mask that keeps them from the detection of points.
 */
#include <math.h>
#include <string.h>

#include "imgproc/detect/detect_internal.h"
#include "sim/core/pages.h"

bst_status bst_imgproc_open_silhouettes(bst_ctx *ctx, bst_imgproc *ip) {
    if (!ip->config.extended.enabled) {
        return BST_OK;
    }
    int width = (int)ip->camera.width_px, height = (int)ip->camera.height_px;
    size_t pixels = (size_t)width * (size_t)height;
    BST_TRY(bst_silhouette_finder_create(ctx, width, height, &ip->finder));
    ip->silhouette_mask = bst_pages_zero(pixels, sizeof *ip->silhouette_mask);
    ip->masked = bst_pages_zero(pixels, sizeof *ip->masked);
    if (!ip->silhouette_mask || !ip->masked) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a mask of %d x %d", width, height);
    }
    return BST_OK;
}

void bst_imgproc_close_silhouettes(bst_imgproc *ip) {
    bst_silhouette_finder_free(&ip->finder);
    bst_pages_free(ip->silhouette_mask);
    bst_pages_free(ip->masked);
}

/* Combines bad pixels and the frame's mask, which may be binned, on the sensor. */
static void combine_masks(bst_imgproc *ip, const bst_imgproc_frame *frame) {
    size_t stride = (size_t)ip->camera.width_px;
    int b = frame->binning, width = frame->window.width / b, height = frame->window.height / b;
    if (ip->bad) {
        memcpy(ip->masked, ip->bad, stride * (size_t)ip->camera.height_px);
    } else {
        memset(ip->masked, 0, stride * (size_t)ip->camera.height_px);
    }
    for (int y = 0; y < height * b; y++) {
        const uint8_t *from = ip->silhouette_mask + (size_t)(y / b) * (size_t)width;
        uint8_t *to = ip->masked + (size_t)(frame->window.y0 + y) * stride + frame->window.x0;
        for (int x = 0; x < width * b; x++) {
            to[x] = to[x] || from[x / b];
        }
    }
}

const uint8_t *bst_imgproc_find_silhouettes(bst_imgproc *ip, const bst_imgproc_frame *frame,
                                            const bst_camera_motion *motion, double sigma_px,
                                            int saturated_dn) {
    const bst_camera *c = &ip->camera;
    const double read_e = bst_camera_read_noise_e(c);
    const bst_calibrate_pixels read = {c, &ip->maps, ip->bad, frame, NULL, NULL, 0};
    const bst_window *w = &frame->window;
    bst_silhouette_frame f = {
        .read = bst_calibrate_pixels_read,
        .user = &read,
        .raw = frame->pixels,
        .width = w->width / frame->binning,
        .height = w->height / frame->binning,
        .saturated_dn = saturated_dn,
        .full_e = (saturated_dn - c->offset_dn) * c->gain_e_per_dn,
        .read_variance_e2 = read_e * read_e + c->gain_e_per_dn * c->gain_e_per_dn / 12.0,
        .sigma_px = sigma_px,
        .wings = ip->known != NULL};
    if (motion) {
        bst_camera_motion_streak(motion, c, w->x0 + 0.5 * (w->width - 1),
                                 w->y0 + 0.5 * (w->height - 1), &f.streak_x_px, &f.streak_y_px);
        f.streak_x_px /= frame->binning;
        f.streak_y_px /= frame->binning;
    }
    memset(ip->silhouette_mask, 0, (size_t)f.width * (size_t)f.height);
    bst_silhouettes_find(&ip->finder, &ip->config.extended, &f, ip->silhouette_mask,
                         &ip->silhouettes);
    bool masked = false;
    for (int i = 0; i < ip->silhouettes.count; i++) {
        masked = masked || ip->silhouettes.items[i].masked;
    }
    if (!masked) {
        return ip->bad;
    }
    combine_masks(ip, frame);
    return ip->masked;
}

const bst_silhouettes *bst_imgproc_silhouettes(const bst_imgproc *ip) {
    return &ip->silhouettes;
}
