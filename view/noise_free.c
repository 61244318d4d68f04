#include "view/noise_free.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Planes of light [electrons], whose sum is the frame without noise. */
static const char *const planes[] = {"stars", "targets", "background"};
enum { PLANES = sizeof planes / sizeof *planes };

/* Path of a plane's file: that of the frames with another first word. False: there is none. */
static bool path_of(const bst_view_run *run, const bst_view_sensor *s, int plane, char *path,
                    size_t bytes) {
    static const char first_word[] = "frames";
    bst_ctx ignored = {0};
    char name[320];
    const char *file = s->sensor.file;
    if (strncmp(file, first_word, sizeof first_word - 1) != 0) {
        return false;
    }
    snprintf(name, sizeof name, "%s%s", planes[plane], file + sizeof first_word - 1);
    return bst_run_reader_file(&ignored, run->reader, name, path, bytes) == BST_OK &&
           access(path, R_OK) == 0;
}

void bst_view_add_planes(const bst_view_run *run, const bst_view_sensor *sensor, cJSON *out) {
    cJSON *names = cJSON_AddArrayToObject(out, "planes");
    char path[4096];
    for (int i = 0; i < PLANES; i++) {
        if (path_of(run, sensor, i, path, sizeof path)) {
            cJSON_AddItemToArray(names, cJSON_CreateString(planes[i]));
        }
    }
}

/* Adds a plane to the sum. *sum: NULL at the first one. */
static bst_status add_plane(bst_ctx *ctx, const char *path, int64_t index, float **sum,
                            float **room, bst_fits_source_frame *size) {
    bst_fits_source *source;
    bst_fits_source_frame place;
    BST_TRY(bst_fits_source_open(ctx, path, &source));
    bst_status status = bst_fits_source_select(ctx, source, index, &place);
    if (status == BST_OK && *sum && (place.width != size->width || place.height != size->height)) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%s: %d x %d pixels, the other planes have %d x %d",
                          path, place.width, place.height, size->width, size->height);
    }
    if (status == BST_OK) {
        const size_t pixels = (size_t)place.width * (size_t)place.height;
        const bool first = !*sum;
        if (first) {
            *size = place;
            *sum = malloc((pixels + 1) * sizeof **sum);
            *room = malloc((pixels + 1) * sizeof **room);
        }
        status = *sum && *room
                     ? bst_fits_source_pixels(ctx, source, first ? *sum : *room)
                     : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the planes of a frame");
        for (size_t i = 0; !first && status == BST_OK && i < pixels; i++) {
            (*sum)[i] += (*room)[i];
        }
    }
    bst_fits_source_close(source);
    return status;
}

/* Number of a keyword of the frame's header; NAN: none. */
static double keyword(bst_fits_source *header, const char *name) {
    char text[BST_FITS_SOURCE_TEXT], *end;
    if (!bst_fits_source_text(header, name, text)) {
        return NAN;
    }
    double value = strtod(text, &end);
    return end == text ? NAN : value;
}

/* Gain [e/DN] and offset [DN] of a frame. */
static bst_status read_calibration(bst_ctx *ctx, const bst_view_run *run, const bst_view_sensor *s,
                                   int64_t index, double *gain, double *offset) {
    char path[4096];
    bst_fits_source *header;
    bst_fits_source_frame place;
    BST_TRY(bst_run_reader_file(ctx, run->reader, s->sensor.file, path, sizeof path));
    BST_TRY(bst_fits_source_open(ctx, path, &header));
    bst_status status = bst_fits_source_select(ctx, header, index, &place);
    *gain = status == BST_OK ? keyword(header, "GAIN") : NAN;
    *offset = status == BST_OK ? keyword(header, "OFFSET") : NAN;
    bst_fits_source_close(header);
    if (status == BST_OK && !(*gain > 0.0 && isfinite(*offset))) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: frame %lld has no GAIN and OFFSET", path,
                        (long long)index);
    }
    return status;
}

static bst_status sum_planes(bst_ctx *ctx, const bst_view_run *run, const bst_view_sensor *s,
                             int64_t index, float **sum, bst_fits_source_frame *size) {
    char path[4096];
    float *room = NULL;
    bst_status status = BST_OK;
    for (int i = 0; i < PLANES && status == BST_OK; i++) {
        if (path_of(run, s, i, path, sizeof path)) {
            status = add_plane(ctx, path, index, sum, &room, size);
        }
    }
    free(room);
    return status == BST_OK && !*sum
               ? bst_fail(ctx, BST_ERR_NOT_FOUND,
                          "the run has no noise-free planes; record them with "
                          "/record/planes=[\"stars\", \"targets\", \"background\"]")
               : status;
}

/* Writes the part that is asked for, in digital numbers. sum: [height][width], electrons. */
static bst_status write_part(bst_ctx *ctx, bst_view_exchange *x, const float *sum,
                             const bst_fits_source_frame *size, double gain, double offset) {
    const size_t pixels = (size_t)size->width * (size_t)size->height;
    BST_TRY(bst_view_begin_part(ctx, &x->part, size->width, size->height, &x->bytes));
    uint16_t *whole = malloc(pixels * sizeof *whole);
    for (size_t i = 0; whole && i < pixels; i++) {
        double dn = (double)sum[i] / gain + offset;
        whole[i] = (uint16_t)(dn > 0.0 ? fmin(dn + 0.5, 65535.0) : 0.0);
    }
    bool done = whole && bst_view_bin_part(whole, (size_t)size->width, &x->part, x->bytes.data);
    free(whole);
    return done ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame");
}

static bst_status answer(bst_ctx *ctx, bst_view_run *run, bst_view_exchange *x) {
    bst_view_sensor *s;
    bst_fits_source_frame size = {.width = 0};
    double gain, offset;
    float *sum = NULL;
    BST_TRY(bst_view_find_sensor(ctx, run, x->sensor, &s));
    if (x->frame >= (int64_t)s->count || s->exposures[x->frame].fits_index < 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "frame %lld is not kept", (long long)x->frame);
    }
    const int64_t index = s->exposures[x->frame].fits_index;
    bst_status status = sum_planes(ctx, run, s, index, &sum, &size);
    status = status == BST_OK ? read_calibration(ctx, run, s, index, &gain, &offset) : status;
    if (status == BST_OK) {
        status = write_part(ctx, x, sum, &size, gain, offset);
    }
    free(sum);
    return status;
}

bst_status bst_view_route_noise_free(bst_ctx *ctx, bst_view_exchange *x) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? answer(ctx, run, x) : status;
    bst_view_unlock(run);
    return status;
}
