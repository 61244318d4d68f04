#include "sim/io/quicklook.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "sim/io/marks_internal.h"

#define PANEL 640 /* width and maximum height of a panel */
#define MARGIN 20
#define HEAD 58    /* title */
#define CAPTION 58 /* above each panel */
#define LEGEND 44  /* below */
#define LEGEND_ROW 24
#define INSET 208   /* side of the inset */
#define INSET_PX 48 /* frame pixels per side of the inset */

static const bst_io_colour ground = {16, 20, 28}, white = BST_WHITE, soft = BST_SOFT,
                           target_colour = BST_TARGET_COLOUR, track_colour = BST_TRACK_COLOUR,
                           object_colour = BST_OBJECT_COLOUR, star_colour = BST_STAR_COLOUR,
                           rest_colour = BST_REST_COLOUR;

/* Mapping from frame pixels to picture pixels in one view. */
typedef struct view {
    bst_io_box box;
    double x0, y0; /* frame pixel coordinates of the box's outer corner */
    double scale;  /* picture pixels per frame pixel */
} view;

static double view_x(const view *v, double x_px) {
    return v->box.x + (x_px - v->x0) * v->scale - 0.5;
}
static double view_y(const view *v, double y_px) {
    return v->box.y + (y_px - v->y0) * v->scale - 0.5;
}

static int by_importance(const void *a, const void *b) {
    const bst_io_mark *p = a, *q = b;
    return (p->importance < q->importance) - (p->importance > q->importance);
}

void bst_io_mark_sort(bst_io_mark *marks, int count) {
    if (count > 0) { /* qsort takes no NULL */
        qsort(marks, (size_t)count, sizeof *marks, by_importance);
    }
}

/* Number of detections that are drawn. */
static int drawn_of(const bst_quicklook_frame *f) {
    return f->detection_count < BST_QUICKLOOK_MARKS ? f->detection_count : BST_QUICKLOOK_MARKS;
}

/* Draws the marks of detections, truth and track; `size` scales them (larger in the inset). */
static void draw_marks(bst_picture *p, const bst_quicklook_frame *f, const view *v, double size) {
    bst_picture_clip(p, v->box);
    for (int i = drawn_of(f) - 1; i >= 0; i--) {
        const bst_io_mark *m = &f->detections[i];
        double r = fmax(m->radius_px * v->scale, 5.0 * size);
        bst_picture_circle(p, view_x(v, m->x_px), view_y(v, m->y_px), r,
                           m->kind == BST_MARK_STAR   ? star_colour
                           : m->kind == BST_MARK_REST ? rest_colour
                                                      : object_colour,
                           m->kind == BST_MARK_DETECTION ? 1.5 : 1.0);
    }
    bst_mark_cross(p, view_x(v, f->boresight_x_px), view_y(v, f->boresight_y_px), 7.0 * size,
                   16.0 * size);
    if (f->has_target) {
        double r = 11.0 * size;
        bst_picture_rectangle(p, view_x(v, f->target_x_px) - r, view_y(v, f->target_y_px) - r,
                              2 * r, 2 * r, target_colour, 1.6);
    }
    if (f->has_track) {
        bst_mark_diamond(p, view_x(v, f->track_x_px), view_y(v, f->track_y_px), 18.0 * size);
    }
    bst_picture_unclip(p);
}

/* Rounds a length down to 1, 2 or 5 times a power of ten. */
static double round_length(double v) {
    double ten = pow(10.0, floor(log10(v)));
    double m = v / ten;
    return ten * (m >= 5.0 ? 5.0 : m >= 2.0 ? 2.0 : 1.0);
}

static void draw_scale(bst_picture *p, const bst_quicklook_frame *f, const view *v) {
    if (!(f->pixel_scale_arcsec > 0.0)) {
        return;
    }
    double arcsec = round_length(0.24 * v->box.width / v->scale * f->pixel_scale_arcsec);
    char text[48];
    if (arcsec >= 60.0) {
        arcsec = 60.0 * round_length(arcsec / 60.0);
        snprintf(text, sizeof text, "%g arcmin", arcsec / 60.0);
    } else {
        snprintf(text, sizeof text, "%g arcsec", arcsec);
    }
    double length = arcsec / f->pixel_scale_arcsec * v->scale;
    double x = v->box.x + 14, y = v->box.y + v->box.height - 14;
    bst_picture_line(p, x, y, x + length, y, white, 2.0);
    bst_picture_line(p, x, y - 4, x, y + 4, white, 1.5);
    bst_picture_line(p, x + length, y - 4, x + length, y + 4, white, 1.5);
    bst_picture_text(p, x, y - 10, 9.0, white, false, text);
}

