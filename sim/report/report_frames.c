#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/text.h"
#include "sim/export/frame_marks.h"
#include "sim/io/fits_reader.h"
#include "sim/io/frame_picture.h"
#include "sim/report/report.h"

/* Number of frames shown; sides of a frame and its inset in SVG units; sensor pixels in an inset;
 * grey levels; maximum number of marks. */
enum { SHOWN = 6, SIDE = 352, INSET = 180, INSET_PX = 48, GREYS = 16, MOST_MARKS = 400 };

static const struct {
    const char *colour, *name;
} kinds[] = {
    [BST_OVERLAY_TARGET] = {"#ff5c5c", "target (truth)"},
    [BST_OVERLAY_OBJECT] = {"#96a0b0", "object (truth)"},
    [BST_OVERLAY_STAR] = {"#6ebe78", "identified star"},
    [BST_OVERLAY_REST] = {"#54868c", "at rest among stars"},
    [BST_OVERLAY_DETECTION] = {"#ffd64f", "detection"},
    [BST_OVERLAY_TRACK] = {"#5cdcff", "track"},
    [BST_OVERLAY_BORESIGHT] = {"#ec80ff", "boresight"},
};

/* Part of a frame that is shown in an SVG at (x, y) with `scale` units per pixel. */
typedef struct part {
    double x, y, width, height; /* SVG units */
    int column, row, columns, rows;
    double scale;
    bool labels;
    double marks; /* size of the marks, 1: normal */
} part;

/* Embeds a part of the frame in the SVG as a grey PNG. */
static bst_status put_pixels(bst_ctx *ctx, FILE *out, const bst_fits_read_frame *frame,
                             bst_io_stretch stretch, const part *p, int width, int height) {
    bst_picture *picture;
    uint8_t *png = NULL;
    size_t bytes;
    BST_TRY(bst_picture_create(ctx, width, height, (bst_io_colour){0, 0, 0}, &picture));
    bst_status status = bst_picture_frame(ctx, picture, (bst_io_box){0, 0, width, height},
                                          frame->pixels, frame->width, frame->height, p->column,
                                          p->row, p->columns, p->rows, stretch);
    if (status == BST_OK) {
        status = bst_picture_grey_png(ctx, picture, GREYS, &png, &bytes);
    }
    bst_picture_free(picture);
    if (status == BST_OK) {
        fprintf(out,
                "<image x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
                "href=\"data:image/png;base64,",
                p->x, p->y, p->width, p->height);
        bst_html_base64(out, png, bytes);
        fputs("\"/>\n", out);
    }
    free(png);
    return status;
}

/* Writes a mark into the SVG at (x, y), `size` times the normal size. */
static void put_mark(FILE *out, bst_io_overlay_kind kind, double x, double y, double radius,
                     double size) {
    double r = radius, arm = 11.0 * size, gap = 4.0 * size;
    switch (kind) {
        case BST_OVERLAY_TARGET:
        case BST_OVERLAY_OBJECT:
            r = fmax(r, 7.0 * size);
            fprintf(out, "<path d=\"M%.1f %.1fh%.1fv%.1fh%.1fz\"", x - r, y - r, 2.0 * r, 2.0 * r,
                    -2.0 * r);
            break;
        case BST_OVERLAY_STAR:
        case BST_OVERLAY_REST:
        case BST_OVERLAY_DETECTION:
            fprintf(out, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"", x, y, fmax(r, 3.5 * size));
            break;
        case BST_OVERLAY_TRACK:
            r = 11.0 * size;
            fprintf(out, "<path d=\"M%.1f %.1fl%.1f %.1fl%.1f %.1fl%.1f %.1fz\"", x, y - r, r, r,
                    -r, r, -r, -r);
            break;
        case BST_OVERLAY_BORESIGHT:
            fprintf(out, "<path d=\"M%.1f %.1fH%.1fM%.1f %.1fH%.1fM%.1f %.1fV%.1fM%.1f %.1fV%.1f\"",
                    x - arm, y, x - gap, x + gap, y, x + arm, x, y - arm, y - gap, x, y + gap,
                    y + arm);
            break;
    }
    fprintf(out, " fill=\"none\" stroke=\"%s\" stroke-width=\"%s\"/>", kinds[kind].colour,
            kind == BST_OVERLAY_STAR || kind == BST_OVERLAY_REST ? ".7" : "1.2");
}

