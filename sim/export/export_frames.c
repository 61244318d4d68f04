#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/cli/progress.h"
#include "sim/core/compare.h"
#include "sim/core/folder.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/export/frame_marks.h"
#include "sim/export/video.h"
#include "sim/io/fits_reader.h"

enum { STRETCH_FRAMES = 9 };

/* State of exporting the frames of one sensor. */
typedef struct job {
    const bst_export *e;
    const bst_run_sensor *sensor;
    bst_fits_reader *fits;
    bst_frame_marks *marks;
    int64_t *chosen; /* indices in the FITS file */
    int64_t *ids;    /* exposure numbers */
    int64_t count;
    int width, height; /* of a picture */
    bst_io_stretch stretch;
    bst_video *video;
    bool refused; /* ffmpeg closed its input */
    uint8_t *bgr;
    char stem[256], path[4096];
} job;

/* Selects frames by exposure number. */
static bst_status choose(bst_ctx *ctx, job *j) {
    int64_t frames = bst_fits_reader_info(j->fits)->frames;
    j->chosen = calloc((size_t)frames + 1, sizeof *j->chosen);
    j->ids = calloc((size_t)frames + 1, sizeof *j->ids);
    if (!j->chosen || !j->ids) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %lld frames", (long long)frames);
    }
    bool cube = bst_fits_reader_info(j->fits)->cube;
    for (int64_t i = 0; i < frames; i++) {
        int64_t id;
        BST_TRY(bst_fits_reader_id(ctx, j->fits, i, &id));
        if (id < 0) { /* a cube without its table */
            BST_TRY(bst_frame_marks_exposure(ctx, j->marks, cube ? i : i + 1, &id));
        }
        id = id < 0 ? i : id;
        if (id >= j->e->first && id <= j->e->last && (id - j->e->first) % j->e->every == 0) {
            j->chosen[j->count] = i;
            j->ids[j->count++] = id;
        }
    }
    return BST_OK;
}

/* Computes one stretch for all frames: the median over a few, evenly spaced. */
static bst_status find_stretch(bst_ctx *ctx, job *j) {
    double values[3][STRETCH_FRAMES];
    int n = j->count < STRETCH_FRAMES ? (int)j->count : STRETCH_FRAMES;
    for (int i = 0; i < n; i++) {
        bst_fits_read_frame frame;
        int64_t at = n > 1 ? i * (j->count - 1) / (n - 1) : 0;
        BST_TRY(bst_fits_reader_frame(ctx, j->fits, j->chosen[at], &frame));
        bst_io_stretch s = bst_io_stretch_of(frame.pixels, frame.width, frame.height);
        values[0][i] = s.black;
        values[1][i] = s.white - s.black;
        values[2][i] = s.softening;
    }
    for (int k = 0; k < 3; k++) {
        qsort(values[k], (size_t)n, sizeof **values, bst_compare_doubles);
    }
    double black = values[0][n / 2];
    j->stretch = (bst_io_stretch){black, black + values[1][n / 2], values[2][n / 2]};
    return BST_OK;
}

/* Writes one frame as PNG file or adds it to the video. */
static bst_status write_frame(bst_ctx *ctx, job *j, int64_t k) {
    bst_fits_read_frame frame;
    bst_io_overlay overlay;
    bst_picture *picture;
    BST_TRY(bst_fits_reader_frame(ctx, j->fits, j->chosen[k], &frame));
    if (j->e->annotate) {
        BST_TRY(bst_frame_marks_get(ctx, j->marks, j->ids[k], &overlay));
    }
    bst_io_stretch stretch = j->e->each_stretch
                                 ? bst_io_stretch_of(frame.pixels, frame.width, frame.height)
                                 : j->stretch;
    /* a PNG has the size of its frame, all frames of a video the same size */
    int width = j->width, height = j->height;
    if (!j->e->film) {
        double scale = fmin(1.0, (double)(j->width > j->height ? j->width : j->height) /
                                     (frame.width > frame.height ? frame.width : frame.height));
        width = (int)fmax(1.0, round(frame.width * scale));
        height = (int)fmax(1.0, round(frame.height * scale));
    }
    const bst_io_counts counts = {frame.pixels, frame.width, frame.height};
    BST_TRY(bst_frame_picture(ctx, &counts, stretch, j->e->annotate ? &overlay : NULL, width,
                              height, &picture));
    bst_status status;
    if (j->e->film) {
        status = bst_picture_copy(ctx, picture, j->bgr);
        if (status == BST_OK) {
            status = bst_video_add(ctx, j->video, j->bgr);
            j->refused = status != BST_OK;
        }
    } else {
        char path[4200];
        snprintf(path, sizeof path, "%s/frame_%06" PRId64 ".png", j->path, j->ids[k]);
        status = bst_picture_save(ctx, picture, path);
    }
    bst_picture_free(picture);
    return status;
}

