#include "sim/run/run_pictures.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/plot.h"
#include "sim/io/quicklook.h"

enum { MAX_POINTS = 4096 };

/* A copied frame with its overlay. */
typedef struct picture {
    uint16_t *pixels; /* NULL: none yet */
    int width, height;
    int64_t exposure_id;
    int64_t mid_tick;
    bst_window window;
    double binning;
    bst_io_mark *marks; /* of all detections */
    int mark_count, mark_room;
    bool processed;
    bool has_target;
    double target_x_px, target_y_px;
    bool has_track;
    double track_x_px, track_y_px;
    char track_label[48];
    int mode;
} picture;

struct bst_run_pictures {
    bst_camera camera;
    double rate_hz;
    bst_time epoch;
    int target;
    picture first, last, pending; /* pending: the newest frame, whose tracks have not arrived */
    int mode;
    bst_io_pointing_point points[MAX_POINTS];
    int point_count;
    int64_t judged, stride;
};

bst_status bst_run_pictures_create(bst_ctx *ctx, const bst_camera *camera, int64_t tick_rate_hz,
                                   bst_time epoch, int target_object, bst_run_pictures **out) {
    bst_run_pictures *p = calloc(1, sizeof *p);
    *out = p;
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for pictures");
    }
    p->camera = *camera;
    p->rate_hz = (double)tick_rate_hz;
    p->epoch = epoch;
    p->target = target_object;
    p->stride = 1;
    return BST_OK;
}

void bst_run_pictures_free(bst_run_pictures *p) {
    if (p) {
        picture *all[] = {&p->first, &p->last, &p->pending};
        for (int i = 0; i < 3; i++) {
            free(all[i]->pixels);
            free(all[i]->marks);
        }
        free(p);
    }
}

/* Makes room for the restored pixels and marks of a picture; false: there is no memory. */
static bool make_room(picture *pic, size_t pixels, int marks) {
    free(pic->pixels);
    free(pic->marks);
    pic->pixels = pixels > 0 ? malloc(pixels * sizeof *pic->pixels) : NULL;
    pic->marks = marks > 0 ? malloc((size_t)marks * sizeof *pic->marks) : NULL;
    pic->mark_count = pic->mark_room = pic->marks ? marks : 0;
    return (pixels == 0 || pic->pixels) && (marks == 0 || pic->marks);
}

/* Saves or restores a picture. */
static bst_status archive_picture(const bst_run_pictures *p, picture *pic, bst_archive *archive) {
    bool present = pic->pixels != NULL;
    bst_archive_bool(archive, &present);
    pic->width = (int)bst_archive_integer(archive, pic->width, 0, p->camera.width_px);
    pic->height = (int)bst_archive_integer(archive, pic->height, 0, p->camera.height_px);
    int marks = bst_archive_count(archive, pic->mark_count, INT32_MAX / 2);
    size_t pixels = present ? (size_t)pic->width * (size_t)pic->height : 0;
    if (bst_archive_is_restoring(archive) && !make_room(pic, pixels, marks)) {
        return bst_fail(bst_archive_ctx(archive), BST_ERR_MEMORY, "out of memory for pictures");
    }
    bst_archive_bytes(archive, pic->pixels, pixels * sizeof *pic->pixels);
    bst_archive_bytes(archive, pic->marks, (size_t)marks * sizeof *pic->marks);
    BST_ARCHIVE(archive, pic->exposure_id);
    BST_ARCHIVE(archive, pic->mid_tick);
    BST_ARCHIVE(archive, pic->window);
    BST_ARCHIVE(archive, pic->binning);
    bst_archive_bool(archive, &pic->processed);
    bst_archive_bool(archive, &pic->has_target);
    BST_ARCHIVE(archive, pic->target_x_px);
    BST_ARCHIVE(archive, pic->target_y_px);
    bst_archive_bool(archive, &pic->has_track);
    BST_ARCHIVE(archive, pic->track_x_px);
    BST_ARCHIVE(archive, pic->track_y_px);
    BST_ARCHIVE(archive, pic->track_label);
    pic->track_label[sizeof pic->track_label - 1] = '\0';
    BST_ARCHIVE(archive, pic->mode);
    return BST_OK;
}

bst_status bst_run_pictures_archive(bst_run_pictures *p, bst_archive *archive) {
    BST_TRY(archive_picture(p, &p->first, archive));
    BST_TRY(archive_picture(p, &p->last, archive));
    BST_TRY(archive_picture(p, &p->pending, archive));
    BST_ARCHIVE(archive, p->mode);
    p->point_count = bst_archive_count(archive, p->point_count, MAX_POINTS);
    bst_archive_bytes(archive, p->points, (size_t)p->point_count * sizeof *p->points);
    BST_ARCHIVE(archive, p->judged);
    p->stride = bst_archive_integer(archive, p->stride, 1, INT64_MAX / 2);
    return BST_OK;
}

