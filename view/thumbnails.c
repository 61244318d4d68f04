#include "view/thumbnails.h"

#include <stdlib.h>
#include <string.h>

#include "view/pixel_bins.h"
#include "view/recorded_run_internal.h"
#include "view/thumbnail_store.h"

/* Peaks of the bins of a frame, which is read in bands of rows. */
static bst_status take_peaks(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t frame,
                             int n, uint16_t *row, bst_view_thumbnail *one) {
    bst_fits_read_frame band = {.height = 1};
    uint16_t *out = one->data;
    for (int y = 0; y < band.height;) {
        BST_TRY(bst_view_read_rows(ctx, run, s, frame, y, 0, &band));
        const int most = bst_view_band_rows(band.width, n), left = band.height - y;
        const int rows = left < most ? left : most;
        BST_TRY(bst_view_read_rows(ctx, run, s, frame, y, rows, &band));
        bst_view_peak_pixels(band.pixels, band.width, rows, n, row, out);
        out += bst_view_bins(rows, n) * bst_view_bins(band.width, n);
        y += rows;
    }
    return BST_OK;
}

static bst_status make(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t sensor,
                       int64_t frame, const bst_view_thumbnail **out) {
    bst_fits_read_frame image;
    BST_TRY(bst_view_read_rows(ctx, run, s, frame, 0, 0, &image));
    bst_view_thumbnail *one = bst_view_thumbnails_place(&run->thumbnails);
    const int longest = image.width > image.height ? image.width : image.height;
    const int n = bst_view_bins(longest, BST_VIEW_THUMBNAIL_PX);
    uint16_t *row = one ? malloc((size_t)image.width * sizeof *row + 1) : NULL;
    if (!row) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a small picture");
    }
    bst_status status = take_peaks(ctx, run, s, frame, n, row, one);
    free(row);
    BST_TRY(status);
    one->sensor = sensor;
    one->fits_index = s->exposures[frame].fits_index;
    one->width = bst_view_bins(image.width, n);
    one->height = bst_view_bins(image.height, n);
    *out = one;
    return BST_OK;
}

/* Finds or makes a picture, and copies it. */
static bst_status copy(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                       bst_view_bytes *out) {
    bst_view_sensor *s;
    BST_TRY(bst_view_find_sensor(ctx, run, sensor, &s));
    const bool kept = frame >= 0 && (uint64_t)frame < s->count;
    const bst_view_thumbnail *one =
        kept ? bst_view_thumbnails_find(run->thumbnails, sensor, s->exposures[frame].fits_index)
             : NULL;
    if (!one) {
        BST_TRY(make(ctx, run, s, sensor, frame, &one));
    }
    out->bytes = (size_t)one->width * (size_t)one->height * sizeof *one->data;
    out->data = malloc(out->bytes + 1);
    if (!out->data) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a small picture");
    }
    memcpy(out->data, one->data, out->bytes);
    out->width = one->width;
    out->height = one->height;
    return BST_OK;
}

bst_status bst_view_run_thumbnail(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                                  bst_view_bytes *out) {
    *out = (bst_view_bytes){.data = NULL};
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? copy(ctx, run, sensor, frame, out) : status;
    bst_view_unlock(run);
    return status;
}