/* Creates the folder of PNG files, or starts the video. */
static bst_status open_output(bst_ctx *ctx, job *j) {
    const char *tail = j->e->film ? ".mp4" : "";
    int n = snprintf(j->path, sizeof j->path, "%s/%s%s", j->e->out, j->stem, tail);
    if (n < 0 || (size_t)n + 64 >= sizeof j->path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", j->e->out);
    }
    if (!j->e->film) {
        return bst_folder_make(ctx, j->path);
    }
    j->bgr = malloc(3 * (size_t)j->width * (size_t)j->height);
    if (!j->bgr) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a film");
    }
    return bst_video_begin(ctx, j->path, j->width, j->height, j->e->frame_rate, &j->video);
}

/* Writes the chosen frames of a sensor and finishes the video. */
static bst_status write_frames(bst_ctx *ctx, job *j) {
    bst_progress progress;
    bst_progress_start(&progress, j->stem, "frames", j->count);
    bst_status status = BST_OK;
    for (int64_t k = 0; k < j->count && status == BST_OK; k++) {
        status = bst_export_check(ctx);
        status = status == BST_OK ? write_frame(ctx, j, k) : status;
        bst_progress_update(&progress, k + 1);
    }
    bst_progress_end(&progress);
    if (!j->video) {
        return status;
    }
    if (status == BST_OK || j->refused) {
        /* the error message of ffmpeg, if it ended early */
        status = bst_video_end(ctx, j->video);
    } else {
        bst_video_abandon(j->video);
    }
    return status;
}

/* Exports the frames of one sensor as PNG files or video. */
static bst_status export_sensor(bst_ctx *ctx, job *j) {
    char path[4096];
    BST_TRY(bst_run_reader_file(ctx, j->e->run, j->sensor->file, path, sizeof path));
    BST_TRY(bst_fits_reader_open(ctx, path, &j->fits));
    BST_TRY(bst_frame_marks_create(ctx, j->e->run, j->sensor->index, j->sensor->target, &j->marks));
    BST_TRY(choose(ctx, j));
    const bst_fits_file_info *info = bst_fits_reader_info(j->fits);
    if (j->count == 0) {
        bst_log(ctx, BST_LOG_WARNING, "%s: of its %s none is among those asked for", path,
                bst_text_of_count((char[BST_COUNT_TEXT]){0}, info->frames, "frame", "frames"));
        return BST_OK;
    }
    double longest = info->width > info->height ? info->width : info->height;
    double scale = j->e->longest_side > 0 ? fmin(1.0, (double)j->e->longest_side / longest) : 1.0;
    j->width = (int)fmax(1.0, round(info->width * scale));
    j->height = (int)fmax(1.0, round(info->height * scale));
    if (!j->e->each_stretch) {
        BST_TRY(find_stretch(ctx, j));
    }
    snprintf(j->stem, sizeof j->stem, "%.*s", (int)strcspn(j->sensor->file, "."), j->sensor->file);
    BST_TRY(open_output(ctx, j));
    BST_TRY(write_frames(ctx, j));
    printf("%s%s: %s\n", j->path, j->e->film ? "" : "/",
           bst_text_of_count((char[BST_COUNT_TEXT]){0}, j->count, "frame", "frames"));
    return BST_OK;
}

bst_status bst_export_frames(bst_ctx *ctx, const bst_export *e) {
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count, kept = 0;
    BST_TRY(bst_run_sensors(ctx, e->run, e->sensor, sensors, &count));
    for (int i = 0; i < count; i++) {
        if (!sensors[i].file[0]) {
            continue;
        }
        kept++;
        job *j = calloc(1, sizeof *j);
        if (!j) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
        }
        j->e = e;
        j->sensor = &sensors[i];
        bst_status status = export_sensor(ctx, j);
        bst_fits_reader_close(j->fits);
        bst_frame_marks_free(j->marks);
        free(j->chosen);
        free(j->ids);
        free(j->bgr);
        free(j);
        BST_TRY(status);
    }
    return kept > 0 ? BST_OK
                    : bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: its frames were not kept",
                               bst_run_reader_folder(e->run));
}
