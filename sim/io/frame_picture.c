#include "sim/io/frame_picture.h"

#include <math.h>

#include "sim/io/marks_internal.h"

static const bst_io_colour black = {0, 0, 0}, white = BST_WHITE, soft = BST_SOFT;

static const bst_io_colour colours[] = {
    [BST_OVERLAY_TARGET] = BST_TARGET_COLOUR,    [BST_OVERLAY_OBJECT] = BST_SOFT,
    [BST_OVERLAY_STAR] = BST_STAR_COLOUR,        [BST_OVERLAY_REST] = BST_REST_COLOUR,
    [BST_OVERLAY_DETECTION] = BST_OBJECT_COLOUR, [BST_OVERLAY_TRACK] = BST_TRACK_COLOUR,
    [BST_OVERLAY_BORESIGHT] = BST_CROSS_COLOUR};

void bst_mark_cross(bst_picture *p, double x, double y, double gap, double arm) {
    const bst_io_colour colour = BST_CROSS_COLOUR;
    bst_picture_line(p, x - arm, y, x - gap, y, colour, 1.3);
    bst_picture_line(p, x + gap, y, x + arm, y, colour, 1.3);
    bst_picture_line(p, x, y - arm, x, y - gap, colour, 1.3);
    bst_picture_line(p, x, y + gap, x, y + arm, colour, 1.3);
}

void bst_mark_diamond(bst_picture *p, double x, double y, double r) {
    const bst_io_colour colour = BST_TRACK_COLOUR;
    const double dx[4] = {r, 0, -r, 0}, dy[4] = {0, r, 0, -r};
    for (int i = 0; i < 4; i++) {
        int j = (i + 1) % 4;
        bst_picture_line(p, x + dx[i], y + dy[i], x + dx[j], y + dy[j], colour, 1.6);
    }
}

/* Draws a mark at (x, y) of the picture; returns its extent to the right. */
static double draw_mark(bst_picture *p, bst_io_overlay_kind kind, double x, double y, double r) {
    switch (kind) {
        case BST_OVERLAY_TARGET:
        case BST_OVERLAY_OBJECT:
            r = fmax(r, 11.0);
            bst_picture_rectangle(p, x - r, y - r, 2 * r, 2 * r, colours[kind], 1.5);
            return r;
        case BST_OVERLAY_STAR:
        case BST_OVERLAY_REST:
        case BST_OVERLAY_DETECTION:
            r = fmax(r, 5.0);
            bst_picture_circle(p, x, y, r, colours[kind],
                               kind == BST_OVERLAY_DETECTION ? 1.5 : 1.0);
            return r;
        case BST_OVERLAY_TRACK:
            bst_mark_diamond(p, x, y, 18.0);
            return 18.0;
        case BST_OVERLAY_BORESIGHT:
            bst_mark_cross(p, x, y, 7.0, 16.0);
            return 16.0;
    }
    return 0.0;
}

/* Draws a streak about (x, y) as a line beside its light, or as the path that the stars share, with
 * a small circle at its place. */
static void draw_streak(bst_picture *p, const bst_io_overlay *overlay, const bst_io_overlay_mark *m,
                        double x, double y, double scale) {
    const bst_io_colour colour = colours[m->kind];
    bst_picture_circle(p, x, y, 3.0, colour, 1.0);
    if (!m->on_path) {
        double dx = m->half_x_px * scale, dy = m->half_y_px * scale;
        bst_picture_line(p, x - dx, y - dy, x + dx, y + dy, colour, 1.0);
        return;
    }
    for (int k = 1; k < overlay->path_count; k++) {
        const double *a = overlay->path_px[k - 1], *b = overlay->path_px[k];
        bst_picture_line(p, x + a[0] * scale, y + a[1] * scale, x + b[0] * scale, y + b[1] * scale,
                         colour, 1.0);
    }
}

/* Draws a line of text on a dark background, legible over stars. */
static double put_line(bst_picture *p, double x, double y, double height, bst_io_colour colour,
                       const char *text) {
    double width = bst_picture_text_width(height, false, text);
    bst_io_box ground = {(int)x - 3, (int)(y - height) - 4, (int)width + 6, (int)height + 8};
    bst_picture_fill(p, ground, black);
    bst_picture_text(p, x, y, height, colour, false, text);
    return width;
}