/* True if the mark is a detection, identified star or source at rest among stars. */
static bool is_detection(const bst_io_overlay_mark *m) {
    return m->kind == BST_OVERLAY_STAR || m->kind == BST_OVERLAY_REST ||
           m->kind == BST_OVERLAY_DETECTION;
}

/* Position of a mark in a part of the frame; false: outside, or not finite. */
static bool find_mark(const bst_io_overlay_mark *m, const part *p, double *x, double *y) {
    *x = (m->x_px - p->column + 0.5) * p->scale;
    *y = (m->y_px - p->row + 0.5) * p->scale;
    return *x > -20.0 && *y > -20.0 && *x < p->width + 20.0 && *y < p->height + 20.0;
}

/* Writes the label of a mark next to it. */
static void put_label(FILE *out, const bst_io_overlay_mark *m, const part *p, double x, double y) {
    /* next to the mark; on its other side near the edge of the frame */
    bool left = x > p->width - 110.0;
    bool track = m->kind == BST_OVERLAY_TRACK;
    fprintf(out, "<text class=\"m\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" fill=\"%s\">",
            left ? x - 14.0 : x + 14.0, track ? y - 5.0 : y + 11.0, left ? "end" : "start",
            kinds[m->kind].colour);
    bst_html_text(out, m->label);
    fputs("</text>", out);
}

/* Draws up to MOST_MARKS detections and as many other marks, the most important in front.
 * *detections and *drawn: number of detections in the part, and drawn. */
static void put_marks(FILE *out, const bst_io_overlay *overlay, const part *p, int *detections,
                      int *drawn) {
    double x, y;
    int chosen[2 * MOST_MARKS], count = 0, others = 0;
    *detections = 0;
    for (int i = 0; i < overlay->count; i++) {
        if (find_mark(&overlay->marks[i], p, &x, &y) &&
            (is_detection(&overlay->marks[i]) ? ++*detections : ++others) <= MOST_MARKS) {
            chosen[count++] = i;
        }
    }
    *drawn = *detections < MOST_MARKS ? *detections : MOST_MARKS;
    fprintf(out, "<svg x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\">", p->x, p->y, p->width,
            p->height);
    while (count-- > 0) {
        const bst_io_overlay_mark *m = &overlay->marks[chosen[count]];
        find_mark(m, p, &x, &y);
        put_mark(out, m->kind, x, y, m->radius_px * p->scale, p->marks);
        if (p->labels && m->label[0]) {
            put_label(out, m, p, x, y);
        }
    }
    fputs("</svg>\n", out);
}

/* Centre of the inset: target, else track, else boresight, else centre of the frame. */
static void find_middle(const bst_io_overlay *overlay, const bst_fits_read_frame *frame, double *x,
                        double *y) {
    static const bst_io_overlay_kind order[] = {BST_OVERLAY_TARGET, BST_OVERLAY_TRACK,
                                                BST_OVERLAY_BORESIGHT};
    *x = 0.5 * frame->width;
    *y = 0.5 * frame->height;
    for (size_t k = 0; k < sizeof order / sizeof *order; k++) {
        for (int i = 0; i < overlay->count; i++) {
            const bst_io_overlay_mark *m = &overlay->marks[i];
            if (m->kind == order[k] && m->x_px >= 0.0 && m->y_px >= 0.0 && m->x_px < frame->width &&
                m->y_px < frame->height) {
                *x = m->x_px;
                *y = m->y_px;
                return;
            }
        }
    }
}

/* Writes facts about the frame below the inset. */
static void put_facts(FILE *out, const bst_report_frame *f, bool tracked, double x, double y) {
    char lines[4][80] = {"", "", "", ""};
    if (!f) {
        return;
    }
    char number[32];
    if (f->error_px < 1e-3) {
        snprintf(lines[0], sizeof lines[0], "on the boresight");
    } else if (isfinite(f->error_px)) {
        snprintf(lines[0], sizeof lines[0], "%s px from the boresight",
                 bst_report_page_number(number, f->error_px, 3));
    }
    if (isfinite(f->snr)) {
        snprintf(lines[1], sizeof lines[1], "SNR %.1f%s", f->snr,
                 f->occulted ? ", behind the Earth" : "");
        if (isfinite(f->track_snr)) {
            snprintf(lines[1], sizeof lines[1], "SNR %.1f, measured %.1f", f->snr, f->track_snr);
        }
    }
    if (isfinite(f->detections)) {
        snprintf(lines[2], sizeof lines[2], "%.0f detection%s, %.0f star%s identified",
                 f->detections, f->detections == 1.0 ? "" : "s", f->stars,
                 f->stars == 1.0 ? "" : "s");
    }
    if (f->known && tracked) {
        snprintf(lines[3], sizeof lines[3], "%s", f->in_track ? "in track" : "not in track");
    }
    for (int k = 0; k < 4; k++) {
        if (lines[k][0]) {
            y += 19.0;
            fprintf(out, "<text x=\"%.1f\" y=\"%.1f\">", x, y);
            bst_html_text(out, lines[k]);
            fputs("</text>", out);
        }
    }
}