/* Copies the pixels of a frame for the quick-look picture. */
static bst_status copy_frame(bst_ctx *ctx, bst_run_pictures *p, const bst_frame_message *m) {
    if (!m->frame) {
        return BST_OK;
    }
    picture *pic = &p->pending;
    size_t pixels = (size_t)m->frame->width * (size_t)m->frame->height;
    if (!pic->pixels || (size_t)pic->width * (size_t)pic->height < pixels) {
        free(pic->pixels);
        pic->pixels = malloc(pixels * sizeof *pic->pixels);
        if (!pic->pixels) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for pictures");
        }
    }
    const uint16_t *source;
    BST_TRY(bst_frame_map(m->frame, ctx, &source));
    memcpy(pic->pixels, source, pixels * sizeof *source);
    bst_frame_unmap(m->frame);
    *pic = (picture){.pixels = pic->pixels, .marks = pic->marks, .mark_room = pic->mark_room};
    pic->width = m->frame->width;
    pic->height = m->frame->height;
    pic->exposure_id = m->exposure_id;
    pic->mid_tick = m->start_tick + (m->end_tick - m->start_tick) / 2;
    pic->window = m->window;
    pic->binning = m->binning > 1 ? m->binning : 1.0;
    pic->mode = p->mode;
    return BST_OK;
}

/* Picture pixel of a sensor position; `first`: corner of the window. */
static double pixel_of(const picture *pic, double place_px, int first) {
    double middle = 0.5 * (pic->binning -
                           1.0); /* centre of a binned pixel, relative to its first sensor pixel */
    return (place_px - first - middle) / pic->binning;
}

/* Marks the true centroid of the target in the picture. */
static void mark_truth(const bst_run_pictures *p, picture *pic, const bst_truth *truth) {
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *item = &truth->items[i];
        if (item->kind == BST_SOURCE_OBJECT && (int)item->id == p->target &&
            (item->flags & BST_TRUTH_IN_FIELD)) {
            pic->has_target = true;
            pic->target_x_px = pixel_of(pic, item->x_centroid_px, pic->window.x0);
            pic->target_y_px = pixel_of(pic, item->y_centroid_px, pic->window.y0);
        }
    }
}

/* Marks the detections in the picture. */
static bst_status mark_detections(bst_ctx *ctx, picture *pic, const bst_detections *detections) {
    if (detections->count > pic->mark_room) {
        bst_io_mark *more = realloc(pic->marks, (size_t)detections->count * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for pictures");
        }
        pic->marks = more;
        pic->mark_room = detections->count;
    }
    for (int i = 0; i < detections->count; i++) {
        const bst_detection *d = &detections->items[i];
        pic->marks[i] = (bst_io_mark){.x_px = pixel_of(pic, d->x_px, pic->window.x0),
                                      .y_px = pixel_of(pic, d->y_px, pic->window.y0),
                                      .importance = d->flux_e,
                                      .kind = d->label != BST_LABEL_STAR ? BST_MARK_DETECTION
                                              : d->star_id != 0          ? BST_MARK_STAR
                                                                         : BST_MARK_REST};
    }
    pic->mark_count = detections->count;
    return BST_OK;
}

/* Sorts detection marks: the target's own first, then by brightness. */
static void sort_marks(const picture *pic) {
    for (int i = 0; i < pic->mark_count; i++) {
        bst_io_mark *m = &pic->marks[i];
        if (pic->has_target && hypot(m->x_px - pic->target_x_px, m->y_px - pic->target_y_px) <=
                                   BST_RIGHT_TARGET_PX / pic->binning) {
            m->importance = INFINITY;
        }
    }
    bst_io_mark_sort(pic->marks, pic->mark_count);
}

/* Completes the newest frame: it becomes the last one, and the first if there was none. */
static bst_status settle_pending(bst_ctx *ctx, bst_run_pictures *p, const bst_tracks *tracks) {
    picture *pic = &p->pending;
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (t->target_of_interest) {
            pic->has_track = true;
            pic->track_x_px = pixel_of(pic, t->x_px, pic->window.x0);
            pic->track_y_px = pixel_of(pic, t->y_px, pic->window.y0);
            snprintf(pic->track_label, sizeof pic->track_label, "track %lld  SNR %.1f",
                     (long long)t->id, t->snr);
        }
    }
    pic->processed = true;
    if (!p->first.pixels) {
        size_t bytes = (size_t)pic->width * (size_t)pic->height * sizeof(uint16_t);
        p->first = *pic;
        p->first.pixels = malloc(bytes);
        p->first.marks = malloc((size_t)pic->mark_count * sizeof *pic->marks + 1);
        p->first.mark_room = pic->mark_count;
        if (!p->first.pixels || !p->first.marks) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for pictures");
        }
        memcpy(p->first.pixels, pic->pixels, bytes);
        if (pic->mark_count > 0) {
            memcpy(p->first.marks, pic->marks, (size_t)pic->mark_count * sizeof *pic->marks);
        }
    }
    picture swap = p->last;
    p->last = *pic;
    *pic = swap;
    pic->processed = true; /* an earlier frame until the next one arrives */
    return BST_OK;
}