static bool target_is_inside(const bst_quicklook_frame *f) {
    return f->has_target && f->target_x_px > -0.5 && f->target_y_px > -0.5 &&
           f->target_x_px < f->width - 0.5 && f->target_y_px < f->height - 0.5;
}

/* Draws an arrow at the boresight towards a target outside the frame. */
static void draw_pointer(bst_picture *p, const bst_quicklook_frame *f, const view *v) {
    double dx = f->target_x_px - f->boresight_x_px, dy = f->target_y_px - f->boresight_y_px;
    double r = hypot(dx, dy);
    if (!f->has_target || target_is_inside(f) || !(r > 0.0) || !isfinite(r)) {
        return;
    }
    dx /= r;
    dy /= r;
    double x0 = view_x(v, f->boresight_x_px) + 28 * dx;
    double y0 = view_y(v, f->boresight_y_px) + 28 * dy;
    double x1 = x0 + 70 * dx, y1 = y0 + 70 * dy;
    bst_picture_clip(p, v->box);
    bst_picture_line(p, x0, y0, x1, y1, target_colour, 1.8);
    bst_picture_line(p, x1, y1, x1 - 11 * dx - 6 * dy, y1 - 11 * dy + 6 * dx, target_colour, 1.8);
    bst_picture_line(p, x1, y1, x1 - 11 * dx + 6 * dy, y1 - 11 * dy - 6 * dx, target_colour, 1.8);
    char text[64];
    snprintf(text, sizeof text, "target: %.0f px away", r);
    double width = bst_picture_text_width(9.5, false, text);
    /* beyond the tip, or beside it for a vertical arrow */
    double x = fabs(dx) < 0.5 ? x1 + 10 : dx > 0.0 ? x1 + 8 : x1 - 8 - width;
    bst_picture_text(p, x, y1 + 5, 9.5, target_colour, false, text);
    bst_picture_unclip(p);
}

/* Draws the enlarged surroundings of the target in the upper right corner of the panel, or in the
 * upper left if it would hide them. */
static bst_status draw_inset(bst_ctx *ctx, bst_picture *p, const bst_quicklook_frame *f,
                             const view *panel, bst_io_stretch stretch) {
    bool inside = target_is_inside(f);
    double x = inside ? f->target_x_px : f->boresight_x_px;
    double y = inside ? f->target_y_px : f->boresight_y_px;
    int shorter = panel->box.width < panel->box.height ? panel->box.width : panel->box.height;
    int side = INSET < shorter / 2 ? INSET : shorter / 2;
    if (side < 40 || !isfinite(x) || !isfinite(y)) {
        return BST_OK;
    }
    bool left = view_x(panel, x) > panel->box.x + 0.55 * panel->box.width &&
                view_y(panel, y) < panel->box.y + side + 40;
    view v = {.box = {left ? panel->box.x : panel->box.x + panel->box.width - side, panel->box.y,
                      side, side},
              .scale = (double)side / INSET_PX};
    int x0 = (int)floor(x + 0.5) - INSET_PX / 2, y0 = (int)floor(y + 0.5) - INSET_PX / 2;
    v.x0 = x0 - 0.5;
    v.y0 = y0 - 0.5;
    BST_TRY(bst_picture_frame(ctx, p, v.box, f->pixels, f->width, f->height, x0, y0, INSET_PX,
                              INSET_PX, stretch));
    draw_marks(p, f, &v, 2.6);
    bst_picture_rectangle(p, v.box.x, v.box.y, v.box.width - 1, v.box.height - 1, soft, 1.2);
    /* the enlarged part, on the panel */
    bst_picture_rectangle(p, view_x(panel, v.x0), view_y(panel, v.y0), INSET_PX * panel->scale,
                          INSET_PX * panel->scale, soft, 1.0);
    char text[64];
    snprintf(text, sizeof text, "%s, %d x %d px", inside ? "target" : "boresight", INSET_PX,
             INSET_PX);
    bst_picture_text(p, v.box.x + 8, v.box.y + side - 9, 8.5, white, false, text);
    return BST_OK;
}

