/* Collection of bad-pixel evidence by the detector. */
#include "imgproc/detect/detect_internal.h"

bst_status bst_imgproc_collect_shows(bst_ctx *ctx, bst_imgproc *ip, int capacity) {
    return bst_pixel_shows_create(ctx, capacity, &ip->shows);
}

void bst_imgproc_use_map(bst_imgproc *ip, const bst_pixel_map *map) {
    ip->map = map;
}

const bst_pixel_shows *bst_imgproc_shows(const bst_imgproc *ip) {
    return &ip->shows;
}

void bst_imgproc_begin_shows(bst_imgproc *ip) {
    ip->shows.count = ip->shows.check_count = ip->shows.maxima = 0;
    ip->shows.pixels = 0.0;
    ip->shows.usable = ip->shows.capacity > 0;
}

void bst_imgproc_add_shows(bst_imgproc *ip, const bst_imgproc_frame *frame,
                           const bst_imgproc_frame *whole) {
    ip->shows.usable = ip->shows.usable && !ip->smeared;
    if (!ip->shows.usable) {
        return;
    }
    bst_calibrate_pixels read = {&ip->camera,
                                 &ip->maps,
                                 ip->bad,
                                 frame,
                                 NULL,
                                 ip->columns.count > 0 ? &ip->columns : NULL,
                                 (frame->window.x0 - whole->window.x0) / frame->binning};
    bst_locate_prepare(&ip->locator, &ip->view);
    bst_pixel_shows_add(&ip->shows, &ip->locator, &ip->view, &ip->candidates);
    if (ip->map) {
        bst_pixel_map_check(ip->map, &ip->view, &frame->window, bst_calibrate_pixels_read, &read,
                            &ip->shows);
    }
    ip->shows.pixels += (double)ip->view.width * ip->view.height;
}