bst_status bst_run_pictures_message(bst_ctx *ctx, bst_run_pictures *p, const char *channel,
                                    const void *payload) {
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        return copy_frame(ctx, p, payload);
    }
    bool waiting = p->pending.pixels && !p->pending.processed;
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        const bst_truth *truth = payload;
        if (waiting && truth->exposure_id == p->pending.exposure_id) {
            mark_truth(p, &p->pending, truth);
        }
    } else if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        const bst_detections *detections = payload;
        if (waiting && detections->exposure_id == p->pending.exposure_id) {
            return mark_detections(ctx, &p->pending, detections);
        }
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        const bst_tracks *tracks = payload;
        if (waiting && tracks->exposure_id == p->pending.exposure_id) {
            return settle_pending(ctx, p, tracks);
        }
    } else if (strcmp(channel, BST_CHANNEL_CONTROL_STATUS) == 0) {
        p->mode = ((const bst_control_status *)payload)->mode;
    }
    return BST_OK;
}

void bst_run_pictures_judged(bst_run_pictures *p, const bst_loop_frame *f) {
    if (p->judged++ % p->stride != 0 || isnan(f->error_px)) {
        return;
    }
    if (p->point_count == MAX_POINTS) {
        /* the buffer is full: keep every second point, and from now on every second frame */
        for (int i = 0; i < MAX_POINTS / 2; i++) {
            p->points[i] = p->points[2 * i];
        }
        p->point_count = MAX_POINTS / 2;
        p->stride *= 2;
    }
    p->points[p->point_count++] = (bst_io_pointing_point){.time_s = f->time_s,
                                                          .dx_px = f->error_x_px,
                                                          .dy_px = f->error_y_px,
                                                          .mode = f->mode,
                                                          .in_track = f->in_track,
                                                          .counted = bst_loop_frame_is_pointing(f),
                                                          .visible = f->visible};
}

/* Text of a panel. */
typedef struct panel_text {
    char time[80];
} panel_text;

/* Describes a picture as a panel of the quick-look image. */
static bst_quicklook_frame panel(const bst_run_pictures *p, const picture *pic, const char *title,
                                 panel_text *text) {
    double seconds = (double)pic->mid_tick / p->rate_hz;
    char utc[48];
    bst_time_to_utc(bst_time_add(p->epoch, seconds), 1, utc, sizeof utc);
    sort_marks(pic);
    snprintf(text->time, sizeof text->time, "%s  t = %.1f s", utc, seconds);
    return (bst_quicklook_frame){
        .pixels = pic->pixels,
        .width = pic->width,
        .height = pic->height,
        .title = title,
        .time = text->time,
        .mode = bst_mode_name(pic->mode),
        .detections = pic->marks,
        .detection_count = pic->mark_count,
        .has_target = pic->has_target,
        .target_x_px = pic->target_x_px,
        .target_y_px = pic->target_y_px,
        .has_track = pic->has_track,
        .track_x_px = pic->track_x_px,
        .track_y_px = pic->track_y_px,
        .track_label = pic->track_label,
        .boresight_x_px = pixel_of(pic, bst_camera_centre_x(&p->camera), pic->window.x0),
        .boresight_y_px = pixel_of(pic, bst_camera_centre_y(&p->camera), pic->window.y0),
        .pixel_scale_arcsec = p->camera.pixel_scale_arcsec * pic->binning};
}

bst_status bst_run_pictures_write(bst_ctx *ctx, const bst_run_pictures *p, const char *folder,
                                  const char *title, const bst_loop_figures *figures) {
    char path[4096], label[160] = "never acquired";
    /* without image processing no frame is completed: show the newest one */
    const picture *first = p->first.pixels ? &p->first : p->pending.pixels ? &p->pending : NULL;
    const picture *last =
        p->last.pixels && p->last.exposure_id != p->first.exposure_id ? &p->last : NULL;
    if (first) {
        panel_text texts[2];
        bst_quicklook_frame a = panel(p, first, "First frame", &texts[0]), b;
        if (last) {
            b = panel(p, last, "Last frame", &texts[1]);
        }
        snprintf(path, sizeof path, "%s/quicklook.png", folder);
        BST_TRY(bst_quicklook_write(ctx, path, title, &a, last ? &b : NULL));
    }
    if (p->point_count > 1) {
        bool made;
        if (figures->pointing_frames > 0) {
            snprintf(label, sizeof label,
                     "pointing RMS %.3f px    largest %.3f px    custody %.1f %%    acquired at "
                     "%.1f s",
                     figures->pointing_rms_px, figures->pointing_max_px, 100.0 * figures->custody,
                     figures->time_to_acquire_s);
        } else if (isfinite(figures->time_to_acquire_s)) {
            snprintf(label, sizeof label, "never settled    custody %.1f %%    acquired at %.1f s",
                     100.0 * figures->custody, figures->time_to_acquire_s);
        }
        snprintf(path, sizeof path, "%s/pointing.png", folder);
        BST_TRY(
            bst_io_pointing_plot(ctx, path, title, label, p->points, p->point_count, 0.5, &made));
    }
    return BST_OK;
}