/* Draws one frame of the quick-look image with marks, inset, scale and captions. */
static bst_status draw_panel(bst_ctx *ctx, bst_picture *p, const bst_quicklook_frame *f, int left,
                             int top) {
    double scale = (double)PANEL / (f->width > f->height ? f->width : f->height);
    view v = {
        .box = {left, top + CAPTION, (int)lround(f->width * scale), (int)lround(f->height * scale)},
        .x0 = -0.5,
        .y0 = -0.5,
        .scale = scale};
    v.box.width = v.box.width < 1 ? 1 : v.box.width;
    v.box.height = v.box.height < 1 ? 1 : v.box.height;
    bst_io_stretch stretch = bst_io_stretch_of(f->pixels, f->width, f->height);
    BST_TRY(bst_picture_frame(ctx, p, v.box, f->pixels, f->width, f->height, 0, 0, f->width,
                              f->height, stretch));
    draw_marks(p, f, &v, 1.0);
    BST_TRY(draw_inset(ctx, p, f, &v, stretch));
    draw_pointer(p, f, &v);
    draw_scale(p, f, &v);
    bst_picture_rectangle(p, v.box.x - 1, v.box.y - 1, v.box.width + 1, v.box.height + 1, soft,
                          1.0);

    double x = left;
    x += bst_picture_text(p, x, top + 20, 12.0, white, true, f->title ? f->title : "Frame") + 16;
    if (f->mode && f->mode[0]) {
        char text[64];
        snprintf(text, sizeof text, "mode: %s", f->mode);
        x += bst_picture_text(p, x, top + 20, 11.0, object_colour, false, text) + 16;
    }
    if (f->has_track && f->track_label) {
        bst_picture_text(p, x, top + 20, 11.0, track_colour, false, f->track_label);
    }
    x = left + bst_picture_text(p, left, top + 44, 10.0, soft, false, f->time ? f->time : "") + 16;
    if (drawn_of(f) < f->detection_count) {
        char text[64];
        snprintf(text, sizeof text, "%d of %d detections drawn", drawn_of(f), f->detection_count);
        bst_picture_text(p, x, top + 44, 10.0, white, false, text);
    }
    return BST_OK;
}

/* Draws the legend. `single`: one panel only; the legend then has two rows. */
static void draw_legend(bst_picture *p, double left, double y, bool single) {
    const double h = 9.5, gap = 30;
    double x = left;
    y -= single ? LEGEND_ROW : 0;
    double mid = y - 4;
    bst_picture_rectangle(p, x, mid - 7, 14, 14, target_colour, 1.6);
    x += 22 + bst_picture_text(p, x + 22, y, h, soft, false, "target (truth)") + gap;
    bst_mark_diamond(p, x + 8, mid, 9);
    x += 24 + bst_picture_text(p, x + 24, y, h, soft, false, "track") + gap;
    bst_picture_circle(p, x + 7, mid, 6.5, object_colour, 1.5);
    x += 22 + bst_picture_text(p, x + 22, y, h, soft, false, "detection") + gap;
    if (single) {
        x = left;
        y += LEGEND_ROW;
        mid += LEGEND_ROW;
    }
    bst_picture_circle(p, x + 7, mid, 6.5, star_colour, 1.2);
    x += 22 + bst_picture_text(p, x + 22, y, h, soft, false, "identified star") + gap;
    bst_picture_circle(p, x + 7, mid, 6.5, rest_colour, 1.2);
    x += 22 + bst_picture_text(p, x + 22, y, h, soft, false, "at rest among stars") + gap;
    bst_mark_cross(p, x + 9, mid, 3, 9);
    bst_picture_text(p, x + 26, y, h, soft, false, "boresight");
}

bst_status bst_quicklook_write(bst_ctx *ctx, const char *path, const char *title,
                               const bst_quicklook_frame *first,
                               const bst_quicklook_frame *second) {
    const bst_quicklook_frame *frames[2] = {first, second};
    int panels = second ? 2 : 1;
    for (int i = 0; i < panels; i++) {
        if (!frames[i]->pixels || frames[i]->width < 1 || frames[i]->height < 1) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a frame without pixels", path);
        }
    }
    int width = MARGIN + panels * (PANEL + MARGIN);
    int height = HEAD + CAPTION + PANEL + LEGEND + (second ? 0 : LEGEND_ROW);
    bst_picture *p;
    BST_TRY(bst_picture_create(ctx, width, height, ground, &p));
    bst_picture_text(p, MARGIN, 36, 16.0, white, true, title ? title : "");
    bst_status status = BST_OK;
    for (int i = 0; i < panels && status == BST_OK; i++) {
        status = draw_panel(ctx, p, frames[i], MARGIN + i * (PANEL + MARGIN), HEAD);
    }
    if (status == BST_OK) {
        draw_legend(p, MARGIN, height - 16, !second);
        status = bst_picture_save(ctx, p, path);
    }
    bst_picture_free(p);
    return status;
}
