#include "imgproc/calibrate/reference_pixels.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

const bst_config_desc bst_reference_pixels_config_table[] = {
    BST_BOOL(bst_reference_pixels_config, enabled, "false",
             "Take the level of the reference pixels, the onboard camera's detector/overscan, off "
             "each frame, and leave them out."),
    BST_INT(bst_reference_pixels_config, smooth_rows, "", 0, 10000, "0",
            "Rows on either side whose reference columns count for a row."),
    BST_BOOL(bst_reference_pixels_config, alternating_columns, "true",
             "Take the level of even and of odd columns off by the reference rows, where there are "
             "any."),
    BST_CONFIG_END,
};

void bst_reference_pixels_free(bst_reference_pixels *r) {
    free(r->pixels);
    free(r->sum);
    free(r->count);
    *r = (bst_reference_pixels){0};
}

static bst_status reserve(bst_ctx *ctx, bst_reference_pixels *r, size_t pixels, size_t rows) {
    if (pixels <= r->capacity && rows <= r->rows) {
        return BST_OK;
    }
    bst_reference_pixels_free(r);
    r->pixels = malloc(pixels * sizeof *r->pixels);
    r->sum = malloc((rows + 1) * sizeof *r->sum);
    r->count = malloc((rows + 1) * sizeof *r->count);
    if (!r->pixels || !r->sum || !r->count) {
        bst_reference_pixels_free(r);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the reference pixels of %zu rows",
                        rows);
    }
    r->capacity = pixels;
    r->rows = rows;
    return BST_OK;
}

/* Part of a window, columns x0 to x1 and rows y0 to y1 of the frame, that has light. */
typedef struct inside {
    int x0, x1, y0, y1;
} inside;

static int between(int64_t v, int most) {
    return v < 0 ? 0 : v > most ? most : (int)v;
}

static inside lit_part(const bst_camera *camera, bst_window w) {
    const bst_detector_edges_config *o = &camera->detector.overscan;
    return (inside){
        between(o->left - w.x0, w.width), between(camera->width_px - o->right - w.x0, w.width),
        between(o->bottom - w.y0, w.height), between(camera->height_px - o->top - w.y0, w.height)};
}

/* Level of even and odd columns over the offset, by the reference rows. */
static void column_levels(const bst_imgproc_frame *frame, const inside *lit, double offset_dn,
                          double level[2]) {
    int width = frame->window.width;
    double sum[2] = {0.0, 0.0};
    int64_t count[2] = {0, 0};
    for (int y = 0; y < frame->window.height; y++) {
        if (y >= lit->y0 && y < lit->y1) {
            continue;
        }
        const uint16_t *row = frame->pixels + (size_t)y * (size_t)width;
        for (int x = lit->x0; x < lit->x1; x++) {
            sum[(frame->window.x0 + x) & 1] += row[x];
            count[(frame->window.x0 + x) & 1]++;
        }
    }
    for (int k = 0; k < 2; k++) {
        level[k] = count[k] > 0 ? sum[k] / (double)count[k] - offset_dn : 0.0;
    }
    if (count[0] == 0 || count[1] == 0) {
        level[0] = level[1] = 0.0;
    }
}

/* Running sums of the rows' reference columns, without the level of their columns. */
static void sum_rows(bst_reference_pixels *r, const bst_imgproc_frame *frame, const inside *lit,
                     const double level[2]) {
    int width = frame->window.width;
    r->sum[0] = 0.0;
    r->count[0] = 0;
    for (int y = 0; y < frame->window.height; y++) {
        const uint16_t *row = frame->pixels + (size_t)y * (size_t)width;
        double sum = 0.0;
        int count = 0;
        for (int x = 0; x < width; x++) {
            x = x == lit->x0 && lit->x1 > lit->x0 ? lit->x1 : x; /* over the lit pixels */
            if (x < width) {
                sum += row[x] - level[(frame->window.x0 + x) & 1];
                count++;
            }
        }
        r->sum[y + 1] = r->sum[y] + sum;
        r->count[y + 1] = r->count[y] + count;
    }
}

bst_status bst_reference_pixels_subtract(bst_ctx *ctx, bst_reference_pixels *r,
                                         const bst_reference_pixels_config *config,
                                         const bst_camera *camera, const bst_imgproc_frame *frame,
                                         bst_imgproc_frame *out) {
    assert(r && config && camera && frame && frame->pixels && out);
    const bst_window w = frame->window;
    const inside lit = lit_part(camera, w);
    *out = *frame;
    bool any = lit.x0 > 0 || lit.x1 < w.width || lit.y0 > 0 || lit.y1 < w.height;
    if (!config->enabled || !any || frame->binning > 1) {
        return BST_OK;
    }
    BST_TRY(reserve(ctx, r, (size_t)w.width * (size_t)w.height, (size_t)w.height));
    double level[2] = {0.0, 0.0};
    if (config->alternating_columns) {
        column_levels(frame, &lit, camera->offset_dn, level);
    }
    sum_rows(r, frame, &lit, level);
    const int top = (1 << frame->bits) - 1, smooth = (int)config->smooth_rows;
    for (int y = 0; y < w.height; y++) {
        int from = y > smooth ? y - smooth : 0;
        int to = y + smooth + 1 < w.height ? y + smooth + 1 : w.height;
        int count = r->count[to] - r->count[from];
        double row = count > 0 ? (r->sum[to] - r->sum[from]) / count - camera->offset_dn : 0.0;
        const float off[2] = {(float)(row + level[0]), (float)(row + level[1])};
        const uint16_t *in = frame->pixels + (size_t)y * (size_t)w.width;
        uint16_t *line = r->pixels + (size_t)y * (size_t)w.width;
        for (int x = 0; x < w.width; x++) {
            float v = (float)in[x] - off[(w.x0 + x) & 1] + 0.5F;
            v = v < 0.0F ? 0.0F : v > (float)top ? (float)top : v;
            line[x] = in[x] >= top ? in[x] : (uint16_t)v;
        }
    }
    out->pixels = r->pixels;
    return BST_OK;
}

bst_status bst_reference_pixels_mask(bst_ctx *ctx, const bst_reference_pixels_config *config,
                                     const bst_camera *camera, uint8_t **bad) {
    int width = (int)camera->width_px, height = (int)camera->height_px;
    const inside lit = lit_part(camera, (bst_window){0, 0, width, height});
    if (!config->enabled) {
        return BST_OK;
    }
    if (lit.x0 == 0 && lit.x1 == width && lit.y0 == 0 && lit.y1 == height) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "reference_pixels/enabled: is true, but the onboard camera has no "
                        "reference pixels; give detector/overscan, or set it to false");
    }
    if (!*bad) {
        *bad = calloc((size_t)width, (size_t)height);
        if (!*bad) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a bad-pixel map");
        }
    }
    for (int y = 0; y < height; y++) {
        uint8_t *row = *bad + (size_t)y * (size_t)width;
        bool inside_rows = y >= lit.y0 && y < lit.y1;
        memset(row, 1, (size_t)(inside_rows ? lit.x0 : width));
        if (inside_rows) {
            memset(row + lit.x1, 1, (size_t)(width - lit.x1));
        }
    }
    return BST_OK;
}