/* Number of detections in a frame, and drawn. */
typedef struct shown {
    int detections, drawn;
} shown;

/* Writes one frame as SVG: picture, marks, inset around the target, and facts. */
static bst_status put_frame(bst_ctx *ctx, FILE *out, const bst_fits_read_frame *frame,
                            const bst_io_overlay *overlay, const bst_report_frame *facts,
                            bool tracked, shown *marks) {
    bst_io_stretch stretch = bst_io_stretch_of(frame->pixels, frame->width, frame->height);
    double scale = (double)SIDE / (frame->width > frame->height ? frame->width : frame->height);
    part whole = {.columns = frame->width,
                  .rows = frame->height,
                  .scale = scale,
                  .labels = true,
                  .marks = 1.0};
    whole.width = frame->width * scale;
    whole.height = frame->height * scale;
    double x, y;
    find_middle(overlay, frame, &x, &y);
    int columns = frame->width < INSET_PX ? frame->width : INSET_PX;
    int rows = frame->height < INSET_PX ? frame->height : INSET_PX;
    part inset = {.x = SIDE + 8.0, .columns = columns, .rows = rows, .marks = 2.2};
    inset.column = (int)fmax(0.0, fmin(round(x) - columns / 2, frame->width - columns));
    inset.row = (int)fmax(0.0, fmin(round(y) - rows / 2, frame->height - rows));
    inset.scale = (double)INSET / (columns > rows ? columns : rows);
    inset.width = columns * inset.scale;
    inset.height = rows * inset.scale;
    fprintf(out, "<svg class=\"frame\" viewBox=\"0 0 %d %.0f\" role=\"img\" aria-label=\"",
            SIDE + 8 + INSET, fmax(whole.height, inset.height + 84.0));
    bst_html_format(out, "Picture of the %s with what was detected and what is true",
                    overlay->caption ? overlay->caption : "frame");
    fputs("\">\n", out);
    /* the browser enlarges small frames */
    bool small = scale > 1.0;
    BST_TRY(put_pixels(ctx, out, frame, stretch, &whole,
                       small ? frame->width : (int)fmax(1.0, whole.width),
                       small ? frame->height : (int)fmax(1.0, whole.height)));
    put_marks(out, overlay, &whole, &marks->detections, &marks->drawn);
    BST_TRY(put_pixels(ctx, out, frame, stretch, &inset, columns, rows));
    int there, marked;
    put_marks(out, overlay, &inset, &there, &marked);
    fprintf(out,
            "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
            "stroke=\"#b9c0c8\" stroke-width=\".8\" stroke-dasharray=\"3 2\"/>"
            "<rect x=\"%.1f\" y=\".4\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
            "stroke=\"#b9c0c8\" stroke-width=\".8\"/>",
            inset.column * scale, inset.row * scale, columns * scale, rows * scale, inset.x,
            inset.width - 0.4, inset.height - 0.8);
    put_facts(out, facts, tracked, inset.x, inset.height + 2.0);
    fputs("</svg>\n", out);
    return BST_OK;
}

/* ------------------------------------------------------------------ which frames */

/* Selects the frames to show: evenly spaced, including the first one with the target in track. */
static int choose(const bst_report_sensor *s, const int64_t *ids, int64_t frames,
                  int64_t chosen[SHOWN]) {
    int64_t count = frames < SHOWN ? frames : SHOWN;
    for (int64_t i = 0; i < count; i++) {
        chosen[i] = count > 1 ? i * (frames - 1) / (count - 1) : 0;
    }
    for (size_t i = 0; i < s->count && count == SHOWN; i++) {
        if (s->frames[i].in_track) {
            for (int64_t k = 0; k < frames; k++) {
                /* it takes the second place unless it comes after the third */
                if (ids[k] == s->frames[i].exposure_id && k > 0 && k < chosen[2]) {
                    chosen[1] = k;
                }
            }
            break;
        }
    }
    return (int)count;
}

