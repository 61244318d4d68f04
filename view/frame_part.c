/* Parts of recorded frames, read in bands of rows. */
#include <stdlib.h>

#include "view/recorded_run_internal.h"

/* Pixels that are read at a time. */
enum { BAND_PIXELS = 1 << 20 };

int bst_view_band_rows(int width, int n) {
    const int bins = BAND_PIXELS / width / n;
    return (bins > 1 ? bins : 1) * n;
}

/* Reads the bands of a part that was fitted to the frame and bins them. */
static bst_status read_bands(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t frame,
                             const bst_view_part *part, uint32_t *sums, uint16_t *out) {
    const int n = (int)part->binning, width = (int)part->width;
    const int64_t end = part->y + part->height;
    bst_fits_read_frame band;
    BST_TRY(bst_view_read_rows(ctx, run, s, frame, 0, 0, &band));
    const int most = bst_view_band_rows(band.width, n), frame_width = band.width,
              frame_height = band.height;
    for (int64_t y = part->y; y < end;) {
        const int rows = end - y < most ? (int)(end - y) : most;
        BST_TRY(bst_view_read_rows(ctx, run, s, frame, (int)y, rows, &band));
        if (band.width != frame_width || band.height != frame_height) {
            return bst_fail(ctx, BST_ERR_IO, "frame %lld: changed while it was read",
                            (long long)frame);
        }
        for (int k = 0; k < rows; k += n) {
            bst_view_bin_row(band.pixels + (size_t)k * (size_t)band.width + part->x,
                             (size_t)band.width, width, rows - k < n ? rows - k : n, n, sums, out);
            out += bst_view_bins(width, n);
        }
        y += rows;
    }
    return BST_OK;
}

bst_status bst_view_begin_part(bst_ctx *ctx, bst_view_part *part, int width, int height,
                               bst_view_bytes *out) {
    if (!bst_view_fit_part(part, width, height)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the frame has %d x %d pixels: the part is not within it, or its binning "
                        "is wrong (allowed: 1 to %d)",
                        width, height, BST_VIEW_BINNING_MOST);
    }
    out->width = bst_view_bins(part->width, part->binning);
    out->height = bst_view_bins(part->height, part->binning);
    const size_t pixels = (size_t)out->width * (size_t)out->height;
    if (pixels > BST_VIEW_PIXELS_MOST) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%zu pixels (allowed: %d; ask for a part, or give longest or binning)",
                        pixels, BST_VIEW_PIXELS_MOST);
    }
    out->bytes = pixels * sizeof(uint16_t);
    out->binning = (int)part->binning;
    out->x = (int)part->x;
    out->y = (int)part->y;
    out->frame_width = width;
    out->frame_height = height;
    out->data = malloc(out->bytes);
    return out->data ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame");
}

static bst_status read_part(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t frame,
                            bst_view_part part, bst_view_bytes *out) {
    bst_fits_read_frame image;
    BST_TRY(bst_view_read_rows(ctx, run, s, frame, 0, 0, &image));
    BST_TRY(bst_view_begin_part(ctx, &part, image.width, image.height, out));
    uint32_t *sums = malloc((size_t)part.width * sizeof *sums);
    bst_status status = sums ? read_bands(ctx, run, s, frame, &part, sums, out->data)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame");
    free(sums);
    return status;
}

bst_status bst_view_run_pixels(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                               const bst_view_part *part, bst_view_bytes *out) {
    bst_view_sensor *s;
    *out = (bst_view_bytes){.data = NULL};
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? bst_view_find_sensor(ctx, run, sensor, &s) : status;
    status = status == BST_OK ? read_part(ctx, run, s, frame, *part, out) : status;
    bst_view_unlock(run);
    return status;
}