static void draw_legend(bst_picture *p, int width, int height, double h) {
    static const struct {
        bst_io_overlay_kind kind;
        const char *text;
    } entries[] = {
        {BST_OVERLAY_TARGET, "target (truth)"}, {BST_OVERLAY_OBJECT, "object (truth)"},
        {BST_OVERLAY_TRACK, "track"},           {BST_OVERLAY_DETECTION, "detection"},
        {BST_OVERLAY_STAR, "identified star"},  {BST_OVERLAY_REST, "at rest among stars"},
        {BST_OVERLAY_BORESIGHT, "boresight"}};
    double x = 10.0, y = height - 10.0;
    for (size_t i = 0; i < sizeof entries / sizeof *entries; i++) {
        double length = bst_picture_text_width(h, false, entries[i].text) + 16.0;
        if (x + length > width) {
            break;
        }
        x += put_line(p, x, y, h, colours[entries[i].kind], entries[i].text) + 16.0;
    }
}

static void draw_overlay(bst_picture *p, const bst_io_overlay *overlay, int width, int height,
                         bst_io_box box, double scale) {
    double h = fmin(fmax(width / 100.0, 7.0), 14.0); /* height of capital letters */
    bst_picture_clip(p, box);
    for (int i = overlay->count - 1; i >= 0; i--) {
        const bst_io_overlay_mark *m = &overlay->marks[i];
        if (!isfinite(m->x_px) || !isfinite(m->y_px)) {
            continue;
        }
        double x = box.x + (m->x_px + 0.5) * scale - 0.5, y = box.y + (m->y_px + 0.5) * scale - 0.5;
        bool streak = m->on_path || m->half_x_px != 0.0 || m->half_y_px != 0.0;
        double r = streak ? 5.0 : draw_mark(p, m->kind, x, y, m->radius_px * scale);
        if (streak) {
            draw_streak(p, overlay, m, x, y, scale);
        }
        if (m->label[0]) {
            /* a track's label is above, an object's below: their positions often coincide */
            double base = m->kind == BST_OVERLAY_TRACK ? y - 0.5 * r : y + 0.5 * r + 0.8 * h;
            bst_picture_text(p, x + fmax(r, 18.0) + 6.0, base, 0.8 * h, colours[m->kind], false,
                             m->label);
        }
    }
    bst_picture_unclip(p);
    if (overlay->caption) {
        put_line(p, 10.0, h + 10.0, h, white, overlay->caption);
    }
    draw_legend(p, width, height, 0.8 * h);
}

bst_status bst_frame_picture(bst_ctx *ctx, const bst_io_counts *counts, bst_io_stretch stretch,
                             const bst_io_overlay *overlay, int width, int height,
                             bst_picture **out) {
    const uint16_t *pixels = counts->pixels;
    int columns = counts->columns, rows = counts->rows;
    *out = NULL;
    if (columns < 1 || rows < 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "a frame without pixels");
    }
    double scale = fmin((double)width / columns, (double)height / rows);
    bst_io_box box = {.width = (int)fmax(1.0, floor(columns * scale + 0.5)),
                      .height = (int)fmax(1.0, floor(rows * scale + 0.5))};
    box.width = box.width < width ? box.width : width;
    box.height = box.height < height ? box.height : height;
    box.x = (width - box.width) / 2;
    box.y = (height - box.height) / 2;
    BST_TRY(bst_picture_create(ctx, width, height, black, out));
    bst_status status =
        bst_picture_frame(ctx, *out, box, pixels, columns, rows, 0, 0, columns, rows, stretch);
    if (status != BST_OK) {
        bst_picture_free(*out);
        *out = NULL;
        return status;
    }
    if (box.width < width || box.height < height) {
        bst_picture_rectangle(*out, box.x - 1, box.y - 1, box.width + 1, box.height + 1, soft, 1.0);
    }
    if (overlay) {
        draw_overlay(*out, overlay, width, height, box, scale);
    }
    return BST_OK;
}