/* The report frame of an exposure; NULL: none. */
static const bst_report_frame *facts_of(const bst_report_sensor *s, int64_t exposure_id) {
    for (size_t i = 0; i < s->count; i++) {
        if (s->frames[i].exposure_id == exposure_id) {
            return &s->frames[i];
        }
    }
    return NULL;
}

/* Writes the legend and the selected frames of a sensor. */
static bst_status put_chosen(bst_ctx *ctx, FILE *out, const bst_report_sensor *s,
                             bst_fits_reader *fits, bst_frame_marks *marks, int64_t *ids) {
    int64_t frames = bst_fits_reader_info(fits)->frames, chosen[SHOWN];
    bool cube = bst_fits_reader_info(fits)->cube;
    for (int64_t i = 0; i < frames; i++) {
        BST_TRY(bst_fits_reader_id(ctx, fits, i, &ids[i]));
        if (ids[i] < 0) { /* a cube without its table */
            BST_TRY(bst_frame_marks_exposure(ctx, marks, cube ? i : i + 1, &ids[i]));
        }
    }
    int count = choose(s, ids, frames, chosen);
    fputs("<ul class=\"legend\">\n", out);
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        fprintf(out,
                "<li><svg class=\"key dot\" viewBox=\"0 0 2 2\" aria-hidden=\"true\"><circle "
                "cx=\"1\" cy=\"1\" r=\"1\" fill=\"%s\"/></svg>%s</li>\n",
                kinds[k].colour, kinds[k].name);
    }
    fputs("</ul>\n", out);
    bst_report_page_grid(out, BST_PAGE_HALF);
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        bst_fits_read_frame frame;
        bst_io_overlay overlay = {0};
        int64_t id = ids[chosen[i]];
        status = bst_fits_reader_frame(ctx, fits, chosen[i], &frame);
        if (status == BST_OK && id >= 0) {
            status = bst_frame_marks_get(ctx, marks, id, &overlay);
        }
        if (status == BST_OK) {
            bst_report_page_figure(out, BST_PAGE_HALF);
            shown marks_of = {0};
            char caption[280];
            status =
                put_frame(ctx, out, &frame, &overlay, facts_of(s, id), s->has_tracks, &marks_of);
            int n = snprintf(caption, sizeof caption, "%s", overlay.caption ? overlay.caption : "");
            if (status == BST_OK && marks_of.drawn < marks_of.detections && n < 200) {
                snprintf(caption + n, sizeof caption - (size_t)n,
                         "   %d of %d detections drawn: the target's and the brightest",
                         marks_of.drawn, marks_of.detections);
            }
            bst_report_page_figure_end(out, caption);
        }
    }
    bst_report_page_grid_end(out);
    return status;
}

bst_status bst_report_frames(bst_ctx *ctx, FILE *out, bst_run_reader *run,
                             const bst_report_sensor *s) {
    char path[4096];
    bst_ctx unheard = {0};
    bst_fits_reader *fits = NULL;
    bst_frame_marks *marks = NULL;
    int64_t *ids = NULL;
    if (!s->sensor.file[0] ||
        bst_run_reader_file(&unheard, run, s->sensor.file, path, sizeof path) != BST_OK ||
        bst_fits_reader_open(&unheard, path, &fits) != BST_OK) {
        fputs("<p class=\"note\">Frames were not kept.</p>\n", out);
        return BST_OK;
    }
    int64_t frames = bst_fits_reader_info(fits)->frames;
    bst_status status = BST_OK;
    if (frames > 0) {
        ids = calloc((size_t)frames, sizeof *ids);
        status =
            ids ? bst_frame_marks_create(ctx, run, s->sensor.index, s->sensor.target, &marks)
                : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %" PRId64 " frames", frames);
        if (status == BST_OK) {
            status = put_chosen(ctx, out, s, fits, marks, ids);
        }
    }
    free(ids);
    bst_frame_marks_free(marks);
    bst_fits_reader_close(fits);
    if (status == BST_ERR_FORMAT || status == BST_ERR_IO) {
        /* damaged file: the readable frames are on the page */
        bst_run_reader_note_problem(run, "%s", ctx->message);
        fputs("<p class=\"bad\">No more frames can be read: ", out);
        bst_html_text(out, bst_report_local(run, ctx->message));
        fputs("</p>\n", out);
        status = BST_OK;
    }
    return status;
}
